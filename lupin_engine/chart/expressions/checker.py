"""Expressions: a typed, side-effect-free subset of Python, checked at load and compiled once.

What is allowed: and/or/not, comparisons (also `in`), + - * / // %, unary minus, `x if c else y`, indexing of
lists, fields of declared records, lists and tuples, numbers and texts, and calls of `len min max abs round
any all known held in_state` and of the catalog's functions. Everything else is refused: above all method
calls, names with a leading underscore, `**`, shifts, comprehensions, lambdas and formatted texts. Arithmetic
takes numbers only, so no text or list can be multiplied; a product of integers is bounded when it is
computed. There is thus no way to reach an object's attributes, to loop, or to use much memory.

Units are part of a number's type. A text that is a quantity ('5 s') counts as a number where it meets one
with a unit, and a written 0 has any unit. The environment has every number in its base unit; a name whose
type has another one, as in a binding, is read in that. Every mistake is told at its column in the file.

Checking writes the same expression anew (`a.b` becomes `a["b"]`, names become look-ups in the environment).
Python's own compiler gets that, with no builtins, when the expression is evaluated for the first time, so an
expression costs what the same Python would and a chart of a thousand states need not compile what it never
evaluates.
"""

from __future__ import annotations

import ast
import keyword
import math
import re
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, NamedTuple

from lupin_engine.chart.expressions import units as q
from lupin_engine.chart.expressions.evaluation import Compiled, Environment, Expression
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.source import Text
from lupin_engine.errors import meant, nearest
from lupin_engine.plugin.contract import Function
from lupin_engine.plugin.types import (
    ANY,
    BOOL,
    COUNT,
    INTEGER,
    NUMBER,
    TEXT,
    UNITS,
    Type,
    in_unit,
    innermost,
    list_of,
    parse_quantity,
)

MAX_CHARACTERS = 2000
MAX_NODES = 200
MAX_INTEGER = 2**53
#: How long the code of an expression may be in which values stand that a part was given.
MAX_CODE = 100_000

#: Roots of the environment that are records of their own; every other name is a context variable.
ROOTS = frozenset({"param", "request", "input", "event", "error", "target", "itinerary"})
#: Names that an expression may call besides the catalog's functions.
BUILTIN_CALLS = ("len", "min", "max", "abs", "round", "any", "all", "known", "held", "in_state")

_BLANK = re.compile(r"\s")
#: Python warns of a number that runs into a word (`1if`), which is no diagnostic of ours.
_RUN_TOGETHER = re.compile(r"[0-9][A-Za-z_]")
_WHOLE = re.compile(r"\s*\$\{(.*)\}\s*", re.DOTALL)
_TRUTHS: Mapping[str, bool] = {"true": True, "false": False}
#: Words that no expression could read as a name.
WORDS = frozenset({*keyword.kwlist, *_TRUTHS})


@dataclass
class Usage:
    """What the expressions of a chart have read; shared by all scopes of one load."""

    parameters: set[str] = field(default_factory=set)
    functions: set[str] = field(default_factory=set)
    inputs: set[str] = field(default_factory=set)


