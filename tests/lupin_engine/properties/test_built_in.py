"""What always holds: each property finds the defect that it is there for, and nothing where all is well."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from lupin_engine.chart.model import Chart
from lupin_engine.machine import event as events
from lupin_engine.machine import operations, requests
from lupin_engine.machine.itineraries import Itineraries
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.operations import Operations
from lupin_engine.machine.scope import World
from lupin_engine.machine.step import Refusal, Step
from lupin_engine.machine.timers import Timers
from lupin_engine.properties.built_in import BUILT_IN, Glance, Monitor, Passage, WatchPlans, due, glance
from lupin_engine.sim.simulation import Script, Simulation
from tests import shipped
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart, fails


class WatchedMachine(Machine):
    """A machine of which every step is judged."""

    def __init__(self, world: World, memory: Any = None) -> None:
        super().__init__(world, memory)
        self.monitor = Monitor(WatchPlans(BUILT_IN))

    def _finish(self) -> Step:
        step = super()._finish()
        self.monitor.take(step, self.scope)
        return step


class WatchedBench(Bench):
    """A bench with such a machine."""

    machine_type = WatchedMachine

    @property
    def breaches(self) -> dict[str, str]:
        """What was broken, with how."""
        assert isinstance(self.machine, WatchedMachine)
        return {name: text for name, (_, text) in self.machine.monitor.breaches.items()}


DRIVING: dict[str, Any] = {
    "A": {
        "invoke": {"do": "nav.go", "timeout": 10.0},
        "on_done": "B",
        "on_error": "B",
        "on": {"operator.dock": {"refuse": "crashed"}, "again": "A"},
    },
    "B": {"entry": "!arm.wave", "on": {"back": "A", "wave": {"do": "!arm.wave", "during": {"pause"}}}},
    "FAULT": {},
}
CLOSE = ("itinerary.close", {"status": "OK"})
REST = ("itinerary.close_rest", {"status": "SKIPPED"})
WALK: dict[str, Any] = {
    "W": {
        "label": "INSPECTING",
        "itinerary": {"items": ["1", "2"]},
        "on": {
            "close": {"do": CLOSE},
            "next": {"do": "itinerary.advance"},
            "end": {"target": "DONE", "do": REST},
        },
        "states": {"V": {"invoke": "bridge.read", "on_done": {"do": CLOSE}, "on_error": {"do": CLOSE}}},
    },
    "DONE": {"entry": "report.summary"},
    "FAULT": {},
}
Way = Callable[[], WatchedBench]


def bench(states: dict[str, Any], **fields: Any) -> WatchedBench:
    """Return a bench with a hold that an operator engages."""
    return WatchedBench(chart(states, holds={"pause": PAUSE}, **fields))


def drive() -> WatchedBench:
    """Drive, pause, go on, be told late, be refused, and arrive."""
    found = bench(DRIVING)
    first = found.attempt
    found.send(events.accepted(first))
    found.send("operator.pause")
    found.wait(1.0)
    found.send(events.done(first, {}))
    found.send("operator.resume")
    found.send("again")
    found.send(events.accepted(found.attempt))
    found.send("operator.dock")
    found.wait(20.0)
    return found


def walk() -> WatchedBench:
    """Visit one target, close it, try to close it again, and end."""
    found = bench(WALK)
    found.send(events.done(found.attempt, {}))
    for event in ("close", "next", "end"):
        found.send(event)
    return found


def enter_held() -> WatchedBench:
    """Come to a state that drives while a hold is engaged."""
    found = bench(
        {"B": {"on": {"go": {"target": "A", "during": {"pause"}}}}, "A": DRIVING["A"], "FAULT": {}} | {}
    )
    found.send("operator.pause")
    found.send("go")
    return found


def fall() -> WatchedBench:
    """Pass through a state that drives."""
    states = {
        "Z": {"on": {"go": "A"}},
        "A": {**DRIVING["A"], "always": {"target": "B", "guard": lambda _: True}},
    }
    found = bench({**states, "B": DRIVING["B"], "FAULT": {}})
    found.send("go")
    return found


def eager(patch: pytest.MonkeyPatch) -> None:
    """Begin operations as soon as a state is entered."""
    original = Machine._microstep

    def microstep(self: Machine, plan: Any, trigger: Any) -> None:
        original(self, plan, trigger)
        self._operations.begin_missing(self._active, self._step)

    patch.setattr(Machine, "_microstep", microstep)


def hears_all(patch: pytest.MonkeyPatch) -> None:
    """Take what is said of a former attempt for the current one's."""

    def report(self: Operations, kind: str, attempt: Any, data: Any, step: Any) -> None:
        invocation = self._scope.memory.invocations[attempt.invocation]
        self._move(attempt, kind, step)
        if kind == "done":
            self._signal("done", invocation, events.Trigger(event=data["result"]), step)

    patch.setattr(Operations, "_report_unwanted", report)


