"""Hot reload: moves an idle machine's memory to another chart, for missions that are changed while it runs.

A machine is idle where a mission could start, and while no operation but the engine's own is running (a robot
that waits for its servers may get other missions). Kept are the states, holds, inputs with their hysteresis,
variables, the last code and the counters of the last mission. Entries that the other chart lacks are dropped,
its additional ones begin as at the start.
"""

from __future__ import annotations

from typing import TypeVar

from lupin_engine.chart.model import Chart
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.memory import Memory, Phase, Timer
from lupin_engine.machine.scope import World
from lupin_engine.machine.snapshot import restore, snapshot
from lupin_engine.machine.structure import dispatch_table
from lupin_engine.plugin.builtin import is_builtin
from lupin_engine.plugin.profile import START

_Machine = TypeVar("_Machine", bound=Machine)


def is_idle(machine: Machine) -> bool:
    """Say whether the chart may be exchanged: no mission and no operation of a plugin is running."""
    chart, memory = machine.chart, machine.memory
    if any(chart.states[name].mission for name in memory.configuration):
        return False
    running = [a.operation for a in memory.attempts.values() if a.phase is not Phase.LOST]
    if running:
        return all(map(is_builtin, running))
    offered = dispatch_table(chart).configuration(memory.configuration).candidates(START)
    return not memory.invocations and any(rule.target is not None for rules in offered for rule in rules)


def successor(machine: _Machine, world: World) -> _Machine:
    """Return a machine of another chart on the memory of an idle one; `Machine.go_on` is its first step.

    Raises:
        SnapshotError: the other chart has no such state, or no such hold that is engaged.
    """
    memory = restore(machine.chart, machine.snapshot())
    _forget(memory, machine.chart, world.chart)
    return type(machine)(world, restore(world.chart, snapshot(world.chart, memory)))


def _forget(memory: Memory, before: Chart, chart: Chart) -> None:
    """Drop the entries whose owner another chart lacks, and initial values of inputs."""
    memory.inputs = {name: found for name, found in memory.inputs.items() if found.reported}
    memory.go_on(before, chart)
    memory.mission_id = memory.mission_id if memory.mission else ""
    memory.timers[:] = [timer for timer in memory.timers if _goes_on(timer, memory, chart)]
    memory.frozen[:] = [timer for timer in memory.frozen if _goes_on(timer, memory, chart)]
    memory.waiting_actions[:] = [
        waiting for waiting in memory.waiting_actions if waiting[1].partition(".")[0] in chart.plugins
    ]


def _goes_on(timer: Timer, memory: Memory, chart: Chart) -> bool:
    """Say whether a deadline stays armed; those of live values are set anew."""
    _, _, kind, (owner, event) = timer
    if kind in ("after", "at"):
        event = event.partition(" ")[0]
        return owner in chart.states and any(event == own.event for own in chart.states[owner].timers)
    if kind == "budget":  # that of a mission runs on where it is diverted, and ends with it
        return owner in memory.configuration and owner in chart.states and bool(chart.states[owner].budget)
    return owner in memory.asked if kind == "ask" else kind != "fresh"
