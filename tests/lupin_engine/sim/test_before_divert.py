"""A divert of the lifecycle waits until a state is finished, or left in order."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart.model import Chart
from lupin_engine.diagram.mermaid import mermaid
from lupin_engine.diagram.outline import outline
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.missions.load import check_chart, load_chart
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim.scripted import MockOutcome, Rule
from lupin_engine.sim.simulation import Ask, Happening, Restart, Run, Script, SetValue, simulate
from lupin_verify.proof import ProofVerdict, prove
from lupin_verify.situations.explorer import Bounds
from tests import shipped

LIFECYCLE = default_missions_folder() / "lifecycle.yaml"
#: Ten seconds in a lift; then the robot puts down what it carries, which takes another five.
MISSION = """\
mission: Deliver
initial: RIDE
states:
  RIDE:
    before_divert: 30 s
    invoke: {do: nav.go_to, with: {pose: "${ home }"}, timeout: {after: 90 s, code: nav_timeout}}
    on_done: CARRY
    on_error: FAULT
  CARRY:
    before_divert: {leave_by: PUT_DOWN, within: 8 s}
    initial: WALK
    on_done: done
    states:
      WALK: {after: {20 s: HAND_OVER}}
      HAND_OVER: {after: {1 s: over}}
      PUT_DOWN: {after: {5 s: REST}}
      over: {type: final}
  REST: {after: {60 s: CARRY}}
  done: {type: final}
"""
RIDING = Rule("nav.go_to", (MockOutcome(after=10.0),))
ABORT, DOCK, PAUSE, RESUME = (Ask(f"operator.{word}") for word in ("abort", "dock", "pause", "resume"))
LOW, PRESSED, OUT = (
    SetValue("robot.battery", 0.1),
    SetValue("robot.estop", True),
    SetValue("robot.estop", False),
)


def chart(folder: Path, text: str = MISSION) -> Chart:
    """Load a mission in the slot of the shipped lifecycle."""
    (folder / "deliver.yaml").write_text(text, "utf-8")
    return load_chart(LIFECYCLE, [folder / "deliver.yaml"], shipped.catalog())


def run(folder: Path, *happenings: tuple[str, float, Any], rules: tuple[Rule, ...] = (RIDING,)) -> Run:
    """Simulate a delivery to which something happens, so many seconds after a state is entered."""
    found = tuple(Happening(effect, after, state) for state, after, effect in happenings)
    made = simulate(chart(folder), Script("Deliver", rules=rules, happenings=found, limit=300.0))
    assert made.violated == ()
    return made


def story(made: Run) -> list[tuple[float, str]]:
    """Return when the robot came to the states after PREPARE, and what was refused."""
    found = []
    for step in made.steps:
        found += [(round(step.time, 1), name.rpartition(".")[2]) for name in step.entered if "." in name]
        if step.refusal is not None:
            found.append((round(step.time, 1), step.refusal.text))
    return [one for one in found if one[1] not in ("Deliver", "CARRY")]


def test_without_a_divert_nothing_is_different(tmp_path: Path) -> None:
    made = run(tmp_path)
    assert story(made) == [
        (0.0, "RIDE"),
        (10.0, "WALK"),
        (30.0, "HAND_OVER"),
        (31.0, "over"),
        (31.0, "done"),
        (31.0, "DRIVING_HOME"),
    ]


@pytest.mark.parametrize("divert", [ABORT, DOCK, LOW], ids=["abort", "dock", "low battery"])
def test_a_state_is_finished_and_then_left_in_order(divert: Any, tmp_path: Path) -> None:
    """The divert waits for the lift, then for the box; its code comes when it is taken."""
    made = run(tmp_path, ("RIDE", 4.0, divert))
    assert story(made)[1:5] == [(10.0, "WALK"), (10.0, "PUT_DOWN"), (15.0, "REST"), (15.0, "DRIVING_HOME")]
    assert made.view.lifecycle == ("DONE" if divert is ABORT else "RETURNING")
    codes = [(step.time, code.code) for step in made.steps for code in step.codes]
    assert codes[0] == (4.0, "divert_waits")
    assert made.context["divert"] == ""


def test_the_time_bounds_the_wait(tmp_path: Path) -> None:
    """A lift that is stuck is left after its thirty seconds, also by a divert that comes later."""
    stuck = Rule("nav.go_to", (MockOutcome(after=80.0),))
    assert story(run(tmp_path, ("RIDE", 4.0, ABORT), rules=(stuck,)))[1] == (30.0, "DRIVING_HOME")
    assert story(run(tmp_path, ("RIDE", 50.0, ABORT), rules=(stuck,)))[1] == (50.0, "DRIVING_HOME")


def test_the_last_request_counts(tmp_path: Path) -> None:
    """The same one again is refused; a level never takes the place of a request."""
    made = run(tmp_path, ("RIDE", 2.0, DOCK), ("RIDE", 3.0, ABORT), ("RIDE", 4.0, ABORT), ("RIDE", 5.0, LOW))
    assert (4.0, "abort refused: what has begun is finished first") in story(made)
    assert [code.code for step in made.steps for code in step.codes if step.time == 15.0] == [
        "mission_aborted",
        "battery_low",
    ]
    assert made.view.lifecycle == "DONE"


def test_a_stop_holds_at_once_and_its_time_does_not_count(tmp_path: Path) -> None:
    """Who aborts during the stop is answered; what was begun is finished after the release."""
    made = run(
        tmp_path, ("WALK", 1.0, PRESSED), ("WALK", 2.0, ABORT), ("WALK", 100.0, OUT), ("WALK", 101.0, RESUME)
    )
    assert story(made)[2:] == [(111.0, "PUT_DOWN"), (116.0, "REST"), (116.0, "DRIVING_HOME")]
    assert made.view.lifecycle == "DONE"


def test_a_pause_ends_for_what_is_finished_first(tmp_path: Path) -> None:
    """As without: a divert releases a pause. One that comes later holds the robot, as ever."""
    made = run(tmp_path, ("RIDE", 2.0, PAUSE), ("RIDE", 5.0, ABORT))
    assert story(made)[1] == (15.0, "WALK")
    made = run(tmp_path, ("WALK", 2.0, ABORT), ("PUT_DOWN", 1.0, PAUSE), ("PUT_DOWN", 41.0, RESUME))
    assert (57.0, "DRIVING_HOME") in story(made)


def test_a_restart_forgets_no_divert(tmp_path: Path) -> None:
    made = run(tmp_path, ("WALK", 2.0, ABORT), ("PUT_DOWN", 1.0, Restart(2.0)), ("PUT_DOWN", 10.0, RESUME))
    assert (made.view.lifecycle, [name for _, name in story(made)][-2:]) == ("DONE", ["REST", "DRIVING_HOME"])


def test_what_needs_no_event_does_not_come_before_the_divert(tmp_path: Path) -> None:
    """The state after the last one that is waited for leads back at once: the divert comes all the same."""
    text = MISSION.replace("REST: {after: {60 s: CARRY}}", "REST: {always: CARRY}")
    script = Script("Deliver", rules=(RIDING,), happenings=(Happening(ABORT, 1.0, "WALK"),), limit=300.0)
    made = simulate(chart(tmp_path, text), script)
    assert (made.view.lifecycle, made.violated) == ("DONE", ())
    assert [name for _, name in story(made)][-2:] == ["REST", "DRIVING_HOME"]


def test_an_error_leads_out_at_once(tmp_path: Path) -> None:
    fails = Rule("nav.go_to", (MockOutcome(after=5.0, code="nav_failed"),))
    made = run(tmp_path, ("RIDE", 2.0, ABORT), rules=(fails,))
    assert (made.view.lifecycle, made.context["divert"]) == ("FAULT", "")


def test_the_picture_shows_what_is_written(tmp_path: Path) -> None:
    """No guard, no arrow and no action that only the engine has."""
    drawn = mermaid(outline(chart(tmp_path)))
    assert "divert_due" not in drawn
    assert "before a divert: within 30 s" in drawn
    assert "before a divert: PUT_DOWN, within 8 s" in drawn


WRONG = [
    "2:11 context.divert: the variable 'divert' is that of 'before_divert'; rename yours",
    "6:31 MISSION.Wrong.A.before_divert: MISSION.Wrong.A has no state 'NOWHERE'; allowed: 'B', 'C'",
    "6:48 MISSION.Wrong.A.before_divert.within: expected duration (s), got 'soon'; its units are 'ms', 's', "
    "'min', 'h'",
    "9:11 MISSION.Wrong.A.B.before_divert: 'MISSION.Wrong.A' is active at the same time, and a divert waits "
    "for it already; let one of them have it",
]


def test_what_is_wrong_is_told(tmp_path: Path) -> None:
    text = """\
