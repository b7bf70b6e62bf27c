"""How long the shipped inspection mission takes to load and to run in virtual time, without ROS.

    .venv/bin/python benchmarks/mission.py [--rounds 20]

Each figure is the median of the rounds, with the fastest and the slowest; everything is imported before.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any

from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder
from lupin_engine.missions.load import forget, load_chart
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.sim.simulation import Script, simulate


def measure(name: str, rounds: int, work: Callable[[], object]) -> None:
    """Print how long `work` takes, in milliseconds."""
    taken = []
    for _ in range(rounds):
        begun = time.perf_counter()
        work()
        taken.append(1e3 * (time.perf_counter() - begun))
    median = statistics.median(taken)
    print(f"{name:42} {median:7.1f} ms   ({min(taken):.1f} to {max(taken):.1f})")


def main() -> None:
    """Measure loading, one tag and all tags."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rounds", type=int, default=20)
    rounds = parser.parse_args().rounds
    folder, catalog = default_missions_folder(), load_catalog()
    files = [folder / "inspection.yaml"]
    chart = load_chart(folder / LIFECYCLE, files, catalog)

    def run(request: dict[str, Any], targets: int) -> None:
        visits = simulate(chart, Script("InspectionMission", request)).visits
        assert [visit.status for visit in visits] == ["OK"] * targets

    def load() -> None:
        forget()
        load_chart(folder / LIFECYCLE, files, catalog)

    run({"tag_sequence": ["1"]}, 1)  # the layout is read once
    measure("load, compose and check three files", rounds, load)
    measure("simulate one tag", rounds, lambda: run({"tag_sequence": ["1"]}, 1))
    measure("simulate all 29 tags (96 s of virtual time)", rounds, lambda: run({}, 29))


if __name__ == "__main__":
    main()
