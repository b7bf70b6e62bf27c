"""What scenarios reached: read off their steps, counted exactly, told with places, added up over missions."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.replay.coverage import (
    GUARDS,
    OUTCOMES,
    STATES,
    TRANSITIONS,
    Coverage,
    CoverageObserver,
    Key,
    add_up,
    coverage_lines,
    items,
    reached,
)
from lupin_engine.sim.scenario import load_scenario
from lupin_engine.sim.suite import ScenarioResult, Suite
from tests import shipped
from tests.lupin_engine.diagram import pictured

COOKBOOK = Path(__file__).parents[3] / "docs" / "cookbook"
HEAD = 'scenario: a test\nmission: inspection\nrequest: {tag_sequence: ["1"]}\n'
INSPECTING = "MISSION.InspectionMission.INSPECTING"
SKIP = f"{INSPECTING}.SCANNING.on.operator.skip_current.0"


def result(folder: Path, text: str) -> ScenarioResult:
    """Run a scenario and count what it reaches."""
    file = folder / "x.scenario.yaml"
    file.write_text(HEAD + text, encoding="utf-8")
    found = Suite(shipped.catalog(), CoverageObserver()).run(file)
    assert found.holds, found
    return found


def test_a_mission_without_trouble_reaches_its_way(tmp_path: Path) -> None:
    """States by entry, transitions by id, ends by operation, guards by what they came to."""
    counts = result(tmp_path, "expect: {final: DONE}\n").counts
    assert counts[STATES, f"{INSPECTING}.NAVIGATING", ""] == 1
    assert counts[TRANSITIONS, f"{INSPECTING}.NAVIGATING.DRIVING.on_done.1", ""] == 1
    assert counts[OUTCOMES, f"{INSPECTING}.NAVIGATING.DRIVING", "nav.go_to done"] == 1
    guard = f"{INSPECTING}.NAVIGATING.DRIVING.on_done.0"
    assert (counts[GUARDS, guard, "true"], counts[GUARDS, guard, "false"]) == (0, 1)
    assert counts[STATES, "FAULT", ""] == 0


def test_refusals_and_holds_are_reached_too(tmp_path: Path) -> None:
    """A transition that refuses is taken when it does; a hold's guards have branches."""
    text = "when:\n  - {on: NAVIGATING, request: mission.start}\n  - {on: DONE, request: operator.pause}\n"
    counts = result(tmp_path, text + "expect: {refused: [mission_running, not_running]}\n").counts
    assert counts[TRANSITIONS, "MISSION.on.mission.start.0", ""] == 1
    assert counts[TRANSITIONS, "RETURNING.on.mission.start.0", ""] == 0
    assert counts[GUARDS, "hold.pause.engage", "false"] == 1
    assert counts[GUARDS, "hold.pause.engage", "true"] == 0


def test_what_is_only_explained_is_not_reached(tmp_path: Path) -> None:
    """A step that tells why nothing happened asks every guard; only the decision counts."""
    text = (
        "parameters: {flower_scan_dwell_s: 5 s}\nwhen:\n  - {on: DWELLING, request: operator.skip_current}\n"
    )
    shutil.copytree(default_missions_folder(), tmp_path, dirs_exist_ok=True)
    part = tmp_path / "parts" / "visit_targets.yaml"
    refused = "operator.skip_current: {refuse: already_closed}\n    on:\n      operator.skip_current:\n"
    guarded = "operator.reset: {refuse: already_closed}\n    on:\n      operator.skip_current:\n"
    text_of_part = part.read_text(encoding="utf-8")
    assert text_of_part.count(refused) == 1
    changed = text_of_part.replace(refused, f"{guarded}        guard: itinerary.open\n")
    part.write_text(changed, encoding="utf-8")
    counts = result(tmp_path, text + "expect: {refused: [not_possible]}\n").counts
    assert (counts[GUARDS, SKIP, "true"], counts[GUARDS, SKIP, "false"]) == (0, 1)


