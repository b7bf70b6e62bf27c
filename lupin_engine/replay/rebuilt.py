"""The machine of a record: another one, to which the same happens at the same times."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from lupin_engine.machine.machine import Machine
from lupin_engine.machine.scope import World
from lupin_engine.machine.step import Step


def rebuilt(steps: Iterable[Step], world: World) -> tuple[Mapping[str, Any], list[Step]]:
    """Return the variables at the end of a record, and the steps by which they came about.

    A record may lack reports that changed nothing when they came; then the steps differ from the recorded.
    """
    machine, found = Machine(world), []
    for step in steps:
        found += _happen(machine, step)
    return machine.memory.context, found


def _happen(machine: Machine, step: Step) -> list[Step]:
    """Let happen what a step was about."""
    name, now = step.event.name, step.time
    if name == "start":
        return [machine.start(now, step.event.data.get("ahead"))]
    if not name.startswith("timer."):
        return [machine.handle(step.event, now)]
    fired = machine.advance(now)
    return [fired] if fired is not None else []
