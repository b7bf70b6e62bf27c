"""The environment of a proof: enumerates the moves of servers, sensors, clocks and people in a situation.

A server may accept, end in any result of the declared classes or in any declared code, end by itself, or be
silent until the deadline. After a cancel it may still accept, end, or be silent; and an answer to an attempt
that is over may come. Live values take any value of their classes, every request comes at any time, and the
process may be restarted. Any running deadline may be the next, except after one that is due earlier by the
order of deadlines (`ranks_after`).
"""

from __future__ import annotations

import enum
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any, NamedTuple, TypeVar

from lupin_engine.chart import Chart, State
from lupin_engine.machine import (
    ANSWERED,
    CANCELLED_CODE,
    CLOCK,
    RELEASED,
    RESUMED,
    WAITS,
    Attempt,
    Event,
    Machine,
    Phase,
    Reported,
    ResourceClaim,
    Step,
    Timer,
    Timers,
)
from lupin_engine.machine import event as events
from lupin_engine.plugin import RESTARTED, is_builtin
from lupin_engine.properties import Remembered
from lupin_engine.sim import label_of
from lupin_verify.situations.classes import Classes
from lupin_verify.situations.relevance import ANY_ABANDONED, invokes, is_abandoned
from lupin_verify.situations.situation import (
    RANKS,
    WATCHED,
    Situation,
    SlotTable,
    TrackedDict,
    TrackedList,
    TrackedMemory,
    is_waited_for,
)

_Entry = TypeVar("_Entry", str, ResourceClaim)
#: A deadline: its kind, its owner and the event that it makes there.
TimerName = tuple[str, str, str]
#: Two deadlines of which the first certainly comes before the second: by at least so many seconds.
Rank = tuple[TimerName, TimerName, float]
#: Deadlines without an order: a time of day, and the end of a freshness, which each report puts off.
_UNRANKED = frozenset({"at", "fresh"})

#: The states of the properties' monitors, by name.
Watched = tuple[tuple[str, Remembered], ...]
#: The same missions are reloaded; during a mission that waits for its end.
LOADED = Event("loaded")
#: The kind of the deadlines of properties; each fires after all others that are due at the same moment.
OF_PROPERTY, _LAST = "property", sys.maxsize
#: The digits of differences of deadlines.
_DIGITS = 9


class Mover(enum.IntFlag):
    """Who makes a move."""

    ANSWER = 1  #: a server accepts, or ends well
    FAILURE = 2  #: a server ends in a code, or by itself
    TIMER = 4
    REQUEST = 8
    ABORT = 16
    WORLD = 32  #: a live value, an event, a restart, or a stray answer
    AT_ONCE = 64  #: a deadline of 0 s


@dataclass(frozen=True)
class WorldMove:
    """A move of the environment: an event, or a deadline that fires.

    A combined move, `made_of` several by their numbers, is the last of them after reports of values. With
    `unchanged` the deadline is that of an update, and the arguments are still the same.
    """

    side: Mover
    event: Event | None = None
    timer: TimerName = ("", "", "")
    made_of: tuple[int, ...] = ()
    unchanged: bool = False

    @property
    def reports_value(self) -> bool:
        """Whether it reports a live value, or the robot's clock."""
        return self.event is not None and self.event.name in ("value", CLOCK)


class Due(NamedTuple):
    """The deadlines that may be the next, as moves; one that is due `at_once` precedes everything else."""

    at_once: bool
    moves: tuple[int, ...]


