"""A server with another definition of a type, as Nav2 of Lyrical has of NavigateToPose: told by name."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from nav2_msgs.action import NavigateToPose

from lupin_ros.adapter.actions import GoalCallbacks
from lupin_ros.adapter.environment import distribution
from lupin_ros.adapter.node import RosNode, peer_mismatches
from lupin_ros.interfaces.type_hashes import local_hash
from tests.lupin_ros.helpers import spin_for, spin_until
from tests.tools import load_tool

pytestmark = [pytest.mark.ros, pytest.mark.long, pytest.mark.timeout(900)]

ROOT = Path(__file__).parents[4]
MORE = "\nfloat32 position_tracking_error\nfloat32 heading_tracking_error\n"
SERVER = """
import rclpy
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionServer

def drive(goal):
    goal.publish_feedback(NavigateToPose.Feedback(distance_remaining=2.5, heading_tracking_error=1.0))
    goal.succeed()
    return NavigateToPose.Result(error_msg="there")

rclpy.init()
node = rclpy.create_node("bt_navigator")
server = ActionServer(node, NavigateToPose, "navigate_to_pose", drive)
rclpy.spin(node)
"""


@pytest.fixture
def other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ros_domain: int) -> Iterator[None]:
    """A server in plain rclpy, whose package was compiled with two more fields in the feedback."""
    sources, prefix = tmp_path / "interfaces", tmp_path / "prefix"
    shutil.copytree(ROOT / "interfaces" / "nav2_msgs", sources / "nav2_msgs")
    shutil.copy(ROOT / "interfaces" / "pip_wheels.cmake", sources)
    with (sources / "nav2_msgs" / "action" / "NavigateToPose.action").open("a", encoding="utf-8") as file:
        file.write(MORE)
    bootstrap = load_tool("bootstrap")
    monkeypatch.setattr(bootstrap, "DISTRIBUTION", distribution())
    monkeypatch.setattr(bootstrap, "INTERFACES_LOG", tmp_path / "build.log")
    monkeypatch.setenv("CMAKE_PREFIX_PATH", sys.prefix)
    bootstrap.build_wheels(
        sys.executable, "wheels", ["interfaces/nav2_msgs"], tmp_path / "built", [str(sources)]
    )
    (wheel,) = (tmp_path / "built").glob("*.whl")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--ignore-installed"]
    subprocess.run([*pip, f"--prefix={prefix}", str(wheel)], check=True)
    (packages,) = prefix.glob("lib/python*/site-packages")
    first = {"PYTHONPATH": packages, "LD_LIBRARY_PATH": prefix / "lib", "AMENT_PREFIX_PATH": prefix}
    found = {name: f"{path}{os.pathsep}{os.environ.get(name, '')}" for name, path in first.items()}
    server = subprocess.Popen([sys.executable, "-c", SERVER], env={**os.environ, **found})
    yield
    server.kill()
    server.wait()


@pytest.mark.usefixtures("other")
def test_it_is_told_by_name(capfd: pytest.CaptureFixture[str]) -> None:
    """Only the feedback differs: on Jazzy its beginning is read, on Kilted the two do not match."""
    heard: list[object] = []
    with RosNode("mission_orchestrator") as ros:
        caller = ros.action(NavigateToPose, "navigate_to_pose")
        spin_until([ros], lambda: peer_mismatches(ros), what="the server")
        (told,) = peer_mismatches(ros)
        if distribution() == "jazzy":
            spin_until([ros], caller.ready, what="the server")
            caller.send(
                NavigateToPose.Goal(),
                GoalCallbacks(
                    feedback=lambda message: heard.append(message.distance_remaining),
                    ended=lambda status, result: heard.append((status, result.error_msg)),
                ),
            )
            spin_until([ros], lambda: len(heard) == 2, what="feedback and result")
        else:
            spin_for([ros], 3.0)
            assert not caller.ready()
        spin_until([ros], lambda: told in capfd.readouterr().err, what="a line of the log")
    kind = "nav2_msgs/action/NavigateToPose_FeedbackMessage"
    start = f"/navigate_to_pose/_action/feedback: node /bt_navigator uses another definition: here {kind} "
    assert told.startswith(f"{start}{local_hash(kind)}, there {kind} RIHS01_")
    assert told.endswith(
        "; build both sides from the same interface packages, and the same distribution of ROS 2"
    )
    assert heard == ([2.5, (4, "there")] if distribution() == "jazzy" else [])
