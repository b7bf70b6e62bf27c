"""Where a tag is, as published: its own place on the map, whichever missions are loaded."""

from __future__ import annotations

import math

from lupin_engine.ros.adapter.node import Qos
from lupin_msgs.msg import DiscoveredTags, Observation
from tests.ros.world import Operator, World

#: Tags of three tables, which are on the robot's way to each other.
TAGS = ("1", "5", "12")


def readings(operator: Operator) -> dict[str, Observation]:
    """The readings by tag; the aggregator publishes flowers on the same topic."""
    found = [one for one in operator.observations if one.kind == Observation.KIND_TAG_READING]
    return {one.tag_reading.tag_id: one for one in found}


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
