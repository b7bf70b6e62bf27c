"""`lupin test` as it is typed: seeds, choice, JUnit, coverage, JSON, scenarios from records."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from lupin_cli.main import main
from lupin_cli.verbs.simulate import simulate
from lupin_cli.verbs.test import _default
from lupin_cli.verbs.test import test as run_scenarios
from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder

SCENARIOS = Path(__file__).parents[2] / "scenarios" / "inspection"
HEAD = 'scenario: a promise\nmission: inspection\nrequest: {tag_sequence: ["1"]}\n'
CHANCE = "mocks: [{do: nav.go_to, then: {any_of: [{weight: 9}, {fail: nav_rejected}]}}]\n"
# pytest would take the verb for a test.
run_scenarios.__test__ = False  # type: ignore[attr-defined]


def typed(*arguments: str | Path, verb: Any = run_scenarios, colour: bool = False) -> Result:
    """Return what a verb prints; its return value is its exit code."""
    result = CliRunner().invoke(verb, list(map(str, arguments)), standalone_mode=False, color=colour)
    assert result.exception is None, result.exception
    return result


def written(folder: Path, name: str, text: str) -> Path:
    """Write a scenario."""
    file = folder / f"{name}.scenario.yaml"
    file.write_text(HEAD + text, encoding="utf-8")
    return file


def test_the_folder_tests_scenarios_is_taken_when_none_is_named() -> None:
    """As an author types it in a checkout."""
    assert list(_default()) == [Path("tests/scenarios")]
    result = typed("tests/scenarios/inspection/three_tags.scenario.yaml")
    assert result.return_value == 0
    promise = "three tags are visited in the order of the request and the robot comes home"
    assert result.output.splitlines() == [f"ok    three_tags: {promise} (13.1 s)", "1 scenario: all hold"]


def test_quiet_tells_failures_only(tmp_path: Path) -> None:
    """What holds is counted."""
    written(tmp_path, "a", "expect: {final: DONE}\n")
    written(tmp_path, "b", "expect: {final: FAULT}\n")
    lines = typed(tmp_path, "-q").output.splitlines()
    assert lines[0].startswith("FAIL  b: a promise")
    assert lines[-1] == "1 of 2 scenarios failed"


def test_the_seed_that_fails_can_be_typed_again(tmp_path: Path) -> None:
    """`--seeds` finds it and names it, `--seed` runs it."""
    file = written(
        tmp_path, "x", "parameters: {nav_max_attempts: 1}\n" + CHANCE + "expect: {visits: [1 OK]}\n"
    )
    first = typed(file, "--seeds", 100).output.splitlines()[0]
    assert first.startswith("FAIL  x: a promise (")
    seed = first.rpartition("--seed ")[2].rstrip(")")
    assert typed(file, "--seed", seed).return_value == 1
    good = typed(file, "--seed", int(seed) + 1)
    assert (good.return_value, good.output.splitlines()[0][-8:]) == (0, f"seed {int(seed) + 1})"[-8:])
    assert typed(file, "--seeds", seed).output.splitlines()[0].endswith(f", {seed} seeds)")


def test_coverage_is_told_and_can_be_asked_for(tmp_path: Path) -> None:
    """A table, what is missing, and an exit code."""
    written(tmp_path, "a", "expect: {final: DONE}\n")
    result = typed(tmp_path, "--coverage")
    assert result.return_value == 0
    assert "lifecycle: transitions that were not reached" in result.output.splitlines()
    less = typed(tmp_path, "--min-coverage", 100)
    assert (less.return_value, less.output.splitlines()[-1]) == (1, "less than 100 % was reached")
    assert typed(tmp_path, "--min-coverage", 10).return_value == 0


def test_scenarios_that_cannot_be_read_reach_nothing(tmp_path: Path) -> None:
    """All of nothing is not enough."""
    written(tmp_path, "a", "")
    result = typed(tmp_path, "--coverage", "--min-coverage", 50)
    assert (result.return_value, result.output.splitlines()[-5:]) == (
        1,
        [
            "",
            "nothing was reached: no scenario was run",
            "",
            "1 of 1 scenario failed",
            "less than 50 % was reached",
        ],
    )


WAIT = "mission: Wait\nstates:\n  WAITING: {after: {1 s: done}}\n  done: {type: final}\n"


def test_coverage_of_a_mission_of_ones_own_leaves_the_shipped_lifecycle_out(tmp_path: Path) -> None:
    """Also a copy of it, as `lupin new` makes one; a lifecycle of one's own is counted."""
    file = tmp_path / "missions" / "wait.yaml"
    file.parent.mkdir()
    file.write_text(WAIT)
    (tmp_path / "x.scenario.yaml").write_text("scenario: x\nmission: wait\nexpect: {final: DONE}\n")
    assert "100.0 % of all" in typed(tmp_path, "--min-coverage", 100, "--coverage").output
    lifecycle = (default_missions_folder() / LIFECYCLE).read_text(encoding="utf-8")
    (file.parent / LIFECYCLE).write_text(lifecycle)
    assert typed(tmp_path, "--min-coverage", 100).return_value == 0
    origin = "origin: {lifecycle: greenhouse-robot, version: 0.1.0, sha256: 12d68d75c5f06360}\n"
    (file.parent / LIFECYCLE).write_text(lifecycle.replace("\n", f"\n{origin}", 1))
    assert typed(tmp_path, "--min-coverage", 100).return_value == 0
    (file.parent / LIFECYCLE).write_text(lifecycle + "# and a word of our own\n")
    told = typed(tmp_path, "--coverage").output
    assert "lifecycle: transitions that were not reached" in told.splitlines()


