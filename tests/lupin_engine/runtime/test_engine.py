"""The loop ends its turn, whatever a mission does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from lupin_engine.machine.event import Event
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.step import Step
from lupin_engine.runtime import engine as loop
from lupin_engine.runtime.clock import VirtualClock
from lupin_engine.runtime.engine import Engine
from lupin_engine.runtime.setup import make_world
from tests.lupin_engine.machine.charts import chart

#: An operator sends it into a circle without time.
TIMERS: dict[str, Any] = {
    "START": {"on": {"operator.dock": "X"}},
    "X": {"after": {0.0: "Y"}},
    "Y": {"after": {0.0: "X"}},
    "FAULT": {},
}
#: Tries for ever what fails in the call that begins it.
TRIES: dict[str, Any] = {
    "START": {"on": {"operator.dock": "TRY"}},
    "TRY": {"invoke": "nav.go", "on_done": "START", "on_error": "TRY"},
    "FAULT": {},
}


class Broken:
    """A driver that cannot begin anything."""

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Fail."""
        raise OSError("no such device")

    def cancel(self, attempt: str) -> None:
        """Nothing is under way."""

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Do nothing."""


def sent(states: dict[str, Any]) -> tuple[Engine, list[Step]]:
    """Return an engine that was sent into the circle of a chart, and its steps."""
    steps: list[Step] = []
    clock = VirtualClock()
    engine = Engine(Machine(make_world(chart(states), {})), clock, {"nav": Broken()}, steps.append)
    engine.start()
    engine.request(Event("operator.dock"))
    return engine, steps


@pytest.mark.parametrize(
    ("states", "circle"),
    [
        (TIMERS, "Y, X are entered over and over"),
        (TRIES, "nav.go begin and end over and over"),
    ],
)
def test_a_circle_without_time_leads_to_fault(
    states: dict[str, Any], circle: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As an error of execution does, with a code and what goes round; the loop then has nothing to do."""
    monkeypatch.setattr(loop, "MOST_AT_ONCE", 500)
    engine, steps = sent(states)
    assert engine.machine.memory.configuration[-1] == "FAULT"
    told = (
        f"time stands still: more than 500 things happen at one moment; {circle},"
        " so let one of them take time"
    )
    assert [(code.code, code.detail) for code in steps[-1].codes] == [("execution_error", told)]
    engine.drain()
    assert engine.next_deadline is None
    assert len(steps) < 510


def test_a_circle_in_fault_gives_others_their_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    """There is nowhere else to go; so it is told, and whoever owns the loop can do other things meanwhile."""
    monkeypatch.setattr(loop, "MOST_AT_ONCE", 500)
    circle = {"initial": "X", "states": {"X": {"after": {0.0: "FAULT.Y"}}, "Y": {"after": {0.0: "FAULT.X"}}}}
    engine, steps = sent({"START": {"on": {"operator.dock": "FAULT"}}, "FAULT": circle})
    assert len(steps) < 510
    assert engine.next_deadline == 0.0
    assert any("time stands still" in note for note in steps[-1].notes)
    engine.drain()
    assert len(steps) > 1000
