"""`lupin campaign`: tests a mission in thousands of random worlds; violations become small scenarios."""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Executor
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from lupin_cli import options
from lupin_cli.exit_codes import BROKEN, INTERRUPTED, not_done
from lupin_cli.files import write_text
from lupin_engine.errors import LupinError, Problems, UsageError
from lupin_engine.plugin import load_catalog

if TYPE_CHECKING:
    from lupin_verify import Campaign, CampaignSum, Dealer, Violation

#: How long the scheduler of a cluster has to answer, in seconds.
SCHEDULER_S = 10.0
#: What the address of a scheduler looks like: of another one Dask tells only when its time is over.
_ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://\S+:\d+")


class Written(NamedTuple):
    """The scenario of a violation, after so many runs in `took` s; without a file, `why` is the reason."""

    file: Path | None
    tries: int = 0
    why: str = ""
    took: float = 0.0

    def __str__(self) -> str:
        if self.file is None:
            return self.why
        return f"{self.file}, made smaller by {self.tries} runs in {self.took:.1f} s"


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
    from lupin_verify import Dealer, WorkerProcesses, make_task

    found = _campaign(mission, rates, settings)
    _make_folder(out)
    workers = min(jobs or os.cpu_count() or 1, seeds)
    dealer = Dealer(found, seeds, workers=workers)
    if cluster is not None or workers > 1:
        dealer.executors = (
            (lambda: WorkerProcesses(workers)) if cluster is None else _cluster(cluster, dealer)
        )
        dealer.task = make_task(found.loaded, rates, found.parameters)
    written, stopped = _run(found, dealer, out, show=not quiet and not as_json)
    interrupted = isinstance(stopped, KeyboardInterrupt)
    if as_json:
        record = _record(found, dealer, written)
        click.echo(json.dumps({**record, "interrupted": interrupted}, default=str))
    else:
        _print_result(found, dealer, written, quiet)
        if interrupted:
            click.echo(_interruption_text(dealer))
    if isinstance(stopped, LupinError):
        raise stopped
    if interrupted:
        return INTERRUPTED
    if not dealer.found.missions and not dealer.found.first and found.begins_on_request:
        raise UsageError(f"in {seeds} seeds no mission began: {_why_none_began(found)}")
    return BROKEN if dealer.found.first else 0


def _run(
    campaign: Campaign, dealer: Dealer, out: Path, show: bool
) -> tuple[dict[str, Written], BaseException | None]:
    """Run all seeds, and write the scenarios; return these, and the exception that stopped it or None."""
    written: dict[str, Written] = {}
    try:
        with _progress(dealer, show):
            dealer.run()
        for number, violation in enumerate(dealer.found.first.values(), 1):
            with _status(f"{violation.name}: making its scenario smaller ({number})", show):
                written[violation.name] = _write(campaign, violation, out)
    except (KeyboardInterrupt, LupinError) as stopped:
        return written, stopped
    return written, None


def _interruption_text(dealer: Dealer) -> str:
    if dealer.found.seeds < dealer.seeds:
        return f"interrupted after {dealer.found.seeds} of {dealer.seeds} seeds; the rest was not looked at"
    return "interrupted while scenarios were made smaller; not all of them were written"


