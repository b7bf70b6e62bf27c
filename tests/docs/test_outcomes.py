"""What the page of outcomes asks for is what the shipped missions do, cell by cell."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.sim.scripted import Between, MockOutcome, Rule
from lupin_engine.sim.simulation import Simulation
from tests.tools import load_tool

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "outcomes.md"
#: The table that says which rows can be held in which way; all others are about an event.
POSSIBLE = "What can be held"

#: (table, row, column) -> cell; in the first table the cell is `yes`.
Cells = dict[tuple[str, str, str], str]


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    return load_tool("outcomes")


@pytest.fixture(scope="module")
def generated(tool: ModuleType) -> Cells:
    """What the missions do."""
    found: Cells = tool.outcomes(default_missions_folder())
    return found


@pytest.fixture(scope="module")
def asked(tool: ModuleType) -> Cells:
    """What the page asks for, for every place that it says can be."""
    cells = read(PAGE.read_text(encoding="utf-8"), tool)
    possible = {(row, column) for table, row, column in cells if table == POSSIBLE}
    return {
        (table, row, column): cell
        for (table, row, column), cell in cells.items()
        if table != POSSIBLE and (row, column) in possible
    }


def read(page: str, tool: ModuleType) -> Cells:
    """Return the cells of all tables of the page that have a column for each way to be held."""
    columns = tuple(tool.COLUMNS)
    found: Cells = {}
    for table, head, names, line in _lines(page):
        if head != ("State", *columns):
            continue
        for name in names.split(", "):
            rows = tool.meant_by(name)
            assert rows, f"{table}: no row is called {name!r}"
            for row in rows:
                for column, cell in zip(columns, line, strict=True):
                    place = table, row, column
                    assert place not in found, f"{table}: {row} stands there twice"
                    if cell:
                        found[place] = cell
    return found


def _lines(page: str) -> Iterator[tuple[str, tuple[str, ...], str, list[str]]]:
    """Yield the rows of all tables: the heading above, the table's head, the first cell, the others."""
    title = ""
    head: tuple[str, ...] = ()
    for line in page.splitlines():
        if line.startswith("#"):
            title = line.lstrip("# ")
        if not line.startswith("|"):
            head = ()
            continue
        cells = tuple(cell.strip() for cell in line.strip("|").split("|"))
        if not head:
            head = cells
        elif set(cells[0]) != {"-"}:
            yield title, head, cells[0], _spelt_out(cells[1:])


def _spelt_out(cells: tuple[str, ...]) -> list[str]:
    """Replace `=` by what stands to the left of it."""
    found: list[str] = []
    for cell in cells:
        found.append(next(c for c in reversed(found) if c) if cell == "=" else cell)
    return found


@pytest.mark.slow
def test_the_missions_do_what_the_page_asks_for(asked: Cells, generated: Cells) -> None:
    """Every difference is told by its cell: what is asked, and what the missions do."""
    differences = [
        f"{table}: {row}, {column}:\n  asked      {asked.get(place, 'nothing is said')}\n"
        f"  generated  {generated.get(place, 'it cannot be')}"
        for place in sorted(asked.keys() | generated.keys())
        if asked.get(place) != generated.get(place)
        for table, row, column in [place]
    ]
    assert not differences, "\n".join([f"{len(differences)} cells differ:", *differences])


def test_every_event_state_and_hold_is_asked_for(asked: Cells, tool: ModuleType) -> None:
    """What does nothing says so."""
    states = {(row, column) for _, row, column in asked}
    assert {row for row, _ in states} == set(tool.SITUATIONS)
    missing = [
        (event, *state) for event in tool.EVENTS for state in sorted(states) if (event, *state) not in asked
    ]
    assert missing == []


@pytest.mark.slow
def test_what_the_tool_writes_is_read_as_what_it_means(generated: Cells, tool: ModuleType) -> None:
    """Rows that are joined, names that are shortened and repeated cells say the same as all cells alone."""
    written = read("\n".join(tool.tables(generated)), tool)
    possible = {place for place in written if place[0] == POSSIBLE}
    told = {place: cell for place, cell in written.items() if (POSSIBLE, *place[1:]) in possible - {place}}
    assert told == generated


