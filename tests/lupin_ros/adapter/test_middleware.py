"""The adapter over real DDS: every work-around that it promises."""

from __future__ import annotations

import fcntl
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest
from nav2_msgs.action import NavigateToPose
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

from lupin_engine.errors import LupinError, UsageError
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.types import DURATION, INTEGER, POSE, TEXT, list_of
from lupin_ros.adapter.dds.profile import OPEN, RANGE, THIS_MACHINE, use_profile, variables
from lupin_ros.adapter.environment import distribution
from lupin_ros.adapter.executor import StaleAfter
from lupin_ros.adapter.node import (
    ActionCaller,
    CallFailure,
    GoalCallbacks,
    Qos,
    RosNode,
    ServedGoal,
    peer_mismatches,
)
from lupin_ros.adapter.peers import rival_servers
from tests.lupin_ros.helpers import PATIENCE, spin_for, spin_until, work_off
from tests.processes import ended

MakeNode = Callable[..., RosNode]

PARAMETERS = {
    "nav_timeout_s": Parameter(DURATION, 60.0, "how long", maximum=600.0),
    "sweeps": Parameter(INTEGER, 1, "how often", minimum=1, maximum=5),
    "tags": Parameter(list_of(TEXT), [], "which"),
    "dock_pose": Parameter(POSE, None, "where"),
    "title": Parameter(TEXT, "", "what"),
}


def ok(_: Any, response: Trigger.Response) -> Trigger.Response:
    response.success = True
    return response


# --- topics and services ----------------------------------------------------------------------------------


def test_a_late_subscriber_gets_the_latched_message(make_node: MakeNode) -> None:
    speaker, listener, heard = make_node("speaker"), make_node("listener"), []
    speaker.publisher(String, "/state", Qos.LATCHED).publish(String(data="READY"))
    listener.subscribe(String, "/state", Qos.LATCHED, heard.append)
    spin_until([speaker, listener], lambda: heard)
    assert heard[0].data == "READY"


def test_a_call_is_answered_once(make_node: MakeNode) -> None:
    server, client, answers = make_node("server"), make_node("client"), []
    server.serve(Trigger, "/ask", ok)
    caller = client.service(Trigger, "/ask")
    spin_until([server, client], caller.ready)
    caller.call(Trigger.Request(), 5.0, answers.append)
    assert answers == []
    spin_until([server, client], lambda: answers)
    assert [answer.success for answer in answers] == [True]
    assert not caller.client._pending_requests


def test_an_answer_may_come_later_and_in_any_order(make_node: MakeNode) -> None:
    server, client, answers, open_ = make_node("server"), make_node("client"), [], []

    def ask(request: Any, response: Any, answer: Callable[[Any], None]) -> None:
        response.message = f"number {len(open_)}"
        open_.append((response, answer))

    server.serve_later(Trigger, "/ask", ask)
    caller = client.service(Trigger, "/ask")
    spin_until([server, client], caller.ready)
    for _ in range(2):
        caller.call(Trigger.Request(), 5.0, lambda response: answers.append(response.message))
    spin_until([server, client], lambda: len(open_) == 2)
    assert answers == []
    for response, answer in reversed(open_):
        answer(response)
    spin_until([server, client], lambda: len(answers) == 2)
    assert sorted(answers) == ["number 0", "number 1"]


def test_an_answer_of_a_node_that_is_gone_goes_nowhere(make_node: MakeNode) -> None:
    server, client, open_ = make_node("server"), make_node("client"), []
    server.serve_later(Trigger, "/ask", lambda _, response, answer: open_.append((response, answer)))
    caller = client.service(Trigger, "/ask")
    spin_until([server, client], caller.ready)
    caller.call(Trigger.Request(), 5.0, lambda _: None)
    spin_until([server, client], lambda: open_)
    server.close()
    ((response, answer),) = open_
    assert answer(response) is None


def test_a_call_without_a_server_is_unavailable(make_node: MakeNode) -> None:
    client, answers = make_node("client"), []
    client.service(Trigger, "/nobody").call(Trigger.Request(), 5.0, answers.append)
    assert answers == []
    spin_until([client], lambda: answers)
    assert answers == [CallFailure("unavailable", "/nobody: no server")]


