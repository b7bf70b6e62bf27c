"""A picture coloured by runs: how often each state was entered and each transition taken."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from lupin_engine.diagram.picture import Arrow, Label, Picture, StateBox, TextLine, Tone
from lupin_engine.errors import UsageError


@dataclass(frozen=True)
class Counts:
    """How often states were entered and transitions taken, by full name and by id; absent is never.

    `title` says what was counted; a coloured picture shows it.
    """

    states: Mapping[str, int]
    ways: Mapping[str, int]
    title: str = ""


def coloured(picture: Picture, counts: Counts) -> Picture:
    """Return a picture in which what was visited stands out, with how often, and the rest is pale."""
    boxes = tuple(_box(box, counts) for box in picture.boxes)
    arrows = tuple(_arrow(arrow, counts) for arrow in picture.arrows)
    notes = tuple(_line(line, counts) for line in picture.notes)
    return replace(picture, boxes=boxes, arrows=arrows, notes=notes, run=counts.title or "visited")


def count_steps(steps: Iterable[Mapping[str, Any]], title: str = "") -> Counts:
    """Count what the steps of runs entered and took; they are records as `runtime.record` makes them."""
    states: Counter[str] = Counter()
    ways: Counter[str] = Counter()
    for step in steps:
        states.update(step.get("entered", ()))
        ways.update(step.get("taken", ()))
    return Counts(states, ways, title)


def read_trace(text: str, name: str) -> Counts:
    """Read the record of a run: what `lupin simulate --json` prints, or steps as a list or one a line.

    Raises:
        UsageError: it is no such record.
    """
    try:
        steps = _steps(text)
    except (ValueError, TypeError, AttributeError):
        hint = "'lupin simulate MISSION --json' prints one"
        raise UsageError(f"{name!r} is not the record of a run; {hint}") from None
    found = count_steps(steps, f"coloured by {name}: {len(steps)} steps; pale: never visited")
    if not found.states:
        raise UsageError(f"the run in {name!r} entered no state")
    return found


def _steps(text: str) -> list[Mapping[str, Any]]:
    try:
        record = json.loads(text)
    except ValueError:
        record = [json.loads(line) for line in text.splitlines() if line.strip()]
    steps = record if isinstance(record, list) else record.get("steps", [record])
    for step in steps:
        if not all(isinstance(name, str) for key in ("entered", "taken") for name in step.get(key, ())):
            raise TypeError
    return list(steps)


def check_fits(picture: Picture, counts: Counts, name: str) -> None:
    """Check that a run is one of the mission in a picture.

    Raises:
        UsageError: it entered a state that the chart does not have.
    """
    strangers = sorted(state for state in counts.states if state not in picture.chart.states)
    if strangers:
        raise UsageError(
            f"{name!r} is a run of another mission: {picture.title} has no state {strangers[0]!r}"
        )


def _box(box: StateBox, counts: Counts) -> StateBox:
    count = counts.states.get(box.name, 0)
    within = tuple(_box(child, counts) for child in box.children)
    lines = tuple(_line(line, counts) for line in box.lines)
    return replace(box, children=within, lines=lines, count=count, tone=_tone(count))


def _line(line: TextLine, counts: Counts) -> TextLine:
    return line if line.label is None else replace(line, label=_label(line.label, counts))


def _label(label: Label, counts: Counts) -> Label:
    return replace(label, count=sum(counts.ways.get(id, 0) for id in label.ids))


def _arrow(arrow: Arrow, counts: Counts) -> Arrow:
    labels = tuple(_label(label, counts) for label in arrow.labels)
    gone = sum(label.count or 0 for label in labels)
    return replace(arrow, labels=labels, tone=_tone(gone) if labels else arrow.tone)


def _tone(count: int) -> Tone:
    return Tone.VISITED if count else Tone.NEVER
