"""Parses ECMAScript expressions (recursive descent), as charts use them, to expressions of the language with
types.

Numbers, texts, lists, variables, arithmetic, comparisons, `&&`, `||`, `!`, `?:`, `In()`, a few of `Math` and
`typeof x === 'undefined'`; anything else is refused (`CannotSay`). ECMAScript takes any value for a truth
value; here a number is compared with 0, a text with ''. A statement (`return`) is always an error, as in
SCXML.
"""

from __future__ import annotations

import ast
import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from lupin_engine.plugin import MAX_INTEGER
from lupin_scxml.notes import AlwaysFails, CannotSay

#: Longer or deeper expressions are none that a mission can say.
MAX_CHARACTERS, MAX_DEPTH = 2000, 40
_TOKEN = re.compile(
    r"""\s*(?:(?P<number>(?:0[xX][\da-fA-F]+|\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?![\w$])|(?P<text>'[^'\\$\n]*'|"[^"\\$\n]*")"""
    r"""|(?P<name>[A-Za-z_$][\w$]*)|(?P<sign>[=!]==?|<=|>=|&&|\|\||[-+*/%<>!?:()\[\]{},.]))"""
)
#: Words that begin or end statements and so are no expression.
_STATEMENTS = frozenset(
    (
        *("break", "case", "catch", "continue", "default", "do", "else", "export", "finally", "for", "if"),
        *("import", "return", "switch", "throw", "try", "var", "while", "with"),
    )
)
_LEVELS = {"||": 1, "or": 1, "&&": 2, "and": 2, **dict.fromkeys(("==", "===", "!=", "!=="), 3)}
_LEVELS |= {**dict.fromkeys(("<", "<=", ">", ">="), 4), "+": 5, "-": 5, "*": 6, "/": 6, "%": 6}
_ARITHMETIC: Mapping[str, type[ast.operator]] = {
    "+": ast.Add,
    "-": ast.Sub,
    "*": ast.Mult,
    "/": ast.Div,
    "%": ast.Mod,
}
_COMPARISONS: Mapping[str, type[ast.cmpop]] = {
    **dict.fromkeys(("==", "==="), ast.Eq),
    **dict.fromkeys(("!=", "!=="), ast.NotEq),
    "<": ast.Lt,
    "<=": ast.LtE,
    ">": ast.Gt,
    ">=": ast.GtE,
}
#: Functions of `Math` that the language has, too.
_MATH = {"Math.max": "max", "Math.min": "min", "Math.abs": "abs"}
_TYPEOF = {"number": "number", "text": "string", "bool": "boolean", "undefined": "undefined"}
#: Words of Python that an exported document has where the language has others.
_OWN_WORDS = {"In": "in_state", "_event.data.": "event.", "True": "true", "False": "false"}
_OWN_TOKEN = re.compile(r"'[^']*'|\"[^\"]*\"|\b_event\.data\.|\b[A-Za-z_]\w*")
_ASSIGNMENT = re.compile(
    r"(?:(?:var|let)\s+)?([A-Za-z_$][\w$.]*)\s*([-+*/]?=(?!=)|\+\+|--)\s*(.*)", re.DOTALL
)


@dataclass
class Operand:
    """A parsed part of an expression: its tree, and its type; '' is unknown.

    Beside the types of the language there are `undefined`, `typeof` and `object`, which has fields. A
    concatenated text has parts.
    """

    node: ast.expr
    type: str = ""
    fields: Mapping[str, Operand] = field(default_factory=dict)
    parts: tuple[Operand, ...] = ()
    #: It may be undefined for a while, though it has a type.
    is_optional: bool = False


UNDEFINED = Operand(ast.Constant(None), "undefined")

#: Says what a name with dots means, and how many of its words it used.
Resolve = Callable[[list[str]], tuple[Operand, int]]


def constant(value: Any) -> Operand:
    """Return a literal as an operand."""
    if isinstance(value, bool):
        return Operand(ast.Name("true" if value else "false"), "bool")
    return Operand(ast.Constant(value), "text" if isinstance(value, str) else "number")


def read(text: str, resolve: Resolve) -> Operand:
    """Parse an expression.

    Raises:
        CannotSay: it has no equivalent.
        AlwaysFails: it is no expression in ECMAScript either.
    """
    if len(text) > MAX_CHARACTERS:
        raise CannotSay(f"an expression of {len(text)} characters")
    try:
        reader = _EcmaReader(text, resolve)
        found = reader.expression()
        reader.expect("")
    except RecursionError:
        raise CannotSay(f"the expression {text!r}") from None
    return found


