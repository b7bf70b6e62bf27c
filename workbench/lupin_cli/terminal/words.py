"""Formats durations, and the default of an open question, as text."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lupin_engine.runtime import OpenQuestion


def default_text(asked: OpenQuestion) -> str:
    """Return the default of a question and the time left until it counts, in words."""
    rest = (
        f"with {clock(asked.left)} left; the clock stands still"
        if asked.stopped
        else f"in {clock(asked.left)}"
    )
    return f"else {asked.default} {rest}"


def clock(seconds: float) -> str:
    """Return a duration as minutes and seconds."""
    whole = max(0.0, seconds)
    return f"{int(whole // 60):02d}:{whole % 60:04.1f}"
