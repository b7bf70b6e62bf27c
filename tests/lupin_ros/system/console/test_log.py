"""Timeline and log: what happened before the page was there, scrubbing, filters, gaps, and foreign clocks."""

from __future__ import annotations

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import Browser, BrowserContext, Locator, Page, Route, expect

from tests.browsing import opened
from tests.lupin_ros.system.console.conftest import PATIENCE_MS, Served, stall

pytestmark = pytest.mark.long


def command(robot: Served, *words: str) -> None:
    """Command the orchestrator from a shell, as somebody else may."""
    options = ["--domain", str(robot.lupin.domain)]
    subprocess.run([sys.executable, "-m", "lupin_cli.main", *words, *options], check=True, timeout=60)


@pytest.fixture(scope="module")
def robot(serve: Callable[..., Served]) -> Served:
    """One that stands before tag 3 of an inspection, and was paused and resumed before.

    Its past and its deaths are this module's alone. A second try begins with another one.
    """
    robot = serve("up", "--speed", "2")
    command(robot, "start", "inspection")
    command(robot, "pause")
    command(robot, "resume")
    robot.lupin.until_line("tag 2")
    stall(robot, 1000)
    return robot


@pytest.fixture
def log(robot: Served, console: Page) -> Page:
    """The log of that robot, with all of its past."""
    console.goto(f"{robot.url}#log")
    expect(console.locator(".log .panel-head .soft")).to_contain_text("lines")
    search(console, "start InspectionMission accepted")
    expect(line(console, "start InspectionMission accepted")).to_have_count(1)
    search(console, "")
    return console


def line(page: Page, text: str) -> Locator:
    """The lines that have a text, of those that are to be seen."""
    return page.get_by_role("row").filter(has_text=text)


def search(page: Page, text: str) -> None:
    """Show only lines with a text."""
    page.locator(".log-filters").get_by_label("Search").fill(text)


def moment_of(page: Page) -> str:
    """The time of the moment that is shown."""
    return page.locator(".moment time").get_attribute("datetime") or ""


def test_a_reload_in_the_middle_of_a_mission_loses_nothing(log: Page) -> None:
    """The log begins with the start of the orchestrator, each step once, in the order of time."""
    before = log.locator(".line-time").all_inner_texts()
    log.reload()
    log.locator(".lines").focus()
    log.keyboard.press("Home")
    expect(line(log, "start plugins.ready").first).to_be_visible()
    expect(line(log, "plugins.ready done").first).to_be_visible()
    times = log.locator(".lines-all .line-time").all_inner_texts()
    assert times == sorted(times)
    assert before
    search(log, "start InspectionMission accepted")
    expect(line(log, "start InspectionMission accepted")).to_have_count(1)


def test_every_view_follows_to_a_moment_and_one_key_is_live(log: Page) -> None:
    """A click on a line sets the moment: state bar, timeline, log; L is now again."""
    search(log, "pause accepted")
    line(log, "pause accepted").click()
    expect(log.locator(".moment-past")).to_be_visible()
    expect(log.locator(".bar .where")).to_contain_text("paused")
    paused_at = moment_of(log)
    expect(line(log, "pause accepted")).to_have_attribute("aria-selected", "true")
    log.get_by_text("As a table").click()
    expect(log.get_by_role("row", name=re.compile("Holds .*paused by the operator"))).to_be_visible()
    log.get_by_role("link", name="Chart").click()
    assert moment_of(log) == paused_at
    log.keyboard.press("l")
    expect(log.locator(".moment-past")).to_have_count(0)
    expect(log.locator(".bar .where")).not_to_contain_text("paused")


def test_keys_go_step_by_step_and_from_problem_to_problem(log: Page) -> None:
    """On the timeline, on the log, and on the slider below."""
    timeline, shown = log.get_by_role("slider", name="Timeline"), log.locator(".moment time")
    timeline.focus()
    log.keyboard.press("Home")
    begin = moment_of(log)
    log.keyboard.press("ArrowRight")
    expect(shown).not_to_have_attribute("datetime", begin)
    first = moment_of(log)
    log.keyboard.press("ArrowRight")
    expect(shown).not_to_have_attribute("datetime", first)
    assert begin < first < moment_of(log)
    log.keyboard.press("ArrowLeft")
    expect(shown).to_have_attribute("datetime", first)
    log.keyboard.press("Shift+ArrowRight")
    expect(log.locator(".log-detail")).to_contain_text("warning")
    log.keyboard.press("Escape")
    expect(log.locator(".moment-past")).to_have_count(0)
    slider = log.get_by_role("slider", name="The moment that is shown")
    slider.press("ArrowLeft")
    expect(log.locator(".moment-past")).to_be_visible()
    slider.press("End")
    expect(log.locator(".moment-past")).to_have_count(0)
    log.locator(".lines").focus()
    log.keyboard.press("Home")
    log.keyboard.press("ArrowDown")
    expect(log.get_by_role("row", selected=True)).to_have_count(1)
    log.get_by_role("button", name="● Live").click()
    expect(log.locator(".moment-past")).to_have_count(0)


