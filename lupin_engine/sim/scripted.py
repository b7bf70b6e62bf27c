"""Scripted servers: mocks that end operations by their arguments, after given times with given outcomes.

An unscripted operation ends as its plugin's own mock does. Times count from the acceptance of an attempt,
which comes at once unless the script delays it. An update goes on with the outcome and the time of the goal
in whose place it is taken.
"""

from __future__ import annotations

import enum
import random
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from lupin_engine.machine.scope import World
from lupin_engine.plugin.builtin import MISSING, READY, TIME_ZONE
from lupin_engine.plugin.contract import Operation, Outlet
from lupin_engine.plugin.mocks import contains
from lupin_engine.runtime.clock import UTC, VirtualClock, calendar_of
from lupin_engine.sim.agenda import Agenda
from lupin_engine.sim.measured import Measured, Metres, distance_of, is_pose


class OnCancel(enum.Enum):
    """The reaction of a scripted server to the cancel of an accepted attempt."""

    END = "ends"  #: confirms, after `cancel_after` seconds
    IGNORE = "ignored"  #: goes on, and ends as if nothing had been said
    REFUSE = "refused"  #: goes on, and says so
    SILENT = "unconfirmed"  #: stops, and never says so


@dataclass(frozen=True)
class Between:
    """A duration in seconds that is drawn anew each time; each gap between two neighbours is as likely."""

    low: float
    high: float
    between: tuple[float, ...] = ()

    def draw(self, dice: random.Random) -> float:
        """Return one of these durations."""
        bounds = (self.low, *self.between, self.high)
        gap = dice.randrange(len(bounds) - 1) if self.between else 0
        return dice.uniform(bounds[gap], bounds[gap + 1])


@dataclass(frozen=True)
class MockOutcome:
    """The end of one attempt: done with `result` over the mock's, failed with `code`, or never.

    Args:
        after: seconds from acceptance to the end; None: as long as the plugin's mock takes.
        accepted_after: seconds from the request to its acceptance; None: it is never accepted.
        cut_short: fields of the result that a cancel gives, over the mock's; None: it gives none.
        progress: reported after acceptance.
    """

    after: float | Between | None = None
    code: str = ""
    detail: str = ""
    result: Mapping[str, Any] = field(default_factory=dict)
    never: bool = False
    accepted_after: float | Between | None = 0.0
    on_cancel: OnCancel = OnCancel.END
    cancel_after: float | Between = 0.0
    cut_short: Mapping[str, Any] | None = None
    progress: str = ""

    @property
    def is_random(self) -> bool:
        """Whether anything about it is drawn."""
        durations = (self.after, self.accepted_after, self.cancel_after)
        return any(isinstance(duration, Between) for duration in durations)


@dataclass(frozen=True)
class AnyOf:
    """One of several outcomes, each as likely as its weight says beside the others."""

    outcomes: tuple[MockOutcome | AnyOf, ...]
    weights: tuple[float, ...]

    #: It is always drawn.
    is_random = True


@dataclass(frozen=True)
class Rule:
    """The outcomes of attempts of one operation.

    It covers an attempt that has all of `arguments` (records need only contain the given fields) and, with
    `target`, that is made at the itinerary's current target of that name, with `metres`, that drives so far,
    with `hour`, that begins in that hour of the day. With `once` each outcome is used once, in order, and the
    rule is spent after the last; else the first one is used always.
    """

    operation: str
    outcomes: tuple[MockOutcome | AnyOf, ...]
    arguments: Mapping[str, Any] = field(default_factory=dict)
    target: str | None = None
    once: bool = False
    metres: Metres | None = None
    hour: int | None = None

    @property
    def is_random(self) -> bool:
        """Whether anything about it is drawn."""
        return any(outcome.is_random for outcome in self.outcomes)

    def covers(
        self,
        operation: str,
        arguments: Mapping[str, Any],
        target: str,
        distance: float | None = None,
        hour: int | None = None,
    ) -> bool:
        """Say whether an attempt falls under this rule; it drives so many metres in that hour of the day."""
        if operation != self.operation or (self.target is not None and self.target != target):
            return False
        if self.hour is not None and self.hour != hour:
            return False
        if self.metres is not None and distance not in self.metres:
            return False
        return contains(arguments, self.arguments)


def drawn(outcome: MockOutcome | AnyOf, dice: random.Random) -> MockOutcome:
    """Return an outcome with its durations drawn; of several alternatives one, drawn by their weights."""
    while isinstance(outcome, AnyOf):
        (outcome,) = dice.choices(outcome.outcomes, outcome.weights)
    if not outcome.is_random:
        return outcome
    after, accepted = _drawn(outcome.after, dice), _drawn(outcome.accepted_after, dice)
    cancel = _drawn(outcome.cancel_after, dice) or 0.0
    return replace(outcome, after=after, accepted_after=accepted, cancel_after=cancel)


