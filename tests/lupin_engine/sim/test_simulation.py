"""Simulations: virtual time, scripted servers, and the story that they tell."""

from __future__ import annotations

from itertools import pairwise

import pytest

from lupin_engine.errors import LupinError
from lupin_engine.machine.event import Start
from lupin_engine.plugin.mocks import contains
from lupin_engine.runtime import engine
from lupin_engine.sim.narration import narrate, short_name, shorten
from lupin_engine.sim.scripted import MockOutcome, Rule
from lupin_engine.sim.simulation import Ask, Happening, Run, Script, SetValue, simulate
from tests import shipped


def inspection(*tags: str, **more: object) -> Run:
    """Simulate an inspection of `tags`."""
    request = {"tag_sequence": list(tags)} if tags else {}
    script = Script("InspectionMission", request, **more)  # type: ignore[arg-type]
    return simulate(shipped.mission("inspection"), script)


def test_a_whole_greenhouse_takes_no_time() -> None:
    """All 29 tags in virtual time: a minute and a half of it, none of ours."""
    run = inspection()
    assert (run.ended, len(run.visits), {visit.status for visit in run.visits}) == (True, 29, {"OK"})
    assert run.seconds == pytest.approx(0.5 + 29 * 3.2 + 3.0)


def test_the_limit_cuts_a_simulation_off() -> None:
    """Time ends where the script says."""
    run = inspection("1", "2", limit=4.0)
    assert (run.cut_off, run.seconds, run.ended) == (True, 4.0, False)
    assert [visit.status for visit in run.visits] == ["OK", ""]


