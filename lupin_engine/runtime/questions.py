"""Reads the open questions of a recorded view, with the time left for an answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class OpenQuestion:
    """A question in a view: its choices, as (name, label), and the seconds `left` until the default counts.

    During a hold its clock is `stopped`.
    """

    state: str
    question: str
    choices: tuple[tuple[str, str], ...]
    default: str
    left: float
    stopped: bool


def open_questions(view: Mapping[str, Any], now: float) -> list[OpenQuestion]:
    """Return the questions of a view that was recorded, at the time `now` of the clock of its deadlines."""
    return [
        OpenQuestion(
            state=str(asked["state"]),
            question=str(asked["question"]),
            choices=tuple((str(choice["name"]), str(choice["label"])) for choice in asked["choices"]),
            default=str(asked["default"]),
            left=float(asked["left"] or 0.0)
            if asked["deadline"] is None
            else max(0.0, asked["deadline"] - now),
            stopped=asked["deadline"] is None,
        )
        for asked in view.get("asking", ())
    ]
