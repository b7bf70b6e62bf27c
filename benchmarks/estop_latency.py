"""How long after an e-stop the base is told to stop, beside a bare rclpy node that does nothing else.

    .venv/bin/python benchmarks/estop_latency.py [--trials 500] [--tags 0]

This process publishes the Bool and is the action server; it takes the time from `publish(True)` to the
server's cancel callback. In turn, on the same domain and in the same minute, it stops:

* the orchestrator, driving to a tag, as a process of its own: e-stop, cancel, release, resume, the next goal;
* a bare rclpy node, as a process of its own, whose callback of the Bool cancels the goal that it has sent.

Both get their e-stop at a random moment after the goal was taken, so that no timer of theirs is favoured.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionServer, CancelResponse
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from lupin_msgs.msg import MissionState
from lupin_msgs.srv import GetTagReading, StartMission

LUPIN = str(Path(sys.executable).with_name("lupin"))
DOMAIN = "93"
#: Seconds that anything may take before the benchmark gives up.
PATIENCE = 30.0
#: Between these many seconds after the goal was taken the e-stop is engaged.
EARLIEST, LATEST = 0.03, 0.06

BARE = """
import rclpy
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from std_msgs.msg import Bool

rclpy.init()
node = rclpy.create_node("bare")
client = ActionClient(node, NavigateToPose, "/bare/navigate_to_pose")
handle = None

def taken(future):
    global handle
    handle = future.result()

def on_estop(message):
    if message.data:
        handle.cancel_goal_async()
    else:
        client.send_goal_async(NavigateToPose.Goal()).add_done_callback(taken)

node.create_subscription(Bool, "/bare/e_stop_state", on_estop, 10)
executor = SingleThreadedExecutor()
executor.add_node(node)
try:
    executor.spin()
except (KeyboardInterrupt, ExternalShutdownException):
    pass
"""


BESIDE = """
import sys
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.qos import DurabilityPolicy, QoSProfile
from lupin_msgs.msg import DiscoveredTag, DiscoveredTags

rclpy.init()
node = rclpy.create_node("beside")
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
publisher = node.create_publisher(DiscoveredTags, "/perception/discovered_tags", latched)
message = DiscoveredTags()
message.header.frame_id = "map"
for number in range(int(sys.argv[1])):
    tag = DiscoveredTag(tag_id=str(number), species="tulip", sightings=5)
    tag.pose_in_map.position.x, tag.pose_in_map.orientation.w = float(number), 1.0
    message.tags.append(tag)

def tell():
    message.header.stamp = node.get_clock().now().to_msg()
    for tag in message.tags:
        tag.pose_in_map.position.y += 0.001
    publisher.publish(message)

node.create_timer(1.0, tell)
try:
    rclpy.spin(node)
except (KeyboardInterrupt, ExternalShutdownException):
    pass
