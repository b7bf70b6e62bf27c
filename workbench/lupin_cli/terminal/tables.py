"""The tables of `doctor`, `graph` and `plugin`, and the page of a plugin."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.console import Console, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from lupin_engine.plugin import Entry, Plugin, sections
from lupin_ros.launch import Finding

if TYPE_CHECKING:
    from lupin_ros.adapter import Interface, Kind

#: Cells that no name of the map fills.
_ANY_WIDTH = 10_000
_STATE_STYLES: Mapping[str, str] = MappingProxyType({"ok": "green", "note": "yellow", "problem": "bold red"})
#: Kind of interface -> title of its table, what its two ends are called.
_INTERFACES: Mapping[Kind, tuple[str, str, str]] = MappingProxyType(
    {
        "topic": ("topics", "published by", "read by"),
        "service": ("services", "served by", "called by"),
        "action": ("actions", "served by", "called by"),
    }
)


# -- doctor -----------------------------------------------------------------------------------------------


def print_health(findings: Sequence[Finding]) -> None:
    """Print the findings about this machine, and whether missions can be run on it."""
    console = Console(highlight=False)
    console.print(_health_table(findings))
    console.print(_health_verdict(findings))


def _health_table(findings: Iterable[Finding]) -> RenderableType:
    """Return the findings as a table, with advice below each."""
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("")
    table.add_column("looked at", overflow="fold")
    table.add_column("found", overflow="fold")
    for finding in findings:
        found = Text(finding.found)
        if finding.advice:
            found.append(f"\n{finding.advice}", _STATE_STYLES[finding.state])
        table.add_row(Text(finding.state, _STATE_STYLES[finding.state]), finding.topic, found)
    return table


def _health_verdict(findings: Iterable[Finding]) -> Text:
    problems = sum(1 for finding in findings if finding.state == "problem")
    if not problems:
        return Text("missions can be run here", "bold green")
    return Text(f"{problems} problem{'s' * (problems > 1)} to mend before missions can be run", "bold red")


# -- graph ------------------------------------------------------------------------------------------------


def print_network(interfaces: Sequence[Interface]) -> None:
    """Print the interfaces of each kind with their problems; names are never broken."""
    console = Console(highlight=False)
    for kind, (title, *ends) in _INTERFACES.items():
        of_kind = [interface for interface in interfaces if interface.kind == kind]
        table = _network_table(title, ends, of_kind)
        wanted = console.measure(table, options=console.options.update(max_width=_ANY_WIDTH)).maximum
        if of_kind and wanted <= console.width:
            console.print(table)
        elif of_kind:
            console.print(_network_list(title, ends, of_kind), soft_wrap=True)
    problems = [f"{i.name}: {problem}" for i in interfaces for problem in i.problems]
    for problem in problems:
        console.print(Text(problem, "bold red"), soft_wrap=True)
    if not problems:
        console.print(Text("everybody understands everybody", "bold green"))


def _network_table(title: str, ends: Sequence[str], interfaces: Iterable[Interface]) -> Table:
    table = Table(box=SIMPLE_HEAD, pad_edge=False, title=title, title_justify="left", title_style="bold")
    for heading in ("name and type", *ends):
        table.add_column(heading, no_wrap=True)
    for one in interfaces:
        table.add_row(_what(one, "\n"), _nodes(one.producers, "\n"), _nodes(one.consumers, "\n"))
    return table


def _network_list(title: str, ends: Sequence[str], interfaces: Iterable[Interface]) -> Text:
    """Return the table's contents as a list, for a terminal that is too narrow for a table."""
    text = Text(f"{title}\n", "bold")
    for one in interfaces:
        text.append("  ").append_text(_what(one, "  "))
        for end, nodes in zip(ends, (one.producers, one.consumers), strict=True):
            text.append(f"\n    {end} ", "not bold dim").append_text(_nodes(nodes, ", "))
        text.append("\n")
    return text


def _what(interface: Interface, between: str) -> Text:
    name = Text(interface.name, "bold red" if interface.problems else "bold")
    return name.append(f"{between}{interface.type}", "not bold dim")


def _nodes(nodes: Iterable[str], between: str) -> Text:
    text = between.join(node.removeprefix("/") for node in nodes)
    return Text(text or "nobody", "not bold" if text else "not bold dim")


# -- plugin -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class InstalledPlugin:
    """A plugin in the list; `problem` is why it is refused."""

    name: str
    doc: str
    operations: int
    distribution: str
    version: str
    entry_point: str
    problem: str = ""


def print_plugins(plugins: Iterable[InstalledPlugin]) -> None:
    """Print the list of the installed plugins."""
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for title in ("plugin", "what it is", "operations", "from"):
        table.add_column(title, overflow="fold", justify="right" if title == "operations" else "left")
    for one in plugins:
        doc = Text(one.problem, "bold red") if one.problem else Text(one.doc)
        table.add_row(one.name, doc, f"{one.operations or ''}", f"{one.distribution} {one.version}".strip())
    Console(highlight=False).print(table)


def print_plugin(plugin: Plugin, origin: str) -> None:
    """Print the contents of a plugin, section by section."""
    console = Console(highlight=False)
    console.print(Text.assemble((plugin.name, "bold"), f": {plugin.doc}"))
    console.print(Text(origin, "dim"))
    for section in sections(plugin):
        console.print(Text(f"\n{section.title}", "bold green"))
        for entry in section.entries:
            console.print(Padding(Text(entry.name, "bold"), (0, 0, 0, 2)))
            console.print(Padding(entry.doc, (0, 0, 0, 6)), markup=False)
            console.print(Padding(_facts(entry), (0, 0, 0, 6)))


def _facts(entry: Entry) -> Table:
    grid = Table.grid(padding=(0, 2))
    for left, right in _lines(entry):
        grid.add_row(Text(left, "dim"), Text(right))
    return grid


def _lines(entry: Entry) -> Iterator[tuple[str, str]]:
    for name, kind, doc in entry.arguments:
        yield name, f"{kind}: {doc}"
    yield from entry.facts
