"""Why something happened, why not, and what is possible: in words that are exact."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from lupin_engine.machine import event as events
from lupin_engine.machine.event import Event
from lupin_engine.machine.requests import Possibility
from lupin_engine.machine.step import Considered
from tests.lupin_engine.machine.charts import PAUSE, PLACE, Bench, chart, expression, fails
from tests.lupin_engine.machine.properties.test_properties import START, World

HERE = "test.yaml:1:1"


def full(source: str, *parts: tuple[str, Any]) -> Any:
    """Return an `and` of parts, each a text and a function."""
    whole = expression(lambda env: all(part(env) for _, part in parts), source)
    return type(whole)(source, PLACE, whole.type, whole.evaluate, parts)


# -- one transition ---------------------------------------------------------------------------------------


def test_a_guard_that_is_false_says_which_part_is() -> None:
    """Every operand of the outermost and/or/not with its value."""
    guard = full("a and b", ("a", lambda env: True), ("b", lambda env: env["event"]["b"]))
    bench = Bench(chart({"A": {"on": {"go": {"target": "A", "id": "A.go", "guard": guard}}}}))
    step = bench.send("go", b=False)
    considered = Considered("A.go", PLACE, "a and b", holds=False, parts=(("a", True), ("b", False)))
    assert step.why == (considered,)
    assert str(considered) == f"A.go ({HERE}): a and b is false: a is true, b is false"


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (lambda env: 0, "0"),
        (lambda env: "", ""),
        (lambda env: env["input"]["x"], "input.x is unknown"),
        (fails, "an error: division by zero"),
    ],
)
def test_a_guard_without_parts_is_told_as_a_whole(value: Any, told: str) -> None:
    """With its value, or what keeps it from having one."""
    rule = {"target": "A", "id": "A.go", "guard": expression(value, "ok")}
    bench = Bench(chart({"A": {"on": {"go": rule}}}, inputs={"x": {}}))
    (one,) = bench.send("go").why
    assert str(one) == f"A.go ({HERE}): ok is false: ok is {told}"


def test_what_is_as_good_as_true_can_be_taken() -> None:
    """The machine asks for truth, not for the word; so does who explains it."""
    rule = {"target": "A", "id": "A.go", "guard": expression(lambda env: 3, "n")}
    bench = Bench(chart({"A": {"on": {"go": rule}}}))
    (go,) = [one for one in bench.machine.explain(0.0) if one.event == "go"]
    assert (go.possible, str(go)) == (True, "go: A.go")


def test_what_waits_for_a_release_says_so() -> None:
    """Whatever its guard is now."""
    one = Considered("A.go", PLACE, "", holds=True, held="pause")
    assert str(one) == f"A.go ({HERE}) waits: pause is engaged"
    assert str(Considered("A.go", PLACE, "", holds=True)) == f"A.go ({HERE}) can be taken"


def test_a_refused_request_says_what_was_considered() -> None:
    """With the data that it came with."""
    guard = full("event.n > 3", ("event.n > 3", lambda env: env["event"]["n"] > 3))
    bench = Bench(chart({"A": {"on": {"operator.dock": {"target": "A", "id": "A.dock", "guard": guard}}}}))
    step = bench.send("operator.dock", n=2)
    assert [str(one) for one in step.why] == [f"A.dock ({HERE}): event.n > 3 is false"]


def test_a_transition_offered_to_two_regions_is_told_once() -> None:
    """It is one transition."""
    regions: dict[str, Any] = {"R": {"states": {"x": {}}}, "S": {"states": {"x": {}}}}
    rule = {"target": "P", "guard": lambda env: False}
    bench = Bench(chart({"P": {"kind": "parallel", "states": regions, "on": {"go": rule}}}))
    assert len(bench.send("go").why) == 1


def test_a_step_in_one_line() -> None:
    """For logs and failing tests."""
    bench = Bench(chart({"A": {"on": {"go": {"target": "B", "id": "A.go"}}}, "B": {}}))
    assert [repr(bench.send("go")), repr(bench.send("go"))] == [
        "<Step 2 at 0: go: A.go>",
        "<Step 3 at 0: go: nobody listens to go>",
    ]
    assert repr(bench.observe("x", 1)) == "<Step 4 at 0: value: nothing>"
    assert bench.steps[0] != bench.steps[1]
    assert (bench.steps[0] == "a step") is False


# -- everything at once -----------------------------------------------------------------------------------


def explained(bench: Bench) -> dict[str, Possibility]:
    """Return what is possible, by event."""
    return {one.event: one for one in bench.machine.explain(bench.now)}


def test_requests_come_first_then_events_by_name() -> None:
    """How operations end and time passes is not asked for; patterns are no names."""
    states = {
        "A": {
            "always": {"target": "B", "guard": lambda env: False},
            "after": {5.0: "B"},
            "on": {"nav.gone": "B", "door.*": "B", "*": "B"},
        },
        "B": {"on": {"zoo": "A"}, "on_done": "A", "on_error": "A", "budget": {5.0: "A"}},
    }
    assert list(explained(Bench(chart(states)))) == [
        "mission.start",
        "operator.abort",
        "operator.dock",
        "operator.pause",
        "operator.reset",
        "operator.resume",
        "operator.skip_current",
        "nav.gone",
        "zoo",
        "always",
    ]


def test_what_is_heard_elsewhere_is_impossible_here() -> None:
    """An event of the chart that nobody listens to in this state."""
    bench = Bench(chart({"A": {}, "B": {"on": {"zoo": "A"}}}))
    assert str(explained(bench)["zoo"]) == "zoo: nobody listens to it here"


def test_each_region_takes_its_own() -> None:
    """The first that can be taken for every leaf."""
    region: dict[str, Any] = {
        "states": {"x": {"on": {"go": [{"target": "x", "guard": lambda env: False}, "y"]}}, "y": {}}
    }
    bench = Bench(chart({"P": {"kind": "parallel", "states": {"R": region, "S": region}}}))
    found = explained(bench)["go"]
    bench.send("go")
    assert (found.taken, len(found.considered)) == (bench.steps[-1].taken, 4)


def test_events_of_plugins_wait_while_held() -> None:
    """As they do when they come."""
    states = {"A": {"on": {"door.open": {"target": "B", "id": "A.open"}}}, "B": {}}
    bench = Bench(chart(states, holds={"pause": PAUSE}))
    bench.send("operator.pause")
    assert str(explained(bench)["door.open"]) == f"door.open: A.open ({HERE}) waits: pause is engaged"
    assert bench.send("door.open").notes == ("door.open waits for the release",)
    assert bench.leaves == ["A"]
    bench.send("operator.resume")
    assert bench.leaves == ["B"]


def test_a_level_is_possible_when_it_is_true() -> None:
    """While it is held back by a hold, it is explained like an event that waits."""
    states = {"A": {"on": {"input.wet": {"target": "B", "id": "A.wet"}}}, "B": {}}
    bench = Bench(chart(states, inputs={"wet": {}}, holds={"pause": PAUSE}))
    assert str(explained(bench)["input.wet"]) == "input.wet: it is not true now"
    bench.send("operator.pause")
    bench.send(events.observed("wet", True, 0.0))
    assert str(explained(bench)["input.wet"]) == f"input.wet: A.wet ({HERE}) waits: pause is engaged"
    bench.send("operator.resume")
    assert bench.leaves == ["B"]


# -- the shipped mission ----------------------------------------------------------------------------------

INSPECTING = "MISSION.InspectionMission.INSPECTING"
NAVIGATING = f"{INSPECTING}.NAVIGATING"


def mission(*happenings: Event) -> World:
    """Return the shipped inspection on its first drive, after what happens there."""
    world = World()
    world.report(-1, "done")
    world.send(START)
    world.report(-1, "done")
    for happening in happenings:
        world.send(happening)
    return world


def told(world: World) -> dict[str, str]:
    """Return what is possible in words, by event; looking must not change anything."""
    before = copy.deepcopy(world.memory)
    found = world.machine.explain(world.now)
    assert world.memory == before
    return {one.event: str(one).removeprefix(f"{one.event}: ") for one in found}


def test_in_ready() -> None:
    """A start is possible; the rest says where it would be."""
    world = World()
    world.report(-1, "done")
    found = told(world)
    assert found.pop("always").endswith(": len(input.missing) > 0 is false")
    assert found == {
        "mission.start": "READY.on.mission.start.2",
        "operator.abort": "abort is not possible in READY; it is possible in RETURNING or a running mission",
        "operator.dock": "dock is not possible in READY; it is possible in a running mission",
        "operator.pause": "pause refused: no mission is running",
        "operator.reset": "reset is not possible in READY; it is possible in FAULT",
        "operator.resume": "resume is not possible in READY because nothing is paused",
        "operator.skip_current": "skip_current is not possible in READY; it is possible in INSPECTING",
        "input.battery.low": "nobody listens to it here",
        "nav.battery_silent": "on.nav.battery_silent.0",
    }


def test_in_a_drive() -> None:
    """What the operator can do; a level is possible when it is true."""
    assert told(mission()) == {
        "mission.start": "start refused: a mission is already running",
        "operator.abort": "MISSION.on.operator.abort.0",
        "operator.dock": "MISSION.on.operator.dock.1",
        "operator.pause": "engages pause",
        "operator.reset": "reset is not possible in INSPECTING NAVIGATING; it is possible in FAULT",
        "operator.resume": "resume is not possible in INSPECTING NAVIGATING because nothing is paused",
        "operator.skip_current": f"{NAVIGATING}.on.operator.skip_current.0",
        "input.battery.low": "it is not true now",
        "nav.battery_silent": "on.nav.battery_silent.0",
    }


def test_while_held() -> None:
    """What says `during` or `releases` does not wait."""
    world = mission(Event("operator.pause"))
    found = told(world)
    assert found["operator.pause"] == "pause refused: paused by the operator"
    assert found["operator.resume"] == "releases pause"
    assert found["operator.abort"] == "MISSION.on.operator.abort.0, releases pause"


def test_while_stopped() -> None:
    """A person cannot resume while the button is pressed, but skip, which moves nothing."""
    world = mission(events.observed("robot.estop", True, 0.0))
    found = told(world)
    assert found["operator.resume"] == "resume refused: e-stop engaged"
    assert found["operator.skip_current"] == f"{NAVIGATING}.on.operator.skip_current.0"
    assert found["operator.dock"] == "MISSION.on.operator.dock.1"
    world.send(events.observed("robot.battery", 0.1, 0.0))
    assert told(world)["input.battery.low"] == "nobody listens to it here", "the robot goes home on release"


def test_on_the_way_home() -> None:
    """With an empty battery nothing keeps the robot from it."""
    world = mission(events.observed("robot.battery", 0.1, 0.0))
    found = told(world)
    assert found["operator.abort"] == "abort refused: returning because the battery is low"
    assert found["operator.pause"] == "pause refused: returning because the battery is low"
    assert found["operator.dock"] == "dock refused: the robot is already returning"
    assert found["input.battery.low"] == "nobody listens to it here"


def test_every_explanation_comes_true() -> None:
    """What was said of a request is what happens when it is made."""
    for setting in ((), (Event("operator.pause"),), (events.observed("robot.battery", 0.1, 0.0),)):
        for verb in ("abort", "dock", "pause", "reset", "resume", "skip_current"):
            world = mission(*setting)
            request = Event(f"operator.{verb}")
            (said,) = [one for one in world.machine.explain(world.now) if one.event == request.name]
            world.send(request)
            step = world.steps[-1]
            assert (step.accepted, step.refusal) == (said.possible, said.refusal)
            assert step.taken[: len(said.taken)] == said.taken
