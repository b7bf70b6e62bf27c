"""Scenario files: every mistake told with its place, every failure with its story and both files' lines."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_engine.errors import ChartError, UsageError
from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder
from lupin_engine.sim.failure import failure_lines
from lupin_engine.sim.scenario import Missions, Scenario, load_scenario, scenario_files
from lupin_engine.sim.scenario_file import CountNode, ScenarioNode, VisitNode
from lupin_engine.sim.simulation import Run
from tests import shipped
from tests.lupin_engine.chart.test_words import wide_catalog

#: Scenarios in which much is wrong, each beside what is told about it.
BROKEN = Path(__file__).parents[2] / "scenarios" / "broken"
MISSIONS = Missions(shipped.catalog())
HEAD = 'scenario: a test\nmission: inspection\nrequest: {tag_sequence: ["1"]}\n'


def written(folder: Path, text: str) -> Path:
    """Write a scenario and return its file."""
    file = folder / "x.scenario.yaml"
    file.write_text(text, encoding="utf-8")
    return file


def loaded(folder: Path, text: str) -> Scenario:
    """Return the scenario of a text."""
    return load_scenario(written(folder, text), shipped.catalog(), MISSIONS)


def ran(folder: Path, text: str) -> Run:
    """Return what comes of a scenario that holds."""
    scenario = loaded(folder, HEAD + text)
    run = scenario.run()
    assert not scenario.failures(run), "\n".join(map(str, scenario.failures(run)))
    return run


def problems(folder: Path, text: str) -> list[str]:
    """Return what is told about a scenario, without the file's name."""
    with pytest.raises(ChartError) as caught:
        loaded(folder, text)
    return [str(line).removeprefix(f"{folder}/x.scenario.yaml:") for line in caught.value.diagnostics]


def failures(folder: Path, text: str) -> list[str]:
    """Return the first three lines of each failure of a scenario."""
    scenario = loaded(folder, HEAD + text)
    found = scenario.failures(scenario.run())
    return [
        " | ".join(line.strip() for line in str(failure).splitlines()[:3]).partition("yaml:")[2]
        for failure in found
    ]


# -- mistakes of a file ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["everything", "arguments"])
def test_every_mistake_is_told_with_its_place(tmp_path: Path, name: str) -> None:
    """Names are looked up, values are of their type; all mistakes come at once, in the order of the file."""
    file = BROKEN / name
    text, told = (file.with_suffix(ending).read_text(encoding="utf-8") for ending in (".yaml", ".txt"))
    assert problems(tmp_path, text) == told.splitlines()


@pytest.mark.parametrize(
    "given",
    ["{pose: {x: 40 cm, y: 5.9 m}}", "{pose: {yaw: 180 deg}}", "{pose: {x: 400 mm, yaw: 3.141593 rad}}"],
    ids=["lengths", "an angle", "both"],
)
def test_arguments_of_a_mock_are_compared_in_base_units(tmp_path: Path, given: str) -> None:
    """A mission drives to 0.4 m and half a turn, however a scenario writes that."""
    ran(
        tmp_path,
        "parameters: {dock_pose: {x: 40 cm, y: 5.9 m, yaw: 180 deg}}\n"
        f"mocks: [{{do: nav.dock, with: {given}, then: {{after: 90 s}}}}]\n"
        "expect: {at_least: 30 s}\n",
    )


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "1:1: error: the file is empty [wrong-yaml]"),
        (
            "scenario: x\nmission: inspection\n",
            "1:1: error: the key 'expect' is missing; write 'expect: ...'",
        ),
        (HEAD + "expekt: {}\n", "4:1: error: unknown key 'expekt'; did you mean 'expect'?"),
        (HEAD + "expect: {finel: DONE}\n", "4:10: error: expect: unknown key 'finel'; did you mean 'final'?"),
        (HEAD + "expect: {visits: 3}\n", "4:18: error: expect.visits: expected a list, got 3"),
        (
            HEAD + "expect: {published: [2]}\n",
            "4:22: error: expect.published.0: expected a mapping, got 2",
        ),
        (
            HEAD + 'expect: {published: ["2"]}\n',
            "4:22: error: expect.published.0: the key 'status' is missing",
        ),
        (
            HEAD + "expect: {}\ntimeout: 3 s\n",
            "5:1: error: a scenario has no timeout; write 'limit: 10 min', or 'within' under 'expect'",
        ),
        (
            HEAD + "mocks: [{do: nav.go_to, then: {any_of: []}}]\nexpect: {}\n",
            "4:40: error: nav.go_to: there is nothing to choose from [wrong-shape]",
        ),
    ],
    ids=[
        "empty",
        "missing",
        "unknown",
        "unknown within",
        "shape",
        "number",
        "half",
        "elsewhere",
        "no choice",
    ],
)
def test_a_file_of_the_wrong_shape_is_told(tmp_path: Path, text: str, expected: str) -> None:
    """What is no scenario is never a traceback."""
    assert any(line.startswith(expected) for line in problems(tmp_path, text)), problems(tmp_path, text)


