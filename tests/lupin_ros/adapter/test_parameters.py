"""Declared parameters as ROS parameters: conversion without a node."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from rclpy.parameter import Parameter as RosParameter

from lupin_engine.errors import PluginError, shortened
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.types import (
    ANY,
    BOOL,
    DURATION,
    INTEGER,
    LENGTH,
    POSE,
    TEXT,
    Type,
    list_of,
    one_of,
    within,
)
from lupin_ros.adapter.parameters import descriptor, read, ros_type, to_ros

ORIGIN = {"x": 0.0, "y": 0.0, "yaw": 0.0}


@pytest.mark.parametrize(
    ("kind", "default", "given", "expected"),
    [
        (DURATION, 1.0, 60, 60.0),
        (DURATION, 1.0, "2 min", 120.0),
        (LENGTH, 1.0, "25 cm", 0.25),
        (BOOL, False, True, True),
        (list_of(TEXT), ["a"], None, []),
        (list_of(LENGTH), [], [1, 2], [1.0, 2.0]),
        (POSE, ORIGIN, [1, 2, 3], {"x": 1.0, "y": 2.0, "yaw": 3.0}),
        (POSE, ORIGIN, ORIGIN, ORIGIN),
        (POSE, None, [], None),
        (POSE, None, None, None),
        (TEXT, None, None, None),
    ],
)
def test_what_ros_delivers_is_read(kind: Any, default: Any, given: Any, expected: Any) -> None:
    assert read("p", Parameter(kind, default, ""), given) == expected


@pytest.mark.parametrize(
    ("kind", "given", "problem"),
    [
        (DURATION, "5 m", "parameter 'p': expected duration, got '5 m'; its units are 'ms', 's', 'min', 'h'"),
        (BOOL, 1, "parameter 'p': expected bool, got 1"),
        (INTEGER, 1.5, "parameter 'p': expected integer, got 1.5"),
        (TEXT, 7, "parameter 'p': expected text, got 7; write \"7\""),
        (list_of(TEXT), [7], "parameter 'p': expected text, got 7; write [\"7\"]"),
        (list_of(TEXT), 7, "parameter 'p': expected list of text, got 7; write [\"7\"]"),
        (list_of(INTEGER), 7, "parameter 'p': expected list of integer, got 7; write [7]"),
        (POSE, 5, "parameter 'p': expected pose with the fields x, y, yaw, got 5; give it as [x, y, yaw]"),
    ],
)
@pytest.mark.parametrize("default", [None, ORIGIN])
def test_what_cannot_be_read_is_told(kind: Any, given: Any, problem: str, default: Any) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(problem)}$"):
        read("p", Parameter(kind, default, ""), given)


@pytest.mark.parametrize(
    ("minimum", "maximum", "problem"),
    [
        (2, None, "parameter 'p': expected integer of at least 2, got 1"),
        (None, 0, "parameter 'p': expected integer of at most 0, got 1"),
        (2, 3, "parameter 'p': expected integer between 2 and 3, got 1"),
    ],
)
def test_ranges_are_told(minimum: float | None, maximum: float | None, problem: str) -> None:
    with pytest.raises(ValueError, match=f"^{problem}$"):
        read("p", Parameter(INTEGER, 2, "", minimum, maximum), 1)


def test_a_type_brings_its_own_range() -> None:
    share = Parameter(Type("number", "share", minimum=0.0, maximum=1.0), 0.5, "", maximum=2.0)
    (told,) = descriptor(share).floating_point_range
    assert (told.from_value, told.to_value) == (0.0, 1.0)
    with pytest.raises(ValueError, match=r"^parameter 'p': expected share between 0 and 1, got 1\.5$"):
        read("p", share, 1.5)


def test_a_choice_is_described_and_refused_like_a_range() -> None:
    backend = Parameter(one_of("simulator", "mqtt"), "simulator", "where readings come from")
    assert descriptor(backend).additional_constraints == "one of simulator, mqtt"
    told = "parameter 'p': expected one of simulator, mqtt, got 'mqt'; did you mean 'mqtt'?"
    with pytest.raises(ValueError, match=f"^{re.escape(told)}$"):
        read("p", backend, "mqt")


def test_values_go_back_with_their_type() -> None:
    empty = to_ros("p", Parameter(list_of(TEXT), [], ""), [])
    assert (empty.type_, empty.value) == (RosParameter.Type.STRING_ARRAY, [])
    assert list(to_ros("p", Parameter(POSE, None, ""), ORIGIN).value) == [0.0, 0.0, 0.0]
    assert to_ros("p", Parameter(TEXT, None, ""), None).type_ == RosParameter.Type.NOT_SET


def test_open_ranges_have_an_end_only_where_there_is_one() -> None:
    (numbers,) = descriptor(Parameter(DURATION, 1.0, "")).floating_point_range
    assert (numbers.from_value, numbers.to_value) == (0.0, float("inf"))
    (integers,) = descriptor(Parameter(INTEGER, 1, "", maximum=5)).integer_range
    assert (integers.from_value, integers.to_value) == (1 - 2**53, 5)
    assert not descriptor(Parameter(TEXT, "", "")).integer_range


@pytest.mark.parametrize(
    ("kind", "described"),
    [(TEXT, "what"), (DURATION, "what [s]"), (POSE, "what [x m, y m, yaw rad]")],
)
def test_units_are_described(kind: Any, described: str) -> None:
    assert descriptor(Parameter(kind, None, "what")).description == described


WARD = Type("record", "ward", fields={"id": TEXT, "floor": INTEGER, "door": LENGTH, "pose": POSE})
ICU = {"id": "icu", "floor": 2, "door": 1.2, "pose": {"x": 1.0, "y": 2.0, "yaw": 0.0}}
FORM = "[{id: text, floor: integer, door: m, pose: {x: m, y: m, yaw: rad}}, ...]"


def test_records_are_json() -> None:
    """It is read back as it was, and described by its fields."""
    wards = Parameter(list_of(WARD), [], "the places")
    sent = to_ros("wards", wards, [ICU])
    assert sent.type_ == RosParameter.Type.STRING
    assert read("wards", wards, sent.value) == [ICU]
    assert read("wards", wards, sent.value.replace("1.2", '"120 cm"')) == [ICU]
    assert descriptor(wards).description == f"the places [JSON, numbers in base units: {FORM}]"
    assert to_ros("ward", Parameter(WARD, None, ""), None).type_ == RosParameter.Type.NOT_SET
    assert read("ward", Parameter(WARD, None, ""), None) is None
    assert read("ways", Parameter(list_of(POSE), [], ""), json.dumps([ORIGIN])) == [ORIGIN]


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ("[{", "unfinished: it ends after '[{'"),
        ('[{"id": "lab", "floor": 1', """unfinished: it ends after '{"id": "lab", "floor": 1'"""),
        ('[{"id": "la', """unfinished: it ends after '[{"id": "la'"""),
        (
            "[{id: 1}]",
            "cannot be read from letter 3 on, after '[{': Expecting property name enclosed in double quotes",
        ),
        ('[{"id": "a", "floor": 1, "floor": 2}]', "a record has 'floor' twice; leave one out"),
        ("lab", "expected list of ward, got 'lab'"),
        ("[" * 100_000, f"expected list of ward, got {shortened('[' * 100_000)!r}"),
        ("{}", "expected list of ward, got a record alone; a list is wanted: write [ ... ]"),
        (json.dumps([{**ICU, "dor": 1}]), "[0].dor: a ward has no 'dor'; did you mean 'door'?"),
        (json.dumps([{**ICU, "pose": {"x": 1}}]), "[0].pose: y and yaw of pose left out"),
        (json.dumps([ICU, {**ICU, "floor": "2"}]), "[1].floor: expected integer, got '2'"),
        (
            json.dumps([{**ICU, "door": "1 s"}]),
            "[0].door: expected length, got '1 s'; its units are 'mm', 'cm', 'm', 'km'",
        ),
    ],
)
def test_records_that_cannot_be_read_are_refused(given: Any, problem: str) -> None:
    told = f"parameter 'wards': {problem}; give it as JSON: {FORM}"
    with pytest.raises(ValueError, match=f"^{re.escape(told)}$"):
        read("wards", Parameter(list_of(WARD), [ICU], ""), given)


def test_every_mistake_is_told_and_very_many_are_counted() -> None:
    """Each has its place; the form of the whole comes once, at the end."""
    wards = Parameter(list_of(WARD), [ICU], "")
    wrong = {**ICU, "flor": 1, "pose": {**ICU["pose"], "y": "0 kg"}, "door": "2"}
    with pytest.raises(ValueError, match=r"^parameter 'wards': ") as refused:
        read("wards", wards, json.dumps([wrong]))
    assert str(refused.value).splitlines() == [
        "parameter 'wards': [0].flor: a ward has no 'flor'; did you mean 'floor'?",
        "parameter 'wards': [0].door: expected length, got '2'; its units are 'mm', 'cm', 'm', 'km'",
        "parameter 'wards': [0].pose.y: expected length, got '0 kg'; its units are 'mm', 'cm', 'm', 'km'"
        f"; give it as JSON: {FORM}",
    ]
    with pytest.raises(ValueError, match=r"^parameter 'wards': ") as refused:
        read("wards", wards, json.dumps([{}] * 100))
    assert str(refused.value).splitlines()[-2:] == [
        "parameter 'wards': [7]: id and floor and door and pose of ward left out",
        f"and 92 more; give it as JSON: {FORM}",
    ]


def test_the_bounds_of_a_list_are_numbers_of_elements() -> None:
    """They are described; a table with too few stays as it was."""
    wards = Parameter(within(list_of(WARD), 1, 2), [ICU], "")
    assert descriptor(wards).additional_constraints == "1 to 2 elements"
    assert descriptor(Parameter(within(list_of(TEXT), 1, None), ["a"], "")).additional_constraints == (
        "at least 1 element"
    )
    with pytest.raises(ValueError, match=r"^parameter 'wards': expected 1 to 2 elements, got 0; give it as"):
        read("wards", wards, "[]")


@pytest.mark.parametrize("kind", [ANY, list_of(list_of(TEXT))])
def test_some_types_cannot_be_ros_parameters(kind: Any) -> None:
    with pytest.raises(PluginError, match="'p'"):
        ros_type("p", kind)
