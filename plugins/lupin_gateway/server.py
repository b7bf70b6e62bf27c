"""The web server (Starlette on uvicorn): console files, `/status`, `/history`, and WebSockets at `/_ros` and
`/`.

A second port may serve the protocol only. Clients that do not read are disconnected (code 1013), and those
whose token is no longer valid (1008). Exceptions in periodic work are logged and do not stop it.
"""

from __future__ import annotations

import asyncio
import contextlib
import gzip
import math
import os
import socket
import time
import zlib
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from http import HTTPStatus
from pathlib import Path
from typing import Protocol

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Scope
from starlette.websockets import WebSocket, WebSocketDisconnect
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from lupin_engine.errors import UsageError, shortened
from lupin_gateway.access import NotAdmitted, Use
from lupin_gateway.encoding import FrameData
from lupin_gateway.entry.entrance import (
    SECURITY_HEADERS,
    AuthMiddleware,
    address_of,
    admit_visitor,
    browser_of,
)
from lupin_gateway.entry.gate import Gate, GateListener, places
from lupin_gateway.guard import GatewayRules, Guard
from lupin_gateway.hub import Hub, Outbox
from lupin_gateway.ports import HistoryPort, RosPort
from lupin_gateway.session import Limits, Session
from lupin_gateway.stop import PUBLISH_HZ

#: The files that are served: the console, as console/build.mjs makes it.
PAGES = Path(__file__).with_name("pages")
_PAGE = "index.html"
#: What of it is packed; the rest is small.
_PACKED = (".js", ".css", ".html")
#: What a page may load, and from where: only what this gateway serves.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'self'"
)
#: The largest frame that a client may send, in bytes; a larger one ends its connection (code 1009).
LARGEST_FRAME = 8_000_000
#: Seconds between two pings, and that a client has for its answer: who is gone is noticed after both.
PING_EVERY_S, PING_WITHIN_S = 5.0, 15.0
#: Bytes that the kernel buffers for one connection (it doubles them), and how long the other end may
#: acknowledge nothing, in ms.
KERNEL_BUFFER, GONE_AFTER_MS = 256_000, 20_000
#: The same of what comes in: as much is read at once, in which frames of 6 bytes are taken apart one by one.
KERNEL_INPUT = 8_000
#: Seconds of one turn of a history, while which nobody else is served.
HISTORY_TURN_S = 0.005
#: Codes with which a client is sent away that does not even read its answers (RFC 6455: try again later), and
#: one that may not be in any more.
TOO_SLOW, TURNED_OUT = 1013, 1008
#: Seconds between two looks at tokens and silent connections. Who may not be in goes when two looks in a row
#: say so: an editor may be writing the file of tokens. Reports of ended connections are further apart.
LOOK_S, REPORT_S = 1.0, 60.0


@dataclass(frozen=True)
class Address:
    """Where the server listens: `rosbridge_port` is a second port, with the protocol only; 0 is none."""

    host: str = "127.0.0.1"
    port: int = 8080
    rosbridge_port: int = 0

    def sockets(self) -> list[GateListener]:
        """Return listening sockets, one for each port.

        Raises:
            UsageError: a port is taken, or there is no such address here.
        """
        ports = [self.port, *filter(None, [self.rosbridge_port])]
        return [_listening(self.host, port) for port in ports]


def _listening(host: str, port: int) -> GateListener:
    try:
        found = socket.create_server((host, port), backlog=128)
        # All are handed on to each connection: the outbox is where a client's frames wait, who does not read
        # at all is let go, and no answer waits 40 ms until the one before it is acknowledged. (asyncio sees
        # to that for sockets that it makes itself.)
        found.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        found.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, KERNEL_BUFFER)
        found.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, KERNEL_INPUT)
        found.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, GONE_AFTER_MS)
        return GateListener(fileno=found.detach())
    except OSError as problem:
        reason = os.strerror(problem.errno) if problem.errno else str(problem)
        raise UsageError(
            f"the gateway cannot listen on {host}:{port}: {reason}; another program may have this port, "
            "then choose another one"
        ) from problem


