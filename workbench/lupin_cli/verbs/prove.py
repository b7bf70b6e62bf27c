"""`lupin prove`: proves properties of missions by state-space exploration.

Exit codes: 0 everything holds within the bounds that the last line names; 1 something is broken; 2 wrong
usage, or a mission has errors; 3 not shown, because no times were found for a breach, the budget ran out or
it was interrupted, and with `--whole` also because of a bound.
"""

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lupin_cli import options
from lupin_cli.exit_codes import BROKEN, NOT_PROVEN, not_done
from lupin_engine.errors import Diagnostic, UsageError
from lupin_engine.plugin import load_catalog

if TYPE_CHECKING:
    from rich.console import Console

    from lupin_cli.proofs.evidence import Origin
    from lupin_cli.proofs.safety_case import CaseEvidence
    from lupin_engine.chart import Chart
    from lupin_engine.missions import LoadedMissions
    from lupin_engine.replay import FieldEvidence
    from lupin_verify import Bounds, ExplorationProgress, FailingScenario, Proof, ProofTask, Proven


@click.command(short_help="Explore every way that missions can go, without ROS.")
@click.argument("missions", nargs=-1, required=True)
@options.mission_settings
@click.option(
    "--targets",
    type=click.IntRange(0, 8),
    help="Explore itineraries and lists of up to this many elements; default: 2, then 3 and 4 while a fixed"
    " number of transitions lasts. With --outcomes: 2.",
)
@click.option(
    "--late",
    type=click.IntRange(0, 4),
    default=0,
    show_default=True,
    help="Explore late answers, too: to up to this many orders that were already given up.",
)
@click.option("--no-restarts", is_flag=True, help="Leave out restarts of the process, and reloads.")
@click.option(
    "--parameters",
    "every_class",
    is_flag=True,
    help="Prove again for each other value of each parameter that conditions distinguish, one at a time.",
)
@click.option(
    "--outcomes",
    metavar="PAGE.md|new",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Compare each cell of this page of outcomes with what follows in every situation; new: write it,"
    " beside the mission.",
)
@click.option(
    "--list", "listed", is_flag=True, help="List the properties, and where they stand; prove nothing."
)
@click.option(
    "--jobs",
    "-j",
    type=click.IntRange(min=1),
    help="Proofs that run side by side, each in a process of its own; default: one for each core.",
)
@click.option(
    "--budget", metavar="DURATION", help="Stop after this time, for all proofs together, such as '60 s'."
)
@click.option(
    "--whole", is_flag=True, help="Exit with 3 if a proof has bounds: 'proven for ...' is not enough."
)
@click.option("--no-scenarios", is_flag=True, help="Write no failing scenarios beside the mission.")
@click.option(
    "--report",
    metavar="FILE",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write the results into one page: FILE.html, or a safety case as FILE.md.",
)
@options.field
@click.option(
    "--seen",
    "results",
    multiple=True,
    metavar="FILE.json",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="For --report: the output of 'lupin test --json' or 'lupin campaign --json'.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the results as a JSON list, an object a proof.")
