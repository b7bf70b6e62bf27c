"""`lupin state`: shows the state of the orchestrator on the network, and its available requests."""

from __future__ import annotations

import contextlib
import functools
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from lupin_cli import options
from lupin_cli.exit_codes import ACCEPTED
from lupin_cli.operator.network import attendant, last_published, nobody
from lupin_engine.plugin import Profile, load_profiles

if TYPE_CHECKING:
    from lupin_ros.launch import Attendant, Published

#: How often what is watched is looked at, in seconds.
WATCH_PERIOD_S = 0.25


@click.command(short_help="Show the state of the orchestrator, and its available requests.")
@click.option("--watch", is_flag=True, help="Show it again whenever it changes, until Ctrl-C.")
@click.option("--json", "as_json", is_flag=True, help="Write it as a JSON object; with --watch, one a line.")
@options.domain
def state(watch: bool, as_json: bool, domain: int | None) -> int:
    """Show the state of the orchestrator, and its available requests.

    Exit code: 0 shown; 2 no orchestrator answers.
    """
    if not watch:
        found = _look(last_published(domain))
        click.echo(json.dumps(found, indent=2) if as_json else _text(found))
        return ACCEPTED
    with attendant(domain) as orchestrator:
        if not orchestrator.hear():
            raise nobody()
        _watch(orchestrator, as_json)
    return ACCEPTED


@functools.cache
def _profiles() -> list[Profile]:
    return load_profiles()


def _look(published: Published) -> dict[str, Any]:
    from lupin_cli.operator.look import look

    return look(published.steps, published.possible, published.offer, published.now)


def _text(found: Mapping[str, Any]) -> str:
    from lupin_cli.operator.look import lines

    verbs = {name: verb for profile in _profiles() for name, verb in profile.verbs.items()}
    return "\n".join(lines(found, verbs))


#: What is told of an orchestrator that is not there.
_NOBODY = {"lifecycle": ""}


def _text_of(found: Mapping[str, Any] | None) -> str:
    return _text(found) if found else str(nobody())


def _watch(orchestrator: Attendant, as_json: bool) -> None:
    """Show it again and again until Ctrl-C, also when the orchestrator goes and comes back."""
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    from lupin_ros.launch import Interrupts

    console = Console(highlight=False)
    in_place = console.is_terminal and not console.is_dumb_terminal and not as_json
    shown: Any = None
    screen = Live(console=console, auto_refresh=False) if in_place else contextlib.nullcontext()
    # Counted: an exception that comes while an object is being freed would be lost.
    with Interrupts() as interrupts, screen as live:
        while not interrupts.count:
            found = _look(orchestrator) if orchestrator.is_there() else None
            text = _text_of(found)
            news = _lasting(found) if live is None else text
            if news != shown and live is not None:
                live.update(Text(text), refresh=True)
            elif news != shown:
                click.echo(json.dumps(found or _NOBODY) if as_json else f"{text}\n")
            shown = news
            orchestrator.spin(WATCH_PERIOD_S)


def _lasting(found: Mapping[str, Any] | None) -> Any:
    """Return the fields whose change is shown: all that do not change by time alone."""
    if found is None:
        return None
    asked = [question["question"] for question in found["asking"]]
    return {**found, "seconds": None, "asking": asked}
