"""The console in a real browser, before the gateway of real nodes."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")
pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import BrowserContext, Page
from websockets.sync.client import connect

from lupin_harness.domains import claimed_domain
from tests.browsing import DESK, FLAGS, PATIENCE_MS, PHONE, browser, context, opened
from tests.lupin_ros.launch.processes import Lupin
from tests.lupin_ros.plugins.gateway.conftest import free_port
from tests.lupin_ros.world import Operator

__all__ = ["DESK", "FLAGS", "PATIENCE_MS", "PHONE", "browser", "context"]


STOPS, RESET = "/lupin/hmi/stops", "/lupin/hmi/reset_stop"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """All tests of this folder need a browser and ROS."""
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.browser)
            item.add_marker(pytest.mark.timeout(300))


@dataclass
class Served:
    """What serves the console, the address of the page, and an operator's token where one is asked for."""

    lupin: Lupin
    url: str
    token: str = ""


class Serving:
    """What serves the console now: one at a time, since nodes at rest are in the way of others, too."""

    def __init__(self, folders: pytest.TempPathFactory) -> None:
        self._folders = folders
        self._open = ExitStack()
        self._now: tuple[tuple[str, ...], Served] | None = None

    def start(self, *arguments: str) -> Served:
        """Start `lupin … --hmi` in a domain of its own and return when its page is there."""
        self.end()
        domain = self._open.enter_context(claimed_domain())
        port = free_port()
        logs = self._folders.mktemp("logs")
        # A robot that is silent for 2 s counts as stopped; on a busy machine it is only not let work.
        more = ("--hmi", "--set", f"lupin_gateway.port={port}", "--set", "estop_timeout_s=20 s")
        more += ("--set", f"lupin_arm.library_path={logs / 'arm_library.json'}")
        lupin = Lupin(*arguments, *more, domain=domain, log_dir=logs / "run")
        self._open.callback(lupin.kill)
        lupin.until_line("Ctrl-C stops everything")
        self._now = arguments, Served(lupin, f"http://127.0.0.1:{port}/")
        return self._now[1]

    def shared(self, *arguments: str) -> Served:
        """Return what was started last, if with the same arguments; start it otherwise."""
        return self._now[1] if self._now and self._now[0] == arguments else self.start(*arguments)

    def end(self) -> None:
        """End it, with all that it started."""
        self._now = None
        self._open.close()


@pytest.fixture(scope="session")
def serving(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    """What all modules start theirs with."""
    found = Serving(tmp_path_factory)
    yield found
    found.end()


@pytest.fixture(scope="module")
def serve(serving: Serving) -> Callable[..., Served]:
    """Start `lupin … --hmi` for a module of its own; a second try of a test begins with a new one."""
    return serving.start


@pytest.fixture(scope="module")
def robot(serving: Serving) -> Served:
    """`lupin up --hmi` with the simulated greenhouse, fast; modules share it and leave it at rest."""
    return serving.shared("up", "--speed", "4")


def stall(served: Served, goals: int) -> None:
    """Let the robot stand still with each of its next goals: a drive lasts while a page looks at it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(served.lupin.domain))
        operator = Operator()
        try:
            operator.hit(goals, "stall")
        finally:
            # rclpy's destroy_node was seen to stand still: that must not take the other tests along.
            closing = threading.Thread(target=operator.ros.close, daemon=True)
            closing.start()
            closing.join(timeout=20.0)


@contextmanager
def telling(*tell: Callable[[], None]) -> Iterator[None]:
    """Tell something ten times a second."""
    ended = threading.Event()

    def work() -> None:
        while not ended.wait(0.1):
            for each in tell:
                each()

    worker = threading.Thread(target=work)
    worker.start()
    try:
        yield
    finally:
        ended.set()
        worker.join()


@pytest.fixture(autouse=True)
def released(request: pytest.FixtureRequest) -> Iterator[None]:
    """Release the stops that pages of the test left: where it fails, the next begins at rest all the same."""
    served: Served | None = None
    if "robot" in request.fixturenames:
        request.getfixturevalue("browser")  # without one, the test is skipped before the robot is started
        served = request.getfixturevalue("robot")
    yield
    if served is not None and served.lupin.process.poll() is None:
        release_left(served)


def release_left(served: Served) -> None:
    """Reset each stop whose page is gone; a page that has just been closed may still be on its way out."""
    address = served.url.replace("http", "ws") + "_ros"
    with connect(address, additional_headers={"Cookie": f"lupin_token={served.token}"}) as socket:
        socket.send(json.dumps({"op": "subscribe", "topic": STOPS, "type": "std_msgs/msg/String"}))
        while frame := json.loads(socket.recv(10)):
            if frame["op"] != "publish":
                continue
            stops = json.loads(frame["msg"]["data"])["stops"]
            for name in (stop["name"] for stop in stops if stop["left"]):
                request = {"op": "call_service", "id": name, "service": RESET, "args": {"name": name}}
                socket.send(json.dumps(request))
            if not stops:
                return


@pytest.fixture
def console(context: BrowserContext, robot: Served) -> Iterator[Page]:
    """The console of `robot`, connected; what the page logs as an error fails the test."""
    yield from opened(context, robot.url)