@click.option("--quiet", "-q", is_flag=True, help="Print what is broken, and the last line.")
@not_done()
def prove(
    missions: tuple[str, ...],
    settings: tuple[str, ...],
    targets: int | None,
    late: int,
    no_restarts: bool,
    every_class: bool,
    outcomes: Path | None,
    listed: bool,
    jobs: int | None,
    budget: str | None,
    whole: bool,
    no_scenarios: bool,
    report: Path | None,
    field: tuple[Path, ...],
    results: tuple[Path, ...],
    as_json: bool,
    quiet: bool,
) -> int:
    """Explore every way that missions can go, and report the properties that hold in all of them.

    MISSIONS are names of missions or mission files. Servers may answer anything that their catalogs declare,
    or nothing; inputs change; every request comes at any time. For each broken property a failing scenario
    is written beside the mission, named after the property.

    Exit code: 0 everything holds within the bounds that the last line names; 1 something is broken; 2 wrong
    usage, or a mission has errors; 3 not shown: no times were found at which a breach can happen, the budget
    ran out, or it was interrupted; with --whole also if the proof has bounds.
    """
    from lupin_cli.proofs.evidence import origin
    from lupin_cli.settings import settings_in
    from lupin_engine.errors import Problems
    from lupin_engine.missions import load_missions
    from lupin_verify import NEW, Bounds, proof_tasks, prove_tasks

    problems, catalog = Problems(UsageError), load_catalog()
    seconds = None
    with problems.collecting():
        seconds = read_budget("--budget", budget)
    if report is not None and report.suffix not in (".html", ".md"):
        problems.add(f"--report: {str(report)!r} must end in .html or .md")
    if outcomes not in (None, NEW) and not outcomes.is_file():
        problems.add(f"--outcomes: there is no file {str(outcomes)!r}; write 'new' to have the page written")
    loaded = {name: load_missions([name], catalog) for name in missions}
    given = {}
    for name, one in loaded.items():
        given[name], wrong = settings_in("--set", settings, one.chart.parameters)
        problems.add(*wrong)
    problems.raise_any()
    from lupin_cli.proofs.safety_case import read_seen

    seen = read_seen(field, results, catalog)
    if listed:
        _list(list(loaded.values()), seen.field, as_json)
        return 0
    widens = targets is None and outcomes is None
    tasks = [
        task
        for name, one in loaded.items()
        for task in proof_tasks(one, name, given[name], every_class, outcomes, widens)
    ]
    bounds = Bounds(owed=late, restarts=not no_restarts)
    bounds = bounds if targets is None else bounds._replace(targets=targets)
    shown = not (as_json or quiet) and sys.stderr.isatty()
    with _progress_of(tasks, loaded, shown) as show_progress:
        made = prove_tasks(tasks, loaded, bounds, jobs or os.cpu_count() or 1, seconds, show_progress)
    proofs = []
    for task, proof in zip(tasks, made, strict=True):
        one = loaded[task.mission]
        proofs.append((one, proof, _write_scenarios(one, proof, task.parameters, not no_scenarios)))
    if report is not None or as_json:
        made_by = origin(click.get_current_context())
    if report is not None:
        _write_report(report, proofs, made_by, seen)
    if as_json:
        click.echo(json.dumps([_record(*one, made_by) for one in proofs], default=str))
    else:
        for one, proof, written in proofs:
            _show(one, proof, written, quiet, not no_scenarios)
    for one, proof, _ in proofs if outcomes == NEW else ():
        _write_outcomes(one, proof, settings, bounds, as_json)
    return _exit_code([proof for _, proof, _ in proofs], whole)


def _write_report(
    file: Path, proofs: Sequence[tuple[LoadedMissions, Proof, Any]], made_by: Origin, seen: CaseEvidence
) -> None:
    from lupin_cli.files import write_text
    from lupin_cli.proofs.proof_page import proof_page
    from lupin_cli.proofs.safety_case import as_markdown, safety_case

    cases = [(one, proof, safety_case(one, proof, made_by, seen)) for one, proof, _ in proofs]
    if file.suffix == ".md":
        write_text(file, as_markdown(cases))
    else:
        write_text(file, proof_page(proofs, made_by, [case for _, _, case in cases]))


def _list(missions: Sequence[LoadedMissions], field: FieldEvidence | None, as_json: bool) -> None:
    """Print the properties of missions, with what robots have shown of them where there is a journal."""
    if as_json:
        click.echo(json.dumps([_list_record(one, field) for one in missions]))
        return
    for one in missions:
        _show_list(one, field)
    for problem in field.left_out if field is not None else ():
        click.echo(f"left out: {problem}", err=True)


def _list_record(loaded: LoadedMissions, field: FieldEvidence | None) -> dict[str, Any]:
    from lupin_verify import listed

    known = [
        (name, says, None if place is None else place.shown) for name, says, place in listed(loaded.chart)
    ]
    found = [{"name": name, "says": says, "place": place} for name, says, place in known]
    return {"mission": loaded.names[0], "properties": found, "field": field and field.record()}


def _show_list(loaded: LoadedMissions, field: FieldEvidence | None) -> None:
    """Print the properties of a mission, each with its sentence and where it comes from."""
    from lupin_cli.proofs.proof_words import shown_place
    from lupin_verify import listed

    click.echo(loaded.names[0])
    for name, says, place in listed(loaded.chart):
        click.echo(f"  {name}: {says} ({'built in' if place is None else shown_place(loaded, place)})")
        if field is not None and name in loaded.chart.properties:
            click.echo(f"    {field.shown(name)}")
    _show_not_meant(loaded)


def _show_not_meant(loaded: LoadedMissions) -> None:
    from lupin_cli.proofs.proof_words import exemptions

    for name, mission, why in exemptions(loaded.chart):
        click.echo(f"  not meant of {mission}: {name}, because {why}")


def _exit_code(proofs: Sequence[Proof], whole: bool) -> int:
    """Return the exit code of proofs; with `whole` a bound counts as not shown."""
    if any(proof.broken for proof in proofs):
        return BROKEN
    shown = (proof.complete and not proof.not_shown and not (whole and proof.cut) for proof in proofs)
    return 0 if all(shown) and not any(proof.interrupted for proof in proofs) else NOT_PROVEN


