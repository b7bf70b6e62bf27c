"""What only the whole graph of situations can tell: what can be reached from everywhere, and what goes round.

Each property but one is a question: is a goal reached from every situation if certain sides want that,
whatever order deadlines come in? `no_zeno` looks for circles of deadlines without time.
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
#: So many values of open inputs are told apart (see `_values_of`).
_BITS = 64
#: Deadlines that may be put off for ever: a value may be reported again and again.
_MAY_NOT_COME = frozenset({"fresh"})
_NOBODY = Mover(0)


@dataclass(frozen=True)
class GraphProperty:
    """Something that holds of the graph as a whole: `broken` gives the situations that break it.

    One `of_missions` is about charts in which missions begin and end. `{home}` in a text stands for the
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
        #: The transitions by deadlines that come if nothing else does.
        self._certain = (self.by(Mover.TIMER) & ~may_not_come[by]) | self.by(Mover.AT_ONCE)
        self._all, values = _values_of(explored)
        self._values = values[by] if len(by) else np.zeros(0, np.uint64)

    def situations(self, flags: int) -> _Mask:
        """Return the situations that have one of these flags."""
        found: _Mask = (self._flags & flags) != 0
        return found

    def by(self, sides: Mover) -> _Mask:
        """Return the transitions of certain sides."""
        found: _Mask = (self._sides & int(sides)) != 0
        return found

    def does(self, what: int) -> _Mask:
        """Return the transitions that do something (see `Does`)."""
        found: _Mask = (self._does & what) != 0
        return found

    def leads_to(
        self,
        goal: _Mask,
        helpful: Mover,
        *,
        against: Mover = _NOBODY,
        values_change: bool = False,
        advances: bool = False,
    ) -> _Mask:
        """Return the situations from which one of the goal is certainly reached if somebody wants that.

        Somebody makes any of the helpful moves, or waits. Which deadline comes next is not up to anybody, as
        long as each that runs on and on comes at last; nor are the moves `against` it, which may come or not.
        Where one situation stands for all values of an input it must be so for each of them, unless
        `values_change` on the way. Then where it is said to be so it is; not everything is said, since it may
        depend on the value which of two ways leads on at its end.

        Args:
            goal: situations.
            helpful: whose moves.
            against: whose moves must not keep from the goal, beside deadlines.
            values_change: whether live values take any value on the way.
            advances: whether it is also enough that something is told of a target or of the mission.
        """
        reached = goal.copy()
        told = self.does(Does.ADVANCES if advances else 0)
        against |= Mover.TIMER
        while True:
            reached = self._attracted(reached, helpful, against, values_change, told)
            stays = self._may_stay(~reached, self.by(against) & ~told)
            if (stays | reached).all():
                return reached
            reached = ~stays

    def _attracted(
        self, goal: _Mask, helpful: Mover, against: Mover, values_change: bool, told: _Mask
    ) -> _Mask:
        """Return the situations from which a helpful move leads on to the goal, or all against it do."""
        reached = goal.copy()
        other, helps = self.by(against), self.by(helpful)
        left = np.flatnonzero(other | helps)
        others = np.bincount(self.sources[other], minlength=len(goal))
        waits = np.zeros(len(goal), bool)
        waits[self.sources[self._certain]] = True
        of = np.where(reached, self._all, np.uint64(0))
        while True:
            new = reached[self.targets[left]] | told[left]
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

    def _may_stay(self, outside: _Mask, against: _Mask) -> _Mask:
        """Return the situations outside of a goal from which the moves against it need not lead to it."""
        inside = against & outside[self.sources] & outside[self.targets]
        stuck = outside.copy()
        stuck[self.sources[self._certain]] = False
        return self.comes_from(stuck | self._in_fair_circles(inside), inside)

    def _in_fair_circles(self, allowed: _Mask) -> _Mask:
        """Return situations from which moves go round without end, and no deadline that runs is left out.

        A deadline that runs all the time and is never set anew comes at last, and a budget that is used up
        again and again is at its end at last. Fair cycles as in Emerson and Lei, Modalities for Model
        Checking, 1987.
        """
        at = np.flatnonzero(allowed)
        at = self._inside(at, self.in_circles(at))
        at = at[~self._spends(at)]
        circles = self.in_circles(at)
        names = self._deadlines_in(circles, self._moves.running)
        while True:
            before = circles
            for name in (one for one in names if one[0] not in _MAY_NOT_COME):
                at = self._inside(at, circles)
                ends = np.zeros(len(circles), bool)
                ends[self.sources[at[~self._goes_on(name, at)]]] = True
                circles = circles & self.comes_from(ends, at)
            circles = circles & self.in_circles(self._inside(at, circles))
            if (circles == before).all():
                return circles

    def _spends(self, at: NDArray[np.intp]) -> _Mask:
        """Return which transitions use up a part of a budget, if no others than these are taken.

        They are by deadlines that were set when the budget ran already, which has run on since.
        """
        spends = np.zeros(len(at), bool)
        sources, targets = self.sources[at], self.targets[at]
        budgets = self._deadlines_in(sources, self._moves.spending)
        timed = np.unique(self._by[at[self.by(Mover.TIMER)[at] & ~self.by(Mover.AT_ONCE)[at]]]).tolist()
        for budget, move in itertools.product(budgets, timed):
            timer = self._moves.all[move].timer
            fires, runs = self._by[at] == move, self._has(self._moves.spending, budget)
            goes_on = self._goes_on(budget, at) & self._goes_on(timer, at)
            is_set = self._is_set(timer, at)
            since = runs & self._runs(timer)
            while True:
                left = since[targets] & ~(is_set | (goes_on & since[sources]))
                if not left.any():
                    break
                since[targets[left]] = False
            spends |= fires & since[sources]
        # Where there is no mission budgets are forgotten.
        return spends & ~self.comes_from(~self.situations(Is.MISSION), at)[sources]

    def _goes_on(self, name: TimerName, at: NDArray[np.intp]) -> _Mask:
        """Return through which transitions a deadline runs on."""
        running = self._runs(name)
        found: _Mask = running[self.sources[at]] & running[self.targets[at]] & ~self._is_set(name, at)
        return found

    def _is_set(self, name: TimerName, at: NDArray[np.intp]) -> _Mask:
        """Return which transitions set a deadline."""
        found: _Mask = np.array([name in one for one in self._deadlines], bool)[self._sets[at]]
        return found

    def _runs(self, name: TimerName) -> _Mask:
        """Return where a deadline runs."""
        return self._has(self._moves.running, name)

    def _has(self, of: Callable[[int], frozenset[TimerName]], name: TimerName) -> _Mask:
        """Return where a deadline is one of those that run there and that `of` gives."""
        numbers, where = self._numbers
        found: _Mask = np.array([name in of(number) for number in numbers], bool)[where]
        return found

    def _deadlines_in(
        self, situations: _Mask | NDArray[np.uint32], of: Callable[[int], frozenset[TimerName]]
    ) -> frozenset[TimerName]:
        """Return the deadlines that run in one of some situations and that `of` gives."""
        numbers = np.unique(self._timers[situations]).tolist()
        return frozenset[TimerName]().union(*map(of, numbers))

    def _inside(self, at: NDArray[np.intp], situations: _Mask) -> NDArray[np.intp]:
        """Return those of some transitions that lead from one of some situations to one of them."""
        found: NDArray[np.intp] = at[situations[self.sources[at]] & situations[self.targets[at]]]
        return found

    @cached_property
    def _numbers(self) -> tuple[list[int], NDArray[np.intp]]:
        """The numbers of the deadlines that run together, each once, and which of them is where."""
        numbers, where = np.unique(self._timers, return_inverse=True)
        return numbers.tolist(), where

    def comes_from(self, goal: _Mask, allowed: _Mask | NDArray[np.intp]) -> _Mask:
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

    def in_circles(self, allowed: _Mask | NDArray[np.intp]) -> _Mask:
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


