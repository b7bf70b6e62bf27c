"""The floor: what the same work costs when it is written out by hand, with nothing of an engine."""

from __future__ import annotations

import platform
from collections.abc import Callable

from bench import BOUND, FIRST_EVENTS, Bench, Unsupported, reached

VERSION = f"CPython {platform.python_version()}"

_CYCLE = {("a", "go"): "b", ("b", "go"): "c", ("c", "go"): "a"}
_SIDES = {("l1", "go"): "l2", ("l2", "go"): "l1", ("r1", "go"): "r2", ("r2", "go"): "r1"}
_TIMED = {"ping": "pong", "pong": "ping"}


class Floor:
    """Every chart's state, each chart a method."""

    def __init__(self) -> None:
        self.state, self.left, self.right, self.timed = "a", "l1", "r1", "ping"
        self.count, self.now, self.due = 0, 0.0, 1.0

    def cycle(self, event: str) -> None:
        """Go on in the cycle."""
        self.state = _CYCLE[self.state, event]

    def guarded(self, event: str) -> None:
        """Go on in the cycle if the guard holds, and count."""
        if self.count < BOUND:
            self.state = _CYCLE[self.state, event]
            self.count += 1

    def parallel(self, event: str) -> None:
        """Go on in both regions."""
        self.left = _SIDES[self.left, event]
        self.right = _SIDES[self.right, event]

    def advance(self) -> None:
        """Let the next second pass."""
        self.now = self.due
        self.timed = _TIMED[self.timed]
        self.due = self.now + 1.0


def make(chart: str) -> Bench:
    """Return a chart, running."""
    floor = Floor()
    if chart == "timed":
        return Bench(_advancing(floor), lambda: reached([floor.timed], round(floor.now)))
    if chart == "parallel":
        return Bench(_sending(floor.parallel), lambda: reached([floor.left, floor.right]))
    if chart == "guarded":
        return Bench(_sending(floor.guarded), lambda: reached([floor.state], floor.count))
    if chart == "cycle":
        return Bench(_sending(floor.cycle), lambda: reached([floor.state]))
    raise Unsupported("nothing to load")


def further(chart: str) -> Callable[[], object]:
    """Return what makes one more instance."""

    def one() -> Floor:
        floor = Floor()
        for _ in range(FIRST_EVENTS):
            getattr(floor, chart)("go")
        return floor

    return one


def _sending(handle: Callable[[str], None]) -> Callable[[int], None]:
    def run(number: int) -> None:
        for _ in range(number):
            handle("go")

    return run


def _advancing(floor: Floor) -> Callable[[int], None]:
    def run(number: int) -> None:
        advance = floor.advance
        for _ in range(number):
            advance()

    return run