def read_budget(option: str, budget: str | None) -> float | None:
    """Read the duration of an option, in seconds; UsageError: it is none."""
    from lupin_engine.plugin import DURATION, convert

    try:
        return None if budget is None else float(convert(budget, DURATION))
    except ValueError as problem:
        raise UsageError(f"{option}: {problem}; write a duration such as '60 s'") from None


def so_far(name: str, progress: ExplorationProgress, took: float) -> str:
    """Return how far a proof is, after some seconds."""
    from lupin_cli.proofs.proof_words import counted

    rate, about = progress.transitions / took, progress.estimate
    done = "" if about is None else f"about {progress.expanded / about:.0%} of {about:,}; "
    return (
        f"{name}: {done}{counted(progress.situations, 'situation')}, {progress.waiting:,} to explore,"
        f" {rate:,.0f} transitions/s, {progress.depth} deep"
    )


@contextmanager
def _progress_of(
    tasks: Sequence[ProofTask], loaded: Mapping[str, LoadedMissions], shown: bool
) -> Iterator[Callable[[int, ExplorationProgress, float], None]]:
    """Show a line for each running proof; yields the function that updates them."""
    from rich.console import Console
    from rich.progress import Progress, TextColumn

    from lupin_cli.proofs.proof_words import name_of

    lines: dict[int, Any] = {}
    bar = Progress(TextColumn("{task.description}"), console=Console(stderr=True), disable=not shown)

    def report(number: int, progress: ExplorationProgress, took: float) -> None:
        task = tasks[number]
        if number not in lines:
            lines[number] = bar.add_task("")
        name = name_of(loaded[task.mission], task.varied)
        bar.update(lines[number], description=so_far(name, progress, took))

    with bar:
        yield report


def prove_within(files: Sequence[Path], seconds: float, verbose: bool) -> tuple[Diagnostic, ...]:
    """Prove missions within a time, shared among them, and return the diagnostics.

    It prints a line for each proof; with `verbose` also the counterexamples. A proof that is not complete in
    time is no error. A part of a file that several missions use counts as unreached if none of them reaches
    it.

    Raises:
        KeyboardInterrupt: it was interrupted; nothing more is proven.
    """
    from lupin_cli.proofs.proof_words import last_line
    from lupin_engine.missions import load_missions
    from lupin_verify import Bounds, ProofTask, findings, prove_tasks

    found: list[list[Diagnostic]] = []
    charts: list[Chart] = []
    for file in files:
        loaded = load_missions([str(file)], load_catalog())
        task, of = ProofTask(str(file), {}, widens=True), {str(file): loaded}
        (proof,) = prove_tasks([task], of, Bounds(), 1, seconds / len(files), lambda *_: None)
        if verbose:
            _show(loaded, proof, {}, quiet=True, wanted=False)
        else:
            click.echo(f"{loaded.names[0]}: {last_line(proof)}", err=True)
        if proof.interrupted:
            raise KeyboardInterrupt
        found.append(findings(proof, str(file)))
        charts.append(proof.chart)
    return tuple(dict.fromkeys(one for each in found for one in each if _is_of_all(one, charts, found)))


def _is_of_all(one: Diagnostic, charts: Sequence[Chart], found: Sequence[Sequence[Diagnostic]]) -> bool:
    """Return whether all missions that use a file have a finding; true of findings of other rules."""
    from lupin_verify import UNREACHED

    users = [of_chart for chart, of_chart in zip(charts, found, strict=True) if one.place.file in chart.files]
    return one.rule != UNREACHED or all(any(_is_same(one, other) for other in of_chart) for of_chart in users)


def _is_same(one: Diagnostic, other: Diagnostic) -> bool:
    return (one.place, one.rule) == (other.place, other.rule)


def _write_scenarios(
    loaded: LoadedMissions, proof: Proof, parameters: Mapping[str, Any], wanted: bool
) -> dict[str, FailingScenario]:
    """Write a scenario that fails for each property that is broken, if wanted; return them by property."""
    if not wanted:
        return {}
    from lupin_cli.files import write_text
    from lupin_engine.sim import Missions
    from lupin_verify import failing_scenario

    written = {}
    missions = Missions(load_catalog())
    for one in proof.broken:
        found = failing_scenario(one, Path(loaded.files[0]), parameters, missions)
        if found is not None:
            write_text(found.file, found.text)
            written[one.name] = found
    return written


