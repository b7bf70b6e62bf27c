"""Discrete-event simulation of a mission: the engine's own loop, scripted servers, scripted happenings.

Virtual time jumps to the next deadline of the machine or the next action of the world. At the same time the
machine's deadlines go first, then the actions in the order in which they were written: the same inputs give
the same steps. A run ends when the mission is over and no happening is scheduled, when nothing is pending, at
the state of `stop_at`, or at a limit of time or steps.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from lupin_engine.chart.model import Chart
from lupin_engine.errors import LupinError
from lupin_engine.machine.event import STANDSTILL, Event, Start
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.memory import Visit
from lupin_engine.machine.scope import World
from lupin_engine.machine.snapshot import restore
from lupin_engine.machine.step import Step, View
from lupin_engine.plugin.builtin import TIME_ZONE
from lupin_engine.plugin.profile import START
from lupin_engine.runtime.clock import UTC, VirtualClock, calendar_of
from lupin_engine.runtime.engine import Engine, EngineOutlet, InputLog
from lupin_engine.runtime.history import History
from lupin_engine.runtime.journal.journal import Journal, Keep
from lupin_engine.runtime.journal.records import JournalHead, journal_of
from lupin_engine.runtime.journal.recovery import Leftover, goes_on, recover, resumed_event
from lupin_engine.runtime.journal.replay import resumed
from lupin_engine.runtime.journal.writer import MemoryWriter
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim.agenda import Agenda
from lupin_engine.sim.measured import Measured
from lupin_engine.sim.scripted import MockOutcome, Rule, Stage

#: How long a simulation goes on when nobody says otherwise, in seconds of virtual time.
LIMIT = 24 * 3600.0
#: How many steps a simulation has at most for each day of its limit: what has more goes in circles.
MAX_STEPS = 100_000
#: What the robot's clock shows at the beginning when nobody says otherwise: never the computer's own date.
NEW_YEAR = "2026-01-01 00:00"
#: How many steps of such loops are shown.
_SHOWN_STEPS = 12


def most_steps(limit: float) -> float:
    """Return the limit of steps for a limit of time (s): `MAX_STEPS` for each day, and not less."""
    return MAX_STEPS * max(1.0, limit / LIMIT)


@dataclass(frozen=True)
class Ask:
    """An operator makes a request. For `mission.start` the mission's name and id are filled in."""

    event: str
    data: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class SetValue:
    """The live value `value` (the plugin's name for it) is reported as `is_now`."""

    value: str
    is_now: Any


@dataclass(frozen=True)
class Happen:
    """A plugin reports one of its events."""

    event: str
    data: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class End:
    """The newest attempt of `operation` ends now: done without a code, else failed."""

    operation: str
    code: str = ""
    detail: str = ""
    result: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Leave:
    """The server of `operation` stops answering, until it comes back."""

    operation: str


@dataclass(frozen=True)
class ComeBack:
    """The server of `operation` answers again."""

    operation: str


@dataclass(frozen=True)
class PutOff:
    """The answer of the newest attempt of `operation` is delayed by `seconds`."""

    operation: str
    seconds: float


@dataclass(frozen=True)
class SetClock:
    """The robot's clock is set, to a date with a time of day."""

    to: str


@dataclass(frozen=True)
class Restart:
    """The orchestrator ends, and `after` seconds later a new process recovers from its journal.

    The world runs on meanwhile: servers end attempts and values change, unnoticed. Without `after` the
    machine goes on at once from its snapshot, without a hold, as `restart: true` of old scenarios means.
    """

    after: float | None = 0.0


@dataclass(frozen=True)
class TakeView:
    """Records the view; nothing happens."""


Effect = Ask | SetValue | Happen | End | Leave | ComeBack | PutOff | SetClock | Restart | TakeView


@dataclass(frozen=True)
class Happening:
    """An effect, `after` seconds from the start.

    With a `state` the time counts from its `nth` entry, with an `operation` from its `nth` start; 0 means
    every one of them. `number` says which piece of a script it comes from.
    """

    effect: Effect
    after: float = 0.0
    state: str | None = None
    nth: int = 1
    operation: str | None = None
    number: int = 0

    @property
    def waits(self) -> bool:
        """Whether something must happen before its time counts."""
        return self.state is not None or self.operation is not None

    def is_meant(self, entered: str, started: str) -> bool:
        """Say whether it waits for this entry of a state, or this start of an operation."""
        if self.state is not None:
            return bool(entered) and is_named(entered, self.state)
        return self.operation == started