def truth(found: Operand) -> ast.expr:
    """Return a value as a condition: its truth value in ECMAScript."""
    if found.parts:  # what is put together of several is seldom empty, and only then it is false
        if any(
            part.type in ("number", "bool") or (_is_text(part) and _spelled(part)) for part in found.parts
        ):
            return constant(True).node
        raise CannotSay("a text that is put together, as a condition")
    if found.type in ("number", "text"):
        zero = ast.Constant(0 if found.type == "number" else "")
        return ast.Compare(found.node, [ast.NotEq()], [zero])
    if found.type.startswith("list"):
        return constant(True).node
    return constant(False).node if found.type == "undefined" else found.node


def written(node: ast.expr) -> str:
    """Return the text of an expression."""
    return ast.unparse(node)


def value_of(found: Operand) -> Any:
    """Return a literal as it is, and any other expression as `${ ... }`.

    Raises:
        CannotSay: no variable can have this value.
    """
    if found.parts:
        return "".join(_spelled(part) for part in found.parts)
    if found.type in ("undefined", "typeof", "object"):
        raise CannotSay(f"a value that is {found.type}")
    text = written(found.node)
    try:
        return ast.literal_eval({"true": "True", "false": "False"}.get(text, text))
    except (ValueError, TypeError, SyntaxError):
        return f"${{ {text} }}"


def assignments(script: str) -> Iterator[tuple[str, str]]:
    """Yield location and expression of each statement of a script.

    Raises:
        CannotSay: it does more than assign.
    """
    text = re.sub(r"//[^\n]*|/\*.*?\*/", "", script, flags=re.DOTALL)
    for statement in filter(None, map(str.strip, re.split(r"[;\n]", text))):
        found = _ASSIGNMENT.fullmatch(statement)
        if found is None or (found[2] in ("++", "--")) is bool(found[3]):
            raise CannotSay("a script")
        name, sign, given = found.groups()
        yield name, given if sign == "=" else f"{name} {sign[0]} {f'({given})' if given else 1}"