def closes_again(patch: pytest.MonkeyPatch) -> None:
    """Close what is closed."""

    def close(self: Itineraries, walk: Any, outcome: Any, step: Any) -> None:
        self._close(walk, walk.visit, outcome, step)

    patch.setattr(Itineraries, "close", close)


def no_deadline(patch: pytest.MonkeyPatch) -> None:
    """Wait for the end of a cancelled attempt for ever."""
    original = Timers.arm

    def arm(self: Timers, kind: str, *rest: Any) -> None:
        if kind != "cancel":
            original(self, kind, *rest)

    patch.setattr(Timers, "arm", arm)


def nothing(owner: Any, name: str) -> Callable[[pytest.MonkeyPatch], None]:
    """Return a defect: a method that does nothing."""
    return lambda patch: patch.setattr(owner, name, lambda *_: None)


DEFECTS: dict[str, tuple[str, Way, Callable[[pytest.MonkeyPatch], None], str]] = {
    "a drive begins while held": (
        "hold_starts_nothing",
        enter_held,
        lambda patch: patch.setattr(operations, "is_held_back", lambda *_: False),
        "nav.go (a2) is started while pause is engaged",
    ),
    "a hold lets the drive go on": (
        "hold_stops_all",
        drive,
        nothing(Operations, "suspend"),
        "nav.go (a2) is accepted while pause is engaged",
    ),
    "a cancel is waited for without end": (
        "hold_stops_all",
        drive,
        no_deadline,
        "nav.go (a2) is cancelled without a deadline",
    ),
    "an operation begins before the chart is at rest": (
        "no_false_start",
        fall,
        eager,
        "nav.go (a2) is started and cancelled in the same step",
    ),
    "a visit is closed twice": (
        "closed_once",
        walk,
        closes_again,
        "1 reported, but 0 closed; what has a visit is published by closing that, not beside it",
    ),
    "the rest is not closed": (
        "all_closed",
        walk,
        nothing(Itineraries, "close_rest"),
        "the mission ended without a result for 2",
    ),
    "the end of a former attempt counts": (
        "former_attempts",
        drive,
        hears_all,
        "attempt.done of a2, which nobody waits for, leads to A#done#3",
    ),
    "a request is refused in silence": (
        "refusals_have_reasons",
        drive,
        lambda patch: patch.setattr(requests, "Refusal", lambda code, _: Refusal(code, " ")),
        "operator.dock is refused without a reason",
    ),
}


@pytest.mark.parametrize("way", [drive, walk, enter_held, fall])
def test_nothing_is_found_where_all_is_well(way: Way) -> None:
    """The ways that find the defects find none without them."""
    assert way().breaches == {}


