"""How topics travel: the quality-of-service profiles, and how large a message may be.

The profiles are declared once, so that two ends cannot disagree.

A TRANSIENT_LOCAL subscriber never matches a VOLATILE publisher, and says nothing about it; that is why a
topic is created with one of these names and never with a profile of its own.

Reading a message holds the thread on which a stop waits for its turn: rclpy makes Python objects of all of it
before anybody can look. That takes about 20 us for each message or text in a list, and 0.6 ms for a megabyte
of numbers or of one text. Lists and texts have no bound on the wire, so the bytes are counted first.
"""

from __future__ import annotations

import enum
import re
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import Any

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

#: Messages kept for who listens to whatever there is, until it takes them.
HEARD_DEPTH = 1000
#: Requests kept per service. The default of 10 is shared by all clients and loses the rest silently.
SERVICE_DEPTH = 1000
#: Of messages with a list of messages or texts, in bytes: 550 poses with their names, 10 ms.
OBJECT_BYTES = 49_152
#: Of messages with one text or with lists of numbers, in bytes: a map of 8 million cells, 5 ms.
FLAT_BYTES = 8_388_608

_NUMBER = re.compile(r"u?int\d+|float|double|boolean|octet|byte|char")


class Qos(enum.Enum):
    """Names of the profiles; `profile()` is what rclpy wants."""

    LATCHED = "latched"  #: reliable, transient local, depth 1: a state that late joiners must see
    BACKLOG = "backlog"  #: reliable, transient local, depth 50: observations
    EVENT = "event"  #: reliable, volatile, depth 10: a button, a charge
    DETECTION = "detection"  #: reliable, volatile, depth 5: detections, joint states
    SENSOR = "sensor"  #: best effort, volatile, depth 5: camera images
    TRANSFORMS = "transforms"  #: reliable, volatile, depth 100: /tf, many small messages of many publishers
    STATIC_TRANSFORMS = "static transforms"  #: reliable, transient local, depth 100: /tf_static
    SERVICES = "services"  #: reliable, volatile, depth 1000: service requests and answers

    def profile(self) -> QoSProfile:
        """Return a fresh rclpy profile."""
        return _profile(*_PROFILES[self])


#: profile -> (reliable, transient local, depth)
_PROFILES = {
    Qos.LATCHED: (True, True, 1),
    Qos.BACKLOG: (True, True, 50),
    Qos.EVENT: (True, False, 10),
    Qos.DETECTION: (True, False, 5),
    Qos.SENSOR: (False, False, 5),
    Qos.TRANSFORMS: (True, False, 100),
    Qos.STATIC_TRANSFORMS: (True, True, 100),
    Qos.SERVICES: (True, False, SERVICE_DEPTH),
}


def heard_profile(offered: Sequence[QoSProfile], depth: int = HEARD_DEPTH) -> QoSProfile:
    """Return the profile with which a subscriber hears all publishers of a topic, and what they keep.

    It asks for what every one of them offers: one that asks for more is not matched. `depth` is how many
    messages are kept until they are taken.
    """
    reliable = all(offer.reliability == ReliabilityPolicy.RELIABLE for offer in offered)
    latched = all(is_latched(offer) for offer in offered)
    return _profile(reliable, latched, depth)


def is_latched(profile: QoSProfile) -> bool:
    """Say whether late subscribers get what was published before."""
    return bool(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL)


def _profile(reliable: bool, latched: bool, depth: int) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def asks_more(asked: QoSProfile, wanted: QoSProfile) -> bool:
    """Say whether a subscriber asks for more than it wants, and may not be matched for that."""
    reliable = ReliabilityPolicy.RELIABLE
    more_reliable = asked.reliability == reliable and wanted.reliability != reliable
    return bool(more_reliable) or (is_latched(asked) and not is_latched(wanted))


def offers_text(offered: Iterable[QoSProfile]) -> str:
    """Return what publishers offer as rosbag2 writes it down: YAML, each once."""
    return "\n".join(dict.fromkeys(_offer_text(profile) for profile in offered))


def _offer_text(profile: QoSProfile) -> str:
    return "\n".join(
        (
            f"- history: {profile.history.name.lower()}",
            f"  depth: {profile.depth}",
            f"  reliability: {profile.reliability.name.lower()}",
            f"  durability: {profile.durability.name.lower()}",
            f"  deadline:\n{_span_text(profile.deadline)}",
            f"  lifespan:\n{_span_text(profile.lifespan)}",
            f"  liveliness: {profile.liveliness.name.lower()}",
            f"  liveliness_lease_duration:\n{_span_text(profile.liveliness_lease_duration)}",
            "  avoid_ros_namespace_conventions: false",
        )
    )


def _span_text(span: Duration) -> str:
    seconds, nanoseconds = divmod(span.nanoseconds, 1_000_000_000)
    return f"    sec: {seconds}\n    nsec: {nanoseconds}"


@cache
def most_bytes(kind: Any) -> int | None:
    """Return how many bytes a message of a kind may have; None for one that has no list and no text."""
    elements = list(_unbounded(kind()))
    if not elements:
        return None
    return FLAT_BYTES if all(map(_NUMBER.fullmatch, filter(None, elements))) else OBJECT_BYTES


def _unbounded(message: Any) -> Iterator[str]:
    """Yield the type of the elements of each list in a message, and '' for each text."""
    for name, declared in message.get_fields_and_field_types().items():
        if declared.startswith("sequence<"):
            yield declared.removeprefix("sequence<").partition(">")[0].partition(",")[0]
        elif declared in ("string", "wstring"):
            yield ""
        elif hasattr(value := getattr(message, name), "get_fields_and_field_types"):
            yield from _unbounded(value)
