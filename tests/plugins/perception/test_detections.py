"""The JSON of the detectors: what is read, and what is left out and told."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_perception.detections import (
    MAX_ENTRIES,
    MAX_TEXT,
    Detection,
    TagSeen,
    read_flowers,
    read_tags,
)

CLASSES = ["tulip_red", "tulip_white", "tulip_pink", "bug"]


def flowers(*entries: Any) -> tuple[list[Detection], list[str]]:
    return read_flowers(json.dumps(entries), CLASSES, 640.0)


def flower(**changed: Any) -> dict[str, Any]:
    return {"class": 0, "confidence": 0.9, "bbox_xyxy": [300, 100, 340, 150]} | changed


def test_a_frame_of_tags_is_read() -> None:
    text = json.dumps([{"id": 7, "corners": [[1, 2]] * 4, "dist": 1.25}, {"id": "12", "dist": 0}, {"id": 3}])
    assert read_tags(text) == ([TagSeen("7", 1.25), TagSeen("12", math.inf), TagSeen("3", math.inf)], [])


def test_a_frame_without_tags_is_read_too() -> None:
    assert read_tags("[]") == ([], [])


def test_of_one_tag_seen_twice_in_a_frame_the_nearer_counts() -> None:
    text = json.dumps([{"id": 7, "dist": 2.0}, {"id": 7, "dist": 1.0}, {"id": 7, "dist": 0.0}])
    assert read_tags(text)[0] == [TagSeen("7", 1.0)]


BAD_ID = "an id is no whole number from 0 to 2147483647"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "no JSON"),
        ("[{", "no JSON"),
        ("[" * 100_000, "no JSON"),
        ("[" + "9" * 5000 + "]", "no JSON"),
        ("null", "no list"),
        ('{"id": 7}', "no list"),
        ("[7]", "an entry is no object"),
        ("[[]]", "an entry is no object"),
        ("[{}]", BAD_ID),
        ('[{"id": true}]', BAD_ID),
        ('[{"id": 7.0}]', BAD_ID),
        ('[{"id": -1}]', BAD_ID),
        ('[{"id": 2147483648}]', BAD_ID),
        ('[{"id": "²"}]', BAD_ID),
        ('[{"id": "../7"}]', BAD_ID),
        ('[{"id": "' + "1" * 400 + '"}]', BAD_ID),
        ('[{"id": 7, "dist": NaN}]', "a dist is no finite number"),
        ('[{"id": 7, "dist": 1e999}]', "a dist is no finite number"),
        ('[{"id": 7, "dist": ' + "9" * 400 + "}]", "a dist is no finite number"),
        ('[{"id": 7, "dist": "near"}]', "a dist is no finite number"),
        ("[" + "{}," * MAX_ENTRIES + "{}]", f"more than {MAX_ENTRIES} entries"),
        (" " * MAX_TEXT + "[]", f"more than {MAX_TEXT} characters"),
    ],
    ids=range(22),
)
def test_what_is_no_frame_of_tags_is_left_out_and_told(text: str, problem: str) -> None:
    assert read_tags(text) == ([], [problem])


def test_one_bad_entry_does_not_spoil_the_frame_and_is_told_once() -> None:
    text = json.dumps([{"id": "x"}, {"id": 7, "dist": 1.0}, {"id": "y"}])
    assert read_tags(text) == ([TagSeen("7", 1.0)], [BAD_ID])


def test_an_unknown_key_is_ignored_and_told() -> None:
    text = json.dumps([{"id": 7, "dist": 1.0, "hamming": 0}])
    assert read_tags(text) == ([TagSeen("7", 1.0)], ["keys besides corners, dist, id are ignored"])


def test_a_frame_of_flowers_is_read() -> None:
    named = flower(class_name="tulip_pink", track_id=5, bbox_xyxy=[0, 0, 0, 10])
    assert flowers(flower(), named) == (
        [Detection("tulip_red", 0.9, 0.0), Detection("tulip_pink", 0.9, -1.0)],
        [],
    )


def test_a_name_of_the_class_wins_over_its_number_unless_it_is_empty() -> None:
    found, _ = flowers(flower(class_name="bug"), flower(class_name=""), flower(class_name=None))
    assert [detection.name for detection in found] == ["bug", "tulip_red", "tulip_red"]


BAD_CLASS = "a class is none of tulip_red, tulip_white, tulip_pink, bug"
BAD_CONFIDENCE = "a confidence is no number from 0 to 1"
BAD_BOX = "a bbox_xyxy is not four finite numbers"


@pytest.mark.parametrize(
    ("changed", "problem"),
    [
        ({"class": 4}, BAD_CLASS),
        ({"class": -1}, BAD_CLASS),
        ({"class": True}, BAD_CLASS),
        ({"class": None}, BAD_CLASS),
        ({"class_name": "rose"}, BAD_CLASS),
        ({"confidence": None}, BAD_CONFIDENCE),
        ({"confidence": math.nan}, BAD_CONFIDENCE),
        ({"confidence": 1.01}, BAD_CONFIDENCE),
        ({"confidence": -0.01}, BAD_CONFIDENCE),
        ({"bbox_xyxy": None}, BAD_BOX),
        ({"bbox_xyxy": [1, 2, 3]}, BAD_BOX),
        ({"bbox_xyxy": [1, math.nan, 3, 4]}, BAD_BOX),
        ({"bbox_xyxy": [1, 2, math.inf, 4]}, BAD_BOX),
        ({"bbox_xyxy": [1, 2, "3", 4]}, BAD_BOX),
        ({"colour": "red"}, "keys besides bbox_xyxy, class, class_name, confidence, track_id are ignored"),
    ],
)
def test_what_is_no_flower_is_told(changed: dict[str, Any], problem: str) -> None:
    good = flower(**{"class": 1})
    found, problems = flowers(flower(**changed), good)
    assert problems == [problem]
    assert found[-1].name == "tulip_white"
    assert len(found) == (2 if "colour" in changed else 1)


@given(left=st.floats(-1e308, 1e308), right=st.floats(-1e308, 1e308))
def test_a_bearing_is_within_the_image_whatever_the_box(left: float, right: float) -> None:
    ((found,), problems) = flowers(flower(bbox_xyxy=[left, 0, right, 1]))
    assert problems == []
    assert -1.0 <= found.bearing <= 1.0


@given(text=st.text(max_size=200))
def test_no_text_at_all_raises_anything(text: str) -> None:
    tags, tag_problems = read_tags(text)
    found, flower_problems = read_flowers(text, CLASSES, 640.0)
    assert tags or tag_problems or found or flower_problems or json.loads(text) == []
