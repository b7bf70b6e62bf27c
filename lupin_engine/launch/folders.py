"""Where runs and crashes leave their files: the user's state folder, or a temporary one."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from lupin_engine.errors import UsageError

#: What is kept of earlier runs and crashes; the oldest go first.
KEPT_RUNS = KEPT_CRASHES = 20


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
    """Make the folder for the logs of one run: the given one, else a fresh one named by time and process.

    Raises:
        UsageError: the given one cannot be made, or written to.
    """
    if given is not None:
        return _writable(given)
    runs = state_folder("runs")
    make_room(runs, KEPT_RUNS)
    folder = runs / name_of_now()
    folder.mkdir()
    return folder


def _writable(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise UsageError(f"no logs can be written to {str(folder)!r}: {problem.strerror}") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UsageError(f"no logs can be written to {str(folder)!r}: it is not writable")
    return folder.resolve()


def name_of_now() -> str:
    """Return what this process calls what it leaves now; such names sort by age."""
    return f"{time.strftime('%Y-%m-%d_%H-%M-%S')}_{os.getpid()}"


def make_room(folder: Path, kept: int) -> None:
    """Remove the oldest of what processes have left in a folder, so that with one more `kept` are there.

    What belongs to a process that still runs stays: nodes that were brought up last week write there.
    """
    left = sorted(entry for entry in folder.iterdir() if not _is_in_use(entry))
    for entry in left[: max(0, len(left) - kept + 1)]:
        if entry.is_dir():
            shutil.rmtree(entry, ignore_errors=True)
        else:
            entry.unlink(missing_ok=True)


def _is_in_use(entry: Path) -> bool:
    process = entry.stem.rpartition("_")[2]
    if not entry.is_dir() or not process.isdecimal():
        return False
    try:
        os.kill(int(process), 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True  # of another user
    return True
