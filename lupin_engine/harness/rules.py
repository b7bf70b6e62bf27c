"""What a plugin's catalog must keep, checked without ROS: each rule tells everything that breaks it."""

from __future__ import annotations

import ast
import copy
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

from lupin_engine.errors import PluginError, nearest
from lupin_engine.harness.examples import arguments_for, defaults_of
from lupin_engine.plugin.contract import Argument, Code, Operation, Plugin
from lupin_engine.plugin.discovery import EntryPoint, find_entry_point, source_file
from lupin_engine.plugin.registry import build_catalog, import_plugin, load_catalog
from lupin_engine.plugin.types import Type, convert

#: Arguments by operation, action or function; what is not given is made up from the types.
Given = Mapping[str, Mapping[str, Any]]

#: What a request may carry where a reader expects something else.
ODD: tuple[Any, ...] = ("", "no such thing", 0, -1.5, True, None, [], {}, ["", {}], {"": None})
#: Loaded, they say that ROS is: rclpy, and what every message package imports.
ROS = ("rclpy", "rosidl_parser")
#: Seconds that loading a catalog may take in a new process, on a busy machine.
LOADING_S = 30.0


@dataclass(frozen=True)
class Subject:
    """The plugin that is checked: its entry point, and arguments to try things with."""

    point: EntryPoint
    arguments: Given = field(default_factory=dict)

    @cached_property
    def plugin(self) -> Plugin:
        """The plugin, imported.

        Raises:
            PluginError: it cannot be.
        """
        return import_plugin(self.point)

    def arguments_for(self, name: str, declared: Mapping[str, Argument]) -> dict[str, Any]:
        """Return arguments for what is called `name`."""
        return arguments_for(declared, self.arguments.get(name, {}))


def find_subject(name: str, arguments: Given = MappingProxyType({})) -> Subject:
    """Return an installed plugin, by the name of its entry point.

    Raises:
        UsageError: there is none; the text has the nearest name.
    """
    return Subject(find_entry_point(name), arguments)


def registered(subject: Subject) -> Iterator[str]:
    """The registry takes it, alone and beside all that is installed, under the name of its entry point."""
    plugin = subject.plugin
    if plugin.name != subject.point.name:
        yield f"the entry point {subject.point.name!r} names a plugin that calls itself {plugin.name!r}"
    try:
        build_catalog([plugin])
        installed = load_catalog().plugins
        if plugin.name not in installed:
            build_catalog([*installed.values(), plugin])
    except PluginError as problem:
        yield from str(problem).splitlines()


def loads_without_ros(subject: Subject) -> Iterator[str]:
    """Loading the catalog imports nothing of ROS: a laptop must be able to check missions with it."""
    program = (
        "import json, sys; path, name, value, ros = json.loads(sys.argv[1]); sys.path[:] = path; "
        "from lupin_engine.plugin.discovery import EntryPoint; EntryPoint(name, value).load(); "
        "print('\\n', json.dumps(sorted(set(ros) & set(sys.modules))))"
    )
    point = subject.point
    given = json.dumps([sys.path, point.name, point.value, ROS])
    command = [sys.executable, "-c", program, given]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONSTARTUP"}
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=LOADING_S, env=environment, check=False
        )
    except subprocess.TimeoutExpired:
        yield f"{point.module} is not loaded within {LOADING_S:g} s"
        return
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or ["no word of why"])[-1]
        yield f"{point.module} cannot be loaded in a process of its own: {reason}"
        return
    for module in json.loads(done.stdout.splitlines()[-1]):
        yield f"loading {point.module} imports {module}; import it in the client or the node only"


def names_modules(subject: Subject) -> Iterator[str]:
    """Client and nodes are where the catalog says."""
    plugin = subject.plugin
    named = {"client": plugin.client} if plugin.client else {}
    named |= {f"node {name!r}": target for name, target in plugin.nodes.items()}
    for what, target in named.items():
        module, _, attribute = target.partition(":")
        source = source_file(module)
        if source is None:
            yield f"{what}: there is no module {module!r}"
            continue
        try:
            names = _names_in(Path(source))
        except (OSError, ValueError, SyntaxError) as problem:
            yield f"{what}: the module {module!r} cannot be read: {problem}"
            continue
        if names is not None and attribute not in names:
            yield f"{what}: there is no {attribute!r} in {module!r}; {nearest(attribute, names)}"


def _names_in(source: Path) -> set[str] | None:
    """Return what a module names at its top, read without importing it; None where that cannot be seen."""
    if source.suffix != ".py":
        return None  # compiled, or built in
    tree = ast.parse(source.read_bytes(), source.name)
    outside = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    found: set[str] = set()
    for node in _at_the_top(tree.body):
        if isinstance(node, outside):
            found.add(node.name)
        elif isinstance(node, (ast.ImportFrom, ast.Import)):
            found |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, ast.Assign):
            found |= {target.id for target in node.targets if isinstance(target, ast.Name)}
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            found.add(node.target.id)
    return found


