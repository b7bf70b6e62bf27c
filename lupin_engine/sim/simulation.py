"""A mission in virtual time: the engine's own loop, scripted servers, and a script of what else happens.

Time jumps to the next deadline of the machine or the next thing on the world's agenda. At the same time the
machine's deadlines go first, then the agenda in the order in which it was written: the same inputs give the
same steps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from lupin_engine.chart.model import Chart
from lupin_engine.machine.event import Event, Publish, Report
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.memory import Visit
from lupin_engine.machine.step import Step
from lupin_engine.machine.view import View
from lupin_engine.plugin.registry import Catalog
from lupin_engine.runtime.clock import VirtualClock
from lupin_engine.runtime.engine import Engine, EngineOutlet
from lupin_engine.runtime.setup import make_machine
from lupin_engine.sim.agenda import Agenda
from lupin_engine.sim.scripted import Rule, Stage

#: Published states in which a mission is over.
ENDED, FAULTED = "DONE", "FAULT"
START = "mission.start"
#: How long a simulation goes on when nobody says otherwise, in seconds of virtual time.
LIMIT = 24 * 3600.0


@dataclass(frozen=True)
class Ask:
    """An operator makes a request. For `mission.start` the mission's name and id are filled in."""

    event: str
    data: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Tell:
    """The world changes: the live value `value` (the plugin's name for it) becomes `is_now`."""

    value: str
    is_now: Any


@dataclass(frozen=True)
class End:
    """The newest attempt of `operation` ends now: done without a code, else failed."""

    operation: str
    code: str = ""
    detail: str = ""


@dataclass(frozen=True)
class Happening:
    """Something that happens `after` seconds from the start, or from the `nth` entry of `state`."""

    effect: Ask | Tell | End
    after: float = 0.0
    state: str | None = None
    nth: int = 1


@dataclass(frozen=True)
class Script:
    """What a simulation is of: a mission, its request, the servers' answers, and what else happens.

    With `starts` the mission is started as soon as the chart can take the request.
    """

    mission: str
    request: Mapping[str, Any] = field(default_factory=dict)
    rules: tuple[Rule, ...] = ()
    happenings: tuple[Happening, ...] = ()
    limit: float = LIMIT
    starts: bool = True


@dataclass(frozen=True)
class Run:
    """What came of a simulation.

    `lifecycles` are the published states in the order of their appearance; `visits` the last itinerary's.
    `cut_off`: the time limit was reached. `unfired`: happenings that never came to pass.
    """

    chart: Chart
    steps: tuple[Step, ...]
    published: tuple[tuple[float, Publish], ...]
    reports: tuple[Report, ...]
    lifecycles: tuple[str, ...]
    visits: tuple[Visit, ...]
    view: View
    seconds: float
    cut_off: bool
    unfired: tuple[Happening, ...]

    @property
    def ended(self) -> bool:
        """Whether the mission was carried out to its end."""
        return self.view.lifecycle == ENDED

    @property
    def refused(self) -> tuple[Step, ...]:
        """The requests that were refused."""
        return tuple(step for step in self.steps if step.accepted is False)


def simulate(
    chart: Chart, catalog: Catalog, script: Script, parameters: Mapping[str, Any] | None = None
) -> Run:
    """Run a script against a chart in virtual time.

    Raises:
        UsageError: a parameter does not exist or is out of range.
        LupinError: a plugin cannot work with the parameters, or the chart never comes to rest.
    """
    return Simulation(chart, catalog, script, parameters or {}).run()


