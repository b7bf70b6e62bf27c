"""The simulated robot as a node: pose, sensors, battery, stop, and the action `navigate_to_pose`.

A stop brakes the robot and does not end its goal: it drives on when the stop is released. A new goal aborts
the one before, as in Nav2; a goal is also aborted when the mission's node falls silent (the watchdog).
A 5 Hz heartbeat publishes; a faster timer moves the robot only while it drives. No callback blocks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import (
    PoseStamped,
    PoseWithCovarianceStamped,
    Transform,
    TransformStamped,
    Twist,
    Vector3,
)
from nav2_msgs.action import NavigateToPose
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage

from lupin_engine.errors import LupinError, Problems
from lupin_engine.plugin import BOOL, COUNT, NUMBER, POSE, TEXT, Parameter, number_in, one_of, time_fields
from lupin_greenhouse import (
    WATCHDOG_PARAMETERS,
    WATCHDOG_TIMEOUT,
    WATCHED,
    SilenceWatchdog,
    StopListener,
    heading,
    is_under_way,
)
from lupin_msgs.msg import MissionState
from lupin_ros.adapter import Qos, Repeater, RosNode, ServedGoal
from lupin_sim.faults import Faults, InjectedFault
from lupin_sim.floor import Floor
from lupin_sim.layout import load_layout
from lupin_sim.node import senses
from lupin_sim.node.display import Display, quaternion
from lupin_sim.node.senses import Senses
from lupin_sim.robot import FloorPose, Robot

#: Seconds between two heartbeats (e-stop, transforms), and heartbeats between two battery messages.
HEARTBEAT_S = 0.2
BEATS_PER_BATTERY = 5
#: Seconds between two poses while standing still or driving.
POSE_PERIOD_S = 0.5
#: Seconds between two movements, and movements between two feedbacks and two plans.
MOVE_S = 0.05
MOVES_PER_FEEDBACK = 2
MOVES_PER_PLAN = 20
#: Metres between two looks around while driving; a fast robot looks more often, not less carefully. After a
#: standstill of so many seconds (a clock that jumps) the looks in between are left out.
LOOK_M = 0.1
LOOKS_WITHIN_S = 1.0

#: Movements for which it stands at its goal, looking, before it says that it has arrived: as with Nav2, whose
#: goal checkers see a robot stop, its camera has shown by then what it stands before.
MOVES_STANDING = 4

#: Seconds for which a velocity by hand is obeyed, as controllers of bases do it.
TWIST_S = 0.5

#: Variance of x, y (m²) and yaw (rad²) of a localized and of a lost robot, and its growth between two poses.
VARIANCE, LOST_VARIANCE, LOSING = 0.01, 4.0, 4.0
#: Variance of what a robot on a floor does not know: z, roll and pitch.
UNKNOWN_VARIANCE = 1e6

#: The battery: three cells of lithium in a row, and what the robot takes from them.
EMPTY_V, FULL_V = 9.0, 12.6
CURRENT_A, CAPACITY_AH, TEMPERATURE_C = 1.5, 5.0, 25.0

#: Result code of Nav2's planner for "no path".
NO_VALID_PATH = 208

#: Parameters that take effect while the node runs.
LIVE = ("speed", "estop", "battery", "drain_per_s", "fault", "fault_count")

_FAULTS = one_of(*(fault.value for fault in InjectedFault))

PARAMETERS = {
    "tag_locations_file": Parameter(TEXT, "", "layout of the simulated greenhouse; empty: the bundled one"),
    "start_pose": Parameter(POSE, {"x": 0.5, "y": 0.5, "yaw": 0.0}, "where the robot stands at the start"),
    "speed": Parameter(number_in("m/s"), 0.5, "driving speed", minimum=0.01, maximum=10.0),
    "estop": Parameter(BOOL, False, "whether the emergency stop is engaged, besides those of pages and HMIs"),
    "battery": Parameter(NUMBER, 1.0, "charge of the battery, 0 to 1; setting it sets the level", 0.0, 1.0),
    "drain_per_s": Parameter(NUMBER, 0.0, "charge that the battery loses in a second", minimum=0.0),
    "fault": Parameter(_FAULTS, InjectedFault.NONE.value, "what goes wrong"),
    "fault_count": Parameter(COUNT, 0, "goals that the fault hits; 0: until it is changed. Set it first"),
    **WATCHDOG_PARAMETERS,
    **senses.PARAMETERS,
}


def check(values: Mapping[str, Any]) -> None:
    """Check that the parameters describe a greenhouse.

    Raises:
        LupinError: all errors.
    """
    problems = Problems()
    with problems.collecting():
        load_layout(values["tag_locations_file"])
    with problems.collecting():
        senses.places(values["pests"])
    problems.raise_any()


class SimNode:
    """Publishes the robot's sensors, and drives to the goals of `navigate_to_pose`."""

    def __init__(self, ros: RosNode) -> None:
        self._ros = ros
        values = ros.parameters()
        layout = load_layout(values["tag_locations_file"])
        self._floor = Floor(layout.tables)
        self._robot = Robot(FloorPose(**values["start_pose"]), ros.elapsed(), values["speed"])
        self._believed = self._robot.pose
        self._variance = VARIANCE
        self._faults = Faults()
        self._fault_count: int = values["fault_count"]
        self._correcting_fault = False
        self._estop_parameter = False
        self._goal: ServedGoal | None = None
        self._goal_began = 0.0
        self._moving = Repeater(ros.timer, MOVE_S, self._move)
        self._moves = 0
        self._standing = 0
        self._beats = 0
        self._next_pose = ros.elapsed()
        self._next_look = ros.elapsed()
        timeout = values[WATCHDOG_TIMEOUT]
        self._watchdog = SilenceWatchdog(ros.steady_timer, timeout, self._lost, WATCHED)
        self._connect()
        self._senses = Senses(ros, layout, values, self._publish_transforms)
        ros.subscribe(MissionState, "/mission/state", Qos.LATCHED, self._on_mission)
        self._senses.look(self._robot.pose)
        reason = self._change({name: values[name] for name in LIVE})
        if reason is not None:
            raise LupinError(reason)

    def _connect(self) -> None:
        ros = self._ros
        self._poses = ros.publisher(PoseWithCovarianceStamped, "/amcl_pose", Qos.LATCHED)
        self._transforms = ros.publisher(TFMessage, "/tf", Qos.EVENT)
        self._batteries = ros.publisher(BatteryState, "/io/power/power_watcher", Qos.EVENT)
        self._estops = ros.publisher(Bool, "/e_stop_state", Qos.EVENT)
        self._stops = StopListener(ros, "", 0.0, lambda _: self._on_stop())
        ros.serve_action(
            NavigateToPose,
            "navigate_to_pose",
            admit=self._admit,
            started=self._start,
            cancelled=self._cancel,
        ).refuses = lambda _: self._faults.now(InjectedFault.REFUSE_CANCEL)
        ros.subscribe(Twist, "/cmd_vel", Qos.EVENT, self._on_twist)
        self._display = Display(ros)
        ros.on_parameter(self._change)
        ros.on_stop(lambda: self._end_goal("aborted", "the simulated robot is switched off"))
        ros.timer(HEARTBEAT_S, self._beat)

    # --- settings -----------------------------------------------------------------------------------------

    def _change(self, values: Mapping[str, Any]) -> str | None:
        """Apply new values of parameters in `LIVE`; return why not, None where that is done."""
        fixed = [name for name in values if name not in LIVE]
        if fixed:
            return f"{', '.join(fixed)}: read at the start of the node only"
        if self._correcting_fault:
            return None  # no new wish: the parameter is being told what is so
        self._advance()
        self._robot.speed = values.get("speed", self._robot.speed)
        self._robot.charge = values.get("battery", self._robot.charge)
        self._robot.drain_per_s = values.get("drain_per_s", self._robot.drain_per_s)
        self._estop_parameter = values.get("estop", self._estop_parameter)
        self._fault_count = values.get("fault_count", self._fault_count)
        if "fault" in values:
            fault = InjectedFault(values["fault"])
            self._faults.set(fault, self._fault_count, goal_running=self._goal is not None)
            self._show_used_up_fault(fault)
        self._settle()
        if "battery" in values:
            self._publish_battery()
        return None

    def _show_used_up_fault(self, before: InjectedFault) -> None:
        """Set the parameter to `none` once the fault has hit its last goal."""
        if self._faults.kind is before:
            return

        def show() -> None:
            if self._faults.kind is InjectedFault.NONE:
                self._correcting_fault = True
                try:
                    self._ros.set_parameter("fault", InjectedFault.NONE.value)
                finally:
                    self._correcting_fault = False

        self._ros.post(show)

    def _on_stop(self) -> None:
        """Brake, or drive on: the stop of pages and HMIs has changed."""
        self._advance()
        self._settle()

    def _on_mission(self, message: MissionState) -> None:
        self._watchdog.heard(is_under_way(message.lifecycle_state))
        self._senses.hear_mission(message.mission_id)

    @property
    def _estop(self) -> bool:
        return self._estop_parameter or self._stops.engaged

    def _on_twist(self, message: Twist) -> None:
        """Follow a velocity command, unless the robot is stopped or drives to a goal."""
        forward, left = message.linear.x, message.angular.z
        if self._estop or self._goal is not None or not (math.isfinite(forward) and math.isfinite(left)):
            return
        self._advance()
        self._robot.obey(forward, left, self._ros.elapsed() + TWIST_S)
        self._moving.start()

    def _settle(self) -> None:
        """Apply a change to the brake, and publish it."""
        if self._estop and self._goal is None:
            self._robot.halt()  # a velocity from before the stop is not obeyed after it
        self._robot.braked = self._estop or self._faults.now(InjectedFault.STALL)
        self._display.stop(self._estop)
        self._publish_estop()
        self._publish_pose()

    # --- the goal -----------------------------------------------------------------------------------------

    def _admit(self, goal: NavigateToPose.Goal) -> bool:
        frame, place = goal.pose.header.frame_id, goal.pose.pose.position
        numbers = (place.x, place.y, heading(goal.pose.pose.orientation))
        if frame not in ("map", "") or not all(map(math.isfinite, numbers)):
            self._ros.log.warning("goal rejected: not a pose in frame map", frame=frame, pose=numbers)
            return False
        before = self._faults.kind
        fault = self._faults.take()
        self._show_used_up_fault(before)
        return fault is not InjectedFault.REJECT

    def _start(self, served: ServedGoal) -> None:
        self._advance()
        if self._goal is not None:
            # As Nav2 does: the new goal wins, the old one is aborted.
            self._goal.abort(NavigateToPose.Result(error_msg="preempted by a new goal"))
        self._goal, self._goal_began = served, self._ros.elapsed()
        self._next_look = self._goal_began
        target = served.request.pose.pose
        here = self._robot.pose
        path = self._floor.path((here.x, here.y), (target.position.x, target.position.y))
        if path is None:
            self._end_goal("aborted", "no path", NO_VALID_PATH)
            return
        self._robot.follow(path, heading(target.orientation))
        self._standing = 0
        self._settle()
        self._publish_plan(served)
        if not self._moving.running:
            self._moves = 0
            self._moving.start()

    def _move(self) -> None:
        self._advance()
        self._moves += 1
        if self._goal is None:
            self._roll_on()
        elif self._faults.now(InjectedFault.ABORT):
            self._end_goal("aborted", "fault: abort")
        elif self._robot.arrived:
            self._stand()
        else:
            self._publish_transforms()
            if self._moves % MOVES_PER_FEEDBACK == 0:
                self._goal.feedback(self._feedback())
            if self._moves % MOVES_PER_PLAN == 0:
                self._publish_plan(self._goal)

    def _roll_on(self) -> None:
        """Publish the pose while the robot follows a velocity, and when that ends."""
        self._publish_transforms()
        if not self._robot.by_hand:
            self._moving.stop()
            self._publish_pose()

    def _stand(self) -> None:
        """Look ahead a few times at the goal; then the robot has arrived."""
        self._standing += 1
        if self._standing < MOVES_STANDING:
            self._senses.look(self._robot.pose)
        else:
            self._end_goal("succeeded")

    def _publish_plan(self, served: ServedGoal) -> None:
        self._display.publish_plan(self._robot.path, heading(served.request.pose.pose.orientation))

    def _advance(self) -> None:
        """Move the robot to the present time, and look around on the way."""
        now = self._ros.elapsed()
        self._next_look = max(self._next_look, now - LOOKS_WITHIN_S)
        while self._goal is not None and self._next_look <= now:
            self._robot.advance(self._next_look)
            self._senses.look(self._robot.pose)
            self._next_look += LOOK_M / self._robot.speed
        self._robot.advance(now)

    def _cancel(self, served: ServedGoal) -> None:
        if served is self._goal:
            self._end_goal("canceled", "cancelled by the client")

    def _lost(self, reason: str) -> None:
        """Abort the goal: the watchdog has not heard the mission's node for too long."""
        if self._goal is not None:
            self._advance()
            self._ros.log.warning("the robot stops", reason=reason)
            self._end_goal("aborted", reason)

    def _end_goal(self, how: str, message: str = "", code: int = 0) -> None:
        """End the running goal, if any, and stand still."""
        served, self._goal = self._goal, None
        if served is None:
            return
        self._moving.stop()
        self._robot.halt()
        self._faults.goal_ended()
        # Pose and map go out before the result, so whoever waits for the result knows them.
        self._settle()
        self._senses.look(self._robot.pose)
        self._senses.publish_map()
        end = {"succeeded": served.succeed, "aborted": served.abort, "canceled": served.cancel}[how]
        end(NavigateToPose.Result(error_code=code, error_msg=message))

    def _feedback(self) -> NavigateToPose.Feedback:
        feedback = NavigateToPose.Feedback()
        feedback.current_pose = self._pose_message(self._believed)
        feedback.navigation_time = Duration(**time_fields(self._ros.elapsed() - self._goal_began))
        feedback.estimated_time_remaining = Duration(**time_fields(self._robot.remaining / self._robot.speed))
        feedback.distance_remaining = self._robot.remaining
        return feedback

    # --- published messages ------------------------------------------------------------------------------

    def _beat(self) -> None:
        self._advance()
        self._publish_estop()
        if self._goal is None:
            self._senses.look(self._robot.pose)
        if self._ros.elapsed() >= self._next_pose:
            if self._faults.now(InjectedFault.LOSE_LOCALIZATION):
                self._variance = min(LOST_VARIANCE, self._variance * LOSING)
            self._publish_pose()
        if self._beats % BEATS_PER_BATTERY == 0:
            self._publish_battery()
        self._beats += 1

    def _publish_pose(self) -> None:
        # From here on, so that a pose that was sent on arrival is not repeated at once.
        self._next_pose = self._ros.elapsed() + POSE_PERIOD_S - HEARTBEAT_S / 2
        if not self._faults.now(InjectedFault.LOSE_LOCALIZATION):
            self._believed, self._variance = self._robot.pose, VARIANCE
        message = PoseWithCovarianceStamped()
        stamped = self._pose_message(self._believed)
        message.header, message.pose.pose = stamped.header, stamped.pose
        diagonal = [self._variance] * 2 + [UNKNOWN_VARIANCE] * 3 + [self._variance]
        for axis, variance in enumerate(diagonal):
            message.pose.covariance[axis * 7] = variance
        self._poses.publish(message)

    def _publish_transforms(self, sensed: Sequence[TransformStamped] = ()) -> None:
        """Publish the robot's pose and its sensed transforms with one stamp."""
        transforms = [_transform("odom", "base_link", self._robot.pose), *sensed]
        if not self._faults.now(InjectedFault.LOSE_LOCALIZATION):
            transforms.insert(0, _transform("map", "odom", FloorPose(0.0, 0.0, 0.0)))
        stamp = self._ros.stamp()
        for transform in transforms:
            transform.header.stamp = stamp
        self._transforms.publish(TFMessage(transforms=transforms))

    def _publish_battery(self) -> None:
        message = BatteryState(percentage=self._robot.charge, present=True)
        message.header.stamp = self._ros.stamp()
        message.power_supply_status = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
        message.voltage = EMPTY_V + (FULL_V - EMPTY_V) * self._robot.charge
        message.current = -CURRENT_A
        message.capacity = message.design_capacity = CAPACITY_AH
        message.charge = CAPACITY_AH * self._robot.charge
        message.temperature = TEMPERATURE_C
        self._batteries.publish(message)

    def _publish_estop(self) -> None:
        self._estops.publish(Bool(data=self._estop))

    def _pose_message(self, pose: FloorPose) -> PoseStamped:
        message = PoseStamped()
        message.header.stamp = self._ros.stamp()
        message.header.frame_id = "map"
        message.pose.position.x, message.pose.position.y = pose.x, pose.y
        message.pose.orientation = quaternion(pose.yaw)
        return message


def _transform(parent: str, child: str, pose: FloorPose) -> TransformStamped:
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id = parent
    message.transform = Transform(
        translation=Vector3(x=pose.x, y=pose.y, z=0.0), rotation=quaternion(pose.yaw)
    )
    return message


def main(arguments: Sequence[str]) -> int:
    """Run the node until it is stopped; `arguments` are the ROS arguments."""
    with RosNode("lupin_sim", arguments, PARAMETERS) as ros:
        SimNode(ros)
        ros.spin()
    return 0
