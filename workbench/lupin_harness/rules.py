"""Rules for a plugin's catalog, checked without ROS; each yields all its violations."""

from __future__ import annotations

import copy
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from types import MappingProxyType
from typing import Any

from lupin_engine.errors import PluginError, nearest
from lupin_engine.plugin import (
    Argument,
    Code,
    EntryPoint,
    LiveValue,
    Notation,
    Operation,
    Plugin,
    Type,
    build_catalog,
    entry_points,
    find_entry_point,
    import_plugin,
    load_catalog,
    problems,
    refuse_rivals,
    source_file,
    told,
)
from lupin_harness.examples import arguments_for, defaults_of

#: Arguments by operation, action or function; what is not given is made up from the types.
Given = Mapping[str, Mapping[str, Any]]

#: What a request may carry where a reader expects something else.
ODD: tuple[Any, ...] = ("", "no such thing", 0, -1.5, True, None, [], {}, ["", {}], {"": None})
#: Modules that mean that ROS was imported: rclpy, and what every message package imports.
ROS = ("rclpy", "rosidl_parser")
#: Seconds that loading a catalog may take in a new process, on a busy machine.
LOADING_S = 30.0
#: The memory address in the `repr` of an object.
_ADDRESS = re.compile(r" at 0x[0-9a-f]+")


@dataclass(frozen=True)
class PluginUnderTest:
    """The plugin that is checked: its entry point, and arguments for calls."""

    point: EntryPoint
    arguments: Given = field(default_factory=dict)

    @cached_property
    def plugin(self) -> Plugin:
        """The plugin, imported.

        Raises:
            PluginError: it cannot be imported.
        """
        return import_plugin(self.point)

    @cached_property
    def elsewhere(self) -> Elsewhere | str:
        """The plugin as another process loads it, or a text why it cannot."""
        return load_elsewhere(self.point)

    def arguments_for(self, name: str, declared: Mapping[str, Argument]) -> dict[str, Any]:
        """Return arguments for the operation, action or function `name`."""
        return arguments_for(declared, self.arguments.get(name, {}))


def find_subject(name: str, arguments: Given = MappingProxyType({})) -> PluginUnderTest:
    """Return an installed plugin, by the name of its entry point.

    Raises:
        UsageError: there is none; the text has the nearest name.
    """
    return PluginUnderTest(find_entry_point(name), arguments)


def registered(subject: PluginUnderTest) -> Iterator[str]:
    """The registry takes it, alone and beside all that is installed, under the name of its entry point."""
    plugin = subject.plugin
    if plugin.name != subject.point.name:
        yield f"the entry point {subject.point.name!r} names a plugin that calls itself {plugin.name!r}"
    point = subject.point
    try:
        build_catalog([plugin])
        rivals = [other for other in entry_points() if other.name == point.name and other != point]
        refuse_rivals(point.name, [point, *rivals])
        installed = load_catalog().plugins
        if plugin.name not in installed:
            build_catalog([*installed.values(), plugin])
    except PluginError as problem:
        yield from str(problem).splitlines()


@dataclass(frozen=True)
class Elsewhere:
    """A catalog as another process loads it, and the ROS modules that this imports."""

    ros: tuple[str, ...]
    catalog: Mapping[str, str]


#: Loads an entry point, and prints what of some modules that has imported, and the catalog.
_LOAD = (
    "import json, sys; path, name, value, ros = json.loads(sys.argv[1]); sys.path[:] = path; "
    "from lupin_engine.plugin.discovery import EntryPoint; found = EntryPoint(name, value).load(); "
    "imported = sorted(set(ros) & set(sys.modules)); "
    "from lupin_harness.rules import declarations; "
    "print('\\n', json.dumps([imported, declarations(found)]))"
)


def load_elsewhere(point: EntryPoint) -> Elsewhere | str:
    """Load a catalog in another process; return a text where that fails."""
    command = [sys.executable, "-c", _LOAD, json.dumps([sys.path, point.name, point.value, ROS])]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONSTARTUP"}
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=LOADING_S, env=environment, check=False
        )
    except subprocess.TimeoutExpired:
        return f"{point.module} is not loaded within {LOADING_S:g} s"
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or ["no word of why"])[-1]
        return f"{point.module} cannot be loaded in a process of its own: {reason}"
    imported, catalog = json.loads(done.stdout.splitlines()[-1])
    return Elsewhere(tuple(imported), catalog)


def declarations(plugin: object) -> dict[str, str]:
    """Return all declarations of a catalog as texts, by name, without memory addresses."""
    found: dict[str, str] = {}
    for part in fields(plugin) if isinstance(plugin, Plugin) else ():
        value = getattr(plugin, part.name)
        if isinstance(value, Mapping):
            word = part.name.removesuffix("s").replace("_", " ")
            found |= {f"{word} {name!r}": _ADDRESS.sub("", repr(thing)) for name, thing in value.items()}
        else:
            found[part.name] = _ADDRESS.sub("", repr(value))
    return found


