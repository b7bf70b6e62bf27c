"""The console in a browser, on a simulation that is operated by the page alone, and on a recording."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from datetime import datetime, timezone
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the extra hmi is not installed here")
pytest.importorskip("playwright", reason="playwright is not installed here")
pytest.importorskip("mcap_ros2", reason="the extra record is not installed here")

from mcap_ros2.writer import Writer
from playwright.sync_api import Browser, BrowserContext, CDPSession, Locator, Page, expect

from tests.browsing import HOLD_MS, PHONE, opened
from tests.console.pages import STEPS, ServedPages, SimulationPage

pytestmark = [pytest.mark.browser, pytest.mark.timeout(300)]

#: What stands out of the page on the right, the navigation aside, which can be scrolled.
WIDER = """[...document.querySelectorAll("body *:not(nav *)")]
    .filter((each) => each.getBoundingClientRect().right > innerWidth + 1)
    .map((each) => `${each.tagName} ${each.className}`)"""
#: Topics of the orchestrator that are a std_msgs/String.
TEXTS = ("steps", "possible", "missions", "chart")


@pytest.fixture(scope="module")
def simulation() -> Iterator[ServedPages]:
    """A mission that an operator starts."""
    with ServedPages("simulate", "inspection") as found:
        yield found


@pytest.fixture
def page(context: BrowserContext, simulation: ServedPages) -> Iterator[Page]:
    """The console on a simulation that has just begun."""
    for found in opened(context, f"{simulation.url}#simulation"):
        found.get_by_role("button", name="Begin again").click()
        expect(found.locator(".virtual-time")).to_have_text("0 s")
        yield found


def bar(page: Page) -> Locator:
    return page.locator(".virtual")


def state(page: Page) -> Locator:
    return page.locator(".bar .where b")


def run_to_the_end(page: Page) -> None:
    """Start a mission by the page's own button, and run it as fast as it goes."""
    page.get_by_role("link", name="Mission").click()
    page.get_by_role("button", name="Start inspection").click()
    expect(state(page)).to_have_text("PREPARE")
    bar(page).get_by_label("Speed").select_option("max")
    bar(page).get_by_role("button", name="Run", exact=True).click()
    expect(state(page)).to_have_text("DONE")


def test_a_mission_is_operated_from_start_to_end_and_marked_as_simulated(page: Page) -> None:
    expect(page.locator(".virtual-word")).to_have_text("SIMULATION")
    expect(state(page)).to_have_text("READY")
    run_to_the_end(page)
    expect(bar(page).get_by_role("status")).to_have_text("nothing will happen by itself")
    page.get_by_role("link", name="Log").click()
    expect(page.get_by_role("region", name="Timeline")).to_contain_text("nav.go_to")
    page.get_by_role("link", name="Chart").click()
    expect(page.locator("svg [data-state='DONE']").first).to_be_visible()


def test_a_fault_is_injected_step_by_step(page: Page) -> None:
    page.get_by_role("link", name="Mission").click()
    page.get_by_role("button", name="Start inspection").click()
    page.get_by_role("link", name="Simulation").click()
    operation = page.get_by_role("group", name="nav.localize")
    expect(operation).to_be_visible()
    bar(page).get_by_role("button", name="Step").click()
    operation = page.get_by_role("group", name="nav.go_to")
    operation.get_by_label("Fail with").select_option("nav_status_6")
    operation.get_by_role("button", name="Fail now").click()
    page.get_by_role("link", name="Log").click()
    expect(page.get_by_role("region", name="Log")).to_contain_text("nav_status_6")


def test_silence_and_what_the_robot_senses(page: Page) -> None:
    page.get_by_role("link", name="Mission").click()
    page.get_by_role("button", name="Start inspection").click()
    page.get_by_role("link", name="Simulation").click()
    page.get_by_role("group", name="nav.localize").get_by_role("button", name="Fall silent").click()
    page.get_by_role("button", name="nav.localize answers again").click()
    expect(page.get_by_role("button", name="answers again")).to_have_count(0)
    page.get_by_role("button", name="estop true").click()
    row = page.get_by_role("row", name=re.compile("^estop"))
    expect(row.locator("code")).to_have_text("true")
    battery = page.get_by_role("row", name=re.compile("^battery(?!_)"))
    battery.get_by_role("textbox").fill("much")
    battery.get_by_role("button", name="Set").click()
    wrong = page.get_by_role("region", name="Faults").get_by_role("alert")
    expect(wrong).to_have_text("battery: expected number, got 'much'")
    battery.get_by_role("textbox").fill("12 %")
    battery.get_by_role("button", name="Set").click()
    expect(battery.locator("code")).to_contain_text("0.12")
    expect(wrong).to_have_count(0)


def test_the_stop_of_the_page_stops_the_simulated_robot(page: Page) -> None:
    page.locator("#stop").click()
    row = page.get_by_role("row", name=re.compile("^estop"))
    expect(row.locator("code")).to_have_text("true")
    page.get_by_role("button", name="Release my stop").click(delay=HOLD_MS)
    expect(row.locator("code")).to_have_text("false")


