"""What a proof finds beside broken properties: growth, and what no explored step concerns."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_cli.proofs.proof_words import result
from lupin_engine.missions.load import load_chart
from lupin_engine.runtime.setup import make_world
from lupin_verify import growth
from lupin_verify.proof import prove
from lupin_verify.situations.explorer import Bounds
from tests import shipped

LIFECYCLE = Path(__file__).parents[2] / "charts" / "mini" / "lifecycle.yaml"
BREAKS = """\
mission: Breaks
properties:
  p: {never: "in_state('B')"}
initial: A
states:
  A: {after: {1 s: {target: B}}}
  B: {after: {1 s: done}}
  done: {type: final}
"""
GROWS = """\
mission: Grows
context:
  n: {type: count, default: 0}
properties:
  q: {never: "in_state('READY') and in_state('A')"}
  r: {after: "in_state('READY') and in_state('A')", never: "in_state('A')"}
initial: A
states:
  A:
    entry: [{set: {n: "${ n + 1 }"}}]
    after:
      1 s: [{target: done, guard: n == 0}, {target: A}]
  done: {type: final}
"""
#: What is said of it with 60 values.
HOW = (
    "'n' grows without end (61 values, the last 60){}"
    "bound it, with a guard where it is set, or with 'max:' where it is declared (more is then an error)"
)


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The current folder has a mission that is broken, and one that grows; 60 values are enough."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(LIFECYCLE, tmp_path)
    Path("breaks.yaml").write_text(BREAKS, encoding="utf-8")
    Path("grows.yaml").write_text(GROWS, encoding="utf-8")
    monkeypatch.setattr(Bounds.__new__, "__defaults__", (2, 0, True, 60, 2))


def test_growth_is_a_result_of_its_own_mission(capsys: pytest.CaptureFixture[str]) -> None:
    """The others are proven; it is told in the author's words, with exit code 3 where nothing is broken."""
    asked = ["prove", "grows.yaml", "--no-restarts", "--no-scenarios", "--jobs", "1"]
    assert main([*asked, "--quiet"]) == 3
    told = capsys.readouterr().out
    assert told.startswith(f"Grows: not proven: {HOW.format(': ')}; ")
    assert told.endswith(" still to explore\n")
    assert main([*asked, "breaks.yaml", "--json", "--report", "proof.html"]) == 1
    grows, breaks = json.loads(capsys.readouterr().out)
    assert grows["complete"] is False
    assert grows["stopped"] == HOW.format(": ")
    assert {one["verdict"] for one in grows["properties"]} == {"not proven"}
    assert [one["name"] for one in breaks["properties"] if one["verdict"] == "broken"] == ["p"]
    page = Path("proof.html").read_text(encoding="utf-8")
    assert "&#x27;n&#x27; grows without end (61 values, the last 60): bound it" in page


def test_growth_is_a_finding_at_the_variable(capsys: pytest.CaptureFixture[str]) -> None:
    """A warning beside the errors of other missions."""
    assert main(["check", "breaks.yaml", "grows.yaml", "--prove", "60 s", "--github"]) == 1
    told = capsys.readouterr().out.splitlines()
    assert [line.partition("::MISSION")[0] for line in told[:1]] == [
        "::error file=breaks.yaml,line=6,col=20,title=broken-property"
    ]
    assert told[1:] == [
        "::warning file=grows.yaml,line=3,col=3,title=grows-without-end"
        f"::context.n: {HOW.format('; ')} [grows-without-end]"
    ]


def test_what_has_most_values_is_named_where_a_proof_ends_early(monkeypatch: pytest.MonkeyPatch) -> None:
    """It may be what keeps the proof from its end."""
    monkeypatch.setattr(growth, "_MANY", 20)
    of = load_chart(Path("lifecycle.yaml"), [Path("grows.yaml")], shipped.catalog())
    proof = prove(make_world(of, {}), Bounds(restarts=False), lambda p: "no time" if p.depth > 50 else "")
    assert proof.stopped == "no time"
    assert result(proof).startswith("not proven: no time; 'n' has had ")
    assert "values so far: bound it, with a guard where it is set" in result(proof)


