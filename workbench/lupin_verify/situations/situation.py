"""Situations: a machine's memory as a tuple of small numbers, and memories that know what of them was read.

A memory is cut into slots: a field, or one entry of a field that is a mapping. What a slot can be is kept
once and numbered; a situation is the numbers of all slots. What does not decide what a machine does is left
out of the comparison (see `relevance`): two memories that differ in nothing else are one situation, for which
the memory stands that was seen first.

The time is always 0 here. A deadline is as far away as when it was set, however long ago that is: which
one fires next is not read off it but chosen (see `worlds`). So clock values appear as differences only.
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
from lupin_verify.situations.relevance import Relevance, is_orphan, kind_of, orphan_kind

#: The numbers of all slots; 0: there is nothing.
Situation = tuple[int, ...]
#: A field of the memory, and the entry in it; '' for the field as a whole, or the order of its entries.
SlotName = tuple[str, str]

#: What is made new in a step gets numbers from here on, until it has its lasting name.
FIRST_NEW = 1_000_000


def _owner(one: MemoryField) -> Owner:
    assert one.owner is not None, f"nothing owns the entries of {one.name}"
    return one.owner


def _named(is_one: Callable[[MemoryField], bool]) -> tuple[str, ...]:
    """Return those of the compared fields of the memory of which something is true."""
    every = (one for one in Memory.schema() if one.compared is not Compare.NOTHING)
    return tuple(one.name for one in every if is_one(one))


#: Mappings of which every entry is a slot; of the ordered ones the order of the entries is one, too.
ORDERED = _named(lambda one: one.kind is FieldKind.ORDERED)
UNORDERED = _named(lambda one: one.kind is FieldKind.BY_KEY)
#: Sets of names, each a slot; whether there is any is one, too.
NAMES = _named(lambda one: one.kind is FieldKind.NAMES)
WHOLE = _named(lambda one: one.kind is FieldKind.WHOLE)
#: Those of them that are lists.
LISTS = _named(lambda one: one.kind is FieldKind.WHOLE and one.empty is list)
#: Fields of which entries may be dead: those that are kept under names of the chart. Others tell which moves
#: there are.
MORTAL = _named(lambda one: one.kind in (FieldKind.BY_KEY, FieldKind.ORDERED) and one.owner is not None)
#: What a reload of the same missions empties, what it compares anew, and what it leaves as it is.
DROPPED = _named(lambda one: one.name in MORTAL and _owner(one).goes_on is GoesOn.NONE)
COMPARED = _named(lambda one: one.name in MORTAL and one.owner in (INPUTS, LEVELS))
THROUGH = tuple(name for name in MORTAL if name not in (*DROPPED, *COMPARED))
#: Those of which entries that are not live are empty. Others are not: with a live value that is not known,
#: say, a machine goes other ways than with any that is.
FADING = _named(
    lambda one: one.name in MORTAL and one.life in (Life.MISSION, Life.USE) and _owner(one).of_states
)
#: What is no part of a memory: which deadlines certainly come before others, what is known to be false, and
#: what the properties of authors remember.
RANKS, CALM, WATCHED = ("ranks", ""), ("calm", ""), ("watched", "")
#: The claims of attempts, which follow from these: few steps need more of them.
CLAIMS = ("claims", "")
#: What a field is where there is nothing; what is not compared begins with it in every step. So does what
#: was told before the mission, of which a registry may leave out whatever it likes: what counts of a report
#: can be any list all the same.
_EMPTY: Mapping[str, Callable[[], Any]] = {
    **{one.name: one.empty for one in Memory.schema()},
    "next_id": lambda: FIRST_NEW,
}
_IDLE = tuple(one.name for one in Memory.schema() if one.compared is Compare.NOTHING)


class Overflow(Exception):
    """There are more slots than room was left for: the exploration begins again with more."""


class TooMany(Exception):
    """A slot has so many values that it grows without end."""

    def __init__(self, slot: SlotName, count: int, last: Any) -> None:
        what, told = ".".join(filter(None, slot)), shortened(repr(last), 200)
        super().__init__(f"{what} grows: it has had {count} values, the last one {told}")
        self.slot = slot
        self.count = count
        self.last = last


class SlotTable:
    """The slots of one chart and what each of them can be."""

    def __init__(self, relevance: Relevance, room: int, most: int) -> None:
        """Make a table without slots.

        Args:
            relevance: what of a memory decides anything.
            room: how many slots there may be.
            most: how many values of one slot are no growth without end.
        """
        self.relevance = relevance
        self.room = room
        self._most = most
        self.index: dict[SlotName, int] = {}
        self.names: list[SlotName] = []
        #: The slots whose values may be dead (see `liveness`).
        self.mortal: set[int] = set()
        #: The slots of inputs of which all values are known beforehand.
        self.reported: frozenset[int] = frozenset()
        self._numbers: list[dict[Hashable, int]] = []
        self._values: list[list[Any]] = []
        whole = ((name, "") for name in (*WHOLE, *ORDERED, *NAMES))
        for slot_name in (*whole, RANKS, CALM, WATCHED, CLAIMS):
            self.slot(slot_name)
        keyed = (one for one in Memory.schema() if one.name in (*UNORDERED, *NAMES))
        self.keys = {one.name: tuple(sorted(_owner(one).names(relevance.chart))) for one in keyed}
        for field, names in self.keys.items():
            for key in names:
                self.slot((field, key))

    def slot(self, name: SlotName) -> int:
        """Return the index of a slot."""
        found = self.index.get(name)
        if found is None:
            found = self.index[name] = len(self.names)
            self.names.append(name)
            if name[1] and name[0] in MORTAL:
                self.mortal.add(found)
            self._numbers.append({})
            self._values.append([None])
        if found >= self.room:
            raise Overflow
        return found

    def number(self, slot: int, value: Any) -> int:
        """Return the number of a value of a slot.

        Raises:
            TooMany: it has more values than are told apart.
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
        """Return a value that nobody else changes."""
        kept = self._values[slot][number]
        return pickle.loads(kept) if type(kept) is bytes else _copied(kept)

    def values(self, slot: int) -> list[Any]:
        """Return all values that a slot had so far."""
        return [self.value(slot, number) for number in range(1, len(self._values[slot]))]

    def is_kept(self, slot: int, number: int, value: Any) -> bool:
        """Say whether a value is the same as one that is kept."""
        kept = self._values[slot][number]
        return kept is value or (type(kept) is type(value) and bool(kept == value))

    def get(self, situation: Situation, name: SlotName) -> Any:
        """Return what a slot is in a situation; None where there is nothing."""
        number = situation[self.slot(name)]
        return self.value(self.index[name], number) if number else None