@dataclass(frozen=True)
class Script:
    """The input of a simulation: a mission, its request, the servers' answers, and happenings.

    With `starts` the mission is started as soon as the chart can take the request. `seed` seeds the draws of
    the servers and the jitter of retries. With `stop_at` the run ends when that state is entered. `clock` is
    the robot's wall clock at the beginning. `measured` is of a robot.
    """

    mission: str
    request: Mapping[str, Any] = field(default_factory=dict)
    rules: tuple[Rule, ...] = ()
    happenings: tuple[Happening, ...] = ()
    limit: float = LIMIT
    starts: bool = True
    seed: int = 0
    stop_at: str = ""
    clock: str = NEW_YEAR
    measured: Measured = field(default_factory=Measured)

    @property
    def is_random(self) -> bool:
        """Whether the servers draw anything."""
        return any(rule.is_random for rule in self.rules)


@dataclass(frozen=True)
class MomentView:
    """The view at one moment: after `steps` steps, at `time`."""

    time: float
    steps: int
    view: View
    context: Mapping[str, Any]


@dataclass(frozen=True, repr=False)
class Run:
    """The result of a simulation: its history, and its final state.

    `visits` are the visits of all itineraries, `visits_of_sweep` those of the running sweep of each that has
    begun, `context` the variables at the end. `cut_off`: a limit of time
    or steps was reached; `stopped`: the state of `stop_at` was entered. `unfired`: happenings that never took
    place; `idle`: those without effect, with the time. `views` are the recorded views, by number.
    `parameters` are the given settings. `unspent` counts the attempts under each rule with unused outcomes,
    by its number. `violated` are the properties that were: the step (None: at the end), the name, and how.
    """

    chart: Chart
    history: History
    visits: tuple[Visit, ...]
    view: View
    seconds: float
    cut_off: bool
    unfired: tuple[Happening, ...]
    idle: tuple[tuple[float, Happening], ...] = ()
    views: Mapping[int, tuple[MomentView, ...]] = field(default_factory=dict)
    context: Mapping[str, Any] = field(default_factory=dict)
    stopped: bool = False
    parameters: Mapping[str, Any] = field(default_factory=dict)
    unspent: Mapping[int, int] = field(default_factory=dict)
    violated: tuple[tuple[Step | None, str, str], ...] = ()
    visits_of_sweep: tuple[Visit, ...] = ()

    def __repr__(self) -> str:
        return f"<Run to {self.view.lifecycle} in {self.seconds:g} s: {len(self.steps)} steps>"

    @property
    def steps(self) -> Sequence[Step]:
        """The steps in their order."""
        return self.history.steps

    @property
    def limit(self) -> str:
        """The limit that ended it, with the repeated transitions; '' where none did."""
        if not self.cut_off:
            return ""
        if len(self.steps) < most_steps(self.seconds):
            return f"the time limit of {self.seconds:g} s"
        last = Counter(name for step in self.steps[-100:] for name in step.taken or (step.event.name,))
        often = ", ".join(name for name, _ in last.most_common(3))
        return f"the limit of {len(self.steps)} steps at {self.seconds:g} s; what repeats: {often}"

    @property
    def watched_until(self) -> float:
        """The time until which a property may come true (s); infinite if nothing was pending in the end."""
        is_over = self.view.lifecycle in self.chart.profile.stages.over
        return self.seconds if self.cut_off or self.stopped or is_over else math.inf

    @property
    def ended(self) -> bool:
        """Whether the mission was carried out to its end."""
        return self.view.lifecycle in self.chart.profile.stages.ended


def simulate(
    chart: Chart,
    script: Script,
    parameters: Mapping[str, Any] | None = None,
    world: World | None = None,
) -> Run:
    """Run a script against a chart in virtual time.

    Args:
        world: of this chart and these parameters, if it exists already.

    Raises:
        UsageError: a parameter does not exist or is out of range.
        LupinError: a plugin cannot work with the parameters.
        Standstill: the mission loops without time passing.
    """
    return Simulation(chart, script, parameters or {}, world).run()


class Standstill(LupinError):
    """The mission loops without time passing; the first `shown` steps are enough to show it."""

    def __init__(self, text: str, shown: int) -> None:
        super().__init__(text)
        self.shown = shown


