"""Every button in every situation: what was told of a request is what comes of it.

The situations are found by a walk, breadth first: from the start every request, every end of every operation
under way, the next deadline, and the stop, the battery and the servers as they come and go.
"""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart.model import Chart, Kind
from lupin_engine.machine import event as events
from lupin_engine.machine.event import Event
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.memory import Phase
from lupin_engine.machine.step import Step
from lupin_engine.missions.folders import lifecycle_in, mission_files
from lupin_engine.missions.load import load_chart
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.builtin import MISSING
from lupin_engine.plugin.profile import START
from lupin_engine.runtime.explanation import explanation
from lupin_engine.runtime.possible import RequestPreview, requests_of
from lupin_engine.runtime.setup import make_machine
from lupin_engine.sim.scenario import Missions, load_scenario, scenario_files
from lupin_engine.sim.simulation import Simulation
from tests import shipped

ROOT = Path(__file__).parents[3]
#: What the world tells, by the plugins' names of it: a pose is known, the rest comes and goes.
POSE = {"x": 0.5, "y": 0.5, "yaw": 0.0}
TAG = {
    "id": "1",
    "x": 1.0,
    "y": 1.0,
    "facing": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
    "species": "tulip",
    "species_confidence": 0.9,
    "anomaly": False,
    "sightings": 3,
}
TOLD: dict[str, tuple[Any, ...]] = {
    "robot.estop": (True, False),
    "robot.battery": (0.1, 0.9),
    MISSING: (["a server"], []),
    "tags.discovered": ([TAG],),
    "camera.light": (10.0,),
}
#: With these there is more to do at a target.
SETTINGS = {
    "arm_patrol_enabled": True,
    "require_visual_confirmation": True,
    "flower_scan_dwell_s": 2.0,
    "photo_light": 1e6,
}

Told = list[dict[str, Any]]


class Situation:
    """A machine at one moment of the walk."""

    def __init__(self, machine: Machine, now: float) -> None:
        self.machine = machine
        self.now = now

    @property
    def key(self) -> tuple[object, ...]:
        """What makes it another situation for an operator."""
        memory = self.machine.memory
        inputs = (memory.inputs.get(name) for name in ("estop", "missing", "discovered"))
        told = (str(found and found.value) for found in inputs)
        why = memory.mission, memory.context.get("reason")
        held, asked = tuple(sorted(memory.held)), tuple(memory.asked)
        return memory.configuration, held, asked, *memory.levels.items(), *told, *why

    def copy(self) -> Situation:
        """Return a second one that goes its own way."""
        machine = self.machine
        return Situation(Machine(machine.world, pickle.loads(pickle.dumps(machine.memory))), self.now)

    def told(self) -> Told:
        """Return what is told of all requests here."""
        found = RequestPreview(self.machine).news(self.now)
        assert found is not None, "nobody has looked yet"
        return found

    def moves(self) -> Iterator[Event | None]:
        """Yield what can happen next, beside requests; None: the next deadline comes."""
        machine = self.machine
        memory, catalog = machine.memory, machine.chart.catalog
        for attempt in memory.attempts.values():
            if attempt.phase not in (Phase.WAITING, Phase.LOST):
                operation = catalog.operations[attempt.operation]
                given = operation.mock.result
                result = given(attempt.arguments, machine.world.parameters) if callable(given) else given
                yield events.done(attempt.id, result)
                yield from (events.failed(attempt.id, code.name, "scripted") for code in operation.codes[:2])
                yield events.cancelled(attempt.id)
        for value, others in TOLD.items():
            yield from (events.observed(value, other, self.now) for other in others)
        if machine.next_deadline is not None:
            yield None

    def happen(self, move: Event | None) -> Step:
        """Let something happen."""
        if move is not None:
            return self.machine.handle(move, self.now)
        self.now = max(self.now, self.machine.next_deadline or 0.0)
        step = self.machine.advance(self.now)
        assert step is not None
        return step


def rules_of(chart: Chart, event: str) -> list[str]:
    """Return the transitions on a request."""
    return [rule.id for state in chart.states.values() for rule in state.transitions if rule.event == event]


