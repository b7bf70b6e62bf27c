"""Motion that a stop meets on the way: goals, clicks and twists of pages and strangers, in metres driven.

Real processes; the pages speak the gateway's protocol over a socket. Every stop here is let go again, and
what was asked for before or meanwhile must not drive then.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatus, GoalStatusArray
from geometry_msgs.msg import Twist, Vector3
from nav2_msgs.action import NavigateToPose
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from lupin_ros.adapter.host import Repeater
from lupin_ros.adapter.node import GoalCallbacks, Qos
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(240)

#: Metres a second; how far the robot may get until a stop is carried out, and while it stands.
SPEED, STOPPING_M, STANDING_M = 0.5, 0.25, 0.01
#: Seconds that a busy machine may add to the time for which a velocity is obeyed.
BUSY_S = 0.5
#: Seconds in which a robot that is let go would be well under way, and a tag that is far from the start.
WATCHED_S, FAR_TAG = 2.5, "29"
STOP_TOPIC, TAKE, BASE_TOPIC = "/lupin/hmi/estop", "/lupin/hmi/take_base", "/lupin/hmi/base"
#: A place some metres from the start, and a velocity.
GOAL = {"pose": {"header": {"frame_id": "map"}, "pose": {"position": {"y": 6.0}, "orientation": {"w": 1.0}}}}
FORWARD, STILL = {"linear": {"x": 0.4}}, {"linear": {"x": 0.0}}
STOPPED = "refused: e-stop engaged"


class Page:
    """A page, as the gateway's protocol has it; it works on the bystander's node while it waits."""

    def __init__(self, url: str, bystander: Bystander) -> None:
        self._opened = contextlib.ExitStack()
        self._socket = self._opened.enter_context(connect(url))
        self._bystander = bystander
        self._numbers = itertools.count(1)
        self.frames: list[dict[str, Any]] = []

    def close(self) -> None:
        self._opened.close()

    def send(self, op: str, **fields: Any) -> str:
        given = {"op": op, "id": f"{op}-{next(self._numbers)}", **fields}
        self._socket.send(json.dumps(given))
        return str(given["id"])

    def _read(self) -> None:
        while True:
            try:
                self.frames.append(json.loads(self._socket.recv(timeout=0.0)))
            except (TimeoutError, ConnectionClosed):
                return

    def until(self, find: Callable[[], Any], what: str) -> Any:
        def found() -> Any:
            self._read()
            return find()

        return self._bystander.until(found, f"{what}; seen: {self.frames[-3:]}") or find()

    def answer(self, number: str, op: str = "") -> dict[str, Any]:
        """Wait for what comes of an operation: its answer, its result, or why it was refused."""

        def about() -> list[dict[str, Any]]:
            mine = [f for f in self.frames if f.get("id") == number and f["op"] != "action_feedback"]
            return [f for f in mine if op in ("", f["op"])]

        found: list[dict[str, Any]] = self.until(about, f"the answer to {number}")
        return found[0]

    def call(self, service: str, **arguments: Any) -> Any:
        number = self.send("call_service", service=service, args=arguments)
        return self.answer(number, "service_response")["values"]

    def goal(self, action: str = "/navigate_to_pose", type_: str = "nav2_msgs/NavigateToPose") -> str:
        return self.send("send_action_goal", action=action, action_type=type_, args=GOAL)

    def publish(self, topic: str, type_: str, message: Any) -> str:
        self.send("advertise", topic=topic, type=type_)
        return self.send("publish", topic=topic, msg=message)

    def drive(self, message: Any, topic: str = "/cmd_vel") -> str:
        return self.publish(topic, "geometry_msgs/Twist", message)

    def click(self) -> str:
        return self.publish("/goal_pose", "geometry_msgs/PoseStamped", GOAL["pose"])

    def stop(self, engaged: bool) -> None:
        self.send("publish", topic=STOP_TOPIC, msg={"data": engaged})

    def base(self) -> dict[str, Any]:
        """Return what was told last of who has the base."""
        found = [f["msg"]["data"] for f in self.frames if f.get("topic") == BASE_TOPIC]
        return dict(json.loads(found[-1])) if found else {}

    def refused(self, number: str) -> str:
        """Return the text with which an operation was refused."""
        frame = self.answer(number)
        return str(frame["values"] if frame["op"] == "action_result" else frame["msg"])


class Bystander(Operator):
    """An operator who sees where the base is, how far it has driven, and which goals navigation has."""

    def __init__(self, world: World) -> None:
        super().__init__()
        self.world = world
        self.place: tuple[float, float] | None = None
        self.metres = 0.0
        #: The goals that navigation worked on at the same time, as often as that was told.
        self.active: list[set[bytes]] = []
        self.ros.subscribe(TFMessage, "/tf", Qos.TRANSFORMS, self._on_transforms)
        self.ros.subscribe(GoalStatusArray, "/navigate_to_pose/_action/status", Qos.LATCHED, self._on_goals)
        self._estop = self.ros.publisher(Bool, STOP_TOPIC, Qos.EVENT)
        self._pressed = Repeater(self.ros.steady_timer, 0.2, lambda: self._estop.publish(Bool(data=True)))
        self.twists = self.ros.publisher(Twist, "/cmd_vel", Qos.EVENT)
        self.navigation = self.ros.action(NavigateToPose, "/navigate_to_pose")

    def _on_transforms(self, message: TFMessage) -> None:
        for found in message.transforms:
            if found.child_frame_id == "base_link":
                place = found.transform.translation.x, found.transform.translation.y
                self.metres += math.dist(place, self.place or place)
                self.place = place

    def _on_goals(self, message: GoalStatusArray) -> None:
        working = (GoalStatus.STATUS_ACCEPTED, GoalStatus.STATUS_EXECUTING, GoalStatus.STATUS_CANCELING)
        goals = [one.goal_info.goal_id.uuid for one in message.status_list if one.status in working]
        self.active.append({bytes(goal) for goal in goals})

    def rest(self, seconds: float) -> float:
        """Let time go by; return the metres driven meanwhile."""
        before, end = self.metres, time.monotonic() + seconds
        self.until(lambda: time.monotonic() >= end, "the time")
        return self.metres - before

    def drives(self) -> None:
        """Wait for the next 0.3 m."""
        before = self.metres
        self.until(lambda: self.metres > before + 0.3, "the drive")

    def stands(self) -> None:
        """Wait until the robot has not moved for half a second."""
        self.until(lambda: self.rest(0.5) < STANDING_M, "the robot at rest")

    def press(self, engaged: bool) -> None:
        """Press or release the shared stop, as a panel without a gateway does."""
        self.publish_stop(engaged)
        self.until(lambda: self.state.estop_engaged is engaged, f"the stop is {engaged}")

    def publish_stop(self, engaged: bool) -> None:
        """The same, whoever hears it."""
        if engaged:
            self._pressed.start()
        else:
            self._pressed.stop()
        self._estop.publish(Bool(data=engaged))

    def send(self) -> list[int]:
        """Send a goal as any action client does; the list gets how it ends, 0: rejected."""
        goal = NavigateToPose.Goal()
        goal.pose.header.frame_id = "map"
        goal.pose.pose.position.y = 6.0
        goal.pose.pose.orientation.w = 1.0
        self.until(self.navigation.ready, "the navigation")
        ended: list[int] = []
        self.navigation.send(
            goal,
            GoalCallbacks(ended=lambda status, _: ended.append(status), rejected=lambda: ended.append(0)),
        )
        return ended


@pytest.fixture
def bystander(world: World) -> Iterator[Bystander]:
    found = Bystander(world)
    yield found
    found.ros.close()


@pytest.fixture
def robot(world: World, bystander: Bystander) -> Bystander:
    """The simulated robot, its watchdog and an orchestrator, in READY."""
    world.start("nav_watchdog")
    world.start_all(speed=2.0 * SPEED)
    bystander.in_state("READY")
    bystander.until(lambda: bystander.place, "the robot")
    bystander.until(bystander.navigation.ready, "the navigation")
    bystander.until(lambda: bystander._estop.get_subscription_count() > 0, "the stop is heard")
    return bystander


@pytest.fixture
def page(world: World, robot: Bystander) -> Iterator[Callable[[], Page]]:
    """Open pages of one gateway."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = int(free.getsockname()[1])
    process = world.start("lupin_gateway", port=port)
    while True:
        assert process.poll() is None, world.log("lupin_gateway").read_text()
        try:
            socket.create_connection(("127.0.0.1", port), 1.0).close()
            break
        except OSError:
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(0.05)
    pages: list[Page] = []

    def open_one() -> Page:
        opened = Page(f"ws://127.0.0.1:{port}/_ros", robot)
        pages.append(opened)
        opened.send("subscribe", topic=BASE_TOPIC, type="std_msgs/String")
        opened.send("subscribe", topic="/mission/state", type="lupin_msgs/MissionState")
        opened.until(lambda: any(f.get("topic") == "/mission/state" for f in opened.frames), "the state")
        return opened

    yield open_one
    for each in pages:
        each.close()


