"""Parses the detectors' JSON, and validates every field. Pure.

Tags: a list of `{"id": int, "corners": [[x, y], ...], "dist": metres}`, one message a frame; the distance is
0 where the camera is not calibrated. Flowers: a list of `{"class": int, "confidence": 0 to 1, "bbox_xyxy":
[x1, y1, x2, y2], "track_id": int or null, "class_name": text or null}`, boxes in pixels.

Invalid entries are dropped with a problem text, which names the kind of fault and none of the data, so that
a caller can log each text once.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from lupin_greenhouse import finite
from lupin_perception.boxes import PlanterBox, Size

#: The longest text, in characters, and the longest list that are read: a frame has some dozens of entries.
MAX_TEXT = 262_144
MAX_ENTRIES = 512
#: The largest tag id that is taken for one; the largest families have some thousands.
MAX_TAG_ID = 2**31 - 1

TAG_KEYS = frozenset({"id", "corners", "dist"})
FLOWER_KEYS = frozenset({"class", "confidence", "bbox_xyxy", "track_id", "class_name"})
BOX_KEYS = frozenset({"id", "box_id", "x", "y", "yaw", "width", "depth", "height"})

Entry = TypeVar("Entry")


@dataclass(frozen=True)
class TagSeen:
    """A tag in a frame: its id in decimal, and its distance in metres, infinite where it is not known."""

    id: str
    distance: float


@dataclass(frozen=True)
class Detection:
    """A detection: its class, its confidence (0 to 1), and its place in the image.

    `bearing` is the middle of its box, -1 at the image's left edge and +1 at its right edge.
    """

    name: str
    confidence: float
    bearing: float


@dataclass(frozen=True)
class UnreadableDetection:
    """The problem text of a dropped entry."""

    reason: str


def read_tags(text: str) -> tuple[list[TagSeen], list[str]]:
    """Return the tags of a frame, each id once (its nearest view), and the problems."""
    found, problems = _read(text, TAG_KEYS, _tag)
    nearest: dict[str, TagSeen] = {}
    for tag in found:
        if tag.id not in nearest or tag.distance < nearest[tag.id].distance:
            nearest[tag.id] = tag
    return list(nearest.values()), problems


def read_flowers(text: str, classes: Sequence[str], image_width: float) -> tuple[list[Detection], list[str]]:
    """Return the detections of a frame, and the problems; `image_width` in pixels."""
    return _read(text, FLOWER_KEYS, lambda entry: _flower(entry, classes, image_width))


def read_boxes(text: str) -> tuple[dict[str, PlanterBox], list[str]]:
    """Return the boxes of a list, or of an object's list `boxes`, by the id of their tag, and the problems.

    An entry has the centre (m), the heading of the outward normal (rad) and the size (m): `{"id" or
    "box_id", "x", "y", "yaw", "width", "depth", "height"}`.
    """
    found, problems = _read(text, BOX_KEYS, _box, "boxes")
    return dict(found), problems


def _box(entry: Mapping[str, Any]) -> tuple[str, PlanterBox] | UnreadableDetection:
    tag_id = entry.get("id", entry.get("box_id"))
    numbers = [finite(entry.get(name)) for name in ("x", "y", "yaw", "width", "depth")]
    x, y, yaw, width, depth = (math.nan if number is None else number for number in numbers)
    if not isinstance(tag_id, (str, int)) or None in numbers:
        return UnreadableDetection(
            "a box has no id, or x, y, yaw, width and depth are not all finite numbers"
        )
    if width <= 0.0 or depth <= 0.0:
        return UnreadableDetection("a box has no area")
    normal = np.array((math.cos(yaw), math.sin(yaw)))
    return str(tag_id), PlanterBox(np.array((x, y)) + normal * depth / 2.0, normal, Size(width, depth))


def _read(
    text: str,
    keys: frozenset[str],
    read: Callable[[Mapping[str, Any]], Entry | UnreadableDetection],
    within: str = "",
) -> tuple[list[Entry], list[str]]:
    entries = _entries(text, within)
    if isinstance(entries, UnreadableDetection):
        return [], [entries.reason]
    results = [
        read(e) if isinstance(e, Mapping) else UnreadableDetection("an entry is no object") for e in entries
    ]
    found = [result for result in results if not isinstance(result, UnreadableDetection)]
    problems = [result.reason for result in results if isinstance(result, UnreadableDetection)]
    if any(isinstance(entry, Mapping) and not keys >= entry.keys() for entry in entries):
        problems.append(f"keys besides {', '.join(sorted(keys))} are ignored")
    return found, list(dict.fromkeys(problems))


def _entries(text: str, within: str) -> list[Any] | UnreadableDetection:
    if len(text) > MAX_TEXT:
        return UnreadableDetection(f"more than {MAX_TEXT} characters")
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        return UnreadableDetection("no JSON")
    if within and isinstance(data, Mapping):
        data = data.get(within)
    if not isinstance(data, list):
        return UnreadableDetection("no list")
    return data if len(data) <= MAX_ENTRIES else UnreadableDetection(f"more than {MAX_ENTRIES} entries")


def _tag(entry: Mapping[str, Any]) -> TagSeen | UnreadableDetection:
    number = _tag_id(entry.get("id"))
    distance = finite(entry.get("dist", 0.0))
    if number is None:
        return UnreadableDetection(f"an id is no whole number from 0 to {MAX_TAG_ID}")
    if distance is None:
        return UnreadableDetection("a dist is no finite number")
    return TagSeen(str(number), distance if distance > 0.0 else math.inf)


def _tag_id(value: Any) -> int | None:
    if isinstance(value, str) and len(value) <= 10 and value.isascii() and value.isdecimal():
        value = int(value)
    whole = isinstance(value, int) and not isinstance(value, bool)
    return value if whole and 0 <= value <= MAX_TAG_ID else None


def _flower(
    entry: Mapping[str, Any], classes: Sequence[str], width: float
) -> Detection | UnreadableDetection:
    name = _class_name(entry, classes)
    confidence = finite(entry.get("confidence"))
    bearing = _bearing(entry.get("bbox_xyxy"), width)
    if name is None:
        return UnreadableDetection(f"a class is none of {', '.join(classes)}")
    if confidence is None or not 0.0 <= confidence <= 1.0:
        return UnreadableDetection("a confidence is no number from 0 to 1")
    if bearing is None:
        return UnreadableDetection("a bbox_xyxy is not four finite numbers")
    return Detection(name, confidence, bearing)


def _class_name(entry: Mapping[str, Any], classes: Sequence[str]) -> str | None:
    name, index = entry.get("class_name"), entry.get("class")
    if isinstance(name, str) and name:
        return name if name in classes else None
    if isinstance(index, int) and not isinstance(index, bool) and 0 <= index < len(classes):
        return classes[index]
    return None


def _bearing(box: Any, width: float) -> float | None:
    """Return where the middle of a box is across the image, -1 to 1; None where it is no box."""
    if not isinstance(box, list) or len(box) != 4:
        return None
    numbers = [number for value in box if (number := finite(value)) is not None]
    if len(numbers) != 4:
        return None
    return max(-1.0, min(1.0, ((numbers[0] + numbers[2]) / 2.0 / width - 0.5) * 2.0))
