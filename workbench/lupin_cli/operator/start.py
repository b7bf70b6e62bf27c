"""`lupin start`: starts a mission of the orchestrator on the network."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePath
from typing import Any

import click

from lupin_cli import options
from lupin_cli.operator.network import attendant, nobody, print_answer
from lupin_engine.errors import UsageError
from lupin_engine.plugin import (
    BUILTIN_TYPES,
    START_VERB,
    TEXT,
    Fault,
    Type,
    given_fields,
    parse_type,
)


@click.command(cls=options.RequestCommand, short_help="Start a mission of the orchestrator that runs.")
@click.argument("mission")
@options.fields
@options.domain
def start(mission: str, request: dict[str, Any], fields: tuple[str, ...], domain: int | None) -> int:
    """Start a mission of the orchestrator that runs, and leave it to itself.

    MISSION is its name or that of its file; `lupin state` names the available ones. Fields of its request
    that are not given have their defaults.
    `lupin run` also starts the nodes that a mission needs, and follows it.

    Exit code: 0 started; 1 refused, with the reason; 2 wrong usage, or no orchestrator answers.
    """
    with attendant(domain) as orchestrator:
        if not orchestrator.hear_missions():
            raise nobody()
        offer = _offer(mission, orchestrator.missions)
        name = offer["mission"] if offer else mission
        asked = _asked(given_fields(request), fields, offer["request"] if offer else ())
        return print_answer(orchestrator.command(START_VERB, name, asked))


def _offer(mission: str, missions: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """Return the catalogue's entry of a mission by its name or its file; None where there is none."""
    file = PurePath(mission).stem
    named = [one for one in missions if one["mission"] == mission]
    return next(iter([*named, *(one for one in missions if one.get("file") == file)]), None)


def _asked(
    options_: Mapping[str, Any], given: Iterable[str], declared: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Return the request as data of the types that the orchestrator publishes; it checks the rest.

    Raises:
        UsageError: a field is given twice, has no `=`, or lacks its unit, which programs may leave out.
    """
    from lupin_cli.requests import fields_in, given_twice

    fields, wrong = fields_in(given, {one["name"]: _type(one) for one in declared}, {Fault.NO_UNIT})
    wrong += given_twice(options_, fields)
    if wrong:
        raise UsageError("\n".join(wrong))
    return {**options_, **fields}


def _type(published: Mapping[str, Any]) -> Type:
    """Return a published type; values of a plugin's type are written as names of things."""
    kind, name = published.get("kind", "name"), published["type"].rpartition(" of ")[2]
    fields = {each: _type(inner) for each, inner in published.get("fields", {}).items()}
    of = Type(kind, name, unit=published.get("unit", ""), fields=fields)
    known = {name: TEXT if kind in ("name", "list") else of, **BUILTIN_TYPES}
    return parse_type(published["type"], known)