def test_mistakes_of_shape_and_of_names_are_told_at_once(tmp_path: Path) -> None:
    """What has the wrong shape is told and left out; the names in all the rest are looked up."""
    text = """\
mocks:
  - {do: nav.goto, then: {after: 5 s}}
  - {do: nav.dock, then: [{after: 5}, {fail: nav_rejectd}], target: 3}
when:
  - {on: NAVIGATNG, request: operator.pause}
  - {on: NAVIGATING, request: [operator.pause]}
  - {at: 5 s, requst: operator.resume}
  - {at: 6 s, restart: 3}
expect: {visits: 3, final: DONE, holds: [paus]}
"""
    assert problems(tmp_path, HEAD + text) == [
        "5:10: error: unknown operation 'nav.goto'; did you mean 'nav.go_to'? [unknown-operation]",
        "6:35: error: after: a duration needs a unit, got 5; write '5 s' [no-unit]",
        "6:46: error: nav.dock: unknown code 'nav_rejectd'; did you mean 'nav_rejected'? [undeclared-code]",
        "6:69: error: mocks.1.target: expected text, got 3 [wrong-shape]",
        "8:10: error: unknown state 'NAVIGATNG'; did you mean 'NAVIGATING'? [unknown-state]",
        "9:31: error: when.1.request: expected a mapping, got a list of 1 [wrong-shape]",
        "10:15: error: when.2: unknown key 'requst'; did you mean 'request'? [unknown-key]",
        "11:24: error: when.3.restart: expected a duration such as '5 s', got 3 [wrong-shape]",
        "12:18: error: expect.visits: expected a list, got 3 [wrong-shape]",
        "12:42: error: expect.holds: unknown hold 'paus'; did you mean 'pause'? [unknown-hold]",
    ]


def test_every_key_says_what_it_is_for() -> None:
    """Editors show the descriptions, and know the short forms."""
    schema = ScenarioNode.model_json_schema(mode="validation")
    definitions = {"ScenarioNode": schema, **schema["$defs"]}
    for name, model in definitions.items():
        objects = [model, *model.get("anyOf", ())]
        for key, described in (pair for one in objects for pair in one.get("properties", {}).items()):
            assert described.get("description"), f"{name}.{key} has no description"


# -- expectations ------------------------------------------------------------------------------------------

FAILING = [
    (
        "lifecycle: [BOOT, DONE]",
        "4:22: lifecycle | expected: BOOT, DONE | actual:   BOOT, READY, PREPARE, INSPECTING, RETURNING",
    ),
    (
        "phases: [SCANNING, LOCALIZING]",
        "4:30: phases: LOCALIZING is not published after SCANNING | expected: SCANNING, LOCALIZING"
        " | actual:   LOCALIZING, NAVIGATING, SCANNING, PUBLISHING",
    ),
    (
        "passes: [READING, NAVIGATING]",
        "4:29: passes: NAVIGATING is not entered after READING | expected: READING, NAVIGATING",
    ),
    (
        "passes: [NAVIGATING, {state: READING, within: 2 s}]",
        "4:32: passes: READING is not entered within 2 s after NAVIGATING"
        " | expected: READING within 2 s, counted from 0.5 s | actual:   READING at 3.5 s",
    ),
    (
        "passes: [{state: READING, by: 3 s}]",
        "4:20: passes: READING is not entered by 3 s | expected: READING by 3 s | actual:   READING at 3.5 s",
    ),
    (
        "passes: [NAVIGATING, {state: READING, at_least: 4 s}]",
        "4:32: passes: READING is not entered after at least 4 s after NAVIGATING",
    ),
    (
        "leads_to: [{from: NAVIGATING, to: READING, within: 2 s}]",
        "4:22: leads_to: READING | expected: READING follows every NAVIGATING within 2 s"
        " | actual:   NAVIGATING at 0.5 s, READING 3.0 s later",
    ),
    (
        "leads_to: [{from: READING, to: NAVIGATING}]",
        "4:22: leads_to: NAVIGATING | expected: NAVIGATING follows every READING"
        " | actual:   READING at 3.5 s, NAVIGATING never after that",
    ),
    (
        "never: [FAULT, READING]",
        "4:26: never: READING | expected: READING is not entered | actual:   entered MISSION.",
    ),
    (
        "never: [{state: NAVIGATING, after: READING}, {state: DONE, after: READING}]",
        "4:56: never: DONE | expected: DONE is not entered after READING | actual:   entered DONE at 6.7 s",
    ),
    ("visits: [2 OK]", "4:20: visits | expected: 2 OK | actual:   1 OK"),
    ("visits: [1 OK, 2 OK]", "4:26: visits | expected: 1 OK, 2 OK | actual:   1 OK"),
    ("visits: []", "4:19: visits | expected: none | actual:   1 OK"),
    (
        "published: [1 SKIPPED mission_aborted]",
        "4:23: published | expected: 1 SKIPPED mission_aborted | actual:   1 OK",
    ),
    (
        "published: [{target: '1', status: OK, reading: {tag_id: '2'}}]",
        "4:23: published | expected: 1 OK with {'tag_id': '2'} | actual:   1 OK with {'tag_id': '1'",
    ),
    ("statuses: {OK: {at_least: 2}}", "4:26: statuses: OK | expected: at least 2 | actual:   1 of 1"),
    ("refused: [no_tags]", "4:21: refused | expected: no_tags | actual:   no further refusal"),
    ("holds: [pause]", "4:19: holds | expected: pause | actual:   none"),
    ("final: FAULT", "4:18: final | expected: FAULT | actual:   DONE"),
    ("paused: true", "4:19: paused | expected: True | actual:   False"),
    ("last_error: battery_low", "4:23: last_error | expected: battery_low | actual:   none"),
    ("counts: {nav.go_to: 2, nav.dock: 1}", "4:31: counts: nav.go_to | expected: 2 | actual:   1"),
    ("counts: {nav.go_to: {at_most: 0}}", "4:31: counts: nav.go_to | expected: 0 | actual:   1"),
    ("cancels: {nav.go_to: 1}", "4:32: cancels: nav.go_to | expected: 1 | actual:   0"),
    ("dropped: 2", "4:20: dropped | expected: 2 | actual:   0"),
    ("notes: [nobody listens]", "4:19: notes | expected: nobody listens | actual:   none"),
    ("within: 2 s", "4:19: within | expected: 2 s | actual:   6.7 s"),
    ("at_least: 7 s", "4:21: at_least | expected: 7 s | actual:   6.7 s"),
]