def _copied(value: Any) -> Any:
    """Return a value for somebody who may change it; values of the language are never changed themselves."""
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
    """The memory of a situation; what is read is looked up when it is first asked for, and remembered.

    A step depends on the slots in `values`, of which it has taken the value, and in `presence`, of which it
    has only looked whether there is anything. What it has `written` it has written whatever was there.
    Variables that are `aside` were set, each to a value that was made of a slot that nothing else has read;
    once one of them is read, so is that slot.
    """

    __slots__ = ("aside", "presence", "situation", "table", "values", "written")

    def __init__(self, table: SlotTable, situation: Situation) -> None:
        # Nothing of the fields is set here: what is not set is looked up.
        self.table = table
        self.situation = situation
        self.aside: dict[str, tuple[Any, int]] = {}
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
        """Return what a slot is, and remember that it was read."""
        self.values.add(slot)
        number = self.situation[slot]
        return self.table.value(slot, number) if number else None

    def has(self, slot: int) -> bool:
        """Say whether a slot is anything, and remember that somebody wants to know that."""
        self.presence.add(slot)
        return self.situation[slot] != 0

    @property
    def reads(self) -> frozenset[int]:
        """What the step depends on: slots, and after them the presence of slots."""
        room = self.table.room
        return frozenset(self.values).union(slot + room for slot in self.presence - self.values)

    def put_aside(self, variables: Iterable[str], slot: int) -> None:
        """Let variables that were set just now be made of an input that nothing else has read."""
        self.values.discard(slot)
        self.presence.add(slot)
        dict.pop(self.inputs, self.table.names[slot][1])
        for name in variables:
            self.aside[name] = dict.pop(self.context, name), slot

    def take_back(self, variable: str) -> Any:
        """Return what a variable was set to, and remember that what it was made of was read."""
        value, slot = self.aside.pop(variable)
        self.values.add(slot)
        dict.__setitem__(self.context, variable, value)
        return value

    @property
    def claims(self) -> list[ResourceClaim]:
        """The claims of all attempts, of which only those are looked up that the step has looked at."""
        entries = self.attempts
        assert isinstance(entries, TrackedDict)
        before: tuple[ResourceClaim, ...] = self.fetch(self.table.index[CLAIMS]) or ()
        found = {claim.attempt: claim for claim in before if claim.attempt not in entries.gone}
        for name, attempt in dict.items(entries):
            claim = claim_of(attempt)
            if claim is None:
                found.pop(name, None)
                continue
            if name not in found:
                entries.in_order()
            found[name] = claim
        # Where nobody has asked for the order, none has come, gone, or got another name.
        return [found[name] for name in (entries.order or found) if name in found]

    def is_any_engaged(self, holds: Iterable[str]) -> bool:
        """Say whether one of some holds is engaged: where no other one is, no matter which."""
        holds = tuple(holds)
        others = self._other_holds(holds)
        if self.held and len(others) < len(holds) and not any(name in self.held for name in others):
            return True
        return bool(self.held) and super().is_any_engaged(holds)

    def is_any_beside(self, holds: Container[str]) -> bool:
        """Say whether a hold is engaged that is not among some, which are not looked at."""
        others = self._other_holds(holds)
        every = len(others) == len(self.table.keys["held"])
        return bool(self.held) and (every or any(name in self.held for name in others))

    def engaged_beside(self, holds: Container[str]) -> list[str]:
        """Return the engaged holds that are not among some, which are not looked at."""
        return [name for name in self._other_holds(holds) if name in self.held] if self.held else []

    def _other_holds(self, holds: Container[str]) -> list[str]:
        return [name for name in self.table.keys["held"] if name not in holds]

    def release(self, holds: Iterable[str]) -> list[str]:
        """Release some holds, of which it makes no difference which were engaged; so all are returned."""
        names = list(holds)
        for name in names:
            self.held.remove(name)
        return names

    @property
    def target(self) -> str:
        """Nothing: which target a display shows leads to nothing, so it is not read."""
        return ""

    def plain(self) -> Memory:
        """Return a memory of the machine's own kind, of which nothing is tracked.

        What goes `THROUGH` a reload entry by entry is not read by that, only whether it is there; nor what is
        `COMPARED` anew, since with the same missions the result is the same. What is `DROPPED` is left out.
        """
        unread = TrackedMemory(self.table, self.situation)
        found = {name: getattr(self, name) for name in (*WHOLE, *_IDLE)}
        found |= {name: list(getattr(self, name)) for name in (*LISTS, *NAMES)}
        try:
            for name in (*ORDERED, *UNORDERED):
                of = unread if name in (*THROUGH, *COMPARED) else self
                found[name] = {} if name in DROPPED else dict(getattr(of, name).items())
        finally:
            self.presence |= unread.presence | unread.values
        return Memory(**found)

    @contextmanager
    def unread(self, field: str, keys: Iterable[str], whatever: Any = None) -> Iterator[None]:
        """Let a step have entries whose values make no difference to it, so that they do not count as read.

        Afterwards they are as they were; where `whatever` stood for them, those are that the step has left.
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

    def take_over(self, other: Memory, whole: bool = False) -> None:
        """Become what another memory is: one that goes on from this one, or on the `whole` another one."""
        for name in (*WHOLE, *NAMES):
            setattr(self, name, getattr(other, name))
        for name in (*ORDERED, *UNORDERED):
            if whole or name not in (*THROUGH, *COMPARED):
                getattr(self, name).replaced(getattr(other, name))

    def looked_at_timers(self) -> list[list[Timer]]:
        """Return the deadlines that run, and those that are stopped, as far as the step looked at them."""
        found = [object.__getattribute__(self, name) for name in ("timers", "frozen") if self.is_set(name)]
        return [one for one in found if not (isinstance(one, TrackedList) and one.is_unread)]

    def is_looked_at(self, name: str) -> bool:
        """Say whether entries of a field were looked at, put in or taken out."""
        entries = object.__getattribute__(self, name) if self.is_set(name) else {}
        return (
            not isinstance(entries, TrackedDict)
            or bool(entries.gone)
            or any(True for _ in dict.items(entries))
        )

    def is_set(self, name: str) -> bool:
        """Say whether a field was looked at or written."""
        try:
            object.__getattribute__(self, name)
        except AttributeError:
            return False
        return True

    def changes(self) -> Iterator[tuple[int, int]]:
        """Yield the slots that are not as they were, each with what it is now."""
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
        for name, (value, _) in self.aside.items():
            yield from self.change(index["context", name], value)

    def _entry_changes(self, name: str, entries: dict[str, Any]) -> Iterator[tuple[int, int]]:
        if not isinstance(entries, TrackedDict):  # put in place of the whole field
            entries = TrackedDict(self, name).replaced(entries)
        for key in entries.gone:
            yield from self.change(self.table.slot((name, key)), None)
        for key, value in dict.items(entries):
            yield from self.change(self.table.slot((name, key)), value)
        if entries.order is not None:
            yield from self.change(self.table.index[name, ""], tuple(entries.order) or None)

    def _name_changes(self, field: str, names: TrackedNames | list[str]) -> Iterator[tuple[int, int]]:
        index, every = self.table.index, self.table.keys[field]
        known = names.known if isinstance(names, TrackedNames) else {n: n in names for n in every}
        for name, is_there in known.items():
            yield from self.change(index[field, name], is_there or None)
        if known:
            yield from self.change(index[field, ""], bool(names) or None)

    def change(self, slot: int, value: Any) -> Iterator[tuple[int, int]]:
        """Yield a slot with what it is now, unless it is known to be as it was."""
        self.written.add(slot)
        old = self.situation[slot]
        is_same = bool(old) and self.table.is_kept(slot, old, value)
        number = old if is_same else 0 if value is None else self.table.number(slot, value)
        known = slot in self.values or (slot in self.presence and old == 0)
        if number != old or not known:
            yield slot, number


class TrackedNames:
    """The names in a field, each a slot, with one more that says whether there is any."""

    def __init__(self, memory: TrackedMemory, field: str) -> None:
        self._memory = memory
        self._field = field
        #: Those that were put in or taken out.
        self.known: dict[str, bool] = {}
        #: All that are there, once that was asked.
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

    def append(self, name: str) -> None:
        """Put one in."""
        self._set(name, True)

    def remove(self, name: str) -> None:
        """Take one out."""
        self._set(name, False)

    def _set(self, name: str, is_there: bool) -> None:
        self.known[name], self._all = is_there, None


class TrackedList(list[Any]):
    """A field that is a list, which is looked up when more is asked than whether there is anything."""

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
        """Take everything out, whatever there was."""
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
    """The entries of a field; each is looked up when it is first asked for.

    `gone` are entries that were there before; `order` the keys in their order, once that was looked at.
    """

    __slots__ = ("_all", "_field", "_memory", "gone", "order")

    def __init__(self, memory: TrackedMemory, field: str) -> None:
        super().__init__()
        self._memory = memory
        self._field = field
        self._all = False
        self.gone: set[str] = set()
        self.order: list[str] | None = None

    def replaced(self, by: Mapping[str, Any]) -> TrackedDict:
        """Put other entries in place of all."""
        self.clear()
        self.update(by)
        return self

    def _is_aside(self, key: object) -> bool:
        return self._field == "context" and key in self._memory.aside

    def in_order(self) -> list[str]:
        """Return the keys in their order, which is read with that."""
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
        if self._is_aside(key):
            return self._memory.take_back(key)
        if key in self.gone or self._all or not key:
            raise KeyError(key)
        found = self._memory.fetch(self._memory.table.slot((self._field, key)))
        if found is None:
            raise KeyError(key)
        super().__setitem__(key, found)
        return found

    def get(self, key: str, default: Any = None) -> Any:
        """Return an entry, or what is given instead."""
        try:
            return self[key]
        except KeyError:
            return default

    def __contains__(self, key: object) -> bool:
        if super().__contains__(key) or self._is_aside(key):
            return True
        if key in self.gone or self._all or not key:
            return False
        return self._memory.has(self._memory.table.slot((self._field, str(key))))

    def __setitem__(self, key: str, value: Any) -> None:
        if self._field in ORDERED and key not in self:
            self.in_order().append(key)
        if self._is_aside(key):
            del self._memory.aside[key]
        super().__setitem__(key, value)
        self.gone.discard(key)

    def __delitem__(self, key: str) -> None:
        if key not in self:
            raise KeyError(key)
        super().pop(key, None)
        self.gone.add(key)
        if self._field in ORDERED:
            self.in_order().remove(key)

    def pop(self, key: str, *default: Any) -> Any:
        """Take an entry out."""
        if key not in self:
            if default:
                return default[0]
            raise KeyError(key)
        found = self[key]
        del self[key]
        return found

    def setdefault(self, key: str, default: Any = None) -> Any:
        """Return an entry; where there is none, put one there."""
        if key not in self:
            self[key] = default
        return self[key]

    def update(self, other: Any = (), **more: Any) -> None:  # type: ignore[override]
        """Put entries in."""
        for key, value in dict(other, **more).items():
            self[key] = value

    def rename(self, named: Mapping[str, str]) -> None:
        """Give entries other names; their order stays."""
        keys = self.in_order()
        moved = {new: super(TrackedDict, self).pop(old) for old, new in named.items()}
        self.gone |= {old for old in named if not is_new(old)}
        self.gone -= moved.keys()
        super().update(moved)
        keys[:] = [named.get(key, key) for key in keys]
        self._all = False

    def clear(self) -> None:
        """Take all entries out."""
        known = self._memory.table.keys.get(self._field)
        if known is None:
            for key in list(self.in_order()):
                del self[key]
        else:  # whatever there was
            super().clear()
            self.gone.update(known)
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


#: What stands for a field that is asked for.
_FIELDS: Mapping[str, Callable[[TrackedMemory, str], Any]] = {
    **dict.fromkeys(WHOLE, _whole),
    **dict.fromkeys(LISTS, lambda memory, name: TrackedList(memory, memory.table.index[name, ""])),
    **dict.fromkeys((*ORDERED, *UNORDERED), TrackedDict),
    **dict.fromkeys(_IDLE, lambda _, name: _EMPTY[name]()),
    **dict.fromkeys(NAMES, TrackedNames),
}


# -- lasting names ---------------------------------------------------------------------------------------


def settle_names(memory: TrackedMemory) -> dict[str, str]:
    """Give attempts, invocations and deadlines their lasting names; return what was renamed.

    An invocation is named by what it serves; its attempt that somebody waits for has number 0. One that
    nobody waits for is an orphan (see `is_orphan`). So what came before does not show. Deadlines are numbered
    in their order.
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
            timers[:] = _lasting(timers, named)
    return named


