"""Noticing that files have changed, by looking."""

from __future__ import annotations

import hashlib
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
    stamps: dict[Path, tuple[int, int]] | None = None
    contents: dict[Path, bytes] | None = None
    while True:
        seen = _stamps(files())
        if seen != stamps:
            stamps = seen
            # A file that was saved as it was is not worth a word.
            found = _contents(seen)
            if found != contents:
                contents = found
                yield
        wait()


def _stamps(files: Iterable[Path]) -> dict[Path, tuple[int, int]]:
    found = {}
    for file in files:
        try:
            status = file.stat()
        except OSError:
            continue  # it went away just now
        found[file] = status.st_mtime_ns, status.st_size
    return found


def _contents(files: Iterable[Path]) -> dict[Path, bytes]:
    found = {}
    for file in files:
        try:
            found[file] = hashlib.sha256(file.read_bytes()).digest()
        except OSError:
            continue
    return found