@pytest.mark.parametrize(("expect", "told"), FAILING, ids=[expect for expect, _ in FAILING])
def test_what_did_not_come_true_is_told(tmp_path: Path, expect: str, told: str) -> None:
    """A failure names its place in the file, what was expected, and what came."""
    (found,) = failures(tmp_path, f"expect: {{ {expect} }}\n")
    assert found.startswith(told)


def test_the_hold_after_a_restart_is_compared_although_it_is_in_no_file(tmp_path: Path) -> None:
    (found,) = failures(tmp_path, "when: [{at: 1 s, restart: 1 s}]\nexpect: {holds: []}\n")
    assert found.startswith("5:17: holds | expected: none | actual:   restarted")


def test_a_later_entry_may_be_the_one_that_is_in_time(tmp_path: Path) -> None:
    """Any entries that fit will do, not only the first ones."""
    scenario = loaded(
        tmp_path,
        HEAD.replace('"1"', '"1", "2"')
        + "mocks: [{do: nav.go_to, then: [{after: 10 s}, {after: 1 s}]}]\n"
        + "expect: {passes: [NAVIGATING, {state: READING, within: 2 s}, {state: visited, within: 1 s}]}\n",
    )
    assert scenario.failures(scenario.run()) == []


MOMENTS = [
    (
        "state: READING",
        "state at 1.0 s | expected: READING | actual:   MISSION.InspectionMission.INSPECTING",
    ),
    ("not_state: [INSPECTING]", "not_state at 1.0 s | expected: not INSPECTING | actual:   MISSION."),
    ("lifecycle: DONE", "lifecycle at 1.0 s | expected: DONE | actual:   INSPECTING"),
    ("phase: SCANNING", "phase at 1.0 s | expected: SCANNING | actual:   NAVIGATING"),
    ('target: ""', "target at 1.0 s | expected: none | actual:   1"),
    ("paused: true", "paused at 1.0 s | expected: True | actual:   False"),
    ("held: [estop]", "held at 1.0 s | expected: estop | actual:   none"),
    ("last_error: nav_timeout", "last_error at 1.0 s | expected: nav_timeout | actual:   none"),
    ("running: []", "running at 1.0 s | expected: none | actual:   nav.go_to"),
    ("variables: {reason: abort}", "variables at 1.0 s | expected: reason: abort | actual:   reason:"),
]


@pytest.mark.parametrize(("moment", "told"), MOMENTS, ids=[moment for moment, _ in MOMENTS])
def test_what_must_be_so_at_a_moment_is_compared_then(tmp_path: Path, moment: str, told: str) -> None:
    """A look at a time says what was different then, and where that is written."""
    (found,) = failures(tmp_path, f"when: [{{at: 1 s, expect: {{ {moment} }}}}]\nexpect: {{final: DONE}}\n")
    place, _, rest = found.partition(": ")
    assert place.startswith("4:")
    assert rest.startswith(told)


def test_a_variable_is_expected_as_its_type_is_written(tmp_path: Path) -> None:
    """With its unit; and a value that it can never have is told before anything runs."""
    text = "when: [{at: 1 s, expect: {variables: {reason: 3}}}]\nexpect: {final: DONE}\n"
    (told,) = problems(tmp_path, HEAD + text)
    assert told == "4:47: error: expect.variables.reason: expected text, got 3 [wrong-type]"


