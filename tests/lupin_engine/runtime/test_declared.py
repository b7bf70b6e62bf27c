"""What a plugin tells against its declaration, before a mission sees it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from lupin_engine.machine.machine import Machine
from lupin_engine.machine.scope import World
from lupin_engine.machine.step import Step
from lupin_engine.plugin.contract import EventKind, Operation
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import NUMBER, POSE, TEXT, Notation, Type, list_of, problems
from lupin_engine.runtime.clock import VirtualClock
from lupin_engine.runtime.engine import Engine, EngineOutlet
from tests.lupin_engine.machine.charts import chart
from tests.lupin_engine.runtime.test_runtime import Server

SENSOR = Type("record", "sensor", fields={"name": TEXT, "value": NUMBER})
CATALOG = Catalog(
    operations={"nav.go": Operation("drive", result={"pose": POSE, "seen": list_of(SENSOR)})},
    events={"nav.bump": EventKind("something was hit", {"force": NUMBER})},
)
#: The first name that a machine gives.
ATTEMPT = "a2"
HERE = {"x": 1.0, "y": 2, "yaw": 0.0}
STATES: dict[str, Any] = {
    "A": {"invoke": {"do": "nav.go"}, "on_done": "B", "on_error": "C", "on": {"nav.bump": "D"}},
    "B": {},
    "C": {},
    "D": {},
}


def outlet() -> tuple[EngineOutlet, Machine, list[Step]]:
    """Return where the driver of the catalog reports, while the first attempt is under way."""
    steps: list[Step] = []
    machine = Machine(World(replace(chart(STATES), catalog=CATALOG), {}, {}, {}))
    engine = Engine(machine, VirtualClock(), {"nav": Server()}, steps.append)
    engine.start()
    found = EngineOutlet(engine, engine.drain)
    found.accepted(ATTEMPT)
    return found, machine, steps


@pytest.mark.parametrize(
    ("result", "why"),
    [
        ({"pose": {**HERE, "x": math.nan}, "seen": []}, "pose.x: expected length, got nan"),
        ({"pose": {"x": 1.0}, "seen": []}, "pose: y and yaw of pose left out"),
        ({"pose": HERE, "seen": [{"name": "co2", "value": "a"}]}, "seen[0].value: expected number, got 'a'"),
        ({"pose": HERE, "seen": [{"name": "co2"}]}, "seen[0]: value of sensor left out"),
        ({"pose": HERE, "seen": None}, "seen: expected list of sensor, got None"),
        ({"pose": HERE}, "seen: left out"),
        (None, "fields are expected, got NoneType"),
    ],
)
def test_a_result_that_is_not_the_declared_one_fails_its_attempt(result: Any, why: str) -> None:
    """Nobody works with it, and nobody waits for an end that was told already."""
    driver, machine, steps = outlet()
    driver.done(ATTEMPT, result)
    detail = f"nav.go answered what it does not declare: {why}"
    assert steps[-1].event.data == {"attempt": ATTEMPT, "code": "driver_error", "detail": detail}
    assert machine.view.lifecycle == "C"


def test_a_result_as_declared_is_taken_in_as_it_is() -> None:
    """Also with fields that nobody declared; and what comes late is the machine's matter."""
    driver, machine, steps = outlet()
    result = {"pose": {**HERE, "frame": "map"}, "seen": (), "more": math.nan}
    driver.done(ATTEMPT, result)
    assert steps[-1].event.data == {"attempt": ATTEMPT, "result": result}
    assert machine.view.lifecycle == "B"
    driver.done(ATTEMPT, {})
    assert steps[-1].notes == (f"dropped: done of attempt {ATTEMPT}, which nobody waits for",)


@pytest.mark.parametrize(
    ("data", "why"),
    [
        ({"force": math.inf}, "force: expected number, got inf"),
        ({"force": "2 kN"}, "force: expected number, got '2 kN'"),
        ({}, "force: left out"),
        (5, "fields are expected, got int"),
    ],
)
def test_an_event_that_is_not_the_declared_one_is_not_taken_in(data: Any, why: str) -> None:
    """It is there to be found in the record."""
    driver, machine, steps = outlet()
    driver.event("nav.bump", data)
    assert (steps[-1].event.name, steps[-1].event.data) == (
        "driver.failed",
        {"command": "nav.bump", "detail": why},
    )
    assert machine.view.lifecycle == "A"
    driver.event("nav.bump", {"force": 3})
    assert machine.view.lifecycle == "D"


def test_a_quantity_in_text_is_for_files_only() -> None:
    """Missions would calculate with the text."""
    assert (
        problems("60 s", Type("number", "duration", unit="s"), Notation.DATA)[0].at()
        == "expected duration, got '60 s'"
    )


def test_what_is_told_of_a_long_value_is_short() -> None:
    """It stands in the mission's state, on a wire."""
    assert problems("x" * 1000, NUMBER, Notation.DATA)[0].at() == f"expected number, got '{'x' * 98}..."