# -- whoever sends it: the watchdog ------------------------------------------------------------------------


def test_a_goal_that_was_sent_before_a_stop_is_gone_when_it_is_let_go(robot: Bystander) -> None:
    ended = robot.send()
    robot.drives()
    robot.press(True)
    assert robot.rest(1.0) < STOPPING_M
    assert ended == [GoalStatus.STATUS_CANCELED]
    robot.press(False)
    assert robot.rest(WATCHED_S) < STANDING_M


@pytest.mark.core
@pytest.mark.parametrize("holds", [0.7, 0.05])
def test_a_goal_that_is_sent_during_a_stop_is_gone_when_it_is_let_go(robot: Bystander, holds: float) -> None:
    """Also one that comes just before the stop is let go, and while a mission is held by that stop."""
    assert robot.start(FAR_TAG).accepted
    robot.drives()
    robot.press(True)
    robot.held()
    for _ in range(3):  # whatever comes, again and again
        ended = robot.send()
        robot.until(lambda ended=ended: ended, "the end of the goal")  # type: ignore[misc]
        assert ended == [GoalStatus.STATUS_CANCELED]
    robot.stands()
    late = robot.send()
    robot.rest(holds)
    robot.press(False)
    assert robot.rest(WATCHED_S) < STANDING_M
    assert late == [GoalStatus.STATUS_CANCELED]
    assert robot.state.paused
    robot.active.clear()
    assert robot.ask("resume").success
    robot.drives()
    assert max(map(len, robot.active)) == 1


