"""A valve with a flow meter, as a node: `python valve.py --ros-args -p ledger:=/var/lib/valve.json`.

It never gives a tag water twice a day, whoever asks and whatever dies meanwhile: a dose is in the ledger
before the valve opens, with all that it may become, and corrected when the valve is shut. No water flows for
an orchestrator that is gone: it tells its state five times a second; when it falls silent the valve shuts.
"""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Any

import rclpy
from control_msgs.action import GripperCommand
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState

from lupin_msgs.msg import MissionState
from lupin_msgs.srv import SetArmPreset


class Valve(Node):
    """One dose for each choice of a tag, and one choice of each tag a day."""

    def __init__(self) -> None:
        super().__init__("valve")
        self.flow = self.declare_parameter("flow", 2.0).value / 60.0  # l/min, kept in l/s
        self.file = Path(self.declare_parameter("ledger", "valve.json").value)
        self.timeout = self.declare_parameter("orchestrator_timeout_s", 2.0).value
        self.chosen = ""
        self.open_for = ""
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.meter = self.create_publisher(JointState, "/valve/meter", latched)
        group = ReentrantCallbackGroup()
        self.heard = time.monotonic()
        self.create_subscription(MissionState, "/mission/state", self.hear, 10, callback_group=group)
        self.create_service(SetArmPreset, "/valve/choose", self.choose, callback_group=group)
        self.server = ActionServer(
            self,
            GripperCommand,
            "/valve/give",
            self.give,
            goal_callback=self.admit,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=group,
        )
        self.publish(self.today())

    def today(self) -> dict[str, float]:
        """Return the litres of each tag that had water today."""
        ledger = json.loads(self.file.read_text()) if self.file.exists() else {}
        return ledger.get(time.strftime("%Y-%m-%d"), {})

    def enter(self, tag: str, litres: float) -> None:
        """Write down what a tag has had: safe on the disk before anything else happens."""
        given = {**self.today(), tag: litres}
        aside = self.file.with_suffix(".new")
        with aside.open("w") as written:
            json.dump({time.strftime("%Y-%m-%d"): given}, written)
            written.flush()
            os.fsync(written.fileno())
        aside.replace(self.file)
        self.publish(given)

    def publish(self, given: dict[str, float]) -> None:
        """Tell what was given, also to whoever comes later."""
        message = JointState(name=list(given), position=list(given.values()))
        message.header.stamp = self.get_clock().now().to_msg()
        self.meter.publish(message)

    def choose(self, request: Any, response: Any) -> Any:
        """Note for which tag the next dose is."""
        litres = self.today().get(request.name)
        response.success = litres is None
        response.message = "" if litres is None else f"had {litres:.2f} l today"
        self.chosen = request.name if response.success else ""
        return response

    def admit(self, goal: Any) -> GoalResponse:
        """Take one dose for each choice, which is written down here."""
        tag, self.chosen = self.chosen, ""
        if not tag or self.open_for or goal.command.position <= 0.0:
            return GoalResponse.REJECT
        self.enter(tag, goal.command.position)
        self.open_for = tag
        return GoalResponse.ACCEPT

    def hear(self, _: MissionState) -> None:
        """Note that the orchestrator is there."""
        self.heard = time.monotonic()

    def is_watched(self, begun: float) -> bool:
        """Say whether somebody was heard lately who would shut the valve."""
        return time.monotonic() - max(self.heard, begun) < self.timeout

    def give(self, goal: Any) -> Any:
        """Let water flow until the meter says enough, the dose is cancelled, or nobody watches any more."""
        tag, wanted, flowed = self.open_for, goal.request.command.position, 0.0
        begun = time.monotonic()
        self.get_logger().info(f"open for tag {tag}")
        while flowed < wanted and not goal.is_cancel_requested and self.is_watched(begun):
            time.sleep(0.02)
            flowed = min(wanted, (time.monotonic() - begun) * self.flow)
            goal.publish_feedback(GripperCommand.Feedback(position=flowed))
        self.enter(tag, flowed)
        self.open_for = ""
        self.get_logger().info(f"shut after {flowed:.3f} l for tag {tag}")
        end = goal.succeed if flowed >= wanted else goal.canceled if goal.is_cancel_requested else goal.abort
        end()
        return GripperCommand.Result(position=flowed, reached_goal=flowed >= wanted)


def main() -> None:
    """Serve until the process is ended."""
    rclpy.init()
    node = Valve()
    executor = MultiThreadedExecutor(4)
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        return


if __name__ == "__main__":
    main()