@pytest.mark.parametrize("defect", DEFECTS)
def test_a_planted_defect_is_found(defect: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the property that it breaks, and it is told how."""
    name, way, plant, told = DEFECTS[defect]
    plant(monkeypatch)
    assert way().breaches.get(name) == told


def once(states: dict[str, Any], *sent: str, **fields: Any) -> dict[str, str]:
    """Return what is broken after some events."""
    found = bench(states, **fields)
    for event in sent:
        found.send(event)
    if found.started:
        found.send(events.done(found.attempt, {}))
    return found.breaches


def test_an_action_that_moves_while_held_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is the catalog that says which move."""
    monkeypatch.setattr("lupin_engine.properties.built_in.action_moves", lambda *_: True)
    monkeypatch.setattr("lupin_engine.machine.actions.ExecutableContent.resume", lambda *_: None)
    found = bench({"B": {"on": {"wave": {"do": "arm.wave", "during": {"pause"}}}}})
    found.send("operator.pause")
    found.send("wave")
    assert found.breaches == {"hold_starts_nothing": "arm.wave is carried out while pause is engaged"}


def test_that_another_hold_is_released_makes_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    """One of two was engaged all through the step."""
    monkeypatch.setattr("lupin_engine.properties.built_in.action_moves", lambda *_: True)
    wave = {"do": "arm.wave", "during": {"pause"}, "releases": {"stop"}}
    stop = {"engage": "stop", "release": ("operator.resume",), "code": "paused"}
    found = WatchedBench(chart({"B": {"on": {"wave": wave}}}, holds={"pause": PAUSE, "stop": stop}))
    for event in ("operator.pause", "stop", "wave"):
        found.send(event)
    assert found.machine.memory.held == ["pause"]
    assert found.breaches == {"hold_starts_nothing": "arm.wave is carried out while pause is engaged"}


def test_defects_of_a_chart_are_found() -> None:
    """What the checker keeps out of missions, and what it cannot know."""
    assert once(
        {"A": {"on": {"go": {"do": ("set", {"n": fails})}}}, "FAULT": {}}, "go", context={"n": 0}
    ) == {
        "no_execution_error": "test.yaml:1:1: set: division by zero",
    }
    small = {"small": lambda env: env["context"]["n"] < 5}
    grows = {"A": {"on": {"go": {"do": ("set", {"n": 7})}}}, "FAULT": {}}
    assert once(grows, "go", context={"n": 0}, invariants=small) == {
        "invariants": "test.yaml:1:1: invariant small does not hold: small"
    }
    assert once({"A": {"invoke": "nav.go"}, "FAULT": {}})["ends_are_handled"] == (
        "no transition handles the end of the operation of A"
    )
    deaf = {"MISSION": {"label": "INSPECTING", "invoke": "nav.go", "on_done": {"do": "report.clear"}}}
    assert once({**deaf, "FAULT": {}}) == {
        "no_deaf_wait": "nothing is under way in MISSION, and nothing it listens to comes by itself"
    }


def test_what_is_read_before_a_walk_begins_is_no_result_of_it() -> None:
    """The step that publishes the reading of tag 1 begins the visits, that of tag 1 among them."""
    read = ("publish.reading", {"tag": "1", "reading": {"t": 20}})
    found = bench({"A": {"on": {"seen": {"target": "W", "do": read}}}, **WALK})
    found.send("seen")
    assert found.machine.memory.itineraries["W"].begun
    assert [name for name in found.breaches if name == "closed_once"] == []


def test_the_shipped_mission_keeps_them_all() -> None:
    """Each is a pure function of the passage: asked twice it says the same; what was relevant is counted."""
    inspection: Chart = shipped.mission("inspection")
    simulation = Simulation(inspection, Script("InspectionMission", {"tag_sequence": ["1", "2"]}), {})
    monitor, seen = Monitor(WatchPlans(BUILT_IN)), [Glance()]

    def look(step: Step) -> None:
        passage = Passage(seen[-1], step, simulation.machine.scope)
        for one in BUILT_IN:
            state, verdict = one.watch(one.first, passage)
            assert (state, due(state)) == ((), float("inf"))
            assert one.watch(one.first, passage) == (state, verdict)
        seen.append(glance(simulation.machine.memory))
        assert hash(seen[-1]) == hash(glance(simulation.machine.memory))
        monitor.take(step, simulation.machine.scope)

    simulation.listener = look
    simulation.run()
    assert monitor.breaches == {}
    assert monitor.relevant["closed_once"] == 2
    assert monitor.relevant["all_closed"] == 1
    assert len({one.name for one in BUILT_IN}) == len({one.says for one in BUILT_IN}) == len(BUILT_IN)
