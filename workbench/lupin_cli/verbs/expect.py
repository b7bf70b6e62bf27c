"""`lupin expect`: predicts how long a mission takes, what is left, and which targets it misses."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lupin_cli import options
from lupin_cli.exit_codes import not_done
from lupin_engine.errors import Problems, UsageError

if TYPE_CHECKING:
    from lupin_engine.chart import Chart
    from lupin_verify import Expected, Rates

#: How many remarks and targets are printed.
_MOST = 8


@click.command(
    cls=options.RequestCommand, short_help="Predict how long a mission will take, and what it misses."
)
@click.argument("mission")
@options.fields
@options.mission_settings
@click.option(
    "--rates",
    type=click.Path(path_type=Path, dir_okay=False),
    default=options.LEARNED,
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
    from lupin_cli.settings import settings_in
    from lupin_cli.verbs.simulate import check_clock, simulation_task, with_rates
    from lupin_engine.plugin import Parameter
    from lupin_engine.sim import Happening, SetValue
    from lupin_verify import expect as run_all

    problems = Problems(UsageError)
    task = simulation_task(problems, mission, request, fields, settings, None, started=True)
    inputs = [(name, one) for one in task.chart.inputs.values() for name in (one.name, one.value)]
    known = {name: Parameter(one.type, None, one.value) for name, one in inputs}
    began, wrong = settings_in("--value", values, known)
    problems.add(*wrong)
    with problems.collecting():
        check_clock(clock)
    with problems.collecting():
        task, learned = with_rates(task, mission, rates, settings)
    problems.raise_any()
    script = replace(task.script, clock=clock or task.script.clock)
    reports = (Happening(SetValue(known[name].doc, value)) for name, value in began.items())
    script = replace(script, happenings=(*script.happenings, *reports))
    found = run_all(task.loaded, learned, script, task.world, range(seeds))
    name = task.loaded.names[0]
    if as_json:
        click.echo(json.dumps({"mission": name, **_record(found, learned)}))
    else:
        for line in _lines(name, found, learned, task.chart):
            click.echo(line)
    return int(bool(found.stuck))


def p50_p90(values: Sequence[float], much: float = 0.9) -> list[float]:
    """Return what half of some values keep to, and a share of `much`."""
    import numpy as np

    return [float(found) for found in np.quantile(values, (0.5, much))]


def _record(found: Expected, rates: Rates) -> dict[str, Any]:
    def both(values: Sequence[float], much: float) -> dict[str, float] | None:
        return dict(zip(("p50", "p90"), p50_p90(values, much), strict=True)) if values else None

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
        "missed": both(found.missed, 0.9),
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
