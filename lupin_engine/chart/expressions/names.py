"""Finds the dependencies of checked expressions in their text: names, and inputs that may be unknown."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from functools import lru_cache

from lupin_engine.chart.expressions.reader import MAX_NODES
from lupin_engine.chart.expressions.scope import ERROR_RESULT, insets

_CACHED = 4096


@lru_cache(_CACHED)
def tree_of(source: str) -> ast.expr | None:
    """Parse an expression that was checked before; None for one that was refused as no expression.

    A text with expressions in it is the list of these.
    """
    inside = [source[i.begin + 2 : i.colon if i.colon >= 0 else i.end - 1] for i in insets(source)]
    if inside:
        return ast.List([tree for tree in map(tree_of, inside) if tree is not None], ast.Load())
    try:
        tree = ast.parse(re.sub(r"\s", " ", source).strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        return None
    # What was refused as too large may be deeper than Python can follow.
    return None if 2 * len(source) > MAX_NODES and sum(1 for _ in ast.walk(tree)) > MAX_NODES else tree


@lru_cache(_CACHED)
def names_read(source: str) -> frozenset[str]:
    """Return the first words of all that an expression reads or calls: `input`, `reason`, `in_state`."""
    tree = tree_of(source)
    return (
        frozenset(node.id for node in ast.walk(tree) if isinstance(node, ast.Name)) if tree else frozenset()
    )


def renamed(source: str, names: Mapping[str, str]) -> str:
    """Return an expression, or a text with expressions in it, that reads variables by other names."""
    if not names or names.keys().isdisjoint(names_read(source)):
        return source
    spans = [(one.begin + 2, one.colon if one.colon >= 0 else one.end - 1) for one in insets(source)]
    found, at = "", 0
    for begin, end in spans or [(0, len(source))]:
        found, at = found + source[at:begin] + _renamed(source[begin:end], names), end
    return found + source[at:]


def _renamed(source: str, names: Mapping[str, str]) -> str:
    tree, plain = tree_of(source), re.sub(r"\s", " ", source)
    if tree is None:
        return source
    read = [node for node in ast.walk(tree) if isinstance(node, ast.Name) and names.get(node.id)]
    elements = {node.id for node in read if isinstance(node.ctx, ast.Store)}
    text, indent = plain.encode(), len(plain) - len(plain.lstrip())
    for node in sorted(read, key=lambda node: -node.col_offset):
        if node.id not in elements:
            begin, end = indent + node.col_offset, indent + (node.end_col_offset or 0)
            text = text[:begin] + names[node.id].encode() + text[end:]
    return text.decode()


@lru_cache(_CACHED)
def unknowns_read(source: str, known: frozenset[str] = frozenset()) -> tuple[str, ...]:
    """Return the possibly unknown values that an expression reads without a guard by `known`.

    These are inputs, as `input.NAME`, calls of `find` and values by name, both as they are written.
    """
    tree = tree_of(source)
    return tuple(dict.fromkeys(_unasked(tree, known))) if tree is not None else ()


@lru_cache(_CACHED)
def unknowns_asked(source: str, outcome: bool) -> frozenset[str]:
    """Return the values that are known when a condition has this `outcome`."""
    tree = tree_of(source)
    return _asked(tree, outcome) if tree is not None else frozenset()


def _unasked(node: ast.AST, known: frozenset[str]) -> Iterator[str]:
    """Yield the possibly unknown values that are read below a node, given the known ones there."""
    name = _unknown(node)
    if name and name not in known:
        yield name
    if isinstance(node, ast.BoolOp):
        for value in node.values:
            yield from _unasked(value, known)
            known |= _asked(value, isinstance(node.op, ast.And))
    elif isinstance(node, ast.IfExp):
        yield from _unasked(node.test, known)
        yield from _unasked(node.body, known | _asked(node.test, True))
        yield from _unasked(node.orelse, known | _asked(node.test, False))
    elif isinstance(node, (ast.ListComp, ast.GeneratorExp)):
        for loop in node.generators:
            yield from _unasked(loop.iter, known)
            for test in loop.ifs:
                yield from _unasked(test, known)
                known |= _asked(test, True)
        yield from _unasked(node.elt, known)
    elif _question(node) is None:
        for child in ast.iter_child_nodes(node):
            yield from _unasked(child, known)


def _asked(node: ast.expr, outcome: bool) -> frozenset[str]:
    """Return the values that are known when a condition has this `outcome`."""
    asked = _question(node)
    if asked is not None:
        return frozenset(_unasked(asked, frozenset())) if outcome else frozenset()
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return _asked(node.operand, not outcome)
    if isinstance(node, ast.BoolOp):
        found = [_asked(value, outcome) for value in node.values]
        if isinstance(node.op, ast.And) is outcome:
            return frozenset().union(*found)
        return frozenset.intersection(*found)
    return frozenset()


def _question(node: ast.AST) -> ast.expr | None:
    """Return the argument of `known(...)`; None where the node is no such call."""
    if isinstance(node, ast.Call) and _is_called(node, "known") and node.args:
        return node.args[0]
    return None


def _is_called(node: ast.Call, name: str) -> bool:
    return isinstance(node.func, ast.Name) and node.func.id == name


def _unknown(node: ast.AST) -> str:
    """Return the possibly unknown value that a node reads; '' when there is none."""
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "input":
        return f"input.{node.attr}"
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
        return ast.unparse(node) if isinstance(node.slice.value, str) else ""
    if isinstance(node, ast.Attribute) and ast.unparse(node) == ERROR_RESULT:
        return ERROR_RESULT
    return ast.unparse(node) if isinstance(node, ast.Call) and _is_called(node, "find") else ""


def may_ask(source: str) -> bool:
    """Say, by its text, whether an expression may read a possibly unknown value."""
    return any(mark in source for mark in ("input.", "find(", ERROR_RESULT, "['", '["'))