def test_a_stop_without_an_orchestrator_ends_goals_too(robot: Bystander) -> None:
    robot.world.processes["mission_orchestrator"].kill()
    robot.rest(3.0)
    ended = robot.send()
    robot.drives()
    robot.publish_stop(True)
    robot.until(lambda: ended, "the end of the goal")
    robot.publish_stop(False)
    assert robot.rest(WATCHED_S) < STANDING_M


# -- the gateway's doors -----------------------------------------------------------------------------------


@pytest.mark.core
def test_under_a_stop_every_door_of_the_gateway_refuses_motion(
    robot: Bystander, page: Callable[[], Page]
) -> None:
    robot.world.start("lupin_arm_sim")
    robot.world.start("lupin_arm")
    one, other = page(), page()
    other.stop(True)
    robot.until(lambda: robot.state.estop_engaged, "stopped")
    assert one.refused(one.goal()).startswith(f"/navigate_to_pose {STOPPED}")
    assert one.refused(one.click()).startswith(f"/goal_pose {STOPPED}")
    assert one.refused(one.drive(FORWARD)).startswith(f"/cmd_vel {STOPPED}")
    for service, arguments in (
        ("/lupin/arm/preset", {"name": "inspect"}),
        ("/lupin/arm/library/play", {"name": "wave"}),
        ("/lupin/arm/elbow/set_angle_with_speed", {"angle": 10.0}),
    ):
        assert str(one.call(service, **arguments)).startswith(f"{service} {STOPPED}"), service
    heard: list[float] = []
    robot.ros.subscribe(Twist, "/cmd_vel", Qos.EVENT, lambda message: heard.append(message.linear.x))

    def still() -> list[float]:
        one.send("publish", topic="/cmd_vel", msg=STILL)
        return heard

    one.until(still, "a zero twist, which passes")
    other.stop(False)
    robot.until(lambda: not robot.state.estop_engaged, "released")
    assert robot.rest(WATCHED_S) < STANDING_M
    assert set(heard) == {0.0}
    one.drive(FORWARD)  # asked for anew it is carried out
    one.until(lambda: 0.4 in heard, "the twist")


def test_what_a_page_drives_ends_with_a_stop(robot: Bystander, page: Callable[[], Page]) -> None:
    one = page()
    goal = one.goal()
    robot.drives()
    robot.world.processes["mission_orchestrator"].kill()  # nobody but the gateway and the watchdog is left
    robot.world.processes["nav_watchdog"].kill()
    one.stop(True)
    assert one.answer(goal)["status"] == GoalStatus.STATUS_CANCELED
    assert one.refused(one.goal()).startswith(f"/navigate_to_pose {STOPPED}")
    one.stop(False)
    assert robot.rest(WATCHED_S) < STANDING_M


