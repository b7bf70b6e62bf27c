"""`lupin simulate … --hmi`: a robot's topics and services in virtual time, and all that can go wrong."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra hmi is not installed here")

from lupin_engine.plugin.registry import load_catalog
from tests.console.pages import LUPIN, STATE, STEPS, ServedPages, SimulationPage

LIFECYCLE = """\
lifecycle: small
profile: greenhouse
initial: READY
states:
  READY: {on: {mission.start: MISSION}}
  MISSION: {slot: mission, on_done: READY}
  FAULT: {on: {operator.reset: READY}}
"""
STILL = """\
mission: Still
initial: A
states:
  A: {after: {1 s: B}}
  B: {after: {0 s: C}, on: {operator.skip_current: done}}
  C: {after: {0 s: B}}
  done: {type: final}
"""


@pytest.fixture(scope="module")
def served() -> Iterator[ServedPages]:
    """A mission that an operator starts."""
    with ServedPages("simulate", "inspection") as found:
        yield found


@pytest.fixture
def page(served: ServedPages) -> Iterator[SimulationPage]:
    """A page of it, from the beginning on, as fast as it goes."""
    found = SimulationPage(served.port)
    assert found.do("again") == (True, "")
    assert found.do("speed", "max") == (True, "")
    yield found
    found.close()


def under_way(page: SimulationPage, operation: str) -> dict[str, Any]:
    """Start a mission, and go on until an operation is under way."""
    assert page.command("start", "InspectionMission", tag_sequence=["1", "5"])["accepted"]
    for _ in range(50):
        found = [one for one in page.now["operations"] if one["operation"] == operation]
        if found:
            return found[0]
        assert page.do("step") == (True, "")
        page.work_off()
    raise AssertionError(f"{operation} never began")


def test_it_says_what_it_is_and_where(served: ServedPages) -> None:
    assert served.line == f"simulation of InspectionMission: pages at {served.url[:-1]}; Ctrl-C ends it"
    status = json.loads(served.fetch("status"))
    assert (status["mode"], status["title"]) == ("simulation", "InspectionMission")


@pytest.mark.slow
def test_its_steps_are_those_of_the_simulation_at_the_terminal(page: SimulationPage) -> None:
    """The same mission, request and seed: what is told to pages is what `lupin simulate --json` prints."""
    arguments = ["simulate", "inspection", "--tags", "1,5", "--json"]
    printed = json.loads(subprocess.run([*LUPIN, *arguments], capture_output=True, check=True).stdout)
    assert page.command("start", "InspectionMission", tag_sequence=["1", "5"])["accepted"]
    assert page.do("until", "DONE") == (True, "")
    now = page.reaches(lambda now: now["note"], "the end of the mission")
    assert now["note"] == "DONE was entered"
    page.work_off()

    def sense(steps: list[dict[str, Any]]) -> list[Any]:
        return [(round(one["time"], 6), one["event"], one.get("taken")) for one in steps if one.get("taken")]

    assert sense([record["step"] for record in page.steps()]) == sense(printed["steps"])
    last = page.told(STATE)[-1]
    assert (last["lifecycle_state"], last["targets_completed"], last["paused"]) == ("DONE", 2, False)


CODES = [
    (name, code.name)
    for name in ("nav.go_to", "bridge.read_tag")
    for code in load_catalog().operations[name].codes
]


@pytest.mark.parametrize(("operation", "code"), CODES)
def test_every_failure_that_is_declared_can_be_injected(
    page: SimulationPage, operation: str, code: str
) -> None:
    offered = under_way(page, operation)
    assert code in [one["code"] for one in offered["codes"]]
    assert page.do("fail", operation, code, "by hand") == (True, "")
    page.work_off()
    failed = [one["step"]["data"] for one in page.steps() if one["step"]["event"] == "attempt.failed"]
    assert [(one["code"], one["detail"]) for one in failed[-1:]] == [(code, "by hand")]


def test_a_silent_server_is_heard_no_more_until_it_answers_again(page: SimulationPage) -> None:
    under_way(page, "nav.go_to")
    assert page.do("silence", "nav.go_to") == (True, "")
    assert page.do("until", "FAULT") == (True, "")
    assert page.reaches(lambda now: now["silent"], "silence")["silent"] == ["nav.go_to"]
    assert page.do("answer", "nav.go_to") == (True, "")
    assert page.reaches(lambda now: not now["silent"], "an answer")["silent"] == []


def test_an_answer_can_come_late(page: SimulationPage) -> None:
    under_way(page, "nav.go_to")
    due = page.now["next"]
    assert page.do("late", "nav.go_to", "20 s") == (True, "")
    assert page.do("step") == (True, "")
    ended = [one["time"] for one in page.steps() if one["step"]["event"] == "attempt.done"]
    assert ended[-1] == pytest.approx(due + 20.0)


def test_the_stop_of_a_page_is_the_robots_and_everything_it_senses_can_be_set(page: SimulationPage) -> None:
    under_way(page, "nav.go_to")
    page.stop(True)
    page.work_off()
    assert page.told(STATE)[-1]["estop_engaged"] is True
    page.stop(False)
    page.work_off()
    assert page.told(STATE)[-1]["estop_engaged"] is False
    sensed = (("estop", "true", True), ("battery", "12 %", 0.12), ("missing", "[arm]", ["arm"]))
    for name, value, shown in sensed:
        assert page.do("set", name, value) == (True, "")
        page.work_off()
        now = next(one["now"] for one in page.now["values"] if one["name"] == name)
        assert (now["value"] if isinstance(now, dict) else now) == shown
    assert page.do("set", "estop", "false") == (True, "")


def test_a_crash_of_the_orchestrator_forgets_nothing(page: SimulationPage) -> None:
    under_way(page, "nav.go_to")
    assert page.do("crash") == (True, "")
    assert page.do("step") == (True, "")  # another one comes back, and holds the mission
    assert page.command("resume")["accepted"]
    assert page.do("until", "DONE") == (True, "")
    page.reaches(lambda now: now["note"] == "DONE was entered", "the end")


def test_what_is_wrong_is_told_and_changes_nothing(page: SimulationPage) -> None:
    under_way(page, "nav.go_to")
    before = page.now["time"]
    wrong = {
        ("fial",): "unknown command 'fial'; did you mean 'fail'?",
        ("fail", "nav.go_too"): "unknown operation 'nav.go_too'; did you mean 'nav.go_to'?",
        ("fail", "nav.go_to", "rejected"): "nav.go_to has no code 'rejected'; did you mean 'nav_rejected'?",
        ("fail", "bridge.read_tag"): "bridge.read_tag is not under way; nav.go_to is",
        ("late", "nav.go_to", "soon"): "'soon' is no duration; write one such as '90 s' or '20 min'",
        ("answer", "nav.go_to"): "the server of 'nav.go_to' is not silent",
        ("set", "batery", "1"): "unknown value 'batery'; did you mean 'battery'?",
        ("speed", "1000"): "a speed is 0.1 to 100, or max, got 1000",
        ("speed", "quick"): "'quick' is no speed; write 0.1 to 100, or max",
        ("until", "DON"): "no state 'DON'; did you mean 'DONE'?",
    }
    found = {words: page.do(*words) for words in wrong}
    assert found == {words: (False, text) for words, text in wrong.items()}
    assert page.now["time"] == before
    service, command = "/simulation/do", "/mission_orchestrator/command"
    assert page.call(service)["values"] == f"{service}: it takes a command, and words, which are texts"
    assert page.call(command, verb=1)["values"] == f"{command}: verb must be a text"
    assert page.call("/twin/get_field")["values"].endswith("a simulation does not have this service")
    page.send({"op": "publish", "topic": "/cmd_vel", "type": "geometry_msgs/msg/Twist", "msg": {}})
    page.work_off()
    assert "/cmd_vel: this is a simulation, which hears nothing that pages publish" in page.statuses()


def test_it_begins_again_as_another_start_and_forgets_the_last_one(
    served: ServedPages, page: SimulationPage
) -> None:
    under_way(page, "nav.go_to")
    boot = page.now["boot"]
    assert page.do("again") == (True, "")
    now = page.reaches(lambda now: now["boot"] != boot, "another start")
    assert (now["time"], now["running"], now["operations"]) == (0.0, False, [])
    boots = {json.loads(one["msg"]["data"])["boot"] for one in served.history() if one["topic"] == STEPS}
    assert boots == {now["boot"]}
    later = SimulationPage(served.port)
    later.work_off()
    assert {record["boot"] for record in later.told(STEPS)} == {now["boot"]}
    later.close()


def test_time_goes_by_at_the_speed_that_is_set_and_stands_when_paused(page: SimulationPage) -> None:
    assert page.do("speed", "100") == (True, "")
    assert page.do("run") == (True, "")
    page.reaches(lambda now: now["running"] and now["time"] > 20.0, "20 s of virtual time")
    assert page.do("pause") == (True, "")
    page.work_off()
    stands = page.now
    assert stands["running"] is False
    page.work_off()
    assert page.now["time"] == stands["time"]
    clock = page.call("/rosapi/get_time")["values"]["time"]
    assert clock["sec"] + clock["nanosec"] / 1e9 == pytest.approx(page.now["at"] / 1000.0, abs=1e-3)


def test_while_it_stands_nothing_is_told(page: SimulationPage) -> None:
    under_way(page, "nav.go_to")
    page.work_off()
    before = len(page.frames)
    for _ in range(3):
        page.work_off()
    assert len(page.frames) == before + 3  # the answers to what was asked


@pytest.mark.slow
def test_a_page_draws_and_explains_the_chart_that_is_simulated(page: SimulationPage) -> None:
    draw, explain = "/mission_orchestrator/draw", "/mission_orchestrator/explain"
    drawn = page.call(draw, folded=["MISSION"])["values"]
    assert (drawn["success"], drawn["message"]) == (True, "")
    assert 'data-state="READY"' in drawn["svg"]
    explained = page.call(explain, element="READY", chart=drawn["chart"])["values"]
    assert json.loads(explained["explanation"])["active"] is True
    wrong = page.call(explain, element="READY", chart="0")["values"]
    assert wrong["message"] == f"another chart runs: {drawn['chart']}, not '0'; read ~/chart again"
    assert page.call(draw, folded="MISSION")["values"] == f"{draw}: folded must be a list of states"


@pytest.mark.slow
def test_ctrl_c_ends_it_and_a_taken_port_is_told() -> None:
    with ServedPages("simulate", "inspection") as first:
        command = [*LUPIN, "simulate", "inspection", "--hmi", "--port", str(first.port)]
        second = subprocess.run(command, capture_output=True, text=True, check=False)
        assert (second.returncode, second.stdout) == (2, "")
        assert second.stderr == (
            f"lupin: the gateway cannot listen on 127.0.0.1:{first.port}: Address already in use; another "
            "program may have this port, then choose another one\n"
        )
        page = SimulationPage(first.port)
        assert first.interrupt() == (0, "")
        page.close()


@pytest.mark.slow
def test_a_circle_without_time_is_told(tmp_path: Path) -> None:
    """The page says what goes round, the mission is in FAULT, and the next one can be tried."""
    (tmp_path / "lifecycle.yaml").write_text(LIFECYCLE, encoding="utf-8")
    (tmp_path / "still.yaml").write_text(STILL, encoding="utf-8")
    with ServedPages("simulate", str(tmp_path / "still.yaml")) as served:
        page = SimulationPage(served.port)
        assert page.command("start", "Still")["accepted"]
        assert page.do("run") == (True, "")
        now = page.reaches(lambda now: now["note"], "the circle")
        assert now["note"] == (
            "time stands still: more than 10000 things happen at one moment; MISSION.Still.B, MISSION.Still.C"
            " are entered over and over, so let one of them take time"
        )
        page.work_off()
        assert page.told(STATE)[-1]["lifecycle_state"] == "FAULT"
        assert page.command("reset", "")["accepted"]
        page.close()
