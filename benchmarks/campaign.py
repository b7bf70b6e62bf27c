"""How many missions a campaign makes in a second of processor, and how much faster more workers would be.

    .venv/bin/python benchmarks/campaign.py                         # one worker and eight, by simulation
    .venv/bin/python benchmarks/campaign.py --workers 1 2 --really  # and beside it the cores that there are

Missions a second: seeds of the inspection with two targets each, in this process, three times.

Workers: batches of the inspection are run here one by one, and their times of processor taken. The dealer of
`lupin campaign` then deals them out to workers of a virtual clock: a batch takes a worker as long as it took
here, a worker is ready as long after the beginning as a real one was, what the dealer does itself takes its
real time, with all that goes to workers and comes back made to bytes and read again. So the dealer's core is
its own, as is that of each worker. Where there are more batches than were run, they come again.
"""

from __future__ import annotations

import argparse
import heapq
import pickle
import tempfile
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.registry import load_catalog
from lupin_verify import dealing
from lupin_verify.campaign import Campaign
from lupin_verify.dealing import BATCH, CampaignTask, Dealer, WorkerProcesses, make_task, run_batch
from lupin_verify.rates import default_rates, read_rates

TWO_TARGETS = "campaign: two targets\ntargets: 2\n"


def missions_a_second(seeds: int) -> Iterator[float]:
    """Yield how many missions with two targets a second of processor is enough for, of three runs."""
    loaded = load_missions(["inspection"], load_catalog())
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "rates.yaml")
        file.write_text(TWO_TARGETS, encoding="utf-8")
        campaign = Campaign(loaded, read_rates(file, loaded.chart), {})
    for _ in range(3):
        found = dealing.run_seeds(campaign, range(seeds))
        yield found.missions / found.processor


# -- workers of a virtual clock ----------------------------------------------------------------------------


class Batch(NamedTuple):
    """What a batch came to, as bytes, and how long a worker takes for it."""

    result: bytes
    seconds: float


def measured(task: CampaignTask, batches: int) -> list[Batch]:
    """Run some batches one by one."""
    run_batch(task, range(0))  # loads the mission
    found = []
    for number in range(batches):
        began = time.process_time()
        result = pickle.dumps(run_batch(task, range(number * BATCH, (number + 1) * BATCH)))
        found.append(Batch(result, time.process_time() - began))
    return found


class Workers(Executor):
    """Workers of a virtual clock; whoever deals out is on the same clock, with its real time of processor."""

    def __init__(self, workers: int, ready: float, batches: Sequence[Batch]) -> None:
        self.now = 0.0
        self.dealt = 0.0
        self._since = time.process_time()
        self._free = [ready] * workers
        self._batches = batches
        self._under_way: dict[Future[Any], tuple[float, Batch]] = {}

    def submit(self, function: Callable[..., Any], /, *args: Any, **_: Any) -> Future[Any]:
        """Give a batch to the worker that is free first."""
        pickle.dumps((function, args))
        self._go_on()
        batch = self._batches[args[-1].start // BATCH % len(self._batches)]
        over = max(heapq.heappop(self._free), self.now) + batch.seconds
        heapq.heappush(self._free, over)
        future: Future[Any] = Future()
        self._under_way[future] = over, batch
        return future

    def wait(self, futures: Collection[Future[Any]], return_when: str) -> tuple[set[Future[Any]], set[Any]]:
        """Let the time pass until one is over, in place of `concurrent.futures.wait`."""
        assert return_when == FIRST_COMPLETED
        self._go_on()
        self.now = max(self.now, min(self._under_way[future][0] for future in futures))
        done = {future for future in futures if self._under_way[future][0] <= self.now}
        for future in done:
            future.set_result(pickle.loads(self._under_way.pop(future)[1].result))
        return done, set(futures) - done

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take the time of what was dealt last."""
        self._go_on()

    def _go_on(self) -> None:
        """Let the time pass that the dealer took."""
        now = time.process_time()
        self.now += now - self._since
        self.dealt += now - self._since
        self._since = now


class Dealt(NamedTuple):
    """How long a campaign takes by the clock, and how long the dealer for each batch."""

    seconds: float
    a_batch: float


def simulated(campaign: Campaign, task: CampaignTask, seeds: int, workers: Workers, count: int) -> Dealt:
    """Deal seeds out to workers of a virtual clock."""
    with patch.object(dealing, "wait", workers.wait):
        found = Dealer(campaign, seeds, executors=lambda: workers, workers=count, task=task).run()
    assert found.seeds == seeds
    return Dealt(workers.now, workers.dealt * BATCH / seeds)


@contextmanager
def _timed(into: list[float]) -> Iterator[None]:
    began = time.perf_counter()
    yield
    into.append(time.perf_counter() - began)


def really(campaign: Campaign, task: CampaignTask, seeds: int, workers: int) -> float:
    """Deal seeds out to processes, and return how long that takes by the clock."""
    took: list[float] = []
    with _timed(took):
        Dealer(campaign, seeds, executors=lambda: WorkerProcesses(workers), workers=workers, task=task).run()
    return took[0]


def until_ready(task: CampaignTask) -> float:
    """Return how long a process takes until it has loaded the mission."""
    took: list[float] = []
    with _timed(took), WorkerProcesses(1) as executor:
        executor.submit(run_batch, task, range(0)).result()
    return took[0]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=60, help="for missions a second (default: 60)")
    parser.add_argument(
        "--batches", type=int, default=50, help=f"of {BATCH} seeds, run once each (default: 50)"
    )
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 8], help="how many (default: 1 8)")
    parser.add_argument("--really", action="store_true", help="with processes of this computer, too")
    asked = parser.parse_args()
    rates = ", ".join(f"{rate:,.0f}" for rate in missions_a_second(asked.seeds))
    print(f"inspection, two targets, {asked.seeds} seeds: {rates} missions a second of processor")
    loaded = load_missions(["inspection"], load_catalog())
    campaign = Campaign(loaded, default_rates(loaded.chart), {})
    task = make_task(loaded, None, {})
    ready, batches = until_ready(task), measured(task, asked.batches)
    seconds = sorted(batch.seconds for batch in batches)
    print(
        f"{len(batches)} batches of {BATCH} seeds: {seconds[0]:.2f} to {seconds[-1]:.2f} s,"
        f" {sum(seconds) / len(seconds):.2f} s on average; a worker is ready after {ready:.2f} s"
    )
    for times in (1, 10):
        seeds, first = times * asked.batches * BATCH, 0.0
        for count in asked.workers:
            found = simulated(campaign, task, seeds, Workers(count, ready, batches), count)
            first = first or found.seconds
            told = f"{seeds:>7,} seeds, {count:>4} workers: {found.seconds:>8.1f} s,"
            told += f" {first / found.seconds:5.2f} x, the dealer {1000 * found.a_batch:.2f} ms a batch"
            if asked.really and times == 1:
                told += f"; {really(campaign, task, seeds, count):.1f} s really"
            print(told)


if __name__ == "__main__":
    main()