def own_expression(text: str, states: Mapping[str, str]) -> str:
    """Convert an expression of a document that the engine exported; `states` are the names of states by id.

    Raises:
        CannotSay: it is none.
    """

    def said(found: re.Match[str]) -> str:
        token = found[0]
        if found.string.endswith("In(", 0, found.start()) and token[0] in "'\"":
            return repr(states.get(token[1:-1], token[1:-1]))
        return _OWN_WORDS.get(token, token)

    found = " ".join(_OWN_TOKEN.sub(said, " ".join(text.split())).split())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            ast.parse(found, mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise CannotSay(f"the expression {text!r}") from None
    return found


def _number(text: str) -> float:
    """Return the value of a numeric literal; one that begins with 0 is octal if it can be.

    Raises:
        CannotSay: it is too large.
    """
    if re.fullmatch(r"0[0-7]+", text):
        found: float = int(text, 8)
    elif text[:2].lower() == "0x":
        found = int(text, 16)
    else:
        found = float(text) if re.search(r"[.eE]", text) else int(text)
    if abs(found) <= MAX_INTEGER:
        return found
    with suppress(OverflowError):
        if math.isfinite(found := float(found)):
            return found
    raise CannotSay(f"the number {text}")


def _remainder(left: ast.expr, right: ast.expr) -> ast.expr:
    """Return `left % right` with the sign of `left`, as in ECMAScript; the language's has that of `right`."""
    if isinstance(right, ast.Constant):
        right = ast.Constant(abs(right.value))  # type: ignore[arg-type]
    else:
        right = ast.Call(ast.Name("abs"), [right], [])
    rest = ast.BinOp(left, ast.Mod(), right)
    back = ast.UnaryOp(ast.USub(), ast.BinOp(ast.UnaryOp(ast.USub(), left), ast.Mod(), right))
    return ast.IfExp(ast.Compare(left, [ast.GtE()], [ast.Constant(0)]), rest, back)


def _modulo(left: ast.expr, right: ast.expr, are_numbers: bool) -> Operand:
    """Return `left % right`: a literal where both are, and the right one is not zero."""
    if isinstance(left, ast.Constant) and isinstance(right, ast.Constant) and are_numbers and right.value:
        rest = math.fmod(left.value, right.value)  # type: ignore[arg-type]
        return constant(int(rest) if rest == int(rest) else rest)
    return Operand(_remainder(left, right), "number" if are_numbers else "")


def _logical(left: ast.expr, is_and: bool, right: ast.expr) -> Operand:
    """Return the conjunction or disjunction of two conditions; a side with a known truth is left out."""
    for side, other in ((left, right), (right, left)):
        if (known := _known(side)) is not None:
            return Operand(other if known is is_and else side, "bool")
    both = ast.And() if is_and else ast.Or()
    chained = isinstance(left, ast.BoolOp) and type(left.op) is type(both)
    sides = [*left.values, right] if chained else [left, right]  # type: ignore[attr-defined]
    return Operand(ast.BoolOp(both, sides), "bool")


def _without_sign(node: ast.expr) -> ast.expr:
    """Return a remainder that is compared with 0, where its sign makes no difference."""
    is_remainder = isinstance(node, ast.IfExp) and isinstance(node.body, ast.BinOp)
    return node.body if is_remainder and isinstance(node.body.op, ast.Mod) else node  # type: ignore[attr-defined]


def _rounded(given: ast.expr) -> ast.expr:
    """Return a number rounded as in ECMAScript: halves up; the language rounds them to even."""
    up = ast.BinOp(given, ast.Add(), ast.Constant(0.5))
    is_half = ast.Compare(ast.BinOp(given, ast.Mod(), ast.Constant(1)), [ast.Eq()], [ast.Constant(0.5)])
    return ast.IfExp(is_half, ast.Call(ast.Name("round"), [up], []), ast.Call(ast.Name("round"), [given], []))


def _text_of(value: Any) -> str:
    """Return a literal as text, as in ECMAScript.

    Raises:
        CannotSay: it is a number with an exponent.
    """
    if isinstance(value, bool):
        return str(value).lower()
    found = str(int(value) if isinstance(value, float) and value == int(value) else value)
    if isinstance(value, float) and "e" in found:
        raise CannotSay(f"the number {value} in a text")
    return found


def _known(node: ast.expr) -> bool | None:
    """Return the value of a constant condition; None for any other one."""
    return {"true": True, "false": False}.get(node.id) if isinstance(node, ast.Name) else None


def _spelled(part: Operand) -> str:
    return part.node.value if _is_text(part) else f"${{ {written(part.node)} }}"  # type: ignore[attr-defined]


def _is_text(part: Operand) -> bool:
    return isinstance(part.node, ast.Constant) and isinstance(part.node.value, str)


class _EcmaReader:
    """A recursive descent parser: one method for each level of precedence."""

    def __init__(self, text: str, resolve: Resolve) -> None:
        self._text = text
        self._resolve = resolve
        self._tokens = list(self._split(text.strip()))
        self._at = 0
        self._depth = 0

    def _split(self, text: str) -> Iterator[tuple[str, str]]:
        at = 0
        while at < len(text):
            found = _TOKEN.match(text, at)
            if found is None or found.lastgroup is None:
                raise self._no()
            yield found.lastgroup, found[found.lastgroup]
            at = found.end()

    def _no(self) -> CannotSay:
        return CannotSay(f"the expression {' '.join(self._text.split())!r}")

    @property
    def _next(self) -> str:
        return self._tokens[self._at][1] if self._at < len(self._tokens) else ""

    def _take(self, *signs: str) -> str:
        """Consume the next token if it is one of these."""
        found = self._next
        if found not in signs or not found or self._tokens[self._at][0] in ("text", "number"):
            return ""
        self._at += 1
        return found

    def expect(self, sign: str) -> None:
        """Consume a sign; with '' make sure that this is the end."""
        if not self._take(sign) if sign else self._next:
            raise self._no()

    def expression(self) -> Operand:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise self._no()
        found = self._binary(1)
        if self._take("?"):
            then = self.expression()
            self.expect(":")
            other = self.expression()
            node = ast.IfExp(truth(found), self._plain(then), self._plain(other))
            found = Operand(node, then.type if then.type == other.type else "")
        self._depth -= 1
        return found

    def _plain(self, found: Operand) -> ast.expr:
        """Return the tree of an operand that can be a part of an expression."""
        if found.parts or found.type in ("undefined", "typeof", "object"):
            raise self._no()
        return found.node

    def _binary(self, level: int) -> Operand:
        left = self._unary()
        while (sign := self._next) and _LEVELS.get(sign, 0) >= level and self._take(sign):
            left = self._joined(left, sign, self._binary(_LEVELS[sign] + 1))
        return left

    def _joined(self, left: Operand, sign: str, right: Operand) -> Operand:
        if sign in ("&&", "and", "||", "or"):
            return _logical(truth(left), sign in ("&&", "and"), truth(right))
        if sign in _COMPARISONS:
            return self._compared(left, sign, right)
        if sign == "+" and "text" in (left.type, right.type):
            return self._concatenated(left, right)
        if any(side.type in ("text", "bool") or side.type.startswith("list") for side in (left, right)):
            raise self._no()  # ECMAScript makes numbers of them
        known = left.type == right.type == "number"
        one, other = self._plain(left), self._plain(right)
        if sign == "%":
            return _modulo(one, other, known)
        node = ast.BinOp(one, _ARITHMETIC[sign](), other)
        return Operand(node, "number" if known else "")

    def _concatenated(self, left: Operand, right: Operand) -> Operand:
        """Return a sum with a text in it, as its parts."""
        parts = [part for side in (left, right) for part in side.parts or (side,)]
        if any(part.type == "undefined" or part.type.startswith("list") for part in parts):
            raise self._no()
        return Operand(ast.Constant(""), "text", parts=tuple(parts))

    def _kind_of(self, found: Operand) -> str:
        """Return the value of a `typeof`."""
        of = found.fields["of"]
        if of.type not in _TYPEOF or of.is_optional:
            raise self._no()
        return _TYPEOF[of.type]

    def _compared(self, left: Operand, sign: str, right: Operand) -> Operand:
        same = sign in ("==", "===")
        if left.type == "typeof" and _is_text(right):
            return constant((self._kind_of(left) == ast.literal_eval(right.node)) is same)
        if "undefined" in (left.type, right.type) and sign[0] in "=!" and left.type and right.type:
            return constant((left.type == right.type) is same)
        for side, text in ((left, right), (right, left)):
            if side.parts and _is_text(text) and not text.parts and sign[0] in "=!":
                return self._put_together(side, text.node.value, same)  # type: ignore[attr-defined]
        types = {left.type, right.type} - {""}
        if len(types) > 1:  # ECMAScript converts one of them
            raise self._no()
        one, other = self._plain(left), self._plain(right)
        if sign[0] in "=!" and isinstance(one, ast.Constant) and isinstance(other, ast.Constant) and types:
            return constant((one.value == other.value) is same)
        if sign[0] in "=!" and isinstance(other, ast.Constant) and other.value == 0:
            one = _without_sign(one)
        return Operand(ast.Compare(one, [_COMPARISONS[sign]()], [other]), "bool")

    def _around_the_open_part(self, found: Operand) -> tuple[str, Operand | None, str]:
        """Return the literal text before and after the one part that is no literal; None without one."""
        sides = [""]
        open_part: Operand | None = None
        for part in found.parts:
            if isinstance(part.node, ast.Constant) or _known(part.node) is not None:
                known = _known(part.node)
                sides[-1] += _text_of(part.node.value if known is None else known)  # type: ignore[attr-defined]
            elif open_part is not None or part.type not in ("text", "number"):
                raise self._no()
            else:
                open_part = part
                sides.append("")
        return sides[0], open_part, sides[-1]

    def _put_together(self, found: Operand, text: str, same: bool) -> Operand:
        """Compare a concatenated text, with one part that is no literal, with a literal."""
        left, open_part, right = self._around_the_open_part(found)
        if open_part is None:
            return constant((left == text) is same)
        inner = text[len(left) : len(text) - len(right)]
        if left + inner + right != text:
            return constant(not same)
        wanted: Any = inner
        if open_part.type == "number":
            try:
                wanted = _number(inner.removeprefix("-")) * (-1 if inner.startswith("-") else 1)
            except ValueError:
                return constant(not same)
            if _text_of(wanted) != inner:
                return constant(not same)
        equal = ast.Compare(open_part.node, [ast.Eq() if same else ast.NotEq()], [constant(wanted).node])
        return Operand(equal, "bool")

    def _unary(self) -> Operand:
        sign = self._take("!", "-", "+", "typeof", "not")
        if not sign:
            return self._postfix()
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise self._no()
        found = self._binary(3) if sign == "not" else self._unary()
        self._depth -= 1
        if sign == "typeof":
            return Operand(found.node, "typeof", {"of": found})
        if sign in ("!", "not"):
            known = _known(truth(found))
            return (
                Operand(ast.UnaryOp(ast.Not(), truth(found)), "bool")
                if known is None
                else constant(not known)
            )
        if found.type in ("text", "bool") or found.type.startswith("list"):
            raise self._no()  # ECMAScript makes a number of it
        if sign == "-" and isinstance(found.node, ast.Constant) and found.type == "number":
            return constant(-found.node.value)  # type: ignore[operator]
        return found if sign == "+" else Operand(ast.UnaryOp(ast.USub(), self._plain(found)), found.type)

    def _postfix(self) -> Operand:
        found = self._primary()
        while True:
            if found.type.startswith("list") and self._take("["):
                index = self._plain(self.expression())
                self.expect("]")
                found = Operand(ast.Subscript(found.node, index), found.type.removeprefix("list of "))
            elif self._next == "." and found.type.startswith("list"):
                self._take(".")
                found = self._of_list(found)
            else:
                return found

    def _of_list(self, found: Operand) -> Operand:
        if self._take("length"):
            return Operand(ast.Call(ast.Name("len"), [found.node], []), "number")
        if self._take("includes"):
            self.expect("(")
            wanted = self._plain(self.expression())
            self.expect(")")
            return Operand(ast.Compare(wanted, [ast.In()], [found.node]), "bool")
        raise self._no()

    def _primary(self) -> Operand:
        if self._take("("):
            found = self.expression()
            self.expect(")")
            return found
        if self._take("["):
            return self._list()
        if self._take("{"):
            return self._object()
        if not self._next:
            raise self._no()
        kind, text = self._tokens[self._at]
        self._at += 1
        if kind == "number":
            return constant(_number(text))
        if kind == "text":
            return constant(text[1:-1])
        if kind == "name":
            return self._name(text)
        raise self._no()

    def _list(self) -> Operand:
        elements: list[Operand] = []
        while not self._take("]"):
            if elements:
                self.expect(",")
            elements.append(self.expression())
        kinds = {element.type for element in elements}
        if len(kinds) > 1 or not kinds <= {"number", "text", "bool"}:
            raise self._no()
        return Operand(
            ast.List([self._plain(e) for e in elements]), f"list of {kinds.pop() if kinds else 'number'}"
        )

    def _object(self) -> Operand:
        fields: dict[str, Operand] = {}
        while not self._take("}"):
            if fields:
                self.expect(",")
            kind, text = self._tokens[self._at] if self._next else ("", "")
            self._at += 1
            self.expect(":")
            fields[text[1:-1] if kind == "text" else text] = self.expression()
        return Operand(ast.Constant(None), "object", fields)

    def _name(self, first: str) -> Operand:
        if first in _STATEMENTS:
            raise AlwaysFails(f"{first!r} is no expression")
        if first in ("true", "false", "True", "False"):
            return constant(first.lower() == "true")
        if first in ("undefined", "null", "None"):
            return UNDEFINED
        words = [first]
        while (after := self._field()) is not None:
            words.append(after)
        if self._take("("):
            return self._call(".".join(words))
        found, used = self._resolve(words)
        for word in words[used:]:
            if found.type == "object" and word in found.fields:
                found = found.fields[word]
            elif word == "length" and found.type.startswith("list"):
                found = Operand(ast.Call(ast.Name("len"), [found.node], []), "number")
            else:
                raise self._no()
        return found

    def _field(self) -> str | None:
        """Return the word of a following `.word` or `['word']`; methods of lists are parsed elsewhere."""
        ahead = self._tokens[self._at : self._at + 3]
        if len(ahead) > 1 and ahead[0][1] == "." and ahead[1][0] == "name" and ahead[1][1] != "includes":
            self._at += 2
            return ahead[1][1]
        if len(ahead) > 2 and ahead[0] == ("sign", "[") and ahead[1][0] == "text" and ahead[2][1] == "]":
            self._at += 3
            return ahead[1][1][1:-1]
        return None

    def _given(self) -> list[Operand]:
        """Parse the arguments of a call, and its closing bracket."""
        given: list[Operand] = []
        while not self._take(")"):
            if given:
                self.expect(",")
            given.append(self.expression())
        return given

    def _call(self, name: str) -> Operand:
        if name == "In" and self._tokens[self._at + 1 : self._at + 2] == [("sign", ")")]:
            # Where there is no data, SCXML lets the id stand without quotes.
            state, _ = self._resolve(["In", self._next.strip("'\"")])
            self._at += 2
            return Operand(ast.Call(ast.Name("in_state"), [state.node], []), "bool")
        given = self._given()
        plain = [self._plain(one) for one in given]
        if name == "Math.floor" and len(given) == 1:
            return Operand(ast.BinOp(plain[0], ast.FloorDiv(), ast.Constant(1)), "number")
        if name == "Math.round" and len(given) == 1:
            known = isinstance(plain[0], ast.Constant) and given[0].type == "number"
            if known:
                return constant(math.floor(plain[0].value + 0.5))  # type: ignore[attr-defined]
            return Operand(_rounded(plain[0]), "number")
        if name in ("Math.max", "Math.min") and len(given) == 1:
            return given[0]
        if name in _MATH and given:
            return Operand(ast.Call(ast.Name(_MATH[name]), list(plain), []), "number")
        raise self._no()