def test_an_error_is_compared_with_its_detail_where_one_is_expected(tmp_path: Path) -> None:
    """By its code alone, or with all of the detail, at a moment and at the end."""
    dies = "- {at: 1 s, fail: {do: nav.go_to, code: nav_status_6, detail: no path}"
    text = f"""\
parameters: {{nav_max_attempts: 1}}
when:
  {dies}, expect: {{last_error: "nav_status_6: no path"}}}}
  - {{at: end, expect: {{last_error: nav_status_6}}}}
"""
    ran(tmp_path, text + 'expect: {last_error: "nav_status_6: no path"}\n')
    (found,) = failures(tmp_path, text + 'expect: {last_error: "nav_status_6: no"}\n')
    assert found.endswith("| expected: nav_status_6: no | actual:   nav_status_6: no path")


def test_a_moment_can_be_any_entry_any_start_or_the_end(tmp_path: Path) -> None:
    """What is looked at every time must be so every time; what happens beside it has happened."""
    ran(
        tmp_path,
        """\
when:
  - {on: INSPECTING, expect: {state: NAVIGATING, target: "1", running: [nav.go_to]}}
  - {start_of: nav.go_to, nth: every, after: 1 s, expect: {phase: NAVIGATING, variables: {reason: done}}}
  - {start_of: bridge.read_tag, request: operator.pause, expect: {held: [pause], paused: true}}
  - {at: 10 s, request: operator.resume, expect: {held: []}}
  - {at: end, expect: {lifecycle: DONE, running: [], not_state: [MISSION], variables: {reason: done}}}
expect: {holds: [pause], notes: [the answer of bridge.read_tag waits for the release]}
""",
    )


def test_a_refusal_that_nobody_expected_is_a_failure(tmp_path: Path) -> None:
    """Silence about refusals means that there are none."""
    text = "when:\n  - {on: NAVIGATING, request: operator.reset}\nexpect: {final: DONE}\n"
    (found,) = failures(tmp_path, text)
    assert "refused | expected: no further refusal | actual:   operator.reset not_possible" in found


@pytest.mark.parametrize(
    ("when", "told"),
    [
        (
            "on: NAVIGATING, nth: 2, request: operator.pause",
            "NAVIGATING is entered 2 times, for",
        ),
        ("on: FAULT, request: operator.pause", "FAULT is entered, for something to happen then"),
        ("start_of: nav.dock, nth: 3, restart: 1 s", "nav.dock is started 3 times, for something to happen"),
        ("on: FAULT, expect: {paused: true}", "FAULT is entered, for something to happen then"),
        (
            "at: 4 s, fail: {do: nav.go_to, code: nav_rejected}",
            "nav.go_to is under way | actual:   not so",
        ),
        ("at: 1 s, server_back: nav.go_to", "the server of nav.go_to is gone | actual:   not so at 1.0 s"),
    ],
)
def test_what_never_came_to_pass_is_a_failure(tmp_path: Path, when: str, told: str) -> None:
    """A scenario that tests nothing says so, at the line that does nothing."""
    scenario = (
        f"when:\n  - {{at: 0.1 s, clock: '2026-01-01 03:00'}}\n  - {{ {when} }}\nexpect: {{final: DONE}}\n"
    )
    (found,) = failures(tmp_path, scenario)
    assert found.startswith(f"6:5: when | expected: {told}")


MOCKS = """\
mocks:
  - {do: nav.go_to, with: {pose: {x: 1 m}}, then: never}
  - {do: bridge.read_tag, target: "2", then: never}
  - {do: nav.dock, then: [{after: 1 s}, {after: 2 s}]}
  - {do: nav.localize, then: [{after: 1 s}]}
"""


def test_mocks_that_had_no_part_in_a_failure_are_told_beside_it(tmp_path: Path) -> None:
    """One of them may be meant otherwise; without a failure they may say what must not happen."""
    ran(tmp_path, MOCKS + "expect: {published: [1 OK]}\n")
    assert failures(tmp_path, MOCKS + "expect: {published: [1 UNREACHABLE]}\n") == [
        "9:22: published | expected: 1 UNREACHABLE | actual:   1 OK",
        "5:5: mock not used up | expected: an attempt of nav.go_to under this mock"
        " | actual:   0 of 1; pose of the first: {x 1.1, y 1.3, yaw 0}",
        "6:5: mock not used up | expected: an attempt of bridge.read_tag under this mock | actual:   0 of 1",
        "7:5: mock not used up | expected: 2 attempts of nav.dock under this mock | actual:   1 of 1",
    ]


