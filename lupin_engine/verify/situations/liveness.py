"""Which slots are live at which place: what nothing will read before it is written again is not told apart.

A place is a configuration with the values of the variables that are texts. Which slots are live there is not
read off the chart, but learnt from what the machine's steps read: at first nothing is. A slot that is not
live has, where there is anything in it, its first value. Once a step turns out to need one that is not live
at its place, that one is made live there, and at all places from which it comes unwritten; then the walk
begins anew. So in the walk that gets to its end every step needs live slots alone, and what is live after it
was live before, or is set by it: situations that agree in all live slots are bisimilar.
"""

from __future__ import annotations

from collections.abc import Iterable

from lupin_engine.chart.model import Chart
from lupin_engine.verify.situations.found import Effect
from lupin_engine.verify.situations.situation import SlotTable

#: Slots that may be dead: the others tell which moves there are, or what is known of a situation.
_MAY_DIE = ("context", "request", "given", "itineraries", "history", "handled", "budgets")
#: What a place may not be without.
_CONFIGURATION = ("configuration", "")


class Liveness:
    """What is live at the places of one chart; it only grows."""

    def __init__(self, chart: Chart, table: SlotTable, on: bool = True) -> None:
        """Begin with nothing that is live; where it is not `on`, everything is."""
        self._on = on
        self._table = table
        texts = [("context", name) for name, of in chart.context.items() if of.type.kind == "text"]
        #: The slots whose values make a place.
        self.of_place = tuple(table.index[name] for name in (_CONFIGURATION, *texts))
        self._live: dict[tuple[int, ...], set[int]] = {}
        self._edges: dict[tuple[int, ...], dict[tuple[tuple[int, ...], frozenset[int]], None]] = {}

    def dead(self, place: tuple[int, ...], slots: Iterable[int] | None = None) -> frozenset[int]:
        """Return the slots that are not live at a place, or those of some."""
        if not self._on:
            return frozenset()
        names, live = self._table.names, self._live.get(place, set()).union(self.of_place)
        every = range(len(names)) if slots is None else slots
        return frozenset(s for s in every if s not in live and names[s][1] and names[s][0] in _MAY_DIE)

    def takes(self, place: tuple[int, ...], effect: Effect, to: tuple[int, ...]) -> bool:
        """Take notice of a step between places; say whether everything that it needs is live."""
        if not self._on:
            return True
        if effect.delta:
            self._edges.setdefault(to, {})[place, effect.sets] = None
        grown = self._grow(place, self.dead(place, effect.needs))
        through = frozenset(self._live.get(to, ())) - effect.sets
        return not (self._grow(place, self.dead(place, through)) or grown)

    def _grow(self, place: tuple[int, ...], more: Iterable[int]) -> bool:
        """Make slots live at a place and wherever they come from; say whether there were any."""
        waiting = [(place, frozenset(more))]
        grown = bool(waiting[0][1])
        while waiting:
            at, slots = waiting.pop()
            new = slots - self._live.setdefault(at, set())
            if new:
                self._live[at] |= new
                waiting += [(source, new - sets) for source, sets in self._edges.get(at, ())]
        return grown
