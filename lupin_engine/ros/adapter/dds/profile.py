"""Which profile the middleware reads: this machine only, unless the user asks for the network.

`ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST` alone closes nothing: it limits whom we look for, while our sockets
still listen on every interface, and a stranger who looks for us is answered. So the profile lists 127.0.0.1
as the only interface, too.
"""

from __future__ import annotations

import os
from pathlib import Path

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
CLOSED = "LOCALHOST"
#: The variables that name a profile, the one that counts first.
VARIABLES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")

_FOLDER = Path(__file__).parent
THIS_MACHINE, OPEN = _FOLDER / "this_machine.xml", _FOLDER / "open.xml"


def close_the_range() -> None:
    """Let a process that was told nothing, and its children, look for nobody outside this machine."""
    if not os.environ.get(RANGE):  # also to ROS an empty one is none
        os.environ[RANGE] = CLOSED


def is_closed() -> bool:
    """Say whether only this machine was asked for."""
    return os.environ.get(RANGE) in ("", None, CLOSED)


def users_profile() -> str:
    """Return the file that the user has named; '' where ours counts."""
    given = (os.environ.get(name, "") for name in VARIABLES)
    return next((file for file in given if file and Path(file) not in (THIS_MACHINE, OPEN)), "")


def use_profile() -> None:
    """Name our profile to the middleware, unless the user has named one.

    To be called before the first participant of a process: the middleware reads it once.
    """
    close_the_range()
    if not users_profile():
        os.environ[VARIABLES[0]] = str(THIS_MACHINE if is_closed() else OPEN)
