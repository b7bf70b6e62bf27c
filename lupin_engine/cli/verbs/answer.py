"""`lupin answer`: what a mission asks the operator, and the answer."""

from __future__ import annotations

import click

from lupin_engine.cli import options
from lupin_engine.errors import Problems, UsageError, nearest
from lupin_engine.ros.launch.environment import close_the_doors, current_domain

#: How long an orchestrator is waited for, in seconds.
_PATIENCE_S = 3.0


@click.command(short_help="Show what a mission asks the operator, and answer it.")
@click.argument("choice", required=False)
@options.domain
def answer(choice: str | None, domain: int | None) -> int:
    """Answer what a running mission asks; without a CHOICE, show the question.

    Exit code: 0 answered or shown; 1 nothing is asked, or the answer was refused; 2 nobody is there.
    """
    from lupin_engine.ros.launch.requirements import prepare_ros

    problems = Problems(UsageError)
    with problems.collecting():
        close_the_doors(domain)
    with problems.collecting():
        prepare_ros()
    problems.tell()
    from lupin_engine.cli.terminal.view import default_text
    from lupin_engine.ros.operator import Respondent

    respondent = Respondent()
    try:
        asked = respondent.asked(_PATIENCE_S)
        if asked is None:
            raise UsageError(f"no orchestrator speaks in ROS domain {current_domain()}; give --domain")
        if choice is not None:
            known = [name for question in asked for name, _ in question.choices]
            if asked and choice not in known:
                raise UsageError(f"{choice!r} is no choice; {nearest(choice, known)}")
            said = respondent.answer(choice, _PATIENCE_S) if asked else None
            click.echo(said.text if said is not None else "nothing is asked")
            return 0 if said is not None and said.accepted else 1
    finally:
        respondent.close()
    for question in asked:
        click.echo(question.question)
        width = max(len(name) for name, _ in question.choices)
        for name, label in question.choices:
            click.echo(f"  {name:<{width}}  {label}")
        click.echo(f"  {default_text(question)}")
    if not asked:
        click.echo("nothing is asked")
    return 0 if asked else 1
