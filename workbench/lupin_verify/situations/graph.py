"""Liveness properties of the explored graph, by attractors under fairness, and cycles that take no time.

Each property but one asks: do certain movers reach a goal from every situation, in whatever order deadlines
fire? `no_zeno` looks for cycles of deadlines of 0 s. They are judged only where the exploration is complete.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lupin_engine.plugin import Stages
from lupin_verify.situations.found import Does, Explored, Is
from lupin_verify.situations.worlds import Mover, TimerName

_Mask = NDArray[np.bool_]
#: The most combinations of values of unconstrained inputs that are distinguished (see `_assignments`).
_BITS = 64
#: Deadlines that may be put off for ever: each report of a value sets its freshness again.
_MAY_NOT_COME = frozenset({"fresh"})
_NOBODY = Mover(0)


@dataclass(frozen=True)
class GraphProperty:
    """A property of the graph as a whole; `broken` returns the mask of situations that break it.

    One `of_missions` applies to charts in which missions begin and end. `{home}` in a text stands for the
    states in which a mission could begin.
    """

    name: str
    says: str
    broken: Callable[[Graph], _Mask]
    why: str
    of_missions: bool = False

    def named(self, stages: Stages) -> GraphProperty:
        """Return this with the names that a profile's lifecycles have for `{home}`."""
        home = " or ".join((*stages.ready, *stages.ended)) or "a state in which a mission could begin"
        return replace(self, says=self.says.format(home=home), why=self.why.format(home=home))


