"""What a lifecycle brings for every mission: named, listed, and not meant where a mission says why."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.chart.compose.timeless import BUILT_IN_NAMES
from lupin_engine.errors import Severity
from lupin_engine.missions.load import check_chart
from lupin_engine.properties.authored import properties_of
from lupin_engine.properties.inherited import INHERITED
from lupin_engine.sim.scenario import load_scenario
from lupin_verify.proof import listed
from lupin_verify.situations.graph import NAMED_OF_THE_GRAPH
from tests import shipped

ROOT = Path(__file__).parents[3]
LIFECYCLE = ROOT / "missions" / "lifecycle.yaml"
MISSION = """\
mission: Stand
{more}
states:
  STANDING: {{after: {{1 s: done}}}}
  done: {{type: final}}
"""


def test_the_checker_knows_their_names() -> None:
    """Though it stands below what watches them."""
    assert {*INHERITED, *(one.name for one in NAMED_OF_THE_GRAPH)} == BUILT_IN_NAMES


def checked(folder: Path, more: str) -> tuple[list[str], list[str]]:
    """Return the errors of a mission, and the reasons why inherited properties are not meant of it."""
    file = folder / "stand.yaml"
    file.write_text(MISSION.format(more=more), encoding="utf-8")
    chart, told = check_chart(LIFECYCLE, [file], shipped.catalog())
    errors = [str(one).partition("stand.yaml:")[2] for one in told if one.severity is Severity.ERROR]
    reasons = (
        [] if chart is None else [*{why for p in chart.properties.values() for why in p.not_meant.values()}]
    )
    return errors, reasons


def test_a_mission_says_what_is_not_meant(tmp_path: Path) -> None:
    """With a reason; it is not watched in its runs then."""
    errors, reasons = checked(
        tmp_path, "not_meant: {abort_ends_the_mission: the crate is brought back first}"
    )
    assert (errors, reasons) == ([], ["the crate is brought back first"])


WRONG = {
    "not_meant: {abort_ends_the_misson: it stands}": "2:13: error: not_meant.abort_ends_the_misson: unknown"
    " inherited property 'abort_ends_the_misson'; did you mean 'abort_ends_the_mission'? [unknown-property]",
    "not_meant: {ends_at_home: }": "2:13: error: not_meant.ends_at_home: there is no reason why"
    " 'ends_at_home' is not meant; write 'ends_at_home: REASON' [missing-key]",
    "properties: {good_at_target: {built_in: true}}": "2:41: error: properties.good_at_target: unknown"
    " built-in property 'good_at_target'; did you mean 'good_at_its_target'? [unknown-property]",
    "properties: {p: {never: this_step.accepted == 'operator.abrot'}}": "abrot",
    "properties: {p: {never: was_in_state('STANDNG')}}": "STANDNG",
}


@pytest.mark.parametrize("more", WRONG)
def test_what_is_wrong_is_told(more: str, tmp_path: Path) -> None:
    """With its place, and the nearest name."""
    (error,) = checked(tmp_path, more)[0]
    assert WRONG[more] in error


def test_step_belongs_to_properties(tmp_path: Path) -> None:
    """A guard does not see it."""
    text = "on: {operator.skip_current: {refuse: x, guard: this_step.moving}}\ncodes: {x: {label: no}}"
    assert "there is no 'this_step' here: only a property is about steps" in checked(tmp_path, text)[0][0]


def test_all_are_listed_and_watched() -> None:
    """Each with its sentence and place; the page of proofs says how many the shipped lifecycle brings."""
    chart = shipped.mission("inspection")
    names = {name: place for name, says, place in listed(chart) if says}
    assert names.keys() >= chart.properties.keys()
    assert all(names[name] is not None for name in chart.properties)
    steps = {one.name for one in properties_of(chart)}
    assert chart.properties.keys() - steps == {one.name for one in NAMED_OF_THE_GRAPH}
    page = (ROOT / "docs" / "proof.md").read_text(encoding="utf-8")
    assert f"The greenhouse's lifecycle brings {len(chart.properties)}, such as" in page


#: Goes round twice; leaves the localization out where that is asked for.
ROUNDS = """\
mission: Rounds
request: {quickly: {type: bool, default: false}}
context: {laps: {type: count, default: 0}}
codes: {lost: {label: not localized}}
initial: STANDING
states:
  STANDING: {after: {1 s: [{target: ROUND, guard: request.quickly}, {target: LOCALIZING}]}}
  LOCALIZING:
    invoke: {do: nav.localize, with: {max_variance: 0.25}, timeout: {after: 15 s, code: lost}}
    on_done: ROUND
    on_error: FAULT
  ROUND: {entry: [{set: {laps: "${ laps + 1 }"}}], after: {1 s: LAST}}
  LAST: {after: {1 s: [{target: ROUND, guard: laps < 2}, {target: done}]}}
  done: {type: final}
"""
DOCKS = "[{on: ROUND, request: operator.dock}, {on: DOCKED, request: operator.resume}]"


@pytest.mark.parametrize(("quickly", "when"), [("true", "[]"), ("false", "[]"), ("false", DOCKS)])
def test_a_localization_is_left_out(quickly: str, when: str, tmp_path: Path) -> None:
    """What leads back after it is none of that, nor is a resume."""
    (tmp_path / "rounds.yaml").write_text(ROUNDS, encoding="utf-8")
    file, broken = tmp_path / "rounds.scenario.yaml", "[localized_as_asked]" if quickly == "true" else "[]"
    request = f"request: {{quickly: {quickly}}}\nwhen: {when}\nexpect: {{final: DONE, violated: {broken}}}\n"
    file.write_text(f"scenario: it goes round\nmission: rounds.yaml\n{request}", encoding="utf-8")
    scenario = load_scenario(file, shipped.catalog())
    assert scenario.failures(scenario.run()) == []
