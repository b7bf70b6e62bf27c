"""The environment variables of a run's processes: ROS domain, discovery range, logs."""

from __future__ import annotations

import os
from pathlib import Path

from lupin_engine.errors import Problems, UsageError
from lupin_engine.plugin import DOMAIN, robot_namespace, ros_domain
from lupin_ros.adapter import environment
from lupin_ros.adapter.dds.profile import CLOSED, RANGE, close_the_range, is_closed, users_profile

PEERS = "ROS_STATIC_PEERS"
RMW = "RMW_IMPLEMENTATION"
#: What a discovery range may be, where nodes are to find each other.
RANGES = ("SUBNET", CLOSED, "SYSTEM_DEFAULT")


def close_the_doors(domain: int | None = None) -> None:
    """Limit the DDS network of this process and its children to this machine, unless the shell opens it.

    Raises:
        UsageError: the shell has set variables of ROS with which nodes would not find each other.
    """
    close_the_range()
    if domain is not None:
        os.environ[DOMAIN] = str(domain)
    problems = Problems(UsageError)
    with problems.collecting():
        ros_domain()
    advice = {RANGE: range_advice(), PEERS: peers_advice()}
    problems.add(*(f"{name} is {os.environ[name]!r}: {text}" for name, text in advice.items() if text))
    with problems.collecting():
        robot_namespace()
    problems.raise_any()


def range_advice() -> str:
    """Return advice about the discovery range that the shell has set; '' where it is fine."""
    text = os.environ.get(RANGE, "")
    if text == "OFF":
        return "nodes do not find each other: unset it"
    return "" if not text or text in RANGES else f"use one of {', '.join(RANGES)}, or unset it"


def peers_advice() -> str:
    """Return advice about peers on other computers that the shell has set; '' where they are fine."""
    if not os.environ.get(PEERS) or not is_local_only():
        return ""
    return f"nodes stay on this machine: set {RANGE}=SUBNET to reach them, or unset it"


def open_to() -> str:
    """Return which other computers can reach and command the nodes of this machine, and why; '' for none."""
    theirs = users_profile()
    if theirs:
        return f"your DDS profile {theirs} is used instead of the engine's: it alone says who is let in"
    if not is_closed():
        asked = f"{RANGE}={os.environ[RANGE]}"
        return f"every computer of the network is let in, and may command the robot: {asked}"
    other = os.environ.get(RMW, "")
    if environment.rclpy_source() == "apt" and other not in ("", "rmw_fastrtps_cpp"):
        return f"the engine closes Fast DDS only, and this is {other}: docs/security.md says how to close it"
    return ""


def current_domain() -> int:
    """Return the ROS domain of this process; UsageError where its environment names none that exists."""
    return ros_domain()


def current_place() -> str:
    """Return the ROS domain of this process, with the namespace of its robot, for people."""
    robot = robot_namespace()
    return f"ROS domain {current_domain()}{robot and f', robot {robot}'}"


def is_local_only() -> bool:
    """Return whether nodes discover only those of this machine."""
    return is_closed() and not users_profile()


def for_children(folder: Path) -> dict[str, str]:
    """Return the environment for the nodes of a run; ROS writes its own logs into `folder` too."""
    complete = environment.child_environment()
    complete.setdefault("ROS_LOG_DIR", str(folder / "ros"))
    # Without it a node's output reaches its log file by the kilobyte, too late to say why it died.
    complete["PYTHONUNBUFFERED"] = "1"
    complete["RCUTILS_COLORIZED_OUTPUT"] = "0"
    return complete