class _ConsoleFiles(StaticFiles):
    """Static files of the console, packed once: its page names each with a hash, and browsers keep that.

    Whatever is asked for without the hash is revalidated each time.
    """

    def __init__(self) -> None:
        super().__init__(directory=PAGES, html=True)
        self._contents = {file.name: file.read_bytes() for file in PAGES.iterdir() if file.suffix in _PACKED}
        self._hashes = {name: sha256(each).hexdigest()[:12] for name, each in self._contents.items()}
        for name, found in self._hashes.items():
            named = f'"{name}"'.encode(), f'"{name}?{found}"'.encode()
            self._contents[_PAGE] = self._contents[_PAGE].replace(*named)
        self._packed = {name: gzip.compress(each, mtime=0) for name, each in self._contents.items()}

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Return a file with the security headers and the cookie by which the browser is known."""
        response, given = await super().get_response(path, scope), Headers(scope=scope)
        name = _PAGE if path in (".", "") else path
        is_named = scope["query_string"].decode("latin-1") == self._hashes.get(name)
        if response.status_code == HTTPStatus.OK and name in self._contents:
            response = self._packed_one(name, response, "gzip" in given.get("accept-encoding", ""))
        _, known = browser_of(given, secure=scope["scheme"] == "https")
        response.raw_headers.extend(known)
        kept = "max-age=31536000, immutable" if is_named else "no-cache"
        response.headers.update(
            {**SECURITY_HEADERS, "content-security-policy": POLICY, "cache-control": kept}
        )
        return response

    def _packed_one(self, name: str, found: Response, packed: bool) -> Response:
        """Return the content of a file that was found, packed if the browser reads that."""
        content = self._packed[name] if packed else self._contents[name]
        response = Response(content, media_type=found.media_type)
        if name != _PAGE:  # that is another one whenever one of its files is
            response.headers.update({key: found.headers[key] for key in ("etag", "last-modified")})
        response.headers["vary"] = "Accept-Encoding"
        if packed:
            response.headers["content-encoding"] = "gzip"
        return response


@cache
def _console() -> _ConsoleFiles:
    """Return the console's files, which the gateways of several robots share."""
    return _ConsoleFiles()