mission: Wrong
context: {divert: {type: text, default: ""}}
initial: A
states:
  A:
    before_divert: {leave_by: NOWHERE, within: soon}
    initial: B
    states:
      B: {before_divert: 10 s, after: {5 s: C}}
      C: {after: {5 s: done}}
  done: {type: final}
"""
    (tmp_path / "wrong.yaml").write_text(text, "utf-8")
    _, found = check_chart(LIFECYCLE, [tmp_path / "wrong.yaml"], shipped.catalog())
    assert [f"{one.place.line}:{one.place.column} {one.message}" for one in found] == WRONG
    lifecycle = tmp_path / "lifecycle.yaml"
    shipped_one = LIFECYCLE.read_text("utf-8")
    lifecycle.write_text(
        shipped_one.replace("  RETURNING:\n", "  RETURNING:\n    before_divert: 5 s\n"), "utf-8"
    )
    (tmp_path / "deliver.yaml").write_text(MISSION, "utf-8")
    _, found = check_chart(lifecycle, [tmp_path / "deliver.yaml"], shipped.catalog())
    assert [one.message for one in found] == [
        "RETURNING.before_divert: only a state of a mission is left by a divert; "
        "move it into a state of the mission"
    ]


def test_a_proof_looks_whether_the_divert_comes(tmp_path: Path) -> None:
    """Two states that lead to each other let it wait for ever."""
    rest = "REST: {after: {60 s: CARRY}}"
    round_about = MISSION.replace(rest, "REST: {before_divert: 10 s, after: {5 s: CARRY}}")
    for text, verdict in ((MISSION, ProofVerdict.HOLDS), (round_about, ProofVerdict.BROKEN)):
        world = make_world(chart(tmp_path, text), {})
        proof = prove(world, Bounds(targets=0, restarts=False))
        verdicts = {one.name: one.verdict for one in proof.properties}
        assert verdicts["divert_that_waits_comes"] is verdict
