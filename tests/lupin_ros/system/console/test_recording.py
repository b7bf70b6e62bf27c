"""A run over ROS is recorded, and shown again without ROS: of each moment it tells what was told then."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")
pytest.importorskip("mcap_ros2", reason="the extra record is not installed here")

from playwright.sync_api import BrowserContext, expect

from lupin_harness.domains import claimed_domain
from tests.browsing import opened
from tests.console.pages import STATE, STEPS, ServedPages
from tests.lupin_ros.launch.processes import Lupin
from tests.lupin_ros.plugins.gateway.conftest import free_port
from tests.plugins.gateway.served import OpenPage, until

pytestmark = pytest.mark.long

EXPLAIN = "/mission_orchestrator/explain"
CHART = "/mission_orchestrator/chart"
#: Arrows that read live values.
ARROWS = (
    "MISSION.on.input.battery.low.0",
    "MISSION.InspectionMission.PREPARE.LOCALIZING.on_done.0",
)
#: Seconds after which it is asked again, though there was no step: live values come all the time.
LONGEST_S = 0.2


@dataclass
class Told:
    """What the orchestrator said of an element, and when it was asked and answered, in ms since 1970."""

    asked: float
    element: str
    answer: dict[str, Any]
    answered: float


@dataclass
class LivedRun:
    """A recorded run, and what the orchestrator said meanwhile."""

    file: Path
    told: list[Told]


def explained(page: OpenPage, chart: str, element: str, **more: float) -> dict[str, Any]:
    """Ask why a state's arrows, or an arrow, can be taken."""
    values = page.call(EXPLAIN, chart=chart, element=element, **more)["values"]
    assert isinstance(values, dict), values
    assert values["success"], values
    found: dict[str, Any] = json.loads(values["explanation"])
    return found


def heard(page: OpenPage, topic: str) -> list[dict[str, Any]]:
    """Return what a topic told the page so far."""
    return [json.loads(each["msg"]["data"]) for each in list(page.frames) if each.get("topic") == topic]


def follow(page: OpenPage) -> None:
    """Read the chart and the steps."""
    for topic in (STEPS, CHART):
        page.send({"op": "subscribe", "topic": topic, "type": "std_msgs/String"})
    until(lambda: heard(page, CHART) and heard(page, STEPS), "a chart and steps")


def watch(page: OpenPage) -> Iterator[Told]:
    """Ask of the innermost state, and of some arrows, why each can be taken, until the mission is over."""
    follow(page)
    chart = heard(page, CHART)[-1]["hash"]
    while (view := heard(page, STEPS)[-1]["view"])["lifecycle"] != "DONE":
        again = partial(is_time, page, len(page.frames) + 1 + len(ARROWS), time.monotonic() + LONGEST_S)
        for element in (view["configuration"][-1], *ARROWS):
            asked = 1000 * time.time()
            answer = explained(page, chart, element)
            yield Told(asked, element, answer, 1000 * time.time())
        until(again, "time to ask again")


def is_time(page: OpenPage, count: int, end: float) -> bool:
    """Whether something was told beside so many frames, or it is later than `end`."""
    return len(page.frames) > count or time.monotonic() > end


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> LivedRun:
    """Two tags are visited by the simulated robot, recorded from the start to the end."""
    folder = tmp_path_factory.mktemp("run")
    file, port = folder / "run.mcap", free_port()
    arguments = ["run", "inspection", "--tags", "1,2", "--speed", "8", "--record", str(file), "--hmi"]
    settings = ["--set", "estop_timeout_s=20 s", "--set", f"lupin_gateway.port={port}"]
    with claimed_domain() as domain:
        command = Lupin(*arguments, *settings, domain=domain, log_dir=folder / "logs")
        try:
            command.until_line("pages at http://127.0.0.1:")
            page = OpenPage(port)
            told = list(watch(page))
            page.close()
            command.end()
        finally:
            command.kill()
    assert file.exists(), command.output
    return LivedRun(file, told)


