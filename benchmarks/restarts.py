"""What the journal costs, and what it saves: steps, replay, an orchestrator that is killed again and again.

    .venv/bin/python benchmarks/restarts.py journal    # a step, its size, replay; without ROS
    .venv/bin/python benchmarks/restarts.py kills [--kills 100] [--seed 1]

`kills` runs real nodes on the domain of ROS_DOMAIN_ID, with journals in XDG_STATE_HOME. The orchestrator is
killed (-9) at random moments; each time it must be held until somebody resumes, and in the end every target
must have exactly one outcome.
"""

from __future__ import annotations

import argparse
import random
import statistics
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from lupin_engine.chart.model import Chart
from lupin_engine.machine.machine import Machine
from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder
from lupin_engine.missions.load import load_chart
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.properties.live import LiveMonitor
from lupin_engine.runtime.clock import VirtualClock
from lupin_engine.runtime.journal.journal import Journal, Keep
from lupin_engine.runtime.journal.records import JournalHead, journal_of
from lupin_engine.runtime.journal.replay import replay
from lupin_engine.runtime.journal.writer import MemoryWriter
from lupin_engine.sim.simulation import Happening, Script, SetValue, Simulation

sys.path.insert(0, str(Path(__file__).parents[1]))

TARGETS = [str(number) for number in range(1, 31) if number != 8]


def quantiles(taken: list[float]) -> str:
    """Return median and 99th percentile of durations, in microseconds."""
    ordered = sorted(taken)
    return f"{1e6 * statistics.median(ordered):.1f} us, p99 {1e6 * ordered[int(0.99 * len(ordered))]:.1f} us"


def head_of(machine: Machine, clock: VirtualClock) -> JournalHead:
    """Return the head of a file about a machine that is not started."""
    return JournalHead(
        boot="",
        engine="",
        chart="",
        chart_name=machine.chart.name,
        profile=machine.chart.profile.name,
        parameters={},
        time=clock.now(),
        ahead_ns=round((clock.wall() - clock.now()) * 1e9),
        seed=machine.world.seed,
    )


class Timed:
    """A log that measures what another one takes."""

    def __init__(self, log: Journal) -> None:
        self._log = log
        self.taken: list[float] = []

    def __getattr__(self, name: str) -> Any:
        work = getattr(self._log, name)

        def timed(*arguments: Any) -> Any:
            begun = time.perf_counter()
            found = work(*arguments)
            self.taken.append(time.perf_counter() - begun)
            return found

        return timed


class Loop:
    """The loop of a journal: calls are run at once."""

    def post(self, call: Callable[[], None]) -> None:
        """Run a call."""
        call()

    def disk_changed(self, problem: str) -> None:
        """Print why the disk fails."""
        print(problem)


def in_memory() -> tuple[Journal, MemoryWriter]:
    """Return a journal that keeps its file in memory, and that file."""
    writer = MemoryWriter()
    return Journal(Path(), Keep(), Loop(), writer=writer), writer


@cache
def inspection() -> Chart:
    """Return the chart of the inspection."""
    folder = default_missions_folder()
    return load_chart(folder / LIFECYCLE, [folder / "inspection.yaml"], load_catalog())


def inspected(log: Any, journal: Journal, watch: LiveMonitor | None = None) -> Simulation:
    """Run an inspection of all targets with live values as on the robot, and keep its journal."""
    chart = inspection()
    poses = [
        Happening(SetValue("robot.pose", {"x": t / 7, "y": 1 / (t + 1), "yaw": 0.1 * t}), round(0.2 * t, 6))
        for t in range(1500)
    ]
    stops = [Happening(SetValue("robot.estop", False), round(0.1 * t, 6)) for t in range(3000)]
    script = Script("InspectionMission", {"tag_sequence": TARGETS}, happenings=(*poses, *stops))
    run = Simulation(chart, script, {}, log=log)
    journal.wall_ns = lambda: round(run.wall * 1e9)
    journal.begin(head_of(run.machine, VirtualClock(0.0, run.wall)))
    run._engine.watch = watch
    run.begin()
    while not run.is_over and run.advance():
        journal.compact(run.machine)
    return run


def measure_watch(rounds: int = 12) -> None:
    """Print what the watch over the properties adds to a step, with and without it by turns."""
    watch = LiveMonitor(inspection())
    taken: dict[bool, list[float]] = {False: [], True: []}
    for number in range(2 * rounds):
        is_watched = number % 2 == 1
        journal, _ = in_memory()
        begun = time.process_time()
        run = inspected(journal, journal, watch if is_watched else None)
        taken[is_watched].append((time.process_time() - begun) / len(run.steps))
    without, more = (
        statistics.median(taken[False]),
        statistics.median(b - a for a, b in zip(taken[False], taken[True], strict=True)),
    )
    print(f"the watch over the properties: {1e6 * more:.1f} us a step of {1e6 * without:.1f} us")


