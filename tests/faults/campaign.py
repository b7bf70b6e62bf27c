"""Runs with faults, one for each seed; the same seed is the same plan.

    make faults SEEDS=1-500
    .venv/bin/python -m tests.faults.campaign --seeds 1-500 [--jobs 2] [--folder faults]
    .venv/bin/python -m tests.faults.campaign --seeds 7 --show      # the plan only
    .venv/bin/python -m tests.faults.campaign --table               # of what has run until now

Each run is a line of `runs.csv` in the folder; seeds that are there already are left out, so a campaign that
was broken off goes on. Exit code 1 when something did not hold.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from tests.faults.cable import FaultyComputers
from tests.faults.plan import KINDS, plan
from tests.lupin_ros.computers import NoComputers

FIELDS = ("seed", "verdict", "seconds", "end", "resumes", "driven", "plan", "problems", "commit", "date")
#: Nodes are made anew after so many runs, so that what they keep of missions does not make each run slower.
RUNS_PER_ARENA = 40
ROOT = Path(__file__).parents[2]


def seeds_of(text: str) -> list[int]:
    """Return the numbers of `1-5,9`."""
    found: list[int] = []
    for part in text.split(","):
        first, _, last = part.partition("-")
        found += range(int(first), int(last or first) + 1)
    return found


def rows_of(file: Path) -> list[dict[str, str]]:
    """Return what has run."""
    if not file.exists():
        return []
    with file.open(newline="") as lines:
        return list(csv.DictReader(lines))


def add(file: Path, row: dict[str, object]) -> None:
    """Add a run; several processes may."""
    with file.open("a", newline="") as out:
        writer = csv.DictWriter(out, FIELDS)
        if out.tell() == 0:
            writer.writeheader()
        writer.writerow(row)


@contextlib.contextmanager
def two_computers() -> Iterator[FaultyComputers | None]:
    """Two computers, of which this process is on the first; None where there is no root."""
    found = FaultyComputers()
    try:
        try:
            found.connect()
            found.enter(0)
        except NoComputers as problem:
            print(f"one computer only, so no faults of the link and the disk: {problem}", flush=True)
            yield None
        else:
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SUBNET"
            yield found
    finally:
        found.remove()


def work(seeds: list[int], file: Path) -> None:
    """Carry runs out in this process; it has no threads yet, and nothing of ROS."""
    with two_computers() as computers, contextlib.ExitStack() as stack:
        from lupin_harness.domains import claimed_domain

        os.environ["ROS_DOMAIN_ID"] = str(stack.enter_context(claimed_domain()))
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        left = seeds
        while left:
            with tempfile.TemporaryDirectory(prefix="faults-", ignore_cleanup_errors=True) as folder:
                left = in_one_arena(left, Path(folder), file, computers)


def in_one_arena(seeds: list[int], folder: Path, file: Path, computers: FaultyComputers | None) -> list[int]:
    """Carry runs out with the same nodes as long as they are sound; return the seeds that are left."""
    from tests.faults.arena import Arena, Broken
    from tests.faults.run import Run
    from tests.faults.verdict import driven, problems

    arena = Arena(folder, computers)
    left = list(seeds)
    try:
        for seed in seeds[:RUNS_PER_ARENA]:
            drawn, begun = plan(seed, root=computers is not None), time.monotonic()
            left.remove(seed)
            run = Run(arena, drawn)
            row: dict[str, object] = {
                "seed": seed,
                "plan": drawn,
                "commit": commit(),
                "date": time.strftime("%F %T"),
            }
            try:
                seen = run.go()
            except (Broken, AssertionError) as problem:
                add(file, row | {"verdict": "not begun", "problems": problem})
                keep(folder, file.parent / f"{seed}")
                break
            wrong = problems(drawn, seen, arena.places)
            far = max((driven(seen.track, lost.begin, lost.end)[1] for lost in seen.lost), default=0.0)
            row |= {"verdict": "violation" if wrong else "ok", "seconds": f"{time.monotonic() - begun:.1f}"}
            row |= {
                "end": seen.end,
                "resumes": seen.resumes,
                "driven": f"{far:.2f}",
                "problems": "; ".join(wrong),
            }
            add(file, row)
            print(
                f"{drawn}\n  -> {row['verdict']}: {seen.end} in {row['seconds']} s {row['problems']}",
                flush=True,
            )
            if wrong:
                keep(folder, file.parent / f"{seed}")
                break
    finally:
        stubborn = arena.close()
        unmount(folder)
        if stubborn:
            print(f"had to be killed: {', '.join(stubborn)}", flush=True)
    return left


def keep(folder: Path, to: Path) -> None:
    """Keep logs, journals and track of a run in which something did not hold."""
    to.mkdir(parents=True, exist_ok=True)
    things = [str(folder / name) for name in ("logs", "state", "track.txt")]
    subprocess.run(["cp", "-r", *things, str(to)], check=False, stderr=subprocess.DEVNULL)
    (to / "state" / "filler").unlink(missing_ok=True)


def unmount(folder: Path) -> None:
    """Let go of the disk of an arena."""
    subprocess.run(["umount", "-l", str(folder / "state")], check=False, stderr=subprocess.DEVNULL)


def commit() -> str:
    """Return which state of the sources runs."""
    done = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True)
    return done.stdout.strip()


def table(rows: list[dict[str, str]]) -> str:
    """Return what came of the runs, by the kinds of their faults."""
    by_kind: dict[str, list[dict[str, str]]] = defaultdict(list)
    for row in rows:
        for kind in KINDS:
            if f": {kind}" in row["plan"]:
                by_kind[kind].append(row)
    lines = [
        "| fault | runs | DONE | held | FAULT | not begun | resumed | longest drive unheard (s) | wrong |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, chosen in [*sorted(by_kind.items()), ("all", rows)]:
        ends = [sum(row["end"].startswith(end) for row in chosen) for end in ("DONE", "held", "FAULT")]
        unbegun = sum(row["verdict"] == "not begun" for row in chosen)
        resumed = sum(int(row["resumes"] or 0) for row in chosen)
        far = max((float(row["driven"] or 0.0) for row in chosen), default=0.0)
        wrong = sum(row["verdict"] == "violation" for row in chosen)
        cells = [name, len(chosen), *ends, unbegun, resumed, f"{far:.1f}", wrong]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


def main() -> int:
    """Do what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", default="1-20", help="such as 1-500 or 3,7")
    parser.add_argument("--jobs", type=int, default=1, help="so many at a time")
    parser.add_argument("--folder", type=Path, default=Path("faults"))
    parser.add_argument("--show", action="store_true", help="print the plans only")
    parser.add_argument("--table", action="store_true", help="print the table only")
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    file = given.folder.absolute() / "runs.csv"
    done = {int(row["seed"]) for row in rows_of(file)}
    left = [seed for seed in seeds_of(given.seeds) if seed not in done]
    if given.show:
        print("\n".join(str(plan(seed)) for seed in seeds_of(given.seeds)))
        return 0
    if given.work:
        work(left, file)
        return 0
    if not given.table:
        share(left, given.jobs, given.folder)
    rows = rows_of(file)
    print(table(rows))
    return int(any(row["verdict"] != "ok" for row in rows))


def share(seeds: list[int], jobs: int, folder: Path) -> None:
    """Carry runs out in so many processes."""
    line = [sys.executable, "-m", "tests.faults.campaign", "--work", "--folder", str(folder), "--seeds"]
    parts = [",".join(map(str, seeds[number::jobs])) for number in range(jobs)]
    for process in [subprocess.Popen([*line, part]) for part in parts if part]:
        process.wait()


if __name__ == "__main__":
    sys.exit(main())
