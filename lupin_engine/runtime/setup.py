"""Makes a machine of a chart and settings: parameters checked, functions and readers bound."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lupin_engine.chart.model import Chart
from lupin_engine.errors import UsageError
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.scope import World
from lupin_engine.plugin.builtin import TIME_ZONE
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.parameters import sorted_out
from lupin_engine.runtime.clock import calendar_of


def make_machine(chart: Chart, given: Mapping[str, Any]) -> Machine:
    """Return a machine that is not started.

    Raises:
        UsageError: a given parameter does not exist or has a wrong value; every such problem is named.
        LupinError: a plugin cannot work with the parameters (for example: a file that is absent).
    """
    return Machine(make_world(chart, given))


def make_world(chart: Chart, given: Mapping[str, Any]) -> World:
    """Return the constants of a machine; errors as for `make_machine`."""
    parameters = check_parameters(chart.parameters, given)
    used = set(chart.plugins)
    functions = {
        name: function.bind(parameters)
        for plugin in chart.catalog.plugins.values()
        if plugin.name in used
        for name, function in plugin.functions.items()
    }
    readers = {
        name: reader.bind(parameters)
        for plugin in chart.catalog.plugins.values()
        if plugin.name in used
        for name, reader in plugin.readers.items()
    }
    calendar = calendar_of(parameters[TIME_ZONE]) if TIME_ZONE in chart.parameters else None
    return World(chart, parameters, functions, readers, calendar=calendar)


def check_parameters(declared: Mapping[str, Parameter], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the value of every declared parameter, in base units.

    Raises:
        UsageError: naming every unknown name with the nearest one, and every wrong value with its range.
    """
    values, problems = sorted_out(declared, given)
    if problems:
        raise UsageError("\n".join(problems))
    return {name: values.get(name, parameter.default) for name, parameter in declared.items()}
