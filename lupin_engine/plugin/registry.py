"""Discovers and verifies plugins, and joins their declarations to one catalog.

A plugin is refused by name with a reason (`PluginError`) before it is used: names that a mission could not
write, defaults that do not have their type, a name that two plugins claim. Plugins are found by entry point
(group `lupin.plugins`, each naming a `Plugin`); nothing of ROS is imported for that.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, TypeVar

from lupin_engine.errors import PluginError, nearest
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
from lupin_engine.plugin.discovery import GROUP, PROFILES, EntryPoint, entry_points, entry_points_by_group
from lupin_engine.plugin.parameters import POSSIBLE_TYPES, RESERVED, carried_as
from lupin_engine.plugin.profile import NO_PROFILE, OWN_VERBS, Profile
from lupin_engine.plugin.shapes import misshapen
from lupin_engine.plugin.types import BUILTIN_TYPES, UNITS, Type, convert, problems

#: What names consist of: of most things; of functions and values; of types and codes.
NAME = re.compile(r"[a-z][a-z0-9_]*")
DOTTED_NAME = re.compile(r"[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)*")
FREE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
VERB = re.compile(r"[a-z][a-z0-9_-]*")
KEY = re.compile(r"[a-z]")
#: The same in words.
LETTERS: Mapping[re.Pattern[str], str] = MappingProxyType(
    {
        NAME: "lower case letters, digits and underscores",
        DOTTED_NAME: "lower case letters, digits, underscores and dots",
        FREE_NAME: "letters, digits and underscores",
        VERB: "lower case letters, digits, underscores and hyphens",
        KEY: "one lower case letter",
    }
)
_TARGET = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")

#: First words of events that the engine itself makes; nobody else may.
RESERVED_EVENTS = frozenset(
    {
        "mission",
        "operator",
        "answer",
        "input",
        "after",
        "every",
        "at",
        "clock",
        "budget",
        "done",
        "error",
        "attempt",
        "timer",
        "driver",
    }
)
#: First words of names that mean something else where a plugin's name could stand.
_RESERVED = RESERVED_EVENTS | {"param", "request", "event", "itinerary"}

_T = TypeVar("_T")


@dataclass(frozen=True)
class Catalog:
    """All that the plugins offer, by full name; verified.

    Operations, actions and events are `plugin.local`; functions, values, types and parameters carry their own
    full names. `owners` says which plugin a function, value, type or parameter comes from. `profiles` are
    those that are installed, `profile` the one that holds: the only one, or the one that a lifecycle names.
    `base` is the catalog to which plugins were added.
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
    profiles: Mapping[str, Profile] = field(default_factory=dict)
    profile: Profile = NO_PROFILE
    base: Catalog | None = None

    @property
    def installed(self) -> Catalog:
        """The catalog without plugins that were added, such as the bindings of a folder of missions."""
        return self if self.base is None else self.base

    @property
    def known_types(self) -> Mapping[str, Type]:
        """Every type that a file may name: the built-in ones and the plugins'."""
        return {**BUILTIN_TYPES, **self.types}

    @cached_property
    def for_missions(self) -> Catalog:
        """The catalog for authors of missions: without internal declarations."""
        offered = {name: plugin for name, plugin in self.plugins.items() if not plugin.internal}
        return self if len(offered) == len(self.plugins) else self._with_plugins(_join(offered))

    def with_plugin(self, plugin: Plugin) -> Catalog:
        """Return a catalog that has another plugin too; errors as for `build_catalog`."""
        added = build_catalog([*self.plugins.values(), plugin])
        return replace(self._with_plugins(added), base=self.installed)

    def with_profile(self, name: str) -> Catalog:
        """Return the same with the installed profile `name` as the one that holds; KeyError for another."""
        chosen = self.profiles[name]
        return self if chosen is self.profile else replace(self, profile=chosen)

    def _with_plugins(self, other: Catalog) -> Catalog:
        return replace(other, profiles=self.profiles, profile=self.profile)


def load_catalog() -> Catalog:
    """Discover the installed plugins and profiles, verify them and return their catalog with the engine's.

    Raises:
        PluginError: one cannot be imported, breaks the contract, or contradicts another one.
    """
    found = entry_points_by_group(GROUP, PROFILES)
    points = {point: import_plugin(point) for point in found[GROUP]}
    for name in dict.fromkeys(plugin.name for plugin in points.values()):
        refuse_rivals(name, [point for point, plugin in points.items() if plugin.name == name])
    return build_catalog([builtin.PLUGIN, *points.values()], map(_import_profile, found[PROFILES]))


