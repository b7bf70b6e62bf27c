"""What only the whole graph of situations can tell: what can be reached from everywhere, and what goes round.

Each property is one question: can a goal be reached from every situation by moves of certain sides alone?
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lupin_engine.verify.situations.found import Explored, Is
from lupin_engine.verify.situations.worlds import Mover

_Mask = NDArray[np.bool_]
#: So many values of open inputs are told apart (see `_values_of`).
_BITS = 64


@dataclass(frozen=True)
class GraphProperty:
    """Something that holds of the graph as a whole: `broken` gives the situations that break it.

    One `of_missions` is about charts in which missions begin and end.
    """

    name: str
    says: str
    broken: Callable[[Graph], _Mask]
    why: str
    of_missions: bool = False


class Graph:
    """An explored graph, with masks over its situations and transitions."""

    def __init__(self, explored: Explored) -> None:
        self.sources = np.frombuffer(explored.sources, dtype=np.uint32)
        self.targets = np.frombuffer(explored.targets, dtype=np.uint32)
        by = np.frombuffer(explored.by, dtype=np.uint16)
        sides = np.array([int(move.side) for move in explored.moves.all], dtype=np.uint8)
        self._sides = sides[by] if len(by) else np.zeros(0, dtype=np.uint8)
        self._flags = np.frombuffer(explored.flags, dtype=np.uint8)
        self._advances = np.frombuffer(explored.advances, dtype=np.uint8) != 0
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

    @property
    def advancing(self) -> _Mask:
        """The situations in which something can be told of a target or of the mission, as things go on."""
        found = np.zeros(len(self._flags), np.uint64)
        at = np.flatnonzero(self._advances & self.by(Mover.ANSWER | Mover.TIMER))
        np.bitwise_or.at(found, self.sources[at], self._values[at])
        advances: _Mask = found == self._all
        return advances

    def leads_to(self, goal: _Mask, allowed: _Mask, values_change: bool = False) -> _Mask:
        """Return the situations from which one of the goal can be reached by allowed transitions.

        Where one situation stands for all values of an input it must be so for each of them, unless
        `values_change` on the way. Then where it is said to be so it is; not everything is said, since it may
        depend on the value which of two ways leads on at its end.
        """
        reached = goal.copy()
        sources, targets = self.sources[allowed], self.targets[allowed]
        values = np.full(len(sources), self._all) if values_change else self._values[allowed]
        of = np.where(reached, self._all, np.uint64(0))
        while True:
            new = reached[targets]
            if not new.any():
                return reached
            np.bitwise_or.at(of, sources[new], values[new])
            reached = of == self._all
            left = ~new & ~reached[sources]
            sources, targets, values = sources[left], targets[left], values[left]

    def in_circles(self, allowed: _Mask) -> _Mask:
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
    helpful = Mover.ANSWER | Mover.TIMER | Mover.REQUEST | Mover.WORLD
    goal, allowed = graph.situations(Is.OVER), graph.by(helpful)
    return ~graph.leads_to(goal, allowed, values_change=True)


def _untold(graph: Graph) -> _Mask:
    return ~graph.leads_to(graph.situations(Is.TOLD), graph.by(Mover.TIMER))


def _moves_on(graph: Graph) -> _Mask:
    return ~graph.leads_to(~graph.situations(Is.MOVES), graph.by(Mover.ABORT | Mover.TIMER))


def _livelock(graph: Graph) -> _Mask:
    goal = graph.situations(Is.TOLD) | graph.advancing
    return ~graph.leads_to(goal, graph.by(Mover.ANSWER | Mover.TIMER))


#: The properties of servers that say nothing, and of circles that take no time.
SILENCE, NO_ZENO = "silence_is_told", "no_zeno"
#: All of them, in the order in which they are told.
OF_THE_GRAPH = (
    GraphProperty(
        "home_again",
        "From every situation, READY or DONE can be reached if servers answer.",
        _not_home,
        "no answer, request or deadline leads to READY or DONE",
        of_missions=True,
    ),
    GraphProperty(
        SILENCE,
        "If servers say nothing, a mission does not wait for ever: it ends, pauses, asks or fails.",
        _untold,
        "without answers it waits for ever: no deadline leads to an end, a pause, a question or FAULT",
        of_missions=True,
    ),
    GraphProperty(
        "abort_stops",
        "From every situation, aborting (repeatedly if accepted) and waiting bring the robot to rest.",
        _moves_on,
        "something moves, and neither an abort nor a deadline ends that",
    ),
    GraphProperty(
        NO_ZENO,
        "No cycle of steps takes zero time.",
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
