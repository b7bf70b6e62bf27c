"""Parses an expression to a tree, with findings at their column in the file."""

from __future__ import annotations

import ast
import re
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from functools import cache

from lupin_engine.chart.expressions import units as q
from lupin_engine.chart.expressions.evaluation import MAX_ELEMENTS
from lupin_engine.chart.expressions.scope import Choice, Fragment, Scope, Typed
from lupin_engine.chart.findings import Findings
from lupin_engine.plugin.types import ANY, UNITS, Type, in_unit, parse_quantity

MAX_CHARACTERS = 2000
MAX_NODES = 200
#: How many steps it counts to look through a text.
TEXT_STEPS = 100
#: So many steps an expression may take: what it says, times the elements of the lists that it goes through.
MAX_STEPS = 2_000_000

_BLANK = re.compile(r"\s")
#: Python warns of a number that runs into a word (`1if`), which is no diagnostic of ours.
_RUN_TOGETHER = re.compile(r"[0-9][A-Za-z_]")

#: Placeholder result after an error.
UNTYPED = Typed(ANY, "None")
_REFUSED: Mapping[str, str] = {
    "Lambda": "a lambda",
    "SetComp": "a comprehension",
    "DictComp": "a comprehension",
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
#: Signs of other languages, and what they are here; found outside of texts.
_FOREIGN: Mapping[str, str] = {
    "&&": "and",
    "||": "or",
    "=>": ">=",
    "=<": "<=",
    "<>": "!=",
    "=": "==",
    "!": "not",
}
_FOREIGN_SIGN = re.compile(r"""'[^']*'|"[^"]*"|(&&|\|\||=>|=<|<>|(?<![=!<>])=(?!=)|!(?!=))""")
#: A number and what may be its unit, outside of texts, where an operand ends.
_QUANTITY = re.compile(
    r"""'[^']*'|"[^"]*"|(?<![\w.])(\d+(?:\.\d+)?\s*([%°A-Za-z/]+\d?))(?=\s*(?:$|[]),<>=!]|(?:and|or|if|else)\b))"""
)


class ExpressionReader(ABC):
    """Parses one expression and reports its mistakes; subclasses give the meaning of its nodes."""

    def __init__(self, fragment: Fragment, scope: Scope, findings: Findings, path: str) -> None:
        self.fragment = fragment
        self.scope = scope
        self.findings = findings
        self.path = path
        self.failed = False
        source = fragment.source.strip()
        self._source = source if source.isprintable() else _BLANK.sub(" ", source)
        self.warned = False
        #: The element of the loop that is being read, by its name; how often that is evaluated.
        self.element: dict[str, Typed] = {}
        self.times = 1
        #: How many steps the expression takes at most.
        self.steps = 0
        #: How much of what was read may be unknown.
        self.unknowns = 0

    @abstractmethod
    def visit(self, node: ast.expr) -> Typed:
        """Return the type and code of a node; `UNTYPED` after findings."""

    @property
    def start(self) -> int:
        """The offset in its text at which the expression begins."""
        return self.fragment.offset + indent_of(self.fragment.source)

    # -- reading -------------------------------------------------------------------------------------------

    def parse(self) -> ast.expr | None:
        """Return the expression as a tree; None after findings."""
        source = self._source
        if not source:
            self.stop(0, "the expression is empty", "write one, such as 'param.x > 0'")
        elif len(source) > MAX_CHARACTERS:
            self.stop(0, f"the expression has {len(source)} characters", f"at most {MAX_CHARACTERS}")
        elif "\\" in source:
            self.stop(source.index("\\"), "a backslash is not allowed in an expression")
        else:
            return self._parse_python(source)
        return None

    def _parse_python(self, source: str) -> ast.expr | None:
        try:
            root = _tree(source)
        except SyntaxError as error:
            sign = next((found for found in _FOREIGN_SIGN.finditer(source) if found[1]), None)
            if sign is None:
                self.stop(*_syntax(error, len(source)), _bare_quantity(source))
            else:
                hint = f"write '{_FOREIGN[sign[1]]}'"
                self.stop(sign.start(), f"'{sign[1]}' is not allowed in an expression", hint)
            return None
        except (ValueError, MemoryError, RecursionError):
            self.stop(0, "not an expression: too deeply nested, or not a text")
            return None
        # No character makes more than two nodes, so that most expressions need not be counted.
        if 2 * len(source) > MAX_NODES and sum(1 for _ in ast.walk(root)) > MAX_NODES:
            self.stop(0, "the expression is too large", f"at most {MAX_NODES} operators and operands")
            return None
        return root

    def stop(self, offset: int, problem: str, hint: str = "") -> None:
        """Report an error that ends the reading of the expression."""
        place = self.fragment.text.at(self.start + min(offset, len(self._source)))
        self.findings.add(place, "bad-expression", self.path, problem, hint)
        self.failed = True

    def wrong(self, node: ast.expr, rule: str, problem: str, hint: str = "") -> Typed:
        """Report an error at a node, and return the placeholder."""
        self.wrong_at(self.offset(node), rule, problem, hint)
        return UNTYPED

    def wrong_at(self, offset: int, rule: str, problem: str, hint: str = "") -> None:
        """Report an error at a character of the expression."""
        place = self.fragment.text.at(self.start + offset)
        self.findings.add(place, rule, self.path, problem, hint)
        self.failed = True

    def offset(self, node: ast.expr) -> int:
        """Return the character at which a node begins."""
        return self.characters(node.col_offset)

    def characters(self, octets: int) -> int:
        """Return how many characters a number of octets is; Python counts octets."""
        if self._source.isascii():
            return octets
        return len(self._source.encode()[:octets].decode(errors="ignore"))

    def text_of(self, node: ast.expr) -> str:
        """Return a node as it is written."""
        if self._source.isascii():
            return self._source[node.col_offset : node.end_col_offset]
        return self._source[self.offset(node) : self.characters(node.end_col_offset or 0)]

    def mismatch(self, node: ast.expr, wanted: Type, got: Type) -> None:
        """Report a value of the wrong type."""
        shown = self.text_of(node)
        if q.is_number(wanted) and q.is_number(got) and wanted.unit != got.unit:
            problem = f"expected {q.describe(wanted)}, but {shown!r} is {q.describe(got)}"
            self.wrong(node, "wrong-unit", problem, q.unit_hint(wanted, got))
            return
        asked, hint = q.describe(wanted), q.difference(wanted, got)
        if wanted.kind == "bool" and q.is_number(got):
            hint = f"compare it, such as '{shown} > 0'"
        elif wanted.kind == "integer" and got.kind == "number":
            asked = "a whole number"
            hint = "leave its digits out" if shown.startswith("round(") else f"write 'round({shown})'"
        self.wrong(node, "wrong-type", f"expected {asked}, but {shown!r} is {q.describe(got)}", hint)

    def refuse(self, node: ast.expr, kind: str) -> Typed:
        """Report a construct of Python that expressions do not have, and return the placeholder."""
        what = _REFUSED.get(kind, f"this ({kind})")
        return self.wrong(
            node, "bad-expression", f"{what} is not allowed in an expression", _INSTEAD.get(kind, "")
        )

    def wanted(self, node: ast.expr, wanted: Type) -> Typed:
        """Visit a node that must be of a type; a finding where it is of another one."""
        typed = self.visit(node)
        if not q.accepts(wanted, typed.type):
            self.mismatch(node, wanted, typed.type)
        return typed

    def looked_at(self, typed: Typed, times: int = 1) -> Typed:
        """Add the cost of reading a whole value.

        Inside a loop the code that is returned fails at run time for a value that is not short, unless its
        type limits it.
        """
        kind = typed.type
        if kind.kind not in ("list", "text", "any"):
            return typed
        self.steps += self.times * times * capacity(kind)
        if (
            not self.element
            or typed.written is not None
            or (kind.kind == "list" and kind.maximum is not None)
        ):
            return typed
        return Typed(kind, f"_short({typed.code})")

    def no_number(self, node: ast.expr, got: Type) -> Typed:
        """Report a value that is no number, and return the placeholder."""
        if self.failed and got.kind == "any":
            return UNTYPED  # what it is has been told to be wrong already
        shown = self.text_of(node)
        hint = f"write '{shown}.value'" if "value" in got.fields else ""
        problem = f"expected a number, but {shown!r} is {q.describe(got)}"
        return self.wrong(node, "wrong-type", problem, hint)

    def arity(self, node: ast.Call, name: str, count: int) -> bool:
        """Say whether a call has the right number of arguments; a finding otherwise."""
        if len(node.args) == count:
            return True
        rule = "missing-argument" if len(node.args) < count else "unknown-argument"
        self.wrong(node, rule, f"{name} takes {counted(count)}, got {len(node.args)}")
        return False


def _bare_quantity(source: str) -> str:
    """Return the quoted form of a number with a unit that stands without quotes; '' without one."""
    found = (match[1] for match in _QUANTITY.finditer(source) if match[2] in UNITS)
    quantity = next(found, None)
    return f"write the quantity in quotes: '{quantity}'" if quantity else ""


def _syntax(error: SyntaxError, length: int) -> tuple[int, str]:
    """Return the offset at which Python stopped, and a text of ours: Python's changes with its version."""
    offset = (error.offset or length + 1) - 1
    if offset >= length:
        return length, "not an expression: it ends too early"
    closed = "never closed" in error.msg
    return offset, f"not an expression: {error.msg}" if closed else "not an expression from here on"


def capacity(kind: Type) -> int:
    """Return the largest number of elements of a list; of a text, the cost of reading it."""
    if kind.kind == "text":
        return TEXT_STEPS
    return MAX_ELEMENTS if kind.maximum is None or kind.kind != "list" else int(kind.maximum)


def gone_through(typed: Typed) -> Typed:
    """Return a list to loop over; its length is checked at run time, if its type has no limit."""
    is_bounded = typed.type.kind == "list" and typed.type.maximum is not None
    return typed if is_bounded else Typed(typed.type, f"_bounded({typed.code})")


def calculable(typed: Typed) -> Typed:
    """Treat a value from the wire as a number in calculations; anything else fails at run time."""
    return Typed(q.WIRE, f"_number({typed.code})") if typed.type is q.WIRE else typed


def orderable(kind: Type) -> bool:
    """Say whether values of a type have an order."""
    return q.is_number(kind) or kind.kind == "any"


def as_quantity(typed: Typed, other: Type) -> Typed:
    """Read a text such as '5 s' as a number when it meets one with a unit; '50 %' meets a plain number."""
    if typed.type.kind != "text" or not q.is_number(other):
        return typed
    found = _quantity(typed, other.unit)
    return typed if found is None or (not other.unit and found.type.unit) else found


def _quantity(typed: Typed, unit: str) -> Typed | None:
    """Return a written text as the quantity that it is, or None; also where a condition chooses the text.

    It is in its base unit, or in `unit` where it can be.
    """
    written = typed.written
    if isinstance(written, Choice):
        body, other = _quantity(written.body, unit), _quantity(written.other, unit)
        if body is None or other is None or body.type != other.type:
            return None
        return Typed(body.type, conditional_code(written.test, body, other))
    found = parse_quantity(written) if written is not None else None
    if found is None:
        return None
    value, base = found
    if unit in UNITS and unit != base and UNITS[unit][0] == base:
        return Typed(q.number(unit), repr(in_unit(value, unit)))
    return Typed(q.number(base), repr(value))


def listed(found: Iterable[Typed]) -> str:
    """Return the code of several expressions, separated."""
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


def dotted(node: ast.expr) -> str | None:
    """Return the name that a chain of attributes spells, or None when it is something else."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        inner = dotted(node.value)
        return None if inner is None else f"{inner}.{node.attr}"
    return None


def counted(count: int) -> str:
    """Return a number of arguments in words."""
    return {0: "no argument", 1: "one argument"}.get(count, f"{count} arguments")


def conditional_code(test: str, body: Typed, other: Typed) -> str:
    """Return the code of a choice between two."""
    return f"({body.code} if {test} else {other.code})"


@cache
def environment_code(key: str) -> str:
    """Return the code that reads an entry of the environment."""
    return f"env[{key!r}]"


def indent_of(source: str) -> int:
    """Return how many blanks a text begins with."""
    return len(source) - len(source.lstrip())
