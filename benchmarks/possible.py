"""What it costs to tell what each request would do, after every step of all scenarios, and to tell the chart.

    .venv/bin/python benchmarks/possible.py [--rounds 5]

As in the orchestrator the requests are looked at after every step, and made JSON of when an answer is new.
Figures are milliseconds of the processor, the median of the rounds.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.runtime.possible import RequestPreview
from lupin_engine.sim.scenario import Missions, Scenario, load_scenario, scenario_files
from lupin_engine.sim.simulation import Simulation
from lupin_ros.service.chart_record import chart_picture, chart_record

SCENARIOS = Path(__file__).parents[1] / "tests" / "scenarios"


@dataclass
class Tally:
    """Looks, those that found that something may have changed, those that did; and seconds."""

    looks: int = 0
    worked: int = 0
    news: int = 0
    seconds: float = 0.0


def follow(scenario: Scenario, tally: Tally) -> None:
    """Run a scenario and look after everything that happens."""
    world = scenario.missions.world(scenario.chart, scenario.parameters)
    simulation = Simulation(scenario.chart, scenario.script, scenario.parameters, world)
    simulation.begin()
    foresight, machine, told = RequestPreview(simulation.machine), simulation.machine, None
    while not simulation.is_over and simulation.advance() and simulation.now < scenario.script.limit:
        if simulation.machine is not machine:  # made anew after a crash
            machine = simulation.machine
            foresight = RequestPreview(machine)
        begun = time.process_time()
        found = foresight.news(simulation.now)
        if found is not None and found != told:
            json.dumps(found)
        tally.seconds += time.process_time() - begun
        tally.looks += 1
        tally.worked += found is not None
        tally.news += found is not None and found != told
        told = found or told


def measure(scenarios: Sequence[Scenario]) -> Tally:
    """Follow all scenarios once."""
    tally = Tally()
    for scenario in scenarios:
        follow(scenario, tally)
    return tally


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    missions = Missions(load_catalog())
    files = [file for name in ("inspection", "exploration", "war_stories") for file in _files(name)]
    scenarios = [load_scenario(file, missions.catalog, missions) for file in files]
    measure(scenarios)
    found = [measure(scenarios) for _ in range(rounds)]
    one, seconds = found[0], statistics.median(each.seconds for each in found)
    print(f"{one.looks} looks, {one.worked} with work, {one.news} with news")
    print(f"a look: {1e3 * seconds / one.looks:.3f} ms; one with work: {1e3 * seconds / one.worked:.3f} ms")
    loaded, taken = load_missions((), missions.catalog), []
    for _ in range(rounds):
        begun = time.process_time()
        text = json.dumps({**chart_record(loaded), **chart_picture(loaded)})
        taken.append(time.process_time() - begun)
    print(f"the chart, {len(text) / 1e3:.0f} kB: {1e3 * statistics.median(taken):.0f} ms")


def _files(name: str) -> list[Path]:
    return scenario_files([SCENARIOS / name])


if __name__ == "__main__":
    main()
