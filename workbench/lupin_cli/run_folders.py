"""Folders for the logs of runs and crashes: the user's state folder, or a temporary one."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

from lupin_engine.errors import UsageError
from lupin_engine.plugin import user_folder

#: How many earlier runs and crashes are kept; the oldest are removed first.
KEPT_RUNS = KEPT_CRASHES = 20


def state_folder(name: str) -> Path:
    """Return (and make) the folder `name` among this program's state; a temporary one if that cannot be."""
    for folder in (base / name for base in _bases()):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return Path(tempfile.mkdtemp(prefix=f"lupin-{name}-"))


def _bases() -> Iterator[Path]:
    """Yield the configured state folder, and the default one."""
    environments: tuple[Mapping[str, str], ...] = (os.environ, {})
    with contextlib.suppress(UsageError):  # no home, for example an unknown user id in a container
        for environment in environments:
            yield user_folder("XDG_STATE_HOME", ".local/state", environment)


def new_run_folder(given: Path | None = None) -> Path:
    """Make the folder for the logs of one run: the given one, else a fresh one named by time and process.

    Raises:
        UsageError: it cannot be made, or written to.
    """
    if given is not None:
        return writable(given)
    try:
        runs = state_folder("runs")
        make_room(runs, KEPT_RUNS)
        folder = runs / name_of_now()
        folder.mkdir()
    except OSError as problem:
        where = f" in {str(problem.filename)!r}" if problem.filename else ""
        reason = f"there is no room for the logs of a run{where}: {problem.strerror}"
        raise UsageError(f"{reason}; make some, or name a folder with --log-dir") from None
    return folder


def writable(folder: Path, what: str = "logs") -> Path:
    """Return a folder for `what`, made where it is missing.

    Raises:
        UsageError: it cannot be made, or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise UsageError(f"no {what} can be written to {str(folder)!r}: {problem.strerror}") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UsageError(f"no {what} can be written to {str(folder)!r}: it is not writable")
    return folder.resolve()


def name_of_now() -> str:
    """Return a name of time and process id for the files of this process; such names sort by age."""
    return f"{time.strftime('%Y-%m-%d_%H-%M-%S')}_{os.getpid()}"


def make_room(folder: Path, kept: int) -> None:
    """Remove the oldest entries of a folder, so that there are `kept` after one more is added.

    Entries of processes that still run stay: nodes that were brought up last week write there.
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