def test_nothing_that_moves_is_started_while_held(generated: Cells, tool: ModuleType) -> None:
    """The one thing that a safety reviewer looks for, over all cells."""
    moving = {tool.WORDS[name] for name in ("nav.go_to", "nav.dock", "arm.preset")}
    moved = 0
    for (event, row, column), cell in generated.items():
        parts = [part.partition(" ") for part in cell.split("; ")]
        started = {word for verb, _, words in parts if verb == "starts" for word in words.split(", ")}
        was_held = column != "not held"
        verbs = {verb for verb, _, _ in parts}
        is_held = (was_held and "releases" not in verbs) or "engages" in verbs
        assert not is_held or moving.isdisjoint(started), f"{event}: {row}, {column}: {cell}"
        moved += not moving.isdisjoint(started)
    assert moved, "no cell starts anything that moves: the words have changed"


# -- not only where the tool leads --------------------------------------------------------------------------

#: What a cell says of the way there: which targets are left, and what was reported before.
_BY_HISTORY = ("closes ", "next target", "last_error")


@pytest.mark.slow
def test_a_cell_holds_in_situations_that_chance_leads_to(tool: ModuleType, asked: Cells) -> None:
    """The first target in 400 random inspections, whatever was asked for and happened before."""
    lab, differing, seen = tool.Lab(default_missions_folder()), list[str](), set[tuple[str, str, str]]()
    for seed in range(400):
        for place, cell in random_cells(tool, lab, random.Random(f"outcomes/{seed}")):
            if place in asked:
                seen.add(place)
                wanted, found = (_without_history(text) for text in (asked[place], cell))
                differing += [f"{place}: {wanted} / {found}"] if wanted != found else []
    assert differing == []
    assert len(seen) > 350


def _without_history(cell: str) -> str:
    parts = [part.partition("READY · ")[0] for part in cell.split("; ") if not part.startswith(_BY_HISTORY)]
    return "; ".join(parts) or "nothing"


def random_cells(
    tool: ModuleType, lab: Any, dice: random.Random
) -> Iterator[tuple[tuple[str, str, str], str]]:
    """Yield what followed at once from each thing that happened by chance, as a cell of its place."""
    operations = ("nav.localize", "nav.go_to", "nav.dock", "bridge.read_tag")
    rules = tuple(Rule(name, (MockOutcome(after=Between(1.0, 20.0)),)) for name in operations)
    simulation = lab._simulation(tool.Situation((), rules, parameters={"flower_scan_dwell_s": 5.0}))
    simulation.begin()
    often = ("start", "resume", "resume", "e-stop released", "battery recovered", "dependency back")
    for _ in range(25):
        until = simulation.now + dice.expovariate(1 / 6.0)
        while simulation.next_due is not None and simulation.next_due <= until:
            simulation.advance()
        simulation.wait_until(until)
        event, before, known = (
            dice.choice([*tool.EVENTS, *often]),
            tool._Look.at(simulation),
            len(simulation.steps),
        )
        place, is_meant = (event, before.row, _column(simulation)), _is_meant(simulation, before)
        simulation.do(tool.EVENTS[event])
        if is_meant:
            yield place, tool._told(before, simulation.steps[known:], tool._Look.at(simulation))


def _is_meant(simulation: Simulation, before: Any) -> bool:
    """Say whether it is as the page takes it: at the first target, docked from there, no answer waits."""
    memory, now = simulation.machine.memory, simulation.now
    lacks = simulation.machine.input_value("missing", now) and "dependencies" not in before.row
    walks = any(walk.begun for walk in memory.itineraries.values()) or "docked" not in before.row
    is_first = before.view.target == "1" or not sum(before.view.counts.values())
    return is_first and walks and not lacks and not memory.deferred


def _column(simulation: Simulation) -> str:
    held, machine = tuple(simulation.machine.memory.held), simulation.machine
    if held == ("estop",):
        return "e-stopped" if machine.input_value("estop", simulation.now) else "released"
    return {(): "not held", ("pause",): "paused"}.get(held, "held by both")
