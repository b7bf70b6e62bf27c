"""What pages cost the gateway, and how fast a stop is, beside any other server of the rosbridge protocol.

    .venv/bin/python benchmarks/gateway.py                               # the gateway alone
    .venv/bin/python benchmarks/gateway.py --beside "COMMAND"            # in turn with another server
    .venv/bin/python benchmarks/gateway.py --only "COMMAND"              # that other server alone

`COMMAND` starts the other server on the loopback port that stands in it as `{port}`. Each server runs as a
process of its own, on the same domain, one after the other:

* nobody: no page is open;
* pages: 20 pages with 12 topics each, nine at 20 Hz with at most 2 KB, three at 1 Hz (29 tags, a map of
  123 x 108 cells, a path of 200 poses). Latency is from the publication to the page, over DDS and socket;
* flood: the same pages, all twelve topics at 20 Hz;
* stop: one more page says stop and go in turn, while its own call of a service hangs that never answers;
  latency is from the page to the subscriber of `/lupin/gateway/stop`. Idle, and during the flood;
* field: one page asks for a field of 200 x 100 cells, one call after the other.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import os
import random
import re
import shlex
import signal
import socket
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import rclpy
import websockets
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped
from idle_cpu import cpu_seconds
from nav_msgs.msg import OccupancyGrid, Odometry
from nav_msgs.msg import Path as Plan
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import BatteryState, Imu, JointState, LaserScan
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from lupin_msgs.msg import MissionState, Observation, SensorReading, TwinState, TwinTagState
from lupin_msgs.srv import GetField

DOMAIN = "94"
PAGES = 20
FAST_HZ, SLOW_HZ = 20.0, 1.0
FIELDS = 50
ESTOP = "/lupin/hmi/estop"
#: The call that hangs is one that no plugin offers to pages.
OFFERED = """-p "engineer_names:=['/hang']\""""
OURS = f"{Path(sys.executable).with_name('lupin')} node lupin_gateway --ros-args -p port:={{port}} {OFFERED}"
PATIENCE = 30.0
_STAMP = re.compile(rb'"stamp": ?\{"sec": ?(\d+), ?"nanosec": ?(\d+)')
_TOPIC = re.compile(rb'"topic": ?"([^"]+)"')


def messages() -> dict[str, tuple[Any, float]]:
    """Return a message for each topic, with its rate; sizes as on the robot."""
    readings = [SensorReading(name=n, value=1.25, unit="1") for n in ("temperature", "humidity", "co2")]
    tags = [TwinTagState(tag_id=str(i), readings=readings, species="tulip") for i in range(29)]
    frames = [TransformStamped(child_frame_id=f"link_{i}") for i in range(3)]
    scan = LaserScan(ranges=[1.0 + i / 7 for i in range(90)])
    grid = OccupancyGrid(data=np.full(123 * 108, -1, dtype=np.int8))
    grid.info.width, grid.info.height = 123, 108
    joints = JointState(name=[f"joint_{i}" for i in range(12)], position=[i / 7 for i in range(12)])
    fast = {
        "/joint_states": joints,
        "/odom": Odometry(),
        "/imu": Imu(),
        "/scan": scan,
        "/tf": TFMessage(transforms=frames),
        "/mission/state": MissionState(lifecycle_state="INSPECTING", mission_phase="NAVIGATING"),
        "/floranova/observations": Observation(source="InspectionMission"),
        "/amcl_pose": PoseWithCovarianceStamped(),
        "/battery": BatteryState(voltage=24.0, percentage=0.7),
    }
    slow = {"/twin/state": TwinState(tags=tags), "/map": grid, "/plan": Plan(poses=[PoseStamped()] * 200)}
    return {n: (m, FAST_HZ) for n, m in fast.items()} | {n: (m, SLOW_HZ) for n, m in slow.items()}


