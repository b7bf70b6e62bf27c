"""The stop under a thumb: it never moves, and what releases a stop needs a gesture of its own."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import (
    Browser,
    BrowserContext,
    CDPSession,
    Page,
    ViewportSize,
    WebSocketRoute,
    expect,
)

from tests.browsing import HOLD_MS, PATIENCE_MS, PHONE
from tests.lupin_ros.system.console.conftest import STOPS, Served
from tests.lupin_ros.system.console.test_stop import ESTOP, Robot, listener

__all__ = ["listener"]

SIZES = [(320, 568), (360, 740), (390, 844), (768, 1024), (1440, 900)]
SIZES += [(height, width) for width, height in SIZES]
#: Pixels around STOP in which nothing that releases may lie: a finger hits so far beside what it means.
SLIP_PX = 40
#: Milliseconds that a finger rests.
SHORT, USUAL, LONG, RESTING = 50, 150, 400, 1200
Box = dict[str, float]


class Finger:
    """A touch screen, and what the page sends of its stop."""

    def __init__(self, page: Page, session: CDPSession) -> None:
        self.page = page
        self._session = session
        #: What the page said of its stop, the newest last.
        self.said: list[bool] = []
        page.on("websocket", lambda socket: socket.on("framesent", self._sent))

    def _sent(self, frame: Any) -> None:
        sent = json.loads(frame)
        if sent.get("topic") == ESTOP and sent["op"] == "publish":
            self.said.append(sent["msg"]["data"])

    def _dispatch(self, kind: str, *points: tuple[float, float]) -> None:
        touches = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(points)]
        self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touches})

    def box(self, which: str) -> Box:
        """Return where something is."""
        found = self.page.locator(which).bounding_box()
        assert found is not None, which
        return dict(found)

    def middle(self, which: str) -> tuple[float, float]:
        box = self.box(which)
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def rest(self, at: tuple[float, float], rests_ms: float) -> None:
        """Touch a place for so long."""
        self._dispatch("touchStart", at)
        self.page.wait_for_timeout(rests_ms)
        self._dispatch("touchEnd")

    def slide(self, start: tuple[float, float], end: tuple[float, float], rests_ms: float) -> None:
        """Touch one place, and let go at another after having rested there."""
        self._dispatch("touchStart", start)
        for step in range(1, 6):
            along = (start[0] + (end[0] - start[0]) * step / 5, start[1] + (end[1] - start[1]) * step / 5)
            self._dispatch("touchMove", along)
        self.page.wait_for_timeout(rests_ms)
        self._dispatch("touchEnd")

    def two(self, first: tuple[float, float], second: tuple[float, float], rests_ms: float) -> None:
        """Touch a place, and with a second finger another one."""
        self._dispatch("touchStart", first)
        self._dispatch("touchStart", first, second)
        self.page.wait_for_timeout(rests_ms)
        self._dispatch("touchEnd")


@pytest.fixture
def touch(browser: Browser, robot: Served, request: pytest.FixtureRequest) -> Iterator[Finger]:
    """A page on a touch screen of the size that the test names; on a phone by default."""
    width, height = getattr(request, "param", (PHONE["width"], PHONE["height"]))
    size = ViewportSize(width=width, height=height)
    context = browser.new_context(viewport=size, has_touch=True, is_mobile=width < 1440, locale="en-GB")
    context.set_default_timeout(PATIENCE_MS)
    yield opened(context, robot.url)
    context.close()


def opened(context: BrowserContext, url: str) -> Finger:
    page = context.new_page()
    finger = Finger(page, context.new_cdp_session(page))
    page.goto(url)
    page.locator(".bar .pill.good").wait_for()
    expect(page.locator("#stop-box")).to_have_attribute("data-state", "free")
    return finger


def release(finger: Finger) -> None:
    finger.rest(finger.middle("#release"), HOLD_MS)
    expect(finger.page.locator("#stop-box")).to_have_attribute("data-state", "free")
    finger.said.clear()


def is_stopped(finger: Finger, place: Box) -> None:
    """The stop is engaged and nothing let it go; STOP is where it was, and what releases is not near it."""
    finger.page.wait_for_timeout(300)
    expect(finger.page.locator("#stop-state")).to_contain_text("page-")
    assert finger.page.locator("#stop").get_attribute("aria-pressed") == "true"
    assert finger.said
    assert all(finger.said)
    assert finger.box("#stop") == place
    is_away_from(finger.page, place)


def is_away_from(page: Page, place: Box) -> None:
    for button in page.locator("#stop-box button:visible:not(#stop)").all():
        box = button.bounding_box()
        assert box is not None
        aside = (
            box["x"] >= place["x"] + place["width"] + SLIP_PX
            or box["x"] + box["width"] + SLIP_PX <= place["x"]
        )
        assert aside, f"{button.inner_text()} at {box} is near STOP at {place}"


#: Those that `make test` tries, too: the narrowest, and a usual phone in both ways that it is held.
USUAL_SIZES = [(320, 568), (390, 844), (844, 390)]
BY_SIZE = pytest.mark.parametrize(
    "touch",
    [
        pytest.param(size, id=f"{size[0]}x{size[1]}", marks=[pytest.mark.long] * (size not in USUAL_SIZES))
        for size in SIZES
    ],
    indirect=True,
)


@BY_SIZE
def test_a_finger_on_stop_stops_however_long_it_rests_and_however_often_it_comes(touch: Finger) -> None:
    place, middle = touch.box("#stop"), touch.middle("#stop")
    for rests in (SHORT, USUAL, LONG, RESTING):
        touch.rest(middle, rests)
        is_stopped(touch, place)
        release(touch)
    for _ in range(2):
        touch.rest(middle, SHORT)
        touch.page.wait_for_timeout(SHORT)
    is_stopped(touch, place)
    touch.slide(middle, touch.middle("#release"), RESTING)
    is_stopped(touch, place)
    touch.slide(middle, (middle[0], middle[1] + 200), USUAL)
    is_stopped(touch, place)
    touch.two(middle, touch.middle("#release"), RESTING)
    is_stopped(touch, place)
    release(touch)


def test_what_releases_needs_to_be_held(touch: Finger) -> None:
    """No tap, no double tap, no finger that leaves or that another one joins, no click and no short key."""
    place = touch.box("#stop")
    touch.rest(touch.middle("#stop"), USUAL)
    own = touch.middle("#release")
    for rests in (SHORT, USUAL, LONG):
        touch.rest(own, rests)
        touch.rest(own, rests)
        is_stopped(touch, place)
    touch.slide(own, (own[0], own[1] + 200), RESTING)
    is_stopped(touch, place)
    touch.two(own, (own[0], own[1] + 300), RESTING)
    is_stopped(touch, place)
    touch.two((own[0], own[1] + 300), own, RESTING)
    is_stopped(touch, place)
    touch.page.evaluate("document.getElementById('release').click()")
    touch.page.locator("#release").focus()
    for key in ("Enter", " "):
        touch.page.keyboard.press(key)
    is_stopped(touch, place)
    release(touch)


@pytest.mark.parametrize("key", ["Enter", " "])
def test_a_key_that_is_held_releases(touch: Finger, key: str) -> None:
    touch.rest(touch.middle("#stop"), USUAL)
    touch.page.locator("#release").focus()
    touch.page.keyboard.down(key)
    touch.page.wait_for_timeout(300)
    touch.page.keyboard.down(key)  # as a key that is held repeats
    expect(touch.page.locator("#stop-box")).to_have_attribute("data-state", "free")
    touch.page.keyboard.down(key)
    touch.page.keyboard.up(key)
    touch.page.wait_for_timeout(300)
    expect(touch.page.locator("#stop-box")).to_have_attribute("data-state", "free")


def test_the_robot_stays_stopped_under_a_thumb(touch: Finger, listener: Robot) -> None:
    """As the robot hears it; nothing can be resumed, and the arm takes no preset."""
    page = touch.page
    for rests in (USUAL, LONG, RESTING):
        page.evaluate("location.hash = 'control'")
        touch.rest(touch.middle("#stop"), rests)
        listener.is_told(True)
        page.wait_for_timeout(500)
        listener.is_told(True)
        assert all(listener.heard)
        resume = page.get_by_role("button", name="resume", exact=True, include_hidden=True)
        expect(resume).to_have_attribute("aria-disabled", "true")
        page.evaluate("location.hash = 'arm'")
        expect(page.locator(".why").first).to_have_text("the robot is stopped: release the stop first")
        release(touch)
        listener.is_told(False)


NAMES = (
    "anna-3",
    "page-1f6a2b9c-12",
    "a-page-with-a-very-long-name-that-somebody-gave-it-4",
    "link",
)


@BY_SIZE
def test_stop_is_in_the_same_place_whatever_is_said_beside_it(touch: Finger, robot: Served) -> None:
    page, place = touch.page, touch.box("#stop")
    routes: list[WebSocketRoute] = []

    def through(route: WebSocketRoute) -> None:
        server = route.connect_to_server()
        server.on_message(lambda text: None if f'"{STOPS}"' in str(text) else route.send(text))
        routes.append(route)

    page.route_web_socket("**/_ros", through)
    page.reload()
    expect(page.locator("#stop-box")).to_have_attribute("data-state", "free")

    def say(**frame: Any) -> None:
        for route in routes:
            route.send(json.dumps(frame))
        page.wait_for_timeout(30)
        assert touch.box("#stop") == place
        is_away_from(page, place)

    def stops(*names: str, left: bool) -> None:
        told = {"stopped": bool(names), "stops": [{"name": n, "left": left, "age": 1.0} for n in names]}
        say(op="publish", topic=STOPS, msg={"data": json.dumps(told)})

    for language in ("en", "nl"):
        page.evaluate(f"document.documentElement.lang = '{language}'")
        for left in (False, True):
            stops(left=left)
            for count in (1, 2, 4):
                stops(*NAMES[:count], left=left)
    page.locator("#stop").tap()
    for language in ("nl", "en"):
        page.evaluate(f"document.documentElement.lang = '{language}'")
        stops(*NAMES, left=True)
    stops(*(f"page-{number}" for number in range(30)), left=True)
    say(op="service_response", id="reset x", result=False, values="no stop is called 'page-1'; " * 8)
    for route in routes:
        route.close()
    expect(page.locator("#stop-box")).to_have_attribute("data-state", "away")
    assert touch.box("#stop") == place
    is_away_from(page, place)
    page.evaluate("document.documentElement.dataset.mode = 'recording'")
    page.wait_for_timeout(100)
    assert touch.box("#stop") == place


def test_the_stop_of_another_page_is_reset_by_holding_only(
    browser: Browser, robot: Served, touch: Finger
) -> None:
    """Also while its state is told anew: what is held is the same button."""
    other = browser.new_context()
    page = other.new_page()
    page.goto(robot.url)
    page.locator("#stop").click()
    expect(touch.page.locator("#stop-state")).to_contain_text("page-")
    other.close()
    reset = "#stop-others button"
    expect(touch.page.locator(reset)).to_be_visible()
    for _ in range(2):
        touch.rest(touch.middle(reset), USUAL)
    touch.page.evaluate("document.querySelector('#stop-others button').click()")
    touch.page.wait_for_timeout(500)
    expect(touch.page.locator("#stop-box")).to_have_attribute("data-state", "stopped")
    touch.rest(touch.middle(reset), HOLD_MS)
    expect(touch.page.locator("#stop-box")).to_have_attribute("data-state", "free")
