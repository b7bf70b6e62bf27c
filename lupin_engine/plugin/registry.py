"""Finding plugins, verifying them on registration, and the one catalog of all that they offer.

A plugin is refused by name with a reason (`PluginError`) before anything uses it: names that a mission could
not write, defaults that do not have their type, a name that two plugins claim. Plugins are found by entry
point (group `lupin.plugins`, each naming a `Plugin`); nothing of ROS is imported for that.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any, TypeVar

from lupin_engine.errors import PluginError
from lupin_engine.plugin import builtin
from lupin_engine.plugin.contract import (
    Action,
    Argument,
    Code,
    EventKind,
    Function,
    LiveValue,
    Operation,
    Parameter,
    Plugin,
    Reader,
)
from lupin_engine.plugin.discovery import EntryPoint, entry_points
from lupin_engine.plugin.types import BUILTIN_TYPES, Type, convert

_NAME = re.compile(r"[a-z][a-z0-9_]*")
_DOTTED = re.compile(r"[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)*")
_TYPE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_CODE = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_TARGET = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")

#: First words of events that the engine itself makes; nobody else may.
RESERVED_EVENTS = frozenset(
    {"mission", "operator", "input", "after", "budget", "done", "error", "attempt", "timer", "driver"}
)
#: First words of names that mean something else where a plugin's name could stand.
_RESERVED = RESERVED_EVENTS | {"param", "request", "event", "itinerary"}

_T = TypeVar("_T")


@dataclass(frozen=True)
class Catalog:
    """All that the plugins offer, by full name; verified.

    Operations, actions and events are `plugin.local`; functions, values, types and parameters carry their own
    full names. `owners` says which plugin a function, value, type or parameter comes from.
    """

    plugins: Mapping[str, Plugin] = field(default_factory=dict)
    operations: Mapping[str, Operation] = field(default_factory=dict)
    actions: Mapping[str, Action] = field(default_factory=dict)
    functions: Mapping[str, Function] = field(default_factory=dict)
    values: Mapping[str, LiveValue] = field(default_factory=dict)
    events: Mapping[str, EventKind] = field(default_factory=dict)
    types: Mapping[str, Type] = field(default_factory=dict)
    readers: Mapping[str, Reader] = field(default_factory=dict)
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    codes: Mapping[str, Code] = field(default_factory=dict)
    owners: Mapping[tuple[str, str], str] = field(default_factory=dict)

    @property
    def known_types(self) -> Mapping[str, Type]:
        """Every type that a file may name: the built-in ones and the plugins'."""
        return {**BUILTIN_TYPES, **self.types}

    @cached_property
    def for_missions(self) -> Catalog:
        """What authors of missions are offered: all but what is internal to plugins."""
        offered = {name: plugin for name, plugin in self.plugins.items() if not plugin.internal}
        return self if len(offered) == len(self.plugins) else _join(offered)


def load_catalog() -> Catalog:
    """Find the installed plugins, verify them and return what they offer, the built-in plugin included.

    Raises:
        PluginError: a plugin cannot be imported, breaks the contract, or contradicts another one.
    """
    return build_catalog([builtin.PLUGIN, *map(import_plugin, entry_points())])


def import_plugin(point: EntryPoint) -> Plugin:
    """Return the plugin that an entry point names.

    Raises:
        PluginError: it cannot be imported, or is something else.
    """
    try:
        plugin = point.load()
    except (
        Exception
    ) as error:  # a plugin is foreign code: whatever its import does is its fault, told in one line
        reason = f"{type(error).__name__}: {error}"
        raise PluginError(f"plugin {point.name!r} ({point.value}) cannot be imported: {reason}") from error
    if not isinstance(plugin, Plugin):
        kind = type(plugin).__name__
        raise PluginError(
            f"plugin {point.name!r} ({point.value}) is a {kind}; the entry point must name a Plugin"
        )
    return plugin


def build_catalog(plugins: Iterable[Plugin]) -> Catalog:
    """Verify `plugins` and join what they offer; the built-in plugin is added when it is not among them.

    Raises:
        PluginError: names the plugin and the reason.
    """
    named: dict[str, Plugin] = {}
    for plugin in (builtin.PLUGIN, *plugins):
        if plugin is builtin.PLUGIN and plugin.name in named:
            continue
        if plugin.name in named:
            raise _refused(plugin, "another plugin has the same name")
        _verify(plugin)
        named[plugin.name] = plugin
    return _join(named)


