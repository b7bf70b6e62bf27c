"""The bench: the real nodes with the simulated robot, the pages, and everybody who moves and stops it.

Each method that `table` names does one thing that a person or a program does, and waits for nothing but what
that person would wait for.
"""

from __future__ import annotations

import json
import math
import os
import signal
import socket
import time
import uuid
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from action_msgs.srv import CancelGoal
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped, Twist, Vector3
from mirte_msgs.srv import GetServoOffset, SetServoAngle, SetServoOffset
from nav2_msgs.action import NavigateToPose
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lupin_engine_msgs.action import RunMission
from lupin_engine_msgs.srv import Command
from lupin_msgs.srv import CalibrateArm, SetArmPreset, StartMission
from lupin_ros.adapter.node import CallFailure, GoalCallbacks, Qos
from lupin_ros.service.names import COMMAND_SERVICE, RUN_ACTION
from lupin_sim.layout import load_layout
from tests.lupin_ros.system.safety.matrix.measure import Bystander
from tests.lupin_ros.system.safety.matrix.page import STOP_TOPIC, Page
from tests.lupin_ros.world import Operator, World

#: Metres a second at which it is stopped, and between two cells.
SPEED, FAST = 1.0, 10.0
#: Where drives lead, along the free side of the greenhouse: whichever is farther (m).
ENDS = ((0.5, 7.5), (0.5, 0.7))
#: The arm's joints, and where a cell begins (rad).
JOINTS = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_joint")
START = (0.0, -0.40, 0.90, -0.80)
SERVOS = "/io/servo/hiwonder"
#: Whatever must come within a cell does within so many seconds, on a busy machine.
PATIENCE_S = 15.0
#: A node has started within so many seconds.
STARTED_S = 60.0
#: Seconds that a servo turns in a calibration.
TURN_S = 1.0
#: What the nodes are started with.
USUAL: Mapping[str, Mapping[str, Any]] = {
    "greenhouse_bridge": {},
    "lupin_sim": {"speed": SPEED, "detector": False},
    "nav_watchdog": {},
    "lupin_arm_sim": {},
    "lupin_arm": {"hardware": "real", "preset_duration": 4.0, "calibration_settle_s": 0.05},
    "mission_orchestrator": {"estop_timeout_s": 2.0},
    "lupin_gateway": {"engineer_names": ["/*"]},
}
#: How many nodes listen to the shared stop at least: orchestrator, base, arm.
HEAR_STOPS = 3
LIBRARY = """{"version": 1, "poses": {}, "sequences": {"wave": {
"mode": "teleop", "duration_s": 6.0, "waypoints": [
{"t": 0.0, "arm": [0.0, -0.4, 0.9, -0.8]},
{"t": 3.0, "arm": [0.5, 0.0, 0.0, 0.0]},
{"t": 6.0, "arm": [0.0, -0.4, 0.9, -0.8]}]}}}"""


