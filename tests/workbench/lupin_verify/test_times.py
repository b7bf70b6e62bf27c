"""Sums of deadlines against others: what holds, what is broken, and what is not shown either way."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_engine.missions.load import load_chart
from lupin_engine.properties.authored import properties_of
from lupin_engine.runtime.setup import make_world
from lupin_verify.situations.explorer import Bounds, SituationExplorer
from lupin_verify.situations.levels import explore
from tests import shipped
from tests.workbench.lupin_verify.test_counterexamples import LIFECYCLE

#: Two deadlines after each other inside of a state that has one, too; what is late sets `late`.
SUMS = """\
mission: Sums
properties: {{never_late: {{never: late}}}}
context: {{late: {{type: bool, default: false}}}}
initial: W
states:
  W:
    after: {{{outer} s: {{target: done, do: {{set: {{late: {outer_is_late}}}}}}}}}
    initial: A
    states:
      A: {{after: {{{first} s: B}}}}
      B: {{after: {{{second} s: {{target: done, do: {{set: {{late: {inner_is_late}}}}}}}}}}}
  done: {{type: final}}
"""


def proven(folder: Path, capsys: pytest.CaptureFixture[str], text: str, *more: str) -> tuple[int, str]:
    """Prove a mission; return the exit code, and what is told."""
    shutil.copy(LIFECYCLE, folder)
    mission = folder / "sums.yaml"
    mission.write_text(text, encoding="utf-8")
    code = main(["prove", str(mission), "--targets", "0", "--quiet", "--no-scenarios", *more])
    return code, capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("restarts", [True, False])
@pytest.mark.parametrize(("first", "second"), [(6, 5), (6, 3), (1, 8), (9, 2)])
@pytest.mark.parametrize("inner", [True, False])
def test_the_sum_of_deadlines_decides(
    first: int, second: int, inner: bool, restarts: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whichever is due later never fires, held or not; arithmetic says which it is.

    Through a restart nobody knows: what is due meanwhile fires late.
    """
    late = {"outer_is_late": str(not inner).lower(), "inner_is_late": str(inner).lower()}
    text = SUMS.format(outer=10, first=first, second=second, **late)
    code, told = proven(tmp_path, capsys, text, *([] if restarts else ["--no-restarts"]))
    is_late = (first + second < 10) == inner
    assert code == is_late or (restarts and not is_late and code == 3), told


