"""Conditions about every moment, with and without a mission: their scope, and properties made of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace

from lupin_engine.chart.compose.declare import CLOCK, input_type
from lupin_engine.chart.documents import PropertyNode
from lupin_engine.chart.expressions.evaluation import Expression
from lupin_engine.chart.expressions.guards import FALSE, TRUE, formula_of, implies, negate, possible
from lupin_engine.chart.expressions.scope import Scope
from lupin_engine.chart.expressions.units import one
from lupin_engine.chart.expressions.values import read_guard, read_key
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import Chart, TemporalProperty
from lupin_engine.chart.strictness import stricter
from lupin_engine.errors import Place, Severity
from lupin_engine.plugin.contract import ENGINE_CODES, OPERATION_CODES, OWN_HOLDS
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import BOOL, DURATION, TEXT, Type, list_of

#: What such a condition does not see, because it is told of every moment.
_MOMENTARY = ("event", "error", "request", "target", "itinerary")
#: The properties that are watched in every mission; a property of an author has another name.
WATCHED_ALWAYS = frozenset(
    {"hold_starts_nothing", "hold_stops_all", "no_false_start", "closed_once", "all_closed"}
    | {"former_attempts", "no_execution_error", "invariants", "ends_are_handled", "no_deaf_wait"}
    | {"refusals_have_reasons", "time_goes_on", "no_exception", "resources_exclude", "outcomes"}
    | {"home_again", "silence_is_told", "abort_stops", "no_zeno", "no_livelock"}
)
#: The properties that are watched where a file names them: `NAME: {built_in: true}`.
BUILT_IN_NAMES = frozenset(
    {"good_at_its_target", "good_after_success", "nothing_after_close", "no_second_round"}
    | {"resume_goes_on", "answers_lead_on", "success_ends", "failure_ends"}
)
#: Those of them that are about all runs together.
OF_THE_GRAPH = frozenset({"success_ends", "failure_ends"})
_REQUEST = re.compile(r"(?<![\w.'\"])request\b")
_CONDITIONS, _PLACES = ("always", "never", "eventually"), ("visit_all", "visit_in_order")
_KINDS = (*_CONDITIONS, *_PLACES)
_MORE = ("within", "after", "until")


def timeless(scope: Scope, what: str, catalog: Catalog, codes: Iterable[str]) -> Scope:
    """Return a scope for conditions about every moment: no temporary names, but the engine's own holds.

    `what` is `invariant` or `property`; `codes` are those that the chart declares. A property sees the step.
    It may read the request of a mission: it is about that mission's runs then.
    """
    verb = "holds at" if what == "invariant" else "is about"
    for name in _MOMENTARY:
        if (what, name) != ("property", "request") or name not in scope.names:
            scope = scope.without(name, f"{one(what)} {verb} every moment, with and without a mission")
    scope = replace(scope, holds=(*scope.holds, *OWN_HOLDS))
    return (
        scope if what == "invariant" else scope.with_names({"this_step": _step(catalog, scope.holds, codes)})
    )


def _step(catalog: Catalog, holds: Iterable[str], codes: Iterable[str]) -> Type:
    """Return the type of what a property sees of a step; see `properties.authored`."""
    operations = list_of(Type("text", "operation", values=tuple(catalog.operations)))
    request = Type("text", "request", values=("", *catalog.profile.events))
    of_operations = (code.name for one in catalog.operations.values() for code in one.codes)
    known = dict.fromkeys((*codes, *of_operations, *ENGINE_CODES, *OPERATION_CODES))
    fields = {
        "accepted": request,
        "refused": request,
        "because": TEXT,
        "released": list_of(Type("text", "hold", values=tuple(holds))),
        "begun": operations,
        "succeeded": operations,
        "failed": operations,
        "given_up": operations,
        "bypassed": operations,
        "codes": list_of(Type("text", "code", values=tuple(known))),
        "divert": TEXT,
        "moving": BOOL,
        "waiting": BOOL,
    }
    return Type("record", "this_step", fields=fields)


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
    return timeless(
        Scope(names, chart.catalog.functions, states, tuple(chart.holds)),
        "property",
        chart.catalog,
        chart.codes,
    )


def read_property(
    name: str, node: PropertyNode, place: Place, scope: Scope, findings: Findings, mission: str = ""
) -> TemporalProperty | None:
    """Read a property, of a mission if it stands in one; None after findings."""
    path, known = f"properties.{name}", len(findings.errors)
    _check_shape(name, node, path, findings)
    if any(_is_written(node, key) for key in _PLACES):
        _check_places(node, path, findings, mission)
    keys = (*_CONDITIONS, "after", "until")
    said = {
        key: read_guard(getattr(node, key), node.at(key), scope, findings, f"{path}.{key}") for key in keys
    }
    places = {key: _read_places(node, key, scope, findings, path) for key in _PLACES}
    within = read_key(node, "within", DURATION, scope, findings, path)
    if len(findings.errors) > known:
        return None
    _warn_of_what_cannot_break(said, place, path, findings)
    sources = [each.source for each in (*said.values(), within) if isinstance(each, Expression)]
    sources += [source for found in places.values() for source in found]
    begins_anew = any(places.values()) or (node.until is not None and node.after is None)
    about = mission if begins_anew or any(map(_REQUEST.search, sources)) else ""
    return TemporalProperty(
        name,
        place,
        said["always"],
        said["never"],
        said["eventually"],
        places["visit_all"],
        places["visit_in_order"],
        within,
        said["after"],
        said["until"],
        node.summary,
        about,
        node.built_in,
        breach=node.breach,
        code=node.code,
    )


def _warn_of_what_cannot_break(
    said: Mapping[str, Expression | None], place: Place, path: str, findings: Findings
) -> None:
    """Warn of a property that holds in every run, whatever the mission does."""
    known = {key: formula_of(one.source) for key, one in said.items() if one is not None}
    until, after = known.get("until", FALSE), known.get("after", TRUE)
    breach = known.get("never") or (negate(known["always"]) if "always" in known else TRUE)
    if not possible(breach):
        why, hint = "its condition is a constant", "write what may be false"
    elif until != FALSE and implies(after, until):
        why, hint = "'until' is true whenever 'after' is, so it never begins", "leave one of them out"
    elif until != FALSE and "eventually" not in known and implies(breach, until):
        broken = "'never' is" if "never" in known else "'always' is not"
        why = f"'until' is true whenever {broken}"
        hint = "write as 'until' what ends it before a breach"
    elif "eventually" in known and "after" in known and implies(after, known["eventually"]):
        why, hint = "what shall come is true whenever 'after' is", "write what is not true yet"
    else:
        return
    findings.warn(place, "never-breaks", path, f"no run can break it: {why}", hint)


def _read_places(
    node: PropertyNode, key: str, scope: Scope, findings: Findings, path: str
) -> dict[str, Expression]:
    """Read the places under a key, by their text; one that is wrong is a finding, and left out."""
    found: dict[str, Expression] = {}
    for number, raw in enumerate(getattr(node, key)):
        place = node.at(key, number)
        one = read_guard(raw, place, scope, findings, f"{path}.{key}.{number}")
        if one is not None and one.source in found:
            problem = f"{one.source} stands here twice"
            findings.add(place, "wrong-shape", f"{path}.{key}", problem, "name each place once")
        elif one is not None:
            found[one.source] = one
    return found


def _check_places(node: PropertyNode, path: str, findings: Findings, mission: str) -> None:
    """Check what else stands beside places, and where they stand."""
    key = next(key for key in _PLACES if _is_written(node, key))
    at, count = node.at(key), len(getattr(node, key))
    if not mission:
        problem = f"'{key}' is about the runs of one mission"
        findings.add(at, "wrong-shape", path, problem, "write it in the file of that mission")
    if not count:
        findings.add(at, "wrong-shape", path, f"'{key}' names no place", f"write '{key}: [CONDITION, ...]'")
    if count == 1 and key == "visit_in_order":
        hint = "name another one, or write 'visit_all'"
        findings.add(at, "wrong-shape", path, "one place alone has no order", hint)
    if node.after is not None:
        problem = f"'{key}' begins with the mission, not with 'after'"
        findings.add(node.at("after"), "wrong-shape", path, problem, "leave it out")


def _is_written(node: PropertyNode, key: str) -> bool:
    return getattr(node, key) not in (None, ())


def own_name(name: str, node: PropertyNode, place: Place, findings: Findings) -> str | None:
    """Return the name of an author's property; None after a finding that it is that of a built-in one.

    While that is a warning, the property is called `my_NAME`.
    """
    if name not in WATCHED_ALWAYS and (node.built_in or name not in BUILT_IN_NAMES):
        return name
    problem = f"there is a property {name!r} already, of every mission"
    hint = f"call it my_{name}"
    if name in BUILT_IN_NAMES:
        problem, hint = f"{name!r} is built in", f"write 'built_in: true', or call it my_{name}"
    taken = stricter("property-name", place, f"properties.{name}", problem, hint)
    findings.extend([taken])
    return f"my_{name}" if taken.severity is Severity.WARN else None


def _check_built_in(name: str, node: PropertyNode, written: list[str], findings: Findings) -> None:
    if name not in BUILT_IN_NAMES:
        findings.unknown(
            node.at("built_in"),
            "unknown-property",
            f"properties.{name}",
            "built-in property",
            name,
            BUILT_IN_NAMES,
        )
    if name in OF_THE_GRAPH and (node.breach != "report" or node.code is not None):
        at, key = ("breach", node.breach) if node.breach != "report" else ("code", node.code)
        problem = f"no robot can see a breach of {name!r}: only a proof decides it"
        where, hint = f"properties.{name}.{at}", f"leave '{at}: {key}' out"
        findings.add(node.at(at), "never-happens", where, problem, hint)
    for key in written:
        problem = f"{key!r} says something of {name!r}, which is built in"
        findings.add(node.at(key), "wrong-shape", f"properties.{name}.{key}", problem, "leave it out")


def _check_shape(name: str, node: PropertyNode, path: str, findings: Findings) -> None:
    kinds = [key for key in _KINDS if _is_written(node, key)]
    if node.built_in:
        _check_built_in(
            name, node, [*kinds, *(key for key in _MORE if getattr(node, key) is not None)], findings
        )
        return
    if len(kinds) != 1:
        found = f"got {' and '.join(kinds)}" if kinds else "got none"
        problem, hint = (
            f"expected one of {', '.join(_KINDS[:-1])} and {_KINDS[-1]}, {found}",
            "write two properties",
        )
        findings.add(node.place, "wrong-shape", path, problem, hint if kinds else "write 'always: CONDITION'")
    if "eventually" in kinds and node.within is None:
        problem = "what comes eventually needs a time in which it does"
        findings.add(node.place, "missing-key", path, problem, "write 'within: 10 s'")
    if node.within is not None and kinds and "eventually" not in kinds:
        problem = f"'within' belongs to eventually, not to {kinds[0]}"
        findings.add(node.at("within"), "wrong-shape", path, problem, "leave it out, or write 'until: ...'")


__all__ = ["own_name", "read_property", "scope_of", "timeless"]
