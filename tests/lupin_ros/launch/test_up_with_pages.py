"""`lupin up --hmi` with real processes: a page works, a service hangs, and each process dies once."""

from __future__ import annotations

import json
import os
import signal
import time
import urllib.request
from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")

from std_msgs.msg import Bool

from lupin_msgs.msg import MissionState
from lupin_ros.adapter.node import Qos, RosNode
from tests.lupin_ros.helpers import spin_until
from tests.lupin_ros.launch.processes import Lupin
from tests.lupin_ros.plugins.gateway.conftest import free_port
from tests.plugins.gateway.served import OpenPage, until

pytestmark = [
    pytest.mark.timeout(300),
    pytest.mark.filterwarnings("ignore:module 'sre_.*' is deprecated:DeprecationWarning"),
]

COMMAND, FIELD = "/mission_orchestrator/command", "/twin/get_field"
#: What 99 of 100 stops and pauses may take from the page to ROS, in seconds: a bound for busy machines.
AT_ONCE = 0.5


@pytest.fixture
def up(lupin: Callable[..., Lupin], tmp_path: Any) -> Lupin:
    """All nodes with a gateway, ready."""
    # A robot that is silent for 2 s counts as stopped; on a busy machine it is only not let work.
    patient = ("--set", "estop_timeout_s=20 s")
    started = lupin("up", "--hmi", "--set", f"lupin_gateway.port={free_port()}", *patient, "--separate")
    started.until_line("Ctrl-C stops everything")
    return started


@pytest.fixture
def port(up: Lupin) -> int:
    """Where the gateway says that it is."""
    (line,) = [line for line in up.lines if "pages at http://127.0.0.1:" in line]
    return int(line.rpartition(":")[2])