def _attempt_names(memory: TrackedMemory, entries: TrackedDict) -> dict[str, str]:
    """Return the new names of attempts."""
    invocations = [one for _, one in dict.items(memory.invocations)]
    current = {one.attempt for one in invocations}
    named: dict[str, str] = {}
    taken: set[str] | None = None
    changed = {name for name in entries.gone if is_orphan(name)}
    orphans: dict[str, str] = {}
    # Whoever has the name that a new attempt gets needs another one.
    passed_on = {f"{one.invocation}#0" for name, one in dict.items(entries) if name in current} - current
    for name in passed_on:
        entries.get(name)
    for name, attempt in list(dict.items(entries)):
        unwanted = attempt.phase in (Phase.CANCELLING, Phase.LOST)
        if name in current:
            if name != f"{attempt.invocation}#0":
                named[name] = f"{attempt.invocation}#0"
        elif unwanted and not is_waited_for(memory, attempt):
            orphans[name] = orphan_kind(attempt)
        elif name in passed_on or is_orphan(name) or (unwanted and (name.endswith("#0") or is_new(name))):
            taken = set(entries.in_order()) if taken is None else taken
            count = next(n for n in range(1, len(taken) + 2) if f"{attempt.invocation}#{n}" not in taken)
            named[name] = f"{attempt.invocation}#{count}"
            taken.add(named[name])
    moved = {name for name, kind in orphans.items() if kind_of(name) != kind}
    changed |= {name for name in moved if is_orphan(name)}
    for kind in {kind_of(name) for name in changed} | {orphans[name] for name in moved}:
        named |= _orphan_names(memory, entries, orphans, kind)
    return named