def test_the_states_of_a_recorded_run_are_those_of_its_steps(context: BrowserContext, run: LivedRun) -> None:
    with ServedPages("replay", str(run.file)) as served:
        lines = served.history()
        steps = [json.loads(line["msg"]["data"]) for line in lines if line["topic"] == STEPS]
        states = [line["msg"] for line in lines if line["topic"] == STATE]
        lived = [name for name, _ in groupby(step["view"]["lifecycle"] for step in steps)]
        assert lived[-3:] == ["INSPECTING", "RETURNING", "DONE"]
        assert [name for name, _ in groupby(state["lifecycle_state"] for state in states)] == lived
        assert states[-1]["targets_completed"] == 2
        assert {line["topic"] for line in lines} >= {"/tf", "/map", "/amcl_pose", "/floranova/observations"}
        for page in opened(context, f"{served.url}#log"):
            shown = page.locator(".control-where")
            expect(shown).to_contain_text("DONE")
            for step in reversed(steps[-25:]):
                page.get_by_role("button", name="Step before").click()
                now = " ".join(filter(None, (step["view"]["lifecycle"], step["view"]["phase"])))
                expect(shown).to_contain_text(now)
            # At any moment each view shows what was known then: the bar too, which reads MissionState.
            page.locator(".virtual").get_by_role("button", name="To the begin").click()
            expect(page.locator(".bar .where")).not_to_contain_text("DONE")
            page.locator(".virtual").get_by_label("Speed").select_option("64")
            page.locator(".virtual").get_by_role("button", name="Play").click()
            expect(page.locator(".bar .where")).to_contain_text(re.compile("INSPECTING|RETURNING|DONE"))
            expect(page.locator(".bar .where b")).to_have_text("DONE")
            expect(page.get_by_role("button", name="Abort")).to_be_disabled()


def steps_of(served: ServedPages) -> list[dict[str, Any]]:
    """Return the steps of a recording."""
    return [json.loads(line["msg"]["data"]) for line in served.history() if line["topic"] == STEPS]


def told_again(page: OpenPage, chart: str, told: Told) -> tuple[dict[str, Any], float]:
    """Ask the recording of a moment, in ms, at which the machine had taken as many steps as then."""
    low, high = told.asked, told.answered
    while True:
        moment = (low + high) / 2
        found = explained(page, chart, told.element, moment=moment)
        if found["sequence"] == told.answer["sequence"] or high - low < 0.001:
            return found, moment
        low, high = (moment, high) if found["sequence"] < told.answer["sequence"] else (low, moment)


def test_why_an_arrow_could_not_be_taken_is_told_of_each_moment_as_it_was_told_then(run: LivedRun) -> None:
    """Live values of before count too, of which no step was told; the page has no other source."""
    with ServedPages("replay", str(run.file)) as served:
        steps = steps_of(served)
        chart = steps[-1]["chart"]
        page = OpenPage(served.port)
        asked = run.told[:: -(-len(run.told) // 30)]
        for each in asked:
            assert each.answer == told_again(page, chart, each)[0]
        rules = [rule for each in asked for rule in each.answer["rules"]]
        assert {rule["possible"] for rule in rules} == {True, False}
        told = {step["step"]["sequence"] for step in steps}
        assert [each for each in asked if each.answer["sequence"] not in told]
        early = page.call(EXPLAIN, chart=chart, element="READY", moment=steps[0]["wall_ns"] / 1e6 - 1)
        assert early["values"]["message"] == "no step was recorded until this moment"
        page.close()


def test_the_chart_of_a_recording_tells_it_beside_a_state(context: BrowserContext, run: LivedRun) -> None:
    told = next(each for each in run.told if each.element.endswith("DWELLING") and each.answer["active"])
    with ServedPages("replay", str(run.file)) as served:
        asking = OpenPage(served.port)
        _, moment = told_again(asking, steps_of(served)[-1]["chart"], told)
        asking.close()
        for page in opened(context, f"{served.url}#chart/{told.element}"):
            slider = page.get_by_role("slider", name="The moment that is shown")
            expect(page.locator(".bar .where b")).to_have_text("DONE")
            slider.fill(str(moment))
            rows = page.locator(".outcomes tr")
            expect(rows).to_have_count(len(told.answer["rules"]))
            for row, rule in zip(rows.all(), told.answer["rules"], strict=True):
                expect(row).to_contain_text("can" if rule["possible"] else rule["reason"])
            slider.press("End")
            expect(rows.first).to_contain_text("DWELLING is not active")