#: READING is never entered, and of its two properties nothing can be said.
UNUSED = """\
mission: Unused
properties:
  reads_once: {after: "in_state('READING')", never: "in_state('A')"}
  not_both: {never: "in_state('A') and in_state('READY')"}
context:
  twice: {type: bool, default: false}
initial: A
states:
  A:
    after: {1 s: [{target: READING, guard: twice}, {target: done}]}
  READING: {after: {1 s: done}}
  done: {type: final}
"""


def test_what_nothing_concerns_is_a_warning(capsys: pytest.CaptureFixture[str]) -> None:
    """Properties that never applied, states and transitions never reached: counted, and told with a place."""
    Path("unused.yaml").write_text(UNUSED, encoding="utf-8")
    asked = ["prove", "unused.yaml", "--no-restarts", "--no-scenarios"]
    assert main([*asked, "--quiet"]) == 0
    unreached = "1 state never entered, 1 more transition never taken"
    last = f"Unused: proven; 1 of your properties never applied; {unreached}; "
    assert capsys.readouterr().out.startswith(last)
    assert main(asked) == 0
    told = capsys.readouterr().out
    assert "  - reads_once: after in_state('READING'): never in_state('A')" in told
    assert "never in_state('A') (never applied: no explored step concerns it)\n" in told
    assert "  warning: never entered: unused.yaml:11:3, state READING\n" in told
    assert "  warning: never taken: unused.yaml:10:19, A after 1 s → READING\n" in told
    assert main(["check", "unused.yaml", "--prove", "60 s", "--json"]) == 0
    found = [one for one in json.loads(capsys.readouterr().out) if one["rule"].startswith("never-")]
    assert [(one["line"], one["severity"], one["rule"], one["path"]) for one in found] == [
        (6, "warning", "never-set", "context.twice"),
        (3, "warning", "never-applies", "properties.reads_once"),
        (11, "warning", "never-reached", "MISSION.Unused.READING"),
        (10, "warning", "never-reached", "MISSION.Unused.A.after.0"),
    ]
    for form in ("--sarif", "--github"):
        assert main(["check", "unused.yaml", "--prove", "60 s", form]) == 0
        assert capsys.readouterr().out.count("is never entered, with these parameters and bounds") == 1
    assert main(["check", "unused.yaml", "--prove", "60 s"]) == 0
    assert ": warning: properties.reads_once: it never applied: no explored step" in capsys.readouterr().out


def test_what_another_mission_reaches_is_no_warning(capsys: pytest.CaptureFixture[str]) -> None:
    """A part of the lifecycle that one of its missions does not reach, but another one does."""
    text = Path("lifecycle.yaml").read_text(encoding="utf-8")
    extra = "  EXTRA: {on: {operator.reset: READY}}\n  MISSION:"
    way = "mission.start: MISSION\n      operator.dock: {target: EXTRA, guard: reason == 'far'}"
    added = text.replace("  MISSION:", extra).replace("mission.start: MISSION", way)
    Path("lifecycle.yaml").write_text(added, encoding="utf-8")
    goes_there = UNUSED.replace("  A:\n", "  A:\n    entry: [{set: {reason: far}}]\n")
    Path("unused.yaml").write_text(goes_there, encoding="utf-8")
    assert main(["check", "breaks.yaml", "--prove", "60 s", "--github"]) == 1
    alone = capsys.readouterr().out
    assert main(["check", "breaks.yaml", "unused.yaml", "--prove", "60 s", "--github"]) == 1
    both = capsys.readouterr().out
    assert alone.count("state EXTRA is never entered") == 1
    assert "state EXTRA is never entered" not in both
    assert both.count("state READING is never entered") == 1
    assert main(["prove", "breaks.yaml", "--no-restarts", "--no-scenarios", "--quiet"]) == 1
    assert "; of lifecycle.yaml 1 state never entered, 1 more " in capsys.readouterr().out


