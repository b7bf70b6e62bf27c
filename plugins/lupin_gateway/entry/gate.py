"""Limits connections from their first byte: how many there may be, and how long they may be silent.

A connection is a *stranger's* until a request on it is authenticated. Strangers have a quota of their own,
so they never take the place of a visitor. When it is full the oldest stranger is closed, not the newest, so
a person still gets in while an attacker fills all places. In each turn of the event loop only a few strangers
are read (`SHARES`): otherwise a stop would wait behind their handshakes.
"""

from __future__ import annotations

import asyncio
import gc
import resource
import socket
import time
from collections import Counter
from dataclasses import dataclass
from typing import Any

from starlette.types import ASGIApp, Receive, Scope, Send

from lupin_gateway.access import NotAdmitted, UserRole, Visitor

#: Seconds that a connection has for its handshake and the head of a request, also of each further one.
HEAD_WITHIN_S = 10.0
#: How many strangers are accepted, read (which may be a handshake), and found ended in one turn of the loop.
#: For each one that is accepted at most one ends.
SHARES = {"accept": 4, "read": 4, "end": 8}
#: Connections after which what they left in circles is collected. Python would wait for 80,000 objects, and
#: hold up a stop for 170 ms with them.
MOST_LEFT = 64
#: Descriptors that are wanted, and those that are left to all else: DDS, files, the console.
WANTED_DESCRIPTORS, OTHER_DESCRIPTORS = 4_096, 256
#: Key in the scope of a request: the connection that it came by.
CONNECTION = "lupin_connection"


@dataclass(frozen=True)
class Places:
    """Quotas of connections: strangers per address and in all, visitors, and those kept for operators."""

    one_address: int = 32
    strangers: int = 256
    visitors: int = 1_000
    operators: int = 64


def places() -> Places:
    """Return the quotas for this process's file descriptors, after raising its limit if allowed."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = WANTED_DESCRIPTORS if hard == resource.RLIM_INFINITY else min(WANTED_DESCRIPTORS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        soft = wanted
    usual = Places()
    if soft == resource.RLIM_INFINITY or soft >= usual.strangers + usual.visitors + OTHER_DESCRIPTORS:
        return usual
    left = max(64, soft - OTHER_DESCRIPTORS)
    return Places(usual.one_address, left // 4, left - left // 4, left // 16)


class GateConnection(socket.socket):
    """The socket of one connection. asyncio uses it like any other; it sees reads and closing."""

    def __init__(self, gate: Gate, key: tuple[int, Any], descriptor: int) -> None:
        super().__init__(fileno=descriptor)
        self._gate = gate
        self.key = key
        self.address = str(key[1][0])
        self.since = time.monotonic()
        self.requests = 0
        self.visitor: Visitor | None = None
        self.is_ended = False

    def recv_into(self, *arguments: Any) -> int:
        """Read; a stranger's read raises BlockingIOError where this turn's share is used up."""
        self._wait_for_turn()
        return super().recv_into(*arguments)

    def recv(self, *arguments: Any) -> bytes:
        """Read; a stranger's read raises BlockingIOError where this turn's share is used up."""
        self._wait_for_turn()
        return super().recv(*arguments)

    def _wait_for_turn(self) -> None:
        if self.visitor is None:
            self._gate.turn.take("end" if self.is_ended else "read")

    def close(self) -> None:
        """Close it, and free its place."""
        self._gate.forget(self)
        super().close()

    def end(self) -> None:
        """Shut it down; asyncio reads the end of it and closes it."""
        self._gate.forget(self)
        self.is_ended = True
        try:
            self.shutdown(socket.SHUT_RDWR)
        except OSError:
            return  # the other end was faster


class GateListener(socket.socket):
    """A listening socket whose connections go through a gate, once it has one."""

    gate: Gate | None = None

    def accept(self) -> tuple[socket.socket, Any]:
        """Accept a connection; raises BlockingIOError where this turn's share is used up."""
        if self.gate is None:
            return super().accept()
        self.gate.turn.take("accept")
        plain, peer = super().accept()
        return self.gate.enter((self.getsockname()[1], peer), plain.detach()), peer


