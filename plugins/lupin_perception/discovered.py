"""Reads a DiscoveredTags message to plain records; pure.

A tag without a finite position cannot be driven to, so it is left out until it has one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from lupin_greenhouse import numeric_key, seen_rotation

Record = Mapping[str, Any]


def records(message: Any) -> tuple[list[Record], list[str]]:
    """Return the tags that have a position, and the ids of the others.

    Each id comes once, with its last entry; numeric ids come first and by number, so that a mission without
    an order of its own does not visit 15 before 3.
    """
    placed: dict[str, Record] = {}
    others: dict[str, None] = {}
    for tag in message.tags:
        record = _record(tag) if tag.tag_id else None
        if record is not None:
            placed[tag.tag_id] = record
        else:
            others[tag.tag_id] = None
    return [placed[name] for name in sorted(placed, key=numeric_key)], list(others)


def _record(tag: Any) -> Record | None:
    """Return a tag as a record; None where its position or orientation is not finite."""
    place, turn = tag.pose_in_map.position, seen_rotation(tag.pose_in_map.orientation)
    if turn is None or not all(map(math.isfinite, (place.x, place.y))):
        return None
    confidence = float(tag.species_confidence)
    return {
        "id": tag.tag_id,
        "x": place.x,
        "y": place.y,
        "facing": dict(zip("xyzw", turn, strict=True)),
        "species": tag.species,
        "species_confidence": confidence if math.isfinite(confidence) else 0.0,
        "anomaly": bool(tag.anomaly),
        "sightings": int(tag.sightings),
    }
