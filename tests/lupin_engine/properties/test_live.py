"""The watch on a robot: what is broken becomes a step of the machine, once, also over a restart."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart.expressions.evaluation import Compiled, Constant, Expression
from lupin_engine.chart.model import Chart, TemporalProperty
from lupin_engine.machine.event import PROPERTY_BROKEN, Event, observed
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.scope import EvaluationScope
from lupin_engine.machine.snapshot import restore
from lupin_engine.machine.step import Step
from lupin_engine.missions.load import load_chart
from lupin_engine.plugin.types import BOOL, DURATION
from lupin_engine.properties.built_in import Glance, Passage, Remembered, glance
from lupin_engine.properties.clauses import breaches
from lupin_engine.properties.live import LiveMonitor
from lupin_engine.runtime.engine import Engine
from lupin_engine.runtime.setup import make_machine
from lupin_engine.sim import scenario_files
from lupin_engine.sim.suite import Suite
from tests import shipped

ROOT = Path(__file__).parents[3]
LIFECYCLE = """\
lifecycle: Watched
inputs:
  estop: {value: robot.estop, initial: false}
  battery: {value: robot.battery, initial: 100 %}
codes: {too_low: {label: the battery is too low, severity: warn}}
holds:
  estop: {engage: input.estop, release: [operator.resume], release_guard: not input.estop, code: too_low}
properties:
  charged: {PROPERTY}
states:
  READY: {on: {mission.start: MISSION}}
  MISSION: {slot: mission, on_done: READY}
  FAULT: {on: {operator.reset: READY}}
initial: READY
"""
MISSION = """\
mission: Stand
states:
  STANDING:
    invoke: {do: nav.go_to, with: {pose: "${ param.dock_pose }"}, timeout: never}
    on_done: done
    on_error: done
    on: {operator.skip_current: done}
  done: {type: final}
"""
NEVER = "never: \"input.battery < '15 %'\""
SOON = "after: \"input.battery < '15 %'\", eventually: \"input.battery > '50 %'\", within: 2 s"
LOW = "property charged (line 9): input.battery < '15 %' became true; it must never be"


def chart_with(folder: Path, says: str) -> Chart:
    """Load a lifecycle with one property."""
    (folder / "lifecycle.yaml").write_text(LIFECYCLE.replace("{PROPERTY}", f"{{{says}}}"), encoding="utf-8")
    (folder / "stand.yaml").write_text(MISSION, encoding="utf-8")
    return load_chart(folder / "lifecycle.yaml", [folder / "stand.yaml"], shipped.catalog())


class Clock:
    """A clock that is set."""

    time = 0.0

    def now(self) -> float:
        """Return the time."""
        return self.time


class Robot:
    """An engine with its watch, whose servers never answer."""

    def __init__(self, chart: Chart, machine: Machine | None = None) -> None:
        self.clock, self.steps, self.made = Clock(), list[Step](), list[tuple[str, str]]()
        self.engine = Engine(
            machine or make_machine(chart, {}),
            self.clock,
            {"nav": self},
            self.steps.append,  # type: ignore[dict-item]
        )
        self.watch = self.engine.watch = LiveMonitor(chart)

    def start(self, attempt: str, name: str, arguments: Any) -> None:
        """Note what begins."""
        self.made.append(("start", name))

    def cancel(self, attempt: str) -> None:
        """Note what is cancelled."""
        self.made.append(("cancel", attempt.partition("#")[0]))

    def sees(self, name: str, value: Any, at: float) -> None:
        """Report a live value."""
        self.at(at)
        self.engine.post(observed(f"robot.{name}", value, at))
        self.engine.drain()

    def until(self, time: float) -> None:
        """Report that the battery is low, and let time pass."""
        self.sees("battery", 0.14, 2.0)
        self.at(time)

    def at(self, time: float) -> None:
        """Let time pass."""
        self.clock.time = time
        self.engine.drain()

    @property
    def codes(self) -> list[tuple[float, str, str]]:
        """Time, name and detail of every code that was reported."""
        return [(step.time, code.code, code.detail) for step in self.steps for code in step.codes]

    @property
    def held(self) -> list[str]:
        """The engaged holds."""
        return self.engine.machine.memory.held


def begun(folder: Path, says: str) -> Robot:
    """Return a robot that drives in a mission."""
    robot = Robot(chart_with(folder, says))
    robot.engine.start()
    robot.engine.request(Event("mission.start", {"mission_type": "Stand", "mission_id": "m1"}))
    return robot


def test_a_breach_is_reported_in_the_next_step_once_until_it_holds_again(tmp_path: Path) -> None:
    """By the engine's code where its author gives none, and nothing else happens."""
    robot = begun(tmp_path, NEVER)
    for at, charge in ((1.0, 0.16), (2.0, 0.14), (3.0, 0.13), (4.0, 0.2), (62.0, 0.12)):
        robot.sees("battery", charge, at)
    assert robot.codes == [(2.0, "property_broken", LOW), (62.0, "property_broken", LOW)]
    broken = [index for index, step in enumerate(robot.steps) if step.event.name == PROPERTY_BROKEN]
    assert [robot.steps[index - 1].event.data.get("value") for index in broken] == [0.14, 0.12]
    assert (robot.held, robot.steps[-1].configuration[1]) == ([], "MISSION")