class World:
    """The ROS side: publishes the topics, hears the stop, serves a field and a call that never ends."""

    def __init__(self) -> None:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node("gateway_bench")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.sent: dict[str, list[int]] = defaultdict(list)
        self.heard: list[tuple[float, bool]] = []
        self.hung = _role("hang")
        self.node.create_subscription(Bool, "/lupin/gateway/stop", self._hear, 10)
        self.node.create_service(GetField, "/twin/get_field", self._field)
        self._topics = {
            name: (self.node.create_publisher(type(message), name, 10), message, hz)
            for name, (message, hz) in messages().items()
        }
        self._timers: list[Any] = []
        cells = np.linspace(15.0, 25.0, 20_000, dtype=np.float32)
        cells[::7] = math.nan
        self._cells = cells

    def publish(self, flood: bool) -> None:
        """Publish from here on."""
        for name, (_, _, hz) in self._topics.items():
            period = 1.0 / (FAST_HZ if flood else hz)
            self._timers.append(self.node.create_timer(period, lambda name=name: self._tell(name)))

    def be_silent(self) -> None:
        """Publish nothing any more."""
        for timer in self._timers:
            self.node.destroy_timer(timer)
        self._timers.clear()

    def _tell(self, name: str) -> None:
        publisher, message, _ = self._topics[name]
        now = time.monotonic_ns()
        header = message.transforms[0].header if name == "/tf" else message.header
        header.stamp.sec, header.stamp.nanosec = divmod(now, 1_000_000_000)
        self.sent[name].append(now)
        publisher.publish(message)

    def _hear(self, message: Bool) -> None:
        if not self.heard or self.heard[-1][1] != message.data:
            self.heard.append((time.monotonic(), message.data))

    def _field(self, _: Any, answer: Any) -> Any:
        answer.ok, answer.width, answer.height, answer.values = True, 200, 100, self._cells
        return answer

    def until(self, done: Callable[[], Any], patience: float = PATIENCE) -> bool:
        """Work until something holds; say whether it did in time."""
        end = time.monotonic() + patience
        while not done():
            if time.monotonic() > end:
                return False
            self.executor.spin_once(0.02)
        return True

    def work(self, seconds: float) -> None:
        """Work for that long."""
        self.until(lambda: False, seconds)


# -- the pages, a process of their own --------------------------------------------------------------------


async def _page(url: str, seen: list[tuple[bytes, int, int]]) -> None:
    async with websockets.connect(url, max_size=None, compression=None) as socket_:
        for name, (message, _) in messages().items():
            kind = type(message).__module__.split(".")[0] + "/msg/" + type(message).__name__
            await socket_.send(json.dumps({"op": "subscribe", "topic": name, "type": kind}))
        async for text in socket_:
            data = text if isinstance(text, bytes) else text.encode()
            stamp, topic = _STAMP.search(data), _TOPIC.search(data)
            if stamp and topic:
                sent = int(stamp[1]) * 1_000_000_000 + int(stamp[2])
                seen.append((topic[1], sent, time.monotonic_ns()))


async def _pages(url: str) -> None:
    """Be twenty pages until the end of the input; then tell what they saw."""
    seen: list[list[tuple[bytes, int, int]]] = [[] for _ in range(PAGES)]
    tasks = [asyncio.create_task(_page(url, each)) for each in seen]
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
    lost = sum(task.done() for task in tasks)
    told = {"lost": lost, "seen": [[(t.decode(), s, at) for t, s, at in each] for each in seen]}
    print(json.dumps(told), flush=True)
    os._exit(0)


async def _operator(url: str, task: str, count: int) -> None:
    """Be one page that says stop and go, or asks for fields; prints the moments."""
    async with websockets.connect(url, max_size=None, compression=None) as page:
        if task == "field":
            for i in range(count):
                box = {
                    "sensor_type": "temperature",
                    "resolution": 0.1,
                    "bbox_max_x": 20.0,
                    "bbox_max_y": 10.0,
                }
                call = {"op": "call_service", "service": "/twin/get_field", "id": str(i), "args": box}
                await page.send(json.dumps({**call, "type": "lupin_msgs/srv/GetField"}))
                await asyncio.wait_for(page.recv(), PATIENCE)
            return
        await page.send(json.dumps({"op": "advertise", "topic": ESTOP, "type": "std_msgs/msg/Bool"}))
        await page.send(json.dumps({"op": "publish", "topic": ESTOP, "msg": {"data": False}}))
        await asyncio.sleep(1.0)
        hang = {"op": "call_service", "service": "/hang", "type": "std_srvs/srv/Trigger", "id": "hang"}
        await page.send(json.dumps(hang))
        for i in range(2 * count):
            await asyncio.sleep(random.uniform(0.05, 0.1))
            data = i % 2 == 0
            print(json.dumps([time.monotonic(), data]), flush=True)
            await page.send(json.dumps({"op": "publish", "topic": ESTOP, "msg": {"data": data}}))
        await asyncio.sleep(1.0)


def _hang() -> None:
    """Serve a call; the process is stopped before one comes."""
    rclpy.init()
    node = rclpy.create_node("gateway_bench_hung")
    node.create_service(Trigger, "/hang", lambda _, answer: answer)
    rclpy.spin(node)


# -- the servers ------------------------------------------------------------------------------------------


