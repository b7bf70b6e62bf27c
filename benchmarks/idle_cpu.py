"""How much processor an idle orchestrator takes, beside a bare rclpy node with the same endpoints.

    .venv/bin/python benchmarks/idle_cpu.py [--seconds 20] [--rounds 3]

Both run as processes of their own on a private domain, in turn, with the simulated robot and the bridge
beside them, so that the same messages arrive. The bare node has the publishers, subscriptions, services,
clients and the 5 Hz timer of the orchestrator, and does with a message nothing at all; it uses rclpy as it
is, with its own SingleThreadedExecutor. Figures are user and system time from /proc, per cent of one core.
"""

from __future__ import annotations

import argparse
import os
import signal
import statistics
import subprocess
import sys
import time
from pathlib import Path

LUPIN = str(Path(sys.executable).with_name("lupin"))
DOMAIN = "94"

BARE = """
import signal
import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from lupin_msgs.msg import MissionState, Observation
from lupin_msgs.srv import ConfirmTag, GetTagReading, SetArmPreset, StartMission
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

rclpy.init()
node = rclpy.create_node("bare")
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
backlog = QoSProfile(depth=50, durability=DurabilityPolicy.TRANSIENT_LOCAL)
state = node.create_publisher(MissionState, "/bare/state", latched)
node.create_publisher(Observation, "/bare/observations", backlog)
node.create_publisher(String, "/bare/steps", backlog)
node.create_subscription(PoseWithCovarianceStamped, "/amcl_pose", lambda message: None, latched)
node.create_subscription(BatteryState, "/io/power/power_watcher", lambda message: None, 10)
node.create_subscription(Bool, "/e_stop_state", lambda message: None, 10)
node.create_service(StartMission, "/bare/start", lambda request, response: response)
for name in ("abort", "dock", "pause", "reset", "resume", "skip_current"):
    node.create_service(Trigger, f"/bare/{name}", lambda request, response: response)
node.create_client(GetTagReading, "/greenhouse_bridge/get_tag_reading")
node.create_client(ConfirmTag, "/perception/confirm_tag")
node.create_client(SetArmPreset, "/lupin/arm/preset")
client = ActionClient(node, NavigateToPose, "navigate_to_pose")
message = MissionState()
node.create_timer(0.2, lambda: state.publish(message))
executor = SingleThreadedExecutor()
executor.add_node(node)
try:
    executor.spin()
except (KeyboardInterrupt, ExternalShutdownException):
    pass
"""


def cpu_seconds(pid: int) -> float:
    """Return user and system time of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def start(command: list[str]) -> subprocess.Popen[bytes]:
    """Start a process on the private domain, its output thrown away."""
    environment = {**os.environ, "ROS_DOMAIN_ID": DOMAIN, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    return subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


def stop(process: subprocess.Popen[bytes]) -> None:
    """End a process as Ctrl-C would."""
    process.send_signal(signal.SIGINT)
    try:
        process.wait(10.0)
    except subprocess.TimeoutExpired:
        process.kill()


def measure(command: list[str], seconds: float) -> float:
    """Return the share of one core that a process takes once it has settled, in per cent."""
    process = start(command)
    try:
        time.sleep(6.0)  # start, discovery, BOOT: not idle yet
        before, begun = cpu_seconds(process.pid), time.monotonic()
        time.sleep(seconds)
        return 100.0 * (cpu_seconds(process.pid) - before) / (time.monotonic() - begun)
    finally:
        stop(process)


def main() -> None:
    """Measure both in turn and print medians and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    world = [start([LUPIN, "node", "greenhouse_bridge"]), start([LUPIN, "node", "lupin_sim"])]
    ours, bare = [], []
    try:
        for number in range(arguments.rounds):
            ours.append(measure([LUPIN, "node", "mission_orchestrator"], arguments.seconds))
            bare.append(measure([sys.executable, "-c", BARE], arguments.seconds))
            print(
                f"round {number + 1}: orchestrator {ours[-1]:.2f} %, bare node {bare[-1]:.2f} %", flush=True
            )
    finally:
        for process in world:
            stop(process)
    first, second = statistics.median(ours), statistics.median(bare)
    ratio = first / second
    print(f"median: orchestrator {first:.2f} %, bare node {second:.2f} % of one core; ratio {ratio:.2f}")


if __name__ == "__main__":
    main()
