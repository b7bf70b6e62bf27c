"""How long `lupin diagram inspection -o FILE` takes, from the start of the process to the written file.

    .venv/bin/python benchmarks/diagram.py [--rounds 9] [--formats svg mermaid ...]

Each figure is the fastest of the rounds in seconds, the median in brackets; "cpu" is the least processor time
of a round. The first round, which reads everything from the disk, is not counted.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from lupin_cli.verbs.diagram import FORMATS

PROGRAM = (sys.executable, "-m", "lupin_cli.main", "diagram", "inspection", "-o")


def measure(file: Path) -> tuple[float, float]:
    """Draw once; return the seconds that passed, and those that the processor worked."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([*PROGRAM, str(file)], check=True)
    passed, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    return passed, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Measure the formats and print a table."""
    parser = argparse.ArgumentParser(description="Time lupin diagram.")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--formats", nargs="+", choices=FORMATS, default=list(FORMATS))
    given = parser.parse_args()
    print("| format | seconds | cpu |\n|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for name in given.formats:
            file = Path(folder) / f"inspection{FORMATS[name]}"
            rounds = [measure(file) for _ in range(given.rounds + 1)][1:]
            passed, cpu = zip(*rounds, strict=True)
            print(f"| {name} | {min(passed):.2f} ({statistics.median(passed):.2f}) | {min(cpu):.2f} |")


if __name__ == "__main__":
    main()
