"""The verbs of an operator against an orchestrator that runs: what is printed, and the exit codes."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from std_msgs.msg import String

from lupin_cli.main import main
from lupin_engine_msgs.srv import Command
from lupin_harness.domains import claimed_domain
from lupin_ros.adapter.node import Qos, RosNode
from lupin_ros.launch import operator as operators
from lupin_ros.launch import published_here
from lupin_ros.launch.operator import Commander, operator_name
from lupin_ros.service.names import COMMAND_SERVICE, STEPS_TOPIC
from tests.lupin_ros.world import Operator, World
from tests.processes import ended

pytestmark = pytest.mark.timeout(180)

#: What a verb says, and its exit code.
Say = Callable[..., tuple[int, str]]


@pytest.fixture(scope="module")
def operator(ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Operator]:
    """An orchestrator that is ready, with all that an inspection needs, and somebody who watches it."""
    world = World(tmp_path_factory.mktemp("verbs"))
    world.start_all()
    operator = Operator()
    try:
        operator.in_state("READY")
        yield operator
    finally:
        operator.ros.close()
        killed = world.stop()
    assert killed == []


@pytest.fixture
def lupin(capfd: pytest.CaptureFixture[str]) -> Say:
    """Run a verb."""

    def run(*words: str) -> tuple[int, str]:
        capfd.readouterr()
        code = main(words)
        said = capfd.readouterr()
        return code, said.out + said.err

    return run


@pytest.mark.core
def test_a_mission_in_the_hands_of_an_operator(operator: Operator, lupin: Say) -> None:
    """Each verb once accepted and once refused; the sentence is the engine's."""
    operator.until(lambda: operator.state.lifecycle_state in ("READY", "DONE"), "rest")
    rest = operator.state.lifecycle_state  # DONE in a second try
    assert lupin("pause") == (1, "pause refused: no mission is running\n")
    assert lupin("resume") == (1, f"resume is not possible in {rest} because nothing is paused\n")
    assert lupin("dock") == (1, f"dock is not possible in {rest}; it is possible in a running mission\n")
    assert lupin("reset") == (1, f"reset is not possible in {rest}; it is possible in FAULT\n")
    assert lupin("answer") == (1, "nothing is asked\n")
    assert lupin("start", "inspection", "--tags", "1,77")[0] == 1
    assert lupin("start", "Dance") == (
        1,
        "unknown mission 'Dance'; allowed: 'ExplorationMission', 'InspectionMission'\n",
    )
    wrong = "start refused: unknown field 'tags'; allowed: 'tag_sequence'\n"
    assert lupin("start", "inspection", "--request", "tags=1") == (1, wrong)
    both = ("--tags", "1", "--request", "tag_sequence=1")
    assert lupin("start", "inspection", *both)[0] == 2
    code, said = lupin("start", "exploration", "--request", "discovery_goal=0")
    assert (code, said) == (1, "discovery_goal must be at least 1, got 0\n")
    operator.in_state(rest)

    operator.hit(9, "stall")  # nothing ends by itself
    code, said = lupin("start", "inspection", "--request", "tag_sequence=1,5")
    assert (code, bool(re.fullmatch(r"InspectionMission lupin-\w{8} started\n", said))) == (0, True)
    operator.in_state("INSPECTING", "NAVIGATING")
    assert lupin("start", "inspection") == (1, "start refused: a mission is already running\n")
    assert lupin("pause") == (0, "pause accepted\n")
    operator.until(lambda: operator.state.paused, "paused")
    code, said = lupin("state")
    first, *lines = said.splitlines()
    assert (code, first) == (0, "INSPECTING NAVIGATING  target 1")
    assert re.match(r"  mission    InspectionMission lupin-\w{8}, for 00:\d\d\.\d$", lines[0])
    assert lines[1:] == [
        "  done       none of 2 targets",
        "  paused     paused by the operator",
        "  last       paused by the operator (paused_by_operator), target 1",
        "  to do      Resume to let the mission go on.",
        "  possible   abort, dock, resume, skip",
        "  not now    pause: pause refused: paused by the operator",
        "             reset: reset is not possible in INSPECTING NAVIGATING; it is possible in FAULT",
        "             start exploration, start inspection: start refused: a mission is already running",
    ]
    assert lupin("resume") == (0, "resume accepted\n")
    operator.until(lambda: not operator.state.paused, "resumed")
    assert lupin("skip") == (0, "skip accepted\n")
    operator.until(lambda: operator.state.current_target == "5", "the next tag")
    assert lupin("abort") == (0, "abort accepted\n")
    operator.hit(0, "none")  # the way home
    operator.in_state("DONE")
    code, said = lupin("state", "--json")
    found = json.loads(said)
    assert (code, found["lifecycle"], found["counts"]["skipped"]) == (0, "DONE", 2)
    possible = {(one["request"], one["mission"]) for one in found["requests"] if one["possible"]}
    assert ("mission.start", "InspectionMission") in possible


@pytest.mark.core
def test_the_state_is_followed(operator: Operator, lupin: Say) -> None:
    """A line for each change, to a pipe too; Ctrl-C is the way to end it."""
    command = [str(Path(sys.executable).with_name("lupin")), "state", "--watch", "--json"]
    with ended(subprocess.Popen(command, stdout=subprocess.PIPE, text=True)) as watching:
        assert watching.stdout is not None
        first = json.loads(watching.stdout.readline())
        operator.in_state(first["lifecycle"])
        operator.hit(1, "stall")  # a state that is over at once may go by unseen
        assert lupin("start", "inspection", "--tags", "1")[0] == 0
        seen = (json.loads(line) for line in watching.stdout)
        under_way = next(one for one in seen if one["lifecycle"] == "INSPECTING")
        assert under_way["mission_id"] != first["mission_id"]
        assert lupin("skip") == (0, "skip accepted\n")
        assert next(one for one in seen if one["lifecycle"] == "DONE")["counts"]["skipped"] == 1
        watching.send_signal(signal.SIGINT)
        assert watching.wait(60.0) == 0