def _drawn(duration: float | Between | None, dice: random.Random) -> float | None:
    return duration.draw(dice) if isinstance(duration, Between) else duration


class _Server:
    """A rule in use, with its remaining outcomes and the number of uses."""

    def __init__(self, rule: Rule, number: int, seed: int) -> None:
        self.rule = rule
        self._left = list(rule.outcomes)
        self._name = f"{seed}/{number}"
        #: How many attempts fell under the rule.
        self.used = 0

    @property
    def is_spent(self) -> bool:
        """Whether every outcome was that of an attempt."""
        return not self._left if self.rule.once else self.used > 0

    @property
    def has_outcomes(self) -> bool:
        """Whether there is an outcome for one more attempt."""
        return bool(self._left)

    def next_outcome(self) -> MockOutcome:
        """Return the outcome of the next attempt.

        Every use of every rule has its own random numbers, so the draws of one mock do not depend on
        another's.
        """
        found = self._left.pop(0) if self.rule.once else self._left[0]
        self.used += 1
        if isinstance(found, MockOutcome) and not found.is_random:
            return found
        # Chance for tests: the same every time, and good enough to guess by.
        return drawn(found, random.Random(f"{self._name}/{self.used}"))


@dataclass
class _ServedAttempt:
    """An attempt that a scripted server has heard of."""

    operation: str
    arguments: Mapping[str, Any]
    outcome: MockOutcome
    #: How far it drives, in metres; None: nowhere.
    distance: float | None = None
    accepted: bool = False
    #: By how many seconds its answer is put off.
    late: float = 0.0
    #: When the first goal was accepted that it continues.
    since: float | None = None


