"""Types of event payloads and of done data, which are not declared.

They are inferred from the writers. A reader may come before its writer, so composition is repeated to a fixed
point (at most `compose.MAX_LEARNED` times), and then once more with what was inferred.
"""

from __future__ import annotations

from collections.abc import Mapping

from lupin_engine.chart.compose.declare import NAME
from lupin_engine.chart.compose.tree import Draft, texts_of
from lupin_engine.chart.documents import RaiseNode, written_in
from lupin_engine.chart.expressions.evaluation import Value
from lupin_engine.chart.expressions.scope import Scope
from lupin_engine.chart.expressions.units import join
from lupin_engine.chart.expressions.values import read_literal
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.source import Map, map_at
from lupin_engine.errors import Place
from lupin_engine.plugin.types import ANY, Type

NOTHING = Type("record", "event")
#: No event that is raised begins like that.
_END = "done."


class Carried:
    """The types of payloads by event, and of done data by the state that ends, as all writers agree on."""

    def __init__(
        self, findings: Findings, known: Mapping[str, Type] | None = None, unknown: Type = NOTHING
    ) -> None:
        """Start from the types that an earlier pass has inferred; the others are `unknown`."""
        self._findings = findings
        self.known = known or {}
        self._unknown = unknown
        self._places: dict[str, Place] = {}
        #: What this look at the chart has found.
        self.found: dict[str, Type] = {}

    def fields_of(self, name: str) -> Type:
        """Return the type of `event` for listeners to a raised event, or to the end of a state."""
        return self.known.get(name, self._unknown)

    def read(self, name: str, given: Map | None, place: Place, scope: Scope, path: str) -> dict[str, Value]:
        """Read the payload of an event or a result; all writers must agree on its fields."""
        values: dict[str, Value] = {}
        fields: dict[str, Type] = {}
        written = map_at(place) if given is None else given
        for field in written:
            if not NAME.fullmatch(field):
                at, hint = written.key_place(field), "use letters, digits and underscores"
                self._findings.add(at, "bad-name", path, f"{str(field)!r} cannot be a field", hint)
            value = read_literal(written, field, scope, self._findings, f"{path}.{field}")
            fields[str(field)] = value.type if value is not None else ANY
            if value is not None:
                values[str(field)] = value
        self._agree(name, Type("record", "event", fields=fields), place, path)
        return values

    def _agree(self, name: str, kind: Type, place: Place, path: str) -> None:
        first = self.found.setdefault(name, kind)
        there = self._places.setdefault(name, place)
        joined = {field: join(first.fields.get(field, ANY), found) for field, found in kind.fields.items()}
        if first.fields.keys() == kind.fields.keys() and None not in joined.values():
            self.found[name] = Type("record", "event", fields={f: t for f, t in joined.items() if t})
            return
        where = f"line {there.line}" if there.file == place.file else str(there)
        what = f"the end of {name.removeprefix(_END)!r}" if name.startswith(_END) else repr(name)
        problem = f"{what} carries {_shown_type(kind)} here, and {_shown_type(first)} in {where}"
        self._findings.add(place, "different-fields", path, problem, "give it the same fields everywhere")


def _shown_type(kind: Type) -> str:
    return ", ".join(f"{name!r} ({found})" for name, found in kind.fields.items()) or "nothing"


def end_of(state: str) -> str:
    """Return the name under which the result of a state is kept."""
    return f"{_END}{state}"


def carries_something(draft: Draft) -> bool:
    """Say whether a state's text raises an event with fields, or has a result."""
    if draft.node is not None and draft.node.result:
        return True
    return any(found.with_ for node in texts_of(draft) for found in written_in(node, RaiseNode))
