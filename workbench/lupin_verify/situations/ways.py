"""Chooses the paths of counterexamples: of the shortest paths one with the fewest faults."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lupin_engine.machine import RESUMED
from lupin_verify.situations.found import Breach, Explored
from lupin_verify.situations.worlds import Mover, WorldMove

#: Deadlines that fire because a server or sensor is silent.
_OF_SILENCE = ("timeout", "cancel", "fresh")


def is_fault(move: WorldMove) -> bool:
    """Return whether a move is a fault: a failure, silence, or a crash."""
    crash = move.event is not None and move.event.name == RESUMED
    return bool(move.side & Mover.FAILURE) or move.timer[0] in _OF_SILENCE or crash


class ShortestWays:
    """Shortest paths, in moves, from the initial situation to all of an explored graph."""

    def __init__(self, explored: Explored) -> None:
        self._wrong = np.array([is_fault(move) for move in explored.moves.all], dtype=np.int32)
        self._parents = np.array(explored.parents, dtype=np.int64)
        self._moves = np.array(explored.parent_moves, dtype=np.int64)
        self._each = explored.moves.each
        count = len(self._parents)
        depths = [0] * count
        for number, parent in enumerate(self._parents.tolist()[1:], 1):
            depths[number] = depths[parent] + 1
        self.depths = np.array(depths, dtype=np.int32)
        self.faults = np.zeros(count, dtype=np.int32)
        self._choose(explored)

    def _choose(self, explored: Explored) -> None:
        """Choose for each situation the shortest path with the fewest faults, level by level."""
        sources = np.frombuffer(explored.sources, dtype=np.uint32)
        targets = np.frombuffer(explored.targets, dtype=np.uint32)
        by = np.frombuffer(explored.by, dtype=np.uint16)
        ahead = np.flatnonzero(self.depths[targets] == self.depths[sources] + 1)
        ahead = ahead[np.argsort(self.depths[sources[ahead]], kind="stable")]
        levels = self.depths[sources[ahead]]
        for level in range(int(levels[-1]) + 1 if len(levels) else 0):
            edges = ahead[np.searchsorted(levels, level) : np.searchsorted(levels, level, side="right")]
            faults = self.faults[sources[edges]] + self._wrong[by[edges]]
            order = np.lexsort((faults, targets[edges]))
            reached, first = np.unique(targets[edges][order], return_index=True)
            chosen = edges[order][first]
            self.faults[reached] = faults[order][first]
            self._parents[reached], self._moves[reached] = sources[chosen], by[chosen]

    def to(self, situation: int) -> list[int]:
        """Return the moves of the path to a situation, with the reports of values that precede a move."""
        found: list[int] = []
        while situation:
            found[:0] = self._each(int(self._moves[situation]))
            situation = int(self._parents[situation])
        return found

    def first(self, breaches: Sequence[Breach]) -> list[Breach]:
        """Return breaches, those with the fewest faults first."""
        return sorted(breaches, key=self._faults)

    def _faults(self, breach: Breach) -> int:
        return int(self.faults[breach.situation] + (self._wrong[breach.move] if breach.move >= 0 else 0))

    def nearest(self, situations: Sequence[int]) -> list[int]:
        """Return situations by depth, of one depth those with the fewest faults first."""
        found = np.array(situations)
        return [int(one) for one in found[np.lexsort((self.faults[found], self.depths[found]))]]
