"""The event loop: one queue of events, one step at a time, commands out to the plugins' drivers.

Any thread may post; one thread drains. Reports that a driver makes while a command is carried out join the
queue and are stepped after it (run to completion). More than `MOST_AT_ONCE` steps at one moment end as an
error of the mission. A driver's exception fails its attempt, never the loop.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol, TypeVar

from lupin_engine.errors import shortened
from lupin_engine.machine import event as events
from lupin_engine.machine.event import NOTHING, STANDSTILL, Act, Cancel, Command, Event, Start
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.memory import Attempt, Phase
from lupin_engine.machine.scope import EvaluationScope
from lupin_engine.machine.step import Step
from lupin_engine.plugin.contract import Driver, RecoveringDriver
from lupin_engine.runtime.clock import Clock
from lupin_engine.runtime.declared import DRIVER_CODE, DRIVER_FAILED, as_declared

#: How many letters of what a server says about an attempt are kept: it is logged, recorded and shown.
MAX_DETAIL = 500

#: How many steps may be made at one go; more are a mission that goes in circles in no time.
MOST_AT_ONCE = 10_000
#: So many of them are looked at to tell the circle.
_CIRCLE = 100

#: By so much the robot's clock may drift from the one that the machine knows, in seconds.
CLOCK_TOLERANCE_S = 0.5


_T = TypeVar("_T")


class InputLog(Protocol):
    """The write-ahead log of the machine's inputs: each is written before the step that it causes."""

    def started(self, now: float, ahead: float | None) -> None:
        """The machine is started."""

    def handled(self, now: float, event: Event, origin: Mapping[str, str]) -> None:
        """The machine gets an event; `origin` names who requested it."""

    def fired(self, now: float) -> None:
        """The machine fires its earliest deadline."""

    def loaded(self, now: float) -> None:
        """The machine was replaced by a hot reload."""

    def when_flushed(self, then: Callable[[], None]) -> None:
        """Call `then` on the loop's thread, perhaps later, when all records are durable, or cannot be."""


class StepWatch(Protocol):
    """What watches the steps for breaches of properties (see `properties.LiveMonitor`)."""

    def take(self, step: Step, scope: EvaluationScope) -> list[Event]:
        """Judge a step; return the events that report its breaches."""

    @property
    def next_deadline(self) -> float | None:
        """When time alone breaks a property; None: never."""

    def late(self, now: float) -> list[Event]:
        """Return the events that report what time alone has broken."""

    @property
    def unreported(self) -> list[Event]:
        """The events of breaches that the machine has not got."""


