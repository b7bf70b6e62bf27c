"""The ROS package's launch files start what `lupin up` starts. ROS 2's launcher is not here: none was run."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
import yaml

from lupin_engine.plugin.registry import load_catalog
from lupin_ros.launch.nodes import nodes_of
from tests.tools import load_tool

PACKAGE = Path(__file__).parents[2] / "ros_package"
launch_files = load_tool("launch_files")


@pytest.mark.parametrize("name", launch_files.files())
def test_a_file_is_made_from_what_is_declared(name: str) -> None:
    text = (PACKAGE / name).read_text(encoding="utf-8")
    assert text == launch_files.files()[name], "python tools/launch_files.py ros_package"


@pytest.mark.parametrize("kind", launch_files.KINDS)
def test_both_forms_start_the_same(kind: str) -> None:
    """The same nodes in the same order, with the same arguments, each of a name that `ros2 run` knows."""
    described = yaml.safe_load((PACKAGE / f"{kind}.launch.yaml").read_text(encoding="utf-8"))["launch"]
    nodes = [each["node"]["exec"] for each in described if "node" in each]
    arguments = [each["arg"]["name"] for each in described if "arg" in each]
    tree = ast.parse((PACKAGE / f"{kind}.launch.py").read_text(encoding="utf-8"))
    (listed,) = (
        ast.literal_eval(each.value)
        for each in tree.body
        if isinstance(each, ast.Assign) and ast.unparse(each.targets[0]) == "NODES"
    )
    calls = [each for each in ast.walk(tree) if isinstance(each, ast.Call)]
    declared = [ast.literal_eval(c.args[0]) for c in calls if ast.unparse(c.func) == "DeclareLaunchArgument"]
    assert (listed, declared) == (nodes, arguments)
    assert set(nodes) <= set((PACKAGE / "nodes.txt").read_text(encoding="utf-8").split())
    assert set(nodes) <= set(nodes_of(load_catalog()))
    assert nodes[-1] == "mission_orchestrator"
