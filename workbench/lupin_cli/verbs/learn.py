"""`lupin learn`: learns from the journal how long everything takes and how often it fails."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lupin_cli import options
from lupin_cli.exit_codes import not_done
from lupin_cli.files import write_text
from lupin_cli.learned import LEARNED
from lupin_engine.errors import UsageError
from lupin_engine.plugin import load_catalog

if TYPE_CHECKING:
    from lupin_verify import Drift, Evidence

#: How a file begins that may be written anew.
_OURS = 'campaign: "learned from '


@click.command(short_help="Learn times and failures from the journal, for simulations.")
@options.domain
@options.journal
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path, dir_okay=False),
    default=LEARNED,
    show_default=True,
    help="The file of rates that is written.",
)
@click.option("--drift", "drift_only", is_flag=True, help="Write nothing: tell what became slower, where.")
@click.option("--json", "as_json", is_flag=True, help="Print what was learned as one JSON object.")
@not_done()
def learn(domain: int | None, journal: Path | None, output: Path, drift_only: bool, as_json: bool) -> int:
    """Learn from the journal what every operation takes and how often it fails.

    It counts by target, by the metres driven and by the hour of day, and what live values lose. The file is
    for `lupin expect`, `lupin simulate --rates` and `lupin campaign --rates`.

    Exit code: 0 learned, or with --drift nothing has changed; 1 --drift has found something; 2 there is no
    journal, or no mission in it could be used.
    """
    from lupin_engine.runtime import journal_folder
    from lupin_verify import drifts, gather, table

    folder = journal or journal_folder(domain=domain)
    if not drift_only:
        _check_output(output)
    with _progress() as report:
        found = gather(folder, load_catalog(), report)
    if not found.seen:
        why = "".join(f"\n    {problem}" for problem in found.left_out)
        raise UsageError(f"no mission in {folder} could be learned from{why or '; none was run'}")
    changed = drifts(found.seen)
    learned = {} if drift_only else table(found)
    if not drift_only:
        from lupin_engine.replay import yaml_text

        write_text(output, yaml_text(learned))
    if as_json:
        told = [asdict(one) | {"slower": _finite(one.slower)} for one in changed]
        record = {"file": None if drift_only else str(output), "drift": told, "left_out": found.left_out}
        click.echo(json.dumps(record if drift_only else {**record, "rates": learned}))
        return int(drift_only and bool(changed))
    for problem in found.left_out:
        click.echo(f"left out: {problem}", err=True)
    if not drift_only:
        _print_table(found, learned)
    for one in changed:
        click.echo(_drift_text(one))
    if drift_only and not changed:
        click.echo(f"nothing has become slower in {found.missions} missions")
    elif not drift_only:
        click.echo(f"wrote {output}: {learned['campaign']}")
    return int(drift_only and bool(changed))


def _check_output(file: Path) -> None:
    """Check that a file may be written: one that was not learned is kept."""
    try:
        ours = not file.exists() or file.read_text(encoding="utf-8", errors="replace").startswith(_OURS)
    except OSError as problem:
        raise UsageError(f"--output: cannot read {str(file)!r}: {problem.strerror}") from None
    if not ours:
        raise UsageError(f"--output: {str(file)!r} is there and was not written by learn; name another file")


def _finite(share: float) -> float | None:
    return None if math.isinf(share) else share


def _drift_text(one: Drift) -> str:
    since = f"{datetime.fromtimestamp(one.since).astimezone():%Y-%m-%d %H:%M}"
    where = f"{one.operation} at {one.target}" if one.target else one.operation
    if one.failed:
        return f"{where}: {one.failed} of the last {one.newest} failed, more than before, since {since}"
    return (
        f"{where}: the last {one.newest} took {one.slower:.0%} longer than {one.before} before, since {since}"
    )


def _print_table(found: Evidence, learned: dict[str, Any]) -> None:
    from rich.table import Table

    from lupin_cli.terminal.outcome import make_console

    shown = Table(box=None, pad_edge=False)
    for head in ("operation", "attempts", "failed", "p50", "p90", "slowest at", "hours that differ"):
        shown.add_column(head)
    for row in _rows(found, learned):
        shown.add_row(*row)
    make_console().print(shown)
    for one in learned["drain"]:
        driving = f"{one['per_metre']} per metre and " if "per_metre" in one else ""
        rates = f"loses {driving}{one['per_minute']} per minute"
        click.echo(f"{one['value']}: {rates} ({one['metres']:g} m, {one['minutes']:g} min)")


def _rows(found: Evidence, learned: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    from lupin_engine.replay import lasting
    from lupin_verify import ENOUGH, quantile

    took = defaultdict[str, dict[str, list[float]]](lambda: defaultdict(list))
    attempts = {name: sum(row.values()) for name, row in learned["learned"]["seen"].items()}
    for one in found.seen:
        if not one.code:
            took[one.operation][one.target].append(one.seconds)
    for name, count in attempts.items():
        by_target = {target: _median(row) for target, row in took[name].items() if len(row) >= ENOUGH}
        every = sorted(second for row in took[name].values() for second in row)
        slow = max(by_target, key=lambda target: by_target[target], default="")
        times = (lasting(quantile(every, 0.5)), lasting(quantile(every, 0.9))) if every else ("-", "-")
        where = f"{slow} ({lasting(by_target[slow])})" if slow and len(by_target) > 1 else ""
        failed = count - len(every)
        share = f"{failed} ({failed / count:.1%})" if failed else "-"
        yield name, str(count), share, *times, where, "; ".join(_hours(learned["hours"], name))


def _median(values: Sequence[float]) -> float:
    from lupin_verify import quantile

    return quantile(sorted(values), 0.5)


def _hours(hours: list[dict[str, Any]], name: str) -> Iterator[str]:
    for one in hours:
        differs = [f"{key} {one[key]}" for key in ("takes", "fails") if key in one]
        if one["do"] == name and differs:
            yield f"{one['hour']} h {', '.join(differs)}"


@contextmanager
def _progress() -> Iterator[Callable[[str], object]]:
    """Yield a function that shows the progress, where the error output is a terminal."""
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda text: None
        return
    with console.status("reading the journal") as shown:
        yield lambda text: shown.update(f"reading the journal: {text}")
