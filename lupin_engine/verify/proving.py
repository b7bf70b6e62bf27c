"""Proofs of several missions, or of one with several values of its parameters, in processes of their own.

Each process makes one proof after the other. What the machine's steps do is remembered by the process that
made them: so processes share missions, not the situations of one.
"""

from __future__ import annotations

import copyreg
import signal
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, replace
from multiprocessing import get_context
from multiprocessing.queues import SimpleQueue
from multiprocessing.synchronize import Event
from types import MappingProxyType
from typing import Any

from lupin_engine.errors import LupinError
from lupin_engine.missions.load import LoadedMissions
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.runtime.setup import make_world
from lupin_engine.verify.proof import Proof, prove
from lupin_engine.verify.situations.classes import parameter_classes
from lupin_engine.verify.situations.explorer import Bounds
from lupin_engine.verify.situations.found import ExplorationProgress
from lupin_engine.verify.situations.situation import TooMany

#: How far a proof is: its number, and how long it has been under way (s).
ProofNews = tuple[int, ExplorationProgress, float]
#: So often a process tells how far it is, in seconds.
_TOLD_EVERY = 1.0


@dataclass(frozen=True)
class ProofTask:
    """One proof: of the mission that is called so, with some parameters; `varied`: what is not as given."""

    mission: str
    parameters: Mapping[str, Any]
    varied: str = ""


def proof_tasks(
    loaded: LoadedMissions, mission: str, given: Mapping[str, Any], every: bool
) -> list[ProofTask]:
    """Return the proofs of a mission: as given, and with `every` other class of one parameter at a time."""
    found = [ProofTask(mission, given)]
    world = make_world(loaded.chart, given)
    for name, value in parameter_classes(world) if every else ():
        if name not in given:
            found.append(ProofTask(mission, {**given, name: value}, f"{name} is {value}"))
    return found


def prove_task(
    task: ProofTask, loaded: LoadedMissions, bounds: Bounds, goes_on: Callable[[ExplorationProgress], str]
) -> Proof:
    """Make one proof.

    Raises:
        LupinError: the mission has situations without end.
    """
    try:
        proof = prove(make_world(loaded.chart, task.parameters), bounds, goes_on)
    except TooMany as problem:
        raise LupinError(f"{loaded.names[0]} has situations without end: {problem}") from None
    varied = (f"In this proof {task.varied}.",) if task.varied else ()
    return replace(proof, bounds=(*varied, *proof.bounds))


def prove_tasks(
    tasks: Sequence[ProofTask],
    loaded: Mapping[str, LoadedMissions],
    bounds: Bounds,
    jobs: int,
    seconds: float | None,
    told: Callable[[int, ExplorationProgress, float], None],
) -> list[Proof]:
    """Make proofs in processes, all within some seconds; Ctrl-C stops all in order.

    Args:
        told: called now and then for each proof under way: its number, how far it is, and after how long (s).

    Raises:
        LupinError: a mission has situations without end.
    """
    context = get_context("spawn")
    stop = context.Event()
    workers = min(jobs, len(tasks))
    news = context.SimpleQueue()
    with ProcessPoolExecutor(workers, context, _begin, (stop, news, seconds, time.monotonic())) as pool:
        # Processes that begin leave a Ctrl-C to this one from their first moment on.
        usual = signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            made = [pool.submit(_prove_here, number, task, bounds) for number, task in enumerate(tasks)]
        finally:
            signal.signal(signal.SIGINT, usual)
        _gather(made, stop, news, told)
        proofs = [future.result() for future in made]
    return [
        replace(proof, chart=loaded[task.mission].chart) for proof, task in zip(proofs, tasks, strict=True)
    ]


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


def out_of_time(seconds: float | None, began: float) -> str:
    """Say that a budget ran out, by the monotonic clock; '' while it did not."""
    over = seconds is not None and time.monotonic() - began > seconds
    return f"the budget of {seconds:g} s ran out" if over else ""


# -- in a process of its own -----------------------------------------------------------------------------

_stop: Event | None = None
_news: SimpleQueue[ProofNews] | None = None
_seconds: float | None = None
_began = 0.0


def _begin(stop: Event, news: SimpleQueue[ProofNews], seconds: float | None, began: float) -> None:
    global _stop, _news, _seconds, _began
    _stop, _news, _seconds, _began = stop, news, seconds, began
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who dealt out says when to stop
    copyreg.pickle(MappingProxyType, lambda found: (MappingProxyType, (dict(found),)))


def _prove_here(number: int, task: ProofTask, bounds: Bounds) -> Proof:
    began = last = time.monotonic()

    def goes_on(progress: ExplorationProgress) -> str:
        nonlocal last
        now = time.monotonic()
        if _news is not None and now - last >= _TOLD_EVERY:
            last = now
            _news.put((number, progress, now - began))
        if _stop is not None and _stop.is_set():
            return "interrupted"
        return out_of_time(_seconds, _began)

    loaded = load_missions([task.mission], load_catalog())
    return replace(prove_task(task, loaded, bounds, goes_on), chart=None)  # type: ignore[arg-type]
