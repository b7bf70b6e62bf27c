"""`lupin start`: a mission of the orchestrator that is on the network."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePath
from typing import Any

import click

from lupin_cli import options
from lupin_cli.operator.network import attendant, nobody, told
from lupin_engine.errors import UsageError
from lupin_engine.plugin import START_VERB, given_fields


@click.command(cls=options.RequestCommand, short_help="Start a mission of the orchestrator that runs.")
@click.argument("mission")
@click.option(
    "--request",
    "fields",
    metavar="NAME=VALUE",
    multiple=True,
    help="Any field of the mission's request, such as patience='90 s' or amounts=1,5.",
)
@options.domain
def start(mission: str, request: dict[str, Any], fields: tuple[str, ...], domain: int | None) -> int:
    """Start a mission of the orchestrator that runs, and leave it to itself.

    MISSION is its name or that of its file; `lupin state` names those that there are. What is not given of
    its request is left to the mission.
    `lupin run` also brings up what a mission needs, and follows it.

    Exit code: 0 started; 1 refused, with the reason; 2 nobody is there.
    """
    with attendant(domain) as orchestrator:
        if not orchestrator.hear_missions():
            raise nobody()
        offer = _offer(mission, orchestrator.missions)
        name = offer["mission"] if offer else mission
        asked = _together(given_fields(request), _read(fields, offer["request"] if offer else ()))
        return told(orchestrator.command(START_VERB, name, asked))


def _offer(mission: str, missions: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """Return what is told of a mission by its name or its file; None where the orchestrator has none."""
    file = PurePath(mission).stem
    named = [one for one in missions if one["mission"] == mission]
    return next(iter([*named, *(one for one in missions if one.get("file") == file)]), None)


def _read(given: Iterable[str], declared: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return `name=value` as data of the types that are told; the orchestrator checks it.

    Raises:
        UsageError: one of them has no `=`, or lacks its unit: to programs, the orchestrator allows that.
    """
    from lupin_cli.settings import read_value, split
    from lupin_engine.plugin import BUILTIN_TYPES, TEXT, Fault, Notation, list_of, parse_type, problems

    types = {}
    for field in declared:
        try:
            types[field["name"]] = parse_type(field["type"], BUILTIN_TYPES)
        except ValueError:  # a type of a plugin: names of things
            types[field["name"]] = list_of(TEXT) if " of " in field["type"] else TEXT
    texts, wrong = split("--request", given)
    values = {name: read_value(text, types.get(name, TEXT)) for name, text in texts.items()}
    for name, value in values.items():
        found = problems(value, types.get(name, TEXT), Notation.FILE)
        wrong += [f"--request: {one.at(name)}" for one in found if one.fault is Fault.NO_UNIT]
    if wrong:
        raise UsageError("\n".join(wrong))
    return values


def _together(options_: Mapping[str, Any], fields: Mapping[str, Any]) -> dict[str, Any]:
    twice = [name for name in options_ if name in fields]
    if twice:
        raise UsageError(f"{', '.join(twice)}: given by an option of its own and by --request; leave one out")
    return {**options_, **fields}