@pytest.mark.parametrize("door", ["goal", "click"])
def test_what_a_page_drives_ends_when_its_gateway_is_killed(
    robot: Bystander, page: Callable[[], Page], door: str
) -> None:
    """Nobody is left who could cancel it but the watchdog of navigation, which hears the gateway no more."""
    one = page()
    getattr(one, door)()
    robot.drives()
    robot.world.processes["lupin_gateway"].kill()
    before = robot.metres
    robot.stands()
    assert robot.metres - before < 2.0 * SPEED * (2.0 + BUSY_S)
    reason = "reason='the gateway of the pages is silent for 1.5 s'"
    assert reason in robot.world.log("nav_watchdog").read_text()


def test_while_a_mission_has_the_base_pages_do_not_drive(robot: Bystander, page: Callable[[], Page]) -> None:
    """While it is held somebody may take the base, and who resumes gets it back before the mission drives."""
    one, other = page(), page()
    assert robot.start(FAR_TAG).accepted
    robot.drives()
    one.until(lambda: one.base()["hindrance"] == "mission", "the mission has the base")
    for refused in (one.refused(one.goal()), one.refused(one.drive(FORWARD)), one.refused(one.click())):
        assert "refused: a mission has the base (INSPECTING)" in refused
    taken = one.call(TAKE, take=True)
    assert taken == {"success": False, "message": "a mission has the base (INSPECTING): pause it first"}
    assert robot.ask("pause").success
    robot.stands()
    one.until(lambda: one.base()["hindrance"] == "held", "held")
    assert "refused: a mission is held (INSPECTING): take the base first" in one.refused(one.goal())
    assert one.call(TAKE, take=True)["success"]
    one.until(lambda: one.base()["taken_by"], "taken")
    robot.rest(0.5)
    assert "has the base" in other.refused(other.goal())
    robot.active.clear()
    goal = one.goal()
    robot.drives()
    assert robot.state.paused
    assert robot.ask("resume").success
    assert one.answer(goal)["status"] in (GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED)
    robot.drives()
    assert max(map(len, robot.active)) == 1
    assert not one.base()["taken_by"]
    log = next(Path(os.environ["XDG_STATE_HOME"]).rglob("audit.jsonl")).read_text()
    assert TAKE in log
    assert '"base_taken_back"' in log


def test_a_stop_takes_the_base_back(robot: Bystander, page: Callable[[], Page]) -> None:
    one = page()
    assert robot.start(FAR_TAG).accepted
    robot.drives()
    assert robot.ask("pause").success
    one.until(lambda: one.base()["hindrance"] == "held", "held")
    assert one.call(TAKE, take=True)["success"]
    one.goal()
    robot.drives()
    one.stop(True)
    robot.until(lambda: robot.state.estop_engaged, "stopped")
    robot.stands()
    assert not one.call(TAKE, take=True)["success"]
    one.stop(False)
    robot.until(lambda: not robot.state.estop_engaged, "released")
    assert robot.rest(WATCHED_S) < STANDING_M
    one.until(lambda: one.base()["hindrance"] == "held" and not one.base()["taken_by"], "taken back")
    assert "take the base first" in one.refused(one.goal())


# -- twists ------------------------------------------------------------------------------------------------


def test_a_twist_moves_the_simulated_base_until_it_is_old_or_stopped(robot: Bystander) -> None:
    robot.until(lambda: robot.twists.get_subscription_count() > 0, "the base")

    def publish() -> float:
        robot.twists.publish(Twist(linear=Vector3(x=FORWARD["linear"]["x"])))
        return robot.rest(0.1)

    before = robot.metres
    robot.until(lambda: publish() and robot.metres > before + 0.3, "the drive")
    assert robot.rest(2.0) < FORWARD["linear"]["x"] * (0.5 + BUSY_S)
    assert robot.rest(0.5) < STANDING_M
    robot.until(lambda: publish() > 0.0, "the drive")
    robot.press(True)
    robot.stands()
    assert sum(publish() for _ in range(10)) < STANDING_M
    robot.press(False)
    assert robot.rest(1.0) < STANDING_M
