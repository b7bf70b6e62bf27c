"""`lupin prove`: what it says of a mission that is well, and of wrong usage."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lupin_cli.main import main
from lupin_cli.verbs.prove import so_far
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.memory import Memory
from lupin_engine.machine.reload import successor
from lupin_engine.missions.folders import lifecycle_of
from lupin_engine.missions.load import load_chart
from lupin_engine.runtime.setup import make_world
from lupin_verify.growth import BoundedExplorer
from lupin_verify.proof import Proof, ProofVerdict, prove
from lupin_verify.situations.explorer import Bounds
from lupin_verify.situations.found import ExplorationProgress
from lupin_verify.situations.levels import explore
from lupin_verify.situations.situation import CARRIED_OVER, DROPPED, TrackedMemory
from lupin_verify.situations.worlds import LOADED
from tests import shipped
from tests.workbench.lupin_verify.toys import LIFECYCLE, KeepingExplorer, two_holds

ROOT = Path(__file__).parents[3]
#: Driving is cut short by a half empty battery, whatever the server does; only a timeout ends the planning.
LOOP = """\
mission: Loop
inputs:
  charge: {value: robot.battery, levels: {half: {below: 50 %}}}
initial: PLANNING
states:
  PLANNING:
    invoke: {do: nav.localize, with: {max_variance: 0.25}, timeout: {after: 15 s, code: nav_timeout}}
    on_done: FOLLOWING
    on_error: done
  FOLLOWING:
    invoke: {do: nav.go_to, with: {pose: "${ home }"}, timeout: {after: 60 s, code: nav_timeout}}
    on: {input.charge.half: PLANNING}
    on_done: done
    on_error: done
  done: {type: final}
"""


def test_a_budget_that_runs_out_proves_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 3, and how far it came."""
    assert main(["prove", "inspection", "--targets", "0", "--budget", "0 s", "--json"]) == 3
    (found,) = json.loads(capsys.readouterr().out)
    assert found["complete"] is False
    assert found["stopped"] == "the budget of 0 s ran out"
    assert {one["verdict"] for one in found["properties"]} == {"not proven"}