def _write_outcomes(
    loaded: LoadedMissions, proof: Proof, settings: Sequence[str], bounds: Bounds, as_json: bool
) -> None:
    """Write the page of outcomes of a mission beside it; none of a proof that is not complete."""
    from lupin_cli.files import write_text
    from lupin_verify import outcome_page

    file = Path(loaded.files[0]).with_suffix(".outcomes.md")
    if not proof.complete:
        click.echo(f"{file} was not written: not everything was explored", err=True)
    elif proof.outcomes:
        command = [Path(loaded.files[0]).stem, *(f"--set {one}" for one in settings)]
        command += [] if bounds.targets == type(bounds)().targets else [f"--targets {bounds.targets}"]
        command += [f"--late {bounds.owed}"] if bounds.owed else []
        command += [] if bounds.restarts else ["--no-restarts"]
        write_text(file, outcome_page(proof.chart, proof.outcomes, " ".join([*command, "--outcomes new"])))
        click.echo(f"wrote {file}", err=as_json)


def _show(
    loaded: LoadedMissions,
    proof: Proof,
    written: Mapping[str, FailingScenario],
    quiet: bool,
    wanted: bool = True,
) -> None:
    from lupin_cli.proofs.proof_words import last_line, name_of, shown_place, tried_only
    from lupin_cli.terminal.outcome import make_console

    console, name = make_console(), name_of(loaded, proof.varied)
    if not quiet:
        click.echo(name)
    for one in proof.properties:
        found = one.verdict in (one.verdict.BROKEN, one.verdict.NOT_SHOWN)
        if found or not quiet:
            mark, about = _MARKS[one.verdict.value]
            click.echo(f"  {mark} {one.name}: {one.says}{about}{tried_only(proof, one)}")
        if found:
            _show_breach(one, written.get(one.name), console, wanted)
    if not quiet:
        _show_not_meant(loaded)
        for part in proof.dead:
            click.echo(f"  warning: {part.sentence(shown_place(loaded, part.place))}")
        click.echo("  What was explored, and its bounds:")
        for text in proof.bounds:
            click.echo(f"    {text}")
    click.echo(f"{name}: {last_line(proof)}")


#: Verdict -> what stands before a property, and after it.
_MARKS = {
    "holds": ("✓", ""),
    "broken": ("✗", ""),
    "not relevant": ("-", " (never applied: no explored step concerns it)"),
    "not proven": ("?", " (not proven)"),
    "not shown": ("?", " (not shown)"),
    "not meant": ("-", " (not meant of this mission)"),
}


def _show_breach(one: Proven, scenario: FailingScenario | None, console: Console, wanted: bool) -> None:
    """Print a counterexample: as steps like `lupin simulate`, or as moves where there is no scenario."""
    from lupin_cli.terminal.outcome import print_lines, show_timeline
    from lupin_engine.replay import exact_columns, timeline
    from lupin_verify import why_none

    click.echo(f"      {one.text}")
    if scenario is not None:
        lines = scenario.lines
        print_lines(lines, exact_columns(lines, console.width), console, lambda _: None)
        show_timeline(timeline(scenario.run), console)
        if scenario.rest:
            click.echo(f"      {scenario.rest}")
        file = shlex.quote(str(scenario.file))
        click.echo(f"      wrote {file}; lupin test {file} shows it again")
        return
    if wanted or one.steps is None:
        click.echo(f"      {why_none(one)}")
    for text in one.moves:
        click.echo(f"      {text}")


def _record(
    loaded: LoadedMissions, proof: Proof, written: Mapping[str, FailingScenario], made_by: Origin
) -> dict[str, Any]:
    from dataclasses import asdict

    from lupin_cli.proofs.evidence import ASSUMPTIONS, NOT_SHOWN, catalogs_hash
    from lupin_engine.runtime import step_record

    return {
        "mission": loaded.names[0],
        "varied": proof.varied,
        "parameters": dict(proof.parameters),
        "chart": loaded.hash,
        "catalogs": catalogs_hash(loaded),
        "made": {**asdict(made_by), "seconds": proof.seconds, "processor": proof.processor},
        "complete": proof.complete,
        "stopped": proof.stopped,
        **asdict(proof.progress),
        "targets": proof.targets,
        "beyond": proof.beyond,
        "cut": list(proof.cut),
        "bounds": list(proof.bounds),
        "assumptions": list(ASSUMPTIONS),
        "not_shown": list(NOT_SHOWN),
        "reached": asdict(proof.reached),
        "taken": sorted(proof.taken),
        "dead": [part.sentence(part.place.shown) for part in proof.dead],
        "properties": [
            {
                "name": one.name,
                "says": one.says,
                "verdict": one.verdict.value,
                "text": one.text,
                "moves": list(one.moves),
                "scenario": str(written[one.name].file) if one.name in written else None,
                "steps": None if one.steps is None else [step_record(step) for step in one.steps],
            }
            for one in proof.properties
        ],
    }
