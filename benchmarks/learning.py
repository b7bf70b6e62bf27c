"""How far predictions from learned rates are off, on robots whose parameters the learner does not see.

    .venv/bin/python benchmarks/learning.py                    # five robots
    .venv/bin/python benchmarks/learning.py --robots 1 --missions 20 --then 50

Each robot has a speed, a delay before it sets off, noise, slow floor at some tags, drives that fail or hang,
and a battery of its own. It plays missions to tags and in an order of chance, in virtual time, and writes the
journal of each by the engine's journal. What is learned comes from these files alone. Then it plays one
mission, whose order it never had, again and again, which is compared with what was expected of it. At last
the floor before one tag becomes slow.
"""

from __future__ import annotations

import argparse
import math
import random
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from functools import cache
from itertools import pairwise
from pathlib import Path
from statistics import quantiles
from typing import Any, NamedTuple
from unittest.mock import patch

from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.replay.yaml_text import yaml_text
from lupin_engine.runtime.journal.journal import CHARTS, Journal, Keep
from lupin_engine.runtime.journal.records import JournalHead
from lupin_engine.runtime.journal.writer import MemoryWriter
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim.scripted import MockOutcome, Stage
from lupin_engine.sim.simulation import Script, SetValue, Simulation
from lupin_sim.floor import Floor
from lupin_sim.layout import load_layout
from lupin_verify.drift import Drift, drifts
from lupin_verify.expecting import expect, learned_script, mission_seconds
from lupin_verify.learning import gather, table
from lupin_verify.rates import read_rates

LOADED = load_missions(["inspection"], load_catalog())
WORLD = make_world(LOADED.chart, {})
FLOOR, TAGS = Floor(load_layout("").tables), [tag.id for tag in load_layout("").tags]
HOME = (0.5, 0.5)
#: Seconds between two reports of the battery, and its resolution.
BATTERY_S, BATTERY_STEP = 1.0, 0.001


@cache
def length(start: tuple[float, float], goal: tuple[float, float]) -> float:
    """Return the length of the way around the tables, in metres."""
    corners = [start, *(FLOOR.path(start, goal) or [goal])]
    return sum(math.dist(a, b) for a, b in pairwise(corners))


class Played(NamedTuple):
    """How long a mission took (s), how full the battery was at its end, and how many tags were missed."""

    seconds: float
    battery: float
    missed: int


class _Owner:
    """The loop of a journal in one thread; its disk does not fail."""

    def post(self, call: Callable[[], None]) -> None:
        call()

    def disk_changed(self, problem: str) -> None:
        raise AssertionError(problem)


