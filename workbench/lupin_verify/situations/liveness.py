"""Which slots are live at which place: what nothing will read before it is written again is not told apart.

A place is a configuration with the values of its keys: the variables that are texts, and what history
remembers. Which slots are live there is not read off the chart, but learnt from what the machine's steps
read: at first nothing is. The value of a dead slot is replaced by
one fixed value. For the fields in `FADING` even its presence is dropped, unless a step tests for presence.
Once a step turns out to need something that is not live at its place, that is made live there, and at all
places from which it comes unwritten; then the walk begins anew. Whether a key is live follows from the
configuration.
An input is unconstrained in a configuration, under a hold or without one, if reporting it there changes only
its value. Its value is then not stored: a transition that reads it is expanded once for each value (see
`LevelWalk`). That is assumed at first, and given up where it is not so.
So in the walk that gets to its end every step needs live slots alone, and what is live after it was live
before, or is set by it: situations that agree in all live slots are bisimilar.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from typing import NamedTuple

from lupin_engine.chart import Chart
from lupin_verify.situations.found import Effect
from lupin_verify.situations.situation import FADING, SlotTable

#: Whether there is a hold, and the values of the configuration and of the keys; the first two are the head.
#: What is live does not depend on the hold, what is open depends on the head alone.
Place = tuple[int, ...]
Head = tuple[int, ...]
_HEAD = 2


class Dead(NamedTuple):
    """The slots that are not live somewhere; of those that are `gone` not even whether there is anything."""

    slots: Set[int] = frozenset()
    gone: Set[int] = frozenset()

    def left(self, slot: int, value: int) -> int:
        """Return what is left of a value."""
        return value if slot not in self.slots else 0 if slot in self.gone else min(value, 1)


class Liveness:
    """The live slots at the control locations of one chart. Keys and constrained inputs are only added."""

    def __init__(
        self, chart: Chart, table: SlotTable, told: Mapping[int, Mapping[int, int]], on: bool = True
    ) -> None:
        """Begin with nothing that is live.

        Args:
            chart: the chart.
            table: its slots.
            told: of the slots of inputs that may be open the numbers of their values, each with the move that
                tells it.
            on: whether anything is ever not live.
        """
        self._on = on
        self.told = told if on else {}
        #: The inputs that are not open, by the head of places; None: in any.
        self._closed: dict[Head | None, set[int]] = {}
        self._table = table
        keys = [("context", name) for name, of in chart.context.items() if of.type.kind == "text"]
        keys += [("history", name) for name in table.keys["history"]]
        self._keys = tuple(table.index[key] for key in keys)
        self._key_set = frozenset(self._keys)
        #: The slots whose values make a place, and those of its head.
        self.of_head = (table.index["held", ""], table.index["configuration", ""])
        self.of_place = (*self.of_head, *self._keys)
        self._of_effects: dict[
            tuple[frozenset[int], frozenset[int]], tuple[frozenset[int], frozenset[int], frozenset[int]]
        ] = {}
        self._of_keys = _Flow()
        self._of_slots = _Flow()
        #: The steps that were met, in this walk and before.
        self._met: dict[_Met, None] = {}
        #: The configurations in which a key became live in this walk.
        self._split: set[int] = set()

    def begin(self) -> None:
        """Prepare for a new walk: work out anew what is live, as fewer values may be open now.

        If a place has become several, nobody knows to which of them its steps belong: they are forgotten.
        """
        known = (one for one in self._met if self._split.isdisjoint((one.place[1], one.to[1])))
        self._met, self._split, self._of_slots = dict.fromkeys(known), set(), _Flow()
        for one in self._met:
            self._take(one)

    def open(self, place: Place) -> Set[int]:
        """Return the slots of inputs whose values are open at a place."""
        return self.told.keys() - self._closed.get(None, set()) - self._closed.get(place[:_HEAD], set())

    def close(self, head: Head | None, slots: Set[int]) -> bool:
        """Take notice that these are not open at places with a head (None: any); say whether it was known."""
        closed = self._closed.setdefault(head, set())
        calm = slots <= closed
        closed.update(slots)
        return calm

    def dead(self, place: Place) -> Dead:
        """Return the slots that are not live at a place."""
        if not self._on:
            return Dead()
        room, live = self._table.room, self._of_keys.live(place[1:_HEAD]) | self._of_slots.live(place[1:])
        dead = self._table.mortal - live | self.open(place)
        fading = (slot for slot in dead if self._table.names[slot][0] in FADING)
        return Dead(dead, frozenset(slot for slot in fading if slot + room not in live))

    def place(self, values: Iterable[int]) -> Place:
        """Return the place with these values of `of_place`, without what is not live."""
        place = tuple(values)
        if not self._on:
            return place
        head, live = place[:_HEAD], self._of_keys.live(place[1:_HEAD])
        named = zip(self._keys, place[_HEAD:], strict=True)
        return (*head, *(value if slot in live else 0 for slot, value in named))

    def takes(self, place: Place, effect: Effect, to: Place) -> bool:
        """Take notice of a step between places; say whether everything that it needs is live."""
        if not self._on:
            return True
        of_keys, needs, sets = self._parts(effect)
        one = _Met(place, to, needs, sets)
        self._met[one] = None
        split = self._of_keys.takes(place[1:_HEAD], to[1:_HEAD], of_keys, sets)
        self._split.update(configuration for (configuration,) in split)
        return not (self._take(one) or split)

    def _take(self, one: _Met) -> set[Place]:
        """Take notice of the other slots of a step; return where one was not live that is needed."""
        open_ = self.open(one.place)
        return self._of_slots.takes(one.place[1:], one.to[1:], one.needs - open_, one.sets | open_)

    def _parts(self, effect: Effect) -> tuple[frozenset[int], frozenset[int], frozenset[int]]:
        """Return which keys and which other slots an effect needs, and what it sets, presences with them."""
        found = self._of_effects.get((effect.needs, effect.sets))
        if found is None:
            room, mortal = self._table.room, self._table.mortal
            needs = {slot for slot in effect.needs if slot % room in mortal}
            needs |= {slot + room for slot in needs if slot < room}
            of_keys = frozenset(slot for slot in needs if slot % room in self._key_set)
            sets = effect.sets.union(slot + room for slot in effect.sets)
            found = of_keys, frozenset(needs - of_keys), sets
            self._of_effects[effect.needs, effect.sets] = found
        return found


class _Met(NamedTuple):
    """A step between places: which slots but for keys it needs, and which it sets."""

    place: Place
    to: Place
    needs: frozenset[int]
    sets: frozenset[int]


_NOTHING: Set[int] = frozenset()


class _Flow:
    """What is live where: it is needed there, or it goes on from there to where it is live.

    The presence of a slot is numbered as `TrackedMemory.reads` does.
    """

    def __init__(self) -> None:
        self._live: dict[Place, set[int]] = {}
        self._edges: dict[Place, dict[tuple[Place, frozenset[int]], None]] = {}

    def live(self, place: Place) -> Set[int]:
        return self._live.get(place, _NOTHING)

    def takes(self, place: Place, to: Place, needs: frozenset[int], sets: frozenset[int]) -> set[Place]:
        """Take notice of a step; return the places at which more is live than was."""
        if place != to:
            self._edges.setdefault(to, {})[place, sets] = None
        needed = needs.union(self.live(to) - sets) - self.live(place)
        return self._grow(place, needed) if needed else set()

    def _grow(self, place: Place, more: frozenset[int]) -> set[Place]:
        """Make slots live at a place and wherever they come from; return where one was not."""
        waiting = [(place, more)]
        grown = set()
        while waiting:
            at, slots = waiting.pop()
            new = slots - self._live.setdefault(at, set())
            if new:
                grown.add(at)
                self._live[at] |= new
                waiting += [(source, new - sets) for source, sets in self._edges.get(at, ())]
        return grown