def test_a_pointer_sets_the_moment_and_moves_the_timeline(log: Page) -> None:
    """A click is a moment; dragging and the wheel only move what is seen."""
    timeline = log.get_by_role("slider", name="Timeline")
    box = timeline.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + 10
    log.mouse.move(x, y)
    expect(log.locator(".timeline-hint")).to_contain_text(re.compile(r"\d\d:\d\d:\d\d"))
    log.mouse.wheel(0, -300)
    log.mouse.down()
    log.mouse.move(x + 100, y, steps=5)
    log.mouse.up()
    expect(log.locator(".moment-past")).to_have_count(0)
    log.mouse.click(x, y)
    expect(log.locator(".moment-past")).to_be_visible()
    log.keyboard.press("Escape")


def test_filters_and_what_is_saved(log: Page, tmp_path: Path) -> None:
    """By severity, kind, target and text; the file has the lines that are shown."""
    count = log.locator(".log .panel-head .soft")
    log.locator(".log-filters").get_by_label("Severity").select_option("warnings and errors")
    expect(log.locator(".lines-all .line-sign", has_text="●")).to_have_count(0)
    expect(line(log, "held: paused by the operator")).to_have_count(1)
    log.locator(".log-filters").get_by_label("Severity").select_option("everything")
    log.locator(".log-filters select").nth(1).select_option("1")
    expect(count).to_contain_text(" of ")
    expect(log.locator(".lines-all").get_by_role("row").first).to_contain_text("1 ")
    log.get_by_role("button", name="Go to it").click()
    expect(log.locator(".bar .where")).to_contain_text("· 1")
    log.keyboard.press("l")
    log.locator(".log-filters select").nth(1).select_option("every target")
    log.locator(".log-kinds summary").click()
    kinds = log.locator(".log-kinds input")
    for index in range(1, kinds.count()):
        kinds.nth(index).uncheck()
    expect(line(log, "pause accepted")).to_have_count(1)
    expect(line(log, "nav.go_to done")).to_have_count(0)
    saved = {}
    for kind in ("CSV", "JSON"):
        with log.expect_download() as download:
            log.get_by_role("button", name=f"Save {kind}").click()
        saved[kind] = tmp_path / download.value.suggested_filename
        download.value.save_as(saved[kind])
    with saved["CSV"].open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["kind"], row["text"].partition(" accepted")[0]) for row in rows] == [
        ("command", "start InspectionMission"), ("command", "pause"), ("command", "resume"),
    ]  # fmt: skip
    assert [row["time"] for row in json.loads(saved["JSON"].read_text(encoding="utf-8"))] == [
        row["time"] for row in rows
    ]
    search(log, "no such thing")
    expect(log.get_by_text("No line is like this.")).to_be_visible()


def test_a_time_is_jumped_to(log: Page) -> None:
    """Of the clock on the wall here; what is no time is said so."""
    search(log, "pause accepted")
    shown = line(log, "pause accepted").locator(".line-time").inner_text()
    jump = log.get_by_label("Jump to")
    jump.fill(shown.partition(".")[0])
    jump.press("Enter")
    expect(log.locator(".moment time")).to_contain_text(shown.partition(".")[0])
    jump.fill("25:70")
    jump.press("Enter")
    expect(log.get_by_text("this is no time of day, such as 03:12")).to_be_visible()


def test_a_click_on_a_state_opens_it_in_the_chart(log: Page) -> None:
    search(log, "plugins.ready done")
    line(log, "plugins.ready done").get_by_role("button", name="READY").click()
    expect(log).to_have_url(re.compile(r"#chart/READY$"))
    expect(log.locator(".moment-past")).to_be_visible()


