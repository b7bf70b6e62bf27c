"""Proofs of several missions, or of one with several values of its parameters, in processes of their own.

Each process makes one proof after the other, this one too where there is no other. What the machine's steps
do is remembered by the process that made them: so processes share missions, not the situations of one.
"""

from __future__ import annotations

import copyreg
import signal
import time
from collections.abc import Callable, Mapping, Sequence
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
from lupin_verify.proof import Proof, prove
from lupin_verify.situations.classes import parameter_classes
from lupin_verify.situations.explorer import Bounds
from lupin_verify.situations.found import ExplorationProgress

#: How far a proof is: its number, and how long it has been under way (s).
ProofNews = tuple[int, ExplorationProgress, float]
#: So often a process tells how far it is, in seconds.
_TOLD_EVERY = 1.0
#: Why a proof was stopped that somebody has interrupted.
INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class ProofTask:
    """One proof: of the mission that is called so, with some parameters; `varied`: what is not as given.

    `outcomes` is the page whose cells are looked at, if any.
    """

    mission: str
    parameters: Mapping[str, Any]
    varied: str = ""
    outcomes: Path | None = None


def proof_tasks(
    loaded: LoadedMissions,
    mission: str,
    given: Mapping[str, Any],
    every: bool,
    outcomes: Path | None = None,
) -> list[ProofTask]:
    """Return the proofs of a mission: as given, and with `every` other class of one parameter at a time."""
    found = [ProofTask(mission, given, "", outcomes)]
    world = make_world(loaded.chart, given)
    for name, value in parameter_classes(world) if every else ():
        if name not in given:
            found.append(ProofTask(mission, {**given, name: value}, f"{name} = {shorten(value)}", outcomes))
    return found


def _prove(
    task: ProofTask, loaded: LoadedMissions, bounds: Bounds, goes_on: Callable[[ExplorationProgress], str]
) -> Proof:
    began, processor = time.monotonic(), time.process_time()
    proof = prove(make_world(loaded.chart, task.parameters), bounds, goes_on, task.outcomes)
    varied = (f"In this proof {task.varied}.",) if task.varied else ()
    return replace(
        proof,
        bounds=(*varied, *proof.bounds),
        varied=task.varied,
        seconds=time.monotonic() - began,
        processor=time.process_time() - processor,
    )


def prove_tasks(
    tasks: Sequence[ProofTask],
    loaded: Mapping[str, LoadedMissions],
    bounds: Bounds,
    jobs: int,
    seconds: float | None,
    told: Callable[[int, ExplorationProgress, float], None],
) -> list[Proof]:
    """Make proofs, all within some seconds; Ctrl-C stops all in order.

    Args:
        jobs: in so many processes; one proof after the other is made in this one.
        told: called now and then for each proof under way: its number, how far it is, and after how long (s).
    """
    workers, began = min(jobs, len(tasks)), time.monotonic()
    if workers < 2:
        made: list[Proof] = []
        for number, task in enumerate(tasks):
            look = _looks(partial(told, number), lambda: _was_interrupted(made), seconds, began)
            made.append(_prove(task, loaded[task.mission], bounds, look))
        return made
    context = get_context("spawn")
    stop = context.Event()
    news = context.SimpleQueue()
    with WorkerProcesses(workers, _begin, stop, news, seconds, began) as pool:
        # Processes that begin leave a Ctrl-C to this one from their first moment on.
        usual = signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            asked = [pool.submit(_prove_here, number, task, bounds) for number, task in enumerate(tasks)]
        finally:
            signal.signal(signal.SIGINT, usual)
        _gather(asked, stop, news, told)
        proofs = [future.result() for future in asked]
    return [
        replace(proof, chart=loaded[task.mission].chart) for proof, task in zip(proofs, tasks, strict=True)
    ]


def _was_interrupted(made: Sequence[Proof]) -> bool:
    return bool(made) and made[-1].stopped == INTERRUPTED


def _gather(
    made: Sequence[Future[Proof]],
    stop: Event,
    news: SimpleQueue[ProofNews],
    told: Callable[[int, ExplorationProgress, float], None],
) -> None:
    """Wait for all, and tell how far they are; with a Ctrl-C, for what they have found so far."""
    left = set(made)
    while left:
        try:
            left = wait(left, _TOLD_EVERY / 2, return_when=FIRST_COMPLETED).not_done
            while not news.empty():
                told(*news.get())
        except KeyboardInterrupt:
            stop.set()


def _looks(
    tell: Callable[[ExplorationProgress, float], None],
    is_over: Callable[[], bool],
    seconds: float | None,
    began: float,
) -> Callable[[ExplorationProgress], str]:
    """Return what a proof asks now and then: it tells how far it is, and says why to stop, or nothing."""
    since = last = time.monotonic()

    def look(progress: ExplorationProgress) -> str:
        nonlocal last
        now = time.monotonic()
        if now - last >= _TOLD_EVERY:
            last = now
            tell(progress, now - since)
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


def _prove_here(number: int, task: ProofTask, bounds: Bounds) -> Proof:
    news, stop = _news, _stop
    assert news is not None, "the process has begun"
    assert stop is not None, "the process has begun"
    look = _looks(lambda *how_far: news.put((number, *how_far)), stop.is_set, _seconds, _began)
    loaded = load_missions([task.mission], load_catalog())
    return replace(_prove(task, loaded, bounds, look), chart=None)  # type: ignore[arg-type]
