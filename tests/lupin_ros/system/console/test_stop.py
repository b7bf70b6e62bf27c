"""The stop of the page, heard on the network: one press, whatever else of the page or the gateway fails."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import Browser, BrowserContext, Page, Route, expect
from std_msgs.msg import Bool

from lupin_ros.adapter.node import Qos, RosNode
from tests.browsing import HOLD_MS
from tests.lupin_ros.helpers import spin_until
from tests.lupin_ros.system.console.conftest import Served

ESTOP, FIELD = "/lupin/hmi/estop", "/twin/get_field"
#: What a press may take to ROS on a busy machine, in seconds; and after a gateway that starts again.
AT_ONCE, AFTER_RESTART = 3.0, 30.0


class Robot:
    """A node of the robot, which hears the stop of the pages."""

    def __init__(self) -> None:
        self.ros = RosNode("hears_stops")
        self.heard: list[bool] = []
        self.ros.subscribe(
            Bool, "/lupin/gateway/stop", Qos.LATCHED, lambda message: self.heard.append(message.data)
        )

    def is_told(self, stopped: bool, limit: float = AT_ONCE) -> None:
        """Wait until the stop is heard as it is said; what was heard before does not count."""
        self.heard.clear()
        spin_until([self.ros], lambda: self.heard[-1:] == [stopped], limit, f"stop {stopped}")


@pytest.fixture(scope="module")
def robot(serve: Callable[..., Served]) -> Served:
    """Processes of their own: one is held up."""
    return serve("up", "--speed", "4", "--separate")


@pytest.fixture
def listener(robot: Served, monkeypatch: pytest.MonkeyPatch) -> Iterator[Robot]:
    """A node in the domain of `robot`."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(robot.lupin.domain))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    found = Robot()
    found.is_told(False, AFTER_RESTART)
    yield found
    found.ros.close()


def release(page: Page) -> None:
    page.locator("#release").click(delay=HOLD_MS)
    expect(page.locator("#stop-box")).to_have_attribute("data-state", "free")


def press_and_release(page: Page, robot: Robot) -> None:
    """A press on a page that is connected is heard at once, and shown as confirmed; so is the release."""
    expect(page.locator("#stop-box")).to_have_attribute("data-state", "free")
    robot.is_told(False)
    page.locator("#stop").click()
    robot.is_told(True)
    expect(page.locator("#stop-state")).to_contain_text("Stopped by page-")
    release(page)
    robot.is_told(False)


def test_one_press_is_heard_and_so_is_the_key(console: Page, listener: Robot) -> None:
    """The stop counts from the moment that the button goes down, and the keys work wherever the focus is."""
    press_and_release(console, listener)
    button = console.locator("#stop").bounding_box()
    assert button is not None
    console.mouse.move(button["x"] + 5, button["y"] + 5)
    console.mouse.down()
    listener.is_told(True)
    console.mouse.move(5, 300)
    console.mouse.up()
    release(console)
    console.get_by_role("link", name="Map").focus()
    console.keyboard.press("Shift+Escape")
    listener.is_told(True)
    release(console)


def test_it_is_always_in_the_same_place_and_nothing_lies_over_it(console: Page) -> None:
    """In every view, on a desk and on a phone, however far one has scrolled."""
    for width, height in ((1440, 900), (390, 844)):
        console.set_viewport_size({"width": width, "height": height})
        places = set()
        for view in ("control", "chart", "map", "log", "twin", "arm", "health", "people"):
            console.evaluate(f"location.hash = '{view}'")
            expect(console.locator("nav a[aria-current=page]")).to_have_attribute("href", f"#{view}")
            console.mouse.move(width / 2, height / 2)
            console.mouse.wheel(0, 2000)
            box = console.locator("#stop").bounding_box()
            assert box is not None
            x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
            places.add((x, y))
            assert console.evaluate(f"document.elementFromPoint({x}, {y}).id") == "stop"
        assert len(places) == 1


def test_who_else_stops_the_robot_is_named(console: Page, listener: Robot) -> None:
    """An HMI beside the gateway, and the robot, which repeats it; 2 s after its last word it is over."""
    panel = listener.ros.publisher(Bool, ESTOP, Qos.EVENT)
    end = time.monotonic() + 10.0
    alert = console.locator(".alert", has_text="another operator panel")
    while not alert.count():
        assert time.monotonic() < end, console.locator(".alert").all_inner_texts()
        panel.publish(Bool(data=True))
        console.wait_for_timeout(300)
    expect(alert).to_have_count(0, timeout=10_000)


def test_its_texts_are_in_the_language_of_the_page(console: Page, listener: Robot) -> None:
    console.locator("#stop").click()
    listener.is_told(True)
    console.get_by_text("Settings").click()
    console.get_by_label("Language").select_option("nl")
    expect(console.locator("#stop-state")).to_contain_text("Gestopt door page-")
    console.get_by_role("button", name="Mijn stop opheffen").click(delay=HOLD_MS)
    listener.is_told(False)
    console.get_by_label("Taal").select_option("en")


