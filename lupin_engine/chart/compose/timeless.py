"""Conditions about every moment, with and without a mission: their scope, and properties made of them."""

from __future__ import annotations

import re
from dataclasses import replace

from lupin_engine.chart.compose.declare import CLOCK, input_type
from lupin_engine.chart.documents import PropertyNode
from lupin_engine.chart.expressions.evaluation import Expression
from lupin_engine.chart.expressions.scope import Scope
from lupin_engine.chart.expressions.units import one
from lupin_engine.chart.expressions.values import read_guard, read_key
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import Chart, TemporalProperty
from lupin_engine.errors import Place
from lupin_engine.plugin.contract import OWN_HOLDS
from lupin_engine.plugin.types import DURATION, Type

#: What such a condition does not see, because it is told of every moment.
_MOMENTARY = ("event", "error", "request", "target", "itinerary")
#: The properties that are watched in every mission; a property of an author has another name.
WATCHED_ALWAYS = frozenset(
    {"hold_starts_nothing", "hold_stops_all", "no_false_start", "closed_once", "all_closed"}
    | {"former_attempts", "no_execution_error", "invariants", "ends_are_handled", "no_deaf_wait"}
    | {"refusals_have_reasons", "time_goes_on", "no_exception", "resources_exclude", "outcomes"}
    | {"home_again", "silence_is_told", "abort_stops", "no_zeno", "no_livelock"}
)
_REQUEST = re.compile(r"(?<![\w.'\"])request\b")
_KINDS = ("always", "never", "eventually")


def timeless(scope: Scope, what: str) -> Scope:
    """Return a scope without temporary names, with the engine's own holds; `what` is written in it.

    A property may read the request where there is one: it is about that mission's runs then.
    """
    verb = "holds at" if what == "invariant" else "is about"
    for name in _MOMENTARY:
        if (what, name) != ("property", "request") or name not in scope.names:
            scope = scope.without(name, f"{one(what)} {verb} every moment, with and without a mission")
    return replace(scope, holds=(*scope.holds, *OWN_HOLDS))


def scope_of(chart: Chart) -> Scope:
    """Return the scope of a property outside of the files of a chart."""
    names = {
        "param": Type("record", "param", fields={n: p.type for n, p in chart.parameters.items()}),
        "input": Type("record", "input", fields={n: input_type(i) for n, i in chart.inputs.items()}),
        **{name: variable.type for name, variable in chart.context.items()},
        "clock": CLOCK,
    }
    if len(chart.missions) == 1:
        (mission,) = chart.missions.values()
        fields = {name: field.type for name, field in mission.request.items()}
        names["request"] = Type("record", "request", fields=fields)
    states = tuple(name for name in chart.states if name)
    return timeless(Scope(names, chart.catalog.functions, states, tuple(chart.holds)), "property")


def read_property(
    name: str, node: PropertyNode, place: Place, scope: Scope, findings: Findings, mission: str = ""
) -> TemporalProperty | None:
    """Read a property, of a mission if there is one; None after findings."""
    path, known = f"properties.{name}", len(findings.errors)
    _check_shape(node, path, findings)
    keys = (*_KINDS, "after", "until")
    said = {
        key: read_guard(getattr(node, key), node.at(key), scope, findings, f"{path}.{key}") for key in keys
    }
    within = read_key(node, "within", DURATION, scope, findings, path)
    if len(findings.errors) > known:
        return None
    sources = [each.source for each in (*said.values(), within) if isinstance(each, Expression)]
    about = mission if any(map(_REQUEST.search, sources)) else ""
    return TemporalProperty(name, place, within=within, summary=node.summary, mission=about, **said)


def _check_shape(node: PropertyNode, path: str, findings: Findings) -> None:
    kinds = [key for key in _KINDS if getattr(node, key) is not None]
    if len(kinds) != 1:
        found = f"got {' and '.join(kinds)}" if kinds else "got none"
        problem, hint = f"expected one of always, never and eventually, {found}", "write two properties"
        findings.add(node.place, "wrong-shape", path, problem, hint if kinds else "write 'always: CONDITION'")
    if "eventually" in kinds and node.within is None:
        problem = "what comes eventually needs a time in which it does"
        findings.add(node.place, "missing-key", path, problem, "write 'within: 10 s'")
    if node.within is not None and kinds and "eventually" not in kinds:
        problem = f"'within' belongs to eventually, not to {kinds[0]}"
        findings.add(node.at("within"), "wrong-shape", path, problem, "leave it out, or write 'until: ...'")
    if node.until is not None and node.after is None:
        problem, hint = "'until' ends what 'after' begins", "write 'after: CONDITION', or leave it out"
        findings.add(node.at("until"), "missing-key", path, problem, hint)


__all__ = ["read_property", "scope_of", "timeless"]