def test_a_failure_shows_both_files_and_what_happened_around_it(tmp_path: Path) -> None:
    """The line of the expectation, the line of the chart, and the story with its step marked."""
    text = (
        HEAD
        + "when:\n  - {on: READING, request: operator.skip_current}\nexpect: {visits: [1 OK], final: FAULT}\n"
    )
    scenario = loaded(tmp_path, text)
    lines = [line for _, line in failure_lines(scenario.failures(scenario.run()))]
    assert lines[0] == f"{tmp_path}/x.scenario.yaml:6:19: visits"
    assert lines[3:5] == [
        "      6 | expect: {visits: [1 OK], final: FAULT}",
        "        |                   ^",
    ]
    assert lines[5].startswith("  missions/parts/visit_targets.yaml:")
    assert lines[5].endswith("on.operator.skip_current.0")
    assert "target: PUBLISHING" in lines[6]
    marked = [line for line in lines if line.startswith("    >")]
    assert ["operator.skip_current accepted" in line for line in marked] == [True]
    assert "publish 1 SKIPPED" in marked[0]
    at = lines.index(marked[0])
    assert "nav.go_to done" in lines[at - 1]
    assert "nav.dock done" in lines[at + 1]
    assert lines[at + 2].endswith("x.scenario.yaml:6:33: final")
    assert any(line.endswith(": the state DONE") for line in lines[at:])


def test_a_phase_that_never_came_is_shown_where_the_chart_has_it(tmp_path: Path) -> None:
    """Of several states with this phase the first."""
    scenario = loaded(tmp_path, HEAD + "expect: {phases: [PUBLISHING, SCANNING]}\n")
    (failure,) = scenario.failures(scenario.run())
    told = [what.rpartition(".")[2] for what, _ in failure.concerned if what.startswith("the state")]
    assert told == ["READING"]


# -- what happens ------------------------------------------------------------------------------------------


def test_a_server_that_is_gone_is_silent_until_it_is_back(tmp_path: Path) -> None:
    """Neither what it was asked before nor what it is asked meanwhile is answered."""
    run = ran(
        tmp_path,
        """\
parameters: {nav_timeout_s: 10 s, nav_max_attempts: 3}
when:
  - {start_of: nav.go_to, after: 1 s, server_gone: [nav.go_to, nav.dock]}
  - {start_of: nav.go_to, nth: 3, after: 1 s, server_back: nav.go_to}
expect: {published: [1 UNREACHABLE nav_timeout], counts: {nav.go_to: 3, nav.dock: 1}}
""",
    )
    assert run.view.code == "nav_timeout"


def test_a_cancel_takes_the_time_that_is_said(tmp_path: Path) -> None:
    """The robot goes home only when the drive has ended, at most 3 s later."""
    for cancel, seconds in (("2 s", 6.5), ("ends", 4.5), ("unconfirmed", 7.5), ("5 s", 7.5)):
        run = ran(
            tmp_path,
            f"mocks: [{{do: nav.go_to, then: {{never: true, cancel: {cancel}}}}}]\n"
            "when: [{on: NAVIGATING, after: 1 s, request: operator.abort}]\nexpect: {final: DONE}\n",
        )
        assert run.seconds == pytest.approx(seconds)


def test_a_refused_cancel_keeps_a_person_from_resuming(tmp_path: Path) -> None:
    """The way home begins at once: its server puts it in the place of the old drive."""
    run = ran(
        tmp_path,
        """\
mocks: [{do: nav.go_to, then: {never: true, cancel: refused}}]
when:
  - {on: NAVIGATING, after: 1 s, request: operator.pause}
  - {on: NAVIGATING, after: 4 s, request: operator.resume}
  - {on: NAVIGATING, after: 5 s, request: operator.abort}
expect:
  final: DONE
  refused: [{request: operator.resume, code: cancel_refused}]
  counts: {nav.go_to: 1, nav.dock: 1}
""",
    )
    assert run.view.code == "cancel_refused"
    assert run.view.detail == "nav.go_to refuses to stop, and may go on"


def test_an_operation_ends_with_the_result_that_is_said(tmp_path: Path) -> None:
    """`finish` ends it now, over what the mock would say."""
    reading = '{tag_id: "1", stamp: 4.0, sim_time_of_day_seconds: 0, readings: [{name: co2, value: 400}]}'
    ran(
        tmp_path,
        "mocks: [{do: bridge.read_tag, then: never}]\nwhen: [{on: READING, after: 2 s, finish: "
        f"{{do: bridge.read_tag, done: {{reading: {reading}}}}}}}]\n"
        "expect:\n  published:\n"
        "    - {target: '1', status: OK, reading: {stamp: 4.0, readings: [{name: co2, value: 400.0}]}}\n",
    )


WATCHFUL = """\
mission: Watchful
context: {blocks: {type: count, default: 0}}
invariants: {patience: {that: blocks < 2}}
initial: WALKING
states:
  WALKING:
    after: {10 s: done}
    on:
      nav.blocked:
        - {target: STUCK, guard: "event.seconds > '1 s'", do: [set: {blocks: "${ blocks + 1 }"}]}
  STUCK: {after: {2 s: WALKING}}
  done: {type: final}
"""


