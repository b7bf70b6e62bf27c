"""Write the tables of docs/outcomes.md from the shipped missions: what follows from what, in every state.

    .venv/bin/python tools/outcomes.py

For every cell the missions are led into the row's state in virtual time, held as the column says, and then
what the table is about happens once. What the steps of that moment did is the cell. The page itself is
written by hand; tests/docs/test_outcomes.py compares the two.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from lupin_engine.chart.model import Chart
from lupin_engine.machine.event import Act, Cancel, Command, Report, Start
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.scope import World
from lupin_engine.machine.step import Step, View
from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder
from lupin_engine.missions.load import load_chart
from lupin_engine.plugin.builtin import MISSING, READY
from lupin_engine.plugin.profile import Publish
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim.scripted import MockOutcome, Rule
from lupin_engine.sim.simulation import Ask, Effect, Script, SetValue, Simulation

INSPECTION, EXPLORATION = "InspectionMission", "ExplorationMission"
TAGS = ("1", "2", "3")
LOW, FULL = 0.1, 0.9

STOP, LET_GO = SetValue("robot.estop", True), SetValue("robot.estop", False)
EMPTY, CHARGED = SetValue("robot.battery", LOW), SetValue("robot.battery", FULL)
LOST, BACK = SetValue(MISSING, ["action server navigate_to_pose"]), SetValue(MISSING, [])
START = Ask("mission.start")
PAUSE, ABORT, DOCK, SKIP = (Ask(f"operator.{name}") for name in ("pause", "abort", "dock", "skip_current"))

#: What can happen, by section of the page: the table's title -> the effect.
SECTIONS: Mapping[str, Mapping[str, Effect]] = MappingProxyType(
    {
        "Requests": {
            "start": START,
            "pause": PAUSE,
            "resume": Ask("operator.resume"),
            "abort": ABORT,
            "skip_current": SKIP,
            "dock": DOCK,
            "reset": Ask("operator.reset"),
        },
        "What the world does": {
            "e-stop pressed": STOP,
            "e-stop released": LET_GO,
            "battery low": EMPTY,
            "battery recovered": CHARGED,
            "dependency lost": LOST,
            "dependency back": BACK,
        },
    }
)
#: The same without the sections.
EVENTS: Mapping[str, Effect] = MappingProxyType(
    {title: effect for events in SECTIONS.values() for title, effect in events.items()}
)
#: In which ways a mission can be held: the column's title -> what brings it about, and what is held then.
COLUMNS: Mapping[str, tuple[tuple[Effect, ...], tuple[str, ...]]] = MappingProxyType(
    {
        "not held": ((), ()),
        "paused": ((PAUSE,), ("pause",)),
        "e-stopped": ((STOP,), ("estop",)),
        "released": ((STOP, LET_GO), ("estop",)),
    }
)
#: Operations and actions in words.
WORDS: Mapping[str, str] = MappingProxyType(
    {
        READY: "dependency check",
        "nav.localize": "localizing",
        "nav.choose_frontier": "choice",
        "nav.go_to": "drive",
        "nav.dock": "drive home",
        "perception.confirm_tag": "call",
        "bridge.read_tag": "call",
        "arm.preset": "arm",
    }
)

#: A cell's place: the event, the row, the column.
Place = tuple[str, str, str]
#: Between the parts of a row's name.
SEPARATOR = " · "
NOTHING = "nothing"


def _never(operation: str) -> Rule:
    return Rule(operation, (MockOutcome(never=True),))


@dataclass(frozen=True)
class Situation:
    """How a row's state is reached.

    `path` is gone step by step: a text is a row that must be reached, an effect happens then. `when_held`
    happens after the holds of the column were engaged.
    """

    path: tuple[str | Effect, ...] = ()
    rules: tuple[Rule, ...] = ()
    mission: str = INSPECTION
    parameters: Mapping[str, Any] = field(default_factory=dict)
    when_held: tuple[Effect, ...] = ()


READY_ROW = "READY · charged"
NAVIGATING = "INSPECTING · NAVIGATING"
GO = (READY_ROW, START)
DRIVES = (_never("nav.go_to"), _never("nav.dock"))
#: The ways to read a target, as far as they go: the row's last parts -> what is set and who does not answer.
VISIT: Mapping[str, tuple[tuple[Rule, ...], Mapping[str, Any]]] = MappingProxyType(
    {
        "NAVIGATING": (DRIVES, {}),
        "CONFIRMING": (
            (_never("perception.confirm_tag"), _never("nav.dock")),
            {"require_visual_confirmation": True},
        ),
        "SCANNING · reading": ((_never("bridge.read_tag"), _never("nav.dock")), {}),
        "SCANNING · dwelling": ((_never("nav.dock"),), {"flower_scan_dwell_s": 3600.0}),
    }
)
_FOUND = [
    {
        "id": tag,
        "x": float(tag),
        "y": 0.0,
        "facing": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        "species": "",
        "species_confidence": 0.0,
        "anomaly": False,
        "sightings": 3,
    }
    for tag in TAGS
]
#: Found on the way, nearest first.
DISCOVERY = (
    *GO,
    "PREPARE",
    SetValue("robot.pose", {"x": 0.0, "y": 0.0, "yaw": 0.0}),
    "EXPLORING · choosing",
    SetValue("tags.discovered", _FOUND),
)


def _visits() -> Iterator[tuple[str, Situation]]:
    """Yield the rows of both states that visit targets."""
    missions = (("INSPECTING", INSPECTION, GO), ("MONITORING", EXPLORATION, DISCOVERY))
    for lifecycle, mission, way in missions:
        for phase, (rules, parameters) in VISIT.items():
            row = f"{lifecycle}{SEPARATOR}{phase}"
            yield row, Situation((*way, row), rules, mission, parameters)
        # Only a visit that is closed while held waits in PUBLISHING.
        before = f"{lifecycle}{SEPARATOR}NAVIGATING"
        passing = Situation((*way, before), DRIVES, mission, when_held=(SKIP,))
        yield f"{lifecycle}{SEPARATOR}PUBLISHING", passing


def _on_the_way(*then: str | Effect) -> Situation:
    return Situation((*GO, NAVIGATING, *then), DRIVES)


def _at_the_dock(*then: str | Effect) -> Situation:
    return Situation((*GO, NAVIGATING, *then), (_never("nav.go_to"),))


_HOME = "RETURNING · home · "
#: Every row of the tables, in their order.
SITUATIONS: Mapping[str, Situation] = MappingProxyType(
    {
        "BOOT": Situation((LOST,)),
        READY_ROW: Situation((READY_ROW,)),
        "READY · battery low": Situation((READY_ROW, EMPTY)),
        # Only what is held stays there.
        "READY · dependencies": Situation((READY_ROW,), when_held=(LOST,)),
        "PREPARE": Situation((*GO, "PREPARE"), (_never("nav.localize"), _never("nav.dock"))),
        "EXPLORING · choosing": Situation((*GO, "EXPLORING · choosing"), DRIVES, EXPLORATION),
        "EXPLORING · driving": Situation((*GO, "EXPLORING · driving"), DRIVES, EXPLORATION),
        **dict(_visits()),
        f"{_HOME}done": Situation((*GO, f"{_HOME}done"), (_never("nav.dock"),)),
        f"{_HOME}abort": _on_the_way(ABORT),
        f"{_HOME}dock": _on_the_way(DOCK),
        f"{_HOME}battery low": _on_the_way(EMPTY),
        f"{_HOME}battery recovered": _on_the_way(EMPTY, CHARGED),
        f"{_HOME}over and low": _on_the_way(ABORT, EMPTY),
        f"{_HOME}over and recovered": _on_the_way(ABORT, EMPTY, CHARGED),
        "RETURNING · docked · charged": _at_the_dock(DOCK, "RETURNING · docked · charged"),
        "RETURNING · docked · battery low": _at_the_dock(EMPTY, "RETURNING · docked · battery low"),
        "DONE · charged": _on_the_way(ABORT, ABORT),
        "DONE · battery low": _on_the_way(ABORT, ABORT, EMPTY),
        "DONE · dependencies": _on_the_way(ABORT, ABORT, LOST),
        "FAULT · failed": Situation((*GO, "FAULT · failed"), (_never("nav.localize"),)),
        "FAULT · dependencies": Situation((LOST, "FAULT · dependencies")),
    }
)


# -- one cell ---------------------------------------------------------------------------------------------


def row_of(machine: Machine, now: float) -> str:
    """Return the row that a machine is in."""
    view, battery = machine.view, machine.input_value("battery", now)
    charge = "battery low" if battery["low"] else "charged"
    inner = view.configuration[-1].rpartition(".")[2]
    if view.lifecycle in ("READY", "DONE"):
        lacks = machine.input_value("missing", now)
        return f"{view.lifecycle}{SEPARATOR}{'dependencies' if lacks else charge}"
    if view.lifecycle == "FAULT":
        return (
            "FAULT · dependencies" if any(a.operation == READY for a in view.attempts) else "FAULT · failed"
        )
    if view.lifecycle == "RETURNING":
        return f"RETURNING · docked · {charge}" if inner == "DOCKED" else _way_home(machine, battery["low"])
    if view.lifecycle == "EXPLORING":
        is_choosing = any(name.endswith(".CHOOSING") for name in view.configuration)
        return f"EXPLORING · {'choosing' if is_choosing else 'driving'}"
    if view.phase == "SCANNING":
        return f"{view.lifecycle} · SCANNING · {inner.lower()}"
    return SEPARATOR.join(filter(None, (view.lifecycle, view.phase if view.lifecycle != "PREPARE" else "")))


def _way_home(machine: Machine, is_low: bool) -> str:
    reason = machine.memory.context["reason"]
    if reason == "battery":
        reason = "battery low" if is_low else "battery recovered"
    elif reason == "low":
        reason = "over and low" if is_low else "over and recovered"
    return f"{_HOME}{reason}"


class Lab:
    """Leads the shipped missions into situations, and lets things happen there."""

    def __init__(self, folder: Path) -> None:
        missions = [folder / "inspection.yaml", folder / "exploration.yaml"]
        self._chart: Chart = load_chart(folder / LIFECYCLE, missions, load_catalog())
        self._worlds: dict[str, World] = {}

    def cell(self, row: str, column: str, event: str) -> str | None:
        """Return what an event does there; None when the row cannot be held in that way."""
        simulation = self._reached(row, column)
        if simulation is None:
            return None
        before, known = _Look.at(simulation), len(simulation.steps)
        simulation.do(EVENTS[event])
        return _told(before, simulation.steps[known:], _Look.at(simulation))

    def _reached(self, row: str, column: str) -> Simulation | None:
        """Return a simulation in a row's situation, held as the column says; None where that cannot be."""
        situation = SITUATIONS[row]
        simulation = self._simulation(situation)
        simulation.begin()
        for stage in situation.path:
            if not isinstance(stage, str):
                simulation.do(stage)
            while isinstance(stage, str) and _row(simulation) != stage:
                assert simulation.advance(), f"{row}: {stage} is never reached, it ends in {_row(simulation)}"
        holding, held = COLUMNS[column]
        for effect in (*holding, *situation.when_held):
            simulation.do(effect)
        is_there = _row(simulation) == row and tuple(simulation.machine.memory.held) == held
        return simulation if is_there else None

    def _simulation(self, situation: Situation) -> Simulation:
        given = {"seed_climate_on_discovery": False, **situation.parameters}
        world = self._worlds.get(repr(given))
        if world is None:
            world = self._worlds[repr(given)] = make_world(self._chart, given)
        request = {"tag_sequence": list(TAGS), "discovery_goal": len(TAGS)}
        script = Script(situation.mission, request, situation.rules, starts=False)
        return Simulation(self._chart, script, given, world)


