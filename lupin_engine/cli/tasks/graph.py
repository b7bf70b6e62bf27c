"""What `lupin graph` does."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

import click
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from lupin_engine.errors import Problems, UsageError, meant
from lupin_engine.ros.launch.environment import close_the_doors, current_domain
from lupin_engine.ros.launch.requirements import prepare_ros

if TYPE_CHECKING:
    from lupin_engine.ros.adapter.network import Interface, Kind

#: Kind -> title of its table, what its two ends are called.
_TABLES: dict[Kind, tuple[str, str, str]] = {
    "topic": ("topics", "published by", "read by"),
    "service": ("services", "served by", "called by"),
    "action": ("actions", "served by", "called by"),
}


def work(words: Sequence[str], domain: int | None, everything: bool, mermaid: bool, as_json: bool) -> int:
    """Do what the options of `lupin graph` say, and return the exit code."""
    problems = Problems(UsageError)
    if mermaid and as_json:
        problems.add("--mermaid and --json are two forms of the same map: give one of them")
    with problems.collecting():
        close_the_doors(domain)
    with problems.collecting():
        prepare_ros()
    problems.tell()
    from lupin_engine.ros.launch.graph import network  # needs rclpy

    seen = network()
    if not seen:
        raise UsageError(
            f"there is no other node in ROS domain {current_domain()}; give --domain, or `lupin up`"
        )
    shown = [i for i in seen if everything or not i.is_housekeeping]
    if not shown:
        raise UsageError("nobody here has more than what every node has; --all shows that")
    chosen = [i for i in shown if _is_meant(i, words)]
    if not chosen:
        raise UsageError(_not_found(words, shown))
    if as_json:
        click.echo(json.dumps([asdict(interface) for interface in chosen], indent=2, ensure_ascii=False))
    elif mermaid:
        click.echo("\n".join(flowchart(chosen)))
    else:
        _print(chosen)
    return 1 if any(interface.problems for interface in chosen) else 0


def _is_meant(interface: Interface, words: Sequence[str]) -> bool:
    return not words or any(word in text for word in words for text in _texts(interface))


def _texts(interface: Interface) -> tuple[str, ...]:
    return interface.name, interface.type, *interface.producers, *interface.consumers


def _not_found(words: Sequence[str], shown: Iterable[Interface]) -> str:
    hint = meant(words[0], {text for interface in shown for text in _texts(interface)})
    problem = f"nothing here has {' or '.join(map(repr, words))} in its name, type or nodes"
    return f"{problem}; {hint}" if hint else problem


def _print(chosen: Sequence[Interface]) -> None:
    console = Console(highlight=False)
    for kind, (title, producers, consumers) in _TABLES.items():
        of_kind = [interface for interface in chosen if interface.kind == kind]
        if of_kind:
            console.print(_table(title, producers, consumers, of_kind))
    problems = [f"{i.name}: {problem}" for i in chosen for problem in i.problems]
    for problem in problems:
        console.print(Text(problem, "bold red"), soft_wrap=True)
    if not problems:
        console.print(Text("everybody understands everybody", "bold green"))


def _table(title: str, producers: str, consumers: str, rows: Iterable[Interface]) -> Table:
    grid = Table(box=SIMPLE_HEAD, pad_edge=False, title=title, title_justify="left", title_style="bold")
    grid.add_column("name and type", overflow="fold")
    for heading in (producers, consumers):
        grid.add_column(heading, overflow="fold", min_width=20)
    for row in rows:
        what = Text(row.name, "bold red" if row.problems else "bold").append(f"\n{row.type}", "not bold dim")
        grid.add_row(what, _who(row.producers), _who(row.consumers))
    return grid


def _who(nodes: Sequence[str]) -> Text:
    return Text("\n".join(node.removeprefix("/") for node in nodes)) if nodes else Text("nobody", "dim")


def flowchart(chosen: Sequence[Interface]) -> Iterator[str]:
    """Yield the lines of a Mermaid flowchart: from who produces, through what it is, to who consumes.

    Who asks stands left of whom is asked, as data flows in a topic from left to right.
    """
    yield "flowchart LR"
    nodes = sorted({node for i in chosen for node in (*i.producers, *i.consumers)})
    numbers = {node: f"n{number}" for number, node in enumerate(nodes)}
    for node, number in numbers.items():
        yield f'  {number}["{node.removeprefix("/")}"]'
    for position, interface in enumerate(chosen):
        opening, closing = ("([", "])") if interface.kind == "topic" else ("{{", "}}")
        yield f'  i{position}{opening}"{interface.name}"{closing}'
        asked = interface.kind != "topic"
        left, right = interface.producers, interface.consumers
        if asked:
            left, right = right, left
        yield from (f"  {numbers[node]} --> i{position}" for node in left)
        yield from (f"  i{position} --> {numbers[node]}" for node in right)
