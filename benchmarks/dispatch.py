"""How long our machine takes for an event, a timed transition and a chart, beside other engines.

    .venv/bin/python benchmarks/dispatch.py [--quick] [--json FILE] [--write] [--engines KEY ...]

The peers are installed into an environment of their own (--env); one that cannot be is told as such. Each
engine runs in its own process, one block of each in turn, so that a noisy minute hits all of them alike.
Every chart is checked event by event first, and after all blocks each engine must be where that many events
lead. benchmarks/README.md says what is measured and how.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from peers.generated import write_trees
from peers.install import install_node, install_python
from peers.process import Engine, EngineError, EngineProcess
from peers.table import PARTS, Figure, Results, document, machine_kind, show, write_section
from rich.console import Console
from rich.progress import Progress

ROOT = Path(__file__).resolve().parents[1]
DOCUMENT = ROOT / "docs" / "performance.md"

ENGINES = (
    Engine("lupin", "lupin", "lupin_machine", "ours"),
    Engine("lupin-fresh", "lupin, a new Event each time", "lupin_machine", "ours", "fresh"),
    Engine("floor", "floor: hand-written dict, Python", "floor", "ours"),
    Engine("xstate", "XState actor", "xstate", "node"),
    Engine("transitions", "transitions, flat", "transitions_flat"),
    Engine("transitions-nested", "transitions, hierarchical", "transitions_nested"),
    Engine("sismic", "sismic", "sismic_interpreter"),
    Engine("python-statemachine", "python-statemachine", "statemachine_chart"),
)
#: Variants of ours measure the same machine: loading and weighing them again would say nothing new.
RUN_ONLY = frozenset({"lupin-fresh"})

RUN_CHARTS = ("cycle", "guarded", "parallel", "timed")
SIZES = (10, 100, 1000)
CHARTS = tuple(chart for part in PARTS for chart, _ in part.columns)

#: Events that are sent one by one and checked before anything is timed: every state is met twice.
CHECKED = 7
#: After this many events every chart is where it began.
PERIOD = 6
#: What a calibrated block aims at, so that a quiet moment does not make one shorter than it must be.
HEADROOM = 1.25
INSTANCES = 300


@dataclass(frozen=True)
class Method:
    """How much is measured."""

    rounds: int
    block_s: float


def expected(chart: str, total: int) -> dict[str, Any]:
    """Return where a chart must be after `total` events."""
    if chart.startswith("load-"):
        return {"active": ["group_1_1_step_1"], "count": int(chart.removeprefix("load-"))}
    if chart == "timed":
        return {"active": [("ping", "pong")[total % 2]], "count": total}
    if chart == "parallel":
        return {"active": [f"l{total % 2 + 1}", f"r{total % 2 + 1}"], "count": None}
    return {"active": ["abc"[total % 3]], "count": total if chart == "guarded" else None}


class Trial:
    """One chart on one engine: checked, calibrated, then measured block by block."""

    def __init__(self, process: EngineProcess, chart: str) -> None:
        self.key = process.engine.key
        self._process = process
        self._chart = chart
        self._total = 0
        self._number = 1
        self._first = 0.0
        self.blocks: list[float] = []
        self.missing = ""

    def begin(self, block_s: float) -> None:
        """Make the chart, check it step by step, and find out how many events a block takes."""
        with self._told():
            self._process.ask("prepare", chart=self._chart)
            self._first = self._run(1)
            self.check()
            for _ in range(0 if self._chart.startswith("load-") else CHECKED - 1):
                self._run(1)
                self.check()
            seconds = self._run(self._number)
            while seconds < block_s / 5:
                self._number *= 4
                seconds = self._run(self._number)
            # The first whole block is not counted: compilers and caches are warm after it.
            for _ in range(2):
                self._number = self._whole(self._number * HEADROOM * block_s / seconds)
                seconds = self._run(self._number)

    def block(self) -> None:
        """Measure one block."""
        if not self.missing:
            with self._told():
                self.blocks.append(self._run(self._number) / self._number)

    def finish(self) -> Figure:
        """Check where all that led, and return what was measured, in µs an event or ms a load."""
        if not self.missing:
            with self._told():
                self.check()
        if self.missing or not self.blocks:
            return Figure(missing=self.missing)
        unit = 1e3 if self._chart.startswith("load-") else 1e6
        blocks = tuple(unit * block for block in self.blocks)
        return Figure(statistics.median(blocks), min(blocks), blocks, first=unit * self._first)

    def check(self) -> None:
        """Raise unless the engine is where it must be: one that dispatches into nothing is quick."""
        found, wanted = self._process.ask("reached"), expected(self._chart, self._total)
        if found != wanted:
            raise EngineError(f"wrong: after {self._total} events {found}, not {wanted}")

    def _run(self, number: int) -> float:
        seconds = float(self._process.ask("run", number=number)["seconds"])
        self._total += number
        return seconds

    def _whole(self, number: float) -> int:
        """Return a number of events after which the chart is not where it was before."""
        if self._chart.startswith("load-"):
            return max(1, round(number))
        return PERIOD * round(number / PERIOD) + 1

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except EngineError as problem:
            self.missing = str(problem)


def compare(
    chart: str, processes: list[EngineProcess], method: Method, progress: Progress
) -> dict[str, Figure]:
    """Measure one chart on all engines, a block of each in turn."""
    trials = [Trial(process, chart) for process in processes]
    task = progress.add_task(chart, total=len(trials) * (method.rounds + 1))
    for trial in trials:
        trial.begin(method.block_s)
        progress.advance(task)
    for _ in range(method.rounds):
        for trial in trials:
            trial.block()
            progress.advance(task)
    return {trial.key: trial.finish() for trial in trials}


def weigh(processes: list[EngineProcess], progress: Progress) -> dict[str, Figure]:
    """Measure how many bytes a further machine of the guarded chart takes."""
    found = {}
    for process in progress.track(processes, description="bytes"):
        try:
            size = float(process.ask("weigh", chart="guarded", number=INSTANCES)["bytes"])
            found[process.engine.key] = Figure(size, size, (size,))
        except EngineError as problem:
            found[process.engine.key] = Figure(missing=str(problem))
    return found


def measure(
    engines: list[Engine], charts: list[str], method: Method, environment: Path, progress: Progress
) -> Results:
    """Measure everything that was asked for."""
    results = Results(engines, method=asdict(method))
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        write_trees(list(SIZES), folder)
        processes, absent = [], []
        for engine in engines:
            try:
                process = EngineProcess(engine, environment, folder)
            except EngineError:
                absent.append(engine)
                continue
            stack.callback(process.close)
            processes.append(process)
            results.versions[engine.key] = process.version
        for chart in charts:
            able = [p for p in processes if chart in RUN_CHARTS or p.engine.key not in RUN_ONLY]
            row = weigh(able, progress) if chart == "bytes" else compare(chart, able, method, progress)
            results.figures[chart] = {**row, **{e.key: Figure(missing="not installed") for e in absent}}
    return results


def as_json(results: Results) -> str:
    """Return everything as JSON, all blocks included."""
    found = {
        "machine": machine_kind(),
        "method": results.method,
        "versions": results.versions,
        "figures": {
            chart: {engine: asdict(figure) for engine, figure in row.items()}
            for chart, row in results.figures.items()
        },
    }
    return json.dumps(found, indent=2, ensure_ascii=False) + "\n"


def read_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    keys = [engine.key for engine in ENGINES]
    add = parser.add_argument
    add("--engines", nargs="+", choices=keys, default=keys, metavar="KEY", help=", ".join(keys))
    add("--charts", nargs="+", choices=CHARTS, default=list(CHARTS), metavar="CHART")
    add("--quick", action="store_true", help="under 30 s: few, short blocks; no 1,000 states")
    add("--rounds", type=int, help="blocks of each engine (7; quick: 3)")
    add("--block", type=float, help="shortest block in seconds (0.2; quick: 0.02)")
    add("--env", type=Path, default=ROOT / ".venv-peers", help="where the peers are")
    add("--json", type=Path, metavar="FILE", help="write all figures there")
    add("--write", action="store_true", help="rewrite the section in docs/performance.md")
    return parser.parse_args()


def main() -> int:
    """Install, measure, show."""
    given = read_arguments()
    method = Method(given.rounds or (3 if given.quick else 7), given.block or (0.02 if given.quick else 0.2))
    engines = [engine for engine in ENGINES if engine.key in given.engines]
    charts = [c for c in CHARTS if c in given.charts and not (given.quick and c == "load-1000")]
    console, environment = Console(stderr=True, markup=False), given.env.resolve()
    if any(engine.runs_in == "peers" for engine in engines):
        install_python(environment, console.print)
    if any(engine.runs_in == "node" for engine in engines):
        install_node(environment, console.print)
    with Progress(console=console) as progress:
        results = measure(engines, charts, method, environment, progress)
    # Not on a terminal there is no width to keep to.
    show(results, Console(width=None if sys.stdout.isatty() else 160))
    if given.json is not None:
        given.json.write_text(as_json(results), encoding="utf-8")
    if given.write:
        write_section(DOCUMENT, document(results))
    for wrong in results.wrong:
        console.print(wrong, style="red")
    return 1 if results.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
