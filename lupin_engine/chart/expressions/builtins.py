"""The built-in functions of expressions: each checks a call, and returns its type and code.

A call with mistakes is `UNTYPED` after findings. Those that loop over a list are in `loops`.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping

from lupin_engine.chart.expressions import loops
from lupin_engine.chart.expressions import units as q
from lupin_engine.chart.expressions.reader import (
    UNTYPED,
    ExpressionReader,
    calculable,
    dotted,
    environment_code,
    listed,
    orderable,
)
from lupin_engine.chart.expressions.scope import ERROR_RESULT, Typed
from lupin_engine.errors import meant, nearest
from lupin_engine.plugin.types import ANY, BOOL, COUNT, Type, list_of


def _len(checker: ExpressionReader, node: ast.Call) -> Typed:
    """`len(LIST)` or `len(TEXT)`: the number of elements or letters."""
    if not checker.arity(node, "len", 1):
        return UNTYPED
    argument = checker.visit(node.args[0])
    if argument.type.kind not in ("list", "text", "any"):
        problem = f"{checker.text_of(node.args[0])!r} is {q.describe(argument.type)}, which has no length"
        return checker.wrong(node.args[0], "wrong-type", problem, "expected a list or a text")
    return Typed(COUNT, f"len({argument.code})")


def _extreme(checker: ExpressionReader, node: ast.Call) -> Typed:
    """`min` and `max` of a list, or of several numbers in one unit; of an empty list an error at run time."""
    name = dotted(node.func) or ""
    if not node.args:
        return checker.wrong(node, "missing-argument", f"{name} takes a list of numbers, or several numbers")
    found = [checker.visit(argument) for argument in node.args]
    kinds = [typed.type for typed in found]
    if len(found) == 1:
        if kinds[0].kind not in ("list", "any"):
            return checker.wrong(node.args[0], "wrong-type", f"{name} of one value needs a list")
        kinds = [kinds[0].item or ANY]
    joined: Type | None = kinds[0]
    for argument, kind in zip(node.args, kinds, strict=True):
        if not orderable(kind):
            return checker.no_number(argument, kind)
        joined = q.join(joined, kind) if joined is not None else None
        if joined is None:
            problem = f"cannot compare {q.describe(kinds[0])} with {q.describe(kind)}"
            return checker.wrong(argument, "wrong-unit", problem, q.unit_hint(kinds[0], kind))
    return Typed(joined or ANY, f"{name}({listed(map(checker.looked_at, found))})")


def _abs(checker: ExpressionReader, node: ast.Call) -> Typed:
    if not checker.arity(node, "abs", 1):
        return UNTYPED
    argument = calculable(checker.visit(node.args[0]))
    if not q.is_number(argument.type) and argument.type is not q.WIRE:
        return checker.no_number(node.args[0], argument.type)
    return Typed(argument.type, f"abs({argument.code})")


def _round(checker: ExpressionReader, node: ast.Call) -> Typed:
    """`round(NUMBER)`, a whole number, or `round(NUMBER, DIGITS)` with 0 to 9 digits, written out."""
    if len(node.args) not in (1, 2):
        checker.arity(node, "round", 1)
        return UNTYPED
    argument = calculable(checker.visit(node.args[0]))
    if not q.is_number(argument.type) and argument.type is not q.WIRE:
        return checker.no_number(node.args[0], argument.type)
    code = argument.code
    if len(node.args) == 2:
        digits = node.args[1]
        value = digits.value if isinstance(digits, ast.Constant) else None
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= 9:
            return checker.wrong(digits, "wrong-type", "the digits of round must be written out, 0 to 9")
        code = f"{code}, {value}"
    unit = "" if argument.type.unit == "*" else argument.type.unit
    return Typed(q.whole(unit) if len(node.args) == 1 else argument.type, f"round({code})")


def _quantifier(checker: ExpressionReader, node: ast.Call) -> Typed:
    """`any` and `all` of a list of booleans."""
    name = dotted(node.func) or ""
    if not checker.arity(node, name, 1):
        return UNTYPED
    argument = checker.looked_at(checker.wanted(node.args[0], list_of(BOOL)))
    return Typed(BOOL, f"{name}({argument.code})")


def _known(checker: ExpressionReader, node: ast.Call) -> Typed:
    """`known(VALUE)`: whether a live value or another value that may be missing is there."""
    if not checker.arity(node, "known", 1):
        return UNTYPED
    argument, before = node.args[0], checker.unknowns
    typed = checker.visit(argument)
    if isinstance(argument, ast.Attribute) and dotted(argument.value) == "input":
        return Typed(BOOL, f"{environment_code('known')}({argument.attr!r})")
    if checker.unknowns == before and not checker.failed and dotted(argument) != ERROR_RESULT:
        hint = "write known(input.NAME) or known(find(...))"
        return checker.wrong(argument, "wrong-type", "known asks about what may be missing", hint)
    return Typed(BOOL, f"_known(lambda: {typed.code})")


def _held(checker: ExpressionReader, node: ast.Call) -> Typed:
    """`held(NAME)`: whether a hold is engaged."""
    name = _word(checker, node, "held", "a hold")
    if name is None:
        return UNTYPED
    if name not in checker.scope.holds:
        hint = nearest(name, checker.scope.holds)
        return checker.wrong(node.args[0], "unknown-hold", f"unknown hold {name!r}", hint)
    return Typed(BOOL, f"{environment_code('held')}({name!r})")


def _in_state(checker: ExpressionReader, node: ast.Call) -> Typed:
    """`in_state(NAME)`: whether a state is active, named by the end of its full name."""
    states = _states(checker, node, "in_state")
    return UNTYPED if states is None else Typed(BOOL, f"{environment_code('in_state')}({states!r})")


def _was_in_state(checker: ExpressionReader, node: ast.Call) -> Typed:
    """`was_in_state(NAME)`: whether a state was active before the step; in properties only."""
    if "this_step" not in checker.scope.names:
        return checker.wrong(node, "unknown-name", "only a property asks what was active before a step")
    states = _states(checker, node, "was_in_state")
    return (
        UNTYPED if states is None else Typed(BOOL, f"{environment_code('this_step')}['was_in']({states!r})")
    )


def _states(checker: ExpressionReader, node: ast.Call, function: str) -> tuple[str, ...] | None:
    """Return the full names of the states that the argument names, () of an unknown one (see `_no_state`).

    None after a finding that it is no name.
    """
    name = _word(checker, node, function, "a state")
    if name is None:
        return None
    states = [state for state in checker.scope.states if state == name or state.endswith(f".{name}")]
    if not states:
        _no_state(checker, node.args[0], name)
    return tuple(states)


def _no_state(checker: ExpressionReader, node: ast.expr, name: str) -> None:
    """Report an unknown state: an error; where missions may be missing, a warning if one is similar."""
    problem = f"no state is called {name!r}"
    known = {word for state in checker.scope.states for word in state.split(".")}
    if not checker.scope.open_states:
        checker.wrong(node, "unknown-state", problem, nearest(name, known))
        return
    guess = meant(name, known)
    if not guess:
        return  # the lifecycle may speak of missions that are not loaded
    place = checker.fragment.text.at(checker.start + checker.offset(node))
    problem += " in the missions that are loaded, so this is false"
    checker.warned = True
    checker.findings.warn(place, "unknown-state", checker.path, problem, guess)


def _word(checker: ExpressionReader, node: ast.Call, function: str, what: str) -> str | None:
    """Return the single argument, which must be a word that is written out, quoted or not.

    None after a finding: there is not one argument, or it is no word.
    """
    if not checker.arity(node, function, 1):
        return None
    argument = node.args[0]
    if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
        return argument.value
    name = dotted(argument)
    if name is None:
        checker.wrong(
            argument, "wrong-type", f"{function} takes the name of {what}", f"write {function}('NAME')"
        )
    return name


#: By name, what checks a call; the names are `scope.BUILTIN_CALLS`.
BUILTINS: Mapping[str, Callable[[ExpressionReader, ast.Call], Typed]] = {
    "len": _len,
    "min": _extreme,
    "max": _extreme,
    "sum": loops.total,
    "abs": _abs,
    "round": _round,
    "any": _quantifier,
    "all": _quantifier,
    "first": loops.first,
    "find": loops.find,
    "sorted": loops.in_order,
    "known": _known,
    "held": _held,
    "in_state": _in_state,
    "was_in_state": _was_in_state,
}