def explained(machine: Machine, now: float, element: str) -> dict[str, Any]:
    """Return what the chart shows of one transition."""
    (rule,) = explanation(machine, element, now)["rules"]
    return dict(rule)


def press(situation: Situation, told: dict[str, Any], request: Event) -> None:
    """Make a request, and hold what comes of it against what was told, and what the chart showed."""
    machine = situation.machine
    before = list(machine.memory.held)
    rules = {rule: explained(machine, situation.now, rule) for rule in rules_of(machine.chart, request.name)}
    step = situation.happen(request)
    can = {rule for rule, shown in rules.items() if shown["possible"]}
    if not told["fields"]:
        assert can == ({*step.taken} & {*rules} if step.accepted else set()), (request, rules)
    held = machine.memory.held
    refusal = step.refusal
    assert {
        "possible": step.accepted,
        "engages": [hold for hold in held if hold not in before],
        "releases": [hold for hold in before if hold not in held],
        "code": refusal.code if refusal else "",
        "reason": refusal.text if refusal else "",
    } == {name: told[name] for name in ("possible", "engages", "releases", "code", "reason")}, request


def begun(chart: Chart) -> Situation:
    """Return where a chart begins, with a robot that knows where it is."""
    machine = make_machine(
        chart, {name: value for name, value in SETTINGS.items() if name in chart.parameters}
    )
    machine.start(0.0)
    machine.handle(events.observed("robot.pose", POSE, 0.0), 0.0)
    return Situation(machine, 0.0)


def walked(chart: Chart) -> list[Situation]:
    """Press every button in every situation; return the situations."""
    first = begun(chart)
    found = {first.key: first}
    waiting = deque([first])
    while waiting:
        here = waiting.popleft()
        come = []
        for told, request in zip(here.told(), requests_of(chart), strict=True):
            event = request.event
            if event.name == START:
                event = Event(START, {**event.data, "mission_id": "walk-1"})
            then = here.copy() if told["possible"] else here
            press(then, told, event)
            come.append(then)
        for move in list(here.moves()):
            come.append(here.copy())
            come[-1].happen(move)
        for there in come:
            if there.key not in found:
                found[there.key] = there
                waiting.append(there)
    return list(found.values())


def rests(chart: Chart) -> set[str]:
    """Return the states in which a chart can be seen: neither passed in a step nor a place of history."""
    kinds = (Kind.FINAL, Kind.HISTORY)
    return {name for name, s in chart.states.items() if s.kind not in kinds and not s.local_name.islower()}


@pytest.mark.slow
def test_what_is_told_comes_true_in_every_state_of_both_missions() -> None:
    """Accepted or refused with that code and sentence, and those holds engaged and released."""
    chart = load_missions((), shipped.catalog()).chart
    met = walked(chart)
    assert rests(chart) - {name for one in met for name in one.machine.memory.configuration} == set()


def test_where_a_state_goes_on_is_no_promise_of_one_that_is_not_active() -> None:
    chart = load_missions((), shipped.catalog()).chart
    ways = [rule for state in chart.states.values() for rule in state.resume_at]
    machine = begun(chart).machine
    told = [explained(machine, 0.0, rule.id) for rule in ways]
    assert [(one["possible"], one["reason"]) for one in told] == [
        (False, f"{chart.states[rule.source].local_name} is not active") for rule in ways
    ]


@pytest.mark.slow
def test_what_is_told_of_answers_comes_true() -> None:
    """The photo round asks the operator: what is no choice now is refused."""
    folder = ROOT / "examples" / "photo_round" / "missions"
    chart = load_chart(lifecycle_in(folder), mission_files(folder), shipped.catalog())
    asking = next(one for one in walked(chart) if one.machine.memory.asked)
    told = {one["request"]: one for one in asking.told() if one["verb"] == "answer"}
    assert [*told] == [*chart.answers]
    assert all(one["possible"] for one in told.values())
    idle = {one["request"]: one["reason"] for one in begun(chart).told()}
    assert idle["answer.as_it_is"] == "the answer 'as_it_is' is refused: nothing is asked"


