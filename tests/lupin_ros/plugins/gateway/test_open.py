"""A gateway as its own process: closed to other addresses, or open with TLS and tokens."""

from __future__ import annotations

import json
import socket
import ssl
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from std_msgs.msg import Bool
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from lupin_ros.adapter.node import Qos, RosNode
from tests.lupin_ros.helpers import spin_until
from tests.lupin_ros.plugins.gateway.conftest import free_port
from tests.lupin_ros.world import World
from tests.plugins.gateway.served import OpenPage, until

trustme = pytest.importorskip("trustme")

#: Another address of this machine than the one that a closed gateway listens on.
ELSEWHERE = "127.0.0.2"


@pytest.mark.core
def test_a_gateway_as_it_is_cannot_be_reached_from_elsewhere(gateway: Callable[..., str]) -> None:
    """Neither at its port nor at the second one, at no other address of this machine."""
    second = free_port()
    first = int(gateway(rosbridge_port=second).rpartition(":")[2].partition("/")[0])
    found = {str(info[4][0]) for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    for address in {*found, ELSEWHERE} - {"127.0.0.1"}:
        for port in (first, second):
            with pytest.raises(ConnectionRefusedError):
                socket.create_connection((address, port), 5).close()
    OpenPage(second).work_off()


def test_an_open_gateway_does_not_start_without_its_files(world: World) -> None:
    """Whoever starts it is told what it needs, and nothing listens."""
    process = world.start("lupin_gateway", open=True, port=free_port())
    assert process.wait(60.0) != 0
    log = world.log("lupin_gateway").read_text(encoding="utf-8")
    assert "an open gateway needs tokens: who may come in: lines of NAME ROLE EXPIRES TOKEN, mode 600" in log
    assert "Traceback" not in log


@pytest.mark.core
def test_an_open_gateway(
    gateway: Callable[..., str], make_node: Callable[..., RosNode], tmp_path: Path, world: World
) -> None:
    """From elsewhere with a token over TLS: a viewer stops and commands nothing, an operator releases."""
    authority = trustme.CA()
    issued = authority.issue_cert(ELSEWHERE, "localhost")
    issued.cert_chain_pems[0].write_to_path(str(tmp_path / "cert.pem"))
    issued.private_key_pem.write_to_path(str(tmp_path / "key.pem"))
    tokens = tmp_path / "tokens"
    tokens.write_text(f"anna operator 2099-12-31 {'a' * 40}\neve viewer 2099-12-31 {'e' * 40}\n")
    tokens.chmod(0o600)
    trust = ssl.create_default_context()
    authority.configure_trust(trust)
    # TLS 1.3 sends tickets after the handshake: the reading thread of the client wakes, and waits for data
    # inside OpenSSL while the request is written. Seldom, that request never arrives.
    trust.maximum_version = ssl.TLSVersion.TLSv1_2
    files = {"tls_certificate": tmp_path / "cert.pem", "tls_key": tmp_path / "key.pem", "tokens": tokens}
    log = tmp_path / "audit.jsonl"
    address = gateway(open=True, audit_file=log, engineer_names=["/lab"], **files)
    port = int(address.rpartition(":")[2].partition("/")[0])

    with pytest.raises(InvalidStatus) as refused:
        connect(f"wss://{ELSEWHERE}:{port}/_ros", ssl=trust)
    assert refused.value.response.status_code == 401

    ros, heard = make_node("robot"), list[bool]()
    ros.subscribe(Bool, "/lupin/hmi/estop", Qos.EVENT, lambda message: heard.append(message.data))

    def page(token: str) -> OpenPage:
        return OpenPage(port, trust, ELSEWHERE, authorization=f"Bearer {token * 40}")

    eve, anna = page("e"), page("a")
    eve.stop(True)
    spin_until([ros], lambda: heard[-1:] == [True], what="the stop")
    assert eve.call("/mission/start")["result"] is False
    released: dict[str, Any] = anna.call("/lupin/hmi/reset_stop", name="eve-1")["values"]
    assert released["success"] is True
    spin_until([ros], lambda: heard[-1] is False, what="the release")
    assert ros.node.count_publishers("/lupin/hmi/estop") == 1
    for one in (eve, anna):
        one.close()
    until(lambda: log.read_text(encoding="utf-8").count("\n") >= 3, "three lines")
    lines = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    assert [(line["who"], line["name"], line.get("accepted")) for line in lines] == [
        ("eve", "/lupin/hmi/estop", None),
        ("eve", "/mission/start", False),
        ("anna", "/lupin/hmi/reset_stop", True),
    ]
    assert "aaaaaaaa" not in log.read_text() + world.log("lupin_gateway").read_text()
