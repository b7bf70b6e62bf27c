"""The simulated detectors: their frames hold what is in view, as the aggregator reads it."""

from __future__ import annotations

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_greenhouse.plates import PLATE_M
from lupin_perception.detections import Detection, read_flowers, read_tags
from lupin_sim.camera import Plate
from lupin_sim.detector import (
    CENTRE_PX,
    CLASSES,
    FOCAL_PX,
    IMAGE_PX,
    PEST,
    blooms_of,
    flower_entries,
    readable,
    tag_entries,
    tag_in_robot,
)
from lupin_sim.robot import FloorPose

#: Faces -x; a robot at the origin that looks along x stands 1 m in front of it.
PLATE = Plate("7", 1.0, 0.0, math.pi, (1.0, 0.0))
ORIGIN = FloorPose(0.0, 0.0, 0.0)


def flowers(pose: FloorPose, *plates: Plate) -> list[Detection]:
    found, problems = read_flowers(json.dumps(flower_entries(pose, plates)), CLASSES, IMAGE_PX[0])
    assert problems == []
    return found


def test_a_tag_ahead_is_told_with_its_distance_and_its_corners_clockwise_from_the_upper_left() -> None:
    (entry,) = tag_entries(ORIGIN, [PLATE])
    half = FOCAL_PX * 0.08
    assert (entry["id"], entry["dist"]) == (7, 1.0)
    left, right, upper, lower = 320.5 - half, 320.5 + half, 240.5 - half, 240.5 + half
    corners = [(left, upper), (right, upper), (right, lower), (left, lower)]
    assert [tuple(corner) for corner in entry["corners"]] == [pytest.approx(corner) for corner in corners]


def test_a_tag_to_the_left_is_on_the_left_of_the_image() -> None:
    (entry,) = tag_entries(FloorPose(0.0, -0.3, 0.0), [PLATE])
    assert all(u < 320.5 for u, _ in entry["corners"])


@given(ahead=st.floats(0.6, 2.0), left=st.floats(-0.2, 0.2), heading=st.floats(-1.2, 1.2))
def test_the_corners_are_those_of_a_plate_of_its_size_place_and_heading(
    ahead: float, left: float, heading: float
) -> None:
    """Looked at askew, too: its nearer edge is the taller one."""
    (entry,) = tag_entries(ORIGIN, [Plate("7", ahead, left, math.pi + heading, (ahead, left))])
    upper_left, upper_right, lower_right, lower_left = entry["corners"]

    def edge(upper: list[float], lower: list[float]) -> tuple[float, float]:
        assert upper[0] == lower[0]
        forward = FOCAL_PX * PLATE_M / (lower[1] - upper[1])
        return forward, (CENTRE_PX[0] - upper[0]) * forward / FOCAL_PX

    one, other = edge(upper_left, lower_left), edge(upper_right, lower_right)
    assert ((one[0] + other[0]) / 2, (one[1] + other[1]) / 2) == pytest.approx((ahead, left))
    # The edge to the left of whoever looks at it is clockwise of its normal.
    assert (one[0] - other[0], one[1] - other[1]) == pytest.approx(
        (PLATE_M * -math.sin(heading), PLATE_M * math.cos(heading)), abs=1e-9
    )


@given(turn=st.floats(-3.0, 3.0), x=st.floats(-5.0, 5.0), y=st.floats(-5.0, 5.0), aside=st.floats(-0.3, 0.3))
def test_turning_and_moving_the_greenhouse_changes_no_bearing(
    turn: float, x: float, y: float, aside: float
) -> None:
    plate = Plate("7", 1.0, aside, math.pi - 0.4, (1.0, aside))
    cosine, sine = math.cos(turn), math.sin(turn)
    place = x + cosine * plate.x - sine * plate.y, y + sine * plate.x + cosine * plate.y
    turned = Plate("7", *place, plate.yaw + turn, place)
    here, there = flowers(ORIGIN, plate), flowers(FloorPose(x, y, turn), turned)
    assert [one.bearing for one in there] == pytest.approx([one.bearing for one in here], abs=1e-6)
    assert here


