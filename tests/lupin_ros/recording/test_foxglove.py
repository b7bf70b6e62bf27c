"""A recording in the hands of Foxglove and Lichtblick: their own packages read every message of it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as Plan
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from lupin_msgs.msg import Observation, SensorReading, TagReading
from lupin_ros.adapter.node import Qos, RosNode
from lupin_ros.recording.recorder import TopicRecorder
from tests.lupin_ros.helpers import spin_until
from tests.npm import installed, run_node

PACKAGES = (
    "@mcap/core@2.2.2",
    "@mcap/support@1.1.0",
    "@foxglove/rosmsg@5.0.5",
    "@foxglove/rosmsg2-serialization@3.1.0",
    "@lichtblick/rosmsg@1.0.0",
    "@lichtblick/rosmsg2-serialization@1.0.0",
    "@lichtblick/cdr@1.0.1",
)


@pytest.mark.node
@pytest.mark.timeout(400)
def test_both_read_what_was_recorded(make_node: Callable[..., RosNode], tmp_path: Path) -> None:
    """What their panels show of a robot: the map, frames, the plan, and messages with lists of messages."""
    folder = installed(*PACKAGES)
    node = make_node("robot")
    frames = TFMessage(transforms=[TransformStamped(child_frame_id="base_link")])
    frames.transforms[0].header.frame_id = "map"
    reading = SensorReading(name="temperature", value=math.nan)
    told = {
        "/map": OccupancyGrid(data=[0, 100, -1]),
        "/tf": frames,
        "/plan": Plan(),
        "/floranova/observations": Observation(tag_reading=TagReading(tag_id="5", readings=[reading])),
        "/mission_orchestrator/steps": String(data='{"step": 1}'),
    }
    for topic, message in told.items():
        node.publisher(type(message), topic, Qos.LATCHED).publish(message)
    with TopicRecorder(tmp_path / "robot.mcap") as recorder:
        spin_until([node], lambda: recorder.topics >= len(told) and recorder.messages >= len(told))
    found = json.loads(run_node(Path(__file__).with_name("foxglove.cjs"), folder, recorder.path))
    assert found["profile"] == "ros2"
    assert sum(found["counts"].values()) == recorder.messages
    assert found["counts"].items() >= dict.fromkeys(told, 1).items()
    assert found["last"]["/map"]["data"] == [0, 100, -1]
    assert found["last"]["/tf"]["transforms"][0]["header"]["frame_id"] == "map"
    assert found["last"]["/floranova/observations"]["tag_reading"]["readings"] == [
        {"name": "temperature", "value": None}
    ]
    assert json.loads(found["last"]["/mission_orchestrator/steps"]["data"]) == {"step": 1}
