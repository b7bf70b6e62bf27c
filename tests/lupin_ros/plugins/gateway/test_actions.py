"""Goals of a page: feedback, result, cancel; servers that reject, hang or die; a page that goes away."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from nav2_msgs.action import NavigateToPose

from lupin_ros.adapter.node import RosNode, ServedGoal
from tests.lupin_ros.plugins.gateway.page import Page

pytestmark = [pytest.mark.node, pytest.mark.timeout(120)]

ACTION, TYPE = "/navigate_to_pose", "nav2_msgs/NavigateToPose"
GOAL = {"pose": {"header": {"frame_id": "map"}, "pose": {"position": {"x": 1.5}}}}
NOTHING_WRONG = {"error_code": 0, "error_msg": ""}
OpenPage = Callable[..., Page]


class Server:
    """An action server: takes what is given to it, and a test ends it."""

    def __init__(self, ros: RosNode, admits: bool = True) -> None:
        self.goals: list[ServedGoal] = []
        self.asked_to_cancel: list[ServedGoal] = []
        ros.serve_action(
            NavigateToPose,
            ACTION,
            admit=lambda goal: admits,
            started=self.goals.append,
            cancelled=self.asked_to_cancel.append,
        )


@pytest.mark.core
def test_feedback_and_result(
    gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """As rosbridge has them: the values of both."""
    ros = make_node("nav")
    server = Server(ros)
    one = page(gateway(), ros)
    number = one.begin("goal", ACTION, TYPE, GOAL)
    one.until(lambda: server.goals, "the goal")
    assert server.goals[0].request.pose.pose.position.x == 1.5
    server.goals[0].feedback(NavigateToPose.Feedback(distance_remaining=2.5))
    assert one.until(lambda: one.of("feedback"), "feedback")[0]["msg"]["distance_remaining"] == 2.5
    server.goals[0].succeed(NavigateToPose.Result())
    assert one.answer(number) == {"event": "answer", "n": number, "ok": True, "value": NOTHING_WRONG}


def test_cancel(gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]) -> None:
    """By the id of the goal, and all of them by the service of the action, as STOP does."""
    ros = make_node("nav")
    server = Server(ros)
    one = page(gateway(), ros)
    number = one.begin("goal", ACTION, TYPE, GOAL)
    one.until(lambda: server.goals, "the goal")
    one.do("cancel", n=number)
    one.until(lambda: server.asked_to_cancel, "the cancel")
    server.goals[0].cancel(NavigateToPose.Result())
    answer = one.answer(number)
    assert not answer["ok"]
    assert "Action was canceled" in answer["value"]
    number = one.begin("goal", ACTION, TYPE, GOAL)
    one.until(lambda: len(server.goals) == 2, "the second goal")
    everything = {"goal_info": {"goal_id": {"uuid": [0] * 16}, "stamp": {"sec": 0, "nanosec": 0}}}
    told = one.call(f"{ACTION}/_action/cancel_goal", "action_msgs/CancelGoal", everything)
    assert told["return_code"] == 0
    assert len(told["goals_canceling"]) == 1
    one.until(lambda: len(server.asked_to_cancel) == 2, "the cancel of all")
    server.goals[1].cancel(NavigateToPose.Result())
    assert not one.answer(number)["ok"]


@pytest.mark.parametrize(
    ("serves", "goal", "text"),
    [
        ("nothing", GOAL, "/navigate_to_pose: nobody serves this action now"),
        ("no goal", GOAL, "/navigate_to_pose: the goal was rejected"),
        (
            "goals",
            {"pos": {}},
            "/navigate_to_pose: pos: nav2_msgs/action/NavigateToPose.Goal has no such field; "
            "did you mean 'pose'?",
        ),
    ],
)
def test_goals_that_never_begin(
    serves: str,
    goal: Any,
    text: str,
    gateway: Callable[..., str],
    page: OpenPage,
    make_node: Callable[..., RosNode],
) -> None:
    """Each ends in a failure that names the action."""
    ros = make_node("nav")
    if serves != "nothing":
        Server(ros, admits=serves == "goals")
    one = page(gateway(), ros)
    if serves != "nothing":
        one.until(
            lambda: ACTION in one.call("/rosapi/action_servers", "", {})["action_servers"], "the server"
        )
    answer = one.answer(one.begin("goal", ACTION, TYPE, goal))
    assert not answer["ok"]
    assert text in answer["value"]


def test_a_server_that_dies_ends_the_goal(
    gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """Else the page would wait for ever."""
    ros, nav = make_node("robot"), make_node("nav")
    server = Server(nav)
    one = page(gateway(), ros, nav)
    number = one.begin("goal", ACTION, TYPE, GOAL)
    one.until(lambda: server.goals, "the goal")
    one.nodes = [ros]
    nav.close()
    answer = one.answer(number)
    assert not answer["ok"]
    assert "/navigate_to_pose: its server is gone" in answer["value"]


@pytest.mark.core
def test_the_goals_of_a_page_that_goes_are_cancelled(
    gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """Nobody else knows their ids."""
    ros = make_node("nav")
    server = Server(ros)
    url = gateway()
    one, other = page(url, ros), page(url, ros)
    one.begin("goal", ACTION, TYPE, GOAL)
    other.until(lambda: server.goals, "the goal")
    one.close()
    other.until(lambda: server.asked_to_cancel, "the cancel")
    server.goals[0].cancel(NavigateToPose.Result())