@dataclass(frozen=True, eq=False)
class Scope:
    """What an expression may see where it stands.

    `names` are the roots and the context variables with their types. `absent` says, for a root that is not
    there, the rule and the reason. `bound` are parameters of a part that its user has given a value. `states`
    are full names, for in_state; `holds` are names, for held. With `open_states` more states may exist than
    are loaded: the lifecycle also speaks of missions that stand in other files. `item` is what the element of
    a `for_each` is called.
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

    # The states of one family have one scope and say the same in it again and again. So it remembers what
    # was derived from it, and the names and expressions that were read in it.
    _derived: dict[Any, Scope] = field(init=False, repr=False, compare=False, default_factory=dict)
    _names: dict[tuple[str, str], Typed] = field(init=False, repr=False, compare=False, default_factory=dict)
    _compiled: dict[tuple[str, int], _Checked] = field(
        init=False, repr=False, compare=False, default_factory=dict
    )

    def with_names(self, names: Mapping[str, Type]) -> Scope:
        """Return this scope with further names, or other types for the same ones."""
        key: Any = tuple(names.items())
        derived = self._derived.get(key)
        if derived is None:
            absent = {name: reason for name, reason in self.absent.items() if name not in names}
            derived = self._derived[key] = replace(self, names={**self.names, **names}, absent=absent)
        return derived

    def with_event(self, kind: Type) -> Scope:
        """Return this scope with an event of a type: what most transitions and actions see."""
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


class _Checked(NamedTuple):
    """What is the same wherever an expression of type `wanted` stands in a scope."""

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


def fragment_of(text: Text) -> Fragment | None:
    """Return the expression that a value consists of (`${ ... }`), or None when it is a plain text."""
    if text.startswith("${") and text.endswith("}"):
        return None if "${" in text[2:] else Fragment(text[2:-1], text, 2)
    match = _WHOLE.fullmatch(text)
    return None if match is None or "${" in match.group(1) else Fragment(match.group(1), text, match.start(1))


def compile_expression(
    fragment: Fragment, scope: Scope, wanted: Type, findings: Findings, path: str
) -> Expression | None:
    """Check an expression that must be of type `wanted`; None after findings.

    The result reads an environment as `chart.model` describes. It raises `UnknownInput`, ZeroDivisionError,
    IndexError (also of an empty list's smallest element), OverflowError or what a plugin's function raises;
    after reading something of type `any` also KeyError and TypeError, where that was not as expected.
    """
    source = fragment.source.strip()
    key = (source, id(wanted))  # what is kept under it keeps the type alive; to hash a type takes longer
    checked = scope._compiled.get(key)
    if checked is None:
        checker = _Checker(fragment, scope, findings, path)
        typed = checker.check(wanted)
        if typed is None:
            return None
        parts = tuple([(text, _later(part)) for text, part in checker.parts])
        checked = _Checked(wanted, typed.type, _later(typed), parts)
        if not checker.warned:
            scope._compiled[key] = checked
    indent = 0 if source is fragment.source else _indent(fragment.source)
    place = fragment.text.at(fragment.offset + indent)
    return Expression(source, place, checked.type, checked.evaluate, checked.parts)


def check_expression(
    fragment: Fragment, scope: Scope, wanted: Type, findings: Findings, path: str
) -> Typed | None:
    """Check an expression without compiling it; for one that is built into others."""
    return _Checker(fragment, scope, findings, path).check(wanted)


def _indent(source: str) -> int:
    return len(source) - len(source.lstrip())


def _times(left: Any, right: Any) -> Any:
    """Multiply; integers only as far as a float could tell them apart."""
    product = left * right
    if isinstance(product, int) and abs(product) > MAX_INTEGER:
        raise OverflowError(f"{product:.3g} is too large")
    return product


def _number(value: Any) -> Any:
    """Refuse to calculate with what is no number: no text or list may be multiplied."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TypeError(f"expected a number, got {value!r}")
    return value


def _same(value: Any) -> Any:
    return value


#: All that compiled code can name besides its environment.
_GLOBALS: dict[str, Any] = {
    "__builtins__": {},
    "len": len,
    "min": min,
    "max": max,
    "abs": abs,
    "round": round,
    "any": any,
    "all": all,
    "_number": _number,
    "_times": _times,
    "_same": _same,
    "_in_unit": in_unit,
    "inf": math.inf,
}


def _later(typed: Typed) -> Compiled:
    return Compiled(typed.code, _to_function)


def _to_function(code: str) -> Callable[[Environment], Any]:
    """Compile checked code to a function of the environment."""
    function: Callable[[Environment], Any] = eval(f"lambda env: {code}", _GLOBALS)
    return function


@cache
def _environment(key: str) -> str:
    return f"env[{key!r}]"


#: What is gone on with after a mistake.
_NOTHING = Typed(ANY, "None")
_OPERATORS: Mapping[type[ast.operator], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.FloorDiv: "//",
    ast.Mod: "%",
}
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
_ORDERINGS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)
_REFUSED: Mapping[str, str] = {
    "Lambda": "a lambda",
    "ListComp": "a comprehension",
    "SetComp": "a comprehension",
    "DictComp": "a comprehension",
    "GeneratorExp": "a comprehension",
    "NamedExpr": "':='",
    "JoinedStr": "a formatted text",
    "Dict": "a mapping",
    "Set": "a set",
    "Await": "await",
    "Yield": "yield",
    "YieldFrom": "yield",
    "Starred": "'*'",
    "Slice": "a slice",
    "Pow": "'**'",
    "LShift": "'<<'",
    "RShift": "'>>'",
    "BitOr": "'|'",
    "BitAnd": "'&'",
    "BitXor": "'^'",
    "MatMult": "'@'",
    "Invert": "'~'",
    "UAdd": "a unary '+'",
    "Is": "'is'",
    "IsNot": "'is not'",
}
_INSTEAD: Mapping[str, str] = {
    "BitOr": "write 'or'",
    "BitAnd": "write 'and'",
    "Is": "write '=='",
    "IsNot": "write '!='",
    "Invert": "write 'not'",
}