def load_profiles() -> list[Profile]:
    """Find the installed profiles.

    Raises:
        PluginError: one cannot be imported.
    """
    return [_import_profile(point) for point in entry_points(PROFILES)]


def _import_profile(point: EntryPoint) -> Profile:
    return point.load_as(Profile, "profile", "a Profile")


def refuse_rivals(name: str, points: Sequence[EntryPoint]) -> None:
    """Check that no two packages bring a plugin of one name; `points` are all that do.

    Raises:
        PluginError: there are two.
    """
    if len(points) > 1:
        offers = " and ".join(map(str, points))
        raise PluginError(f"plugin {name!r} is offered more than once: {offers}; uninstall all but one")


def import_plugin(point: EntryPoint) -> Plugin:
    """Return the plugin that an entry point names.

    Raises:
        PluginError: it cannot be imported, or is something else.
    """
    return point.load_as(Plugin, "plugin", "a Plugin")


def verified_plugin(point: EntryPoint) -> Plugin:
    """Return the plugin that an entry point names, which the registry takes.

    Raises:
        PluginError: it cannot be imported, breaks the contract, or another package brings one of its name.
    """
    refuse_rivals(point.name, [other for other in entry_points() if other.name == point.name])
    plugin = import_plugin(point)
    build_catalog([plugin])
    return plugin


def build_catalog(plugins: Iterable[Plugin], profiles: Iterable[Profile] = ()) -> Catalog:
    """Verify `plugins` and join their declarations; the built-in plugin is added when it is not among them.

    Raises:
        PluginError: names the plugin or profile and the reason.
    """
    named: dict[str, Plugin] = {}
    for plugin in (builtin.PLUGIN, *plugins):
        if plugin is builtin.PLUGIN and plugin.name in named:
            continue
        if plugin.name in named:
            raise _refused(plugin, "another plugin has the same name")
        _verify(plugin)
        named[plugin.name] = plugin
    return replace(_join(named), **_profiles(profiles))


def _profiles(profiles: Iterable[Profile]) -> dict[str, Any]:
    """Return the fields of a catalog about profiles; PluginError: one is malformed or installed twice."""
    found: dict[str, Profile] = {}
    for profile in profiles:
        if profile.name in found:
            raise PluginError(f"profile {profile.name!r} is installed twice; uninstall one")
        problems = [f"profile {profile.name!r}: {problem}" for problem in _profile_problems(profile)]
        if problems:
            raise PluginError("\n".join(problems))
        found[profile.name] = profile
    only = next(iter(found.values())) if len(found) == 1 else NO_PROFILE
    return {"profiles": MappingProxyType(found), "profile": only}


def _profile_problems(profile: Profile) -> Iterator[str]:
    requests = profile.requests.values()
    families: tuple[tuple[str, re.Pattern[str], Iterable[str]], ...] = (
        ("profile", NAME, [profile.name]),
        ("outcome", FREE_NAME, profile.statuses),
        ("counter", NAME, [outcome.counter for outcome in profile.outcomes]),
        ("request field", NAME, profile.request),
        ("operator's request", NAME, profile.requests),
        ("verb", VERB, [*OWN_VERBS, *profile.verbs.values()]),
        ("key", KEY, [one.key for one in requests if one.key]),
        ("publication", DOTTED_NAME, profile.publications),
    )
    for family, pattern, names in families:
        yield from _bad_spellings(family, pattern, names)
        twice = sorted({name for name in names if list(names).count(name) > 1})
        yield from (f"{family} {name!r} is there twice" for name in twice)
    for name, publication in profile.publications.items():
        if publication.outcome not in profile.statuses:
            yield f"{name} publishes an unknown outcome {publication.outcome!r}; " + nearest(
                publication.outcome, profile.statuses
            )
    for meaning, name in (("resume", profile.resume), ("abort", profile.abort)):
        if name and name not in profile.requests:
            yield f"{meaning} names an unknown request {name!r}; {nearest(name, profile.requests)}"
    for gauge, flag in profile.terminal.gauges.items():
        if flag not in profile.terminal.flags:
            yield f"gauge {gauge!r} names an unknown flag {flag!r}; {nearest(flag, profile.terminal.flags)}"


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
    """Check one plugin by itself; PluginError with all its errors, in the order of its declaration."""
    try:
        found = list(misshapen(plugin)) or list(_problems(plugin))
    except Exception as error:  # what stands there is not even of the kind that can be checked
        reason = f"{type(error).__name__}: {error}"
        raise _refused(plugin, f"it is not written as the contract wants it: {reason}") from error
    if found:
        raise PluginError("\n".join(str(_refused(plugin, problem)) for problem in found))