def test_a_call_of_the_wrong_type_is_an_exception(make_node: MakeNode) -> None:
    server, client, answers = make_node("server"), make_node("client"), []
    server.serve(Trigger, "/ask", ok)
    caller = client.service(Trigger, "/ask")
    spin_until([server, client], caller.ready)
    caller.call("no request", 5.0, answers.append)
    spin_until([client], lambda: answers)
    assert answers[0].code == "exception"


def test_a_late_answer_is_a_timeout_and_leaves_nothing_behind(make_node: MakeNode) -> None:
    server, client, answers = make_node("server"), make_node("client"), []
    server.serve(Trigger, "/ask", ok)
    caller = client.service(Trigger, "/ask")
    spin_until([server, client], caller.ready)
    caller.call(Trigger.Request(), 0.1, answers.append)
    spin_until([client], lambda: answers)  # the server does not get its turn
    assert answers == [CallFailure("timeout", "/ask: no answer within 0.1 s")]
    assert not caller.client._pending_requests
    spin_for([server, client], 0.1)
    assert len(answers) == 1


def test_a_client_that_is_closed_says_nothing_more(make_node: MakeNode) -> None:
    """Neither the deadline of a call under way nor the word that nobody is there."""
    server, client, answers = make_node("server"), make_node("client"), []
    server.serve(Trigger, "/ask", ok)
    caller, lonely = client.service(Trigger, "/ask"), client.service(Trigger, "/nobody")
    spin_until([server, client], caller.ready)
    caller.call(Trigger.Request(), 0.05, answers.append)
    lonely.call(Trigger.Request(), 0.05, answers.append)
    caller.close()
    lonely.close()
    spin_for([client], 0.2)
    assert answers == []


def test_a_cancelled_call_says_nothing(make_node: MakeNode) -> None:
    server, client, answers = make_node("server"), make_node("client"), []
    server.serve(Trigger, "/ask", ok)
    caller = client.service(Trigger, "/ask")
    spin_until([server, client], caller.ready)
    caller.call(Trigger.Request(), 0.1, answers.append).cancel()
    spin_for([server, client], 0.2)
    assert answers == []


def test_fifty_calls_at_once_are_all_answered(make_node: MakeNode) -> None:
    server, client, answers = make_node("server"), make_node("client"), []
    server.serve(Trigger, "/ask", ok)
    caller = client.service(Trigger, "/ask")
    spin_until([server, client], caller.ready)
    for _ in range(50):
        caller.call(Trigger.Request(), 10.0, answers.append)
    spin_until([server, client], lambda: len(answers) == 50)
    assert not any(isinstance(answer, CallFailure) for answer in answers)


def _older_than_30_s(_: Any, sent: float) -> float | None:
    age = time.time_ns() * 1e-9 - sent
    return age if age > 30.0 else None


@pytest.mark.parametrize(
    ("stale_after", "carried_out"), [(30.0, 0), (None, 1), (_older_than_30_s, 0), (lambda *_: None, 1)]
)
def test_a_stale_request_is_not_carried_out(
    make_node: MakeNode,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    stale_after: StaleAfter,
    carried_out: int,
) -> None:
    """The clock says that it is a minute old; the one after it is not."""
    server, client, taken, answers = make_node("server"), make_node("client"), [], []
    said: list[str] = []

    def take(_: Any, response: Trigger.Response) -> Trigger.Response:
        taken.append(1)
        return ok(_, response)

    def looked() -> bool:
        said.append(capfd.readouterr().err)
        return bool(taken) or "request refused: it is stale" in "".join(said)

    server.serve(Trigger, "/ask", take, stale_after=stale_after)
    caller = client.service(Trigger, "/ask")
    spin_until([server, client], caller.ready)
    caller.call(Trigger.Request(), 0.1, answers.append)
    spin_until([client], lambda: answers)  # the caller has given up before the server looks
    with monkeypatch.context() as later:
        now = time.time_ns
        later.setattr(time, "time_ns", lambda: now() + 60_000_000_000)
        spin_until([server], looked)
    assert len(taken) == carried_out
    caller.call(Trigger.Request(), PATIENCE, answers.append)
    spin_until([server, client], lambda: len(answers) == 2)
    assert len(taken) == carried_out + 1
    assert answers[1].success


