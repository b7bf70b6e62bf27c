"""Scenario files: every mistake told with its place, every failure with its story."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.errors import ChartError, UsageError
from lupin_engine.sim.scenario import chart_loader, load_scenario, scenario_files
from tests import shipped

CHARTS = chart_loader(shipped.catalog())
HEAD = 'scenario: a test\nmission: inspection\nrequest: {tag_sequence: ["1"]}\n'


def written(folder: Path, text: str) -> Path:
    """Write a scenario and return its file."""
    file = folder / "x.scenario.yaml"
    file.write_text(text, encoding="utf-8")
    return file


def problems(folder: Path, text: str) -> list[str]:
    """Return what is told about a scenario, without the file's name."""
    with pytest.raises(ChartError) as caught:
        load_scenario(written(folder, text), shipped.catalog(), CHARTS)
    return [str(line).removeprefix(f"{folder}/x.scenario.yaml:") for line in caught.value.diagnostics]


def failures(folder: Path, text: str) -> list[str]:
    """Return the first three lines of each failure of a scenario."""
    scenario = load_scenario(written(folder, HEAD + text), shipped.catalog(), CHARTS)
    found = scenario.failures(scenario.run())
    return [
        " | ".join(line.strip() for line in str(failure).splitlines()[:3]).partition("yaml:")[2]
        for failure in found
    ]


BROKEN = """\
scenario: everything is wrong
mission: inspection
parameters: {nav_timeout: 3 s, scan_timeout_s: 0 s}
limit: 90
mocks:
  - {do: nav.goto, then: done}
  - {do: nav.go_to, with: {pos: 1}, then: {fail: nav_status_7}}
  - {do: bridge.read_tag, then: {done: {reeding: 1}, never: true}}
when:
  - {at: 1, request: operator.pauze}
  - {on: NAVIGATE, value: {batery: 10 %}}
  - {on: NAVIGATING, value: {battery: full}}
  - {on: NAVIGATING, at: 1 s, request: operator.pause}
  - {on: NAVIGATING}
  - {on: NAVIGATING, fail: {do: nav.go_to, code: late}}
expect:
  passes: [READING, REDING]
  counts: {nav.go: 1}
  within: 3
"""

TOLD = [
    "3:14: error: parameters: unknown parameter 'nav_timeout';"
    " did you mean 'nav_timeout_s'? [unknown-parameter]",
    "3:48: error: parameters.scan_timeout_s: must be at least 0.1 s, got '0 s' [wrong-type]",
    "4:8: error: limit: a duration needs a unit, got 90; write '90 s' [no-unit]",
    "6:10: error: unknown operation 'nav.goto'; did you mean 'nav.go_to'? [unknown-operation]",
]


def test_every_mistake_is_told_with_its_place(tmp_path: Path) -> None:
    """Names are looked up in mission and catalog; all mistakes come at once, in the order of the file."""
    found = problems(tmp_path, BROKEN)
    assert found[: len(TOLD)] == TOLD
    rest = [
        ("7:28", "unknown argument 'pos'"),
        ("7:50", "unknown code 'nav_status_7'"),
        ("8:33", "an attempt ends once"),
        ("8:41", "unknown field 'reeding'"),
        ("10:10", "a duration needs a unit"),
        ("10:22", "did you mean 'operator.pause'?"),
        ("11:10", "did you mean 'NAVIGATING'?"),
        ("11:28", "unknown value 'batery'; did you mean 'battery'?"),
        ("12:39", "expected number, got 'full'"),
        ("13:5", "either 'at' (a duration) or 'on' (a state)"),
        ("14:5", "nothing happens"),
        ("15:50", "unknown code 'late'"),
        ("17:21", "unknown state 'REDING'; did you mean 'READING'?"),
        ("18:12", "unknown operation or action 'nav.go'"),
        ("19:11", "a duration needs a unit"),
    ]
    for line, (place, text) in zip(found[len(TOLD) :], rest, strict=True):
        assert line.startswith(f"{place}: error: "), line
        assert text in line


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
    ],
    ids=["empty", "missing", "unknown", "unknown within", "shape"],
)
def test_a_file_of_the_wrong_shape_is_told(tmp_path: Path, text: str, expected: str) -> None:
    """What is no scenario is never a traceback."""
    assert any(line.startswith(expected) for line in problems(tmp_path, text))


