"""What everybody is to see at once: a stop, a failed mission and a question, in every view and beside it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the extra hmi is not installed here")
pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import Browser, Page, ViewportSize, expect

from tests.browsing import DESK, HOLD_MS, PHONE, opened
from tests.console.pages import ServedPages, SimulationPage

pytestmark = [pytest.mark.browser, pytest.mark.timeout(300)]

COOKBOOK = Path(__file__).parents[2] / "docs" / "cookbook"
VIEWS = ("control", "chart", "map", "log", "twin", "arm", "health", "people", "simulation")
INSPECTION = pytest.mark.parametrize("simulation", ["inspection"], indirect=True)
ASK = pytest.mark.parametrize("simulation", [str(COOKBOOK / "ask.yaml")], indirect=True)
#: What shakes the device is only counted.
SHAKES = "window.shaken = 0; navigator.vibrate = () => (window.shaken += 1, true);"
#: The colours of the timeline's pixels that are greener than they are red or blue.
GREEN = """canvas => {
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    let green = 0; for (let at = 0; at < data.length; at += 4)
        green += data[at + 3] > 0 && data[at + 1] > data[at] + 6 && data[at + 1] > data[at + 2] + 6;
    return green; }"""


@pytest.fixture(scope="module")
def simulation(request: pytest.FixtureRequest) -> Iterator[ServedPages]:
    """A mission that an operator starts: the one that the test names."""
    with ServedPages("simulate", request.param) as found:
        yield found


@pytest.fixture
def served(simulation: ServedPages) -> Iterator[SimulationPage]:
    """It has just begun, and goes as fast as it can."""
    found = SimulationPage(simulation.port)
    assert found.do("again") == (True, "")
    assert found.do("speed", "max") == (True, "")
    yield found
    found.close()


@pytest.fixture(params=[DESK, PHONE], ids=["desk", "phone"])
def page(
    request: pytest.FixtureRequest, browser: Browser, simulation: ServedPages, served: SimulationPage
) -> Iterator[Page]:
    """The console, which somebody has touched already, and which knows nothing of the test before."""
    context = browser.new_context(viewport=ViewportSize(**request.param), locale="en-GB")
    context.add_init_script(SHAKES)
    for found in opened(context, simulation.url):
        found.locator("nav").click(position={"x": 2, "y": 2})
        yield found
    context.close()


def in_every_view(page: Page, text: str) -> None:
    for view in VIEWS:
        page.evaluate(f"location.hash = '{view}'")
        expect(page.locator(".alert", has_text=text)).to_be_in_viewport()
    assert text in page.title()
    page.locator(".alert", has_text=text).click()
    expect(page.locator("nav a[aria-current=page]")).to_have_attribute("href", "#control")


def shaken(page: Page) -> int:
    return int(page.evaluate("window.shaken"))


@INSPECTION
def test_a_failed_mission_and_a_stop(page: Page, served: SimulationPage) -> None:
    assert served.command("start", "InspectionMission")["accepted"]
    assert served.do("silence", "nav.localize") == (True, "")
    assert served.do("until", "FAULT") == (True, "")
    in_every_view(page, "FAULT: localization failed")
    assert shaken(page) == 1
    mission = page.locator(".view section[aria-label='Mission']")
    expect(mission).to_contain_text("0 of ")
    expect(mission).to_contain_text("skipped")
    expect(mission.locator(".pill.good")).to_have_count(0)
    page.evaluate("location.hash = 'log'")
    page.wait_for_timeout(500)
    assert page.locator(".timeline-canvas canvas").evaluate(GREEN) == 0
    page.evaluate("location.hash = 'chart/FAULT'")
    expect(page.locator(".stage.fault")).to_be_visible()
    expect(page.locator(".pill.good", has_text="active")).to_have_count(0)

    page.locator("#stop").click()
    expect(page.locator("#stop-state")).to_contain_text("Stopped by page-")
    assert "STOPPED by page-" in page.title()
    assert shaken(page) == 2
    page.locator("#release").click(delay=HOLD_MS)
    expect(page.locator("#stop-state")).to_have_text("")
    assert "STOPPED" not in page.title()
    assert served.do("set", "estop", "true") == (True, "")
    in_every_view(page, "STOPPED: e-stop engaged")


@ASK
def test_a_question(page: Page, served: SimulationPage) -> None:
    assert served.command("start", "Ask")["accepted"]
    assert served.do("until", "ASKING") == (True, "")
    in_every_view(page, "The mission asks: At tag 1")
    assert shaken(page) == 1
    assert served.command("answer", choice="go_home")["accepted"]
    expect(page.locator(".alert")).to_have_count(0)
    assert page.title() == "Lupin console"


@INSPECTION
def test_a_stop_that_was_released_is_not_said_to_be_engaged(page: Page, served: SimulationPage) -> None:
    """Its hold is there still; it says what ends it."""
    assert served.command("start", "InspectionMission")["accepted"]
    mission = page.locator(".view section[aria-label='Mission']")
    page.evaluate("location.hash = 'control'")
    page.locator("#stop").click()
    expect(mission.locator(".control-holds")).to_contain_text("e-stop engaged")
    expect(page.locator(".view section[aria-label='What to do']")).to_contain_text(
        "Release the stop, then resume."
    )
    page.locator("#release").click(delay=HOLD_MS)
    expect(mission.locator(".control-holds")).to_contain_text("the stop is released")
    expect(mission.locator(".control-holds")).to_contain_text("ended by: resume")
    expect(mission).not_to_contain_text("e-stop")
    page.wait_for_timeout(700)  # the button has just come to its place
    page.locator(".view").get_by_role("button", name="resume", exact=True).click()
    expect(mission).to_contain_text("Asked last: resume by page-")