def measure_journal() -> None:
    """Print what a step costs, what an hour takes, and how fast it is replayed."""
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as folder:
        disk = Journal(Path(folder), Keep(), Loop())
        timed = Timed(disk)
        inspected(timed, disk)
        disk.close()
        print(f"a record on this disk's journal, without the commit's wait: {quantiles(timed.taken)}")
    journal, writer = in_memory()
    run = inspected(journal, journal)
    hour = 3600.0 / run.now * len(writer.data) / 1e6
    print(f"{len(run.steps)} steps in {run.now:.0f} s are {len(writer.data)} bytes: {hour:.1f} MB an hour")
    begun = time.process_time()
    found = journal_of(Path("x"), writer.data)
    read = time.process_time() - begun
    count = sum(1 for each in replay(found, run.world) if each.step is not None)
    taken = time.process_time() - begun
    print(
        f"replay: {count / taken:.0f} events a second of processor time ({read:.2f} of {taken:.2f} s to read)"
    )


def kill(kills: int, seed: int) -> None:
    """Kill a real orchestrator at random moments; nothing may be lost, done twice, or move by itself."""
    from tests.lupin_ros.world import Operator, World

    chance = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        world, operator = World(Path(folder)), Operator()
        world.start_all(speed=8.0)
        took: list[float] = []
        missions = 0
        try:
            while len(took) < kills:
                carried_out(world, operator, chance, kills, took)
                missions += 1
        finally:
            operator.ros.close()
            world.stop()
    spread = f"{min(took):.1f} to {max(took):.1f} s, median {statistics.median(took):.1f} s"
    print(f"{len(took)} kills in {missions} missions: held after {spread}; every target has one outcome")


def carried_out(world: Any, operator: Any, chance: random.Random, kills: int, took: list[float]) -> None:
    """Carry out a mission whose orchestrator is killed now and then, and check what came of it."""
    operator.until(lambda: operator.states and operator.state.lifecycle_state in ("READY", "DONE"), "ready")
    answers: list[Any] = []

    def begun() -> bool:
        answers.append(operator.start(*TARGETS[:8]))
        if not answers[-1].accepted:
            print(answers[-1].error_message)
        return bool(answers[-1].accepted)

    operator.until(begun, "a start")
    mission_id = answers[-1].mission_id
    operator.until(lambda: operator.state.mission_id == mission_id, "the mission")
    while operator.state.lifecycle_state != "DONE":
        until = time.monotonic() + chance.uniform(0.0, 3.0)
        while time.monotonic() < until:
            operator.ros.spin_once(0.02)
        if len(took) >= kills or operator.state.lifecycle_state == "DONE":
            operator.in_state("DONE")
            break
        taken, over = killed_once(world, operator)
        took.append(taken)
        print(
            f"{len(took)} kills, back after {taken:.1f} s{', when all was over' if over else ''}", flush=True
        )
        if over:
            break
    check(operator, mission_id)


def killed_once(world: Any, operator: Any) -> tuple[float, bool]:
    """Kill the orchestrator, start another one; return after how long it tells, and whether all was over."""
    process = world.processes["mission_orchestrator"]
    process.kill()
    process.wait()
    begun, since = time.monotonic(), time.time()
    operator.states.clear()
    world.start("mission_orchestrator", estop_timeout_s=10.0)

    def is_told() -> bool:
        """Say whether the newest state is the new one's: the dead one's last words may come late."""
        state = operator.states[-1] if operator.states else None
        return state is not None and state.header.stamp.sec > since and state.lifecycle_state != "BOOT"

    operator.until(is_told, "another one tells")
    taken = time.monotonic() - begun
    if operator.state.lifecycle_state == "READY":
        return taken, True
    assert operator.state.paused, operator.state
    goal = standing(operator)
    assert operator.ask("resume").success, goal
    return taken, False


def standing(operator: Any) -> str:
    """Check that the orchestrator sends nothing for a while, and return what it holds at."""
    until = time.monotonic() + 0.3
    while time.monotonic() < until:
        operator.ros.spin_once(0.02)
        assert operator.state.paused, operator.state
    return str(operator.state.last_error)


def check(operator: Any, mission_id: str) -> None:
    """Check that every target of a mission has exactly one outcome; a repeat is the same message."""

    def mine() -> list[Any]:
        return [o for o in operator.observations if o.mission_id == mission_id]

    operator.until(lambda: len({o.tag_reading.tag_id for o in mine()}) == len(TARGETS[:8]), "all outcomes")
    different = {(o.tag_reading.tag_id, o.status, o.header.stamp.sec, o.header.stamp.nanosec) for o in mine()}
    assert sorted(Counter(target for target, *_ in different).values()) == [1] * len(TARGETS[:8])


def main() -> None:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("what", choices=["journal", "kills"])
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    if given.what == "journal":
        measure_journal()
        measure_watch()
    else:
        kill(given.kills, given.seed)


if __name__ == "__main__":
    main()
