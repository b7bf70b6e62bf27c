"""The calibration's chart and what it reckons; its service is tested with the fakes of tests/lupin_ros."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

import lupin_arm.calibration
from lupin_arm.calibration.offsets import HIGHEST, HOMES, SMALL, corrections, refusals, to_write
from lupin_cli.verbs.diagram import diagram
from lupin_engine.missions.load import check_chart
from lupin_engine.replay.coverage import (
    GUARDS,
    OUTCOMES,
    STATES,
    TRANSITIONS,
    Coverage,
    CoverageObserver,
    add_up,
)
from lupin_engine.sim.scenario import scenario_files
from lupin_engine.sim.suite import Suite
from tests import shipped

ROOT = Path(__file__).parents[3]
FOLDER = Path(lupin_arm.calibration.__file__).parent
SCENARIOS = Path(__file__).with_name("calibration")


def moved(**by: int) -> dict[str, int]:
    """Return where the servos stand, some of them off by so many counts."""
    return {joint: home + by.get(joint, 0) for joint, home in HOMES.items()}


NONE = dict.fromkeys(HOMES, 0)


@cache
def coverage() -> Coverage:
    """Run every scenario of the chart."""
    suite = Suite(shipped.catalog(), CoverageObserver())
    return add_up([suite.run(file) for file in scenario_files([SCENARIOS])], suite.missions)


def test_the_chart_has_no_findings() -> None:
    """Neither errors nor warnings, with the installed plugins."""
    chart, found = check_chart(FOLDER / "lifecycle.yaml", [FOLDER / "calibration.yaml"], shipped.catalog())
    assert found == ()
    assert chart is not None


@pytest.mark.parametrize("file", scenario_files([SCENARIOS]), ids=lambda file: file.name.partition(".")[0])
def test_a_scenario_holds(file: Path) -> None:
    """What the table of actions says, and what happens when servos do not answer."""
    result = Suite(shipped.catalog()).run(file)
    assert result.holds, result


@pytest.mark.parametrize("kind", [STATES, TRANSITIONS, OUTCOMES, GUARDS])
def test_the_scenarios_reach_everything(kind: str) -> None:
    """Every state, transition, end of an operation, and both sides of every guard."""
    parts = coverage().parts
    assert {part.title for part in parts} == {"lifecycle", "calibration"}
    tallies = [tally for part in parts for tally in part.tallies() if tally.kind == kind]
    missing = [f"{piece.place}: {piece.text}" for tally in tallies for piece in tally.missing]
    assert tallies
    assert missing == []


def test_the_servos_homes_are_those_of_the_robot() -> None:
    """What was measured there; a count more is a hundredth of a degree."""
    assert dict(HOMES) == {"shoulder_lift": 11450, "elbow": 11750, "wrist": 12200, "gripper": 10524}


def test_a_servo_gets_what_it_is_off_and_what_it_has() -> None:
    """Counts and offsets are hundredths of a degree both, so they add up."""
    found = corrections(moved(elbow=-700, wrist=500), {**NONE, "wrist": 300}, HIGHEST)
    by_joint = {one.joint: one for one in found}
    assert list(by_joint) == ["shoulder_lift", "elbow", "wrist", "gripper"]
    assert (by_joint["elbow"].difference, by_joint["wrist"].difference) == (-700, 800)
    assert to_write(found, NONE) == {"elbow": -700, "wrist": 800}
    assert refusals(found) == ""


@pytest.mark.parametrize(("off", "in_place"), [(200, True), (-200, True), (201, False), (-201, False)])
def test_two_degrees_are_not_worth_writing(off: int, in_place: bool) -> None:
    """As far as the sum goes, not the difference."""
    (one, *_) = corrections(moved(shoulder_lift=off), NONE, HIGHEST)
    assert one.in_place is in_place
    assert bool(to_write([one], NONE)) is not in_place


@pytest.mark.parametrize(("off", "refused"), [(3000, False), (-3000, False), (3001, True), (-3001, True)])
def test_an_offset_has_a_unit_and_a_limit(off: int, refused: bool) -> None:
    """War story A31: 125 steps of 24 hundredths of a degree are 30 degrees, and the limit says so."""
    (one, *_) = corrections(moved(shoulder_lift=off), NONE, HIGHEST)
    assert math.degrees(HIGHEST) == pytest.approx(30.0)
    assert bool(one.refused) is refused
    if refused:
        wrong = f"it is off by {off / 100:.1f} deg, more than 30.0 deg: mount its horn anew"
        assert refusals([one]) == f"shoulder_lift: {wrong}"


def test_a_lower_limit_may_be_set_and_no_higher_one() -> None:
    """A servo holds no more than its steps."""
    (one, *_) = corrections(moved(shoulder_lift=800), NONE, math.radians(7.2))
    assert one.refused == "it is off by 8.0 deg, more than 7.2 deg: mount its horn anew"
    (one, *_) = corrections(moved(shoulder_lift=3500), NONE, math.radians(90.0))
    assert "more than 30.0 deg" in one.refused


def test_a_servo_that_stays_uncorrected_gets_its_offset_back() -> None:
    """Hazard of section 7: its offset stayed zero."""
    found = corrections(moved(elbow=5000), {joint: 0 for joint in HOMES if joint != "wrist"}, HIGHEST)
    before = dict.fromkeys(HOMES, 240)
    assert to_write(found, before) == {"elbow": 240, "wrist": 240}
    assert [one.split(":")[0] for one in refusals(found).split("; ")] == ["elbow", "wrist"]


@given(
    st.fixed_dictionaries({joint: st.integers(0, 25_000) for joint in HOMES}),
    st.dictionaries(st.sampled_from(list(HOMES)), st.integers(-3000, 3000)),
    st.floats(0.0, 10.0),
)
def test_what_is_written_is_what_a_servo_can_hold(
    counts: dict[str, int], offsets: dict[str, int], largest: float
) -> None:
    """Whatever the servos say, and every servo is corrected, in place, or refused with a reason."""
    found = corrections(counts, offsets, largest)
    assert [one.joint for one in found] == list(HOMES)
    written = to_write(found, {})
    for one in found:
        assert not (one.in_place and one.refused)
        assert not one.in_place or abs(one.difference) <= SMALL
        assert (one.joint in written) is not one.in_place
    assert all(abs(offset) <= 3000 for offset in written.values())


def test_the_picture_of_the_documentation_is_that_of_the_chart(tmp_path: Path) -> None:
    """A picture that is out of date is worse than none."""
    kept, drawn = ROOT / "docs" / "img" / "arm_calibration.svg", tmp_path / "drawn.svg"
    chart = FOLDER / "calibration.yaml"
    assert CliRunner().invoke(diagram, [str(chart), "-o", str(drawn)]).exit_code == 0
    if not kept.is_file() or kept.read_bytes() != drawn.read_bytes():
        command = f"lupin diagram {chart.relative_to(ROOT)} -o {kept.relative_to(ROOT)}"
        pytest.fail(f"docs/img/arm_calibration.svg is out of date; run: {command}", pytrace=False)


def test_authors_of_missions_are_not_offered_what_only_this_chart_may_do() -> None:
    """A mission that released the servos would find nobody to do it."""
    catalog = shipped.catalog()
    assert "calibration.release" in catalog.operations
    offered = catalog.for_missions
    assert "nav.go_to" in offered.operations
    names = [*offered.operations, *offered.values, *offered.types]
    assert not any(name.startswith(("calibration", "servo_offset", "correction")) for name in names)
    assert offered.for_missions is offered