class Bench(Operator):
    """Who asks and who looks is one node; the robot's nodes are processes of their own."""

    def __init__(self, folder: Path) -> None:
        super().__init__("matrix")
        self.folder = folder
        os.environ |= {"XDG_STATE_HOME": str(folder / "state"), "XDG_CONFIG_HOME": str(folder / "config")}
        self.world = World(folder)
        self.watch = Bystander(self.ros)
        #: What was answered to what a cell asked for; '' for yes.
        self.answers: list[str] = []
        self._port = _free_port()
        self._given: dict[str, Mapping[str, Any]] = {}
        self._pages: dict[str, Page] = {}
        self._stopping: set[str] = set()
        self._asked: dict[str, str] = {}
        self._joystick: float | None = None
        self._joystick_of_page = True
        self._twists = self.ros.publisher(Twist, "/cmd_vel", Qos.EVENT)
        #: Two other HMIs that write the shared stop: one stops, the other says steadily that it does not.
        self._strangers: list[Any] = []
        self._stranger_stops = False
        self._controller = self.ros.publisher(
            JointTrajectory, "/mirte_master_arm_controller/joint_trajectory", Qos.EVENT
        )
        self._serve_servos()
        self.ros.steady_timer(0.1, self._tick)
        self.ros.steady_timer(0.5, self._half_second)
        self.ros.steady_timer(0.33, self._third_of_a_second)
        (folder / "library.json").write_text(LIBRARY)
        for node in USUAL:
            self._start(node, {})

    @property
    def url(self) -> str:
        """Where a browser finds the console."""
        return f"http://127.0.0.1:{self._port}/"

    @property
    def tells_state(self) -> bool:
        """Whether there is somebody to publish the mission's state."""
        return self._runs("mission_orchestrator")

    # -- processes --------------------------------------------------------------------------------------

    def _start(self, node: str, given: Mapping[str, Any]) -> None:
        own: dict[str, Mapping[str, Any]] = {
            "lupin_gateway": {"port": self._port},
            "lupin_arm": {"library_path": self.folder / "library.json"},
        }
        self._given[node] = given
        self.world.start(node, **{**USUAL[node], **own.get(node, {}), **given})

    def _kill(self, node: str) -> None:
        process = self.world.processes[node]
        process.kill()
        process.wait()

    def _runs(self, node: str) -> bool:
        return self.world.processes[node].poll() is None

    def close(self) -> list[str]:
        """End everything; return what did not end by itself."""
        self.thaw_base()
        for page in self._pages.values():
            page.close()
        self.ros.close()
        return self.world.stop()

    # -- between two cells ------------------------------------------------------------------------------

    def reset(self, settings: Mapping[str, Mapping[str, Any]]) -> None:
        """Bring everything to rest: no stop, no mission, nothing that moves; nodes with these settings."""
        self.joystick_free()
        self.thaw_base()
        self._strangers_leave()
        for node in ("mission_orchestrator", "lupin_gateway"):
            wanted = settings.get(node, {})
            if not self._runs(node) or self._given[node] != wanted:
                if node == "lupin_gateway":
                    self.leave_page()
                if self._runs(node):
                    self.world.processes[node].terminate()
                    self.world.processes[node].wait()
                self._start(node, wanted)
        for name in list(self._pages):
            self.let_go_of(name)
            if name != "a" or self._pages[name].is_closed:
                self._pages.pop(name).close()
        self.page_resets_stops()
        for name, value in (("estop", False), ("battery", 1.0), ("speed", FAST), ("fault", "none")):
            self.set_parameter("lupin_sim", name, value)
        self.states.clear()
        self.wait_for(lambda: self.states and not self.state.estop_engaged, "no stop", STARTED_S)
        self.call(CalibrateArm, "/lupin/arm/calibrate", CalibrateArm.Request(action="cancel"))
        self.servos_on()
        self.ask_arm_to_stop()
        self._end_mission()
        self.call(CancelGoal, "/navigate_to_pose/_action/cancel_goal", CancelGoal.Request())
        self._send_arm(START, 0.3)
        self.wait_for(self._at_rest, "everything at rest")
        self.set_parameter("lupin_sim", "speed", SPEED)
        self.watch.forget()
        self.answers.clear()
        self._asked.clear()
        self.page("a").statuses.clear()

    def _end_mission(self) -> None:
        next_try = 0.0

        def ended() -> bool:
            nonlocal next_try
            if self.state.lifecycle_state in ("READY", "DONE") and not self.state.paused:
                return True
            if time.monotonic() > next_try:
                next_try = time.monotonic() + 0.5
                verb = "reset" if self.state.lifecycle_state == "FAULT" else "abort"
                if self.state.paused and self.state.lifecycle_state in ("READY", "DONE"):
                    verb = "resume"
                self._command(verb)
            return False

        self.wait_for(ended, "the end of the mission", 30.0)

    def _at_rest(self) -> bool:
        now = time.time()
        joints, base = self.watch.joints, self.watch.base
        if not joints or not base or max(now - joints[-1][0], now - base[-1][0]) > 0.5:
            return False
        moved = self.watch.moved(now - 0.3, now)
        at_start = max(abs(a - b) for a, b in zip(self._arm_pose(), START, strict=True)) < 0.02
        return at_start and not moved.exceeds(0.0, 1e-3)

    # -- waiting ----------------------------------------------------------------------------------------

    def wait_for(self, condition: Callable[[], Any], what: str, seconds: float = PATIENCE_S) -> None:
        """Work until a condition holds."""
        self.until(condition, what, seconds)

    def work(self, until: float) -> None:
        """Work until a time of the wall clock."""
        while time.time() < until:
            self.ros.spin_once(0.01)
        self._collect()

    def mission_drives(self) -> None:
        """Have a mission under way that drives."""
        begin = time.time()
        self.start_mission()
        self.wait_for(lambda: self.watch.moved(begin, time.time()).metres > 0.15, "the mission drives")

    def _third_of_a_second(self) -> None:
        if self._strangers:
            self._strangers[1].publish(Bool(data=False))

    def _tick(self) -> None:
        for name in self._stopping:
            self._pages[name].stop(True)
        if self._joystick is not None:
            self._drive(self._joystick)

    def _half_second(self) -> None:
        if self._stranger_stops:
            self._strangers[0].publish(Bool(data=True))

    # -- pages ------------------------------------------------------------------------------------------

    def page(self, name: str) -> Page:
        """Return a page that is connected."""
        if name not in self._pages:
            opened: list[Page] = []

            def connected() -> bool:
                with suppress(OSError, TimeoutError, EOFError, Exception):
                    opened.append(Page(self._port))
                return bool(opened)

            self.wait_for(connected, f"page {name}", STARTED_S)
            self._pages[name] = opened[0]
            self.wait_for(lambda: opened[0].stops(), f"what page {name} shows")
        return self._pages[name]

    def stop_of(self, name: str, *, steadily: bool = True) -> None:
        """A page tells STOP."""
        page = self.page(name)
        page.stop(True)
        if steadily:
            self._stopping.add(name)

    def let_go_of(self, name: str) -> None:
        """A page releases its own stop."""
        self._stopping.discard(name)
        if name in self._pages:
            self._pages[name].stop(False)

    def stop_of_a(self) -> None:
        """STOP on page A, told steadily."""
        self.stop_of("a")

    def a_lets_go(self) -> None:
        """Release on page A."""
        self.let_go_of("a")

    def stop_of_b(self) -> None:
        """STOP on page B, which is closed then."""
        page = self.page("b")
        page.stop(True)
        self.work(time.time() + 0.1)
        self._pages.pop("b").close()

    def stop_of_b_and_kill(self) -> None:
        """The same, and the gateway is killed."""
        self.stop_of_b()
        self.work(time.time() + 0.2)
        self.kill_gateway()

    def gateway_and_reset(self) -> None:
        """It is started again, and the stop of page B is reset by its name."""
        self.start_gateway()
        self.page_resets_stops()

    def stop_of_roslib(self) -> None:
        """STOP of a program: one message, and it stays connected."""
        self.stop_of("roslib", steadily=False)

    def roslib_lets_go(self) -> None:
        """Its false."""
        self.let_go_of("roslib")

    def leave_page(self) -> None:
        """All pages are closed."""
        self._stopping.clear()
        for name in list(self._pages):
            self._pages.pop(name).close()

    def page_is_back(self) -> None:
        """Page A is opened again."""
        self.page("a")

    def page_resets_stops(self) -> None:
        """An operator resets every stop that a page or a link has left."""
        page = self.page("a")

        def none_left() -> bool:
            for stop in page.stops().get("stops", []):
                if stop["left"]:
                    page.begin("call_service", service="/lupin/hmi/reset_stop", args={"name": stop["name"]})
            self.work(time.time() + 0.1)
            return not page.stops().get("stopped", True)

        self.wait_for(none_left, "no stop of a page")

    def _collect(self) -> None:
        """Take the answers that pages got."""
        page = self._pages.get("a")
        for number, kind in list(self._asked.items()):
            if page is not None and number in page.answers:
                told = page.answers[number]
                del self._asked[number]
                self.answers.append(f"{kind}: {_refusal(told)}" if _refusal(told) else "")
        if page is not None:
            self.answers += page.statuses
            page.statuses.clear()

    # -- sources of motion ------------------------------------------------------------------------------

    def _place(self) -> tuple[float, float, float]:
        _, x, y, yaw = self.watch.base[-1]
        return x, y, yaw

    def _far(self) -> tuple[float, float]:
        x, y, _ = self._place()
        return max(ENDS, key=lambda end: math.dist(end, (x, y)))

    def _begin(self, kind: Any, name: str, request: Any, said: Callable[[Any], str]) -> None:
        """Call a service without waiting; what it answers is noted."""
        if name not in self._callers:
            self._callers[name] = self.ros.service(kind, name)
        caller = self._callers[name]
        self.wait_for(caller.ready, name)
        caller.call(
            request,
            PATIENCE_S,
            lambda answer: self.answers.append(
                answer.detail if isinstance(answer, CallFailure) else said(answer)
            ),
        )

    def _far_tag(self) -> str:
        x, y, _ = self._place()
        return max(load_layout().tags, key=lambda tag: math.dist((tag.x, tag.y), (x, y))).id

    def run_mission(self) -> None:
        """A program runs the same mission as an action."""
        asked = json.dumps({"tag_sequence": [self._far_tag()]})
        if RUN_ACTION not in self._callers:
            self._callers[RUN_ACTION] = self.ros.action(RunMission, RUN_ACTION)
        client = self._callers[RUN_ACTION]
        self.wait_for(client.ready, RUN_ACTION)
        ended = lambda _, result: self.answers.append(result.message)  # noqa: E731
        client.send(RunMission.Goal(mission="InspectionMission", request=asked), GoalCallbacks(ended=ended))

    def start_mission(self) -> None:
        """Start a mission to the tag that is farthest away."""
        request = StartMission.Request(mission_type="InspectionMission", tag_sequence=[self._far_tag()])
        said = lambda answer: "" if answer.accepted else str(answer.error_message)  # noqa: E731
        self._begin(StartMission, "/mission/start", request, said)

    def goal_of_page(self) -> None:
        """Page A sends a goal of navigation."""
        x, y = self._far()
        pose = {"position": {"x": x, "y": y}, "orientation": {"w": 1.0}}
        number = self.page("a").begin(
            "send_action_goal",
            action="/navigate_to_pose",
            action_type="nav2_msgs/NavigateToPose",
            args={"pose": {"header": {"frame_id": "map"}, "pose": pose}},
        )
        self._asked[number] = "goal"

    def click_of_page(self) -> None:
        """Page A publishes where somebody clicked."""
        x, y = self._far()
        pose = {"position": {"x": x, "y": y}, "orientation": {"w": 1.0}}
        self.page("a").publish("/goal_pose", {"header": {"frame_id": "map"}, "pose": pose})

    def joystick_of_page(self) -> None:
        """Page A drives, ten times a second, to where there is room."""
        _, y, yaw = self._place()
        ahead = y + 3.0 * math.sin(yaw)
        self._joystick = 0.5 if 0.6 < ahead < 7.6 else -0.5
        self._joystick_of_page = True

    def joystick_free(self) -> None:
        """Whoever drove takes his hand off."""
        if self._joystick is not None:
            self._drive(0.0)
            self._joystick = None

    def _drive(self, speed: float) -> None:
        if not self._joystick_of_page:
            self._twists.publish(Twist(linear=Vector3(x=speed)))
        elif "a" in self._pages:
            self._pages["a"].publish("/cmd_vel", {"linear": {"x": speed}})

    def goal_of_page_with_base(self) -> None:
        """Page A takes the base of a mission that is held, and sends a goal."""
        page = self.page("a")
        number = page.begin("call_service", service="/lupin/hmi/take_base", args={})
        self.wait_for(lambda: number in page.answers, "the answer to who wants the base")
        self.goal_of_page()

    def twists_of_stranger(self) -> None:
        """A program drives, past the gateway."""
        self.joystick_of_page()
        self._joystick_of_page = False

    def goal_of_stranger(self) -> None:
        """A program of somebody else sends a goal."""
        x, y = self._far()
        goal = NavigateToPose.Goal(pose=PoseStamped())
        goal.pose.header.frame_id = "map"
        goal.pose.pose.position.x, goal.pose.pose.position.y = x, y
        goal.pose.pose.orientation.w = 1.0
        if not hasattr(self, "_navigation"):
            self._navigation = self.ros.action(NavigateToPose, "navigate_to_pose")
        self.wait_for(self._navigation.ready, "navigation")
        self._navigation.send(
            goal,
            GoalCallbacks(
                ended=lambda status, _: self.answers.append(f"ended with status {status}"),
                rejected=lambda: self.answers.append("the goal was rejected"),
            ),
        )

    def goal_to_frozen_base(self) -> None:
        """The base hangs while a mission sends its goal: the answer comes when it is thawed."""
        self.world.processes["lupin_sim"].send_signal(signal.SIGSTOP)
        self.start_mission()
        self.work(time.time() + 0.5)

    def thaw_base(self) -> None:
        """It goes on, and answers what has come meanwhile."""
        if self._runs("lupin_sim"):
            self.world.processes["lupin_sim"].send_signal(signal.SIGCONT)

    # -- the arm ----------------------------------------------------------------------------------------

    def _arm_pose(self) -> tuple[float, ...]:
        return tuple(self.watch.joints[-1][1:5])

    def arm_preset(self) -> None:
        """Send the arm to a preset."""
        name = "tuck" if abs(self._arm_pose()[2] - 1.5) > 0.3 else "inspect"
        self._begin(SetArmPreset, "/lupin/arm/preset", SetArmPreset.Request(name=name), _said)

    def arm_sequence(self) -> None:
        """Page A plays a sequence of the library."""
        number = self.page("a").begin(
            "call_service", service="/lupin/arm/library/play", args={"name": "wave", "speed": 1.0}
        )
        self._asked[number] = "sequence"

    def calibrate(self) -> None:
        """Begin a calibration, which turns all joints to zero."""
        self._begin(CalibrateArm, "/lupin/arm/calibrate", CalibrateArm.Request(action="start"), _said)

    def servos_on(self) -> None:
        """Switch the servos on, which a calibration that was stopped has left off."""
        self.call(SetBool, "/lupin/arm/set_torque", SetBool.Request(data=True))

    def ask_arm_to_stop(self) -> None:
        """Stop what the library plays."""
        self.call(Trigger, "/lupin/arm/library/stop", Trigger.Request())

    def _send_arm(self, pose: tuple[float, ...], seconds: float) -> None:
        """Move the simulated arm as its servos would, past all that may be asked."""
        point = JointTrajectoryPoint(
            positions=list(pose),
            velocities=[0.5] * 4,
            time_from_start=Duration(sec=int(seconds), nanosec=int(seconds % 1.0 * 1e9)),
        )
        self._controller.publish(JointTrajectory(joint_names=list(JOINTS), points=[point]))

    def _serve_servos(self) -> None:
        """Serve what only real servos have: offsets, and a turn to an angle, answered when it is there."""

        def turn(joint: int | None, request: Any, response: Any, answer: Callable[[Any], None]) -> None:
            if joint is not None:
                pose = list(self._arm_pose())
                pose[joint] = request.angle
                self._send_arm(tuple(pose), TURN_S)
            response.status = True
            self.ros.call_later(TURN_S, lambda: answer(response))

        self.ros.serve(SetBool, "/enable_arm_control", _done)
        for name, joint in (("shoulder_lift", 1), ("elbow", 2), ("wrist", 3), ("gripper", None)):
            base = f"{SERVOS}/{name}"
            self.ros.serve(GetServoOffset, f"{base}/_offset", lambda _, response: response)
            self.ros.serve(SetServoOffset, f"{base}/_set_offset", lambda _, response: response)
            self.ros.serve_later(SetServoAngle, f"{base}/set_angle", partial(turn, joint))

    # -- stops ------------------------------------------------------------------------------------------

    def strangers_come(self) -> None:
        """Two other HMIs are about to write the shared stop, and are known to the others."""
        self._strangers = [self.ros.publisher(Bool, STOP_TOPIC, Qos.EVENT) for _ in range(2)]
        known = lambda: all(each.get_subscription_count() >= HEAR_STOPS for each in self._strangers)  # noqa: E731
        self.wait_for(known, "who hears a stop")

    def _strangers_leave(self) -> None:
        self._stranger_stops = False
        for each in self._strangers:
            self.ros.node.destroy_publisher(each)
        self._strangers = []

    def stop_of_stranger(self) -> None:
        """One of them tells a stop, twice a second; the other goes on saying that it does not."""
        self._stranger_stops = True
        self._strangers[0].publish(Bool(data=True))

    def stranger_is_silent(self) -> None:
        """It says nothing any more."""
        self._stranger_stops = False

    def press_button(self) -> None:
        """The robot's own button."""
        self.set_parameter("lupin_sim", "estop", True)

    def release_button(self) -> None:
        """It is turned back."""
        self.set_parameter("lupin_sim", "estop", False)

    def _command(self, verb: str) -> None:
        request = Command.Request(verb=verb, command_id=str(uuid.uuid4()))
        name = COMMAND_SERVICE
        if name not in self._callers:
            self._callers[name] = self.ros.service(Command, name)
        self.wait_for(self._callers[name].ready, name)
        self._callers[name].call(request, 5.0, lambda _: None)

    def pause(self) -> None:
        """An operator pauses the mission."""
        self._command("pause")

    def resume(self) -> None:
        """An operator resumes the mission."""
        self._command("resume")

    def kill_orchestrator(self) -> None:
        """It is killed."""
        self._kill("mission_orchestrator")

    def start_orchestrator(self) -> None:
        """It is started again, and holds what it finds."""
        if not self._runs("mission_orchestrator"):
            self._start("mission_orchestrator", self._given["mission_orchestrator"])
        self.states.clear()
        self.wait_for(
            lambda: self.states and self.state.lifecycle_state != "BOOT", "the orchestrator", STARTED_S
        )

    def restart_orchestrator(self) -> None:
        """It is killed and started again at once."""
        self.kill_orchestrator()
        self.start_orchestrator()

    def drain_battery(self) -> None:
        """The battery is low."""
        self.set_parameter("lupin_sim", "battery", 0.1)

    def charge_battery(self) -> None:
        """It is full."""
        self.set_parameter("lupin_sim", "battery", 1.0)

    def kill_gateway(self) -> None:
        """It is killed; pages lose their connection."""
        self._kill("lupin_gateway")
        self.leave_page()

    def start_gateway(self) -> None:
        """It is started again, and page A comes back."""
        if not self._runs("lupin_gateway"):
            self._start("lupin_gateway", self._given["lupin_gateway"])
        self.page("a")


def _done(_: Any, response: Any) -> Any:
    response.success = True
    return response


def _refusal(told: Mapping[str, Any]) -> str:
    """Return why a page's request was refused; '' where it was not, or has only ended."""
    values = told["values"]
    if not told["result"]:
        return str(values)
    return "" if values.get("success", True) else str(values["message"])


def _said(answer: Any) -> str:
    return "" if answer.success else str(answer.message)


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as found:
        return int(found.getsockname()[1])
