"""`lupin test`: scenarios against missions, one line each, failures explained."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import click

from lupin_engine.errors import LupinError, UsageError
from lupin_engine.plugin.registry import Catalog, load_catalog
from lupin_engine.sim.scenario import Charts, chart_loader, load_scenario, scenario_files

#: Where scenarios are looked for when none is named, nearest first.
_PLACES = (Path("scenarios"), Path("tests/scenarios"))


@click.command(short_help="Run scenarios against missions, without ROS.")
@click.argument("paths", nargs=-1, type=click.Path(path_type=Path))
def test(paths: tuple[Path, ...]) -> int:
    """Run scenarios against missions, without ROS.

    PATHS are scenario files (*.scenario.yaml) or folders of them; without any, the folder scenarios or
    tests/scenarios is taken. Exit code: 0 when every scenario holds, else 1.
    """
    catalog = load_catalog()
    charts = chart_loader(catalog)
    files = scenario_files(paths or _default())
    failed = [file for file in files if not _holds(file, catalog, charts)]
    count = f"{len(files)} scenario{'s' if len(files) != 1 else ''}"
    click.echo(f"{len(failed)} of {count} failed" if failed else f"{count}: all hold")
    return 1 if failed else 0


command = test


def _default() -> Iterable[Path]:
    for place in _PLACES:
        if place.is_dir():
            return [place]
    raise UsageError(f"name scenario files or a folder; neither {_PLACES[0]} nor {_PLACES[1]} is here")


def _holds(file: Path, catalog: Catalog, charts: Charts) -> bool:
    """Run one scenario and tell how it went; a scenario that cannot be read is one that fails."""
    try:
        scenario = load_scenario(file, catalog, charts)
        run = scenario.run()
    except LupinError as problem:
        click.echo(f"{click.style('ERROR', fg='red')} {file}\n{problem}")
        return False
    failures = scenario.failures(run)
    word = click.style("FAIL ", fg="red") if failures else click.style("ok   ", fg="green")
    click.echo(f"{word} {file.name.partition('.')[0]}: {scenario.promise} ({run.seconds:.1f} s)")
    for failure in failures:
        click.echo(str(failure))
    return not failures
