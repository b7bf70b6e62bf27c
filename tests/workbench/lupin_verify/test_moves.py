"""Moves of an exploration are told as stories tell steps."""

from __future__ import annotations

import pytest

from lupin_engine.machine import event as events
from lupin_engine.machine.event import CLOCK, RELEASED, RESUMED, Event
from lupin_verify.situations.moves import move_text
from lupin_verify.situations.worlds import LOADED, OF_PROPERTY, Mover, WorldMove
from tests.workbench.lupin_verify.toys import round_trip

TOLD = [
    (events.done("A#0", {}), "A: nav.go done"),
    (events.done("C#1", {"value": 2.5, "seen": True}), "C: bridge.read done (value: 2.5, seen: true)"),
    (events.failed("A#0", "driver_error"), "A: nav.go failed: driver_error"),
    (events.accepted("A#0"), "A: nav.go accepted"),
    (events.done("long over", {}), "a server answers an attempt that ended long ago"),
    (events.observed("robot.battery", 0.31, 0.0), "robot.battery = 0.31"),
    (events.observed("robot.estop", True, 0.0), "robot.estop = true"),
    (Event(CLOCK, {"ahead": 0.0, "says": "2026-01-01 22:00"}), "the robot's clock says 2026-01-01 22:00"),
    (Event("operator.dock", {}), "operator.dock"),
    (Event("mission.start", {"mission_id": "proof", "tags": ["1", "2"]}), "mission.start (tags: [1, 2])"),
    (Event(RESUMED, {"away": 1.0}), "the process ends, and a new one continues"),
    (Event(RELEASED, {"hold": "restarted"}), "the resume policy ends the hold restarted"),
    (LOADED, "the missions are reloaded"),
]
DUE = [
    (("after", "B", "after.0"), "time is up in B"),
    (("after", "B", "every.0"), "a tick in B"),
    (("budget", "B", "budget"), "the budget is up in B"),
    (("at", "B", "at.0 2026-01-01 07:00"), "the time of day comes in B"),
    (("ask", "B", "answer.yes"), "nobody has answered in B"),
    (("retry", "i:A", ""), "A: next try of nav.go"),
    (("timeout", "A#0", ""), "A: nav.go timed out"),
    (("cancel", "A#1", ""), "A: nav.go does not confirm its cancel"),
    (("fresh", "battery", ""), "input.battery is too old"),
    ((OF_PROPERTY, "comes", ""), "the time of the property comes is over"),
]


@pytest.mark.parametrize(("event", "words"), TOLD, ids=[words for _, words in TOLD])
def test_what_happens(event: Event, words: str) -> None:
    """Answers with their operation, values, requests, restarts."""
    assert move_text(round_trip(), WorldMove(Mover.WORLD, event)) == words


@pytest.mark.parametrize(("timer", "words"), DUE, ids=[words for _, words in DUE])
def test_what_is_due(timer: tuple[str, str, str], words: str) -> None:
    """Deadlines with the state that they are of."""
    assert move_text(round_trip(), WorldMove(Mover.TIMER, timer=timer)) == words