class Graph:
    """An explored graph, with masks over its situations and transitions."""

    def __init__(self, explored: Explored) -> None:
        self.sources = np.frombuffer(explored.sources, dtype=np.uint32)
        self.targets = np.frombuffer(explored.targets, dtype=np.uint32)
        by = self._by = np.frombuffer(explored.by, dtype=np.uint16)
        sides = np.array([int(move.side) for move in explored.moves.all], dtype=np.uint8)
        self._sides = sides[by] if len(by) else np.zeros(0, dtype=np.uint8)
        self._flags = np.frombuffer(explored.flags, dtype=np.uint8)
        self._does = np.frombuffer(explored.does, dtype=np.uint8)
        self._moves, self._deadlines = explored.moves, explored.deadlines
        self._sets = np.frombuffer(explored.sets, dtype=np.uint16)
        self._timers = np.frombuffer(explored.timers, dtype=np.uint16)
        may_not_come = np.array([move.timer[0] in _MAY_NOT_COME for move in explored.moves.all], bool)
        #: The transitions by deadlines that fire if nothing else happens.
        self._certain = (self.by(Mover.TIMER) & ~may_not_come[by]) | self.by(Mover.AT_ONCE)
        self._all, values = _assignments(explored)
        self._values = values[by] if len(by) else np.zeros(0, np.uint64)

    def situations(self, flags: int) -> _Mask:
        """Return the situations that have one of these flags."""
        found: _Mask = (self._flags & flags) != 0
        return found

    def by(self, sides: Mover) -> _Mask:
        """Return the transitions of certain movers."""
        found: _Mask = (self._sides & int(sides)) != 0
        return found

    def does(self, what: int) -> _Mask:
        """Return the transitions with one of these `Does` flags."""
        found: _Mask = (self._does & what) != 0
        return found

    def attractor(
        self,
        goal: _Mask,
        helpful: Mover,
        *,
        against: Mover = _NOBODY,
        values_change: bool = False,
        advances: bool = False,
        answered: bool = False,
    ) -> _Mask:
        """Return the attractor of a goal: the situations from which helpful moves or waiting surely reach it.

        Deadlines fire in any order, under fairness: one that runs on and is never set again fires at last.
        Moves `against` may be made or not. Where a situation stands for all values of an input, the goal must
        be reached for each of them, unless `values_change` on the way. The result is then an
        under-approximation: which of two paths reaches the goal may depend on the value.

        Args:
            goal: situations.
            helpful: the movers that want the goal.
            against: the movers, beside deadlines, that must not prevent it.
            values_change: whether live values take any value on the way.
            advances: whether a published outcome or report is a goal, too.
            answered: whether servers answer in time: no operation ends by its timeout.
        """
        reached = goal.copy()
        advancing = self.does(Does.ADVANCES if advances else 0)
        comes = ~self.of_timeouts() if answered else np.ones(len(self.sources), bool)
        other = self.by(against | Mover.TIMER) & comes
        waits = np.zeros(len(goal), bool)
        waits[self.sources[self._certain & comes]] = True
        while True:
            reached = self._attracted(reached, helpful, other, waits, values_change, advancing)
            may_stay = self._may_stay(~reached, other & ~advancing, waits)
            if (may_stay | reached).all():
                return reached
            reached = ~may_stay

    def _attracted(
        self, goal: _Mask, helpful: Mover, other: _Mask, waits: _Mask, values_change: bool, advancing: _Mask
    ) -> _Mask:
        """Return the situations from which a helpful move, or every adverse one, leads on to the goal.

        `other` are the adverse transitions, `waits` the situations in which one of them comes by itself.
        """
        reached = goal.copy()
        helps = self.by(helpful)
        left = np.flatnonzero(other | helps)
        others = np.bincount(self.sources[other], minlength=len(goal))
        of = np.where(reached, self._all, np.uint64(0))
        while True:
            new = reached[self.targets[left]] | advancing[left]
            if not new.any():
                return reached
            found = left[new]
            helped = found[helps[found]]
            values = self._all if values_change else self._values[helped]
            np.bitwise_or.at(of, self.sources[helped], values)
            others -= np.bincount(self.sources[found[other[found]]], minlength=len(goal))
            reached = (of == self._all) | (waits & (others == 0))
            left = left[~new]
            left = left[~reached[self.sources[left]]]

    def _may_stay(self, outside: _Mask, against: _Mask, waits: _Mask) -> _Mask:
        """Return the situations outside of a goal from which adverse moves may avoid it for ever."""
        inside = against & outside[self.sources] & outside[self.targets]
        stuck = outside & ~waits
        return self.can_reach(stuck | self.on_fair_cycles(inside), inside)

    def of_timeouts(self) -> _Mask:
        """Return the transitions by which a server's silence ends."""
        silences = np.array([move.timer[0] in ("timeout", "cancel") for move in self._moves.all], bool)
        found: _Mask = silences[self._by] if len(self._by) else np.zeros(0, bool)
        return found

    def in_missions(self, allowed: _Mask) -> _Mask:
        """Return the allowed transitions between situations in which a mission goes on or waits."""
        going = self.situations(Is.MISSION) & (~self.situations(Is.REPORTED) | self.situations(Is.AWAY))
        found: _Mask = allowed & going[self.sources] & going[self.targets]
        return found

    def on_fair_cycles(self, allowed: _Mask) -> _Mask:
        """Return the situations from which moves can go round a fair cycle for ever.

        In a fair cycle no deadline runs all the time without being set or firing, and no budget is used up
        again and again. Computed as by Emerson and Lei, Modalities for Model Checking, 1987.
        """
        at = np.flatnonzero(allowed)
        at = self._inside(at, self.on_cycles(at))
        at = at[~self._spends(at)]
        cycles = self.on_cycles(at)
        names = self._deadlines_in(cycles, self._moves.running)
        while True:
            before = cycles
            for name in (one for one in names if one[0] not in _MAY_NOT_COME):
                at = self._inside(at, cycles)
                ends = np.zeros(len(cycles), bool)
                ends[self.sources[at[~self._continues(name, at)]]] = True
                cycles = cycles & self.can_reach(ends, at)
            cycles = cycles & self.on_cycles(self._inside(at, cycles))
            if (cycles == before).all():
                return cycles

    def _spends(self, at: NDArray[np.intp]) -> _Mask:
        """Return the transitions that use up a part of a budget, if only transitions in `at` are taken.

        They are by deadlines that were set while the budget ran, and it has run on since.
        """
        spends = np.zeros(len(at), bool)
        sources, targets = self.sources[at], self.targets[at]
        budgets = self._deadlines_in(sources, self._moves.spending)
        timed = np.unique(self._by[at[self.by(Mover.TIMER)[at] & ~self.by(Mover.AT_ONCE)[at]]]).tolist()
        for budget, move in itertools.product(budgets, timed):
            timer = self._moves.all[move].timer
            fires, runs = self._by[at] == move, self._has(self._moves.spending, budget)
            goes_on = self._continues(budget, at) & self._continues(timer, at)
            is_set = self._is_set(timer, at)
            since = runs & self._runs(timer)
            while True:
                left = since[targets] & ~(is_set | (goes_on & since[sources]))
                if not left.any():
                    break
                since[targets[left]] = False
            spends |= fires & since[sources]
        # Without a mission there are no budgets.
        return spends & ~self.can_reach(~self.situations(Is.MISSION), at)[sources]

    def _continues(self, name: TimerName, at: NDArray[np.intp]) -> _Mask:
        """Return the transitions through which a deadline runs on."""
        running = self._runs(name)
        found: _Mask = running[self.sources[at]] & running[self.targets[at]] & ~self._is_set(name, at)
        return found

    def _is_set(self, name: TimerName, at: NDArray[np.intp]) -> _Mask:
        """Return the transitions that set a deadline."""
        found: _Mask = np.array([name in one for one in self._deadlines], bool)[self._sets[at]]
        return found

    def _runs(self, name: TimerName) -> _Mask:
        """Return the situations in which a deadline runs."""
        return self._has(self._moves.running, name)

    def _has(self, of: Callable[[int], frozenset[TimerName]], name: TimerName) -> _Mask:
        """Return the situations in which a deadline is among those that `of` gives."""
        numbers, where = self._numbers
        found: _Mask = np.array([name in of(number) for number in numbers], bool)[where]
        return found

    def _deadlines_in(
        self, situations: _Mask | NDArray[np.uint32], of: Callable[[int], frozenset[TimerName]]
    ) -> frozenset[TimerName]:
        """Return the deadlines that `of` gives in any of some situations."""
        numbers = np.unique(self._timers[situations]).tolist()
        return frozenset[TimerName]().union(*map(of, numbers))

    def _inside(self, at: NDArray[np.intp], situations: _Mask) -> NDArray[np.intp]:
        """Return the transitions that begin and end in some situations."""
        found: NDArray[np.intp] = at[situations[self.sources[at]] & situations[self.targets[at]]]
        return found

    @cached_property
    def _numbers(self) -> tuple[list[int], NDArray[np.intp]]:
        """The different sets of running deadlines by number, and each situation's index in them."""
        numbers, where = np.unique(self._timers, return_inverse=True)
        return numbers.tolist(), where

    def can_reach(self, goal: _Mask, allowed: _Mask | NDArray[np.intp]) -> _Mask:
        """Return the situations from which one of the goal can be reached by allowed transitions."""
        reached = goal.copy()
        sources, targets = self.sources[allowed], self.targets[allowed]
        while True:
            new = reached[targets]
            if not new.any():
                return reached
            reached[sources[new]] = True
            left = ~new & ~reached[sources]
            sources, targets = sources[left], targets[left]

    def on_cycles(self, allowed: _Mask | NDArray[np.intp]) -> _Mask:
        """Return the situations from which allowed transitions can be taken without end."""
        sources, targets = self.sources[allowed], self.targets[allowed]
        found = np.zeros(len(self._flags), dtype=bool)
        while len(sources):
            goes_on = np.zeros(len(found), dtype=bool)
            goes_on[sources] = True
            kept = goes_on[targets]
            if kept.all():
                found[sources] = True
                return found
            sources, targets = sources[kept], targets[kept]
        return found


