"""A recorded run becomes a scenario that runs the same and holds."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart.findings import Findings
from lupin_engine.chart.source import parse
from lupin_engine.errors import UsageError
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.replay.reconstruction import read_recording, scenario_text, would_differ
from lupin_engine.replay.yaml_text import WIDTH, yaml_text
from lupin_engine.runtime.record import step_record
from lupin_engine.sim.scenario import Missions, Scenario, load_scenario, load_scenario_text, scenario_files
from lupin_engine.sim.simulation import START
from tests import shipped

SCENARIOS = Path(__file__).parents[2] / "scenarios" / "inspection"
EXAMPLES = Path(__file__).parents[3] / "examples"
MISSIONS = Missions(shipped.catalog())
MADE = Path("made.scenario.yaml")

Steps = list[dict[str, Any]]


def steps_of(scenario: Scenario) -> Steps:
    """Return the record of a scenario's run, as it comes out of JSON."""
    found: Steps = json.loads(json.dumps([step_record(step) for step in scenario.run().steps]))
    return found


def remade(steps: Sequence[Mapping[str, Any]], parameters: Mapping[str, Any]) -> str:
    """Return the text of the scenario made of a record."""
    text = json.dumps({"steps": steps, "parameters": parameters})
    return scenario_text(read_recording(text, "run.json"), "as recorded", MADE, MISSIONS)


def recordable() -> list[Path]:
    """Return the scenarios in which a mission that exists is started."""
    found = scenario_files([SCENARIOS])
    without = ("requests_refused_when_ready", "start_refused_for_unknown_mission")
    return [file for file in found if not file.name.startswith(without)]


@pytest.mark.slow
@pytest.mark.parametrize("file", recordable(), ids=lambda file: file.name.partition(".")[0])
def test_every_run_can_be_made_a_scenario(file: Path) -> None:
    """What was recorded of a scenario's run is a scenario that holds, with the same steps."""
    scenario = load_scenario(file, shipped.catalog(), MISSIONS)
    made = load_scenario_text(remade(steps_of(scenario), scenario.parameters), MADE, MISSIONS)
    run = made.run()
    assert made.failures(run) == []
    assert made.node.expect.lifecycle == scenario.run().history.lifecycles


@pytest.mark.slow
@pytest.mark.parametrize("file", scenario_files([EXAMPLES]), ids=lambda file: file.name.partition(".")[0])
def test_a_run_of_an_example_can_be_made_a_scenario(file: Path) -> None:
    """With what a cancel gave, with answers, and by clocks that go on."""
    scenario = load_scenario(file, shipped.catalog(), MISSIONS)
    recording = read_recording(
        json.dumps({"steps": steps_of(scenario), "parameters": scenario.parameters}), "run.json"
    )
    place = file.with_name("made.scenario.yaml")
    made = load_scenario_text(scenario_text(recording, "as recorded", place, MISSIONS), place, MISSIONS)
    run = made.run()
    assert (made.failures(run), run.context) == ([], scenario.run().context)


TEXT = """\
scenario: as recorded
mission: inspection
request: {tag_sequence: ["1", "2", "3"]}
parameters: {nav_max_attempts: 2}
mocks:
  - {do: nav.go_to, then: [done, {fail: nav_status_6, after: 1 s}, {fail: nav_status_6, after: 1 s}]}
expect:
  lifecycle: [BOOT, READY, PREPARE, INSPECTING, RETURNING, DONE]
  passes: [BOOT, READY, LOCALIZING, FOLDING, DRIVING, READING, DWELLING, PUBLISHING, FOLDING, DRIVING,
      PUBLISHING, FOLDING, DRIVING, READING, DWELLING, PUBLISHING, visited, done, DRIVING_HOME, DONE]
  published: [1 OK, 2 UNREACHABLE nav_status_6, 3 OK]
  counts: {plugins.ready: 1, nav.localize: 1, nav.go_to: 4, bridge.read_tag: 2, nav.dock: 1}
  final: DONE
  last_error: nav_status_6
"""


def test_it_reads_as_if_written_by_hand() -> None:
    """Only what differs from the plugins' mocks is mocked; times are short."""
    scenario = load_scenario(SCENARIOS / "unreachable.scenario.yaml", shipped.catalog(), MISSIONS)
    assert remade(steps_of(scenario), scenario.parameters) == TEXT


