"""Reads messages into records; pure. Unusable ones raise `Dropped` with the reason.

In an Observation a pose whose orientation has w = 0 is unset. Of a rotation only the yaw is kept, as a
quaternion (0, 0, z, w) of length 1, so that (z, w) give the same heading.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np

from lupin_engine.errors import LupinError, shortened
from lupin_engine.plugin import seconds_of
from lupin_greenhouse import frame_name, seen_rotation
from lupin_twin.field import OccupancyMap
from lupin_twin.records import (
    FARTHEST_M,
    Anomaly,
    Bloom,
    BoxOutline,
    Corners,
    Discovery,
    Flowers,
    Observed,
    Pin,
    Reading,
    is_near,
)

#: `Observation.kind` and `.status`; existing numbers never change.
TAG_READING, FLOWER, ANOMALY = 0, 1, 2
STATUS_OK, STATUSES = 0, range(4)

#: No tag and no sensor has a longer name; both are published with every state, and listed in answers.
LONGEST_NAME = 64

#: Length of (z, w) below which a rotation has no turn about the vertical to speak of.
SMALLEST_TURN = 1e-6


class Dropped(LupinError):
    """A message cannot be used; the text says why."""


def observed(message: Any, frame: str, now: float) -> Observed | None:
    """Return the record of an Observation; None where its status is not OK.

    Args:
        message: the Observation.
        frame: the frame that its poses must have; "" on the wire counts as that frame.
        now: seconds; the time of an observation without a stamp.

    Raises:
        Dropped: the frame, the kind, the status or the tag's id cannot be used.
    """
    reader = _READERS.get(message.kind)
    if reader is None:
        raise Dropped(f"observation of unknown kind {message.kind} dropped")
    if message.status not in STATUSES:
        raise Dropped(f"observation of unknown status {message.status} dropped")
    if message.status != STATUS_OK:
        return None
    origin = {
        "stamp": seconds_of(message.header.stamp) or now,
        "mission_id": message.mission_id,
        "source": message.source,
    }
    return reader(message, frame, origin)


def _reading(message: Any, frame: str, origin: dict[str, Any]) -> Reading:
    _check_frame(frame, "tag reading", message.header.frame_id)
    values = message.tag_reading
    return Reading(
        tag_id=_tag_id(values.tag_id, "tag reading"),
        readings=tuple((_sensor(one.name), float(one.value)) for one in values.readings if one.name),
        pin=pin_of(message.tag_pose_in_map),
        **origin,
    )


def _flowers(message: Any, frame: str, origin: dict[str, Any]) -> Flowers:
    flower = message.flower
    tag_id = _tag_id(flower.tag_id, "flower observation")
    _check_frame(frame, "flower observation", flower.pose.header.frame_id, message.header.frame_id)
    return Flowers(
        tag_id=tag_id,
        species=flower.species,
        confidence=_finite(flower.confidence),
        anomaly=bool(flower.anomaly),
        blooms=tuple(_bloom(point) for point in flower.flowers if _has_place(point.position)),
        footprint=_footprint(flower.box_footprint.points),
        pin=pin_of(flower.pose.pose),
        **origin,
    )


def _bloom(point: Any) -> Bloom:
    p = point.position
    place = float(p.x), float(p.y), float(p.z)
    return Bloom(*place, point.species, _finite(point.confidence), bool(point.anomaly))


def _footprint(points: Sequence[Any]) -> Corners:
    """Return the corners; none where one of them is not finite: the others would make another box."""
    corners = tuple((float(point.x), float(point.y)) for point in points)
    return corners if all(map(math.isfinite, chain.from_iterable(corners))) else ()


def _anomaly(message: Any, frame: str, origin: dict[str, Any]) -> Anomaly:
    report = message.anomaly
    _check_frame(frame, "anomaly report", report.pose.header.frame_id, message.header.frame_id)
    p = report.pose.pose.position
    if not _has_place(p):
        raise Dropped("anomaly report without a place dropped")
    return Anomaly(
        x=float(p.x),
        y=float(p.y),
        z=float(p.z),
        description=report.description,
        severity=int(report.severity),
        **origin,
    )


_READERS: Mapping[int, Callable[[Any, str, dict[str, Any]], Observed]] = {
    TAG_READING: _reading,
    FLOWER: _flowers,
    ANOMALY: _anomaly,
}


def discoveries(message: Any, frame: str) -> list[Discovery]:
    """Return the tags of a DiscoveredTags message that have an id and a position.

    Raises:
        Dropped: they are in another frame.
    """
    _check_frame(frame, "discovered tags", message.header.frame_id)
    named = ((tag, tag.tag_id.strip()) for tag in message.tags if len(tag.tag_id) <= LONGEST_NAME)
    found = (_discovery(tag, tag_id) for tag, tag_id in named if tag_id)
    return [discovery for discovery in found if discovery is not None]


def _discovery(tag: Any, tag_id: str) -> Discovery | None:
    pin = _seen_pin(tag.pose_in_map)
    if pin is None:
        return None
    confidence = _finite(tag.species_confidence)
    return Discovery(tag_id, pin, int(tag.sightings), tag.species, confidence, bool(tag.anomaly))


def boxes(text: str) -> list[BoxOutline]:
    """Return the planter boxes of a geometry message: JSON, a list or an object with `boxes`.

    Each has `id` (or `box_id`) of its tag, centre `x`, `y`, direction `yaw` of its outward normal n, `width`
    across and `depth` along n. With l = n turned by +90° the corners are c ± n·depth/2 ± l·width/2.

    Raises:
        Dropped: the text is something else.
    """
    try:
        given = json.loads(text)
        entries = given["boxes"] if isinstance(given, Mapping) else given
        return [_box(entry) for entry in entries]
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise Dropped(f"box geometry dropped: {type(error).__name__}: {shortened(str(error), 100)}") from None


def _box(entry: Mapping[str, Any]) -> BoxOutline:
    tag_id = _name(str(entry["id"] if "id" in entry else entry["box_id"]).strip(), "box geometry")
    tag_id.encode()  # JSON can tell half a letter, which no message could publish
    names = ("x", "y", "yaw", "width", "depth")
    x, y, yaw, width, depth = numbers = [float(entry[name]) for name in names]
    if not (tag_id and is_near(x, y) and all(abs(number) <= FARTHEST_M for number in numbers)):
        raise ValueError(f"box {shortened(tag_id)!r} has no id, or no place and size in this greenhouse")
    ahead, aside = max(0.0, depth) / 2.0, max(0.0, width) / 2.0
    nx, ny = math.cos(yaw), math.sin(yaw)

    def corner(n: float, l: float) -> tuple[float, float]:  # noqa: E741  the letters of the formula
        return x + nx * n - ny * l, y + ny * n + nx * l

    sides = ((ahead, aside), (ahead, -aside), (-ahead, -aside), (-ahead, aside))
    return BoxOutline(tag_id, tuple(corner(n, l) for n, l in sides))  # noqa: E741


def occupancy(message: Any, frame: str) -> OccupancyMap:
    """Return an OccupancyGrid message as a map.

    Raises:
        Dropped: the frame is another one, or the sizes do not match.
    """
    _check_frame(frame, "map", message.header.frame_id)
    info, cells = message.info, np.frombuffer(message.data, dtype=np.int8)
    size = info.width, info.height
    if min(size) < 1 or size[0] * size[1] != cells.size or not 0.0 < info.resolution < math.inf:
        given = f"{size[0]} x {size[1]} cells of {info.resolution:g} m, {cells.size} told"
        raise Dropped(f"map dropped: {given}")
    origin = _seen_pin(info.origin)
    if origin is None:
        raise Dropped("map dropped: it has no finite origin")
    yaw = 2.0 * math.atan2(origin.z, origin.w)
    return OccupancyMap(origin.x, origin.y, yaw, float(info.resolution), cells.reshape(size[1], size[0]))


def pin_of(pose: Any) -> Pin | None:
    """Return a tag's position and heading; None for an unset pose."""
    return _seen_pin(pose) if pose.orientation.w != 0.0 else None


