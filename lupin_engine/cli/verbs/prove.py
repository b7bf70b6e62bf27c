"""`lupin prove`: every way that missions can go, and what holds in all of them.

Exit codes: 0 all that was asked holds; 1 something is broken; 2 wrong usage, or a mission has errors; 3 not
proven, because the budget ran out or somebody interrupted.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from lupin_engine.cli.exit_codes import BROKEN, NOT_PROVEN, not_done
from lupin_engine.errors import LupinError, UsageError
from lupin_engine.plugin.registry import load_catalog

if TYPE_CHECKING:
    from lupin_engine.missions.load import LoadedMissions
    from lupin_engine.verify.explorer import ExplorationProgress
    from lupin_engine.verify.proof import Proof, Proven

#: So often a line tells how far it is, in seconds.
_EVERY = 1.0


@click.command(short_help="Look at every way that missions can go, without ROS.")
@click.argument("missions", nargs=-1, required=True)
@click.option(
    "--set", "settings", metavar="NAME=VALUE", multiple=True, help="A parameter, such as monitoring_sweeps=2."
)
@click.option(
    "--targets", type=click.IntRange(0, 8), default=2, show_default=True, help="Longest itinerary and list."
)
@click.option(
    "--late",
    type=click.IntRange(0, 4),
    default=0,
    show_default=True,
    help="So many operations that nobody waits for may still answer at any later time.",
)
@click.option("--no-restarts", is_flag=True, help="The process does not end in the midst of a mission.")
@click.option("--budget", metavar="DURATION", help="Stop after so much time, such as '60 s'.")
@click.option("--json", "as_json", is_flag=True, help="Print what was found as one JSON object.")
@click.option("--quiet", "-q", is_flag=True, help="Print what is broken, and the last line.")
@not_done()
def prove(
    missions: tuple[str, ...],
    settings: tuple[str, ...],
    targets: int,
    late: int,
    no_restarts: bool,
    budget: str | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Look at every way that missions can go, and tell what holds in all of them.

    MISSIONS are names of missions or mission files. Servers may answer anything that their catalogs declare,
    late, twice or never; inputs change; every request comes at any time.

    Exit code: 0 everything holds; 1 something is broken; 2 wrong usage, or a mission has errors; 3 not
    proven: the budget ran out, or it was interrupted.
    """
    from lupin_engine.cli.settings import settings_in
    from lupin_engine.errors import Problems
    from lupin_engine.missions.selection import load_missions
    from lupin_engine.runtime.setup import make_world
    from lupin_engine.verify.explorer import Bounds

    problems, catalog = Problems(UsageError), load_catalog()
    seconds = None
    with problems.collecting():
        seconds = _seconds(budget)
    loaded = [load_missions([name], catalog) for name in missions]
    worlds = []
    for one in loaded:
        parameters, wrong = settings_in("--set", settings, one.chart.parameters)
        problems.add(*wrong)
        worlds.append((one, parameters))
    problems.tell()
    bounds = Bounds(targets, late, not no_restarts)
    proofs = []
    for one, parameters in worlds:
        tell = _progress(one.names[0], seconds, not (as_json or quiet) and sys.stderr.isatty())
        proofs.append((one, _proven(one, make_world(one.chart, parameters), bounds, tell)))
    if as_json:
        click.echo(json.dumps([_record(one, proof) for one, proof in proofs], default=str))
    else:
        for one, proof in proofs:
            _show(one, proof, quiet)
    if any(proof.broken for _, proof in proofs):
        return BROKEN
    return 0 if all(proof.complete for _, proof in proofs) else NOT_PROVEN


def _seconds(budget: str | None) -> float | None:
    from lupin_engine.plugin.types import DURATION, convert

    try:
        return None if budget is None else float(convert(budget, DURATION))
    except ValueError as problem:
        raise UsageError(f"--budget: {problem}; write a duration such as '60 s'") from None


