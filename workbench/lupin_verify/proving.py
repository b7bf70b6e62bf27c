"""Runs several proofs, of missions or of values of their parameters, in worker processes.

Each process makes one proof after the other; with one job this process does. A single proof is not parallel,
because its cache of effects is local to a process. Ctrl-C stops all proofs; each returns its result so far.
Longer lists are explored only when each mission has been proven with short ones.
"""

from __future__ import annotations

import copyreg
import signal
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from multiprocessing.queues import SimpleQueue
from multiprocessing.synchronize import Event
from pathlib import Path
from types import MappingProxyType
from typing import Any

from lupin_engine.missions import LoadedMissions, load_missions
from lupin_engine.plugin import load_catalog
from lupin_engine.runtime import make_world
from lupin_engine.sim import shorten
from lupin_verify.dealing import WorkerProcesses
from lupin_verify.outcome_table import NEW, is_written
from lupin_verify.proof import Proof, prove
from lupin_verify.situations.classes import parameter_classes
from lupin_verify.situations.explorer import Bounds
from lupin_verify.situations.found import INTERRUPTED, ExplorationProgress
from lupin_verify.widening import widen

#: How far a proof is: its number, and how long it has been under way (s).
ProofNews = tuple[int, ExplorationProgress, float]
#: How often a process reports its progress, in seconds.
REPORT_EVERY = 1.0


@dataclass(frozen=True)
class ProofTask:
    """One proof: of a mission with some parameters; `varied` names the parameter that is not as given.

    `outcomes` is the page of outcomes to prove, if any, or `NEW`. One that `widens` goes on to longer lists.
    """

    mission: str
    parameters: Mapping[str, Any]
    varied: str = ""
    outcomes: Path | None = None
    widens: bool = False


def proof_tasks(
    loaded: LoadedMissions,
    mission: str,
    given: Mapping[str, Any],
    every: bool,
    outcomes: Path | None = None,
    widens: bool = False,
) -> list[ProofTask]:
    """Return the proofs of a mission: as given, and for `every` also each other class of one parameter."""
    found = [ProofTask(mission, given, "", outcomes, widens)]
    if outcomes is not None and (outcomes == NEW or is_written(outcomes)):
        outcomes = None  # such a page is about the given parameters
    world = make_world(loaded.chart, given)
    for name, value in parameter_classes(world) if every else ():
        if name not in given:
            varied = f"{name} = {shorten(value)}"
            found.append(ProofTask(mission, {**given, name: value}, varied, outcomes, widens))
    return found


def _prove(
    task: ProofTask,
    loaded: LoadedMissions,
    bounds: Bounds,
    stop_reason: Callable[[ExplorationProgress], str],
    shorter: Proof | None = None,
) -> Proof:
    """Make a proof; given that of `shorter` lists, go on from it to longer ones."""

    def made(bounds: Bounds, also: Callable[[ExplorationProgress], str] = lambda _: "") -> Proof:
        began, processor = time.monotonic(), time.process_time()
        world = make_world(loaded.chart, task.parameters)
        proof = prove(world, bounds, lambda one: stop_reason(one) or also(one), task.outcomes)
        varied = (f"In this proof {task.varied}.",) if task.varied else ()
        return replace(
            proof,
            bounds=(*varied, *proof.bounds),
            varied=task.varied,
            seconds=time.monotonic() - began,
            processor=time.process_time() - processor,
        )

    if shorter is None:
        return made(bounds)
    return widen(shorter, bounds, made) if task.widens else shorter


