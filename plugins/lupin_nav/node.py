"""The node `nav_watchdog`: cancels Nav2's goals under a stop, and when their sender falls silent.

Nav2 follows a goal to its end even if the client is dead, and after a stop's release it would go on. So while
a stop is engaged every goal is cancelled, repeatedly, new ones too. The node watches the orchestrator while a
mission is active, and the gateway, which cannot cancel its pages' goals after it was killed. It belongs on
Nav2's computer: elsewhere a broken link would silence the watchdog too. The simulated base needs it as well.
"""

from __future__ import annotations

from collections.abc import Sequence

from action_msgs.msg import GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from std_msgs.msg import Bool

from lupin_engine.plugin import DURATION, ROS_NAME, Parameter
from lupin_greenhouse import (
    PAGES_TOPIC,
    WATCHDOG_PARAMETERS,
    WATCHDOG_TIMEOUT,
    WATCHED,
    SilenceWatchdog,
    StopListener,
    StopState,
    is_under_way,
)
from lupin_msgs.msg import MissionState
from lupin_ros.adapter import CallFailure, Qos, Repeater, RosNode

#: Seconds between two cancels, and how long the answer to one may take.
PERIOD_S = 0.5
#: Seconds of silence after which the gateway, which speaks five times a second, counts as gone.
GATEWAY_TIMEOUT_S = 1.5
#: The status of goals that nobody has agreed to end.
_DRIVING = (GoalStatus.STATUS_ACCEPTED, GoalStatus.STATUS_EXECUTING)

PARAMETERS = {
    "nav_action_name": Parameter(ROS_NAME, "navigate_to_pose", "action server of Nav2"),
    "estop_topic": Parameter(ROS_NAME, "/e_stop_state", "topic of the emergency stop, true while engaged"),
    "estop_timeout_s": Parameter(
        DURATION,
        2.0,
        "an emergency stop that was told steadily and is silent for so long counts as engaged; 0: never",
        maximum=60.0,
    ),
    **WATCHDOG_PARAMETERS,
}


class NavWatchdog:
    """Cancels the action's goals while a stop is engaged, and those of a silent orchestrator or gateway.

    Cancelled are the goals accepted until now (until the release, or until the silence was noticed);
    cancelling is repeated until the server has agreed for each of them.
    """

    def __init__(self, ros: RosNode) -> None:
        self._ros = ros
        values = ros.parameters()
        self._action = values["nav_action_name"]
        self._cancel = ros.service(CancelGoal, f"{self._action}/_action/cancel_goal")
        self._cancelling = Repeater(ros.steady_timer, PERIOD_S, self._send)
        every, timeout = ros.steady_timer, values[WATCHDOG_TIMEOUT]
        self._watchdog = SilenceWatchdog(every, timeout, self._end_goals, WATCHED)
        self._gateway = SilenceWatchdog(
            every, min(timeout, GATEWAY_TIMEOUT_S), self._on_silent_gateway, "the gateway of the pages"
        )
        self._mission_drives = False
        self._stopped = False
        #: Until when goals that end were accepted; all zeros: until now.
        self._until = CancelGoal.Request().goal_info.stamp
        #: The goals that the server drives to, each with the time at which it was accepted.
        self._driving: dict[bytes, tuple[int, int]] = {}
        ros.subscribe(GoalStatusArray, f"{self._action}/_action/status", Qos.LATCHED, self._on_status)
        ros.subscribe(
            MissionState,
            "/mission/state",
            Qos.LATCHED,
            self._on_mission,
        )
        ros.subscribe(Bool, PAGES_TOPIC, Qos.LATCHED, lambda _: self._gateway.heard(True))
        StopListener(ros, values["estop_topic"], values["estop_timeout_s"], self._on_stop)
        ros.on_inactive(hindrance=self._what_moves)

    def _what_moves(self) -> str:
        if self._mission_drives:
            return "a mission drives: pause it first"
        served = self._ros.node.count_publishers(f"{self._action}/_action/status")
        return f"{self._action} has a goal: cancel it first" if self._driving and served else ""

    def _on_mission(self, message: MissionState) -> None:
        is_one = is_under_way(message.lifecycle_state)
        self._mission_drives = is_one and not message.paused
        self._watchdog.heard(is_one)

    def _on_silent_gateway(self, reason: str) -> None:
        """Cancel its pages' goals, unless a mission drives or the gateway ended in order."""
        if self._ros.count_publishers(PAGES_TOPIC) and not self._mission_drives:
            self._end_goals(reason)

    def _on_stop(self, state: StopState) -> None:
        before, self._stopped = self._stopped, state.engaged
        if before != self._stopped:
            self._end_goals("the stop is engaged" if self._stopped else "the stop was engaged until now")

    def _on_status(self, message: GoalStatusArray) -> None:
        goals = [one.goal_info for one in message.status_list if one.status in _DRIVING]
        self._driving = {bytes(one.goal_id.uuid): (one.stamp.sec, one.stamp.nanosec) for one in goals}

    def _end_goals(self, reason: str) -> None:
        self._ros.log.warning("all goals are cancelled", action=self._action, reason=reason)
        self._until = self._ros.stamp()
        self._cancelling.start()
        self._send()

    def _send(self) -> None:
        request = CancelGoal.Request()  # without an id: every goal that was accepted until the stamp
        if not self._stopped:
            request.goal_info.stamp = self._until
        self._cancel.call(request, PERIOD_S, self._on_answer)

    def _on_answer(self, answer: CancelGoal.Response | CallFailure) -> None:
        if isinstance(answer, CallFailure):
            self._ros.log.error("no answer to the cancel: the robot may drive on", action=self._action)
        elif answer.return_code == CancelGoal.Response.ERROR_REJECTED or self._left_out(answer):
            self._ros.log.error("the cancel is refused: the robot may drive on", action=self._action)
        elif not self._stopped:
            self._cancelling.stop()

    def _left_out(self, answer: CancelGoal.Response) -> bool:
        """Return whether goals go on: an rclpy server omits a goal that it refuses to cancel."""
        until = (self._until.sec, self._until.nanosec)
        to_end = {goal for goal, at in self._driving.items() if self._stopped or at <= until}
        return bool(to_end.difference(bytes(one.goal_id.uuid) for one in answer.goals_canceling))


def main(arguments: Sequence[str]) -> int:
    """Run the node until it is stopped; `arguments` are the ROS arguments."""
    with RosNode("nav_watchdog", arguments, PARAMETERS, managed=True) as ros:
        NavWatchdog(ros)
        ros.spin()
    return 0
