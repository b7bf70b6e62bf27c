"""Mission control by a real page: every button in every state, whole missions, questions, forms."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from playwright.sync_api import Browser, BrowserContext, Locator, Page, expect
from std_msgs.msg import Bool

from lupin_engine.missions.folders import default_missions_folder
from lupin_greenhouse.stops import HMI_TOPIC
from lupin_ros.adapter.node import Qos
from lupin_ros.launch.operator import Attendant
from tests.browsing import HOLD_MS
from tests.lupin_ros.launch.processes import until
from tests.lupin_ros.system.console.conftest import DESK, PATIENCE_MS, PHONE, Served, telling
from tests.lupin_ros.world import Operator

COOKBOOK = Path(__file__).parents[4] / "docs" / "cookbook"
OPERATOR, VIEWER = "a" * 40, "e" * 40
#: A mission whose request has a field of each kind.
FORMS = """\
mission: Forms
summary: Take whatever is filled in.
request:
  tag_sequence: {type: list of tag, not_empty: nothing_named, summary: where to go}
  discovery_goal: {type: count, default: 3, min: 1, max: 9, summary: how often}
codes:
  nothing_named: {label: no tag is named, severity: warn, advice: Name one.}
initial: PREPARE
states:
  PREPARE: {always: done}
  done: {type: final}
"""


@pytest.fixture(scope="module")
def robot(serve: Callable[..., Served], tmp_path_factory: pytest.TempPathFactory) -> Served:
    """Two shipped missions, one that asks and one with a form, fast; who comes in needs a token."""
    folder = tmp_path_factory.mktemp("control")
    tokens = folder / "tokens"
    tokens.write_text(f"anna operator 2099-12-31 {OPERATOR}\neve viewer 2099-12-31 {VIEWER}\n")
    tokens.chmod(0o600)
    missions = folder / "missions"
    shutil.copytree(default_missions_folder(), missions)
    shutil.copy(COOKBOOK / "ask.yaml", missions)
    shutil.copy(COOKBOOK / "parts" / "localize.yaml", missions / "parts")
    (missions / "forms.yaml").write_text(FORMS)
    files = [str(missions / f"{name}.yaml") for name in ("inspection", "exploration", "ask", "forms")]
    settings = ("--set", f"lupin_gateway.tokens={tokens}", "--set", "monitoring_sweeps=1")
    return replace(serve("up", *files, "--speed", "6", *settings), token=OPERATOR)


@pytest.fixture
def enter(browser: Browser, robot: Served) -> Iterator[Callable[..., BrowserContext]]:
    """Make browsers, each of a person with a token."""
    made: list[BrowserContext] = []

    def one(token: str = OPERATOR, **how: Any) -> BrowserContext:
        made.append(browser.new_context(**{"viewport": DESK, "locale": "en-GB", **how}))
        made[-1].set_default_timeout(PATIENCE_MS)
        made[-1].add_cookies([{"name": "lupin_token", "value": token, "url": robot.url}])
        return made[-1]

    yield one
    for context in made:
        context.close()


@pytest.fixture
def context(enter: Callable[..., BrowserContext]) -> BrowserContext:
    """An operator's."""
    return enter()


@pytest.fixture
def attendant(robot: Served, monkeypatch: pytest.MonkeyPatch) -> Iterator[Attendant]:
    """A node that hears what the orchestrator tells; the mission of the test before is over."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(robot.lupin.domain))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    found = Attendant()
    assert found.hear()
    in_state(found, "READY", "DONE")
    found.command("resume")  # an orchestrator that stood still in the test before has begun anew, held
    yield found
    found.command("resume")
    found.command("abort")
    found.command("abort")
    found.command("reset")
    found.close()


def view(attendant: Attendant) -> dict[str, Any]:
    """What the orchestrator shows now."""
    attendant.spin(0.02)
    return dict(attendant.steps[-1]["view"])


def in_state(attendant: Attendant, *lifecycles: str) -> None:
    until(lambda: view(attendant)["lifecycle"] in lifecycles, f"one of {lifecycles}")


def button(page: Page, name: str) -> Locator:
    """A button by its text."""
    return page.get_by_role("button", name=name, exact=True, include_hidden=True)


def press(page: Page, name: str) -> None:
    """Press a request's button, as a person who has seen that it is there now."""
    expect(button(page, name)).to_be_visible()
    page.wait_for_timeout(SETTLED_MS)
    button(page, name).click()


