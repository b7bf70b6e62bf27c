"""The registry of tags: debouncing, the nearest view, missions, and confirmation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_greenhouse.poses import Pose
from lupin_perception import registry
from lupin_perception.flowers import ScanSummary
from lupin_perception.registry import Confirmation, Known, Registry

RED = ScanSummary("tulip_red", 0.9, False, ())


def at(x: float) -> Pose:
    return Pose(np.array((x, 0.0, 0.0)), np.array((0.0, 0.0, 0.0, 1.0)))


def made(enough: int = 3, reach: float = 2.5, freshness: float = 5.0) -> Registry:
    return Registry(enough, reach, freshness)


def see(tags: Registry, *tag_ids: str, distance: float = 1.0, now: float = 0.0, x: float = 1.0) -> None:
    for tag_id in tag_ids:
        tags.add(tag_id, at(x), distance, now)


def names(tags: Registry) -> list[str]:
    return [known.id for known in tags.discovered()]


def test_a_tag_is_discovered_at_its_third_sighting() -> None:
    tags = made()
    see(tags, "5", "5")
    assert names(tags) == []
    assert tags.find("5") is None
    see(tags, "5")
    assert names(tags) == ["5"]
    known = tags.find("5")
    assert known is not None
    assert known.sightings == 3


@pytest.mark.parametrize(
    ("reach", "distance", "counts"),
    [(2.5, 2.5, True), (2.5, 2.6, False), (0.0, 9.0, True), (2.5, math.inf, True)],
)
def test_a_view_from_too_far_does_not_count(reach: float, distance: float, counts: bool) -> None:
    assert made(reach=reach).is_near(distance) is counts


@given(
    views=st.lists(st.tuples(st.floats(0.1, 2.5), st.floats(-9, 9)), min_size=3, unique_by=lambda v: v[0]),
    order=st.randoms(use_true_random=False),
)
def test_the_nearest_view_places_a_tag_in_whatever_order_they_came(
    views: list[tuple[float, float]], order: object
) -> None:
    shuffled = list(views)
    order.shuffle(shuffled)  # type: ignore[attr-defined]
    places = []
    for sequence in (views, shuffled):
        tags = made()
        for distance, x in sequence:
            tags.add("5", at(x), distance, 0.0)
        (known,) = tags.discovered()
        places.append(known.pose.position[0])
        assert known.sightings == len(views)
    assert places[0] == places[1] == min(views)[1]


@given(order=st.permutations(["1", "1", "1", "2", "2", "3", "3", "3", "3"]))
def test_which_tags_are_discovered_does_not_depend_on_the_order_of_views(order: list[str]) -> None:
    tags = made()
    see(tags, *order)
    assert sorted(names(tags)) == ["1", "3"]


def test_a_view_from_an_unknown_distance_places_a_tag_only_while_no_better_one_has() -> None:
    tags = made(enough=1)
    see(tags, "5", distance=math.inf, x=1.0)
    see(tags, "5", distance=math.inf, x=2.0)
    (known,) = tags.discovered()
    assert known.pose.position[0] == 2.0
    see(tags, "5", distance=2.0, x=3.0)
    see(tags, "5", distance=math.inf, x=4.0)
    assert known.pose.position[0] == 3.0


def test_a_new_mission_begins_with_nothing() -> None:
    """War story A17: tags of the last run do not count in the next."""
    tags = made(enough=1)
    assert tags.begin("m1")
    see(tags, "5")
    assert not tags.begin("m1")
    assert not tags.begin(""), "what is told between missions ends none"
    assert names(tags) == ["5"]
    assert tags.begin("m2")
    assert names(tags) == []


def test_what_grows_at_a_tag_is_what_was_told_last() -> None:
    tags = made(enough=1)
    see(tags, "5")
    tags.classify("5", RED)
    tags.classify("5", ScanSummary("tulip_white", 0.5, True, ()))
    (known,) = tags.discovered()
    assert known.summary == ScanSummary("tulip_white", 0.5, True, ())


def test_there_is_room_for_so_many_tags_and_those_known_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "MAX_TAGS", 1)
    tags = made(enough=1)
    see(tags, "5")
    assert tags.add("6", at(0.0), 1.0, 0.0) is None
    assert tags.add("5", at(0.0), 1.0, 0.0) is not None
    assert names(tags) == ["5"]


def test_a_tag_is_confirmed_once_it_was_seen_often_enough_and_for_as_long_as_that_is_fresh() -> None:
    tags = made()
    assert tags.confirm("5", 0.0) == Confirmation(False, 0.0, error="tag '5' not discovered")
    see(tags, "5", "5")
    below = tags.confirm("5", 0.0)
    assert (below.detected, below.error) == (False, "tag '5' below sighting threshold: 2 of 3")
    assert below.confidence == pytest.approx(2 / 3)
    see(tags, "5", now=1.0, x=4.0, distance=0.5)
    found = tags.confirm("5", 6.0)
    assert (found.detected, found.confidence, found.error) == (True, 1.0, "")
    assert found.pose is not None
    assert found.pose.position[0] == 4.0
    stale = Confirmation(False, 0.0, error="tag '5' stale: last seen 5.1 s ago, allowed 5 s")
    assert tags.confirm("5", 6.1) == stale


def test_a_strange_id_is_told_back_short_and_quoted() -> None:
    found = made().confirm("\x1b[2J" + "9" * 10_000, 0.0)
    assert found.error == f"tag '\\x1b[2J{'9' * 36}...' not discovered"


def test_what_others_work_from_is_told_apart_from_mere_sightings() -> None:
    """Boxes and the memory are made anew only when a tag is found, moves, is classified or forgotten."""
    tags = made()
    tags.begin("m1")
    before = tags.revision

    def changed() -> bool:
        nonlocal before
        before, now = tags.revision, tags.revision > before
        return now

    see(tags, "1", "1")
    assert not changed(), "not yet discovered"
    see(tags, "1")
    assert changed()
    see(tags, "1", "1")
    assert not changed(), "seen again in the same place"
    see(tags, "1", distance=2.0, x=5.0)
    assert not changed(), "a worse view"
    see(tags, "1", x=1.1)
    assert changed()
    for degrees, news in ((0.1, False), (1.0, True)):
        half = math.radians(degrees) / 2.0
        turned = Pose(at(1.1).position, np.array((0.0, 0.0, math.sin(half), math.cos(half))))
        tags.add("1", turned, 1.0, 0.0)
        assert changed() is news, f"turned by {degrees} degrees"
    tags.classify("1", ScanSummary("tulip_red", 0.9, False, ()))
    assert changed()
    assert tags.begin("m2")
    assert changed()


def test_what_an_earlier_process_knew_counts_again() -> None:
    """But whether the tag is in sight, it cannot know."""
    tags = made()
    tags.begin("m1")
    tags.restore([Known("5", at(1.0), 0.5, 7, -math.inf)])
    assert names(tags) == ["5"]
    assert tags.confirm("5", 100.0).error == "tag '5' stale: not seen since this node began, allowed 5 s"
    see(tags, "5", distance=2.0, now=100.0, x=3.0)
    known = tags.find("5")
    assert known is not None
    assert (known.sightings, known.pose.plane[0]) == (8, 1.0), "the nearer view still places it"
    assert tags.confirm("5", 100.0).detected