def hanging(route: Route) -> None:
    """Answer nothing, ever."""


def broken(route: Route) -> None:
    route.fulfill(body="throw new Error('broken')", content_type="text/javascript")


def missing(route: Route) -> None:
    route.fulfill(status=500, body="")


@pytest.mark.parametrize("files", ["console.js", "console.*"])
@pytest.mark.parametrize("how", [hanging, broken, missing])
def test_it_works_when_the_page_itself_does_not(
    context: BrowserContext, robot: Served, listener: Robot, how: Callable[[Route], None], files: str
) -> None:
    """The page's own script or style does not come, is broken, or never ends coming."""
    page = context.new_page()
    page.route(f"**/{files}", how)
    page.goto(robot.url, wait_until="commit")
    press_and_release(page, listener)


def test_it_works_while_calls_of_the_page_hang(console: Page, robot: Served, listener: Robot) -> None:
    """A service of the robot does not answer; the page has asked it many times over."""
    twin = robot.lupin.pid_of("lupin_twin")
    os.kill(twin, signal.SIGSTOP)
    try:
        console.evaluate(
            """service => { const socket = new WebSocket(`ws://${location.host}/_ros`);
            socket.onopen = () => { for (let n = 0; n < 5; n++)
                socket.send(JSON.stringify({op: "call_service", id: `c${n}`, service, args: {}})); } }""",
            FIELD,
        )
        press_and_release(console, listener)
    finally:
        os.kill(twin, signal.SIGCONT)


def test_each_tab_has_its_own(console: Page, context: BrowserContext, robot: Served, listener: Robot) -> None:
    """The robot goes on when both are released, whoever said it last."""
    other = context.new_page()
    other.goto(robot.url)
    for page in (console, other):
        page.locator("#stop").click()
        listener.is_told(True)
    release_one = other.locator("#release")
    release_one.click(delay=HOLD_MS)
    expect(other.locator("#stop")).to_have_attribute("aria-pressed", "false")
    expect(other.locator("#stop-box")).to_have_attribute("data-state", "stopped")
    listener.is_told(True)
    release(console)
    listener.is_told(False)


def test_a_press_counts_that_came_while_the_gateway_was_away(
    context: BrowserContext, robot: Served, listener: Robot
) -> None:
    """It says that nobody has confirmed it, and is told as soon as somebody is there again."""
    page = context.new_page()
    page.goto(robot.url)
    page.locator(".bar .pill.good").wait_for()
    os.kill(robot.lupin.pid_of("lupin_gateway"), signal.SIGKILL)
    expect(page.locator("#stop-box")).to_have_attribute("data-state", "away")
    page.locator("#stop").click()
    expect(page.locator("#stop-state")).to_have_text("Not connected: use the button on the robot")
    listener.is_told(True, AFTER_RESTART)
    expect(page.locator("#stop-state")).to_contain_text("Stopped by page-")
    release(page)


def test_a_connection_that_died_in_silence_is_found_out(
    context: BrowserContext, robot: Served, listener: Robot
) -> None:
    """As after a sleep: the browser holds the connection for open, and nothing passes. It is made anew."""
    page = context.new_page()
    page.add_init_script(
        """const Real = WebSocket; let deaf = 0; const all = [];
        window.WebSocket = class extends Real {
          constructor(...given) { super(...given); all.push(this); }
          send(data) { if (!this.dead) super.send(data); } };
        window.WebSocket.OPEN = Real.OPEN;
        window.allDie = () => { for (const each of all) { each.dead = true; each.onmessage = null; } };"""
    )
    page.goto(robot.url)
    page.locator(".bar .pill.good").wait_for()
    page.evaluate("allDie()")
    page.locator("#stop").click()
    listener.is_told(True, AFTER_RESTART)
    expect(page.locator("#stop-state")).to_contain_text("Stopped by page-")
    release(page)


def test_it_works_after_a_sleep(context: BrowserContext, robot: Served, listener: Robot) -> None:
    """The browser freezes the page, the network goes; a press in between is told when it is back."""
    page = context.new_page()
    page.goto(robot.url)
    page.locator(".bar .pill.good").wait_for()
    session = context.new_cdp_session(page)
    for state in ("frozen", "active"):
        session.send("Page.setWebLifecycleState", {"state": state})
    press_and_release(page, listener)
    context.set_offline(True)
    page.locator("#stop").click()
    context.set_offline(False)
    listener.is_told(True, AFTER_RESTART)
    release(page)


def test_two_browsers_are_two(console: Page, browser: Browser, robot: Served, listener: Robot) -> None:
    """A stop of somebody else is shown with its name."""
    other = browser.new_context()
    page = other.new_page()
    page.goto(robot.url)
    page.locator("#stop").click()
    listener.is_told(True)
    expect(console.locator("#stop-state")).to_contain_text("Stopped by page-")
    expect(console.locator("#stop")).to_have_attribute("aria-pressed", "false")
    page.locator("#release").click(delay=HOLD_MS)
    listener.is_told(False)
    other.close()