class _Turn:
    """The work that was done for strangers in this turn of the event loop."""

    def __init__(self) -> None:
        self._done: Counter[str] = Counter()

    def take(self, what: str) -> None:
        """Count one more of a kind of work: see `SHARES`.

        Raises:
            BlockingIOError: its share of this turn is used up.
        """
        if not self._done:
            asyncio.get_running_loop().call_soon(self._done.clear)
        self._done[what] += 1
        if self._done[what] > SHARES[what]:
            raise BlockingIOError


class Gate:
    """All connections of a gateway."""

    def __init__(self, limits: Places) -> None:
        self._limits = limits
        self._all: dict[tuple[int, Any], GateConnection] = {}
        self._strangers: dict[str, dict[GateConnection, None]] = {}
        self._ended: Counter[str] = Counter()
        self._left = 0
        self.turn = _Turn()

    def enter(self, key: tuple[int, Any], descriptor: int) -> GateConnection:
        """Register a connection; where a quota is exceeded, the oldest stranger is closed.

        The key is the local port with the peer's address.
        """
        connection = self._all[key] = GateConnection(self, key, descriptor)
        own = self._strangers.setdefault(connection.address, {})
        own[connection] = None
        if len(own) > self._limits.one_address:
            self._end(next(iter(own)), "too many of one address")
        elif self._number_of_strangers() > self._limits.strangers:
            crowd = max(self._strangers, key=lambda address: len(self._strangers[address]))
            self._end(next(iter(self._strangers[crowd])), "too many in all")
        return connection

    def _number_of_strangers(self) -> int:
        return sum(map(len, self._strangers.values()))

    def forget(self, connection: GateConnection) -> None:
        """Remove a connection that is closed, or about to be."""
        if self._all.get(connection.key) is connection:  # another may have the same address by now
            del self._all[connection.key]
        self._is_no_stranger(connection)

    def _is_no_stranger(self, connection: GateConnection) -> None:
        own = self._strangers.get(connection.address, {})
        own.pop(connection, None)
        if not own:
            self._strangers.pop(connection.address, None)

    def _end(self, connection: GateConnection, why: str) -> None:
        self._ended[why] += 1
        connection.end()
        self._left += 1
        if self._left >= MOST_LEFT:
            self._left = 0
            gc.collect()

    # -- requests -------------------------------------------------------------------------------------------

    def watching(self, application: ASGIApp) -> ASGIApp:
        """Return an ASGI application that counts open requests, and puts the connection into their scopes."""

        async def watched(scope: Scope, receive: Receive, send: Send) -> None:
            server, client = scope.get("server"), scope.get("client")
            connection = self._all.get((server[1], tuple(client))) if server and client else None
            if connection is None:
                await application(scope, receive, send)
                return
            connection.requests += 1
            try:
                await application({**scope, CONNECTION: connection}, receive, send)
            finally:
                connection.requests -= 1
                connection.since = time.monotonic()

        return watched

    def admit(self, connection: GateConnection | None, visitor: Visitor) -> None:
        """Move a connection from the strangers' quota to the visitors', for the visitor who was
        authenticated.

        Raises:
            NotAdmitted: the quota of visitors is full.
        """
        if connection is None or connection.visitor is not None:
            return
        inside = len(self._all) - self._number_of_strangers()
        left = self._limits.visitors - (0 if visitor.role >= UserRole.OPERATOR else self._limits.operators)
        if inside >= left:
            self._ended["too many who were let in"] += 1
            raise NotAdmitted(503, f"{inside} connections are open already, try again later")
        connection.visitor = visitor
        self._is_no_stranger(connection)

    # -- time -----------------------------------------------------------------------------------------------

    def sweep(self) -> None:
        """Close connections without an open request for `HEAD_WITHIN_S`; to be called every second or so."""
        late = time.monotonic() - HEAD_WITHIN_S
        for connection in [one for one in self._all.values() if not one.requests and one.since < late]:
            self._end(connection, f"no request within {HEAD_WITHIN_S:g} s")

    def report(self) -> str:
        """Return how many connections were closed since the last report, by reason; '' for none."""
        listed = ", ".join(f"{number} ({why})" for why, number in sorted(self._ended.items()))
        self._ended.clear()
        return listed and f"connections were ended: {listed}"