@pytest.mark.slow
def test_what_was_told_holds_until_something_else_is() -> None:
    """After every step of every war story: no change is overlooked."""
    missions = Missions(shipped.catalog())
    for file in scenario_files([ROOT / "tests" / "scenarios" / "war_stories"]):
        scenario = load_scenario(file, missions.catalog, missions)
        world = missions.world(scenario.chart, scenario.parameters)
        simulation = Simulation(scenario.chart, scenario.script, scenario.parameters, world)
        simulation.begin()
        foresights: dict[Machine, RequestPreview] = {}
        told: Told = []
        while not simulation.is_over and simulation.advance() and simulation.now < scenario.script.limit:
            machine = simulation.machine  # after a crash it is another one
            foresight = foresights.get(machine) or foresights.setdefault(machine, RequestPreview(machine))
            told = foresight.news(simulation.now) or told
            assert told == RequestPreview(machine).news(simulation.now), (file, simulation.now)
            machine.scope.watches.pop()


LIFECYCLE = """\
lifecycle: small
profile: greenhouse
inputs: {pose: {value: robot.pose, freshness: 2 s}}
codes: {lost: {label: nobody knows where the robot is, severity: warn}}
initial: READY
states:
  READY:
    on:
      mission.start: MISSION
      operator.dock:
        - {refuse: lost, guard: not known(input.pose)}
        - READY
  MISSION: {slot: mission, on_done: READY}
  FAULT: {on: {operator.reset: READY}}
"""
MISSION = "mission: Nothing\ninitial: done\nstates: {done: {type: final}}\n"


def small(folder: Path, guard: str) -> Chart:
    """Return a chart that refuses to dock where a guard is true."""
    (folder / "lifecycle.yaml").write_text(
        LIFECYCLE.replace("not known(input.pose)", guard), encoding="utf-8"
    )
    (folder / "nothing.yaml").write_text(MISSION, encoding="utf-8")
    return load_chart(folder / "lifecycle.yaml", [folder / "nothing.yaml"], shipped.catalog())


def docking(foresight: RequestPreview, now: float) -> str | None:
    """Return the code that a request to dock is refused with; None: no news."""
    found = foresight.news(now)
    return None if found is None else next(one["code"] for one in found if one["verb"] == "dock")


def test_what_grows_old_is_news(tmp_path: Path) -> None:
    """Nobody says anything, and a request is refused from then on; its deadline is when to look."""
    machine = begun(small(tmp_path, "not known(input.pose)")).machine
    dock = partial(docking, RequestPreview(machine))
    assert [dock(0.0), dock(1.9)] == ["", None]
    assert machine.next_deadline == 2.0
    assert machine.advance(2.0) is not None
    assert [dock(2.0), dock(9.0)] == ["lost", None]
    machine.handle(events.observed("robot.pose", POSE, 9.0), 9.0)
    assert [dock(9.0), dock(10.0)] == ["", None]


def test_what_the_time_of_day_decides_is_news(tmp_path: Path) -> None:
    """Without a step: whoever tells looks now and then."""
    chart = small(tmp_path, "clock.time >= '06:30' or not known(input.pose)")
    machine = make_machine(chart, {"time_zone": "UTC"})
    machine.start(0.0, ahead=6.5 * 3600.0 - 1.0)
    machine.handle(events.observed("robot.pose", POSE, 0.0), 0.0)
    dock = partial(docking, RequestPreview(machine))
    assert dock(0.5) == ""
    assert dock(1.5) == "lost"


def test_a_start_that_only_its_fields_keep_from_beginning_is_told_as_one() -> None:
    """A form can ask for it with others; what else keeps it is told first."""
    machine = make_machine(shipped.mission("inspection"), {"tag_sequence": ["999"]})
    foresight = RequestPreview(machine)
    machine.start(0.0)

    def starting(now: float) -> tuple[str, bool]:
        (told,) = [one for one in foresight.news(now) or () if one["verb"] == "start"]
        return told["code"], told["fields"]

    assert starting(0.0) == ("not_ready", False)
    (attempt,) = machine.memory.attempts
    machine.handle(events.done(attempt, {}), 1.0)
    assert starting(1.0) == ("unknown_tag", True)