class _Checker:
    """Checks and rewrites one expression; after a mistake it goes on with a type that fits everywhere."""

    def __init__(self, fragment: Fragment, scope: Scope, findings: Findings, path: str) -> None:
        self._fragment = fragment
        self._scope = scope
        self._findings = findings
        self._path = path
        self._failed = False
        self._grown = False
        source = fragment.source.strip()
        self._source = source if source.isprintable() else _BLANK.sub(" ", source)
        self._operands: list[tuple[ast.expr, Typed]] = []
        self.warned = False
        self.parts: list[tuple[str, Typed]] = []

    def check(self, wanted: Type) -> Typed | None:
        """Return type and code, or None after findings."""
        root = self._parse()
        if root is None:
            return None
        found = _as_quantity(self._visit(root), wanted)
        if not self._failed and not q.accepts(wanted, found.type):
            self._mismatch(root, wanted, found.type)
        if self._grown and not self._failed and not _can_be_compiled(found.code):
            self._stop(0, "the expression is too large with the values that stand for its parameters")
        if self._failed:
            return None
        self._note_parts(root)
        return found

    @property
    def _start(self) -> int:
        """Where in its text the expression begins."""
        return self._fragment.offset + _indent(self._fragment.source)

    # -- reading -------------------------------------------------------------------------------------------

    def _parse(self) -> ast.expr | None:
        source = self._source
        if not source:
            self._stop(0, "the expression is empty", "write one, such as 'param.x > 0'")
        elif len(source) > MAX_CHARACTERS:
            self._stop(0, f"the expression has {len(source)} characters", f"at most {MAX_CHARACTERS}")
        elif "\\" in source:
            self._stop(source.index("\\"), "a backslash is not allowed in an expression")
        else:
            return self._parse_python(source)
        return None

    def _parse_python(self, source: str) -> ast.expr | None:
        try:
            root = _tree(source)
        except SyntaxError as error:
            self._stop(*_syntax(error, len(source)))
            return None
        except (ValueError, MemoryError, RecursionError):
            self._stop(0, "not an expression: too deeply nested, or not a text")
            return None
        # No character makes more than two nodes, so that most expressions need not be counted.
        if 2 * len(source) > MAX_NODES and sum(1 for _ in ast.walk(root)) > MAX_NODES:
            self._stop(0, "the expression is too large", f"at most {MAX_NODES} operators and operands")
            return None
        return root

    def _stop(self, offset: int, problem: str, hint: str = "") -> None:
        place = self._fragment.text.at(self._start + min(offset, len(self._source)))
        self._findings.add(place, "bad-expression", self._path, problem, hint)
        self._failed = True

    def _wrong(self, node: ast.expr, rule: str, problem: str, hint: str = "") -> Typed:
        self._wrong_at(self._offset(node), rule, problem, hint)
        return _NOTHING

    def _wrong_at(self, offset: int, rule: str, problem: str, hint: str = "") -> None:
        place = self._fragment.text.at(self._start + offset)
        self._findings.add(place, rule, self._path, problem, hint)
        self._failed = True

    def _offset(self, node: ast.expr) -> int:
        return self._characters(node.col_offset)

    def _characters(self, octets: int) -> int:
        if self._source.isascii():
            return octets
        return len(self._source.encode()[:octets].decode(errors="ignore"))

    def _text_of(self, node: ast.expr) -> str:
        if self._source.isascii():
            return self._source[node.col_offset : node.end_col_offset]
        return self._source[self._offset(node) : self._characters(node.end_col_offset or 0)]

    def _mismatch(self, node: ast.expr, wanted: Type, got: Type) -> None:
        shown = self._text_of(node)
        if q.is_number(wanted) and q.is_number(got) and wanted.unit != got.unit:
            problem = f"expected {q.describe(wanted)}, but {shown!r} is {q.describe(got)}"
            self._wrong(node, "wrong-unit", problem, q.unit_hint(wanted, got))
            return
        asked, hint = q.describe(wanted), ""
        if wanted.kind == "bool" and q.is_number(got):
            hint = f"compare it, such as '{shown} > 0'"
        elif wanted.kind == "integer" and got.kind == "number":
            asked = "a whole number"
            hint = "leave its digits out" if shown.startswith("round(") else f"write 'round({shown})'"
        self._wrong(node, "wrong-type", f"expected {asked}, but {shown!r} is {q.describe(got)}", hint)

    def _note_parts(self, root: ast.expr) -> None:
        """Note the operands of the outermost and/or/not, which tell why a guard was false."""
        if isinstance(root, ast.BoolOp) or (isinstance(root, ast.UnaryOp) and isinstance(root.op, ast.Not)):
            self.parts = [(self._text_of(node), typed) for node, typed in self._operands]

    # -- nodes ---------------------------------------------------------------------------------------------

    def _visit(self, node: ast.expr) -> Typed:
        visit = _VISITORS.get(type(node))
        if visit is None:
            return self._refuse(node, type(node).__name__)
        return visit(self, node)

    def _refuse(self, node: ast.expr, kind: str) -> Typed:
        what = _REFUSED.get(kind, f"this ({kind})")
        return self._wrong(
            node, "bad-expression", f"{what} is not allowed in an expression", _INSTEAD.get(kind, "")
        )

    def _constant(self, node: ast.Constant) -> Typed:
        value = node.value
        if isinstance(value, bool):
            return Typed(BOOL, repr(value))
        if isinstance(value, str):
            return Typed(TEXT, repr(value), value)
        if isinstance(value, int) and abs(value) <= MAX_INTEGER:
            return Typed(q.ZERO if value == 0 else COUNT, repr(value))
        if isinstance(value, float) and math.isfinite(value):
            return Typed(q.ZERO_NUMBER if value == 0 else NUMBER, repr(value))
        hint = "use known(input.NAME) to ask for what may be missing" if value is None else ""
        return self._wrong(
            node, "bad-expression", f"{self._text_of(node)} is not allowed in an expression", hint
        )

    def _name(self, node: ast.Name) -> Typed:
        name, scope = node.id, self._scope
        if name in _TRUTHS:
            return Typed(BOOL, repr(_TRUTHS[name]))
        if name.startswith("_"):
            return self._wrong(
                node, "unknown-name", f"unknown name {name!r}: no name begins with an underscore"
            )
        if name in scope.names:
            if name in ROOTS:
                return Typed(scope.names[name], _environment(name))
            code = _environment("item") if name == scope.item else f"{_environment('context')}[{name!r}]"
            return _in_its_unit(scope.names[name], code)
        if name in scope.absent:
            rule, reason = scope.absent[name]
            return self._wrong(node, rule, f"there is no {name!r} here: {reason}")
        if name in BUILTIN_CALLS or name in scope.functions:
            return self._wrong(node, "wrong-type", f"{name!r} is a function", f"call it: {name}(...)")
        return self._wrong(node, "unknown-name", f"unknown name {name!r}", nearest(name, scope.names))

    def _attribute(self, node: ast.Attribute) -> Typed:
        if not isinstance(node.value, ast.Name):
            return self._field(node)
        key = (node.value.id, node.attr)
        known = self._scope._names.get(key)
        if known is None:
            known = self._field(node)
            if not self._failed and not self._grown:
                self._scope._names[key] = known
        return known

    def _field(self, node: ast.Attribute) -> Typed:
        if node.attr.startswith("_"):
            problem = f"unknown name {node.attr!r}: no name begins with an underscore"
            self._wrong_at(self._attribute_offset(node), "unknown-name", problem)
            return _NOTHING
        root = node.value.id if isinstance(node.value, ast.Name) else ""
        if root == "param" and node.attr in self._scope.bound:
            self._scope.usage.parameters.add(node.attr)
            self._grown = True
            return self._scope.bound[node.attr]
        record = self._visit(node.value)
        code = f"{record.code}[{node.attr!r}]"
        if record.type.kind == "any":
            return Typed(record.type, code)
        if record.type.kind != "record":
            return self._wrong_field(
                node, f"{self._text_of(node.value)!r} is {q.describe(record.type)}, no record"
            )
        if node.attr not in record.type.fields:
            return self._unknown_field(node, record.type, root)
        self._note(root, node.attr)
        return _in_its_unit(record.type.fields[node.attr], code)

    def _note(self, root: str, name: str) -> None:
        if root == "param":
            self._scope.usage.parameters.add(name)
        elif root == "input":
            self._scope.usage.inputs.add(name)

    def _unknown_field(self, node: ast.Attribute, record: Type, root: str) -> Typed:
        if root == "param":
            problem = f"unknown parameter {node.attr!r}"
            self._wrong_at(
                self._attribute_offset(node), "unknown-parameter", problem, nearest(node.attr, record.fields)
            )
            return _NOTHING
        where = self._text_of(node.value)
        if not record.fields:
            return self._wrong_field(node, f"{where!r} has no fields to read")
        return self._wrong_field(node, f"{where!r} has no {node.attr!r}", nearest(node.attr, record.fields))

    def _wrong_field(self, node: ast.Attribute, problem: str, hint: str = "") -> Typed:
        self._wrong_at(self._attribute_offset(node), "unknown-name", problem, hint)
        return _NOTHING

    def _attribute_offset(self, node: ast.Attribute) -> int:
        return self._characters(node.end_col_offset or 0) - len(node.attr)

    def _subscript(self, node: ast.Subscript) -> Typed:
        if isinstance(node.slice, ast.Slice):
            return self._refuse(node, "Slice")
        value, index = self._visit(node.value), self._visit(node.slice)
        if value.type.kind not in ("list", "any"):
            problem = f"{self._text_of(node.value)!r} is {q.describe(value.type)}, only a list can be indexed"
            return self._wrong(node.value, "wrong-type", problem)
        if not q.accepts(INTEGER, index.type):
            self._mismatch(node.slice, INTEGER, index.type)
        item = value.type if value.type.kind == "any" else value.type.item
        return Typed(item or ANY, f"{value.code}[{index.code}]")

    def _sequence(self, node: ast.List | ast.Tuple) -> Typed:
        found = [self._visit(element) for element in node.elts]
        item = found[0].type if found else ANY
        for element, typed in zip(node.elts[1:], found[1:], strict=True):
            joined = q.join(item, typed.type)
            if joined is None:
                kinds = f"the first is {q.describe(item)}, this is {q.describe(typed.type)}"
                problem = f"a list holds one type: {kinds}"
                return self._wrong(element, "wrong-type", problem)
            item = joined
        return Typed(list_of(item), f"[{_listed(found)}]")

    def _bool_operation(self, node: ast.BoolOp) -> Typed:
        operands = [(operand, self._wanted(operand, BOOL)) for operand in node.values]
        self._operands = operands  # those of the outermost come last
        sign = " and " if isinstance(node.op, ast.And) else " or "
        return Typed(BOOL, f"({sign.join([typed.code for _, typed in operands])})")

    def _wanted(self, node: ast.expr, wanted: Type) -> Typed:
        typed = self._visit(node)
        if not q.accepts(wanted, typed.type):
            self._mismatch(node, wanted, typed.type)
        return typed

    def _unary(self, node: ast.UnaryOp) -> Typed:
        if isinstance(node.op, ast.Not):
            operand = self._wanted(node.operand, BOOL)
            self._operands = [(node.operand, operand)]
            return Typed(BOOL, f"(not {operand.code})")
        if not isinstance(node.op, ast.USub):
            return self._refuse(node, type(node.op).__name__)
        operand = _calculable(self._visit(node.operand))
        if operand.type is q.WIRE:
            return Typed(q.WIRE, f"(-{operand.code})")
        if not q.is_number(operand.type):
            return self._no_number(node.operand, operand.type)
        kind = INTEGER if operand.type.kind == "integer" and not operand.type.unit else q.plain(operand.type)
        return Typed(kind, f"(-{operand.code})")

    def _no_number(self, node: ast.expr, got: Type) -> Typed:
        if self._failed and got.kind == "any":
            return _NOTHING  # what it is has been told to be wrong already
        shown = self._text_of(node)
        hint = f"write '{shown}.value'" if "value" in got.fields else ""
        problem = f"expected a number, but {shown!r} is {q.describe(got)}"
        return self._wrong(node, "wrong-type", problem, hint)

    def _binary(self, node: ast.BinOp) -> Typed:
        sign = _OPERATORS.get(type(node.op))
        if sign is None:
            return self._refuse(node, type(node.op).__name__)
        left, right = map(_calculable, self._pair(node.left, node.right))
        for operand, typed in ((node.left, left), (node.right, right)):
            if not q.is_number(typed.type) and typed.type is not q.WIRE:
                return self._no_number(operand, typed.type)
        wire = left.type is q.WIRE or right.type is q.WIRE
        kind = q.WIRE if wire else q.arithmetic(sign, left.type, right.type)
        if kind is None:
            problem = f"cannot compute {q.describe(left.type)} {sign} {q.describe(right.type)}"
            return self._wrong(node, "wrong-unit", problem, q.unit_hint(left.type, right.type))
        if sign == "*" and kind.kind != "number":
            return Typed(kind, f"_times({left.code}, {right.code})")
        return Typed(kind, f"({left.code} {sign} {right.code})")

    def _pair(self, left: ast.expr, right: ast.expr) -> tuple[Typed, Typed]:
        """Check two operands that meet; a text that is a quantity becomes a number beside one with a unit."""
        first, second = self._visit(left), self._visit(right)
        if "text" in (first.type.kind, second.type.kind):
            return _as_quantity(first, second.type), _as_quantity(second, first.type)
        return first, second

    def _compare(self, node: ast.Compare) -> Typed:
        left = node.left
        code = ""
        for operator, right in zip(node.ops, node.comparators, strict=True):
            if isinstance(operator, (ast.Is, ast.IsNot)):
                return self._refuse(left, type(operator).__name__)
            first, second = self._pair(left, right)
            self._check_comparison(operator, left, right, first.type, second.type)
            self._check_values(operator, left, right, first.type, second.type)
            code = f"{code or first.code} {_COMPARISONS[type(operator)]} {second.code}"
            left = right
        return Typed(BOOL, f"({code})")

    def _check_comparison(
        self, operator: ast.cmpop, left: ast.expr, right: ast.expr, first: Type, second: Type
    ) -> None:
        if self._failed and "any" in (first.kind, second.kind):
            return  # what is compared has been told to be wrong already
        if isinstance(operator, (ast.In, ast.NotIn)):
            self._check_membership(left, right, first, second)
        elif isinstance(operator, _ORDERINGS) and not (_orderable(first) and _orderable(second)):
            wrong, kind = (left, first) if not _orderable(first) else (right, second)
            self._no_number(wrong, kind)
        elif q.join(first, second) is None:
            rule = "wrong-unit" if q.is_number(first) and q.is_number(second) else "wrong-type"
            problem = f"cannot compare {q.describe(first)} with {q.describe(second)}"
            self._wrong(right, rule, problem, q.unit_hint(first, second))

    def _check_values(
        self, operator: ast.cmpop, left: ast.expr, right: ast.expr, first: Type, second: Type
    ) -> None:
        """Refuse to compare a text of which all possible values are known with one that it can never be."""
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
                problem = f"{self._text_of(asked)} is never {value!r}"
                self._wrong(other, "undeclared-code", problem, nearest(value, kind.values))

    def _check_membership(self, left: ast.expr, right: ast.expr, first: Type, second: Type) -> None:
        if second.kind == "text":
            if not q.accepts(TEXT, first):
                self._mismatch(left, TEXT, first)
        elif second.kind not in ("list", "any"):
            problem = f"expected a list after 'in', but {self._text_of(right)!r} is {q.describe(second)}"
            self._wrong(right, "wrong-type", problem)
        elif second.item is not None and q.join(first, second.item) is None:
            problem = f"{self._text_of(left)!r} is {q.describe(first)} and cannot be in {q.describe(second)}"
            self._wrong(left, "wrong-type", problem)

    def _conditional(self, node: ast.IfExp) -> Typed:
        test = self._wanted(node.test, BOOL)
        body, other = self._pair(node.body, node.orelse)
        kind = q.join(body.type, other.type)
        if kind is None:
            rule = "wrong-unit" if q.is_number(body.type) and q.is_number(other.type) else "wrong-type"
            problem = f"one outcome is {q.describe(body.type)}, the other {q.describe(other.type)}"
            return self._wrong(node.orelse, rule, problem, "both must have one type")
        choice = Choice(test.code, body, other) if body.written and other.written else None
        return Typed(kind, _conditional(test.code, body, other), choice)

    # -- calls ---------------------------------------------------------------------------------------------

    def _call(self, node: ast.Call) -> Typed:
        name = _dotted(node.func)
        if name is None:
            return self._wrong(node, "bad-expression", "only functions can be called, by their name")
        if node.keywords:
            return self._wrong(node.keywords[0].value, "bad-expression", "arguments are given by position")
        starred = next((a for a in node.args if isinstance(a, ast.Starred)), None)
        if starred is not None:
            return self._refuse(starred, "Starred")
        if name in _BUILTINS:
            return _BUILTINS[name](self, node)
        if name in self._scope.functions:
            return self._function(node, name, self._scope.functions[name])
        allowed = [*BUILTIN_CALLS, *self._scope.functions]
        hint = nearest(name, allowed)
        if isinstance(node.func, ast.Attribute) and _root(node.func) in self._scope.names:
            hint = "values have no methods; " + hint
        return self._wrong(node, "unknown-function", f"unknown function {name!r}", hint)

    def _function(self, node: ast.Call, name: str, function: Function) -> Typed:
        self._scope.usage.functions.add(name)
        arguments = list(function.arguments.items())
        for extra in node.args[len(arguments) :]:
            self._wrong(extra, "unknown-argument", f"{name} takes {_count(len(arguments))}")
        for missing, argument in arguments[len(node.args) :]:
            if not argument.optional:
                self._wrong(
                    node, "missing-argument", f"{name} needs the argument {missing!r}: {argument.doc}"
                )
        given = [
            self._wanted_value(argument, wanted.type)
            for argument, (_, wanted) in zip(node.args, arguments, strict=False)
        ]
        return Typed(function.returns, f"{_environment('functions')}[{name!r}]({_listed(given)})")

    def _wanted_value(self, node: ast.expr, wanted: Type) -> Typed:
        typed = _as_quantity(self._visit(node), wanted)
        if not q.accepts(wanted, typed.type):
            self._mismatch(node, wanted, typed.type)
        return typed

    def _arity(self, node: ast.Call, name: str, count: int) -> bool:
        if len(node.args) == count:
            return True
        rule = "missing-argument" if len(node.args) < count else "unknown-argument"
        self._wrong(node, rule, f"{name} takes {_count(count)}, got {len(node.args)}")
        return False

    def _len(self, node: ast.Call) -> Typed:
        if not self._arity(node, "len", 1):
            return _NOTHING
        argument = self._visit(node.args[0])
        if argument.type.kind not in ("list", "text", "any"):
            problem = f"{self._text_of(node.args[0])!r} is {q.describe(argument.type)}, which has no length"
            return self._wrong(node.args[0], "wrong-type", problem, "expected a list or a text")
        return Typed(COUNT, f"len({argument.code})")

    def _extreme(self, node: ast.Call) -> Typed:
        name = _dotted(node.func) or ""
        if not node.args:
            return self._wrong(
                node, "missing-argument", f"{name} takes a list of numbers, or several numbers"
            )
        found = [self._visit(argument) for argument in node.args]
        kinds = [typed.type for typed in found]
        if len(found) == 1:
            if kinds[0].kind not in ("list", "any"):
                return self._wrong(node.args[0], "wrong-type", f"{name} of one value needs a list")
            kinds = [kinds[0].item or ANY]
        joined: Type | None = kinds[0]
        for argument, kind in zip(node.args, kinds, strict=False):
            if not _orderable(kind):
                return self._no_number(argument, kind)
            joined = q.join(joined, kind) if joined is not None else None
            if joined is None:
                problem = f"cannot compare {q.describe(kinds[0])} with {q.describe(kind)}"
                return self._wrong(argument, "wrong-unit", problem, q.unit_hint(kinds[0], kind))
        return Typed(joined or ANY, f"{name}({_listed(found)})")

    def _abs(self, node: ast.Call) -> Typed:
        if not self._arity(node, "abs", 1):
            return _NOTHING
        argument = _calculable(self._visit(node.args[0]))
        if not q.is_number(argument.type) and argument.type is not q.WIRE:
            return self._no_number(node.args[0], argument.type)
        return Typed(argument.type, f"abs({argument.code})")

    def _round(self, node: ast.Call) -> Typed:
        if len(node.args) not in (1, 2):
            self._arity(node, "round", 1)
            return _NOTHING
        argument = _calculable(self._visit(node.args[0]))
        if not q.is_number(argument.type) and argument.type is not q.WIRE:
            return self._no_number(node.args[0], argument.type)
        code = argument.code
        if len(node.args) == 2:
            digits = node.args[1]
            value = digits.value if isinstance(digits, ast.Constant) else None
            if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= 9:
                return self._wrong(digits, "wrong-type", "the digits of round must be written out, 0 to 9")
            code = f"{code}, {value}"
        unit = "" if argument.type.unit == "*" else argument.type.unit
        return Typed(q.whole(unit) if len(node.args) == 1 else argument.type, f"round({code})")

    def _quantifier(self, node: ast.Call) -> Typed:
        name = _dotted(node.func) or ""
        if not self._arity(node, name, 1):
            return _NOTHING
        argument = self._wanted(node.args[0], list_of(BOOL))
        return Typed(BOOL, f"{name}({argument.code})")

    def _known(self, node: ast.Call) -> Typed:
        if not self._arity(node, "known", 1):
            return _NOTHING
        argument = node.args[0]
        if not isinstance(argument, ast.Attribute) or _dotted(argument.value) != "input":
            return self._wrong(argument, "wrong-type", "known asks about an input", "write known(input.NAME)")
        self._visit(argument)
        return Typed(BOOL, f"{_environment('known')}({argument.attr!r})")

    def _held(self, node: ast.Call) -> Typed:
        name = self._word(node, "held", "a hold")
        if name is None:
            return _NOTHING
        if name not in self._scope.holds:
            hint = nearest(name, self._scope.holds)
            return self._wrong(node.args[0], "unknown-hold", f"unknown hold {name!r}", hint)
        return Typed(BOOL, f"{_environment('held')}({name!r})")

    def _in_state(self, node: ast.Call) -> Typed:
        name = self._word(node, "in_state", "a state")
        if name is None:
            return _NOTHING
        states = [state for state in self._scope.states if state == name or state.endswith(f".{name}")]
        if not states:
            self._no_state(node.args[0], name)
        return Typed(BOOL, f"{_environment('in_state')}({tuple(states)!r})")

    def _no_state(self, node: ast.expr, name: str) -> None:
        problem = f"no state is called {name!r}"
        known = {word for state in self._scope.states for word in state.split(".")}
        if not self._scope.open_states:
            self._wrong(node, "unknown-state", problem, nearest(name, known))
            return
        guess = meant(name, known)
        if not guess:
            return  # the lifecycle may speak of missions that are not loaded
        place = self._fragment.text.at(self._start + self._offset(node))
        problem += " in the missions that are loaded, so this is false"
        self.warned = True
        self._findings.warn(place, "unknown-state", self._path, problem, guess)

    def _word(self, node: ast.Call, function: str, what: str) -> str | None:
        """Return the single argument when it is a word that is written out, quoted or not."""
        if not self._arity(node, function, 1):
            return None
        argument = node.args[0]
        if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
            return argument.value
        name = _dotted(argument)
        if name is None:
            self._wrong(
                argument, "wrong-type", f"{function} takes the name of {what}", f"write {function}('NAME')"
            )
        return name