def test_it_begins_again_also_while_the_past_is_looked_at(page: Page) -> None:
    run_to_the_end(page)
    page.locator(".moment input").press("Home")
    expect(state(page)).not_to_have_text("DONE")
    bar(page).get_by_role("button", name="Begin again").click()
    expect(state(page)).to_have_text("READY")
    expect(page.locator(".virtual-time")).to_have_text("0 s")
    page.get_by_role("link", name="Log").click()
    expect(page.get_by_role("region", name="Timeline")).not_to_contain_text("nav.go_to")


def test_a_second_try_is_counted_where_it_runs(page: Page) -> None:
    """In the chart and beside it, and with what runs now."""
    page.get_by_role("link", name="Mission").click()
    page.get_by_role("button", name="Start inspection").click()
    page.get_by_role("link", name="Simulation").click()
    operation = page.get_by_role("group", name="nav.go_to")
    expect(page.get_by_role("group", name="nav.localize")).to_be_visible()
    bar(page).get_by_role("button", name="Step").click()
    operation.get_by_label("Fail with").select_option("nav_status_6")
    operation.get_by_role("button", name="Fail now").click()
    expect(operation).to_have_count(0)
    bar(page).get_by_role("button", name="Step").click()
    expect(operation).to_be_visible()
    expect(page.locator(".control-running")).to_contain_text("try 2")
    page.get_by_role("link", name="Chart").click()
    expect(page.locator(".chart .pill", has_text="nav.go_to: try 2")).to_be_visible()
    expect(page.locator(".paper .retry text")).to_have_text("↻ 2")


def test_two_fingers_zoom_the_chart_and_not_the_page(browser: Browser, simulation: ServedPages) -> None:
    context = browser.new_context(viewport=PHONE, has_touch=True, is_mobile=True, locale="en-GB")
    for page in opened(context, f"{simulation.url}#chart"):
        drawing, stage = page.locator(".paper svg"), page.locator(".stage").bounding_box()
        before = drawing.bounding_box()
        assert before is not None
        assert stage is not None
        place = stage["x"] + stage["width"] / 2, stage["y"] + 100
        fingers = context.new_cdp_session(page)
        spread(fingers, "touchStart", place, 20)
        for apart in range(20, 80, 10):
            spread(fingers, "touchMove", place, apart)
        fingers.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        wider = "([svg, least]) => svg.getBoundingClientRect().width > least"
        page.wait_for_function(wider, arg=[drawing.element_handle(), 1.3 * before["width"]])
        assert page.evaluate("visualViewport.scale") == 1
    context.close()


def spread(fingers: CDPSession, kind: str, place: tuple[float, float], apart: float) -> None:
    """Touch on both sides of a place, so many pixels from it."""
    x, y = place
    points = [{"x": x + way * apart, "y": y, "id": number} for number, way in enumerate((-1, 1))]
    fingers.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


LISTS = """
mission: Lists
summary: Take a list, which may be empty.
request:
  names: {type: list of text, default: [a, b], summary: what to do}
initial: WAIT
states:
  WAIT: {after: {1 h: done}}
  done: {type: final}
"""


def test_an_empty_list_is_sent_on_purpose_only(context: BrowserContext, tmp_path: Path) -> None:
    """A field that is left alone keeps its default; a comma alone is a list of nothing."""
    file = tmp_path / "lists.yaml"
    file.write_text(LISTS)
    with ServedPages("simulate", str(file)) as served:
        for page in opened(context, f"{served.url}#control"):
            page.get_by_text("Options").click()
            for text, sent in ((",", []), ("", None)):
                page.get_by_label(re.compile("^names")).fill(text)
                page.get_by_role("button", name="Start lists").click()
                expect(page.locator(".control-answer.good")).to_contain_text("start")
                records = [
                    json.loads(line["msg"]["data"]) for line in served.history() if line["topic"] == STEPS
                ]
                started = [
                    each["step"]["data"] for each in records if each["step"]["event"] == "mission.start"
                ]
                assert started[-1].get("names") == sent
                page.get_by_role("button", name="Begin again").click()
                expect(page.locator(".virtual-time")).to_have_text("0 s")


def test_every_view_lives_without_half_of_its_topics_and_without_webgl(
    context: BrowserContext, simulation: ServedPages
) -> None:
    """A simulation has the orchestrator's topics only; the browser gives no context of WebGL."""
    context.add_init_script(
        "const get = HTMLCanvasElement.prototype.getContext;"
        "HTMLCanvasElement.prototype.getContext = function (kind, ...more) {"
        "  return /webgl|webgpu/.test(kind) ? null : get.call(this, kind, ...more); };"
    )
    for page in opened(context, f"{simulation.url}#simulation"):
        names = page.locator("nav a").evaluate_all("links => links.map((link) => link.hash)")
        assert len(names) > 7
        for name in names:
            page.goto(f"{simulation.url}{name}")
            expect(page.locator("main .panel, main canvas").first).to_be_visible()
            expect(page.locator("main [role=alert]")).to_have_count(0)
            expect(page.locator("#stop")).to_be_enabled()