def _assignments(explored: Explored) -> tuple[np.uint64, NDArray[np.uint64]]:
    """Return a bit for each assignment of unconstrained inputs, and each move's assignments.

    A move without reports before it exists in all. With more than `_BITS` assignments, one with them in none.
    """
    every = explored.moves.all
    chosen = {number: frozenset(move.made_of[:-1]) for number, move in enumerate(every) if move.made_of}
    asked = frozenset().union(*chosen.values())
    inputs = (values.values() for values in explored.moves.unconstrained_values().values())
    asked_inputs = [moves for moves in inputs if asked.intersection(moves)]
    together = [frozenset(moves) for moves in itertools.islice(itertools.product(*asked_inputs), _BITS + 1)]
    if len(together) > _BITS:
        together = [frozenset()]
    found = np.full(len(every), 2 ** len(together) - 1, np.uint64)
    for number, values in chosen.items():
        found[number] = sum(1 << at for at, one in enumerate(together) if values <= one)
    return np.uint64(2 ** len(together) - 1), found


def _not_home(graph: Graph) -> _Mask:
    helpful = Mover.ANSWER | Mover.REQUEST | Mover.WORLD
    return ~graph.attractor(graph.situations(Is.OVER), helpful, values_change=True)


def _silent(graph: Graph) -> _Mask:
    return ~graph.attractor(graph.situations(Is.REPORTED), _NOBODY)