def _looked(*words: str) -> tuple[str, bool]:
    """Run a verb in a process of its own; return what it says, and whether it used ROS."""
    program = f"import sys; from lupin_cli.main import main; main({words!r}); print('rclpy' in sys.modules)"
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    *said, used = (done.stderr + done.stdout).splitlines()
    return "\n".join(said), used == "True"


@pytest.mark.core
def test_to_look_takes_no_ros(operator: Operator) -> None:
    """What is shown is as new as over ROS, after each of several commands at once."""
    operator.until(lambda: operator.state.lifecycle_state in ("READY", "DONE"), "rest")
    assert _looked("answer") == ("nothing is asked", False)
    operator.hit(9, "stall")
    assert operator.start("1").accepted
    for request, paused in (("pause", True), ("resume", False), ("pause", True)):
        assert operator.ask(request).success
        said, used = _looked("state", "--json")
        assert (json.loads(said)["paused"], used) == (paused, False)
    assert operator.ask("abort").success
    operator.hit(0, "none")
    operator.in_state("DONE")


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP, signal.SIGINT])
def test_an_orchestrator_that_is_gone_is_not_shown(
    how: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not as it was last, whatever became of it; and the next one is shown."""
    with claimed_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
        world, there = World(tmp_path), Operator()
        try:
            _is_gone(how, world, there, domain)
        finally:
            there.ros.close()
            killed = world.stop()
        assert killed == []


def _is_gone(how: signal.Signals, world: World, there: Operator, domain: int) -> None:
    process = world.start("mission_orchestrator")
    there.until(lambda: there.states, "a state")
    there.until(lambda: published_here() is not None, "an answer")
    process.send_signal(how)
    if how == signal.SIGSTOP:  # over ROS the middleware of others may still have it
        assert published_here() is None
        process.send_signal(signal.SIGKILL)
    process.wait(60.0)
    nobody = f"lupin: no orchestrator speaks in ROS domain {domain}; give --domain, or `lupin up`"
    assert _looked("state") == (nobody, True)
    world.start("mission_orchestrator")
    there.until(lambda: published_here() is not None, "an answer of the next one")
    assert _looked("state")[1] is False


@pytest.mark.core
def test_the_record_says_who(operator: Operator, lupin: Say) -> None:
    """The user and the computer, and an id of its own for each command."""
    steps: list[dict[str, Any]] = []
    operator.ros.subscribe(String, STEPS_TOPIC, Qos.BACKLOG, lambda m: steps.append(json.loads(m.data)))

    def asked() -> list[dict[str, str]]:
        return [one["command"] for one in steps if one["step"]["event"] == "operator.reset"]

    operator.until(lambda: steps, "steps")
    before = len(asked())
    lupin("reset")
    lupin("reset")
    operator.until(lambda: len(asked()) == before + 2, "two commands")
    first, second = asked()[-2:]
    assert first["by"] == second["by"] == operator_name()
    assert first["command_id"] != second["command_id"]


@pytest.mark.core
@pytest.mark.parametrize("words", [("state",), ("pause",), ("start", "inspection"), ("answer", "stay")])
def test_nobody_is_there(lupin: Say, words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """Which is another exit code than a refusal."""
    with claimed_domain() as domain, monkeypatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(domain))  # which --domain sets for good
        patch.setattr(operators, "FOUND_S", 0.5)
        text = f"lupin: no orchestrator speaks in ROS domain {domain}; give --domain, or `lupin up`\n"
        assert lupin(*words, "--domain", str(domain)) == (2, text)


def test_what_is_not_answered_is_asked_once_more_by_the_same_id(
    make_node: Callable[..., RosNode], monkeypatch: pytest.MonkeyPatch
) -> None:
    """So whoever carried it out and could not say so does not do it again."""
    with claimed_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        server, asked = make_node("server"), []

        def take(request: Any, response: Any, answer: Callable[[Any], None]) -> None:
            asked.append((request.verb, request.command_id, request.by))
            if len(asked) > 1:
                response.accepted, response.message, response.repeated = True, "pause accepted", True
                answer(response)

        server.serve_later(Command, COMMAND_SERVICE, take)
        commander = Commander()
        monkeypatch.setattr(commander._ros, "spin_once", _both(commander._ros, server))
        answer = commander.command("pause", timeout=1.0)
        commander.close()
    assert (answer.accepted, answer.text) == (True, "pause accepted")
    assert len(asked) == 2
    assert asked[0] == asked[1]
    assert asked[0][1]


def _both(client: RosNode, server: RosNode) -> Callable[[float], bool]:
    """Let the server work whenever the client does."""
    work = client.spin_once

    def spin_once(timeout: float) -> bool:
        server.spin_once(0.005)
        return work(min(timeout, 0.005))

    return spin_once


def test_a_silent_orchestrator_is_told_from_none(
    make_node: Callable[..., RosNode], lupin: Say, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was asked twice. One that was stopped by a debugger, say."""
    with claimed_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        make_node("server").serve_later(Command, COMMAND_SERVICE, lambda *_: None)
        assert lupin("pause") == (2, f"lupin: {COMMAND_SERVICE}: no answer within 3 s\n")