class Simulation:
    """One run of a script."""

    def __init__(self, chart: Chart, catalog: Catalog, script: Script, parameters: Mapping[str, Any]) -> None:
        self._script = script
        self._clock = VirtualClock()
        self._agenda = Agenda()
        self._machine: Machine = make_machine(chart, catalog, parameters)
        self._stage = Stage(
            catalog,
            self._machine.world.parameters,
            script.rules,
            self._agenda,
            self._clock.now,
            lambda: self._machine.view.target,
        )
        drivers: dict[str, Any] = {}
        self._engine = Engine(self._machine, self._clock, drivers, self._stepped)
        # Nobody needs waking: the loop below drains after everything that it lets happen.
        drivers.update(self._stage.drivers(EngineOutlet(self._engine, lambda: None)))
        self._steps: list[Step] = []
        self._published: list[tuple[float, Publish]] = []
        self._reports: list[Report] = []
        self._lifecycles: list[str] = []
        self._missions = 0
        self._started = not script.starts
        self._waiting: dict[int, Happening] = dict(enumerate(script.happenings))
        self._entered: dict[int, int] = {}
        self._planned = 0

    def run(self) -> Run:
        """Run until the mission is over, nothing more will happen, or the time limit is reached."""
        for index, happening in list(self._waiting.items()):
            if happening.state is None:
                self._plan(index, happening)
        self._engine.start()
        cut_off = False
        while not self._over():
            due = self._next_due()
            if due is None:
                break
            if due > self._script.limit:
                self._clock.move_to(self._script.limit)
                cut_off = True
                break
            self._clock.move_to(due)
            self._engine.drain()
            if self._agenda.do_next(due):
                self._engine.drain()
        return self._result(cut_off)

    def _over(self) -> bool:
        """Say whether nothing of interest can follow: the mission is over, and the script told to its end."""
        idle = self._started and not self._planned
        return idle and self._machine.view.lifecycle in (ENDED, FAULTED)

    def _next_due(self) -> float | None:
        times = (self._engine.next_deadline, self._agenda.next_due)
        return min((time for time in times if time is not None), default=None)

    # -- what the script lets happen --------------------------------------------------------------------

    def _plan(self, index: int, happening: Happening) -> None:
        del self._waiting[index]
        self._planned += 1
        self._agenda.note(self._clock.now() + happening.after, lambda: self._happen(happening.effect))

    def _happen(self, effect: Ask | Tell | End) -> None:
        self._planned -= 1
        if isinstance(effect, Ask):
            self._ask(effect.event, effect.data)
        elif isinstance(effect, Tell):
            self._stage.outlet.value(effect.value, effect.is_now, self._clock.now())
        else:
            self._stage.end_current(effect.operation, effect.code, effect.detail)

    def _ask(self, event: str, data: Mapping[str, Any]) -> None:
        if event == START:
            self._missions += 1
            named = {"mission_type": self._script.mission, "mission_id": f"sim-{self._missions}"}
            data = {**named, **self._script.request, **data}
        self._engine.request(Event(event, data))

    def _start_mission(self) -> None:
        self._planned -= 1
        self._ask(START, {})

    # -- what the machine says --------------------------------------------------------------------------

    def _stepped(self, step: Step) -> None:
        self._steps.append(step)
        shown = [moment.lifecycle for moment in step.trail] or [self._machine.view.lifecycle]
        for lifecycle in shown:
            if lifecycle and lifecycle != (self._lifecycles or [""])[-1]:
                self._lifecycles.append(lifecycle)
        for command in step.commands:
            if isinstance(command, Publish):
                self._published.append((step.time, command))
            elif isinstance(command, Report):
                self._reports.append(command)
        if step.entered:
            self._notice_entries(step)

    def _notice_entries(self, step: Step) -> None:
        for name in step.entered:
            for index, happening in list(self._waiting.items()):
                if happening.state is not None and is_named(name, happening.state):
                    self._entered[index] = self._entered.get(index, 0) + 1
                    if self._entered[index] == happening.nth:
                        self._plan(index, happening)
        if not self._started and takes_start(self._machine.chart, step.configuration):
            self._started = True
            self._planned += 1
            self._agenda.note(step.time, self._start_mission)

    def _result(self, cut_off: bool) -> Run:
        walk = self._machine.memory.walk
        return Run(
            chart=self._machine.chart,
            steps=tuple(self._steps),
            published=tuple(self._published),
            reports=tuple(self._reports),
            lifecycles=tuple(self._lifecycles),
            visits=tuple(walk.visits) if walk else (),
            view=self._machine.view,
            seconds=self._clock.now(),
            cut_off=cut_off,
            unfired=tuple(self._waiting.values()),
        )


def is_named(full: str, name: str) -> bool:
    """Say whether a state's full name is meant by `name`: all of it, or its last parts."""
    return full == name or full.endswith(f".{name}")


def takes_start(chart: Chart, configuration: tuple[str, ...]) -> bool:
    """Say whether a mission could be started here: an active state has a transition that does not refuse."""
    return any(
        rule.event == START and rule.refuse is None
        for name in configuration
        for rule in chart.states[name].transitions
    )