def test_a_browser_whose_clock_is_an_hour_off_shows_the_robots_time(browser: Browser, robot: Served) -> None:
    """Nothing shifts: neither what is now, nor the lines, nor what is live."""
    context = browser.new_context(locale="en-GB", timezone_id="Europe/Amsterdam")
    context.add_init_script(
        "const real = Date; const off = 3600000;"
        "window.Date = class extends real {"
        "  constructor(...given) { super(...(given.length ? given : [real.now() + off])); }"
        "  static now() { return real.now() + off; } };"
        "Object.defineProperty(performance, 'timeOrigin', {value: performance.timeOrigin + off});"
    )
    page = context.new_page()
    page.goto(f"{robot.url}#log")
    search(page, "start InspectionMission accepted")
    expect(line(page, "start InspectionMission accepted")).to_have_count(1, timeout=PATIENCE_MS)
    expect(page.locator(".moment time")).to_contain_text("CET")
    now = datetime.fromisoformat(moment_of(page).replace("Z", "+00:00")).timestamp()
    assert abs(now - time.time()) < 30
    page.get_by_role("slider", name="Timeline").press("ArrowLeft")
    expect(page.locator(".bar .where")).to_contain_text(re.compile(r"[A-Z]{4}"))
    then = datetime.fromisoformat(moment_of(page).replace("Z", "+00:00")).timestamp()
    assert timedelta(0) <= timedelta(seconds=time.time() - then) < timedelta(minutes=10)
    context.close()


#: More steps than a page keeps that shows what is now.
MANY = 5800


def test_what_a_page_forgets_is_loaded_when_it_is_looked_for(context: BrowserContext, robot: Served) -> None:
    """Of an hour and more a page has the end; the log, Home and the report of a shift get the rest."""
    path = f"{robot.url}history?since=0&topics=/mission_orchestrator/steps"
    first = json.loads(context.request.get(path).text().splitlines()[0])
    record = json.loads(first["msg"]["data"])
    names = ("configuration", "asking", "held", "attempts", "cancelling")
    record["view"] = {**{name: [] for name in names}, "lifecycle": "BOOT", "mission": "", "holds": {}}

    def step(number: int) -> str:
        at = first["at"] - 100 * (MANY - number)
        told = {"event": "value", "sequence": number - MANY, "notes": [f"long ago {number}"], "time": 0.0}
        text = json.dumps({**record, "wall_ns": at * 1_000_000, "step": {**told, "configuration": []}})
        return json.dumps({**first, "at": at, "msg": {"data": text}})

    before = "\n".join(map(step, range(MANY)))
    asked: list[str] = []

    def answer(route: Route) -> None:
        asked.append(route.request.url)
        if "since=0&" in route.request.url:
            route.fulfill(body=f"{before}\n{route.fetch().text()}")
        else:
            route.continue_()

    context.route(re.compile("/history"), answer)
    for page in opened(context, f"{robot.url}#log"):
        older = page.get_by_role("button", name="Show what was before")
        older.click()
        search(page, "long ago 0")
        expect(line(page, "long ago 0")).to_have_count(1)
        expect(older).to_have_count(0)
        page.get_by_role("link", name="Chart").click()
        page.get_by_role("link", name="Log").click()
        expect(older).to_be_visible()
        expect(line(page, "long ago 0")).to_have_count(0)
        page.get_by_role("slider", name="Timeline").press("Home")
        expect(page.locator(".moment-past")).to_be_visible()
        expect(line(page, "long ago 0")).to_have_count(1)
        begin = datetime.fromisoformat(moment_of(page).replace("Z", "+00:00")).timestamp()
        assert begin * 1000 == pytest.approx(first["at"] - 100 * MANY, abs=1)
        assert sum("since=0&" in url for url in asked) == 3


def test_a_page_that_was_frozen_is_back_at_what_is_now(log: Page, robot: Served) -> None:
    """A laptop that slept: what happened meanwhile is shown, and is in the log, without being loaded anew."""
    search(log, "pause accepted")
    expect(line(log, "pause accepted").first).to_be_visible()
    before = line(log, "pause accepted").count()
    session = log.context.new_cdp_session(log)
    session.send("Page.setWebLifecycleState", {"state": "frozen"})
    command(robot, "pause")
    session.send("Page.setWebLifecycleState", {"state": "active"})
    expect(log.locator(".bar .where")).to_contain_text("paused")
    expect(log.locator(".bar .pill.good").first).to_be_visible()
    expect(line(log, "pause accepted")).to_have_count(before + 1)
    command(robot, "resume")
    expect(log.locator(".bar .where")).not_to_contain_text("paused")


def test_a_death_of_the_orchestrator_is_a_gap(log: Page, robot: Served) -> None:
    """`kill -9`: the silence, the new start, and what was before are all in the log, also after a reload."""
    os.kill(robot.lupin.pid_of("mission_orchestrator"), signal.SIGKILL)
    robot.lupin.until_line("mission_orchestrator is back")
    for _ in range(2):
        search(log, "orchestrator was")
        expect(line(log, "the orchestrator was started anew").first).to_be_visible()
        log.locator(".log-filters").get_by_label("Severity").select_option("errors")
        expect(log.locator(".lines-all").get_by_role("row").first).to_contain_text("✖")
        log.reload()
    search(log, "pause accepted")
    expect(line(log, "pause accepted").first).to_be_visible()
