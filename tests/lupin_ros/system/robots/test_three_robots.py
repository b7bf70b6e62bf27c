"""Three robots in one domain: what each is told, loses and is flooded with is its own."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import urllib.request
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import pytest
from rclpy.serialization import deserialize_message
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage

from lupin_engine.plugin import COMMON_NAMES
from lupin_ros.adapter.network import interfaces, other_participants
from lupin_ros.adapter.node import Qos
from tests.lupin_ros.system.robots.three import LUPIN, NAMES, Robot, flood, spin, stopped_in
from tests.plugins.gateway.served import OpenPage

pytestmark = [pytest.mark.timeout(300), pytest.mark.core]

#: Seconds that a stop may take while another robot is flooded, and how many are measured of each robot.
STOP_S, STOPS = 0.1, 10


def test_no_name_is_shared_but_the_common_ones(
    robots: list[Robot], record_property: Callable[[str, object], None]
) -> None:
    """Read off the graph, with the parts of actions, and of whoever is at an end."""
    node = robots[0].operator.ros.node
    assert spin(robots, lambda: other_participants(node) >= 11, 20.0), "not all are found"
    spin(robots, lambda: False, 2.0)
    shared, outside = set(), set()
    for one in interfaces(node, parts=True):
        owners = {end.split("/")[1] for end in (*one.producers, *one.consumers) if end != "?"}
        if len(owners & set(NAMES)) > 1:
            shared.add(one.name)
        if one.name.split("/")[1] not in NAMES:
            outside.add(one.name)
    assert shared <= set(COMMON_NAMES)
    assert outside <= set(COMMON_NAMES)
    record_property("participants", other_participants(node) + 1)
    record_property("names", len(interfaces(node, parts=True)))


def test_frames_have_their_prefix_on_the_network_only(robots: list[Robot]) -> None:
    """Its nodes write and read `map`, or the robot would not be localized."""
    frames = set[str]()

    def take(data: bytes, _: object) -> None:
        message = deserialize_message(data, TFMessage)
        frames.update(
            name for one in message.transforms for name in (one.header.frame_id, one.child_frame_id)
        )

    robots[2].operator.ros.subscribe_raw(TFMessage, "/tf", Qos.TRANSFORMS.profile(), take)
    assert spin(robots, lambda: {"robot3/map", "robot3/base_link"} <= frames, 20.0), frames
    assert {frame.partition("/")[0] for frame in frames} == {"robot3"}


def test_of_a_robot_there_is_one_orchestrator(robots: list[Robot]) -> None:
    second = subprocess.run(
        [LUPIN, "node", "mission_orchestrator", "--ros-args", "-r", "__ns:=/robot2"],
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert second.returncode == 1
    assert second.stderr.splitlines()[-1] == (
        "lupin: mission_orchestrator stands down: /robot2/mission_orchestrator (READY) is the orchestrator "
        "of robot /robot2 in this ROS domain already; stop that one, or start this one with another "
        "ROS_DOMAIN_ID"
    )


def test_a_stop_a_flood_and_a_kill_are_of_one_robot(
    robots: list[Robot], record_property: Callable[[str, object], None]
) -> None:
    first, *others = robots
    for robot in robots:
        assert robot.operator.start("29").accepted
    for robot in robots:
        robot.operator.in_state("INSPECTING", "NAVIGATING")
    before = [robot.seen() for robot in others]

    first.stop.publish(Bool(data=True))
    assert spin(robots, lambda: first.operator.state.estop_engaged, 10.0)
    first.stop.publish(Bool(data=False))
    assert [robot.seen() for robot in others] == before, "the stop of one"

    with flood("robot1"):
        assert spin(robots, lambda: len(first.stops) > 1000 and first.starts() > 1, 30.0), "a flood"
        took = [stopped_in(robot, robots) for _ in range(STOPS) for robot in others]
    record_property("stops_ms", [round(1000 * seconds) for seconds in took])
    assert median(took) <= STOP_S
    assert [robot.starts() for robot in others] == [1, 1]
    for robot in others:
        robot.operator.resume()
    assert spin(robots, lambda: not any(robot.operator.state.paused for robot in others), 10.0)

    before = [robot.seen() for robot in others]
    killed = first.world.processes["mission_orchestrator"]
    killed.send_signal(signal.SIGKILL)
    killed.wait(10.0)
    spin(robots, lambda: False, 4.0)
    assert [robot.seen() for robot in others] == before, "the death of one"
    for robot in others:
        assert robot.operator.state.lifecycle_state == "INSPECTING"
        told = {one.mission_id for one in robot.operator.observations}
        assert told <= {"", robot.operator.state.mission_id}


def test_one_gateway_shows_and_stops_each(robots: list[Robot], tmp_path: Path) -> None:
    """The first one's orchestrator is dead by now."""
    _, second, third = robots
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    given = ["-p", f"port:={port}", "-p", "robots:=['robot1', 'robot2', 'robot3']"]
    second.world.run("lupin_gateway", [LUPIN, "node", "lupin_gateway", "--ros-args", *given])

    def listed() -> dict[str, dict[str, Any]]:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/robots", timeout=5.0) as answer:
                return {one["robot"]: one for one in json.load(answer)}
        except OSError:
            return {}

    assert spin(robots, lambda: listed().get("robot3", {}).get("heard"), 30.0)
    assert [(name, one["heard"]) for name, one in listed().items()] == [
        *(("robot1", False), ("robot2", True), ("robot3", True))
    ]
    page = OpenPage(port, base="/robots/robot2")
    page.stop(True)
    assert spin(robots, lambda: second.operator.state.estop_engaged, 10.0)
    assert listed()["robot2"]["stops"]
    assert listed()["robot3"]["stops"] == []
    assert not third.operator.state.estop_engaged
    asked = OpenPage(port, base="/robots/robot3").call("/rosapi/nodes")["values"]["nodes"]
    assert "/robot3/mission_orchestrator" in asked
    assert all(name.startswith("/robot3/") for name in asked)


def test_a_verb_commands_its_robot(robots: list[Robot]) -> None:
    _, second, third = robots
    said = subprocess.run([LUPIN, "--robot", "robot3", "pause"], capture_output=True, text=True, timeout=60.0)
    assert (said.returncode, said.stderr) == (0, ""), said
    assert spin(robots, lambda: third.operator.state.paused, 10.0)
    state = subprocess.run([LUPIN, "state", "--json", "--robot", "robot3"], capture_output=True, timeout=60.0)
    assert json.loads(state.stdout)["mission_id"] == third.operator.state.mission_id
    assert second.operator.state.mission_id != third.operator.state.mission_id
