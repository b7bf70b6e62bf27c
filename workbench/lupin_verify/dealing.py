"""Distributes a campaign's seeds in batches: to this process, or to an executor of `concurrent.futures`.

A worker gets the files of the mission with its batch, and loads them once, by their hash. A batch that is
lost with its worker is dealt again; when it was dealt `TRIES` times in all, the campaign fails.
"""

from __future__ import annotations

import gc
import os
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import chain, islice
from multiprocessing import get_context, parent_process
from pathlib import Path
from typing import Any

from lupin_engine import __version__
from lupin_engine.errors import LupinError
from lupin_engine.missions import LoadedMissions, load_files
from lupin_engine.plugin import load_catalog
from lupin_verify.campaign import Campaign, CampaignSum
from lupin_verify.rates import default_rates, read_rates

#: The number of steps between two garbage collections.
STEPS_KEPT = 20_000
#: A batch of seeds, and how often it was dealt out.
_Dealt = tuple[range, int]
#: How many seeds a batch has, how many batches wait for each worker, how often one is dealt out at most.
BATCH, AHEAD, TRIES = 20, 3, 4


@dataclass(frozen=True)
class CampaignTask:
    """A picklable campaign for workers: the bytes of its files, by their names in a folder.

    `hash` is that of the mission's files; `folder` is the original folder of the files.
    """

    hash: str
    folder: str
    lifecycle: str
    mission: str
    files: tuple[tuple[str, bytes], ...] = field(repr=False)
    rates: bytes = field(default=b"", repr=False)
    rates_file: str = ""
    parameters: Mapping[str, Any] = field(default_factory=dict, hash=False)  # lists may be in it
    version: str = __version__


@lru_cache(maxsize=4)
def _unpacked(task: CampaignTask) -> Campaign:
    """Return the campaign of a task, loaded in this process.

    Raises:
        LupinError: another engine is installed here, or the mission has another hash here.
    """
    if task.version != __version__:
        raise LupinError(f"a worker has engine {__version__}, and not {task.version}: install the same there")
    with tempfile.TemporaryDirectory() as folder:
        for name, content in (*task.files, *([(task.rates_file, task.rates)] if task.rates else [])):
            (Path(folder) / name).parent.mkdir(parents=True, exist_ok=True)
            (Path(folder) / name).write_bytes(content)
        loaded = load_files(Path(folder) / task.lifecycle, [Path(folder) / task.mission], load_catalog())
        if loaded.hash != task.hash:
            raise LupinError(f"a worker reads another mission than {task.hash[:12]}: {loaded.hash[:12]}")
        rates = default_rates(loaded.chart)
        if task.rates:
            rates = read_rates(Path(folder) / task.rates_file, loaded.chart)
        campaign = Campaign(loaded, rates, task.parameters)
        campaign.folders = (folder, task.folder)
        return campaign


def run_batch(task: CampaignTask, seeds: range) -> CampaignSum:
    """Run some seeds of a task, in a worker."""
    return run_seeds(_unpacked(task), seeds)


def run_seeds(campaign: Campaign, seeds: range) -> CampaignSum:
    """Run some seeds one after the other; garbage is collected between them, of new objects only."""
    found, began, clean = CampaignSum(), time.process_time(), 0
    gc.freeze()
    gc.disable()
    try:
        for seed in seeds:
            campaign.run(seed, found)
            if found.steps - clean > STEPS_KEPT:
                gc.collect()
                clean = found.steps
    finally:
        gc.enable()
        gc.unfreeze()
    found.processor = time.process_time() - began
    return found


def make_task(loaded: LoadedMissions, rates: Path | None, parameters: Mapping[str, Any]) -> CampaignTask:
    """Return the task of a campaign of one mission, with its file of rates if any."""
    short = loaded.short_names
    named = {Path(name).resolve(): short[name] for name in loaded.sources}
    return CampaignTask(
        loaded.hash,
        str(loaded.lifecycle.parent),
        named[loaded.lifecycle.resolve()],
        named[loaded.files[0].resolve()],
        tuple((short[name], content) for name, content in loaded.sources.items()),
        rates.read_bytes() if rates is not None else b"",
        "rates.yaml",
        dict(parameters),
    )


