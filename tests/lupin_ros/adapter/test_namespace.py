"""The names of a node in a namespace, on the network as others see them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from nav2_msgs.action import NavigateToPose
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from lupin_engine.errors import UsageError
from lupin_engine.plugin import TEXT, CommonName, Parameter
from lupin_ros.adapter.network import interfaces
from lupin_ros.adapter.node import Qos, RosNode
from lupin_ros.launch.description import parameter_file

MakeNode = Callable[..., RosNode]
IN_ROBOT2 = ("--ros-args", "-r", "__ns:=/robot2")


def names(node: RosNode) -> set[str]:
    """Return what the node itself is at an end of, without what every node has."""
    return {one.name for one in interfaces(node.node) if not one.is_housekeeping}


def test_every_name_follows_it(make_node: MakeNode) -> None:
    """With and without a slash in front; a private name as ROS has it."""
    node = make_node("arm", IN_ROBOT2)
    node.publisher(Bool, "/joint_states", Qos.EVENT)
    node.subscribe(Bool, "e_stop_state", Qos.EVENT, lambda _: None)
    node.serve(Trigger, "~/go", lambda _, answer: answer)
    node.service(Trigger, "/mission/start")
    node.action(NavigateToPose, "/navigate_to_pose")
    own = {"joint_states", "e_stop_state", "arm/go", "mission/start", "navigate_to_pose"}
    assert names(node) == {f"/robot2/{name}" for name in own}
    assert node.namespace == "/robot2"


def test_what_is_common_and_what_is_remapped_does_not(make_node: MakeNode) -> None:
    """A name that was resolved is final: it can be used again."""
    node = make_node("lamp", (*IN_ROBOT2, "-r", "e_stop_state:=/site/e_stop"))
    for name in ("/clock", CommonName("/site/rain"), "/e_stop_state", node.topic_name("/map")):
        node.subscribe(Bool, name, Qos.EVENT, lambda _: None)
    assert names(node) == {"/clock", "/site/rain", "/site/e_stop", "/robot2/map"}


def test_the_variable_names_it_where_no_argument_does(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LUPIN_ROBOT", "fleet/robot1")
    assert make_node("one").namespace == "/fleet/robot1"
    assert make_node("other", IN_ROBOT2).namespace == "/robot2"


def test_without_one_every_name_is_as_it_is_written(make_node: MakeNode) -> None:
    node = make_node("arm")
    for name in ("/joint_states", "e_stop_state"):
        node.subscribe(Bool, name, Qos.EVENT, lambda _: None)
    assert names(node) == {"/joint_states", "/e_stop_state"}
    assert node.namespace == ""


def test_a_file_of_parameters_is_of_the_robots_node(make_node: MakeNode, tmp_path: Path) -> None:
    """Another robot's node of that name does not read it."""
    file = tmp_path / "arm.yaml"
    file.write_text(parameter_file("/robot2/arm", {"word": "hello"}), encoding="utf-8")
    given = ("--params-file", str(file))
    known = {"word": Parameter(TEXT, "none", "a word")}
    assert make_node("arm", (*IN_ROBOT2, *given), known).parameters() == {"word": "hello"}
    other = ("--ros-args", "-r", "__ns:=/robot3", *given)
    assert make_node("arm", other, known).parameters() == {"word": "none"}


def test_what_is_no_namespace_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match=r"^ROS does not start with the arguments .*robot-2.*: "):
        RosNode("arm", ("--ros-args", "-r", "__ns:=/robot-2"))
    monkeypatch.setenv("LUPIN_ROBOT", "robot-2")
    with pytest.raises(UsageError, match=r"^LUPIN_ROBOT 'robot-2' is no ROS namespace: "):
        RosNode("arm")