def real(steps: Steps) -> Steps:
    """Make a simulated record look like one of a robot: other times, delays, reports all the time."""
    found: Steps = []
    for number, step in enumerate(steps):
        time = 1000.0 + step["time"] + 0.0137 * number
        found.append({**step, "sequence": len(found) + 1, "time": time})
        level = {"name": "robot.battery", "value": 0.9 - 0.001 * number, "stamp": time}
        quiet = {"event": "value", "data": level, "configuration": step["configuration"]}
        found += [{**quiet, "sequence": len(found) + 1 + n, "time": time + 0.001 * n} for n in (1, 2, 3)]
    return found


ROBOT = """\
scenario: a robot that starts somewhere
mission: inspection
request: {tag_sequence: ["1", "2"]}
start: never
when:
  - {at: 1 s, value: {robot.pose: {x: 1.5, y: 2 m, yaw: 0 rad}}}
  - {at: 8 s, request: mission.start}
  - {on: NAVIGATING, nth: 2, after: 1 s, request: operator.pause}
  - {on: NAVIGATING, nth: 2, after: 30 s, request: operator.resume}
expect: {final: DONE}
"""


def test_a_robots_record_will_do() -> None:
    """One object a line, as `lupin run --json` prints them; of reports those last before a step are kept.

    Records of before had no wall clock, no name of the start and no hash of the chart.
    """
    steps = real(steps_of(load_scenario_text(ROBOT, MADE, MISSIONS)))
    lines = [json.dumps({"type": "note", "text": "hello"})]
    new = {"wall_ns": 1_763_885_000_000_000_000, "boot": "b2", "chart": "c2"}
    for number, step in enumerate(steps):
        told = {"type": "step", "elapsed": 1.0, "step": step, "view": {}}
        lines.append(json.dumps({**told, **new} if number % 2 else told))
    text = scenario_text(read_recording("\n".join(lines), "run.jsonl"), "as recorded", MADE, MISSIONS)
    made = load_scenario_text(text, MADE, MISSIONS)
    assert made.failures(made.run()) == []
    assert text.count("robot.pose") == 5, "at the start, where home is, and after each drive"
    assert "robot.battery" not in text, "it was never low"
    assert "start: never" in text
    assert '{on: READY, after: 8.027 s, request: {mission.start: {tag_sequence: ["1", "2"]}}}' in text


def test_of_many_reports_those_count_that_something_followed() -> None:
    """What was reported and reported anew before the next step is not told twice."""
    levels = (50, 40, 30, 25, 22, 10, 9, 8)
    times = (f"{2 + number / 10:.1f} s" for number in range(len(levels)))
    falls = [f"  - {{at: {t}, value: {{battery: {n} %}}}}" for t, n in zip(times, levels, strict=True)]
    head = 'scenario: x\nmission: inspection\nrequest: {tag_sequence: ["1"]}\nwhen:\n'
    scenario = load_scenario_text("\n".join((head, *falls, "expect: {}")), MADE, MISSIONS)
    text = remade(steps_of(scenario), {})
    found = [line for line in text.splitlines() if "robot.battery" in line]
    assert found == [
        "  - {on: DRIVING, after: 2 s, value: {robot.battery: 0.1}}",
        "  - {on: DRIVING_HOME, after: 0.2 s, value: {robot.battery: 0.08}}",
    ]


def test_values_that_change_nothing_are_left_out() -> None:
    """A battery that is full says nothing; one that is empty does."""
    for level, count in ((0.9, 0), (0.1, 1)):
        text = f"when: [{{on: NAVIGATING, after: 1 s, value: {{battery: {level}}}}}]\nexpect: {{}}\n"
        head = 'scenario: x\nmission: inspection\nrequest: {tag_sequence: ["1"]}\n'
        scenario = load_scenario_text(head + text, MADE, MISSIONS)
        assert remade(steps_of(scenario), {}).count("robot.battery") == count


NOTES = """\
mission: Notes
context: {level: {type: number, default: 0}}
initial: LOOKING
states:
  LOOKING:
    after:
      1 s:
        target: done
        do:
          - set: {level: "${ input.battery.value }"}
  done: {type: final, result: {level: "${ level }"}}
"""


def test_values_that_a_variable_keeps_are_not_left_out(tmp_path: Path) -> None:
    """Nothing else comes of the report, and the scenario would end with another value without it."""
    (tmp_path / "missions").mkdir()
    (tmp_path / "missions" / "notes.yaml").write_text(NOTES, encoding="utf-8")
    told = "when: [{on: LOOKING, value: {battery: 60 %}}]\nexpect: {}\n"
    made = tmp_path / "made.scenario.yaml"
    scenario = load_scenario_text(f"scenario: x\nmission: notes\n{told}", made, MISSIONS)
    record = read_recording(json.dumps({"steps": steps_of(scenario)}), "run.json")
    text = scenario_text(record, "as recorded", made, MISSIONS)
    assert "value: {robot.battery: 0.6}" in text


