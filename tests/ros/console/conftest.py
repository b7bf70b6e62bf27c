"""The console in a real browser, before the gateway of real nodes."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")
pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import Browser, BrowserContext, Page, sync_playwright

from lupin_engine.harness.domains import claimed_domain
from tests.ros.gateway.conftest import free_port
from tests.ros.launch.processes import Lupin

#: Milliseconds that the page may take for anything on a busy machine.
PATIENCE_MS = 60_000
#: Chromium without a screen, and without asking the world for anything.
FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
DESK = {"width": 1440, "height": 900}
PHONE = {"width": 390, "height": 844}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """All tests of this folder need a browser and ROS."""
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.browser)
            item.add_marker(pytest.mark.timeout(300))


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Chromium, as Debian has it."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("no Chromium is installed here: apt install chromium")
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
        yield found
        found.close()


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    """A fresh profile, in English, on a desk."""
    found = browser.new_context(viewport=DESK, locale="en-GB", timezone_id="Europe/Amsterdam")
    found.set_default_timeout(PATIENCE_MS)
    yield found
    found.close()


@dataclass
class Served:
    """What serves the console, and the address of the page."""

    lupin: Lupin
    url: str


@pytest.fixture(scope="module")
def serve(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Served]]:
    """Start `lupin … --hmi` and return when its page is there. What it started ends with the module."""
    started: list[Lupin] = []
    with claimed_domain() as domain:

        def start(*arguments: str) -> Served:
            port = free_port()
            logs = tmp_path_factory.mktemp("logs")
            # A robot that is silent for 2 s counts as stopped; on a busy machine it is only not let work.
            more = ("--hmi", "--set", f"lupin_gateway.port={port}", "--set", "estop_timeout_s=20 s")
            started.append(Lupin(*arguments, *more, domain=domain, log_dir=logs / "run"))
            started[-1].until_line("Ctrl-C stops everything")
            return Served(started[-1], f"http://127.0.0.1:{port}/")

        yield start
        for command in started:
            command.kill()


@pytest.fixture(scope="module")
def robot(serve: Callable[..., Served]) -> Served:
    """`lupin up --hmi` with the simulated greenhouse, fast."""
    return serve("up", "--speed", "4")


@pytest.fixture
def console(context: BrowserContext, robot: Served) -> Iterator[Page]:
    """The console of `robot`, connected; what the page logs as an error fails the test."""
    page = context.new_page()
    wrong: list[str] = []
    page.on("pageerror", lambda problem: wrong.append(str(problem)))
    page.on("console", lambda told: wrong.append(told.text) if told.type == "error" else None)
    page.goto(robot.url)
    page.locator(".bar .pill.good").wait_for()
    yield page
    assert not wrong, "\n".join(wrong)