def _values_of(explored: Explored) -> tuple[np.uint64, NDArray[np.uint64]]:
    """Return all values that open inputs can have together, a bit each, and for which of them each move is.

    That is all, unless values are told before the move. Where they are too many for bits it is then none.
    """
    every = explored.moves.all
    chosen = {number: frozenset(move.made_of[:-1]) for number, move in enumerate(every) if move.made_of}
    asked = frozenset().union(*chosen.values())
    inputs = (values.values() for values in explored.moves.told().values())
    told = [moves for moves in inputs if asked.intersection(moves)]
    together = [frozenset(moves) for moves in itertools.islice(itertools.product(*told), _BITS + 1)]
    if len(together) > _BITS:
        together = [frozenset()]
    found = np.full(len(every), 2 ** len(together) - 1, np.uint64)
    for number, values in chosen.items():
        found[number] = sum(1 << at for at, one in enumerate(together) if values <= one)
    return np.uint64(2 ** len(together) - 1), found


def _not_home(graph: Graph) -> _Mask:
    helpful = Mover.ANSWER | Mover.REQUEST | Mover.WORLD
    return ~graph.leads_to(graph.situations(Is.OVER), helpful, values_change=True)


def _untold(graph: Graph) -> _Mask:
    return ~graph.leads_to(graph.situations(Is.TOLD), _NOBODY)


