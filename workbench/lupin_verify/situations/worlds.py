"""What may come next in a situation: all that servers, sensors, clocks and people can do at any moment.

A server that was asked may accept, end in any result of the declared classes or in any declared code, end
by itself, or say nothing until the deadline. After a cancel it may still accept, end, or say nothing; and
anybody may speak of an attempt that is long over. Live values take any value of their classes, every request
comes at any time, and the process may be restarted. Of the deadlines that are set any may be the next, but
for those before which another one certainly comes.
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
from lupin_verify.situations.relevance import ANY_ORPHAN, is_orphan
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
#: Deadlines that are in no order: a time of day, and the end of a freshness, which each report puts off.
_UNRANKED = frozenset({"at", "fresh"})

#: What properties remember, by their names.
Watched = tuple[tuple[str, Remembered], ...]
#: The missions are loaded anew, as they are; where one is under way, that waits for its end.
LOADED = Event("loaded")
#: The kind of the deadlines of properties; each comes after what is due at the same moment.
OF_PROPERTY, _LAST = "property", sys.maxsize
#: To so many digits differences of deadlines are kept.
_DIGITS = 9


class Mover(enum.IntFlag):
    """Whose move it is."""

    ANSWER = 1  #: a server accepts, or ends well
    FAILURE = 2  #: a server ends in a code, or by itself
    TIMER = 4
    REQUEST = 8
    ABORT = 16
    WORLD = 32  #: a live value, an event, a restart, or what changes nothing
    AT_ONCE = 64  #: a deadline without any time


@dataclass(frozen=True)
class WorldMove:
    """Something that happens: an event, or the deadline of a kind, an owner and an event of its own.

    One that is `made_of` several moves, by their numbers, is the last of them; before it values are told.
    """

    side: Mover
    event: Event | None = None
    timer: TimerName = ("", "", "")
    made_of: tuple[int, ...] = ()

    @property
    def tells_value(self) -> bool:
        """Whether it tells a live value."""
        return self.event is not None and self.event.name == "value"


class Due(NamedTuple):
    """The deadlines that may be the next, as moves; what is due `at_once` comes before everything else."""

    at_once: bool
    moves: tuple[int, ...]


class WorldMoves:
    """All moves of one chart, numbered when they are first possible."""

    def __init__(self, table: SlotTable, classes: Classes, owed: int, restarts: bool) -> None:
        """Begin with those that are possible everywhere.

        Args:
            table: the slots of the chart.
            classes: what servers, sensors and people may say.
            owed: how many attempts of one operation may wait for their end beside the current one.
            restarts: whether the process may end, and another one goes on.
        """
        self._table = table
        self._classes = classes
        self.owed = owed
        self.all: list[WorldMove] = []
        self._numbers: dict[tuple[Any, ...], int] = {}
        #: The slots that say which deadlines may be the next, and the one that says which attempts there are.
        self.slots_of_timers = tuple(table.index[name] for name in (("timers", ""), RANKS, WATCHED))
        self.slot_of_order = table.index["attempts", ""]
        #: The moves that are possible wherever no deadline is due at once.
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
        for number, event in enumerate(self._classes.events):
            yield f"event {number}", WorldMove(Mover.WORLD, event)
        yield "stray", WorldMove(Mover.WORLD, events.done("long over", {}))
        if restarts:
            yield "restart", WorldMove(Mover.WORLD, Event(RESUMED, {"detail": "", "held": True, "away": 1.0}))
            yield "released", WorldMove(Mover.WORLD, Event(RELEASED, {"hold": RESTARTED}))
            yield "loaded", WorldMove(Mover.WORLD, LOADED)

    def told_before(self, values: tuple[int, ...], number: int) -> int:
        """Return the number of a move before which values are told, by the numbers of the moves."""
        if not values:
            return number
        made_of = (*values, number)
        return self._number(("made of", made_of), replace(self.all[number], made_of=made_of))

    def each(self, number: int) -> tuple[int, ...]:
        """Return the moves that one stands for."""
        return self.all[number].made_of or (number,)

    def told(self) -> dict[int, dict[int, int]]:
        """Return the inputs of values that never grow old and are told to nothing else.

        Of the slot of each the numbers that it may have, each with the number of the move that tells it.
        """
        found: dict[int, dict[int, int]] = {}
        for number in self.everywhere:
            event = self.all[number].event
            if event is None or not self.all[number].tells_value:
                continue
            specs = [i for i in self._table.relevance.chart.inputs.values() if i.value == event.data["name"]]
            if len(specs) == 1 and specs[0].freshness is None:
                slot = self._table.index["inputs", specs[0].name]
                value = self._table.number(slot, Reported(event.data["value"], 0.0))
                found.setdefault(slot, {}).setdefault(value, number)
        return {slot: values for slot, values in found.items() if len(values) > 1}

    # -- what is possible where -----------------------------------------------------------------------

    def due(self, numbers: tuple[int, ...]) -> Due:
        """Return the deadlines that may be the next, by the values of `slots_of_timers`."""
        found = self._of_timers.get(numbers)
        if found is None:
            found = self._of_timers[numbers] = self._due(*numbers)
        return found

    def running(self, timers: int) -> frozenset[TimerName]:
        """Return the deadlines of the chart that run, by the value of their slot."""
        slot = self.slots_of_timers[0]
        armed = self._table.value(slot, timers) if timers else ()
        return frozenset((kind, *about) for _, _, kind, about in armed)

    def spending(self, timers: int) -> frozenset[TimerName]:
        """Return the budgets that run and are not at their end, but those that begin anew."""
        armed = self._table.value(self.slots_of_timers[0], timers) if timers else ()
        found = ((kind, *about) for due, _, kind, about in armed if kind == "budget" and due > 0.0)
        return frozenset(name for name in found if not self._is_of_a_part(name[1]))

    def _is_of_a_part(self, state: str) -> bool:
        """Say whether a state is inside of one that uses a mission, which begins anew with each entry."""
        states = self._table.relevance.chart.states
        around = states[state].parent
        return around is not None and (states[around].use is not None or self._is_of_a_part(around))

    def attempts(self, number: int) -> tuple[int, ...]:
        """Return the slots of the attempts, by the value of `slot_of_order`."""
        names = self._table.value(self.slot_of_order, number) if number else ()
        return tuple(self._table.slot(("attempts", name)) for name in names)

    def answers(self, slot: int, number: int) -> tuple[int, ...]:
        """Return what a server may say of the attempt in a slot."""
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
        armed = [(kind, *about) for _, _, kind, about in timers]
        late = {after for before, after, _ in ranks if before in armed}
        return Due(
            False,
            tuple(
                self._number(timer, WorldMove(Mover.TIMER, timer=timer))
                for timer in armed
                if timer not in late
            ),
        )

    def _answers(self, attempt: Attempt) -> tuple[int, ...]:
        """Return what a server may say of an attempt."""
        found = []
        for key, side, event in self._said(attempt):
            found.append(self._number((attempt.id, *key), WorldMove(side, event)))
        return tuple(found)

    def _said(self, attempt: Attempt) -> Iterator[tuple[tuple[Any, ...], Mover, Event]]:
        """Yield what a server may say of an attempt."""
        if is_orphan(attempt.id) and attempt.phase is not Phase.WAITING:
            yield ("accepted",), Mover.ANSWER, events.accepted(attempt.id)
            yield ("done",), Mover.ANSWER, events.done(attempt.id, {})
            yield ("failed",), Mover.ANSWER, events.failed(attempt.id, CANCELLED_CODE)
            yield ("cancelled",), Mover.ANSWER, events.cancelled(attempt.id)
        elif attempt.phase is not Phase.WAITING:
            yield from self._said_of_known(attempt)

    def _said_of_known(self, attempt: Attempt) -> Iterator[tuple[tuple[Any, ...], Mover, Event]]:
        if attempt.phase is not Phase.ACCEPTED:
            yield ("accepted",), Mover.ANSWER, events.accepted(attempt.id)
        speaks = attempt.phase in (Phase.REQUESTED, Phase.ACCEPTED)
        results = self._classes.results(attempt.operation, attempt.arguments)
        gives = self._classes.gives(attempt.operation)
        for number, result in enumerate(results if speaks or gives else results[:1]):
            yield ("done", number), Mover.ANSWER, events.done(attempt.id, result)
        told = self._classes.told(attempt.operation, attempt.arguments) if speaks else ()
        for number, event in enumerate(told):
            yield ("told", number), Mover.ANSWER, event
        codes = self._classes.codes(attempt.operation)
        for code in codes if speaks else codes[:1]:
            yield ("failed", code), Mover.FAILURE, events.failed(attempt.id, code)
        side = Mover.FAILURE if speaks else Mover.ANSWER
        yield ("cancelled",), side, events.cancelled(attempt.id)
        for number, result in enumerate(results if gives and not speaks else ()):
            yield ("gave", number), Mover.ANSWER, events.cancelled(attempt.id, result)

    # -- carrying a move out ----------------------------------------------------------------------------

    def carry_out(self, machine: Machine, memory: TrackedMemory, move: WorldMove) -> Step | None:
        """Make the step; None where the bounds leave it out."""
        if move.event is None:
            return self._fire(machine, memory, move.timer)
        name = move.event.name
        if name in machine.chart.catalog.events and any(e.name == name for e in memory.deferred):
            return None  # of events with one name, whatever their data, one waits for the release
        if name == "attempt.done" and not self._is_told(memory, move.event.data["attempt"]):
            return None
        if name == RESUMED:
            label, stages = label_of(machine.chart, memory.configuration), machine.chart.profile.stages
            held = label not in stages.without_mission
            return machine.handle(replace(move.event, data={**move.event.data, "held": held}), 0.0)
        if name == "value":
            told = [i.name for i in machine.chart.inputs.values() if i.value == move.event.data["name"]]
            with memory.unread("inputs", told, _BEFORE):
                return machine.handle(move.event, 0.0)
        return machine.handle(move.event, 0.0)

    def _is_told(self, memory: TrackedMemory, attempt: str) -> bool:
        """Say whether the live values are known that an operation leaves behind when it ends well."""
        found = None if is_orphan(attempt) else memory.attempts.get(attempt)
        told = self._classes.tells(found.operation, found.arguments) if found is not None else ()
        return all(name in memory.inputs for name in told)

    def _fire(self, machine: Machine, memory: TrackedMemory, wanted: TimerName) -> Step | None:
        kind, owner, event = wanted
        if kind == "at" and any(waiting.name == WAITS for waiting in memory.deferred):
            return None  # of times of day one waits for the release
        timers = memory.timers
        found = next(t for t in timers if (t[2], *t[3]) == wanted)
        timers.remove(found)
        timers.insert(0, (0.0, found[1], kind, (owner, event)))
        if kind == "fresh":
            known, freshness = memory.inputs[owner], machine.chart.inputs[owner].freshness
            memory.inputs[owner] = known._replace(stamp=-(freshness or 0.0))
        return machine.advance(0.0)

    def is_within_bounds(self, name: str) -> bool:
        """Say whether no more attempts of one operation wait for their end than the bounds say."""
        kind, number, count = name.rpartition("#")
        return not number or kind == ANY_ORPHAN or int(count) <= self.owed + 1


#: What a live value was before another one is told: something else, told at the same time.
_BEFORE = Reported(object(), 0.0)


def running(table: SlotTable, situation: Situation) -> list[Timer]:
    """Return the deadlines that run in a situation, those of properties with them."""
    timers: list[Timer] = table.get(situation, ("timers", "")) or []
    return [*timers, *deadlines_of(table.get(situation, WATCHED) or ())]


def deadlines_of(watched: Watched) -> list[Timer]:
    """Return what properties wait for as deadlines."""
    due = [(state[0], name) for name, state in watched if state and state[0] < math.inf]
    return [(seconds, _LAST, OF_PROPERTY, (name, "")) for seconds, name in due]


def forget_unwanted(memory: TrackedMemory, owed: int) -> None:
    """Of attempts that nobody waits for and that keep nothing from beginning, remember the newest only.

    All that can come of one is a late answer, and that is about no other. The engine itself gives none.
    """
    for name in list(_were_waited_for(memory)):
        memory.attempts.get(name)
    # Of those that the step has not looked at nothing has changed.
    inert = _inert(memory, dict.values(memory.attempts))
    if inert and owed:
        inert = _inert(memory, memory.attempts.values())
    own = [name for name in inert if is_builtin(memory.attempts[name].operation)]
    others = [name for name in inert if name not in own]
    for name in (*own, *others[: len(others) - owed]):
        del memory.attempts[name]
        Timers(memory).disarm("cancel", name)


def _inert(memory: TrackedMemory, attempts: Iterable[Attempt]) -> list[str]:
    """Return those of some attempts of which at most a late answer comes."""
    over = (a for a in attempts if a.phase is Phase.LOST or (a.phase is Phase.CANCELLING and not a.uses))
    return [attempt.id for attempt in over if not is_waited_for(memory, attempt)]


def _were_waited_for(memory: TrackedMemory) -> Iterator[str]:
    """Yield the attempts that the invocations have waited for that a step has looked at."""
    invocations = memory.invocations
    assert isinstance(invocations, TrackedDict)
    for name in (*dict.keys(invocations), *invocations.gone):
        before = memory.fetch(memory.table.slot(("invocations", name)))
        if before is not None and before.cut is not None:
            yield before.cut.attempt


def in_order(memory: TrackedMemory) -> None:
    """Put entries in the same order wherever the machine does not look at it.

    Of invocations only those of the elements of one state have an order. Answers of elements that wait for a
    release one after the other have none, if nothing is kept of them (see `Relevance.keeps_nothing`).
    """
    invocations, answers = memory.invocations, memory.deferred
    if not (isinstance(answers, TrackedList) and answers.is_unread):
        beside = groupby(answers, lambda event: _element_of(event, memory.table.relevance.keeps_nothing))
        answers[:] = [e for state, run in beside for e in (sorted(run, key=_attempt_of) if state else run)]
    assert isinstance(invocations, TrackedDict)
    if invocations.order is not None:
        invocations.order.sort(key=lambda name: name.partition("[")[0])


def settled_claims(memory: TrackedMemory) -> tuple[ResourceClaim, ...]:
    """Put attempts in the same order wherever the machine does not look at it; return their claims.

    Of attempts that stand beside each other only one that waits looks at those before it.
    """
    attempts, claims = memory.attempts, memory.claims
    assert isinstance(attempts, TrackedDict)
    if attempts.order is not None:
        waiting = {claim.attempt for claim in claims if claim.waits}
        attempts.order[:] = _sorted_between(attempts.order, waiting.__contains__)
    return tuple(_sorted_between(claims, lambda claim: claim.waits))


def _sorted_between(entries: Iterable[_Entry], stays: Callable[[_Entry], bool]) -> list[_Entry]:
    """Return entries where those that stay are in their places, and what is between them is sorted."""
    return [one for keeps, run in groupby(entries, stays) for one in (run if keeps else sorted(run))]


def _attempt_of(event: Event) -> str:
    return str(event.data.get("attempt", ""))


def _element_of(event: Event, states: Set[str]) -> str:
    """Return the state whose element an answer is of, if it is one of these states; '' otherwise."""
    state, is_element, _ = _attempt_of(event).partition("[")
    return state if is_element and event.name == ANSWERED and state in states else ""


class Deadlines(NamedTuple):
    """The deadlines that run after a step, and those that a hold stops, as far as they are in an order."""

    armed: tuple[Timer, ...]
    frozen: tuple[Timer, ...]


def rankable(chart: Chart, timers: Iterable[Timer]) -> Iterator[Timer]:
    """Yield the deadlines of which is known how far away they were when they were set."""
    for timer in timers:
        _, _, kind, (owner, _) = timer
        state = owner.removeprefix("i:").partition("[")[0] if kind == "retry" else ""
        if kind not in _UNRANKED and not (state and _has_jitter(chart.states[state])):
            yield timer


def _has_jitter(state: State) -> bool:
    invokes = (state.invoke, state.for_each.invoke if state.for_each else None)
    return any(one is not None and one.retry is not None and one.retry.jitter is not None for one in invokes)


def _left_of_properties(ranks: Iterable[Rank]) -> dict[TimerName, float]:
    """Return how much is left at least of the deadlines of properties."""
    left: dict[TimerName, float] = {}
    for _, late, lead in ranks:
        if late[0] == OF_PROPERTY:
            left[late] = max(lead, left.get(late, lead))
    return left


def _lead(late: TimerName, least: float, early: float) -> float:
    """Return how much later a deadline is at least that has so much left, where that is kept of it."""
    return round(least - early, _DIGITS) if late[0] == OF_PROPERTY else 0.0


def ranks_after(
    before: frozenset[Rank],
    deadlines: Deadlines,
    fresh: frozenset[TimerName],
    renamed: Mapping[str, str],
) -> frozenset[Rank]:
    """Return which deadlines certainly come before which others after a step.

    One that is set now comes after every other that was set for as long or less: that one's time runs
    already. Of those that are set in the same step the shorter comes first. Deadlines that a hold stops
    come later by as long as it lasts than those that it does not stop. A budget may be used up in part, and a
    tick may come sooner if the one before was late, so these come after nothing. How much later is kept of
    the deadlines of properties alone: at a step that much is left of one at least, and what is set then for
    no longer comes before it, too. So the times of states that follow each other are added up.

    Args:
        before: the same before the step; so the step itself does not depend on it.
        deadlines: those that there are now.
        fresh: those of them that the step has set.
        renamed: the attempts that have another name now.
    """
    named = [((timer[2], *timer[3]), timer, stopped) for timer, stopped in _both(*deadlines)]
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
    """Return what a deadline is called once attempts are renamed; `GONE` if another has its owner's name."""
    kind, owner, event = timer
    if owner in renamed.values() and owner not in renamed:
        return GONE
    return kind, renamed.get(owner, owner), event


#: In place of the name of a deadline whose owner is gone.
GONE: TimerName = ("", "", "")


def _both(armed: Iterable[Timer], frozen: Iterable[Timer]) -> Iterator[tuple[Timer, bool]]:
    yield from ((timer, False) for timer in armed)
    yield from ((timer, True) for timer in frozen)
