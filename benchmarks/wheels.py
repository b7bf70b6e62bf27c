"""A toy whose situations can be counted by hand, explored by `lupin prove` and by SPIN in the same run.

    .venv/bin/python benchmarks/wheels.py [--states 270]

Three wheels turn on their own, so N states each make N x N x N situations: 19,683,000 with 270. For us a
wheel is a variable of a mission that a request turns; for SPIN a process of a model in Promela. Both must
come to that number. Times are those of the processor; that of SPIN is its verifier's, compiled with -O2,
without partial order reduction, which would leave situations out. SPIN needs a C compiler; where it is
missing that is told.
"""

from __future__ import annotations

import argparse
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from lupin_engine.missions.load import load_chart
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.properties.built_in import BUILT_IN
from lupin_engine.runtime.setup import make_world
from lupin_verify.situations.explorer import Bounds, SituationExplorer
from lupin_verify.situations.found import ExplorationProgress
from lupin_verify.situations.levels import explore

LIFECYCLE = """\
lifecycle: Wheels
states:
  ALL: {slot: mission, on_done: ALL}
"""
MISSION = """\
mission: Toy
context:
  a: {type: count, default: 0}
  b: {type: count, default: 0}
  c: {type: count, default: 0}
states:
  TURNING:
    on:
      operator.skip_current: [{guard: a < LAST, do: [{set: {a: "${ a + 1 }"}}]}, {do: [{set: {a: 0}}]}]
      operator.dock: [{guard: b < LAST, do: [{set: {b: "${ b + 1 }"}}]}, {do: [{set: {b: 0}}]}]
      operator.resume: [{guard: c < LAST, do: [{set: {c: "${ c + 1 }"}}]}, {do: [{set: {c: 0}}]}]
      operator.abort: done
  done: {type: final}
"""
PROMELA = """\
short wheel[3];
active [3] proctype turn() { do :: atomic { wheel[_pid] = (wheel[_pid] + 1) % STATES } od }
"""
_STATES = re.compile(r"^\s*(\d+) states, stored", re.MULTILINE)


class Counted(NamedTuple):
    """What one of them says: how many situations, in how many seconds of processor, with how much memory."""

    situations: int
    seconds: float
    megabytes: float


def ours(states: int) -> Counted:
    """Explore the mission, with all that is watched in every step."""
    with tempfile.TemporaryDirectory() as name:
        lifecycle, mission = Path(name) / "lifecycle.yaml", Path(name) / "toy.yaml"
        lifecycle.write_text(LIFECYCLE, encoding="utf-8")
        mission.write_text(MISSION.replace("LAST", str(states - 1)), encoding="utf-8")
        world = make_world(load_chart(lifecycle, [mission], load_catalog()), {})
    explorer = SituationExplorer(world, BUILT_IN, Bounds(targets=0, restarts=False))
    begun = time.process_time()
    found = explore(explorer, _tell)
    seconds = time.process_time() - begun
    assert found.complete, found.stopped
    assert found.breaches == {}
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return Counted(found.progress.situations, seconds, memory)


def _tell(progress: ExplorationProgress) -> str:
    if sys.stderr.isatty():
        print(f"\r{progress.situations:,} situations ", end="", file=sys.stderr, flush=True)
    return ""


def spin(states: int) -> Counted | None:
    """Let SPIN explore its model; None where there is none, or no compiler."""
    if shutil.which("spin") is None or shutil.which("cc") is None:
        return None
    with tempfile.TemporaryDirectory() as name:
        (Path(name) / "wheels.pml").write_text(PROMELA.replace("STATES", str(states)), encoding="utf-8")
        for command in (
            ["spin", "-a", "wheels.pml"],
            ["cc", "-O2", "-DSAFETY", "-DNOREDUCE", "-DMEMLIM=8192", "-o", "pan", "pan.c"],
        ):
            subprocess.run(command, cwd=name, check=True, capture_output=True)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        # As deep as there are situations: depth first goes through all of them on one way.
        depth = str(states**3 + 10)
        done = subprocess.run(
            ["./pan", f"-m{depth}", "-w25"], cwd=name, check=True, capture_output=True, text=True
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    found = _STATES.search(done.stdout)
    if found is None or "max search depth too small" in done.stdout:
        raise SystemExit(f"spin did not look at everything:\n{done.stdout}")
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Counted(int(found[1]), seconds, after.ru_maxrss / 1024)


def main() -> None:
    """Count, compare and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--states", type=int, default=90, help="of each of the three wheels (default: 90)")
    states = parser.parse_args().states
    theirs = spin(states)
    mine = ours(states)
    for name, one in (("SPIN", theirs), ("lupin", mine)):
        if one is None:
            print(f"{name:<6} is not installed, or there is no C compiler: apt install spin gcc")
            continue
        rate = one.situations / max(one.seconds, 1e-9)
        print(
            f"{name:<6} {one.situations:>12,} situations {one.seconds:>9.1f} s of processor"
            f" {rate:>12,.0f} a second {one.megabytes:>8,.0f} MB"
        )
        if one.situations != states**3:
            raise SystemExit(f"{name}: {states**3:,} situations were expected")
    if theirs is not None:
        print(f"SPIN is {mine.seconds / max(theirs.seconds, 1e-9):.1f} times as fast")


if __name__ == "__main__":
    main()
