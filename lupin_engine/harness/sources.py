"""What the sources of a plugin's client and nodes tell without being imported: they need ROS to be.

Only what is written out is seen: a code in a constant, a class derived from another one's, a name that is
put together are left to the rules that try the driver.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from lupin_engine.errors import meant, nearest
from lupin_engine.plugin.contract import Plugin
from lupin_engine.plugin.discovery import source_file

#: What a driver has, with what the engine calls it.
DRIVER: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "__init__": ("ros", "outlet", "parameters"),
        "missing": (),
        "start": ("attempt", "operation", "arguments"),
        "cancel": ("attempt",),
        "act": ("action", "arguments"),
        "close": (),
    }
)
_DEFINITIONS = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def client_problems(target: str) -> Iterator[str]:
    """Tell why the engine cannot make a driver of what `module:Class` names."""
    source, missing = _named(target)
    if missing:
        yield missing
    found = _definition(source, target)
    # One that is derived from another class has the rest from there.
    if isinstance(found, ast.ClassDef) and not found.bases and not found.decorator_list:
        yield from _driver_problems(found)


def node_problems(target: str) -> Iterator[str]:
    """Tell why the engine cannot run what `module:function` names."""
    source, missing = _named(target)
    if missing:
        yield missing
    found = _definition(source, target)
    if isinstance(found, ast.FunctionDef) and not found.decorator_list:
        yield from _call_problems(found.name, found, ("arguments",))


def undeclared(plugin: Plugin) -> Iterator[str]:
    """Tell names that the client's module writes out and the catalog does not have, each with its line."""
    source, _ = _named(plugin.client)
    known: Mapping[str, Iterable[str]] = {
        "code": {code.name for operation in plugin.operations.values() for code in operation.codes},
        "live value": plugin.values,
        "event": [f"{plugin.name}.{name}" for name in plugin.events],
        "parameter": plugin.parameters,
    }
    if source is None:
        return
    for node in ast.walk(source.tree):
        for what, name, line in _written_names(node):
            if name not in known[what]:
                said = nearest(name, known[what])
                yield f"{source.file.name}:{line}: {name!r} is no {what} of the catalog; {said}"
        yield from (f"{source.file.name}:{problem}" for problem in _field_problems(node, plugin))


def _field_problems(node: ast.AST, plugin: Plugin) -> Iterator[str]:
    """Tell an event with other fields than it declares, where both are written out."""
    match node:
        case ast.Call(
            func=ast.Attribute(attr="event"), args=[ast.Constant(value=str(name)), ast.Dict(keys=keys)]
        ):
            event = {f"{plugin.name}.{local}": kind for local, kind in plugin.events.items()}.get(name)
            written = {key.value for key in keys if isinstance(key, ast.Constant)}
            if event is not None and len(written) == len(keys) and written != set(event.fields):
                wanted = ", ".join(event.fields) or "none"
                yield f"{node.lineno}: event {name!r} is told with other fields than it declares: {wanted}"


def _definition(source: _Source | None, target: str) -> ast.AST | None:
    return source.names.get(target.partition(":")[2]) if source is not None else None


def _driver_problems(found: ast.ClassDef) -> Iterator[str]:
    methods = {node.name: node for node in found.body if isinstance(node, ast.FunctionDef)}
    others = [name for name in methods if name not in DRIVER]
    for name, given in DRIVER.items():
        if name in methods:
            yield from _call_problems(f"{found.name}.{name}", methods[name], ("self", *given))
        else:
            said = meant(name, others)
            problem = f"{found.name} in line {found.lineno} has no method {name}({', '.join(given)})"
            yield f"{problem}; {said}" if said else problem


def _call_problems(name: str, function: ast.FunctionDef, given: Sequence[str]) -> Iterator[str]:
    """Tell when a function cannot be called with so many arguments by position."""
    declared = function.args
    at_most = len(declared.posonlyargs) + len(declared.args)
    at_least = at_most - len(declared.defaults)
    by_name = any(default is None for default in declared.kw_defaults)
    if (at_most < len(given) and declared.vararg is None) or at_least > len(given) or by_name:
        yield f"{name} in line {function.lineno} must be callable as {function.name}({', '.join(given)})"


@dataclass(frozen=True)
class _Source:
    """A module as it is written: `names` has what it names at its top, with definitions."""

    file: Path
    tree: ast.Module
    names: Mapping[str, ast.AST | None]


def _named(target: str) -> tuple[_Source | None, str]:
    """Return the module of `module:name`, and why there is no such name; of neither what cannot be seen."""
    module, _, name = target.partition(":")
    file = source_file(module)
    if file is None:
        return None, f"there is no module {module!r}"
    if not file.endswith(".py"):
        return None, ""  # compiled, or built in
    try:
        tree = ast.parse(Path(file).read_bytes(), Path(file).name)
    except (OSError, ValueError, SyntaxError) as problem:
        return None, f"the module {module!r} cannot be read: {problem}"
    names = dict(_names_in(tree))
    missing = "" if name in names else f"there is no {name!r} in {module!r}; {nearest(name, names)}"
    return _Source(Path(file), tree, names), missing


def _names_in(tree: ast.Module) -> Iterator[tuple[str, ast.AST | None]]:
    """Yield what a module names at its top, with the definition where it is one."""
    for node in _at_the_top(tree.body):
        if isinstance(node, _DEFINITIONS):
            yield node.name, node
        elif isinstance(node, (ast.ImportFrom, ast.Import)):
            yield from ((alias.asname or alias.name, None) for alias in node.names)
        elif isinstance(node, ast.Assign):
            yield from ((target.id, None) for target in node.targets if isinstance(target, ast.Name))
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            yield node.target.id, None


def _at_the_top(body: Iterable[ast.AST]) -> Iterator[ast.AST]:
    """Yield the statements of a module, also those below `if` and `try`."""
    for node in body:
        yield node
        if isinstance(node, (ast.If, ast.Try, ast.ExceptHandler)):
            yield from _at_the_top(ast.iter_child_nodes(node))


def _written_names(node: ast.AST) -> Iterator[tuple[str, str, int]]:
    """Yield what a piece of source reports, or reads, by a name that is written out, with its line."""
    if isinstance(node, ast.Subscript) and _last_name(node.value).lstrip("_") == "parameters":
        yield from _text("parameter", node.slice)
    if isinstance(node, ast.Call):
        called, given = _last_name(node.func), node.args
        if called == "Failed" and given:
            yield from _text("code", given[0])
        if isinstance(node.func, ast.Attribute) and (called, len(given)) in _REPORTS:
            what, place = _REPORTS[called, len(given)]
            yield from _text(what, given[place])


#: Calls of an outlet, by the number of their arguments: what is named, and which argument names it.
_REPORTS: Mapping[tuple[str, int], tuple[str, int]] = MappingProxyType(
    {
        ("failed", 2): ("code", 1),
        ("failed", 3): ("code", 1),
        ("value", 3): ("live value", 0),
        ("event", 2): ("event", 0),
    }
)


def _last_name(node: ast.AST) -> str:
    """Return `name` of `name` and of `anything.name`, else ''."""
    return getattr(node, "id", "") or getattr(node, "attr", "")


def _text(what: str, node: ast.expr) -> Iterator[tuple[str, str, int]]:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield what, node.value, node.lineno