class Gateway:
    """The connections of one process."""

    def __init__(
        self,
        ros: RosPort,
        hub: Hub,
        limits: Limits,
        rules: GatewayRules,
        tls: Mapping[str, str],
        history: HistoryPort,
    ) -> None:
        """`tls` are the files of the server's certificate, by uvicorn's names; none: nothing is encrypted."""
        #: Its robot, by the namespace; '' for the root.
        self.robot = ""
        #: All gateways of the server, by the names of their robots.
        self.siblings: Mapping[str, Gateway] = {"": self}
        self.rules = rules
        self.tls = tls
        self.history = history
        self._ros = ros
        self._hub = hub
        self._limits = limits
        self.gate = Gate(places())
        #: Who is connected, with what ends that for a reason.
        self._clients: dict[Guard, Callable[[str], None]] = {}
        self._must_go: set[Guard] = set()

    def application(self) -> ASGIApp:
        """Return the ASGI application of the first port."""
        routes: list[BaseRoute] = [
            WebSocketRoute("/_ros", self._connect),
            WebSocketRoute("/", self._connect),
            Route("/status", self._status),
            Route("/history", self._history),
            Route("/robots", self._robots),
            Mount("/", _console()),
        ]
        return self._watched(AuthMiddleware(Starlette(routes=routes), self.rules, self.gate))

    def protocol_only(self) -> ASGIApp:
        """Return the ASGI application of the second port: the protocol at any path, as in rosbridge."""
        return self._watched(Starlette(routes=[WebSocketRoute("/{path:path}", self._connect)]))

    def _watched(self, application: ASGIApp) -> ASGIApp:
        trusted = os.environ.get("FORWARDED_ALLOW_IPS", "127.0.0.1")  # as uvicorn has it
        return self.gate.watching(ProxyHeadersMiddleware(application, trusted))  # type: ignore[arg-type]

    async def _status(self, request: Request) -> JSONResponse:
        visitor = self.rules.access.admit(request.headers, self.rules.clocks.wall())
        state = {"clients": len(self._clients), "topics": self._hub.topics(), **self._ros.about()}
        who = {"name": visitor.name, "role": visitor.role.word}
        robots = {"robot": self.robot, "robots": list(self.siblings)} if self.robot else {}
        return JSONResponse({**state, **who, **robots})

    async def _robots(self, request: Request) -> JSONResponse:
        """Answer with a `RobotRecord` of each robot that the visitor is let in to."""
        found = []
        for name, gateway in self.siblings.items():
            with contextlib.suppress(NotAdmitted):
                gateway.rules.access.admit(request.headers, gateway.rules.clocks.wall())
                found.append(gateway.rules.summary(name))
        return JSONResponse(found)

    def warn(self, text: str) -> None:
        """Log what is wrong for a while."""
        self.rules.warn(text)

    def start(self) -> None:
        """Begin to work; on the event loop."""
        self.history.start()

    def tick(self) -> None:
        """Publish the stop; to be called `PUBLISH_HZ` times a second."""
        self.rules.tick()

    async def _history(self, request: Request) -> Response:
        visitor = self.rules.access.admit(request.headers, self.rules.clocks.wall())
        given = request.query_params.get("since", "0")
        try:
            begin = float(given)
        except ValueError:
            begin = math.nan
        if not math.isfinite(begin):
            wanted = "since=MS is wanted, milliseconds since 1970, such as since=1795434151280"
            return PlainTextResponse(f"{wanted}, not {shortened(given)!r}\n", 400)
        allowed = self.rules.allowed
        named = request.query_params.get("topics")
        known = set(self.history.topics) & set(named.split(",")) if named else self.history.topics
        topics = [each for each in known if not allowed.refusal(visitor, Use.SUBSCRIBE, each)]
        packed = "gzip" in request.headers.get("accept-encoding", "")
        headers = {**SECURITY_HEADERS, "cache-control": "no-store"}
        if packed:
            headers["content-encoding"] = "gzip"
        parts = _in_turns(self.history.lines(begin, topics), packed)
        return StreamingResponse(parts, media_type="application/x-ndjson", headers=headers)

    async def _connect(self, socket_: WebSocket) -> None:
        try:
            visitor = await admit_visitor(self.rules, self.gate, socket_)
        except NotAdmitted as refused:
            await socket_.send_denial_response(PlainTextResponse(f"{refused}\n", refused.status))
            return
        browser, known = browser_of(socket_.headers, secure=bool(self.tls))
        await socket_.accept(headers=known)
        guard = self.rules.enter(visitor, address_of(socket_), browser)
        leaving: tuple[int, str] = TOO_SLOW, "this client does not read its answers"

        def stop_sending() -> None:
            sending.cancel()

        def turn_out(reason: str) -> None:
            nonlocal leaving
            leaving = TURNED_OUT, reason
            guard.log_disconnect(reason)
            sending.cancel()

        outbox = Outbox(stop_sending)
        session = Session(self._ros, self._hub, outbox, self._limits, guard)
        sending = asyncio.ensure_future(_send_all(outbox, socket_))
        self._clients[guard] = turn_out
        try:
            receiving = asyncio.ensure_future(_receive_all(session.receive, socket_))
            await asyncio.wait({receiving, sending}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            del self._clients[guard]
            session.close()
            receiving.cancel()
            sending.cancel()
        if sending.cancelled():
            await _send_away(socket_, *leaving)

    def look(self) -> None:
        """End connections whose token was invalid twice in a row, and strangers that are silent."""
        guards = list(self._clients)
        reasons = self.rules.access.reasons_to_go([one.visitor for one in guards], self.rules.clocks.wall())
        must_go = {one: reason for one, reason in zip(guards, reasons, strict=True) if reason}
        for one in self._must_go & must_go.keys():
            self._clients[one](must_go[one])
        self._must_go = set(must_go)
        self.gate.sweep()


async def _in_turns(lines: Iterator[bytes], packed: bool) -> AsyncIterator[bytes]:
    """Yield lines in parts, compressed by gzip if wanted; other work of the loop comes in between."""
    packer = zlib.compressobj(1, wbits=31)
    part, end = bytearray(), time.monotonic() + HISTORY_TURN_S
    for line in lines:
        part += packer.compress(line) if packed else line
        if time.monotonic() >= end:
            yield bytes(part)
            part.clear()
            await asyncio.sleep(0)
            end = time.monotonic() + HISTORY_TURN_S
    yield bytes(part) + (packer.flush() if packed else b"")


async def _receive_all(receive: Callable[[FrameData], None], socket_: WebSocket) -> None:
    while True:
        message = await socket_.receive()
        if message["type"] == "websocket.disconnect":
            return
        text = message.get("text")
        with _logging_defects():
            receive(text if text is not None else message.get("bytes") or b"")
        await asyncio.sleep(0)  # frames of others come between two of one client


@contextlib.contextmanager
def _logging_defects() -> Iterator[None]:
    """Log an exception instead of ending a connection, or the publishing of the stop."""
    try:
        yield
    except Exception as defect:
        context = {"message": "the gateway has a defect", "exception": defect}
        asyncio.get_running_loop().call_exception_handler(context)


async def _send_all(outbox: Outbox, socket_: WebSocket) -> None:
    # What starlette adds to sending is left out: it is done some thousand times a second.
    send = socket_._send
    with contextlib.suppress(WebSocketDisconnect, OSError):
        while True:
            frame = await outbox.take()
            kind = "text" if isinstance(frame, str) else "bytes"
            await send({"type": "websocket.send", kind: frame})


async def _send_away(socket_: WebSocket, code: int, reason: str) -> None:
    with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError, asyncio.TimeoutError):
        await asyncio.wait_for(socket_.close(code, reason), 1.0)


