"""Chooses the middleware's DDS profile: this machine only, unless the user asks for the network.

`ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST` alone closes nothing: it limits whom we look for, while our sockets
still listen on every interface, and a stranger who looks for us is answered. So the profile lists 127.0.0.1
as the only interface, too.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from lupin_ros.adapter.environment import distribution

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
CLOSED = "LOCALHOST"
_OLD, _NEW = "FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"

#: Seconds after which Fast DDS forgets a participant that is silent, and between two words of one, where the
#: profile does not say.
LEASE_S, ANNOUNCEMENT_S = 20.0, 3.0

_FOLDER = Path(__file__).parent
THIS_MACHINE, OPEN = _FOLDER / "this_machine.xml", _FOLDER / "open.xml"


def close_the_range() -> None:
    """Set the discovery range of this process and its children to this machine, unless it is set."""
    if not os.environ.get(RANGE):  # also to ROS an empty one is none
        os.environ[RANGE] = CLOSED


def is_closed() -> bool:
    """Return whether the discovery range is this machine."""
    return os.environ.get(RANGE) in ("", None, CLOSED)


def variables() -> tuple[str, ...]:
    """Return the variables that the middleware reads, the one that counts first: Fast DDS 3 has renamed it.

    One that it does not read would leave the network open.
    """
    return {"jazzy": (_OLD,), "kilted": (_NEW, _OLD)}.get(distribution() or "jazzy", (_NEW,))


def users_profile() -> str:
    """Return the file that the user has named; '' where ours counts."""
    given = (os.environ.get(name, "") for name in variables())
    return next((file for file in given if file and Path(file) not in (THIS_MACHINE, OPEN)), "")


def use_profile() -> None:
    """Name our profile to the middleware, unless the user has named one.

    To be called before the first participant of a process: the middleware reads it once.
    """
    close_the_range()
    if not users_profile():
        os.environ[variables()[0]] = str(THIS_MACHINE if is_closed() else OPEN)


def forgotten_after() -> float:
    """Return the seconds that a process may stand still without being forgotten by others.

    That is the lease without one and a half periods of its announcements: the last one was up to a period
    before, and on a busy computer it was late.
    """
    lease, announcement = LEASE_S, ANNOUNCEMENT_S
    # What cannot be read Fast DDS ignores, too.
    with contextlib.suppress(OSError, KeyError, ValueError, ElementTree.ParseError):
        profile = ElementTree.parse(users_profile() or os.environ[variables()[0]])
        lease = _seconds(profile, "leaseDuration", lease)
        announcement = _seconds(profile, "leaseAnnouncement", announcement)
    return max(lease - 1.5 * announcement, 0.5 * lease)


def _seconds(profile: ElementTree.ElementTree[Any], name: str, default: float) -> float:
    """Return the first duration of a name in a profile; one that is infinite is."""
    found = profile.find(f".//{{*}}{name}")
    if found is None:
        return default
    if "INFINIT" in "".join(found.itertext()):
        return float("inf")
    return float(found.findtext("{*}sec", "0")) + 1e-9 * float(found.findtext("{*}nanosec", "0"))