def _at_the_top(body: Iterable[ast.AST]) -> Iterator[ast.AST]:
    """Yield the statements of a module, also those below `if` and `try`."""
    for node in body:
        yield node
        if isinstance(node, (ast.If, ast.Try, ast.ExceptHandler)):
            yield from _at_the_top(ast.iter_child_nodes(node))


def documented(subject: Subject) -> Iterator[str]:
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


def labelled(subject: Subject) -> Iterator[str]:
    """Codes have labels that say more to an operator than their names."""
    for where, code in _codes(subject.plugin):
        if code.label.strip() in ("", code.name):
            yield f"{where}: the label of the code {code.name!r} must say what happened"


def _codes(plugin: Plugin) -> Iterator[tuple[str, Code]]:
    for name, operation in plugin.operations.items():
        yield from ((f"operation {name!r}", code) for code in operation.codes)
    for name, reader in plugin.readers.items():
        yield f"reader {name!r}", reader.code


def mocked(subject: Subject) -> Iterator[str]:
    """In a simulation every operation gives all that it declares, in the right types."""
    plugin = subject.plugin
    parameters = defaults_of(plugin.parameters)
    values = {name: value.type for name, value in load_catalog().values.items()}
    values |= {name: value.type for name, value in plugin.values.items()}
    for name, operation in plugin.operations.items():
        where = f"operation {name!r}: the mock"
        arguments = subject.arguments_for(name, operation.arguments)
        try:
            result = _mocked(operation.mock.result, arguments, parameters)
            changed = _mocked(operation.mock.values, arguments, parameters)
        except Exception as problem:  # foreign code
            yield f"{where} fails for {arguments}: {type(problem).__name__}: {problem}"
            continue
        yield from (f"{where} {text}" for text in result_problems(operation, result))
        for value in changed:
            if value not in values:
                yield f"{where} changes {value!r}, which is no live value; {nearest(value, values)}"
            else:
                yield from (f"{where}: {text}" for text in _mismatch(value, changed[value], values[value]))


def _mocked(given: Any, arguments: Mapping[str, Any], parameters: Mapping[str, Any]) -> Mapping[str, Any]:
    found: Mapping[str, Any] = given(arguments, parameters) if callable(given) else given
    return found


def result_problems(operation: Operation, result: Mapping[str, Any]) -> Iterator[str]:
    """Tell what keeps `result` from being the declared result of an operation."""
    for name in operation.result:
        if name not in result:
            yield f"leaves out {name!r} of the result"
    for name, value in result.items():
        if name not in operation.result:
            yield f"answers {name!r}, which is no field of the result"
        else:
            yield from _mismatch(name, value, operation.result[name])


def _mismatch(name: str, value: Any, kind: Type) -> Iterator[str]:
    try:
        convert(value, kind)
    except ValueError as problem:
        yield f"{name!r}: {problem}"


def computes(subject: Subject) -> Iterator[str]:
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
            yield f"{where} fails for {arguments}: {type(problem).__name__}: {problem}"
            continue
        if (arguments, parameters) != before:
            yield f"{where} changes its arguments or the parameters"
        if any(outcome != outcomes[0] for outcome in outcomes):
            yield f"{where} returns another result for the same arguments {arguments}"
        returned, refused = outcomes[0]
        if not refused:
            yield from (f"{where}: {text}" for text in _mismatch("result", returned, function.returns))


def _outcome(bound: Callable[..., Any], arguments: Mapping[str, Any]) -> tuple[Any, str]:
    """Return the result, and why there is none: a function may refuse what it cannot work with."""
    try:
        return copy.deepcopy(bound(*arguments.values())), ""
    except ValueError as refused:
        return None, str(refused) or "refused"


def reads(subject: Subject) -> Iterator[str]:
    """Readers take whatever a request carries: they return, or raise ValueError with a text."""
    plugin = subject.plugin
    for name, reader in plugin.readers.items():
        try:
            bound = reader.bind(defaults_of(plugin.parameters))
        except Exception as problem:  # foreign code
            kind = type(problem).__name__
            yield f"reader {name!r} does not bind with the default parameters: {kind}: {problem}"
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
RULES: Mapping[str, Callable[[Subject], Iterator[str]]] = MappingProxyType(
    {
        rule.__name__: rule
        for rule in (
            registered,
            loads_without_ros,
            names_modules,
            documented,
            labelled,
            mocked,
            computes,
            reads,
        )
    }
)


def problems_with(rule: str, subject: Subject) -> list[str]:
    """Return what breaks a rule; nothing where it is kept."""
    try:
        return list(RULES[rule](subject))
    except Exception as problem:  # foreign data, so wrong that another rule refuses it already
        return [f"it cannot be tried: {type(problem).__name__}: {problem}"]


def findings(subject: Subject) -> dict[str, list[str]]:
    """Return what breaks each rule, by the rule's name; an empty list where it is kept."""
    return {rule: problems_with(rule, subject) for rule in RULES}
