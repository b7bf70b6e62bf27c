"""Splits what breaks a property into alternatives: lists of clauses, all of which are true at a breach."""

from __future__ import annotations

import ast
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from lupin_engine.chart.expressions.evaluation import Compiled, Environment, to_function
from lupin_engine.chart.model import TemporalProperty


@dataclass(frozen=True)
class Clause:
    """A part of a condition, as checked code; of a `negated` one the contrary breaks the property."""

    node: ast.expr
    negated: bool

    @cached_property
    def code(self) -> str:
        """Its code."""
        return ast.unparse(self.node)

    @cached_property
    def evaluate(self) -> Callable[[Environment], Any]:
        """Its function of the environment."""
        return to_function(self.code)

    def is_true(self, env: Environment) -> bool:
        """Return whether it speaks for a breach.

        Raises:
            Exception: whatever its evaluation raises.
        """
        return bool(self.evaluate(env)) is not self.negated


def breaches(rule: TemporalProperty) -> list[list[Clause]]:
    """Return the alternatives of an `always` or a `never`; none where the condition is no checked code."""
    that = rule.never if rule.never is not None else rule.always
    if that is None or not isinstance(that.evaluate, Compiled):
        return []
    return _alternatives(ast.parse(that.evaluate.code, mode="eval").body, rule.never is None)


def _alternatives(node: ast.expr, negated: bool) -> list[list[Clause]]:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return _alternatives(node.operand, not negated)
    if not isinstance(node, ast.BoolOp):
        return [[Clause(node, negated)]]
    inner = [_alternatives(each, negated) for each in node.values]
    if isinstance(node.op, ast.Or) is not negated:
        return [one for each in inner for one in each]
    # What has alternatives of its own inside is one clause here.
    flat = (
        each[0] if len(each) == 1 else [Clause(value, negated)]
        for value, each in zip(node.values, inner, strict=True)
    )
    return [[clause for clauses in flat for clause in clauses]]
