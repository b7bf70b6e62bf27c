"""`lupin answer`: shows the open question of a mission, or answers it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from lupin_cli import options
from lupin_cli.exit_codes import ACCEPTED, REFUSED
from lupin_cli.operator.network import attendant, last_published, nobody, print_answer
from lupin_engine.errors import UsageError, nearest
from lupin_engine.plugin import ANSWER_VERB

if TYPE_CHECKING:
    from lupin_engine.runtime import OpenQuestion


@click.command(short_help="Show the open question of a mission, or answer it.")
@click.argument("choice", required=False)
@options.domain
def answer(choice: str | None, domain: int | None) -> int:
    """Answer the open question of a mission; without a CHOICE, show it.

    Exit code: 0 answered or shown; 1 nothing is asked, or the answer was refused; 2 no orchestrator answers,
    or there is no such choice.
    """
    if choice is None:
        return _show(last_published(domain).asked())
    with attendant(domain) as orchestrator:
        if not orchestrator.hear():
            raise nobody()
        asked = orchestrator.asked()
        if not asked:
            return _show(asked)
        known = [name for question in asked for name, _ in question.choices]
        if choice not in known:
            raise UsageError(f"{choice!r} is no choice; {nearest(choice, known)}")
        return print_answer(orchestrator.command(ANSWER_VERB, request={"choice": choice}))


def _show(asked: Sequence[OpenQuestion]) -> int:
    """Print the open questions and return the exit code."""
    from lupin_cli.terminal.words import default_text

    for question in asked:
        click.echo(question.question)
        width = max(len(name) for name, _ in question.choices)
        for name, label in question.choices:
            click.echo(f"  {name:<{width}}  {label}")
        click.echo(f"  {default_text(question)}")
    if not asked:
        click.echo("nothing is asked")
    return ACCEPTED if asked else REFUSED