FAILING = [
    (
        "lifecycle: [BOOT, DONE]",
        "4:22: lifecycle | expected: BOOT, DONE | actual:   BOOT, READY, PREPARE, INSPECTING, RETURNING",
    ),
    (
        "passes: [READING, NAVIGATING]",
        "4:29: passes: NAVIGATING is not entered after READING | expected: READING, NAVIGATING",
    ),
    (
        "never: [FAULT, READING]",
        "4:26: never: READING | expected: READING is not entered | actual:   entered MISSION.",
    ),
    ("visits: [2 OK]", "4:20: visits | expected: 2 OK | actual:   1 OK"),
    ("visits: [1 OK, 2 OK]", "4:20: visits | expected: 1 OK, 2 OK | actual:   1 OK"),
    ("visits: []", "4:19: visits | expected: none | actual:   1 OK"),
    (
        "published: [1 SKIPPED mission_aborted]",
        "4:23: published | expected: 1 SKIPPED mission_aborted | actual:   1 OK",
    ),
    ("refused: [no_tags]", "4:21: refused | expected: no_tags | actual:   no further refusal"),
    ("final: FAULT", "4:18: final | expected: FAULT | actual:   DONE"),
    ("paused: true", "4:19: paused | expected: True | actual:   False"),
    ("last_error: battery_low", "4:23: last_error | expected: battery_low | actual:   none"),
    ("counts: {nav.go_to: 2, nav.dock: 1}", "4:31: counts: nav.go_to | expected: 2 | actual:   1"),
    ("dropped: 2", "4:20: dropped | expected: 2 | actual:   0"),
    ("within: 2 s", "4:19: within | expected: 2 s | actual:   6.7 s"),
    ("at_least: 7 s", "4:21: at_least | expected: 7 s | actual:   6.7 s"),
]


@pytest.mark.parametrize(("expect", "told"), FAILING, ids=[expect.partition(":")[0] for expect, _ in FAILING])
def test_what_did_not_come_true_is_told(tmp_path: Path, expect: str, told: str) -> None:
    """A failure names its place in the file, what was expected, and what came."""
    (found,) = failures(tmp_path, f"expect: {{ {expect} }}\n")
    assert found.startswith(told)


def test_a_refusal_that_nobody_expected_is_a_failure(tmp_path: Path) -> None:
    """Silence about refusals means that there are none."""
    text = "when:\n  - {on: NAVIGATING, request: operator.reset}\nexpect: {final: DONE}\n"
    (found,) = failures(tmp_path, text)
    assert "refused | expected: no further refusal | actual:   operator.reset not_possible" in found


def test_a_happening_that_never_came_is_a_failure(tmp_path: Path) -> None:
    """A scenario that tests nothing says so."""
    text = "when:\n  - {on: NAVIGATING, nth: 2, request: operator.pause}\nexpect: {final: DONE}\n"
    (found,) = failures(tmp_path, text)
    assert (
        "expected: NAVIGATING is entered 2 times, for something to happen then | actual:   entered 1 times"
        in found
    )


def test_a_failure_tells_what_happened_around_it(tmp_path: Path) -> None:
    """The story up to the step in question stands below."""
    text = HEAD + "when:\n  - {on: READING, request: operator.skip_current}\nexpect: {visits: [1 OK]}\n"
    scenario = load_scenario(written(tmp_path, text), shipped.catalog(), CHARTS)
    (failure,) = scenario.failures(scenario.run())
    assert "operator.skip_current accepted" in str(failure.story[-1])
    assert "publish 1 SKIPPED" in str(failure.story[-1])


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
    for name in ("lifecycle.yaml", "inspection.yaml", "parts/visit_targets.yaml"):
        target = tmp_path / name
        target.parent.mkdir(exist_ok=True)
        target.write_text((Path("missions") / name).read_text(encoding="utf-8"), encoding="utf-8")
    file = written(tmp_path, HEAD + "expect: {final: DONE}\n")
    scenario = load_scenario(file, shipped.catalog())
    assert scenario.chart.missions["InspectionMission"].file == str(tmp_path / "inspection.yaml")