def test_a_mission_in_which_nothing_takes_time_does_not_go_on_for_ever(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A search for frontiers that are found and reached at once never comes to the end of its time."""
    monkeypatch.setattr(engine, "MOST_AT_ONCE", 500)
    rules = [Rule(name, (MockOutcome(after=0.0),)) for name in ("nav.choose_frontier", "nav.go_to")]
    script = Script("ExplorationMission", rules=tuple(rules))
    with pytest.raises(LupinError) as caught:
        simulate(shipped.mission("exploration"), script)
    assert str(caught.value) == (
        "time stands still: more than 500 things happen at one moment;"
        " nav.choose_frontier, nav.go_to begin and end over and over, so let one of them take time"
    )


def test_a_mission_that_waits_for_an_operator_ends_the_simulation() -> None:
    """When nothing more will happen there is nothing to wait for."""
    run = inspection("1", happenings=(Happening(Ask("operator.pause"), 1.0),))
    assert (run.cut_off, run.view.paused, run.ended) == (False, True, False)


def test_happenings_count_from_the_start_or_from_a_state() -> None:
    """`nth` counts the entries of a state, `after` the seconds from there."""
    pause = Happening(Ask("operator.pause"), 1.0, "NAVIGATING", nth=2)
    resume = Happening(Ask("operator.resume"), 60.0)
    run = inspection("1", "2", happenings=(pause, resume))
    asked = [(step.time, step.event.name) for step in run.steps if step.accepted is not None]
    assert asked == [
        (0.0, "mission.start"),
        (pytest.approx(4.7), "operator.pause"),
        (60.0, "operator.resume"),
    ]
    assert run.ended


def test_what_never_happened_is_told() -> None:
    """A happening that waits for a state which is not entered is not forgotten."""
    never = Happening(SetValue("robot.estop", True), 0.0, "FAULT")
    assert inspection("1", happenings=(never,)).unfired == (never,)


NAV, BRIDGE = "action server navigate_to_pose", "service get_tag_reading"


def missing(*changes: tuple[float, list[str]]) -> tuple[Happening, ...]:
    """Tell what the plugins wait for, from these times on."""
    return tuple(Happening(SetValue("plugins.missing", names), at) for at, names in changes)


@pytest.mark.parametrize("rule", [(), (Rule("plugins.ready", (MockOutcome(never=True),)),)])
def test_nobody_is_ready_while_something_is_missing(rule: tuple[Rule, ...]) -> None:
    """The wait ends when the list is told to be empty, and not before, whatever its mock says."""
    happenings = missing((0.0, [NAV]), (1.0, [NAV, BRIDGE]), (20.0, []))
    run = inspection("1", rules=rule, happenings=happenings)
    assert [step.time for step in run.steps if "READY" in step.entered] == [20.0]
    assert run.ended


def test_the_detail_of_a_wait_in_vain_is_what_was_missing_last() -> None:
    """As the node tells it."""
    run = inspection("1", happenings=missing((0.0, [NAV]), (1.0, [NAV, BRIDGE])))
    assert (run.view.lifecycle, run.view.code, run.view.detail) == (
        "FAULT",
        "dependency_timeout",
        f"{NAV}, {BRIDGE}",
    )


def test_a_wait_that_begins_while_something_is_missing_says_so() -> None:
    """What was told before is told again to who begins to wait."""
    run = inspection("1", starts=False, happenings=missing((5.0, [NAV])))
    assert (run.history.lifecycles, run.view.detail) == (["BOOT", "READY", "BOOT", "FAULT"], NAV)


def test_rules_are_tried_in_order() -> None:
    """The first rule that covers an attempt and is not spent decides; then the plugin's mock."""
    rules = (
        Rule(
            "nav.go_to", (MockOutcome(code="nav_status_6", after=1.0), MockOutcome()), target="2", once=True
        ),
        Rule("nav.go_to", (MockOutcome(after=10.0),), target="3"),
    )
    run = inspection("1", "2", "3", rules=rules)
    drives = [
        step.time
        for step in run.steps
        for c in step.commands
        if isinstance(c, Start) and "go_to" in c.operation
    ]
    assert [round(second - first, 3) for first, second in pairwise(drives)] == [
        3.2,
        2.0,
        3.2,
    ]
    assert run.seconds == pytest.approx(0.5 + 3.2 + 2.0 + 3.2 + 10.2 + 3.0)


@pytest.mark.parametrize(
    ("whole", "part", "expected"),
    [
        ({"a": {"x": 1, "y": 2}}, {"a": {"x": 1}}, True),
        ({"a": {"x": 1, "y": 2}}, {"a": {"x": 2}}, False),
        ({"a": 1}, {}, True),
        ({"a": 1}, {"b": 1}, False),
        ({"a": 1}, {"a": {"x": 1}}, False),
        ({"a": [1, 2]}, {"a": [1]}, False),
        ({"a": 0.1 + 0.2}, {"a": 0.3}, True),
        ({"a": 2.4113515}, {"a": 2.41135}, True),
        ({"a": 2.4113515}, {"a": 2.411}, False),
        ({"a": 6e-17}, {"a": 0.0}, True),
        ({"a": 1e-6}, {"a": 0.0}, False),
        ({"a": [{"x": 0.3, "y": 1.0}]}, {"a": [{"x": 0.1 + 0.2}]}, True),
        ({"a": [{"x": 0.3}, {"x": 0.4}]}, {"a": [{"x": 0.3}]}, False),
        ({"a": [{"x": 0.3}, {"x": 0.4}]}, {"a": [{"x": 0.4}, {"x": 0.3}]}, False),
    ],
)
def test_arguments_need_only_contain_what_is_named(whole: object, part: object, expected: bool) -> None:
    """Records by the fields that the script names, computed numbers to six digits, all else as a whole."""
    assert contains(whole, part) is expected


STORY = """\
     0.0 s  start   -> BOOT   start plugins.ready
     0.0 s  plugins.ready done   -> READY
     0.0 s  mission.start accepted   -> PREPARE.LOCALIZING   start nav.localize(max_variance: 0.25)
     0.4 s  robot.estop = true   warn estop_engaged   hold estop engaged
     0.5 s  nav.localize done   the answer of nav.localize waits for the release
     0.6 s  operator.resume REFUSED: resume refused: e-stop engaged
     0.7 s  robot.estop = false"""


def test_a_story_is_told_in_lines() -> None:
    """One line a step: time, event, where it led, what was commanded, why not."""
    happenings = (
        Happening(SetValue("robot.estop", True), 0.4),
        Happening(Ask("operator.resume"), 0.6),
        Happening(SetValue("robot.estop", False), 0.7),
    )
    run = inspection("1", happenings=happenings)
    assert "\n".join(str(line) for line in narrate(run.chart, run.history)) == STORY


def test_states_are_called_as_they_are_published() -> None:
    """The slot and the mission that stands in it are left out."""
    given = shipped.mission("inspection")
    assert short_name(given, "MISSION.InspectionMission.INSPECTING.SCANNING") == "INSPECTING.SCANNING"
    assert short_name(given, "RETURNING.DOCKED") == "RETURNING.DOCKED"
    assert short_name(given, "MISSION") == "MISSION"


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (True, "true"),
        (1.23456, "1.235"),
        ({"x": 1.0, "y": [1, 2]}, "{x 1, y [1, 2]}"),
        ("a" * 60, "a" * 45 + "..."),
    ],
)
def test_values_are_told_in_few_characters(value: object, expected: str) -> None:
    """A story fits on a screen."""
    assert shorten(value) == expected
