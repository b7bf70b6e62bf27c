"""What goes wrong around a gateway: nodes that die and come back, clients that do not read, taken ports."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rclpy.duration import Duration
from std_msgs.msg import Int32, String
from std_srvs.srv import Trigger
from websockets.sync.client import connect

from lupin_msgs.msg import Observation
from lupin_ros.adapter.node import Qos, RosNode
from tests.lupin_ros.helpers import spin_until
from tests.lupin_ros.plugins.gateway.conftest import free_port
from tests.lupin_ros.plugins.gateway.page import Page
from tests.lupin_ros.world import World

pytestmark = [pytest.mark.timeout(150)]

OpenPage = Callable[..., Page]


@pytest.mark.node
def test_nodes_die_and_come_back(
    gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """The page keeps its connection and its subscriptions, and is told what is gone."""
    ros, first = make_node("robot"), make_node("orchestrator")
    state = first.publisher(String, "/state", Qos.LATCHED)
    state.publish(String(data="first"))
    first.serve(Trigger, "/pause", lambda request, response: Trigger.Response(message="first"))
    one = page(gateway(), ros, first)
    one.subscribe("/state", "std_msgs/String")
    one.until(lambda: one.messages("/state"), "the first state")
    assert one.call("/pause", "std_srvs/Trigger", {})["message"] == "first"
    one.nodes = [ros]
    first.close()
    gone = "failed: /pause: nobody serves this service now"
    one.until(lambda: one.call("/pause", "std_srvs/Trigger", {}) == gone, "the end of the first")
    second = make_node("orchestrator")
    one.nodes = [ros, second]
    second.publisher(String, "/state", Qos.LATCHED).publish(String(data="second"))
    second.serve(Trigger, "/pause", lambda request, response: Trigger.Response(message="second"))
    one.until(lambda: one.messages("/state")[-1] == {"data": "second"}, "the second state")
    one.until(lambda: one.call("/pause", "std_srvs/Trigger", {}) != gone, "the second service")
    assert one.call("/pause", "std_srvs/Trigger", {})["message"] == "second"
    assert not one.of("close")


@pytest.mark.node
def test_a_stopped_process_takes_nothing_with_it(
    gateway: Callable[..., str],
    page: OpenPage,
    world: World,
    make_node: Callable[..., RosNode],
    tmp_path: Path,
) -> None:
    """The twin is stopped while the heat map asks it; what is published still arrives at once."""
    ros = make_node("robot")
    heard: list[String] = []
    ros.subscribe(String, "/words", Qos.EVENT, heard.append)
    twin = world.start("lupin_twin", store_file=tmp_path / "twin.db")
    one = page(gateway(call_timeout=2.0), ros)
    field = {"sensor_type": "temperature", "resolution": 0.25, "bbox_max_x": 2, "bbox_max_y": 2}
    ask = ("/twin/get_field", "lupin_msgs/GetField", field)
    one.until(lambda: isinstance(one.call(*ask), dict), "a field")
    os.kill(twin.pid, signal.SIGSTOP)
    try:
        hung = [one.begin("call", *ask) for _ in range(10)]
        one.publish("/words", "std_msgs/String", {"data": "pause"})
        one.until(lambda: heard, "the publication", timeout=1.5)
        assert not one.of("answer", n=hung[0])
        answer = one.answer(hung[-1])
        assert answer["value"] == "/twin/get_field: no answer within 2 s; what was asked for may still happen"
    finally:
        twin.kill()
        twin.wait(10.0)
    world.start("lupin_twin", store_file=tmp_path / "twin.db")
    one.until(lambda: isinstance(one.call(*ask), dict), "a field again")


def memory_of(process: subprocess.Popen[bytes]) -> int:
    """Bytes of memory that a process has of its own."""
    status = Path(f"/proc/{process.pid}/status").read_text(encoding="ascii")
    return 1024 * int(status.partition("VmRSS:")[2].split()[0])


@pytest.mark.core
def test_a_client_that_never_reads_costs_little_and_delays_nobody(
    gateway: Callable[..., str], world: World, make_node: Callable[..., RosNode]
) -> None:
    """Ten of them, and 100 MB sent: at most 8 MB each; the one that reads gets all numbers."""
    ros = make_node("robot")
    numbers = ros.publisher(Int32, "/numbers", Qos.TRANSFORMS)
    words = ros.publisher(String, "/words", Qos.EVENT)
    url = gateway()
    with connect(url) as reader:
        reader.send(json.dumps({"op": "subscribe", "topic": "/numbers", "type": "std_msgs/Int32"}))
        deaf = [_deaf(url) for _ in range(10)]
        spin_until([ros], lambda: numbers.get_subscription_count() and words.get_subscription_count())
        before = memory_of(world.processes["lupin_gateway"])
        got = []
        for number in range(1000):
            words.publish(String(data=f"{number:05}" * 20_000))
            numbers.publish(Int32(data=number))
            got.append(json.loads(reader.recv(10.0))["msg"]["data"])
        assert got == list(range(1000))
        assert memory_of(world.processes["lupin_gateway"]) - before < 10 * 8_000_000
        for each in deaf:
            each.close()


def _deaf(url: str) -> socket.socket:
    """A client that subscribes, and then does not read."""
    host, port = url.removeprefix("ws://").partition("/")[0].split(":")
    client = socket.create_connection((host, int(port)))
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    lines = ("GET /_ros HTTP/1.1", f"Host: {host}", "Upgrade: websocket", "Connection: Upgrade")
    lines += ("Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Version: 13", "", "")
    client.sendall("\r\n".join(lines).encode())
    assert client.recv(12) == b"HTTP/1.1 101"
    frame = json.dumps({"op": "subscribe", "topic": "/words", "type": "std_msgs/String"}).encode()
    assert len(frame) < 126
    client.sendall(bytes([0x81, 0x80 | len(frame), 0, 0, 0, 0]) + frame)
    return client


def test_a_slow_client_is_told_what_it_lost(
    gateway: Callable[..., str], make_node: Callable[..., RosNode]
) -> None:
    """Of events as many as fit, and how many did not; afterwards all comes again."""
    ros = make_node("robot")
    observations = ros.publisher(Observation, "/floranova/observations", Qos.BACKLOG)
    with connect(gateway(), max_size=None, max_queue=1) as slow:
        topic = {"op": "subscribe", "topic": "/floranova/observations", "id": "s"}
        slow.send(json.dumps({**topic, "type": "lupin_msgs/Observation"}))
        spin_until([ros], observations.get_subscription_count)
        for number in range(200):
            observations.publish(Observation(mission_id=str(number), status_detail="x" * 100_000))
            # The publisher keeps 50: what the gateway has not taken by then is lost before it.
            assert observations.wait_for_all_acked(Duration(seconds=10.0))
        frames = [json.loads(slow.recv(10.0))]
        while frames[-1]["op"] == "status" or frames[-1]["msg"]["mission_id"] != "199":
            frames.append(json.loads(slow.recv(10.0)))
    told = [each for each in frames if each["op"] == "status"]
    got = [int(each["msg"]["mission_id"]) for each in frames if each["op"] == "publish"]
    assert [each["level"] for each in told] == ["warning"] * len(told)
    lost = sum(int(each["msg"].split(": ")[1].split()[0]) for each in told)
    assert lost > 0
    assert len(got) + lost == 200
    assert got == sorted(got)


def test_a_taken_port_is_told(ros_domain: int) -> None:
    """In a sentence, before anything is started."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        ended = _run("-p", f"port:={port}")
        assert ended.returncode == 2
        told = f"the gateway cannot listen on 127.0.0.1:{port}: Address already in use; "
        assert told in ended.stderr
        assert "Traceback" not in ended.stderr


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (("-p", "events:=['/a']"), "events: '/a' is no TOPIC=NUMBER such as /floranova/observations=50"),
        (("-p", "port:=70000"), "parameter 'port': expected count between 1 and 65535, got 70000"),
    ],
)
def test_wrong_settings_are_told(given: tuple[str, ...], text: str, ros_domain: int) -> None:
    """In a sentence."""
    ended = _run(*given)
    assert ended.returncode in (1, 2)
    assert text in ended.stderr
    assert "Traceback" not in ended.stderr


def _run(*arguments: str) -> subprocess.CompletedProcess[str]:
    lupin = str(Path(sys.executable).with_name("lupin"))
    command = [lupin, "node", "lupin_gateway", "--ros-args", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60)


def test_the_second_port_speaks_on_any_path(gateway: Callable[..., str], world: World) -> None:
    """As rosbridge does; files are on the first one only."""
    second = free_port()
    gateway(rosbridge_port=second)
    with connect(f"ws://127.0.0.1:{second}/anything") as client:
        client.send(json.dumps({"op": "call_service", "service": "/rosapi/get_time", "id": "1"}))
        answer: dict[str, Any] = json.loads(client.recv(10.0))
    assert answer["result"] is True
    with socket.create_connection(("127.0.0.1", second)) as client:
        client.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert client.recv(12) == b"HTTP/1.1 404"
