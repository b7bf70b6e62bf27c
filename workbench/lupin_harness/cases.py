"""The harness as classes of tests: derive from them in a module of tests, and pytest runs the rules.

    class TestCatalog(CatalogContract):
        plugin = "lamp"

    class TestDriver(DriverContract):
        plugin = "lamp"
        arguments = {"switch": {"name": "red"}}

`CatalogContract` needs no ROS. `DriverContract` starts the plugin's own nodes, and the stand-ins of `offer`,
on a ROS domain of its own; without ROS it is skipped.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import pytest

from lupin_engine.errors import PluginError, UsageError, nearest
from lupin_engine.plugin import load_catalog
from lupin_harness.live import apply, live_cases
from lupin_harness.referee import ContractBroken
from lupin_harness.rules import RULES, Given, PluginUnderTest, find_subject, problems_with

if TYPE_CHECKING:
    from lupin_harness.bench import Lab
    from lupin_ros.adapter import RosNode


def _subject(plugin: str, arguments: Given = MappingProxyType({})) -> PluginUnderTest:
    """Return the plugin under test; fail in one line when it is not installed or cannot be imported."""
    try:
        subject = find_subject(plugin, arguments)
        _ = subject.plugin
        return subject
    except UsageError as problem:
        text = f"{problem}; it is tested as it is installed: pip install --editable FOLDER"
    except PluginError as problem:
        text = str(problem)
    pytest.fail(text, pytrace=False)


class CatalogContract:
    """The rules of every catalog. `arguments` are by operation, action or function, else examples."""

    plugin: ClassVar[str]
    arguments: ClassVar[Given] = {}

    def pytest_generate_tests(self, metafunc: pytest.Metafunc) -> None:
        """Make one test of each rule."""
        metafunc.parametrize("rule", RULES)

    def test_catalog(self, rule: str) -> None:
        """The catalog keeps the rule."""
        problems = problems_with(rule, _subject(self.plugin, self.arguments))
        if problems:
            pytest.fail("\n".join([f"{rule}: {RULES[rule].__doc__}", *problems]), pytrace=False)


class DriverContract:
    """The rules of every driver.

    `arguments` are by operation or action; with them an operation must succeed. `parameters` override
    defaults. `nodes` are the nodes to start, by default all of the plugin; `node_parameters` are by node.
    `waits` is False for a driver that works without servers. `first` lists, by operation, those that a
    mission does before it.
    """

    plugin: ClassVar[str]
    arguments: ClassVar[Given] = {}
    parameters: ClassVar[Mapping[str, Any]] = {}
    nodes: ClassVar[Sequence[str] | None] = None
    node_parameters: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    waits: ClassVar[bool] = True
    first: ClassVar[Mapping[str, Sequence[str]]] = {}

    _stack: ClassVar[ExitStack]
    _lab: ClassVar[Lab]

    @staticmethod
    def offer(ros: RosNode) -> None:
        """Put stand-ins of servers on a node of this process; there are none unless this is overridden."""

    @classmethod
    def node_entries(cls) -> dict[str, str]:
        """Return the nodes to start, with their entry points `module:function`; UsageError: unknown one."""
        own = _subject(cls.plugin).plugin.serving
        known = {
            name: entry for plugin in load_catalog().plugins.values() for name, entry in plugin.nodes.items()
        }
        wanted = list(own) if cls.nodes is None else cls.nodes
        for name in wanted:
            if name not in known:
                raise UsageError(f"no plugin has a node {name!r}; {nearest(name, known)}")
        return {name: known[name] for name in wanted}

    @classmethod
    def setup_class(cls) -> None:
        """Claim ROS domains."""
        pytest.importorskip("rclpy", reason="ROS 2 is not installed here")
        from lupin_harness.bench import Lab, Setting

        setting = Setting(
            _subject(cls.plugin).plugin,
            cls.parameters,
            cls.arguments,
            cls.node_entries(),
            cls.node_parameters,
            cls.offer,
            cls.waits,
            cls.first,
        )
        cls._stack = ExitStack()
        cls._lab = cls._stack.enter_context(Lab(setting).open())

    @classmethod
    def teardown_class(cls) -> None:
        """End all servers."""
        cls._stack.close()

    def pytest_generate_tests(self, metafunc: pytest.Metafunc) -> None:
        """Make one test of each rule, for each operation that it is about."""
        found = list(live_cases(_subject(self.plugin).plugin))
        names = [f"{rule}-{operation}" if operation else rule for rule, operation in found]
        metafunc.parametrize(("rule", "operation"), found, ids=names)

    def test_driver(self, rule: str, operation: str) -> None:
        """The driver keeps the rule."""
        try:
            apply(rule, operation, self._lab)
        except ContractBroken as broken:
            pytest.fail(f"{rule}: {broken}", pytrace=False)
