"""What has happened on a robot, by its journal: beside tests, campaigns and proofs, and in a safety case."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import lupin_engine
from lupin_cli.main import main
from lupin_engine.missions.selection import load_missions
from tests import shipped
from tests.workbench.lupin_cli.test_learn import journal as journal

ROOT = Path(__file__).parents[3]
SCENARIOS = ROOT / "tests" / "scenarios" / "inspection"
PROOF = [{"taken": ["READY.on.mission.start.2", "MISSION.on.operator.abort.0"]}]
CAMPAIGN = {
    "seeds": 10,
    "missions": 12,
    "transitions": {"MISSION.on.operator.abort.0": 7},
    "properties": [{"name": "ends_at_home", "looked_at": 12, "violated_by": 0}],
}


def written(folder: Path, name: str, content: object) -> str:
    """Write JSON, and return the name of its file."""
    (folder / name).write_text(json.dumps(content), encoding="utf-8")
    return str(folder / name)


@pytest.mark.slow
def test_what_never_happened_on_a_robot_is_listed_beside_what_others_saw(
    journal: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With how often; '-' where a source does not look."""
    seen = [written(tmp_path, "p.json", PROOF), written(tmp_path, "c.json", CAMPAIGN)]
    asked = ["test", str(SCENARIOS), "-q", "--field", str(journal), "--seen", seen[0], "--seen", seen[1]]
    assert main(asked) == 0
    lines = capsys.readouterr().out.splitlines()
    table = lines[lines.index("InspectionMission on robots") :]
    assert table[1].startswith("transitions: ")
    assert table[3] == "holds: 0 of 2 have happened on robots"
    assert table[5] == "     tests     proof  campaign  never on a robot"
    (abort,) = [line for line in table if "MISSION: operator.abort -> RETURNING" in line]
    assert abort.split()[1:3] == ["1", "7"]
    (hold,) = [line for line in table if line.endswith(": hold pause")]
    assert hold.split()[1:3] == ["-", "-"]
    assert int(hold.split()[0]) > 0


@pytest.mark.slow
def test_the_same_as_json(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Every item with its counts, and the properties with their breaches and margins."""
    assert main(["test", str(SCENARIOS), "--field", str(journal), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["field"]["InspectionMission"]
    assert (found["missions"], found["left_out"]) == (8, [])
    starts = [one for one in found["items"] if one["what"] == "READY: mission.start -> MISSION"]
    assert [(one["kind"], one["field"]) for one in starts] == [("transitions", 8)]
    assert found["breaches"]["low_battery_leads_home"] == 0
    margin = found["margins"]["low_battery_leads_home"]
    assert margin["left"] == pytest.approx(margin["came"] - margin["limit"])
    assert (margin["what"], margin["limit"], margin["unit"]) == ("input.battery", 20.0, "%")


def test_prove_lists_how_near_robots_came(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Properties of the graph are not watched there."""
    assert main(["prove", str(ROOT / "missions" / "inspection.yaml"), "--list", "--field", str(journal)]) == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    (home,) = [n for n, line in enumerate(lines) if line.startswith("low_battery_leads_home:")]
    assert lines[home + 1].startswith("on robots: broken 0 times, missions: 8; nearest: input.battery ")
    (ends,) = [n for n, line in enumerate(lines) if line.startswith("success_ends:")]
    assert lines[ends + 1] == "not watched on robots"


MISSION = """\
mission: Stand
initial: STANDING
states:
  STANDING: {after: {1 s: [{guard: reason == 'abort', target: SPARE}, {target: done}]}}
  SPARE: {after: {1 s: done}}
  done: {type: final}
"""


@pytest.mark.slow
def test_a_report_fills_a_safety_case(journal: Path, tmp_path: Path) -> None:
    """Claims with their evidence, assumptions, cuts, versions, and room to sign; also in the page."""
    mission = tmp_path / "stand.yaml"
    mission.write_text(MISSION, encoding="utf-8")
    seen = [
        written(tmp_path, "t.json", {"scenarios": [1, 2], "failed": 0}),
        written(tmp_path, "c.json", CAMPAIGN),
    ]
    asked = ["prove", str(mission), "--targets", "0", "--no-restarts", "-q", "--field", str(journal)]
    asked += [word for file in seen for word in ("--seen", file)]
    assert main([*asked, "--report", str(tmp_path / "case.md")]) == 0
    text = (tmp_path / "case.md").read_text(encoding="utf-8")
    heads = [line for line in text.splitlines() if line.startswith("#")]
    assert heads == [
        "# Safety case: Stand",
        "## System",
        "## Claims and their evidence",
        "## Evidence as a whole",
        "## Assumptions",
        "## What was cut, and what is not shown",
        "## Origin",
        "## Signatures",
    ]
    loaded = load_missions([str(mission)], shipped.catalog())
    assert f"| Mission | Stand |\n| Files | {', '.join(loaded.short_names.values())} |\n" in text
    assert (
        f"| SHA-256 of the files | {loaded.hash} |\n| Engine | Lupin engine {lupin_engine.__version__}, "
        in text
    )
    assert f"| Plugins | {', '.join(loaded.plugins)} |\n| SHA-256 of their catalogs | " in text
    assert "- Never entered: stand.yaml:5:3, state SPARE.\n" in text
    (home,) = [line for line in text.splitlines() if line.startswith("| ends_at_home |")]
    assert "| lifecycle | holds | 0 violations, looked at 12 times | broken 0 times, missions: 8 |" in home
    assert "| Tests | 2 scenarios, 0 failed |" in text
    assert "| Campaign | 12 missions of 10 seeds |" in text
    assert "| Robots | 8 missions, simulated robots included |" in text
    assert "| Operator of the robot |  |  |  |" in text
    assert main([*asked, "--report", str(tmp_path / "case.html")]) == 0
    page = (tmp_path / "case.html").read_text(encoding="utf-8")
    assert "<h3>Signatures</h3>" in page
    assert "<td>Operator of the robot</td>" in page


@pytest.mark.slow
@pytest.mark.parametrize(("verb", "others"), [("test", "prove"), ("prove", "test")])
def test_a_file_of_other_results_is_refused(
    verb: str, others: str, journal: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With what is expected."""
    file = written(tmp_path, "x.json", {"other": 1})
    what = SCENARIOS if verb == "test" else ROOT / "missions" / "inspection.yaml"
    assert main([verb, str(what), "--field", str(journal), "--seen", file]) == 2
    assert (
        f"expected the output of 'lupin {others} --json' or 'lupin campaign --json'"
        in capsys.readouterr().err
    )
