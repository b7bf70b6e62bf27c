"""What an adapter of one engine offers to the worker; nothing here but the standard library.

An adapter is a module with `VERSION`, `make(chart) -> Bench`, and, where the engine has further instances,
`further(chart) -> Callable[[], object]`. Charts are `cycle`, `guarded`, `parallel`, `timed` and `load-N`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

#: What the guards compare with; never met.
BOUND = 1_000_000_000
#: Events that a further instance has seen before it is weighed: every state of a chart twice.
FIRST_EVENTS = 6
#: Where the driver puts what all engines read (`tree-N.json`).
FOLDER = Path(os.environ.get("BENCHMARK_FOLDER", "."))

_T = TypeVar("_T")


class Unsupported(Exception):
    """The engine has no such thing; the text goes into the table."""


@dataclass(frozen=True)
class Reached:
    """Where a chart is: its innermost active states, and its count (actions, seconds or states)."""

    active: list[str]
    count: int | None = None


@dataclass(frozen=True)
class Bench:
    """One chart, running: `run(n)` is timed, `reached()` says what it came to."""

    run: Callable[[int], None]
    reached: Callable[[], Reached]


def reached(leaves: list[str], count: int | None = None) -> Reached:
    """Return where a chart is, its leaves by their last words in small letters, in order."""
    return Reached(sorted(leaf.rpartition(".")[2].lower() for leaf in leaves), count)


def loading(load: Callable[[], _T], look: Callable[[_T], Reached]) -> Bench:
    """Return a bench that loads a chart again and again, and looks at the machine that came out last."""
    machines: list[_T] = []

    def run(number: int) -> None:
        for _ in range(number):
            machines[:] = [load()]

    return Bench(run, lambda: look(machines[0]))


def tree(chart: str) -> list[dict[str, Any]]:
    """Return the states of the generated chart `load-N`."""
    number = chart.removeprefix("load-")
    found: list[dict[str, Any]] = json.loads((FOLDER / f"tree-{number}.json").read_text(encoding="utf-8"))
    return found


def is_load(chart: str) -> bool:
    """Tell whether a chart is one that is loaded, not run."""
    return chart.startswith("load-")
