"""`lupin campaign`: thousands of random worlds in virtual time; what is violated becomes a scenario."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lupin_engine.cli import options
from lupin_engine.cli.exit_codes import BROKEN, INTERRUPTED, not_done
from lupin_engine.cli.files import write_text
from lupin_engine.errors import Problems, UsageError
from lupin_engine.plugin.registry import load_catalog

if TYPE_CHECKING:
    from lupin_engine.verify.campaign import Campaign, CampaignSum, Violation
    from lupin_engine.verify.dealing import Dealer

#: How long the scheduler of a cluster has to answer, in seconds.
SCHEDULER_S = 10.0


@click.command(short_help="Run a mission in thousands of random worlds.")
@click.argument("mission")
@click.option("--seeds", type=click.IntRange(min=1), default=1000, show_default=True, help="How many worlds.")
@click.option(
    "--rates",
    type=click.Path(path_type=Path, dir_okay=False),
    help="How often what goes wrong (YAML); without it everything does now and then.",
)
@options.mission_settings
@click.option(
    "--jobs", "-j", type=click.IntRange(min=1), help="Worker processes; default: one for each core."
)
@click.option(
    "--cluster", metavar="tcp://HOST:PORT", help="Workers of a Dask scheduler (extra `cluster`) do the work."
)
@click.option(
    "--out",
    "-o",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path(),
    help="Folder for the scenarios of what is violated; default: this one.",
)
@click.option("--json", "as_json", is_flag=True, help="Print all that came of it as one JSON object.")
@click.option("--quiet", "-q", is_flag=True, help="Print what is violated and the last line only.")
@not_done()
def campaign(
    mission: str,
    seeds: int,
    rates: Path | None,
    settings: tuple[str, ...],
    jobs: int | None,
    cluster: str | None,
    out: Path,
    as_json: bool,
    quiet: bool,
) -> int:
    """Run a mission in thousands of random worlds, and watch every step.

    Servers fail, fall silent, answer late; people ask for everything at any time; sensors change. Properties
    that hold of every mission, and those that the mission states, are watched. Of each that is violated the
    shortest run is made as small as can be and written as a scenario, which `lupin test` runs.

    Exit code: 0 nothing is violated; 1 something is; 2 it could not be run; 130 interrupted.
    """
    from lupin_engine.verify.dealing import Dealer, WorkerProcesses, make_task

    found = _campaign(mission, rates, settings)
    workers = min(jobs or os.cpu_count() or 1, seeds)
    dealer = Dealer(found, seeds, workers=workers)
    if cluster or workers > 1:
        dealer.executors = _cluster(cluster, dealer) if cluster else lambda: WorkerProcesses(workers)
        dealer.task = make_task(found.loaded, rates, found.parameters)
    began, interrupted = time.perf_counter(), False
    try:
        with _progress(dealer, show=not quiet and not as_json):
            dealer.run()
    except KeyboardInterrupt:
        interrupted = True
    took = time.perf_counter() - began
    written = {
        violation.name: _write(found, violation, out)
        for violation in dealer.found.first.values()
        if not interrupted
    }
    if as_json:
        record = _record(found, dealer, took, written)
        click.echo(json.dumps({**record, "interrupted": interrupted}, default=str))
    else:
        _tell(found, dealer.found, took, written, quiet)
        if interrupted:
            click.echo(f"interrupted after {dealer.found.seeds} of {seeds} seeds; the rest was not looked at")
    return INTERRUPTED if interrupted else BROKEN if dealer.found.first else 0


def _campaign(mission: str, rates: Path | None, settings: tuple[str, ...]) -> Campaign:
    from lupin_engine.cli.settings import settings_in
    from lupin_engine.missions.selection import load_missions
    from lupin_engine.verify.campaign import Campaign
    from lupin_engine.verify.rates import default_rates, read_rates

    loaded, problems = load_missions([mission], load_catalog()), Problems(UsageError)
    if rates is not None and not rates.is_file():
        problems.add(f"no file {str(rates)!r}; without --rates everything goes wrong now and then")
    parameters, wrong = settings_in("--set", settings, loaded.chart.parameters)
    problems.add(*wrong)
    problems.tell()
    drawn = default_rates(loaded.chart) if rates is None else read_rates(rates, loaded.chart)
    return Campaign(loaded, drawn, parameters)


# -- who does the work -----------------------------------------------------------------------------------


def _cluster(address: str, dealer: Dealer) -> Callable[[], Executor]:
    """Return what makes an executor of a Dask cluster."""
    try:
        from distributed import Client
    except ImportError:
        raise UsageError("--cluster needs Dask: pip install 'lupin-engine[cluster]'") from None
    try:
        client = Client(address, timeout=SCHEDULER_S, set_as_default=False)
    except (OSError, ValueError) as problem:
        raise UsageError(f"no Dask scheduler answers at {address!r}: {problem}") from None
    dealer.workers = max(1, len(client.scheduler_info()["workers"]))

    def executor() -> Executor:
        made: Executor = client.get_executor(pure=False)
        return made

    return executor


# -- what came of it ---------------------------------------------------------------------------------------


def _progress(dealer: Dealer, show: bool) -> Any:
    """Return what shows how far it is, while it is entered; nothing where nobody watches."""
    from rich.console import Console
    from rich.progress import Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), TimeRemainingColumn())
    bar = Progress(*columns, console=console, transient=True, disable=not show or not console.is_terminal)
    task = bar.add_task("", total=dealer.seeds)
    began = time.perf_counter()

    def told(found: CampaignSum) -> None:
        rate = found.missions / (time.perf_counter() - began)
        text = f"{found.seeds} of {dealer.seeds} seeds, {rate:.0f} missions/s, {len(found.pairs)} pairs"
        violated = f", violated: {', '.join(sorted(found.first))}" if found.first else ""
        bar.update(task, completed=found.seeds, description=text + violated)

    dealer.told = told
    return bar


def _write(campaign: Campaign, violation: Violation, out: Path) -> str:
    """Write a violation as a scenario, as small as can be; return the file, or why there is none."""
    from lupin_engine.sim import SUFFIX
    from lupin_engine.sim.scenario import Missions
    from lupin_engine.verify.minimise import Minimiser

    file = out / f"{violation.name}_{violation.seed}{SUFFIX}"
    says = {one.name: one.says for one in campaign.properties}
    missions, mission = Missions(campaign.chart.catalog), campaign.loaded.files[0]
    minimiser = Minimiser(violation.name, says.get(violation.name, violation.text), file, mission, missions)
    try:
        text = minimiser.text(campaign.recorded(violation), campaign.script(violation.seed))
    except UsageError as problem:
        return str(problem)
    out.mkdir(parents=True, exist_ok=True)
    write_text(file, text)
    return f"{file}, by {minimiser.tries} runs"


def _tell(campaign: Campaign, found: CampaignSum, took: float, written: dict[str, str], quiet: bool) -> None:
    if not quiet:
        width = max(len(one.name) for one in campaign.properties)
        click.echo(f"{'property':{width}}  looked at  violated by")
        for one in campaign.properties:
            violated = f"{found.violated[one.name]} seeds" if found.violated[one.name] else "-"
            looked = found.relevant[one.name] or "never"
            click.echo(f"{one.name:{width}}  {looked:>9}  {violated}")
        _tell_coverage(campaign, found)
    for violation in found.first.values():
        when = f"at {violation.time:.1f} s of seed {violation.seed}"
        click.echo(f"{violation.name} is violated {when}: {violation.text}")
        if violation.name in written:
            click.echo(f"    {written[violation.name]}")
    days = found.seconds / 86400.0
    rate = found.missions / max(found.processor, 1e-9)
    click.echo(
        f"{found.seeds} seeds, {found.missions} missions, {days:.1f} days of operation, {found.steps} steps"
        f" in {took:.1f} s: {rate:.0f} missions a second of processor"
    )


def _tell_coverage(campaign: Campaign, found: CampaignSum) -> None:
    missed = campaign.never_taken(found)
    click.echo(f"transitions taken: {campaign.can_be_taken - len(missed)} of {campaign.can_be_taken}")
    for rule in missed:
        click.echo(f"    never: {rule.id} ({rule.place})")
    chance = 100.0 * found.chance_of_new
    click.echo(
        f"pairs of transitions: {len(found.pairs)}, the last new one by seed {found.last_new};"
        f" the chance that the next seed brings one is about {chance:.1f} %"
    )


def _record(campaign: Campaign, dealer: Dealer, took: float, written: dict[str, str]) -> dict[str, Any]:
    found = dealer.found
    return {
        "mission": campaign.rates.script.mission,
        "rates": campaign.rates.name,
        "chart": campaign.loaded.hash,
        "seeds": found.seeds,
        "missions": found.missions,
        "steps": found.steps,
        "virtual_seconds": found.seconds,
        "took": took,
        "processor": found.processor,
        "lost_batches": dealer.lost,
        "properties": [
            {
                "name": one.name,
                "says": one.says,
                "looked_at": found.relevant[one.name],
                "violated_by": found.violated[one.name],
            }
            for one in campaign.properties
        ],
        "violated": [
            {**vars(violation), "scenario": written.get(violation.name, "")}
            for violation in found.first.values()
        ],
        "ended": dict(found.ended),
        "transitions": dict(sorted(found.transitions.items())),
        "never_taken": [rule.id for rule in campaign.never_taken(found)],
        "pairs": len(found.pairs),
        "last_new_pair": found.last_new,
        "chance_of_new_pair": found.chance_of_new,
    }
