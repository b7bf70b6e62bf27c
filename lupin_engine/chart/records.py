"""The base of a composed chart's records, and the one walk through their parts.

A field that authors write declares its role and its word with `said`; the others identify the record (names,
places), or follow from that. The checker, SCXML and comparisons of declarations all walk by that, so that a
new word needs no entry in lists of theirs.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from dataclasses import dataclass as record
else:

    def record(*, frozen: bool) -> Callable[[type], type]:
        """Make a dataclass that is frozen for the type checker only.

        One that is frozen at run time takes three times as long to make, and a large chart has thousands.
        """
        return dataclass(unsafe_hash=frozen, slots=True)


class Role(enum.Enum):
    """The role of a field of a record; an optional one is falsy where it is not written."""

    #: A yes or no, a number, a word or a text for people.
    PLAIN = enum.auto()
    #: A value that is computed, or several by name, on which it depends what happens.
    VALUE = enum.auto()
    #: One that is handed on only: to servers, variables, actions and people.
    CARRIED = enum.auto()
    #: A condition that is computed.
    CONDITION = enum.auto()
    #: Actions in their order.
    ACTIONS = enum.auto()
    #: The name of a code, or several.
    CODE = enum.auto()
    #: The name of a state.
    STATE = enum.auto()
    #: The name of an event, or several.
    EVENT = enum.auto()
    #: The names of holds.
    HOLDS = enum.auto()
    #: Another record, or several: in their order, or by name.
    INSIDE = enum.auto()


#: Roles of values that decide a step; and of all values that are computed.
DECIDING = frozenset({Role.VALUE, Role.CONDITION})
COMPUTED = DECIDING | {Role.CARRIED}


class Part(NamedTuple):
    """A field of a record; `word` is its key in a file."""

    field: str
    role: Role
    word: str


class Walked(NamedTuple):
    """A part of a record: the path of words that leads to it, its role, and its value."""

    words: tuple[str, ...]
    role: Role
    value: Any


def said(role: Role, word: str = "") -> Mapping[str, Any]:
    """Return the metadata of a field; without a word it is written without one, or not by authors."""
    return {"role": role, "word": word}


@cache
def parts_of(kind: type) -> tuple[Part, ...]:
    """Return the parts of a kind of record, in the order of its fields."""
    return tuple(Part(f.name, f.metadata["role"], f.metadata["word"]) for f in fields(kind) if f.metadata)


@cache
def _asked(kind: type, roles: frozenset[Role]) -> tuple[Part, ...]:
    return tuple(part for part in parts_of(kind) if part.role in roles or part.role in _NESTED)


#: Roles of what is walked into: actions have arguments.
_NESTED = (Role.INSIDE, Role.ACTIONS)


def walk(thing: Any, roles: frozenset[Role], words: tuple[str, ...] = ()) -> Iterator[Walked]:
    """Yield all parts of a record with one of some roles, also those of records in it.

    Records in a list are distinguished by the field that is their `KEY`; an `id` is a whole path.
    """
    kind: type = type(thing)
    for field, role, word in _asked(kind, roles):
        value = getattr(thing, field)
        if not value:
            continue
        inner = (*words, word) if word else words
        if role in roles and role in COMPUTED and isinstance(value, Mapping):
            yield from (Walked((*inner, name), role, each) for name, each in value.items())
        elif role in roles:
            yield Walked(inner, role, value)
        if role in _NESTED:
            for each, path in _inside(value, inner):
                yield from walk(each, roles, path)


def own(thing: Any, roles: frozenset[Role]) -> list[Any]:
    """Return the values of a record's own parts with some roles, without the records in it."""
    kind: type = type(thing)
    values = [getattr(thing, part.field) for part in _asked(kind, roles) if part.role in roles]
    return [value for value in values if value]


def _inside(value: Any, words: tuple[str, ...]) -> Iterator[tuple[Any, tuple[str, ...]]]:
    """Yield the records that a field holds, each with the words that lead to it."""
    if isinstance(value, Mapping):
        yield from ((each, (*words, name)) for name, each in value.items())
    elif isinstance(value, tuple):
        for each in value:
            key = getattr(each, each.KEY)
            yield each, (key,) if each.KEY == "id" else (*words, key)
    else:
        yield value, words


#: Fields that make no difference to what a declaration means.
_NOT_COMPARED = ("place", "summary", "doc", "advice")


def same_meaning(first: Any, second: Any) -> bool:
    """Say whether two declarations of one name are equal, apart from place and documentation."""
    if type(first) is not type(second):
        return False
    if isinstance(first, tuple):
        return len(first) == len(second) and all(map(same_meaning, first, second))
    if hasattr(first, "evaluate"):  # an expression, or a constant
        attribute = "source" if hasattr(first, "source") else "value"
        return bool(getattr(first, attribute) == getattr(second, attribute))
    if not is_dataclass(first):
        return bool(first == second)
    names = [field.name for field in fields(first) if field.name not in _NOT_COMPARED]
    return all(same_meaning(getattr(first, name), getattr(second, name)) for name in names)


__all__ = [
    "COMPUTED",
    "DECIDING",
    "Part",
    "Role",
    "Walked",
    "own",
    "parts_of",
    "record",
    "said",
    "same_meaning",
    "walk",
]
