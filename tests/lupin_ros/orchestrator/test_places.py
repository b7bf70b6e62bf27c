"""Where a tag is, as published: its own place on the map, whichever missions are loaded."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path

import pytest

from lupin_greenhouse.layout import BUNDLED
from lupin_msgs.msg import DiscoveredTags, Observation
from lupin_ros.adapter.node import Qos
from tests.lupin_ros.world import Operator, World

#: Tags of three tables, which are on the robot's way to each other.
TAGS = ("1", "5", "12")


def readings(operator: Operator) -> dict[str, Observation]:
    """The readings by tag; the aggregator publishes flowers on the same topic."""
    found = [one for one in operator.observations if one.kind == Observation.KIND_TAG_READING]
    return {one.tag_reading.tag_id: one for one in found}


@pytest.mark.core
def test_an_inspection_alone_publishes_the_places_of_its_tags(world: World, operator: Operator) -> None:
    """No loaded mission declares the list of tags, as with `lupin run inspection`."""
    lists: list[DiscoveredTags] = []
    operator.ros.subscribe(DiscoveredTags, "/perception/discovered_tags", Qos.LATCHED, lists.append)
    world.start("perception_aggregator")
    world.start_all(speed=4.0, missions=["inspection"])
    operator.in_state("READY")
    assert operator.start(*TAGS).accepted
    operator.in_state("DONE")
    operator.until(lambda: set(TAGS) <= set(readings(operator)), "a reading of each tag")
    seen = {tag.tag_id: tag.pose_in_map.position for tag in lists[-1].tags}
    assert set(TAGS) <= set(seen)
    for tag, reading in readings(operator).items():
        place, own = reading.tag_pose_in_map.position, seen[tag]
        away = math.dist((place.x, place.y), (own.x, own.y))
        assert away < 0.1, f"tag {tag} is published {away:.2f} m from where it is"


def layout_where(folder: Path, facings: Mapping[str, str | None]) -> str:
    """Write the layout of the greenhouse with plates that face elsewhere, or nobody knows where."""
    written = json.loads(BUNDLED.read_text(encoding="utf-8"))
    for tag, facing in facings.items():
        written["tags"][tag] = {**written["tags"][tag], "facing": facing}
        if facing is None:
            del written["tags"][tag]["facing"]
    file = folder / f"{'-'.join(facings)}.json"
    file.write_text(json.dumps(written), encoding="utf-8")
    return str(file)


def test_a_tag_that_is_not_where_the_robot_looks_for_it_is_told_and_not_read(
    world: World, operator: Operator, tmp_path: Path
) -> None:
    """The layout is wrong about tag 5 and says nothing of tag 4, which hangs where nobody guesses it."""
    world.start("perception_aggregator")
    world.start("greenhouse_bridge")
    world.start("lupin_sim", speed=2.0, tag_locations_file=layout_where(tmp_path, {"4": "+y"}))
    told = layout_where(tmp_path, {"4": None, "5": "-y"})
    world.start("mission_orchestrator", tag_locations_file=told, require_visual_confirmation=True)
    operator.in_state("READY")
    started = operator.start("1", "5", "4", "12")
    assert started.accepted, started.error_message
    operator.in_state("DONE")

    def results() -> list[Observation]:
        of_mission = [one for one in operator.observations if one.mission_id == started.mission_id]
        return [one for one in of_mission if one.kind == Observation.KIND_TAG_READING]

    operator.until(lambda: len(results()) >= 4, "a result of each tag")
    assert [(one.status, one.status_detail) for one in results()] == [
        (Observation.STATUS_OK, ""),
        (Observation.STATUS_SCAN_FAILED, "tag '5' not discovered"),
        (Observation.STATUS_SCAN_FAILED, "tag '4' not discovered"),
        (Observation.STATUS_OK, ""),
    ]
