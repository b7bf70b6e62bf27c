"""What the page of outcomes asks for is what the shipped missions do, cell by cell."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from lupin_engine.missions.folders import default_missions_folder
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
