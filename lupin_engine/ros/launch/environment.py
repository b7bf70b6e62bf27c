"""The environment that a run's processes start with."""

from __future__ import annotations

import os
from pathlib import Path

from lupin_engine.errors import UsageError
from lupin_engine.plugin.files import ros_domain
from lupin_engine.ros.adapter import environment

DOMAIN = "ROS_DOMAIN_ID"
RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
#: Ports of higher domains collide with those that Linux hands out to anybody.
HIGHEST_DOMAIN = 101
#: What a discovery range may be, where nodes are to find each other.
RANGES = ("SUBNET", "LOCALHOST", "SYSTEM_DEFAULT")


def close_the_doors(domain: int | None = None) -> None:
    """Set the DDS network of this process and its children: this machine only, unless asked otherwise.

    Raises:
        UsageError: the shell has set variables of ROS with which nodes would not find each other.
    """
    if not os.environ.get(RANGE):  # also to ROS an empty one is none
        os.environ[RANGE] = "LOCALHOST"
    if domain is not None:
        os.environ[DOMAIN] = str(domain)
    advice = {DOMAIN: domain_advice(), RANGE: range_advice()}
    problems = [f"{name} is {os.environ[name]!r}: {text}" for name, text in advice.items() if text]
    if problems:
        raise UsageError("\n".join(problems))


def domain_advice() -> str:
    """Say what to do about the domain that the shell has set; '' where nothing is wrong with it."""
    text = os.environ.get(DOMAIN, "").strip()
    fits = text.isascii() and text.isdecimal() and int(text) <= HIGHEST_DOMAIN
    return "" if fits or not text else f"use a number from 0 to {HIGHEST_DOMAIN}"


def range_advice() -> str:
    """Say what to do about the discovery range that the shell has set; '' where nothing is wrong with it."""
    text = os.environ.get(RANGE, "")
    if text == "OFF":
        return "nodes do not find each other: unset it"
    return "" if not text or text in RANGES else f"use one of {', '.join(RANGES)}, or unset it"


def current_domain() -> int:
    """Return the ROS domain of this process."""
    return ros_domain()


def is_local_only() -> bool:
    """Say whether nobody outside this machine can be discovered."""
    return os.environ.get(RANGE) == "LOCALHOST"


def for_children(folder: Path) -> dict[str, str]:
    """Return the environment for the nodes of a run; ROS writes its own logs into `folder` too."""
    complete = environment.child_environment()
    complete.setdefault("ROS_LOG_DIR", str(folder / "ros"))
    # Without it a node's output reaches its log file by the kilobyte, too late to say why it died.
    complete["PYTHONUNBUFFERED"] = "1"
    complete["RCUTILS_COLORIZED_OUTPUT"] = "0"
    return complete
