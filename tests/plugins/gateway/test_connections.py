"""Doors, limits, stop and log of connections, over real sockets and real TLS."""

from __future__ import annotations

import base64
import contextlib
import json
import os
import random
import socket
import ssl
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from lupin_engine.plugin.contract import Access
from lupin_gateway import server
from lupin_gateway.access import LONGEST_FRAME, MOST_SUBSCRIPTIONS, IssuedToken, UserRole, Visitor
from lupin_gateway.guard import RESET_STOP
from lupin_gateway.ports import CallFailed
from lupin_gateway.stop import LINK_GRACE_S, OnLinkLost, StopArbiter
from tests.plugins.gateway.served import OpenPage, ServedGateway, until

YEAR_2100 = 4_102_444_800.0
TOKENS = {
    name: IssuedToken(Visitor(name, role, expires), letter * 40)
    for name, role, expires, letter in (
        ("eve", UserRole.VIEWER, YEAR_2100, "e"),
        ("anna", UserRole.OPERATOR, YEAR_2100, "a"),
        ("ben", UserRole.OPERATOR, YEAR_2100, "b"),
        ("cleo", UserRole.ENGINEER, 1_000_000.0, "c"),
    )
}
PAUSE, START = "/mission/pause", "/mission/start"


@pytest.fixture
def gateway(tmp_path: Path) -> Iterator[ServedGateway]:
    """One for this machine alone."""
    with ServedGateway(tmp_path) as served:
        yield served


@pytest.fixture
def guarded(tmp_path: Path) -> Iterator[ServedGateway]:
    """One that asks for tokens."""
    with ServedGateway(tmp_path, tokens=list(TOKENS.values())) as served:
        yield served


def page_of(name: str, gateway: ServedGateway, **more: Any) -> OpenPage:
    """Open a page with somebody's token."""
    return OpenPage(gateway.port, authorization=f"Bearer {TOKENS[name].secret}", **more)


# -- the stop ---------------------------------------------------------------------------------------------


def test_two_pages_one_stopped(gateway: ServedGateway) -> None:
    """ROS hears one stop and no release while the other page says steadily that it runs."""
    stopped, running = OpenPage(gateway.port), OpenPage(gateway.port)
    stopped.stop(True)
    until(lambda: gateway.stop_told[-1:] == [True], "the stop is told")
    at = len(gateway.stop_told)
    for _ in range(20):
        running.stop(False)
        stopped.stop(True)
    for page in (running, stopped):
        page.work_off()
    until(lambda: len(gateway.stop_told) > at + 3, "it is told steadily")
    assert set(gateway.stop_told[at:]) == {True}
    stopped.stop(False)
    until(lambda: gateway.stop_told[-1] is False, "it is released by who engaged it")
    assert [line["sent"]["data"] for line in wait_for_lines(gateway, 2)] == [True, False]


def wait_for_lines(gateway: ServedGateway, count: int) -> list[dict[str, Any]]:
    """Wait until so many lines are in the log."""
    until(lambda: len(gateway.lines()) >= count, f"{count} lines; so far {gateway.lines()}")
    return gateway.lines()


def test_a_page_gone_stopped_and_reset_by_name(gateway: ServedGateway) -> None:
    """However it goes, its stop stays; what is called is told to pages, and reset by that name."""
    for leave in (OpenPage.close, OpenPage.cut):
        page, other = OpenPage(gateway.port), OpenPage(gateway.port)
        page.stop(True)
        page.work_off()
        leave(page)
        until(lambda: gateway.states[-1]["stops"] and gateway.states[-1]["stops"][0]["left"], "it is left")
        other.stop(False)
        other.work_off()
        assert gateway.rules.stops.stopped
        (left,) = gateway.states[-1]["stops"]
        wrong = other.call(RESET_STOP, name="page")["values"]
        assert wrong == {
            "success": False,
            "message": f"no stop is called 'page'; engaged are: {left['name']}",
        }
        right = other.call(RESET_STOP, name=left["name"])["values"]
        assert right == {"success": True, "message": f"the stop of {left['name']} is released"}
        assert not gateway.rules.stops.stopped
        other.close()


