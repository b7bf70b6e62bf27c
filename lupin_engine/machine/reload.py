"""A machine of another chart that goes on where one is idle: for missions that are loaded anew meanwhile.

A machine is idle where a mission could start, and while nothing is under way but the engine's own
operations (a robot that waits for its servers may get other missions). What is not about a mission goes on
as it was: the states, holds, what is known of the world with its hysteresis, the variables, the code
reported last, the counters of the last mission. What the other chart does not have any more is forgotten,
what it has more begins as it would at the start.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from lupin_engine.chart.model import Chart
from lupin_engine.chart.records import same_meaning
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.memory import Memory, Phase, Timer
from lupin_engine.machine.scope import World
from lupin_engine.machine.snapshot import restore, snapshot
from lupin_engine.machine.structure import dispatch_table
from lupin_engine.plugin.builtin import is_builtin
from lupin_engine.plugin.profile import START

_T = TypeVar("_T")


def is_idle(machine: Machine) -> bool:
    """Tell whether nothing runs that another chart would have to know of."""
    chart, memory = machine.chart, machine.memory
    if any(chart.states[name].mission for name in memory.configuration):
        return False
    running = [a.operation for a in memory.attempts.values() if a.phase is not Phase.LOST]
    if running:
        return all(map(is_builtin, running))
    offered = dispatch_table(chart).configuration(memory.configuration).candidates(START)
    return not memory.invocations and any(rule.target is not None for rules in offered for rule in rules)


def successor(machine: Machine, world: World) -> Machine:
    """Return a machine of another chart that goes on from an idle one; `Machine.go_on` is its first step.

    Raises:
        SnapshotError: the other chart has no such state, or no such hold that is engaged.
    """
    memory = restore(machine.chart, machine.snapshot())
    _forget(memory, machine.chart, world.chart)
    return Machine(world, restore(world.chart, snapshot(world.chart, memory)))


def _forget(memory: Memory, before: Chart, chart: Chart) -> None:
    """Forget what another chart does not have, as far as it is not what the machine rests on."""
    inputs, variables = before.inputs, before.context
    same_inputs = {n: i for n, i in chart.inputs.items() if n in inputs and inputs[n].value == i.value}
    same_variables = {
        n: v for n, v in chart.context.items() if n in variables and variables[n].type == v.type
    }
    if memory.mission not in chart.missions:
        memory.mission = memory.mission_id = ""
    for of_mission in (memory.history, memory.budgets, memory.given):
        of_mission.clear()
    memory.asked = _kept(memory.asked, _asking_the_same(before, chart))
    memory.handled.clear()
    walking = {name for name, state in chart.states.items() if state.itinerary}
    memory.itineraries = _kept(memory.itineraries, dict.fromkeys(walking))
    memory.reached = _kept(memory.reached, {n: s for n, s in chart.states.items() if s.timers})
    memory.context = _kept(memory.context, same_variables)
    heard = {name: found for name, found in memory.inputs.items() if found.reported}
    memory.inputs = _kept(heard, same_inputs)
    memory.heard = _kept(memory.heard, same_inputs)
    memory.before = _kept(memory.before, same_inputs)
    levels = {f"input.{i.name}.{level.name}": level for i in chart.inputs.values() for level in i.levels}
    memory.levels = _kept(memory.levels, levels)
    memory.broken[:] = [name for name in memory.broken if name in chart.invariants]
    memory.timers[:] = [timer for timer in memory.timers if _goes_on(timer, memory, chart)]
    memory.frozen[:] = [timer for timer in memory.frozen if _goes_on(timer, memory, chart)]
    memory.waiting_actions[:] = [
        waiting for waiting in memory.waiting_actions if waiting[1].partition(".")[0] in chart.plugins
    ]


def _kept(found: dict[str, _T], known: Mapping[str, object]) -> dict[str, _T]:
    return {name: value for name, value in found.items() if name in known}


def _asking_the_same(before: Chart, chart: Chart) -> dict[str, object]:
    """Return the states that ask the same question with the same answers as in the chart of before."""
    asks = {name: state.ask for name, state in before.states.items() if state.ask is not None}
    return {n: s for n, s in chart.states.items() if n in asks and same_meaning(s.ask, asks[n])}


def _goes_on(timer: Timer, memory: Memory, chart: Chart) -> bool:
    """Tell whether a deadline goes on; those of live values are set anew."""
    _, _, kind, (owner, event) = timer
    if kind in ("after", "at"):
        event = event.partition(" ")[0]
        return owner in chart.states and any(event == own.event for own in chart.states[owner].timers)
    if kind == "budget":  # that of a mission runs on where it is diverted, and ends with it
        return owner in memory.configuration and owner in chart.states and bool(chart.states[owner].budget)
    return owner in memory.asked if kind == "ask" else kind != "fresh"