def _moves_on(graph: Graph) -> _Mask:
    servers = Mover.ANSWER | Mover.FAILURE
    return ~graph.leads_to(_rests(graph), Mover.ABORT, against=servers)


def _rests(graph: Graph) -> _Mask:
    """Return where nothing moves, nor will by deadlines and answers alone."""
    alone = graph.by(Mover.ANSWER | Mover.FAILURE | Mover.TIMER)
    moves = graph.situations(Is.MOVES)
    moves[graph.sources[alone & graph.does(Does.MOVES)]] = True
    return ~graph.comes_from(moves, alone)


def _livelock(graph: Graph) -> _Mask:
    return ~graph.leads_to(graph.situations(Is.TOLD), Mover.ANSWER, advances=True)


#: The properties of servers that say nothing, and of circles that take no time.
SILENCE, NO_ZENO = "silence_is_told", "no_zeno"
#: All of them, in the order in which they are told.
OF_THE_GRAPH = (
    GraphProperty(
        "home_again",
        "From every situation, {home} can be reached if servers answer.",
        _not_home,
        "no answer, request or deadline certainly leads to {home}",
        of_missions=True,
    ),
    GraphProperty(
        SILENCE,
        "If servers say nothing, a mission does not wait for ever: it ends, pauses, asks or fails.",
        _untold,
        "without answers it may go on for ever: no deadline certainly leads to an end, a pause, a question or"
        " FAULT",
        of_missions=True,
    ),
    GraphProperty(
        "abort_stops",
        "From every situation, aborting (repeatedly if accepted) and waiting end all movement for good.",
        _moves_on,
        "something moves or will move by itself, and no abort or deadline certainly ends that",
    ),
    GraphProperty(
        NO_ZENO,
        "No cycle of deadlines takes zero time.",
        lambda graph: graph.in_circles(graph.by(Mover.AT_ONCE)),
        "deadlines of 0 s lead to each other without end",
    ),
    GraphProperty(
        "no_livelock",
        "If servers answer, a mission goes on: targets get results, or it ends, pauses, asks or fails.",
        _livelock,
        "however servers answer, no target gets a result and the mission does not end",
        of_missions=True,
    ),
)


def broken(graph: Graph, one: GraphProperty) -> list[int]:
    """Return the situations that break a property."""
    found: list[int] = np.flatnonzero(one.broken(graph)).tolist()
    return found
