"""Two people at one robot: each sees the other, what was pressed, and what is to be known."""

from __future__ import annotations

import csv
import os
import signal
from pathlib import Path

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import Browser, BrowserContext, Page, expect

from tests.browsing import HOLD_MS
from tests.lupin_ros.launch.processes import until
from tests.lupin_ros.system.console.asking import command
from tests.lupin_ros.system.console.conftest import DESK, PATIENCE_MS, Served

pytestmark = pytest.mark.long


@pytest.fixture
def other(browser: Browser, robot: Served, console: Page) -> Page:
    """Another person's page, who came later."""
    context = browser.new_context(viewport=DESK, locale="en-GB")
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    page.goto(robot.url)
    page.locator(".bar .pill.good").wait_for()
    page.evaluate("location.hash = 'people'")
    return page


def acknowledge_all(page: Page) -> None:
    """Begin with nothing that is open."""
    button = page.get_by_role("button", name="Acknowledge all")
    if button.is_enabled():
        button.click()
    expect(page.locator(".notices li.open")).to_have_count(0)


def test_two_pages_see_each_other_and_what_was_pressed(console: Page, other: Page) -> None:
    console.evaluate("location.hash = 'arm'")
    here = other.locator("section", has=other.get_by_role("heading", name="Who is here"))
    expect(here.get_by_role("row", name="you")).to_contain_text("People")
    expect(here.get_by_role("row", name="Arm")).to_contain_text("engineer")
    expect(here.locator("tbody tr")).to_have_count(2)
    command(console, "abort")
    preset = console.get_by_role("button", name="tuck")
    expect(preset).to_be_enabled()
    preset.click()
    pressed = other.locator("section", has=other.get_by_role("heading", name="What was pressed"))
    expect(pressed.locator("tbody tr").first).to_contain_text("/lupin/arm/preset")
    expect(pressed.locator("tbody tr").first).to_contain_text("tuck")
    expect(pressed.locator("tbody tr").first).to_contain_text("done")
    name = here.get_by_role("row", name="Arm").locator("th").inner_text().strip()
    expect(pressed.locator("tbody tr").first).to_contain_text(name)
    console.close()
    expect(here.locator("tbody tr")).to_have_count(1)


def test_a_stop_notifies_and_what_one_acknowledges_the_other_sees(console: Page, other: Page) -> None:
    console.evaluate("location.hash = 'people'")
    acknowledge_all(console)
    console.locator("#stop").click()
    stop = other.locator(".notices li", has_text="stopped by").first
    expect(stop).to_have_class("open")
    expect(other.get_by_text("e-stop engaged").first).to_be_visible()
    expect(other.locator(".notices li.open")).to_have_count(1)
    expect(other.locator("nav .badge")).to_contain_text("not acknowledged")
    console.get_by_role("button", name="Release my stop").click(delay=HOLD_MS)
    expect(stop).to_contain_text("over since")
    console.get_by_role("button", name="Acknowledge: stopped by").click()
    other.reload()
    other.locator(".bar .pill.good").wait_for()
    expect(stop).to_have_class("known")
    expect(stop.locator("[title]").last).to_contain_text("✓ page-")
    acknowledge_all(console)
    expect(other.locator("nav .badge")).to_have_count(0)


def test_notifications_outlive_the_gateway(context: BrowserContext, robot: Served) -> None:
    """The browser says that it cannot connect meanwhile, which fails no test here."""
    console = context.new_page()
    console.goto(f"{robot.url}#people")
    console.locator(".bar .pill.good").wait_for()
    acknowledge_all(console)
    console.locator("#stop").click()
    console.get_by_role("button", name="Release my stop").click(delay=HOLD_MS)
    stop = console.locator(".notices li", has_text="stopped by").first
    expect(stop).to_have_class("open")
    # A gateway that dies before it took the release comes back stopped.
    expect(console.locator("#stop-box")).to_have_attribute("data-state", "free")
    known = console.locator(".notices li.known").count()
    os.kill(robot.lupin.pid_of("lupin_gateway"), signal.SIGKILL)
    expect(console.locator(".bar .pill").first).to_have_text("✖ connection lost")
    expect(console.locator(".bar .pill").first).to_have_text("✓ connected")
    console.reload()
    expect(stop).to_have_class("open")
    expect(console.locator(".notices li.known")).to_have_count(known)
    pressed = console.locator("section", has=console.get_by_role("heading", name="What was pressed"))
    expect(pressed.locator("tbody tr").filter(has_text="/lupin/hmi/acknowledge").first).to_be_visible()


def test_the_report_of_a_shift_is_counted_printed_and_saved(console: Page, tmp_path: Path) -> None:
    start = ("start", "ExplorationMission", '{"discovery_goal": 2}')
    # Refused while the stop of the test before is on its way to its end.
    until(lambda: command(console, *start)["accepted"], "a mission begins")
    expect(console.locator(".where b")).to_have_text("MONITORING")
    command(console, "abort")
    expect(console.locator(".where b")).to_have_text("DONE")
    console.evaluate("location.hash = 'people/report'")
    report = console.locator(".report")
    missions = report.locator("section", has=console.get_by_role("heading", name="Missions"))
    expect(missions.locator("tbody tr").last).to_contain_text("ExplorationMission")
    expect(missions.locator("tbody tr").last).to_contain_text("DONE")
    interventions = report.locator("section", has=console.get_by_role("heading", name="Interventions"))
    expect(interventions.locator("tbody tr", has_text="abort").first).to_be_visible()
    with console.expect_download() as saving:
        console.get_by_role("button", name="Save as CSV").click()
    file = tmp_path / "shift.csv"
    saving.value.save_as(file)
    with file.open(encoding="utf-8", newline="") as opened:
        rows = list(csv.reader(opened))
    at = rows.index(["Missions"])
    assert rows[at + 1][:4] == ["Mission", "From", "To", "State"]
    assert any(
        row[:1] == ["ExplorationMission"] and row[3] == "DONE" for row in rows[at + 2 :] if len(row) > 3
    )
    console.emulate_media(media="print", color_scheme="dark")
    assert report.evaluate("each => getComputedStyle(each).color") == "rgb(0, 0, 0)"
    expect(console.locator("nav")).to_be_hidden()
    expect(console.get_by_role("button", name="Print")).to_be_hidden()
    expect(report.get_by_role("heading", name="Shift report")).to_be_visible()
    assert len(console.pdf()) > 5_000
