"""Classifies the operations that move the robot, as catalogs, bindings and settings declare them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from fnmatch import translate
from typing import Any

from lupin_engine.plugin import Access
from lupin_gateway import protocol

#: The service of an action that takes goals: a goal by another door.
_SEND_GOAL = "/_action/send_goal"


class MotionNames:
    """The operations that move the robot; every goal of an action counts as one."""

    def __init__(self, declared: Iterable[Access]) -> None:
        known = list(declared)
        self._velocities = any_of(name for access in known for name in access.velocities)
        self._motions = any_of(name for access in known for name in access.motions)

    def moved_by(self, operation: protocol.Operation | protocol.BadFrame) -> str:
        """Return the name by which an operation moves the robot; '' where it moves nothing."""
        match operation:
            case protocol.SendGoal(action=name):
                return absolute(name)
            case protocol.CallService(service=name) if self.called(name):
                return absolute(name)
            case protocol.PublishMessage(topic=name, message=message) if self.published(name, message):
                return absolute(name)
        return ""

    def called(self, service: str) -> bool:
        """Whether calling a service moves the robot."""
        return service.endswith(_SEND_GOAL) or bool(self._motions.fullmatch(absolute(service)))

    def published(self, topic: str, message: Any) -> bool:
        """Whether a message on a topic moves the robot; a velocity of zero stops it."""
        if self.is_velocity(topic):
            return not _is_still(message)
        return bool(self._motions.fullmatch(absolute(topic)))

    def is_velocity(self, topic: str) -> bool:
        """Whether messages of a topic are velocities."""
        return bool(self._velocities.fullmatch(absolute(topic)))


def any_of(names: Iterable[str]) -> re.Pattern[str]:
    """Return a pattern that matches any of the names; `*` in one matches any text."""
    return re.compile("|".join(translate(name) for name in names) or r"(?!)")


def absolute(name: str) -> str:
    """Return a name with its first slash."""
    return f"/{name.lstrip('/')}"


def _is_still(message: Any) -> bool:
    """Return whether every number of a message is zero, its header excepted; an empty one is all zeros."""
    if isinstance(message, Mapping):
        return all(_is_still(value) for name, value in message.items() if name != "header")
    return isinstance(message, (int, float)) and message == 0