class RobotServer(Protocol):
    """The gateway of a robot, or those of several."""

    gate: Gate
    tls: Mapping[str, str]

    def warn(self, text: str) -> None:
        """Log what is wrong for a while."""

    def application(self) -> ASGIApp:
        """Return the ASGI application of the first port."""

    def protocol_only(self) -> ASGIApp:
        """Return the ASGI application of the second port."""

    def start(self) -> None:
        """Begin to work."""

    def tick(self) -> None:
        """Work, `PUBLISH_HZ` times a second."""

    def look(self) -> None:
        """End connections that are to end, every `LOOK_S`."""


async def serve(gateway: RobotServer, sockets: Sequence[GateListener], until: asyncio.Future[None]) -> None:
    """Serve on the sockets (the first one with files) until the future is done, then close all connections.

    Raises:
        RuntimeError: a server or a periodic task ended by itself.
    """
    for each in sockets:
        each.gate = gateway.gate
    applications = [gateway.application(), *(gateway.protocol_only() for _ in sockets[1:])]
    servers = [_QuietServer(_configuration(application, gateway.tls)) for application in applications]
    running = [
        asyncio.ensure_future(server.serve(sockets=[each]))
        for server, each in zip(servers, sockets, strict=True)
    ]
    gateway.start()
    ticking = asyncio.ensure_future(_tick_steadily(gateway))
    looking = asyncio.ensure_future(_look_steadily(gateway))
    ended, _ = await asyncio.wait({until, ticking, looking, *running}, return_when=asyncio.FIRST_COMPLETED)
    ticking.cancel()
    looking.cancel()
    for server in servers:
        server.should_exit = True
    await asyncio.gather(*running, return_exceptions=True)
    if until not in ended:
        causes = [each.exception() for each in ended]
        raise RuntimeError("a part of the gateway ended by itself") from causes[0]


async def _tick_steadily(gateway: RobotServer) -> None:
    while True:
        with _logging_defects():
            gateway.tick()
        await asyncio.sleep(1.0 / PUBLISH_HZ)


async def _look_steadily(gateway: RobotServer) -> None:
    report_at = 0.0
    while True:
        with _logging_defects():
            gateway.look()
            if time.monotonic() >= report_at and (report := gateway.gate.report()):
                gateway.warn(report)
                report_at = time.monotonic() + REPORT_S
        await asyncio.sleep(LOOK_S)


class _QuietServer(uvicorn.Server):
    """A uvicorn server that installs no signal handlers; the process has its own."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Install none."""
        yield


def _configuration(application: ASGIApp, tls: Mapping[str, str]) -> uvicorn.Config:
    return uvicorn.Config(
        application,
        ssl_certfile=tls.get("ssl_certfile"),
        ssl_keyfile=tls.get("ssl_keyfile"),
        log_config=None,
        log_level="error",  # not what strangers send that is no HTTP: they would fill it
        access_log=False,
        proxy_headers=False,  # the gate must see connections as they are: see `Gateway._watched`
        ws="websockets-sansio",
        ws_max_size=LARGEST_FRAME,
        ws_ping_interval=PING_EVERY_S,
        ws_ping_timeout=PING_WITHIN_S,
        ws_per_message_deflate=False,  # a frame is the same for all, and processor time is scarce
        timeout_graceful_shutdown=1,
        lifespan="off",
    )
