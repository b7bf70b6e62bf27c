"""The local socket answers this user, of this domain and network, as long as the node works; else nobody."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any
from unittest.mock import Mock

import pytest

from lupin_harness.domains import claimed_domain
from lupin_ros.adapter import status_socket
from lupin_ros.adapter.dds.profile import variables
from lupin_ros.adapter.node import RosNode
from lupin_ros.adapter.status_socket import StatusSocket, read_status

pytestmark = pytest.mark.timeout(60)

#: Larger than what the kernel keeps for a reader.
SAID = {"steps": ["ä" * 1_000_000]}


class _Published:
    def status(self) -> str:
        return json.dumps(SAID)


class _Host:
    """A node whose thread works, or hangs."""

    def __init__(self) -> None:
        self.log = Mock()
        self.hangs = False

    def post(self, callback: Callable[[], object]) -> None:
        if not self.hangs:
            threading.Thread(target=callback).start()


@pytest.fixture
def host(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A node with a socket, in a domain of its own."""
    with claimed_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        host: Any = _Host()
        served = StatusSocket(host, _Published())
        yield host
        served.close()


def test_a_reader_gets_it_all_and_again(host: Any) -> None:
    """One who leaves at once, and one who only sends, keep no other waiting."""
    assert [read_status(), read_status()] == [SAID, SAID]
    with status_socket.socket.socket(status_socket.socket.AF_UNIX) as talker:
        talker.connect(status_socket._name())
        talker.sendall(b"{}")
    assert read_status() == SAID


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ROS_DOMAIN_ID", "232"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"),
        ("ROS_STATIC_PEERS", "10.0.0.7"),
        ("ROS_DISCOVERY_SERVER", "127.0.0.1:11811"),
        ("RMW_IMPLEMENTATION", "rmw_other"),
        ("ROS_SECURITY_ENABLE", "true"),
        (variables()[0], "/mine.xml"),
    ],
)
def test_another_network_is_not_this_one(
    host: Any, monkeypatch: pytest.MonkeyPatch, name: str, value: str
) -> None:
    """Whoever could not hear the node over ROS is not answered here either."""
    monkeypatch.setenv(name, value)
    assert read_status() is None


def test_a_node_that_hangs_says_nothing(host: Any) -> None:
    """What it published last may be old; when it works again it answers again."""
    host.hangs = True
    assert read_status() is None
    host.hangs = False
    assert read_status() == SAID


def test_nobody_is_there_before_and_after(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second one of the same domain leaves the first alone, and needs no socket."""
    with claimed_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        assert read_status() is None
        first, second = (StatusSocket(_Host(), _Published()) for _ in range(2))  # type: ignore[arg-type]
        second.close()
        assert read_status() == SAID
        first.close()
        assert read_status() is None


@pytest.mark.skipif(os.getuid() != 0, reason="only root can be somebody else")
@pytest.mark.parametrize("theirs", ["reader", "server"])
def test_another_user_is_refused(host: Any, theirs: str) -> None:
    """Also one who knows the name of the socket, and one who has taken it."""
    name = status_socket._name()
    other = name + b"-of-another"
    code = {
        "reader": f"s.connect({name!r}); print(s.recv(9) or 'refused', flush=True)",
        "server": f"s.bind({other!r}); s.listen(); print('refused', flush=True); c = s.accept()[0]; "
        "c.sendall(b'{}'); c.close()",
    }[theirs]
    program = f"import os, socket; os.setuid(65534); s = socket.socket(socket.AF_UNIX); {code}"
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "refused\n"
        if theirs == "server":
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(status_socket, "_name", lambda _: other)
                assert read_status() is None


def test_it_is_made_on_the_thread_of_the_node(
    make_node: Callable[..., RosNode], monkeypatch: pytest.MonkeyPatch
) -> None:
    """So that it is one moment of the machine."""
    threads: list[threading.Thread] = []

    class Records:
        def status(self) -> str:
            threads.append(threading.current_thread())
            return "{}"

    with claimed_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        node = make_node("told")
        served = StatusSocket(node, Records())
        found: list[Any] = []
        reader = threading.Thread(target=lambda: found.append(read_status()))
        reader.start()
        node.work_until(lambda: bool(found), 10.0)
        reader.join()
        served.close()
    assert found == [{}]
    assert threads == [threading.current_thread()]