def _row(simulation: Simulation) -> str:
    return row_of(simulation.machine, simulation.now)


@dataclass(frozen=True)
class _Look:
    """What there is to see at one moment."""

    row: str
    view: View

    @classmethod
    def at(cls, simulation: Simulation) -> _Look:
        """Look now."""
        return cls(_row(simulation), simulation.machine.view)


def _told(before: _Look, steps: Sequence[Step], after: _Look) -> str:
    """Return what happened in a moment, in the words of a cell."""
    for step in steps:
        if step.refusal is not None:
            return "✗ " + _reason(step.event.name.partition(".")[2], step.refusal.text, before.view)
    commands = [command for step in steps for command in step.commands]
    was, now = before.view, after.view
    moved = was.target != now.target and "" not in (was.target, now.target)
    parts = (
        f"→ {after.row}" if after.row != before.row else "",
        *(f"releases {name}" for name in was.held if name not in now.held),
        *(f"engages {name}" for name in now.held if name not in was.held),
        _listed("cancels", (c.operation for c in commands if isinstance(c, Cancel))),
        _listed("starts", map(_begun, commands)),
        *_closed(commands),
        "next target" if moved else "",
        "summary" if any(isinstance(command, Report) for command in commands) else "",
        f"last_error {now.code or 'cleared'}" if now.code != was.code else "",
    )
    return "; ".join(filter(None, parts)) or NOTHING


