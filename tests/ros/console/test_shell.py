"""The page around the views: the stop, the languages, the colours."""

from __future__ import annotations

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import Browser, Page, expect

from lupin_gateway.server import PAGES
from tests.ros.console.conftest import Served


def test_one_press_stops_and_another_button_releases(console: Page) -> None:
    console.locator("#stop").click()
    expect(console.locator("#stop-state")).to_contain_text("Stopped by")
    expect(console.locator("#stop")).to_have_attribute("aria-pressed", "true")
    console.reload()
    expect(console.locator("#stop")).to_have_attribute("aria-pressed", "true")
    console.get_by_role("button", name="Release my stop").click()
    expect(console.locator("#stop-box")).to_have_attribute("data-state", "free")


def test_the_stop_of_a_page_that_is_gone_is_reset_by_its_name(
    console: Page, browser: Browser, robot: Served
) -> None:
    other = browser.new_context()
    page = other.new_page()
    page.goto(robot.url)
    page.locator("#stop").click()
    expect(console.locator("#stop-box")).to_have_attribute("data-state", "stopped")
    other.close()
    console.get_by_role("button", name="Reset page-").click()
    expect(console.locator("#stop-box")).to_have_attribute("data-state", "free")


def test_it_speaks_dutch_and_stays_so(console: Page) -> None:
    console.get_by_text("Settings").click()
    console.get_by_label("Language").select_option("nl")
    expect(console.get_by_role("link", name="Kaart")).to_be_visible()
    console.reload()
    expect(console.get_by_role("link", name="Kaart")).to_be_visible()


def test_nothing_comes_from_elsewhere(console: Page, robot: Served) -> None:
    loaded = console.evaluate("performance.getEntriesByType('resource').map((each) => each.name)")
    assert loaded
    assert {name for name in loaded if not name.startswith(robot.url)} == set()
    assert (PAGES / "console.js").stat().st_size > 0
