"""What the perception aggregator costs at 30 frames a second of each camera: processor, and latency.

    .venv/bin/python benchmarks/aggregator.py [--seconds 20] [--rate 30]

The node runs as a process of its own on a private domain. Each frame of tags shows three, with transforms
from the map to each; each frame of flowers shows three, of a tag that is scanned for this frame only (the
mission says so half a frame before), so that each is news. On a machine that is too busy to keep up the state
of the mission is overtaken by the next, and fewer observations are told. Latency is from publishing a frame
of flowers to hearing the observation, over DDS both ways. The processor figure beside it is the same process
without any input.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("ROS_DOMAIN_ID", "95")
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

from geometry_msgs.msg import TransformStamped
from idle_cpu import cpu_seconds
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from lupin_msgs.msg import MissionState, Observation
from lupin_ros.adapter.node import Qos, RosNode

LUPIN = str(Path(sys.executable).with_name("lupin"))
#: Targets change so fast here that a frame comes sooner than a detector's delay after its target.
NODE = [LUPIN, "node", "perception_aggregator", "--ros-args", "-p", "detection_delay_s:=0.0"]
TAGS = (5, 6, 7)


class World:
    """Cameras, mission and audience."""

    def __init__(self) -> None:
        self.ros = ros = RosNode("world")
        self.tags = ros.publisher(String, "/camera/tag_detections_json", Qos.DETECTION)
        self.flowers = ros.publisher(String, "/yolo/detections", Qos.DETECTION)
        self.transforms = ros.publisher(TFMessage, "/tf", Qos.TRANSFORMS)
        self.states = ros.publisher(MissionState, "/mission/state", Qos.LATCHED)
        self.sent, self.latencies, self.beats = 0.0, list[float](), 0
        ros.subscribe(Observation, "/floranova/observations", Qos.BACKLOG, self._heard)

    def _heard(self, _: Observation) -> None:
        self.latencies.append(time.perf_counter() - self.sent)

    def ready(self) -> bool:
        """Say whether the aggregator hears all."""
        outlets = (self.tags, self.flowers, self.transforms, self.states)
        return all(outlet.get_subscription_count() for outlet in outlets)

    def beat(self) -> None:
        """Half a frame: every second one scans another tag, the others show it to the cameras."""
        self.beats += 1
        if self.beats % 2:
            state = MissionState(mission_id="m1", lifecycle_state="MONITORING", mission_phase="SCANNING")
            state.current_target = str(TAGS[self.beats // 2 % 2])
            self.states.publish(state)
        else:
            self._show()

    def _show(self) -> None:
        self.transforms.publish(TFMessage(transforms=self._chain()))
        self.tags.publish(String(data=json.dumps([{"id": tag, "corners": [], "dist": 1.0} for tag in TAGS])))
        flower = {"class": 0, "confidence": 0.9, "bbox_xyxy": [100, 100, 150, 150], "track_id": 1}
        self.sent = time.perf_counter()
        self.flowers.publish(String(data=json.dumps([flower] * 3)))

    def _chain(self) -> list[TransformStamped]:
        pairs = [("map", "odom"), ("odom", "base_link"), ("base_link", "camera")]
        chain = [
            TransformStamped(child_frame_id=child)
            for child in [child for _, child in pairs] + [f"tag_{tag}" for tag in TAGS]
        ]
        for message, parent in zip(chain, [p for p, _ in pairs] + ["camera"] * len(TAGS), strict=True):
            message.header.frame_id, message.header.stamp = parent, self.ros.stamp()
            message.transform.rotation.y = message.transform.rotation.w = 0.5**0.5
        return chain

    def spin(self, seconds: float) -> None:
        """Listen for a while."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self.ros.spin_once(left)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--rate", type=float, default=30.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as state:  # what the node keeps of the mission
        measure(options.seconds, options.rate, state)


def measure(seconds: float, rate: float, state: str) -> None:
    """Run the node for so many seconds without input, then with frames, and print what that cost."""
    environment = {**os.environ, "XDG_STATE_HOME": state}
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    world, process = World(), subprocess.Popen(NODE, env=environment, **silent)
    try:
        while not world.ready():
            world.ros.spin_once(0.1)
        world.spin(2.0)
        before = cpu_seconds(process.pid)
        world.spin(seconds)
        idle = (cpu_seconds(process.pid) - before) / seconds
        timer = world.ros.steady_timer(0.5 / rate, world.beat)
        world.spin(1.0)  # until the tags are discovered
        world.latencies.clear()
        before, beats, begin = cpu_seconds(process.pid), world.beats, time.monotonic()
        world.spin(seconds)
        timer.cancel()
        busy = (cpu_seconds(process.pid) - before) / (time.monotonic() - begin)
        world.spin(0.5)
    finally:
        process.terminate()
        process.wait(10.0)
        world.ros.close()
    told, shown = len(world.latencies), (world.beats - beats) // 2
    if told < 2:
        raise SystemExit(f"{shown} frames, {told} observations: nothing to measure")
    cuts = statistics.quantiles(world.latencies, n=100)
    print(f"{shown} frames, {told} observations; processor {busy:.1%} of a core, {idle:.1%} without input")
    print(f"latency of an observation: median {cuts[49] * 1e3:.2f} ms, p99 {cuts[98] * 1e3:.2f} ms")


if __name__ == "__main__":
    main()
