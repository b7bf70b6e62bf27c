"""How long after a keystroke the findings are there, in a mission of 300 lines.

    .venv/bin/python benchmarks/editor.py [--rounds 60] [--states 45]

The server runs as editors run it, and is talked to over its protocol: one character of the mission changes,
and the time runs until the findings of that version have arrived. The mission is the generated one of
`loading.py` in the shipped lifecycle; every fourth keystroke breaks its YAML, another one a key. After
each keystroke the same place is asked for completions. What is given is the median, and the slowest of all.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from pathlib import Path

# The tests have the client.
sys.path.insert(0, str(Path(__file__).parents[1]))

from loading import mission

from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder
from tests.workbench.lupin_lsp.client import Client, at

#: What keystrokes make of a line of the first step. No two texts are the same: nothing is known beforehand.
BEFORE = "phase: DRIVING\n"
KEYSTROKES = ("phase: D{}\n", "phas{}: DRIVING\n", "phase: D{}S\n", "phase: [D{}\n")


def measure(client: Client, path: Path, text: str, rounds: int) -> dict[str, list[float]]:
    """Type `rounds` times and return how long findings and completions took, in milliseconds."""
    found: dict[str, list[float]] = {"findings": [], "completion": []}
    for number in range(rounds):
        changed = text.replace(BEFORE, KEYSTROKES[number % len(KEYSTROKES)].format(number), 1)
        begun = time.perf_counter()
        client.diagnostics(path, client.change(path, changed))
        found["findings"].append(1e3 * (time.perf_counter() - begun))
        begun = time.perf_counter()
        client.ask("completion", path, *at(changed, "on_done: |GROUP_1_1_STEP_2"))
        found["completion"].append(1e3 * (time.perf_counter() - begun))
    return found


def main() -> None:
    """Measure and print one line for each figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rounds", type=int, default=60)
    parser.add_argument("--states", type=int, default=45)
    given = parser.parse_args()
    text = mission(given.states)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lifecycle = (default_missions_folder() / LIFECYCLE).read_text(encoding="utf-8")
        (folder / LIFECYCLE).write_text(lifecycle, encoding="utf-8")
        path = folder / "generated.yaml"
        path.write_text(text, encoding="utf-8")
        client = Client([sys.executable, "-m", "lupin_cli.main", "lsp"], folder)
        client.open(path)
        client.diagnostics(path, 1)
        measure(client, path, text, 4)
        found = measure(client, path, text, given.rounds)
        client.close()
    print(f"{given.states} states, {text.count(chr(10))} lines")
    for what, taken in found.items():
        print(f"{what:12}{statistics.median(taken):8.1f} ms, slowest {max(taken):.1f} ms")


if __name__ == "__main__":
    main()
