"""`lupin learn`: learns from journals how long everything takes and how often it fails."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click

from lupin_cli import options
from lupin_cli.exit_codes import not_done
from lupin_cli.files import write_text
from lupin_engine.errors import LupinError, UsageError
from lupin_engine.plugin import load_catalog

if TYPE_CHECKING:
    from lupin_verify import Drift, Evidence, ObservedAttempt

#: How a file begins that may be written anew.
_OURS = 'campaign: "learned from '


@click.command(short_help="Learn times and failures from the journal, for simulations.")
@click.argument("recordings", nargs=-1, type=click.Path(path_type=Path, dir_okay=False))
@options.domain
@options.journal
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path, dir_okay=False),
    default=options.LEARNED,
    show_default=True,
    help="The file of rates that is written.",
)
@click.option("--drift", "drift_only", is_flag=True, help="Write nothing: print what became slower, where.")
@click.option("--json", "as_json", is_flag=True, help="Print what was learned as one JSON object.")
@not_done()
def learn(
    recordings: tuple[Path, ...],
    domain: int | None,
    journal: Path | None,
    output: Path,
    drift_only: bool,
    as_json: bool,
) -> int:
    """Learn from the journal what every operation takes and how often it fails.

    RECORDINGS are files of `lupin record` or `lupin run --record`, which are read in place of the journal.
    Attempts are counted by target, by the metres driven and by the hour of day; so is what live values lose.
    The file is for `lupin expect`, `lupin simulate --rates` and `lupin campaign --rates`.

    Exit code: 0 learned, or with --drift nothing has changed; 1 --drift has found something; 2 there is no
    journal, or no mission in it could be used.
    """
    from lupin_cli.terminal.findings import counted
    from lupin_verify import NEEDED, compared, drifts, table

    if not drift_only:
        _check_output(output)
    found = _gathered(recordings, journal, domain)
    changed = drifts(found.seen)
    learned = {} if drift_only else table(found)
    if not drift_only:
        from lupin_engine.replay import yaml_text

        write_text(output, yaml_text(learned))
    if as_json:
        changes = [asdict(one) | {"slower": one.slower if one.slower < math.inf else None} for one in changed]
        record = {"file": None if drift_only else str(output), "drift": changes, "left_out": found.left_out}
        click.echo(json.dumps(record if drift_only else {**record, "rates": learned}))
        return int(drift_only and bool(changed))
    for problem in found.left_out:
        click.echo(f"left out: {problem}", err=True)
    if not drift_only:
        _print_table(found, learned)
    for one in changed:
        click.echo(_drift_text(one))
    if not drift_only:
        click.echo(f"wrote {output}: {learned['campaign']}")
    elif not changed:
        enough, places = compared(found.seen)
        few = f"{places - enough} of {places} operations at a target have fewer than {NEEDED} attempts"
        click.echo(f"nothing has become slower in {counted(found.missions, 'mission')}; not compared: {few}")
    return int(drift_only and bool(changed))


def _gathered(recordings: Sequence[Path], journal: Path | None, domain: int | None) -> Evidence:
    """Return the evidence of recordings; without any, of a journal.

    Raises:
        UsageError: no mission can be used, or both recordings and a journal are named.
    """
    from rich.console import Console

    from lupin_engine.runtime import journal_folder
    from lupin_verify import Evidence, gather

    if recordings and journal:
        raise UsageError("--journal: recordings are read in place of a journal; name either")
    found, left_out, where = Evidence(), list[str](), "these recordings"
    with TemporaryDirectory(prefix="lupin-learn-") as name, Console(stderr=True).status("") as shown:
        if not recordings:
            where = str(journal or journal_folder(domain=domain))
        if not recordings or _unpack(recordings, Path(name), left_out):
            found = gather(Path(name if recordings else where), load_catalog(), shown.update)
    found.left_out[:0] = left_out
    if not found.seen:
        why = "".join(f"\n    {problem}" for problem in found.left_out)
        raise UsageError(f"no mission in {where} could be learned from{why or '; none was run'}")
    return found


def _unpack(recordings: Sequence[Path], folder: Path, left_out: list[str]) -> bool:
    """Unpack the journals of recordings; return whether there is one. The others are added to `left_out`."""
    from lupin_cli.recording import open_recording

    for file in recordings:
        try:
            recording = open_recording(file)
            from lupin_ros.recording import unpack_learnable  # needs packages, which are there now

            unpack_learnable(recording, folder)
        except LupinError as problem:
            left_out.append(str(problem))
    return len(left_out) < len(recordings)


def _check_output(file: Path) -> None:
    """Check that a file may be written: one that was not learned is kept."""
    try:
        ours = not file.exists() or file.read_text(encoding="utf-8", errors="replace").startswith(_OURS)
    except OSError as problem:
        raise UsageError(f"--output: cannot read {str(file)!r}: {problem.strerror}") from None
    if not ours:
        raise UsageError(f"--output: {str(file)!r} is there and was not written by learn; name another file")


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
    for head in ("operation", "attempts", "failed", "p50", "p90", "slowest at", "slowest hour"):
        shown.add_column(head)
    rows: defaultdict[str, list[ObservedAttempt]] = defaultdict(list)
    for one in found.seen:
        rows[one.operation].append(one)
    for operation, row in sorted(rows.items()):
        shown.add_row(operation, *_cells(row))
    make_console().print(shown)
    for one in learned["drain"]:
        driving = f"{one['per_metre']} per metre and " if "per_metre" in one else ""
        rates = f"loses {driving}{one['per_minute']} per minute"
        click.echo(f"{one['value']}: {rates} ({one['metres']:g} m, {one['minutes']:g} min)")


def _cells(row: Sequence[ObservedAttempt]) -> Iterator[str]:
    from lupin_cli.verbs.expect import p50_p90
    from lupin_engine.replay import lasting

    took = [one.seconds for one in row if not one.code]
    failed = len(row) - len(took)
    yield str(len(row))
    yield f"{failed} ({failed / len(row):.1%})" if failed else "-"
    yield from map(lasting, p50_p90(took)) if took else "--"
    yield _slowest((one.target, one.seconds) for one in row if not one.code)
    yield _slowest((f"{one.hour} h", one.seconds) for one in row if not one.code)


def _slowest(durations: Iterable[tuple[str, float]]) -> str:
    """Return the place or hour with the longest median; '' where fewer than two have enough attempts."""
    from lupin_engine.replay import lasting
    from lupin_verify import ENOUGH

    rows = defaultdict[str, list[float]](list)
    for name, seconds in durations:
        rows[name].append(seconds)
    medians = {name: median(row) for name, row in rows.items() if name and len(row) >= ENOUGH}
    slow = max(medians, key=lambda name: medians[name], default="")
    return f"{slow} ({lasting(medians[slow])})" if len(medians) > 1 else ""
