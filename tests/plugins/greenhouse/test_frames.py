"""The tree of frames: what is found through it, and what is said where nothing is."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from lupin_greenhouse import frames as module
from lupin_greenhouse.frames import HISTORY_S, Frames
from tests.plugins.greenhouse.places import at, is_same


def stamped(parent: str, child: str, x: float, moment: float = 0.0, w: float = 1.0) -> Any:
    """A TransformStamped."""
    stamp = SimpleNamespace(sec=int(moment), nanosec=int((moment % 1.0) * 1e9))
    return SimpleNamespace(
        header=SimpleNamespace(frame_id=parent, stamp=stamp),
        child_frame_id=child,
        transform=SimpleNamespace(
            translation=SimpleNamespace(x=x, y=0.0, z=0.0),
            rotation=SimpleNamespace(x=0.0, y=0.0, z=0.0, w=w),
        ),
    )


def test_a_frame_is_found_through_those_between() -> None:
    a, b, c = at(1.0, 2.0, yaw=1.0), at(3.0, yaw=-2.0), at(0.5, 0.1, 0.7)
    frames = Frames()
    frames.add("camera", "tag_7", c, 1.0)
    frames.add("odom", "camera", b, 1.0)
    frames.add("/map", "/odom", a, 0.0, static=True)
    found = frames.find("map", "tag_7")
    assert found is not None
    assert is_same(found, a @ b @ c)


def test_a_frame_that_does_not_hang_below_the_other_is_not_found() -> None:
    frames = Frames()
    frames.add("camera", "tag_7", at(), 1.0)
    assert frames.find("map", "tag_7") is None
    assert frames.find("map", "tag_8") is None
    frames.add("tag_7", "camera", at(), 1.0)
    assert frames.find("map", "tag_7") is None, "it goes in circles"


def test_a_tag_is_placed_by_where_the_camera_was_when_it_saw_it() -> None:
    """A robot that has driven on must not take the tag with it."""
    frames = Frames()
    for moment in (0.0, 1.0, 2.0, 3.0):
        frames.add("map", "camera", at(moment), moment)
    frames.add("camera", "tag_7", at(1.0), 1.5)
    found = frames.find("map", "tag_7")
    assert found is not None
    assert found.position.tolist() == pytest.approx([2.5, 0.0, 0.0])


def test_a_tag_seen_before_the_camera_was_known_is_not_placed() -> None:
    frames = Frames()
    frames.add("camera", "tag_7", at(1.0), 1.5)
    frames.add("map", "camera", at(), 2.0)
    assert frames.find("map", "tag_7") is None
    frames.add("camera", "tag_7", at(1.0), 2.5)
    frames.add("map", "camera", at(), 3.0)
    assert frames.find("map", "tag_7") is not None


def test_a_robot_that_lost_its_way_places_no_new_tags() -> None:
    frames = Frames()
    frames.add("map", "odom", at(), 1.0)
    frames.add("odom", "camera", at(), 2.0)
    frames.add("camera", "tag_7", at(), 2.0)
    assert frames.find("map", "tag_7") is None


def test_an_old_view_is_forgotten_with_where_the_camera_was_then() -> None:
    frames = Frames()
    frames.add("map", "camera", at(), 0.0)
    frames.add("camera", "tag_7", at(), 0.0)
    frames.add("map", "camera", at(), HISTORY_S + 1.0)
    assert frames.find("map", "tag_7") is None


def test_what_was_overtaken_is_left_out_and_a_clock_set_back_begins_anew() -> None:
    frames = Frames()
    frames.add("map", "camera", at(5.0), 100.0)
    frames.add("map", "camera", at(1.0), 99.0)
    found = frames.find("map", "camera")
    assert found is not None
    assert found.position[0] == 5.0
    frames.add("map", "camera", at(2.0), 3.0)
    found = frames.find("map", "camera")
    assert found is not None
    assert found.position[0] == 2.0


def test_a_frame_with_another_parent_begins_anew() -> None:
    frames = Frames()
    frames.add("left", "tag_7", at(1.0), 1.0)
    frames.add("map", "tag_7", at(2.0), 0.5)
    found = frames.find("map", "tag_7")
    assert found is not None
    assert found.position[0] == 2.0


def test_a_tag_that_two_cameras_see_in_turn_is_found_through_each() -> None:
    """Their pictures are a moment newer than what the robot says of itself."""
    frames = Frames()
    frames.add("base_link", "left", at(0.1), 0.0, static=True)
    frames.add("base_link", "right", at(0.2), 0.0, static=True)
    for moment in (1.0, 2.0, 3.0):
        frames.add("map", "base_link", at(moment), moment)
        frames.add("left", "tag_7", at(1.1), moment + 0.1)
        frames.add("right", "tag_7", at(1.0), moment + 0.2)
    found = frames.find("map", "tag_7")
    assert found is not None
    assert found.position.tolist() == pytest.approx([4.2, 0.0, 0.0])
    frames.add("left", "tag_7", at(1.1), 3.3)
    found = frames.find("map", "tag_7")
    assert found is not None
    assert found.position.tolist() == pytest.approx([4.2, 0.0, 0.0])


def test_parents_without_end_take_no_room_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_FRAMES", 3)
    frames = Frames()
    for number in range(10):
        frames.add(f"parent_{number}", "tag_7", at(), float(number))
    assert len(frames._resting) <= 3


def test_there_is_room_for_so_many_frames_and_those_known_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_FRAMES", 2)
    frames = Frames()
    assert frames.add("map", "a", at(), 1.0)
    assert frames.add("map", "b", at(), 1.0)
    assert not frames.add("map", "c", at(), 1.0)
    assert frames.add("map", "a", at(3.0), 2.0)
    found = frames.find("map", "a")
    assert found is not None
    assert found.position[0] == 3.0


def test_transforms_are_taken_as_they_come_in_messages() -> None:
    frames = Frames()
    assert frames.take([stamped("/map", "odom", 1.0)], static=True) == []
    assert frames.take([stamped("odom", "base_link", 2.0, 5.5), stamped("odom", "base_link", 3.0, 6.0)]) == []
    found = frames.find("map", "/base_link")
    assert found is not None
    assert found.plane == (4.0, 0.0)


def test_what_is_no_transform_is_left_out_and_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_FRAMES", 1)
    frames = Frames()
    bad = [stamped("map", "a", math.nan), stamped("map", "a", 1.0, w=0.0), stamped("map", "a", 1.0)]
    assert frames.take([*bad, stamped("map", "b", 1.0), stamped("map", "c", 1.0)]) == [
        "a transform without a finite place and rotation left out",
        "more than 1 frames; further ones left out",
    ]
    assert frames.find("map", "a") is not None


def test_a_moving_frame_that_nobody_tells_of_any_more_is_not_found() -> None:
    """Asked for what was heard of since a moment: an old place of a robot is none."""
    frames = Frames()
    frames.add("map", "odom", at(), 0.0, static=True, heard=0.0)
    frames.add("odom", "base_link", at(2.0), 500.0, heard=10.0)
    frames.add("base_link", "camera", at(1.0), 500.0, heard=11.0)
    assert frames.find("map", "camera", since=10.0) is not None
    assert frames.find("map", "camera", since=10.5) is None
    assert frames.find("map", "camera") is not None
    assert frames.gap("map", "camera", since=10.5) == "the transforms of base_link have ceased"
    assert frames.gap("map", "camera", since=12.0) == "the transforms of camera, base_link have ceased"
    assert frames.take([stamped("odom", "base_link", 3.0, 501.0)], heard=12.0) == []
    assert frames.find("map", "camera", since=10.5) is not None


def test_a_clock_that_stands_still_is_no_news() -> None:
    frames = Frames()
    frames.add("map", "camera", at(1.0), 7.0, heard=1.0)
    frames.add("map", "camera", at(9.0), 7.0, heard=5.0)
    assert frames.find("map", "camera", since=2.0) is None


# --- what is missing


def test_the_frame_that_hangs_nowhere_is_named() -> None:
    frames = Frames()
    text = "no transform leads from tag_7 to map: nothing says where {} is"
    assert frames.gap("map", "tag_7") == text.format("tag_7")
    frames.add("camera", "tag_7", at(), 1.0)
    frames.add("base_link", "camera", at(), 1.0)
    assert frames.gap("/map", "/tag_7") == text.format("base_link")
    frames.add("tag_7", "base_link", at(), 1.0)
    assert frames.gap("map", "tag_7") == text.format("tag_7"), "it goes in circles"


def test_clocks_that_disagree_are_told_with_how_far_they_are_apart() -> None:
    """Of the frames on the way the one that ends first and the one that begins last: an hour lies between."""
    frames = Frames()
    for camera, base, tag in ((10.0, 3605.0, 3610.0), (11.0, 3612.0, 3611.0)):
        frames.add("map", "odom", at(), 0.0, static=True)
        frames.add("odom", "base_link", at(), base)
        frames.add("base_link", "camera", at(), camera)
        frames.add("camera", "tag_7", at(), tag)
    assert frames.find("map", "tag_7") is None
    assert frames.gap("map", "tag_7") == (
        "no moment has all transforms from tag_7 to map: those of camera end 3599.0 s before those of tag_7 "
        "begin, so one has ceased, or two clocks disagree"
    )


def test_one_stamp_from_the_future_does_no_lasting_harm() -> None:
    frames = Frames()
    frames.add("map", "camera", at(1.0), 10.0)
    frames.add("map", "camera", at(9.0), 3600.0)
    frames.add("map", "camera", at(2.0), 10.5)
    found = frames.find("map", "camera")
    assert found is not None
    assert found.plane == (2.0, 0.0)


def test_a_transform_that_is_told_ahead_of_its_time_waits_for_it() -> None:
    """Localizers date the map's transform ahead; the robot's own transform says what time it is."""
    frames = Frames()
    for moment in (0.0, 0.5, 1.0):
        frames.add("map", "odom", at(moment), moment + 1.0)
        frames.add("odom", "base_link", at(), moment)
    found = frames.find("map", "base_link")
    assert found is not None
    assert found.plane == (0.0, 0.0), "where the map was at 1.0 s, not what is foretold for 2.0 s"
