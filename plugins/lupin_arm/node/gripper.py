"""Sends goals to the jaw's action server. The vendor's own service must not be used beside it: both fight."""

from __future__ import annotations

from collections.abc import Callable

from action_msgs.msg import GoalStatus
from control_msgs.action import GripperCommand

from lupin_arm.joints import JAW_EFFORT, jaw_to_degrees
from lupin_arm.node.torque import Done
from lupin_arm.node.waiting import when_ready
from lupin_ros.adapter import Goal, GoalCallbacks, RosNode

#: Seconds that a command waits for the jaw's controller to be there.
PATIENCE_S = 2.0


class Gripper:
    """Sends goals to the jaw; their results are only logged."""

    def __init__(self, ros: RosNode, action: str) -> None:
        self._ros = ros
        self._action = ros.action(GripperCommand, action)
        self._goal: Goal | None = None
        self._cancelling = False
        self._stops = 0

    def move(self, angle: float, refusal: Callable[[], str | None], done: Done) -> None:
        """Send the jaw to an angle of its joint; `done(None)` when sent, else `done(reason)`.

        It waits up to `PATIENCE_S` for the server; `refusal` is asked again then. `stop` drops a waiting
        command.
        """
        stops = self._stops

        def found(there: bool) -> None:
            reason = "stopped meanwhile" if stops != self._stops else refusal()
            if not there:
                done(f"{self._action.name}: no action server within {PATIENCE_S:g} s")
            elif reason is not None:
                done(reason)
            else:
                self._send(angle)
                done(None)

        when_ready(self._ros, self._action.ready, PATIENCE_S, found)

    def stop(self) -> None:
        """Stop the jaw; a command that waits for the server is dropped."""
        self._stops += 1
        if self._goal is not None:
            self._cancelling = True
            self._goal.cancel()

    def _send(self, angle: float) -> None:
        goal = GripperCommand.Goal()
        goal.command.position = angle
        goal.command.max_effort = JAW_EFFORT
        self._cancelling = False

        def accepted() -> None:
            if self._cancelling or sent is not self._goal:
                sent.cancel()

        def ended(status: int, _: object) -> None:
            self._ended(sent, angle, "" if status == GoalStatus.STATUS_SUCCEEDED else f"ended as {status}")

        sent = self._goal = self._action.send(
            goal,
            GoalCallbacks(
                accepted=accepted, ended=ended, rejected=lambda: self._ended(sent, angle, "rejected")
            ),
        )

    def _ended(self, goal: Goal, angle: float, problem: str) -> None:
        if goal is not self._goal:
            return  # another one took its place
        self._goal = None
        if problem and not self._cancelling:
            place = round(jaw_to_degrees(angle), 1)
            self._ros.log.warning(f"the jaw may not be where it was sent: {problem}", degrees=place)