@dataclass
class HiddenRobot:
    """A robot whose parameters only it knows; `slow` are tags with the share of time that drives take."""

    seed: int
    slow: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        dice = random.Random(f"hidden/{self.seed}")
        self.speed, self.delay = dice.uniform(0.2, 0.6), dice.uniform(0.5, 4.0)
        self.noise = dice.uniform(0.05, 0.2)
        self.fails, self.hangs = dice.uniform(0.0, 0.06), dice.uniform(0.0, 0.01)
        self.reads, self.unread = dice.uniform(0.3, 2.0), dice.uniform(0.0, 0.03)
        self.per_metre, self.per_minute = dice.uniform(0.0003, 0.002), dice.uniform(0.001, 0.006)
        self.rough = {tag: dice.uniform(1.2, 1.8) for tag in dice.sample(TAGS, 4)}
        self._dice = dice

    def outcome(self, stage: Stage, operation: str, arguments: Any, _: Any) -> MockOutcome:
        """Return what becomes of an attempt, in place of a script's rules."""
        target, noise = stage._target(), self._dice.lognormvariate(0.0, self.noise)
        if operation == "bridge.read_tag":
            code = "scan_failed" if self._dice.random() < self.unread else ""
            return MockOutcome(after=self.reads * noise, code=code)
        if operation not in ("nav.go_to", "nav.dock"):
            return MockOutcome()
        goal = arguments["pose"]
        way = length(self.place, (round(goal["x"], 2), round(goal["y"], 2)))
        share = self.rough.get(target, 1.0) * self.slow.get(target, 1.0) if operation == "nav.go_to" else 1.0
        takes = (self.delay + way / self.speed) * share * noise
        chance = self._dice.random()
        self.until, self.pace = 0.0, way / takes
        if chance < self.hangs:
            return MockOutcome(never=True)
        if chance < self.hangs + self.fails:
            return MockOutcome(after=self._dice.uniform(0.1, 0.9) * takes, code="nav_status_6")
        self.until = stage._now() + takes
        return MockOutcome(after=takes)

    def play(self, number: int, tags: Sequence[str], folder: Path | None = None) -> Played:
        """Play a mission, and write its journal."""
        began = datetime(2026, 3, 1) + timedelta(hours=8 + number % 9, days=number // 9)
        request = {"tag_sequence": list(tags), "mission_id": f"hidden-{self.seed}-{number}"}
        script = Script(LOADED.names[0], request, clock=f"{began:%Y-%m-%d %H:%M}")
        self.place, self.until, self.pace, charge, reported = HOME, 0.0, 0.0, 1.0, 0.0
        writer = FileWriter()
        journal = Journal(folder or Path(), Keep(), _Owner(), lambda: round(sim.wall * 1e9), writer)
        with patch.object(Stage, "_choose", lambda *given: self.outcome(*given)):
            sim = Simulation(LOADED.chart, script, {}, WORLD, log=journal)
            journal.begin(_head(sim, request["mission_id"]))
            sim.begin()
            sim.do(SetValue("robot.pose", {"x": HOME[0], "y": HOME[1], "yaw": 0.0}))
            while not sim.is_over and sim.next_due is not None:
                if reported + BATTERY_S < sim.next_due:
                    reported += BATTERY_S
                    sim.wait_until(max(reported, sim.now))
                    sim.do(SetValue("robot.battery", round(charge / BATTERY_STEP) * BATTERY_STEP))
                    metres = self.pace * BATTERY_S if reported < self.until else 0.0
                    charge -= self.per_minute * BATTERY_S / 60.0 + self.per_metre * metres
                    continue
                done = len(sim.steps)
                sim.advance()
                for step in sim.steps[done:]:
                    if step.event.name == "value" and step.event.data["name"] == "robot.pose":
                        pose = step.event.data["value"]
                        self.place = round(pose["x"], 2), round(pose["y"], 2)
        run = sim.result(cut_off=False)
        journal.ended({"state": run.view.lifecycle, "code": run.view.code, "total": len(run.visits)})
        if folder is not None:
            writer.save()
            _keep_chart(folder)
        missed = sum(not LOADED.chart.profile.is_good(visit.status) for visit in run.visits)
        return Played(mission_seconds(run), charge, missed)


class FileWriter(MemoryWriter):
    """Keeps the frames of a journal until they are saved: in virtual time nobody waits for a disk."""

    def open(self, path: Path, cut: int | None = None) -> None:
        """Begin a file."""
        super().open(path, cut)
        self.path = path

    def save(self) -> None:
        """Write the file."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.write_bytes(self.data)


def _head(sim: Simulation, mission_id: str) -> JournalHead:
    return JournalHead(
        boot="hidden",
        engine="",
        chart=LOADED.hash,
        chart_name=LOADED.chart.name,
        profile=LOADED.chart.profile.name,
        parameters=dict(sim.world.parameters),
        time=0.0,
        ahead_ns=round(sim.wall * 1e9),
        files=tuple(LOADED.short_names[str(file)] for file in LOADED.files),
        mission=LOADED.names[0],
        mission_id=mission_id,
    )


def _keep_chart(folder: Path) -> None:
    for name, short in LOADED.short_names.items():
        path = folder / CHARTS / LOADED.hash / short
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(LOADED.sources[name])


def tours(seed: int, tags: Sequence[str] = ()) -> Iterator[list[str]]:
    """Yield requests: 12 to 20 tags in an order of chance; with `tags`, always these."""
    dice = random.Random(f"tours/{seed}")
    while True:
        yield list(tags) or dice.sample(TAGS, dice.randint(12, 20))


def p50_p90(values: Sequence[float]) -> tuple[float, float]:
    """Return the median and the 90 % quantile."""
    cuts = quantiles(values, n=10, method="inclusive")
    return cuts[4], cuts[8]


def predicted(seed: int, missions: int, then: int) -> tuple[list[float], str]:
    """Return by which shares p50 and p90 of the duration are off, and all as a line."""
    robot, asked = HiddenRobot(seed), tours(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number in range(missions):
            robot.play(number, next(asked), folder)
        file = folder / "learned.yaml"
        file.write_text(yaml_text(table(gather(folder, load_catalog()))), encoding="utf-8")
        rates = read_rates(file, LOADED.chart)
    tags = next(asked)
    script = learned_script(rates, LOADED.names[0], {"tag_sequence": tags})
    found = expect(LOADED, rates, script, make_world(LOADED.chart, rates.parameters), range(then))
    real = [robot.play(missions + number, tags) for number in range(then)]
    mine, its = p50_p90(found.seconds), p50_p90([one.seconds for one in real])
    off = [a / b - 1.0 for a, b in zip(mine, its, strict=True)]
    left = (p50_p90(found.left["robot.battery"])[0], p50_p90([one.battery for one in real])[0])
    missed = (sum(found.missed) / then, sum(one.missed for one in real) / then)
    return off, (
        f"robot {seed}, {len(tags):2} tags: p50 {mine[0]:4.0f} s for {its[0]:4.0f} s ({off[0]:+5.1%}),"
        f" p90 {mine[1]:4.0f} s for {its[1]:4.0f} s ({off[1]:+5.1%}),"
        f" battery {left[0]:.1%} for {left[1]:.1%}, missed {missed[0]:.2f} for {missed[1]:.2f}"
    )


def told(seed: int, missions: int, share: float, most: int) -> tuple[int, list[Drift]]:
    """Return after how many visits a slow-down of one tag is told (0: not within `most`), and all that is."""
    robot, tag = HiddenRobot(seed), TAGS[seed % len(TAGS)]
    with tempfile.TemporaryDirectory() as name:
        folder, asked = Path(name), tours(seed)
        for number in range(missions):
            robot.play(number, next(asked), folder)
        seen = gather(folder, load_catalog()).seen
        robot.slow = {tag: share}
        for visit in range(1, most + 1):
            later = folder / str(visit)
            tags = next(asked)
            robot.play(missions + visit, tags if tag in tags else [*tags[:5], tag, *tags[5:]], later)
            seen += gather(later, load_catalog()).seen
            found = drifts(seen)
            if any(one.target == tag and one.operation == "nav.go_to" for one in found):
                return visit, found
    return 0, []


def false_alarms(seed: int, missions: int) -> int:
    """Return how often something is told anew in so many missions of a robot that stays as it is."""
    robot, asked, alarms, before = HiddenRobot(seed), tours(seed), 0, set[tuple[str, str]]()
    with tempfile.TemporaryDirectory() as name:
        for number in range(missions):
            robot.play(number, next(asked), Path(name))
        seen = sorted(gather(Path(name), load_catalog()).seen, key=lambda one: one.wall)
    ends = [n for n, (a, b) in enumerate(pairwise(seen), 1) if b.wall - a.wall > 1200.0]
    for end in [*ends, len(seen)]:
        now = {(one.operation, one.target) for one in drifts(seen[:end])}
        alarms, before = alarms + len(now - before), now
    return alarms


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", type=int, default=5, help="how many (default: 5)")
    parser.add_argument("--missions", type=int, default=50, help="that are learned from (default: 50)")
    parser.add_argument("--then", type=int, default=200, help="that are predicted (default: 200)")
    asked = parser.parse_args()
    worst = 0.0
    for seed in range(asked.robots):
        off, line = predicted(seed, asked.missions, asked.then)
        worst = max(worst, *map(abs, off))
        print(line, flush=True)
    print(f"durations are predicted within {worst:.1%}", flush=True)
    for seed in range(asked.robots):
        visit, _ = told(seed, asked.missions, 1.5, 10)
        alarms = false_alarms(seed, asked.then)
        print(f"robot {seed}: half as slow again at a tag is told after {visit} visits;", end=" ")
        print(f"{alarms} false alarms in {asked.then} missions without", flush=True)


if __name__ == "__main__":
    main()