def _join(plugins: dict[str, Plugin]) -> Catalog:
    owners: dict[tuple[str, str], str] = {}

    def shared(family: str, pick: Callable[[Plugin], Mapping[str, _T]]) -> Mapping[str, _T]:
        found: dict[str, _T] = {}
        for plugin in plugins.values():
            for name, thing in pick(plugin).items():
                if name in found:
                    other = owners[family, name]
                    raise _refused(plugin, f"the {family} {name!r} is already declared by plugin {other!r}")
                found[name] = thing
                owners[family, name] = plugin.name
        return MappingProxyType(found)

    catalog = Catalog(
        plugins=MappingProxyType(plugins),
        operations=_prefixed(plugins, lambda plugin: plugin.operations),
        actions=_prefixed(plugins, lambda plugin: plugin.actions),
        functions=shared("function", lambda plugin: plugin.functions),
        values=shared("value", lambda plugin: plugin.values),
        events=_prefixed(plugins, lambda plugin: plugin.events),
        types=shared("type", lambda plugin: plugin.types),
        readers=shared("reader", lambda plugin: plugin.readers),
        parameters=shared("parameter", lambda plugin: plugin.parameters),
        codes=_codes(plugins.values()),
        owners=MappingProxyType(owners),
    )
    for plugin in plugins.values():
        for name in plugin.readers:
            if name not in catalog.known_types:
                raise _refused(plugin, f"reader {name!r} reads a type that no plugin declares")
    return catalog


def _prefixed(plugins: Mapping[str, Plugin], pick: Callable[[Plugin], Mapping[str, _T]]) -> Mapping[str, _T]:
    return MappingProxyType(
        {
            f"{plugin.name}.{name}": thing
            for plugin in plugins.values()
            for name, thing in pick(plugin).items()
        }
    )


def _codes(plugins: Iterable[Plugin]) -> Mapping[str, Code]:
    found: dict[str, Code] = {}
    for plugin in plugins:
        for code in _codes_of(plugin):
            known = found.setdefault(code.name, code)
            if known != code:
                raise _refused(plugin, f"the code {code.name!r} is declared as {code} and as {known}")
    return MappingProxyType(found)


def _codes_of(plugin: Plugin) -> Iterator[Code]:
    for operation in plugin.operations.values():
        yield from operation.codes
    for reader in plugin.readers.values():
        yield reader.code


def _refused(plugin: Plugin, reason: str) -> PluginError:
    return PluginError(f"plugin {plugin.name!r}: {reason}")


def _verify(plugin: Plugin) -> None:
    """Check one plugin by itself, in the order of its declaration."""
    for problem in _problems(plugin):
        raise _refused(plugin, problem)


def _problems(plugin: Plugin) -> Iterator[str]:
    if not _NAME.fullmatch(plugin.name):
        yield "its name must be lower case letters, digits and underscores"
    if plugin.name in _RESERVED:
        yield "its name is a word of the language"
    yield from _bad_names(plugin)
    for name, operation in plugin.operations.items():
        yield from _operation_problems(f"operation {name!r}", operation)
    for name, action in plugin.actions.items():
        yield from _argument_problems(f"action {name!r}", action.arguments)
    for name, function in plugin.functions.items():
        yield from _function_problems(f"function {name!r}", function)
    for name, value in plugin.values.items():
        yield from _value_problems(f"value {name!r}", value)
    for name, event in plugin.events.items():
        yield from _event_problems(f"event {name!r}", event)
    for name, parameter in plugin.parameters.items():
        yield from _parameter_problems(f"parameter {name!r}", parameter)
    for name in plugin.stands_in:
        if name not in plugin.nodes:
            yield f"stands_in names {name!r}, which is none of its nodes"
    for name in plugin.companions:
        if name not in plugin.nodes:
            yield f"companions names {name!r}, which is none of its nodes"
    for name, kind in plugin.types.items():
        if kind.name != name:
            yield f"type {name!r} calls itself {kind.name!r}"
        if name in BUILTIN_TYPES:
            yield f"type {name!r} is built in"
    for name, reader in plugin.readers.items():
        yield from _code_problems(f"reader {name!r}", (reader.code,))