class Engine:
    """Runs a machine against drivers on a clock.

    With a log, operations and actions begin when the log is flushed; a cancel never waits for it.
    """

    def __init__(
        self,
        machine: Machine,
        clock: Clock,
        drivers: Mapping[str, Driver],
        listener: Callable[[Step], None],
        wall: Callable[[], float | None] = lambda: None,
        log: InputLog | None = None,
    ) -> None:
        """Make a loop that is not started.

        Args:
            machine: not started either.
            clock: stamps the steps.
            drivers: by plugin name; may be filled after this call, because drivers need the engine's outlet.
            listener: called with every step, before its commands are carried out; only cancels go first.
            wall: the robot's clock, in POSIX time, or None while it is unknown; then times of day wait.
            log: records every input of the machine.
        """
        self.machine = machine
        self.clock = clock
        self.drivers = drivers
        self.listener = listener
        self._wall = wall
        self._log = log
        #: Watches the properties of the missions; None: nothing does.
        self.watch: StepWatch | None = None
        self._failed: Callable[[Exception], None] | None = None
        #: Attempts that wait for the log, and are not begun yet.
        self._withheld: set[str] = set()
        self._queue: deque[Event] = deque()
        self._stepping = False
        self._at_once = 0
        #: What is entered and begun over and over.
        self._entered: dict[str, None] = {}
        self._begun: dict[str, None] = {}

    def on_failure(self, callback: Callable[[Exception], None]) -> None:
        """Call `callback` with each exception of listener, clock, log or machine, and go on.

        Without a callback the exception is raised, after what the step had to end was ended.
        """
        self._failed = callback

    def start(self) -> None:
        """Enter the chart's initial states."""
        now = self.clock.now()
        ahead = self._ahead(now)
        if self._log is not None:
            self._safely(self._log.started, now, ahead)
        self._carry_out(self.machine.start(now, ahead))
        self.drain()

    def go_on_with(self, machine: Machine) -> None:
        """Replace the machine by one that was made of its memory (hot reload)."""
        now = self.clock.now()
        if self._log is not None:
            self._safely(self._log.loaded, now)
        step = machine.go_on(now)
        self.machine = machine
        self._carry_out(step)
        self.drain()

    def resume(self, machine: Machine, event: Event) -> None:
        """Run a recovered machine of another process; `event` informs it (`event.RESUMED`).

        Drivers recover the attempts that it cancels, then those that it adopts. Without a `RecoveringDriver`
        the former end as cancelled, the latter fail.
        """
        self.machine = machine
        now = self.clock.now()
        if self._log is not None:
            self._safely(self._log.handled, now, event, NOTHING)
        step = machine.handle(event, now)
        left = list(machine.memory.attempts.values())
        self._recover(left, Phase.CANCELLING)
        self._queue.extendleft(self.watch.unreported if self.watch is not None else ())
        self._safely(self._judge, step)
        self._safely(self.listener, step)
        self._send_all([command for command in step.commands if isinstance(command, (Start, Act))])
        self._recover(left, Phase.ACCEPTED)
        self.drain()

    def _recover(self, left: Iterable[Attempt], phase: Phase) -> None:
        """Have the drivers recover the attempts of another process that are in one phase."""
        adopt = phase is Phase.ACCEPTED
        for attempt in left:
            if attempt.phase is not phase:
                continue
            plugin, _, name = attempt.operation.partition(".")
            driver = self.drivers.get(plugin)
            if isinstance(driver, RecoveringDriver):
                try:
                    driver.recover(attempt.id, name, adopt=adopt)
                except Exception as problem:
                    self.post(events.failed(attempt.id, DRIVER_CODE, f"{type(problem).__name__}: {problem}"))
            elif adopt:
                self.post(events.failed(attempt.id, DRIVER_CODE, "its driver cannot go on with it"))
            else:
                self.post(events.cancelled(attempt.id))

    def post(self, event: Event) -> None:
        """Queue an event; the caller, or the owner of the loop, drains."""
        self._queue.append(event)

    def request(self, event: Event, origin: Mapping[str, str] = NOTHING) -> Step:
        """Step a request after all queued events; return its step, with the answer. `origin`: who sent it."""
        self.drain()
        step = self._handle(event, self.clock.now(), origin)
        self._carry_out(step)
        self.drain()
        return step

    def _handle(self, event: Event, now: float, origin: Mapping[str, str] = NOTHING) -> Step:
        if self._log is not None:
            self._safely(self._log.handled, now, event, origin)
        return self.machine.handle(event, now)

    def _safely(self, call: Callable[..., _T], *arguments: Any) -> _T | None:
        """Call a function; report its exception to `on_failure`'s callback and return None; else raise it."""
        try:
            return call(*arguments)
        except Exception as problem:
            if self._failed is None:
                raise
            self._failed(problem)
        return None

    def drain(self, more: bool = False) -> None:
        """Fire due deadlines and step all queued events, also those that are queued meanwhile.

        A mission that loops without time passing gets a standstill event, which leads to FAULT; the rest
        waits for the next call: see `next_deadline`.

        Args:
            more: count the steps of the call before as well, because no time has passed.
        """
        if self._stepping:
            return
        self._at_once = self._at_once if more else 0
        while self._safely(self._set_clock) or self._safely(self._fire_due) or self._take_next():
            if self._at_once > MOST_AT_ONCE:
                self._carry_out(self._handle(Event(STANDSTILL, {"detail": self._circle()}), self.clock.now()))
                self._at_once = 0
                return

    def _count(self, step: Step) -> None:
        self._at_once += 1
        if self._at_once > MOST_AT_ONCE - _CIRCLE:
            self._entered |= dict.fromkeys(step.entered)
            self._begun |= {c.operation: None for c in step.commands if isinstance(c, Start)}

    def _circle(self) -> str:
        """Return the message about a loop without time, with the operations or states in it."""
        ways = ((self._begun, "begin and end"), (self._entered, "are entered"), ({"it": None}, "goes on"))
        names, do = next((", ".join(names), do) for names, do in ways if names)
        self._entered.clear()
        self._begun.clear()
        return (
            f"time stands still: more than {MOST_AT_ONCE} things happen at one moment;"
            f" {names} {do} over and over, so let one of them take time"
        )

    def _ahead(self, now: float) -> float | None:
        """Return how far the wall clock is ahead of the steady one; None without a wall clock."""
        wall = self._wall()
        return None if wall is None else wall - now

    def _set_clock(self) -> bool:
        """Pass the robot's wall clock to the machine when it was set or became known."""
        now, reported = self.clock.now(), self.machine.memory.wall
        ahead = self._ahead(now)
        if ahead is None or (reported is not None and abs(ahead - reported) <= CLOCK_TOLERANCE_S):
            return False
        self._carry_out(self._handle(events.clock(ahead), now))
        return True

    @property
    def next_deadline(self) -> float | None:
        """When `drain` is needed although nothing is posted, in the clock's time; None: never."""
        if self._queue:
            return self.clock.now()
        watched = self.watch.next_deadline if self.watch is not None else None
        due = self.machine.next_deadline
        return due if watched is None else watched if due is None else min(due, watched)

    def _fire_due(self) -> bool:
        now, due = self.clock.now(), self.machine.next_deadline
        if due is None or due > now:
            return self._report_late(now)
        if self._log is not None:
            self._safely(self._log.fired, now)
        step = self.machine.advance(now)
        if step is not None:
            self._carry_out(step)
        return step is not None

    def _report_late(self, now: float) -> bool:
        """Queue the reports of what time alone has broken; say whether there are any."""
        late = self.watch.late(now) if self.watch is not None else ()
        self._queue.extendleft(late)
        return bool(late)

    def _judge(self, step: Step) -> None:
        """Queue the reports of what a step has broken before everything else that waits."""
        if self.watch is not None:
            self._queue.extendleft(self.watch.take(step, self.machine.scope))

    def _take_next(self) -> bool:
        if not self._queue:
            return False
        self._safely(self._take, self._queue.popleft())
        return True

    def _take(self, reported: Event) -> None:
        machine = self.machine
        event = as_declared(reported, machine.chart.catalog, machine.memory.attempts)
        self._carry_out(self._handle(event, self.clock.now()))

    def _carry_out(self, step: Step) -> None:
        """Send cancels, publish the step, send the rest; a failing listener does not stop that.

        Cancels go first because publishing is slow, and a robot drives on meanwhile. Reports of drivers wait
        in the queue until the step is carried out.
        """
        self._stepping = True
        try:
            # What this step begins itself is not under way yet, so its end keeps its place.
            new = {command.attempt for command in step.commands if isinstance(command, Start)}
            rest: list[Start | Cancel | Act] = []
            for command in step.commands:
                if isinstance(command, Cancel) and command.attempt not in new:
                    self._end(command)
                elif isinstance(command, (Start, Cancel, Act)):
                    rest.append(command)
            try:
                self._count(step)
                self._safely(self._judge, step)
                self._safely(self.listener, step)
            finally:
                self._send_all(rest)
        finally:
            self._stepping = False

    def _send_all(self, commands: list[Start | Cancel | Act]) -> None:
        """Send cancels now, and the rest when the log is flushed."""
        waiting: list[Start | Act] = []
        for command in commands:
            if self._log is None:
                self._send(command)
            elif isinstance(command, Cancel):
                self._end(command)
            else:
                waiting.append(command)
                self._withheld.update([command.attempt] if isinstance(command, Start) else [])
        if waiting and self._log is not None:
            self._safely(self._log.when_flushed, lambda: self._begin(waiting))

    def _begin(self, commands: list[Start | Act]) -> None:
        """Send the commands that waited for the log, except those cancelled meanwhile."""
        for command in commands:
            if isinstance(command, Act) or command.attempt in self._withheld:
                self._withheld.discard(getattr(command, "attempt", ""))
                self._send(command)

    def _end(self, command: Cancel) -> None:
        """Cancel an attempt; one that was never sent ends at once."""
        if command.attempt in self._withheld:
            self._withheld.remove(command.attempt)
            self.post(events.cancelled(command.attempt))
        else:
            self._send(command)

    def _send(self, command: Command) -> None:
        """Hand a command to its driver; a driver that fails is an error of the attempt, not of the loop."""
        try:
            self._deliver(command)
        except Exception as problem:
            detail = f"{type(problem).__name__}: {problem}"
            if isinstance(command, Start):
                self.post(events.failed(command.attempt, DRIVER_CODE, detail))
            elif isinstance(command, (Cancel, Act)):
                name = command.action if isinstance(command, Act) else command.operation
                self.post(Event(DRIVER_FAILED, {"command": name, "detail": detail}))

    def _deliver(self, command: Command) -> None:
        if isinstance(command, Start):
            plugin, _, name = command.operation.partition(".")
            self.drivers[plugin].start(command.attempt, name, command.arguments)
        elif isinstance(command, Cancel):
            self.drivers[command.operation.partition(".")[0]].cancel(command.attempt)
        elif isinstance(command, Act):
            plugin, _, name = command.action.partition(".")
            self.drivers[plugin].act(name, command.arguments)