def test_a_phone_has_the_controls_of_time_and_the_faults(
    context: BrowserContext, simulation: ServedPages
) -> None:
    for page in opened(context, f"{simulation.url}#simulation"):
        page.set_viewport_size(PHONE)
        expect(bar(page).get_by_role("button", name="Step")).to_be_in_viewport()
        assert page.evaluate(WIDER) == []


# -- a recording ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a simulation told its pages, as a recording of the same topics."""
    file = tmp_path_factory.mktemp("recording") / "inspection.mcap"
    with ServedPages("simulate", "inspection", "--tags", "1,5") as served, file.open("wb") as stream:
        page = SimulationPage(served.port)
        page.do("speed", "max")
        page.do("until", "DONE")
        page.reaches(lambda now: now["note"], "the end")
        writer = Writer(stream)
        schema = writer.register_msgdef("std_msgs/msg/String", "string data")
        for line in served.history():
            if line["topic"].rpartition("/")[2] in TEXTS:
                at = round(line["at"] * 1e6)
                writer.write_message(line["topic"], schema, line["msg"], at, at)
        writer.finish()
        page.close()
    return file


def iso(wall_ns: int) -> str:
    """Return a time as pages write it for machines."""
    moment = datetime.fromtimestamp(wall_ns // 1_000_000_000, timezone.utc)
    return f"{moment:%Y-%m-%dT%H:%M:%S}.{wall_ns // 1_000_000 % 1000:03}Z"


def test_a_recording_is_played_and_its_states_are_those_of_its_steps(
    context: BrowserContext, recording: Path
) -> None:
    with ServedPages("replay", str(recording)) as served:
        records = [json.loads(line["msg"]["data"]) for line in served.history() if line["topic"] == STEPS]
        for page in opened(context, f"{served.url}#log"):
            expect(page.locator(".virtual-word")).to_have_text("RECORDING")
            expect(page.locator("#stop")).to_be_disabled()
            expect(page.locator("#stop-state")).to_have_text("A recording: there is no robot here")
            # Step by step back through the past: the page shows what the file says.
            lifecycle = page.locator(".control-where")
            expect(lifecycle).to_contain_text("DONE")
            for record in reversed(records[-12:]):
                page.get_by_role("button", name="Step before").click()
                expect(page.locator(".moment time")).to_have_attribute("datetime", iso(record["wall_ns"]))
                now = " ".join(filter(None, (record["view"]["lifecycle"], record["view"]["phase"])))
                expect(lifecycle).to_contain_text(now)
            bar(page).get_by_label("Speed").select_option("64")
            bar(page).get_by_role("button", name="Play").click()
            expect(bar(page).get_by_role("button", name="Pause")).to_be_visible()
            expect(bar(page).get_by_role("button", name="Play")).to_be_visible()
            expect(lifecycle).to_contain_text("DONE")
            expect(page.get_by_role("button", name="Abort", include_hidden=True)).to_be_disabled()


def test_a_recording_tells_why_a_button_was_grey_and_folds_its_chart(
    context: BrowserContext, recording: Path
) -> None:
    """By what was recorded alone: the reasons were told then, and the chart is made of its files."""
    mission = "MISSION.InspectionMission"
    with ServedPages("replay", str(recording)) as served:
        for page in opened(context, f"{served.url}#control"):
            page.get_by_role("button", name="To the begin").click()
            resume = page.get_by_role("button", name="resume", exact=True, include_hidden=True)
            row = page.locator(".control-request", has=resume)
            expect(row).to_contain_text("This is a recording: nothing can be commanded. Then: ")
            page.goto(f"{served.url}#chart")
            inner = page.locator(f".paper [data-state='{mission}.INSPECTING']")
            expect(inner).to_have_count(1)
            page.locator(f".paper [data-fold='{mission}']").click()
            expect(inner).to_have_count(0)
            page.locator(f".paper [data-fold='{mission}']").click()
            expect(inner).to_have_count(1)
            page.goto(f"{served.url}#chart/{mission}.INSPECTING")
            note = page.locator(".detail .note")
            expect(note).to_contain_text("no step was recorded until this moment")
            page.keyboard.press("l")
            expect(note).to_contain_text("could happen at this moment is not known: its journal is not in")


def test_a_recording_by_others_says_what_it_lacks(context: BrowserContext, tmp_path: Path) -> None:
    file = tmp_path / "foreign.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream)
        schema = writer.register_msgdef("std_msgs/msg/String", "string data")
        writer.write_message("/chatter", schema, {"data": "hello"}, 10**18, 10**18)
        writer.finish()
    with ServedPages("replay", str(file)) as served:
        for page in opened(context, served.url):
            expect(page.locator(".virtual-problems")).to_contain_text(f"nobody told {STEPS}")
