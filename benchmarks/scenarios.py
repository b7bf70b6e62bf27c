"""How long 1,000 scenario runs take on one core: reading each file, simulating it, comparing.

    .venv/bin/python benchmarks/scenarios.py [--runs 1000] [--rounds 5] [PATH ...]

The scenarios are those of the shipped missions, run again and again until there are enough. As in
`lupin test` a mission is loaded once; everything else, the reading of the file included, is done for every
run. Seconds are those of the processor, so that what else the machine does counts little; of the rounds the
median is told, with the fastest in brackets.
"""

from __future__ import annotations

import argparse
import itertools
import statistics
import time
from collections.abc import Sequence
from pathlib import Path

from lupin_engine.plugin.registry import load_catalog
from lupin_engine.replay.coverage import CoverageObserver
from lupin_engine.sim.scenario import Missions, load_scenario, scenario_files
from lupin_engine.sim.suite import Suite

SCENARIOS = Path(__file__).parents[1] / "tests" / "scenarios"


def measure(suite: Suite, files: Sequence[Path]) -> float:
    """Return how many seconds of the processor the scenarios take."""
    begun = time.process_time()
    for file in files:
        result = suite.run(file)
        assert result.holds, f"{file}: {result.problem or result.failures}"
    return time.process_time() - begun


def phases(missions: Missions, files: Sequence[Path]) -> dict[str, float]:
    """Return how many seconds reading, simulating and comparing take."""
    taken = dict.fromkeys(("read", "simulate", "compare"), 0.0)
    for file in files:
        at = [time.process_time()]
        scenario = load_scenario(file, missions.catalog, missions)
        at.append(time.process_time())
        run = scenario.run()
        at.append(time.process_time())
        assert not scenario.failures(run)
        at.append(time.process_time())
        for name, (begin, end) in zip(taken, itertools.pairwise(at), strict=True):
            taken[name] += end - begin
    return taken


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("paths", nargs="*", type=Path, default=[SCENARIOS], metavar="PATH")
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    files = list(itertools.islice(itertools.cycle(scenario_files(options.paths)), options.runs))
    for title, counts in (("", False), (", counting what is reached", True)):
        suite = Suite(load_catalog(), CoverageObserver() if counts else None)
        measure(suite, files[:100])
        taken = [measure(suite, files) for _ in range(options.rounds)]
        print(f"{len(files)} runs{title}: {statistics.median(taken):.2f} s ({min(taken):.2f})")
    missions = Missions(load_catalog())
    phases(missions, files[:100])
    for name, seconds in phases(missions, files).items():
        print(f"  {name:9}{1e3 * seconds / len(files):7.3f} ms a run")


if __name__ == "__main__":
    main()