def _make_folder(out: Path) -> None:
    """Make the folder of scenarios; UsageError where that is not possible.

    It must exist before scenarios do, because they name the mission relative to it.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise UsageError(f"--out: cannot make the folder {str(out)!r}: {problem.strerror}") from None


def _why_none_began(campaign: Campaign) -> str:
    """Return why the mission of the first seed did not begin."""
    from lupin_verify import CampaignSum

    run = campaign.run(0, CampaignSum())
    refused = [step.refusal for step in run.history.refused if step.refusal] if run is not None else []
    if not refused:
        return "nothing asked for one within the limit; give it a longer 'limit', or look at 'when'"
    return f"mission.start was refused: {refused[0].text}"


def _campaign(mission: str, rates: Path | None, settings: tuple[str, ...]) -> Campaign:
    from lupin_cli.settings import settings_in
    from lupin_engine.missions import load_missions
    from lupin_verify import Campaign, default_rates, read_rates

    loaded, problems = load_missions([mission], load_catalog()), Problems(UsageError)
    if rates is not None and not rates.is_file():
        problems.add(f"no file {str(rates)!r}; without --rates everything goes wrong now and then")
    parameters, wrong = settings_in("--set", settings, loaded.chart.parameters)
    problems.add(*wrong)
    problems.raise_any()
    drawn = default_rates(loaded.chart) if rates is None else read_rates(rates, loaded.chart)
    return Campaign(loaded, drawn, parameters)


# -- who does the work -----------------------------------------------------------------------------------


def _cluster(address: str, dealer: Dealer) -> Callable[[], Executor]:
    """Return a function that makes an executor of a Dask cluster; it raises LupinError once that is lost.

    Raises:
        UsageError: it is no address, Dask is not installed, or no scheduler answers there.
    """
    if not _ADDRESS.fullmatch(address):
        raise UsageError(f"--cluster: {address!r} is no address of a Dask scheduler; write tcp://HOST:PORT")
    try:
        from distributed import Client
        from distributed.scheduler import KilledWorker
    except ImportError:
        raise UsageError("--cluster needs Dask: pip install 'lupin-engine[cluster]'") from None
    try:
        client = Client(address, timeout=SCHEDULER_S, set_as_default=False)
    except (OSError, ValueError) as problem:
        raise UsageError(f"no Dask scheduler answers at {address!r}: {problem}") from None
    workers = len(client.scheduler_info()["workers"])
    dealer.workers = max(1, workers)
    dealer.broken = (*dealer.broken, KilledWorker, CancelledError)
    if not workers:
        click.echo(f"the scheduler at {address} has no workers yet: it begins with the first one", err=True)

    def executor() -> Executor:
        if client.status != "running":
            raise LupinError(f"the Dask scheduler at {address} does not answer any more")
        made: Executor = client.get_executor(pure=False)
        return made

    return executor


# -- what came of it ---------------------------------------------------------------------------------------


def _progress(dealer: Dealer, show: bool) -> Any:
    """Return a context that shows the progress; an empty one where the output is no terminal."""
    from rich.console import Console
    from rich.progress import Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), TimeRemainingColumn())
    bar = Progress(*columns, console=console, transient=True, disable=not show or not console.is_terminal)
    task = bar.add_task("", total=dealer.seeds)
    began = time.perf_counter()

    def report(found: CampaignSum) -> None:
        rate = found.missions / (time.perf_counter() - began)
        text = f"{found.seeds} of {dealer.seeds} seeds, {rate:.0f} missions/s, {len(found.pairs)} pairs"
        violated = f", violated: {', '.join(sorted(found.first))}" if found.first else ""
        bar.update(task, completed=found.seeds, description=text + violated)

    dealer.report = report
    return bar


def _status(text: str, show: bool) -> AbstractContextManager[Any]:
    """Return a context that shows a text; an empty one where the output is no terminal."""
    from rich.console import Console

    console = Console(stderr=True)
    return console.status(text) if show and console.is_terminal else nullcontext()


def _write(campaign: Campaign, violation: Violation, out: Path) -> Written:
    """Write a violation as a scenario, as small as can be."""
    from lupin_engine.sim import SUFFIX, Missions
    from lupin_verify import Minimiser

    file = out / f"{violation.name}_{violation.seed}{SUFFIX}"
    missions, mission = Missions(campaign.chart.catalog), campaign.loaded.files[0]
    minimiser = Minimiser(violation.name, campaign.watched[violation.name], file, mission, missions)
    began = time.perf_counter()
    try:
        text = minimiser.text(campaign.recorded(violation), campaign.script(violation.seed))
    except UsageError as problem:
        return Written(None, minimiser.tries, str(problem))
    write_text(file, text)
    return Written(file, minimiser.tries, took=time.perf_counter() - began)


def _print_result(campaign: Campaign, dealer: Dealer, written: dict[str, Written], quiet: bool) -> None:
    found = dealer.found
    if not quiet:
        width = max(map(len, campaign.watched))
        click.echo(f"{'property':{width}}  looked at  violated by")
        for name in campaign.watched:
            violated = f"{found.violated[name]} seeds" if found.violated[name] else "-"
            click.echo(f"{name:{width}}  {found.relevant[name] or 'never':>9}  {violated}")
        _print_coverage(campaign, found)
    for violation in found.first.values():
        when = f"at {violation.time:.1f} s of seed {violation.seed}"
        click.echo(f"{violation.name} is violated {when}: {violation.text}")
        if violation.name in written:
            click.echo(f"    {written[violation.name]}")
    days = found.seconds / 86400.0
    rate = found.missions / max(found.processor, 1e-9)
    click.echo(
        f"{found.seeds} seeds, {found.missions} missions, {days:.1f} days of operation, {found.steps} steps"
        f" in {dealer.took:.1f} s: {rate:.0f} missions a second of processor"
    )


def _print_coverage(campaign: Campaign, found: CampaignSum) -> None:
    missed = campaign.never_taken(found)
    click.echo(f"transitions taken: {campaign.can_be_taken - len(missed)} of {campaign.can_be_taken}")
    for rule in missed:
        click.echo(f"    never: {rule.id} ({rule.place})")
    for state in campaign.never_entered(found):
        click.echo(f"    never entered: {state.name} ({state.place})")
    chance = 100.0 * found.chance_of_new
    click.echo(
        f"pairs of transitions: {len(found.pairs)}, the last new one by seed {found.last_new};"
        f" the chance that the next seed brings one is about {chance:.1f} %"
    )


def _record(campaign: Campaign, dealer: Dealer, written: dict[str, Written]) -> dict[str, Any]:
    found = dealer.found
    return {
        "mission": campaign.rates.script.mission,
        "rates": campaign.rates.name,
        "chart": campaign.loaded.hash,
        "seeds": found.seeds,
        "missions": found.missions,
        "steps": found.steps,
        "virtual_seconds": round(found.seconds, 3),  # sums of fractions depend on their order
        "took": dealer.took,
        "processor": found.processor,
        "lost_batches": dealer.lost,
        "properties": [
            {
                "name": name,
                "says": says,
                "looked_at": found.relevant[name],
                "violated_by": found.violated[name],
            }
            for name, says in campaign.watched.items()
        ],
        "violated": [{**vars(one), **_record_of(written.get(one.name))} for one in found.first.values()],
        "ended": dict(sorted(found.ended.items())),
        "transitions": dict(sorted(found.transitions.items())),
        "never_taken": [rule.id for rule in campaign.never_taken(found)],
        "never_entered": [state.name for state in campaign.never_entered(found)],
        "pairs": len(found.pairs),
        "last_new_pair": found.last_new,
        "chance_of_new_pair": found.chance_of_new,
    }


def _record_of(written: Written | None) -> dict[str, Any]:
    if written is None:
        return {"scenario": None, "why_none": "interrupted", "made_smaller_in": 0.0}
    return {"scenario": written.file, "why_none": written.why, "made_smaller_in": written.took}
