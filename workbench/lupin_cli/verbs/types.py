"""`lupin types`: writes the interfaces of a run as types for programs that use it through rosbridge."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import click

from lupin_engine.errors import Problems, UsageError, meant


@click.command(short_help="Write all messages and services as TypeScript or JSON Schema.")
@click.argument("language", type=click.Choice(["ts", "json-schema"]))
@click.argument("more", nargs=-1, metavar="[TYPE | PACKAGE]...")
@click.option(
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Write into this file; default: print.",
)
def types(language: str, more: tuple[str, ...], output: Path | None) -> int:
    """Write the types of all messages, services and actions that a run uses, made from their files.

    These are the ones of the orchestrator, the installed plugins and the profile, with everything inside, and
    beside them each TYPE, such as sensor_msgs/msg/LaserScan, and all of each PACKAGE that is named. The same
    files give the same text.

    Exit code: 0 written; 2 a definition is not here, or the file cannot be written.
    """
    from lupin_engine.plugin import write_atomically
    from lupin_ros.interfaces import json_schema, read_interfaces, typescript, used_interfaces

    interfaces = read_interfaces(used_interfaces().union(_named(more)))
    text = typescript(interfaces) if language == "ts" else json_schema(interfaces)
    if output is None:
        click.echo(text, nl=False)
        return 0
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(output, text.encode())
    except OSError as problem:
        raise UsageError(f"cannot write {str(output)!r}: {problem.strerror}") from None
    return 0


def _named(more: Iterable[str]) -> list[str]:
    """Return the interfaces that are named beside those in use.

    Raises:
        UsageError: some are not here, or are no names.
    """
    problems, found = Problems(UsageError), list[str]()
    for name in more:
        with problems.collecting():
            found.extend(_interfaces(name))
    problems.raise_any()
    return found


def _interfaces(name: str) -> Iterator[str]:
    from lupin_ros.interfaces import NAME, names_in, packages

    if NAME.fullmatch(name):
        yield name
        return
    found = names_in(name) if name.isidentifier() else []
    if not found:
        hint = meant(name, packages()) or "write PACKAGE, or a type such as sensor_msgs/msg/LaserScan"
        raise UsageError(f"no interfaces are called {name!r} here; {hint}")
    yield from found
