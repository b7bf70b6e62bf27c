"""Binds the functions that missions call to the layout and parameters of a run."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from lupin_engine.plugin import Parameters
from lupin_greenhouse import layout
from lupin_nav import overrides

#: Records of the types `pose` and `tag`, as plain data.
Pose = dict[str, float]
TagRecord = dict[str, Any]

#: How many places a list that a mission keeps may have.
MAX_PLACES = 16
#: How far from its place in the layout a tag may be found, in metres.
IN_PLACE_M = 0.15


def bind_approach(parameters: Parameters) -> Callable[[TagRecord], Pose]:
    """Return `approach(target)` for the layout, overrides, standoff and heading of the parameters.

    Raises:
        LupinError: the layout or the overrides file cannot be used.
    """
    # Imported here because numpy takes longer to load than all catalogs together, and only runs need it.
    from lupin_nav.approach import approach, tables_of

    known = layout.load(parameters["tag_locations_file"])
    tables, facings = tables_of(known.tables), {tag.id: tag.facing for tag in known.tags.values()}
    by_hand = overrides.load(parameters["approach_overrides_file"])
    standoff, yaw = parameters["approach_standoff_m"], parameters["approach_yaw"]

    def approach_target(target: TagRecord) -> Pose:
        place, tag_id = (target["x"], target["y"]), target["id"]
        found = approach(place, tables, standoff, yaw, by_hand.get(tag_id), facings.get(tag_id))
        return {"x": found.x, "y": found.y, "yaw": found.yaw}

    return approach_target


def bind_approach_discovered(parameters: Parameters) -> Callable[[TagRecord, Pose], Pose]:
    """Return `approach_discovered(target, robot)` for the layout, standoff and heading of the parameters.

    The map of an exploration may have another origin, so the layout's tables are used only if a tag of the
    layout was found at its place.

    Raises:
        LupinError: the layout cannot be used.
    """
    from lupin_nav.approach import approach_discovered, tables_of

    known = layout.load(parameters["tag_locations_file"])
    plates = [(tag.x, tag.y) for tag in known.tags.values()]
    standoff, yaw = parameters["approach_standoff_m"], parameters["approach_yaw"]

    def approach_target(target: TagRecord, robot: Pose) -> Pose:
        facing = tuple(target["facing"][axis] for axis in "xyzw")
        tag, robot_at = (target["x"], target["y"]), (robot["x"], robot["y"])
        in_place = any(math.dist(tag, plate) <= IN_PLACE_M for plate in plates)
        tables = tables_of(known.tables) if in_place else None
        found = approach_discovered(tag, facing, standoff, yaw, robot_at, tables)
        return {"x": found.x, "y": found.y, "yaw": found.yaw}

    return approach_target


def bind_distance(_: Parameters) -> Callable[[Pose, Pose], float]:
    """Return `distance(a, b)` in metres; headings are ignored."""
    return lambda a, b: math.hypot(a["x"] - b["x"], a["y"] - b["y"])


def bind_add_place(_: Parameters) -> Callable[[list[Pose], Pose], list[Pose]]:
    """Return `add_place(places, place)`, which appends and keeps the last `MAX_PLACES`."""
    return lambda places, place: [*places, place][-MAX_PLACES:]


def bind_numeric_order(parameters: Parameters) -> Callable[[], list[TagRecord]]:
    """Return `tags.numeric_order()` over the layout of the parameters; LupinError: that cannot be used."""
    known = layout.load(parameters["tag_locations_file"])
    return lambda: [_record(tag) for tag in known.numeric_order()]


def bind_named(parameters: Parameters) -> Callable[[list[str]], list[TagRecord]]:
    """Return `tags.named(names)` over the layout of the parameters; it raises ValueError for unknown ids.

    Raises:
        LupinError: the layout cannot be used.
    """
    known = layout.load(parameters["tag_locations_file"])
    return lambda names: [_record(tag) for tag in known.named(names)]


def bind_tag_reader(parameters: Parameters) -> Callable[[Any], TagRecord]:
    """Return the reader of type `tag`, from an id to its record; it raises ValueError for unknown ids.

    Raises:
        LupinError: the layout cannot be used.
    """
    known = layout.load(parameters["tag_locations_file"])
    return lambda tag_id: _record(known.tag(tag_id))


def bind_home_pose(parameters: Parameters) -> Callable[[Pose], Pose]:
    """Return `home_pose(start)`: the dock of the parameters.

    A dock at exactly (0, 0) counts as not set: the robot then returns to its start, with the parameter's
    heading.
    """
    dock = parameters["dock_pose"]

    def home_pose(start: Pose) -> Pose:
        unset = dock["x"] == 0.0 and dock["y"] == 0.0
        return {"x": start["x"], "y": start["y"], "yaw": dock["yaw"]} if unset else dict(dock)

    return home_pose


def _record(tag: layout.Tag) -> TagRecord:
    return {"id": tag.id, "x": tag.x, "y": tag.y}
