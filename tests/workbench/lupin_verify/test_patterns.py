"""Specification patterns as properties: a mission that keeps each, and one with a defect that breaks it."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_cli.main import main

#: Localizes, drives to the door and to the window, and looks around there.
ROUND = """\
mission: Round
properties:
  tour: {TOUR}
initial: LOCALIZING
states:
  LOCALIZING:
    invoke: {do: nav.localize, with: {max_variance: 1}, timeout: {after: 10 s, code: nav_timeout}}
    on_done: DOOR
    on_error: FAULT
  DOOR:
    invoke: &drive
      do: nav.go_to
      with: {pose: "${ home }", max_variance: 1}
      timeout: {after: 60 s, code: nav_timeout}
    on_done: WINDOW
    on_error: FAULT
  WINDOW:
    invoke: *drive
    on_done: LOOKING
    on_error: FAULT
    on: {operator.skip_current: LOOKING}
  LOOKING: {after: {2 s: done}}
  done: {type: final}
"""

#: Pattern -> the property, what a defect replaces in the mission, and what the breach is then.
PATTERNS = {
    "visit all": (
        "visit_all: [in_state('WINDOW'), in_state('DOOR')]",
        ("on_done: WINDOW\n    on_error: FAULT", "on_done: WINDOW\n    on_error: LOOKING"),
        "the mission is done, but in_state('WINDOW') never became true",
    ),
    "visit in order": (
        "visit_in_order: [in_state('DOOR'), in_state('WINDOW'), in_state('LOOKING')]",
        ("on_done: WINDOW\n    on_error: FAULT", "on_done: WINDOW\n    on_error: LOOKING"),
        "in_state('LOOKING') became true, but in_state('WINDOW') had not yet",
    ),
    "never before": (
        "never: in_state('DOOR') or in_state('WINDOW'), until: \"'nav.localize' in this_step.succeeded\"",
        ("on_error: FAULT\n  DOOR", "on_error: DOOR\n  DOOR"),
        "in_state('DOOR') or in_state('WINDOW') became true; it must never be",
    ),
    "avoid until": (
        "never: in_state('LOOKING'), until: in_state('WINDOW')",
        ("on_done: WINDOW\n    on_error: FAULT", "on_done: WINDOW\n    on_error: LOOKING"),
        "in_state('LOOKING') became true; it must never be",
    ),
    "between": (
        "never: in_state('DOOR'), after: in_state('WINDOW'), until: not in_state('Round')",
        ("skip_current: LOOKING", "skip_current: DOOR"),
        "in_state('DOOR') became true; it must never be",
    ),
    "response within": (
        "eventually: not in_state('LOOKING'), within: 3 s, after: in_state('LOOKING'),"
        " until: held(pause) or held(estop)",
        ("2 s: done", "4 s: done"),
        "not in_state('LOOKING') did not become true within 3 s",
    ),
}


@pytest.fixture
def mission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file of the round, in the current folder; the shipped lifecycle stands around it."""
    monkeypatch.chdir(tmp_path)
    return Path("round.yaml")


def written(tour: str, defect: tuple[str, str] | None = None) -> str:
    """Return the round with a property, and with a defect."""
    assert defect is None or ROUND.count(defect[0]) == 1
    text = ROUND if defect is None else ROUND.replace(*defect)
    return text.replace("{TOUR}", f"{{{tour}}}")


PROVE = ["prove", "round.yaml", "--targets", "0", "--no-restarts"]


@pytest.mark.proof
@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_pattern_that_is_kept_holds(
    pattern: str, mission: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In every situation, and it applies to some; nothing else is broken either."""
    mission.write_text(written(PATTERNS[pattern][0]), encoding="utf-8")
    assert main(PROVE) == 0
    (said,) = [line for line in capsys.readouterr().out.splitlines() if " tour: " in line]
    assert said.startswith("  ✓ tour: ")


@pytest.mark.proof
@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_defect_breaks_its_pattern(pattern: str, mission: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With the shortest way to it as a scenario, which fails until the mission is mended."""
    tour, defect, breach = PATTERNS[pattern]
    mission.write_text(written(tour, defect), encoding="utf-8")
    assert main([*PROVE, "--quiet"]) == 1
    assert f"\n      property tour (line 3): {breach}\n" in capsys.readouterr().out
    assert main(["test", "round.tour.scenario.yaml"]) == 1
    assert "violated: tour\n" in capsys.readouterr().out
    mission.write_text(written(tour), encoding="utf-8")
    assert main(["test", "round.tour.scenario.yaml"]) == 0