class WorldMoves:
    """All moves of one chart, numbered when they are first enabled."""

    def __init__(self, table: SlotTable, classes: Classes, owed: int, restarts: bool, deferred: int) -> None:
        """Begin with the moves that are enabled everywhere.

        Args:
            table: the slots of the chart.
            classes: the representative values of answers, live values and requests.
            owed: how many abandoned attempts of one operation may still be answered.
            restarts: whether the process may end and be continued by another, and missions be reloaded.
            deferred: how many events of one name, and how many times of day, wait during a hold.
        """
        self._table = table
        self._classes = classes
        self.owed = owed
        self._deferred = deferred
        every = (invoke for _, invoke in invokes(table.relevance.chart))
        #: The classes of abandoned attempts of which an update leaves two.
        self._updated = {f"~{one.name}" for one in every if one.update is not None}
        #: Whether an event of which so many wait already, or a time of day, was left out during a hold.
        self.cuts_waiting = False
        self.all: list[WorldMove] = []
        self._numbers: dict[tuple[Any, ...], int] = {}
        #: The slots that decide which deadlines may be the next, and the slot of the names of the attempts.
        self.slots_of_timers = tuple(table.index[name] for name in (("timers", ""), RANKS, WATCHED))
        self.slot_of_order = table.index["attempts", ""]
        #: The moves that are enabled wherever no deadline is due at once.
        self.everywhere = tuple(self._number((name,), move) for name, move in self._always(restarts))
        self._of_attempt: dict[tuple[int, int], tuple[int, ...]] = {}
        self._of_timers: dict[tuple[int, ...], Due] = {}

    def _number(self, key: tuple[Any, ...], move: WorldMove) -> int:
        found = self._numbers.get(key)
        if found is None:
            found = self._numbers[key] = len(self.all)
            self.all.append(move)
        return found

    def _always(self, restarts: bool) -> Iterator[tuple[str, WorldMove]]:
        abort = f"operator.{self._table.relevance.chart.profile.abort}"
        for number, event in enumerate(self._classes.requests):
            side = Mover.REQUEST | (Mover.ABORT if event.name == abort else Mover(0))
            yield f"request {number}", WorldMove(side, event)
        for number, event in enumerate(self._classes.values):
            yield f"value {number}", WorldMove(Mover.WORLD, event)
        for number, event in enumerate(self._classes.moments):
            yield f"clock {number}", WorldMove(Mover.WORLD, event)
        for number, event in enumerate(self._classes.events):
            yield f"event {number}", WorldMove(Mover.WORLD, event)
        yield "stray", WorldMove(Mover.WORLD, events.done("long over", {}))
        if restarts:
            yield "restart", WorldMove(Mover.WORLD, Event(RESUMED, {"detail": "", "held": True, "away": 1.0}))
            yield "released", WorldMove(Mover.WORLD, Event(RELEASED, {"hold": RESTARTED}))
            yield "loaded", WorldMove(Mover.WORLD, LOADED)

    def preceded_by(self, values: tuple[int, ...], number: int) -> int:
        """Return the number of a move combined with reports of values before it, given by their numbers."""
        if not values:
            return number
        made_of = (*values, number)
        return self._number(("made of", made_of), replace(self.all[number], made_of=made_of))

    def each(self, number: int) -> tuple[int, ...]:
        """Return the moves of a combined move, or the move itself."""
        return self.all[number].made_of or (number,)

    def unconstrained_values(self) -> dict[int, dict[int, int]]:
        """Return the slots of inputs that may be unconstrained: one for its live value, and never stale.

        The robot's clock is one, too. Each has the numbers of its values with those of the moves that report
        them.
        """
        found: dict[int, dict[int, int]] = {}
        for number in self.everywhere:
            event = self.all[number].event
            if event is None or not self.all[number].reports_value:
                continue
            if event.name == CLOCK:
                slot = self._table.index["wall", ""]
                found.setdefault(slot, {})[self._table.number(slot, event.data["ahead"])] = number
                continue
            specs = [i for i in self._table.relevance.chart.inputs.values() if i.value == event.data["name"]]
            if len(specs) == 1 and specs[0].freshness is None:
                slot = self._table.index["inputs", specs[0].name]
                value = self._table.number(slot, Reported(event.data["value"], 0.0))
                found.setdefault(slot, {}).setdefault(value, number)
        return {slot: values for slot, values in found.items() if len(values) > 1}

    # -- enabled moves --------------------------------------------------------------------------------

    def due(self, numbers: tuple[int, ...]) -> Due:
        """Return the deadlines that may be the next, by the values of `slots_of_timers`."""
        found = self._of_timers.get(numbers)
        if found is None:
            found = self._of_timers[numbers] = self._due(*numbers)
        return found

    def running(self, timers: int) -> frozenset[TimerName]:
        """Return the running deadlines of the chart, by the value of their slot."""
        slot = self.slots_of_timers[0]
        armed = self._table.value(slot, timers) if timers else ()
        return frozenset((kind, *about) for _, _, kind, about in armed)

    def spending(self, timers: int) -> frozenset[TimerName]:
        """Return the running budgets that are not used up, without those that an entry resets."""
        armed = self._table.value(self.slots_of_timers[0], timers) if timers else ()
        found = ((kind, *about) for due, _, kind, about in armed if kind == "budget" and due > 0.0)
        return frozenset(name for name in found if not self._is_of_a_part(name[1]))

    def _is_of_a_part(self, state: str) -> bool:
        """Return whether a state is in an embedded submachine, whose budgets each entry resets."""
        states = self._table.relevance.chart.states
        around = states[state].parent
        return around is not None and (states[around].use is not None or self._is_of_a_part(around))

    def attempts(self, number: int) -> tuple[int, ...]:
        """Return the slots of the attempts, by the value of `slot_of_order`."""
        names = self._table.value(self.slot_of_order, number) if number else ()
        return tuple(self._table.slot(("attempts", name)) for name in names)

    def answers(self, slot: int, number: int) -> tuple[int, ...]:
        """Return the possible answers to the attempt in a slot, as moves."""
        found = self._of_attempt.get((slot, number))
        if found is None:
            found = self._of_attempt[slot, number] = self._answers(self._table.value(slot, number))
        return found

    def _due(self, armed_now: int, ranked: int, watched: int) -> Due:
        table, (timers_slot, ranks_slot, watched_slot) = self._table, self.slots_of_timers
        timers = list(table.value(timers_slot, armed_now) or ())
        timers += deadlines_of(table.value(watched_slot, watched) or ())
        ranks = table.value(ranks_slot, ranked) or frozenset()
        now = [(kind, *about) for due, _, kind, about in timers if due <= 0.0]
        if now:
            move = WorldMove(Mover.TIMER | Mover.AT_ONCE, timer=now[0])
            return Due(True, (self._number(("at once", *now[0]), move),))
        armed: list[TimerName] = [(kind, *about) for _, _, kind, about in timers]
        late = {after for before, after, lead in ranks if lead >= 0.0 and before in armed}
        return Due(False, tuple(self._firing(timer for timer in armed if timer not in late)))

    def _firing(self, timers: Iterable[TimerName]) -> Iterator[int]:
        """Yield the moves that fire deadlines; that of an update with other arguments, and with the same."""
        for timer in timers:
            yield self._number(timer, WorldMove(Mover.TIMER, timer=timer))
            if timer[0] == "update":
                yield self._number(("unchanged", *timer), WorldMove(Mover.TIMER, timer=timer, unchanged=True))

    def _answers(self, attempt: Attempt) -> tuple[int, ...]:
        """Return the possible answers to an attempt, as moves."""
        found = []
        for key, side, event in self._possible_answers(attempt):
            found.append(self._number((attempt.id, *key), WorldMove(side, event)))
        return tuple(found)

    def _possible_answers(self, attempt: Attempt) -> Iterator[tuple[tuple[Any, ...], Mover, Event]]:
        """Yield the possible answers to an attempt."""
        if is_abandoned(attempt.id) and attempt.phase is not Phase.WAITING:
            yield ("accepted",), Mover.ANSWER, events.accepted(attempt.id)
            yield ("done",), Mover.ANSWER, events.done(attempt.id, {})
            yield ("failed",), Mover.ANSWER, events.failed(attempt.id, CANCELLED_CODE)
            yield ("cancelled",), Mover.ANSWER, events.cancelled(attempt.id)
        elif attempt.phase is not Phase.WAITING:
            yield from self._answers_of_known(attempt)

    def _answers_of_known(self, attempt: Attempt) -> Iterator[tuple[tuple[Any, ...], Mover, Event]]:
        if attempt.phase not in (Phase.ACCEPTED, Phase.REPLACED):
            yield ("accepted",), Mover.ANSWER, events.accepted(attempt.id)
        speaks = attempt.phase in (Phase.REQUESTED, Phase.ACCEPTED)
        results = self._classes.results(attempt.operation, attempt.arguments)
        gives = self._classes.gives_result(attempt.operation)
        for number, result in enumerate(results if speaks or gives else results[:1]):
            yield ("done", number), Mover.ANSWER, events.done(attempt.id, result)
        reports = self._classes.reports(attempt.operation, attempt.arguments) if speaks else ()
        for number, event in enumerate(reports):
            yield ("told", number), Mover.ANSWER, event
        codes = self._classes.codes(attempt.operation)
        for code in codes if speaks else codes[:1]:
            yield ("failed", code), Mover.FAILURE, events.failed(attempt.id, code)
        side = Mover.FAILURE if speaks else Mover.ANSWER
        yield ("cancelled",), side, events.cancelled(attempt.id)
        for number, result in enumerate(results if gives and not speaks else ()):
            yield ("gave", number), Mover.ANSWER, events.cancelled(attempt.id, result)

    # -- executing a move -------------------------------------------------------------------------------

    def carry_out(self, machine: Machine, memory: TrackedMemory, move: WorldMove) -> Step | None:
        """Make the step of a move; None where it is beyond the bounds.

        Beyond them are an event of one name and a time of day of which enough wait for the end of a hold,
        and a success before the live values that the operation sets are known.
        """
        if move.event is None:
            return self._fire(machine, memory, move.timer)
        name = move.event.name
        if name in machine.chart.catalog.events and self._is_full(memory, name):
            return None
        if name == "attempt.done" and not self._is_reported(memory, move.event.data["attempt"]):
            return None
        if name == RESUMED:
            label, stages = label_of(machine.chart, memory.configuration), machine.chart.profile.stages
            held = label not in stages.without_mission
            return machine.handle(replace(move.event, data={**move.event.data, "held": held}), 0.0)
        if name == "value":
            inputs = [i.name for i in machine.chart.inputs.values() if i.value == move.event.data["name"]]
            with memory.unread("inputs", inputs, _BEFORE):
                return machine.handle(move.event, 0.0)
        return machine.handle(move.event, 0.0)

    def _is_full(self, memory: TrackedMemory, name: str) -> bool:
        """Return whether no more events of a name may wait for the end of a hold."""
        found = sum(waiting.name == name for waiting in memory.deferred) >= self._deferred
        self.cuts_waiting = self.cuts_waiting or found
        return found

    def _is_reported(self, memory: TrackedMemory, attempt: str) -> bool:
        """Return whether all live values are known that the operation of an attempt sets."""
        found = None if is_abandoned(attempt) else memory.attempts.get(attempt)
        reported = () if found is None else self._classes.reported_inputs(found.operation, found.arguments)
        return all(name in memory.inputs for name in reported)

    def _fire(self, machine: Machine, memory: TrackedMemory, wanted: TimerName) -> Step | None:
        kind, owner, event = wanted
        if kind == "at" and self._is_full(memory, WAITS):
            return None
        timers = memory.timers
        found = next(t for t in timers if (t[2], *t[3]) == wanted)
        timers.remove(found)
        timers.insert(0, (0.0, found[1], kind, (owner, event)))
        if kind == "at" and self._classes.moments:
            memory.wall = self._classes.time_comes(event.split(" ")[-1], lambda: memory.wall)
        if kind == "fresh":
            known, freshness = memory.inputs[owner], machine.chart.inputs[owner].freshness
            memory.inputs[owner] = known._replace(stamp=-(freshness or 0.0))
        return machine.advance(0.0)

    def is_within_bounds(self, name: str) -> bool:
        """Return whether an attempt's number is within the bound of abandoned attempts."""
        kind, number, count = name.rpartition("#")
        most = self.owed + 1 + (kind in self._updated)
        return not number or kind == ANY_ABANDONED or int(count) <= most


