"""The server on real sockets: its files, and clients that do not read, do not answer, or send too much."""

from __future__ import annotations

import contextlib
import gzip
import json
import logging
import re
import socket
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
import uvicorn
from websockets.exceptions import ConnectionClosed

from lupin_engine.errors import UsageError
from lupin_gateway import server
from lupin_gateway.server import LARGEST_FRAME, Address
from tests.plugins.gateway.served import OpenPage, ServedGateway, until


def status_of(served: ServedGateway) -> Any:
    """What the gateway says of itself."""
    with urlopen(f"http://localhost:{served.port}/status") as answer:
        return json.load(answer)


def asked(served: ServedGateway, path: str, **headers: str) -> Any:
    """The answer to a browser that asks for a file."""
    request = Request(f"http://localhost:{served.port}/{path}", headers=headers)
    with urlopen(request) as answer:
        return answer.headers, answer.read()


def test_the_first_view_is_light_and_kept_by_its_hash(tmp_path: Path) -> None:
    """At most 90 kB on the wire; what the page names is kept for ever, all else asked for anew."""
    with ServedGateway(tmp_path) as served:
        packed = {"Accept-Encoding": "gzip, deflate, br"}
        headers, page = asked(served, "", **packed)
        assert (headers["cache-control"], headers["etag"]) == ("no-cache", None)
        named = re.findall(r'(?:src|href)="([^"]+)"', gzip.decompress(page).decode())
        files = [asked(served, name, **packed) for name in named]
        assert len(page) + sum(len(content) for _, content in files) < 90_000
        for name, (headers, content) in zip(named, files, strict=True):
            plain = content if name == "icon.svg" else gzip.decompress(content)
            assert plain == (server.PAGES / name.partition("?")[0]).read_bytes()
            assert headers["cache-control"] == (
                "no-cache" if "?" not in name else "max-age=31536000, immutable"
            )
        headers, content = asked(served, "console.js?0123456789ab")
        assert (headers["cache-control"], headers["content-encoding"]) == ("no-cache", None)
        assert content == (server.PAGES / "console.js").read_bytes()
        with pytest.raises(HTTPError, match="304"):
            asked(served, "console.js", **{"If-None-Match": headers["etag"]})


def silent_client(port: int, *operations: dict[str, Any]) -> socket.socket:
    """A client that sends operations, answers no ping, and reads only what its test reads."""
    client = socket.socket()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    client.connect(("127.0.0.1", port))
    lines = ("GET /_ros HTTP/1.1", f"Host: localhost:{port}", "Upgrade: websocket", "Connection: Upgrade")
    lines += ("Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Version: 13", "", "")
    client.sendall("\r\n".join(lines).encode())
    assert client.recv(12) == b"HTTP/1.1 101"
    for operation in operations:
        frame = json.dumps(operation).encode()
        assert len(frame) < 126
        client.sendall(bytes([0x81, 0x80 | len(frame), 0, 0, 0, 0]) + frame)
    return client


def test_the_files_and_the_state(tmp_path: Path) -> None:
    """A page for people, and the same for programs."""
    with ServedGateway(tmp_path) as served:
        page = OpenPage(served.port)
        page.send({"op": "subscribe", "topic": "/map", "type": "nav_msgs/OccupancyGrid"})
        page.work_off()
        assert status_of(served) == {
            "clients": 1,
            "topics": {"/map": 1},
            "mode": "robot",
            "name": "page",
            "role": "engineer",
        }
        with urlopen(f"http://localhost:{served.port}/") as answer:
            assert b"<title>Lupin console</title>" in answer.read()
        page.close()
        until(lambda: status_of(served)["clients"] == 0, "the page is gone")


def test_who_does_not_answer_a_ping_is_let_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A link that was cut without a word: its stop stays, its place does not."""
    monkeypatch.setattr(server, "PING_EVERY_S", 0.1)
    monkeypatch.setattr(server, "PING_WITHIN_S", 0.1)
    with ServedGateway(tmp_path) as served:
        client = silent_client(served.port)
        until(lambda: status_of(served)["clients"] == 0, "it is let go")
        client.close()


def test_who_does_not_read_its_answers_is_sent_away(tmp_path: Path) -> None:
    """Replies are never dropped; another page does not notice."""
    with ServedGateway(tmp_path) as served:
        served.robot.answers["/mission/start"] = lambda data: {"error_message": "x" * 500_000}
        calls = [{"op": "call_service", "service": "/mission/start", "id": str(i)} for i in range(20)]
        client = silent_client(served.port, *calls)
        other = OpenPage(served.port)
        until(lambda: status_of(served)["clients"] == 1, "it is sent away")
        other.work_off()
        client.close()
        other.close()


def test_a_frame_that_is_far_too_large_ends_its_connection(tmp_path: Path) -> None:
    """Before it is in memory as a whole; a frame above the limit of the doors is told instead."""
    with ServedGateway(tmp_path) as served:
        page = OpenPage(served.port)
        with contextlib.suppress(ConnectionClosed):  # before all of it was sent
            page.send("x" * (LARGEST_FRAME + 1))
        until(lambda: status_of(served)["clients"] == 0, "closed")
        page.close()


def test_a_defect_ends_no_connection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """It is logged, and what comes next is done."""

    def broken(*_: Any) -> None:
        raise RuntimeError("a defect")

    with ServedGateway(tmp_path) as served, caplog.at_level(logging.ERROR):
        monkeypatch.setattr(served.robot, "advertise", broken)
        page = OpenPage(served.port)
        page.send({"op": "advertise", "topic": "/goal_pose", "type": "geometry_msgs/PoseStamped"})
        page.work_off()
        page.close()
    assert "the gateway has a defect" in caplog.text


def test_a_server_that_ends_by_itself_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The whole gateway ends then, so that it is started again."""

    async def broken(*_: Any) -> bool:
        raise OSError("no more files")

    with ServedGateway(tmp_path) as served:
        monkeypatch.setattr(uvicorn.Server, "on_tick", broken)
        failed = until(lambda: served.failed, "it ends")
    assert str(failed) == "a part of the gateway ended by itself"
    assert str(failed.__cause__) == "no more files"


@pytest.mark.parametrize(
    ("host", "text"),
    [
        ("127.0.0.1", "127.0.0.1:{port}: Address already in use"),
        ("192.0.2.1", "192.0.2.1:{port}: Cannot assign requested address"),
    ],
)
def test_where_it_cannot_listen(host: str, text: str) -> None:
    """In a sentence, with the address."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(UsageError) as told:
            Address(host, port).sockets()
    assert f"the gateway cannot listen on {text.format(port=port)}; " in str(told.value)