def watchful(folder: Path, text: str) -> Scenario:
    """Return a scenario of a mission that listens to a plugin's event, with made-up plugins."""
    shutil.copytree(default_missions_folder(), folder, dirs_exist_ok=True)
    (folder / "watchful.yaml").write_text(WATCHFUL, encoding="utf-8")
    return load_scenario(written(folder, f"scenario: a test\nmission: watchful\n{text}"), wide_catalog())


def blocked(seconds: str) -> str:
    """Something stands in the way."""
    return f"{{nav.blocked: {{where: {{x: 0 m, y: 0 m, yaw: 0 deg}}, seconds: {seconds}}}}}"


def test_plugins_tell_events(tmp_path: Path) -> None:
    """What a plugin tells reaches the chart with its fields; a broken invariant is told in order."""
    scenario = watchful(
        tmp_path,
        f"""\
when:
  - {{on: WALKING, after: 1 s, event: {blocked("0.5 s")}, expect: {{state: WALKING}}}}
  - {{on: WALKING, after: 3 s, event: {blocked("2 s")}, expect: {{state: STUCK}}}}
  - {{on: WALKING, nth: 2, event: {blocked("2 s")}, expect: {{variables: {{blocks: 2}}}}}}
expect: {{broken: [patience], final: FAULT, passes: [WALKING, STUCK, WALKING, FAULT]}}
""",
    )
    assert scenario.failures(scenario.run()) == []


def test_a_broken_invariant_that_nobody_expected_is_a_failure(tmp_path: Path) -> None:
    """Silence about invariants means that they hold; the failure shows where it is written."""
    when = f"when:\n  - {{on: WALKING, nth: every, event: {blocked('2 s')}}}\n"
    scenario = watchful(tmp_path, f"{when}expect: {{final: FAULT}}\n")
    (failure,) = scenario.failures(scenario.run())
    assert (failure.what, failure.expected, failure.actual) == ("broken", "none", "patience")
    assert failure.concerned[0][0] == "the invariant patience"
    assert failure.concerned[0][1].line == 3


@pytest.mark.parametrize(
    ("event", "told"),
    [
        ("nav.blokked", "4:22: error: when: unknown event 'nav.blokked'; did you mean 'nav.blocked'?"),
        ("nav.blocked", "4:22: error: nav.blocked: the event has no where, seconds"),
        ("{nav.blocked: {where: 3, second: 1 s}}", "4:44: error: nav.blocked.where: expected pose"),
        ("{name: nav.blocked, data: {second: 1 s}}", "4:49: error: nav.blocked: unknown field 'second'"),
    ],
)
def test_events_are_looked_up(tmp_path: Path, event: str, told: str) -> None:
    """Their names and their fields."""
    with pytest.raises(ChartError) as caught:
        watchful(tmp_path, f"when:\n  - {{at: 1 s, event: {event}}}\nexpect: {{}}\n")
    assert any(f"x.scenario.yaml:{told}" in str(line) for line in caught.value.diagnostics), caught.value


