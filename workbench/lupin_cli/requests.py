"""Reads a mission's request from the options, and checks it before anything is started."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from lupin_cli.options import REQUEST
from lupin_cli.settings import read_value, split
from lupin_engine.errors import Problems, UsageError, unknown_field
from lupin_engine.plugin import TEXT, Fault, Notation, Type, given_fields, list_of, problems

if TYPE_CHECKING:
    from lupin_engine.chart import Chart
    from lupin_engine.missions import LoadedMissions


def fields_in(
    given: Iterable[str], types: Mapping[str, Type], faults: Collection[Fault] = frozenset(Fault)
) -> tuple[dict[str, Any], list[str]]:
    """Return the fields given as `name=value`, as data of these types, and their problems.

    A problem is a text without `=` or without a name, which gives no field; or a value that does not fit its
    type, judged like a value in a file, if that is one of the `faults`. A field without a type is text. A
    field whose value has a problem is returned as well.
    """
    texts, wrong = split(REQUEST, given)
    values: dict[str, Any] = {}
    for name, text in texts.items():
        kind = types.get(name, TEXT)
        try:
            values[name] = value = read_value(text, kind)
        except ValueError as problem:
            values[name] = text
            wrong.append(f"{REQUEST}: {name}: {problem}")
            continue
        found = problems(value, kind, Notation.FILE)
        wrong += [f"{REQUEST}: {one.at(name)}" for one in found if one.fault in faults]
    return values, wrong


def given_twice(options: Iterable[str], fields: Collection[str]) -> list[str]:
    """Return at most one problem: it names the fields given by their own option and by `--request`."""
    twice = ", ".join(name for name in options if name in fields)
    return [f"{twice}: given by an option of its own and by {REQUEST}; leave one out"] if twice else []


def request_in(
    loaded: LoadedMissions, options: Mapping[str, Any], given: Iterable[str]
) -> tuple[dict[str, Any], list[str]]:
    """Return the request of the first mission, and the problems of `--request`.

    The request has the fields of the profile's options and of `--request`. A problem is an unknown field, one
    that its own option gives as well, a value of another type or without its unit. `check_fields` checks the
    options.
    """
    declared, of_options = loaded.chart.missions[loaded.names[0]].request, carried(loaded.chart, options)
    types = {name: _written(field.type, loaded.chart.catalog.readers) for name, field in declared.items()}
    fields, wrong = fields_in(given, types)
    unknown = [f"{REQUEST}: {unknown_field(name, declared)}" for name in fields if name not in declared]
    return {**of_options, **fields}, [*wrong, *unknown, *given_twice(of_options, fields)]


def _written(kind: Type, readers: Collection[str]) -> Type:
    """Return the type that a value is written in: the names of things, where a plugin reads them."""
    if (kind.item or kind).name not in readers:
        return kind
    return list_of(TEXT) if kind.item else TEXT


def check_fields(loaded: LoadedMissions, request: Mapping[str, Any]) -> None:
    """Check that the request of the first mission has a field for everything that is given.

    Raises:
        UsageError: it lacks one, and would ignore the value.
    """
    wrong = Problems(UsageError)
    fields = loaded.chart.missions[loaded.names[0]].request
    installed = loaded.chart.catalog.profiles.values()
    options = {name: field.option for each in installed for name, field in each.request.items()}
    for name, value in request.items():
        if value and name not in fields:
            wrong.add(
                f"{loaded.names[0]} has no use for {options[name]}: its request has no {name}; "
                f"it has {', '.join(fields) or 'no fields'}"
            )
    wrong.raise_any()


def check_complete(loaded: LoadedMissions, request: Mapping[str, Any]) -> None:
    """Check that the request of the first mission has every field that it must have.

    Raises:
        UsageError: one is not given; the text shows how to give it.
    """
    # Imported here: other verbs need no machine, and its import takes longer than their work.
    from lupin_engine.machine import described, lacking

    mission, wrong = loaded.chart.missions[loaded.names[0]], Problems(UsageError)
    for field in lacking(mission, request):
        known = loaded.chart.profile.request.get(field.name)
        hint = f"write {REQUEST} {field.name}=..."
        if known is not None and known.option:
            hint = f"write {known.option} {known.metavar or str(field.type).upper()}"
        wrong.add(f"{mission.name} needs {described(field)}; {hint}")
    wrong.raise_any()


def carried(chart: Chart, request: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that were given, of those that the profile has; empty and zero mean not given.

    A mission need not have a field for each: `check_fields` reports that.
    """
    return {name: value for name, value in given_fields(request).items() if name in chart.profile.request}


def check_request(
    loaded: LoadedMissions,
    parameters: Mapping[str, Any],
    options: Mapping[str, Any],
    given: Iterable[str] = (),
) -> dict[str, Any]:
    """Return the request of options and `--request`, checked as far as that needs no robot.

    Raises:
        UsageError: the first mission refuses it, with the text that the service would answer; a field is
            unknown (see `check_fields` and `request_in`) or missing (see `check_complete`); or a parameter
            names something that does not exist, such as a file. The text has every problem of the options and
            of `--request`. Parameters are checked only when no field is missing, a refusal after them; it is
            left out when `--request` has problems.
    """
    from lupin_engine.machine import EvaluationScope, Memory, read_request
    from lupin_engine.runtime import make_world

    wrong = Problems(UsageError)
    with wrong.collecting():
        check_fields(loaded, options)
    request, wrongly_given = request_in(loaded, options, given)
    wrong.add(*wrongly_given)
    with wrong.collecting():
        check_complete(loaded, request)
        world = make_world(loaded.chart, parameters)
        data = {"mission_type": loaded.names[0], **request}
        _, refusal = read_request(world, data, EvaluationScope(world, Memory()).at("", 0.0))
        if refusal is not None and not wrongly_given:
            wrong.add(refusal.text)
    wrong.raise_any()
    return request
