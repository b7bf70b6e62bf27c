"""`lupin why`: explains a target, a state or a moment by its chain of causes, from the journal alone."""

from __future__ import annotations

import json
import re
import shutil
import textwrap
from collections.abc import Iterator
from dataclasses import asdict
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lupin_cli import options
from lupin_cli.exit_codes import not_done
from lupin_engine.errors import UsageError
from lupin_engine.plugin import load_catalog

if TYPE_CHECKING:
    from lupin_engine.replay import Cause, Explanation, Inquiry, JournaledRun

_CLOCK = re.compile(r"(?:(\d{4}-\d\d-\d\d)[ T])?(\d?\d):(\d\d)(?::(\d\d))?$")
#: How wide a line is where there is no terminal, in cells.
_WIDTH = 110
#: Cells before the text of a line: the time of day.
_INDENT = 11


@click.command(short_help="Say why a target, a state or a moment came about, from the journal.")
@click.argument("about", nargs=-1)
@click.option("--at", metavar="TIME", help="A moment instead: '03:12', or '2026-11-23 03:12:07'.")
@click.option("--in", "mission_id", metavar="MISSION_ID", default="", help="Default: the newest mission.")
@click.option("--depth", type=click.IntRange(min=1), default=5, help="Most causes that are shown.")
@click.option(
    "--timeline", "picture", metavar="FILE", help="Draw the run over time into FILE.svg or FILE.png."
)
@options.domain
@options.journal
@click.option("--json", "as_json", is_flag=True, help="Print the explanation as one JSON object.")
@not_done()
def why(
    about: tuple[str, ...],
    at: str | None,
    mission_id: str,
    depth: int,
    picture: str | None,
    domain: int | None,
    journal: Path | None,
    as_json: bool,
) -> int:
    """Say why: `lupin why 12` (a target), `lupin why STATE`, `lupin why PROPERTY`, `lupin why --at 03:12`.

    ABOUT is a target of the mission, a state by any name that displays have for it, or a broken property.
    The answer has the events, the transitions with the values that their conditions read, and the servers'
    answers.

    Exit code: 0 explained, 2 wrong usage, or the journal has no answer.
    """
    from lupin_engine.replay import Inquiry, chart_of, covering, replay_run, run_called, runs_of
    from lupin_engine.runtime import journal_folder

    if bool(about) is (at is not None):
        raise UsageError("say what about: a target, a state, a property, or --at TIME")
    runs = runs_of(journal or journal_folder(domain=domain))
    if at is not None and not mission_id:
        moment = _moment(at, runs[-1].last)
        run = covering(runs, moment)
    else:
        run = run_called(runs, mission_id)
        moment = _moment(at, run.last) if at is not None else 0.0
    chart = chart_of(run, load_catalog()).chart
    lived, machine = replay_run(run, chart)
    inquiry = Inquiry(chart, lived, depth)
    found = (
        inquiry.moment(moment) if at is not None else _asked(inquiry, about, chart.profile.terminal.target)
    )
    if picture is not None:
        from lupin_cli.terminal.outcome import draw
        from lupin_engine.replay import as_run, timeline

        draw(timeline(as_run(chart, lived, machine)), Path(picture))
    if as_json:
        click.echo(json.dumps(_record(run, found), default=str))
        return 0
    click.echo(f"{_title(run)}: {found.text}")
    for line in (line for cause in found.causes for line in _lines(cause)):
        click.echo(line)
    return 0


def _asked(inquiry: Inquiry, about: tuple[str, ...], target: str) -> Explanation:
    """Return the cause of the subject: a target after the word for one, else a property, a state or a target.

    Raises:
        NothingKnown: it is none of them in this run.
    """
    from lupin_engine.replay import NothingKnown

    name = " ".join(about[1:]) if about[0].lower() == target and len(about) > 1 else ""
    if name:
        return inquiry.target(name)
    name = " ".join(about)
    if inquiry.is_property(name):
        return inquiry.breach(name)
    try:
        return inquiry.state(name)
    except NothingKnown as unknown:
        if inquiry.is_state(name):
            raise
        try:
            return inquiry.target(name)
        except NothingKnown as also:
            if inquiry.is_property(name, misspelt=True):
                return inquiry.breach(name)
            raise NothingKnown(f"{unknown}\n{also}") from None


def _moment(text: str, last: float) -> float:
    """Return a moment in POSIX time; a time of day is the last one before the end of the recorded run.

    Raises:
        UsageError: the text is neither a time nor a time of day.
    """
    found = _CLOCK.fullmatch(text.strip())
    end = datetime.fromtimestamp(last)
    try:
        if found is None:
            raise ValueError
        date = datetime.fromisoformat(found[1]) if found[1] else end
        when = date.replace(hour=int(found[2]), minute=int(found[3]), second=int(found[4] or 0))
    except ValueError:
        raise UsageError(f"--at: {text!r} is no time; write '03:12' or '2026-11-23 03:12:07'") from None
    if not found[1] and when > end:
        when -= timedelta(days=1)
    return when.replace(microsecond=0).timestamp()


def _title(run: JournaledRun) -> str:
    date = f"{datetime.fromtimestamp(run.began).astimezone():%Y-%m-%d %Z}"
    return f"{run.mission} {run.mission_id}, {date}" if run.mission_id else date


def _lines(cause: Cause) -> Iterator[str]:
    """Yield a cause as lines: the event, the transitions, the commands, and the conditions."""
    time = f"{datetime.fromtimestamp(cause.wall):%H:%M:%S}" if cause.wall is not None else ""
    by = f" (by {cause.by})" if cause.by else ""
    texts = [
        f"{cause.line.event}{by}",
        *([f"-> {cause.line.moved}"] if cause.line.moved else []),
        *(text for text, _ in (*cause.line.commanded, *cause.line.codes)),
        *(f"because {reason}" for reason in cause.reasons),
        *(f"({note})" for note in cause.line.notes),
    ]
    width = shutil.get_terminal_size((_WIDTH, 24)).columns
    for number, text in enumerate(texts):
        first = f"{time:<{_INDENT}}" if number == 0 else " " * _INDENT
        yield from textwrap.wrap(text, width, initial_indent=first, subsequent_indent=" " * (_INDENT + 3))


def _record(run: JournaledRun, found: Explanation) -> dict[str, Any]:
    return {
        "mission_id": run.mission_id,
        "mission": run.mission,
        "text": found.text,
        "causes": [
            {
                "wall": cause.wall,
                "by": cause.by,
                **asdict(cause.line),
                "because": [
                    {
                        "transition": one.transition,
                        "file": one.place.file,
                        "line": one.place.line,
                        "guard": one.guard,
                        "read": dict(one.read),
                    }
                    for one in cause.reasons
                ],
            }
            for cause in found.causes
        ],
    }