def wrong(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> Any:
    """Return what is said of wrong usage."""
    code = main(["prove", *arguments])
    return code, capsys.readouterr().err


def test_wrong_usage_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    """No such mission, and a budget that is no duration."""
    code, told = wrong(["inspektion"], capsys)
    assert code == 2
    assert "did you mean 'inspection'?" in told
    code, told = wrong(["inspection", "--budget", "60"], capsys)
    assert code == 2
    assert "--budget: expected duration, got '60'" in told


def told_as(form: str, capsys: pytest.CaptureFixture[str]) -> str:
    """Return what a check tells for programs that has no time for a proof."""
    capsys.readouterr()
    assert main(["check", "inspection", "--prove", "0 s", form]) == 0
    return capsys.readouterr().out


def test_check_proves_within_a_budget(capsys: pytest.CaptureFixture[str]) -> None:
    """What was not proven in time is a warning; a budget that is none is an error."""
    assert main(["check", "inspection", "--prove", "0 s"]) == 0
    told = capsys.readouterr().out
    stopped = "not proven: the budget of 0 s ran out"
    last = f"InspectionMission: {stopped}; 1 situation, 0 transitions, 1 still to explore"
    assert f"{last}\n" in told
    rest = "nothing is known of the rest: give the proof more time [not-proven]"
    assert f"warning: {stopped}; {rest}\n" in told
    assert main(["check", "inspection", "--prove", "0 s", "--strict"]) == 1
    assert f"::{stopped}; nothing" in told_as("--github", capsys)
    assert main(["check", "inspection", "--prove", "soon"]) == 2
    assert "--prove: expected duration, got 'soon'" in capsys.readouterr().err
    assert main(["check", "inspection", "--prove", "1 s", "--watch"]) == 2
    assert "--prove takes its time; leave out --watch" in capsys.readouterr().err


def test_an_interrupted_check_proves_nothing_more(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two missions the second one is not begun, and the exit code says why."""

    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(BoundedExplorer, "step", interrupted)
    assert main(["check", "inspection", "exploration", "--prove", "60 s"]) == 130
    told = capsys.readouterr().out
    assert "InspectionMission: not proven: interrupted; " in told
    assert "ExplorationMission" not in told


@pytest.mark.slow
def test_inspection_is_proven() -> None:
    """The shipped mission with one target, in every situation: nothing is broken."""
    told: list[int | None] = []

    def look(progress: ExplorationProgress) -> str:
        told.append(progress.estimate)
        return ""

    proof = prove(make_world(shipped.mission("inspection"), {}), Bounds(targets=1, restarts=False), look)
    assert proof.complete
    # Whatever is told of how many there will be is right within a factor of two.
    estimates = [found for found in told if found is not None]
    assert len(estimates) >= 3
    assert all(0.5 <= found / proof.progress.situations <= 2.0 for found in estimates), estimates
    assert proof.broken == []
    not_held = {one.name for one in proof.properties if one.verdict is not ProofVerdict.HOLDS}
    # It has none of these, and goes nowhere after a localization that failed.
    assert not_held == {"invariants", "answers_lead_on", "drives_localized", "divert_that_waits_comes"}


def test_who_answers_does_not_wait_for_a_timeout(tmp_path: Path) -> None:
    """A mission that only silence ends goes round for ever if servers answer."""
    (tmp_path / "loop.yaml").write_text(LOOP, "utf-8")
    chart = load_chart(
        lifecycle_of(ROOT / "missions" / "inspection.yaml"), [tmp_path / "loop.yaml"], shipped.catalog()
    )
    proof = prove(make_world(chart, {}), Bounds(restarts=False))
    assert "no_livelock" in {one.name for one in proof.broken}


#: Mission -> its file, and the parameters that bound it.
MISSIONS: dict[str, tuple[Path, dict[str, Any]]] = {
    "exploration": (ROOT / "missions" / "exploration.yaml", {"monitoring_sweeps": 1}),
    **{
        name: (ROOT / "examples" / name / "missions" / f"{name}.yaml", {})
        for name in ("watering", "photo_round", "night_watch")
    },
    **{name: (ROOT / "docs" / "cookbook" / f"{name}.yaml", {}) for name in ("evening", "worst", "carry")},
}


def proven(name: str, situations: int) -> Proof:
    """Return what comes of a mission with one target and so many situations at most."""
    file, parameters = MISSIONS[name]
    chart = load_chart(lifecycle_of(file), [file], shipped.catalog())

    def far(progress: ExplorationProgress) -> str:
        return "far enough" if progress.situations > situations else ""

    return prove(make_world(chart, parameters), Bounds(targets=1, restarts=False), far)


@pytest.mark.slow
@pytest.mark.parametrize("name", MISSIONS)
def test_nothing_is_broken_nearby(name: str) -> None:
    """The first situations of each of the others; all of them take a minute."""
    proof = proven(name, 2_000)
    assert proof.stopped == "far enough"
    assert proof.broken == []


@pytest.mark.long
@pytest.mark.proof
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", MISSIONS)
def test_it_is_proven(name: str) -> None:
    """All situations of a mission."""
    proof = proven(name, 150_000)
    assert proof.broken == []
    assert proof.complete


@pytest.mark.slow
def test_processes_prove_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    """With every class of parameters: the same counts and verdicts, one by one and side by side."""
    arguments = ["prove", "inspection", "--targets", "0", "--no-restarts", "--parameters", "--json"]
    assert main([*arguments, "--jobs", "1"]) == 0
    alone = json.loads(capsys.readouterr().out)
    assert main([*arguments, "--jobs", "2"]) == 0
    together = json.loads(capsys.readouterr().out)
    made = [one.pop("made") for one in (*alone, *together)]
    assert together == alone
    assert all(one["seconds"] > 0.0 < one["processor"] for one in made)
    assert [one["bounds"][0] for one in alone[1:]] == [
        "In this proof arm_patrol_enabled = true.",
        "In this proof require_visual_confirmation = true.",
    ]
    assert [one["varied"] for one in alone] == [
        "",
        "arm_patrol_enabled = true",
        "require_visual_confirmation = true",
    ]
    assert [one["parameters"]["arm_patrol_enabled"] for one in alone] == [False, True, False]


@pytest.mark.slow
def test_missions_are_loaded_anew_only_where_none_is_under_way() -> None:
    """The move leads on only where the robot does it, and leaves as it is what it does not read."""
    chart = shipped.mission("inspection")
    explorer = KeepingExplorer(chart, targets=1)
    found = explore(explorer, live=False)
    rows, table = explorer.situations, explorer.table
    loaded = next(number for number, move in enumerate(explorer.moves.all) if move.event is LOADED)
    sources = {source for source, move in zip(found.sources, found.by, strict=True) if move == loaded}
    names = {name for s in sources for name in table.get(rows[s], ("configuration", "")) or ()}
    assert "READY" in names
    assert [name for name in names if chart.states[name].mission] == []
    assert found.breaches == {}
    dropped = 0
    for source in sources:
        memory = TrackedMemory(table, rows[source])
        before = memory.plain()
        for name in DROPPED:  # which the explorer leaves out
            setattr(before, name, dict(getattr(memory, name).items()))
            dropped += bool(getattr(before, name))
        after = successor(Machine(explorer.world, before), explorer.world).memory
        assert all(getattr(after, name) == getattr(before, name) for name in CARRIED_OVER)
        assert not any(getattr(after, name) for name in DROPPED)
    assert dropped


def test_a_reload_of_the_same_missions_leaves_levels_as_they_are(tmp_path: Path) -> None:
    """Where only the level of an input is read, a situation stands for values on both sides of its bound."""
    of_levels = """\
      WAITS: {always: {guard: input.battery.low, target: LOW}}
      LOW: {always: {guard: not input.battery.low, target: WAITS}}
"""
    ready = f"  READY:\n    on: {{mission.start: MISSION}}\n    initial: WAITS\n    states:\n{of_levels}"
    lifecycle = LIFECYCLE.replace("  READY: {on: {mission.start: MISSION}}\n", ready)
    (tmp_path / "lifecycle.yaml").write_text(lifecycle.replace("freshness: 6 s, ", ""), encoding="utf-8")
    mission = tmp_path / "short.yaml"
    mission.write_text("mission: Short\ninitial: done\nstates: {done: {type: final}}\n", encoding="utf-8")
    explorer = KeepingExplorer(load_chart(tmp_path / "lifecycle.yaml", [mission], shipped.catalog()))
    explore(explorer)
    loaded = next(number for number, move in enumerate(explorer.moves.all) if move.event is LOADED)
    levels = {explorer.table.get(one, ("levels", "input.battery.low")) for one in explorer.situations}
    assert levels == {False, True}
    assert {explorer.step(one, loaded).taken for one in explorer.situations} == {()}


def test_after_a_reload_a_hold_is_released_that_may_not_be_engaged() -> None:
    """Holds stay a set whose names are asked for one by one."""
    explorer = KeepingExplorer(two_holds())
    situation, _ = explorer.initial()
    memory = TrackedMemory(explorer.table, situation)
    memory.assign(Memory(held=["stop"]))
    memory.release(["pause"])
    assert list(memory.held) == ["stop"]
    memory.release(["pause", "stop"])
    assert list(memory.held) == []


def test_the_estimate_comes_first() -> None:
    """On a narrow terminal the end of the line is cut off."""
    known = ExplorationProgress(1700, 42000, 900, 4, 1500, 200, [1, 100, 300, 600, 699])
    assert known.estimate is None
    early = "Inspection: 1,700 situations, 200 to explore, 21,000 transitions/s, 4 deep"
    assert so_far("Inspection", known, 2.0) == early
    shrinks = replace(known, levels=[1, 900, 500, 200, 99])
    assert so_far("Inspection", shrinks, 2.0) == early.replace(": ", f": about 84% of {shrinks.estimate:,}; ")


@pytest.mark.slow
@pytest.mark.parametrize(("jobs", "shown"), [("2", ["Inspection", "Exploration"]), ("1", ["Exploration"])])
def test_an_interruption_tells_what_was_found(jobs: str, shown: list[str]) -> None:
    """Each proof under way shows how far it is; after a Ctrl-C at the terminal all end in order."""
    ours, theirs = os.openpty()
    asked = ["prove", "exploration", "inspection", "--targets", "4", "--jobs", jobs, "--no-scenarios"]
    process = subprocess.Popen(
        [sys.executable, "-m", "lupin_cli.main", *asked],
        stdout=subprocess.PIPE,
        stderr=theirs,
        env={**os.environ, "COLUMNS": "200", "TERM": "xterm"},
        start_new_session=True,
        # A shell lets what it begins in the background ignore a Ctrl-C, and these tests with it.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    os.close(theirs)
    told = ""
    while not all(f"{name}Mission: " in told for name in shown):
        told += os.read(ours, 65536).decode(errors="replace")
    os.killpg(process.pid, signal.SIGINT)
    with suppress(OSError):  # nobody has the terminal open any more
        while more := os.read(ours, 65536):
            told += more.decode(errors="replace")
    os.close(ours)
    found, _ = process.communicate(timeout=60)
    assert process.returncode == 3, told
    assert re.search(
        r"Mission: [0-9,]+ situations?, [0-9,]+ to explore, [0-9,]+ transitions/s, \d+ deep", told
    )
    assert "Traceback" not in told
    lines = [line for line in found.decode().splitlines() if "not proven: " in line]
    assert [line.partition(": ")[0] for line in lines] == ["ExplorationMission", "InspectionMission"]
    assert all(re.search(r"not proven: interrupted; [1-9]", line) for line in lines)
