"""`lupin test`: runs scenarios against missions; prints a line for each, failures, and coverage."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lupin_cli import options
from lupin_cli.files import write_text
from lupin_engine.errors import Problems, UsageError
from lupin_engine.plugin import Catalog, load_catalog
from lupin_engine.sim import SUFFIX

if TYPE_CHECKING:
    from lupin_cli.field import FieldTable
    from lupin_engine.replay import Coverage
    from lupin_engine.sim import ScenarioResult

#: Where scenarios are looked for when none is named, nearest first.
_PLACES = (Path("scenarios"), Path("tests/scenarios"))


@click.command(short_help="Run scenarios against missions, without ROS.")
@click.argument("paths", nargs=-1, type=click.Path(path_type=Path))
@click.option("--seed", type=int, default=0, help="Added to the seeds of random scenarios.")
@click.option(
    "--seeds", type=click.IntRange(min=1), default=1, help="Run random scenarios with so many seeds."
)
@click.option("--coverage", "covers", is_flag=True, help="Tell what no scenario reached.")
@click.option(
    "--min-coverage", type=click.FloatRange(0, 100), metavar="PERCENT", help="Fail when less was reached."
)
@click.option(
    "--coverage-diagram",
    "drawing",
    metavar="FILE.svg",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Draw the mission coloured by what was reached; of several missions each into FILE-MISSION.svg.",
)
@options.field
@click.option(
    "--seen",
    "results",
    multiple=True,
    metavar="FILE.json",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="With --field: compare also with the output of 'lupin prove --json' or 'lupin campaign --json'.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.option("--quiet", "-q", is_flag=True, help="Print failures and the last line only.")
@click.option(
    "--record",
    "recording",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Make a scenario of a recorded run: the output of 'lupin simulate --json', or steps.",
)
@click.option("-o", "output", type=click.Path(path_type=Path), help="The scenario that --record makes.")
def test(
    paths: tuple[Path, ...],
    seed: int,
    seeds: int,
    covers: bool,
    min_coverage: float | None,
    drawing: Path | None,
    field: tuple[Path, ...],
    results: tuple[Path, ...],
    as_json: bool,
    quiet: bool,
    recording: Path | None,
    output: Path | None,
) -> int:
    """Run scenarios against missions, without ROS.

    PATHS are scenario files (*.scenario.yaml) or folders of them; without any, the folder scenarios or
    tests/scenarios is taken, and the scenarios of lupin prove beside the missions in missions. To choose by
    name, to share the work between processes and to write JUnit XML, run them with pytest:
    pytest scenarios -k abort -n auto --junitxml report.xml

    Exit code: 0 when every scenario holds and enough was reached, else 1; 2 when there is nothing to run,
    or an argument is wrong.
    """
    from lupin_cli.field import FieldTable
    from lupin_engine.replay import CoverageObserver, add_up, field_evidence
    from lupin_engine.sim import Missions, Suite

    catalog = load_catalog()
    if recording is not None or output is not None:
        return _make_scenario(recording, output, paths, catalog)
    files = _checked(paths, drawing)
    counts = bool(covers or min_coverage is not None or drawing is not None or field)
    suite = Suite(catalog, CoverageObserver() if counts else None)
    tried = []
    for file in files:
        tried.append(suite.run(file, range(seed, seed + seeds)))
        if not as_json:
            _show(tried[-1], quiet)
    coverage = add_up(tried, Missions(catalog)) if counts else None
    if coverage is not None and drawing is not None:
        _draw(coverage, drawing)
    happened = FieldTable(coverage, field_evidence(field, catalog), results) if coverage and field else None
    return _verdict(tried, coverage, min_coverage, as_json, happened)


def _verdict(
    results: Sequence[ScenarioResult],
    coverage: Coverage | None,
    min_coverage: float | None,
    as_json: bool,
    happened: FieldTable | None,
) -> int:
    """Print the sum of all scenarios, and return the exit code."""
    if as_json:
        more = {"field": happened.record()} if happened is not None else {}
        click.echo(json.dumps({**_record(results, coverage), **more}, default=str))
    else:
        _sum_up(results, coverage)
        for line in happened.lines() if happened is not None else ():
            click.echo(line)
    enough = coverage is None or min_coverage is None or coverage.percent >= min_coverage
    if not enough and not as_json:
        click.echo(f"less than {min_coverage:g} % was reached")
    return 0 if enough and all(result.holds for result in results) else 1


def _checked(paths: Sequence[Path], drawing: Path | None) -> list[Path]:
    """Return the chosen files.

    Raises:
        UsageError: with all problems of the arguments.
    """
    problems, files = Problems(UsageError), list[Path]()
    with problems.collecting():
        files = _chosen(paths)
    if drawing is not None and drawing.suffix != ".svg":
        problems.add(f"{str(drawing)!r} must end in .svg")
    problems.raise_any()
    return files


def _chosen(paths: Sequence[Path]) -> list[Path]:
    """Return the files to run; UsageError when there are none."""
    from lupin_engine.sim import scenario_files

    return scenario_files(paths or _default())


def _default() -> Iterable[Path]:
    """Return the nearest folder of scenarios, and the scenarios in `missions`, as `lupin prove` writes them.

    Raises:
        UsageError: there is neither.
    """
    folder = next(([place] for place in _PLACES if place.is_dir()), [])
    found = [*folder, *sorted(Path("missions").glob(f"*{SUFFIX}"))]
    if found:
        return found
    raise UsageError(f"name scenario files or a folder; neither {_PLACES[0]} nor {_PLACES[1]} is here")


def _make_scenario(
    recording: Path | None, output: Path | None, paths: Sequence[Path], catalog: Catalog
) -> int:
    """Make a scenario of a recorded run, and return the exit code 0.

    Raises:
        UsageError: all problems of the arguments, or the run does not come out again as recorded.
    """
    from lupin_engine.replay import read_recording, scenario_text
    from lupin_engine.sim import Missions, is_scenario

    if recording is None or output is None or paths:
        raise UsageError("write 'lupin test --record RUN.json -o NAME.scenario.yaml'")
    problems = Problems(UsageError)
    if not is_scenario(output.name):
        problems.add(f"{str(output)!r} must end in {SUFFIX}")
    if output.exists():
        problems.add(f"{str(output)!r} exists; remove it, or choose another name")
    with problems.collecting():
        recorded = read_recording(_text(recording), str(recording))
    problems.raise_any()
    promise = f"{recorded.mission} as it was recorded in {recording.name}"
    write_text(output, scenario_text(recorded, promise, output, Missions(catalog)))
    click.echo(f"wrote {output}")
    return 0


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise UsageError(f"cannot read {str(file)!r}: {problem}") from None


def _draw(coverage: Coverage, file: Path) -> None:
    """Draw every tested mission, coloured by the coverage of its scenarios."""
    from lupin_engine.diagram import Counts, coloured, outline, svg
    from lupin_engine.replay import STATES, TRANSITIONS

    for mission, (chart, reached) in coverage.charts.items():
        states = {name: count for (kind, name, _), count in reached.items() if kind == STATES}
        ways = {name: count for (kind, name, _), count in reached.items() if kind == TRANSITIONS}
        picture = coloured(outline(chart), Counts(states, ways, "reached by scenarios; pale: never"))
        alone = len(coverage.charts) == 1
        write_text(file if alone else file.with_name(f"{file.stem}-{mission.stem}.svg"), svg(picture))


def _show(result: ScenarioResult, quiet: bool) -> None:
    """Print the result of a scenario; one that cannot be read fails."""
    from lupin_engine.sim import failure

    styles: dict[str, dict[str, Any]] = {
        failure.HEAD: {"bold": True},
        failure.EXPECTED: {"fg": "green"},
        failure.ACTUAL: {"fg": "red"},
        failure.CARET: {"fg": "yellow"},
        failure.CHART: {"fg": "cyan"},
        failure.STORY: {"dim": True},
        failure.MARKED: {"bold": True},
    }
    if result.problem:
        click.echo(f"{click.style('ERROR', fg='red')} {result.file}\n{result.problem}")
    elif result.failures or not quiet:
        word = click.style("FAIL ", fg="red") if result.failures else click.style("ok   ", fg="green")
        click.echo(f"{word} {result.name}: {result.promise} ({_how(result)})")
    for warning in result.warnings:
        click.echo(click.style(str(warning), fg="yellow"))
    for kind, line in failure.failure_lines(result.failures):
        click.echo(click.style(line, **styles.get(kind, {})))


def _how(result: ScenarioResult) -> str:
    """Return the virtual time, and the seed where there was something to draw."""
    lasted = f"{result.seconds:.1f} s"
    if result.seed is None:
        return lasted
    if result.failures:
        return f"{lasted}, with --seed {result.seed}"
    return f"{lasted}, {result.runs} seeds" if result.runs > 1 else f"{lasted}, seed {result.seed}"


def _sum_up(results: Sequence[ScenarioResult], coverage: Coverage | None) -> None:
    from lupin_engine.replay import coverage_lines

    if coverage is not None:
        click.echo("\n".join(("", *coverage_lines(coverage), "")))
    failed = sum(1 for result in results if not result.holds)
    count = f"{len(results)} scenario{'s' if len(results) != 1 else ''}"
    click.echo(f"{failed} of {count} failed" if failed else f"{count}: all hold")


def _record(results: Sequence[ScenarioResult], coverage: Coverage | None) -> dict[str, Any]:
    """Return the results as JSON data."""
    record: dict[str, Any] = {
        "scenarios": [_result_record(result) for result in results],
        "failed": sum(1 for result in results if not result.holds),
    }
    if coverage is not None:
        record["coverage"] = coverage.record()
    return record


def _result_record(result: ScenarioResult) -> dict[str, Any]:

    failures = [
        {
            "place": failure.place.shown,
            "what": failure.what,
            "expected": failure.expected,
            "actual": failure.actual,
            "concerned": [{"place": place.shown, "what": what} for what, place in failure.concerned],
            "story": list(failure.story),
        }
        for failure in result.failures
    ]
    return {
        "file": str(result.file),
        "name": result.name,
        "promise": result.promise,
        "holds": result.holds,
        "problem": result.problem,
        "warnings": [str(warning) for warning in result.warnings],
        "seconds": result.seconds,
        "took": round(result.took, 6),
        "seed": result.seed,
        "runs": result.runs,
        "failures": failures,
    }
