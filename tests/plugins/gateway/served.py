"""A gateway on real sockets, without ROS: what pages ask of the robot is kept, and answered by the test."""

from __future__ import annotations

import asyncio
import json
import ssl
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from lupin_engine.plugin.contract import Access
from lupin_engine.plugin.pages import declared_access
from lupin_engine.plugin.registry import load_catalog
from lupin_gateway.access import AccessControl, AllowList, IssuedToken
from lupin_gateway.audit import AuditLog
from lupin_gateway.encoding import Sample
from lupin_gateway.guard import OWN_ACCESS, STOPS_TOPIC, ClockPair, GatewayRules, RuleOutputs
from lupin_gateway.history import TopicHistory
from lupin_gateway.history.settings import HistoryTopic
from lupin_gateway.hub import Backlog, Hub
from lupin_gateway.ports import GoalEnd
from lupin_gateway.robots import Robots
from lupin_gateway.server import Address, Gateway, RobotServer, serve
from lupin_gateway.session import Limits
from lupin_gateway.stop import StopArbiter
from lupin_ros.service.names import ACCESS

PATIENCE = 20.0


def until(condition: Callable[[], Any], what: str, limit: float = PATIENCE) -> Any:
    """Wait for a condition of another thread, and return what it gave."""
    end, pause = time.monotonic() + limit, threading.Event()
    while not (found := condition()):
        assert time.monotonic() < end, f"not within {limit:g} s: {what}"
        pause.wait(0.005)
    return found


class Robot:
    """ROS as pages reach it: keeps all that is asked, and answers calls with what the test has set."""

    def __init__(self) -> None:
        self.published: list[tuple[str, Any]] = []
        self.called: list[tuple[str, Any]] = []
        self.goals: list[tuple[str, Any]] = []
        self.listened: list[str] = []
        self.answers: dict[str, Callable[[Any], Any]] = {}
        self._latched: dict[str, Sample] = {}
        self._told: dict[str, Callable[[Sample, bool], None]] = {}

    def about(self) -> dict[str, Any]:
        return {"mode": "robot"}

    def listen(self, topic: str, type_: str, told: Callable[[Sample, bool], None], _: Any) -> Robot:
        self.listened.append(topic)
        self._told[topic] = told
        if topic in self._latched:
            asyncio.get_running_loop().call_soon(told, self._latched[topic], True)
        return self

    def tell(self, topic: str, text: str) -> None:
        """Publish a latched std_msgs/String; on the loop."""
        sample = self._latched[topic] = Sample(topic, text.encode(), 0, lambda _: {"data": text})
        if topic in self._told:
            self._told[topic](sample, True)

    def close(self) -> None:
        """As a feed: nothing is told."""

    def advertise(self, *_: Any) -> None: ...

    def unadvertise(self, topic: str) -> None: ...

    def publish(self, topic: str, data: Any, problem: Any) -> None:
        self.published.append((topic, data))

    def call(self, service: str, data: Any, limit: float, done: Callable[[Any], None]) -> None:
        self.called.append((service, data))
        if service in self.answers:
            asyncio.get_running_loop().call_soon(done, self.answers[service](data))

    def send_goal(self, action: str, data: Any, feedback: Any, done: Any) -> Callable[[], None]:
        self.goals.append((action, data))
        return lambda: done(GoalEnd(5, {}))

    def ask(self, question: str, data: Any, refusal: Any, done: Callable[[Any], None]) -> bool:
        done({"time": {"secs": 1, "nsecs": 0}})
        return True