def loads_without_ros(subject: PluginUnderTest) -> Iterator[str]:
    """Loading the catalog imports nothing of ROS: a laptop must be able to check missions with it."""
    point, loaded = subject.point, subject.elsewhere
    if isinstance(loaded, str):
        yield loaded
        return
    for module in loaded.ros:
        yield f"loading {point.module} imports {module}; import it in the client or the node only"


def stays_the_same(subject: PluginUnderTest) -> Iterator[str]:
    """Loading it again, in another process, gives the same catalog: what was checked is what runs."""
    if isinstance(subject.elsewhere, Elsewhere):
        for name, one, other in changes(declarations(subject.plugin), subject.elsewhere.catalog):
            yield f"{name} is {_differs(one, other)}; write down what it is"


def changes(
    before: Mapping[str, str], after: Mapping[str, str]
) -> Iterator[tuple[str, str | None, str | None]]:
    """Yield the differences of two catalogs (see `declarations`), with both texts; None: missing."""
    for name in dict.fromkeys([*before, *after]):
        if before.get(name) != after.get(name):
            yield name, before.get(name), after.get(name)


def _differs(one: str | None, other: str | None) -> str:
    if one is None or other is None:
        return "there in one process and not in another"
    first = next(i for i, (a, b) in enumerate(zip(f"{one}\0", f"{other}\1", strict=False)) if a != b)
    around = slice(max(0, first - 20), first + 20)
    return f"not the same each time it is loaded: {one[around]!r}, then {other[around]!r}"


def names_modules(subject: PluginUnderTest) -> Iterator[str]:
    """The modules of client and nodes are there; they are not imported, for they need ROS."""
    plugin = subject.plugin
    named = {"client": plugin.client} if plugin.client else {}
    named |= {f"node {name!r}": target for name, target in plugin.nodes.items()}
    for what, target in named.items():
        module = target.partition(":")[0]
        if source_file(module) is None:
            yield f"{what}: there is no module {module!r}"


def documented(subject: PluginUnderTest) -> Iterator[str]:
    """What it offers is described: sentences for things, phrases for arguments, values and parameters."""
    plugin = subject.plugin
    yield from _sentence("the plugin", plugin.doc)
    families = ("operation", plugin.operations), ("action", plugin.actions), ("function", plugin.functions)
    for family, things in families:
        for name, thing in things.items():
            yield from _sentence(f"{family} {name!r}", thing.doc)
            for argument, declared in thing.arguments.items():
                yield from _phrase(f"{family} {name!r}: argument {argument!r}", declared.doc)
    for name, event in plugin.events.items():
        yield from _sentence(f"event {name!r}", event.doc)
    for name, value in plugin.values.items():
        yield from _phrase(f"value {name!r}", value.doc)
    for name, parameter in plugin.parameters.items():
        yield from _phrase(f"parameter {name!r}", parameter.doc)


def _sentence(what: str, doc: str) -> Iterator[str]:
    if not doc.strip():
        yield f"{what}: nothing says what it is"
    elif doc[0].islower() or not doc.endswith("."):
        yield f"{what}: {doc!r} is no sentence: begin with a capital, end with a full stop"


def _phrase(what: str, doc: str) -> Iterator[str]:
    if not doc.strip():
        yield f"{what}: nothing says what it is"
    elif doc.endswith("."):
        yield f"{what}: {doc!r} is a phrase: leave out the full stop"


def labelled(subject: PluginUnderTest) -> Iterator[str]:
    """Codes have labels that say more to an operator than their names."""
    for where, code in _codes(subject.plugin):
        if code.label.strip() in ("", code.name):
            yield f"{where}: the label of the code {code.name!r} must say what happened"


def _codes(plugin: Plugin) -> Iterator[tuple[str, Code]]:
    for name, operation in plugin.operations.items():
        yield from ((f"operation {name!r}", code) for code in operation.codes)
    for name, reader in plugin.readers.items():
        yield f"reader {name!r}", reader.code


def mocked(subject: PluginUnderTest) -> Iterator[str]:
    """In a simulation every operation gives all that it declares, in the right types."""
    plugin = subject.plugin
    parameters = defaults_of(plugin.parameters)
    values = {name: value.type for name, value in (*_values_of_others(), *plugin.values.items())}
    for name, operation in plugin.operations.items():
        where = f"operation {name!r}: the mock"
        arguments = subject.arguments_for(name, operation.arguments)
        try:
            result = _mocked(operation.mock.result, arguments, parameters)
            changed = _mocked(operation.mock.values, arguments, parameters)
        except Exception as problem:  # foreign code
            yield f"{where} fails for {arguments}: {told(problem, subject.point.module)}"
            continue
        yield from (f"{where} {text}" for text in result_problems(operation, result))
        for value in changed:
            if value not in values:
                yield f"{where} changes {value!r}, which is no live value; {nearest(value, values)}"
            else:
                yield from (f"{where}: {text}" for text in _mismatch(value, changed[value], values[value]))