def test_a_stale_request_is_answered_with_the_reason(make_node: MakeNode) -> None:
    """A caller whose clock is behind waits for an answer: it is told, and nothing is carried out."""
    server, client, answers = make_node("server"), make_node("client"), []

    def refuse(response: Trigger.Response, reason: str) -> Trigger.Response:
        response.message = reason
        return response

    server.serve(Trigger, "/ask", ok, stale_after=0.2, refuse=refuse)
    caller = client.service(Trigger, "/ask")
    spin_until([server, client], caller.ready)
    begun = client.elapsed()
    caller.call(Trigger.Request(), 10.0, answers.append)
    spin_until([client], lambda: client.elapsed() - begun > 0.4)  # the server does not look at it yet
    spin_until([server, client], lambda: answers)
    assert not answers[0].success
    assert re.match(r"refused: the request is \d+\.\d s old", answers[0].message)


def test_an_exception_in_a_callback_neither_answers_nor_ends_the_spin(
    make_node: MakeNode, capfd: pytest.CaptureFixture[str]
) -> None:
    server, client, answers, failed = make_node("server"), make_node("client"), [], []

    def fail(_: Any, __: Any) -> Any:
        failed.append(1)
        raise RuntimeError("boom")

    server.serve(Trigger, "/bad", fail)
    server.serve(Trigger, "/good", ok)
    bad, good = client.service(Trigger, "/bad"), client.service(Trigger, "/good")
    spin_until([server, client], lambda: bad.ready() and good.ready())
    bad.call(Trigger.Request(), 0.5, answers.append)
    spin_until([server, client], lambda: failed and answers)
    good.call(Trigger.Request(), 5.0, answers.append)
    spin_until([server, client], lambda: len(answers) == 2)
    assert answers[0].code == "timeout"
    assert answers[1].success
    assert "RuntimeError: boom" in capfd.readouterr().err


# --- time, threads, the end -------------------------------------------------------------------------------


def test_posts_of_other_threads_wake_the_node_and_keep_their_order(make_node: MakeNode) -> None:
    ros, done = make_node("poster"), []

    def post() -> None:
        for number in range(3):
            ros.post(lambda number=number: done.append((number, threading.current_thread())))
        ros.post(ros.stop)

    thread = threading.Thread(target=post)
    thread.start()
    ros.spin()
    thread.join()
    assert done == [(number, threading.main_thread()) for number in range(3)]


def test_timers_repeat_until_cancelled_and_one_shots_do_not(make_node: MakeNode) -> None:
    ros, ticks, shots = make_node("ticker"), [], []
    timer = ros.timer(0.01, lambda: ticks.append(ros.now()))
    ros.call_later(0.01, lambda: shots.append(1))
    spin_until([ros], lambda: len(ticks) >= 3)
    timer.cancel()
    timer.cancel()
    seen = len(ticks)
    spin_for([ros], 0.05)
    assert len(ticks) == seen
    assert shots == [1]


def test_nothing_is_kept_of_timers_that_are_over(make_node: MakeNode) -> None:
    """An orchestrator makes one for each deadline."""
    node = make_node("node")
    node.spin_once(0.0)
    before = len(node.node.default_callback_group.entities)
    for _ in range(100):
        node.call_later(60.0, lambda: None).cancel()
    fired: list[bool] = []
    kept = node.call_later(0.0, lambda: fired.append(True))
    spin_until([node], lambda: fired)
    assert len(node.node.default_callback_group.entities) <= before + 1
    kept.cancel()
    assert node.node.default_callback_group.has_entity(next(iter(node.node.timers)))


def test_call_later_follows_simulated_time(make_node: MakeNode) -> None:
    ros = make_node("simulated", ["--ros-args", "-p", "use_sim_time:=true"])
    world, shots = make_node("world"), []
    clock = world.publisher(Clock, "/clock", Qos.EVENT)

    def at(seconds: int) -> None:
        message = Clock()
        message.clock.sec = seconds

        def told() -> bool:
            clock.publish(message)  # again and again: nobody keeps it for a node that is not matched yet
            return ros.now() == seconds

        spin_until([ros, world], told)

    at(100)
    ros.call_later(10.0, lambda: shots.append(ros.now()))
    spin_for([ros], 0.05)
    at(109)
    spin_for([ros], 0.05)
    assert shots == []
    at(111)
    spin_until([ros], lambda: shots)
    assert shots == [111.0]