class Stage:
    """All servers of one simulation.

    Args:
        world: that of the machine; its seed seeds the draws.
        clock: that of the simulation.
        target: returns the itinerary's current target, for rules that name one.
        measured: of a robot; what it drains is reported when an attempt ends.
    """

    def __init__(
        self,
        world: World,
        rules: Iterable[Rule],
        agenda: Agenda,
        clock: VirtualClock,
        target: Callable[[], str],
        measured: Measured,
    ) -> None:
        self._catalog = world.chart.catalog
        self._parameters = world.parameters
        self._servers = [_Server(rule, number, world.seed) for number, rule in enumerate(rules)]
        self._agenda = agenda
        self._now, self._wall = clock.now, clock.wall
        self._target = target
        self._calendar = calendar_of(world.parameters.get(TIME_ZONE, UTC))
        self._measured, self._drained = measured, clock.now()
        #: How many attempts of each operation, at each target and of each distance, fell under which rule.
        self.answered: Counter[tuple[str, str, float | None, int | None]] = Counter()
        self._pose: Any = None
        self._running: dict[str, _ServedAttempt] = {}
        self._silent: set[str] = set()
        self._missing: list[str] = []
        self._outlet: Outlet | None = None
        #: The last report of each value, and when; ends of attempts while there is no driver.
        self._values: dict[str, tuple[Any, float]] = {}
        self._undelivered: dict[str, Callable[[], None]] | None = None

    def drivers(self, outlet: Outlet) -> dict[str, ScriptedDriver]:
        """Return a driver for every plugin of the catalog, all reporting to `outlet` from now on."""
        self._outlet = outlet
        return {name: ScriptedDriver(self, name) for name in self._catalog.plugins}

    @property
    def unspent(self) -> dict[int, int]:
        """How many attempts fell under each rule of which not all outcomes were used, by its number."""
        return {number: one.used for number, one in enumerate(self._servers) if not one.is_spent}

    @property
    def outlet(self) -> Outlet:
        """Where the servers report."""
        assert self._outlet is not None, "the stage has no drivers yet"
        return self._outlet

    # -- what drivers ask for -----------------------------------------------------------------------------

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Take a request; accept it when its outcome says so."""
        if operation in self._silent:
            return
        distance = distance_of(self._catalog.operations[operation], arguments, self._pose)
        _, before = self._updated(operation)
        outcome = self._choose(operation, arguments, distance) if before is None else before.outcome
        running = _ServedAttempt(operation, arguments, outcome, distance)
        self._running[attempt] = running
        wait = running.outcome.accepted_after
        if wait == 0.0:
            self._accept(attempt)
        elif wait is not None:
            self._later(wait, lambda: self._accept(attempt))

    def cancel(self, attempt: str) -> None:
        """Cancel an accepted attempt as its outcome says; any other one goes on."""
        running = self._running.get(attempt)
        if running is None or not running.accepted or running.outcome.on_cancel is OnCancel.IGNORE:
            return
        if running.outcome.on_cancel is OnCancel.REFUSE:
            self.outlet.cancel_refused(attempt, f"{running.operation} refuses to stop, and may go on")
            return
        del self._running[attempt]
        if running.outcome.on_cancel is OnCancel.SILENT:
            return
        wait, given = running.outcome.cancel_after, running.outcome.cut_short
        result = None
        if given is not None:
            result = {**self._mocked(self._operation(running).mock.result, running), **given}
        if wait == 0.0:
            self.outlet.cancelled(attempt, result)
        else:
            self._later(wait, lambda: self.outlet.cancelled(attempt, result))

    def recover(self, attempt: str, *, adopt: bool) -> None:
        """Serve a driver that recovers an attempt: report its missed end, else cancel or keep it."""
        ended = (self._undelivered or {}).pop(attempt, None)
        running = self._running.get(attempt)
        if ended is not None:
            ended()
        elif running is None or not running.accepted:
            if running is None or running.operation not in self._silent:
                self._running.pop(attempt, None)
                self.outlet.cancelled(attempt)
        elif not adopt:
            self.cancel(attempt)

    # -- what the world does ------------------------------------------------------------------------------

    def report(self, value: str, is_now: Any) -> None:
        """Report a live value; the missing servers are progress or the end of attempts that wait for them."""
        self._values[value] = is_now, self._now()
        if is_pose(self._catalog, value):
            self._pose = is_now
        self.outlet.value(value, is_now, self._now())
        if value != MISSING:
            return
        self._missing = list(is_now)
        for attempt in [name for name, found in self._running.items() if found.operation == READY]:
            if self._missing:
                self.outlet.progress(attempt, ", ".join(self._missing))
            else:
                self._end(attempt, self._running[attempt].outcome)

    def end_current(self, operation: str, outcome: MockOutcome) -> bool:
        """End the newest attempt of an operation now; False when there is none."""
        for attempt, running in reversed(list(self._running.items())):
            if running.operation == operation:
                self._end(attempt, outcome)
                return True
        return False

    def disconnect(self) -> None:
        """Drop all reports but ends of attempts, until there are drivers again."""
        self._undelivered = {}
        self._outlet = _Disconnected(self._undelivered, lambda: self.outlet)

    def republish(self) -> None:
        """Report every value as it is, to new drivers."""
        self._undelivered = None
        for name, (value, stamp) in self._values.items():
            self.outlet.value(name, value, stamp)

    def leave(self, operation: str) -> None:
        """The server stops answering, also for attempts that it has accepted."""
        self._silent.add(operation)
        mine = [attempt for attempt, running in self._running.items() if running.operation == operation]
        for attempt in mine:
            del self._running[attempt]

    def come_back(self, operation: str) -> bool:
        """The server answers new requests; False when it was not silent."""
        away = operation in self._silent
        self._silent.discard(operation)
        return away

    def delay(self, operation: str, seconds: float) -> bool:
        """Delay the answer of the newest attempt of an operation; False when there is none."""
        running = next((one for one in reversed(self._running.values()) if one.operation == operation), None)
        if running is not None:
            running.late += seconds
        return running is not None

    @property
    def away(self) -> list[str]:
        """The operations whose servers have left."""
        return sorted(self._silent)

    # -- how attempts go on -------------------------------------------------------------------------------

    def _later(self, wait: float | Between, action: Callable[[], None]) -> None:
        assert not isinstance(wait, Between), "every duration was drawn"
        self._agenda.note(self._now() + wait, action)

    def _choose(self, operation: str, arguments: Mapping[str, Any], distance: float | None) -> MockOutcome:
        target, hour = self._target(), self._calendar.hour(self._wall())
        for number, server in enumerate(self._servers):
            if server.has_outcomes and server.rule.covers(operation, arguments, target, distance, hour):
                self.answered[operation, target, distance, number] += 1
                return server.next_outcome()
        self.answered[operation, target, distance, None] += 1
        return MockOutcome()

    def _accept(self, attempt: str) -> None:
        running = self._running.get(attempt)
        if running is None:
            return
        before, replaced = self._updated(running.operation)
        if replaced is not None:
            del self._running[before]
            running.late, running.since = replaced.late, replaced.since
        running.accepted = True
        running.since = self._now() if running.since is None else running.since
        outcome = running.outcome
        self.outlet.accepted(attempt)
        if replaced is not None:
            self.outlet.cancelled(before)
        missing = ", ".join(self._missing) if running.operation == READY else ""
        if outcome.progress or missing:
            self.outlet.progress(attempt, outcome.progress or missing)
        if not outcome.never:
            after = self._operation(running).mock.after if outcome.after is None else outcome.after
            assert not isinstance(after, Between), "every duration was drawn"
            left = max(0.0, running.since + after - self._now())
            self._later(left, lambda: self._come_to_end(attempt, outcome))

    def _updated(self, operation: str) -> tuple[str, _ServedAttempt | None]:
        """Return the goal in whose place the server takes a new one."""
        if self._catalog.operations[operation].updates:
            for attempt, running in self._running.items():
                if running.operation == operation and running.accepted:
                    return attempt, running
        return "", None

    def _come_to_end(self, attempt: str, outcome: MockOutcome) -> None:
        """End an attempt now, or as much later as `delay` has put it off; one that has ended is ignored."""
        running = self._running.get(attempt)
        late = running.late if running is not None else 0.0
        if running is None or not late:
            self._end(attempt, outcome)
            return
        running.late = 0.0
        self._later(late, lambda: self._come_to_end(attempt, outcome))

    def _end(self, attempt: str, outcome: MockOutcome) -> None:
        running = self._running.get(attempt)
        if running is None or (running.operation == READY and self._missing):
            return
        del self._running[attempt]
        self._drain(0.0 if outcome.code else running.distance or 0.0)
        if outcome.code:
            self.outlet.failed(attempt, outcome.code, outcome.detail)
        else:
            mock = self._operation(running).mock
            for name, is_now in self._mocked(mock.values, running).items():
                known = {} if callable(mock.values) else self._measured.values
                self.report(name, known.get(name, is_now))
            self.outlet.done(attempt, {**self._mocked(mock.result, running), **outcome.result})

    def _drain(self, metres: float) -> None:
        """Report what live values have lost by now, after so many metres."""
        minutes, self._drained = (self._now() - self._drained) / 60.0, self._now()
        for drain in self._measured.drains:
            known = self._values.get(drain.value)
            level = self._catalog.values[drain.value].initial if known is None else known[0]
            if isinstance(level, (int, float)):
                lost = drain.per_metre * metres + drain.per_minute * minutes
                self.report(drain.value, max(0.0, level - lost))

    def _mocked(self, given: Any, running: _ServedAttempt) -> Mapping[str, Any]:
        found: Mapping[str, Any] = given(running.arguments, self._parameters) if callable(given) else given
        return found

    def _operation(self, running: _ServedAttempt) -> Operation:
        return self._catalog.operations[running.operation]


class _Disconnected:
    """The outlet while there is no driver: stores the ends of attempts for a recovery."""

    def __init__(self, ends: dict[str, Callable[[], None]], later: Callable[[], Outlet]) -> None:
        self._ends = ends
        self._later = later

    def accepted(self, attempt: str) -> None:
        """Dropped."""

    def progress(self, attempt: str, detail: str) -> None:
        """Dropped."""

    def done(self, attempt: str, result: Mapping[str, Any]) -> None:
        """Stored."""
        self._ends[attempt] = lambda: self._later().done(attempt, result)

    def failed(self, attempt: str, code: str, detail: str = "") -> None:
        """Stored."""
        self._ends[attempt] = lambda: self._later().failed(attempt, code, detail)

    def cancelled(self, attempt: str, result: Mapping[str, Any] | None = None) -> None:
        """Stored."""
        self._ends[attempt] = lambda: self._later().cancelled(attempt, result)

    def cancel_refused(self, attempt: str, detail: str) -> None:
        """Dropped: a repeated cancel is refused again."""

    def value(self, name: str, value: Any, stamp: float) -> None:
        """Dropped: values are reported again."""

    def event(self, name: str, data: Mapping[str, Any]) -> None:
        """Dropped."""


class ScriptedDriver:
    """The driver of a plugin whose servers a stage plays (`plugin.contract.Driver`)."""

    def __init__(self, stage: Stage, plugin: str) -> None:
        self._stage = stage
        self._plugin = plugin

    def missing(self) -> list[str]:
        """Return []: a scripted server is always there."""
        return []

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Begin an attempt."""
        self._stage.start(attempt, f"{self._plugin}.{operation}", arguments)

    def cancel(self, attempt: str) -> None:
        """Ask that an attempt ends."""
        self._stage.cancel(attempt)

    def recover(self, attempt: str, operation: str, *, adopt: bool) -> None:
        """Adopt an attempt of another process, or have it cancelled."""
        self._stage.recover(attempt, adopt=adopt)

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Carry out an action: the record of the step is all that comes of it."""

    def close(self) -> None:
        """Do nothing: no resource is held."""
