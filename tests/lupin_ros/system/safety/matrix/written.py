"""The table as text, for a terminal and for docs/safety.md. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from tests.lupin_ros.system.safety.matrix.table import ORDERS, RULES, SOURCES, STOPS, Cell, cell

#: What the table stands between on the page.
BEGIN, END = "<!-- matrix: made by `make matrix ARGS=--page` -->", "<!-- matrix ends -->"
#: Signs of a cell: nothing moved, it does not apply, it did not run, something moved.
ZERO, NONE, UNKNOWN, WRONG = "0", "-", "?", "**!**"


def sign(source: str, stop: str, newest: Mapping[str, Mapping[str, Any]]) -> str:
    """Return what stands in a cell of the table: the three orders together."""
    found = [cell(source, stop, order) for order in ORDERS]
    runs = [each for each in found if each.applies]
    if not runs:
        return NONE
    verdicts = [newest.get(each.name, {}).get("verdict", UNKNOWN) for each in runs]
    if any(verdict not in ("ok", UNKNOWN) for verdict in verdicts):
        return WRONG
    if UNKNOWN in verdicts:
        return UNKNOWN
    letters = dict.fromkeys(each.rule.letter for each in runs if each.rule is not None)
    return " ".join(letters) or ZERO


def table(newest: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the table of the page with its legend."""
    lines = [
        f"| | {' | '.join(stop.title for stop in STOPS)} |",
        f"|---|{'---|' * len(STOPS)}",
        *(
            f"| {source.title} | {' | '.join(sign(source.name, stop.name, newest) for stop in STOPS)} |"
            for source in SOURCES
        ),
    ]
    letters: dict[str, str] = {}
    for rule in RULES:
        if rule.letter:
            letters.setdefault(rule.letter, rule.why)
    signs = {
        ZERO: "nothing moves until a person says so",
        NONE: "does not apply",
        UNKNOWN: "has not run",
        **{f"**{letter}**": why for letter, why in letters.items()},
    }
    legend = "; ".join(f"{each}: {meaning}" for each, meaning in signs.items())
    return "\n".join([*lines, "", f"{legend}."])


def write_page(page: Path, newest: Mapping[str, Mapping[str, Any]]) -> None:
    """Write the table between its marks."""
    before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    page.write_text(f"{before}{BEGIN}\n{table(newest)}\n{END}{after}", encoding="utf-8")


def summary(chosen: Iterable[Cell], newest: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the table for a terminal, and in figures what was run."""
    rows = [newest[each.name] for each in chosen if each.name in newest]
    width = max(len(source.name) for source in SOURCES)
    head = " ".join(f"{number:>4}" for number, _ in enumerate(STOPS, 1))
    lines = [f"{'':{width}} {head}"]
    for source in SOURCES:
        signs = (sign(source.name, stop.name, newest).strip("*") for stop in STOPS)
        lines.append(f"{source.name:{width}} {' '.join(f'{each:>4}' for each in signs)}")
    lines += [", ".join(f"{number} {stop.name}" for number, stop in enumerate(STOPS, 1))]
    wrong = [row for row in rows if row["verdict"] != "ok"]
    lines += [f"{row['cell']}: {row['verdict']}: {'; '.join(row['problems'])}" for row in wrong]
    seconds = sum(row["seconds"] for row in rows)
    late = max((row["late"][0] for row in rows), default=0.0)
    lines.append(
        f"{len(rows)} cells in {seconds:.0f} s, {len(wrong)} wrong; at most {late:.2f} m within what a busy "
        "machine adds to a bound"
    )
    return "\n".join(lines)