def _proven(
    loaded: LoadedMissions, world: Any, bounds: Any, tell: Callable[[ExplorationProgress], str]
) -> Proof:
    from lupin_engine.verify.proof import prove as prove_all
    from lupin_engine.verify.situation import TooMany

    try:
        return prove_all(world, bounds, tell)
    except TooMany as problem:
        raise LupinError(f"{loaded.names[0]} has situations without end: {problem}") from None


def _progress(name: str, seconds: float | None, shown: bool) -> Callable[[ExplorationProgress], str]:
    """Return what is asked now and then: it shows how far it is, and says when the time is over."""
    began = time.monotonic()
    last = [began]

    def look(progress: ExplorationProgress) -> str:
        now = time.monotonic()
        if shown and now - last[0] >= _EVERY:
            last[0] = now
            rate = progress.transitions / (now - began)
            click.echo(
                f"\r{name}: {progress.situations:,} situations, {progress.waiting:,} wait,"
                f" {progress.transitions:,} transitions, {rate:,.0f}/s, {progress.depth} deep ",
                err=True,
                nl=False,
            )
        over = seconds is not None and now - began > seconds
        return f"the budget of {seconds:g} s ran out" if over else ""

    return look


def _show(loaded: LoadedMissions, proof: Proof, quiet: bool) -> None:
    from lupin_engine.verify.proof import ProofVerdict

    marks = {
        ProofVerdict.HOLDS: "✓",
        ProofVerdict.BROKEN: "✗",
        ProofVerdict.NOT_RELEVANT: "-",
        ProofVerdict.NOT_PROVEN: "?",
    }
    if not quiet:
        click.echo(f"{loaded.names[0]}")
    for one in proof.properties:
        if not quiet or one.verdict is ProofVerdict.BROKEN:
            about = (
                "" if one.verdict in (ProofVerdict.HOLDS, ProofVerdict.BROKEN) else f" ({one.verdict.value})"
            )
            click.echo(f"  {marks[one.verdict]} {one.name}: {one.says}{about}")
        if one.verdict is ProofVerdict.BROKEN:
            _show_breach(one)
    if not quiet:
        for text in proof.dead:
            click.echo(f"  warning: nothing leads to {text}")
        click.echo("  How far was looked:")
        for text in proof.bounds:
            click.echo(f"    {text}")
    click.echo(f"{loaded.names[0]}: {_last_line(proof)}")


def _show_breach(one: Proven) -> None:
    click.echo(f"      {one.text}")
    if one.steps is None:
        click.echo("      no times were found at which this happens in this order; it may be none")
        for text in one.moves:
            click.echo(f"      {text}")
        return
    for step in one.steps:
        what = ", ".join((*step.taken, *step.notes))
        click.echo(f"      {step.time:9.3f} s  {step.event.name} {_told(step)}{what}")


def _told(step: Any) -> str:
    data = step.event.data
    told = " ".join(str(data[name]) for name in ("name", "value", "attempt", "code") if name in data)
    return f"{told}: " if told else ": "


def _last_line(proof: Proof) -> str:
    progress = proof.progress
    seen = f"{progress.situations:,} situations, {progress.transitions:,} transitions"
    if proof.broken:
        return f"{len(proof.broken)} broken; {seen}"
    if not proof.complete:
        return f"not proven, {proof.stopped}: {seen}, {progress.waiting:,} situations wait"
    return f"proven: {seen}, up to {progress.depth} moves deep"


def _record(loaded: LoadedMissions, proof: Proof) -> dict[str, Any]:
    from dataclasses import asdict

    from lupin_engine.runtime.record import step_record

    return {
        "mission": loaded.names[0],
        "chart": loaded.hash,
        "complete": proof.complete,
        "stopped": proof.stopped,
        **asdict(proof.progress),
        "bounds": list(proof.bounds),
        "dead": list(proof.dead),
        "properties": [
            {
                "name": one.name,
                "says": one.says,
                "verdict": one.verdict.value,
                "text": one.text,
                "moves": list(one.moves),
                "steps": None if one.steps is None else [step_record(step) for step in one.steps],
            }
            for one in proof.properties
        ],
    }
