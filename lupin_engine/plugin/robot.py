"""The robot of this process: a ROS namespace, so that several robots share a domain."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping

from lupin_engine.errors import UsageError
from lupin_engine.plugin.files import ros_domain

ROBOT = "LUPIN_ROBOT"
ADVICE = "use words of ASCII letters, digits and _ that begin with no digit, joined by /, such as robot2"
#: Names that the robots of a domain share: those that ROS itself makes absolute.
COMMON_NAMES = ("/clock", "/parameter_events", "/rosout")
#: ROS allows 245 letters of a namespace, and 255 of a whole name.
_NAMESPACE = re.compile(r"/?([A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)")
_LONGEST = 100


class CommonName(str):
    """A full name of ROS that follows no namespace: all robots share it, or the network has it already."""

    __slots__ = ()


def read_robot(text: str, said: str = "--robot") -> str:
    """Return the namespace of a robot, such as `/robot2` for `robot2`; `said` is where the text stands.

    Raises:
        UsageError: it is none.
    """
    found = _NAMESPACE.fullmatch(text)
    if found is None or len(text) > _LONGEST:
        raise UsageError(f"{said} {text!r} is no ROS namespace: {ADVICE}")
    return f"/{found[1]}"


def robot_namespace(environment: Mapping[str, str] = os.environ) -> str:
    """Return the namespace of this process's robot; '' where none is set.

    Raises:
        UsageError: the variable is no namespace.
    """
    text = environment.get(ROBOT, "")
    return read_robot(text, ROBOT) if text else ""


def name_of(robot: str, name: str) -> str:
    """Return the full name of a topic, service or action of a robot, in its namespace.

    `COMMON_NAMES` and a `CommonName` have none, and private names (`~/`) get it from ROS.
    """
    keeps = name in COMMON_NAMES or isinstance(name, CommonName) or name.startswith("~")
    return name if keeps or not robot else CommonName(f"{robot}/{name.removeprefix('/')}")


def state_key(
    domain: int | None = None, robot: str | None = None, environment: Mapping[str, str] = os.environ
) -> str:
    """Return the words for files of a robot of a ROS domain: `7`, or `7-robot2` in namespace `/robot2`.

    Both are by default this process's.

    Raises:
        UsageError: the environment names none that exists.
    """
    number = ros_domain(environment) if domain is None else domain
    namespace = robot_namespace(environment) if robot is None else robot
    return f"{number}{namespace.replace('/', '-')}"
