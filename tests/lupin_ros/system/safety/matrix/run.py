"""The matrix: every source of motion, every stop, every order, with real processes.

    make matrix                                        # all cells that this commit has not run yet
    make matrix ARGS="--source page_goal --stop e_stop_state"
    make matrix ARGS="--table"                         # what has run until now
    make matrix ARGS="--page"                          # the table of docs/safety.md, made of it
    make matrix ARGS="--defects"                       # planted defects: each must be found

Each cell is a line of `cells.jsonl` in the folder `matrix`; a cell that is there for this commit is left out.
Exit code 1 when something moved, was not said, or a defect was not found.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tests.lupin_ros.system.safety.matrix.table import (
    EVERY_SOURCE,
    EVERY_STOP,
    ORDERS,
    SMALL,
    Cell,
    cell,
    cells,
)
from tests.lupin_ros.system.safety.matrix.written import summary, write_page

if TYPE_CHECKING:
    from tests.lupin_ros.system.safety.matrix.bench import Bench

ROOT = Path(__file__).parents[5]
#: The bench is made anew after so many cells.
CELLS_PER_BENCH = 60
#: The verdict of a cell in which what was waited for did not come; it is run again.
NOT_CARRIED_OUT = "not carried out"


def commit() -> str:
    """Return which state of the sources runs."""
    done = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True)
    return done.stdout.strip()


def results_of(file: Path) -> list[dict[str, Any]]:
    """Return what has run."""
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


@contextmanager
def bench_of() -> Iterator[Bench]:
    """Yield a bench on a domain of its own."""
    with ExitStack() as stack:
        from lupin_harness.domains import claimed_domain

        os.environ["ROS_DOMAIN_ID"] = str(stack.enter_context(claimed_domain()))
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        folder = stack.enter_context(
            tempfile.TemporaryDirectory(prefix="matrix-", ignore_cleanup_errors=True)
        )
        from tests.lupin_ros.system.safety.matrix.bench import Bench

        bench = Bench(Path(folder))
        stack.callback(bench.close)
        yield bench


def carried_out(chosen: Iterable[Cell], keep: Path) -> Iterator[dict[str, Any]]:
    """Yield the result of each cell; a bench on which one could not be carried out is made anew.

    What its nodes have logged is kept in the folder `keep`.
    """
    left = list(chosen)
    while left:
        with bench_of() as bench:
            from tests.lupin_ros.system.safety.matrix.cell import Result, carry_out

            for each in left[:CELLS_PER_BENCH]:
                left.remove(each)
                try:
                    yield carry_out(bench, each).fields()
                except AssertionError as problem:
                    logs = keep / each.name.replace("/", "-")
                    shutil.copytree(bench.folder, logs, dirs_exist_ok=True)
                    yield Result(each.name, NOT_CARRIED_OUT, [str(problem)], answers=bench.answers).fields()
                    break


def run(chosen: list[Cell], file: Path) -> None:
    """Run cells that this commit has not run yet, and write each down."""
    now = commit()
    known = [row for row in results_of(file) if row["commit"] == now and row["verdict"] != NOT_CARRIED_OUT]
    done = {row["cell"] for row in known}
    left = [each for each in chosen if each.applies and each.name not in done]
    for fields in carried_out(left, file.parent):
        with file.open("a") as lines:
            lines.write(json.dumps({**fields, "commit": now, "date": time.strftime("%F %T")}) + "\n")
        told = (
            f"{fields['verdict']:>8} {fields['cell']} {fields['seconds']} s {'; '.join(fields['problems'])}"
        )
        print(told, flush=True)


def main() -> int:
    """Do what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "--source", action="append", choices=EVERY_SOURCE, help="this row only; may be repeated"
    )
    parser.add_argument(
        "--stop", action="append", choices=EVERY_STOP, help="this column only; may be repeated"
    )
    parser.add_argument("--order", action="append", choices=ORDERS, help="this order only; may be repeated")
    parser.add_argument("--small", action="store_true", help="the cells of `make test`")
    parser.add_argument("--folder", type=Path, default=Path("matrix"))
    parser.add_argument("--table", action="store_true", help="print the table only")
    parser.add_argument("--page", action="store_true", help="write the table into docs/safety.md")
    parser.add_argument(
        "--defects", action="store_true", help="plant defects, and look whether each is found"
    )
    parser.add_argument("--only", action="append", default=[], help="with --defects: this one")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    if given.defects:
        from tests.lupin_ros.system.safety.matrix.defects import hunt

        return hunt(given.folder, given.only)
    file = given.folder.absolute() / "cells.jsonl"
    wanted = (
        tuple(given.source or EVERY_SOURCE),
        tuple(given.stop or EVERY_STOP),
        tuple(given.order or ORDERS),
    )
    chosen = [cell(*names) for names in SMALL] if given.small else list(cells(*wanted))
    if not (given.table or given.page):
        run(chosen, file)
    newest = {row["cell"]: row for row in results_of(file)}
    if given.page:
        write_page(ROOT / "docs" / "safety.md", newest)
    print(summary(chosen, newest))
    return int(any(newest.get(each.name, {}).get("verdict", "ok") != "ok" for each in chosen if each.applies))


if __name__ == "__main__":
    sys.exit(main())
