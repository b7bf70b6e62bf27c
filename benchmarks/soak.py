"""Nodes that run for hours: does what they hold grow with time, or with missions?

    make soak HOURS=2
    .venv/bin/python benchmarks/soak.py [--hours 2] [--speed 20] [--every 20] [--folder FOLDER]
    .venv/bin/python benchmarks/soak.py --table FOLDER     # of a run that is over, or still under way

`lupin up` starts all nodes on a domain of their own; missions of both types follow one another. Memory (PSS,
RSS, and without files), descriptors, threads and shared memory of each node, and what lies on the disk, go
into `soak.csv`; the table and `soak.png` are made of it. Growth is the slope of a line through the
last three quarters of a run.
"""

from __future__ import annotations

import argparse
import csv
import os
import random
import signal
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from lupin_harness.domains import claimed_domain
from lupin_ros.launch import shared_memory

LUPIN = str(Path(sys.executable).with_name("lupin"))
TAGS = [str(number) for number in range(1, 31) if number != 8]
#: The lines of smaps_rollup: no file is behind `own` memory, so other processes do not change it.
SIZES = {"Pss": "pss", "Rss": "rss", "Anonymous": "own"}
#: How long a mission may take, in seconds: 5 to 30 are usual, a search that finds nothing has a limit.
MISSION_S = 300.0


def nodes_of(parent: int) -> dict[str, int]:
    """Return the processes that `lupin up` has started, by the names of their nodes."""
    children = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
    found = {}
    for pid in map(int, children):
        words = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
        if "node" in words:
            found[words[words.index("node") + 1]] = pid
    return found


def measured(pid: int) -> dict[str, float]:
    """Return what a process holds now; sizes are in kB."""
    process = Path(f"/proc/{pid}")
    lines = (process / "smaps_rollup").read_text().splitlines()
    sizes = {
        SIZES[name]: float(rest.split()[0])
        for name, _, rest in (line.partition(":") for line in lines)
        if name in SIZES
    }
    segments = [shared_memory.FOLDER / name for name in shared_memory.segments_of(pid)]
    return {
        **sizes,
        "descriptors": len(os.listdir(process / "fd")),
        "threads": len(os.listdir(process / "task")),
        "shared": sum(each.stat().st_blocks / 2 for each in segments if each.exists()),
    }


