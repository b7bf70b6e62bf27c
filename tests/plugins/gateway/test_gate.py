"""How many connections there may be, how long a stranger may be silent, and who is turned out."""

from __future__ import annotations

import re
import resource
import socket
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus

from lupin_gateway import server
from lupin_gateway.access import IssuedToken, UserRole, Visitor
from lupin_gateway.entry import gate
from lupin_gateway.entry.gate import Gate, Places, places
from tests.plugins.gateway.served import PATIENCE, OpenPage, ServedGateway, until

FOREVER = 4_102_444_800.0
ANNA, EVE = (
    IssuedToken(Visitor(name, role, FOREVER, name), name[0] * 40)
    for name, role in (("anna", UserRole.OPERATOR), ("eve", UserRole.VIEWER))
)
#: What was logged.
reports: list[str] = []


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ServedGateway]:
    """A gateway with few places, in which a stranger may be silent for half a second."""
    few = Places(one_address=3, strangers=6, visitors=4, operators=2)
    monkeypatch.setattr(server, "places", lambda: few)
    monkeypatch.setattr(server, "LOOK_S", 0.05)
    monkeypatch.setattr(gate, "HEAD_WITHIN_S", 0.5)
    reports.clear()
    with ServedGateway(tmp_path, tokens=[ANNA, EVE]) as found:
        found.rules.warn = reports.append
        yield found


def ended(at: ServedGateway) -> Counter[str]:
    """Return why connections were ended, by the log and what is not logged yet."""
    found: Counter[str] = Counter()
    for text in (*reports, at.call(at.gateway.gate.report)):
        for number, why in re.findall(r"(\d+) \((.+?)\)", text):
            found[why] += int(number)
    return found


def page_of(token: IssuedToken, at: ServedGateway) -> OpenPage:
    """Come in with a token."""
    return OpenPage(at.port, authorization=f"Bearer {token.secret}")


@pytest.fixture
def stranger(small: ServedGateway) -> Iterator[Callable[..., socket.socket]]:
    """Connect from an address, and say no more than the beginning of a request."""
    opened: list[socket.socket] = []

    def connect(host: str = "127.0.0.1", said: bytes = b"") -> socket.socket:
        address = ("127.0.0.1", small.port)
        opened.append(socket.create_connection(address, PATIENCE, source_address=(host, 0)))
        opened[-1].sendall(said)
        return opened[-1]

    yield connect
    for one in opened:
        one.close()


def is_ended(connection: socket.socket) -> bool:
    """Say whether the gateway has ended a connection."""
    connection.settimeout(0.01)
    try:
        return connection.recv(100) == b""
    except TimeoutError:
        return False
    except ConnectionResetError:
        return True


@pytest.mark.parametrize("said", [b"", b"GET / HTTP/1.1\r\nhost: loc"], ids=["silent", "slow"])
def test_a_stranger_must_ask_for_something_soon(
    small: ServedGateway, stranger: Callable[..., socket.socket], said: bytes
) -> None:
    """Whether nothing comes or half a head; who is in may be silent."""
    page = page_of(ANNA, small)
    for _ in range(2):
        one = stranger(said=said)
        until(lambda: is_ended(one), "the end")  # noqa: B023
    page.work_off()
    assert ended(small) == {"no request within 0.5 s": 2}


def test_the_oldest_of_too_many_ends(
    small: ServedGateway, stranger: Callable[..., socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of one address, and of all: of the address that has the most."""
    monkeypatch.setattr(gate, "HEAD_WITHIN_S", PATIENCE)
    own = [stranger() for _ in range(4)]
    until(lambda: is_ended(own[0]), "the end of the first")
    others = [stranger(f"127.0.0.{number}") for number in range(2, 6)]
    until(lambda: is_ended(own[1]), "the end of the second")
    assert not [one for one in (*own[2:], *others) if is_ended(one)]
    page_of(ANNA, small).work_off()
    assert ended(small) == {"too many in all": 2, "too many of one address": 1}  # with that of the page


def test_places_are_kept_for_operators(small: ServedGateway) -> None:
    """Viewers leave two of the four, and are told so when they want more."""
    eves = [page_of(EVE, small) for _ in range(2)]
    with pytest.raises(InvalidStatus) as refused:
        page_of(EVE, small)
    assert refused.value.response.status_code == 503
    assert refused.value.response.body == b"2 connections are open already, try again later\n"
    for page in (*eves, page_of(ANNA, small), page_of(ANNA, small)):
        page.work_off()


def test_who_is_not_in_the_file_any_more_has_to_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The connection ends with a reason, and the stop of its page stays."""
    monkeypatch.setattr(server, "LOOK_S", 0.05)
    with ServedGateway(tmp_path, tokens=[ANNA, EVE]) as gateway:
        anna, eve = page_of(ANNA, gateway), page_of(EVE, gateway)
        eve.stop(True)
        eve.work_off()
        gateway.rules.access._tokens = lambda: [ANNA]
        until(lambda: eve.socket.close_code, "the end")
        reason = "this token was taken out of the file of tokens"
        assert (eve.socket.close_code, eve.socket.close_reason) == (1008, reason)
        anna.work_off()
        assert gateway.rules.stops.stopped
        until(lambda: [line for line in gateway.lines() if line["what"] == "login"], "a line")
        line = gateway.lines()[-1]
        assert (line["who"], line["accepted"], line["answer"]) == (
            *("eve", False, "eve-2: this token was taken out of the file of tokens"),
        )


def test_places_fit_the_descriptors(monkeypatch: pytest.MonkeyPatch) -> None:
    """As many as may be had are taken; where they are few, each has its part."""
    limits = {"now": (256, 1024)}
    monkeypatch.setattr(resource, "getrlimit", lambda _: limits["now"])
    monkeypatch.setattr(resource, "setrlimit", lambda _, wanted: limits.update(now=wanted))
    assert places() == Places(one_address=32, strangers=192, visitors=576, operators=48)
    assert limits["now"] == (1024, 1024)
    limits["now"] = (1024, resource.RLIM_INFINITY)
    assert places() == Places()
    assert limits["now"] == (4096, resource.RLIM_INFINITY)


def test_a_gate_forgets_what_is_closed() -> None:
    """Nothing is kept of a connection that has ended."""
    one = Gate(Places())
    ends = socket.socketpair()
    with ends[1], one.enter((1, ("127.0.0.1", 2)), ends[0].detach()):
        assert one._all
    assert not one._all
    assert not one._strangers