#: Stands for the value of an input before a report: another value, reported at the same time.
_BEFORE = Reported(object(), 0.0)


def running(table: SlotTable, situation: Situation) -> list[Timer]:
    """Return the running deadlines of a situation, with those of properties."""
    timers: list[Timer] = table.get(situation, ("timers", "")) or []
    return [*timers, *deadlines_of(table.get(situation, WATCHED) or ())]


def deadlines_of(watched: Watched) -> list[Timer]:
    """Return the deadlines of properties."""
    due = [(state[0], name) for name, state in watched if state and state[0] < math.inf]
    return [(seconds, _LAST, OF_PROPERTY, (name, "")) for seconds, name in due]


def drop_abandoned(memory: TrackedMemory, owed: int) -> None:
    """Remove abandoned attempts that hold no resource, but the newest `owed`.

    Only a late answer can come to one, and it concerns no other. Built-in operations give none.
    """
    for name in list(_were_waited_for(memory)):
        memory.attempts.get(name)
    # Attempts that the step has not read are unchanged.
    inert = _inert(memory, dict.values(memory.attempts))
    if inert and owed:
        inert = _inert(memory, memory.attempts.values())
    own = [name for name in inert if is_builtin(memory.attempts[name].operation)]
    others = [name for name in inert if name not in own]
    for name in (*own, *others[: len(others) - owed]):
        del memory.attempts[name]
        Timers(memory).disarm("cancel", name)


