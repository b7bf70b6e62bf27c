"""What is broken is told as a story, and left as a scenario that fails until it is mended."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.missions.load import load_chart
from lupin_engine.runtime.setup import make_world
from lupin_verify.proof import prove
from lupin_verify.situations import ways
from lupin_verify.situations.explorer import Bounds
from tests import shipped

LIFECYCLE = Path(__file__).parents[2] / "charts" / "mini" / "lifecycle.yaml"
PLANTED = """\
mission: Planted
properties:
  b_comes: {after: "in_state('A')", eventually: "in_state('B')", within: 5 s}
  never_c: {never: "in_state('C')"}
initial: A
states:
  A:
    invoke: {do: nav.localize, with: {max_variance: 1.0}, timeout: {after: 10 s, code: late}}
    on_done: B
    on_error: C
  B: {after: {1 s: done}}
  C: {after: {1 s: done}}
  done: {type: final}
"""


def test_a_breach_becomes_a_scenario_that_fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Named for the property, beside the mission; it holds when the property does."""
    shutil.copy(LIFECYCLE, tmp_path)
    mission = tmp_path / "planted.yaml"
    mission.write_text(PLANTED, encoding="utf-8")
    page = tmp_path / "proof.html"
    assert main(["prove", str(mission), "--targets", "0", "--no-restarts", "--report", str(page)]) == 1
    told = capsys.readouterr().out
    assert "✗ never_c: never in_state('C')" in told
    assert "nav.localize failed: driver_error" in told
    lines = [" ".join(line.split()) for line in told.splitlines()]
    late = lines.index("5.0 s ✗ b_comes: in_state('B') did not become true within 5 s")
    assert lines[late - 1].startswith("0.0 s A mission.start accepted")
    assert lines[late + 1].startswith("10.0 s C nav.localize timed out")
    # Moves come 10 ms after each other: times have as many digits as it takes to tell them apart.
    there = lines.index("0.01 s ✗ never_c: in_state('C') became true; it must never be")
    assert lines[there - 1] == "0.01 s C nav.localize failed: driver_error"
    assert lines[there - 2].startswith("0.00 s A mission.start accepted")
    assert "Planted: 2 of 19 properties broken; 172 situations, 2,912 transitions\n" in told
    report = page.read_text(encoding="utf-8")
    assert report.count("<svg") == 3, "what was reached, and a timeline for each of two counterexamples"
    assert "<p class='result broken'>2 of 19 properties broken</p>" in report
    assert "planted.never_c.scenario.yaml" in report
    assert "start nav.localize(max_variance: 1)\n" in report, "commands are told as in the terminal"
    assert "     5.0 s  ✗ b_comes: in_state(&#x27;B&#x27;) did not become true within 5 s\n" in report
    assert "src=" not in report, "it needs nothing else"
    assert "\u00d7" not in report, "what was reached is no count"
    assert "<p>7 of 7 transitions taken, 7 of 7 states entered.</p>" in report
    assert str(tmp_path) not in report.replace(f"{mission}", "").replace(f"{page}", ""), "places are short"
    for name in ("never_c", "b_comes"):
        scenario = tmp_path / f"planted.{name}.scenario.yaml"
        assert main(["test", str(scenario)]) == 1
        assert f"violated: {name}" in capsys.readouterr().out
    mended = PLANTED.replace("within: 5 s", "within: 20 s").replace("on_error: C", "on_error: B")
    mission.write_text(mended.replace("  C: {after: {1 s: done}}\n", "").replace("in_state('C')", "false"))
    for name in ("never_c", "b_comes"):
        assert main(["test", str(tmp_path / f"planted.{name}.scenario.yaml")]) == 0