def _syntax(error: SyntaxError, length: int) -> tuple[int, str]:
    """Return where and how Python stopped reading; in our words, for Python's change with every version."""
    offset = (error.offset or length + 1) - 1
    if offset >= length:
        return length, "not an expression: it ends too early"
    closed = "never closed" in error.msg
    return offset, f"not an expression: {error.msg}" if closed else "not an expression from here on"


def _calculable(typed: Typed) -> Typed:
    """Let what came over the wire be a number where it is calculated with; what is not one fails then."""
    return Typed(q.WIRE, f"_number({typed.code})") if typed.type is q.WIRE else typed


def _orderable(kind: Type) -> bool:
    return q.is_number(kind) or kind.kind == "any"


def _as_quantity(typed: Typed, other: Type) -> Typed:
    """Read a text such as '5 s' as a number when it meets a number with a unit."""
    if typed.type.kind != "text" or not q.is_number(other) or not other.unit:
        return typed
    return _quantity(typed, other.unit) or typed


def _quantity(typed: Typed, unit: str) -> Typed | None:
    """Return a written text as the quantity that it is, or None; also where a condition chooses the text.

    It is in its base unit, or in `unit` where it can be.
    """
    written = typed.written
    if isinstance(written, Choice):
        body, other = _quantity(written.body, unit), _quantity(written.other, unit)
        if body is None or other is None or body.type != other.type:
            return None
        return Typed(body.type, _conditional(written.test, body, other))
    found = parse_quantity(written) if written is not None else None
    if found is None:
        return None
    value, base = found
    if unit in UNITS and unit != base and UNITS[unit][0] == base:
        return Typed(q.number(unit), repr(in_unit(value, unit)))
    return Typed(q.number(base), repr(value))