class _InMemory:
    """The journal of a simulation, for its restarts."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._writer = MemoryWriter()
        self.journal = Journal(Path(), Keep(), self, self._wall_ns, self._writer)

    def post(self, call: Callable[[], None]) -> None:
        """Run a call of the journal: at once."""
        call()

    def disk_changed(self, problem: str) -> None:
        """There is no disk."""

    def _wall_ns(self) -> int:
        return round(self._simulation.wall * 1e9)

    def begin(self) -> None:
        """Begin with the memory of the machine as it is."""
        machine, now = self._simulation.machine, self._simulation.now
        world = machine.world
        self.journal.begin(
            JournalHead(
                boot="",
                engine="",
                chart="",
                chart_name=world.chart.name,
                profile=world.chart.profile.name,
                parameters={},
                time=now,
                ahead_ns=self._wall_ns() - round(now * 1e9),
                seed=world.seed,
                snapshot=machine.snapshot() if machine.memory.sequence else "",
            )
        )

    def left(self) -> Leftover:
        """Return the journal as a new process reads it."""
        return Leftover(journal_of(Path("journal"), self._writer.data))

    def go_on(self, left: Leftover, shift: float) -> None:
        """Continue the journal that `left` is, as a new process does; its clock is `shift` seconds ahead."""
        self.journal.go_on(left.file, shift, self._simulation.now, "")


class Simulation:
    """One run of a script; `listener` is called with every step, while the machine is as after it.

    `crashes` allows restarts that are not in the script.
    """

    def __init__(
        self,
        chart: Chart,
        script: Script,
        parameters: Mapping[str, Any],
        world: World | None = None,
        log: InputLog | None = None,
        crashes: bool = False,
    ) -> None:
        self._script = script
        self.listener: Callable[[Step], None] = lambda step: None
        self._parameters = parameters
        self._agenda = Agenda()
        self._world = replace(world or make_world(chart, parameters), seed=script.seed)
        self._calendar = calendar_of(self._world.parameters.get(TIME_ZONE, UTC))
        self._clock = VirtualClock(0.0, self._calendar.moment(script.clock))
        self._machine = Machine(self._world)
        self._stage = Stage(
            self._world,
            script.rules,
            self._agenda,
            self._clock,
            lambda: self._machine.memory.target,
            script.measured,
        )
        crashes = crashes or any(isinstance(h.effect, Restart) for h in script.happenings)
        self._journal = _InMemory(self) if crashes else None
        self._log = log or (self._journal.journal if self._journal else None)
        self._engine = self._make_engine()
        self._is_away = False
        self.history = History()
        self._views: dict[int, list[MomentView]] = {}
        self._idle: list[tuple[float, Happening]] = []
        self._missions = 0
        self._started = not script.starts
        self._waiting: dict[int, Happening] = dict(enumerate(script.happenings))
        self._fired: set[int] = set()
        self._counted: dict[int, int] = {}
        self._planned = 0
        self._stopped = False
        #: When the engine was last let on.
        self._moment = -1.0

    def _make_engine(self) -> Engine:
        drivers: dict[str, Any] = {}
        engine = Engine(self._machine, self._clock, drivers, self._stepped, self._clock.wall, self._log)
        # Nobody needs waking: the loop below drains after everything that it lets happen.
        drivers.update(self._stage.drivers(EngineOutlet(engine, lambda: None)))
        return engine

    def run(self) -> Run:
        """Run until the mission is over, nothing is pending, or a limit of time or steps is reached.

        Raises:
            Standstill: the mission loops without time passing.
        """
        self.begin()
        cut_off = False
        while not self.is_over:
            due = self.next_due
            if due is None:
                break
            if len(self.steps) >= most_steps(self._script.limit):
                cut_off = True
                break
            if due > self._script.limit:
                self._clock.move_to(self._script.limit)
                cut_off = True
                break
            self.advance()
        return self.result(cut_off)

    # -- the same in pieces, for those who look on ------------------------------------------------------

    def begin(self) -> None:
        """Enter the chart's initial states."""
        for index, happening in list(self._waiting.items()):
            if not happening.waits:
                self._plan(index, happening)
        if self._journal is not None:
            self._journal.begin()
        self._engine.start()

    @property
    def world(self) -> World:
        """The constants of the machine."""
        return self._world

    @property
    def machine(self) -> Machine:
        """The machine as it is now: after a restart it is another one."""
        return self._machine

    @property
    def now(self) -> float:
        """The time."""
        return self._clock.now()

    @property
    def wall(self) -> float:
        """The robot's wall clock, in POSIX time."""
        return self._clock.wall()

    @property
    def clock(self) -> str:
        """The same as people write it."""
        return self._calendar.as_text(self._clock.wall())

    @property
    def away(self) -> list[str]:
        """The operations whose servers are not heard of, until they come back."""
        return self._stage.away

    @property
    def answered(self) -> Mapping[tuple[str, str, float | None, int | None], int]:
        """How many attempts each rule answered, by operation, target, metres and the rule's number."""
        return self._stage.answered

    @property
    def steps(self) -> Sequence[Step]:
        """The steps so far."""
        return self.history.steps

    @property
    def is_over(self) -> bool:
        """Whether the mission is over and the script has ended."""
        if self._stopped:
            return True
        idle = self._started and not self._planned and not self._is_away
        chart = self._machine.chart
        return idle and label_of(chart, self._machine.memory.configuration) in chart.profile.stages.over

    @property
    def next_due(self) -> float | None:
        """The time of the next deadline or action; None when nothing is pending."""
        deadline, planned = self._engine.next_deadline, self._agenda.next_due
        if self._is_away:
            return planned
        if deadline is None or planned is None:
            return planned if deadline is None else deadline
        return min(deadline, planned)

    def advance(self) -> bool:
        """Carry out the next deadline or action; False when nothing is pending."""
        due = self.next_due
        if due is None:
            return False
        self._clock.move_to(due)
        self._drain()
        if self._agenda.do_next(due):
            self._drain()
        return True

    def _drain(self) -> None:
        if not self._is_away:
            same, self._moment = self._moment == self.now, self.now
            self._engine.drain(more=same)

    def wait_until(self, time: float) -> None:
        """Move the clock to `time`; earlier deadlines and actions must have been carried out."""
        self._clock.move_to(time)

    def do(self, effect: Effect) -> bool:
        """Apply an effect now; False when it had nothing to act on."""
        done = _EFFECTS[type(effect)](self, effect)
        self._drain()
        return done is not False

    def request(self, event: Event) -> Step:
        """Send a request; return the step with the answer."""
        step = self._engine.request(event)
        self._engine.drain()
        return step

    # -- what the script lets happen --------------------------------------------------------------------

    def _plan(self, index: int, happening: Happening) -> None:
        self._fired.add(index)
        if happening.nth:
            del self._waiting[index]
        self._planned += 1
        self._agenda.note(self._clock.now() + happening.after, lambda: self._happen(happening))

    def _happen(self, happening: Happening) -> None:
        self._planned -= 1
        if isinstance(happening.effect, TakeView):
            self._take_view(happening.number)
        elif _EFFECTS[type(happening.effect)](self, happening.effect) is False:
            self._idle.append((self._clock.now(), happening))

    def _set_value(self, effect: SetValue) -> None:
        self._stage.report(effect.value, effect.is_now)

    def _end(self, effect: End) -> bool:
        outcome = MockOutcome(code=effect.code, detail=effect.detail, result=effect.result)
        return self._stage.end_current(effect.operation, outcome)

    def _restart(self, effect: Restart) -> bool:
        if self._is_away or self._journal is None:
            return False
        if effect.after is None:
            memory = restore(self._machine.chart, self._machine.snapshot())
            self._machine = self._engine.machine = Machine(self._world, memory)
            return True
        self._is_away = True
        self._stage.disconnect()
        self._agenda.note(self._clock.now() + effect.after, self._come_back)
        return True

    def _come_back(self) -> None:
        """Recover from the journal as a real orchestrator does, with the hold `restarted`."""
        assert self._journal is not None, "who was away had a journal"
        left = self._journal.left()
        recovered = recover(left.file, self._world)
        assert not recovered.problem, recovered.problem
        machine = recovered.machine
        now, wall = self._clock.now(), self._clock.wall()
        self._is_away = False
        if goes_on(machine):
            shift = left.shift(now, wall)
            self._machine = machine = resumed(machine, shift)
            self._engine = self._make_engine()
            self._journal.go_on(left, shift)
            self._engine.resume(machine, resumed_event(left, machine, wall))
        else:
            self._machine = Machine(self._world)
            self._engine = self._make_engine()
            self._journal.begin()
            self._engine.start()
        self._stage.republish()

    def _set_clock(self, effect: SetClock) -> None:
        self._clock.set_wall(self._calendar.moment(effect.to))

    def _take_view(self, number: int) -> None:
        machine, steps = self._machine, len(self.history.steps)
        seen = MomentView(self._clock.now(), steps, machine.view, dict(machine.memory.context))
        self._views.setdefault(number, []).append(seen)

    def _ask(self, event: str, data: Mapping[str, Any]) -> bool:
        if self._is_away:
            return False  # nobody answers
        if event == START:
            self._missions += 1
            named = {"mission_type": self._script.mission, "mission_id": f"sim-{self._missions}"}
            data = {**named, **self._script.request, **data}
        self._engine.request(Event(event, data))
        return True

    def _start_mission(self) -> None:
        self._planned -= 1
        self._ask(START, {})

    # -- what the machine says --------------------------------------------------------------------------

    def _stepped(self, step: Step) -> None:
        memory = self._machine.memory
        self.history.take(step, memory.held)
        if self._waiting:
            self._notice_beginnings(step)
        if self._script.stop_at and any(is_named(name, self._script.stop_at) for name in step.entered):
            self._stopped = True
        if not self._started and step.entered and takes_start(self._machine.chart, step.configuration):
            self._started = True
            self._planned += 1
            self._agenda.note(step.time, self._start_mission)
        self.listener(step)
        if step.event.name == STANDSTILL:
            before = bisect_left(self.steps, step.time, key=lambda one: one.time)
            raise Standstill(step.event.data["detail"], before + _SHOWN_STEPS)

    def _notice_beginnings(self, step: Step) -> None:
        """Schedule the happenings that wait for an entered state or a started operation."""
        begun = [(name, "") for name in step.entered]
        starts = (each for each in step.commands if isinstance(each, Start) and not each.updates)
        begun += [("", each.operation) for each in starts]
        for entered, started in begun:
            for index, happening in list(self._waiting.items()):
                if happening.is_meant(entered, started):
                    count = self._counted[index] = self._counted.get(index, 0) + 1
                    if happening.nth in (0, count):
                        self._plan(index, happening)

    def result(self, cut_off: bool) -> Run:
        """Return the result until now."""
        walks = self._machine.memory.itineraries.values()
        return Run(
            chart=self._machine.chart,
            history=self.history,
            visits=self._machine.memory.outcomes,
            visits_of_sweep=tuple(v for walk in walks if walk.begun for v in walk.visits),
            view=self._machine.view,
            seconds=self._clock.now(),
            cut_off=cut_off,
            unfired=tuple(h for index, h in self._waiting.items() if index not in self._fired),
            idle=tuple(self._idle),
            views={number: tuple(seen) for number, seen in self._views.items()},
            context=dict(self._machine.memory.context),
            stopped=self._stopped,
            parameters=self._parameters,
            unspent=self._stage.unspent,
        )