def prove_tasks(
    tasks: Sequence[ProofTask],
    loaded: Mapping[str, LoadedMissions],
    bounds: Bounds,
    jobs: int,
    seconds: float | None,
    report: Callable[[int, ExplorationProgress, float], None],
) -> list[Proof]:
    """Make proofs, all within one budget of seconds; Ctrl-C stops them with their results so far.

    Args:
        jobs: the number of processes; with 1, this one makes all.
        report: called periodically for each running proof: its number, its progress, its time so far (s).
    """
    workers, began = min(jobs, len(tasks)), time.monotonic()
    if workers < 2:
        return _in_turn(tasks, loaded, bounds, seconds, report)
    context = get_context("spawn")
    stop = context.Event()
    news = context.SimpleQueue()
    with WorkerProcesses(workers, _begin, stop, news, seconds, began) as pool:

        def make_all(shorter: Sequence[Proof | None]) -> list[Proof]:
            # Starting processes inherit that Ctrl-C is ignored: only this one handles it.
            usual = signal.signal(signal.SIGINT, signal.SIG_IGN)
            try:
                each = enumerate(zip(tasks, shorter, strict=True))
                asked = [pool.submit(_prove_here, number, task, bounds, one) for number, (task, one) in each]
            finally:
                signal.signal(signal.SIGINT, usual)
            _gather(asked, stop, news, report)
            return [future.result() for future in asked]

        proofs = make_all([None] * len(tasks))
        if any(task.widens for task in tasks) and not stop.is_set():
            proofs = make_all(proofs)
    return [
        replace(proof, chart=loaded[task.mission].chart) for proof, task in zip(proofs, tasks, strict=True)
    ]


def _in_turn(
    tasks: Sequence[ProofTask],
    loaded: Mapping[str, LoadedMissions],
    bounds: Bounds,
    seconds: float | None,
    report: Callable[[int, ExplorationProgress, float], None],
) -> list[Proof]:
    """Make proofs in this process."""
    made: dict[int, Proof] = {}
    began = time.monotonic()
    for number, task in (*enumerate(tasks), *enumerate(tasks)):
        look = _stop_check(partial(report, number), lambda: _is_interrupted(made.values()), seconds, began)
        made[number] = _prove(task, loaded[task.mission], bounds, look, made.get(number))
    return list(made.values())


def _is_interrupted(made: Iterable[Proof]) -> bool:
    return any(proof.interrupted for proof in made)


def _gather(
    made: Sequence[Future[Proof]],
    stop: Event,
    news: SimpleQueue[ProofNews],
    report: Callable[[int, ExplorationProgress, float], None],
) -> None:
    """Wait for all proofs and report their progress; Ctrl-C stops them, and waits for their results."""
    left = set(made)
    while left:
        try:
            left = wait(left, REPORT_EVERY / 2, return_when=FIRST_COMPLETED).not_done
            while not news.empty():
                report(*news.get())
        except KeyboardInterrupt:
            stop.set()


def _stop_check(
    report: Callable[[ExplorationProgress, float], None],
    is_over: Callable[[], bool],
    seconds: float | None,
    began: float,
) -> Callable[[ExplorationProgress], str]:
    """Return a proof's periodic call: it reports progress, and returns a reason to stop, or nothing."""
    since = last = time.monotonic()

    def look(progress: ExplorationProgress) -> str:
        nonlocal last
        now = time.monotonic()
        if now - last >= REPORT_EVERY:
            last = now
            report(progress, now - since)
        if is_over():
            return INTERRUPTED
        return f"the budget of {seconds:g} s ran out" if seconds is not None and now - began > seconds else ""

    return look


# -- in a process of its own -----------------------------------------------------------------------------

_stop: Event | None = None
_news: SimpleQueue[ProofNews] | None = None
_seconds: float | None = None
_began = 0.0


def _begin(stop: Event, news: SimpleQueue[ProofNews], seconds: float | None, began: float) -> None:
    global _stop, _news, _seconds, _began
    _stop, _news, _seconds, _began = stop, news, seconds, began
    copyreg.pickle(MappingProxyType, lambda found: (_unchanging, (dict(found),)))


def _unchanging(found: dict[str, Any]) -> MappingProxyType[str, Any]:
    return MappingProxyType(found)


def _prove_here(number: int, task: ProofTask, bounds: Bounds, shorter: Proof | None) -> Proof:
    news, stop = _news, _stop
    assert news is not None, "the process has begun"
    assert stop is not None, "the process has begun"
    look = _stop_check(lambda *how_far: news.put((number, *how_far)), stop.is_set, _seconds, _began)
    loaded = load_missions([task.mission], load_catalog())
    return replace(_prove(task, loaded, bounds, look, shorter), chart=None)  # type: ignore[arg-type]
