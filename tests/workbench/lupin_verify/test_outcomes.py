"""Pages of outcomes: every cell holds in every situation that it is about, or a counterexample is told."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_engine.machine.holds import Holds
from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder
from lupin_engine.missions.load import load_chart
from lupin_engine.runtime.setup import make_world
from lupin_verify.outcomes import OUTCOMES
from lupin_verify.proof import Proof, ProofVerdict, prove
from lupin_verify.situations.explorer import Bounds
from tests import shipped

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "outcomes.md"
MINI = ROOT / "tests" / "charts" / "mini" / LIFECYCLE
WATCH = """\
mission: Watch
states:
  WAITING: {after: {5 s: LOOKING}, on: {operator.skip_current: LOOKING}}
  LOOKING: {after: {2 s: done}}
  done: {type: final}
initial: WAITING
"""
#: What an author writes of a mission of their own.
WATCH_PAGE = """\
# What my watch does

| State | Where | About |
|---|---|---|
| READY | `in_state('READY')` | |
| at work · waiting | `in_state('WAITING')` | |
| at work · looking | `in_state('LOOKING')` | |

| Column | Held | Where |
|---|---|---|
| free | | |
| paused | pause | |

| Event | What | But for |
|---|---|---|
| skip | `operator.skip_current` | |
| pause | `operator.pause` | |
| stop | `input.estop` | |

| State | free | paused |
|---|---|---|
| READY | yes | |
| at work | yes | yes |

## skip

| State | free | paused |
|---|---|---|
| READY, at work · looking | ✗ not possible in STATE | = |
| at work · waiting | → at work · looking | ✗ paused |

## pause

| State | free | paused |
|---|---|---|
| READY, at work | engages pause | ✗ paused |

## stop

| State | free | paused |
|---|---|---|
| READY, at work | engages estop; last_error stopped | = |
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a mission, the lifecycle around it, and its page; it is the current one."""
    shutil.copy(MINI, tmp_path)
    (tmp_path / "watch.yaml").write_text(WATCH, encoding="utf-8")
    (tmp_path / "page.md").write_text(WATCH_PAGE, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


ASKED = ["prove", "watch.yaml", "--outcomes", "page.md", "--no-restarts"]


def test_a_page_of_ones_own_mission_is_proven(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What was looked at is told, and what of the page nothing leads to."""
    assert main(ASKED) == 0
    told = capsys.readouterr().out
    assert "✓ outcomes: In each state, each event leads to what its cell in page.md says." in told
    assert "15 of 15 cells of page.md were met." in told


def test_a_cell_that_is_not_kept_is_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With its line, what it says, what happens instead, and the way there."""
    mission = folder / "watch.yaml"
    mission.write_text(WATCH.replace("skip_current: LOOKING", "skip_current: done"), encoding="utf-8")
    assert main([*ASKED, "--quiet"]) == 1
    assert capsys.readouterr().out.splitlines()[:6] == [
        "  ✗ outcomes: In each state, each event leads to what its cell in page.md says.",
        "      page.md:30:1: skip, at work · waiting, free: → at work · looking; but it is in READY",
        "      no scenario was written, because scenarios do not read the page; these moves lead to it:",
        "      mission.start",
        "      operator.skip_current",
        "Watch: 1 of 18 properties broken; 48 situations, 724 transitions",
    ]


def test_processes_tell_it_as_well(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The steps that lead to it come from the process that has found it."""
    for name in ("watch.yaml", "other.yaml"):
        (folder / name).write_text(WATCH.replace("skip_current: LOOKING", "skip_current: done"))
    assert main([*ASKED, "other.yaml", "--quiet", "--jobs", "2"]) == 1
    told = capsys.readouterr().out
    assert told.count("but it is in READY\n") == 2
    assert told.count("      operator.skip_current\n") == 2


def test_what_is_wrong_with_a_page_is_told_at_once(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Names that nobody knows, conditions that cannot be read, each with its place."""
    page = (
        WATCH_PAGE.replace("| paused | pause | |", "| paused | pawse | |")
        .replace("`input.estop`", "`input.estopp`")
        .replace("| engages pause |", "| → at work · lokking |")
        .replace("READY, at work · looking", "REDY, at work · looking")
        .replace("engages estop;", "engaged estop;")
        .replace("## skip", "## skipp")
    )
    (folder / "page.md").write_text(page, encoding="utf-8")
    assert main(ASKED) == 2
    assert capsys.readouterr().err.splitlines() == [
        "lupin: page.md:12:1: unknown hold 'pawse'; did you mean 'pause'?",
        "page.md:18:17: error: stop: 'input' has no 'estopp'; did you mean 'estop'? [unknown-name]",
        "page.md:25:1: unknown event 'skipp'; did you mean 'skip'?",
        "page.md:36:1: unknown state 'at work · lokking'; did you mean 'at work · looking'?",
        "page.md:42:1: unknown outcome 'engaged estop'; did you mean 'engages'?",
    ]
    (folder / "page.md").write_text("# Nothing\n", encoding="utf-8")
    assert main(ASKED) == 2
    assert capsys.readouterr().err == (
        "lupin: page.md: no table of outcomes; it has a head '| State | COLUMN | ... |' below an event\n"
    )


# -- the page of the shipped missions ------------------------------------------------------------------------


def proven(folder: Path, targets: int) -> Proof:
    """Return what comes of the inspection of a folder with the page."""
    chart = load_chart(folder / LIFECYCLE, [folder / "inspection.yaml"], shipped.catalog())
    return prove(make_world(chart, {}), Bounds(targets, restarts=False), outcomes=PAGE)


def test_the_shipped_page_holds_in_every_situation() -> None:
    """Of an inspection with two targets: nearly every cell is met, and every one that is holds."""
    proof = proven(default_missions_folder(), 2)
    found = {one.name: one.verdict for one in proof.properties}
    assert found[OUTCOMES] is ProofVerdict.HOLDS
    assert proof.broken == []
    assert "917 of 1027 cells of outcomes.md were met." in proof.bounds


@pytest.mark.long
@pytest.mark.proof
@pytest.mark.timeout(300)
def test_the_shipped_page_holds_in_every_situation_of_an_exploration() -> None:
    """With two tags, each watched once: the cells of discovery and of monitoring."""
    given = {"monitoring_sweeps": 1, "seed_climate_on_discovery": False}
    world = make_world(shipped.mission("exploration"), given)
    proof = prove(world, Bounds(2, restarts=False), outcomes=PAGE)
    assert proof.broken == []
    assert "982 of 1092 cells of outcomes.md were met." in proof.bounds


def _reset(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _replace(folder, "operator.reset: {target: BOOT,", "operator.reset: {target: READY,")


def _no_start(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _replace(folder, "mission.start: {refuse: in_fault}", "mission.start: {refuse: not_ready}")


def _no_release(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Holds, "release", lambda *_: None)


def _replace(folder: Path, old: str, new: str) -> None:
    file = folder / LIFECYCLE
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")


@pytest.mark.parametrize(
    ("planted", "cell"),
    [
        (_reset, "reset, FAULT · "),
        (_no_start, "start, FAULT · "),
        (_no_release, "resume, "),
    ],
)
def test_a_cell_that_is_changed_is_found(
    planted: Callable[[Path, pytest.MonkeyPatch], None],
    cell: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Mistakes in the lifecycle, and a mutant of the engine."""
    folder = tmp_path / "missions"
    shutil.copytree(default_missions_folder(), folder)
    planted(folder, monkeypatch)
    (broken,) = [one for one in proven(folder, 0).broken if one.name == OUTCOMES]
    assert f": {cell}" in broken.text