def size_of(folder: Path) -> float:
    """Return what lies in a folder, in kB."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()) / 1000.0


class Samples:
    """Writes what all nodes hold, now and then."""

    def __init__(self, folder: Path, parent: int, every: float) -> None:
        self._folder, self._parent, self._every = folder, parent, every
        self._begun = time.monotonic()
        self._next = 0.0
        self.missions = 0
        self._file = (folder / "soak.csv").open("w", newline="")
        self._rows = csv.writer(self._file)
        self._rows.writerow(["seconds", "missions", "of", "measure", "value"])

    @property
    def seconds(self) -> float:
        """How long the nodes have run."""
        return time.monotonic() - self._begun

    def look(self) -> None:
        """Write a sample if it is time for one."""
        if self.seconds < self._next:
            return
        self._next = self.seconds + self._every
        for name, pid in nodes_of(self._parent).items():
            for measure, value in measured(pid).items():
                self._write(name, measure, value)
        self._write("disk", "journal", size_of(self._folder / "state" / "lupin" / "journal"))
        self._write("disk", "logs", size_of(self._folder / "logs"))
        self._write("disk", "state", size_of(self._folder / "state"))
        self._file.flush()

    def _write(self, of: str, measure: str, value: float) -> None:
        self._rows.writerow([f"{self.seconds:.1f}", self.missions, of, measure, f"{value:g}"])


def requests(seed: int) -> Iterator[Any]:
    """Make requests of both types, one after the other."""
    from lupin_msgs.srv import StartMission

    chance = random.Random(seed)
    while True:
        tags = chance.sample(TAGS, 4)
        yield StartMission.Request(mission_type="InspectionMission", tag_sequence=tags)
        yield StartMission.Request(mission_type="ExplorationMission", discovery_goal=2)


def is_idle(operator: Any) -> bool:
    """Say whether a mission could be started."""
    return bool(operator.states) and operator.state.lifecycle_state in ("READY", "DONE")


def work(operator: Any, samples: Samples, request: Any) -> None:
    """Carry out a mission to its end, whatever becomes of its targets."""
    from lupin_msgs.srv import StartMission

    def is_over() -> bool:
        samples.look()
        return is_idle(operator)

    answers: list[Any] = []

    def is_begun() -> bool:
        """Start it; a computer that is too busy to take the request in time refuses it as stale."""
        if is_over():
            answers.append(operator.call(StartMission, "/mission/start", request))
        return bool(answers) and bool(answers[-1].accepted)

    operator.until(is_begun, f"the start of {request.mission_type}", MISSION_S)
    operator.until(lambda: operator.state.mission_id == answers[-1].mission_id, "the mission")
    operator.until(is_over, f"the end of {request.mission_type}", MISSION_S)
    del operator.states[:-1]
    operator.observations.clear()
    samples.missions += 1


def soak(folder: Path, hours: float, speed: float, every: float) -> None:
    """Run missions for so many hours."""
    from tests.lupin_ros.world import Operator

    (folder / "logs").mkdir(parents=True)
    with claimed_domain() as domain:
        os.environ |= {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        os.environ |= {"XDG_STATE_HOME": str(folder / "state"), "XDG_CONFIG_HOME": str(folder / "config")}
        given = ["--separate", "--set", "monitoring_sweeps=1", "--set", "estop_timeout_s=10 s"]
        command = [LUPIN, "up", "--speed", f"{speed:g}", "--log-dir", str(folder / "logs"), *given]
        with (folder / "up.txt").open("wb") as output:
            up = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
        operator = Operator("soak")
        try:
            operator.until(
                lambda: operator.states and operator.state.lifecycle_state == "READY", "READY", 120.0
            )
            samples = Samples(folder, up.pid, every)
            for request in requests(seed=1):
                if samples.seconds > 3600.0 * hours:
                    break
                work(operator, samples, request)
        finally:
            operator.ros.close()
            up.send_signal(signal.SIGINT)
            up.wait(60.0)


def read(folder: Path) -> dict[tuple[str, str], np.ndarray[Any, Any]]:
    """Return arrays of (seconds, missions, value) by node and measure."""
    rows: dict[tuple[str, str], list[tuple[float, float, float]]] = defaultdict(list)
    with (folder / "soak.csv").open() as file:
        for row in csv.DictReader(file):
            key = row["of"], row["measure"]
            rows[key].append((float(row["seconds"]), float(row["missions"]), float(row["value"])))
    return {key: np.array(values) for key, values in rows.items()}


def table(folder: Path) -> str:
    """Return what each node held, and its growth, as a table."""
    found = read(folder)
    last = next(iter(found.values()))[-1]
    told = [
        f"{last[0] / 3600.0:.2f} h, {last[1]:.0f} missions",
        "",
        "| node | PSS (MB) | own memory after 1/4, end (MB) | growth (MB/h) | a mission (kB) "
        "| descriptors | threads | shared (MB) |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in sorted({of for of, _ in found if of != "disk"}):
        own = late(found[name, "own"])
        counts = (late(found[name, measure])[:, 2] for measure in ("descriptors", "threads"))
        spread = [f"{np.min(each):.0f} to {np.max(each):.0f}" for each in counts]
        shared = late(found[name, "shared"])[:, 2] / 1000.0
        grown = 3600.0 * slope(own[:, 0], own[:, 2]) / 1000.0
        each = slope(own[:, 1], own[:, 2])
        told.append(
            f"| {name} | {found[name, 'pss'][-1, 2] / 1000.0:.1f} | {own[0, 2] / 1000.0:.1f}, "
            f"{own[-1, 2] / 1000.0:.1f} | {grown:.2f} | {each:.2f} "
            f"| {' | '.join(spread)} | {shared[0]:.1f}, {shared[-1]:.1f} |"
        )
    for measure in ("journal", "logs", "state"):
        values = found["disk", measure]
        told.append(f"{measure}: {values[-1, 2] / 1000.0:.1f} MB on the disk")
    return "\n".join(told)


def late(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return the samples after the first quarter: until then modules are loaded and tables filled."""
    found: np.ndarray[Any, Any] = values[values[:, 0] >= values[-1, 0] / 4.0]
    return found


def slope(x: np.ndarray[Any, Any], y: np.ndarray[Any, Any]) -> float:
    """Return the slope of the line through points; 0 where there is none."""
    return float(np.polyfit(x, y, 1)[0]) if np.ptp(x) > 0 else 0.0


def draw(folder: Path) -> None:
    """Draw the memory of each node over time into `soak.png`."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    _, (memory, rest) = pyplot.subplots(2, 1, figsize=(9, 8), sharex=True)
    for (name, measure), values in sorted(read(folder).items()):
        if measure == "own":
            memory.plot(values[:, 0] / 60.0, values[:, 2] / 1000.0, label=name)
        elif measure == "descriptors":
            rest.plot(values[:, 0] / 60.0, values[:, 2], label=name)
    memory.set_ylabel("own memory (MB)")
    rest.set_ylabel("descriptors")
    rest.set_xlabel("minutes")
    memory.legend()
    pyplot.savefig(folder / "soak.png", dpi=100)


def main() -> None:
    """Run, and tell what was seen."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--speed", type=float, default=20.0)
    parser.add_argument("--every", type=float, default=20.0, help="seconds between two samples")
    parser.add_argument("--folder", type=Path, default=Path("soak"))
    parser.add_argument("--table", type=Path, metavar="FOLDER")
    given = parser.parse_args()
    if given.table is None:
        soak(given.folder.absolute(), given.hours, given.speed, given.every)
    folder = given.table or given.folder
    print(table(folder))
    draw(folder)


if __name__ == "__main__":
    main()