def _inert(memory: TrackedMemory, attempts: Iterable[Attempt]) -> list[str]:
    """Return the attempts to which only a late answer can come."""
    over = (a for a in attempts if a.phase is Phase.LOST or (a.phase is Phase.CANCELLING and not a.uses))
    return [attempt.id for attempt in over if not is_waited_for(memory, attempt)]


def _were_waited_for(memory: TrackedMemory) -> Iterator[str]:
    """Yield the cancelled attempts that an invocation waited for before the step, of those it has read."""
    invocations = memory.invocations
    assert isinstance(invocations, TrackedDict)
    for name in (*dict.keys(invocations), *invocations.removed):
        before = memory.fetch(memory.table.slot(("invocations", name)))
        if before is not None and before.cut is not None:
            yield before.cut.attempt


def in_order(memory: TrackedMemory) -> None:
    """Sort entries whose order the machine ignores, into a canonical order.

    Invocations are ordered within one state only. Adjacent deferred answers of elements of one state are
    unordered if nothing is stored from them (see `Relevance.keeps_nothing`).
    """
    invocations, answers = memory.invocations, memory.deferred
    if not (isinstance(answers, TrackedList) and answers.is_unread):
        beside = groupby(answers, lambda event: _element_of(event, memory.table.relevance.keeps_nothing))
        answers[:] = [e for state, run in beside for e in (sorted(run, key=_attempt_of) if state else run)]
    assert isinstance(invocations, TrackedDict)
    if invocations.order is not None:
        invocations.order.sort(key=lambda name: name.partition("[")[0])