def test_elapsed_never_goes_back_with_simulated_time(make_node: MakeNode) -> None:
    """Not when it is heard of for the first time, and not when the simulation begins anew."""
    ros = make_node("simulated", ["--ros-args", "-p", "use_sim_time:=true"])
    world = make_node("world")
    clock = world.publisher(Clock, "/clock", Qos.EVENT)
    read = []
    for seconds in (1000, 1003, 2, 5, 4):
        message = Clock()
        message.clock.sec = seconds

        def told(message: Clock = message) -> bool:
            clock.publish(message)
            ros.elapsed()
            return round(ros.now()) == message.clock.sec

        spin_until([ros, world], told)
        read.append(ros.elapsed())
    assert read == pytest.approx([0.0, 3.0, 3.0, 6.0, 6.0])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_spin_cleanly(make_node: MakeNode, number: signal.Signals) -> None:
    ros, goodbyes = make_node("leaving"), []
    publisher = ros.publisher(Bool, "/bye", Qos.EVENT)
    before = signal.getsignal(number)
    ros.on_stop(lambda: goodbyes.append(publisher.publish(Bool())))
    ros.call_later(0.05, lambda: threading.Thread(target=os.kill, args=(os.getpid(), number)).start())
    ros.spin()
    assert goodbyes == [None]
    assert signal.getsignal(number) is before
    assert not ros.node.context.ok()
    ros.close()
    ros.post(lambda: None)


def test_what_is_published_last_arrives(make_node: MakeNode) -> None:
    """The last words of a process, such as the end of a motion, are not lost with it."""
    program = (
        "from std_msgs.msg import String\n"
        "from lupin_ros.adapter.node import Qos, RosNode\n"
        "ros = RosNode('leaving')\n"
        "last = ros.publisher(String, '/last', Qos.EVENT)\n"
        "ros.work_until(last.get_subscription_count, 60.0)\n"
        "ros.on_stop(lambda: [last.publish(String(data=str(n) * 1_000_000)) for n in range(5)])\n"
        "ros.stop()\n"
        "ros.spin()\n"
        "import os\n"
        "os._exit(0)\n"
    )
    world, heard = make_node("world"), list[str]()
    world.subscribe(String, "/last", Qos.EVENT, lambda message: heard.append(message.data[0]))
    with ended(subprocess.Popen([sys.executable, "-c", program])) as process:
        spin_until([world], lambda: process.poll() is not None)
    spin_until([world], lambda: len(heard) == 5, 10.0)
    assert heard == ["0", "1", "2", "3", "4"]


def test_a_node_that_cannot_be_released_does_not_keep_the_process() -> None:
    program = (
        "import threading\n"
        "from lupin_ros.adapter import node as middleware\n"
        "middleware.TEARDOWN_LIMIT_S = 0.2\n"
        "ros = middleware.RosNode('stuck')\n"
        "ros.node.destroy_node = threading.Event().wait\n"
        "ros.stop()\n"
        "ros.spin()\n"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60.0)
    assert ended.returncode == 1
    assert "in close" in ended.stderr


def test_a_context_shut_down_from_elsewhere_ends_the_spin(make_node: MakeNode) -> None:
    ros = make_node("leaving")
    ros.call_later(0.05, ros.node.context.shutdown)
    ros.spin()
    assert not ros.node.context.ok()


def test_a_node_that_keeps_failing_ends_and_says_goodbye_all_the_same(make_node: MakeNode) -> None:
    """Who has goals under way must have them cancelled; nobody waits for an answer then."""
    ros, goodbyes = make_node("broken"), []

    def fail(_: Any) -> None:
        raise RuntimeError("broken")

    ros.on_stop(lambda: ros.work_until(lambda: False, 60.0))
    ros.on_stop(lambda: goodbyes.append("cancelled"))
    ros._executor.spin_once = fail
    with pytest.raises(RuntimeError, match="broken"):
        ros.spin()
    assert goodbyes == ["cancelled"]
    assert not ros.node.context.ok()


def test_one_failure_outside_a_callback_does_not_end_a_last_wait(make_node: MakeNode) -> None:
    ros, waited = make_node("leaving"), []
    spin_once = ros._executor.spin_once

    def fail_once(_: Any) -> None:
        ros._executor.spin_once = spin_once
        raise RuntimeError("once")

    ros._executor.spin_once = fail_once
    ros.call_later(0.05, lambda: waited.append(True))
    ros.work_until(lambda: bool(waited), 10.0)
    assert waited == [True]


# --- parameters -------------------------------------------------------------------------------------------


