"""What proofs cost: situations, transitions, steps of the machine, seconds of processor, and memory.

    .venv/bin/python benchmarks/proofs.py                      # those of the table in docs/proof.md
    .venv/bin/python benchmarks/proofs.py --only exploration   # of one mission
    .venv/bin/python benchmarks/proofs.py --apart              # with all situations told apart

Each proof is made in a process of its own, one after the other, with the graph, restarts and loading anew.
With `--apart` it is only the walk, with nothing left out that could be told apart, up to two million
situations: so its rates are those of looking effects up, where the proof has few situations left.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from lupin_engine.machine.scope import World
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.properties.authored import properties_of
from lupin_engine.runtime.setup import make_world
from lupin_verify.proof import prove
from lupin_verify.situations.explorer import Bounds, SituationExplorer
from lupin_verify.situations.found import ExplorationProgress
from lupin_verify.situations.levels import explore

ROOT = Path(__file__).resolve().parents[1]
#: So many situations are looked at with `--apart`.
MOST = 2_000_000


class Case(NamedTuple):
    """One proof: of which mission, within which bounds, with which parameters."""

    mission: str
    bounds: Bounds
    parameters: Mapping[str, Any] = {}

    def __str__(self) -> str:
        late = ", one answer late" if self.bounds.owed else ""
        more = "".join(f", {name} {value}" for name, value in self.parameters.items())
        return f"{Path(self.mission).stem}, {self.bounds.targets} targets{late}{more}"


TWO_SWEEPS = {"monitoring_sweeps": 2}
CASES = [
    Case("inspection", Bounds(targets=2)),
    Case("inspection", Bounds(targets=4)),
    Case("inspection", Bounds(targets=2, owed=1)),
    Case("exploration", Bounds(targets=1)),
    *(Case("exploration", Bounds(targets=tags), TWO_SWEEPS) for tags in (1, 2, 3)),
    *(
        Case(str(ROOT / f"examples/{name}/missions/{name}.yaml"), Bounds(targets=1))
        for name in ("watering", "photo_round", "night_watch")
    ),
    Case(str(ROOT / "plugins/lupin_arm/calibration/calibration.yaml"), Bounds()),
]


def measured(case: Case, apart: bool) -> dict[str, float]:
    """Make a proof, or a walk with all situations told apart, and return its figures."""
    world = make_world(load_missions([case.mission], load_catalog()).chart, case.parameters)
    begun = time.process_time()
    progress = (walked if apart else proven)(world, case.bounds)
    return {
        "situations": progress.situations,
        "transitions": progress.transitions,
        "steps": progress.steps,
        "seconds": time.process_time() - begun,
        "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def proven(world: World, bounds: Bounds) -> ExplorationProgress:
    """Prove everything, with the graph."""
    proof = prove(world, bounds)
    assert proof.complete, proof.stopped
    assert not proof.broken, [one.name for one in proof.broken]
    return proof.progress


def walked(world: World, bounds: Bounds) -> ExplorationProgress:
    """Look at all situations, or at so many, with nothing left out that could be told apart."""
    explorer = SituationExplorer(world, properties_of(world.chart), bounds)
    found = explore(explorer, lambda progress: "enough" if progress.situations > MOST else "", live=False)
    assert found.complete or found.stopped == "enough", found.stopped
    return found.progress


def main() -> None:
    """Measure each case in a process of its own, and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="", help="the name of a mission")
    parser.add_argument("--apart", action="store_true", help="tell all situations apart")
    parser.add_argument("--case", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.case is not None:
        print(json.dumps(measured(CASES[given.case], given.apart)))
        return
    print("| Proof | Situations | Transitions | Steps | Seconds | Situations/s | Transitions/s | Memory |")
    print("|---|---|---|---|---|---|---|---|")
    for number, case in enumerate(CASES):
        if given.only in case.mission:
            command = [sys.executable, __file__, "--case", str(number), *["--apart"] * given.apart]
            told = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
            _print_row(case, json.loads(told))


def _print_row(case: Case, one: Mapping[str, float]) -> None:
    counts = [f"{one[name]:,.0f}" for name in ("situations", "transitions", "steps")]
    rates = [f"{one[name] / one['seconds']:,.0f}" for name in ("situations", "transitions")]
    cells = [str(case), *counts, f"{one['seconds']:.1f}", *rates, f"{one['megabytes']:,.0f} MB"]
    print("|", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
