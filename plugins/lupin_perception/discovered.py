"""The tags of a DiscoveredTags message as plain records; pure.

A pose whose orientation has w = 0 was never filled in, and what is not finite is no place: such a tag is
known by name only and cannot be driven to, so it is left out until it has a pose.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from lupin_greenhouse.layout import numeric_key

Record = Mapping[str, Any]


def records(message: Any) -> tuple[list[Record], list[str]]:
    """Return the tags that have a place, and the ids of the others.

    Each id comes once, as it was told last, and numeric ids come first and by number, so that whoever has no
    other order does not visit 15 before 3.
    """
    placed: dict[str, Record] = {}
    others: dict[str, None] = {}
    for tag in message.tags:
        if tag.tag_id and _is_placed(tag.pose_in_map):
            placed[tag.tag_id] = _record(tag)
        else:
            others[tag.tag_id] = None
    return [placed[name] for name in sorted(placed, key=numeric_key)], list(others)


def _is_placed(pose: Any) -> bool:
    p, q = pose.position, pose.orientation
    return q.w != 0.0 and all(map(math.isfinite, (p.x, p.y, q.x, q.y, q.z, q.w)))


def _record(tag: Any) -> Record:
    p, q = tag.pose_in_map.position, tag.pose_in_map.orientation
    length = math.hypot(q.x, q.y, q.z, q.w)
    confidence = float(tag.species_confidence)
    return {
        "id": tag.tag_id,
        "x": p.x,
        "y": p.y,
        "facing": {axis: getattr(q, axis) / length for axis in "xyzw"},
        "species": tag.species,
        "species_confidence": confidence if math.isfinite(confidence) else 0.0,
        "anomaly": bool(tag.anomaly),
        "sightings": int(tag.sightings),
    }
