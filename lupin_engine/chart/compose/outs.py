"""What parts report: variables of their users, which a part reads and writes by a name of its own.

A name is replaced by the variable of its use when the chart is composed: machine, snapshot, journal and proof
have that one variable and nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping

from lupin_engine.chart.compose.declare import Declarer
from lupin_engine.chart.compose.tree import Draft
from lupin_engine.chart.documents import PartNode, StateNode
from lupin_engine.chart.expressions.scope import Scope
from lupin_engine.chart.expressions.units import accepts, describe
from lupin_engine.chart.findings import Findings
from lupin_engine.errors import Place, declared_as, nearest, or_else
from lupin_engine.plugin.types import Type


class Outs:
    """Resolves what the uses of parts name for their variables."""

    def __init__(self, declarer: Declarer, findings: Findings) -> None:
        self._declarer = declarer
        self._findings = findings
        #: The types of what each part reports, read once.
        self._types: dict[str, dict[str, Type]] = {}

    def bind(self, draft: Draft, node: StateNode, part: PartNode, scope: Scope) -> dict[str, str]:
        """Return the variable of a use for each name of its part; '' for a name with findings."""
        types, found = self._types_of(part), dict.fromkeys(part.out, "")
        for name, text in node.out.items():
            at, path = node.key_at("out", name), f"{draft.name}.out.{name}"
            if name not in part.out:
                what = "variable that the part reports"
                self._findings.unknown(at, "unknown-argument", path, what, name, part.out)
                continue
            place = node.value_at("out", name)
            variable = self._variable(text, place, path, scope)
            if variable is None or name not in types:
                continue
            if not self._fits(name, types[name], variable, place, path):
                continue
            other = next((one for one, taken in found.items() if taken == variable), None)
            if other is not None:
                problem = f"{text!r} takes {other!r} as well, so the part would write one into the other"
                self._findings.add(place, "conflicting-definition", path, problem, "name another variable")
            found[name] = variable
        for name in part.out:
            if name not in node.out:
                problem = f"the part {part.part!r} reports {name!r}, and no variable takes it"
                hint = f"add 'out: {{{name}: VARIABLE}}'"
                path = f"{draft.name}.out"
                self._findings.add(node.at("use"), "missing-argument", path, problem, hint)
        return found

    def _types_of(self, part: PartNode) -> Mapping[str, Type]:
        if part.title not in self._types:
            known = self._types[part.title] = {}
            for name, node in part.out.items():
                path = f"out.{name}"
                if self._declarer.good_name("variable", name, part.key_at("out", name), path):
                    kind = self._declarer.measured(node, node.type, node.unit, path)
                    known.update({} if kind is None else {name: kind})
        return self._types[part.title]

    def _variable(self, text: str, place: Place, path: str, scope: Scope) -> str | None:
        """Return the variable that a use names, perhaps by the name that a part around it has for it."""
        declared, name = self._declarer.declared, scope.out.get(text) or text
        if name in declared.context:
            return name
        root, _, last = text.rpartition(".")
        problem, hint = (
            f"unknown variable {text!r}",
            or_else(
                nearest(text, declared.context) if declared.context else "", declared_as("context", text)
            ),
        )
        if root == "context" and last in declared.context:
            hint = f"write {last!r}"
        elif text.startswith("${") or root:
            problem, hint = f"{text!r} is no variable, so nothing can be written into it", "name a variable"
        elif text in declared.parameters or text in declared.inputs:
            what = "a parameter" if text in declared.parameters else "an input"
            problem, hint = f"{text!r} is {what}, which nothing in a mission writes", "name a variable"
        self._findings.add(place, "unknown-argument", path, problem, hint)
        return None

    def _fits(self, name: str, kind: Type, variable: str, place: Place, path: str) -> bool:
        """Say whether a variable has the type that the part reads and writes; a finding otherwise."""
        known = self._declarer.declared.context[variable].type
        if accepts(kind, known) and accepts(known, kind):
            return True
        problem = f"the part reports {name!r} as {describe(kind)}, but {variable!r} is {describe(known)}"
        self._findings.add(place, "wrong-type", path, problem, "give both the same type")
        return False