def test_an_end_that_nobody_waits_for_is_none(tmp_path: Path) -> None:
    """What a server says of a cancelled attempt reaches nothing; a timeout is an end of its own."""
    text = "mocks: [{do: bridge.read_tag, then: {after: 10 s, cancel: ignored}}]\nexpect: {dropped: 1}\n"
    state = f"{INSPECTING}.SCANNING.READING"
    counts = result(tmp_path, text + "limit: 1 h\nwhen: [{at: 20 s, value: {battery: 90 %}}]\n").counts
    assert counts[OUTCOMES, state, "bridge.read_tag timeout"] == 1
    assert counts[OUTCOMES, state, "bridge.read_tag done"] == 0


@pytest.mark.parametrize(
    ("on_hold", "mock", "done"),
    [
        ("continue", "cut_short: {flowed: 150 ml}", 1),
        ("continue", "cancel: 2 s", 0),  # without a result it fails
        ("fail", "cut_short: {flowed: 150 ml}", 0),
    ],
)
def test_what_a_hold_cuts_short_is_done_where_it_counts_as_done(
    tmp_path: Path, on_hold: str, mock: str, done: int
) -> None:
    """Its answer comes after the cancel, and is waited for."""
    shutil.copytree(COOKBOOK / "bindings", tmp_path / "missions" / "bindings")
    shutil.copytree(COOKBOOK / "parts", tmp_path / "missions" / "parts")
    text = (COOKBOOK / "pour.yaml").read_text(encoding="utf-8")
    assert text.count("on_hold: fail") == 1
    pour = tmp_path / "missions" / "pour.yaml"
    pour.write_text(text.replace("on_hold: fail", f"on_hold: {on_hold}"), encoding="utf-8")
    file = tmp_path / "x.scenario.yaml"
    file.write_text(
        "scenario: x\nmission: pour\n"
        f"mocks: [{{do: pump.give, with: {{amount: 400 ml}}, then: {{{mock}}}}}]\n"
        "when:\n  - {on: POURING, after: 3 s, request: operator.pause}\n"
        "  - {on: POURING, after: 20 s, request: operator.resume}\n"
        "  - {on: POURING, nth: 2, after: 1 s, request: operator.abort}\nexpect: {}\n",
        encoding="utf-8",
    )
    run = load_scenario(file, shipped.catalog()).run()
    assert reached(run)[OUTCOMES, "MISSION.Pour.POURING", "pump.give done"] == done


def test_guards_are_counted_as_often_as_with_a_plain_chart(tmp_path: Path) -> None:
    """Counting changes no step."""
    file = tmp_path / "x.scenario.yaml"
    file.write_text(HEAD + "when: [{at: 2 s, value: {battery: 5 %}}]\nexpect: {final: RETURNING}\n")
    plain, counting = (Suite(shipped.catalog(), observe) for observe in (None, CoverageObserver()))
    assert plain.run(file).seconds == counting.run(file).seconds
    assert plain.run(file).counts == {}


def test_every_piece_has_its_own_key() -> None:
    """Nothing that can be reached is counted as something else."""
    keys: list[Key] = [item.key for item in items(shipped.mission("inspection"))]
    assert len(keys) == len(set(keys))


def test_a_transition_is_called_by_what_is_written() -> None:
    """By the word of its clock, counted from 0."""
    told = [item.text for item in items(pictured.chart("words"))]
    assert "STARTING.LOOKING: every.0 -> actions" in told
    assert "STARTING.LOOKING: at.0 -> STARTING.RESTING" in told
    assert "STARTING: budget -> BOTH" in told