def test_a_breach_that_comes_and_goes_is_counted(tmp_path: Path) -> None:
    """Of a report at most one in a minute of a mission; a hold is engaged each time."""
    robot = begun(tmp_path, NEVER)
    for second in range(2, 70):
        robot.sees("battery", 0.14 if second % 2 else 0.2, float(second))
    more = f"{LOW}; 29 times more since the last report"
    assert robot.codes == [(3.0, "property_broken", LOW), (63.0, "property_broken", more)]
    robot.engine.request(Event("operator.skip_current"))
    robot.engine.request(Event("mission.start", {"mission_type": "Stand", "mission_id": "m2"}))
    robot.sees("battery", 0.2, 70.0)
    robot.sees("battery", 0.14, 71.0)
    assert robot.codes[-1] == (71.0, "property_broken", LOW), "another mission reports it again"
    robot = begun(tmp_path, f"{NEVER}, breach: hold")
    for second in (2, 3, 4):
        robot.sees("battery", 0.14, second)
        assert robot.held == ["breached"]
        robot.engine.request(Event("operator.resume"))
        robot.sees("battery", 0.2, second + 0.5)


def test_its_author_says_that_it_holds_the_robot(tmp_path: Path) -> None:
    """With a code of his own; the drive is cancelled, and a resume goes on though it is still broken."""
    robot = begun(tmp_path, f"{NEVER}, breach: hold, code: too_low")
    robot.sees("battery", 0.14, 2.0)
    assert (robot.codes, robot.held) == ([(2.0, "too_low", LOW)], ["breached"])
    assert [what for what, _ in robot.made] == ["start", "cancel"]
    assert robot.engine.request(Event("operator.resume")).accepted
    assert robot.held == []


def test_its_author_says_that_it_is_a_fault(tmp_path: Path) -> None:
    """As a broken invariant is."""
    robot = begun(tmp_path, f"{NEVER}, breach: fault")
    robot.sees("battery", 0.14, 2.0)
    assert robot.engine.machine.memory.configuration[-1] == "FAULT"
    assert robot.codes == [(2.0, "property_broken", LOW)]


@pytest.mark.parametrize("breach", ["report", "hold", "fault"])
def test_no_breach_lets_go_of_a_stop(tmp_path: Path, breach: str) -> None:
    """The stop is pressed before it, and stays; no resume releases it while it is pressed."""
    robot = begun(tmp_path, f"{NEVER}, breach: {breach}")
    robot.sees("estop", True, 1.0)
    robot.sees("battery", 0.14, 2.0)
    assert robot.held[0] == "estop"
    assert not robot.engine.request(Event("operator.resume")).accepted
    assert robot.held[0] == "estop"
    assert [what for what, _ in robot.made] == ["start", "cancel"]


def test_what_only_time_breaks_is_reported_when_it_is_due(tmp_path: Path) -> None:
    """The loop is woken for it, and then for nothing more."""
    robot = begun(tmp_path, SOON)
    robot.sees("battery", 0.14, 1.0)
    assert robot.engine.next_deadline == pytest.approx(3.0, abs=1e-5)
    robot.at(3.0)
    assert robot.codes == []
    robot.at(robot.engine.next_deadline or 0.0)
    detail = "property charged (line 9): input.battery > '50 %' did not become true within 2 s"
    assert [(code, text) for _, code, text in robot.codes] == [("property_broken", detail)]
    robot.sees("battery", 0.12, 3.5)
    robot.at(9.0)
    robot.sees("battery", 0.6, 10.0)
    assert (len(robot.codes), robot.engine.next_deadline) == (1, None)


def test_what_cannot_be_judged_is_a_breach_and_stops_no_loop(tmp_path: Path) -> None:
    """A monitor that raises is one that does not hold."""
    robot = begun(tmp_path, NEVER)

    def fails(*_: object) -> Any:
        raise LookupError("nothing there")

    one, reads = robot.watch._quietly[0]
    robot.watch._quietly[0] = (replace(one, watch=fails), reads)
    robot.sees("battery", 0.14, 2.0)
    assert [text for _, _, text in robot.codes] == ["property charged: could not be judged: nothing there"]


