"""The verb of a request of the installed profiles, such as `lupin pause`."""

from __future__ import annotations

import click

from lupin_cli import options
from lupin_cli.operator.network import attendant, print_answer

_CODES = "Exit code: 0 accepted; 1 refused, with the reason; 2 no orchestrator answers."


def request_command(verb: str, doc: str) -> click.Command:
    """Return the command of a verb."""

    @click.command(verb, short_help=doc, help=f"{doc}\n\n{_CODES}")
    @options.domain
    def ask(domain: int | None) -> int:
        with attendant(domain) as orchestrator:
            return print_answer(orchestrator.command(verb))

    return ask
