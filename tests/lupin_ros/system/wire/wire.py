"""The other ends of the orchestrator's wire, which a test makes misbehave, and what must hold all the same.

Action server and bridge are made of bare services here: a server of rclpy always answers, once and in order.
All fakes live on the operator's node and work while the operator waits.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from action_msgs.msg import GoalInfo, GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav2_msgs.action import NavigateToPose
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from unique_identifier_msgs.msg import UUID

from lupin_msgs.msg import MissionState, SensorReading
from lupin_msgs.srv import GetTagReading, SetArmPreset
from lupin_ros.adapter.node import Qos, RosNode
from tests.lupin_ros.world import Operator, World

ACTION, BRIDGE = "/navigate_to_pose", "/greenhouse_bridge/get_tag_reading"
#: Seconds that node and fakes together may take for what must happen at once, on a busy machine.
AT_ONCE = 1.0
#: What a log of the node never has: an exception that somebody had to catch.
NEVER_LOGGED = ("Traceback", "callback failed", "rclpy failed")

OK, UNREACHABLE, SCAN_FAILED, SKIPPED = range(4)


class Asked:
    """A request that stays open: it may be answered never, later, or more than once."""

    def __init__(self, request: Any, answer: Callable[[Any], None]) -> None:
        self.request = request
        self.answer = answer


def serve_by_hand(ros: RosNode, kind: Any, name: str, asked: Callable[[Asked], None]) -> None:
    """Offer a service whose answers are sent when somebody says so."""
    requests: deque[Any] = deque()

    def keep(request: Any, response: Any) -> Any:
        requests.append(request)
        return response

    service = ros.node.create_service(kind, name, keep, qos_profile=Qos.SERVICES.profile())
    send = service.send_response
    service.send_response = lambda _, header: asked(
        Asked(requests.popleft(), lambda response: send(response, header))
    )


@dataclass
class Drive:
    """A goal at the server: `accepted`, `ended` and each of `cancels` are when it happened."""

    base: Base
    key: bytes
    sent: Asked
    arrived: float
    status: int = GoalStatus.STATUS_UNKNOWN
    accepted: float | None = None
    ended: float | None = None
    cancels: list[tuple[float, Asked]] = field(default_factory=list)
    asked: list[Asked] = field(default_factory=list)

    def accept(self, times: int = 1) -> None:
        """Take the goal: from now on the robot drives."""
        self.accepted, self.status = time.monotonic(), GoalStatus.STATUS_EXECUTING
        for _ in range(times):
            self.sent.answer(NavigateToPose.Impl.SendGoalService.Response(accepted=True))
        self.base.tell()

    def reject(self) -> None:
        """Refuse the goal."""
        self.ended = time.monotonic()
        self.sent.answer(NavigateToPose.Impl.SendGoalService.Response(accepted=False))

    def feed_back(self, distance: float) -> None:
        """Tell how far it still is."""
        message = NavigateToPose.Impl.FeedbackMessage(goal_id=UUID(uuid=list(self.key)))
        message.feedback.distance_remaining = distance
        self.base.feedback.publish(message)

    def end(self, status: int, times: int = 1) -> None:
        """End the goal and tell whoever has asked for the result."""
        self.ended, self.status = time.monotonic(), status
        self.base.tell()
        for asked in self.asked:
            for _ in range(times):
                asked.answer(self.result())

    def arrive_at_once(self) -> None:
        """Be there before anybody looks."""
        self.accept()
        self.arrive()

    def arrive(self, times: int = 1) -> None:
        """End the goal: reached."""
        self.end(GoalStatus.STATUS_SUCCEEDED, times)

    def stop(self) -> None:
        """Do what the last cancel asked for."""
        request = self.cancels[-1][1]
        response = CancelGoal.Response(return_code=CancelGoal.Response.ERROR_NONE)
        response.goals_canceling = [GoalInfo(goal_id=UUID(uuid=list(self.key)))]
        request.answer(response)
        self.end(GoalStatus.STATUS_CANCELED)

    def result(self) -> Any:
        """Return the answer to a request for the result."""
        return NavigateToPose.Impl.GetResultService.Response(status=self.status)

    @property
    def place(self) -> tuple[float, float]:
        """Where the goal lies, x and y in metres."""
        position = self.sent.request.goal.pose.pose.position
        return position.x, position.y

    @property
    def drives(self) -> bool:
        """Whether the robot is on its way for this goal."""
        return self.accepted is not None and self.ended is None


class Base:
    """The action server `navigate_to_pose`; `plan` and `on_cancel` say how it behaves."""

    def __init__(self, ros: RosNode) -> None:
        self.drives: list[Drive] = []
        #: What is done with the next goals, one each; without a plan the robot arrives at once.
        self.plan: deque[Callable[[Drive], Any]] = deque()
        self.on_cancel: Callable[[Drive], Any] = Drive.stop
        action = f"{ACTION}/_action"
        self._status = ros.publisher(GoalStatusArray, f"{action}/status", Qos.LATCHED)
        self.feedback = ros.publisher(NavigateToPose.Impl.FeedbackMessage, f"{action}/feedback", Qos.EVENT)
        serve_by_hand(ros, NavigateToPose.Impl.SendGoalService, f"{action}/send_goal", self._on_goal)
        serve_by_hand(ros, NavigateToPose.Impl.GetResultService, f"{action}/get_result", self._on_ask)
        serve_by_hand(ros, CancelGoal, f"{action}/cancel_goal", self._on_cancel)

    def behave(self) -> None:
        """End whatever is left, and do as one should from now on."""
        self.plan.clear()
        self.on_cancel = Drive.stop
        for drive in self.drives:
            if drive.drives:
                drive.end(GoalStatus.STATUS_ABORTED)
            elif drive.ended is None:  # never answered: until it is, the node keeps the robot from new goals
                drive.reject()

    def tell(self) -> None:
        """Publish the status of all goals."""
        message = GoalStatusArray()
        for drive in self.drives:
            if drive.accepted is not None:
                status = GoalStatus(status=drive.status)
                status.goal_info.goal_id.uuid = list(drive.key)
                message.status_list.append(status)
        self._status.publish(message)

    def _on_goal(self, asked: Asked) -> None:
        drive = Drive(self, bytes(asked.request.goal_id.uuid), asked, time.monotonic())
        self.drives.append(drive)
        (self.plan.popleft() if self.plan else Drive.arrive_at_once)(drive)

    def _on_ask(self, asked: Asked) -> None:
        drive = self._find(asked.request.goal_id)
        if drive is None or drive.accepted is None:
            asked.answer(NavigateToPose.Impl.GetResultService.Response())
            return
        drive.asked.append(asked)
        if drive.ended is not None:
            asked.answer(drive.result())

    def _on_cancel(self, asked: Asked) -> None:
        drive = self._find(asked.request.goal_info.goal_id)
        if drive is not None and drive.drives:
            drive.cancels.append((time.monotonic(), asked))
            self.on_cancel(drive)
        elif any(asked.request.goal_info.goal_id.uuid):
            asked.answer(CancelGoal.Response(return_code=CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID))
        else:  # everything that drives; the node asks for that when it boots
            asked.answer(CancelGoal.Response())

    def _find(self, goal_id: UUID) -> Drive | None:
        return next((drive for drive in self.drives if drive.key == bytes(goal_id.uuid)), None)


class Bridge:
    """The service of readings; `plan` is what is done with the next calls, else they are answered at once."""

    def __init__(self, ros: RosNode) -> None:
        self.calls: list[Asked] = []
        self.plan: deque[Callable[[Asked], Any]] = deque()
        serve_by_hand(ros, GetTagReading, BRIDGE, self._on_call)

    def _on_call(self, asked: Asked) -> None:
        self.calls.append(asked)
        (self.plan.popleft() if self.plan else answer_reading)(asked)


def answer_reading(asked: Asked) -> None:
    """Answer with the tag's reading, whose value is the tag's number."""
    response = GetTagReading.Response(status=GetTagReading.Response.STATUS_OK)
    response.reading.tag_id = asked.request.tag_id
    response.reading.readings = [SensorReading(name="temperature", value=float(asked.request.tag_id))]
    asked.answer(response)


class Arm:
    """The service of presets: which were asked for, and when."""

    def __init__(self, ros: RosNode) -> None:
        self.presets: list[tuple[str, float]] = []
        ros.serve(SetArmPreset, "/lupin/arm/preset", self._on_preset)

    def _on_preset(self, request: Any, response: Any) -> Any:
        self.presets.append((request.name, time.monotonic()))
        response.success = True
        return response


def leave_open(_: Any) -> None:
    """Do nothing about a request."""


class Wire:
    """The orchestrator as a process, and everything that it talks to; fakes and rules of one test module."""

    def __init__(self, folder: Path, **parameters: Any) -> None:
        self.world = World(folder)
        self.operator = Operator("wire")
        ros = self.ros = self.operator.ros
        self.begun = 0.0
        self.wanted: dict[str, list[str]] = {}
        self._held: list[tuple[float, bool]] = []
        ros.subscribe(MissionState, "/mission/state", Qos.BACKLOG, self._on_state)
        self._estop = ros.publisher(Bool, "/e_stop_state", Qos.EVENT)
        self._battery = ros.publisher(BatteryState, "/io/power/power_watcher", Qos.EVENT)
        self._pose: Any = None
        self.localize()
        self._parameters = parameters
        #: Parameters that a test has changed, as they were before.
        self._before: dict[str, Any] = {}

    def offer_base(self) -> None:
        """Have the action server in this process."""
        self.base = Base(self.ros)

    def offer_bridge(self) -> None:
        """Have the bridge in this process."""
        self.bridge = Bridge(self.ros)

    def offer_arm(self) -> None:
        """Have the arm's presets in this process."""
        self.arm = Arm(self.ros)

    def start_node(self) -> None:
        """Start the orchestrator and wait until it hears us."""
        self.world.start("mission_orchestrator", **self._parameters)
        self.operator.in_state("READY")
        heard = (self._estop, self._battery)
        self.operator.until(lambda: all(p.get_subscription_count() for p in heard), "its subscriptions")

    def _on_state(self, state: MissionState) -> None:
        self._held.append((time.monotonic(), bool(state.paused or state.estop_engaged)))

    # --- what tests do

    def localize(self, x: float = 0.0, y: float = 0.0, variance: float = 0.0) -> None:
        """Tell where the robot is, and how sure that is."""
        if self._pose is None:
            self._pose = self.ros.publisher(PoseWithCovarianceStamped, "/amcl_pose", Qos.LATCHED)
        pose = PoseWithCovarianceStamped()
        pose.header.frame_id = "map"
        pose.pose.pose.position.x, pose.pose.pose.position.y = x, y
        pose.pose.pose.orientation.w = 1.0
        pose.pose.covariance[0] = pose.pose.covariance[7] = variance
        self._pose.publish(pose)

    def lose_localizer(self) -> None:
        """Let whoever told the pose be gone."""
        self.ros.node.destroy_publisher(self._pose)
        self._pose = None

    def configure(self, **values: Any) -> None:
        """Set parameters of the node until the end of the test; only where a mission could be started."""
        for name, value in values.items():
            service = "/mission_orchestrator/get_parameters"
            (old,) = self.operator.call(GetParameters, service, GetParameters.Request(names=[name])).values
            self._before.setdefault(name, parameter_value_to_python(old))
            self.operator.set_parameter("mission_orchestrator", name, value)

    def estop(self, *levels: bool) -> None:
        """Tell levels of the e-stop, one after the other."""
        for level in levels:
            self._estop.publish(Bool(data=level))

    def battery(self, *percentages: float) -> None:
        """Tell charges of the battery, one after the other."""
        for percentage in percentages:
            self._battery.publish(BatteryState(percentage=percentage, present=True))

    def start(self, *tags: str) -> str:
        """Start an inspection; return its id."""
        answer = self.operator.start(*tags)
        assert answer.accepted, answer.error_message
        self.wanted[answer.mission_id] = list(tags)
        return str(answer.mission_id)

    def ask(self, *requests: str) -> None:
        """Ask the node for what it must accept."""
        for request in requests:
            answer = self.operator.ask(request)
            assert answer.success, answer.message

    def charge(self) -> None:
        """Have a full battery again, and wait until the node knows."""
        self.battery(0.9)
        self.until(lambda: not self.operator.state.battery_low, "charged")

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Work until a condition holds."""
        self.operator.until(condition, what)

    def until_driving(self, number: int = 1) -> Drive:
        """Wait until so many goals of this test have come and the last of them drives; return that one."""
        self.until(lambda: len(self.drives) >= number and self.drives[number - 1].drives, f"drive {number}")
        return self.drives[number - 1]

    def until_held(self) -> None:
        """Wait until the node says that it is held."""
        self.until(lambda: self.operator.state.paused, "held")

    def until_docked(self) -> None:
        """Wait until the robot is at its dock, or has given it up, and waits for somebody who resumes."""
        self.until(
            lambda: self.operator.state.paused and self.operator.state.lifecycle_state == "RETURNING",
            "docked",
        )
        assert not any(drive.drives for drive in self.drives)

    def until_done(self, mission_id: str) -> None:
        """Wait until a mission has ended and its tags are told: two topics keep no order."""
        self.until(
            lambda: (
                self.operator.state.lifecycle_state == "DONE" and self.operator.state.mission_id == mission_id
            ),
            "the end of the mission",
        )
        tags = self.wanted.get(mission_id, [])
        self.until(lambda: len(self.outcomes(mission_id)) >= len(tags), "all observations")

    def until_later(self, seconds: float) -> None:
        """Let time pass: only to show that something does not happen."""
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() >= end, f"{seconds:g} s")

    def until_quiet(self) -> None:
        """Wait until the node has worked off what it was told: it repeats its state, and repeats it again."""

        def told(state: MissionState) -> tuple[Any, ...]:
            return tuple(getattr(state, name) for name in MissionState.get_fields_and_field_types())[1:]

        begun = len(self.operator.states)
        self.until(
            lambda: (
                len(self.operator.states) >= begun + 3
                and told(self.operator.states[-1])
                == told(self.operator.states[-2])
                == told(self.operator.states[-3])
            ),
            "nothing new",
        )

    @property
    def drives(self) -> list[Drive]:
        """The goals of this test."""
        return [drive for drive in self.base.drives if drive.arrived >= self.begun]

    def outcomes(self, mission_id: str) -> list[tuple[str, int]]:
        """Return the closed tags of a mission with their outcomes, in order."""
        mine = [o for o in self.operator.observations if o.mission_id == mission_id]
        return [(o.tag_reading.tag_id, o.status) for o in mine]

    def details(self, mission_id: str) -> list[str]:
        """Return the reasons of a mission's outcomes."""
        return [o.status_detail for o in self.operator.observations if o.mission_id == mission_id]

    # --- between tests

    def begin(self) -> None:
        """Come to rest: everybody behaves, nothing is low, pressed or paused, no mission runs."""
        if hasattr(self, "base"):
            self.base.behave()
        if hasattr(self, "bridge"):
            self.bridge.plan.clear()
            self.bridge.calls.clear()
        self.estop(False)
        self.battery(0.9)
        self.until(lambda: not (self.operator.state.estop_engaged or self.operator.state.battery_low), "calm")
        if self.operator.state.lifecycle_state not in ("READY", "DONE"):  # left by a test that failed
            self.operator.call(Trigger, "/mission/abort", Trigger.Request())
            self.operator.call(Trigger, "/mission/resume", Trigger.Request())
        self.until(lambda: self.operator.state.lifecycle_state in ("READY", "DONE"), "READY or DONE")
        if self.operator.state.paused:
            self.operator.call(Trigger, "/mission/resume", Trigger.Request())
        for name, value in self._before.items():
            self.operator.set_parameter("mission_orchestrator", name, value)
        self._before.clear()
        self.localize()
        self.begun = time.monotonic()
        self.wanted.clear()
        del self._held[:-1]

    def check(self) -> None:
        """Assert what must hold whatever the others did."""
        self._check_tags()
        if hasattr(self, "base"):
            self._check_drives()
        log = self.world.log("mission_orchestrator").read_text()
        assert [line for line in log.splitlines() if any(word in line for word in NEVER_LOGGED)] == []

    def _check_tags(self) -> None:
        """Every tag of every mission is closed exactly once, and the missions are over."""
        assert self.operator.state.lifecycle_state in ("READY", "DONE")
        for mission_id, tags in self.wanted.items():
            closed = Counter(tag for tag, _ in self.outcomes(mission_id))
            assert closed == dict.fromkeys(tags, 1)

    def _check_drives(self) -> None:
        """No goal is sent while the node is held, and none drives then without a cancel under way."""
        for begin, end in held_spans(self._held, time.monotonic()):
            for drive in self.drives:
                assert not begin + AT_ONCE < drive.arrived < end - AT_ONCE, "a goal was sent while held"
                if drive.accepted is None:
                    continue
                stopped = min([at for at, _ in drive.cancels] + [drive.ended or end])
                drove = min(stopped, end) - max(begin, drive.accepted)
                assert drove < AT_ONCE, f"drove for {drove:.2f} s while held"

    def close(self) -> None:
        """End everything; whoever had to be killed is a failure."""
        stubborn = self.world.stop()
        self.operator.ros.close()
        assert stubborn == []


@contextmanager
def running_node(folder: Path, **parameters: Any) -> Iterator[Wire]:
    """Start the node with a base and a bridge beside it; end all of them after the tests of a module."""
    wire = Wire(folder, **parameters)
    wire.offer_base()
    wire.offer_bridge()
    wire.start_node()
    yield wire
    wire.close()


def held_spans(told: Sequence[tuple[float, bool]], now: float) -> Iterator[tuple[float, float]]:
    """Yield the times, from and to, in which the node said that it was held."""
    begin: float | None = None
    for at, held in told:
        if held and begin is None:
            begin = at
        elif not held and begin is not None:
            yield begin, at
            begin = None
    if begin is not None:
        yield begin, now
