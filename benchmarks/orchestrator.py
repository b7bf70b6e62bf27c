"""How long the orchestrator is silent, and what it writes, with real nodes.

    .venv/bin/python benchmarks/orchestrator.py abort [--targets 20000]  # many targets are closed at once
    .venv/bin/python benchmarks/orchestrator.py flood [--seconds 20]     # requests as fast as they go

Nodes run on the domain of ROS_DOMAIN_ID, what they keep goes to a folder of the benchmark.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from std_srvs.srv import Trigger

from lupin_engine_msgs.srv import Command
from lupin_ros.service.names import COMMAND_SERVICE
from tests.lupin_ros.world import Operator, World


class Desk(Operator):
    """An operator who knows when each state was told."""

    def spin(self, seconds: float) -> None:
        """Work for so long."""
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > end, "time", seconds + 60.0)

    def silence(self) -> float:
        """Return the longest time between two states since the last call, by their stamps, in seconds."""
        stamps = [state.header.stamp for state in self.states]
        times = [stamp.sec + 1e-9 * stamp.nanosec for stamp in stamps]
        self.states[:-1] = []
        return max((after - before for before, after in itertools.pairwise(times)), default=0.0)


@contextmanager
def running(**parameters: Any) -> Iterator[tuple[World, Desk, Path]]:
    """Run what an inspection needs; yields also the folder of what is kept."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["XDG_STATE_HOME"] = str(folder / "state")
        world, desk = World(folder), Desk()
        try:
            world.start_all(**parameters)
            desk.in_state("READY")
            yield world, desk, folder
        finally:
            desk.ros.close()
            world.stop()


def measure_abort(targets: int, seconds: float) -> None:
    """Print how long it is silent while a mission of many targets is begun and ended."""
    with running(max_targets=targets) as (_, desk, _):
        tags = [str(number % 7 + 1) for number in range(targets)]
        desk.silence()
        begun = time.monotonic()
        answer = desk.start(*tags)
        assert answer.accepted, answer.error_message
        desk.in_state("INSPECTING", "NAVIGATING")
        took = time.monotonic() - begun
        print(f"{targets} targets begun in {took:.1f} s, silent for {desk.silence():.2f} s", flush=True)
        begun = time.monotonic()
        assert desk.ask("abort").success
        answered = time.monotonic() - begun
        desk.in_state("DONE")
        desk.until(lambda: desk.state.targets_skipped >= targets - 3, "all are told")
        took = time.monotonic() - begun
        desk.spin(seconds)
        silent = desk.silence()
        print(f"aborted: answered in {answered:.2f} s, done after {took:.1f} s, silent for {silent:.2f} s")


def measure_flood(seconds: float) -> None:
    """Print what is written while requests come as fast as they are answered, each with an id of its own."""
    with running() as (_, desk, folder):
        commands = desk.ros.service(Command, COMMAND_SERVICE)
        pauses = desk.ros.service(Trigger, "/mission/pause")
        desk.until(lambda: commands.ready() and pauses.ready(), "the services")
        before = sizes(folder)
        count = 0
        answered: list[Any] = []
        desk.silence()
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for _ in range(50):
                count += 2
                asked = Command.Request(verb="pause", by=f"page {count}", command_id=str(count), request="{}")
                commands.call(asked, 60.0, answered.append)
                pauses.call(Trigger.Request(), 60.0, answered.append)
            desk.until(lambda due=count: len(answered) >= due, "answers")
        desk.spin(1.0)
        print(f"{count / seconds:.0f} requests a second, silent for {desk.silence():.2f} s")
        for name, size in sizes(folder).items():
            grown = size - before.get(name, 0)
            if grown > 1000:
                print(f"{name}: {grown} bytes, {grown / seconds * 86400 / 1e6:.0f} MB a day")


def sizes(folder: Path) -> dict[str, int]:
    """Return how large what is, by kind."""
    kinds = {"console": "mission_orchestrator.log", "records": "**/*.jsonl*", "journal": "**/*.journal"}
    return {kind: sum(f.stat().st_size for f in folder.glob(glob)) for kind, glob in kinds.items()}


def main() -> None:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("what", choices=["abort", "flood"])
    parser.add_argument("--targets", type=int, default=20_000)
    parser.add_argument("--seconds", type=float, default=20.0)
    given = parser.parse_args()
    if given.what == "abort":
        measure_abort(given.targets, given.seconds)
    else:
        measure_flood(given.seconds)


if __name__ == "__main__":
    main()