@given(x=st.floats(-3, 3), y=st.floats(-3, 3), yaw=st.floats(-9, 9))
def test_a_frame_of_tags_can_be_read_and_stays_within_the_image(x: float, y: float, yaw: float) -> None:
    entries = tag_entries(FloorPose(x, y, yaw), [PLATE])
    found, problems = read_tags(json.dumps(entries))
    assert ([tag.id for tag in found], problems) == (["7"], [])
    assert all(0 <= u <= IMAGE_PX[0] and 0 <= v <= IMAGE_PX[1] for u, v in entries[0]["corners"])


@given(x=st.floats(-3, 3), y=st.floats(-3, 3), yaw=st.floats(-3, 3))
def test_where_a_robot_sees_a_plate_is_where_it_is(x: float, y: float, yaw: float) -> None:
    seen = tag_in_robot(FloorPose(x, y, yaw), PLATE)
    cosine, sine = math.cos(yaw), math.sin(yaw)
    place = x + cosine * seen.x - sine * seen.y, y + sine * seen.x + cosine * seen.y
    assert place == pytest.approx((PLATE.x, PLATE.y))
    assert seen.yaw + yaw == pytest.approx(PLATE.yaw)


def test_a_detector_reports_numbers_only() -> None:
    names = ("door", "1" * 5000, "1" * 10, "\u0663", "1" * 9)
    *others, longest = (Plate(name, 1.0, 0.0, math.pi, (1.0, 0.0)) for name in names)
    assert readable([*others, PLATE, longest]) == [PLATE, longest]


def test_what_grows_at_a_tag_is_the_same_every_time_and_differs_from_tag_to_tag() -> None:
    names = [str(number) for number in range(1, 31)]
    assert [blooms_of(name) for name in names] == [blooms_of(name) for name in names]
    assert {blooms_of(name)[0].kind for name in names} == {0, 1, 2}
    pests = [name for name in names if any(bloom.kind == PEST for bloom in blooms_of(name))]
    assert pests == ["5", "10", "15", "20", "25", "30"]
    assert blooms_of("door"), "a tag may have a name"


def test_the_blooms_of_the_box_ahead_are_seen_from_left_to_right() -> None:
    found = flowers(ORIGIN, PLATE)
    species = CLASSES[blooms_of("7")[0].kind]
    assert [detection.name for detection in found] == [species] * len(blooms_of("7"))
    bearings = [detection.bearing for detection in found]
    assert bearings == sorted(bearings)
    assert bearings[0] == pytest.approx(-bearings[-1])


def test_a_bloom_in_the_middle_is_in_the_middle_of_the_image() -> None:
    (entry,) = flower_entries(ORIGIN, [], [(2.0, 0.0)])
    width, height = IMAGE_PX
    assert entry == {
        "class": PEST,
        "confidence": 0.8,
        "bbox_xyxy": pytest.approx(
            [width / 2 - 20.0, height / 2 - 20.0, width / 2 + 20.0, height / 2 + 20.0]
        ),
        "track_id": None,
        "class_name": "bug",
    }


def test_only_the_nearest_box_is_looked_into_and_only_what_is_in_view_is_seen() -> None:
    far = Plate("9", 3.0, 0.0, math.pi, (3.0, 0.0))
    assert flowers(ORIGIN, far, PLATE) == flowers(ORIGIN, PLATE)
    assert flowers(ORIGIN) == []
    aside = flowers(FloorPose(0.0, 0.0, 0.4), PLATE)
    assert 0 < len(aside) < len(blooms_of("7"))
    assert all(detection.bearing > 0.0 for detection in aside), "it looks to the left of them"
    assert flowers(FloorPose(0.0, 0.0, math.pi), PLATE) == []


def test_a_stray_pest_is_seen_where_no_tag_is_and_only_there() -> None:
    """Beside a tag the camera looks into its box."""

    def bearings(pose: FloorPose, *plates: Plate) -> list[float]:
        frame = json.dumps(flower_entries(pose, plates, [(2.0, 0.0)]))
        found, problems = read_flowers(frame, CLASSES, IMAGE_PX[0])
        assert problems == []
        return [detection.bearing for detection in found if detection.name == CLASSES[PEST]]

    assert bearings(ORIGIN) == [pytest.approx(0.0)]
    assert bearings(FloorPose(0.0, 0.0, 0.25)) == [pytest.approx(0.5)], "to the right of where it looks"
    assert bearings(FloorPose(0.0, 0.0, math.pi)) == []
    assert bearings(ORIGIN, PLATE) == []
