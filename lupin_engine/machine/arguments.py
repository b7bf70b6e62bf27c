"""What an invoke or an action hands over, worked out and held against what the catalog declares."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lupin_engine.chart.expressions.evaluation import Environment, Expression, Value
from lupin_engine.plugin.contract import Argument
from lupin_engine.plugin.types import Notation, problems


def evaluated(
    values: Mapping[str, Value], declared: Mapping[str, Argument], env: Environment
) -> dict[str, Any]:
    """Return the arguments as they are now.

    Kinds and units were checked at load, and so was the range of what is written out; the range of what is
    worked out is known only here. Without this look a plugin would get what its catalog rules out, on the
    robot and not in the simulation, whose mocks do not look.

    Raises:
        ValueError: one is outside its range, or not finite; the text begins with its name.
        Exception: an expression fails.
    """
    arguments = {name: value.evaluate(env) for name, value in values.items()}
    for name, argument in declared.items():
        if isinstance(values.get(name), Expression):
            found = problems(arguments[name], argument.type, Notation.DATA)
            if found:
                raise ValueError(found[0].at(name))
    return arguments
