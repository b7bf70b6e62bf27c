"""Robots of one domain: their processes and operators, and a flood."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from std_msgs.msg import Bool, String

from lupin_ros.adapter.node import Qos
from tests.lupin_ros.world import Operator, World

NAMES = ("robot1", "robot2", "robot3")
LUPIN = str(Path(sys.executable).with_name("lupin"))
SHARED = (
    "lupin_sim",
    "lupin_arm_sim",
    "lupin_arm",
    "greenhouse_bridge",
    "perception_aggregator",
    "lupin_twin",
)
#: Publishes and calls a thousand times a second.
FLOOD = """
from std_msgs.msg import Bool
from lupin_msgs.srv import StartMission
from lupin_ros.adapter.node import Qos, RosNode
with RosNode("flood") as ros:
    stop = ros.publisher(Bool, "/e_stop_state", Qos.EVENT)
    start = ros.service(StartMission, "/mission/start")
    ros.steady_timer(0.001, lambda: stop.publish(Bool(data=False)))
    ros.steady_timer(0.001, lambda: start.call(StartMission.Request(mission_type="x"), 1.0, lambda _: None))
    ros.spin()
"""


class Robot:
    """A robot of the domain: its processes, and an operator of it."""

    def __init__(self, name: str, folder: Path) -> None:
        folder.mkdir()
        self.world = World(folder)
        self.operator = Operator()
        self.stop = self.operator.ros.publisher(Bool, "/lupin/hmi/estop", Qos.EVENT)
        self.steps: list[str] = []
        self.stops: list[bool] = []
        self.operator.ros.subscribe(
            String,
            "/mission_orchestrator/steps",
            Qos.BACKLOG,
            lambda message: self.steps.append(message.data),
        )
        self.operator.ros.subscribe(Bool, "/e_stop_state", Qos.EVENT, lambda one: self.stops.append(one.data))
        self._name = name

    def bring_up(self, ros: tuple[str, ...], before: tuple[str, ...]) -> None:
        """Start all its nodes, with these arguments of ROS, and options before the verb."""
        for nodes in (("mission_orchestrator",), SHARED, ("nav_watchdog",)):
            arguments = ["--ros-args", *ros, *(("-p", "estop_timeout_s:=10.0") if len(nodes) == 1 else ())]
            self.world.run(nodes[0], [LUPIN, *before, "node", *nodes, *arguments])

    def seen(self) -> tuple[int, ...]:
        """Count what only an event of its own would change."""
        held = sum(state.paused or state.estop_engaged for state in self.operator.states)
        return held, sum(self.stops), self.starts()

    def starts(self) -> int:
        """Count the requests for a mission that it was told."""
        return sum(json.loads(step)["step"]["event"] == "mission.start" for step in self.steps)


def spin(robots: list[Robot], condition: Callable[[], object], seconds: float) -> bool:
    """Let all operators work until a condition holds, at most so long; return whether it does."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        for robot in robots:
            robot.operator.ros.spin_once(0.002)
    return bool(condition())


class flood:  # noqa: N801 - a context, as a function
    """Floods a robot's stop and its service that starts missions."""

    def __init__(self, robot: str) -> None:
        own = {**os.environ, "LUPIN_ROBOT": robot}
        self._process = subprocess.Popen([sys.executable, "-c", FLOOD], env=own)

    def __enter__(self) -> None:
        """It has begun."""

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()


def stopped_in(robot: Robot, robots: list[Robot]) -> float:
    """Stop a robot, release it, and return the seconds until its base and its mission were stopped."""
    seen, asked = len(robot.stops), time.monotonic()
    robot.stop.publish(Bool(data=True))
    assert spin([robot], lambda: any(robot.stops[seen:]) and robot.operator.state.estop_engaged, 10.0)
    took = time.monotonic() - asked
    robot.stop.publish(Bool(data=False))
    assert spin(robots, lambda: not (robot.stops[-1] or robot.operator.state.estop_engaged), 10.0)
    return took