@pytest.fixture
def listener(up: Lupin, monkeypatch: pytest.MonkeyPatch) -> Iterator[RosNode]:
    """A node of the robot."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(up.domain))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    node = RosNode("listener")
    yield node
    node.close()


def ready(page: OpenPage) -> Callable[[], bool]:
    """Whether the newest state that a page has is READY."""

    def is_ready() -> bool:
        states = [f["msg"]["lifecycle_state"] for f in page.frames if f.get("topic") == "/mission/state"]
        return states[-1:] == ["READY"]

    return is_ready


def command(verb: str, id_: str = "", **more: Any) -> dict[str, Any]:
    """The request of the command service."""
    return {"verb": verb, "mission": "", "request": "", "command_id": id_, "by": "test", **more}


def delays(
    listener: RosNode, page: OpenPage, heard: list[float], act: Callable[[int], None], times: int
) -> list[float]:
    """Act, and wait until something more is heard; return how long each took."""
    found = []
    for number in range(times):
        before = len(heard)
        began = time.monotonic()
        act(number)
        try:
            spin_until([listener], lambda: len(heard) > before)  # noqa: B023
        except AssertionError:
            answers = [f for f in page.frames if f["op"] == "status" or str(f.get("id", "")).startswith("n")]
            pytest.fail(f"nothing heard, time {number}; answers: {answers[-4:]}")
        found.append(heard[before] - began)
    return found


def test_a_page_while_a_service_hangs_and_processes_die(up: Lupin, port: int, listener: RosNode) -> None:
    """Start once, stop and pause past a hanging twin, orchestrator and gateway killed and back."""
    page = OpenPage(port)
    page.send({"op": "subscribe", "topic": "/mission/state", "type": "lupin_msgs/MissionState"})
    until(ready(page), "READY", 60.0)

    # The same command twice: one mission.
    begin = command("start", "6f1c0d3e-0000-4000-8000-000000000001", mission="InspectionMission")
    first, second = (page.call(COMMAND, f"start-{n}", **begin)["values"] for n in (1, 2))
    assert first["accepted"], first
    assert (second["mission_id"], second["step"]) == (first["mission_id"], first["step"])
    assert (first["repeated"], second["repeated"]) == (False, True)

    # The twin hangs with the heat map on; stop and pause come through.
    stops: list[float] = []
    last = [False]

    def on_stop(message: Bool) -> None:
        if message.data is not last[0]:
            last[0] = message.data
            stops.append(time.monotonic())

    pauses: list[float] = []
    paused = [False]

    def on_state(message: MissionState) -> None:
        if message.paused is not paused[0]:
            paused[0] = message.paused
            pauses.append(time.monotonic())

    listener.subscribe(Bool, "/lupin/hmi/estop", Qos.EVENT, on_stop)
    listener.subscribe(MissionState, "/mission/state", Qos.LATCHED, on_state)
    spin_until(
        [listener], lambda: listener.node.count_publishers("/lupin/hmi/estop") == 1, what="the publisher"
    )
    twin = up.pid_of("lupin_twin")
    os.kill(twin, signal.SIGSTOP)
    try:
        for number in range(20):
            page.send(
                {"op": "call_service", "service": FIELD, "id": f"map-{number}", "args": {"resolution": 0.25}}
            )
        asked = ["pause", "resume"]
        took = {
            "pause": delays(
                listener,
                page,
                pauses,
                lambda n: page.send(
                    {"op": "call_service", "service": COMMAND, "id": f"n{n}", "args": command(asked[n % 2])}
                ),
                20,
            )
        }
        took["stop"] = delays(listener, page, stops, lambda n: page.stop(n % 2 == 0), 200)
        for what, each in took.items():
            ordered = sorted(each)
            p50, p99, most = (1000 * ordered[n] for n in (len(each) // 2, len(each) * 99 // 100 - 1, -1))
            which = each.index(ordered[-1])
            print(f"{what}: p50 {p50:.1f} ms, p99 {p99:.1f} ms, most {most:.1f} ms (number {which})")
            assert p99 < 1000 * AT_ONCE, (what, ordered)

        def fields() -> list[dict[str, Any]]:
            return [f for f in page.frames if str(f.get("id", "")).startswith("map-")]

        until(lambda: len(fields()) == 20, "an answer to each")
        assert {f["result"] for f in fields()} == {False}  # the twin hung all the time
    finally:
        os.kill(twin, signal.SIGCONT)

    # The orchestrator dies with a mission under way: the next one holds it, on the same connection.
    os.kill(up.pid_of("mission_orchestrator"), signal.SIGKILL)
    up.until_line("mission_orchestrator is started again in 1 s (1 of 3)")
    up.until_line(f"InspectionMission {first['mission_id']} was under way")

    def held() -> bool:
        states = [f["msg"] for f in page.frames if f.get("topic") == "/mission/state"]
        return bool(states[-1]["paused"] and states[-1]["last_error"].startswith("restarted: "))

    until(held, "the mission is held", 60.0)
    up.until_line("mission_orchestrator is back; it was gone since ")

    # A page that was stopped, and the gateway dies: both come back stopped.
    page.stop(True)
    spin_until([listener], lambda: last == [True], what="the stop")
    kept = up.state / "lupin" / f"gateway-{up.domain}" / "stops.json"
    until(lambda: json.loads(kept.read_text())["stops"], "the stop is on the disk")
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/status", timeout=20) as status:
        assert json.loads(status.read())["clients"] == 1
    os.kill(up.pid_of("lupin_gateway"), signal.SIGKILL)
    up.until_line("lupin_gateway is started again in 1 s (1 of 3)")
    heard = len(stops)

    def reconnect() -> OpenPage | None:
        try:
            return OpenPage(port)
        except OSError:
            return None

    again = until(reconnect, "the gateway answers again", 60.0)
    again.send({"op": "subscribe", "topic": "/lupin/hmi/stops", "type": "std_msgs/String"})
    shown = until(lambda: [f for f in again.frames if f.get("topic") == "/lupin/hmi/stops"], "the stops")
    (left,) = json.loads(shown[-1]["msg"]["data"])["stops"]
    assert left["left"] is True
    assert again.call("/lupin/hmi/reset_stop", name=left["name"])["values"]["success"] is True
    spin_until([listener], lambda: len(stops) > heard and last == [False], what="the release")
    assert len(stops) == heard + 1
    for one in (page, again):
        one.close()
    up.process.send_signal(signal.SIGINT)
    assert up.end() == 0, up.output
