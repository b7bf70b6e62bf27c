"""The environment that a run's processes start with."""

from __future__ import annotations

import os
from pathlib import Path

from lupin_engine.middleware import environment

DOMAIN = "ROS_DOMAIN_ID"
RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
#: Ports of higher domains collide with those that Linux hands out to anybody.
HIGHEST_DOMAIN = 101


def close_the_doors(domain: int | None = None) -> None:
    """Set this process', and so its children's, network: nobody outside this machine unless asked for."""
    if not os.environ.get(RANGE):  # also to ROS an empty one is none
        os.environ[RANGE] = "LOCALHOST"
    if domain is not None:
        os.environ[DOMAIN] = str(domain)


def current_domain() -> int:
    """Return the ROS domain of this process."""
    text = os.environ.get(DOMAIN, "").strip()
    return int(text) if text.isdecimal() else 0


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
