"""The watchdog of navigation at a server that refuses to end a goal: a refusal is no end."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionServer, CancelResponse
from rclpy.task import Future
from std_msgs.msg import Bool

from lupin_nav.node import PARAMETERS, NavWatchdog
from lupin_ros.adapter.node import GoalCallbacks, Qos, RosNode
from tests.lupin_ros.helpers import spin_until

pytestmark = pytest.mark.timeout(60)


class Refusing:
    """A plain rclpy server that agrees to no cancel before the third."""

    def __init__(self, ros: RosNode) -> None:
        self.asked = 0
        self.running = 0
        self._end = Future()
        self._server = ActionServer(
            ros.node, NavigateToPose, "navigate_to_pose", self._execute, cancel_callback=self._cancel
        )

    async def _execute(self, handle: Any) -> NavigateToPose.Result:
        self.running += 1
        await self._end
        self.running -= 1
        handle.canceled()
        return NavigateToPose.Result()

    def _cancel(self, _: Any) -> CancelResponse:
        self.asked += 1
        if self.asked < 3:
            return CancelResponse.REJECT
        self._end.set_result(None)
        return CancelResponse.ACCEPT

    def close(self) -> None:
        self._server.destroy()


def test_a_refusal_is_repeated_also_when_the_stop_is_let_go(make_node: Callable[..., RosNode]) -> None:
    watchdog, robot, client = make_node("nav_watchdog", (), PARAMETERS), make_node("robot"), make_node("rviz")
    server = Refusing(robot)
    NavWatchdog(watchdog)
    stop = client.publisher(Bool, "/e_stop_state", Qos.EVENT)
    navigation = client.action(NavigateToPose, "navigate_to_pose")
    nodes = (watchdog, robot, client)
    spin_until(nodes, lambda: navigation.ready() and stop.get_subscription_count() == 1, what="all are there")
    ended: list[int] = []
    navigation.send(
        NavigateToPose.Goal(),
        GoalCallbacks(ended=lambda status, _: ended.append(status), rejected=lambda: ended.append(0)),
    )
    spin_until(nodes, lambda: server.running == 1, what="the goal")
    stop.publish(Bool(data=True))
    spin_until(nodes, lambda: server.asked == 1, what="the first cancel")
    stop.publish(Bool(data=False))
    spin_until(nodes, lambda: ended == [5], what="the end of the goal")
    assert server.asked == 3
    server.close()
