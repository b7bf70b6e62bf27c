"""Finds the nodes that can be started: the orchestrator, and those of the plugins; and runs them here."""

from __future__ import annotations

import ast
import importlib
import importlib.util
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import ModuleType
from typing import Any

from lupin_engine.errors import LupinError, PluginError, UsageError, nearest
from lupin_engine.plugin import Catalog, Parameter
from lupin_ros.adapter.process import is_rclpys_end, run_together
from lupin_ros.service import names

ORCHESTRATOR = names.NODE
_ORCHESTRATOR_ENTRY = "lupin_ros.orchestrator.node:main"


@dataclass(frozen=True)
class LaunchableNode:
    """A node: its name, `module:function`, and its plugin ('' for the engine's own)."""

    name: str
    entry: str
    plugin: str = ""

    @property
    def doc(self) -> str:
        """The first line of the module's docstring, read without importing it: modules of nodes need ROS."""
        try:
            spec = importlib.util.find_spec(self.entry.partition(":")[0])
            source = spec.loader.get_source(spec.name) if spec and spec.loader else ""  # type: ignore[attr-defined]
            text = ast.get_docstring(ast.parse(source or "")) or ""
        except (ImportError, SyntaxError, AttributeError, ValueError):
            return ""
        return text.partition("\n")[0]

    def parameters(self) -> Mapping[str, Parameter]:
        """Return PARAMETERS of the node's module; importing it needs ROS."""
        found: Mapping[str, Parameter] = getattr(self._module(), "PARAMETERS", {})
        return found

    def check(self, values: Mapping[str, Any]) -> None:
        """Check parameters together, such as whether files exist, without starting the node.

        It calls the function `check` of the node's module, if there is one, with all values.

        Raises:
            LupinError: the node would not start with them; the text has all problems.
            PluginError: the function itself failed.
        """
        check: Callable[[Mapping[str, Any]], None] | None = getattr(self._module(), "check", None)
        try:
            if check is not None:
                check(values)
        except LupinError:
            raise
        except Exception as defect:
            reason = f"{type(defect).__name__}: {defect}"
            raise PluginError(f"node {self.name!r} of {self._owner}: its check failed: {reason}") from defect

    def addresses(self, values: Mapping[str, Any]) -> Sequence[str]:
        """Return the addresses of the pages that the node serves with these parameters; most serve none."""
        found: Callable[[Mapping[str, Any]], Sequence[str]] | None = getattr(
            self._module(), "addresses", None
        )
        return found(values) if found is not None else ()

    def load(self) -> Callable[[Sequence[str]], int]:
        """Import the function that runs the node; PluginError where its module or the function is missing."""
        attribute = self.entry.partition(":")[2]
        found: Callable[[Sequence[str]], int] | None = getattr(self._module(), attribute, None)
        if found is None:
            raise self._broken(f"there is no {attribute!r}")
        return found

    def run(self, arguments: Sequence[str]) -> int:
        """Run the node until a signal stops it, and return its exit code; its exceptions go through."""
        try:
            return self.load()(arguments)
        except (Exception, KeyboardInterrupt) as problem:
            if not is_rclpys_end(problem):
                raise
            return 0

    @property
    def _owner(self) -> str:
        return f"plugin {self.plugin!r}" if self.plugin else "the engine"

    def _module(self) -> ModuleType:
        try:
            return importlib.import_module(self.entry.partition(":")[0])
        except ImportError as problem:
            raise self._broken(str(problem)) from problem

    def _broken(self, reason: str) -> PluginError:
        return PluginError(
            f"node {self.name!r} of {self._owner} cannot be loaded from {self.entry}: {reason}"
        )


def nodes_of(catalog: Catalog) -> Mapping[str, LaunchableNode]:
    """Return every node by name, the orchestrator first."""
    found = {ORCHESTRATOR: LaunchableNode(ORCHESTRATOR, _ORCHESTRATOR_ENTRY)}
    for plugin in catalog.plugins.values():
        for name, entry in plugin.nodes.items():
            found.setdefault(name, LaunchableNode(name, entry, plugin.name))
    return found


def is_composable(node: LaunchableNode, catalog: Catalog) -> bool:
    """Return whether a node may share a process with others."""
    plugin = catalog.plugins.get(node.plugin)
    return plugin is not None and node.name in plugin.composable


def run_composed(nodes: Sequence[LaunchableNode], catalog: Catalog, arguments: Sequence[str]) -> int:
    """Run nodes in this process until one ends or a signal stops all, and return the exit code.

    Raises:
        UsageError: one of them has a process of its own.
    """
    alone = [node.name for node in nodes if not is_composable(node, catalog)]
    if alone:
        raise UsageError(f"{', '.join(alone)}: shares no process; start each with `lupin node NAME`")
    from lupin_ros.adapter.node import one_context  # needs rclpy

    with one_context(arguments):
        return run_together({node.name: partial(node.run, list(arguments)) for node in nodes})


def find_node(name: str, catalog: Catalog) -> LaunchableNode:
    """Return the node `name`.

    Raises:
        UsageError: there is none; the text has the nearest name.
    """
    known = nodes_of(catalog)
    if name not in known:
        raise UsageError(f"unknown node {name!r}; {nearest(name, known)}")
    return known[name]
