"""Quality-of-service profiles of topics and services, and limits on the size of messages.

The profiles are declared once, so that two ends cannot disagree: a TRANSIENT_LOCAL subscriber never matches a
VOLATILE publisher, and nothing reports it.

Deserialising a message blocks the thread that a stop needs: rclpy makes Python objects of all of it. That
takes about 20 us for each message or text in a list, and 0.6 ms for a megabyte of numbers or of one text.
Lists and texts have no bound on the wire, so the bytes are counted first.
"""

from __future__ import annotations

import enum
import re
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import Any

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

#: The queue of a subscriber to any topic, in messages.
HEARD_DEPTH = 1000
#: Requests kept per service. The default of 10 is shared by all clients and loses the rest silently.
SERVICE_DEPTH = 1000
#: Of messages with a list of messages or texts, in bytes: 550 poses with their names, 10 ms.
OBJECT_BYTES = 49_152
#: Of messages with one text or with lists of numbers, in bytes: a map of 8 million cells, 5 ms.
FLAT_BYTES = 8_388_608

_NUMBER = re.compile(r"u?int\d+|float|double|boolean|octet|byte|char")


class Qos(enum.Enum):
    """Names of the profiles; `profile()` makes rclpy's."""

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
    """Return a profile of a subscriber that matches all publishers of a topic, with latched messages.

    It requests no more than every publisher offers, as a publisher that offers less is not matched. It is
    latched only if all are. `depth` is the length of the queue.
    """
    reliable = all(offer.reliability == ReliabilityPolicy.RELIABLE for offer in offered)
    latched = all(is_latched(offer) for offer in offered)
    return _profile(reliable, latched, depth)


def is_latched(profile: QoSProfile) -> bool:
    """Return whether late subscribers get messages that were published before."""
    return bool(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL)


def _profile(reliable: bool, latched: bool, depth: int) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def asks_more(asked: QoSProfile, wanted: QoSProfile) -> bool:
    """Return whether a subscriber requests more than it wants, and may not be matched for that."""
    reliable = ReliabilityPolicy.RELIABLE
    more_reliable = asked.reliability == reliable and wanted.reliability != reliable
    return bool(more_reliable) or (is_latched(asked) and not is_latched(wanted))


def offers_text(offered: Iterable[QoSProfile]) -> str:
    """Return the offered profiles as rosbag2 writes them: YAML, each once."""
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
    """Return the limit of a message type in bytes; None for one without lists and texts."""
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
