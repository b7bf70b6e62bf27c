"""`lupin expect`: predicts how long a mission takes, what is left, and which targets it misses."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lupin_cli import options
from lupin_cli.exit_codes import not_done
from lupin_cli.learned import LEARNED, learned_rates
from lupin_engine.errors import Problems, UsageError, nearest
from lupin_engine.plugin import load_catalog

if TYPE_CHECKING:
    from lupin_engine.chart import Chart
    from lupin_verify import Expected, Rates

#: How many remarks and targets are printed.
_MOST = 8


@click.command(cls=options.RequestCommand, short_help="Tell how long a mission will take and what it misses.")
@click.argument("mission")
@options.fields
@options.mission_settings
@click.option(
    "--rates",
    type=click.Path(path_type=Path, dir_okay=False),
    default=LEARNED,
    show_default=True,
    help="What was learned from the robot, by `lupin learn`.",
)
@click.option(
    "--value",
    "values",
    metavar="NAME=VALUE",
    multiple=True,
    help="A live value at the beginning, by the mission's name or the plugin's.",
)
@click.option("--clock", metavar="DATE TIME", help="When it begins, such as '2026-11-22 22:00'.")
@click.option("--seeds", type=click.IntRange(min=10), default=200, show_default=True, help="How many runs.")
@click.option("--json", "as_json", is_flag=True, help="Print all that is expected as one JSON object.")
@not_done()
def expect(
    mission: str,
    request: dict[str, Any],
    fields: tuple[str, ...],
    settings: tuple[str, ...],
    rates: Path,
    values: tuple[str, ...],
    clock: str | None,
    seeds: int,
    as_json: bool,
) -> int:
    """Predict time, remaining inputs and missed targets of a mission, from the rates learned of the robot.

    The mission runs once for each seed, in virtual time. p50 is what half of the runs keep to, p90 what nine
    of ten do. Rates that were learned from too few attempts are named.

    Exit code: 0 every run came to its end; 1 some did not; 2 nothing can be predicted.
    """
    from lupin_cli.requests import check_complete, check_fields, request_in
    from lupin_cli.settings import settings_in
    from lupin_engine.missions import load_missions
    from lupin_engine.runtime import UTC, calendar_of
    from lupin_verify import expect as run_all
    from lupin_verify import learned_script

    loaded, problems = load_missions([mission], load_catalog()), Problems(UsageError)
    with problems.collecting():
        check_fields(loaded, request)
    asked, wrong = request_in(loaded, request, fields)
    problems.add(*wrong)
    with problems.collecting():
        check_complete(loaded, asked)
    parameters, wrong = settings_in("--set", settings, loaded.chart.parameters)
    problems.add(*wrong)
    began, wrong = _values_in(values, loaded.chart)
    problems.add(*wrong)
    try:
        calendar_of(UTC).moment(clock or "2026-01-01 00:00")
    except ValueError as problem:
        problems.add(f"--clock: {problem}")
    known = None
    with problems.collecting():
        known = learned_rates(rates, loaded.chart)
    problems.raise_any()
    assert known is not None, "else there was a problem"
    script = learned_script(known, loaded.names[0], asked, began, clock)
    found = run_all(loaded, known, script, {**known.parameters, **parameters}, range(seeds))
    if as_json:
        click.echo(json.dumps({"mission": loaded.names[0], **_record(found, known)}))
    else:
        for line in _lines(loaded.names[0], found, known, loaded.chart):
            click.echo(line)
    return int(bool(found.stuck))


def _values_in(given: Iterable[str], chart: Chart) -> tuple[dict[str, Any], list[str]]:
    """Return the live values given as `name=value`, by the plugin's name, and their problems."""
    from lupin_cli.settings import read_value, split
    from lupin_engine.plugin import convert

    texts, wrong = split("--value", given)
    inputs = chart.inputs.values()
    named = {one.value: one for one in inputs} | {one.name: one for one in inputs}
    found = {}
    for name, text in texts.items():
        if name not in named:
            wrong.append(f"--value: no live value {name!r}; {nearest(name, named)}")
            continue
        try:
            found[named[name].value] = convert(read_value(text, named[name].type), named[name].type)
        except ValueError as problem:
            wrong.append(f"--value: {name}: {problem}")
    return found, wrong


def _record(found: Expected, rates: Rates) -> dict[str, Any]:
    from lupin_verify import quantile

    def both(values: list[float], much: float) -> dict[str, float] | None:
        if not values:
            return None
        return {"p50": quantile(sorted(values), 0.5), "p90": quantile(sorted(values), much)}

    learned = rates.learned
    about = (
        None if learned is None else {"missions": learned.missions, "from": learned.from_, "to": learned.to}
    )
    return {
        "rates": rates.name,
        "learned": about,
        "runs": found.runs,
        "targets": found.targets,
        "seconds": both(found.seconds, 0.9),
        "left": {name: both(levels, 0.1) for name, levels in found.left.items()},
        "missed": both([float(count) for count in found.missed], 0.9),
        "missed_at": dict(found.missed_at.most_common()),
        "not_ended": dict(found.stuck.most_common()),
        "remarks": found.remarks,
    }


def _lines(mission: str, found: Expected, rates: Rates, chart: Chart) -> Iterator[str]:
    from lupin_engine.replay import lasting

    word, record = chart.profile.terminal.target, _record(found, rates)
    yield f"{mission}, {found.targets} {word}s: {found.runs} runs in virtual time, {rates.name}"
    if found.seconds:
        rows = [("", "p50", "p90", ""), ("duration", *map(lasting, record["seconds"].values()), "")]
        for name, levels in record["left"].items():
            texts = (_level(chart, name, level) for level in levels.values())
            rows.append((f"{name} left", *texts, "9 of 10 runs keep at least that"))
        often = (f"{n} in {count / found.runs:.0%}" for n, count in found.missed_at.most_common(_MOST))
        counts = (f"{count:.0f}" for count in record["missed"].values())
        rows.append((f"{word}s missed", *counts, ", ".join(often)))
        width = max(len(row[0]) for row in rows)
        for label, half, most, note in rows:
            yield f"{label:{width}}  {half:>9}  {most:>9}  {note}".rstrip()
    for why, count in found.stuck.most_common(_MOST):
        yield f"{count} of {found.runs} runs did not come to an end: {why}"
    yield from _some(found.remarks)


def _some(remarks: list[str]) -> Iterator[str]:
    yield from remarks[:_MOST]
    if len(remarks) > _MOST:
        yield f"and {len(remarks) - _MOST} more like these; --json has all"


def _level(chart: Chart, name: str, level: float) -> str:
    kind = chart.catalog.values[name].type
    is_share = (kind.minimum, kind.maximum) == (0.0, 1.0)
    return f"{level:.1%}" if is_share else f"{level:g}"
