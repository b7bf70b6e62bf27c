"""Rebuilds the machine of a record, by applying its events to a new one at the recorded times."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from lupin_engine.machine.machine import Machine
from lupin_engine.machine.scope import World
from lupin_engine.machine.step import Step


def rebuilt(steps: Iterable[Step], world: World) -> tuple[Mapping[str, Any], list[Step]]:
    """Return the final variables of a rebuilt machine, and its steps.

    A record may lack reports that changed nothing then; in that case the steps may differ.
    """
    machine, found = Machine(world), []
    for step in steps:
        found += _happen(machine, step)
    return machine.memory.context, found


def _happen(machine: Machine, step: Step) -> list[Step]:
    """Apply a step's event."""
    name, now = step.event.name, step.time
    if name == "start":
        return [machine.start(now, step.event.data.get("ahead"))]
    if not name.startswith("timer."):
        return [machine.handle(step.event, now)]
    fired = machine.advance(now)
    return [fired] if fired is not None else []
