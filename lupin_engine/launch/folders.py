"""Where runs and crashes leave their files: the user's state folder, or a temporary one."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

#: Folders of earlier runs that are kept; the oldest go first.
KEPT_RUNS = 20


def state_folder(name: str) -> Path:
    """Return (and make) the folder `name` among this program's state; a temporary one if that cannot be."""
    for base in _bases():
        folder = base / "lupin" / name
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return Path(tempfile.mkdtemp(prefix=f"lupin-{name}-"))


def _bases() -> Iterator[Path]:
    given = os.environ.get("XDG_STATE_HOME")
    if given and Path(given).is_absolute():  # the specification says that relative ones are ignored
        yield Path(given)
    try:
        yield Path.home() / ".local" / "state"
    except RuntimeError:
        return  # no home, for example an unknown user id in a container


def new_run_folder(given: Path | None = None) -> Path:
    """Make the folder for the logs of one run: the given one, else a fresh one named by time and process."""
    if given is not None:
        given.mkdir(parents=True, exist_ok=True)
        return given.resolve()
    runs = state_folder("runs")
    _prune(runs)
    folder = runs / f"{time.strftime('%Y-%m-%d_%H-%M-%S')}_{os.getpid()}"
    folder.mkdir()
    return folder


def _prune(runs: Path) -> None:
    """Remove all but the newest runs. Their names begin with the time, so they sort by age."""
    folders = sorted(folder for folder in runs.iterdir() if folder.is_dir())
    for folder in folders[: max(0, len(folders) - KEPT_RUNS + 1)]:
        shutil.rmtree(folder, ignore_errors=True)
