"""What `lupin plugin list` and `lupin plugin show` do."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import click
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from lupin_engine.chart.bound_catalog import BINDINGS, bound_catalog
from lupin_engine.chart.findings import Findings
from lupin_engine.errors import PluginError, UsageError
from lupin_engine.plugin.contract import Plugin
from lupin_engine.plugin.describe import Entry, sections
from lupin_engine.plugin.discovery import EntryPoint, entry_points, find_entry_point
from lupin_engine.plugin.registry import load_catalog, verified_plugin

#: Where the missions of the current folder may be.
_HERE = ("missions", ".")


@dataclass(frozen=True)
class Row:
    """A plugin in the list; `problem` is why it is refused."""

    name: str
    doc: str
    operations: int
    distribution: str
    version: str
    entry_point: str
    problem: str = ""


def list_work(as_json: bool) -> int:
    """Do what the options of `lupin plugin list` say, and return the exit code."""
    rows = [_row(point) for point in entry_points()]
    if as_json:
        click.echo(json.dumps([asdict(row) for row in rows], indent=2, ensure_ascii=False))
    else:
        Console(highlight=False).print(_table(rows))
    return 1 if any(row.problem for row in rows) else 0


def _row(point: EntryPoint) -> Row:
    name, version = (point.distribution.name, point.distribution.version) if point.distribution else ("", "")
    try:
        plugin = verified_plugin(point)
    except PluginError as problem:
        return Row(point.name, "", 0, name, version, point.value, str(problem))
    return Row(plugin.name, plugin.doc, len(plugin.operations), name, version, point.value)


def _table(rows: list[Row]) -> Table:
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for title in ("plugin", "what it is", "operations", "from"):
        table.add_column(title, overflow="fold", justify="right" if title == "operations" else "left")
    for row in rows:
        doc = Text(row.problem, "bold red") if row.problem else Text(row.doc)
        table.add_row(row.name, doc, f"{row.operations or ''}", f"{row.distribution} {row.version}".strip())
    return table


def show_work(name: str, as_json: bool) -> int:
    """Do what the options of `lupin plugin show` say, and return the exit code."""
    plugin, origin = _installed_or_bound(name)
    if as_json:
        click.echo(json.dumps(_as_data(plugin), indent=2, ensure_ascii=False))
        return 0
    console = Console(highlight=False)
    console.print(Text.assemble((plugin.name, "bold"), f": {plugin.doc}"))
    console.print(Text(origin, "dim"))
    for section in sections(plugin):
        console.print(Text(f"\n{section.title}", "bold green"))
        for entry in section.entries:
            console.print(Padding(Text(entry.name, "bold"), (0, 0, 0, 2)))
            console.print(Padding(entry.doc, (0, 0, 0, 6)), markup=False)
            console.print(Padding(_facts(entry), (0, 0, 0, 6)))
    return 0


def _installed_or_bound(name: str) -> tuple[Plugin, str]:
    """Return a plugin and where it is from: a package, or a binding of the missions in the current folder."""
    file = binding_called(name)
    if file is None:
        point = find_entry_point(name)
        return verified_plugin(point), str(point)
    findings = Findings()
    bound = bound_catalog([file.parent.parent], load_catalog(), {}, findings)
    if bound is None or file.stem not in bound.bindings:
        raise UsageError(f"the binding {file} has errors; to see them: lupin check {file}")
    return bound.bindings[file.stem].plugin, str(file)


def binding_called(name: str) -> Path | None:
    """Return the file of a binding: named itself, or by its name, of the missions in the current folder."""
    named = Path(name)
    files = (
        [named] if named.suffix == ".yaml" else [Path(folder, BINDINGS, f"{name}.yaml") for folder in _HERE]
    )
    return next((file for file in files if file.is_file()), None)


def _facts(entry: Entry) -> Table:
    grid = Table.grid(padding=(0, 2))
    for left, right in _lines(entry):
        grid.add_row(Text(left, "dim"), Text(right))
    return grid


def _lines(entry: Entry) -> Iterator[tuple[str, str]]:
    for name, kind, doc in entry.arguments:
        yield name, f"{kind}: {doc}"
    yield from entry.facts


def _as_data(plugin: Plugin) -> dict[str, object]:
    found = {section.title: [asdict(entry) for entry in section.entries] for section in sections(plugin)}
    return {"name": plugin.name, "doc": plugin.doc, "offers": found}
