"""What a node's executor does unlike rclpy's: it keeps its wait set, and looks at events seldom."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future, Task
from std_msgs.msg import String

from lupin_ros.adapter.node import Qos, RosNode
from tests.lupin_ros.helpers import spin_for, spin_until


@pytest.fixture
def ros() -> Iterator[RosNode]:
    """A node."""
    with RosNode("tester") as node:
        yield node


def heard_by(ros: RosNode) -> tuple[Any, list[str], Callable[[], None]]:
    """Return a subscription, what it has heard, and what tells it something."""
    heard: list[str] = []
    publisher = ros.publisher(String, "told", Qos.EVENT)
    subscription = ros.subscribe(String, "told", Qos.EVENT, lambda message: heard.append(message.data))
    return subscription, heard, lambda: publisher.publish(String(data="a"))


def test_what_is_made_while_it_spins_is_waited_for(ros: RosNode) -> None:
    """The wait set of before does not have it."""
    ros.spin_once(0.0)
    _, heard, tell = heard_by(ros)
    ros.timer(0.05, tell)
    spin_until([ros], lambda: heard, what="a message")


def test_what_an_earlier_callback_destroys_is_not_called_any_more(ros: RosNode) -> None:
    """Both were ready in the same look."""
    subscription, heard, tell = heard_by(ros)
    spin_until([ros], lambda: ros.node.count_subscribers("told") == 1, what="the subscription")
    tell()
    spin_until([ros], lambda: heard, what="a message")
    done: list[bool] = []

    def destroy() -> None:
        ros.node.destroy_subscription(subscription)
        done.append(True)

    tell()
    ros.call_later(0.0, destroy)  # timers come first
    spin_until([ros], lambda: done, what="the timer")
    spin_for([ros], 0.2)
    assert heard == ["a"]


def test_a_publisher_that_does_not_fit_is_told(ros: RosNode, capfd: pytest.CaptureFixture[str]) -> None:
    """The middleware's events are looked at with the peers, not at each wake-up."""
    kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    ros.node.create_subscription(String, "unfit", lambda _: None, kept)
    ros.publisher(String, "unfit", Qos.EVENT)
    said: list[str] = []

    def is_told() -> bool:
        said.append(capfd.readouterr().err)
        return "incompatible QoS" in "".join(said)

    spin_until([ros], is_told, what="the warning")


def test_a_coroutine_goes_on_when_what_it_waits_for_is_there(ros: RosNode) -> None:
    """On every rclpy: 7.1.5 calls it at every turn, 7.1.9 when the future is done."""
    executor, done = ros.node.executor, list[str]()
    awaited = Future(executor=executor)

    async def wait() -> None:
        done.append(await awaited)

    task = executor.create_task(wait)
    spin_for([ros], 0.1)
    assert not task.done()
    ros.call_later(0.0, lambda: awaited.set_result("there"))
    spin_until([ros], task.done, what="the coroutine")
    assert done == ["there"]


@pytest.mark.parametrize(("resume", "calls"), [(True, 1), (False, 3)])
def test_a_task_that_is_resumed_is_not_called_at_every_turn(
    ros: RosNode, monkeypatch: pytest.MonkeyPatch, resume: bool, calls: int
) -> None:
    """A coroutine of newer versions would register its callback again each time."""
    monkeypatch.setattr("lupin_ros.adapter.executor.TASKS_RESUME", resume)
    executor, called = ros.node.executor, list[Task]()
    monkeypatch.setattr(Task, "__call__", lambda task: called.append(task))
    task = executor.create_task(lambda: None)
    for _ in range(3):
        executor.wake()
        ros.spin_once(0.1)
    assert called.count(task) == calls
    executor._call_task_in_next_spin(task)
    ros.spin_once(0.1)
    assert called.count(task) == calls + 1