def test_coverage_of_an_extended_lifecycle_is_of_what_stands_in_it(tmp_path: Path) -> None:
    """What is inherited is tested where it is written."""
    file = tmp_path / "missions" / "wait.yaml"
    file.parent.mkdir()
    file.write_text(WAIT)
    (tmp_path / "x.scenario.yaml").write_text("scenario: x\nmission: wait\nexpect: {final: DONE}\n")
    own = "lifecycle: a\nextends: greenhouse-robot\n"
    (file.parent / LIFECYCLE).write_text(own)
    assert typed(tmp_path, "--min-coverage", 100).return_value == 0
    (file.parent / LIFECYCLE).write_text(
        f"{own}states: {{RETURNING: {{on: {{operator.skip_current: DONE}}}}}}\n"
    )
    told = typed(tmp_path, "--coverage").output
    assert "lifecycle: transitions that were not reached" in told.splitlines()
    assert [line for line in told.splitlines() if "operator." in line] == [
        f"  {tmp_path}/missions/lifecycle.yaml:3:50: RETURNING: operator.skip_current -> DONE"
    ]


def test_coverage_can_be_looked_at(tmp_path: Path) -> None:
    """The mission's picture, with how often each piece was reached; several missions are several files."""
    folder = tmp_path / "missions"
    shutil.copytree(default_missions_folder(), folder)
    text = (folder / "inspection.yaml").read_text(encoding="utf-8")
    (folder / "second.yaml").write_text(text.replace("InspectionMission", "SecondMission"), encoding="utf-8")
    one, drawing = written(tmp_path, "a", "expect: {final: DONE}\n"), tmp_path / "reached.svg"
    typed(one, "-q", "--coverage-diagram", drawing)
    assert "reached by scenarios" in drawing.read_text(encoding="utf-8")
    other = one.read_text(encoding="utf-8").replace("mission: inspection", "mission: second")
    (tmp_path / "b.scenario.yaml").write_text(other, encoding="utf-8")
    typed(tmp_path, "-q", "--coverage-diagram", drawing)
    names = {file.name for file in tmp_path.glob("*.svg")}
    assert names == {"reached.svg", "reached-inspection.svg", "reached-second.svg"}


def test_the_shipped_scenarios_reach_everything() -> None:
    """`--min-coverage 100` is what a CI asks for."""
    assert typed(SCENARIOS, "-q", "--min-coverage", 100).return_value == 0


def test_json_is_one_object(tmp_path: Path) -> None:
    """Machines read results, failures with their places, and coverage."""
    written(tmp_path, "a", "expect: {final: DONE}\n")
    written(tmp_path, "b", "expect: {final: FAULT}\n")
    written(tmp_path, "c", "")
    result = typed(tmp_path, "--json", "--coverage")
    found = json.loads(result.output)
    assert (result.return_value, found["failed"]) == (1, 2)
    assert [(one["name"], one["holds"]) for one in found["scenarios"]] == [
        ("a", True),
        ("b", False),
        ("c", False),
    ]
    (failure,) = found["scenarios"][1]["failures"]
    assert failure["place"] == f"{tmp_path}/b.scenario.yaml:4:17"
    assert (failure["what"], failure["expected"], failure["actual"]) == ("final", "FAULT", "DONE")
    assert failure["concerned"][0]["what"] == "the state DONE"
    assert "the key 'expect' is missing" in found["scenarios"][2]["problem"]
    assert 0 < found["coverage"]["percent"] < 100