def _seen_pin(pose: Any) -> Pin | None:
    """Return position and yaw, the identity where there is no yaw; None where numbers are not finite."""
    p, turn = pose.position, seen_rotation(pose.orientation)
    if turn is None or not all(map(math.isfinite, (p.x, p.y))):
        return None
    _, _, z, w = turn
    length = math.hypot(z, w)
    z, w = (z / length, w / length) if length > SMALLEST_TURN else (0.0, 1.0)
    return Pin(float(p.x), float(p.y), z, w)


def _tag_id(tag_id: str, what: str) -> str:
    if not tag_id.strip():
        raise Dropped(f"{what} without a tag id dropped")
    return _name(tag_id.strip(), what)


def _sensor(name: str) -> str:
    return _name(name, "reading of a sensor")


def _name(name: str, what: str) -> str:
    if len(name) > LONGEST_NAME:
        raise Dropped(f"{what} dropped: a name of {len(name)} letters, at most {LONGEST_NAME} are one")
    return name


def _check_frame(expected: str, what: str, *frames: str) -> None:
    """Raise Dropped where the first frame that is given is not the expected one; without any it is."""
    frame = frame_name(next((name for name in frames if name), expected))
    if frame != expected:
        raise Dropped(f"{what} in frame {shortened(frame)!r} dropped, expected {expected!r}")


def _has_place(position: Any) -> bool:
    return all(map(math.isfinite, (position.x, position.y, position.z)))


def _finite(confidence: float) -> float:
    return float(confidence) if math.isfinite(confidence) else 0.0
