"""What is shown is of now, or says of when it is: without news of the gateway, and of the orchestrator."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import BrowserContext, Page, WebSocketRoute, expect

from lupin_ros.launch.operator import Attendant
from tests.lupin_ros.launch.processes import until
from tests.lupin_ros.system.console.conftest import Served, stall
from tests.lupin_ros.system.console.test_control import button, in_state, panel, view

pytestmark = pytest.mark.long

#: Seconds within which the page says that nothing is heard; a busy machine has some more.
SAID_WITHIN = 5.0
VIEWS = ("control", "chart", "map", "log", "twin", "arm", "health", "people")
#: What somebody reads: it stands still while nothing is heard.
CLOCKS = """which => [...document.querySelectorAll(which)].map((each) => each.innerText)"""
OF_MISSION = ".control-holds, .control-running, .bar"


@pytest.fixture
def attendant(robot: Served, monkeypatch: pytest.MonkeyPatch) -> Iterator[Attendant]:
    """A node that commands the mission, and ends it at last."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(robot.lupin.domain))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    found = Attendant()
    assert found.hear()
    in_state(found, "READY", "DONE")
    yield found
    until(lambda: is_over(found), "the end of the mission")
    found.close()


def is_over(attendant: Attendant) -> bool:
    """Whether no mission is under way; it is ended, also by an orchestrator that is only just there."""
    if view(attendant)["lifecycle"] in ("READY", "DONE") and not view(attendant)["held"]:
        return True
    for verb in ("resume", "abort", "reset"):
        attendant.command(verb)
    return False


def driving(page: Page, robot: Served, attendant: Attendant) -> None:
    """A mission is under way, and its drive lasts."""
    stall(robot, 1)
    page.evaluate("location.hash = 'control'")
    button(page, "start inspection").click()
    in_state(attendant, "INSPECTING")
    expect(panel(page, "What to do")).to_contain_text("Nothing: the mission is under way.")


def says_so(page: Page, why: str, since: float, clocks: str = f"{OF_MISSION}, .moment time") -> None:
    """The page says it in time, and nothing that it shows goes on."""
    page.locator(".as-of", has_text="as of").wait_for()
    assert time.monotonic() - since < SAID_WITHIN
    expect(page.locator(".as-of")).to_contain_text(why)
    before = page.evaluate(CLOCKS, clocks)
    page.wait_for_timeout(2500)
    assert page.evaluate(CLOCKS, clocks) == before


def test_a_gateway_that_stands_still(context: BrowserContext, robot: Served, attendant: Attendant) -> None:
    """All that is shown is grey and says of when it is; the page recovers by itself."""
    console = context.new_page()  # which may say that it cannot connect
    console.goto(robot.url)
    driving(console, robot, attendant)
    gateway = robot.lupin.pid_of("lupin_gateway")
    os.kill(gateway, signal.SIGSTOP)
    try:
        says_so(console, "connection lost", time.monotonic())
        expect(console.locator(".bar .pill.good")).to_have_count(0)
        expect(console.locator("#stop-box")).to_have_attribute("data-state", "away")
        expect(panel(console, "What to do")).to_contain_text("This page is not connected since")
        expect(panel(console, "What to do")).not_to_contain_text("under way")
        for view in VIEWS:
            console.evaluate(f"location.hash = '{view}'")
            expect(console.locator("main .view.stale")).to_be_visible()
            expect(console.locator(".as-of")).to_be_in_viewport()
    finally:
        os.kill(gateway, signal.SIGCONT)
    expect(console.locator(".bar .pill.good")).to_be_visible()
    expect(console.locator(".as-of")).to_have_text("")
    expect(console.locator(".stale")).to_have_count(0)


def test_a_network_that_swallows_everything(context: BrowserContext, robot: Served) -> None:
    """Connections are opened and nothing comes: each is left in its turn, until one is heard."""
    page = context.new_page()
    silent = False
    made: list[bool] = []

    def through(route: WebSocketRoute) -> None:
        made.append(silent)
        if silent:
            return
        server = route.connect_to_server()
        route.on_message(lambda text: None if silent else server.send(text))
        server.on_message(lambda text: None if silent else route.send(text))

    page.route_web_socket("**/_ros", through)
    page.goto(robot.url)
    page.locator(".bar .pill.good").wait_for()
    silent = True
    says_so(page, "connection lost", time.monotonic())
    page.wait_for_timeout(8000)
    assert made.count(True) > 2
    silent = False
    page.locator(".bar .pill.good").wait_for(timeout=15_000)
    expect(page.locator("#stop-box")).to_have_attribute("data-state", "free")


def test_an_orchestrator_that_is_not_heard(console: Page, robot: Served, attendant: Attendant) -> None:
    """The mission is grey, what else is heard is not; when another process goes on, it is said what to do."""
    driving(console, robot, attendant)
    orchestrator = robot.lupin.pid_of("mission_orchestrator")
    os.kill(orchestrator, signal.SIGSTOP)
    try:
        says_so(console, "the orchestrator is not heard", time.monotonic(), OF_MISSION)
        expect(console.locator(".bar .pill.good")).to_be_visible()
        expect(panel(console, "What to do")).to_contain_text("The orchestrator is not heard since")
        expect(panel(console, "What to do")).not_to_contain_text("under way")
        expect(console.locator("main .view.stale")).to_be_visible()
        console.evaluate("location.hash = 'health'")
        expect(console.locator("main .view.stale")).to_have_count(0)
        expect(console.locator(".beside.stale")).to_be_visible()
    finally:
        os.kill(orchestrator, signal.SIGKILL)
        os.kill(orchestrator, signal.SIGCONT)
    console.evaluate("location.hash = 'control'")
    expect(panel(console, "Mission").locator(".control-holds")).to_contain_text(
        "the orchestrator was started again"
    )
    expect(panel(console, "What to do")).to_contain_text("Look where the robot is and that its way is free")
    expect(console.locator(".stale")).to_have_count(0)


def test_who_paused_and_resumed_is_named(console: Page, robot: Served, attendant: Attendant) -> None:
    driving(console, robot, attendant)
    button(console, "pause").click()
    mission = panel(console, "Mission")
    expect(mission.locator(".control-holds")).to_contain_text("by page-")
    expect(mission.locator(".control-holds")).to_contain_text("ended by: resume")
    expect(console.locator(".bar .where")).to_contain_text("paused")
    button(console, "resume").click()
    expect(mission).to_contain_text("Asked last: resume by page-")
    expect(panel(console, "What to do")).to_contain_text("Nothing: the mission is under way.")