def _reason(request: str, text: str, view: View) -> str:
    """Return a refusal without the request's name, which the table has, and without the state's."""
    here = f"{view.lifecycle} {view.phase}".strip()
    return (
        text.removeprefix(f"{request} ")
        .removeprefix("refused: ")
        .removeprefix("is ")
        .replace(f"possible in {here}", "possible in STATE", 1)
    )


def _begun(command: Command) -> str:
    if isinstance(command, Start):
        return command.operation
    return command.action if isinstance(command, Act) else ""


def _listed(verb: str, names: Iterable[str]) -> str:
    words = [WORDS.get(name, name) for name in names if name]
    return f"{verb} {', '.join(words)}" if words else ""


def _closed(commands: Iterable[Command]) -> Iterator[str]:
    by_status: dict[str, list[str]] = {}
    for command in commands:
        if isinstance(command, Publish):
            by_status.setdefault(command.status, []).append(command.target)
    for status, targets in by_status.items():
        yield f"closes {', '.join(targets)} {status}"


def outcomes(folder: Path) -> dict[Place, str]:
    """Return the cell of every place that can be, of the missions in a folder."""
    lab = Lab(folder)
    places = [(event, row, column) for event in EVENTS for row in SITUATIONS for column in COLUMNS]
    cells = {place: lab.cell(place[1], place[2], place[0]) for place in places}
    return {place: cell for place, cell in cells.items() if cell is not None}


