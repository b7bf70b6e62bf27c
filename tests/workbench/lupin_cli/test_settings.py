"""`name=value`: read as the declared type, every problem told at once."""

from __future__ import annotations

from typing import Any

import pytest

from lupin_cli.settings import of_nodes, of_the_mission, settings_in
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.types import (
    BOOL,
    COUNT,
    DURATION,
    INTEGER,
    LENGTH,
    POSE,
    TEXT,
    Type,
    list_of,
    number_in,
    within,
)

DECLARED = {
    "timeout_s": Parameter(DURATION, 60.0, "a time", minimum=1.0),
    "share": Parameter(number_in(""), 0.2, "a share", maximum=1.0),
    "tries": Parameter(COUNT, 2, "a count"),
    "look": Parameter(BOOL, False, "a flag"),
    "preset": Parameter(TEXT, "home", "a text"),
    "tags": Parameter(list_of(TEXT), [], "a list"),
    "dock": Parameter(POSE, {"x": 0.0, "y": 0.0, "yaw": 0.0}, "a pose"),
}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("timeout_s=90 s", 90.0),
        ("timeout_s=1.5 min", 90.0),
        ("share=35 %", pytest.approx(0.35)),
        ("tries=3", 3),
        ("look=true", True),
        ("look=no", False),
        ("preset=5", "5"),
        ("preset=a=b", "a=b"),
        ("tags=1,5, 12", ["1", "5", "12"]),
        ("tags=[1, '5']", ["1", "5"]),
        ("tags=", []),
        ("dock={x: 1 m, y: 200 cm, yaw: 90 deg}", {"x": 1.0, "y": 2.0, "yaw": pytest.approx(1.5707963)}),
        ("dock=[1 m, 2 m, 0 rad]", {"x": 1.0, "y": 2.0, "yaw": 0.0}),
    ],
)
def test_a_value_is_read_as_its_type(text: str, value: Any) -> None:
    """Text stays text also when it looks like a number; units may be written."""
    assert settings_in("--set", [text], DECLARED) == ({text.partition("=")[0]: value}, [])


def test_only_what_was_given_is_returned() -> None:
    """The node has its own defaults; the last of two wins."""
    assert settings_in("--set", ["tries=3", "tries=4"], DECLARED) == ({"tries": 4}, [])
    assert settings_in("--set", [], DECLARED) == ({}, [])


def test_every_problem_is_told() -> None:
    """In one run, each with what is allowed."""
    given = [
        "tries",
        "=5",
        "timeout=5",
        "timeout_s=0.1 s",
        "look=maybe",
        "tries=1.5",
        "share=5 s",
        "dock=[1 m, 2 m]",
    ]
    assert settings_in("--set", given, DECLARED)[1] == [
        "--set: 'tries' has no '='; write --set NAME=VALUE",
        "--set: '=5' has no name before its '='; write --set NAME=VALUE",
        "--set: unknown parameter 'timeout'; did you mean 'timeout_s'?",
        "--set: parameter 'timeout_s': expected duration of at least 1 s, got '0.1 s'",
        "--set: parameter 'look': expected bool, got 'maybe'; write true or false",
        "--set: parameter 'tries': expected count, got 1.5",
        "--set: parameter 'share': expected number, got '5 s'; write a number without a unit, or in %",
        "--set: parameter 'dock': expected pose with the fields x, y, yaw, got ['1 m', '2 m']",
    ]


def test_a_number_says_its_unit_as_in_a_file() -> None:
    """Seconds or minutes is no guess of ours; a plain number has none to say."""
    _, problems = settings_in("--set", ["timeout_s=90", "share=0.3", "dock=[1, 2 m, 0 rad]"], DECLARED)
    assert problems == [
        "--set: parameter 'timeout_s': 90 has no unit; write '90 s'",
        "--set: parameter 'dock': x: 1 has no unit; write '1 m'",
    ]