def panel(page: Page, title: str) -> Locator:
    return page.locator(f"section[aria-label='{title}']")


def shown(page: Page) -> dict[str, tuple[bool, str]]:
    """The buttons of the requests: whether each can be pressed, and the sentence beside it."""
    rows: list[list[Any]] = panel(page, "Operate").evaluate(
        """panel => [...panel.querySelectorAll('.control-request')].map((row) => [row.children[0].textContent,
        row.children[0].getAttribute('aria-disabled') !== 'true', row.children[1].textContent])"""
    )
    return {name: (enabled, sentence) for name, enabled, sentence in rows}


#: After so long, in ms, buttons that have moved take a press.
SETTLED_MS = 700
#: What the page says of the verbs that it knows, in English.
EFFECTS = {
    "pause": "stops the robot where it is, until Resume",
    "resume": "lets the mission go on",
    "skip": "leaves this target out and goes on with the next one",
    "dock": "drives home and waits there, until Resume",
    "abort": "ends the mission",
    "reset": "leaves the fault and looks at everything again",
}


def told(attendant: Attendant) -> dict[str, tuple[bool, str]]:
    """The same as the orchestrator tells it."""
    attendant.spin(0.02)
    found = {}
    for one in attendant.possible["requests"]:
        if one["request"].startswith("operator."):
            sentence = EFFECTS[one["verb"]] if one["possible"] else one["reason"]
            found[one["verb"]] = (one["possible"], sentence)
    return found


def agree(page: Page, attendant: Attendant, *possible: str) -> None:
    """Page and orchestrator say the same of all requests, and these alone are possible."""
    last: list[Any] = []

    def same() -> bool:
        last[:] = told(attendant), shown(page)
        can = {verb for verb, (is_possible, _) in last[0].items() if is_possible}
        return last[0] == last[1] and can == set(possible)

    with contextlib.suppress(AssertionError):
        until(same, "agreement", 30)
    assert last[0] == last[1]
    assert {verb for verb, (is_possible, _) in last[0].items() if is_possible} == set(possible), last[0]


def start(page: Page, mission: str, **fields: str) -> None:
    """Fill in the form of a mission, and press its button."""
    form = page.locator("form", has=button(page, f"start {mission}"))
    for name, text in fields.items():
        if not form.locator("details").get_attribute("open") is not None:
            form.get_by_text("Options").click()
        form.get_by_label(re.compile(f"^{name}")).fill(text)
    button(page, f"start {mission}").click()


