"""A file that is there while something is to be put right again, in case the process is killed meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from lupin_engine.plugin.files import write_atomically
from lupin_engine.ros.adapter.node import RosNode


class RestoreMarker:
    """The file at `path`, and what an earlier process has left there; a full disk keeps nobody from work."""

    def __init__(self, ros: RosNode, path: Path) -> None:
        self._ros = ros
        self._path = path
        #: Whether something was left as it should not be, by this process or by one before.
        self.left_behind = path.exists()

    def set(self, text: str = "") -> None:
        """Leave the mark, with what is needed to put things right."""
        self._attempt(partial(self._path.parent.mkdir, parents=True, exist_ok=True))
        self._attempt(partial(write_atomically, self._path, text.encode()))

    def text(self) -> str:
        """Return what was left with the mark, "" where nothing was or it cannot be read."""
        try:
            return self._path.read_text(encoding="utf-8")
        except (OSError, ValueError):
            return ""

    def leave(self) -> None:
        """Say that it could not be put right: the mark stays."""
        self.left_behind = True

    def remove(self) -> None:
        """Take the mark away."""
        self.left_behind = False
        self._attempt(partial(self._path.unlink, missing_ok=True))

    def _attempt(self, change: Callable[[], object]) -> None:
        try:
            change()
        except OSError as error:
            self._ros.log.warning(f"{self._path} cannot be changed: {error.strerror}")
