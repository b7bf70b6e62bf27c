"""Frames of tags and transforms brought together: what is placed, what waits, what is forgotten."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lupin_greenhouse.poses import Pose
from lupin_perception.detections import MAX_ENTRIES, TagSeen
from lupin_perception.registry import Known, Registry
from lupin_perception.sightings import LATE_S, UNPLACED_FRAMES, Sightings

FIVE = TagSeen("5", 1.0)


def stamped(parent: str, child: str, x: float, moment: float) -> Any:
    """A TransformStamped."""
    place = SimpleNamespace(x=x, y=0.0, z=0.0)
    turn = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
    return SimpleNamespace(
        header=SimpleNamespace(
            frame_id=parent, stamp=SimpleNamespace(sec=int(moment), nanosec=int(moment % 1.0 * 1e9))
        ),
        child_frame_id=child,
        transform=SimpleNamespace(translation=place, rotation=turn),
    )


class Bench:
    """Sightings, and what they count; the stamps of transforms are of another clock, 1000 s ahead."""

    def __init__(self, in_sight: float = 1.0) -> None:
        self.placed: list[Known | None] = []
        self.registry = Registry(min_sightings=1, max_distance=2.5, freshness=5.0)
        self.sightings = Sightings(self.registry, "tag_", in_sight, self.placed.append)

    def tell(self, tag: str, now: float, camera: float = 1.0) -> None:
        """Say that the camera is at (camera, 0) and sees a tag a metre ahead."""
        moment = now + 1000.0
        transforms = [stamped("map", "camera", camera, moment), stamped("camera", f"tag_{tag}", 1.0, moment)]
        assert self.sightings.take(transforms, now) == []


def test_a_tag_is_placed_by_the_transforms_that_are_known() -> None:
    bench = Bench()
    bench.tell("5", 0.0, camera=3.0)
    assert bench.sightings.see([FIVE], 0.1) == ""
    (known,) = bench.placed
    assert known is not None
    assert (known.id, known.pose.plane, known.last_seen) == ("5", (4.0, 0.0), 0.1)


def test_what_waits_counts_once_and_as_of_when_it_was_seen() -> None:
    bench = Bench()
    bench.sightings.see([FIVE], 0.0)
    assert bench.placed == []
    for now in (1.0, 2.0):
        bench.tell("5", now)
    assert [known and known.last_seen for known in bench.placed] == [0.0]


def test_what_waits_is_placed_by_whichever_transform_was_missing() -> None:
    """The detector tells of a tag at once, a slow localizer once a second; by then the tag is out of view."""
    bench = Bench()
    bench.sightings.take([stamped("camera", "tag_5", 1.0, 1000.0)], 0.0)
    bench.sightings.take([stamped("camera", "tag_5", 1.0, 1000.1)], 0.1)
    bench.sightings.see([FIVE], 0.1)
    assert bench.placed == []
    bench.sightings.take([stamped("map", "camera", 3.0, 1000.0)], 0.5)
    (known,) = bench.placed
    assert known is not None
    assert (known.pose.plane, known.last_seen) == ((4.0, 0.0), 0.1)


def test_a_tag_in_sight_that_cannot_be_placed_is_confirmed_all_the_same() -> None:
    """Who asks wants to know whether it is in the picture; where it is was known before."""
    bench = Bench()
    bench.tell("5", 0.0, camera=3.0)
    bench.sightings.see([FIVE], 0.0)
    later = 60.0
    assert not bench.registry.confirm("5", later).detected
    bench.sightings.see([FIVE], later)
    found = bench.registry.confirm("5", later)
    assert (found.detected, found.pose and found.pose.plane) == (True, (4.0, 0.0))
    assert len(bench.placed) == 1, "it counts for nothing else"
    assert not bench.registry.confirm("6", later).detected


def test_what_was_placed_late_makes_nothing_older() -> None:
    bench = Bench()
    bench.sightings.see([FIVE], 0.0)
    bench.registry.add("5", Pose(np.zeros(3), np.array((0.0, 0.0, 0.0, 1.0))), 1.0, 2.0)
    bench.tell("5", 2.5)
    (known,) = bench.placed
    assert known is not None
    assert (known.sightings, known.last_seen) == (2, 2.0)


def test_no_more_wait_than_one_frame_can_have() -> None:
    bench = Bench()
    first, second = ([TagSeen(f"{frame}{n:03}", 1.0) for n in range(MAX_ENTRIES)] for frame in (1, 2))
    bench.sightings.see(first, 0.0)
    bench.sightings.see(second[:100], 0.1)
    assert list(bench.sightings._late) == [tag.id for tag in [*first[100:], *second[:100]]]


@pytest.mark.parametrize(("wait", "count"), [(LATE_S, 1), (LATE_S + 0.1, 0)])
def test_nothing_waits_for_ever(wait: float, count: int) -> None:
    bench = Bench()
    bench.sightings.see([FIVE], 100.0)
    bench.tell("5", 100.0 + wait)
    assert len(bench.placed) == count


@pytest.mark.parametrize(("age", "count"), [(LATE_S, 1), (LATE_S + 0.1, 0)])
def test_an_old_transform_places_nothing(age: float, count: int) -> None:
    """Whatever its stamp says: the robot has driven on meanwhile."""
    bench = Bench()
    bench.tell("5", 0.0)
    bench.sightings.see([FIVE], age)
    assert len(bench.placed) == count
    assert (bench.sightings.where("camera", age) is not None) == bool(count)


def test_what_was_seen_in_the_last_mission_is_no_find_of_the_next() -> None:
    """War story A17, in the small."""
    bench = Bench()
    bench.sightings.see([FIVE], 0.0)
    bench.sightings.forget()
    bench.tell("5", 0.1)
    assert bench.placed == []


def test_what_is_too_far_away_is_in_sight_and_counts_for_nothing() -> None:
    bench = Bench()
    bench.tell("5", 0.0)
    for now in range(UNPLACED_FRAMES + 1):
        assert bench.sightings.see([TagSeen("5", 9.0)], float(now)) == ""
    assert bench.placed == []
    assert bench.sightings.in_sight(float(now)) == {"5": 9.0}


def test_what_is_out_of_sight_is_not_kept() -> None:
    """Also while nobody asks: a detector gone wild has new ids in each frame."""
    bench = Bench(in_sight=0.5)
    for frame in range(100):
        bench.sightings.see([TagSeen(str(frame * 100 + i), 1.0) for i in range(100)], frame * 1.0)
    assert len(bench.sightings._sights) == 100
    assert bench.sightings.in_sight(99.6) == {}


def test_frames_in_a_row_that_cannot_be_placed_are_told_once_with_the_reason() -> None:
    bench = Bench()
    told = [bench.sightings.see([FIVE], 0.01 * frame) for frame in range(UNPLACED_FRAMES + 3)]
    (text,) = filter(None, told)
    assert told[UNPLACED_FRAMES - 1] == text
    assert text.startswith("tags are seen but none can be placed: no transform leads from tag_5 to map: ")
    bench.tell("5", 1.0)
    bench.sightings.see([FIVE], 1.0)
    late = 2.0 + LATE_S
    told = [bench.sightings.see([FIVE], late + 0.01 * frame) for frame in range(UNPLACED_FRAMES)]
    assert "the transforms of tag_5, camera have ceased" in told[-1]


def test_tags_whose_moments_do_not_meet_are_told_with_what_to_look_at() -> None:
    """All that leads to the map is fresh, but of two clocks."""
    bench = Bench()
    bench.sightings.take(
        [stamped("map", "camera", 1.0, 1000.0), stamped("camera", "tag_5", 1.0, 1060.0)], 0.0
    )
    told = [bench.sightings.see([FIVE], 0.01 * frame) for frame in range(UNPLACED_FRAMES)]
    assert told[-1] == (
        "tags are seen but none can be placed: no moment has all transforms from tag_5 to map: those of"
        " camera end 60.0 s before those of tag_5 begin, so one has ceased, or two clocks disagree;"
        " is the camera calibrated, the robot localized?"
    )


def test_a_tag_is_in_sight_for_just_so_long_after_its_last_frame() -> None:
    bench = Bench(in_sight=0.5)
    bench.sightings.see([FIVE], 1.0)
    assert bench.sightings.in_sight(1.5) == {"5": 1.0}
    assert bench.sightings.in_sight(1.6) == {}


def test_a_frame_without_tags_neither_counts_nor_ends_the_row() -> None:
    bench = Bench()
    frames: list[list[TagSeen]] = [[], [FIVE]] * UNPLACED_FRAMES
    told = [bench.sightings.see(seen, float(index)) for index, seen in enumerate(frames)]
    assert [bool(text) for text in told] == [False] * (len(frames) - 1) + [True]