# -- as a page --------------------------------------------------------------------------------------------


def tables(cells: Mapping[Place, str]) -> Iterator[str]:
    """Yield the lines of the tables; rows with the same cells are one."""
    first = next(iter(EVENTS))
    possible = {
        row: tuple("yes" if (first, row, column) in cells else None for column in COLUMNS)
        for row in SITUATIONS
    }
    groups: dict[tuple[str | None, ...], list[str]] = {}
    for row, line in possible.items():
        groups.setdefault(line, []).append(row)
    yield from ("## What can be held", "", *_heading())
    yield from (_line(rows, line) for line, rows in groups.items())
    for section, events in SECTIONS.items():
        yield from ("", f"## {section}")
        for event in events:
            by_row = {row: tuple(cells.get((event, row, column)) for column in COLUMNS) for row in SITUATIONS}
            yield from ("", f"### {event}", "", *_heading())
            yield from (_line(rows, line) for rows, line in _merged(by_row))


def _heading() -> tuple[str, str]:
    return f"| State | {' | '.join(COLUMNS)} |", "|---" * (1 + len(COLUMNS)) + "|"


def _merged(by_row: Mapping[str, tuple[str | None, ...]]) -> list[tuple[list[str], tuple[str | None, ...]]]:
    """Join the rows that agree wherever both can be."""
    groups: list[tuple[list[str], tuple[str | None, ...]]] = []
    for row, line in by_row.items():
        for index, (rows, known) in enumerate(groups):
            if all(None in pair or pair[0] == pair[1] for pair in zip(line, known, strict=True)):
                joined = tuple(a or b for a, b in zip(known, line, strict=True))
                groups[index] = ([*rows, row], joined)
                break
        else:
            groups.append(([row], line))
    return groups


def _line(rows: list[str], line: tuple[str | None, ...]) -> str:
    """Return a row of a table; a cell that is as the one to its left is `=`."""
    shown: list[str] = []
    last = None
    for cell in line:
        shown.append("" if cell is None else "=" if cell == last and cell != "yes" else cell)
        last = cell or last
    return f"| {', '.join(_shortened(rows))} | {' | '.join(shown)} |".replace("|  |", "| |")


def _shortened(rows: list[str]) -> list[str]:
    """Return names that stand for these rows and no others, as short as can be."""
    found: dict[str, None] = {}
    for row in rows:
        parts = row.split(SEPARATOR)
        starts = [SEPARATOR.join(parts[:length]) for length in range(1, len(parts) + 1)]
        found[next(start for start in starts if set(meant_by(start)) <= set(rows))] = None
    return list(found)


def meant_by(name: str) -> list[str]:
    """Return the rows that a name stands for: itself, or all that begin so."""
    return [row for row in SITUATIONS if f"{row}{SEPARATOR}".startswith(f"{name}{SEPARATOR}")]


if __name__ == "__main__":
    sys.stdout.write("\n".join(tables(outcomes(default_missions_folder()))) + "\n")