def canonical_claims(memory: TrackedMemory) -> tuple[ResourceClaim, ...]:
    """Sort attempts and their claims into a canonical order; return the claims.

    Only a waiting attempt depends on those before it, so those between two waiting ones are sorted.
    """
    attempts, claims = memory.attempts, memory.claims
    assert isinstance(attempts, TrackedDict)
    if attempts.order is not None:
        waiting = {claim.attempt for claim in claims if claim.waits}
        attempts.order[:] = _sorted_between(attempts.order, waiting.__contains__)
    return tuple(_sorted_between(claims, lambda claim: claim.waits))


def _sorted_between(entries: Iterable[_Entry], stays: Callable[[_Entry], bool]) -> list[_Entry]:
    """Return entries with the runs between those that stay sorted."""
    return [one for keeps, run in groupby(entries, stays) for one in (run if keeps else sorted(run))]


def _attempt_of(event: Event) -> str:
    return str(event.data.get("attempt", ""))


def _element_of(event: Event, states: Set[str]) -> str:
    """Return the state of the element that an answer belongs to, if it is one of these; '' otherwise."""
    state, is_element, _ = _attempt_of(event).partition("[")
    return state if is_element and event.name == ANSWERED and state in states else ""


class Deadlines(NamedTuple):
    """The running deadlines after a step, and those that a hold stops; only those that have an order.

    Where differences are stored, `fired` is the deadline that made the step: its name, or `AWAY`.
    """

    armed: tuple[Timer, ...]
    frozen: tuple[Timer, ...]
    fired: TimerName | None = None


def rankable(chart: Chart, timers: Iterable[Timer]) -> Iterator[Timer]:
    """Yield the deadlines with a known delay: not times of day, freshness, or retries with jitter."""
    for timer in timers:
        _, _, kind, (owner, _) = timer
        state = owner.removeprefix("i:").partition("[")[0] if kind == "retry" else ""
        if kind not in _UNRANKED and not (state and _has_jitter(chart.states[state])):
            yield timer


def _has_jitter(state: State) -> bool:
    invokes = (state.invoke, state.for_each.invoke if state.for_each else None)
    return any(one is not None and one.retry is not None and one.retry.jitter is not None for one in invokes)


def _left_of_properties(ranks: Iterable[Rank]) -> dict[TimerName, float]:
    """Return the least time left of each property's deadline."""
    left: dict[TimerName, float] = {}
    for _, late, lead in ranks:
        if late[0] == OF_PROPERTY:
            left[late] = max(lead, left.get(late, lead))
    return left


def _lead(late: TimerName, least: float, early: float) -> float:
    """Return by how much a deadline is later at least; 0 unless it is a property's."""
    return round(least - early, _DIGITS) if late[0] == OF_PROPERTY else 0.0