def _bad_names(plugin: Plugin) -> Iterator[str]:
    families: tuple[tuple[str, re.Pattern[str], Iterable[str]], ...] = (
        ("operation", _NAME, plugin.operations),
        ("action", _NAME, plugin.actions),
        ("function", _DOTTED, plugin.functions),
        ("value", _DOTTED, plugin.values),
        ("event", _NAME, plugin.events),
        ("type", _TYPE_NAME, plugin.types),
        ("parameter", _NAME, plugin.parameters),
        ("node", _NAME, plugin.nodes),
    )
    for family, pattern, names in families:
        for name in names:
            if not pattern.fullmatch(name):
                yield f"{family} {name!r}: the name must be lower case letters, digits and underscores"
    for target in filter(None, (plugin.client, *plugin.nodes.values())):
        if not _TARGET.fullmatch(target):
            yield f"{target!r} must have the form 'module:name'"


def _operation_problems(where: str, operation: Operation) -> Iterator[str]:
    yield from _argument_problems(where, operation.arguments)
    yield from _code_problems(where, operation.codes)
    for name in operation.result:
        if not _NAME.fullmatch(name):
            yield f"{where}: the result field {name!r} must be lower case letters, digits and underscores"
    for resource in operation.uses:
        if not _NAME.fullmatch(resource):
            yield f"{where}: uses {resource!r}, which is no name of a resource"
    if operation.mock.after < 0:
        yield f"{where}: the mock ends after {operation.mock.after} s"
    if isinstance(operation.mock.result, Mapping):
        yield from _mock_problems(where, operation, operation.mock.result)


def _mock_problems(where: str, operation: Operation, result: Mapping[str, Any]) -> Iterator[str]:
    for name, value in result.items():
        if name not in operation.result:
            yield f"{where}: the mock answers {name!r}, which is no field of the result"
            continue
        problem = _mismatch(value, operation.result[name])
        if problem:
            yield f"{where}: the mock's {name!r}: {problem}"


def _argument_problems(where: str, arguments: Mapping[str, Argument]) -> Iterator[str]:
    for name, argument in arguments.items():
        if not _NAME.fullmatch(name):
            yield f"{where}: the argument {name!r} must be lower case letters, digits and underscores"
        problem = None if argument.default is None else _mismatch(argument.default, argument.type)
        if problem:
            yield f"{where}: the default of argument {name!r}: {problem}"


def _function_problems(where: str, function: Function) -> Iterator[str]:
    yield from _argument_problems(where, function.arguments)
    if not callable(function.bind):
        yield f"{where}: bind must be a function of the parameters"
    optional = False
    for name, argument in function.arguments.items():
        if optional and not argument.optional:
            yield f"{where}: the argument {name!r} must be given, but follows one that need not be"
        optional = optional or argument.optional


def _value_problems(where: str, value: LiveValue) -> Iterator[str]:
    if value.freshness is not None and not value.freshness > 0:
        yield f"{where}: a freshness of {value.freshness} s is never met"
    problem = None if value.initial is None else _mismatch(value.initial, value.type)
    if problem:
        yield f"{where}: the initial value: {problem}"


def _event_problems(where: str, event: EventKind) -> Iterator[str]:
    for name, kind in event.fields.items():
        if not _NAME.fullmatch(name):
            yield f"{where}: the field {name!r} must be lower case letters, digits and underscores"
        if not isinstance(kind, Type):
            yield f"{where}: the field {name!r} must have a Type, got {kind!r}"


def _parameter_problems(where: str, parameter: Parameter) -> Iterator[str]:
    problem = _mismatch(parameter.default, parameter.type)
    if problem:
        yield f"{where}: the default: {problem}"
        return
    if parameter.minimum is None and parameter.maximum is None:
        return
    if parameter.type.kind not in ("integer", "number"):
        yield f"{where}: a {parameter.type} has no minimum or maximum"
        return
    default = convert(parameter.default, parameter.type)
    if parameter.minimum is not None and default < parameter.minimum:
        yield f"{where}: the default {default:g} is below the minimum {parameter.minimum:g}"
    if parameter.maximum is not None and default > parameter.maximum:
        yield f"{where}: the default {default:g} is above the maximum {parameter.maximum:g}"


def _code_problems(where: str, codes: Iterable[Code]) -> Iterator[str]:
    for code in codes:
        if not _CODE.fullmatch(code.name):
            yield f"{where}: the code {code.name!r} must be letters, digits and underscores"
        if not code.label:
            yield f"{where}: the code {code.name!r} has no label for people"


def _mismatch(value: Any, wanted: Type) -> str | None:
    try:
        convert(value, wanted)
    except ValueError as error:
        return str(error)
    return None