@pytest.mark.parametrize("says", [NEVER, SOON])
@pytest.mark.parametrize("reported", [False, True])
def test_the_next_process_neither_loses_nor_repeats_a_breach(
    tmp_path: Path, says: str, reported: bool
) -> None:
    """It ends before or after the machine got the report, and what is kept is plain JSON."""
    robot = begun(tmp_path, says)
    robot.engine.listener = lambda step: ended(step, robot)

    class Ended(Exception):
        pass

    def ended(step: Step, robot: Robot) -> None:
        robot.steps.append(step)
        if reported is (step.event.name == PROPERTY_BROKEN) and (reported or step.event.name == "value"):
            raise Ended

    with pytest.raises(Ended):
        robot.until(9.0)
    machine = robot.engine.machine
    kept = json.loads(json.dumps(robot.watch.kept()))
    chart = machine.chart
    again = Robot(chart, Machine(machine.world, restore(chart, machine.snapshot())))
    again.watch.begin(kept, again.engine.machine.scope)
    again.clock.time = 9.0
    again.engine.resume(
        again.engine.machine, Event("engine.resumed", {"detail": "", "held": True, "away": 0})
    )
    again.sees("battery", 0.13, 10.0)
    codes = [code for _, code, _ in (*robot.codes, *again.codes)]
    assert codes.count("property_broken") == 1


class Compared:
    """Judges every step by every property, and by the watch of a robot; reports nothing to the machine."""

    next_deadline, unreported = None, ()

    def __init__(self, chart: Chart) -> None:
        self.live, self.before = LiveMonitor(chart), Glance()
        self.all = list(self.live._says.values())
        self.states: dict[str, Remembered] = {}
        self.broken: set[str] = set()

    def take(self, step: Step, scope: EvaluationScope) -> list[Event]:
        """Compare what is broken after a step."""
        self.live.take(step, scope)
        passage, broken = Passage(self.before, step, scope), set()
        for one in self.all:
            self.states[one.name], verdict = one.watch(self.states.get(one.name, one.first), passage)
            broken |= {one.name} if verdict.breach else set()
        self.before = glance(scope.memory)
        assert self.live._broken - self.live._waits.keys() == broken, step
        self.broken |= broken
        return []

    def late(self, now: float) -> list[Event]:
        """Return nothing: the next step tells."""
        return []


def each_part(chart: Chart) -> dict[str, TemporalProperty]:
    """Return the properties of a chart with each of their clauses as properties of their own."""
    found = dict(chart.properties)
    mission = next(iter(chart.missions))
    for rule in chart.properties.values():
        clauses = [clause for way in breaches(rule) for clause in way]
        said = [Expression(one.code, rule.place, BOOL, Compiled(one.code)) for one in clauses]
        for number, (that, then) in enumerate(zip(said, said[1:] + said[:1], strict=True)):
            name = f"{rule.name}_{number}"
            found[name] = TemporalProperty(name, rule.place, never=that)
            found[f"{name}a"] = TemporalProperty(f"{name}a", rule.place, always=that)
            found[f"{name}u"] = TemporalProperty(f"{name}u", rule.place, never=that, after=then, until=that)
            found[f"{name}n"] = TemporalProperty(
                f"{name}n", rule.place, never=that, until=then, mission=mission
            )
            places = {each.source: each for each in (that, then)}
            found[f"{name}v"] = TemporalProperty(
                f"{name}v", rule.place, visit_in_order=places, mission=mission
            )
            five = Constant(5.0, rule.place, DURATION)
            found[f"{name}e"] = TemporalProperty(
                f"{name}e", rule.place, eventually=that, within=five, after=then
            )
    return found


@pytest.mark.slow
@pytest.mark.parametrize("mission", ["inspection", "exploration"])
def test_it_sees_what_the_monitors_of_simulations_see(mission: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """After every step of every scenario: what it does not ask cannot have another answer than before."""
    first, made = Engine.__init__, list[Compared]()
    charts: dict[Chart, Chart] = {}

    def watched(self: Engine, machine: Machine, *given: Any, **more: Any) -> None:
        first(self, machine, *given, **more)
        chart = machine.chart
        charts.setdefault(chart, replace(chart, properties=each_part(chart)))
        made.append(Compared(charts[chart]))
        self.watch = made[-1]  # type: ignore[assignment]

    monkeypatch.setattr(Engine, "__init__", watched)
    suite = Suite(shipped.catalog())
    for file in scenario_files([ROOT / "tests" / "scenarios" / mission])[:40]:
        assert suite.run(file, range(1)).holds
    assert len(made) > 20
    assert len(set().union(*(one.broken for one in made))) > 20