WARD = Type(
    "record", "ward", fields={"id": TEXT, "floor": INTEGER, "pose": POSE, "door": within(LENGTH, 0.5, 3.0)}
)
WARDS = {
    "wards": Parameter(list_of(WARD), [], "the places"),
    "few": Parameter(within(list_of(WARD), 1, 2), [], "some of them"),
}
OTHERS = [
    ('wards=[{"id": "lab", "floor": 1', """unfinished: it ends after '{"id": "lab", "floor": 1'"""),
    ("wards=[{id: 'a]", """unfinished: it ends after "[{id: 'a]\""""),
    (
        "wards=[{id: a}}]",
        "cannot be read from letter 9 on, after '[{id: a}': expected ',' or ']', but got '}'",
    ),
    ("wards=", "expected list of ward, got ''; write [] for an empty list"),
    ("wards=maternity", "expected list of ward, got 'maternity'"),
    ("wards={id: lab}", "expected list of ward, got a record alone; a list is wanted: write [ ... ]"),
    ("wards=[{id: a, id: b}]", "a record has 'id' twice; leave one out"),
    ("wards=[lab]", "[0]: expected ward with the fields id, floor, pose, door, got 'lab'"),
    ("few=[]", "expected 1 to 2 elements, got 0"),
]


def test_every_mistake_in_a_list_of_records_is_told() -> None:
    """Each with its place, as those of a request are."""
    given = "wards=[{id: lab, flor: 1, pose: {x: 1 m, y: 0 kg, yaw: 0}, door: 20 cm}, {id: 7}]"
    values, problems = settings_in("--set", [given], WARDS)
    assert (values, [one.removeprefix("--set: parameter 'wards': ") for one in problems]) == (
        {},
        [
            "[0].flor: a ward has no 'flor'; did you mean 'floor'?",
            "[0]: floor of ward left out",
            "[0].pose.y: expected length, got '0 kg'; its units are 'mm', 'cm', 'm', 'km'",
            "[0].pose.yaw: 0 has no unit; write '0 rad'",
            "[0].door: expected length between 50 and 300 cm, got '20 cm'",
            "[1]: floor and pose and door of ward left out",
            "[1].id: expected text, got 7",
        ],
    )


@pytest.mark.parametrize(("given", "problem"), OTHERS)
def test_a_list_of_records_that_cannot_be_read_is_told_why(given: str, problem: str) -> None:
    """What is unfinished, and where; what to write instead."""
    name = given.partition("=")[0]
    assert settings_in("--set", [given], WARDS) == ({}, [f"--set: parameter {name!r}: {problem}"])


def test_problems_of_a_node_name_it() -> None:
    """As it has to be written; what can be used is used, so that the rest can be checked with it."""
    values, problems = settings_in("--set", ["tries", "timeout_s=5 m", "look=on"], DECLARED, "reader")
    assert values == {"look": True}
    assert problems == [
        "--set reader: 'reader.tries' has no '='; write --set reader.NAME=VALUE",
        "--set reader: parameter 'timeout_s': expected duration, got '5 m'; "
        "its units are 'ms', 's', 'min', 'h'",
    ]


def test_a_name_that_is_somebody_elses_is_told_so_and_all_names_are_listed_once() -> None:
    """A nearest name goes first: it is a slip of the pen."""
    given = ["trees=1", "backend=mqtt", "colour=red", "smell=sweet"]
    _, problems = settings_in(
        "--set", given, DECLARED, elsewhere=lambda name: "it is a reader's" if name == "backend" else ""
    )
    assert problems == [
        "--set: unknown parameter 'trees'; did you mean 'tries'?",
        "--set: unknown parameter 'backend'; it is a reader's",
        "--set: unknown parameter 'colour'; "
        "allowed: 'dock', 'look', 'preset', 'share', 'tags', 'timeout_s', 'tries'",
        "--set: unknown parameter 'smell'",
    ]


GIVEN = ["preset=a.b", "reader.backend=mqtt", "reader.topic=a/{tag}=b", "other.x=1", "nothing"]


def test_a_setting_with_a_node_before_it_is_the_nodes() -> None:
    """Only a dot of the name counts."""
    assert of_the_mission(GIVEN) == ["preset=a.b", "nothing"]
    assert of_nodes(GIVEN) == {"reader": ["backend=mqtt", "topic=a/{tag}=b"], "other": ["x=1"]}
