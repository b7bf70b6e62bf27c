"""The scope of an expression, and the result of checking it."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from lupin_engine.chart.expressions.evaluation import Compiled
from lupin_engine.chart.source import Text
from lupin_engine.plugin.contract import Function
from lupin_engine.plugin.types import Type

#: Roots of the environment that are records of their own; every other name is a context variable.
ROOTS = frozenset(
    {"param", "request", "input", "event", "error", "target", "itinerary", "clock", "this_step"}
)
#: Names that an expression may call besides the catalog's functions.
BUILTIN_CALLS = (
    *("len", "min", "max", "sum", "abs", "round", "any", "all"),
    *("first", "find", "sorted", "known", "held", "in_state", "was_in_state"),
)
#: What `find` and `sorted` call the element that they look at.
ELEMENT = "t"
#: What an operation gave that was cut short; it may be unknown.
ERROR_RESULT = "error.result"
TRUTHS: Mapping[str, bool] = {"true": True, "false": False}
#: Words that no expression could read as a name.
WORDS = frozenset({*keyword.kwlist, *TRUTHS})

_WHOLE = re.compile(r"\s*\$\{(.*)\}\s*", re.DOTALL)


@dataclass
class Usage:
    """The names that the expressions of a chart have read; shared by all scopes of one load."""

    parameters: set[str] = field(default_factory=set)
    functions: set[str] = field(default_factory=set)
    inputs: set[str] = field(default_factory=set)


@dataclass(frozen=True, eq=False)
class Scope:
    """The names that an expression may read where it stands.

    `names` are the roots and the context variables with their types. `absent` gives, for a root that is
    missing, the rule and the reason. `bound` are parameters of a part with an argument. `states` are full
    names, for in_state; `holds` are names, for held. With `open_states` more states may exist than are
    loaded: the lifecycle also names those of missions in other files. `item` is the name of the element of a
    `for_each`. `within` is the state that uses a mission whose file the expression stands in. `out` has the
    variables of a part's use, by the names that the part has for them.
    """

    names: Mapping[str, Type]
    functions: Mapping[str, Function] = field(default_factory=dict)
    states: Sequence[str] = ()
    holds: Iterable[str] = ()
    absent: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    bound: Mapping[str, Typed] = field(default_factory=dict)
    usage: Usage = field(default_factory=Usage)
    open_states: bool = False
    item: str = ""
    within: str = ""
    out: Mapping[str, str] = field(default_factory=dict)

    # The states of one family have one scope and say the same in it again and again. So it remembers what
    # was derived from it, and the names and expressions that were read in it.
    _derived: dict[Any, Scope] = field(init=False, repr=False, compare=False, default_factory=dict)
    read_names: dict[tuple[str, str], Typed] = field(
        init=False, repr=False, compare=False, default_factory=dict
    )
    compiled: dict[tuple[str, int], CheckedExpression] = field(
        init=False, repr=False, compare=False, default_factory=dict
    )

    @property
    def has_context(self) -> bool:
        """Say whether variables can be declared for it: in a chart, not in a binding."""
        return "input" in self.names

    def with_names(self, names: Mapping[str, Type]) -> Scope:
        """Return this scope with further names, or other types for the same ones."""
        key: Any = tuple(names.items())
        derived = self._derived.get(key)
        if derived is None:
            absent = {name: reason for name, reason in self.absent.items() if name not in names}
            derived = self._derived[key] = replace(self, names={**self.names, **names}, absent=absent)
        return derived

    def with_event(self, kind: Type) -> Scope:
        """Return this scope with an event of a type: that of most transitions and actions."""
        key = id(kind)  # the scope that is kept under it keeps the type alive
        derived = self._derived.get(key)
        if derived is None:
            derived = self._derived[key] = self.with_names({"event": kind})
        return derived

    def with_item(self, name: str, kind: Type) -> Scope:
        """Return this scope with the element of a `for_each`, which the author calls `name`."""
        return replace(self.with_names({name: kind}), item=name)

    def without(self, name: str, reason: str) -> Scope:
        """Return this scope without one of the roots, and why it is not there."""
        names = {known: kind for known, kind in self.names.items() if known != name}
        return replace(self, names=names, absent={**self.absent, name: ("unknown-name", reason)})


class Fragment(NamedTuple):
    """The source of an expression: a piece of a text in a file, beginning at character `offset` of it."""

    source: str
    text: Text
    offset: int = 0


class Choice(NamedTuple):
    """A text that a condition, given as code, chooses from two."""

    test: str
    body: Typed
    other: Typed


class Typed(NamedTuple):
    """A checked expression: its type, and its code over an environment `env`.

    `written` is a text that is written out, or the choice between two: it may turn out to be a quantity.
    """

    type: Type
    code: str
    written: str | Choice | None = None


class CheckedExpression(NamedTuple):
    """The result for an expression of type `wanted`, equal wherever it stands in a scope."""

    wanted: Type
    type: Type
    evaluate: Compiled
    parts: tuple[tuple[str, Compiled], ...]


def literal(value: Any, kind: Type) -> Typed:
    """Return plain data of a type as an expression."""
    if isinstance(value, str):
        return Typed(kind, repr(value), value)
    # Python warns of a written number or list that is read like a record; only of `any` can that be tried.
    return Typed(kind, f"_same({value!r})" if kind.kind == "any" else f"({value!r})")


class Inset(NamedTuple):
    """An expression in a text: from its `${` up to behind its `}`, with the colon before its format.

    `colon` is -1 where there is none, `end` where it is not closed.
    """

    begin: int
    colon: int
    end: int


def insets(text: str) -> Iterator[Inset]:
    """Yield the expressions in a text; braces in quotes or brackets end none."""
    begin = text.find("${")
    while begin >= 0:
        colon, end = _colon_and_end(text, begin + 2)
        yield Inset(begin, colon, end)
        begin = text.find("${", end) if end >= 0 else -1


def _colon_and_end(text: str, begin: int) -> tuple[int, int]:
    """Return the position of an expression's colon, and of its end; -1 for a missing one."""
    colon, depth, quote = -1, 0, ""
    for at in range(begin, len(text)):
        sign = text[at]
        if quote or sign in "'\"":
            quote = "" if sign == quote else quote or sign
        elif sign in "([)]":
            depth += 1 if sign in "([" else -1
        elif sign == ":" and depth == 0 and colon < 0:
            colon = at
        elif sign == "}":
            return colon, at + 1
    return colon, -1


def fragment_of(text: Text) -> Fragment | None:
    """Return the expression that a value consists of (`${ ... }`), or None when it is a plain text."""
    if text.startswith("${") and text.endswith("}"):
        source = text[2:-1]
        if "${" in source or (":" in source and any(inset.colon >= 0 for inset in insets(text))):
            return None
        return Fragment(source, text, 2)
    match = _WHOLE.fullmatch(text)
    return None if match is None or "${" in match.group(1) else Fragment(match.group(1), text, match.start(1))