def test_a_record_that_breaks_off_ends_there(tmp_path: Path) -> None:
    """What came after it is not guessed."""
    scenario = load_scenario(SCENARIOS / "three_tags.scenario.yaml", shipped.catalog(), MISSIONS)
    text = remade(steps_of(scenario)[:14], {})
    assert "limit: " in text
    made = load_scenario_text(text, MADE, MISSIONS)
    run = made.run()
    assert made.failures(run) == []
    assert (run.cut_off, len(run.history.published)) == (True, 1)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[]", "run.json: there are no steps in it"),
        ("3", "run.json: expected the output of 'lupin simulate --json', or steps, one a line"),
        ("{}", "run.json: expected the output of"),
        ('{"steps": []}', "run.json: there are no steps in it"),
        ('{"steps": [{"event": "start", "time": 0}]}', "run.json: no mission is started in it"),
        ('{"event": "start", "time": 0}\nwhat', "run.json:2: this is no JSON"),
    ],
)
def test_what_is_no_record_is_told(text: str, told: str) -> None:
    """In a sentence, with the file."""
    with pytest.raises(UsageError) as caught:
        read_recording(text, "run.json")
    assert str(caught.value).startswith(told)


START_STEP = {"event": START, "time": 0, "data": {"mission_type": "inspection"}, "accepted": True}


@pytest.mark.parametrize(
    ("wrong", "part"),
    [
        ({"time": "0 s"}, "time"),
        ({"time": True}, "time"),
        ({"time": 1e400}, "time"),
        ({"time": 10**400}, "time"),
        ({"event": 3}, "event"),
        ({"data": [1]}, "data"),
        ({"data": {}}, "data"),
        ({"event": "value", "data": {"name": 1, "value": 2}}, "data"),
        ({"event": "attempt.failed", "data": {"attempt": "a1"}}, "data"),
        ({"event": "attempt.done", "data": {"attempt": "a1", "result": [1]}}, "data"),
        ({"entered": "READY"}, "entered"),
        ({"entered": [1]}, "entered"),
        ({"configuration": [None]}, "configuration"),
        ({"commands": "x"}, "commands"),
        ({"commands": [{"command": "start", "attempt": "a1"}]}, "commands"),
        ({"commands": [{"command": ["cancel"]}]}, "commands"),
        ({"refusal": "no"}, "refusal"),
        ({"refusal": {"code": 1}}, "refusal"),
    ],
)
def test_a_step_that_is_none_is_told_with_its_number(wrong: dict[str, Any], part: str) -> None:
    """Records are cut off, and edited by hand."""
    steps = [START_STEP, {**START_STEP, **wrong}]
    with pytest.raises(UsageError) as caught:
        read_recording(json.dumps({"steps": steps}), "run.json")
    assert str(caught.value) == f"run.json: step 2 is none: its {part!r} is not as it is recorded"


@pytest.mark.parametrize("more", [{"parameters": [1]}, {"seed": "x"}])
def test_settings_that_are_none_are_told(more: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match="'parameters' must be an object and 'seed' a whole number"):
        read_recording(json.dumps({"steps": [START_STEP], **more}), "run.json")


def test_a_start_that_nobody_answered_is_no_start() -> None:
    """The record broke off before the answer."""
    unanswered = {name: value for name, value in START_STEP.items() if name != "accepted"}
    with pytest.raises(UsageError, match="does not come out as it was recorded: recorded: nothing more"):
        remade([unanswered], {})


def test_what_does_not_come_out_the_same_is_told() -> None:
    """No scenario is made that would fail; the first difference is named."""
    scenario = load_scenario(SCENARIOS / "three_tags.scenario.yaml", shipped.catalog(), MISSIONS)
    steps = steps_of(scenario)
    driven = next(step for step in steps if any("NAVIGATING" in name for name in step.get("entered", ())))
    driven["entered"] = ["RETURNING", "RETURNING.DRIVING_HOME"]
    with pytest.raises(UsageError) as caught:
        remade(steps, {})
    first = "recorded: entered RETURNING; simulated: entered MISSION.InspectionMission.INSPECTING"
    assert str(caught.value) == f"the scenario does not come out as it was recorded: {first}"


