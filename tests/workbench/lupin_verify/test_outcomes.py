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


@pytest.mark.slow
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


# -- a page that is written ----------------------------------------------------------------------------------

NEW = ["prove", "watch.yaml", "--no-restarts", "--quiet", "--outcomes", "new"]
COMPARED = [*NEW[:-1], "watch.outcomes.md"]


@pytest.fixture
def written(folder: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """The page of the watch, as a proof writes it."""
    assert main(NEW) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "wrote watch.outcomes.md"
    return folder / "watch.outcomes.md"


def test_a_page_is_written_from_the_graph(written: Path) -> None:
    """Of requests and live values, in every state and hold, and how to write it again."""
    text = written.read_text(encoding="utf-8")
    assert text.splitlines()[:2] == [
        "<!-- written by: lupin prove watch --no-restarts --outcomes new -->",
        "# What happens when: Watch",
    ]
    skip = text.partition("### operator.skip_current\n\n")[2].partition("\n\n")[0]
    assert skip.splitlines() == [
        "| State | not held | estop | pause | estop, pause |",
        "|---|---|---|---|---|",
        "| READY, LOOKING | ✗ not possible here | = | = | = |",
        "| WAITING | → LOOKING | ✗ stopped | ✗ paused | ✗ stopped |",
    ]
    stop = text.partition("### input.estop becomes true\n\n")[2].partition("\n\n")[0]
    engages = "engages estop; reports stopped"
    assert stop.splitlines()[2:] == [
        f"| READY, WAITING, LOOKING | {engages} | nothing | {engages} | nothing |"
    ]


def test_a_written_page_is_kept_until_the_mission_changes(
    written: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is written the same again; what differs then is told with its place, and how it comes to it."""
    text = written.read_text(encoding="utf-8")
    assert main([*NEW, "--jobs", "2"]) == 0
    assert written.read_text(encoding="utf-8") == text
    assert main(COMPARED) == 0
    capsys.readouterr()
    mission = folder / "watch.yaml"
    mission.write_text(WATCH.replace("skip_current: LOOKING", "skip_current: done"), encoding="utf-8")
    assert main(COMPARED) == 1
    line = text.splitlines().index("| WAITING | → LOOKING | ✗ stopped | ✗ paused | ✗ stopped |") + 1
    where = f"      watch.outcomes.md:{line}:1: operator.skip_current, WAITING, not held: "
    assert capsys.readouterr().out.splitlines()[:6] == [
        "  ✗ outcomes: In each state, each cause leads to what the page of outcomes says.",
        f"{where}'→ LOOKING' is on the page, but never follows",
        f"{where}'→ READY' follows, but is not on the page",
        "      no scenario was written, because scenarios do not read the page; these moves lead to it:",
        "      mission.start",
        "      operator.skip_current",
    ]


def test_what_no_longer_happens_is_told(
    written: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing new happens, so no moves lead to it; of many differences the first are told."""
    (folder / "watch.yaml").write_text(WATCH.replace("5 s: LOOKING", "5 s: done"), encoding="utf-8")
    text = written.read_text(encoding="utf-8")
    more = "".join(f"| LOOKING | {number} |\n" for number in range(30))
    written.write_text(f"{text}\n### lamp.on succeeds\n\n| State | not held |\n|---|---|\n{more}")
    assert main(COMPARED) == 1
    said = capsys.readouterr().out.splitlines()
    line = len(text.splitlines()) + 6
    assert said[1] == (
        f"      watch.outcomes.md:{line}:1: lamp.on succeeds, LOOKING, not held: '0'"
        " is on the page, but never follows"
    )
    assert said[21:23] == [
        "      and 10 more; --outcomes new writes the page anew",
        "      no moves lead to what only the page says",
    ]


def test_operations_and_what_varies(folder: Path) -> None:
    """The ends of operations are causes; where situations differ a cell has several lines."""
    mission = """\
mission: Watch
states:
  FINDING:
    invoke:
      do: nav.localize
      with: {max_variance: 1}
      timeout: {after: 5 s, code: late}
      retry: {attempts: 2, backoff: 1 s}
    on_done: done
    on_error: LOST
  LOST: {after: {2 s: done}}
  done: {type: final}
initial: FINDING
"""
    (folder / "watch.yaml").write_text(mission, encoding="utf-8")
    assert main(NEW) == 0
    text = (folder / "watch.outcomes.md").read_text(encoding="utf-8")
    found = text.partition("## Operations\n\n")[2].splitlines()
    assert [line for line in found if line.startswith(("###", "| FINDING"))] == [
        "### nav.localize fails",
        "| FINDING | reports its code<br>→ LOST; reports its code | waits for the release | = | = |",
        "### nav.localize succeeds",
        "| FINDING | → READY | waits for the release | = | = |",
        "### nav.localize takes too long",
        "| FINDING | cancels nav.localize; reports late<br>→ LOST; cancels nav.localize; reports late |",
    ]
    assert main(COMPARED) == 0


def test_no_page_is_written_of_half_a_proof(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nor compared; a page that is not there is told."""
    assert main([*NEW, "--budget", "0 s"]) == 3
    assert capsys.readouterr().err == "watch.outcomes.md was not written: not everything was explored\n"
    assert not (folder / "watch.outcomes.md").exists()
    assert main(COMPARED) == 2
    assert capsys.readouterr().err == (
        "lupin: --outcomes: there is no file 'watch.outcomes.md'; write 'new' to have the page written\n"
    )


# -- the page of the shipped missions ------------------------------------------------------------------------


def proven(folder: Path, targets: int) -> Proof:
    """Return what comes of the inspection of a folder with the page."""
    chart = load_chart(folder / LIFECYCLE, [folder / "inspection.yaml"], shipped.catalog())
    return prove(make_world(chart, {}), Bounds(targets, restarts=False), outcomes=PAGE)


@pytest.mark.slow
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


@pytest.mark.slow
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