def test_failures_are_coloured_on_a_terminal_only(tmp_path: Path) -> None:
    """Expected is green, actual red; elsewhere there are no signs of it."""
    file = written(tmp_path, "a", "expect: {final: FAULT}\n")
    assert "\x1b[32m    expected: FAULT\x1b[0m" in typed(file, colour=True).output
    assert "\x1b" not in typed(file).output


def test_a_simulation_becomes_a_scenario(tmp_path: Path) -> None:
    """From `lupin simulate --json` to a file that holds."""
    record, made = tmp_path / "run.json", tmp_path / "more" / "made.scenario.yaml"
    record.write_text(typed("inspection", "--tags", "1,2", "--json", verb=simulate).output, encoding="utf-8")
    result = typed("--record", record, "-o", made)
    assert (result.return_value, result.output) == (0, f"wrote {made}\n")
    assert typed(made).output.splitlines()[-1] == "1 scenario: all hold"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["-k", "battery", str(SCENARIOS)], "No such option"),
        (["--record", __file__], "write 'lupin test --record RUN.json -o NAME.scenario.yaml'"),
        (["-o", "x.scenario.yaml"], "write 'lupin test --record RUN.json -o NAME.scenario.yaml'"),
        (["--record", __file__, "-o", "x.yaml"], "'x.yaml' must end in .scenario.yaml"),
        (
            ["--record", __file__, "-o", str(SCENARIOS / "estop.scenario.yaml")],
            "exists; remove it, or",
        ),
        (["--record", __file__, "-o", "x.scenario.yaml"], ":1: this is no JSON"),
        (
            ["--record", __file__, "-o", __file__],
            f"lupin: {__file__!r} must end in .scenario.yaml\n"
            f"{__file__!r} exists; remove it, or choose another name\n{__file__}:1: this is no JSON",
        ),
        (["--coverage-diagram", "x.png", str(SCENARIOS)], "'x.png' must end in .svg"),
        (
            ["--coverage-diagram", "x.png", str(SCENARIOS / "nowhere")],
            "nowhere'; their names end in .scenario.yaml\n'x.png' must end in .svg\n",
        ),
        (["--seeds", "0", str(SCENARIOS)], "0 is not in the range x>=1"),
    ],
)
def test_wrong_usage_is_a_sentence(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2, and no traceback."""
    assert main(["test", *arguments]) == 2
    assert told in capsys.readouterr().err


def test_what_a_proof_has_written_runs_with_the_scenarios(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So a breach that is known stays red; a folder of missions alone will do."""
    monkeypatch.chdir(tmp_path)
    found = Path("missions/go.no_deaf_wait.scenario.yaml")
    found.parent.mkdir()
    found.write_text("", encoding="utf-8")
    assert list(_default()) == [found]
    Path("scenarios").mkdir()
    assert list(_default()) == [Path("scenarios"), found]


@pytest.mark.parametrize(
    ("limit", "warns"), [("15 s", True), ("20 s", True), ("21 s", False)], ids=["below", "same", "above"]
)
def test_a_duration_that_no_run_can_exceed_is_a_warning(tmp_path: Path, limit: str, warns: bool) -> None:
    """A mission that hangs is stopped at the limit, and lasts no longer."""
    file = written(tmp_path, "x", f"limit: {limit}\nexpect: {{within: 20 s}}\n")
    told = (
        f"{file}:5:18: warning: expect.within: no run lasts longer than its 'limit' of {limit}, so this "
        "always holds; write a 'limit' above 20 s, or leave one of them out [never-applies]"
    )
    result = typed(file)
    assert (result.return_value, result.output.splitlines()[1:-1]) == (0, [told] if warns else [])
    (record,) = json.loads(typed(file, "--json").output)["scenarios"]
    assert record["warnings"] == ([told] if warns else [])
