"""Texts with expressions in them: `shelf ${ target.id }: ${ event.depth:.1f cm }`.

Each expression may be a text, a number, a yes or no, or a list of those, which is joined with commas. A
number is followed by its unit. A format after a colon gives the digits (`.1f`), the unit of its dimension
(`cm`, `min`, `%`), or both.
"""

from __future__ import annotations

import re

from lupin_engine.chart.expressions import units as q
from lupin_engine.chart.expressions.checker import check_expression
from lupin_engine.chart.expressions.evaluation import Compiled, Expression
from lupin_engine.chart.expressions.names import renamed
from lupin_engine.chart.expressions.scope import Fragment, Inset, Scope, Typed, insets
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.source import Text
from lupin_engine.plugin.types import ANY, TEXT, UNITS, Type, innermost, units_of

_FORMAT = re.compile(r"\s*(?:\.([0-9])f)?\s*([A-Za-z°%][A-Za-z0-9/]*)?\s*")
#: What is more than the name of a value.
_COMPUTES = re.compile(r"[-+*/%(]")
_EXAMPLE = "write digits, a unit or both, such as ':.1f', ':min' or ':.1f cm'"


def read_text(raw: Text, scope: Scope, findings: Findings, path: str) -> Expression | None:
    """Read a text with expressions in it; None after findings."""
    typed = check_text(raw, scope, findings, path)
    return (
        None
        if typed is None
        else Expression(renamed(str(raw), scope.out), raw.place, TEXT, Compiled(typed.code))
    )


def check_text(raw: Text, scope: Scope, findings: Findings, path: str) -> Typed | None:
    """Check a text with expressions in it without compiling it; None after findings."""
    parts: list[str] = []
    begin, right = 0, True
    for inset in insets(raw):
        if inset.end < 0:
            problem, hint = "the expression in this text is not closed", "write '}' behind it"
            findings.add(raw.at(inset.begin), "bad-expression", path, problem, hint)
            return None
        parts.append(repr(raw[begin : inset.begin]))
        code = _Inserted(raw, inset, findings, path).code(scope)
        right = right and code is not None
        parts.append(code or "''")
        begin = inset.end
    parts.append(repr(raw[begin:]))
    code = f"''.join([{', '.join(part for part in parts if part != repr(''))}])"
    return Typed(TEXT, code) if right else None


class _Inserted:
    """An expression in a text, and the format of its value."""

    def __init__(self, raw: Text, inset: Inset, findings: Findings, path: str) -> None:
        self._raw, self._inset = raw, inset
        self._findings, self._path = findings, path
        self._source = raw[inset.begin + 2 : inset.colon if inset.colon >= 0 else inset.end - 1]

    def code(self, scope: Scope) -> str | None:
        """Return the code of the text that it becomes; None after findings."""
        inset = self._inset
        fragment = Fragment(self._source, self._raw, inset.begin + 2)
        typed = check_expression(fragment, scope, ANY, self._findings, self._path)
        form = None if inset.colon < 0 else _FORMAT.fullmatch(self._raw, inset.colon + 1, inset.end - 1)
        if inset.colon >= 0 and (form is None or not any(form.groups())):
            written = self._raw[inset.colon : inset.end - 1].strip()
            self._add(inset.colon, "bad-expression", f"{written!r} is no way to tell a value", _EXAMPLE)
            return None
        digits, unit = form.groups() if form else (None, None)
        if typed is None or not self._fits(typed.type, digits, unit):
            return None
        own = innermost(typed.type).unit
        unit_shown = unit or ("" if own == "*" else own)
        known = own in UNITS and UNITS[own][0] != own  # in a binding a number may be in another unit
        code = f"_in_base({typed.code}, {own!r})" if known else typed.code
        computed = self._source.strip() if _COMPUTES.search(self._source) else ""
        return f"_text({code}, {unit_shown!r}, {digits}, {computed!r})"

    def _fits(self, kind: Type, digits: str | None, unit: str | None) -> bool:
        inner = innermost(kind)
        if inner.kind == "any":
            return True
        shown = self._source.strip()
        if inner.kind == "record":
            hint = f"name a field: '{shown}.{next(iter(inner.fields), 'FIELD')}'"
            self._add(self._first, "wrong-type", f"{shown!r} is {q.describe(kind)}, which is no text", hint)
            return False
        if (digits or unit) and not q.is_number(inner):
            problem = f"{shown!r} is {q.describe(kind)}, and only numbers have digits and units"
            self._add(self._inset.colon, "wrong-type", problem, "leave the ':' out")
            return False
        base = UNITS[inner.unit][0] if inner.unit in UNITS else inner.unit
        if unit and inner.unit != "*" and (unit not in UNITS or UNITS[unit][0] != base):
            units = ", ".join(map(repr, units_of(base)))
            hint = f"its units are {units}" if base else "leave the unit out, or write '%'"
            self._add(
                self._inset.colon, "wrong-unit", f"{shown!r} is {q.describe(kind)}, not in {unit!r}", hint
            )
            return False
        return True

    @property
    def _first(self) -> int:
        return self._inset.begin + 2 + len(self._source) - len(self._source.lstrip())

    def _add(self, offset: int, rule: str, problem: str, hint: str) -> None:
        self._findings.add(self._raw.at(offset), rule, self._path, problem, hint)
