"""Checks of the request that the options describe, made before anything is started."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lupin_engine.chart import Chart
from lupin_engine.errors import Problems, UsageError
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import given_fields


def check_fields(loaded: LoadedMissions, request: Mapping[str, Any]) -> None:
    """Check that the request of the first mission has a field for everything that is given.

    Raises:
        UsageError: it lacks one, and would ignore the value.
    """
    problems = Problems(UsageError)
    fields = loaded.chart.missions[loaded.names[0]].request
    installed = loaded.chart.catalog.profiles.values()
    options = {name: field.option for each in installed for name, field in each.request.items()}
    for name, value in request.items():
        if value and name not in fields:
            problems.add(
                f"{loaded.names[0]} has no use for {options[name]}: its request has no {name}; "
                f"it has {', '.join(fields) or 'no fields'}"
            )
    problems.tell()


def check_complete(loaded: LoadedMissions, request: Mapping[str, Any]) -> None:
    """Check that the request of the first mission has every field that it must have.

    Raises:
        UsageError: one is not given; the text says how to give it.
    """
    # Imported here: other verbs need no machine, and its import takes longer than their work.
    from lupin_engine.machine import described, lacking

    mission, problems = loaded.chart.missions[loaded.names[0]], Problems(UsageError)
    for field in lacking(mission, carried(loaded.chart, request)):
        known = loaded.chart.profile.request.get(field.name)
        hint = f"a scenario that says 'request: {{{field.name}: ...}}' gives it"
        if known is not None and known.option:
            hint = f"write {known.option} {known.metavar or str(field.type).upper()}"
        problems.add(f"{mission.name} needs {described(field)}; {hint}")
    problems.tell()


def carried(chart: Chart, request: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that were given, of those that a request of the chart's missions has a field for."""
    return {name: value for name, value in given_fields(request).items() if name in chart.profile.request}


def check_request(loaded: LoadedMissions, given: Mapping[str, Any], request: Mapping[str, Any]) -> None:
    """Check that the first mission accepts a request, as far as that needs no robot.

    Raises:
        UsageError: it would not, and the text is the one that the service would answer; it has no field
            for what is given (see `check_fields`), or lacks one (see `check_complete`); or a parameter leads
            nowhere (for example: a file that is absent). The text has everything that is wrong.
    """
    from lupin_engine.machine import EvaluationScope, Memory, read_request
    from lupin_engine.runtime import make_world

    problems = Problems(UsageError)
    with problems.collecting():
        check_fields(loaded, request)
    with problems.collecting():
        check_complete(loaded, request)
        world = make_world(loaded.chart, given)
        data = {"mission_type": loaded.names[0], **carried(loaded.chart, request)}
        _, refusal = read_request(world, data, EvaluationScope(world, Memory()).at("", 0.0))
        if refusal is not None:
            problems.add(refusal.text)
    problems.tell()
