"""Noticing that files have changed, by looking."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

#: How often the files are looked at, in seconds.
PAUSE_S = 0.3


def changes(files: Callable[[], Iterable[Path]], wait: Callable[[], None]) -> Iterator[None]:
    """Yield at once, and again whenever what the files say has become something else.

    Args:
        files: the files to look at, asked every time: some may be new, some gone.
        wait: called between two looks.
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