def ranks_after(
    before: frozenset[Rank],
    deadlines: Deadlines,
    fresh: frozenset[TimerName],
    renamed: Mapping[str, str],
) -> frozenset[Rank]:
    """Return the partial order of deadlines after a step: pairs of which the first fires before the second.

    A deadline that is set now is after every running one of the same delay or less. Of those set in one step
    the shorter is first. A deadline that a hold stops is never before one that it does not stop. A budget may
    be used up in part, and a tick may be early after a late one, so these are after nothing. Only for
    deadlines of properties the least lead is stored: a deadline that is set later for no longer than the lead
    is before it, too. So delays of successive states add up.

    Args:
        before: the order before the step; the step itself does not depend on it.
        deadlines: the deadlines after the step.
        fresh: those of them that the step has set.
        renamed: the attempts with another name.
    """
    named = [
        ((timer[2], *timer[3]), timer, stopped) for timer, stopped in _both(deadlines.armed, deadlines.frozen)
    ]
    stops = {name: stopped for name, _, stopped in named}
    old = stops.keys() - fresh
    left = _left_of_properties(before)
    left |= {
        name: timer[0]
        for name, timer, _ in named
        if name in fresh and name[0] != "budget" and not name[2].startswith("every")
    }
    known = ((name_after(a, renamed), name_after(b, renamed), lead) for a, b, lead in before)
    ranks = {(a, b, lead) for a, b, lead in known if {a, b} <= old and (stops[b] or not stops[a])}
    for late, late_timer, late_stopped in named:
        least = left.get(late, -1.0)
        for early, early_timer, early_stopped in named:
            is_new = early != late and (late in fresh or early in fresh)
            if is_new and early_timer[:2] < (least, late_timer[1]) and (late_stopped or not early_stopped):
                ranks.add((early, late, _lead(late, least, early_timer[0])))
    return frozenset(ranks)


def name_after(timer: TimerName, renamed: Mapping[str, str]) -> TimerName:
    """Return a deadline's name after attempts are renamed; `GONE` if another attempt got its owner's name."""
    kind, owner, event = timer
    if owner in renamed.values() and owner not in renamed:
        return GONE
    return kind, renamed.get(owner, owner), event


#: The name of a deadline whose owner is gone.
GONE: TimerName = ("", "", "")
#: Instead of a deadline that fired: the process was gone, and what was due meanwhile fires late.
AWAY: TimerName = ("away", "", "")


def differences_after(
    before: frozenset[Rank],
    deadlines: Deadlines,
    fresh: frozenset[TimerName],
    renamed: Mapping[str, str],
) -> frozenset[Rank]:
    """Return difference bounds of deadlines after a step: the second is later by at least so many seconds.

    A negative bound limits how much earlier it may be, and one of 0 or more is an order, as in `ranks_after`,
    whose arguments these are. When a deadline fires, its bounds become bounds of the time that is left of
    the others: 6 s and then 5 s are after 10 s.
    """
    fired, is_away = deadlines.fired, deadlines.fired == AWAY
    least, most = dict[TimerName, float](), dict[TimerName, float]()
    for early, late, lead in before if not is_away else ():
        named = name_after(late, renamed)
        least[named] = max(lead, least.get(named, 0.0))
        if late == fired:
            named = name_after(early, renamed)
            most[named] = min(-lead, most.get(named, math.inf))
    kinds = {
        (timer[2], *timer[3]): (timer, stopped) for timer, stopped in _both(deadlines.armed, deadlines.frozen)
    }
    for name, (timer, _) in kinds.items():
        if name in fresh:
            is_partial = name[0] == "budget" or name[2].startswith("every")
            least[name], most[name] = 0.0 if is_partial else timer[0], timer[0]
        most[name] = min(timer[0], most.get(name, math.inf))
    found = set[Rank]()
    for a, b, lead in before:
        early, late = name_after(a, renamed), name_after(b, renamed)
        if {early, late} <= kinds.keys() - fresh and (kinds[late][1] or not kinds[early][1]):
            found.add((early, late, min(lead, 0.0) if is_away else lead))
    for late, (late_timer, late_stopped) in kinds.items():
        for early, (early_timer, early_stopped) in kinds.items():
            is_known = early != late and (late in fresh or (early in fresh and not is_away))
            if is_known and (late_stopped or not early_stopped):
                lead = round(least.get(late, 0.0) - most[early], _DIGITS)
                is_tie = lead == 0.0 and not (late in fresh and early in fresh and early_timer < late_timer)
                found.add((early, late, -_TIE if is_tie else lead))
    return frozenset(found)


#: Stands for a difference of 0 s of deadlines without an order (s).
_TIE = 1e-6


def _both(armed: Iterable[Timer], frozen: Iterable[Timer]) -> Iterator[tuple[Timer, bool]]:
    yield from ((timer, False) for timer in armed)
    yield from ((timer, True) for timer in frozen)
