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

    def reading(self, decode: Callable[[bytes], dict[str, Any]]) -> Callable[[bytes], dict[str, Any]]:
        """Return a decoder of messages as plain data that takes the prefix off."""
        return (lambda data: _plain(decode(data), self._removed)) if self._prefix else decode

    def _added(self, frame: str) -> str:
        return frame if not frame or frame.startswith(self._prefix) else self._prefix + frame.lstrip("/")

    def _removed(self, frame: str) -> str:
        return frame.lstrip("/").removeprefix(self._prefix)


def _plain(data: Any, rename: Callable[[str], str]) -> Any:
    if isinstance(data, dict):
        return {key: rename(one) if key in _FRAMES else _plain(one, rename) for key, one in data.items()}
    is_of_messages = isinstance(data, list) and data and isinstance(data[0], dict)
    return [_plain(one, rename) for one in data] if is_of_messages else data


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
