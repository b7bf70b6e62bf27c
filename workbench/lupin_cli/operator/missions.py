"""`lupin missions`: lists the missions of the journal, with their times and ends."""

from __future__ import annotations

import json
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lupin_cli import options
from lupin_cli.exit_codes import not_done

if TYPE_CHECKING:
    from lupin_engine.replay import JournaledRun


@click.command(short_help="List the missions that were run, and how they ended.")
@options.domain
@options.journal
@click.option("--json", "as_json", is_flag=True, help="Print them as one JSON list.")
@not_done()
def missions(domain: int | None, journal: Path | None, as_json: bool) -> int:
    """List the missions that were run, the newest last, and how they ended.

    The orchestrator keeps a journal of each ROS domain; no robot need be there to read it.

    Exit code: 0 listed, 2 there is no journal.
    """
    from lupin_engine.replay import runs_of
    from lupin_engine.runtime import journal_folder

    runs = [run for run in runs_of(journal or journal_folder(domain=domain)) if run.mission_id]
    if as_json:
        click.echo(json.dumps([_record(run) for run in runs]))
        return 0
    from rich.table import Table

    from lupin_cli.terminal.outcome import make_console

    table = Table(box=None, pad_edge=False)
    for head in ("id", "mission", "began", "took", "ended in", "outcomes", ""):
        table.add_column(head)
    for run in runs:
        table.add_row(*_row(run))
    make_console().print(table)
    return 0


def _row(run: JournaledRun) -> tuple[str, ...]:
    from lupin_engine.replay import lasting

    end = run.end
    counts = {name: n for name, n in (end or {}).items() if isinstance(n, int) and name != "total" and n}
    outcomes = ", ".join(f"{n} {name}" for name, n in counts.items())
    restarts = f"restarted {run.restarts} times" if run.restarts > 1 else "restarted" if run.restarts else ""
    return (
        run.mission_id,
        run.mission,
        f"{datetime.fromtimestamp(run.began).astimezone():%Y-%m-%d %H:%M:%S %Z}",
        lasting(run.last - run.began),
        " ".join(filter(None, (end["state"], end["code"]))) if end else "not ended",
        f"{outcomes} of {end['total']}" if end and end.get("total") else outcomes,
        "; ".join(filter(None, (restarts, *run.problems))),
    )


def _record(run: JournaledRun) -> dict[str, Any]:
    return {
        "mission_id": run.mission_id,
        "mission": run.mission,
        "began": run.began,
        "last": run.last,
        "end": run.end,
        "restarts": run.restarts,
        "chart": run.files[0].head.chart,
        "files": [str(file.path) for file in run.files],
        "problems": run.problems,
    }
