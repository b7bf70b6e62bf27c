"""The layout of the greenhouse, as far as the bridge needs it: which sensors each tag has."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from lupin_engine.errors import LupinError

#: The sensors of each tag, in their order.
Sensors = Mapping[str, tuple[str, ...]]


def read_layout(file: str) -> Sensors | None:
    """Return the sensors of every tag of a layout; None without a file, when any tag may have any sensor.

    Raises:
        LupinError: the file is no layout.
    """
    if not file:
        return None
    try:
        data = json.loads(Path(file).expanduser().read_text(encoding="utf-8"))
    except OSError as error:
        raise LupinError(f"layout file {file}: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise LupinError(f"layout file {file} is no JSON: {error}") from None
    tags = data.get("tags", data) if isinstance(data, dict) else None
    if not isinstance(tags, dict) or not tags:
        raise LupinError(f"layout file {file} has no tags")
    return {tag: _sensors(file, tag, entry) for tag, entry in tags.items()}


def _sensors(file: str, tag: str, entry: object) -> tuple[str, ...]:
    sensors = entry.get("sensors", []) if isinstance(entry, dict) else None
    if not isinstance(sensors, list) or not all(isinstance(sensor, str) for sensor in sensors):
        raise LupinError(f"layout file {file}: the sensors of tag {tag!r} are no list of names")
    return tuple(sensors)
