"""How long the orchestrator is silent, what it writes, and what its journal costs, with real nodes.

    .venv/bin/python benchmarks/orchestrator.py abort [--targets 20000]  # many targets are closed at once
    .venv/bin/python benchmarks/orchestrator.py flood [--seconds 20]     # requests as fast as they go
    .venv/bin/python benchmarks/orchestrator.py journal [--seconds 60]   # a mission with and without it

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

NODE = "mission_orchestrator"
#: An orchestrator whose journal writes nothing.
WITHOUT = """
from lupin_engine.runtime.journal.journal import Journal
Journal._input = Journal._put = lambda *_, **__: None
Journal.begin = Journal.compact = lambda *_, **__: None
Journal.when_kept = lambda _, then: then()
from lupin_cli.main import main
main(["node", "mission_orchestrator", "--ros-args", "-p", "estop_timeout_s:=10.0"])
"""


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


def measure_abort(targets: int) -> None:
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
        desk.spin(20.0)
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


def measure_journal(seconds: float) -> None:
    """Print what the orchestrator takes of a core in a mission, with and without its journal."""
    for kind in ("with", "without", "with", "without"):
        with running(speed=1.0) as (world, desk, folder):
            if kind == "without":
                world.processes[NODE].terminate()
                world.processes[NODE].wait(10.0)
                desk.states.clear()
                world.run(NODE, [sys.executable, "-c", WITHOUT])
                desk.in_state("READY")
            assert desk.start(*[str(number) for number in range(1, 8)]).accepted
            desk.in_state("INSPECTING", "NAVIGATING")
            before, size, begun = cpu(world), sizes(folder)["journal"], time.monotonic()
            desk.spin(seconds)
            took = time.monotonic() - begun
            share = 100.0 * (cpu(world) - before) / took
            grown = (sizes(folder)["journal"] - size) / took * 3600 / 1e6
            print(f"{kind} journal: {share:.2f} % of a core, {grown:.2f} MB an hour", flush=True)


def cpu(world: World) -> float:
    """Return the processor time of the orchestrator, in seconds."""
    told = Path(f"/proc/{world.processes[NODE].pid}/stat").read_text(encoding="utf-8")
    fields = told.rpartition(")")[2].split()

    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("what", choices=["abort", "flood", "journal"])
    parser.add_argument("--targets", type=int, default=20_000)
    parser.add_argument("--seconds", type=float, default=0.0)
    given = parser.parse_args()
    if given.what == "abort":
        measure_abort(given.targets)
    elif given.what == "flood":
        measure_flood(given.seconds or 20.0)
    else:
        measure_journal(given.seconds or 60.0)


if __name__ == "__main__":
    main()
