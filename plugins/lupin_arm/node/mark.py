"""A marker file that exists while something must be restored, so that a crash does not lose it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from lupin_engine.plugin import write_atomically
from lupin_ros.adapter import RosNode


class RestoreMarker:
    """The file at `path`, perhaps left by an earlier process. Failing to write it is logged, no error."""

    def __init__(self, ros: RosNode, path: Path) -> None:
        self._ros = ros
        self._path = path
        #: Whether something was left as it should not be, by this process or by one before.
        self.left_behind = path.exists()

    def set(self, text: str = "") -> None:
        """Write the file, with the data that the restoration needs."""
        self._attempt(partial(self._path.parent.mkdir, parents=True, exist_ok=True))
        self._attempt(partial(write_atomically, self._path, text.encode()))

    def text(self) -> str:
        """Return the data of the file; "" where there is none or it cannot be read."""
        try:
            return self._path.read_text(encoding="utf-8")
        except (OSError, ValueError):
            return ""

    def leave(self) -> None:
        """Record that the restoration failed: the file stays."""
        self.left_behind = True

    def remove(self) -> None:
        """Remove the file."""
        self.left_behind = False
        self._attempt(partial(self._path.unlink, missing_ok=True))

    def _attempt(self, change: Callable[[], object]) -> None:
        try:
            change()
        except OSError as error:
            self._ros.log.warning(f"{self._path} cannot be changed: {error.strerror}")
