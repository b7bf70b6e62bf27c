"""The page of the contract: what a plugin is made of and can use, read off the sources.

.venv/bin/python tools/contract.py > docs/contract.md
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

HEAD = """\
# The contract of a plugin

Every class that a plugin is made of, or can use, with its fields and methods; how they go together is
shown by [the lamp](plugins.md) and [the scale](scale.md). What is not on this page is the engine's own and
may change. Times are seconds, lengths metres, angles radians, masses kilograms: numbers are kept in the
base unit.
"""


@dataclass(frozen=True)
class Part:
    """A heading, what stands below it, and of which module which classes and functions are shown."""

    title: str
    text: str
    module: str
    names: Sequence[str]


PARTS: Sequence[Part] = (
    Part(
        "The catalog",
        "A `Plugin` in a module that needs no ROS, which an entry point of the group `lupin.plugins`\n"
        "names. Where a field has no default it must be given.",
        "lupin_engine/plugin/contract.py",
        (
            *("Plugin", "Operation", "Action", "Argument", "Mock", "OnHold", "Function", "LiveValue"),
            *("EventKind", "Parameter", "Code", "Reader", "Access"),
        ),
    ),
    Part(
        "The profile",
        "A `Profile`, which an entry point of the group `lupin.profiles` names:\n"
        "[another kind of robot](profiles.md).",
        "lupin_engine/plugin/profile.py",
        (
            *("Profile", "TargetOutcome", "Rating", "RequestField", "OperatorRequest", "Publication"),
            *("Stages", "Terminal", "Flag"),
        ),
    ),
    Part(
        "The profile on the wire",
        "What the functions of a `Wire` get and return are the fields of messages, by name.",
        "lupin_engine/plugin/profile.py",
        (
            *("Wire", "Channel", "StartService", "StartRequest", "StartAnswer", "Situation", "Publish"),
            *("Progress", "TargetResult", "Remark"),
        ),
    ),
    Part("Severities", "How bad a code is.", "lupin_engine/errors.py", ("Severity",)),
    Part(
        "Types",
        "`BOOL`, `TEXT`, `NUMBER`, `INTEGER`, `COUNT`, `DURATION`, `LENGTH`, `ANGLE`, `POSE` and `ANY` are\n"
        "there; values are plain data, records are mappings. Others are made with these:",
        "lupin_engine/plugin/types.py",
        ("list_of", "number_in", "one_of", "within", "in_unit", "in_base", "Type"),
    ),
    Part(
        "The driver",
        "What the class that `client` names must be.",
        "lupin_engine/plugin/contract.py",
        ("Driver", "Outlet"),
    ),
    Part(
        "The node",
        "What a driver gets as `ros`, and a node of a plugin can be made with.",
        "lupin_ros/adapter/node.py",
        ("RosNode", "RosTimer"),
    ),
    Part("Quality of service", "A topic is created with one of these.", "lupin_ros/adapter/qos.py", ("Qos",)),
    Part(
        "Services",
        "What `ros.service` gives. A call that is cancelled calls back no more.",
        "lupin_ros/adapter/calls.py",
        ("ServiceCaller", "CallFailure"),
    ),
    Part(
        "Drivers over services",
        "A driver whose operations are one call each is this one.",
        "lupin_ros/adapter/service_driver.py",
        ("ServiceDriver", "ServiceOperation", "Done", "Failed"),
    ),
    Part(
        "Drivers over actions",
        "`ros.action` is below these, for what they do not cover.",
        "lupin_ros/adapter/action_driver.py",
        ("ActionServer", "ActionOperation", "ActionAttempts"),
    ),
    Part(
        "Actions that a node serves",
        "What `ros.serve_action` makes.",
        "lupin_ros/adapter/actions.py",
        ("ActionHost", "ServedGoal"),
    ),
)

#: Classes that the node makes, not the author of a plugin.
GIVEN = frozenset({"RosTimer", "ServiceCaller", "ActionHost", "ServedGoal"})
#: Methods that are between the engine's own modules.
INSIDE = frozenset({"forget", "values_with", "declare_anew", "channels", "guarded", "leave", "work_until"})


def page() -> str:
    """Return the page."""
    return "\n".join(_lines()) + "\n"


def _lines() -> Iterator[str]:
    yield from HEAD.splitlines()
    for part in PARTS:
        module = ".".join(part.module.removesuffix(".py").split("/")[:2])
        yield from ("", f"## {part.title}", "", *part.text.splitlines(), "", f"From `{module}`.")
        definitions = _definitions(part.module)
        for name in part.names:
            yield from ("", f"### {name}", "")
            yield from _definition(definitions[name], part.module)


@cache
def _definitions(module: str) -> Mapping[str, ast.ClassDef | ast.FunctionDef]:
    source = ROOT / module
    tree = ast.parse(source.read_text(encoding="utf-8"), source.name)
    return {node.name: node for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}


def _definition(node: ast.ClassDef | ast.FunctionDef, module: str) -> Iterator[str]:
    if isinstance(node, ast.FunctionDef):
        yield from (f"`{_signature(node)}`", "", *_doc(node))
        return
    yield from _doc(node)
    fields = [part for part in node.body if isinstance(part, ast.AnnAssign)]
    constants = [part for part in node.body if isinstance(part, ast.Assign)]
    methods = [part for part in node.body if isinstance(part, ast.FunctionDef) and _is_shown(node, part)]
    if fields:
        yield from ("", "| field | type | default |", "|---|---|---|")
        yield from (_row(field) for field in fields)
    if constants:
        yield ""
        yield from (_constant(constant, module) for constant in constants)
    for method in methods:
        yield from ("", f"- **`{_signature(method)}`**", *(f"  {line}".rstrip() for line in _doc(method)))


def _is_shown(holder: ast.ClassDef, method: ast.FunctionDef) -> bool:
    if method.name == "__init__":
        return holder.name not in GIVEN
    return not method.name.startswith("_") and method.name not in INSIDE and bool(ast.get_docstring(method))


def _constant(constant: ast.Assign, module: str) -> str:
    """Return a constant with the remark behind it."""
    line = (ROOT / module).read_text(encoding="utf-8").splitlines()[constant.lineno - 1]
    remark = line.partition("#: ")[2]
    names = ", ".join(map(ast.unparse, constant.targets))
    return f"- `{names}`" + (f": {remark}" if remark else "")


def _row(field: ast.AnnAssign) -> str:
    default = "" if field.value is None else f"`{_default(field.value)}`"
    kind = ast.unparse(field.annotation).replace("|", "\\|")
    return f"| `{ast.unparse(field.target)}` | `{kind}` | {default} |"


def _default(value: ast.expr) -> str:
    """Return a default as its user would write it: `{}` of `field(default_factory=dict)`."""
    match value:
        case ast.Call(func=ast.Name(id="field"), keywords=[ast.keyword(value=ast.Name(id=name)), *_]):
            return "{}" if name == "dict" else f"{name}()"
    return ast.unparse(value)


def _signature(function: ast.FunctionDef) -> str:
    if any(isinstance(by, ast.Name) and by.id == "property" for by in function.decorator_list):
        return function.name
    given = ast.unparse(function.args).removeprefix("self").removeprefix(", ")
    returns = f" -> {ast.unparse(function.returns)}" if function.returns else ""
    name = "made with" if function.name == "__init__" else function.name
    return f"{name}({given}){'' if function.name == '__init__' else returns}"


def _doc(node: ast.ClassDef | ast.FunctionDef) -> Iterator[str]:
    """Yield a docstring up to what it raises, which is told in one line."""
    said, _, raised = (ast.get_docstring(node) or "").partition("\nRaises:\n")
    yield from said.rstrip().splitlines()
    if raised:
        reasons = " ".join(raised.split())
        yield from ("", f"Raises {reasons}")


if __name__ == "__main__":
    sys.stdout.write(page())