#: What is done for each kind of effect; False: there was nothing that it could be done to.
_EFFECTS: Mapping[type, Callable[[Simulation, Any], object]] = {
    Ask: lambda simulation, effect: simulation._ask(effect.event, effect.data),
    SetValue: Simulation._set_value,
    Happen: lambda simulation, effect: simulation._stage.outlet.event(effect.event, effect.data),
    End: Simulation._end,
    Leave: lambda simulation, effect: simulation._stage.leave(effect.operation),
    ComeBack: lambda simulation, effect: simulation._stage.come_back(effect.operation),
    PutOff: lambda simulation, effect: simulation._stage.delay(effect.operation, effect.seconds),
    SetClock: Simulation._set_clock,
    Restart: Simulation._restart,
}


def label_of(chart: Chart, configuration: Iterable[str]) -> str:
    """Return the published state of a configuration; '' when there is none."""
    labels = (chart.states[name].label for name in configuration)
    return next(filter(None, labels), "")


def is_named(full: str, name: str) -> bool:
    """Say whether a state's full name is meant by `name`: all of it, or its last parts."""
    return full.endswith(name) and (len(full) == len(name) or full[-len(name) - 1] == ".")


def takes_start(chart: Chart, configuration: tuple[str, ...]) -> bool:
    """Say whether a mission could be started here: an active state has a transition that does not refuse."""
    return any(
        rule.event == START and rule.refuse is None
        for name in configuration
        for rule in chart.states[name].transitions
    )