@pytest.mark.parametrize(
    "data",
    [
        {"text": "a: b", "number": "12", "word": "true", "empty": "", "quote": 'it\'s "so"', "unit": "5 s"},
        {"list": [1, 2.5, True, None, "x y", "[a]", "- a", "#"], "nested": {"a": {"b": ["c"]}}},
        {"long": [f"element {number}" for number in range(60)], "words": ["w" * 150]},
        {
            "when": [
                {"on": "A", "after": "1 s"},
                {"do": "x", "then": [{"fail": f"code_{n}"} for n in range(20)]},
            ]
        },
        {"a": {"one": 1, "two": 2, "three": 3, "four": 4, "five": 5, "six": {"seven": [{"eight": 8}]}}},
        {"deep": [{"text": "t" * 120, "more": ["x"]}, "plain"], "nothing": {}, "none": []},
    ],
)
def test_what_is_written_is_read_again(data: dict[str, Any]) -> None:
    """Whatever a record holds, YAML gives it back."""
    text = yaml_text(data)
    assert parse(text, "made", Findings()) == data
    assert all(len(line) <= WIDTH or "wwww" in line or "tttt" in line for line in text.splitlines())


def test_the_seed_is_kept() -> None:
    """What retries drew is drawn again."""
    scenario = load_scenario(SCENARIOS / "unreachable.scenario.yaml", shipped.catalog(), MISSIONS)
    record = json.dumps({"steps": steps_of(scenario), "parameters": {"nav_max_attempts": 2}, "seed": 17})
    assert "\nseed: 17\n" in scenario_text(read_recording(record, "run.json"), "x", MADE, MISSIONS)


def test_requests_keep_what_they_carry() -> None:
    """A second mission's request is part of what happens."""
    scenario = load_scenario(
        SCENARIOS / "start_refused_while_running.scenario.yaml", shipped.catalog(), MISSIONS
    )
    text = remade(steps_of(scenario), {})
    assert f'- {{on: DONE, after: 1 s, request: {{{START}: {{tag_sequence: ["4"]}}}}}}' in text


def test_what_was_broken_and_violated_is_expected_of_the_scenario(tmp_path: Path) -> None:
    """A run that went wrong becomes a test that says so, and passes until the mission is mended."""
    (tmp_path / "breaks.yaml").write_text(
        "mission: Breaks\n"
        "invariants:\n  few: {that: count == 0, summary: nothing is counted}\n"
        "context: {count: {type: count, default: 0}}\n"
        "states:\n  A: {after: {1 s: {target: B, do: [set: {count: 1}]}}}\n  B: {after: {1 s: done}}\n"
        "  done: {type: final}\ninitial: A\n",
        encoding="utf-8",
    )
    lifecycle = default_missions_folder() / "lifecycle.yaml"
    (tmp_path / "lifecycle.yaml").write_text(lifecycle.read_text(encoding="utf-8"), encoding="utf-8")
    place = tmp_path / "made.scenario.yaml"
    text = "scenario: it breaks\nmission: breaks\nexpect: {broken: [few], final: FAULT}\n"
    scenario = load_scenario_text(text, place, MISSIONS)
    assert scenario.failures(scenario.run()) == []
    recording = read_recording(
        json.dumps({"steps": steps_of(scenario), "parameters": scenario.parameters}), "run.json"
    )
    made = load_scenario_text(scenario_text(recording, "as recorded", place, MISSIONS), place, MISSIONS)
    assert (made.node.expect.broken, made.failures(made.run())) == (["few"], [])


OTHER = """\
mission: InspectionMission
initial: WAITING
states:
  WAITING:
    on: {operator.skip_current: done}
  done: {type: final}
"""


def test_a_recording_that_does_not_fit_a_mission_names_both(tmp_path: Path) -> None:
    """Not a file that was only in memory."""
    scenario = load_scenario(SCENARIOS / "unreachable.scenario.yaml", shipped.catalog(), MISSIONS)
    recording = read_recording(json.dumps(steps_of(scenario)), "monday.json")
    other = tmp_path / "missions" / "other.yaml"
    other.parent.mkdir()
    other.write_text(OTHER, encoding="utf-8")
    with pytest.raises(UsageError) as caught:
        would_differ(recording, other, MISSIONS)
    told = f"monday.json does not fit {other}: unknown state 'MISSION.InspectionMission.PREPARE.LOCALIZING'; "
    assert str(caught.value).startswith(told)
