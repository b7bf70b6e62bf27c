"""`lupin missions`, `why` and `replay`: a real run from its journal, when nothing runs any more."""

from __future__ import annotations

import io
import json
import re
import shutil
import sys
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import pytest

from lupin_cli.main import main
from tests.lupin_ros.launch.processes import Lupin

pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")
pytestmark = pytest.mark.timeout(240)


class Said(NamedTuple):
    """What a verb printed, and its exit code."""

    returncode: int
    stdout: str
    stderr: str


def test_a_run_that_is_over_is_listed_and_explained(
    lupin: Callable[..., Lupin],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    run = lupin("run", "inspection", "--tags", "1,2", "--speed", "10")
    run.process.wait(200)
    monkeypatch.setenv("XDG_STATE_HOME", str(run.state))

    def ask(*words: str, typed: str = "") -> Said:
        monkeypatch.setattr(sys, "stdin", io.StringIO(typed))
        capfd.readouterr()
        code = main([*words, "--domain", str(run.domain)])
        return Said(code, *capfd.readouterr())

    (mission,) = json.loads(ask("missions", "--json").stdout)
    assert (mission["mission"], mission["end"]["state"], mission["restarts"]) == (
        "InspectionMission",
        "DONE",
        0,
    )
    assert mission["end"]["completed"] == 2
    assert "2 completed of 2" in ask("missions").stdout

    told = ask("why", "tag", "2").stdout
    assert re.match(r"InspectionMission lupin-\w+, \d{4}-\d\d-\d\d \w+: tag 2 is OK\n", told)
    assert re.search(r"^\d\d:\d\d:\d\d   bridge.read_tag done$", told, re.MULTILINE)
    assert "publish 2 OK\n" in told
    assert "(itinerary.remaining was 1, context.unreachable was 0, itinerary.total was 2)" in told.replace(
        "\n              ", " "
    )

    causes = json.loads(ask("why", "DONE", "--json").stdout)["causes"]
    assert causes[0]["event"] == "nav.dock done"
    assert causes[0]["because"][0]["file"].endswith("lifecycle.yaml")

    over = f"{datetime.fromtimestamp(mission['last'] + 1.0):%Y-%m-%d %H:%M:%S}"
    assert ": in DONE for " in ask("why", "--at", over, "--timeline", str(tmp_path / "why.svg")).stdout
    assert ask("replay", "--timeline", str(tmp_path / "replay.png")).returncode == 0
    assert (tmp_path / "why.svg").read_text().startswith("<svg")
    assert (tmp_path / "replay.png").read_bytes().startswith(b"\x89PNG")

    story = ask("replay").stdout
    assert "nav.dock done" in story
    assert "DONE: 2 visited of 2 targets" in story

    scenario = tmp_path / "monday.scenario.yaml"
    assert (
        ask("replay", mission["mission_id"], "--to-scenario", str(scenario)).stdout == f"wrote {scenario}\n"
    )
    assert main(["test", str(scenario)]) == 0

    shipped = Path(__file__).parents[3] / "missions"
    other = shutil.copytree(shipped, tmp_path / "missions") / "inspection.yaml"
    assert ask("replay", "--against", str(other)).stdout == f"{other} would have done the same\n"
    walk = other.parent / "parts" / "visit_targets.yaml"
    walk.write_text(walk.read_text().replace("itinerary.remaining > 0", "itinerary.remaining > 1"))
    changed = ask("replay", "--against", str(other))
    assert changed.returncode == 1
    assert changed.stdout.startswith(
        f"{other} would do otherwise: recorded: entered MISSION.InspectionMission."
    )

    there = ask("replay", "--until", "READING", "--interactive", typed="where\nquit\n").stdout
    assert "INSPECTING.SCANNING.READING" in there
    assert "bridge.read_tag (requested)" in there

    unknown = ask("why", "DOCKD")
    assert unknown.returncode == 2
    assert unknown.stderr == (
        "lupin: no state is called 'DOCKD'; did you mean 'DOCKED'?\n"
        "this run knows of no tag 'DOCKD'; allowed: '1', '2'\n"
    )
    misspelt = ask("why", "drives_localised")
    assert misspelt.returncode == 2
    assert misspelt.stderr.startswith(
        "lupin: no property is called 'drives_localised'; did you mean 'drives_localized'?\nproperties: "
    )
