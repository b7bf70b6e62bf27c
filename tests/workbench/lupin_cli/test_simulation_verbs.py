"""`lupin simulate` and `lupin test` as they are typed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from lupin_cli.main import main
from lupin_cli.verbs.simulate import simulate
from lupin_cli.verbs.test import test as run_scenarios
from lupin_engine.missions.folders import LIFECYCLE

MISSIONS = Path(__file__).parents[3] / "missions"
SCENARIOS = Path(__file__).parents[2] / "scenarios" / "inspection"
# pytest would take the verb for a test.
run_scenarios.__test__ = False  # type: ignore[attr-defined]


def typed(verb: Any, *arguments: str) -> Result:
    """Return what a verb prints; its return value is its exit code."""
    result = CliRunner().invoke(verb, arguments, standalone_mode=False)
    assert result.exception is None, result.exception
    return result


def test_simulate_tells_a_story_and_its_sum() -> None:
    """Steps, then a table of targets, then one line; 0 when all were visited."""
    result = typed(simulate, "inspection", "--tags", "1,2", "--set", "flower_scan_dwell_s=2 s")
    assert "PREPARE.LOCALIZING             mission.start accepted" in result.output
    assert "publish 2 OK" in result.output
    assert result.output.splitlines()[-1] == "DONE: 2 visited of 2 targets in 13.9 s of virtual time"
    assert result.return_value == 0


ROUTE = """\
mission: Route
codes:
  drive_slow: {label: driving took too long}
states:
  TOUR:
    itinerary: {items: [{id: gate, x: 1 m, y: 2 m, yaw: 0 rad}, {id: bench, x: 20 cm, y: 2 m, yaw: 90 deg}]}
    on_done: done
    initial: GOING
    states:
      GOING:
        invoke:
          do: nav.go_to
          with: {pose: "${ target }", max_variance: 0.25}
          timeout: {after: 60 s, code: drive_slow}
        on_done: {target: NEXT, do: {itinerary.close: {status: OK}}}
        on_error: {target: NEXT, do: {itinerary.close: {status: UNREACHABLE, code: "${ error.code }"}}}
      NEXT:
        always:
          - {target: GOING, guard: itinerary.remaining > 0, do: itinerary.advance}
          - target: over
      over: {type: final}
  done: {type: final}
"""


def test_targets_that_are_written_out_are_driven_to_and_told_by_their_id(tmp_path: Path) -> None:
    """A list in the file is typed like everything else: its lengths and angles are in base units."""
    shutil.copy(MISSIONS / LIFECYCLE, tmp_path)
    (tmp_path / "route.yaml").write_text(ROUTE)
    result = typed(simulate, str(tmp_path / "route.yaml"))
    assert result.return_value == 0
    told = " ".join(result.output.split())
    assert "start nav.go_to(pose: {id gate, x 1, y 2, yaw 0}, max_variance: 0.25)" in told
    assert "start nav.go_to(pose: {id bench, x 0.2, y 2, yaw 1.571}, max_variance: 0.25)" in told
    assert "publish gate OK" in told
    assert "publish bench OK" in told


def test_a_tick_is_not_told_as_the_end_of_a_time(tmp_path: Path) -> None:
    """What comes at a rate ends nothing; the `after` beside it does."""
    shutil.copy(MISSIONS / LIFECYCLE, tmp_path)
    told = "every: {1 s: {do: {report.note: {text: tick}}}}, after: {2500 ms: done}"
    (tmp_path / "ticks.yaml").write_text(
        f"mission: Ticks\ninitial: A\nstates:\n  A: {{{told}}}\n  done: {{type: final}}\n"
    )
    words = " ".join(typed(simulate, str(tmp_path / "ticks.yaml")).output.split())
    assert words.count("a tick in A (tick)") == 2
    assert words.count("time is up in A") == 1


def test_quiet_prints_the_sum_only() -> None:
    """`-q` leaves the story out."""
    assert "mission.start" not in typed(simulate, "inspection", "--tags", "1", "-q").output


@pytest.mark.parametrize(
    ("scenario", "code", "last"),
    [
        (
            "unreachable",
            1,
            "DONE: 2 visited, 1 unreachable of 3 targets in 12.9 s of virtual time; last: nav_status_6",
        ),
        ("battery_low_while_paused", 2, "it waits for an operator"),
        ("localization_failed_and_left", 2, "FAULT: 3 skipped of 3 targets in 15.0 s of virtual time"),
        ("start_refused_on_low_battery", 2, "start refused: battery low"),
    ],
)
def test_the_exit_code_tells_how_it_ended(scenario: str, code: int, last: str) -> None:
    """0 all visited, 1 some missed, 2 not done; a scenario can be watched like a mission."""
    result = typed(simulate, str(SCENARIOS / f"{scenario}.scenario.yaml"))
    assert result.return_value == code
    assert last in result.output.splitlines()[-1]


def test_until_stops_the_clock() -> None:
    """Who names a time gets what was asked for, as with a state."""
    result = typed(simulate, "inspection", "--until", "5 s", "-q")
    assert result.return_value == 0
    assert result.output.splitlines()[-1].endswith("in 5.0 s of virtual time; stopped where --until says")


def test_json_is_one_object() -> None:
    """Machines read the steps and the final view."""
    result = typed(simulate, "inspection", "--tags", "3", "--json")
    found = json.loads(result.output)
    assert (found["exit_code"], found["lifecycles"][-1]) == (0, "DONE")
    assert [visit["target"] for visit in found["visits"]] == ["3"]
    assert found["steps"][0]["event"] == "start"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["simulate", "inspektion"], "did you mean 'inspection'?"),
        (["simulate", "inspection", "--set", "nav_timeout=3"], "did you mean 'nav_timeout_s'?"),
        (["simulate", "inspection", "--until", "5"], "write a duration such as"),
        (["simulate", "absent.scenario.yaml"], "cannot read the file"),
        (["test", "absent"], "no scenario file 'absent'"),
    ],
)
def test_wrong_usage_is_a_sentence(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """What was typed wrongly is told, with what is allowed, and never as a traceback."""
    assert main(arguments) in (1, 2)
    assert told in capsys.readouterr().err


def test_test_prints_a_line_each() -> None:
    """One line a scenario, then the count."""
    result = typed(
        run_scenarios, str(SCENARIOS / "three_tags.scenario.yaml"), str(SCENARIOS / "estop.scenario.yaml")
    )
    assert result.return_value == 0
    assert [line.split()[:2] for line in result.output.splitlines()] == [
        ["ok", "three_tags:"],
        ["ok", "estop:"],
        ["2", "scenarios:"],
    ]


def test_test_explains_failures_and_goes_on(tmp_path: Path) -> None:
    """A failing scenario and a broken one are both told; the exit code is 1."""
    head = "scenario: fails\nmission: inspection\n"
    (tmp_path / "a.scenario.yaml").write_text(head + "expect: {final: FAULT}\n", encoding="utf-8")
    (tmp_path / "b.scenario.yaml").write_text(head, encoding="utf-8")
    (tmp_path / "c.scenario.yaml").write_text(head + "expect: {final: DONE}\n", encoding="utf-8")
    result = typed(run_scenarios, str(tmp_path))
    assert result.return_value == 1
    assert "expected: FAULT" in result.output
    assert "the key 'expect' is missing" in result.output
    assert result.output.splitlines()[-1] == "2 of 3 scenarios failed"
