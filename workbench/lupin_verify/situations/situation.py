"""Situations, the abstract states of a proof, and memories that track the reads and writes of a step.

A machine's memory is cut into slots, the state variables: a field, or one entry of a field that is a mapping.
Each value of a slot is stored once and numbered; a situation is the tuple of the numbers. Values outside the
cone of influence are not compared (see `relevance`): memories that differ only in them are one situation,
represented by the first of them.

The time is always 0 here. A deadline keeps the delay with which it was set; which one fires next is not
computed from it but chosen (see `worlds`). So clock values appear as differences only.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Container, Hashable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from operator import attrgetter
from typing import Any

from lupin_engine.errors import shortened
from lupin_engine.machine import (
    INPUTS,
    LEVELS,
    Attempt,
    Compare,
    CutShort,
    FieldKind,
    GoesOn,
    Invocation,
    Life,
    Memory,
    MemoryField,
    Owner,
    Phase,
    ResourceClaim,
    Timer,
    Traversal,
    claim_of,
)
from lupin_verify.situations.relevance import Relevance, abandoned_kind, is_abandoned, kind_of

#: The numbers of the values of all slots; 0: the slot is empty.
Situation = tuple[int, ...]
#: A field of the memory, and the entry in it; '' for the field as a whole, or the order of its entries.
SlotName = tuple[str, str]

#: Attempts of a step get numbers from here on, until they get their canonical names.
FIRST_NEW = 1_000_000


def _owner(one: MemoryField) -> Owner:
    assert one.owner is not None, f"nothing owns the entries of {one.name}"
    return one.owner


def _named(is_one: Callable[[MemoryField], bool]) -> tuple[str, ...]:
    """Return the names of the compared fields of the memory that fulfil a condition."""
    every = (one for one in Memory.schema() if one.compared is not Compare.NOTHING)
    return tuple(one.name for one in every if is_one(one))


#: Mappings: each entry is a slot; for ordered ones, the order of the entries is one, too.
ORDERED = _named(lambda one: one.kind is FieldKind.ORDERED)
UNORDERED = _named(lambda one: one.kind is FieldKind.BY_KEY)
#: Sets of names, each a slot; whether there is any is one, too.
NAMES = _named(lambda one: one.kind is FieldKind.NAMES)
WHOLE = _named(lambda one: one.kind is FieldKind.WHOLE)
#: Whole fields that are lists.
LISTS = _named(lambda one: one.kind is FieldKind.WHOLE and one.empty is list)
#: Fields of which entries may be dead: those with names of the chart as keys. Others decide the moves.
MAY_BE_DEAD = _named(lambda one: one.kind in (FieldKind.BY_KEY, FieldKind.ORDERED) and one.owner is not None)
#: Fields that a reload of the same missions empties, computes again, and leaves as they are.
DROPPED = _named(lambda one: one.name in MAY_BE_DEAD and _owner(one).goes_on is GoesOn.NONE)
RECOMPUTED = _named(lambda one: one.name in MAY_BE_DEAD and one.owner in (INPUTS, LEVELS))
CARRIED_OVER = tuple(name for name in MAY_BE_DEAD if name not in (*DROPPED, *RECOMPUTED))
#: Fields of which a dead entry becomes empty. Elsewhere it keeps a value, because presence alone matters: an
#: unknown live value, for example, leads to other steps than any known one.
PRESENCE_MAY_BE_DEAD = _named(
    lambda one: one.name in MAY_BE_DEAD and one.life in (Life.MISSION, Life.USE) and _owner(one).of_states
)
#: Slots beside the memory: the order of deadlines, conditions known to be false, and the authors' monitors.
RANKS, KNOWN_FALSE, WATCHED = ("ranks", ""), ("calm", ""), ("watched", "")
#: The claims of attempts. They follow from the attempts, but most steps read only the claims.
CLAIMS = ("claims", "")
#: The value of an empty field; fields that are not compared have it at the beginning of every step.
_EMPTY: Mapping[str, Callable[[], Any]] = {
    **{one.name: one.empty for one in Memory.schema()},
    "next_id": lambda: FIRST_NEW,
}
_IDLE = tuple(one.name for one in Memory.schema() if one.compared is Compare.NOTHING)


class Overflow(Exception):
    """There are more slots than room: the exploration restarts with more."""


class TooMany(Exception):
    """A slot has more values than the bound: it probably grows without end."""

    def __init__(self, slot: SlotName, count: int, last: Any) -> None:
        what, last_text = ".".join(filter(None, slot)), shortened(repr(last), 200)
        super().__init__(f"{what} grows: it has had {count} values, the last one {last_text}")
        self.slot = slot
        self.count = count
        self.last = last


class SlotTable:
    """The slots of one chart, and the numbered values of each."""

    def __init__(self, relevance: Relevance, room: int, most: int) -> None:
        """Make a table without slots.

        Args:
            relevance: the cone of influence.
            room: the most slots.
            most: the most values of one slot.
        """
        self.relevance = relevance
        self.room = room
        self._most = most
        self.index: dict[SlotName, int] = {}
        self.names: list[SlotName] = []
        #: The slots whose values may be dead (see `liveness`).
        self.may_be_dead: set[int] = set()
        #: The slots of inputs that may be unconstrained: all their values are known beforehand.
        self.reported: frozenset[int] = frozenset()
        self._numbers: list[dict[Hashable, int]] = []
        self._values: list[list[Any]] = []
        whole = ((name, "") for name in (*WHOLE, *ORDERED, *NAMES))
        for slot_name in (*whole, RANKS, KNOWN_FALSE, WATCHED, CLAIMS):
            self.slot(slot_name)
        keyed = (one for one in Memory.schema() if one.name in (*UNORDERED, *NAMES))
        self.keys = {one.name: tuple(sorted(_owner(one).names(relevance.chart))) for one in keyed}
        for field, names in self.keys.items():
            for key in names:
                self.slot((field, key))

    def slot(self, name: SlotName) -> int:
        """Return the index of a slot; add it where it is new.

        Raises:
            Overflow: there is no room for it.
        """
        found = self.index.get(name)
        if found is None:
            found = self.index[name] = len(self.names)
            self.names.append(name)
            if name[1] and name[0] in MAY_BE_DEAD:
                self.may_be_dead.add(found)
            self._numbers.append({})
            self._values.append([None])
        if found >= self.room:
            raise Overflow
        return found

    def number(self, slot: int, value: Any) -> int:
        """Return the number of a value of a slot; values that are equal in the cone have one number.

        Raises:
            TooMany: it has more values than the bound.
        """
        name = self.names[slot]
        key = self.relevance.key(name, value)
        numbers = self._numbers[slot]
        found = numbers.get(key)
        if found is None:
            found = numbers[key] = len(numbers) + 1
            self._values[slot].append(pickle.dumps(value, -1) if type(value) is Traversal else _copied(value))
        if found > self._most:
            raise TooMany(name, found, value)
        return found

    def count(self, name: SlotName) -> int:
        """Return how many values a slot has had."""
        return len(self._numbers[self.index[name]])

    def value(self, slot: int, number: int) -> Any:
        """Return a copy of a value."""
        kept = self._values[slot][number]
        return pickle.loads(kept) if type(kept) is bytes else _copied(kept)

    def values(self, slot: int) -> list[Any]:
        """Return all values that a slot had so far."""
        return [self.value(slot, number) for number in range(1, len(self._values[slot]))]

    def is_same(self, slot: int, number: int, value: Any) -> bool:
        """Return whether a value equals the stored one of a number."""
        kept = self._values[slot][number]
        return kept is value or (type(kept) is type(value) and bool(kept == value))

    def get(self, situation: Situation, name: SlotName) -> Any:
        """Return the value of a slot in a situation; None where it is empty."""
        number = situation[self.slot(name)]
        return self.value(self.index[name], number) if number else None


def _copied(value: Any) -> Any:
    """Return a copy of a value, one level deep; values of the language are immutable."""
    copy = _COPIES.get(type(value))
    return value if copy is None else copy(value)


def _copier(of: type) -> Callable[[Any], Any]:
    values = attrgetter(*(one.name for one in fields(of)))
    return lambda value: of(*map(_copied, values(value)))


_COPIES: Mapping[type, Callable[[Any], Any]] = {
    list: list,
    dict: dict,
    **{of: _copier(of) for of in (Attempt, Invocation, CutShort)},
}


class TrackedMemory(Memory):
    """The memory of a situation, read on demand; it records the read set and the write set of a step.

    The step depends on the values of the slots in `values`, and on the presence of those in `presence`. Slots
    in `written` were written; where they are not in `values`, without being read. `lazy` has variables that
    were set to a value computed from an input that nothing else has read: reading the variable reads the
    input.
    """

    __slots__ = ("lazy", "presence", "situation", "table", "values", "written")

    def __init__(self, table: SlotTable, situation: Situation) -> None:
        # No field is set here: `__getattr__` looks up those that are not set.
        self.table = table
        self.situation = situation
        self.lazy: dict[str, tuple[Any, int]] = {}
        self.values: set[int] = set()
        self.presence: set[int] = set()
        self.written: set[int] = set()

    def __getattr__(self, name: str) -> Any:
        make = _FIELDS.get(name)
        if make is None:
            raise AttributeError(name)
        found = make(self, name)
        setattr(self, name, found)
        return found

    def fetch(self, slot: int) -> Any:
        """Return the value of a slot, and record it as read."""
        self.values.add(slot)
        number = self.situation[slot]
        return self.table.value(slot, number) if number else None

    def has(self, slot: int) -> bool:
        """Return whether a slot has a value, and record its presence as read."""
        self.presence.add(slot)
        return self.situation[slot] != 0

    @property
    def reads(self) -> frozenset[int]:
        """The read set of the step: slots, and from `table.room` on the presence of slots."""
        room = self.table.room
        return frozenset(self.values).union(slot + room for slot in self.presence - self.values)

    def read_lazily(self, variables: Iterable[str], slot: int) -> None:
        """Take back the read of an input by the `set` just done, until one of its variables is read."""
        self.values.discard(slot)
        self.presence.add(slot)
        dict.pop(self.inputs, self.table.names[slot][1])
        for name in variables:
            self.lazy[name] = dict.pop(self.context, name), slot

    def read_now(self, variable: str) -> Any:
        """Return the value of a lazy variable, and record its input as read."""
        value, slot = self.lazy.pop(variable)
        self.values.add(slot)
        dict.__setitem__(self.context, variable, value)
        return value

    @property
    def claims(self) -> list[ResourceClaim]:
        """The claims of all attempts; attempts that the step has not read keep their stored claims."""
        entries = self.attempts
        assert isinstance(entries, TrackedDict)
        before: tuple[ResourceClaim, ...] = self.fetch(self.table.index[CLAIMS]) or ()
        found = {claim.attempt: claim for claim in before if claim.attempt not in entries.removed}
        for name, attempt in dict.items(entries):
            claim = claim_of(attempt)
            if claim is None:
                found.pop(name, None)
                continue
            if name not in found:
                entries.in_order()
            found[name] = claim
        # Where the order was not read, no attempt was added, removed or renamed.
        return [found[name] for name in (entries.order or found) if name in found]

    def is_any_engaged(self, holds: Iterable[str]) -> bool:
        """Return whether one of some holds is engaged, without reading which, where no other one is."""
        holds = tuple(holds)
        others = self._other_holds(holds)
        if self.held and len(others) < len(holds) and not any(name in self.held for name in others):
            return True
        return bool(self.held) and super().is_any_engaged(holds)

    def is_any_beside(self, holds: Container[str]) -> bool:
        """Return whether a hold other than these is engaged, without reading these."""
        others = self._other_holds(holds)
        every = len(others) == len(self.table.keys["held"])
        return bool(self.held) and (every or any(name in self.held for name in others))

    def engaged_beside(self, holds: Container[str]) -> list[str]:
        """Return the engaged holds other than these, without reading these."""
        return [name for name in self._other_holds(holds) if name in self.held] if self.held else []

    def _other_holds(self, holds: Container[str]) -> list[str]:
        return [name for name in self.table.keys["held"] if name not in holds]

    def release(self, holds: Iterable[str]) -> list[str]:
        """Release holds without reading which were engaged; return all of them."""
        names = list(holds)
        for name in names:
            self.held.remove(name)
        return names

    @property
    def target(self) -> str:
        """Nothing: only displays use the target."""
        return ""

    def plain(self) -> Memory:
        """Return an untracked memory for a reload of the missions.

        Of entries that are `CARRIED_OVER` only the presence counts as read; so for `RECOMPUTED` ones, because
        the same missions give the same result. `DROPPED` fields are left out.
        """
        unread = TrackedMemory(self.table, self.situation)
        found = {name: getattr(self, name) for name in (*WHOLE, *_IDLE)}
        found |= {name: list(getattr(self, name)) for name in (*LISTS, *NAMES)}
        try:
            for name in (*ORDERED, *UNORDERED):
                of = unread if name in (*CARRIED_OVER, *RECOMPUTED) else self
                found[name] = {} if name in DROPPED else dict(getattr(of, name).items())
        finally:
            self.presence |= unread.presence | unread.values
        return Memory(**found)

    @contextmanager
    def unread(self, field: str, keys: Iterable[str], whatever: Any = None) -> Iterator[None]:
        """Provide entries to a step whose values do not influence it, without recording them as read.

        `whatever`, where given, stands for each. Afterwards the entries are removed again; with `whatever`
        those are kept that the step has written.
        """
        entries = getattr(self, field)
        lent: dict[str, Any] = {}
        for key in keys:
            slot = self.table.index[field, key]
            if not dict.__contains__(entries, key) and key in entries:
                value = self.table.value(slot, self.situation[slot]) if whatever is None else whatever
                lent[key] = value
                dict.__setitem__(entries, key, value)
        yield
        for key, value in lent.items():
            if whatever is None or dict.get(entries, key) is value:
                dict.pop(entries, key, None)

    def assign(self, other: Memory, whole: bool = False) -> None:
        """Take over the fields of another memory: a successor of this one, or a `whole` new one."""
        for name in WHOLE:
            setattr(self, name, getattr(other, name))
        for name in NAMES:  # the machine may release a hold that is not engaged: a list would raise
            getattr(self, name).replace(getattr(other, name))
        for name in (*ORDERED, *UNORDERED):
            if whole or name not in (*CARRIED_OVER, *RECOMPUTED):
                getattr(self, name).replaced(getattr(other, name))

    def accessed_timers(self) -> list[list[Timer]]:
        """Return the running and the stopped deadlines, as far as the step has read them."""
        found = [object.__getattribute__(self, name) for name in ("timers", "frozen") if self.is_set(name)]
        return [one for one in found if not (isinstance(one, TrackedList) and one.is_unread)]

    def is_accessed(self, name: str) -> bool:
        """Return whether entries of a field were read, added or removed."""
        entries = object.__getattribute__(self, name) if self.is_set(name) else {}
        return (
            not isinstance(entries, TrackedDict)
            or bool(entries.removed)
            or any(True for _ in dict.items(entries))
        )

    def is_set(self, name: str) -> bool:
        """Return whether a field was read or written."""
        try:
            object.__getattribute__(self, name)
        except AttributeError:
            return False
        return True

    def changes(self) -> Iterator[tuple[int, int]]:
        """Yield the changed slots with their new numbers."""
        index = self.table.index
        for name in WHOLE:
            if not self.is_set(name):
                continue
            value = object.__getattribute__(self, name)
            if isinstance(value, TrackedList):
                if value.is_unread:
                    continue
                value = list(value)
            # Of a whole field nothing and an empty one are the same.
            yield from self.change(index[name, ""], value if value or value == 0.0 else None)
        for name in NAMES:
            if self.is_set(name):
                yield from self._name_changes(name, object.__getattribute__(self, name))
        for name in (*ORDERED, *UNORDERED):
            if self.is_set(name):
                yield from self._entry_changes(name, object.__getattribute__(self, name))
        for name, (value, _) in self.lazy.items():
            yield from self.change(index["context", name], value)

    def _entry_changes(self, name: str, entries: dict[str, Any]) -> Iterator[tuple[int, int]]:
        if not isinstance(entries, TrackedDict):  # put in place of the whole field
            entries = TrackedDict(self, name).replaced(entries)
        for key in entries.removed:
            yield from self.change(self.table.slot((name, key)), None)
        for key, value in dict.items(entries):
            yield from self.change(self.table.slot((name, key)), value)
        if entries.order is not None:
            yield from self.change(self.table.index[name, ""], tuple(entries.order) or None)

    def _name_changes(self, field: str, names: TrackedNames) -> Iterator[tuple[int, int]]:
        index = self.table.index
        for name, is_there in names.known.items():
            yield from self.change(index[field, name], is_there or None)
        if names.known:
            yield from self.change(index[field, ""], bool(names) or None)

    def change(self, slot: int, value: Any) -> Iterator[tuple[int, int]]:
        """Yield a written slot with its new number, unless it was read and is unchanged."""
        self.written.add(slot)
        old = self.situation[slot]
        is_same = bool(old) and self.table.is_same(slot, old, value)
        number = old if is_same else 0 if value is None else self.table.number(slot, value)
        known = slot in self.values or (slot in self.presence and old == 0)
        if number != old or not known:
            yield slot, number


class TrackedNames:
    """A field that is a set of names: each name is a slot, and so is whether there is any."""

    def __init__(self, memory: TrackedMemory, field: str) -> None:
        self._memory = memory
        self._field = field
        #: Names that were added or removed.
        self.known: dict[str, bool] = {}
        #: All present names, once read.
        self._all: list[str] | None = None

    def _has(self, name: str) -> bool:
        return self._memory.has(self._memory.table.index[self._field, name])

    def __contains__(self, name: str) -> bool:
        known = self.known.get(name)
        return self._has(name) if known is None else known

    def __iter__(self) -> Iterator[str]:
        return iter(self._there())

    def __bool__(self) -> bool:
        return bool(self._there()) if self.known or self._all is not None else self._has("")

    def __getitem__(self, index: int) -> str:
        return self._there()[index]

    def _there(self) -> list[str]:
        if self._all is None:
            some = self.known or self._has("")
            self._all = [n for n in self._memory.table.keys[self._field] if n in self] if some else []
        return self._all

    def replace(self, by: Iterable[str]) -> None:
        """Replace all names."""
        there = frozenset(by)
        self.known = {name: name in there for name in self._memory.table.keys[self._field]}
        self._all = None

    def append(self, name: str) -> None:
        """Add a name."""
        self._set(name, True)

    def remove(self, name: str) -> None:
        """Remove a name."""
        self._set(name, False)

    def _set(self, name: str, is_there: bool) -> None:
        self.known[name], self._all = is_there, None


class TrackedList(list[Any]):
    """A field that is a list; its truth value reads its presence only, anything else its value."""

    __slots__ = ("_memory", "_slot", "is_unread")

    def __init__(self, memory: TrackedMemory, slot: int) -> None:
        super().__init__()
        self._memory = memory
        self._slot = slot
        self.is_unread = True

    def _load(self) -> None:
        self.is_unread = False
        super().extend(self._memory.fetch(self._slot) or ())

    def __bool__(self) -> bool:
        return self._memory.has(self._slot) if self.is_unread else super().__len__() > 0

    def clear(self) -> None:
        """Remove all elements without reading them."""
        self.is_unread = False
        super().clear()


def _loading(name: str) -> Any:
    usual = getattr(list, name)

    def method(self: TrackedList, *arguments: Any) -> Any:
        if self.is_unread:
            self._load()
        return usual(self, *arguments)

    return method


for _name in (
    "__len__",
    "__iter__",
    "__contains__",
    "__getitem__",
    "__setitem__",
    "__delitem__",
    "__eq__",
    "__reversed__",
    "__add__",
    "append",
    "remove",
    "pop",
    "insert",
    "extend",
    "index",
    "sort",
):
    setattr(TrackedList, _name, _loading(_name))


class TrackedDict(dict[str, Any]):
    """A field that is a mapping; each entry is read on demand.

    `removed` are keys of the situation that were removed; `order` is the list of keys, once it was read.
    """

    __slots__ = ("_all", "_field", "_memory", "order", "removed")

    def __init__(self, memory: TrackedMemory, field: str) -> None:
        super().__init__()
        self._memory = memory
        self._field = field
        self._all = False
        self.removed: set[str] = set()
        self.order: list[str] | None = None

    def replaced(self, by: Mapping[str, Any]) -> TrackedDict:
        """Replace all entries."""
        self.clear()
        self.update(by)
        return self

    def _is_lazy(self, key: object) -> bool:
        return self._field == "context" and key in self._memory.lazy

    def in_order(self) -> list[str]:
        """Return the keys in their order, and record the order as read."""
        if self._field in UNORDERED:
            known = self._memory.table.keys[self._field]
            return [key for key in known if key in self]
        if self.order is None:
            self.order = list(self._memory.fetch(self._memory.table.index[self._field, ""]) or ())
        return self.order

    def _load(self) -> None:
        if not self._all:
            found = {key: self[key] for key in list(self.in_order())}
            found |= dict(dict.items(self))
            super().clear()
            super().update(found)
            self._all = True

    def __missing__(self, key: str) -> Any:
        if self._is_lazy(key):
            return self._memory.read_now(key)
        if key in self.removed or self._all or not key:
            raise KeyError(key)
        found = self._memory.fetch(self._memory.table.slot((self._field, key)))
        if found is None:
            raise KeyError(key)
        super().__setitem__(key, found)
        return found

    def get(self, key: str, default: Any = None) -> Any:
        """Return an entry, or the default."""
        try:
            return self[key]
        except KeyError:
            return default

    def __contains__(self, key: object) -> bool:
        if super().__contains__(key) or self._is_lazy(key):
            return True
        if key in self.removed or self._all or not key:
            return False
        return self._memory.has(self._memory.table.slot((self._field, str(key))))

    def __setitem__(self, key: str, value: Any) -> None:
        if self._field in ORDERED and key not in self:
            self.in_order().append(key)
        if self._is_lazy(key):
            del self._memory.lazy[key]
        super().__setitem__(key, value)
        self.removed.discard(key)

    def __delitem__(self, key: str) -> None:
        if key not in self:
            raise KeyError(key)
        super().pop(key, None)
        self.removed.add(key)
        if self._field in ORDERED:
            self.in_order().remove(key)

    def pop(self, key: str, *default: Any) -> Any:
        """Remove and return an entry."""
        if key not in self:
            if default:
                return default[0]
            raise KeyError(key)
        found = self[key]
        del self[key]
        return found

    def setdefault(self, key: str, default: Any = None) -> Any:
        """Return an entry; add it where there is none."""
        if key not in self:
            self[key] = default
        return self[key]

    def update(self, other: Any = (), **more: Any) -> None:  # type: ignore[override]
        """Add or replace entries."""
        for key, value in dict(other, **more).items():
            self[key] = value

    def rename(self, named: Mapping[str, str]) -> None:
        """Rename entries; their order stays."""
        keys = self.in_order()
        moved = {new: super(TrackedDict, self).pop(old) for old, new in named.items()}
        self.removed |= {old for old in named if not is_new(old)}
        self.removed -= moved.keys()
        super().update(moved)
        keys[:] = [named.get(key, key) for key in keys]
        self._all = False

    def clear(self) -> None:
        """Remove all entries."""
        known = self._memory.table.keys.get(self._field)
        if known is None:
            for key in list(self.in_order()):
                del self[key]
        else:  # without reading them
            super().clear()
            self.removed.update(known)
            self._all = True

    def __iter__(self) -> Iterator[str]:
        return iter(list(self.in_order()))

    def __len__(self) -> int:
        return len(self.in_order())

    def __bool__(self) -> bool:
        if self._field in ORDERED and self.order is None:
            return self._memory.has(self._memory.table.index[self._field, ""])
        return bool(self.in_order())

    def keys(self) -> Any:
        """Return all keys."""
        return dict.fromkeys(self.in_order()).keys()

    def values(self) -> Any:
        """Return all values."""
        self._load()
        return super().values()

    def items(self) -> Any:
        """Return all entries."""
        self._load()
        return super().items()


def _whole(memory: TrackedMemory, name: str) -> Any:
    found = memory.fetch(memory.table.index[name, ""])
    return _EMPTY[name]() if found is None else found


#: Makes the tracked value of a field at its first read.
_FIELDS: Mapping[str, Callable[[TrackedMemory, str], Any]] = {
    **dict.fromkeys(WHOLE, _whole),
    **dict.fromkeys(LISTS, lambda memory, name: TrackedList(memory, memory.table.index[name, ""])),
    **dict.fromkeys((*ORDERED, *UNORDERED), TrackedDict),
    **dict.fromkeys(_IDLE, lambda _, name: _EMPTY[name]()),
    **dict.fromkeys(NAMES, TrackedNames),
}


# -- canonical names -------------------------------------------------------------------------------------


def canonical_names(memory: TrackedMemory) -> dict[str, str]:
    """Give attempts, invocations and deadlines their canonical names; return new names by old ones.

    So situations do not differ by how many attempts there were before. An invocation is named by its state,
    its current attempt has number 0, an abandoned one is named by its class (see `is_abandoned`). Deadlines
    are numbered in their order.
    """
    entries, invocations = memory.attempts, memory.invocations
    assert isinstance(entries, TrackedDict)
    named = {one.id: f"i:{name}" for name, one in dict.items(invocations) if one.id != f"i:{name}"}
    named |= _attempt_names(memory, entries)
    for _, one in dict.items(invocations) if named else ():
        one.id = named.get(one.id, one.id)
        one.attempt = named.get(one.attempt or "", one.attempt)
        if one.cut is not None:
            one.cut.attempt = named.get(one.cut.attempt, one.cut.attempt)
    renamed = {old: new for old, new in named.items() if old in entries}
    if renamed:
        entries.rename(renamed)
        for name, attempt in dict.items(entries):
            attempt.id = name
    for field in ("timers", "frozen"):
        timers = getattr(memory, field)
        if renamed or not (isinstance(timers, TrackedList) and timers.is_unread):
            timers[:] = _canonical_timers(timers, named)
    return named


def _attempt_names(memory: TrackedMemory, entries: TrackedDict) -> dict[str, str]:
    """Return the canonical names of attempts that have another one."""
    invocations = [one for _, one in dict.items(memory.invocations)]
    current = {one.attempt for one in invocations}
    named: dict[str, str] = {}
    taken: set[str] | None = None
    changed = {name for name in entries.removed if is_abandoned(name)}
    abandoned: dict[str, str] = {}
    # An attempt that has the name of a new one needs another name.
    passed_on = {f"{one.invocation}#0" for name, one in dict.items(entries) if name in current} - current
    for name in passed_on:
        entries.get(name)
    for name, attempt in list(dict.items(entries)):
        unwanted = attempt.phase in (Phase.CANCELLING, Phase.LOST)
        if name in current:
            if name != f"{attempt.invocation}#0":
                named[name] = f"{attempt.invocation}#0"
        elif unwanted and not is_waited_for(memory, attempt):
            abandoned[name] = abandoned_kind(attempt)
        elif name in passed_on or is_abandoned(name) or (unwanted and (name.endswith("#0") or is_new(name))):
            taken = set(entries.in_order()) if taken is None else taken
            count = next(n for n in range(1, len(taken) + 2) if f"{attempt.invocation}#{n}" not in taken)
            named[name] = f"{attempt.invocation}#{count}"
            taken.add(named[name])
    moved = {name for name, kind in abandoned.items() if kind_of(name) != kind}
    changed |= {name for name in moved if is_abandoned(name)}
    for kind in {kind_of(name) for name in changed} | {abandoned[name] for name in moved}:
        named |= _abandoned_names(memory, entries, abandoned, kind)
    return named


def _abandoned_names(
    memory: TrackedMemory, entries: TrackedDict, abandoned: Mapping[str, str], kind: str
) -> dict[str, str]:
    """Return the new names of abandoned attempts of one class: numbered from 1 on, by their deadlines."""
    every = [name for name in entries.in_order() if abandoned.get(name, kind_of(name)) == kind]
    owners = [owner for _, _, cancel, (owner, _) in memory.timers if cancel == "cancel"]
    every.sort(key=lambda name: owners.index(name) if name in owners else len(owners))
    named = {name: f"{kind}#{n}" for n, name in enumerate(every, 1)}
    return {entries[old].id: new for old, new in named.items() if old != new}


def is_waited_for(memory: TrackedMemory, attempt: Attempt) -> bool:
    """Return whether an invocation waits for the result of a cancelled attempt."""
    invocation = memory.invocations.get(attempt.invocation)
    return invocation is not None and invocation.cut is not None and invocation.cut.attempt == attempt.id


def is_new(name: str) -> bool:
    """Return whether a name is the engine's own, before `canonical_names`."""
    return name[:1] == "a" and name[1:].isdigit()


def _canonical_timers(timers: list[Timer], named: Mapping[str, str]) -> list[Timer]:
    """Return deadlines with canonical names, sorted by delay and order of setting, and numbered.

    A time of day may come at any time: it has one fixed delay and date.
    """
    found = []
    for due, _, kind, (owner, event) in timers:
        if kind == "at":
            word, _, time = event.split(" ")
            due, event = _AT, f"{word} {_ANY_DATE} {time}"
        found.append((due, kind, (named.get(owner, owner), event)))
    found.sort(key=lambda timer: (timer[0], timer[2] if timer[1] == "at" else ("", "")))
    return [(due, number, kind, about) for number, (due, kind, about) in enumerate(found, 1)]


#: The delay of every time of day, in seconds, and its date.
_AT, _ANY_DATE = 3600.0, "2026-01-01"