class ServedGateway:
    """A gateway in a thread, with doors, stops and a log as the test wants them; a context."""

    def __init__(
        self,
        folder: Path,
        tokens: Sequence[IssuedToken] | None = None,
        tls: Mapping[str, str] | None = None,
        origins: Sequence[str] = (),
        stops: StopArbiter | None = None,
        extra: Access = Access(),  # noqa: B008
        wall: Callable[[], float] = time.time,
        history: Sequence[HistoryTopic] = (),
    ) -> None:
        self.robot = Robot()
        self.stop_told: list[bool] = []
        self.states: list[dict[str, Any]] = []
        self.pauses: list[Callable[[Any], None]] = []
        self.log = folder / "audit.jsonl"
        self._audit = AuditLog(self.log)
        #: Seconds that the steady clock of the rules is ahead of the real one.
        self.ahead = 0.0
        self.rules = GatewayRules(
            AccessControl((lambda: tokens) if tokens is not None else None, origins),
            AllowList([*declared_access(load_catalog()), ACCESS, OWN_ACCESS, extra]),
            stops or StopArbiter(),
            self._audit,
            ClockPair(lambda: time.monotonic() + self.ahead, wall),
            RuleOutputs(
                self.stop_told.append,
                self._tell_state,
                self.pauses.append,
                lambda kept: None,
            ),
        )
        hub = Hub(self.robot.listen, lambda topic: Backlog())
        self.history = TopicHistory(hub, history, wall)
        self.gateway = Gateway(self.robot, hub, Limits(), self.rules, tls or {}, self.history)
        self._serves: RobotServer = self.gateway
        self._loop = asyncio.new_event_loop()
        self._sockets = Address(port=0).sockets()
        self.port: int = self._sockets[0].getsockname()[1]
        self._until: asyncio.Future[None] = self._loop.create_future()
        self._thread = threading.Thread(target=self._run)
        #: What ended it before the test did.
        self.failed: RuntimeError | None = None

    def together(self, **others: ServedGateway) -> None:
        """Serve others beside this one, `robot1`, before it is entered; they are not entered."""
        self._serves = Robots({"robot1": self.gateway, **{name: one.gateway for name, one in others.items()}})
        for one in others.values():
            one._loop.close()
            one._sockets[0].close()

    def _tell_state(self, text: str) -> None:
        self.states.append(json.loads(text))
        self.robot.tell(STOPS_TOPIC, text)

    def _run(self) -> None:
        try:
            self._loop.run_until_complete(serve(self._serves, self._sockets, self._until))
        except RuntimeError as failed:
            self.failed = failed
            for each in self._sockets:  # a server that fails leaves them open
                each.close()
        self._loop.run_until_complete(self._loop.shutdown_default_executor())
        self._loop.close()

    def call(self, function: Callable[[], Any]) -> Any:
        """Call something on the gateway's loop, and return what it returns."""

        async def inner() -> Any:
            return function()

        return asyncio.run_coroutine_threadsafe(inner(), self._loop).result(PATIENCE)

    def lines(self) -> list[dict[str, Any]]:
        """The audit log as it stands."""
        return [json.loads(line) for line in self.log.read_text(encoding="utf-8").splitlines()]

    def __enter__(self) -> ServedGateway:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self.failed is None:
            self._loop.call_soon_threadsafe(self._until.set_result, None)
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive()
        self._audit.close()


class OpenPage:
    """A page that is open: its connection, and the frames that it was sent."""

    def __init__(
        self,
        port: int,
        trust: ssl.SSLContext | None = None,
        host: str = "localhost",
        base: str = "",
        **headers: str,
    ) -> None:
        scheme, more = ("wss", {"ssl": trust}) if trust else ("ws", {})
        # Entered by hand: the connection lives until the page is closed.
        self.socket: ClientConnection = connect(
            f"{scheme}://{host}:{port}{base}/_ros",
            additional_headers={name.replace("_", "-"): value for name, value in headers.items()},
            max_size=None,
            compression=None,
            # Its thread would draw random numbers in the middle of other tests.
            ping_interval=None,
            **more,  # type: ignore[arg-type]
        ).__enter__()
        self.frames: list[dict[str, Any]] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        try:
            for frame in self.socket:
                self.frames.append(json.loads(frame))
        except ConnectionClosed:
            return

    def send(self, frame: Any) -> None:
        """Send an operation, or a frame as it is."""
        self.socket.send(frame if isinstance(frame, (str, bytes)) else json.dumps(frame))

    def stop(self, stopped: bool) -> None:
        """Tell the stop of this page."""
        self.send({"op": "publish", "topic": "/lupin/hmi/estop", "msg": {"data": stopped}})

    def call(self, service: str, id_: str = "", **arguments: Any) -> dict[str, Any]:
        """Call a service, and return the frame of its answer."""
        id_ = id_ or f"call-{len(self.frames)}-{service}"
        self.send({"op": "call_service", "service": service, "args": arguments, "id": id_})
        found: dict[str, Any] = until(
            lambda: next(
                (f for f in self.frames if f["op"] == "service_response" and f.get("id") == id_), None
            ),
            f"an answer of {service}; so far {self.frames[-5:]}",
        )
        return found

    def statuses(self) -> list[str]:
        """The texts of all status frames."""
        return [frame["msg"] for frame in self.frames if frame["op"] == "status"]

    def told(self, count: int = 1) -> list[str]:
        """Wait for so many status frames, and return their texts."""
        until(lambda: len(self.statuses()) >= count, f"{count} status frames; so far {self.frames}")
        return self.statuses()

    def work_off(self) -> None:
        """Wait until the gateway has dealt with all that was sent."""
        self.call("/rosapi/get_time")

    def close(self) -> None:
        """Go as a page does that is closed."""
        self.socket.close()
        self._reader.join(PATIENCE)

    def cut(self) -> None:
        """Go without a word."""
        self.socket.socket.close()