def test_a_browser_that_loads_its_page_anew(gateway: ServedGateway) -> None:
    """The cookie of the first connection proves that it is the same: it takes its stop with it."""
    first = OpenPage(gateway.port)
    assert first.socket.response is not None
    cookie = first.socket.response.headers["set-cookie"]
    assert {"HttpOnly", "SameSite=Strict", "Path=/"} <= set(cookie.split("; "))
    first.stop(True)
    first.work_off()
    first.close()
    again = OpenPage(gateway.port, cookie=cookie.partition(";")[0])
    again.stop(True)
    again.stop(False)
    again.work_off()
    assert not gateway.rules.stops.stopped


def test_a_half_open_connection(
    gateway: ServedGateway, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Who answers no ping is gone: its stop is left, and the last operator's link is lost."""
    monkeypatch.setattr(server, "PING_EVERY_S", 0.1)
    monkeypatch.setattr(server, "PING_WITHIN_S", 0.2)
    with ServedGateway(tmp_path / "other", stops=StopArbiter(OnLinkLost.PAUSE)) as served:
        silent = raw_page(served)
        send_raw(silent, {"op": "publish", "topic": "/lupin/hmi/estop", "msg": {"data": True}})
        until(lambda: any(stop["left"] for stop in served.states[-1]["stops"]), "it is noticed")
        served.ahead = LINK_GRACE_S
        until(lambda: len(served.pauses) == 1, "a pause is asked for")
        silent.close()


@pytest.mark.slow
def test_sockets_on_which_nothing_comes(gateway: ServedGateway) -> None:
    """Connected and silent, or in the middle of a request: nobody else waits for them."""
    silent = []
    for number in range(200):
        silent.append(socket.create_connection(("127.0.0.1", gateway.port), 20))
        silent[-1].sendall(b"GET /_ros HTTP/1.1\r\nHost: loc"[: number % 30])
    page = OpenPage(gateway.port)
    page.stop(True)
    until(lambda: gateway.stop_told[-1], "the stop is told", 5.0)
    for one in silent:
        one.close()


def raw_page(gateway: ServedGateway) -> socket.socket:
    """Connect without a library, which would answer pings."""
    opened = socket.create_connection(("127.0.0.1", gateway.port), 20)
    key = base64.b64encode(os.urandom(16)).decode()
    lines = [
        "GET /_ros HTTP/1.1",
        f"Host: localhost:{gateway.port}",
        "Connection: Upgrade",
        "Upgrade: websocket",
    ]
    lines += [f"Sec-WebSocket-Key: {key}", "Sec-WebSocket-Version: 13", "", ""]
    opened.sendall("\r\n".join(lines).encode())
    answer = b""
    while not answer.endswith(b"\r\n\r\n"):
        answer += opened.recv(1)
    assert b" 101 " in answer
    return opened


def send_raw(opened: socket.socket, operation: Any) -> None:
    """Send a frame of less than 126 bytes, masked with zeros."""
    data = json.dumps(operation).encode()
    opened.sendall(bytes([0x81, 0x80 | len(data), 0, 0, 0, 0]) + data)


@pytest.mark.parametrize("mode", list(OnLinkLost))
def test_a_link_cut_for_half_a_minute(tmp_path: Path, mode: OnLinkLost) -> None:
    """One decision, one reconnection, no command twice, and nothing moves that was not asked to."""
    with ServedGateway(tmp_path, stops=StopArbiter(mode)) as gateway:
        gateway.robot.answers[PAUSE] = gateway.robot.answers[START] = lambda _: {"success": True}
        page = OpenPage(gateway.port)
        page.call(START)
        page.cut()
        until(lambda: not gateway.states[-1]["operators"], "the page is gone")
        for second in range(31):
            gateway.ahead = float(second)
            gateway.call(gateway.rules.tick)
        back = OpenPage(gateway.port)
        back.stop(False)
        back.work_off()
        assert len(gateway.pauses) == (mode is OnLinkLost.PAUSE)
        assert [stop["name"] for stop in gateway.states[-1]["stops"]] == ["link"] * (mode is OnLinkLost.STOP)
        changes = [b for a, b in zip([False, *gateway.stop_told], gateway.stop_told, strict=False) if a != b]
        assert changes == [True] * (mode is OnLinkLost.STOP)
        assert gateway.robot.called == [(START, {})]
        assert gateway.robot.published == []
        for pause in gateway.pauses:
            pause({"success": False, "message": "nothing is running"})
        expected = {OnLinkLost.CONTINUE: [], OnLinkLost.PAUSE: ["pause"], OnLinkLost.STOP: ["stop"]}[mode]
        lines = wait_for_lines(gateway, 1 + len(expected))
        assert [line["name"] for line in lines] == [START, *expected]


def test_a_pause_for_a_lost_link_is_asked_for_until_somebody_answers(tmp_path: Path) -> None:
    """The orchestrator may be dead when the link is lost, and go on by itself when it is started again."""
    with ServedGateway(tmp_path, stops=StopArbiter(OnLinkLost.PAUSE)) as gateway:
        page = OpenPage(gateway.port)
        until(lambda: gateway.states[-1]["operators"], "the page is there")
        page.cut()
        until(lambda: not gateway.states[-1]["operators"], "the page is gone")

        def tick(second: float) -> int:
            gateway.ahead = second
            gateway.call(gateway.rules.tick)
            return len(gateway.pauses)

        assert tick(LINK_GRACE_S) == 1
        gateway.call(lambda: gateway.pauses[0](CallFailed("nobody serves this service now")))
        assert [tick(LINK_GRACE_S + later) for later in (0.5, 1.1, 5.0)] == [1, 2, 2]
        gateway.call(lambda: gateway.pauses[1](CallFailed("nobody serves this service now")))
        assert tick(9.0) == 3
        gateway.call(lambda: gateway.pauses[2]({"success": True, "message": "pause accepted"}))
        assert tick(30.0) == 3
        lines = wait_for_lines(gateway, 2)
        assert [line["answer"] for line in lines] == ["nobody serves this service now", "pause accepted"]


# -- roles ------------------------------------------------------------------------------------------------


def test_what_each_role_may(guarded: ServedGateway) -> None:
    """A viewer reads, an operator commands; what is refused is answered and is a line of the log."""
    guarded.robot.answers[PAUSE] = lambda _: {"success": True, "message": "paused"}
    guarded.robot.answers["/twin/get_field"] = lambda _: {"ok": True}
    eve, anna = page_of("eve", guarded), page_of("anna", guarded)
    refused = eve.call(PAUSE)
    text = "calling /mission/pause needs the role operator; eve is viewer"
    assert (refused["result"], refused["values"], eve.statuses()) == (False, text, [text])
    assert eve.call("/twin/get_field")["result"] is True
    eve.send({"op": "publish", "topic": "/goal_pose", "msg": {}})
    eve.send({"op": "send_action_goal", "action": "/navigate_to_pose", "action_type": "a/B", "id": "g"})
    eve.send({"op": "subscribe", "topic": "/mission/state"})
    eve.work_off()
    assert eve.statuses()[1:] == [
        "publishing on /goal_pose needs the role operator; eve is viewer",
        "commanding the action /navigate_to_pose needs the role operator; eve is viewer",
    ]
    assert anna.call(PAUSE)["values"] == {"success": True, "message": "paused"}
    assert guarded.robot.called == [("/twin/get_field", {}), (PAUSE, {})]
    assert (guarded.robot.published, guarded.robot.goals) == ([], [])
    assert guarded.robot.listened == ["/mission/state"]
    lines = wait_for_lines(guarded, 4)
    assert [(line["who"], line["what"], line["accepted"]) for line in lines] == [
        ("eve", "call_service", False),
        ("eve", "publish", False),
        ("eve", "send_action_goal", False),
        ("anna", "call_service", True),
    ]
    assert lines[3]["answer"] == "paused"
    assert (lines[3]["role"], lines[3]["from"], lines[3]["page"]) == ("operator", "127.0.0.1", "anna-2")


def test_a_viewer_stops_and_an_operator_releases(guarded: ServedGateway) -> None:
    """Who sees a danger may stop; whether it is over is for an operator to say."""
    eve, anna = page_of("eve", guarded), page_of("anna", guarded)
    eve.stop(True)
    until(lambda: guarded.stop_told[-1], "the stop is told")
    eve.stop(False)
    assert eve.told() == ["only an operator releases a stop: reset the stop 'eve-1'"]
    refused = eve.call(RESET_STOP, name="eve-1")
    assert refused["values"] == "calling /lupin/hmi/reset_stop needs the role operator; eve is viewer"
    assert guarded.rules.stops.stopped
    assert anna.call(RESET_STOP, name="eve-1")["values"]["success"] is True
    assert not guarded.rules.stops.stopped


def test_a_token_that_expires_while_the_page_is_open(tmp_path: Path) -> None:
    """It commands no more and releases nothing; to stop it may still."""
    clock = [1_790_000_000.0]
    token = IssuedToken(Visitor("anna", UserRole.OPERATOR, 1_790_000_100.0), "a" * 40)
    with ServedGateway(tmp_path, tokens=[token], wall=lambda: clock[0]) as gateway:
        gateway.rules.access._tokens = lambda: [
            IssuedToken(Visitor("anna", UserRole.OPERATOR, YEAR_2100), "a" * 40)
        ]
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(gateway.rules.access, "admit", lambda *_: token.visitor)
            page = page_of("anna", gateway)
        clock[0] += 200.0
        text = "the token of anna has expired with 2026-09-21; ask for a new one"
        assert page.call(PAUSE)["values"] == text
        page.stop(True)
        page.stop(False)
        assert page.told(2)[1] == text
        assert gateway.rules.stops.stopped


@pytest.mark.parametrize(
    ("token", "origin", "status", "text"),
    [
        ("", "", 401, "a token is needed: log in at /login, or send it as Authorization: Bearer TOKEN"),
        ("x" * 40, "", 401, "this token is nobody's; ask who runs the gateway for one"),
        ("c" * 40, "", 401, "the token of cleo has expired with 1970-01-12; ask for a new one"),
        (
            "a" * 40,
            "https://evil.example",
            403,
            "pages of 'https://evil.example' may not use this gateway; its setting `origins` lets them",
        ),
    ],
    ids=["missing", "wrong", "expired", "foreign origin"],
)
def test_who_does_not_come_in(
    guarded: ServedGateway, token: str, origin: str, status: int, text: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Neither to the protocol nor to any file; a token in the address is none, and none is logged."""
    caplog.set_level(0)
    given = {"authorization": f"Bearer {token}" if token else "", "origin": origin}
    headers = {name: value for name, value in given.items() if value}
    with pytest.raises(InvalidStatus) as refused:
        connect(f"ws://localhost:{guarded.port}/_ros?token={'a' * 40}", additional_headers=headers)
    assert refused.value.response.status_code == status
    assert refused.value.response.body == f"{text}\n".encode()
    for path in ("/", "/status", "/nothing"):
        address = f"http://localhost:{guarded.port}{path}?token={'a' * 40}"
        with pytest.raises(urllib.error.HTTPError) as answer:
            urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=20)
        assert (answer.value.code, answer.value.read().decode()) == (status, f"{text}\n")
    logged = [record.getMessage() for record in caplog.records if record.name.startswith("lupin")]
    assert not [message for message in logged if "a" * 40 in message]
    assert "a" * 40 not in guarded.log.read_text(encoding="utf-8")


def test_a_foreign_page_without_tokens(gateway: ServedGateway) -> None:
    """A page of the network cannot use the browser of who sits at this machine."""
    for headers in ({"origin": "https://evil.example"}, {"origin": "null"}):
        with pytest.raises(InvalidStatus) as refused:
            connect(f"ws://localhost:{gateway.port}/", additional_headers=headers)
        assert refused.value.response.status_code == 403
    page = OpenPage(gateway.port, origin="http://localhost:8080")
    page.work_off()


# -- TLS and the page to log in ------------------------------------------------------------------------------


def test_tls_and_logging_in(tmp_path: Path) -> None:
    """The browser gets a cookie that only this site gets back, over TLS; wrong tokens get words."""
    trustme = pytest.importorskip("trustme")
    authority = trustme.CA()
    certificate = authority.issue_cert("localhost")
    certificate.cert_chain_pems[0].write_to_path(str(tmp_path / "cert.pem"))
    certificate.private_key_pem.write_to_path(str(tmp_path / "key.pem"))
    trust = ssl.create_default_context()
    authority.configure_trust(trust)
    # TLS 1.3 sends tickets after the handshake: the reading thread of the client wakes, and waits for data
    # inside OpenSSL while the request is written. Seldom, that request never arrives.
    trust.maximum_version = ssl.TLSVersion.TLSv1_2
    tls = {"ssl_certfile": str(tmp_path / "cert.pem"), "ssl_keyfile": str(tmp_path / "key.pem")}
    with ServedGateway(tmp_path, tokens=list(TOKENS.values()), tls=tls) as gateway:
        base = f"https://localhost:{gateway.port}"
        opener = urllib.request.build_opener(urllib.request.HTTPSHandler(context=trust), _NoRedirects())
        with pytest.raises(urllib.error.HTTPError) as sent_on:
            opener.open(urllib.request.Request(base, headers={"accept": "text/html"}), timeout=20)
        sent_on.value.close()
        assert (sent_on.value.code, sent_on.value.headers["location"]) == (303, "/login")
        with opener.open(f"{base}/login", timeout=20) as form:
            assert 'type="password"' in form.read().decode()
        assert log_in(opener, base, "x" * 40) == (401, "")
        assert log_in(opener, base, "y" * 5000) == (413, "")
        assert log_in(opener, base, TOKENS["anna"].secret, origin="https://evil.example") == (403, "")
        status, cookie = log_in(opener, base, TOKENS["anna"].secret)
        assert status == 303
        assert {"HttpOnly", "Secure", "SameSite=Strict", "Path=/"} <= set(cookie.split("; "))
        page = OpenPage(gateway.port, trust, cookie=cookie.partition(";")[0], origin=base)
        page.work_off()
        page.close()
        with socket.create_connection(("127.0.0.1", gateway.port), 20) as plain:
            plain.sendall(b"GET / HTTP/1.1\r\nhost: localhost\r\n\r\n")
            assert b"HTTP" not in plain.recv(100)


class _NoRedirects(urllib.request.HTTPRedirectHandler):
    """Shows where one would be sent on to."""

    def redirect_request(self, *_: Any) -> None:
        return None


def log_in(opener: urllib.request.OpenerDirector, base: str, token: str, origin: str = "") -> tuple[int, str]:
    """Send the form, and return the status with the cookie."""
    data = urllib.parse.urlencode({"token": token}).encode()
    request = urllib.request.Request(f"{base}/login", data=data, headers={"origin": origin or base})
    with pytest.raises(urllib.error.HTTPError) as answer:
        opener.open(request, timeout=20)
    answer.value.close()
    return answer.value.code, answer.value.headers.get("set-cookie", "")


# -- floods and broken frames -----------------------------------------------------------------------------


def test_frames_that_are_no_operations(gateway: ServedGateway) -> None:
    """Each gets its words, and the connection stays."""
    page = OpenPage(gateway.port)
    frames = [
        "",
        "nonsense",
        "[]",
        "1",
        '{"op": 7}',
        b"\x00\xff",
        '{"op": "fly"}',
        '{"op":"publish"}',
        "{" * 5000,
    ]
    for number, frame in enumerate(frames, 1):
        page.send(frame)
        page.told(number)
    page.work_off()
    assert len(page.statuses()) == len(frames)


def test_frames_that_are_nested_deep(gateway: ServedGateway) -> None:
    """They are read, answered and written down like others."""
    page, deep = OpenPage(gateway.port), "[" * 400 + "]" * 400
    gateway.robot.answers[PAUSE] = lambda _: {"success": True}
    for service in (PAUSE, "/nobody", RESET_STOP):
        args = f'{{"name": {deep}}}'
        page.send(f'{{"op": "call_service", "service": "{service}", "args": {args}, "id": "{service}"}}')
        until(lambda: [f for f in page.frames if f.get("service") == service], "an answer")  # noqa: B023
    page.send(f'{{"op": "publish", "topic": "/goal_pose", "msg": {deep}}}')
    page.work_off()
    assert gateway.robot.published
    names = [line["name"] for line in wait_for_lines(gateway, 4)]
    assert names == [PAUSE, "/nobody", RESET_STOP, "/goal_pose"]


def test_frames_at_random(gateway: ServedGateway) -> None:
    """Operations cut, doubled and bent: no connection ends, and no command is made of them."""
    chance, page = random.Random(7), OpenPage(gateway.port)
    good = [
        {"op": "subscribe", "topic": "/mission/state", "type": "lupin_msgs/MissionState"},
        {"op": "call_service", "service": "/mission/dock", "args": {}, "id": "a"},
        {"op": "publish", "topic": "/goal_pose", "msg": {"pose": {"position": {"x": 1.0}}}},
    ]
    for _ in range(300):
        text = list(json.dumps(chance.choice(good)))
        for _ in range(chance.randint(1, 5)):
            text[chance.randrange(len(text))] = chance.choice('"{}[]:,\\x00 é')
        page.send("".join(text))
        page.work_off()
        gateway.ahead += 0.05
    called = {service for service, _ in gateway.robot.called}
    assert called <= {"/mission/dock"}


def test_a_frame_that_is_too_long(gateway: ServedGateway) -> None:
    """It is told and nothing of it is carried out; the connection stays, and so does a stop."""
    page = OpenPage(gateway.port)
    long = {"op": "call_service", "service": PAUSE, "args": {"text": "a" * LONGEST_FRAME}, "id": "x"}
    page.send(long)
    size = len(json.dumps(long))
    assert page.told() == [
        f"the frame has {size} bytes, at most 1000000 are taken; nothing of it was carried out"
    ]
    page.send(json.dumps({"op": "fly", "x": "é" * 600_000}, ensure_ascii=False))
    assert page.told(2)[1].startswith("the frame has 1200")
    page.stop(True)
    until(lambda: gateway.stop_told[-1], "the stop is told")
    assert gateway.robot.called == []


def test_a_flood_of_operations_and_a_stop_in_it(gateway: ServedGateway) -> None:
    """More than a hundred a second are refused in words, but for a stop; another page is served as ever."""
    flood, other = OpenPage(gateway.port), OpenPage(gateway.port)
    gateway.robot.answers[PAUSE] = lambda _: {"success": True}
    for number in range(2000):
        flood.send({"op": "call_service", "service": PAUSE, "args": {}, "id": str(number)})
    flood.stop(True)
    until(lambda: gateway.stop_told[-1], "the stop is told")
    assert other.call(PAUSE)["values"] == {"success": True}
    until(lambda: len([f for f in flood.frames if f["op"] == "service_response"]) == 2000, "all are answered")
    refused = [f for f in flood.frames if f["op"] == "service_response" and not f["result"]]
    assert {f["values"] for f in refused} == {
        "more than 100 operations a second; this one was not carried out"
    }
    assert 100 <= len(gateway.robot.called) < 1000


@pytest.mark.parametrize("frame", [b"\x81\x80", b"\x89\x80"], ids=["empty frames", "pings"])
def test_a_flood_of_frames_does_not_keep_other_pages_waiting(gateway: ServedGateway, frame: bytes) -> None:
    """However many of one page are there already: those of another one come between."""
    flood, page, took, ended = raw_page(gateway), OpenPage(gateway.port), list[float](), threading.Event()

    def send() -> None:
        with contextlib.suppress(OSError):
            while not ended.is_set():
                flood.sendall((frame + bytes(4)) * 20_000)

    def read() -> None:
        with contextlib.suppress(OSError):
            while flood.recv(1_000_000):
                pass

    threads = [threading.Thread(target=each) for each in (send, read)]
    for thread in threads:
        thread.start()
    for number in range(1, 12):
        began = time.monotonic()
        page.stop(bool(number % 2))
        until(lambda: gateway.stop_told[-1] is bool(number % 2), "it is told")  # noqa: B023
        took.append(time.monotonic() - began)
    ended.set()
    flood.shutdown(socket.SHUT_RDWR)
    for thread in threads:
        thread.join()
    flood.close()
    assert sorted(took)[5] < 0.3  # without turns it is seconds


def test_stops_are_not_counted(gateway: ServedGateway) -> None:
    """A page that tells its stop a thousand times may command all the same."""
    page = OpenPage(gateway.port)
    for number in range(1001):
        page.stop(number % 2 == 0)
    assert page.call("/rosapi/get_time")["result"] is True
    assert gateway.rules.stops.stopped


def test_a_flood_of_long_frames_is_not_read(gateway: ServedGateway) -> None:
    """A client that is too fast gets only frames read that may be a stop."""
    page = OpenPage(gateway.port)
    for _ in range(300):
        page.send({"op": "call_service", "service": PAUSE, "args": {"text": "a" * 5000}})
    page.stop(True)
    until(lambda: gateway.stop_told[-1], "the stop is told")
    assert len(gateway.robot.called) < 300


@pytest.mark.slow
def test_a_flood_of_subscriptions(gateway: ServedGateway) -> None:
    """64 are taken; ten thousand topics make no more of ROS than these."""
    page = OpenPage(gateway.port)
    for number in range(10_000):
        page.send({"op": "subscribe", "topic": f"/t{number}", "id": f"s{number}"})
        if number % 90 == 0:
            page.work_off()
            gateway.ahead += 1.0
    text = f"a client has at most {MOST_SUBSCRIPTIONS} subscriptions; unsubscribe from something first"
    until(lambda: text in page.statuses(), "it is told")
    gateway.ahead += 1.0
    page.send({"op": "subscribe", "topic": "/t1", "id": "once more"})
    page.work_off()
    assert page.statuses()[-1] == text
    assert len(gateway.robot.listened) == MOST_SUBSCRIPTIONS
    page.send({"op": "unsubscribe", "topic": "/t0", "id": "s0"})
    page.send({"op": "subscribe", "topic": "/t9999", "id": "s9999"})
    page.work_off()
    assert gateway.robot.listened[-1] == "/t9999"


def test_a_client_that_never_reads(gateway: ServedGateway) -> None:
    """It is sent away, delays nobody, and the stop it told stays."""
    gateway.robot.answers["/twin/get_field"] = lambda _: {"ok": True, "error_message": "x" * 400_000}
    silent, other = raw_page(gateway), OpenPage(gateway.port)
    send_raw(silent, {"op": "publish", "topic": "/lupin/hmi/estop", "msg": {"data": True}})
    for _ in range(60):
        send_raw(silent, {"op": "call_service", "service": "/twin/get_field"})
    until(lambda: any(stop["left"] for stop in gateway.states[-1]["stops"]), "it is sent away")
    assert other.call(RESET_STOP, name="page-1")["values"]["success"] is True
    silent.close()


# -- two at once ------------------------------------------------------------------------------------------


def test_answers_do_not_wait_for_each_other(gateway: ServedGateway) -> None:
    """Two answers in a row: the second one is not kept back until the first one is acknowledged."""
    page, took = OpenPage(gateway.port), []
    for number in range(20):
        began = time.monotonic()
        for name in "ab":
            page.send({"op": "call_service", "service": "/rosapi/get_time", "id": f"{number}{name}"})
        until(lambda: len(page.frames) == 2 * number + 2, "both are answered")  # noqa: B023
        took.append(time.monotonic() - began)
    assert sorted(took)[10] < 0.03


def test_two_operators_at_once(guarded: ServedGateway) -> None:
    """Every command is carried out once, in the order of its page, and each has its line."""
    guarded.robot.answers[START] = lambda data: {"accepted": True, "mission_id": data["mission_type"]}
    pages = {name: page_of(name, guarded) for name in ("anna", "ben")}

    def work(name: str) -> None:
        for number in range(30):
            pages[name].call(START, f"{name}{number}", mission_type=f"{name}{number}")

    threads = [threading.Thread(target=work, args=(name,)) for name in pages]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    asked = [data["mission_type"] for _, data in guarded.robot.called]
    for name in pages:
        assert [one for one in asked if one.startswith(name)] == [f"{name}{n}" for n in range(30)]
    lines = wait_for_lines(guarded, 60)
    assert sorted((line["who"], line["mission_id"]) for line in lines) == sorted(
        (name, f"{name}{number}") for name in pages for number in range(30)
    )


def test_names_of_a_site(tmp_path: Path) -> None:
    """A setting offers what nobody declares."""
    with ServedGateway(tmp_path, extra=Access(engineer=("/pump/*",))) as gateway:
        gateway.robot.answers["/pump/on"] = lambda _: {"success": True}
        page = OpenPage(gateway.port)
        assert page.call("/pump/on")["values"] == {"success": True}
        assert page.call("/tap/on")["values"].startswith("calling /tap/on is not offered to pages")


def test_from_outside_nobody_connects(gateway: ServedGateway) -> None:
    """At another address of this machine nothing listens."""
    others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None)} - {"127.0.0.1", "::1"}
    others.add("127.0.0.2")  # also of this machine, and not the one listened on
    for address in others:
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection((str(address), gateway.port), 5).close()
