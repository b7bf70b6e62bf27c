"""`name=value`: read as the declared type, every problem told at once."""

from __future__ import annotations

from typing import Any

import pytest

from lupin_cli.settings import of_nodes, of_the_mission, settings_in
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.types import BOOL, COUNT, DURATION, POSE, TEXT, list_of, number_in

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
