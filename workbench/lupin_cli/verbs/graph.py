"""`lupin graph`: prints the ROS graph: topics, services and actions with the nodes at their ends."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import click

from lupin_cli import options
from lupin_engine.errors import Problems, UsageError, meant
from lupin_engine.plugin import robot_namespace
from lupin_ros.launch import close_the_doors, current_place

if TYPE_CHECKING:
    from lupin_ros.adapter import Interface


@click.command()
@click.argument("words", nargs=-1)
@options.domain
@click.option("--all", "everything", is_flag=True, help="Also what every node has: parameters, logs.")
@click.option("--mermaid", is_flag=True, help="Print the map as a Mermaid flowchart, for a page.")
@click.option("--json", "as_json", is_flag=True, help="Print the map as JSON.")
def graph(words: Sequence[str], domain: int | None, everything: bool, mermaid: bool, as_json: bool) -> int:
    """Show the ROS graph: topics, services and actions with their nodes.

    WORDS filter: only interfaces with one of them in their name, their type or a node's name are shown.

    Exit code: 0; 1 when messages do not arrive, or arrive twice; 2 when there is nothing to show.
    """
    import json
    from dataclasses import asdict

    from lupin_ros.launch import prepare_ros

    problems = Problems(UsageError)
    if mermaid and as_json:
        problems.add("--mermaid and --json are two forms of the same map: give one of them")
    with problems.collecting():
        close_the_doors(domain)
    with problems.collecting():
        prepare_ros()
    problems.raise_any()
    chosen = _chosen(words, everything)
    if as_json:
        click.echo(json.dumps([asdict(interface) for interface in chosen], indent=2, ensure_ascii=False))
    elif mermaid:
        click.echo("\n".join(flowchart(chosen)))
    else:
        from lupin_cli.terminal.tables import print_network

        print_network(chosen)
    return 1 if any(interface.problems for interface in chosen) else 0


def _chosen(words: Sequence[str], everything: bool) -> list[Interface]:
    """Return the interfaces to show.

    Raises:
        UsageError: there are none.
    """
    from lupin_ros.launch import network  # needs rclpy

    robot = f"{robot_namespace()}/"
    seen = [i for i in network() if any(text.startswith(robot) for text in _texts(i))]
    if not seen:
        raise UsageError(f"there is no other node in {current_place()}; give --domain, or `lupin up`")
    shown = [i for i in seen if everything or not i.is_housekeeping]
    if not shown:
        raise UsageError("nobody here has more than what every node has; --all shows that")
    chosen = [i for i in shown if not words or any(w in text for w in words for text in _texts(i))]
    if not chosen:
        raise UsageError(_not_found(words, shown))
    return chosen


def _texts(interface: Interface) -> tuple[str, ...]:
    return interface.name, interface.type, *interface.producers, *interface.consumers


def _not_found(words: Sequence[str], shown: Iterable[Interface]) -> str:
    hint = meant(words[0], {text for interface in shown for text in _texts(interface)})
    problem = f"nothing here has {' or '.join(map(repr, words))} in its name, type or nodes"
    return f"{problem}; {hint}" if hint else problem


def flowchart(chosen: Sequence[Interface]) -> Iterator[str]:
    """Yield the lines of a Mermaid flowchart: from the producer through the interface to the consumer.

    A client stands to the left of its server, as data flows in a topic from left to right.
    """
    yield "flowchart LR"
    nodes = sorted({node for i in chosen for node in (*i.producers, *i.consumers)})
    numbers = {node: f"n{number}" for number, node in enumerate(nodes)}
    for node, number in numbers.items():
        yield f'  {number}["{node.removeprefix("/")}"]'
    for position, interface in enumerate(chosen):
        opening, closing = ("([", "])") if interface.kind == "topic" else ("{{", "}}")
        yield f'  i{position}{opening}"{interface.name}"{closing}'
        left, right = interface.producers, interface.consumers
        if interface.kind != "topic":
            left, right = right, left
        yield from (f"  {numbers[node]} --> i{position}" for node in left)
        yield from (f"  i{position} --> {numbers[node]}" for node in right)