def _node_problems(plugin: Plugin) -> Iterator[str]:
    for key in ("stands_in", "guards", "companions", "composable"):
        for name in getattr(plugin, key):
            if name not in plugin.nodes:
                yield f"{key} names {name!r}, which is none of its nodes; {nearest(name, plugin.nodes)}"
    for name in plugin.composable:
        if plugin.hmi or name in plugin.guards:
            why = "serves pages" if plugin.hmi else "guards something"
            yield f"composable names {name!r}, which {why}: it has a process of its own"


def _problems(plugin: Plugin) -> Iterator[str]:
    if not NAME.fullmatch(plugin.name):
        yield f"its name must be {LETTERS[NAME]}"
    if plugin.name in _RESERVED:
        yield "its name is a word of the language"
    yield from _bad_names(plugin)
    declarations: tuple[tuple[str, Mapping[str, Any], Callable[[str, Any], Iterator[str]]], ...] = (
        ("operation", plugin.operations, _operation_problems),
        ("action", plugin.actions, lambda where, action: _argument_problems(where, action.arguments)),
        ("function", plugin.functions, _function_problems),
        ("value", plugin.values, _value_problems),
        ("event", plugin.events, _event_problems),
        ("parameter", plugin.parameters, _parameter_problems),
    )
    for family, declared, check in declarations:
        for name, declaration in declared.items():
            yield from check(f"{family} {name!r}", declaration)
    yield from _node_problems(plugin)
    for name in RESERVED.intersection(plugin.parameters):
        yield f"parameter {name!r}: the orchestrator has one of that name"
    for name, kind in plugin.types.items():
        if kind.name != name:
            yield f"type {name!r} calls itself {kind.name!r}"
        if name in BUILTIN_TYPES:
            yield f"type {name!r} is built in"
    for name, reader in plugin.readers.items():
        yield from _code_problems(f"reader {name!r}", (reader.code,))


def _bad_names(plugin: Plugin) -> Iterator[str]:
    families: tuple[tuple[str, re.Pattern[str], Iterable[str]], ...] = (
        ("operation", NAME, plugin.operations),
        ("action", NAME, plugin.actions),
        ("function", DOTTED_NAME, plugin.functions),
        ("value", DOTTED_NAME, plugin.values),
        ("event", NAME, plugin.events),
        ("type", FREE_NAME, plugin.types),
        ("parameter", NAME, plugin.parameters),
        ("node", NAME, plugin.nodes),
    )
    for family, pattern, names in families:
        yield from _bad_spellings(family, pattern, names)
    for target in filter(None, (plugin.client, plugin.pages, *plugin.nodes.values())):
        if not _TARGET.fullmatch(target):
            yield f"{target!r} must have the form 'module:name'"


def _bad_spellings(family: str, pattern: re.Pattern[str], names: Iterable[str]) -> Iterator[str]:
    for name in names:
        if not pattern.fullmatch(name):
            yield f"{family} {name!r}: the name must be {LETTERS[pattern]}"


def _operation_problems(where: str, operation: Operation) -> Iterator[str]:
    yield from _argument_problems(where, operation.arguments)
    yield from _code_problems(where, operation.codes)
    yield from _field_problems(where, "result field", operation.result)
    for resource in operation.uses:
        if not NAME.fullmatch(resource):
            yield f"{where}: uses {resource!r}, which is no name of a resource"
    if operation.mock.after < 0:
        yield f"{where}: the mock ends after {operation.mock.after} s"
    if isinstance(operation.mock.result, Mapping):
        yield from _result_problems(f"{where}: the mock", operation, operation.mock.result)
    for number, one in enumerate(operation.classes, 1):
        yield from _result_problems(f"{where}: class {number}", operation, one)


def _result_problems(where: str, operation: Operation, result: Mapping[str, Any]) -> Iterator[str]:
    for name, value in result.items():
        if name not in operation.result:
            yield f"{where} answers {name!r}, which is no field of the result"
            continue
        problem = _mismatch(value, operation.result[name])
        if problem:
            yield f"{where}'s {name!r}: {problem}"


def _argument_problems(where: str, arguments: Mapping[str, Argument]) -> Iterator[str]:
    for name, argument in arguments.items():
        if not NAME.fullmatch(name):
            yield f"{where}: the argument {name!r} must be {LETTERS[NAME]}"
        yield from _type_problems(f"{where}: the argument {name!r}", argument.type)
        problem = None if argument.default is None else _mismatch(argument.default, argument.type)
        if problem:
            yield f"{where}: the default of argument {name!r}: {problem}"


