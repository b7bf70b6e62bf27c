"""Loops over lists in an expression: one at a time, over a bounded list.

The element has a name: in `[... for NAME in LIST if ...]` the author's, in `find` and `sorted` it is `t`. A
nested loop is refused, so that the cost of an expression is hardly more than the sum of its lists. The
functions that read a call or a loop return `UNTYPED` after findings.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from lupin_engine.chart.expressions import units as q
from lupin_engine.chart.expressions.reader import (
    UNTYPED,
    ExpressionReader,
    as_quantity,
    calculable,
    capacity,
    gone_through,
    orderable,
)
from lupin_engine.chart.expressions.scope import BUILTIN_CALLS, ELEMENT, ROOTS, WORDS, Typed
from lupin_engine.plugin.types import ANY, BOOL, Type, list_of, within

#: How many comparisons of an element sorting takes at most.
_COMPARISONS = 10


def holding(kind: Type, most: float) -> Type:
    """Return the type of a list that has so many elements at most."""
    return within(kind, None, most)


def by_name(shown: str, kind: Type, index: Typed) -> str:
    """Return a hint for `shown[index]`, which the language lacks: a field or a `find`; '' without a guess."""
    if index.written in kind.fields:
        return f"write '{shown}.{index.written}'"
    inner = {f"{shown}.{name}": field for name, field in kind.fields.items()}
    for name, values in {shown: kind, **inner}.items():
        item = values.item if values.kind == "list" else None
        text = next((field for field, of in item.fields.items() if of.kind == "text"), None) if item else None
        if text and isinstance(index.written, str):
            return f"write \"find({name}, {ELEMENT}.{text} == '{index.written}')\""
    return f"its fields are {', '.join(map(repr, inner))}" if inner else ""


def called(name: str, kinds: Mapping[str, Type]) -> Iterator[str]:
    """Yield the fields of that name, with the records around them; the outer ones first."""
    records = {where: kind for where, kind in kinds.items() if kind.kind == "record"}
    yield from (f"{where}.{name}" for where, kind in records.items() if name in kind.fields)
    for where, kind in records.items():
        yield from called(name, {f"{where}.{inner}": field for inner, field in kind.fields.items()})


def comprehension(checker: ExpressionReader, node: ast.ListComp | ast.GeneratorExp) -> Typed:
    """`[VALUE for NAME in LIST if CONDITION]`: the value for each element for which the conditions hold."""
    loop, *others = node.generators
    if others or loop.is_async or not isinstance(loop.target, ast.Name):
        problem = "a loop has one name and one list"
        return checker.wrong(others[0].target if others else loop.target, "bad-expression", problem)
    values = _values(checker, loop.iter)
    if values is None:
        return UNTYPED
    with _looping(checker, node, loop.target.id, values) as name:
        if not name:
            return UNTYPED
        conditions = "".join(f" if {checker.wanted(test, BOOL).code}" for test in loop.ifs)
        value = checker.visit(node.elt)
    code = f"[{value.code} for {name} in {gone_through(values).code}{conditions}]"
    return Typed(holding(list_of(value.type), capacity(values.type)), code)


def find(checker: ExpressionReader, node: ast.Call) -> Typed:
    """`find(LIST, CONDITION)`: the first element `t` for which it holds; unknown when there is none."""
    values = _list_argument(checker, node, "find", 2)
    if values is None:
        return UNTYPED
    with _looping(checker, node, ELEMENT, values) as name:
        if not name:
            return UNTYPED
        test = checker.wanted(node.args[1], BOOL)
    checker.unknowns += 1
    code = f"({name} for {name} in {gone_through(values).code} if {test.code})"
    return Typed(values.type.item or ANY, f"_found({code}, {checker.text_of(node)!r})")


def in_order(checker: ExpressionReader, node: ast.Call) -> Typed:
    """`sorted(LIST)` or `sorted(LIST, KEY)`: the elements by a number or text of each, `t`."""
    values = _list_argument(checker, node, "sorted", min(max(len(node.args), 1), 2))
    if values is None:
        return UNTYPED
    kind, key = values.type.item or ANY, ""
    if len(node.args) == 2:
        with _looping(checker, node, ELEMENT, values) as name:
            if not name:
                return UNTYPED
            typed = checker.visit(node.args[1])
        kind, key = typed.type, f", key=lambda {name}: {typed.code}"
    if not orderable(kind) and kind.kind != "text":
        hint = "" if key else "write what it is sorted by, such as 'sorted(places, t.x)'"
        shown = node.args[-1]
        problem = f"expected a number or a text, but {checker.text_of(shown)!r} is {q.describe(kind)}"
        return checker.wrong(shown, "wrong-type", problem, hint)
    checker.looked_at(values, _COMPARISONS)
    made = holding(list_of(values.type.item or ANY), capacity(values.type))
    return Typed(made, f"sorted({gone_through(values).code}{key})")


def first(checker: ExpressionReader, node: ast.Call) -> Typed:
    """`first(LIST, DEFAULT)`: the first element, or the default when there is none."""
    values = _list_argument(checker, node, "first", 2)
    if values is None:
        return UNTYPED
    item = values.type.item or ANY
    otherwise = as_quantity(checker.visit(node.args[1]), item)
    kind = q.join(item, otherwise.type)
    if kind is None:
        problem = f"the elements are {q.describe(item)}, the default is {q.describe(otherwise.type)}"
        return checker.wrong(node.args[1], "wrong-type", problem, "both must have one type")
    return Typed(kind, f"_first({values.code}, lambda: {otherwise.code})")


def total(checker: ExpressionReader, node: ast.Call) -> Typed:
    """`sum(LIST)`: the sum of a list of numbers, of an empty one 0."""
    values = _list_argument(checker, node, "sum", 1)
    if values is None:
        return UNTYPED
    item = values.type.item or values.type
    if not q.is_number(item) and item is not q.WIRE:
        return checker.no_number(node.args[0], item)
    code = checker.looked_at(values).code
    if item is q.WIRE:
        code = f"[{calculable(Typed(item, 'v')).code} for v in {code}]"
    return Typed(item if item is q.WIRE else q.plain(item), f"sum({code})")


def _list_argument(checker: ExpressionReader, node: ast.Call, name: str, count: int) -> Typed | None:
    return _values(checker, node.args[0]) if checker.arity(node, name, count) else None


def _values(checker: ExpressionReader, node: ast.expr) -> Typed | None:
    """Return the list that a loop iterates over; None after findings."""
    typed = checker.visit(node)
    if typed.type.kind in ("list", "any"):
        return typed
    problem = f"expected a list, but {checker.text_of(node)!r} is {q.describe(typed.type)}"
    checker.wrong(node, "wrong-type", problem)
    return None


@contextmanager
def _looping(checker: ExpressionReader, node: ast.expr, name: str, values: Typed) -> Iterator[str]:
    """Bind the element's name in a loop, and yield its name in code; '' after findings."""
    taken = name in checker.scope.names or name in ROOTS or name in BUILTIN_CALLS or name in WORDS
    if checker.element:
        problem, hint = "a loop inside a loop is not allowed", "`x in list` asks whether something is there"
        checker.wrong(node, "bad-expression", problem, hint)
        yield ""
    elif taken or name.startswith("_"):
        checker.wrong(node, "bad-name", f"{name!r} cannot be the name of the element: it has a meaning here")
        yield ""
    else:
        item = values.type.item or values.type
        checker.element = {name: Typed(item, f"v_{name}")}
        checker.times = max(1, capacity(values.type))
        yield f"v_{name}"
        checker.element, checker.times = {}, 1