def _moves_on(graph: Graph) -> _Mask:
    servers = Mover.ANSWER | Mover.FAILURE
    return ~graph.attractor(_rests(graph), Mover.ABORT, against=servers)


def _rests(graph: Graph) -> _Mask:
    """Return the situations in which nothing moves, nor will by deadlines and answers alone."""
    alone = graph.by(Mover.ANSWER | Mover.FAILURE | Mover.TIMER)
    moves = graph.situations(Is.MOVES)
    moves[graph.sources[alone & graph.does(Does.MOVES)]] = True
    return ~graph.can_reach(moves, alone)


def _livelock(graph: Graph) -> _Mask:
    return ~graph.attractor(graph.situations(Is.REPORTED), Mover.ANSWER, advances=True, answered=True)


def _loops(graph: Graph) -> _Mask:
    """Return the situations from which successes and deadlines lead round for ever, or to a wait."""
    at = graph.in_missions(graph.by(Mover.ANSWER | Mover.TIMER) & ~graph.of_timeouts())
    at = at & ~(graph.does(Does.ADVANCES) & graph.situations(Is.ENDLESS)[graph.sources])
    stuck = graph.on_fair_cycles(at) | graph.situations(Is.AWAY)
    return graph.situations(Is.WORKS) & graph.can_reach(stuck, at)


def _tries_for_ever(graph: Graph) -> _Mask:
    """Return the situations from which answers, also bad ones, and deadlines lead round without news."""
    at = graph.in_missions(graph.by(Mover.ANSWER | Mover.FAILURE | Mover.TIMER))
    at = at & ~graph.does(Does.ADVANCES)
    return graph.situations(Is.MISSION) & graph.can_reach(graph.on_fair_cycles(at), at)


#: The names of the properties of silent servers, and of cycles that take no time.
SILENCE, NO_ZENO = "silence_is_told", "no_zeno"
HOME_AGAIN, ABORT_STOPS, NO_LIVELOCK = "home_again", "abort_stops", "no_livelock"
#: All of them, in the order of reports.
OF_THE_GRAPH = (
    GraphProperty(
        HOME_AGAIN,
        "From every situation, {home} can be reached if servers answer.",
        _not_home,
        "no answer, request or deadline certainly leads to {home}",
        of_missions=True,
    ),
    GraphProperty(
        SILENCE,
        "If servers say nothing, a mission does not wait for ever: it ends, pauses, asks or fails.",
        _silent,
        "without answers it may go on for ever: no deadline certainly leads to an end, a pause, a question or"
        " FAULT",
        of_missions=True,
    ),
    GraphProperty(
        ABORT_STOPS,
        "From every situation, aborting (repeatedly if accepted) and waiting end all movement for good.",
        _moves_on,
        "something moves or will move by itself, and no abort or deadline certainly ends that",
    ),
    GraphProperty(
        NO_ZENO,
        "No cycle of deadlines takes zero time.",
        lambda graph: graph.on_cycles(graph.by(Mover.AT_ONCE)),
        "deadlines of 0 s lead to each other without end",
    ),
    GraphProperty(
        NO_LIVELOCK,
        "If servers answer, a mission goes on: targets get results, or it ends, pauses, asks or fails.",
        _livelock,
        "however servers answer, no target gets a result and the mission does not end",
        of_missions=True,
    ),
)

#: Those that a file names, as those of `properties.inherited`.
NAMED_OF_THE_GRAPH = (
    GraphProperty(
        "success_ends",
        "If servers succeed, every mission comes to its end, or sweeps for ever as a parameter says.",
        _loops,
        "though every server succeeds, it may go round for ever, or wait for a person when it is done",
        of_missions=True,
    ),
    GraphProperty(
        "failure_ends",
        "However servers answer, no mission tries something for ever without telling anybody.",
        _tries_for_ever,
        "with some answers it goes round for ever: no result, no end, no pause and no question",
        of_missions=True,
    ),
)


def broken(graph: Graph, one: GraphProperty) -> list[int]:
    """Return the situations that break a property."""
    found: list[int] = np.flatnonzero(one.broken(graph)).tolist()
    return found
