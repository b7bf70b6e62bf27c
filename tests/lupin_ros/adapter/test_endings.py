"""A node that ends leaves no goal behind: real processes, and a server that takes its time."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import TracebackType

import pytest
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionServer

from lupin_ros.adapter.actions import CANCEL_LIMIT_S, GoalCallbacks
from lupin_ros.adapter.node import DELIVERY_LIMIT_S, ActionCaller, RosNode
from lupin_ros.adapter.process import SUPERVISED

#: Looks at a goal for 0.3 s (with `silent`: for ever) before it takes it, and at a cancel for 0.5 s.
SERVER = """
import sys, threading
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from lupin_ros.adapter.node import RosNode

def look(goal):
    print("asked", flush=True)
    threading.Event().wait(None if "silent" in sys.argv else 0.3)
    return GoalResponse.ACCEPT

def stop(handle):
    threading.Event().wait(0.5)
    print("cancelled", flush=True)
    return CancelResponse.ACCEPT

ros = RosNode("server")
held = []
ActionServer(ros.node, NavigateToPose, "/drive", held.append, goal_callback=look, cancel_callback=stop,
             handle_accepted_callback=lambda handle: (held.append(handle), print("taken", flush=True)))
print("up", flush=True)
ros.spin()
"""
#: Sends one goal, as a node of its own or as the driver of a plugin.
CLIENT = """
import sys
from nav2_msgs.action import NavigateToPose
from lupin_ros.adapter.action_driver import ActionAttempts, ActionOperation, ActionServer
from lupin_ros.adapter.node import GoalCallbacks, RosNode
from lupin_ros.adapter.process import end_with_supervisor

end_with_supervisor()
ros = RosNode("client")
told = lambda *_: None
accepted = lambda *_: print("accepted", flush=True)
if "driver" in sys.argv:
    class Outlet:
        failed = done = cancelled = progress = told
    Outlet.accepted = accepted
    server = ActionServer(ros, NavigateToPose, "/drive", ours=False)
    attempts = ActionAttempts(ros, Outlet)
    operation = ActionOperation(server, told, told, "rejected", "unavailable")
    ros.on_stop(lambda: (attempts.close(), server.close()))
    ready = lambda: server.ready
    send = lambda: attempts.start("one", operation, NavigateToPose.Goal())
else:
    caller = ros.action(NavigateToPose, "/drive")
    ready = caller.ready
    goal = NavigateToPose.Goal()
    send = lambda: caller.send(goal, GoalCallbacks(accepted, told, told, told))
ros.steady_timer(0.05, told)
ros.work_until(ready, 60.0)
ros.post(lambda: (send(), print("sent", flush=True)))  # when it spins, and signals are heard
ros.spin()
"""
PATIENCE_S = 10.0
MOMENTS = ("sent", "asked", "accepted")


class Talker:
    """A Python program in a process of its own, whose lines are read as they come."""

    def __init__(self, program: str, *arguments: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", program, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, SUPERVISED: "1"},
        )
        self._lines: queue.Queue[str] = queue.Queue()
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.put(line.strip())

    def says(self, line: str) -> None:
        """Wait for its next line, which is `line`."""
        assert self._lines.get(timeout=PATIENCE_S) == line

    def end(self, how: str) -> float:
        """Have it end by a signal or a cut lifeline, and return the seconds that it took."""
        begin = time.monotonic()
        if how == "lifeline":
            assert self.process.stdin is not None
            self.process.stdin.close()
        else:
            self.process.send_signal(signal.Signals[how])
        self.process.wait(PATIENCE_S)
        return time.monotonic() - begin

    def __enter__(self) -> Talker:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self.process:  # closes the pipes
            self.process.kill()
            self._reader.join()


@pytest.fixture
def server() -> Iterator[Talker]:
    """The slow server."""
    with Talker(SERVER) as server:
        server.says("up")
        yield server


@pytest.mark.parametrize(
    ("kind", "how", "moment"),
    [
        *((kind, "SIGTERM", moment) for kind in ("node", "driver") for moment in MOMENTS),
        ("driver", "SIGINT", "sent"),
        ("driver", "lifeline", "sent"),
        ("driver", "lifeline", "accepted"),
    ],
)
def test_no_goal_goes_on_when_its_client_ends(server: Talker, kind: str, how: str, moment: str) -> None:
    """Whether it ends right after the request, while the server looks at it, or after the acceptance."""
    with Talker(CLIENT, kind) as client:
        client.says("sent")
        if moment != "sent":
            server.says("asked")
        if moment == "accepted":
            client.says("accepted")
        took = client.end(how)
        assert client.process.returncode == 0
        if moment == "sent":
            server.says("asked")
        server.says("taken")
        server.says("cancelled")
    assert took < CANCEL_LIMIT_S + DELIVERY_LIMIT_S + 1.0


def test_a_server_that_never_answers_keeps_a_node_no_longer_than_the_limit() -> None:
    with Talker(SERVER, "silent") as server, Talker(CLIENT) as client:
        server.says("up")
        server.says("asked")
        took = client.end("SIGTERM")
        assert client.process.returncode == 0
        assert client.process.stderr is not None
        assert "no answer to a cancel: the goal may go on" in client.process.stderr.read()
    assert CANCEL_LIMIT_S <= took < CANCEL_LIMIT_S + DELIVERY_LIMIT_S + 2.0


def test_a_closed_client_takes_no_goal(make_node: Callable[..., RosNode]) -> None:
    caller: ActionCaller = make_node("client").action(NavigateToPose, "/closed")
    caller.close()
    with pytest.raises(RuntimeError, match="the client of action /closed is closed"):
        caller.send(NavigateToPose.Goal(), GoalCallbacks())


def test_a_closed_node_serves_no_action_any_more(make_node: Callable[..., RosNode]) -> None:
    """Nor one of rclpy's own servers, for whose sake rclpy would keep the whole node."""
    closed, other = make_node("closed"), make_node("other")

    def serving() -> list[str]:
        found = other.node.get_publishers_info_by_topic("/left/_action/status")
        return [endpoint.node_name for endpoint in found]

    server = ActionServer(closed.node, NavigateToPose, "/left", _no)
    other.work_until(lambda: serving() == ["closed"], PATIENCE_S)
    assert serving() == ["closed"]
    closed.close()
    other.work_until(lambda: not serving(), PATIENCE_S)
    assert serving() == [], server


def test_nothing_is_begun_while_a_node_waits_for_its_cancels(make_node: Callable[..., RosNode]) -> None:
    ros, begun = make_node("leaving"), list[str]()
    ros.steady_timer(0.01, lambda: begun.append("timer"))
    ros.work_until(lambda: bool(begun), PATIENCE_S)
    ros.stop()
    ros._executor.answers_only = True
    begun.clear()
    ros.work_until(lambda: bool(begun), 0.1)
    assert begun == []


def _no(*_: object) -> None:
    """Nobody listens."""