def _function_problems(where: str, function: Function) -> Iterator[str]:
    yield from _argument_problems(where, function.arguments)
    yield from _type_problems(f"{where}: what it returns", function.returns)
    optional = False
    for name, argument in function.arguments.items():
        if optional and not argument.optional:
            yield f"{where}: the argument {name!r} must be given, but follows one that need not be"
        optional = optional or argument.optional


def _value_problems(where: str, value: LiveValue) -> Iterator[str]:
    yield from _type_problems(where, value.type)
    if value.freshness is not None and not value.freshness > 0:
        yield f"{where}: a freshness of {value.freshness} s is never met"
    problem = None if value.initial is None else _mismatch(value.initial, value.type)
    if problem:
        yield f"{where}: the initial value: {problem}"
    for number, one in enumerate(value.classes, 1):
        problem = _mismatch(one, value.type)
        if problem:
            yield f"{where}: class {number}: {problem}"


def _event_problems(where: str, event: EventKind) -> Iterator[str]:
    yield from _field_problems(where, "field", event.fields)


def _field_problems(where: str, what: str, fields: Mapping[str, Type]) -> Iterator[str]:
    for name, kind in fields.items():
        if not NAME.fullmatch(name):
            yield f"{where}: the {what} {name!r} must be {LETTERS[NAME]}"
        yield from _type_problems(f"{where}: the {what} {name!r}", kind)


def _type_problems(where: str, kind: object) -> Iterator[str]:
    if not isinstance(kind, Type):
        yield f"{where} must have a Type, such as `types.TEXT`, got {kind!r}"
        return
    if kind.unit:
        yield from _unit_problems(where, kind.unit)
    yield from _range_problems(where, kind, kind.minimum, kind.maximum)
    if kind.item is not None:
        yield from _type_problems(where, kind.item)
    yield from _field_problems(where, "field", kind.fields)
    for name, named in kind.named.items():
        if named.unit not in ("", *UNITS):
            hint = nearest(named.unit, UNITS)
            yield f"{where}: {name!r} is told in {named.unit!r}, an unknown unit; {hint}"


def _range_problems(where: str, kind: Type, lowest: float | None, highest: float | None) -> Iterator[str]:
    if lowest is None and highest is None:
        return
    is_list = kind.kind == "list" and lowest is None
    if kind.kind not in ("integer", "number") and not is_list:
        yield f"{where}: a {kind} has no minimum or maximum"
    elif lowest is not None and highest is not None and lowest > highest:
        yield f"{where}: the minimum {lowest:g} is above the maximum {highest:g}"


def _unit_problems(where: str, unit: str) -> Iterator[str]:
    """Yield the problem of a unit that is no base unit of a dimension: numbers are kept in these."""
    base = UNITS[unit][0] if unit in UNITS else None
    if base is None:
        yield f"{where} has the unit {unit!r}, which missions cannot write; {nearest(unit, UNITS)}"
    elif base != unit:
        yield f"{where} has the unit {unit!r}; numbers are kept in {base or 'no unit'!r}, so declare that one"


def _parameter_problems(where: str, parameter: Parameter) -> Iterator[str]:
    found = list(_type_problems(where, parameter.type))
    if not found and not carried_as(parameter.type):
        found.append(f"{where}: the type is {parameter.type}, but a parameter {POSSIBLE_TYPES}")
    mismatch = _mismatch(parameter.default, parameter.type)
    if mismatch:
        found.append(f"{where}: the default: {mismatch}")
    if found:
        yield from found
        return
    found = list(_range_problems(where, parameter.type, parameter.minimum, parameter.maximum))
    if found or (parameter.minimum is None and parameter.maximum is None):
        yield from found
        return
    default = convert(parameter.default, parameter.type)
    if parameter.minimum is not None and default < parameter.minimum:
        yield f"{where}: the default {default:g} is below the minimum {parameter.minimum:g}"
    if parameter.maximum is not None and default > parameter.maximum:
        yield f"{where}: the default {default:g} is above the maximum {parameter.maximum:g}"


def _code_problems(where: str, codes: Iterable[Code]) -> Iterator[str]:
    for code in codes:
        if not FREE_NAME.fullmatch(code.name):
            yield f"{where}: the code {code.name!r} must be {LETTERS[FREE_NAME]}"
        if not code.label:
            yield f"{where}: the code {code.name!r} has no label for people"


def _mismatch(value: Any, wanted: Type) -> str | None:
    """Return why a value is not of a type; None where it is, or where this is no type (reported before)."""
    if not isinstance(wanted, Type):
        return None  # which has been told
    return next((problem.text for problem in problems(value, wanted)), None)