def test_broken_and_unfinished_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    """What was found before something stopped the proof is told together with the reason."""
    both = GROWS.replace("in_state('READY') and in_state('A')\"}\n  r", "in_state('A')\"}\n  r")
    Path("grows.yaml").write_text(both, encoding="utf-8")
    assert main(["prove", "grows.yaml", "--no-restarts", "--no-scenarios", "--quiet"]) == 1
    told = capsys.readouterr().out
    assert f"Grows: 1 of 19 properties broken, and not all was explored: {HOW.format(': ')}; " in told


#: What is told of a small mission without restarts; with --late 1 and restarts other sentences stand there.
BOUNDS = """\
  What was explored, and its bounds:
    Late answers, to orders that were given up and hold back no other, are not explored; --late 1 adds them.
    Servers that refuse a cancel are not explored; meanwhile, nothing else begins with what they use.
    A deadline fires at any time, but not before one that was certainly due earlier.
    7 requests, 7 values of inputs and 0 events of plugins come at any time.
    During a hold at most 2 events of each kind, and as many times of day, wait for the release.
    The robot's clock may come to any time of day between two steps; it is not adjusted.
    If an operation sets a live value (such as the pose), that value is known before the operation succeeds.
    The process does not end, and missions are not reloaded.
    Values on which no condition depends are not distinguished: reason.
    Tried as input.battery: 0.1, 0.2, 0.225, 0.25, 0.625.
    Tried as input.estop: false, true.
Breaks: 1 of 18 properties broken; 48 situations, 724 transitions
"""


def test_the_bounds_are_told_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    """What was explored is part of the result."""
    asked = ["prove", "breaks.yaml", "--targets", "0", "--no-scenarios"]
    assert main([*asked, "--no-restarts"]) == 1
    assert capsys.readouterr().out.endswith(BOUNDS)
    assert main([*asked, "--late", "1"]) == 1
    told = capsys.readouterr().out
    late = "Of the orders already given up, up to 1 may still be answered at any time."
    again = "The same missions may be reloaded at any time; during a mission the reload waits for its end."
    assert f"    {late}\n" in told
    assert (
        f"    The process may end at any time; a new one continues from the journal.\n    {again}\n" in told
    )


def test_what_is_not_meant_is_not_claimed(capsys: pytest.CaptureFixture[str]) -> None:
    """Neither in the list of verdicts nor in the safety case."""
    lifecycle = Path("lifecycle.yaml").read_text(encoding="utf-8")
    rests = "properties:\n  rests: {never: in_state('MISSION')}\n  success_ends: {built_in: true}\n"
    Path("lifecycle.yaml").write_text(lifecycle + rests, encoding="utf-8")
    Path("works.yaml").write_text(
        "mission: Works\nnot_meant: {rests: it works, success_ends: it waits}\n"
        "states: {A: {after: {1 s: done}}, done: {type: final}}\n",
        encoding="utf-8",
    )
    asked = ["prove", "works.yaml", "--no-restarts", "--no-scenarios"]
    assert main([*asked, "--report", "case.md"]) == 0
    told = capsys.readouterr().out
    assert "  - rests: never in_state('MISSION') (not meant of this mission)\n" in told
    assert "  not meant of Works: rests, because it works\n" in told
    assert "✓ rests" not in told
    assert "✓ success_ends" not in told
    case = Path("case.md").read_text(encoding="utf-8")
    claimed = [
        line.split(" | ") for line in case.splitlines() if line.startswith(("| rests", "| success_ends"))
    ]
    assert [cells[3] for cells in claimed] == ["not meant", "not meant"]
    assert "- rests is not meant of Works, because it works.\n" in case