"""


class Base:
    """An action server whose robot never arrives, and the e-stop beside it."""

    def __init__(self, node: Any, executor: Any, namespace: str) -> None:
        self._executor = executor
        self.running: Future | None = None
        self.cancelled: float | None = None
        self.estop = node.create_publisher(Bool, f"{namespace}/e_stop_state", 10)
        name = f"{namespace}/navigate_to_pose"
        self._server = ActionServer(
            node, NavigateToPose, name, self._drive, cancel_callback=self._cancel, result_timeout=10
        )

    async def _drive(self, handle: Any) -> Any:
        self.running = Future(executor=self._executor)
        await self.running
        self.running = None
        handle.canceled()
        return NavigateToPose.Result()

    def _cancel(self, _: Any) -> Any:
        self.cancelled = time.perf_counter()
        return CancelResponse.ACCEPT


class Bench:
    """This process: one node with everything that both need."""

    def __init__(self) -> None:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node("estop_latency")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.ours = Base(self.node, self.executor, "")
        self.bare = Base(self.node, self.executor, "/bare")
        self.state = MissionState()
        self.node.create_subscription(MissionState, "/mission/state", self._on_state, 10)
        self.node.create_service(
            GetTagReading, "/greenhouse_bridge/get_tag_reading", lambda _, answer: answer
        )
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._pose = self.node.create_publisher(PoseWithCovarianceStamped, "/amcl_pose", latched)
        pose = PoseWithCovarianceStamped()
        pose.header.frame_id, pose.pose.pose.orientation.w = "map", 1.0
        self._pose.publish(pose)
        self._start = self.node.create_client(StartMission, "/mission/start")
        self._resume = self.node.create_client(Trigger, "/mission/resume")

    def _on_state(self, state: MissionState) -> None:
        self.state = state

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Work until a condition holds."""
        end = time.monotonic() + PATIENCE
        while not condition():
            if time.monotonic() > end:
                sys.exit(f"{what}: not within {PATIENCE:g} s")
            self.executor.spin_once(0.1)

    def call(self, client: Any, request: Any) -> Any:
        """Return the answer of a service."""
        self.until(client.service_is_ready, client.srv_name)
        answer = client.call_async(request)
        self.until(answer.done, client.srv_name)
        return answer.result()

    def begin(self) -> None:
        """Let both drive."""
        for base in (self.ours, self.bare):
            self.until(base.estop.get_subscription_count, "a node that hears the e-stop")
        self.until(lambda: self.state.lifecycle_state == "READY", "READY")
        answer = self.call(
            self._start, StartMission.Request(mission_type="InspectionMission", tag_sequence=["1"])
        )
        if not answer.accepted:
            sys.exit(answer.error_message)
        self.bare.estop.publish(Bool(data=False))

    def trial(self, base: Base, arm_again: Callable[[], None]) -> float:
        """Return the milliseconds from the e-stop to the cancel; the next goal is on its way then."""
        self.until(lambda: base.running is not None, "a goal")
        moment = time.perf_counter() + random.uniform(EARLIEST, LATEST)
        self.until(lambda: time.perf_counter() >= moment, "the moment")
        base.cancelled = None
        begun = time.perf_counter()
        base.estop.publish(Bool(data=True))
        while base.cancelled is None:
            self.executor.spin_once(1.0)
            if time.perf_counter() - begun > PATIENCE:
                sys.exit("the goal was not cancelled")
        base.running.set_result(None)
        self.until(lambda: base.running is None, "the end of the goal")
        arm_again()
        return 1e3 * (base.cancelled - begun)

    def resume(self) -> None:
        """Release the e-stop and go on with the mission."""
        self.ours.estop.publish(Bool(data=False))
        self.until(lambda: self.state.paused and not self.state.estop_engaged, "released")
        answer = self.call(self._resume, Trigger.Request())
        if not answer.success:
            sys.exit(answer.message)

    def send_next(self) -> None:
        """Let the bare node send its next goal."""
        self.bare.estop.publish(Bool(data=False))


def percentile(times: Sequence[float], part: float) -> float:
    """Return the time within which that part of the trials was over."""
    return sorted(times)[min(len(times) - 1, int(part * len(times)))]


def row(name: str, times: Sequence[float]) -> str:
    """Return one line of the table."""
    figures = (statistics.median(times), percentile(times, 0.99), max(times))
    return f"{name:24}" + "".join(f"{figure:9.2f}" for figure in figures)


def main() -> None:
    """Measure both in turn and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--trials", type=int, default=500)
    parser.add_argument("--tags", type=int, default=0, help="discovered tags that are told each second")
    given = parser.parse_args()
    trials = given.trials
    os.environ.setdefault("ROS_DOMAIN_ID", DOMAIN)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    before = os.getloadavg()[0]
    commands = [[LUPIN, "node", "mission_orchestrator"], [sys.executable, "-c", BARE]]
    if given.tags:
        commands.append([sys.executable, "-c", BESIDE, str(given.tags)])
    bench = Bench()
    others = [subprocess.Popen(c, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for c in commands]
    ours, bare = [], []
    try:
        bench.begin()
        for _ in range(trials):
            ours.append(bench.trial(bench.ours, bench.resume))
            bare.append(bench.trial(bench.bare, bench.send_next))
    finally:
        for process in others:
            process.send_signal(signal.SIGINT)
        for process in others:
            process.wait(10.0)
    print(f"e-stop to cancel, ms; {trials} trials each; load {before:.1f} to {os.getloadavg()[0]:.1f}")
    print(f"{'':24}" + "".join(f"{title:>9}" for title in ("p50", "p99", "slowest")))
    print(row("mission_orchestrator", ours))
    print(row("bare rclpy node", bare))
    print(f"ratio of the medians: {statistics.median(ours) / statistics.median(bare):.2f}")


if __name__ == "__main__":
    main()
