"""The fold of steps, live and read back from their records."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import pytest

from lupin_engine.runtime.history import History
from lupin_engine.runtime.record import read_step, step_record
from lupin_engine.sim.scenario import Missions, load_scenario, scenario_files
from tests import shipped

SCENARIOS = Path(__file__).parents[2] / "scenarios"
MISSIONS = Missions(shipped.catalog())

START = {
    "command": "start",
    "attempt": "a1",
    "operation": "nav.go_to",
    "arguments": {},
    "state": "S",
    "tries": 2,
}
CANCEL = {"command": "cancel", "attempt": "a1", "operation": "nav.go_to"}


def told(*steps: tuple[str, list[dict[str, object]]]) -> History:
    """The history of steps, one a second, about the attempt a1."""
    records = [
        {"time": float(second), "event": event, "commands": commands, "data": _data(event)}
        for second, (event, commands) in enumerate(steps)
    ]
    return History(map(read_step, records))


def _data(event: str) -> dict[str, object]:
    if event.startswith("timer."):
        return {"owner": "a1"}
    return {"attempt": "a1", "detail": "half way", "code": "nav_rejected", "result": {"x": 1}}


@pytest.mark.parametrize("file", scenario_files([SCENARIOS / "inspection"])[::4], ids=lambda file: file.stem)
def test_records_give_the_same_history(file: Path) -> None:
    """Through JSON and back nothing is lost that the fold reads."""
    run = load_scenario(file, MISSIONS.catalog, MISSIONS).run()
    records = [json.loads(json.dumps(step_record(step))) for step in run.steps]
    again = History(map(read_step, records))
    assert again.attempts == run.history.attempts
    assert [(step.time, publish) for step, publish in again.published] == [
        (step.time, publish) for step, publish in run.history.published
    ]
    assert [(step.sequence, name) for step, name in again.entered] == [
        (step.sequence, name) for step, name in run.history.entered
    ]
    assert len(again.refused) == len(run.history.refused)


def test_of_a_record_that_is_none_the_first_wrong_part_is_named() -> None:
    """In the order in which a step is told."""
    with pytest.raises(ValueError, match=r"^time$"):
        read_step({"event": "x", "time": "soon", "sequence": "first"})


def test_an_attempt_from_its_start_to_its_end() -> None:
    history = told(
        ("x", [START]), ("attempt.accepted", []), ("attempt.progress", []), ("attempt.failed", []), ("x", [])
    )
    (attempt,) = history.attempts.values()
    assert (attempt.operation, attempt.state, attempt.tries) == ("nav.go_to", "S", 2)
    assert (attempt.started, attempt.accepted, attempt.progress, attempt.over) == (0.0, 1.0, "half way", 3.0)
    assert (attempt.outcome, attempt.detail, attempt.late) == ("failed", "nav_rejected half way", False)


def test_after_its_end_nothing_counts() -> None:
    """A server that says more is not heard."""
    (attempt,) = told(("x", [START]), ("attempt.done", []), ("attempt.failed", [])).attempts.values()
    assert (attempt.outcome, attempt.over, attempt.data["result"]) == ("done", 1.0, {"x": 1})


def test_a_cancel_that_nobody_confirms_ends_the_attempt_for_the_machine_only() -> None:
    """What the server says afterwards is kept, and known to be late."""
    steps = [("x", [START]), ("timer.timeout", [CANCEL]), ("timer.cancel", [])]
    (attempt,) = told(*steps).attempts.values()
    assert (attempt.cancelled, attempt.abandoned, attempt.ended) == (1.0, 2.0, None)
    assert (attempt.outcome, attempt.detail, attempt.over) == ("timed out", "", 2.0)
    (attempt,) = told(*steps, ("attempt.done", [])).attempts.values()
    assert (attempt.answer, attempt.late, attempt.over, attempt.ended) == ("done", True, 2.0, 3.0)


def test_what_is_under_way_is_open() -> None:
    """As long as nobody has said anything else; what is said of a stranger changes nothing."""
    history = told(("attempt.done", []), ("timer.cancel", []), ("x", [CANCEL]), ("x", [START]))
    (attempt,) = history.attempts.values()
    assert (attempt.outcome, attempt.over, attempt.cancelled, attempt.late) == ("open", None, None, False)


def test_holds_and_broken_invariants_are_known_by_when_they_appear() -> None:
    """Holds after each step are compared with those before; a step itself says which invariants broke."""
    history = History()
    for second, (held, broken) in enumerate([((), []), (("a",), ["i"]), (("a", "b"), []), (("b",), [])]):
        history.take(read_step({"time": second, "event": "x", "sequence": second, "broken": broken}), held)
    assert history.held == [(1.0, ("a",)), (2.0, ("a", "b")), (3.0, ("b",))]
    assert [(step.sequence, name) for step, name in history.holds] == [(1, "a"), (2, "b")]
    assert [(step.sequence, name) for step, name in history.broken] == [(1, "i")]


def test_lifecycles_and_phases_come_from_the_trail() -> None:
    """Also those that a step only passes; each is named when it changes."""
    run = load_scenario(
        SCENARIOS / "inspection" / "three_tags.scenario.yaml", MISSIONS.catalog, MISSIONS
    ).run()
    assert run.history.lifecycles == ["BOOT", "READY", "PREPARE", "INSPECTING", "RETURNING", "DONE"]
    phases = [phase for _, phase in run.history.phases]
    assert all(one != other for one, other in itertools.pairwise(phases))
    assert phases.count("NAVIGATING") == 3