class Inbox(Protocol):
    """The queue of a loop."""

    def post(self, event: Event) -> None:
        """Queue an event."""


class EngineOutlet:
    """Where drivers report: every report becomes an event of the loop (see `plugin.contract.Outlet`)."""

    def __init__(self, engine: Inbox, wake: Callable[[], None]) -> None:
        """Make an outlet; `wake` is called after each report so that the owner of the loop drains."""
        self._engine = engine
        self._wake = wake

    def _post(self, event: Event) -> None:
        self._engine.post(event)
        self._wake()

    def accepted(self, attempt: str) -> None:
        """The server took the attempt."""
        self._post(events.accepted(attempt))

    def progress(self, attempt: str, detail: str) -> None:
        """The reason for which the attempt waits."""
        self._post(events.progress(attempt, shortened(detail, MAX_DETAIL)))

    def done(self, attempt: str, result: Mapping[str, Any]) -> None:
        """The attempt succeeded."""
        self._post(events.done(attempt, result))

    def failed(self, attempt: str, code: str, detail: str = "") -> None:
        """The attempt failed."""
        self._post(events.failed(attempt, code, shortened(detail, MAX_DETAIL)))

    def cancelled(self, attempt: str, result: Mapping[str, Any] | None = None) -> None:
        """The attempt ended as asked."""
        self._post(events.cancelled(attempt, result))

    def cancel_refused(self, attempt: str, detail: str) -> None:
        """The server refuses to end the attempt."""
        self._post(events.cancel_refused(attempt, shortened(detail, MAX_DETAIL)))

    def value(self, name: str, value: Any, stamp: float) -> None:
        """A live value changed."""
        self._post(events.observed(name, value, stamp))

    def event(self, name: str, data: Mapping[str, Any]) -> None:
        """One of a plugin's events happened."""
        self._post(Event(name, data))
