"""Static analysis of conditions: mutual exclusion, implication, totality and constants.

A condition is brought to a normal form: `Every` and `Some` of facts, where a fact gives the possible values
of one operand (`error.code` is 'late'; `charge.value` lies below 0.2). Everything is decided by
satisfiability of conditions together, conservatively: a part that is not understood may hold, and so may
everything beyond a budget. Operands are compared by their text, so `a.b` is the same operand wherever it
stands within one transition list, which is where conditions are compared.

Types are unknown here: a text that is a quantity ('5 s') counts as the number it stands for.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from lupin_engine.chart.expressions.names import tree_of
from lupin_engine.plugin.types import parse_quantity

#: So many alternatives are looked at before conditions are taken to be possible together.
MAX_ALTERNATIVES = 500

_CACHED = 4096
_WORDS = {"true": True, "false": False}
_OPPOSITE: Mapping[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
_MIRRORED: Mapping[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.Gt,
    ast.Gt: ast.Lt,
    ast.LtE: ast.GtE,
    ast.GtE: ast.LtE,
}
#: How two operands stand to each other when a comparison of them holds.
_RELATIONS: Mapping[type[ast.cmpop], frozenset[str]] = {
    ast.Eq: frozenset("="),
    ast.NotEq: frozenset("<>"),
    ast.Lt: frozenset("<"),
    ast.LtE: frozenset("<="),
    ast.Gt: frozenset(">"),
    ast.GtE: frozenset(">="),
}


@dataclass(frozen=True)
class ValueSet:
    """A set of values: those `allowed` (None: any) that are not `excluded` and lie between the bounds."""

    allowed: frozenset[Any] | None = None
    excluded: frozenset[Any] = frozenset()
    low: float = -math.inf
    low_open: bool = False
    high: float = math.inf
    high_open: bool = False

    def holds(self, value: Any) -> bool:
        """Say whether `value` is in the set."""
        if value in self.excluded or (self.allowed is not None and value not in self.allowed):
            return False
        if self.low == -math.inf and self.high == math.inf:
            return True
        if not isinstance(value, (int, float)):
            return False
        above = value > self.low or (value == self.low and not self.low_open)
        return above and (value < self.high or (value == self.high and not self.high_open))

    def meets(self, other: ValueSet) -> ValueSet | None:
        """Return the intersection; None when it is empty."""
        if self.allowed is not None and other.allowed is not None and self.allowed.isdisjoint(other.allowed):
            return None
        low, low_open = max((self.low, self.low_open), (other.low, other.low_open))
        high, closed = min((self.high, not self.high_open), (other.high, not other.high_open))
        both = ValueSet(None, self.excluded | other.excluded, low, low_open, high, high_open=not closed)
        sets = [found.allowed for found in (self, other) if found.allowed is not None]
        if sets:
            allowed = frozenset(value for value in frozenset.intersection(*sets) if both.holds(value))
            return replace(both, allowed=allowed) if allowed else None
        if low > high or (low == high and not both.holds(low)):
            return None
        return both


@dataclass(frozen=True)
class Fact:
    """One operand, as it is written, has one of these values."""

    operand: str
    values: ValueSet


@dataclass(frozen=True)
class Every:
    """All parts hold; without parts this is true."""

    parts: tuple[Formula, ...] = ()


@dataclass(frozen=True)
class Some:
    """One of the parts holds; without parts this is false."""

    parts: tuple[Formula, ...] = ()


Formula = Fact | Every | Some

TRUE, FALSE = Every(), Some()


def fact(operand: str, value: Any) -> Fact:
    """Return the condition that an operand has a value."""
    return Fact(operand, ValueSet(frozenset([value])))


def possible(*conditions: Formula) -> bool:
    """Say whether conditions may hold together; False is certain, True is not."""
    if len(conditions) == 2:  # most are simple comparisons, and many pairs are asked for
        first, second = conditions
        if isinstance(first, Fact) and isinstance(second, Fact):
            return first.operand != second.operand or first.values.meets(second.values) is not None
    budget = [MAX_ALTERNATIVES]
    return _possible(list(conditions), {}, budget)


def _possible(waiting: list[Formula], known: Mapping[str, ValueSet], budget: list[int]) -> bool:
    """Search one way in which all waiting conditions hold, given the known facts of the operands."""
    budget[0] -= 1
    if budget[0] < 0:
        return True
    later, found = [], dict(known)
    while waiting:
        condition = waiting.pop()
        if isinstance(condition, Every):
            waiting.extend(condition.parts)
        elif isinstance(condition, Some):
            later.append(condition)
        else:
            values = condition.values.meets(found.get(condition.operand, ValueSet()))
            if values is None:
                return False
            found[condition.operand] = values
    if not later:
        return True
    choice, *rest = later
    return any(_possible([part, *rest], found, budget) for part in choice.parts)


def exclusive(first: Formula, second: Formula) -> bool:
    """Say whether two conditions can never hold at the same time."""
    return not possible(first, second)


def implies(first: Formula, second: Formula) -> bool:
    """Say whether the second condition certainly holds when the first does."""
    return not possible(first, negate(second))


def total(conditions: Sequence[Formula], *given: Formula) -> bool:
    """Say whether one of the conditions certainly holds whenever all of `given` do."""
    return not possible(*given, *(negate(condition) for condition in conditions))


def negate(condition: Formula) -> Formula:
    """Return the condition that holds when this one does not."""
    if isinstance(condition, Every):
        return Some(tuple(negate(part) for part in condition.parts))
    if isinstance(condition, Some):
        return Every(tuple(negate(part) for part in condition.parts))
    return Fact(condition.operand, _complement(condition.values))


def _complement(values: ValueSet) -> ValueSet:
    """Return the other values; a fact is one comparison, so only one of the limits is set."""
    if values.allowed is not None:
        if values.allowed <= {True, False} and all(isinstance(v, bool) for v in values.allowed):
            return ValueSet(frozenset([True, False]) - values.allowed)
        if values.allowed <= frozenset("<=>"):
            return ValueSet(frozenset("<=>") - values.allowed)
        return ValueSet(excluded=values.allowed)
    if values.excluded:
        return ValueSet(values.excluded)
    if values.high < math.inf:
        return ValueSet(low=values.high, low_open=not values.high_open)
    return ValueSet(high=values.low, high_open=not values.low_open)


# -- reading an expression --------------------------------------------------------------------------------


@lru_cache(_CACHED)
def formula_of(source: str) -> Formula:
    """Return the normal form of a condition."""
    tree = tree_of(source)
    return _opaque(source, True) if tree is None else _condition(tree, True)


def _opaque(operand: str, wanted: bool) -> Formula:
    return Fact(operand, ValueSet(frozenset([wanted])))


def _condition(node: ast.expr, wanted: bool) -> Formula:
    """Return the condition that an expression is true (or false, when that is `wanted`)."""
    if isinstance(node, ast.BoolOp):
        parts = tuple(_condition(value, wanted) for value in node.values)
        return Every(parts) if isinstance(node.op, ast.And) is wanted else Some(parts)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return _condition(node.operand, not wanted)
    if isinstance(node, ast.Compare):
        return _comparisons(node, wanted)
    value = _constant(node)
    if isinstance(value, bool):
        return TRUE if value is wanted else FALSE
    return _opaque(ast.unparse(node), wanted)


def _comparisons(node: ast.Compare, wanted: bool) -> Formula:
    lefts = [node.left, *node.comparators]
    pairs = zip(lefts, node.ops, node.comparators, strict=False)
    parts = tuple(_comparison(left, type(op), right, wanted) for left, op, right in pairs)
    if len(parts) == 1:
        return parts[0]
    return Every(parts) if wanted else Some(parts)


def _comparison(left: ast.expr, op: type[ast.cmpop], right: ast.expr, wanted: bool) -> Formula:
    if op not in _OPPOSITE:
        return _opaque(ast.unparse(ast.Compare(left, [op()], [right])), wanted)
    op = op if wanted else _OPPOSITE[op]
    if op in (ast.In, ast.NotIn):
        return _membership(left, right, op is ast.In)
    first, second = _constant(left), _constant(right)
    if second is None and first is not None:
        left, right, first, second = right, left, second, first
        op = _MIRRORED.get(op, op)
    if second is None or (isinstance(second, str) and first is None and op not in (ast.Eq, ast.NotEq)):
        return _relation(ast.unparse(left), op, ast.unparse(right))  # also to a date or time of day
    values = _compared(op, second)
    if first is not None:
        return TRUE if values.holds(first) else FALSE
    return Fact(ast.unparse(left), values)


def _relation(left: str, op: type[ast.cmpop], right: str) -> Formula:
    """Return a comparison of two operands; written either way round, it is the same fact."""
    if left > right:
        left, right, op = right, left, _MIRRORED.get(op, op)
    return Fact(f"{left} ? {right}", ValueSet(_RELATIONS[op]))


def _membership(left: ast.expr, right: ast.expr, wanted: bool) -> Formula:
    items = right.elts if isinstance(right, (ast.List, ast.Tuple)) else None
    values = None if items is None else [_constant(item) for item in items]
    if values is None or None in values:
        return _opaque(f"{ast.unparse(left)} in {ast.unparse(right)}", wanted)
    among = frozenset(values)
    first = _constant(left)
    if first is not None:
        return TRUE if (first in among) is wanted else FALSE
    if not among:
        return FALSE if wanted else TRUE
    return Fact(ast.unparse(left), ValueSet(among) if wanted else ValueSet(excluded=among))


def _compared(op: type[ast.cmpop], value: Any) -> ValueSet:
    """Return the values that stand in this relation to a constant."""
    if op in (ast.Eq, ast.NotEq):
        if isinstance(value, bool):
            return ValueSet(frozenset([value if op is ast.Eq else not value]))
        among = frozenset([value])
        return ValueSet(among) if op is ast.Eq else ValueSet(excluded=among)
    if not isinstance(value, (int, float)):
        return ValueSet()
    if op in (ast.Lt, ast.LtE):
        return ValueSet(high=value, high_open=op is ast.Lt)
    return ValueSet(low=value, low_open=op is ast.Gt)


def _constant(node: ast.expr) -> Any:
    """Return the value that is written, in its base unit; None when it is read or computed."""
    if isinstance(node, ast.Name):
        return _WORDS.get(node.id)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        value = _constant(node.operand)
        return -value if isinstance(value, (int, float)) else None
    if not isinstance(node, ast.Constant):
        return None
    if isinstance(node.value, str):
        quantity = parse_quantity(node.value)
        return node.value if quantity is None else quantity[0]
    return node.value


# -- constants --------------------------------------------------------------------------------------------

_TEXTS = re.compile(r"'[^']*'|\"[^\"]*\"")
_JOINTS = re.compile(r"\b(?:and|or|not)\b|[()]")
_CONSTANTS = frozenset({"true", "false", "True", "False"})
_NAMES = re.compile(r"[A-Za-z_][\w.]*")


@lru_cache(_CACHED)
def constant(source: str) -> bool | None:
    """Return the value of a constant condition; None for one that depends on something.

    Most conditions read every operand once and compare it: those are recognized by their words alone, without
    parsing them.
    """
    pieces = [_NAMES.findall(piece) for piece in _JOINTS.split(_TEXTS.sub("0", source)) if piece.strip()]
    names = [name for piece in pieces for name in piece]
    plain = all(pieces) and len(set(names)) == len(names) and _CONSTANTS.isdisjoint(names)
    if plain and "[]" not in source and "()" not in source:
        return None
    condition = formula_of(source)
    if not possible(condition):
        return False
    return None if possible(negate(condition)) else True