def test_parameters_come_from_the_command_line(make_node: MakeNode) -> None:
    given = ["nav_timeout_s:=30", "sweeps:=2", "tags:=['7', '12']", "dock_pose:=[1, 2, 0]", "title:=''"]
    arguments = ["--ros-args", *(word for value in given for word in ("-p", value))]
    assert make_node("mission", arguments, PARAMETERS).parameters() == {
        "nav_timeout_s": 30.0,
        "sweeps": 2,
        "tags": ["7", "12"],
        "dock_pose": {"x": 1.0, "y": 2.0, "yaw": 0.0},
        "title": "",
    }


def test_parameters_have_defaults_and_ranges(make_node: MakeNode) -> None:
    ros = make_node("mission", ["--ros-args", "-p", "tags:=[]"], PARAMETERS)
    assert ros.parameters()["tags"] == []
    assert ros.parameters()["dock_pose"] is None
    described = ros.node.describe_parameter("nav_timeout_s")
    assert described.description == "how long [s]"
    (allowed,) = described.floating_point_range
    assert (allowed.from_value, allowed.to_value) == (0.0, 600.0)
    assert ros.node.describe_parameter("sweeps").integer_range[0].to_value == 5


def test_all_bad_parameters_are_told_at_once() -> None:
    given = ["nav_timeout_s:=-1", "sweeps:=9", "tags:=[1, 2]", "dock_pose:=[1, 2]", "title:=7"]
    arguments = ["--ros-args", *(word for value in given for word in ("-p", value))]
    with pytest.raises(LupinError) as caught:
        RosNode("mission", arguments, PARAMETERS)
    assert str(caught.value).splitlines() == [
        "parameter 'nav_timeout_s': expected duration between 0 and 600 s, got -1",
        "parameter 'sweeps': expected integer between 1 and 5, got 9",
        "parameter 'tags': expected text, got 1",
        'parameter \'tags\': expected text, got 2; write ["1", "2"]',
        "parameter 'dock_pose': expected pose with the fields x, y, yaw, got [1, 2]; give it as [x, y, yaw]",
        "parameter 'title': expected text, got 7; write \"7\"",
    ]


def test_arguments_that_ros_cannot_read_are_a_usage_error() -> None:
    with pytest.raises(UsageError, match="nonsense"):
        RosNode("mission", ["--ros-args", "-p", "nonsense"])


def test_a_bad_node_name_is_a_usage_error() -> None:
    with pytest.raises(UsageError, match="node name"):
        RosNode("a b")


def test_an_unknown_parameter_that_was_said_is_refused(make_node: MakeNode) -> None:
    with pytest.raises(LupinError) as refused:
        make_node("mission", ["--ros-args", "-p", "nav_timout_s:=3", "-p", "use_sim_time:=false"], PARAMETERS)
    assert str(refused.value) == (
        "parameter 'nav_timout_s' is not known to this node; did you mean 'nav_timeout_s'?"
    )