def _orphan_names(
    memory: TrackedMemory, entries: TrackedDict, orphans: Mapping[str, str], kind: str
) -> dict[str, str]:
    """Return the new names of the orphans of one kind: numbers from 1 on, in the order of their deadlines."""
    every = [name for name in entries.in_order() if orphans.get(name, kind_of(name)) == kind]
    owners = [owner for _, _, cancel, (owner, _) in memory.timers if cancel == "cancel"]
    every.sort(key=lambda name: owners.index(name) if name in owners else len(owners))
    named = {name: f"{kind}#{n}" for n, name in enumerate(every, 1)}
    return {entries[old].id: new for old, new in named.items() if old != new}


def is_waited_for(memory: TrackedMemory, attempt: Attempt) -> bool:
    """Say whether somebody waits for what a cancelled attempt gives."""
    invocation = memory.invocations.get(attempt.invocation)
    return invocation is not None and invocation.cut is not None and invocation.cut.attempt == attempt.id


def is_new(name: str) -> bool:
    """Say whether a name is one that an attempt gets when it is made."""
    return name[:1] == "a" and name[1:].isdigit()


def _lasting(timers: list[Timer], named: Mapping[str, str]) -> list[Timer]:
    """Return deadlines with their lasting names, in order of time and then of setting, numbered by that.

    A time of day may come at any time, on no date in particular.
    """
    found = []
    for due, _, kind, (owner, event) in timers:
        if kind == "at":
            word, _, time = event.split(" ")
            due, event = _AT, f"{word} {_ANY_DATE} {time}"
        found.append((due, kind, (named.get(owner, owner), event)))
    found.sort(key=lambda timer: (timer[0], timer[2] if timer[1] == "at" else ("", "")))
    return [(due, number, kind, about) for number, (due, kind, about) in enumerate(found, 1)]


#: How far away every time of day is, in seconds, and the date that it is on.
_AT, _ANY_DATE = 3600.0, "2026-01-01"
