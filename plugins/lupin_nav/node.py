"""The node `nav_watchdog`: ends what navigation drives for an orchestrator that is silent, or under a stop.

Nav2 follows a goal to its end, whoever sent it and whether he lives. A mission that is stopped cancels its
own; a drive that somebody clicked would go on as soon as the stop is released, so it is cancelled here. This
node belongs on the computer of Nav2: from any other one a broken link silences the watchdog too.
"""

from __future__ import annotations

from collections.abc import Sequence

from action_msgs.srv import CancelGoal

from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.types import ROS_NAME
from lupin_engine.ros.adapter.host import Repeater
from lupin_engine.ros.adapter.node import CallFailure, Qos, RosNode
from lupin_greenhouse.mission import is_under_way
from lupin_greenhouse.node import watchdog
from lupin_greenhouse.node.watchdog import OrchestratorWatchdog
from lupin_msgs.msg import MissionState

#: How long an answer to a cancel may take until it is sent again, in seconds.
ANSWER_S = 0.5

PARAMETERS = {
    "nav_action_name": Parameter(ROS_NAME, "navigate_to_pose", "action server of Nav2"),
    **watchdog.PARAMETERS,
}


class NavWatchdog:
    """Cancels every goal of the action, again and again until the server has answered."""

    def __init__(self, ros: RosNode) -> None:
        self._ros = ros
        values = ros.parameters()
        self._action = values["nav_action_name"]
        self._cancel = ros.service(CancelGoal, f"{self._action}/_action/cancel_goal")
        self._cancelling = Repeater(ros.steady_timer, ANSWER_S, self._send)
        self._watchdog = OrchestratorWatchdog(ros.steady_timer, values[watchdog.TIMEOUT], self._end_goals)
        self._stopped = False
        ros.subscribe(MissionState, "/mission/state", Qos.LATCHED, self._on_state)

    def _on_state(self, message: MissionState) -> None:
        self._cancelling.stop()  # the orchestrator looks after its goals itself
        self._watchdog.heard(message.lifecycle_state)
        before, self._stopped = self._stopped, message.estop_engaged
        if self._stopped and not before and not is_under_way(message.lifecycle_state):
            self._end_goals("the stop is engaged")

    def _end_goals(self, reason: str) -> None:
        self._ros.log.warning("all goals are cancelled", action=self._action, reason=reason)
        self._cancelling.start()
        self._send()

    def _send(self) -> None:
        self._cancel.call(CancelGoal.Request(), ANSWER_S, self._on_answer)  # without id and time: all goals

    def _on_answer(self, answer: CancelGoal.Response | CallFailure) -> None:
        if isinstance(answer, CallFailure):
            self._ros.log.error("no answer to the cancel: the robot may drive on", action=self._action)
        elif answer.return_code == CancelGoal.Response.ERROR_REJECTED:
            self._ros.log.error("the cancel is refused: the robot may drive on", action=self._action)
        else:
            self._cancelling.stop()


def main(arguments: Sequence[str]) -> int:
    """Run the node until it is told to stop; `arguments` are the ROS arguments."""
    with RosNode("nav_watchdog", arguments, PARAMETERS) as ros:
        NavWatchdog(ros)
        ros.spin()
    return 0
