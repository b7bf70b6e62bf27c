"""Dead-variable reduction: a slot that is written before it is read again is dead, its value is not stored.

A control location is a configuration with the values of its keys: text variables and history values. Its live
slots are learnt from the reads of the machine's steps; at first all are dead. The value of a dead slot is
replaced by one fixed value. For fields in `PRESENCE_MAY_BE_DEAD` even its presence is dropped, unless a step
tests for presence. A read of a dead slot makes it live there, and by backward propagation at all locations
from which it comes unwritten; then the exploration restarts. Whether a key is live depends on the
configuration.

An input is unconstrained in a configuration, under a hold or without one, if reporting it there changes only
its value. Its value is then not stored: a transition that reads it is expanded once for each value (see
`LevelExploration`). That is assumed at first, and given up where a report shows otherwise.

So in the exploration that completes, every step reads live slots only, and each slot that is live after it
was live before or is written by it: situations that agree in all live slots are bisimilar.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from typing import NamedTuple

from lupin_engine.chart import Chart
from lupin_verify.situations.found import Effect
from lupin_verify.situations.situation import PRESENCE_MAY_BE_DEAD, SlotTable

#: Whether a hold is active, the value of the configuration (together the head), and the values of the keys.
#: Live slots do not depend on the hold; unconstrained inputs depend on the head alone.
Location = tuple[int, ...]
Head = tuple[int, ...]
_HEAD = 2


class Dead(NamedTuple):
    """The dead slots of a location; of those in `absent` even the presence is dead."""

    slots: Set[int] = frozenset()
    absent: Set[int] = frozenset()

    def left(self, slot: int, value: int) -> int:
        """Return the value that is stored for a slot's value."""
        return value if slot not in self.slots else 0 if slot in self.absent else min(value, 1)