def _in_its_unit(kind: Type, code: str) -> Typed:
    """Return what is looked up in the environment, which has base units, in the unit of its type."""
    unit = innermost(kind).unit
    return Typed(kind, f"_in_unit({code}, {unit!r})" if unit in UNITS and UNITS[unit][0] != unit else code)


def _conditional(test: str, body: Typed, other: Typed) -> str:
    return f"({body.code} if {test} else {other.code})"


def _listed(found: Iterable[Typed]) -> str:
    return ", ".join([typed.code for typed in found])


def _tree(source: str) -> ast.expr:
    if not _RUN_TOGETHER.search(source):
        return _parsed(source)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return _parsed(source)


def _parsed(source: str) -> ast.expr:
    root = compile(source, "<expression>", "eval", ast.PyCF_ONLY_AST)
    assert isinstance(root, ast.Expression)
    return root.body


def _can_be_compiled(code: str) -> bool:
    """Tell whether code is small and flat enough in which values stand that a part was given."""
    if len(code) > MAX_CODE:
        return False
    try:
        _to_function(code)
    except (SyntaxError, MemoryError, RecursionError):
        return False
    return True


def _dotted(node: ast.expr) -> str | None:
    """Return the name that a chain of attributes spells, or None when it is something else."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        inner = _dotted(node.value)
        return None if inner is None else f"{inner}.{node.attr}"
    return None


def _root(node: ast.expr) -> str:
    return (_dotted(node) or "").partition(".")[0]


def _count(count: int) -> str:
    return {0: "no argument", 1: "one argument"}.get(count, f"{count} arguments")


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
}
_BUILTINS: Mapping[str, Callable[[_Checker, ast.Call], Typed]] = {
    "len": _Checker._len,
    "min": _Checker._extreme,
    "max": _Checker._extreme,
    "abs": _Checker._abs,
    "round": _Checker._round,
    "any": _Checker._quantifier,
    "all": _Checker._quantifier,
    "known": _Checker._known,
    "held": _Checker._held,
    "in_state": _Checker._in_state,
}