def _values_of_others() -> Iterable[tuple[str, LiveValue]]:
    try:
        return load_catalog().values.items()
    except PluginError:  # which is told where the plugin is registered
        return ()


def _mocked(given: Any, arguments: Mapping[str, Any], parameters: Mapping[str, Any]) -> Mapping[str, Any]:
    found: Mapping[str, Any] = given(arguments, parameters) if callable(given) else given
    return found


def result_problems(operation: Operation, result: Mapping[str, Any]) -> Iterator[str]:
    """Yield the differences between `result` and the declared result of an operation."""
    for name in operation.result:
        if name not in result:
            yield f"leaves out {name!r} of the result"
    for name, value in result.items():
        if name not in operation.result:
            yield f"answers {name!r}, which is no field of the result"
        else:
            yield from _mismatch(name, value, operation.result[name])


def _mismatch(name: str, value: Any, kind: Type) -> Iterator[str]:
    yield from (f"{name!r}: {problem.at()}" for problem in problems(value, kind, Notation.DATA)[:1])


def computes(subject: PluginUnderTest) -> Iterator[str]:
    """Functions bind with the default parameters and are pure: same in, same out, nothing changed."""
    plugin = subject.plugin
    for name, function in plugin.functions.items():
        where = f"function {name!r}"
        arguments = subject.arguments_for(name, function.arguments)
        parameters = defaults_of(plugin.parameters)
        before = copy.deepcopy((arguments, parameters))
        try:
            bound = function.bind(parameters)
            outcomes = [_outcome(bound, arguments), _outcome(bound, arguments)]
            outcomes.append(_outcome(function.bind(defaults_of(plugin.parameters)), arguments))
        except Exception as problem:  # foreign code; ValueError is told in an outcome
            yield f"{where} fails for {arguments}: {told(problem, subject.point.module)}"
            continue
        if (arguments, parameters) != before:
            yield f"{where} changes its arguments or the parameters"
        if any(outcome != outcomes[0] for outcome in outcomes):
            yield f"{where} returns another result for the same arguments {arguments}"
        returned, refused = outcomes[0]
        if not refused:
            yield from (f"{where}: {text}" for text in _mismatch("result", returned, function.returns))


def _outcome(bound: Callable[..., Any], arguments: Mapping[str, Any]) -> tuple[Any, str]:
    """Return the result, and why there is none: a function may refuse arguments."""
    try:
        return copy.deepcopy(bound(*arguments.values())), ""
    except ValueError as refused:
        return None, str(refused) or "refused"


def reads(subject: PluginUnderTest) -> Iterator[str]:
    """Readers take whatever a request carries: they return, or raise ValueError with a text."""
    plugin = subject.plugin
    for name, reader in plugin.readers.items():
        try:
            bound = reader.bind(defaults_of(plugin.parameters))
        except Exception as problem:  # foreign code
            why = told(problem, subject.point.module)
            yield f"reader {name!r} does not bind with the default parameters: {why}"
            continue
        for given in ODD:
            try:
                bound(copy.deepcopy(given))
            except ValueError as refused:
                if not str(refused):
                    yield f"reader {name!r} refuses {given!r} without saying why"
            except Exception as problem:
                kind = type(problem).__name__
                yield f"reader {name!r} raises {kind} for {given!r}, not ValueError: {problem}"


#: name -> rule; its docstring says what is demanded.
RULES: Mapping[str, Callable[[PluginUnderTest], Iterator[str]]] = MappingProxyType(
    {
        rule.__name__: rule
        for rule in (
            registered,
            loads_without_ros,
            stays_the_same,
            names_modules,
            documented,
            labelled,
            mocked,
            computes,
            reads,
        )
    }
)


#: The rule that the others build on, and how the problem of one that cannot do so begins.
RULES_FIRST = registered.__name__
UNTRIED = "it cannot be tried"


def problems_with(rule: str, subject: PluginUnderTest) -> list[str]:
    """Return the violations of a rule."""
    try:
        return list(RULES[rule](subject))
    except Exception as problem:  # foreign data, so wrong that another rule refuses it already
        return [f"{UNTRIED}: {type(problem).__name__}: {problem}"]


def findings(subject: PluginUnderTest) -> dict[str, list[str]]:
    """Return the violations of each rule, by the rule's name.

    For a catalog that the registry refuses, rules that cannot be checked are left out.
    """
    found = {RULES_FIRST: problems_with(RULES_FIRST, subject)}
    for rule in RULES:
        problems = problems_with(rule, subject) if rule not in found else ()
        if not (found[RULES_FIRST] and any(problem.startswith(UNTRIED) for problem in problems)):
            found.setdefault(rule, list(problems))
    return found
