"""Which kind of proof a link of docs/war-stories.md is, derived from what the linked test starts.

A static call graph over the folder `tests` (rapid type analysis): from a test to the fixtures that it asks
for and to whatever these and it name; of a class that is reached, to the methods whose name somebody calls.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cache
from pathlib import Path

from lupin_engine.sim import SUFFIX

ROOT = Path(__file__).parents[2]
#: What makes a node, and what starts a process.
NODES = ("lupin_ros.adapter.node.RosNode", "rclpy.create_node")
PROCESSES = ("subprocess.Popen", "subprocess.run", "subprocess.check_output")
SIMULATES = "lupin_engine.sim"


class Kind(Enum):
    """What runs in a proof, from the least to the most."""

    CHECK = "check"
    FUNCTION = "function"
    SIMULATED = "simulated"
    NODES = "nodes"
    SYSTEM = "system"


#: What is seen on the wire is proven there.
ON_THE_WIRE = frozenset({Kind.NODES, Kind.SYSTEM})


@dataclass(frozen=True)
class Module:
    """A file of the tests: what it defines, and where it has its other names from."""

    file: Path
    defined: dict[str, ast.AST]
    imported: dict[str, str]


def kind_of(file: Path, test: str) -> Kind:
    """Return the kind of a proof: a scenario, a broken chart, a file of tests, or one test of it."""
    if file.name.endswith(SUFFIX):
        return Kind.SIMULATED
    if file.suffix != ".py":
        return Kind.CHECK
    module = read(file)
    tests = [test] if test else [name for name in module.defined if name.startswith("test_")]
    reached = {name for one in tests for name in reach(module, one)}
    if "lupin_ros" in file.relative_to(ROOT / "tests").parts[:1] and reached.intersection(PROCESSES):
        return Kind.SYSTEM
    if reached.intersection(NODES):
        return Kind.NODES
    return Kind.SIMULATED if any(name.startswith(SIMULATES) for name in reached) else Kind.FUNCTION


@cache
def read(file: Path) -> Module:
    """Read the names of a file."""
    defined: dict[str, ast.AST] = {}
    imported: dict[str, str] = {}
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom):
            imported |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            imported |= {alias.asname or alias.name: alias.name for alias in node.names}
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            defined[node.name] = node
        elif isinstance(node, ast.Assign):
            defined |= {target.id: node.value for target in node.targets if isinstance(target, ast.Name)}
    return Module(file, defined, imported)


def reach(home: Module, test: str) -> set[str]:
    """Return all names outside of the tests that a test comes to, in full."""
    walk = Walk(home)
    walk.name(home, test)
    return walk.outside


class Walk:
    """What was reached from a test, and the methods of reached classes that nobody has called yet."""

    def __init__(self, home: Module) -> None:
        self.outside: set[str] = set()
        self._seen: set[tuple[Path, str]] = set()
        self._called: set[str] = set()
        self._uncalled: dict[str, list[tuple[Module, ast.AST]]] = {}
        # A fixture asks for others by the names that they have for the test.
        self._fixtures = [home, *_conftests(home.file)]

    def name(self, module: Module, name: str) -> None:
        """Follow a name of a module, which may be dotted."""
        if (module.file, name) in self._seen:
            return
        self._seen.add((module.file, name))
        first, _, rest = name.partition(".")
        if first in module.defined:
            self._definition(module, module.defined[first])
        elif first in module.imported:
            full = f"{module.imported[first]}.{rest}".rstrip(".")
            file, last = _file_of(full)
            if file is None:
                self.outside.add(full)
            else:
                self.name(read(file), last)

    def _definition(self, module: Module, node: ast.AST) -> None:
        """Follow a definition: of a test or fixture what it asks for too, of a class what is called of it."""
        if isinstance(node, ast.FunctionDef) and _is_injected(node):
            for asked in node.args.args:
                owner = next((place for place in self._fixtures if asked.arg in place.defined), module)
                self.name(owner, asked.arg)
        for child in _children(node):
            method = isinstance(node, ast.ClassDef) and isinstance(child, ast.FunctionDef)
            if method and not child.name.startswith("__") and child.name not in self._called:
                self._uncalled.setdefault(child.name, []).append((module, child))
            else:
                self._code(module, child)

    def _code(self, module: Module, node: ast.AST) -> None:
        """Follow what code names: functions, classes and attributes."""
        if isinstance(node, ast.Name):
            self.name(module, node.id)
        elif isinstance(node, ast.Attribute):
            if isinstance(node.value, ast.Name):
                self.name(module, f"{node.value.id}.{node.attr}")
            self._call(node.attr)
        for child in _children(node):
            self._code(module, child)

    def _call(self, method: str) -> None:
        self._called.add(method)
        for module, node in self._uncalled.pop(method, []):
            self._code(module, node)


def _is_injected(node: ast.FunctionDef) -> bool:
    """Tell whether the arguments of a function are fixtures."""
    return node.name.startswith("test_") or any("fixture" in ast.unparse(one) for one in node.decorator_list)


def _children(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the parts of code; an annotation is no call."""
    for field, value in ast.iter_fields(node):
        parts = value if isinstance(value, list) else [value]
        if field not in ("returns", "annotation"):
            yield from (part for part in parts if isinstance(part, ast.AST))


def _file_of(full: str) -> tuple[Path | None, str]:
    """Return the file of the tests that has a name, and what it is called there; none for others."""
    parts = full.split(".")
    for end in range(len(parts) - 1, 1, -1):
        file = ROOT.joinpath(*parts[:end]).with_suffix(".py")
        if parts[0] == "tests" and file.is_file():
            return file, ".".join(parts[end:])
    return None, ""


def _conftests(file: Path) -> list[Module]:
    """Return the files with fixtures for a test, the nearest first."""
    folders = [folder for folder in file.parents if (ROOT / "tests") in (folder, *folder.parents)]
    return [read(folder / "conftest.py") for folder in folders if (folder / "conftest.py").is_file()]
