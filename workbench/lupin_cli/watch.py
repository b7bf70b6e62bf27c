"""Detects changes of files by polling."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

#: How often the files are looked at, in seconds.
PAUSE_S = 0.3


def changes(files: Callable[[], Iterable[Path]], wait: Callable[[], None]) -> Iterator[None]:
    """Yield at once, and again whenever the contents of the files have changed, without end.

    A file that cannot be read counts as absent.

    Args:
        files: returns the files, called every time: some may be new or removed.
        wait: called between two polls.
    """
    contents: dict[Path, bytes] | None = None
    while True:
        found = _contents(files())
        if found != contents:
            contents = found
            yield
        wait()


def _contents(files: Iterable[Path]) -> dict[Path, bytes]:
    found = {}
    for file in files:
        with contextlib.suppress(OSError):  # it went away just now
            found[file] = file.read_bytes()
    return found