def test_the_sum_is_a_table_and_a_list(tmp_path: Path) -> None:
    """A line for each mission and lifecycle, then what is missing with its place."""
    suite = Suite(shipped.catalog())
    found = result(tmp_path, "expect: {final: DONE}\n")
    coverage = add_up([found, ScenarioResult(tmp_path / "unreadable")], suite.missions)
    lines = list(coverage_lines(coverage))
    assert [line.split()[0] for line in lines[:4]] == [
        "reached",
        "inspection",
        "lifecycle",
        f"{coverage.percent:.1f}",
    ]
    assert "inspection: states that were not reached" in lines
    missing = [line for line in lines if line.endswith(": INSPECTING.SCANNING.CONFIRMING")]
    assert missing[0].startswith("  missions/parts/visit_targets.yaml:")
    assert any(line.endswith("READING: bridge.read_tag scan_timeout (timeout)") for line in lines)
    assert any(line.endswith("is false") for line in lines)
    record = coverage.record()
    assert [part["name"] for part in record["parts"]] == ["inspection", "lifecycle"]
    assert record["parts"][0]["states"]["taken"] < record["parts"][0]["states"]["of"]


def test_lifecycles_are_shared_between_missions(tmp_path: Path) -> None:
    """What one mission reaches of the lifecycle need not be reached by another."""
    chart = shipped.mission("inspection")
    coverage = Coverage()
    found = result(tmp_path, "expect: {final: DONE}\n")
    coverage.add(Path("one.yaml"), chart, {})
    before = coverage.percent
    coverage.add(Path("other.yaml"), chart, found.counts)
    assert len(coverage.parts) == 2
    assert coverage.percent > before


def test_of_no_scenario_nothing_was_reached() -> None:
    """Which is not all of it."""
    assert Coverage().percent == 0.0
    assert list(coverage_lines(Coverage())) == ["nothing was reached: no scenario was run"]


def test_reached_reads_steps(tmp_path: Path) -> None:
    """Without guards that count, the rest is counted all the same."""
    file = tmp_path / "x.scenario.yaml"
    file.write_text(HEAD + "expect: {final: DONE}\n")
    kinds = {kind for kind, _, _ in reached(load_scenario(file, shipped.catalog()).run())}
    assert kinds == {STATES, TRANSITIONS, OUTCOMES}


SEEN = "x: 1.0, y: 0.0, facing: {x: 0, y: 0, z: 0, w: 1}, species: '', species_confidence: 0"
SEEN += ", anomaly: false, sightings: 1"
EXPLORATION = f"""\
scenario: a search
mission: exploration
request: {{discovery_goal: 2}}
parameters: {{monitoring_sweeps: 1}}
mocks:
  - {{do: nav.go_to, then: {{after: 10 s}}}}
  - {{do: bridge.read_tag, then: {{after: 1 s}}}}
when:
  - {{on: SEARCH, after: 0 s, value: {{robot.pose: {{x: 0, y: 0, yaw: 0}}}}}}
  - {{on: SEARCH, after: 5 s, value: {{tags.discovered: [{{id: "7", {SEEN}}}]}}}}
  - {{on: SEARCH, after: 9 s, value: {{tags.discovered: [{{id: "7", {SEEN}}}, {{id: "3", {SEEN}}}]}}}}
expect: {{final: DONE}}
"""


def test_operations_of_a_for_each_are_counted_under_their_state(tmp_path: Path) -> None:
    """Their ends and their conditions, whichever element they are for."""
    file = tmp_path / "x.scenario.yaml"
    file.write_text(EXPLORATION, encoding="utf-8")
    suite = Suite(shipped.catalog(), CoverageObserver())
    found = suite.run(file)
    assert found.holds, found
    state = "MISSION.ExplorationMission.EXPLORING.SEED_CLIMATE"
    assert found.counts[OUTCOMES, state, "bridge.read_tag done"] == 1
    assert found.counts[GUARDS, f"{state}.for_each", "true"] > 0
    assert found.counts[GUARDS, f"{state}.for_each", "false"] == 0
    keys = {item.key for item in items(shipped.mission("exploration"))}
    assert {key for key in found.counts if key[0] in (OUTCOMES, GUARDS)} <= keys