@pytest.mark.slow
def test_moves_without_times_are_not_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """At one moment either of two may fire, as far as is known: that is no breach, and no proof."""
    text = SUMS.format(outer=11, first=6, second=5, outer_is_late="false", inner_is_late="true")
    page = tmp_path / "proof.html"
    code, told = proven(tmp_path, capsys, text, "--no-restarts", "--report", str(page))
    assert code == 3
    assert told == (
        "  ? never_late: never late (not shown)\n"
        "      property never_late (line 2): late became true; it must never be\n"
        "      no times were found at which these moves can happen in this order, so it may hold:\n"
        "      mission.start\n"
        "      time is up in W.A\n"
        "      time is up in W.B\n"
        "Sums: 1 of 18 properties not shown; 60 situations, 906 transitions\n"
    )
    report = page.read_text(encoding="utf-8")
    assert "<p class='result not-proven'>1 of 18 properties not shown</p>" in report
    assert "<h3 class='not-shown'>Not shown: never_late</h3>" in report
    mission = str(tmp_path / "sums.yaml")
    assert main(["prove", mission, "--targets", "0", "--no-restarts", "--json"]) == 3
    (found,) = json.loads(capsys.readouterr().out)
    verdicts = {one["name"]: one["verdict"] for one in found["properties"]}
    assert verdicts["never_late"] == "not shown"
    assert not list(tmp_path.glob("*.scenario.yaml"))
    assert main(["check", mission, "--prove", "60 s"]) == 0
    told = capsys.readouterr().out
    assert (
        "warning: not shown: never_late: moves that break it were found, but no times at which they can"
        " happen; " in told
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("outer", "more", "verdict", "code"),
    [
        ("12 s", (), "broken", 1),
        ("10 s", (), "holds", 0),
        ("11 s", (), "not shown", 3),
        ("12 s", ("--budget", "0 s"), "not proven", 3),
    ],
)
def test_the_page_says_which_verdict_is_when(
    outer: str,
    more: tuple[str, ...],
    verdict: str,
    code: int,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """With the mission that stands there."""
    page = (Path(__file__).parents[3] / "docs" / "proof.md").read_text(encoding="utf-8")
    mission = page.partition('```yaml title="late.yaml"\n')[2].partition("```")[0]
    assert "`never_late` is broken if the outer deadline is after 12 s" in page
    text = mission.replace("12 s: done", f"{outer}: done")
    found, told = proven(tmp_path, capsys, text, "--no-restarts", "--json", *more)
    verdicts = {one["name"]: one["verdict"] for one in json.loads(told)[0]["properties"]}
    assert (verdicts["never_late"], found) == (verdict, code)
    marks = {"holds": "✓", "broken": "✗"}
    assert f"| {marks.get(verdict, '?')} {verdict} | {code} |" in page


#: What is limited in a proof -> what the last line begins with.
CUT = {
    "nothing": ("A: {after: {1 s: done}}", "proven;"),
    "the time of day, which is tried": (
        "A: {after: {1 s: [{target: done, guard: \"clock.time < '12:00'\"}, {target: done}]}}",
        "proven;",
    ),
    "a fixed list, which is walked whole": (
        "A: {itinerary: {items: [1, 2]}, after: {1 s: done}}",
        "proven;",
    ),
    "values": (
        "A: {after: {1 s: [{target: done, guard: round(input.battery.value) > 7}, {target: done}]}}",
        "proven for the values that were tried;",
    ),
    "events that wait": (
        "A: {on: {nav.battery_silent: done}, after: {1 s: done}}",
        "proven for up to 2 events of each kind that wait in a hold;",
    ),
    "times of day that wait": (
        "A: {at: {'06:30': B, '07:00': B, '08:00': B}, after: {1 s: done}}\n  B: {after: {1 s: done}}",
        "proven for up to 2 events of each kind that wait in a hold;",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CUT)
def test_what_is_cut_stands_in_the_last_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """And nothing else does; it counts in the exit code if the whole is asked for."""
    state, wanted = CUT[name]
    text = f"mission: Sums\ninitial: A\nstates:\n  {state}\n  done: {{type: final}}\n"
    monkeypatch.chdir(tmp_path)
    code, told = proven(tmp_path, capsys, text, "--no-restarts")
    assert code == 0
    assert told.startswith(f"Sums: {wanted} "), told
    assert main(["prove", "sums.yaml", "--targets", "0", "--no-restarts", "--quiet", "--whole"]) == (
        3 if wanted.startswith("proven for ") else 0
    )


#: Waits for a time of day; where it goes then depends on what the clock says.
EVENING = """\
mission: Evening
properties:
  never_there: {never: "in_state('THERE')"}
  never_late: {never: "in_state('LATE') and clock.time == '22:00'"}
initial: A
states:
  A:
    at: {"22:00": [{target: THERE, guard: "GUARD"}, {target: LATE}]}
    after: {100 s: done}
  LATE: {after: {1 s: done}}
  THERE: {after: {1 s: done}}
  done: {type: final}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("guard", "broken"),
    [
        ("clock.time == '22:00'", {"never_there", "never_late"}),
        ("clock.time == '21:00'", {"never_there", "never_late"}),
        ("clock.time < '05:00' and held(pause)", {"never_late"}),
        ("clock.today > '2026-02-01' and clock.time >= '12:00'", {"never_there", "never_late"}),
    ],
)
def test_a_clock_that_is_not_stored_changes_nothing(guard: str, broken: set[str], tmp_path: Path) -> None:
    """It is chosen when it is read: the same is broken and reached as if each moment were a situation."""
    mission = tmp_path / "evening.yaml"
    mission.write_text(EVENING.replace("GUARD", guard), encoding="utf-8")
    world = make_world(load_chart(LIFECYCLE, [mission], shipped.catalog()), {})
    properties = properties_of(world.chart)
    explorers = [SituationExplorer(world, properties, Bounds(restarts=False)) for _ in range(2)]
    fast, slow = (explore(one, open_values=not at) for at, one in enumerate(explorers))
    assert fast.progress.situations < slow.progress.situations
    assert fast.breaches.keys() == slow.breaches.keys() == broken
    assert (fast.taken, fast.entered) == (slow.taken, slow.entered)
