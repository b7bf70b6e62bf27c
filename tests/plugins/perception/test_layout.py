"""The known layout laid over the map, by what must hold wherever the map begins."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_greenhouse import layout as layouts
from lupin_greenhouse.layout import Layout, Table, Tag
from lupin_greenhouse.poses import Array, Pose, pose_of
from lupin_perception.boxes import PlanterBox
from lupin_perception.detections import read_boxes
from lupin_perception.layout import (
    Quality,
    RigidMotion,
    box_of,
    entries,
    fit,
    nearest_table,
    register,
    spread,
)
from lupin_sim.camera import facing

PLACES = st.floats(-20.0, 20.0)
TURNS = st.floats(-3.0, 3.0)
MOTIONS = st.builds(lambda turn, x, y: RigidMotion(turn, np.array((x, y))), TURNS, PLACES, PLACES)
POINTS = st.lists(st.tuples(PLACES, PLACES), min_size=2, max_size=8).filter(lambda ps: spread(ps) > 0.5)
QUALITY = Quality(max_error=0.15, min_spread=0.4)
STILL = RigidMotion(0.0, np.zeros(2))

GREENHOUSE = layouts.load()
TABLE = Table("T", 1.5, 2.6, 7.3, 7.55)


def plate(x: float, y: float, heading: float) -> Pose:
    pose = pose_of((x, y, 0.1), facing(heading))
    assert pose is not None
    return pose


def found(motion: RigidMotion, names: Iterable[str], heading: float = -math.pi / 2) -> dict[str, Pose]:
    """These tags of the greenhouse as they are seen on a map that begins elsewhere."""
    tags = [GREENHOUSE.tags[name] for name in names]
    places = motion.move(np.array([(tag.x, tag.y) for tag in tags]).reshape(-1, 2)).tolist()
    return {tag.id: plate(x, y, heading + motion.turn) for tag, (x, y) in zip(tags, places, strict=True)}


def corners(box: PlanterBox) -> set[tuple[float, float]]:
    return {(round(x, 6), round(y, 6)) for x, y in box.footprint().tolist()}


def rectangle(table: Table, motion: RigidMotion = STILL) -> set[tuple[float, float]]:
    sides = [(x, y) for x in (table.x0, table.x1) for y in (table.y0, table.y1)]
    return {(round(x, 6), round(y, 6)) for x, y in motion.move(sides).tolist()}


# --- the fit


@given(motion=MOTIONS, points=POINTS)
def test_the_motion_that_led_there_is_found(motion: RigidMotion, points: list[tuple[float, float]]) -> None:
    got = fit(points, motion.move(points))
    assert math.cos(got.turn - motion.turn) == pytest.approx(1.0)
    assert got.errors(points, motion.move(points)).max() == pytest.approx(0.0, abs=1e-6)


@given(motion=MOTIONS, points=POINTS, order=st.randoms(use_true_random=False))
def test_the_order_of_tags_changes_nothing(
    motion: RigidMotion, points: list[tuple[float, float]], order: object
) -> None:
    mixed = list(zip(points, motion.move(points).tolist(), strict=True))
    order.shuffle(mixed)  # type: ignore[attr-defined]
    one, other = fit(points, motion.move(points)), fit(*zip(*mixed, strict=True))
    assert math.cos(one.turn - other.turn) == pytest.approx(1.0)
    assert np.allclose(one.shift, other.shift, atol=1e-6)


@given(points=POINTS, noise=st.integers(0, 1000), motion=MOTIONS)
def test_no_other_motion_fits_better(
    points: list[tuple[float, float]], noise: int, motion: RigidMotion
) -> None:
    seen = np.array(points) + np.random.default_rng(noise).normal(0.0, 0.1, (len(points), 2))
    best = fit(points, seen)

    def error(candidate: RigidMotion) -> float:
        return float((candidate.errors(points, seen) ** 2).sum())

    assert error(best) <= error(motion) + 1e-9
    nudged = RigidMotion(best.turn + 0.01, best.shift + 0.01)
    assert error(best) <= error(nudged) + 1e-9


def test_too_few_tags_say_no_turn() -> None:
    assert (fit([], []).turn, fit([], []).shift.tolist()) == (0.0, [0.0, 0.0])
    assert (fit([(1, 2)], [(4, 6)]).turn, fit([(1, 2)], [(4, 6)]).shift.tolist()) == (0.0, [3.0, 4.0])
    same = fit([(1, 2), (1, 2)], [(4, 6), (4, 7)])
    assert (same.turn, same.shift.tolist()) == (0.0, [3.0, 4.5])


# --- boxes


def test_a_table_is_reproduced_with_its_front_where_the_plate_is() -> None:
    box = box_of(TABLE, Tag("6", 1.5, 7.3), (0.0, -1.0), STILL)
    assert box is not None
    assert (box.size.width, box.size.depth) == pytest.approx((1.1, 0.25))
    assert (box.origin.tolist(), box.normal.tolist()) == (pytest.approx([2.05, 7.3]), [0.0, -1.0])
    assert corners(box) == rectangle(TABLE)


@pytest.mark.parametrize(
    ("normal", "expected"),
    [
        ((0.1, 0.9), (0.0, 1.0)),
        ((-0.9, 0.3), (-1.0, 0.0)),
        ((0.0, 0.0), (0.0, -1.0)),
        ((0.3, 0.3), (0.0, -1.0)),
    ],
    ids=["the back", "an end", "a plate that lies", "a plate that leans"],
)
def test_the_front_is_the_side_that_the_plate_faces_or_else_the_long_one_at_hand(
    normal: tuple[float, float], expected: tuple[float, float]
) -> None:
    """One of four sides, so that a noisy quaternion turns no box (war story 53)."""
    box = box_of(TABLE, Tag("6", 1.5, 7.3), normal, STILL)
    assert box is not None
    assert box.normal.tolist() == pytest.approx(list(expected))
    assert corners(box) == rectangle(TABLE)


@given(motion=MOTIONS)
def test_boxes_move_and_turn_with_the_map(motion: RigidMotion) -> None:
    here = box_of(TABLE, Tag("6", 1.5, 7.3), (0.0, -1.0), STILL)
    there = box_of(TABLE, Tag("6", 1.5, 7.3), (0.0, -1.0), motion)
    assert here is not None
    assert there is not None
    assert np.allclose(motion.move(here.footprint()), there.footprint(), atol=1e-6)
    assert np.allclose(motion.move(here.place(0.3, 0.7)), there.place(0.3, 0.7), atol=1e-6)


def test_a_table_without_an_area_is_no_box() -> None:
    assert box_of(Table("T", 1.0, 1.0, 0.0, 2.0), Tag("1", 1.0, 0.0), (1.0, 0.0), STILL) is None


def test_the_table_of_a_tag_is_the_nearest_and_of_equal_ones_the_first() -> None:
    left, right = Table("b", 0.0, 1.0, 0.0, 1.0), Table("a", 2.0, 3.0, 0.0, 1.0)
    assert nearest_table([left, right], Tag("1", 1.4, 0.5)) is left
    assert nearest_table([left, right], Tag("1", 1.5, 0.5)) is right
    assert nearest_table([], Tag("1", 1.5, 0.5)) is None


# --- the registration


@given(motion=MOTIONS)
def test_two_tags_of_a_table_give_its_rectangle_wherever_the_map_begins(motion: RigidMotion) -> None:
    result = register(GREENHOUSE, found(motion, ["6", "29"]), QUALITY)
    assert (set(result.boxes), result.misplaced, result.reason) == ({"6", "29"}, (), "")
    (table,) = [table for table in GREENHOUSE.tables if table.id == "Table1"]
    for box in result.boxes.values():
        wanted = sorted(rectangle(table, motion))
        assert np.allclose(sorted(corners(box)), wanted, atol=1e-4)
        assert np.allclose(box.normal, (math.sin(motion.turn), -math.cos(motion.turn)), atol=1e-6)


@given(motion=MOTIONS, order=st.permutations(["1", "2", "6", "12", "29", "x9"]))
def test_the_order_in_which_tags_are_found_changes_no_box(motion: RigidMotion, order: list[str]) -> None:
    seen = {**found(motion, ["1", "2", "6", "12", "29"]), "x9": plate(0.0, 0.0, 0.0)}
    one, other = (
        register(GREENHOUSE, seen, QUALITY),
        register(GREENHOUSE, {n: seen[n] for n in order}, QUALITY),
    )
    assert set(one.boxes) == {"1", "2", "6", "12", "29"}, "a tag that the layout does not know has no box"
    for name, box in one.boxes.items():
        assert np.allclose(box.footprint(), other.boxes[name].footprint(), atol=1e-6)


@pytest.mark.parametrize("others", [("1", "2", "6", "29"), ("1", "2", "6")])
def test_a_plate_that_was_moved_is_left_out_and_named(others: tuple[str, ...]) -> None:
    """Three that agree are enough to say that it is the fourth."""
    seen = found(STILL, [*others, "12"])
    seen["12"] = plate(3.5, 1.0, 0.0)
    result = register(GREENHOUSE, seen, QUALITY)
    assert (set(result.boxes), result.misplaced) == (set(others), ("12",))


@pytest.mark.parametrize("names", [["6"], ["6", "21"]])
def test_from_tags_too_near_to_each_other_nothing_is_told(names: list[str]) -> None:
    """A26: from one tag nobody knows how the layout is turned."""
    result = register(GREENHOUSE, found(STILL, names), QUALITY)
    assert (result.boxes, result.reason) == (
        {},
        "the tags found are too near to each other to say how the layout lies on the map",
    )


def test_tags_of_another_greenhouse_say_nothing_about_the_layout() -> None:
    strangers = {"100": plate(0.0, 0.0, 0.0), "101": plate(5.0, 0.0, 0.0)}
    for seen in ({}, strangers):
        result = register(GREENHOUSE, seen, QUALITY)
        assert (result.boxes, result.reason) == ({}, "none of the tags found is in the layout")


def test_a_layout_of_another_greenhouse_is_not_used() -> None:
    seen = {name: plate(float(i % 2), i * 1.7, 0.0) for i, name in enumerate(["1", "2", "3"])}
    result = register(GREENHOUSE, seen, QUALITY)
    assert result.boxes == {}
    far = f"tags are more than {QUALITY.max_error:g} m from where it has them"
    assert result.reason == f"the layout does not fit: {far}"


def test_a_layout_without_tables_has_no_boxes() -> None:
    bare = Layout(MappingProxyType(dict(GREENHOUSE.tags)), ())
    assert register(bare, found(STILL, ["6", "29"]), QUALITY).boxes == {}


# --- on the wire


@given(motion=MOTIONS)
def test_what_is_told_is_read_as_it_was(motion: RigidMotion) -> None:
    boxes = register(GREENHOUSE, found(motion, ["6", "29", "2"]), QUALITY).boxes
    told = entries(boxes, 0.3)
    assert all(entry["height"] == 0.3 for entry in told)
    read, problems = read_boxes(json.dumps(told))
    assert problems == []
    for name, box in boxes.items():
        footprint: Array = read[name].footprint()
        assert np.allclose(footprint, box.footprint(), atol=1e-9)
