"""What was measured, as tables for a terminal and for a document."""

from __future__ import annotations

import os
import platform
from dataclasses import dataclass, field
from pathlib import Path

from peers.process import Engine
from rich.console import Console
from rich.table import Table

#: Between these two lines of a document `--write` puts the tables.
BEGIN, END = "<!-- dispatch:begin -->", "<!-- dispatch:end -->"


@dataclass(frozen=True)
class Figure:
    """One cell: median and best in the chart's unit, with the blocks; or why there is none.

    `first` is the very first event or load, on its own, before anything was compiled or kept.
    """

    median: float = 0.0
    best: float = 0.0
    blocks: tuple[float, ...] = ()
    missing: str = ""
    first: float = 0.0


@dataclass
class Results:
    """Everything of one run: figures by chart and engine, what the engines are, how it was measured."""

    engines: list[Engine]
    figures: dict[str, dict[str, Figure]] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    method: dict[str, float] = field(default_factory=dict)

    @property
    def wrong(self) -> list[str]:
        """What an engine did that it should not have done."""
        return [
            f"{engine}, {chart}: {figure.missing}"
            for chart, row in self.figures.items()
            for engine, figure in row.items()
            if figure.missing.startswith(("wrong", "failed"))
        ]


@dataclass(frozen=True)
class Part:
    """A table: its title, and its columns as chart and heading."""

    title: str
    columns: tuple[tuple[str, str], ...]


PARTS = (
    Part(
        "µs per event (timed: per transition in virtual time)",
        (
            ("cycle", "cycle"),
            ("guarded", "guard + action"),
            ("parallel", "3 levels, parallel"),
            ("timed", "timed"),
        ),
    ),
    Part(
        "ms from the declaration to a running machine; bytes per further machine",
        (
            ("load-10", "10 states"),
            ("load-100", "100 states"),
            ("load-1000", "1,000 states"),
            ("bytes", "bytes"),
        ),
    ),
)


def machine_kind() -> str:
    """Return what kind of machine this is, without saying which one."""
    cores = os.cpu_count() or 1
    return f"{platform.system()} on {platform.machine()}{_processor()}, {cores} cores"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return ""
    model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
    return f" ({model})" if model else ""


def rows(results: Results, part: Part) -> tuple[list[str], list[list[str]]]:
    """Return headings and cells of the charts of a part that were measured."""
    columns = [(chart, title) for chart, title in part.columns if chart in results.figures]
    found = []
    for engine in results.engines:
        cells = [_cell(results, chart, engine.key) for chart, _ in columns]
        if any(cells):
            found.append([engine.title, *(cell or "-" for cell in cells)])
    return ["engine", *(title for _, title in columns)], found if columns else []


def _cell(results: Results, chart: str, engine: str) -> str:
    figure = results.figures[chart].get(engine)
    if figure is None:
        return ""
    if figure.missing:
        return figure.missing
    best = "" if chart == "bytes" else f" ({_short(figure.best)})"
    text = f"{_short(figure.median)}{best}"
    ours = results.figures[chart].get("lupin")
    if ours is None or ours.missing or engine == "lupin":
        return text
    return f"{text}, {_short(figure.median / ours.median)}x"


def _short(value: float) -> str:
    """Return a number with three significant digits."""
    if value >= 100:
        return f"{value:,.0f}"
    return f"{value:.3g}" if value >= 0.001 else f"{value:.1e}"


def show(results: Results, console: Console) -> None:
    """Print the tables."""
    for part in PARTS:
        headings, cells = rows(results, part)
        if cells:
            table = Table(*headings, title=part.title, title_justify="left")
            for row in cells:
                table.add_row(*row)
            console.print(table)
    console.print("median of the blocks (best block), how many times ours")


def document(results: Results) -> str:
    """Return the section of the document, markers included."""
    blocks, seconds = results.method["rounds"], results.method["block_s"]
    lines = [
        BEGIN,
        "## Dispatch, beside other engines",
        "",
        "`.venv/bin/python benchmarks/dispatch.py --write`: the same charts for each engine, all in one run,",
        f"each engine in a process of its own, {blocks:.0f} blocks of at least {seconds:g} s in turn. Median",
        "(best block), how many times ours. After the blocks each engine is asked where it is, and must be",
        "there. `benchmarks/README.md` says what each row does.",
        "",
        f"{machine_kind()}, shared.",
        f"{'; '.join(dict.fromkeys(results.versions.values()))}.",
    ]
    for part in PARTS:
        headings, cells = rows(results, part)
        if cells:
            lines += ["", f"{part.title}:", "", _line(headings), _line(["---"] * len(headings))]
            lines += [_line(row) for row in cells]
    return "\n".join([*lines, END])


def _line(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def write_section(path: Path, section: str) -> None:
    """Put the section between its markers, or at the end of a document that has none yet."""
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    before, begun, rest = text.partition(BEGIN)
    _, ended, after = rest.partition(END)
    appended = f"{text.rstrip()}\n\n{section}\n".lstrip()
    path.write_text(before + section + after if begun and ended else appended, encoding="utf-8")
