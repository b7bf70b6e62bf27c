"""The table of docs/safety.md has every source of motion and every stop."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tests.lupin_ros.system.safety.matrix.table import ORDERS, RULES, SOURCES, STOPS, cell, cells
from tests.lupin_ros.system.safety.matrix.written import (
    BEGIN,
    END,
    NONE,
    UNKNOWN,
    WRONG,
    ZERO,
    sign,
    summary,
    table,
    write_page,
)

PAGE = Path(__file__).parents[2] / "docs" / "safety.md"
LETTERS = {rule.letter for rule in RULES if rule.letter}
OK: dict[str, dict[str, Any]] = {
    each.name: {"cell": each.name, "verdict": "ok", "seconds": 1.0, "late": [0.0, 0.0]} for each in cells()
}


def rows_of(text: str) -> list[list[str]]:
    """Return the cells of a table in Markdown, without the line below its head."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[each.strip() for each in line.strip("|").split("|")] for line in [lines[0], *lines[2:]]]


def test_the_page_has_all_rows_and_columns() -> None:
    _, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    written, mark, _ = rest.partition(END)
    head, *rows = rows_of(written)
    assert mark == END
    assert head[1:] == [stop.title for stop in STOPS]
    assert [row[0] for row in rows] == [source.title for source in SOURCES]
    signs = {sign for row in rows for each in row[1:] for sign in each.split()}
    assert signs <= {ZERO, NONE, *LETTERS}
    assert written.strip().splitlines()[-1] == table(OK).splitlines()[-1]  # the legend


def test_a_cell_that_was_wrong_or_did_not_run_is_shown_so() -> None:
    assert sign("mission", "stop_a", OK) == ZERO
    assert sign("mission", "stop_a", {}) == UNKNOWN
    wrong: dict[str, Any] = {**OK, "mission/stop_a/after": {"verdict": "wrong"}}
    assert sign("mission", "stop_a", wrong) == WRONG
    assert sign("late_answer", "e_stop_state", OK) == NONE
    assert sign("mission", "battery", OK) == "h"


def test_every_rule_is_of_some_cell_and_names_what_it_allows() -> None:
    used = {cell(s.name, t.name, order).rule for s in SOURCES for t in STOPS for order in ORDERS}
    assert used - {None} == set(RULES)
    assert [rule.why for rule in RULES if bool(rule.letter) is not bool(rule.allowed)] == []


def test_the_page_is_written_between_its_marks(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    write_page(page, OK)
    assert page.read_text() == f"before\n{BEGIN}\n{table(OK)}\n{END}\nafter\n"


def test_what_was_wrong_is_told_in_words() -> None:
    wrong = {**OK["mission/stop_a/after"], "verdict": "wrong", "problems": ["let go: 1.00 m, 0.00 rad"]}
    told = summary(cells(), {**OK, "mission/stop_a/after": wrong})
    assert "mission/stop_a/after: wrong: let go: 1.00 m, 0.00 rad" in told
    assert f"{len(OK)} cells in {len(OK)} s, 1 wrong; at most 0.00 m within" in told
