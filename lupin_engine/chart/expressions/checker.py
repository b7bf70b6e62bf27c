"""Expressions: a typed, side-effect-free subset of Python, checked at load and compiled once.

Allowed are and/or/not, comparisons (also `in`), + - * / // %, unary minus, `x if c else y`, indexing of
lists, fields of declared records, lists and tuples, `[... for NAME in LIST if ...]`, numbers and texts, and
calls of the functions in `builtins` and in the catalog. Everything else is refused: above all method calls,
names with a leading underscore, `**`, shifts, nested loops, lambdas and formatted texts. Arithmetic takes
numbers only, so no text or list can be multiplied; a product of integers is bounded when it is computed. The
cost of an expression is bounded by the largest size of each list, and refused above a limit. There is thus no
way to reach an object's attributes, or to use much time or memory.

Units are part of a number's type. A text that is a quantity ('5 s') counts as a number where it meets one
with a unit, and a written 0 has any unit. The environment has every number in its base unit; a name whose
type has another one, as in a binding, is read in that. Every mistake is reported at its column in the file.

Checking translates the expression (`a.b` becomes `a["b"]`, names become look-ups in the environment). It is
compiled by Python, without builtins, at its first evaluation, so an expression costs as much as the same
Python, and unused ones in a large chart are never compiled.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Mapping
from typing import Any

from lupin_engine.chart.expressions import units as q
from lupin_engine.chart.expressions.builtins import BUILTINS
from lupin_engine.chart.expressions.evaluation import Compiled, Expression, to_function
from lupin_engine.chart.expressions.loops import by_name, called, comprehension, holding
from lupin_engine.chart.expressions.names import renamed
from lupin_engine.chart.expressions.reader import (
    MAX_STEPS,
    UNTYPED,
    ExpressionReader,
    as_quantity,
    calculable,
    conditional_code,
    counted,
    dotted,
    environment_code,
    indent_of,
    listed,
    orderable,
)
from lupin_engine.chart.expressions.scope import (
    BUILTIN_CALLS,
    ROOTS,
    TRUTHS,
    CheckedExpression,
    Choice,
    Fragment,
    Scope,
    Typed,
)
from lupin_engine.chart.findings import Findings
from lupin_engine.errors import declared_as, nearest, or_else
from lupin_engine.plugin.builtin import TIME_ZONE
from lupin_engine.plugin.contract import Function
from lupin_engine.plugin.types import (
    ANY,
    BOOL,
    COUNT,
    INTEGER,
    MAX_INTEGER,
    NUMBER,
    TEXT,
    UNITS,
    Type,
    beyond,
    innermost,
    is_moment,
    list_of,
    parse_quantity,
)

#: How long the code of an expression may be in which values stand that a part was given.
MAX_CODE = 100_000

_OPERATORS: Mapping[type[ast.operator], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.FloorDiv: "//",
    ast.Mod: "%",
}
#: What computes with care, for numbers grow fast there.
_BOUNDED: Mapping[str, str] = {"*": "_times", "/": "_over"}
_COMPARISONS: Mapping[type[ast.cmpop], str] = {
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.In: "in",
    ast.NotIn: "not in",
}
_PARAMETER = re.compile(r"\bparam\.(\w+)")
_ORDERINGS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)


def compile_expression(
    fragment: Fragment, scope: Scope, wanted: Type, findings: Findings, path: str
) -> Expression | None:
    """Check an expression that must be of type `wanted`; None after findings.

    The result reads an environment as `chart.model` describes. It raises `UnknownInput`, ZeroDivisionError,
    IndexError (also of an empty list's smallest element), OverflowError or the exception of a plugin's
    function; after reading a value of type `any` also KeyError and TypeError, where that has another shape.
    """
    source = fragment.source.strip()
    key = (source, id(wanted))  # what is kept under it keeps the type alive; to hash a type takes longer
    checked = scope.compiled.get(key)
    if checked is None:
        checker = _Checker(fragment, scope, findings, path)
        typed = checker.check(wanted)
        if typed is None:
            return None
        parts = tuple([(renamed(text, scope.out), Compiled(part.code)) for text, part in checker.parts])
        checked = CheckedExpression(wanted, typed.type, Compiled(typed.code), parts)
        if not checker.warned:
            scope.compiled[key] = checked
    place = fragment.text.at(fragment.offset + indent_of(fragment.source))
    return Expression(renamed(source, scope.out), place, checked.type, checked.evaluate, checked.parts)


def check_expression(
    fragment: Fragment, scope: Scope, wanted: Type, findings: Findings, path: str
) -> Typed | None:
    """Check an expression without compiling it, for one that is built into others; None after findings."""
    return _Checker(fragment, scope, findings, path).check(wanted)


class _Checker(ExpressionReader):
    """Checks and rewrites one expression; after a mistake it continues with a type that fits everywhere."""

    def __init__(self, fragment: Fragment, scope: Scope, findings: Findings, path: str) -> None:
        super().__init__(fragment, scope, findings, path)
        self._grown = False
        self._operands: list[tuple[ast.expr, Typed]] = []
        self.parts: list[tuple[str, Typed]] = []

    def check(self, wanted: Type) -> Typed | None:
        """Return type and code, or None after findings."""
        root = self.parse()
        if root is None:
            self._note_parameters()
            return None
        found = as_quantity(self.visit(root), wanted)
        if not self.failed and not q.accepts(wanted, found.type):
            self.mismatch(root, wanted, found.type)
        if self._grown and not self.failed and not _can_be_compiled(found.code):
            self.stop(0, "the expression is too large with the values that stand for its parameters")
        if self.steps > MAX_STEPS and not self.failed:
            problem = f"the expression may take {self.steps} steps, at most {MAX_STEPS} are allowed"
            self.wrong(root, "unbounded", problem, "go through fewer lists, or say the 'max' of one")
        if self.failed:
            self._note_parameters()
            return None
        self._note_parts(root)
        return found

    def _note_parameters(self) -> None:
        """Note the parameters that a refused expression names: perhaps not all of it was read."""
        self.scope.usage.parameters.update(_PARAMETER.findall(self.fragment.source))

    def _note_parts(self, root: ast.expr) -> None:
        """Record the operands of the outermost and/or/not, which explain a false guard."""
        if isinstance(root, ast.BoolOp) or (isinstance(root, ast.UnaryOp) and isinstance(root.op, ast.Not)):
            self.parts = [(self.text_of(node), typed) for node, typed in self._operands]

    # -- nodes ---------------------------------------------------------------------------------------------

    def visit(self, node: ast.expr) -> Typed:
        """Return the type and code of a node; `UNTYPED` after findings."""
        visit = _VISITORS.get(type(node))
        if visit is None:
            return self.refuse(node, type(node).__name__)
        self.steps += self.times
        return visit(self, node)

    def _constant(self, node: ast.Constant) -> Typed:
        value = node.value
        if isinstance(value, bool):
            return Typed(BOOL, repr(value))
        if isinstance(value, str):
            quantity = parse_quantity(value)
            allowed = beyond(quantity[0], q.number(quantity[1])) if quantity is not None else ""
            if allowed:
                problem = f"expected a duration {allowed}, got {value!r}"
                return self.wrong(node, "wrong-type", problem)
            return Typed(TEXT, repr(value), value)
        if isinstance(value, int) and abs(value) <= MAX_INTEGER:
            return Typed(q.ZERO if value == 0 else COUNT, repr(value))
        if isinstance(value, float) and math.isfinite(value):
            return Typed(q.ZERO_NUMBER if value == 0 else NUMBER, repr(value))
        hint = "use known(input.NAME) to ask for what may be missing" if value is None else ""
        return self.wrong(
            node, "bad-expression", f"{self.text_of(node)} is not allowed in an expression", hint
        )

    def _name(self, node: ast.Name) -> Typed:
        name, scope = node.id, self.scope
        if name in TRUTHS:
            return Typed(BOOL, repr(TRUTHS[name]))
        if name in self.element:
            return self.element[name]
        if name.startswith("_"):
            return self.wrong(
                node, "unknown-name", f"unknown name {name!r}: no name begins with an underscore"
            )
        if name in scope.names:
            if name == "request" and scope.within:
                return Typed(scope.names[name], f"{environment_code('given')}[{scope.within!r}]")
            if name in ROOTS:
                return Typed(scope.names[name], environment_code(name))
            variable = f"{environment_code('context')}[{scope.out.get(name, name)!r}]"
            code = environment_code("item") if name == scope.item else variable
            return _in_its_unit(scope.names[name], code)
        if name in scope.absent:
            rule, reason = scope.absent[name]
            return self.wrong(node, rule, f"there is no {name!r} here: {reason}")
        if name in BUILTIN_CALLS or name in scope.functions:
            return self.wrong(node, "wrong-type", f"{name!r} is a function", f"call it: {name}(...)")
        return self.wrong(node, "unknown-name", f"unknown name {name!r}", self._instead_of(name))

    def _instead_of(self, name: str) -> str:
        """Return a hint for an unknown name: a name, a field of a record, a variable to declare."""
        names = self.scope.names
        roots = {root: kind for root, kind in names.items() if root in ROOTS}
        field = next(called(name, roots), None)
        hint = f"did you mean {field!r}?" if field else nearest(name, names)
        return or_else(hint, declared_as("context", name)) if self.scope.has_context else hint

    def _attribute(self, node: ast.Attribute) -> Typed:
        if not isinstance(node.value, ast.Name) or node.value.id in self.element:
            return self._field(node)
        key = (node.value.id, node.attr)
        known = self.scope.read_names.get(key)
        if known is None:
            known = self._field(node)
            if not self.failed and not self._grown:
                self.scope.read_names[key] = known
        return known

    def _field(self, node: ast.Attribute) -> Typed:
        if node.attr.startswith("_"):
            problem = f"unknown name {node.attr!r}: no name begins with an underscore"
            self.wrong_at(self._attribute_offset(node), "unknown-name", problem)
            return UNTYPED
        root = node.value.id if isinstance(node.value, ast.Name) else ""
        if root == "param" and node.attr in self.scope.bound:
            self.scope.usage.parameters.add(node.attr)
            self._grown = True
            return self.scope.bound[node.attr]
        record = self.visit(node.value)
        code = f"{record.code}[{node.attr!r}]"
        if record.type.kind == "any":
            return Typed(record.type, code)
        if record.type.kind != "record":
            return self._wrong_field(
                node, f"{self.text_of(node.value)!r} is {q.describe(record.type)}, no record"
            )
        if node.attr not in record.type.fields:
            return self._unknown_field(node, record.type, root)
        self._note(root, node.attr)
        return _in_its_unit(record.type.fields[node.attr], code)

    def _note(self, root: str, name: str) -> None:
        if root == "param":
            self.scope.usage.parameters.add(name)
        elif root == "input":
            self.scope.usage.inputs.add(name)
        elif root == "clock":
            self.scope.usage.parameters.add(TIME_ZONE)

    def _unknown_field(self, node: ast.Attribute, record: Type, root: str) -> Typed:
        if root == "param":
            problem = f"unknown parameter {node.attr!r}"
            self.wrong_at(
                self._attribute_offset(node), "unknown-parameter", problem, nearest(node.attr, record.fields)
            )
            return UNTYPED
        where = self.text_of(node.value)
        if not record.fields:
            return self._wrong_field(node, f"{where!r} has no fields to read")
        return self._wrong_field(node, f"{where!r} has no {node.attr!r}", nearest(node.attr, record.fields))

    def _wrong_field(self, node: ast.Attribute, problem: str, hint: str = "") -> Typed:
        self.wrong_at(self._attribute_offset(node), "unknown-name", problem, hint)
        return UNTYPED

    def _attribute_offset(self, node: ast.Attribute) -> int:
        return self.characters(node.end_col_offset or 0) - len(node.attr)

    def _subscript(self, node: ast.Subscript) -> Typed:
        if isinstance(node.slice, ast.Slice):
            return self.refuse(node, "Slice")
        value, index = self.visit(node.value), self.visit(node.slice)
        if self.failed and value.type.kind == "any":
            return UNTYPED  # what is indexed has been told to be wrong already
        named = q.named_in(value.type)
        if named is not None and index.type.kind == "text":
            return self._by_name(node, value, index, *named)
        shown = self.text_of(node.value)
        if value.type.kind not in ("list", "any"):
            problem = f"{shown!r} is {q.describe(value.type)}, only a list can be indexed"
            return self.wrong(node.value, "wrong-type", problem, by_name(shown, value.type, index))
        if not q.accepts(INTEGER, index.type):
            hint = by_name(shown, value.type, index)
            if hint:
                problem = f"{shown!r} is {q.describe(value.type)}, which is indexed by a number"
                return self.wrong(node.slice, "wrong-type", problem, hint)
            self.mismatch(node.slice, INTEGER, index.type)
        item = value.type if value.type.kind == "any" else value.type.item
        return Typed(item or ANY, f"{value.code}[{index.code}]")

    def _by_name(self, node: ast.Subscript, value: Typed, index: Typed, field: str, kind: Type) -> Typed:
        """`values['NAME']`: the value of that name in a list of records, unknown when it is missing."""
        name = index.written
        if not isinstance(name, str):
            return self.wrong(node.slice, "wrong-type", "a name must be written out, in quotes")
        if name not in kind.named:
            problem = f"{self.text_of(node.value)!r} tells no {name!r}"
            return self.wrong(node.slice, "unknown-name", problem, nearest(name, kind.named))
        self.unknowns += 1
        found, within = kind.named[name], f"[{field!r}]" if field else ""
        code = f"_named({value.code}{within}, {name!r}, {self.text_of(node)!r})"
        if found.unit in UNITS and UNITS[found.unit][0] != found.unit:
            return Typed(q.number(UNITS[found.unit][0]), f"_in_base({code}, {found.unit!r})")
        return Typed(found, code)

    def _sequence(self, node: ast.List | ast.Tuple) -> Typed:
        found = [self.visit(element) for element in node.elts]
        item = found[0].type if found else ANY
        for element, typed in zip(node.elts[1:], found[1:], strict=True):
            joined = q.join(item, typed.type)
            if joined is None:
                kinds = f"the first is {q.describe(item)}, this is {q.describe(typed.type)}"
                problem = f"a list holds one type: {kinds}"
                return self.wrong(element, "wrong-type", problem)
            item = joined
        return Typed(holding(list_of(item), len(found)), f"[{listed(found)}]")

    def _bool_operation(self, node: ast.BoolOp) -> Typed:
        operands = [(operand, self.wanted(operand, BOOL)) for operand in node.values]
        self._operands = operands  # those of the outermost come last
        sign = " and " if isinstance(node.op, ast.And) else " or "
        return Typed(BOOL, f"({sign.join([typed.code for _, typed in operands])})")

    def _unary(self, node: ast.UnaryOp) -> Typed:
        if isinstance(node.op, ast.Not):
            operand = self.wanted(node.operand, BOOL)
            self._operands = [(node.operand, operand)]
            return Typed(BOOL, f"(not {operand.code})")
        if not isinstance(node.op, ast.USub):
            return self.refuse(node, type(node.op).__name__)
        operand = calculable(self.visit(node.operand))
        if operand.type is q.WIRE:
            return Typed(q.WIRE, f"(-{operand.code})")
        if not q.is_number(operand.type):
            return self.no_number(node.operand, operand.type)
        kind = INTEGER if operand.type.kind == "integer" and not operand.type.unit else q.plain(operand.type)
        return Typed(kind, f"(-{operand.code})")

    def _binary(self, node: ast.BinOp) -> Typed:
        sign = _OPERATORS.get(type(node.op))
        if sign is None:
            return self.refuse(node, type(node.op).__name__)
        left, right = map(calculable, self._pair(node.left, node.right))
        for operand, typed in ((node.left, left), (node.right, right)):
            if not q.is_number(typed.type) and typed.type is not q.WIRE:
                return self.no_number(operand, typed.type)
        wire = left.type is q.WIRE or right.type is q.WIRE
        kind = q.WIRE if wire else q.arithmetic(sign, left.type, right.type)
        if kind is None:
            problem = f"cannot compute {q.describe(left.type)} {sign} {q.describe(right.type)}"
            return self.wrong(node, "wrong-unit", problem, q.unit_hint(left.type, right.type))
        if sign in _BOUNDED:
            return Typed(kind, f"{_BOUNDED[sign]}({left.code}, {right.code})")
        return Typed(kind, f"({left.code} {sign} {right.code})")

    def _pair(self, left: ast.expr, right: ast.expr) -> tuple[Typed, Typed]:
        """Check two operands that meet; a text that is a quantity becomes a number beside one with a unit."""
        first, second = self.visit(left), self.visit(right)
        if "text" in (first.type.kind, second.type.kind):
            return (
                self._as_moment(left, as_quantity(first, second.type), second.type),
                self._as_moment(right, as_quantity(second, first.type), first.type),
            )
        return first, second

    def _as_moment(self, node: ast.expr, typed: Typed, other: Type) -> Typed:
        """Read a written text as the date or time of day that it meets."""
        if not is_moment(other) or typed.type is not TEXT or not isinstance(typed.written, str):
            return typed
        if not re.fullmatch(other.pattern, typed.written):
            problem = f"{typed.written!r} is no {other}"
            self.wrong(node, "wrong-type", problem, f"write one such as '{other.example}'")
        return Typed(other, typed.code)

    def _compare(self, node: ast.Compare) -> Typed:
        left = node.left
        code = ""
        for operator, right in zip(node.ops, node.comparators, strict=True):
            if isinstance(operator, (ast.Is, ast.IsNot)):
                return self.refuse(left, type(operator).__name__)
            first, second = self._pair(left, right)
            self._check_comparison(operator, left, right, first.type, second.type)
            second = self.looked_at(second)
            self._check_values(operator, left, right, first.type, second.type)
            code = f"{code or first.code} {_COMPARISONS[type(operator)]} {second.code}"
            left = right
        return Typed(BOOL, f"({code})")

    def _check_comparison(
        self, operator: ast.cmpop, left: ast.expr, right: ast.expr, first: Type, second: Type
    ) -> None:
        if self.failed and "any" in (first.kind, second.kind):
            return  # what is compared has been told to be wrong already
        if isinstance(operator, (ast.In, ast.NotIn)):
            self._check_membership(left, right, first, second)
        elif isinstance(operator, _ORDERINGS) and is_moment(first) and first == second:
            return
        elif isinstance(operator, _ORDERINGS) and not (orderable(first) and orderable(second)):
            wrong, kind = (left, first) if not orderable(first) else (right, second)
            self.no_number(wrong, kind)
        elif q.join(first, second) is None:
            rule = "wrong-unit" if q.is_number(first) and q.is_number(second) else "wrong-type"
            problem = f"cannot compare {q.describe(first)} with {q.describe(second)}"
            self.wrong(right, rule, problem, q.unit_hint(first, second))

    def _check_values(
        self, operator: ast.cmpop, left: ast.expr, right: ast.expr, first: Type, second: Type
    ) -> None:
        """Report a comparison of a text whose possible values are known with one that it can never be."""
        listed = second.item.values if second.item is not None and _root(right) == "this_step" else ()
        if listed and isinstance(left, ast.Constant) and left.value not in listed:
            problem = f"{self.text_of(right)} never has {left.value!r}"
            self.wrong(left, "undeclared-code", problem, nearest(str(left.value), listed))
        if not (first.values or second.values):
            return
        if isinstance(operator, (ast.In, ast.NotIn)):
            elements = right.elts if isinstance(right, (ast.List, ast.Tuple)) else ()
            pairs = [(left, first, element) for element in elements]
        else:
            pairs = [(left, first, right), (right, second, left)]
        for asked, kind, other in pairs:
            value = other.value if isinstance(other, ast.Constant) else None
            if kind.values and isinstance(value, str) and value not in kind.values:
                problem = f"{self.text_of(asked)} is never {value!r}"
                self.wrong(other, "undeclared-code", problem, nearest(value, kind.values))

    def _check_membership(self, left: ast.expr, right: ast.expr, first: Type, second: Type) -> None:
        if second.kind == "text":
            if not q.accepts(TEXT, first):
                self.mismatch(left, TEXT, first)
        elif second.kind not in ("list", "any"):
            problem = f"expected a list after 'in', but {self.text_of(right)!r} is {q.describe(second)}"
            self.wrong(right, "wrong-type", problem)
        elif second.item is not None and q.join(first, second.item) is None:
            problem = f"{self.text_of(left)!r} is {q.describe(first)} and cannot be in {q.describe(second)}"
            self.wrong(left, "wrong-type", problem)

    def _conditional(self, node: ast.IfExp) -> Typed:
        test = self.wanted(node.test, BOOL)
        body, other = self._pair(node.body, node.orelse)
        kind = q.join(body.type, other.type)
        if kind is None:
            rule = "wrong-unit" if q.is_number(body.type) and q.is_number(other.type) else "wrong-type"
            problem = f"one outcome is {q.describe(body.type)}, the other {q.describe(other.type)}"
            return self.wrong(node.orelse, rule, problem, "both must have one type")
        choice = Choice(test.code, body, other) if body.written and other.written else None
        return Typed(kind, conditional_code(test.code, body, other), choice)

    # -- calls ---------------------------------------------------------------------------------------------

    def _call(self, node: ast.Call) -> Typed:
        name = dotted(node.func)
        if name is None:
            return self.wrong(node, "bad-expression", "only functions can be called, by their name")
        if node.keywords:
            return self.wrong(node.keywords[0].value, "bad-expression", "arguments are given by position")
        starred = next((a for a in node.args if isinstance(a, ast.Starred)), None)
        if starred is not None:
            return self.refuse(starred, "Starred")
        if name in BUILTINS:
            return BUILTINS[name](self, node)
        if name in self.scope.functions:
            return self._function(node, name, self.scope.functions[name])
        allowed = [*BUILTIN_CALLS, *self.scope.functions]
        hint = nearest(name, allowed)
        if isinstance(node.func, ast.Attribute) and _root(node.func) in self.scope.names:
            hint = "values have no methods; " + hint
        return self.wrong(node, "unknown-function", f"unknown function {name!r}", hint)

    def _function(self, node: ast.Call, name: str, function: Function) -> Typed:
        self.scope.usage.functions.add(name)
        arguments = list(function.arguments.items())
        for extra in node.args[len(arguments) :]:
            self.wrong(extra, "unknown-argument", f"{name} takes {counted(len(arguments))}")
        for missing, argument in arguments[len(node.args) :]:
            if not argument.optional:
                self.wrong(node, "missing-argument", f"{name} needs the argument {missing!r}: {argument.doc}")
        given = [
            self._wanted_value(argument, wanted.type)
            for argument, (_, wanted) in zip(node.args, arguments, strict=False)
        ]
        for typed in (Typed(function.returns, ""), *given):
            if typed.type.kind == "list":
                self.looked_at(typed)
        return Typed(function.returns, f"{environment_code('functions')}[{name!r}]({listed(given)})")

    def _wanted_value(self, node: ast.expr, wanted: Type) -> Typed:
        typed = as_quantity(self.visit(node), wanted)
        if not q.accepts(wanted, typed.type):
            self.mismatch(node, wanted, typed.type)
        return typed


def _in_its_unit(kind: Type, code: str) -> Typed:
    """Convert a value from the environment's base unit to the unit of its type."""
    unit = innermost(kind).unit
    return Typed(kind, f"_in_unit({code}, {unit!r})" if unit in UNITS and UNITS[unit][0] != unit else code)


def _can_be_compiled(code: str) -> bool:
    """Say whether code with a part's arguments in it is small and flat enough."""
    if len(code) > MAX_CODE:
        return False
    try:
        to_function(code)
    except (SyntaxError, MemoryError, RecursionError):
        return False
    return True


def _root(node: ast.expr) -> str:
    return (dotted(node) or "").partition(".")[0]


_VISITORS: Mapping[type[ast.expr], Callable[[_Checker, Any], Typed]] = {
    ast.Constant: _Checker._constant,
    ast.Name: _Checker._name,
    ast.Attribute: _Checker._attribute,
    ast.Subscript: _Checker._subscript,
    ast.List: _Checker._sequence,
    ast.Tuple: _Checker._sequence,
    ast.BoolOp: _Checker._bool_operation,
    ast.UnaryOp: _Checker._unary,
    ast.BinOp: _Checker._binary,
    ast.Compare: _Checker._compare,
    ast.IfExp: _Checker._conditional,
    ast.Call: _Checker._call,
    ast.ListComp: comprehension,
    ast.GeneratorExp: comprehension,
}
