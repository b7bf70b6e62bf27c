"""Gives the frames of all messages that a node sends a prefix, and takes it off those that it hears.

So several robots can share /tf: within a node a frame is `map`, on the network it is `robot2/map`. Answers of
our own services have no frames.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

#: The parameter that every node has, as robot_state_publisher's; with its slash, such as `robot2/`.
FRAME_PREFIX = "frame_prefix"
_FRAMES = ("frame_id", "child_frame_id")


class FramePrefix:
    """The prefix of one node; '' changes nothing. A message is changed in place, and only once."""

    def __init__(self, prefix: str) -> None:
        self._prefix = prefix

    def outgoing(self, message: Any) -> Any:
        """Return a message with the prefix before each frame that is not empty and has none."""
        return _renamed(message, self._added) if self._prefix else message

    def incoming(self, message: Any) -> Any:
        """Return a message without the prefix; frames of others keep theirs."""
        return _renamed(message, self._removed) if self._prefix else message

    def _added(self, frame: str) -> str:
        return frame if not frame or frame.startswith(self._prefix) else self._prefix + frame.lstrip("/")

    def _removed(self, frame: str) -> str:
        return frame.lstrip("/").removeprefix(self._prefix)


def _renamed(message: Any, rename: Callable[[str], str]) -> Any:
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        if name in _FRAMES:
            setattr(message, name, rename(value))
        elif hasattr(value, "get_fields_and_field_types"):
            _renamed(value, rename)
        elif isinstance(value, list) and value and hasattr(value[0], "get_fields_and_field_types"):
            for each in value:
                _renamed(each, rename)
    return message