class WorkerProcesses(ProcessPoolExecutor):
    """Worker processes of this computer; they ignore Ctrl-C, and end with the process that began them."""

    def __init__(self, workers: int, begin: Callable[..., None] | None = None, *arguments: Any) -> None:
        """Start workers, each of which calls `begin` first."""
        super().__init__(workers, get_context("spawn"), _begin, (begin, *arguments))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Shut down; with `cancel_futures` running calls are terminated."""
        working = list((self._processes or {}).values())
        super().shutdown(wait, cancel_futures=cancel_futures)
        for process in working if cancel_futures else ():
            process.terminate()


def _begin(begin: Callable[..., None] | None, *arguments: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if begin is not None:
        begin(*arguments)


def _end_with_parent() -> None:
    """Exit this process when its parent has ended, for whatever reason."""
    parent = parent_process()
    assert parent is not None, "workers are begun by another process"
    parent.join()
    os._exit(1)


@dataclass
class Dealer:
    """Distributes the seeds of a campaign; `found` is the sum of the finished batches, in any order.

    `executors` makes an executor, and another one where that is broken; without it this process does the
    work. `broken` are the errors of a lost batch. `report` is called after each batch; all `took` so long
    (s).
    """

    campaign: Campaign
    seeds: int
    report: Callable[[CampaignSum], None] = lambda _: None
    executors: Callable[[], Executor] | None = None
    workers: int = 1
    task: CampaignTask | None = None
    found: CampaignSum = field(default_factory=CampaignSum)
    lost: int = 0
    took: float = 0.0
    broken: tuple[type[BaseException], ...] = (BrokenExecutor,)

    def run(self) -> CampaignSum:
        """Run all seeds; after an error or a KeyboardInterrupt `found` has the finished ones.

        Raises:
            LupinError: a batch was lost again and again, or a worker cannot run it.
        """
        began = time.perf_counter()
        try:
            self._run()
        finally:
            self.took = time.perf_counter() - began
        return self.found

    def _run(self) -> None:
        batches = (range(at, min(at + BATCH, self.seeds)) for at in range(0, self.seeds, BATCH))
        if self.executors is None or self.task is None:
            for batch in batches:
                self._take(run_seeds(self.campaign, batch))
            return
        left: Iterator[_Dealt] = ((batch, 1) for batch in batches)
        while lost := self._deal(left):
            self.lost += len(lost)
            again = [(batch, tries + 1) for batch, tries in lost]
            if any(tries > TRIES for _, tries in again):
                raise LupinError(f"the seeds {lost[0][0].start} to {lost[0][0].stop - 1} end every worker")
            left = chain(again, left)

    def _take(self, batch: CampaignSum) -> None:
        self.found.add(batch)
        self.report(self.found)

    def _deal(self, left: Iterator[_Dealt]) -> list[_Dealt]:
        """Submit batches until none is left or the executor breaks; return the lost ones."""
        assert self.executors is not None, "there are workers"
        assert self.task is not None, "workers have a task"
        executor, out, lost = self.executors(), dict[Future[CampaignSum], _Dealt](), list[_Dealt]()
        try:
            while not lost:
                for dealt in islice(left, AHEAD * self.workers - len(out)):
                    try:
                        out[executor.submit(run_batch, self.task, dealt[0])] = dealt
                    except self.broken:
                        return [dealt, *out.values()]
                if not out:
                    break
                done, _ = wait(out, return_when=FIRST_COMPLETED)
                for future in done:
                    dealt = out.pop(future)
                    try:
                        self._take(future.result())
                    except self.broken:
                        lost.append(dealt)
            return [*lost, *out.values()]
        finally:
            with suppress(Exception):
                executor.shutdown(wait=False, cancel_futures=True)
