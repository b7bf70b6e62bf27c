"""Several robots in the console: the list, and whose stop it is."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the extra hmi is not installed here")
pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import Browser, Page, ViewportSize, expect

from lupin_engine.plugin import Progress
from lupin_gateway.motion import MissionLevel
from tests.browsing import DESK, PHONE, opened
from tests.plugins.gateway.served import ServedGateway, until

pytestmark = [pytest.mark.browser, pytest.mark.timeout(300)]


@pytest.fixture
def robots(tmp_path: Path) -> Iterator[tuple[ServedGateway, ServedGateway]]:
    """Two; the second is on a mission, which asks something."""
    first, second = ServedGateway(tmp_path / "1"), ServedGateway(tmp_path / "2")
    for name, one in (("robot1", first), ("robot2", second)):
        one.gateway.robot = name
    first.together(robot2=second)
    second.rules.progress = Progress("inspection", "i-1", "INSPECTING", target="12")
    second.rules.people.steps.asked = {"ASKING": "Go on?"}
    second.rules.motion.hear_mission(MissionLevel("INSPECTING", under_way=True), 1e12)
    with first:
        yield first, second


@pytest.fixture(params=[DESK, PHONE], ids=["desk", "phone"])
def page(
    request: pytest.FixtureRequest, browser: Browser, robots: tuple[ServedGateway, ServedGateway]
) -> Iterator[Page]:
    """The console of the first one."""
    context = browser.new_context(viewport=ViewportSize(**request.param), locale="en-GB")
    yield from opened(context, f"http://127.0.0.1:{robots[0].port}/")
    context.close()


def test_each_is_shown_and_stopped_on_its_own_page(
    page: Page, robots: tuple[ServedGateway, ServedGateway]
) -> None:
    """A stop of one is shown on the page of the other, whose own stop stays released."""
    first, second = robots
    expect(page).to_have_title("robot1 · Lupin console")
    stop, listed = page.locator("#stop"), page.get_by_role("navigation", name="Robots").locator("a")
    expect(stop).to_have_text("STOP robot1")
    expect(listed).to_have_text(["robot1 not heard", "robot2 INSPECTING · 12 ▲ Go on?"], use_inner_text=True)
    listed.nth(1).click()
    expect(stop).to_have_text("STOP robot2")
    expect(listed.nth(1)).to_have_attribute("aria-current", "page")
    page.locator(".bar .pill.good").wait_for()
    stop.click()
    until(lambda: second.stop_told[-1:] == [True], "the stop")
    expect(page.locator("#stop-state")).to_have_text(re.compile(r"^robot2: Stopped by page-\d$"))
    listed.nth(0).click()
    expect(stop).to_have_text("STOP robot1")
    expect(page.locator("#stop-box")).to_have_attribute("data-state", "free")
    expect(listed.nth(1)).to_contain_text("STOPPED by page-")
    assert not any(first.stop_told)
    until(lambda: [one["left"] for one in second.states[-1]["stops"]] == [True], "it outlives its page")