# -- numbers and words -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("node", "text"),
    [
        (CountNode(at_least=2, at_most=2), "2"),
        (CountNode(at_least=2), "at least 2"),
        (CountNode(at_most=3), "at most 3"),
        (CountNode(at_least=2, at_most=3), "2 to 3"),
        (VisitNode(target="1", status="OK"), "1 OK"),
        (VisitNode(target="1", status="OK", code="x", detail="why"), "1 OK x 'why'"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_expectations_are_told_in_words(node: object, text: str) -> None:
    """As they would be written."""
    assert str(node) == text


# -- files -------------------------------------------------------------------------------------------------


def test_folders_hold_scenarios(tmp_path: Path) -> None:
    """A folder stands for all scenarios below it; one without any is a mistake."""
    file = written(tmp_path, HEAD)
    (tmp_path / "other.yaml").write_text("")
    assert scenario_files([tmp_path]) == [file]
    for wrong in (tmp_path / "other.yaml", tmp_path / "absent.scenario.yaml", tmp_path / "absent"):
        with pytest.raises(UsageError, match=r"no scenario file .*\.scenario\.yaml"):
            scenario_files([wrong])
    (tmp_path / "empty").mkdir()
    with pytest.raises(UsageError, match="no scenario in"):
        scenario_files([tmp_path / "empty"])


def test_a_mission_beside_the_scenario_is_found(tmp_path: Path) -> None:
    """A scenario finds the mission in the folder where it stands, and is not taken for one itself."""
    shutil.copytree(default_missions_folder(), tmp_path, dirs_exist_ok=True)
    file = written(tmp_path, HEAD + "expect: {final: DONE}\n")
    scenario = load_scenario(file, shipped.catalog())
    assert (tmp_path / LIFECYCLE).is_file()
    assert scenario.chart.missions["InspectionMission"].file == str(tmp_path / "inspection.yaml")


def test_a_mission_can_be_named_by_its_file(tmp_path: Path) -> None:
    """Counted from the scenario, wherever the tests are started."""
    shutil.copytree(default_missions_folder(), tmp_path / "mine")
    text = HEAD.replace("mission: inspection", "mission: mine/inspection.yaml") + "expect: {final: DONE}\n"
    scenario = load_scenario(written(tmp_path, text), shipped.catalog())
    assert scenario.mission == tmp_path / "mine" / "inspection.yaml"


def test_a_refusal_shows_the_transition_that_refused(tmp_path: Path) -> None:
    """The line of the chart that said no."""
    when = "when: [{on: NAVIGATING, request: mission.start}]\n"
    scenario = loaded(tmp_path, HEAD + when + "expect: {refused: [not_ready]}\n")
    (failure,) = scenario.failures(scenario.run())
    assert failure.actual == "mission.start mission_running 'start refused: a mission is already running'"
    assert failure.concerned[0][0] == "refused at 0.5 s: MISSION.on.mission.start.0"


def test_missions_and_worlds_are_made_once(tmp_path: Path) -> None:
    """Scenarios of one mission share its chart, and those with the same settings its world."""
    one, other = (loaded(tmp_path, HEAD + "expect: {final: DONE}\n") for _ in range(2))
    assert one.chart is other.chart
    assert MISSIONS.world(one.chart, {"nav_max_attempts": 3}) is MISSIONS.world(
        one.chart, {"nav_max_attempts": 3}
    )
    assert MISSIONS.world(one.chart, {}) is not MISSIONS.world(one.chart, {"nav_max_attempts": 3})


def test_of_several_transitions_of_a_step_the_one_that_led_there_is_shown(tmp_path: Path) -> None:
    """The last tag's end ends the mission in the same step; PUBLISHING is not what leads home."""
    scenario = loaded(tmp_path, HEAD + "expect: {never: [RETURNING]}\n")
    (failure,) = scenario.failures(scenario.run())
    assert [what for what, _ in failure.concerned] == [
        "the state RETURNING",
        "taken at 3.7 s: MISSION.on_done.0",
    ]


# -- questions --------------------------------------------------------------------------------------------

TWO_QUESTIONS = """\
mission: Ask
initial: BOTH
states:
  BOTH:
    type: parallel
    states:
      L:
        initial: FIRST
        states:
          FIRST:
            ask: {question: "left?", choices: {yes: Yes}, default: yes, after: 1 min}
            on: {answer.yes: done}
          done: {type: final}
      R:
        initial: SECOND
        states:
          SECOND:
            ask: {question: "right?", choices: {no: No}, default: no, after: 2 min}
            on: {answer.no: done}
          done: {type: final}
    on_done: done
  done: {type: final}
"""


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ("[left?, right?]", []),
        ("left?", ["asked at 10.0 s", "expected: left?\n", "actual:   left?, right?\n"]),
        ('""', ["asked at 10.0 s", "actual:   left?, right?\n"]),
    ],
)
def test_every_question_that_is_open_is_expected(tmp_path: Path, asked: str, told: list[str]) -> None:
    """In the order in which they were asked; one of them alone is not all."""
    (tmp_path / "missions").mkdir()
    (tmp_path / "missions" / "ask.yaml").write_text(TWO_QUESTIONS, encoding="utf-8")
    text = (
        "scenario: x\nmission: ask\nwhen:\n"
        f"  - {{on: FIRST, after: 10 s, expect: {{asked: {asked}}}}}\n"
        "  - {on: FIRST, after: 90 s, expect: {asked: right?}}\n"
        '  - {on: DONE, expect: {asked: ""}}\nexpect: {}\n'
    )
    scenario = load_scenario(written(tmp_path, text), shipped.catalog(), Missions(shipped.catalog()))
    found = "\n".join(map(str, scenario.failures(scenario.run())))
    assert all(part in found for part in told)
    assert bool(found) == bool(told)


# -- the robot's clock ------------------------------------------------------------------------------------


def test_a_clock_has_a_date_and_a_zone_a_name(tmp_path: Path) -> None:
    """At the start and when it is set; what is none is told at its place."""
    when = "when:\n  - {at: 1 s, clock: tomorrow}\n  - {at: 2 s, clock: 0001-01-01 00:00}\n"
    assert problems(tmp_path, f"{HEAD}clock: 22:00\n{when}expect: {{}}\n") == [
        f"{place}: error: clock: expected a date with a time of day, got {got!r}; "
        "write one such as '2026-11-22 22:00' [wrong-type]"
        for place, got in (("4:8", "22:00"), ("6:22", "tomorrow"), ("7:22", "0001-01-01 00:00"))
    ]
    (tmp_path / "w.yaml").write_text(WAKE, encoding="utf-8")
    (tmp_path / "lifecycle.yaml").symlink_to(default_missions_folder() / LIFECYCLE)
    wrong = "scenario: x\nmission: w.yaml\nparameters: {time_zone: Europe/Amsterdm}\nexpect: {}\n"
    assert problems(tmp_path, wrong) == [
        "3:25: error: parameters.time_zone: there is no time zone 'Europe/Amsterdm'; "
        "did you mean 'Europe/Amsterdam'? [wrong-type]"
    ]


