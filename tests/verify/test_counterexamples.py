"""What is broken is told as a story, and left as a scenario that fails until it is mended."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_engine.cli.main import main

LIFECYCLE = Path(__file__).parents[1] / "charts" / "mini" / "lifecycle.yaml"
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
    assert "Planted: 2 broken;" in told
    report = page.read_text(encoding="utf-8")
    assert report.count("<svg") == 3, "what was reached, and a timeline for each of two counterexamples"
    assert "<b class='broken'>2 broken</b>" in report
    assert "planted.never_c.scenario.yaml" in report
    assert "src=" not in report, "it needs nothing else"
    for name in ("never_c", "b_comes"):
        scenario = tmp_path / f"planted.{name}.scenario.yaml"
        assert main(["test", str(scenario)]) == 1
        assert f"violated: {name}" in capsys.readouterr().out
    mended = PLANTED.replace("within: 5 s", "within: 20 s").replace("on_error: C", "on_error: B")
    mission.write_text(mended.replace("  C: {after: {1 s: done}}\n", "").replace("in_state('C')", "false"))
    for name in ("never_c", "b_comes"):
        assert main(["test", str(tmp_path / f"planted.{name}.scenario.yaml")]) == 0
