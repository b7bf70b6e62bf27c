"""The targets of a mission as RViz gets them, over real DDS."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from visualization_msgs.msg import Marker, MarkerArray

from lupin_ros.adapter.node import Qos, RosNode
from lupin_ros.orchestrator.markers import COLOURS, OPEN, Rating
from tests.lupin_ros.world import Operator, World

pytestmark = [pytest.mark.core, pytest.mark.timeout(180)]

TOPIC = "/lupin/markers"


def colour(marker: Any) -> tuple[float, ...]:
    return tuple(round(part, 3) for part in (marker.color.r, marker.color.g, marker.color.b))


def by_name(array: MarkerArray) -> dict[tuple[str, str], Any]:
    """Return what is drawn, by namespace and target."""
    return {(one.ns, one.text): one for one in array.markers if one.action == Marker.MODIFY}


def test_targets_are_drawn_with_their_outcomes(
    world: World, operator: Operator, make_node: Callable[..., RosNode]
) -> None:
    """A late subscriber has all of them; ids stay, and a new mission deletes those of the old one."""
    heard: list[MarkerArray] = []
    operator.ros.subscribe(MarkerArray, TOPIC, Qos.LATCHED, heard.append)
    world.start_all()
    operator.in_state("READY")
    operator.until(lambda: heard, "the first message")
    assert [one.action for one in heard[0].markers] == [Marker.DELETEALL]
    operator.hit(4, "reject")
    assert operator.start("1", "5").accepted
    operator.until(lambda: len(heard[-1].markers) > 1, "the targets")
    first = by_name(heard[-1])
    assert sorted(first) == [(ns, tag) for ns in ("names", "stands", "targets") for tag in ("1", "5")]
    assert {one.header.frame_id for one in first.values()} == {"map"}
    assert colour(first["targets", "5"]) == OPEN
    assert {first[ns, "5"].id for ns in ("names", "stands", "targets")} != {
        first[ns, "1"].id for ns in ("names", "stands", "targets")
    }
    place, stand = first["targets", "5"].pose.position, first["stands", "5"].pose.position
    assert 0.1 < abs(place.x - stand.x) + abs(place.y - stand.y) < 2.0
    operator.in_state("DONE")
    late: list[MarkerArray] = []
    node = make_node("rviz")
    node.subscribe(MarkerArray, TOPIC, Qos.LATCHED, late.append)

    def is_whole() -> bool:
        node.spin_once(0.01)
        wanted = COLOURS[Rating.BAD]
        return bool(late) and {colour(by_name(late[-1])["targets", tag]) for tag in ("1", "5")} == {wanted}

    operator.until(is_whole, "both outcomes, for a late subscriber")
    assert {key: one.id for key, one in by_name(late[-1]).items()} == {
        key: one.id for key, one in first.items()
    }
    assert [one.markers[0].action for one in heard].count(Marker.DELETEALL) == 2
    operator.hit(0, "none")
    assert operator.start("12").accepted
    operator.until(lambda: ("targets", "12") in by_name(heard[-1]), "the next mission")
    anew = next(one for one in heard if ("targets", "12") in by_name(one))
    assert anew.markers[0].action == Marker.DELETEALL
    assert ("targets", "1") not in by_name(anew)
    operator.until(lambda: colour(by_name(heard[-1])["targets", "12"]) == COLOURS[Rating.GOOD], "a good one")
