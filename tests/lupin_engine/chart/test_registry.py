"""A plugin is verified before anything uses it, and refused by name with a reason."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.errors import PluginError
from lupin_engine.plugin import registry
from lupin_engine.plugin.builtin import BUILTIN
from lupin_engine.plugin.contract import (
    Action,
    Argument,
    Code,
    Function,
    LiveValue,
    Mock,
    Operation,
    Parameter,
    Plugin,
    Reader,
)
from lupin_engine.plugin.discovery import EntryPoint
from lupin_engine.plugin.registry import Catalog, build_catalog, load_catalog
from lupin_engine.plugin.types import COUNT, DURATION, POSE, TEXT, Type

PLAIN = Plugin(
    name="hand", doc="A hand.", operations={"wave": Operation("Wave.", codes=(Code("tired", "tired"),))}
)


def test_a_catalog_joins_what_plugins_offer(catalog: Catalog) -> None:
    """By full name; the built-in plugin is always there."""
    assert list(catalog.plugins) == [BUILTIN, "nav", "bridge", "perception", "arm"]
    assert "nav.go_to" in catalog.operations
    assert "plugins.ready" in catalog.operations
    assert "arm.preset" in catalog.actions
    assert "tags.numeric_order" in catalog.functions
    assert catalog.owners["value", "robot.battery"] == "bridge"
    assert catalog.codes["bridge_error"].label == "bridge error"
    assert catalog.known_types["tag"].fields["id"] is TEXT


def test_the_installed_plugins_make_a_catalog() -> None:
    """By entry point, without ROS."""
    assert "plugins.ready" in load_catalog().operations


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"name": "Hand"}, "its name must be lower case"),
        ({"name": "operator"}, "its name is a word of the language"),
        (
            {"companions": ("watcher",), "nodes": {"a_watcher": "watch:main"}},
            "companions names 'watcher', which is none of its nodes; did you mean 'a_watcher'",
        ),
        (
            {"composable": ("dog",), "nodes": {"dog": "d:main"}, "guards": {"dog": ("go",)}},
            "composable names 'dog', which guards something: it has a process of its own",
        ),
        (
            {"composable": ("page",), "nodes": {"page": "p:main"}, "hmi": True},
            "composable names 'page', which serves pages: it has a process of its own",
        ),
        ({"stands_in": {"sim": ()}}, "stands_in names 'sim', which is none of its nodes; nothing is allowed"),
        ({"functions": {"F": Function("F.", TEXT, lambda _: str)}}, "lower case .*, underscores and dots"),
        (
            {"types": {"my-leaf": Type("record", "my-leaf")}},
            "type 'my-leaf': the name must be letters, digits",
        ),
        (
            {"operations": {"w": Operation("W.", {"to": Argument("text", "to", "x")})}},
            "operation 'w': the argument 'to' must have a Type, such as `types.TEXT`, got 'text'",
        ),
        (
            {"operations": {"w": Operation("W.", result={"to": str})}},
            "operation 'w': the result field 'to' must have a Type, such as `types.TEXT`, got <class 'str'>",
        ),
        (
            {"functions": {"f": Function("F.", "text", lambda _: str)}},
            "function 'f': what it returns must have",
        ),
        ({"values": {"v": LiveValue("V.", "count", initial=1)}}, "value 'v' must have a Type"),
        ({"parameters": {"p": Parameter("text", "x", "p", minimum=1)}}, "parameter 'p' must have a Type"),
        ({"operations": {"w": "wave"}}, r"operation 'w' must be made with Operation\(...\), got 'wave'"),
        ({"operations": ["wave"]}, "operations must be a mapping by name, such as {'name': ...}, got "),
        ({"operations": {"Wave": Operation("Wave.")}}, "operation 'Wave': the name must be"),
        ({"operations": {"w": Operation("W.", {"To": Argument(TEXT, "to")})}}, "argument 'To' must be"),
        ({"operations": {"w": Operation("W.", {"n": Argument(COUNT, "n", -1)})}}, "default of argument 'n'"),
        ({"operations": {"w": Operation("W.", codes=(Code("too late", "x"),))}}, "code 'too late' must be"),
        ({"operations": {"w": Operation("W.", codes=(Code("late", ""),))}}, "code 'late' has no label"),
        ({"operations": {"w": Operation("W.", mock=Mock(-1.0))}}, "mock ends after -1.0 s"),
        ({"operations": {"w": Operation("W.", mock=Mock(0.0, {"x": 1}))}}, "no field of the result"),
        ({"operations": {"w": Operation("W.", result={"x": TEXT}, mock=Mock(0.0, {"x": 1}))}}, "mock's 'x'"),
        ({"operations": {"w": Operation("W.", uses=("Left arm",))}}, "uses 'Left arm'"),
        ({"actions": {"a": Action("A.", {"p": Argument(POSE, "p", {"x": 1.0})})}}, "default of argument 'p'"),
        (
            {
                "functions": {
                    "f": Function(
                        "F.",
                        TEXT,
                        lambda _: str,
                        {"a": Argument(TEXT, "a", optional=True), "b": Argument(TEXT, "b")},
                    )
                }
            },
            "argument 'b' must be given",
        ),
        ({"values": {"v": LiveValue("V.", COUNT, freshness=0.0)}}, "freshness of 0.0 s"),
        ({"values": {"v": LiveValue("V.", COUNT, initial="x")}}, "initial value: expected count"),
        ({"types": {"leaf": Type("record", "blade")}}, "type 'leaf' calls itself 'blade'"),
        ({"types": {"pose": POSE}}, "type 'pose' is built in"),
        ({"readers": {"leaf": Reader(Code("x", "x"), lambda _: str)}}, "reader 'leaf' reads a type"),
        ({"parameters": {"p": Parameter(DURATION, "x", "p")}}, "parameter 'p': the default"),
        (
            {"parameters": {"p": Parameter(DURATION, 1.0, "p", minimum=2.0)}},
            "default 1 is below the minimum 2",
        ),
        (
            {"parameters": {"p": Parameter(DURATION, 9.0, "p", maximum=2.0)}},
            "default 9 is above the maximum 2",
        ),
        ({"parameters": {"p": Parameter(TEXT, "x", "p", minimum=2.0)}}, "a text has no minimum"),
        ({"client": "hand client"}, "'hand client' must have the form 'module:name'"),
    ],
)
def test_a_plugin_that_breaks_the_contract_is_refused(changes: dict[str, Any], reason: str) -> None:
    """Named, with the reason."""
    plugin = replace(PLAIN, **changes)
    with pytest.raises(PluginError, match=reason) as caught:
        build_catalog([plugin])
    assert str(caught.value).startswith(f"plugin {plugin.name!r}: ")


def test_all_that_is_wrong_with_a_plugin_is_told_at_once() -> None:
    """A mistake a run would be a run for every mistake."""
    plugin = replace(PLAIN, name="Hand", actions={"Flash": Action("F.")}, client="hand client")
    with pytest.raises(PluginError) as caught:
        build_catalog([plugin])
    assert str(caught.value).splitlines() == [
        "plugin 'Hand': its name must be lower case letters, digits and underscores",
        "plugin 'Hand': action 'Flash': the name must be lower case letters, digits and underscores",
        "plugin 'Hand': 'hand client' must have the form 'module:name'",
    ]


def test_two_plugins_cannot_claim_one_name() -> None:
    """Neither their own, nor that of a function, value, type or parameter."""
    with pytest.raises(PluginError, match="plugin 'hand': another plugin has the same name"):
        build_catalog([PLAIN, replace(PLAIN, doc="Another.")])
    value = {"skin.temperature": LiveValue("Warmth.", COUNT)}
    with pytest.raises(
        PluginError, match=r"plugin 'foot'.*'skin.temperature' is already declared by plugin 'hand'"
    ):
        build_catalog([replace(PLAIN, values=value), Plugin("foot", "A foot.", values=value)])


def test_a_code_means_the_same_everywhere() -> None:
    """The operator reads one label for it."""
    other = Plugin(
        "foot", "A foot.", operations={"kick": Operation("Kick.", codes=(Code("tired", "no more"),))}
    )
    with pytest.raises(PluginError, match="plugin 'foot': the code 'tired' is declared"):
        build_catalog([PLAIN, other])


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        ("no_such_module_at_all:PLUGIN", "cannot be imported: ModuleNotFoundError"),
        ("os:no_such_name", "cannot be imported: AttributeError"),
        ("os:sep", "names something of type str; it must name a Plugin"),
        ("leaves_at_once:PLUGIN", "cannot be imported: SystemExit: 3"),
    ],
)
def test_an_entry_point_that_fails_is_told_in_one_line(
    value: str, reason: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """No traceback: whoever installed the plugin can mend it. Nor may a plugin end the command."""
    (tmp_path / "leaves_at_once.py").write_text("raise SystemExit(3)")
    monkeypatch.syspath_prepend(tmp_path)
    point = EntryPoint("bad", value)
    monkeypatch.setattr(registry, "entry_points_by_group", lambda *groups: {groups[0]: [point]})
    with pytest.raises(PluginError, match=rf"plugin 'bad' \({value}\) {reason}"):
        load_catalog()
