"""Rules about unused declarations, and events without listeners."""

from __future__ import annotations

from collections.abc import Iterator

from lupin_engine.chart.expressions.evaluation import Constant, Value
from lupin_engine.chart.expressions.values import MISTAKEN
from lupin_engine.chart.findings import warning
from lupin_engine.chart.model import WRITING
from lupin_engine.chart.rules.index import Index
from lupin_engine.chart.rules.written import codes_of
from lupin_engine.chart.semantics import matches
from lupin_engine.errors import Diagnostic, Place

# -- parameters -------------------------------------------------------------------------------------------


def unused_parameter(index: Index) -> Iterator[Diagnostic]:
    """Find a parameter that a file declares and no expression reads.

    An inherited one cannot be removed: that an override has left it without a reader is a warning.
    """
    rule, chart, known = "unused-parameter", index.chart, index.composed.declared.parameters
    for name, place in _declared(index, "parameter"):
        if name in index.composed.usage.parameters or (name in known and known[name].type is MISTAKEN):
            continue
        problem, path = f"nothing reads the parameter {name!r}", f"params.{name}"
        if place.file in chart.lifecycle_files[1:]:
            at = index.composed.drafts[""].file.at("extends")
            problem += f" of {chart.extends} any more"
            yield warning(at, rule, path, problem, f"let the override read it as param.{name}")
        else:
            yield Diagnostic(place, rule, path, problem, f"read it as param.{name}, or remove it")


def _declared(index: Index, family: str) -> Iterator[tuple[str, Place]]:
    for (kind, name), place in index.composed.declared.places.items():
        if kind == family:
            yield name, place


# -- events -----------------------------------------------------------------------------------------------


def unheard_event(index: Index) -> Iterator[Diagnostic]:
    """Find an event that is raised and that nothing in the chart listens to."""
    raised = [call for call in index.calls if call.action.name == "raise"]
    if not raised:
        return
    patterns = {t.event for state in index.states for t in state.transitions}
    wild = [pattern for pattern in patterns if pattern.endswith("*")]
    for call in raised:
        value = call.action.arguments["event"]
        event = value.value if isinstance(value, Constant) else ""
        if event not in patterns and not any(matches(pattern, event) for pattern in wild):
            problem, hint = (
                f"nothing listens to {event!r}",
                f"write 'on: {{{event}: STATE}}' somewhere, or remove it",
            )
            yield warning(value.place, "unheard-event", call.path, problem, hint)


# -- declarations -----------------------------------------------------------------------------------------


def unused_code(index: Index) -> Iterator[Diagnostic]:
    """Find a code that a file declares and that nothing reports or asks for."""
    declared = _own(index, "code")
    used = _codes_used(index) if declared else set()
    for name, place in declared:
        if name not in used and not index.texts.quotes(name):
            problem, hint = f"nothing reports the code {name!r}", "report it as 'code', or remove it"
            yield warning(place, "unused-code", f"codes.{name}", problem, hint)


def _own(index: Index, family: str) -> list[tuple[str, Place]]:
    """Return the declarations that must be used in these files; the lifecycle's may be for other missions."""
    lifecycle = index.chart.lifecycle_files
    return [(name, place) for name, place in _declared(index, family) if place.file not in lifecycle]


def _codes_used(index: Index) -> set[str]:
    """Return all codes that are reported or asked for, and other texts among them."""
    used = codes_of(index.sayings)
    for work in index.works:
        used.update([code.name for code in work.invoke.operation.codes])
    for call in index.calls:
        for value in call.action.arguments.values():
            if isinstance(value, Constant) and value.type.kind == "text":
                used.add(value.value)
    for mission in index.chart.missions.values():
        for field in mission.request.values():
            used.add(f"unknown_{(field.type.item or field.type).name}")  # of a wrong value, by its reader
    return used


def unused_input(index: Index) -> Iterator[Diagnostic]:
    """Find an input, or a level of one, that nothing reads or listens to."""
    declared = _own(index, "input")
    if not declared:
        return
    heard = {t.event for t in index.eventless} | {hold.engage for hold in index.chart.holds.values()}
    read = index.composed.usage.inputs
    for name, place in declared:
        levels = [f"input.{name}.{level.name}" for level in index.chart.inputs[name].levels]
        if name not in read and heard.isdisjoint([f"input.{name}", *levels]):
            problem, hint = f"nothing reads the input {name!r}", f"read it as input.{name}, or remove it"
            yield warning(place, "unused-input", f"inputs.{name}", problem, hint)
            continue
        for level in levels:
            if level not in heard and not index.texts.names(level):
                problem, hint = f"nothing asks for the level {level!r}", "listen to it, read it, or remove it"
                yield warning(place, "unused-input", f"inputs.{name}", problem, hint)


def unused_variable(index: Index) -> Iterator[Diagnostic]:
    """Find a variable of the context that is perhaps set, but never read."""
    for name, place in _own(index, "variable"):
        if not index.texts.names(name):
            problem, hint = f"nothing reads the variable {name!r}", "read it in an expression, or remove it"
            yield warning(place, "unused-variable", f"context.{name}", problem, hint)


def never_set(index: Index) -> Iterator[Diagnostic]:
    """Find a variable that is read, and that nothing gives another value than its default.

    One of the lifecycle may be meant for other missions, unless the lifecycle itself reads it.
    """
    lifecycle = index.chart.lifecycle_files
    written: dict[str, list[Value]] = {}
    for call in index.calls:
        for name, value in call.action.arguments.items() if call.action.name in WRITING else ():
            written.setdefault(name, []).append(value)
    for name, place in _declared(index, "variable"):
        default = index.chart.context[name].default
        is_read = index.texts.names(name, "" if place.file in lifecycle else None)
        if is_read and all(_is_same(value, default) for value in written.get(name, ())):
            problem = f"nothing gives the variable {name!r} another value than its default"
            hint = "set it where that changes, or make it a parameter"
            yield warning(place, "never-set", f"context.{name}", problem, hint)


def _is_same(value: Value, other: Value) -> bool:
    return isinstance(value, Constant) and isinstance(other, Constant) and value.value == other.value


def one_way_switch(index: Index) -> Iterator[Diagnostic]:
    """Find an action that switches something to one side only: all its calls give the same truth value."""
    calls: dict[tuple[str, str], list[tuple[str, Value]]] = {}
    for call in index.calls:
        for name, value in call.action.arguments.items():
            if value.type.kind == "bool" and call.action.name in index.chart.catalog.actions:
                calls.setdefault((call.action.name, name), []).append((call.path, value))
    for (action, name), found in calls.items():
        path, first = found[0]
        if isinstance(first, Constant) and all(_is_same(value, first) for _, value in found):
            said, other = str(first.value).lower(), str(not first.value).lower()
            problem = f"every {action} has '{name}: {said}', and nothing switches it back"
            yield warning(first.place, "one-way-switch", path, problem, f"add one with '{name}: {other}'")


def unused_field(index: Index) -> Iterator[Diagnostic]:
    """Find a field of a request that the mission never reads; one that no start can give is skipped here."""
    for mission in index.chart.missions.values():
        for field in mission.request.values():
            can_be_given = field.default is not None or field.name in index.chart.profile.request
            if can_be_given and not index.texts.names(f"request.{field.name}", mission.name):
                problem = f"nothing reads the field {field.name!r} of the request"
                hint = f"read it as request.{field.name}, or remove it"
                yield warning(field.place, "unused-field", f"request.{field.name}", problem, hint)