WAKE = """mission: Wake
states:
  ASLEEP: {at: {"06:30": done}}
  done: {type: final}
"""


def test_a_simulation_has_a_date_of_its_own_and_a_clock_that_is_set(tmp_path: Path) -> None:
    """Never the computer's; the mission's zone counts."""
    (tmp_path / "w.yaml").write_text(WAKE, encoding="utf-8")
    (tmp_path / "lifecycle.yaml").symlink_to(default_missions_folder() / LIFECYCLE)
    head = "scenario: x\nmission: w.yaml\n"
    assert loaded(tmp_path, head + "expect: {}\n").run().seconds == pytest.approx(6.5 * 3600 + 3.0)
    zone = head + 'clock: "2026-03-29 01:00"\nparameters: {time_zone: Europe/Amsterdam}\n'
    assert loaded(tmp_path, zone + "expect: {}\n").run().seconds == pytest.approx(4.5 * 3600 + 3.0)
    set_back = zone + 'when: [{at: 1 h, clock: "2026-03-29 00:30"}]\nexpect: {notes: [1.5 h back]}\n'
    scenario = loaded(tmp_path, set_back)
    run = scenario.run()
    assert scenario.failures(run) == []
    assert run.seconds == pytest.approx(6 * 3600 + 3.0)


AGAIN = """mission: Again
context:
  times: {type: count, default: 0}
initial: WAKING
states:
  WAKING:
    use: wake
    on_done:
      - {target: done, guard: times == 1}
      - {target: LYING, do: {set: {times: 1}}}
  LYING: {after: {1 h: WAKING}}
  done: {type: final}
"""


def test_a_mission_in_another_deals_with_its_times_anew(tmp_path: Path) -> None:
    """As one that is started again on a day that comes twice."""
    (tmp_path / "wake.yaml").write_text(WAKE, encoding="utf-8")
    (tmp_path / "again.yaml").write_text(AGAIN, encoding="utf-8")
    (tmp_path / "lifecycle.yaml").symlink_to(default_missions_folder() / LIFECYCLE)
    head = "scenario: x\nmission: again.yaml\n"
    set_back = "when: [{on: LYING, after: 30 min, clock: 2026-01-01 05:30}]\nexpect: {}\n"
    assert loaded(tmp_path, head + set_back).run().seconds == pytest.approx(8 * 3600 + 3.0)
    assert loaded(tmp_path, head + "limit: 40 h\nexpect: {}\n").run().seconds == pytest.approx(
        30.5 * 3600 + 3.0
    )


LONG = """
mission: Long
initial: WAITING
states:
  WAITING: {on: {operator.skip_current: done}, after: {%s}}
  done: {type: final}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("timers", "rest", "told"),
    [
        ("30 h: done", "expect: {final: DONE, within: 40 h}", []),
        ("30 h: done", "expect: {final: DONE, passes: [{state: DONE, by: 31 h}]}", []),
        ("30 h: done", "when: [{at: 29 h, expect: {state: [WAITING]}}]\nexpect: {}", []),
        (
            "30 h: done",
            "expect: {final: DONE}",
            ["final: DONE / WAITING, when the run was stopped at the time limit of 86400 s"],
        ),
        (
            "30 h: done",
            "limit: 2 h\nexpect: {passes: [DONE], within: 40 h}",
            [
                "passes: DONE is not entered: DONE / BOOT, READY, MISSION, Long, WAITING, "
                "when the run was stopped at the time limit of 7200 s"
            ],
        ),
        (
            "100 ms: WAITING",
            "expect: {final: DONE}",
            [
                "final: DONE / WAITING, when the run was stopped at the limit of 100000 steps at 9999.6 s; "
                "what repeats: MISSION.Long.WAITING.after.0"
            ],
        ),
    ],
)
def test_a_run_is_not_ended_in_silence(tmp_path: Path, timers: str, rest: str, told: list[str]) -> None:
    """What is looked at later than a day lengthens it; else the failure has the limit, and what repeats."""
    (tmp_path / "missions").mkdir()
    mission = tmp_path / "missions" / "long.yaml"
    mission.write_text(LONG % timers, encoding="utf-8")
    found = written(tmp_path, f"scenario: it ends\nmission: Long\n{rest}\n")
    scenario = load_scenario(found, shipped.catalog(), MISSIONS)
    failed = scenario.failures(scenario.run())
    assert [f"{one.what}: {one.expected} / {one.actual}" for one in failed] == told