class Liveness:
    """The live slots at the control locations of one chart. Only live keys and constrained inputs persist."""

    def __init__(
        self, chart: Chart, table: SlotTable, input_values: Mapping[int, Mapping[int, int]], on: bool = True
    ) -> None:
        """Begin with all slots dead.

        Args:
            chart: the chart.
            table: its slots.
            input_values: for each slot of an input that may be unconstrained, the numbers of its values, each
                with the move that reports it.
            on: False: nothing is ever dead.
        """
        self._on = on
        #: In the first walk nothing is dead or unconstrained, and locations have all keys: it only learns.
        self.learns = on
        self.input_values = input_values if on else {}
        #: The constrained inputs, by the head of locations; None: in any.
        self._constrained: dict[Head | None, set[int]] = {}
        self._table = table
        keys = [("context", name) for name, of in chart.context.items() if of.type.kind == "text"]
        keys += [("history", name) for name in table.keys["history"]]
        self._keys = tuple(table.index[key] for key in keys)
        self._key_set = frozenset(self._keys)
        #: The slots of a location, and those of its head.
        self.head_slots = (table.index["held", ""], table.index["configuration", ""])
        self.location_slots = (*self.head_slots, *self._keys)
        self._of_effects: dict[
            tuple[frozenset[int], frozenset[int]], tuple[frozenset[int], frozenset[int], frozenset[int]]
        ] = {}
        self._of_keys = _LiveSets()
        self._of_slots = _LiveSets()
        #: The steps of this exploration and of those before.
        self._steps: dict[_Summary, None] = {}
        #: The configurations in which a key became live in this exploration.
        self._split: set[int] = set()

    def begin(self) -> None:
        """Prepare for a new exploration: compute live slots again, as fewer inputs may be unconstrained now.

        When a key became live, a location was split by its values. Steps of the unsplit location cannot be
        assigned to the parts, so they are discarded and learnt again.
        """
        known = (one for one in self._steps if self._split.isdisjoint((one.location[1], one.to[1])))
        self._steps, self._split, self._of_slots = dict.fromkeys(known), set(), _LiveSets()
        for one in self._steps:
            self._propagate(one)

    def end_learning(self) -> None:
        """Reduce from now on. The steps learnt so far have values of all keys, so none need be discarded."""
        if self.learns:
            self.learns, self._split = False, set()
            every = self._steps
            self._steps = {
                one._replace(location=self.location(one.location), to=self.location(one.to)): None
                for one in every
            }

    def unconstrained(self, location: Location) -> Set[int]:
        """Return the slots of inputs that are unconstrained at a location."""
        constrained = self._constrained.get(None, set()) | self._constrained.get(location[:_HEAD], set())
        return _NOTHING if self.learns else self.input_values.keys() - constrained

    def constrain(self, head: Head | None, slots: Set[int]) -> bool:
        """Mark inputs as constrained at locations with a head (None: any); return whether all were."""
        constrained = self._constrained.setdefault(head, set())
        is_known = slots <= constrained
        constrained.update(slots)
        return is_known or self.learns

    def dead(self, location: Location) -> Dead:
        """Return the slots that are dead at a location."""
        if self.learns or not self._on:
            return Dead()
        room = self._table.room
        live = self._of_keys.live(location[1:_HEAD]) | self._of_slots.live(location[1:])
        dead = self._table.may_be_dead - live | self.unconstrained(location)
        fading = (slot for slot in dead if self._table.names[slot][0] in PRESENCE_MAY_BE_DEAD)
        return Dead(dead, frozenset(slot for slot in fading if slot + room not in live))

    def location(self, values: Iterable[int]) -> Location:
        """Return the location with these values of `location_slots`, without dead keys."""
        location = tuple(values)
        if self.learns or not self._on:
            return location
        head, live = location[:_HEAD], self._of_keys.live(location[1:_HEAD])
        named = zip(self._keys, location[_HEAD:], strict=True)
        return (*head, *(value if slot in live else 0 for slot, value in named))

    def add_step(self, location: Location, effect: Effect, to: Location) -> bool:
        """Learn from a step between locations; return whether every slot that it reads was live."""
        if not self._on:
            return True
        of_keys, needs, sets = self._reads_and_writes(effect)
        one = _Summary(location, to, needs, sets)
        self._steps[one] = None
        split = self._of_keys.add_step(location[1:_HEAD], to[1:_HEAD], of_keys, sets)
        self._split.update(configuration for (configuration,) in split)
        return self.learns or not (self._propagate(one) or split)

    def _propagate(self, one: _Summary) -> set[Location]:
        """Make the slots that a step reads live; return the locations at which one was dead."""
        unconstrained = self.unconstrained(one.location)
        return self._of_slots.add_step(
            one.location[1:], one.to[1:], one.needs - unconstrained, one.sets | unconstrained
        )

    def _reads_and_writes(self, effect: Effect) -> tuple[frozenset[int], frozenset[int], frozenset[int]]:
        """Return the keys and the other slots that an effect reads, and those it writes, with presences."""
        found = self._of_effects.get((effect.needs, effect.sets))
        if found is None:
            room, may_be_dead = self._table.room, self._table.may_be_dead
            needs = {slot for slot in effect.needs if slot % room in may_be_dead}
            needs |= {slot + room for slot in needs if slot < room}
            of_keys = frozenset(slot for slot in needs if slot % room in self._key_set)
            sets = effect.sets.union(slot + room for slot in effect.sets)
            found = of_keys, frozenset(needs - of_keys), sets
            self._of_effects[effect.needs, effect.sets] = found
        return found


class _Summary(NamedTuple):
    """A step between locations: the slots other than keys that it reads, and the slots that it writes."""

    location: Location
    to: Location
    needs: frozenset[int]
    sets: frozenset[int]


_NOTHING: Set[int] = frozenset()


class _LiveSets:
    """The live slots at each location, by backward propagation over the steps between locations.

    The presence of a slot is numbered as `TrackedMemory.reads` does.
    """

    def __init__(self) -> None:
        self._live: dict[Location, set[int]] = {}
        self._edges: dict[Location, dict[tuple[Location, frozenset[int]], None]] = {}

    def live(self, location: Location) -> Set[int]:
        return self._live.get(location, _NOTHING)

    def add_step(
        self, location: Location, to: Location, needs: frozenset[int], sets: frozenset[int]
    ) -> set[Location]:
        """Add a step; return the locations at which more is live than before."""
        if location != to:
            self._edges.setdefault(to, {})[location, sets] = None
        needed = needs.union(self.live(to) - sets) - self.live(location)
        return self._grow(location, needed) if needed else set()

    def _grow(self, location: Location, more: frozenset[int]) -> set[Location]:
        """Make slots live at a location, and backwards to their writes; return where one was dead."""
        waiting = [(location, more)]
        grown = set()
        while waiting:
            at, slots = waiting.pop()
            new = slots - self._live.setdefault(at, set())
            if new:
                grown.add(at)
                self._live[at] |= new
                waiting += [(source, new - sets) for source, sets in self._edges.get(at, ())]
        return grown
