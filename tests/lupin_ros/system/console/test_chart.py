"""The live chart, over real nodes: what is lit, what runs down, why something can happen."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import BrowserContext, Locator, Page, WebSocketRoute, expect

from tests.lupin_ros.system.console.conftest import PATIENCE_MS, PHONE, Served, stall

pytestmark = pytest.mark.long

expect.set_options(timeout=PATIENCE_MS)

MISSION = "MISSION.InspectionMission"
#: Sends a command on a connection of its own, and returns the answer.
COMMAND = """(args) => new Promise((done) => {
  const socket = new WebSocket(`ws://${location.host}/_ros`);
  const call = { op: "call_service", id: "test", service: "/mission_orchestrator/command", args };
  socket.onopen = () => socket.send(JSON.stringify(call));
  socket.onmessage = ({ data }) => {
    const frame = JSON.parse(data);
    if (frame.op === "service_response") (socket.close(), done(frame.values));
  };
})"""


def command(page: Page, verb: str, mission: str = "", **request: Any) -> None:
    """Command the orchestrator; it must accept."""
    sent = {"verb": verb, "mission": mission, "request": json.dumps(request)}
    answer = page.evaluate(COMMAND, sent)
    assert answer["accepted"], answer


def state(page: Page, name: str) -> Locator:
    """Return the group of a state in the drawing."""
    return page.locator(f'.paper [data-state="{name}"]')


def lit(page: Page, name: str, mark: str = "active") -> None:
    """Wait until a state is lit."""
    expect(state(page, name)).to_have_class(re.compile(rf"\b{mark}\b"))


@pytest.fixture
def chart(console: Page) -> Iterator[Page]:
    """The chart of a robot that is at rest; it is brought back to rest."""
    console.goto(f"{console.url.partition('#')[0]}#chart")
    state(console, "READY").wait_for()
    expect(console.locator(".bar .where")).to_contain_text(re.compile("READY|DONE"))
    yield console
    phase = console.locator(".bar .where").inner_text()
    if not re.search("READY|DONE|RETURNING", phase):
        command(console, "abort")


def test_what_is_active_is_lit_and_a_hold_lies_over_it(chart: Page, robot: Served) -> None:
    """The way there is traced, a deadline runs down, and what the hold is for stands on it."""
    stall(robot, 2)  # the drive before the hold and the one after it
    command(chart, "start", "InspectionMission", tag_sequence=["1"])
    for name in ("MISSION", MISSION, f"{MISSION}.INSPECTING", f"{MISSION}.INSPECTING.NAVIGATING"):
        lit(chart, name)
    lit(chart, f"{MISSION}.INSPECTING.NAVIGATING.DRIVING", "innermost")
    expect(chart.locator(".paper .last").first).to_be_attached()
    ring = chart.locator(".paper .ring:not(.stopped)")
    assert 0 < int(ring.locator("text").text_content() or "0") <= 60
    expect(ring.locator("title")).to_have_text("nav.go_to: 1 min 00 s")
    assert float(ring.locator(".arc").get_attribute("stroke-dashoffset") or 0) < 1
    command(chart, "pause")
    expect(chart.locator(".veil")).to_have_text("❚❚ Held: paused by the operator")
    expect(ring).to_have_count(0)
    command(chart, "resume")
    expect(chart.locator(".veil")).to_have_count(0)
    lit(chart, f"{MISSION}.INSPECTING.NAVIGATING.DRIVING", "innermost")


def test_states_fold_in_place_and_what_is_active_inside_lights_the_box(chart: Page) -> None:
    """Who opens a state that is folded away sees it unfolded, and in the middle."""
    box = state(chart, "MISSION")
    chart.get_by_role("button", name="All", exact=True).click()
    command(chart, "start", "InspectionMission", tag_sequence=["1"])
    command(chart, "pause")  # so that it is not over before it was looked at
    before = box.locator("> g > rect").first.bounding_box()
    chart.locator('[data-fold="MISSION"]').click()
    expect(state(chart, MISSION)).to_have_count(0)
    lit(chart, "MISSION", "innermost")
    after = box.locator("> g > rect").first.bounding_box()
    assert before is not None
    assert after is not None
    assert (after["x"], after["y"]) == pytest.approx((before["x"], before["y"]), abs=2)
    target = f"{MISSION}.INSPECTING.PUBLISHING"
    chart.evaluate("(name) => (location.hash = `chart/${name}`)", target)
    expect(state(chart, target)).to_have_class(re.compile(r"\bselected\b"))
    expect(state(chart, target)).to_be_in_viewport()
    chart.get_by_label("Depth").select_option("1")
    expect(state(chart, MISSION)).to_have_count(0)
    expect(state(chart, "RETURNING")).to_have_count(1)
    expect(state(chart, "RETURNING.DRIVING_HOME")).to_have_count(0)


def test_a_state_tells_its_lines_its_past_and_why_something_cannot_happen(chart: Page) -> None:
    """The sentence is the one that the request would be answered with; it follows what happens."""
    chart.get_by_role("button", name="All", exact=True).click()
    state(chart, "MISSION").locator("> g").first.click(position={"x": 20, "y": 8})
    detail = chart.locator(".detail")
    expect(detail.get_by_role("heading")).to_contain_text("MISSION")
    start = detail.get_by_role("row").filter(has_text="refuses: mission_running")
    expect(start).to_contain_text("cannot MISSION is not active")
    expect(detail.locator("pre")).to_contain_text("MISSION:")
    expect(detail.locator("summary")).to_contain_text("lifecycle.yaml:")
    chart.get_by_label("Find a state or an arrow").fill("abort")
    chart.get_by_label("Found").get_by_role("button").first.click()
    expect(detail.get_by_role("heading")).to_contain_text("abort")
    expect(detail.get_by_role("row")).to_contain_text("cannot MISSION is not active")
    expect(detail.locator("pre")).to_contain_text("operator.abort:")
    command(chart, "start", "InspectionMission", tag_sequence=["1"])
    command(chart, "pause")
    expect(detail.get_by_role("row")).to_have_text(re.compile(r"abort.*✓ can"))
    detail.get_by_role("button", name="From MISSION").click()
    expect(start).to_contain_text("cannot start refused: a mission is already running")
    expect(detail).to_contain_text(re.compile(r"Entered \d+ .*, the last time .* ago"))


def test_the_keyboard_alone_leads_through_the_chart(chart: Page) -> None:
    """Arrow keys go from state to state, Space folds, Enter opens, Escape closes."""
    stage = chart.get_by_role("application")
    stage.focus()
    for key in ("ArrowRight", "ArrowRight", "ArrowRight"):
        chart.keyboard.press(key)
    chart.keyboard.press("Enter")
    chart.locator(".detail").wait_for()
    cursor = chart.locator(".paper .cursor")
    expect(chart.locator(".detail > .soft").first).to_have_text(str(cursor.get_attribute("data-state")))
    stage.focus()
    chart.keyboard.press("Escape")
    expect(chart.locator(".detail")).to_have_count(0)
    while (name := str(cursor.get_attribute("data-state"))) != "MISSION":
        chart.keyboard.press("ArrowRight")
        expect(cursor).not_to_have_attribute("data-state", name)
    chart.keyboard.press("Space")
    expect(state(chart, MISSION)).to_have_count(0)
    chart.keyboard.press("Space")
    expect(state(chart, MISSION)).to_have_count(1)
    place = chart.locator(".paper").evaluate("(paper) => paper.style.transform")
    chart.keyboard.press("Shift+ArrowLeft")
    expect(chart.locator(".paper")).not_to_have_attribute("style", re.compile(re.escape(place)))


def test_a_chart_that_cannot_be_drawn_leaves_the_rest_alive(context: BrowserContext, robot: Served) -> None:
    """Its states are a list then, and each can be opened. The phone shows it as well."""
    page = context.new_page()
    page.set_viewport_size(PHONE)

    def break_it(route: WebSocketRoute) -> None:
        server = route.connect_to_server()
        server.on_message(lambda text: route.send(str(text).replace("<svg xmlns", "<oops xmlns")))

    page.route(re.compile("/history"), lambda route: route.fulfill(status=404))
    page.route_web_socket(re.compile("_ros$"), break_it)
    page.goto(f"{robot.url}#chart")
    expect(page.locator("main [role=alert]")).to_contain_text("The chart cannot be shown as a picture")
    page.locator(".outline").get_by_role("button", name="READY", exact=True).click()
    expect(page.locator(".detail pre")).to_contain_text("READY:")
    expect(page.locator("#stop")).to_be_visible()