@contextmanager
def _server(command: str) -> Iterator[tuple[str, int]]:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    state = TemporaryDirectory()  # a stop that somebody left would be one of this server
    process = subprocess.Popen(
        shlex.split(command.format(port=port)),
        stdout=subprocess.DEVNULL,
        env={**os.environ, "XDG_STATE_HOME": state.name},
    )
    try:
        end = time.monotonic() + PATIENCE
        while socket.socket().connect_ex(("127.0.0.1", port)):
            if time.monotonic() > end or process.poll() is not None:
                sys.exit(f"{command}: does not listen")
            time.sleep(0.1)
        yield f"ws://127.0.0.1:{port}/", process.pid
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        state.cleanup()


def _role(*arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, __file__, "--role", *arguments]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def _part(times: Sequence[float], part: float) -> float:
    ordered = sorted(times)
    return ordered[min(len(ordered) - 1, int(part * len(ordered)))] if ordered else math.nan


def _measure_pages(
    world: World, url: str, pid: int, seconds: float, flood: bool, stops: int = 0
) -> dict[str, Any]:
    """Return what the pages got within some seconds; with `stops`, what these took meanwhile."""
    pages = _role("pages", url)
    world.publish(flood)
    world.work(4.0)
    begun, before = time.monotonic_ns(), cpu_seconds(pid)
    found = {"stop": _measure_stop(world, url, stops)} if stops else {}
    world.work(max(0.0, seconds - (time.monotonic_ns() - begun) / 1e9))
    ended, after = time.monotonic_ns(), cpu_seconds(pid)
    world.work(2.0)
    world.be_silent()
    told = json.loads(pages.communicate()[0])
    due = sum(begun <= at < ended for times in world.sent.values() for at in times) * PAGES
    came = [(at - sent) / 1e6 for each in told["seen"] for _, sent, at in each if begun <= sent < ended]
    return {
        "core": 100 * (after - before) / ((ended - begun) / 1e9),
        "due": due,
        "came": len(came),
        "lost pages": told["lost"],
        "p50": _part(came, 0.5),
        "p99": _part(came, 0.99),
        **found,
    }


def _measure_stop(world: World, url: str, stops: int) -> dict[str, Any]:
    """Return the milliseconds from a page's stop to the topic, while a call of the same page hangs."""
    world.heard.clear()
    world.hung.send_signal(signal.SIGSTOP)
    operator = _role("stop", url, str(stops))
    world.until(lambda: operator.poll() is not None, 60.0)
    world.hung.send_signal(signal.SIGCONT)
    if operator.poll() is None:
        operator.kill()
    assert operator.stdout is not None
    said = [json.loads(line) for line in operator.stdout]
    times = []
    for at, data in said:
        if data:
            first = next((heard for heard, value in world.heard if value and heard >= at), None)
            # One that came after the page had said go again is another stop's, or none.
            if first is not None and first - at < 5.0:
                times.append(1e3 * (first - at))
    return {"said": stops, "heard": len(times), "p50": _part(times, 0.5), "p99": _part(times, 0.99)}


def measure(world: World, command: str, seconds: float, stops: int) -> dict[str, Any]:
    """Return the figures of one server."""
    with _server(command) as (url, pid):
        world.work(5.0)
        before = cpu_seconds(pid)
        world.work(seconds)
        figures: dict[str, Any] = {"nobody": {"core": 100 * (cpu_seconds(pid) - before) / seconds}}
        figures["pages"] = _measure_pages(world, url, pid, seconds, flood=False)
        figures["stop"] = _measure_stop(world, url, stops)
        before, asked = cpu_seconds(pid), _role("field", url, str(FIELDS))
        world.until(lambda: asked.poll() is not None, 2 * PATIENCE)
        cost = 1e3 * (cpu_seconds(pid) - before) / FIELDS
        figures["field"] = {"answered": asked.poll() == 0, "ms": cost}
        figures["flood"] = _measure_pages(world, url, pid, seconds, flood=True, stops=stops)
        return figures


def main() -> None:
    """Measure, and print the figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0, help="seconds of each part")
    parser.add_argument("--stops", type=int, default=100)
    parser.add_argument("--beside", metavar="COMMAND", help="another server, measured in turn")
    parser.add_argument("--only", metavar="COMMAND", help="another server, and not the gateway")
    parser.add_argument("--role", nargs="+", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.role:
        words: list[str] = [*given.role, "", ""]
        role, url, count = words[:3]
        if role == "hang":
            _hang()
        else:
            asyncio.run(_pages(url) if role == "pages" else _operator(url, role, int(count)))
        return
    os.environ.setdefault("ROS_DOMAIN_ID", DOMAIN)
    world = World()
    commands = {"other": given.only} if given.only else {"gateway": OURS}
    if given.beside:
        commands["other"] = given.beside
    for name, command in commands.items():
        print(json.dumps({name: measure(world, command, given.seconds, given.stops)}, indent=1), flush=True)
    world.hung.kill()


if __name__ == "__main__":
    main()