def test_an_unknown_parameter_of_a_file_is_reported(
    make_node: MakeNode, capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A file with `/**` is for other nodes as well."""
    file = tmp_path / "all.yaml"
    file.write_text("/**:\n  ros__parameters: {nav_timout_s: 3, use_sim_time: false}\n")
    make_node("mission", ["--ros-args", "--params-file", str(file)], PARAMETERS)
    shown = capfd.readouterr().err
    assert "'nav_timout_s' is not known to this node; did you mean 'nav_timeout_s'?" in shown
    assert "use_sim_time" not in shown


def set_parameter(nodes: list[RosNode], name: str, value: ParameterValue) -> Any:
    """Set a parameter of the first node from the second one, as `ros2 param set` does."""
    caller, answers = nodes[1].service(SetParameters, f"/{nodes[0].name}/set_parameters"), []
    spin_until(nodes, caller.ready)
    request = SetParameters.Request(parameters=[ParameterMessage(name=name, value=value)])
    caller.call(request, 5.0, answers.append)
    spin_until(nodes, lambda: answers)
    return answers[0].results[0]


def test_a_change_at_run_time_needs_a_taker(make_node: MakeNode) -> None:
    nodes = [make_node("mission", [], PARAMETERS), make_node("setter")]
    sixty = ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=90)
    refused = set_parameter(nodes, "nav_timeout_s", sixty)
    assert not refused.successful
    assert "read at the start of the node only" in refused.reason
    changes: list[Any] = []
    nodes[0].on_parameter(changes.append)
    assert set_parameter(nodes, "nav_timeout_s", sixty).successful  # an integer for a double
    assert changes == [{"nav_timeout_s": 90.0}]
    assert nodes[0].parameters()["nav_timeout_s"] == 90.0
    nodes[0].on_parameter(lambda values: "not now")
    assert set_parameter(nodes, "nav_timeout_s", sixty).reason == "not now"
    with pytest.raises(LupinError, match=r"^parameter 'nav_timeout_s' was not set: not now$"):
        nodes[0].set_parameter("nav_timeout_s", 30.0)
    assert nodes[0].parameters()["nav_timeout_s"] == 90.0
    far = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=601.0)
    assert not set_parameter(nodes, "nav_timeout_s", far).successful


# --- actions ----------------------------------------------------------------------------------------------


class Journey:
    """A goal at both ends: what the client heard, and the goals that the server holds."""

    def __init__(self, make_node: MakeNode) -> None:
        self.client = make_node("client")
        self.make_node = make_node
        self.heard: list[Any] = []
        self.held: list[ServedGoal] = []
        self.cancels: list[ServedGoal] = []
        self.server = self.serve()
        self.caller: ActionCaller = self.client.action(NavigateToPose, "navigate_to_pose")
        self.until(self.caller.ready)

    def serve(self) -> RosNode:
        server = self.make_node("server")
        server.serve_action(
            NavigateToPose,
            "navigate_to_pose",
            admit=lambda goal: goal.behavior_tree != "refused",
            started=self.held.append,
            cancelled=self.cancels.append,
        )
        return server

    def send(self, tree: str = "", key: str = "") -> Any:
        return self.caller.send(
            NavigateToPose.Goal(behavior_tree=tree),
            GoalCallbacks(
                accepted=lambda: self.heard.append("accepted"),
                feedback=lambda message: self.heard.append(message.distance_remaining),
                ended=lambda status, result: self.heard.append((status, result.error_msg)),
                rejected=lambda: self.heard.append("rejected"),
            ),
            key=key,
        )

    def until(self, condition: Callable[[], Any]) -> None:
        spin_until([self.server, self.client], condition)


def test_a_goal_is_accepted_fed_back_and_reached(make_node: MakeNode) -> None:
    journey = Journey(make_node)
    journey.send()
    journey.until(lambda: journey.heard and journey.held)
    journey.held[0].feedback(NavigateToPose.Feedback(distance_remaining=1.5))
    journey.until(lambda: len(journey.heard) == 2)
    journey.held[0].succeed(NavigateToPose.Result(error_msg="there"))
    journey.held[0].abort(NavigateToPose.Result(error_msg="too late"))
    journey.until(lambda: len(journey.heard) == 3)
    assert journey.heard == ["accepted", 1.5, (4, "there")]


def test_a_goal_is_rejected(make_node: MakeNode) -> None:
    journey = Journey(make_node)
    journey.send("refused")
    journey.until(lambda: journey.heard)
    assert journey.heard == ["rejected"]


def test_a_goal_that_its_server_cannot_begin_with_is_aborted(make_node: MakeNode) -> None:
    """The client would wait for ever for one that nobody works on."""
    journey = Journey(make_node)

    def fail(_: ServedGoal) -> None:
        raise RuntimeError("no motor")

    journey.server.close()
    journey.server = make_node("server")
    journey.server.serve_action(
        NavigateToPose, "navigate_to_pose", admit=lambda _: True, started=fail, cancelled=fail
    )
    spin_until([journey.server, journey.client], journey.caller.ready)
    journey.send()
    journey.until(lambda: len(journey.heard) == 2)
    assert journey.heard == ["accepted", (6, "")]


def test_clients_of_actions_that_were_closed_are_not_kept(make_node: MakeNode) -> None:
    """Missions are loaded anew as often as somebody saves a file."""
    ros = make_node("reloading")
    for _ in range(3):
        ros.action(NavigateToPose, "navigate_to_pose").close()
    last = ros.action(NavigateToPose, "navigate_to_pose")
    assert ros._callers == [last]


def test_a_goal_is_cancelled_but_not_before_it_is_accepted(make_node: MakeNode) -> None:
    journey = Journey(make_node)
    goal = journey.send()
    goal.cancel()
    journey.until(lambda: journey.heard and journey.held)
    assert journey.cancels == []
    goal.cancel()
    journey.until(lambda: journey.cancels)
    journey.cancels[0].cancel(NavigateToPose.Result(error_msg="stopped"))
    journey.until(lambda: len(journey.heard) == 2)
    assert journey.heard == ["accepted", (5, "stopped")]


def test_a_lost_result_is_asked_for_again(make_node: MakeNode) -> None:
    journey = Journey(make_node)
    journey.send()
    journey.until(lambda: journey.heard and journey.held)
    work_off([journey.server, journey.client])  # the request for the result has arrived
    journey.caller.client._pending_result_requests.clear()  # as if its answer had been sent into an outage
    journey.held[0].abort(NavigateToPose.Result(error_msg="stuck"))
    journey.until(lambda: len(journey.heard) == 2)
    assert journey.heard == ["accepted", (6, "stuck")]


def test_a_restarted_server_does_not_know_the_goal(make_node: MakeNode) -> None:
    journey = Journey(make_node)
    journey.send()
    journey.until(lambda: journey.heard and journey.held)
    journey.server.close()
    journey.server = journey.serve()
    journey.until(lambda: len(journey.heard) == 2)
    assert journey.heard == ["accepted", (0, "")]


def test_a_result_is_kept_for_a_while_and_then_forgotten(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever goes on with another process's work may ask for it; memory does not grow with goals."""
    monkeypatch.setattr("lupin_ros.adapter.actions.RESULT_KEPT_S", 2)
    journey = Journey(make_node)
    journey.send(key="one")
    journey.until(lambda: journey.heard and journey.held)
    journey.held[0].succeed(NavigateToPose.Result(error_msg="there"))
    journey.until(lambda: len(journey.heard) == 2)
    ends: list[int] = []

    def asked() -> int:
        before = len(ends)
        journey.caller.adopt("one", GoalCallbacks(ended=lambda status, _: ends.append(status)))
        journey.until(lambda: len(ends) > before)
        return ends[-1]

    assert asked() == 4
    journey.until(lambda: asked() == 0)


def test_a_goal_that_the_server_never_answered_ends_as_rejected(make_node: MakeNode) -> None:
    journey = Journey(make_node)
    journey.send()
    journey.server.close()  # before it has looked at the goal
    spin_until([journey.client], lambda: not journey.caller.ready())
    journey.server = journey.serve()
    journey.until(lambda: journey.heard)
    assert journey.heard == ["rejected"]


# --- peers ------------------------------------------------------------------------------------------------


def test_equal_definitions_are_no_finding(make_node: MakeNode) -> None:
    journey = Journey(make_node)
    assert peer_mismatches(journey.client) == []
    assert peer_mismatches(journey.server) == []


def test_a_peer_with_another_type_is_named_once(
    make_node: MakeNode, capfd: pytest.CaptureFixture[str]
) -> None:
    here, there = make_node("here"), make_node("there")
    here.subscribe(String, "/state", Qos.EVENT, print)
    there.publisher(Bool, "/state", Qos.EVENT)
    spin_until([here], lambda: peer_mismatches(here))  # the other one would tell of it as well
    (finding,) = peer_mismatches(here)
    assert finding.startswith("/state: node /there uses another definition: here std_msgs/msg/String RIHS01_")
    assert "there std_msgs/msg/Bool RIHS01_" in finding
    here._check_peers()
    here._check_peers()
    assert capfd.readouterr().err.count("uses another definition") == 1


def test_a_peer_with_another_hash_is_found_for_services_too() -> None:
    def endpoint(node: str, digest: str) -> SimpleNamespace:
        kind = "std_srvs::srv::dds_::Trigger_Request_"
        return SimpleNamespace(node_name=node, node_namespace="/", topic_type=kind, topic_type_hash=digest)

    hashes = {"me": "RIHS01_aa", "you": "RIHS01_bb", "untyped": "INVALID"}
    graph = {"rq/askRequest": [endpoint(node, digest) for node, digest in hashes.items()]}
    node = SimpleNamespace(
        get_name=lambda: "me",
        get_namespace=lambda: "/",
        get_publishers_info_by_topic=lambda topic, no_mangle: graph.get(topic, []),
        get_subscriptions_info_by_topic=lambda topic, no_mangle: [],
    )
    ros: Any = SimpleNamespace(node=node, channels=lambda: ["rq/askRequest", "rr/askReply"])
    (finding,) = peer_mismatches(ros)
    kind = "std_srvs/srv/Trigger_Request"
    assert finding.startswith("request of /ask: node /you uses another definition")
    assert f"here {kind} RIHS01_aa, there {kind} RIHS01_bb" in finding


@pytest.mark.parametrize(
    ("name", "told"), [("twin", "another node of this name"), ("other", "/other")], ids=["twin", "stranger"]
)
def test_a_second_server_of_a_service_is_named_when_it_was_seen_twice(
    make_node: MakeNode, capfd: pytest.CaptureFixture[str], name: str, told: str
) -> None:
    """Both would carry out every request. Who only calls has no rivals."""
    here, there, caller = make_node("twin"), make_node(name), make_node("caller")
    here.serve(Trigger, "/ask", ok)
    caller.service(Trigger, "/ask")
    spin_until([caller], lambda: here.node.count_clients("/ask") == 1)
    assert rival_servers(here) == []
    there.serve(Trigger, "/ask", ok)
    spin_until([caller], lambda: rival_servers(here))  # the servers would look for each other in their turn
    finding = f"/ask is also offered by {told}: every request is carried out by both; stop one of them"
    assert rival_servers(here) == [finding]
    assert rival_servers(caller) == []
    here._check_peers()
    assert capfd.readouterr().err.count("is also offered by") == 0
    here._check_peers()
    here._check_peers()
    assert capfd.readouterr().err.count(finding) == 1


def test_a_second_server_of_an_action_is_named(make_node: MakeNode) -> None:
    """A simulated base beside the real one."""
    here, there = make_node("here"), make_node("there")
    for node in (here, there):
        node.serve_action(
            NavigateToPose, "/drive", admit=lambda _: True, started=lambda _: None, cancelled=lambda _: None
        )
    spin_until([here, there], lambda: rival_servers(here))
    assert rival_servers(here) == [
        "/drive is also offered by /there: every request is carried out by both; stop one of them"
    ]


# --- discovery --------------------------------------------------------------------------------------------


def test_the_users_discovery_profile_wins(make_node: MakeNode, monkeypatch: pytest.MonkeyPatch) -> None:
    read = variables()
    for name in (*read, RANGE):
        monkeypatch.delenv(name, raising=False)
    use_profile()
    assert os.environ[read[0]] == str(THIS_MACHINE)
    assert os.environ[RANGE] == "LOCALHOST"
    monkeypatch.setenv(RANGE, "SUBNET")
    use_profile()  # ours of before is no user's
    assert os.environ[read[0]] == str(OPEN)
    monkeypatch.delenv(read[0])
    monkeypatch.setenv(read[-1], __file__)
    make_node("second")
    assert os.environ.get(read[0], "") == (__file__ if len(read) == 1 else "")


@pytest.mark.parametrize(
    ("here", "read"), [("", "FASTRTPS"), ("jazzy", "FASTRTPS"), ("kilted", "FASTDDS"), ("lyrical", "FASTDDS")]
)
def test_the_variable_is_the_one_that_the_middleware_reads(
    monkeypatch: pytest.MonkeyPatch, here: str, read: str
) -> None:
    """One of another version is no user's profile: it would count nowhere, and nothing would be closed."""
    monkeypatch.setattr("lupin_ros.adapter.dds.profile.distribution", lambda: here)
    assert variables()[0] == f"{read}_DEFAULT_PROFILES_FILE"
    assert len(variables()) == 1 + (here == "kilted")


def test_both_profiles_discover_alike() -> None:
    name = "{http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles}builtin"
    parts = [ElementTree.parse(file).find(f".//{name}") for file in (THIS_MACHINE, OPEN)]
    one, other = (ElementTree.tostring(part) for part in parts if part is not None)
    assert one == other


@pytest.mark.parametrize("reach", ["LOCALHOST", "SUBNET"])
def test_what_the_middleware_complains_of_is_no_line_of_our_output(reach: str, ros_domain: int) -> None:
    """Otherwise it stands among the lines of JSON of `lupin run --json`."""
    name = "fastrtps" if distribution() == "jazzy" else "fastdds"
    port = Path(f"/dev/shm/{name}_port{7411 + 250 * ros_domain}")  # of the first participant of a domain
    port.unlink(missing_ok=True)  # a process that was killed may have left it
    program = "from lupin_ros.adapter.node import RosNode; RosNode('alone').close()"
    command, environment = [sys.executable, "-c", program], {**os.environ, RANGE: reach}
    with open(f"{port}_el", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    assert (done.stdout, f"Failed init_port {port.name}" in done.stderr) == ("", True)
