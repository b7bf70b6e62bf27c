"""Colours a picture by the counts of runs: how often each state was entered and each transition taken."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from lupin_engine.diagram.picture import Arrow, Label, Picture, StateBox, TextLine, Tone
from lupin_engine.errors import UsageError


@dataclass(frozen=True)
class Counts:
    """Counts of entered states and taken transitions, by full name and by id; missing means never.

    `title` is the text about them in a picture. Without `counted` they are flags, and no numbers are shown.
    """

    states: Mapping[str, int]
    ways: Mapping[str, int]
    title: str = ""
    counted: bool = True


def coloured(picture: Picture, counts: Counts) -> Picture:
    """Return a picture with visited elements emphasized and counted, and the rest pale."""
    boxes = tuple(_box(box, counts) for box in picture.boxes)
    arrows = tuple(_arrow(arrow, counts) for arrow in picture.arrows)
    notes = tuple(_line(line, counts) for line in picture.notes)
    return replace(picture, boxes=boxes, arrows=arrows, notes=notes, run=counts.title or "visited")


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
    shown = count if counts.counted else None
    return replace(box, children=within, lines=lines, count=shown, tone=_tone(count))


def _line(line: TextLine, counts: Counts) -> TextLine:
    return line if line.label is None else replace(line, label=_label(line.label, counts))


def _label(label: Label, counts: Counts) -> Label:
    count = sum(counts.ways.get(id, 0) for id in label.ids)
    return replace(label, count=count if counts.counted or not count else None)


def _arrow(arrow: Arrow, counts: Counts) -> Arrow:
    labels = tuple(_label(label, counts) for label in arrow.labels)
    gone = sum(label.count != 0 for label in labels)
    return replace(arrow, labels=labels, tone=_tone(gone) if labels else arrow.tone)


def _tone(count: int) -> Tone:
    return Tone.VISITED if count else Tone.NEVER