def test_a_breach_before_anybody_asked_becomes_a_scenario(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A mission that begins by itself may break a property before the first request, value or answer."""
    lifecycle = "lifecycle: ByItself\nstates:\n  ALL: {slot: mission, on_done: ALL}\n"
    (tmp_path / "lifecycle.yaml").write_text(lifecycle, encoding="utf-8")
    mission = tmp_path / "begun.yaml"
    never = "mission: Begun\nproperties: {never_a: {never: \"in_state('A')\"}}\n"
    mission.write_text(f"{never}states: {{A: {{after: {{1 s: done}}}}, done: {{type: final}}}}\n")
    assert main(["prove", str(mission), "--targets", "0", "--no-restarts"]) == 1
    assert "0.0 s  ✗ never_a: in_state('A') became true; it must never be" in capsys.readouterr().out
    assert main(["test", str(tmp_path / "begun.never_a.scenario.yaml")]) == 1
    assert "violated: never_a" in capsys.readouterr().out


def test_a_breach_is_told_with_the_place_as_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Relative to the folder in which one works, below how it is broken."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(LIFECYCLE, tmp_path)
    Path("planted.yaml").write_text(PLANTED, encoding="utf-8")
    Path("late.scenario.yaml").write_text(
        "scenario: it fails\nmission: planted\nmocks:\n  - {do: nav.localize, then: {fail: driver_error}}\n"
        "expect: {}\n",
        encoding="utf-8",
    )
    assert main(["test", "late.scenario.yaml"]) == 1
    told = capsys.readouterr().out
    assert "    actual:   property never_c (line 4): in_state('C') became true; it must never be\n" in told
    assert "  planted.yaml:4:3: the property never_c\n" in told
    assert str(tmp_path) not in told


#: Two ways lead to C, and as many to D, in as many moves: a failure, and a request.
TWO_WAYS = """\
mission: TwoWays
properties:
  never_c: {never: "in_state('C')"}
  never_d: {never: "in_state('D')"}
initial: A
states:
  A:
    invoke: {do: nav.localize, with: {max_variance: 1.0}, timeout: {after: 10 s, code: late}}
    on_done: B
    on_error: C
    on: {operator.skip_current: C}
  B:
    invoke: {do: nav.localize, with: {max_variance: 1.0}, timeout: {after: 10 s, code: late}}
    on_done: D
    on_error: D
  C: {after: {1 s: done}}
  D: {after: {1 s: done}}
  done: {type: final}
"""


def ways_to_breaches(folder: Path) -> dict[str, str]:
    """Return the last move of the way that is told of each property that is broken."""
    shutil.copy(LIFECYCLE, folder)
    mission = folder / "two_ways.yaml"
    mission.write_text(TWO_WAYS, encoding="utf-8")
    chart = load_chart(folder / "lifecycle.yaml", [mission], shipped.catalog())
    proof = prove(make_world(chart, {}), Bounds(targets=0, restarts=False))
    return {one.name: one.moves[-1] for one in proof.broken}


def test_of_the_shortest_ways_the_one_with_the_fewest_faults_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever was found first: were what goes well the fault, the other way would be told."""
    told = ways_to_breaches(tmp_path)
    assert told == {"never_c": "operator.skip_current", "never_d": "B: nav.localize done"}
    is_fault = ways.is_fault
    monkeypatch.setattr(ways, "is_fault", lambda move: not is_fault(move))
    turned = ways_to_breaches(tmp_path)
    assert turned["never_c"] != told["never_c"]
    assert turned["never_d"] != told["never_d"]


#: Two states that send each other on without any time.
STILL = """\
mission: Still
initial: A
states:
  A: {after: {0 s: B}, on: {operator.skip_current: done}}
  B: {after: {0 s: A}}
  done: {type: final}
"""


@pytest.mark.slow
def test_a_circle_without_time_is_a_scenario(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`lupin test` shows that time does not go on, and comes to its end; the command can be pasted."""
    folder = tmp_path / "two words"
    folder.mkdir()
    shutil.copy(LIFECYCLE, folder)
    mission, page = folder / "still.yaml", folder / "proof.html"
    mission.write_text(STILL, encoding="utf-8")
    asked = ["prove", str(mission), "--targets", "0", "--no-restarts", "--quiet", "--report", str(page)]
    assert main(asked) == 1
    scenario = folder / "still.no_zeno.scenario.yaml"
    told = capsys.readouterr().out
    assert f"wrote '{scenario}'; lupin test '{scenario}' shows it again" in told
    assert main(["test", str(scenario)]) == 1
    told = capsys.readouterr().out
    assert "violated: time_goes_on" in told
    assert "more than 10000 things happen at one moment; MISSION.Still.B, MISSION.Still.A are entered" in told


def test_of_a_circle_that_takes_time_as_much_is_told_as_tells_enough(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The scenario goes on for an hour; the story and the page say that it does."""
    shutil.copy(LIFECYCLE, tmp_path)
    mission, page = tmp_path / "still.yaml", tmp_path / "proof.html"
    mission.write_text(STILL.replace("0 s", "10 s"), encoding="utf-8")
    asked = ["prove", str(mission), "--targets", "0", "--no-restarts", "--quiet", "--report", str(page)]
    assert main(asked) == 1
    told = capsys.readouterr().out
    assert "✗ silence_is_told: " in told
    assert "      and so on: 340 more steps\n" in told
    assert (
        "     0.0 s  ✗ silence_is_told: without answers it may go on for ever: no deadline certainly" in told
    )
    assert told.count("time is up in A") < 30
    assert "and so on: 340 more steps" in page.read_text(encoding="utf-8")


#: Drives without an end if the server says nothing; then FAULT tells that.
SILENT = """\
mission: Silent
initial: GO
states:
  GO:
    invoke: {do: nav.go_to, with: {pose: "${ param.dock_pose }"}, timeout: never}
    on_done: done
    on_error: FAULT
  done: {type: final}
"""


def test_the_scenario_of_a_silent_server_holds_once_somebody_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """However the mission tells it."""
    shutil.copy(LIFECYCLE, tmp_path)
    faulty = LIFECYCLE.read_text(encoding="utf-8").rstrip() + "\n  FAULT: {on: {operator.reset: READY}}\n"
    (tmp_path / "lifecycle.yaml").write_text(faulty, encoding="utf-8")
    mission, scenario = tmp_path / "silent.yaml", tmp_path / "silent.silence_is_told.scenario.yaml"
    mission.write_text(SILENT, encoding="utf-8")
    assert main(["prove", str(mission), "--targets", "0", "--no-restarts", "--quiet"]) == 1
    assert "mocks:\n  - {do: nav.go_to, then: [{accepted: never}]}\n" in scenario.read_text(encoding="utf-8")
    assert main(["test", str(scenario)]) == 1
    assert "violated: somebody_is_told" in capsys.readouterr().out
    mended = SILENT.replace("timeout: never", "timeout: {after: 60 s, code: late}")
    mission.write_text(mended, encoding="utf-8")
    assert main(["test", str(scenario)]) == 0


#: Drives again and again until it arrives; where the robot is nobody has said before.
UNTIL = """\
mission: Until
initial: GO
states:
  GO:
    invoke:
      do: nav.go_to
      with: {pose: "${ approach(tags.named(['1'])[0]) }"}
      timeout: {after: 60 s, code: nav_timeout}
    on_done: done
    on_error: WAIT
  WAIT: {after: {5 s: GO}}
  done: {type: final}
"""


@pytest.mark.slow
def test_what_an_operation_leaves_behind_comes_with_its_answer(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It ends only where the pose is known; it tells that itself, so servers that answer lead to the end."""
    shutil.copy(default_missions_folder() / LIFECYCLE.name, tmp_path)
    mission = tmp_path / "until.yaml"
    mission.write_text(UNTIL, encoding="utf-8")
    assert main(["prove", str(mission), "--targets", "0", "--no-restarts", "--no-scenarios"]) == 1
    told = capsys.readouterr().out
    assert "✗ silence_is_told: " in told
    assert "✓ no_livelock: " in told


MENDED = """\
mission: Mended
invariants: {never_b: {that: "not in_state('B')"}}
initial: A
states:
  A: {after: {1 s: B}}
  B: {after: {1 s: done}}
  done: {type: final}
"""


def test_an_invariant_that_holds_again_at_the_end_of_its_step_is_broken(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """B breaks it, and its error leads to FAULT in the same step, where it holds: the scenario fails."""
    shutil.copy(LIFECYCLE, tmp_path)
    mission = tmp_path / "mended.yaml"
    mission.write_text(MENDED, encoding="utf-8")
    assert main(["prove", str(mission), "--targets", "0", "--no-restarts"]) == 1
    scenario = tmp_path / "mended.invariants.scenario.yaml"
    capsys.readouterr()
    assert main(["test", str(scenario)]) == 1
    assert "FAIL  mended.invariants: No invariant is broken." in capsys.readouterr().out


DRIVE = '{do: nav.go_to, with: {pose: "${ param.dock_pose }"}, timeout: never}'
#: What is corrected -> the property that is broken, the mission's states, and what is replaced by what.
CORRECTED = {
    "a state is removed": (
        "never_n",
        "A: {on: {operator.skip_current: B}, after: {9 s: done}},"
        " B: {on: {operator.dock: {do: {set: {n: 2}}}}, after: {9 s: done}}",
        "{on: {operator.skip_current: B}, after: {9 s: done}},"
        " B: {on: {operator.dock: {do: {set: {n: 2}}}}, after: {9 s: done}}",
        "{after: {9 s: done}}",
    ),
    "a request is refused": (
        "never_n",
        'A: {on: {operator.skip_current: {do: {set: {n: "${ min(n + 1, 2) }"}}}}, after: {9 s: done}}',
        '{do: {set: {n: "${ min(n + 1, 2) }"}}}',
        '[{refuse: late, guard: n > 0}, {do: {set: {n: "${ min(n + 1, 2) }"}}}]',
    ),
    "a state gets a way out": (
        "home_again",
        "A: {after: {1 s: B}, on: {operator.dock: done}},"
        " B: {on: {operator.skip_current: {target: done, guard: n > 1}}}",
        "guard: n > 1",
        "guard: n == 0",
    ),
    "a drive gets a timeout": (
        "silence_is_told",
        f"GO: {{invoke: {DRIVE}, on_done: done, on_error: done, on: {{operator.skip_current: done}}}}",
        "timeout: never",
        "timeout: {after: 60 s, code: late}",
    ),
    "a circle ends": (
        "no_livelock",
        "A: {after: {9 s: B}, on: {operator.dock: done}}, B: {after: {9 s: A}}",
        "{9 s: A}",
        "{9 s: done}",
    ),
    "a circle asks": (
        "no_livelock",
        "A: {after: {9 s: B}, on: {operator.dock: done}}, B: {after: {9 s: A}}",
        "{9 s: A}}",
        "{9 s: ASK}}, ASK: {ask: {question: Go on?, choices: {go_on: Yes}, default: go_on, after: 1 h},"
        " on: {answer.go_on: A}}",
    ),
    "a circle pauses": (
        "no_livelock",
        "A: {after: {9 s: B}, on: {operator.dock: done}}, B: {after: {9 s: A}}",
        "B: {after: {9 s: A}}",
        "B: {paused: true, on: {operator.resume: A}}",
    ),
    "an abort ends a drive": (
        "abort_stops",
        f"GO: {{invoke: {DRIVE}, on_done: done, on_error: done,"
        " on: {operator.abort: {target: done, guard: n > 1}}}",
        "guard: n > 1",
        "guard: n == 0",
    ),
    "a circle without time": (
        "no_zeno",
        "A: {after: {0 s: B}, on: {operator.dock: done}}, B: {after: {0 s: A}}",
        "{0 s: A}",
        "{1 s: A}",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CORRECTED)
def test_a_scenario_holds_once_its_property_does(name: str, tmp_path: Path) -> None:
    """It names no state of the mission, and requests may be refused: a correction may change both."""
    broken, states, old, new = CORRECTED[name]
    lifecycle = LIFECYCLE.read_text(encoding="utf-8").partition("    on:\n      operator.abort")[0]
    (tmp_path / "lifecycle.yaml").write_text(lifecycle, encoding="utf-8")
    mission = tmp_path / "planted.yaml"
    text = (
        "mission: Planted\nproperties: {never_n: {never: n > 1}}\n"
        "context: {n: {type: count, default: 0}}\n"
        f"initial: {states.partition(':')[0]}\nstates: {{{states}, done: {{type: final}}}}\n"
    )
    mission.write_text(text, encoding="utf-8")
    prove_it = ["prove", str(mission), "--targets", "0", "--no-restarts", "--quiet"]
    assert main(prove_it) == 1
    scenario = tmp_path / f"planted.{broken}.scenario.yaml"
    assert main(["test", str(scenario)]) == 1
    assert "Planted" not in scenario.read_text(encoding="utf-8")
    mission.write_text(text.replace(old, new), encoding="utf-8")
    assert main(["test", str(scenario)]) == 0