def test_every_button_in_every_state(
    console: Page, attendant: Attendant, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In each, page and orchestrator say the same; every request is made with its button."""
    hands = Operator("hands")
    agree(console, attendant)
    hands.set_parameter("mission_orchestrator", "localization_covariance_threshold", 0.0)
    start(console, "inspection", tag_sequence="30, 28, 5, 26, 1, 24, 9, 10")
    in_state(attendant, "PREPARE")
    agree(console, attendant, "pause", "abort")
    press(console, "pause")
    expect(panel(console, "Mission")).to_contain_text("paused by the operator")
    agree(console, attendant, "resume", "abort")
    expect(panel(console, "What to do")).to_contain_text("Resume to let the mission go on.")
    press(console, "resume")
    in_state(attendant, "FAULT")
    agree(console, attendant, "reset")
    expect(panel(console, "What to do")).to_contain_text("Give the robot its pose on the map, then reset.")
    expect(panel(console, "Mission").locator(".pill.bad")).to_contain_text("fault")
    press(console, "reset")
    in_state(attendant, "READY")
    agree(console, attendant)

    hands.set_parameter("mission_orchestrator", "localization_covariance_threshold", 0.25)
    start(console, "inspection")
    in_state(attendant, "INSPECTING")
    agree(console, attendant, "pause", "skip", "abort", "dock")
    expect(console.locator("form[aria-label=InspectionMission] .control-request > span").first).to_have_text(
        "start refused: a mission is already running"
    )
    press(console, "pause")
    agree(console, attendant, "resume", "skip", "abort", "dock")
    press(console, "skip")
    expect(panel(console, "Mission")).to_contain_text("1 skipped")
    console.locator("#stop").click()
    expect(panel(console, "What to do")).to_contain_text("Release the stop, then resume.")
    agree(console, attendant, "abort", "dock")
    console.locator("#release").click(delay=HOLD_MS)
    agree(console, attendant, "resume", "abort", "dock")
    press(console, "resume")
    agree(console, attendant, "pause", "skip", "abort", "dock")
    press(console, "dock")
    in_state(attendant, "RETURNING")
    expect(panel(console, "Mission")).to_contain_text("returning")
    until(lambda: view(attendant)["phase"] != "" or view(attendant)["paused"], "the dock")
    expect(panel(console, "Mission")).to_contain_text("waits for you")
    agree(console, attendant, "resume", "abort")
    press(console, "resume")
    in_state(attendant, "INSPECTING")

    press(console, "abort")
    expect(console.get_by_role("button", name=re.compile(r"Press again to abort \(\d\)"))).to_be_visible()
    expect(button(console, "abort")).to_be_visible()  # 5 s later nothing has happened
    assert view(attendant)["lifecycle"] == "INSPECTING"
    button(console, "abort").focus()
    console.keyboard.press("Enter")
    console.keyboard.press("Enter")
    in_state(attendant, "RETURNING")
    agree(console, attendant, "pause", "abort")
    expect(panel(console, "Operate").locator(".control-answer.good")).to_have_text("✓ abort accepted")
    in_state(attendant, "DONE")
    agree(console, attendant)
    hands.ros.close()


def test_an_inspection_from_start_to_end(console: Page, attendant: Attendant) -> None:
    """By the page alone, with tags that are picked, one of them on the map; progress is counted."""
    form = console.locator("form", has=button(console, "start inspection"))
    form.get_by_text("Options").click()
    form.get_by_role("button", name="Pick on the map").click()
    expect(console).to_have_url(re.compile("#map"))
    field = form.get_by_role("textbox", name="tag_sequence")
    form.get_by_role("group").get_by_role("button", name="5", exact=True).click()
    form.get_by_role("group").get_by_role("button", name="6", exact=True).click()
    console.locator(".view").get_by_role("button", name=re.compile("^Tag 19")).click()
    form.get_by_role("group").get_by_role("button", name="6", exact=True).click()
    expect(field).to_have_value("5, 19")
    button(console, "Done picking (2)").click()
    button(console, "start inspection").click()
    running = panel(console, "Running now")
    expect(running.get_by_role("link", name="nav.go_to")).to_be_visible()
    expect(running).to_contain_text("target 5")
    expect(running).to_contain_text("try 1")
    expect(running).to_contain_text(" left")
    running.get_by_role("link", name="nav.go_to").click()
    expect(console).to_have_url(re.compile(r"#chart/MISSION\.InspectionMission\.INSPECTING"))
    in_state(attendant, "DONE")
    expect(panel(console, "Mission")).to_contain_text("2 of 2 done")
    expect(panel(console, "Mission").locator(".pill.good").last).to_have_text(re.compile("2 completed"))
    until(lambda: view(attendant)["completed"] == 2, "both targets counted")


def test_an_exploration_from_start_to_end(console: Page, attendant: Attendant) -> None:
    start(console, "exploration", discovery_goal="1")
    in_state(attendant, "EXPLORING", "MONITORING")
    in_state(attendant, "DONE")
    expect(panel(console, "Mission")).to_contain_text("mission over")
    assert view(attendant)["mission"] == "ExplorationMission"


def seconds(page: Page) -> float:
    """The time that is left for an answer, as the page tells it."""
    text = panel(page, "The mission asks").inner_text()
    found = re.search(r"(?:(\d+) min )?([\d.]+) s", text)
    assert found is not None, text
    return 60 * int(found[1] or 0) + float(found[2])


def is_right(page: Page, attendant: Attendant) -> bool:
    """Whether the page's time that is left is the orchestrator's, within 2.5 s."""
    attendant.spin(0.02)
    asked = attendant.asked()  # the page may have heard of it before
    return len(asked) == 1 and abs(seconds(page) - asked[0].left) < 2.5


def test_a_second_tap_does_not_press_what_came_in_its_place(console: Page, attendant: Attendant) -> None:
    """Pause goes and Resume stands there: who taps twice in haste stays paused."""
    start(console, "inspection")
    press(console, "pause")
    box = button(console, "resume")
    expect(box).to_have_attribute("aria-disabled", "false")
    box.click()
    console.wait_for_timeout(1000)
    assert view(attendant)["held"] == ["pause"]
    press(console, "resume")
    until(lambda: view(attendant)["held"] == [], "going on")


def test_a_question_is_answered(
    enter: Callable[..., BrowserContext], robot: Served, attendant: Attendant
) -> None:
    """Its time runs down by the robot's clock: the browser's is an hour off, and it sleeps for 100 s."""
    page = enter(viewport=PHONE).new_page()
    page.add_init_script(
        """let slept = 0; const now = performance.now.bind(performance), date = Date.now;
        performance.now = () => now() - slept; Date.now = () => date() + 3600000;
        window.sleepFor = (seconds) => { slept += 1000 * seconds; };"""
    )
    page.goto(f"{robot.url}#control")
    start(page, "ask")
    asks = panel(page, "The mission asks")
    expect(asks).to_contain_text("Go on to tag 5?")
    expect(asks).to_contain_text("without an answer: Come home, in 9 min")
    until(lambda: is_right(page, attendant), "the right time")
    before = seconds(page)
    page.evaluate("sleepFor(100)")
    until(lambda: seconds(page) != before, "the page's next second")
    until(lambda: is_right(page, attendant), "the right time again", 10.0)
    press(page, "pause")
    expect(asks).to_contain_text("standing still while held")
    still = seconds(page)
    expect(asks.get_by_role("button", name="Go on to tag 5")).to_have_attribute("aria-disabled", "true")
    expect(asks).to_contain_text("refused: paused by the operator")
    press(page, "resume")
    expect(asks).to_contain_text("without an answer: Come home, in 9 min")
    assert seconds(page) <= still
    asks.get_by_role("button", name="Go on to tag 5").click()
    until(lambda: view(attendant)["configuration"][-1].endswith("SECOND"), "the second drive")
    expect(asks).to_have_count(0)


def test_mistakes_are_told_beside_their_fields(console: Page, attendant: Attendant) -> None:
    """What the declaration tells keeps a form from being sent; the rest is the engine's to say."""
    form = console.locator("form", has=button(console, "start forms"))
    tags, goal = (
        form.get_by_label(re.compile("^tag_sequence")),
        form.get_by_label(re.compile("^discovery_goal")),
    )
    expect(form).to_contain_text("required")
    expect(form).to_contain_text("how often · count · 1 to 9 · default: 3")
    before = attendant.steps[-1]["step"]["sequence"]
    button(console, "start forms").click()
    expect(form).to_contain_text("This is required.")
    expect(tags).to_be_focused()
    for text, problem in [
        ("x", "A whole number is expected, such as 3."),
        ("1.5", "A whole number is expected, such as 3."),
        ("0", "At least 1 is expected."),
        ("10", "At most 9 is expected."),
    ]:
        goal.fill(text)
        expect(form).to_contain_text(problem)
        expect(goal).to_have_attribute("aria-invalid", "true")
    button(console, "start forms").click()
    goal.fill("2")
    expect(goal).to_have_attribute("aria-invalid", "false")
    attendant.spin(0.2)
    assert not [
        one for one in attendant.steps if one["step"]["sequence"] > before and "start" in one["step"]["event"]
    ]
    tags.fill("1, 999")
    button(console, "start forms").click()
    expect(form.locator(".control-answer.bad")).to_contain_text("unknown tag '999'; the layout has 29 tags")
    tags.fill("1, 5")
    button(console, "start forms").click()
    expect(form.locator(".control-answer.good")).to_be_visible()
    assert attendant.steps


def test_a_viewer_looks_and_is_told_why_not(
    enter: Callable[..., BrowserContext], robot: Served, attendant: Attendant
) -> None:
    page = enter(VIEWER).new_page()
    page.goto(f"{robot.url}#control")
    expect(panel(page, "What to do")).to_contain_text("You may look only")
    assert {why for _, why in shown(page).values()} == {
        "You may look only: commanding needs the role of an operator."
    }
    button(page, "start inspection").click(force=True)
    page.get_by_role("link", name="Map").click()
    drive = page.get_by_role("button", name="Drive to a place")
    expect(drive).to_be_disabled()
    expect(page.locator("main")).to_contain_text(
        "You may look only: commanding needs the role of an operator."
    )
    attendant.spin(0.3)
    assert view(attendant)["lifecycle"] in ("READY", "DONE")


def test_the_page_recovers_from_an_orchestrator_and_a_gateway_that_die(
    context: BrowserContext, robot: Served, attendant: Attendant
) -> None:
    """Its buttons are grey with the reason meanwhile, and work again without being loaded anew."""
    page = context.new_page()
    page.goto(f"{robot.url}#control")
    agree(page, attendant)
    for node, why in (
        ("mission_orchestrator", "The orchestrator is not heard."),
        ("lupin_gateway", "There is no connection to the robot."),
    ):
        pid = robot.lupin.pid_of(node)
        # It hangs first: the next orchestrator would be there before anybody has missed this one.
        os.kill(pid, signal.SIGSTOP if node == "mission_orchestrator" else signal.SIGKILL)
        expect(panel(page, "What to do")).to_contain_text(why)
        assert {text for _, text in shown(page).values()} == {why}
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
        expect(panel(page, "What to do")).not_to_contain_text(why)
        in_state(attendant, "READY")
        agree(page, attendant)
    start(page, "inspection", tag_sequence="21, 12")
    in_state(attendant, "INSPECTING")


def test_a_call_that_hangs_is_told_and_holds_nothing_up(
    console: Page, robot: Served, attendant: Attendant
) -> None:
    """One thing is asked at a time; what came of it is said when the answer does not come."""
    orchestrator = robot.lupin.pid_of("mission_orchestrator")
    os.kill(orchestrator, signal.SIGSTOP)
    try:
        button(console, "start inspection").click()
        expect(panel(console, "What to do")).to_contain_text(re.compile("Waiting for the answer|not heard"))
        console.locator("#stop").click()
        expect(console.locator("#stop-state")).to_contain_text("Stopped by")
    finally:
        os.kill(orchestrator, signal.SIGCONT)
    console.locator("#release").click(delay=HOLD_MS)
    expect(console.locator("form[aria-label=InspectionMission] .control-answer")).to_be_visible()


def test_nothing_is_commanded_in_the_past(console: Page, attendant: Attendant) -> None:
    """The bar of the moment leads there, and its button back."""
    agree(console, attendant)
    console.get_by_role("button", name="Step before").click()
    expect(panel(console, "What to do")).to_contain_text("You look at the past: go back to now first.")
    past = "You look at the past: go back to now first. "
    verdicts = [(can, why.removeprefix(past)) for can, why in shown(console).values() if why.startswith(past)]
    assert len(verdicts) == len(told(attendant)), "the engine's own word of that moment stands there as well"
    assert all(
        not can and (why == "It was possible then." or why.startswith("Then: ")) for can, why in verdicts
    )
    console.get_by_role("button", name="Live").click()
    agree(console, attendant)


def test_a_hold_names_who_stops_the_robot_now(
    console: Page, enter: Callable[..., BrowserContext], robot: Served, attendant: Attendant
) -> None:
    """Several stop, and who began it lets go: the hold, the bar and the title name the others."""
    start(console, "inspection", tag_sequence="21, 12")
    in_state(attendant, "INSPECTING")
    first, second = stopping(enter(), robot), stopping(enter(), robot)
    bar, held = console.locator("#stop-state"), console.locator(".control-holds")
    expect(bar).to_have_text(re.compile(r"^Stopped by anna-\d+, anna-\d+$"))
    both = bar.inner_text().removeprefix("Stopped by ")
    expect(held).to_contain_text(f"by {both} ")
    first.locator("#release").click(delay=HOLD_MS)
    left = both.split(", ")[1]
    expect(held).to_contain_text(f"by {left} ")
    expect(bar).to_have_text(f"Stopped by {left}")
    expect(console).to_have_title(re.compile(f"^STOPPED by {left} · "))
    hands = Operator("panel")
    other = hands.ros.publisher(Bool, HMI_TOPIC, Qos.EVENT)
    with contextlib.closing(hands.ros), telling(lambda: other.publish(Bool(data=True))):
        second.locator("#release").click(delay=HOLD_MS)
        # The robot repeats it as its own.
        expect(held).to_contain_text("by the robot's own e-stop, another operator panel ")
    expect(held).to_contain_text("stopped before: the stop is released")
    expect(held).not_to_contain_text("operator panel")


def stopping(context: BrowserContext, robot: Served) -> Page:
    """Open a page that presses STOP."""
    page = context.new_page()
    page.goto(robot.url)
    page.locator(".bar .pill.good").wait_for()
    page.locator("#stop").click()
    expect(page.locator("#stop")).to_have_attribute("aria-pressed", "true")
    return page
