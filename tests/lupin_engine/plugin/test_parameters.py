"""Values for parameters: read in their types, and refused in the same words wherever they come from."""

from __future__ import annotations

import re
from typing import Any

import pytest

from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.parameters import accepted, carried_as, sorted_out
from lupin_engine.plugin.types import (
    ANY,
    COUNT,
    DURATION,
    LENGTH,
    NUMBER,
    POSE,
    ROS_NAME,
    TEXT,
    Type,
    list_of,
    number_in,
    one_of,
)

CHOICE = Parameter(one_of("simulator", "recorded", "mqtt"), "simulator", "")
NAME = Parameter(ROS_NAME, "/map", "")


@pytest.mark.parametrize(
    ("spec", "given", "value"),
    [
        (Parameter(DURATION, 5.0, "", maximum=60.0), "1 min", 60.0),
        (Parameter(COUNT, 5, "", minimum=1), 1, 1),
        (CHOICE, "recorded", "recorded"),
        (NAME, "map", "map"),
        (NAME, "~/get_tag_reading", "~/get_tag_reading"),
        (NAME, "/lupin/arm/preset_2", "/lupin/arm/preset_2"),
    ],
)
def test_what_is_allowed_is_taken(spec: Parameter, given: Any, value: Any) -> None:
    """In base units; the ends of a range belong to it."""
    assert accepted(spec, given) == value


@pytest.mark.parametrize(
    ("spec", "given", "told"),
    [
        (
            Parameter(DURATION, 5.0, "", maximum=60.0),
            "2 min",
            "expected duration between 0 and 1 min, got '2 min'",
        ),
        (Parameter(DURATION, 5.0, "", minimum=1.0), -1, "expected duration of at least 1 s, got -1"),
        (Parameter(LENGTH, 0.5, "", maximum=1.5), "2 m", "expected length of at most 1.5 m, got '2 m'"),
        (Parameter(number_in("px"), 5.0, "", minimum=1.0), 0, "expected number in px of at least 1, got 0"),
        (
            Parameter(NUMBER, 0.5, "", 0.0, 1.0),
            float("nan"),
            "expected number, got nan; write a finite number",
        ),
        (Parameter(COUNT, 5, "", 1, 9), 10, "expected count between 1 and 9, got 10"),
        (CHOICE, "mqt", "expected one of simulator, recorded, mqtt, got 'mqt'; did you mean 'mqtt'?"),
        (CHOICE, "", "expected one of simulator, recorded, mqtt, got ''"),
        (CHOICE, 5, "expected text, got 5"),
        (NAME, "a b", "expected ROS name, got 'a b', such as /camera/image_raw"),
        (NAME, "", "expected ROS name, got '', such as /camera/image_raw"),
        (NAME, "/map/", "expected ROS name, got '/map/', such as /camera/image_raw"),
        (NAME, "/2d/map", "expected ROS name, got '/2d/map', such as /camera/image_raw"),
        (NAME, "/map\n", "expected ROS name, got '/map\\n', such as /camera/image_raw"),
    ],
)
def test_what_is_not_allowed_is_told_with_what_is(spec: Parameter, given: Any, told: str) -> None:
    """The whole range, in the unit, and the value as it was written."""
    with pytest.raises(ValueError, match=f"^{re.escape(told)}$"):
        accepted(spec, given)


def test_good_values_are_kept_beside_bad_ones() -> None:
    """So that what depends on them can be checked as well."""
    declared = {"backend": CHOICE, "tries": Parameter(COUNT, 2, ""), "title": Parameter(TEXT, "", "")}
    given = {"tries": 3, "backend": "mqt", "bakend": "mqtt", "title": 7}
    assert sorted_out(declared, given) == (
        {"tries": 3},
        [
            "parameter 'backend': expected one of simulator, recorded, mqtt, got 'mqt'; did you mean 'mqtt'?",
            "unknown parameter 'bakend'; did you mean 'backend'?",
            "parameter 'title': expected text, got 7",
        ],
    )


@pytest.mark.parametrize(
    ("kind", "carried"),
    [
        (POSE, "list of number"),
        (list_of(POSE), "text"),
        (Type("record", "ward", fields={"id": TEXT, "at": POSE}), "text"),
        (list_of(list_of(Type("record", "ward", fields={"id": TEXT}))), "text"),
        (list_of(LENGTH), "list of number"),
        (list_of(list_of(LENGTH)), ""),
        (ANY, ""),
    ],
)
def test_how_a_node_has_a_parameter(kind: Type, carried: str) -> None:
    """A record of numbers as their list, as ever; any other, and those in lists, as JSON."""
    assert carried_as(kind) == carried
