"""A picture as PlantUML text, for those whose documentation is drawn by it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from lupin_engine.chart.model import Kind
from lupin_engine.diagram.picture import Arrow, Box, Cause, Picture, Tone

_HEAD = """\
@startuml
hide empty description
skinparam shadowing false
skinparam state {
  BackgroundColor #f8fafc
  BorderColor #475569
}"""
_CAUSES = {Cause.ERROR: "#dc2626", Cause.OPERATOR: "#2563eb", Cause.TIME: "#d97706", Cause.ALWAYS: "#94a3b8"}
_TONES = {Tone.PALE: "#f1f5f9", Tone.NEVER: "#f1f5f9", Tone.VISITED: "#d6f0de"}
#: What would change a text, and what stands for it: a tilde takes the sign after it as it is.
_MARKS = {mark: f"~{mark}" for mark in ("~", "**", "//", "--", "__", "<", "[[")} | {
    '"': "<U+0022>",
    "\\": "<U+005C>",
}
_ANY_MARK = re.compile("|".join(map(re.escape, _MARKS)))


def plantuml(picture: Picture) -> str:
    """Return the text of a picture."""
    return "\n".join(_Writer(picture).lines()) + "\n"


class _Writer:
    """Writes one picture.

    PlantUML lets no arrow cross the border of a region: such a way is a line of text where it begins. A
    history of a parallel state would stand in one of the regions, so the arrow to it leads to the state.
    """

    def __init__(self, picture: Picture) -> None:
        self._picture = picture
        self._boxes = {box.name: box for box in picture.every()}
        self._regions: dict[str, tuple[str, ...]] = {}
        for top in picture.boxes:
            self._note_regions(top, ())
        crossing = [a for a in picture.arrows if self._regions[a.source] != self._regions[a.target]]
        self._arrows = [arrow for arrow in picture.arrows if arrow not in crossing]
        self._ways: dict[str, list[str]] = {}
        for arrow in crossing:
            target = self._boxes[arrow.target].title
            self._ways.setdefault(arrow.source, []).extend(f"{label} → {target}" for label in arrow.labels)

    def _note_regions(self, box: Box, around: tuple[str, ...]) -> None:
        self._regions[box.name] = around
        for child in box.children:
            is_region = box.kind is Kind.PARALLEL and child.kind is not Kind.HISTORY
            self._note_regions(child, (*around, child.name) if is_region else around)

    def lines(self) -> Iterator[str]:
        """Yield the lines of the text."""
        picture = self._picture
        yield from _HEAD.splitlines()
        yield f"title {_plain(picture.title)}"
        yield from self._inside(picture.boxes, picture.initial)
        yield from (self._arrow(arrow) for arrow in self._arrows)
        notes = [str(note) for note in (*picture.notes, picture.run) if str(note)]
        if notes:
            yield f"footer {_text(notes)}"
        yield "@enduml"

    def _inside(self, boxes: tuple[Box, ...], initial: str | None) -> Iterator[str]:
        for box in boxes:
            yield from self._box(box)
        if initial is not None:
            yield f"[*] --> {_id(initial)}"
        yield from (f"{_id(box.name)} --> [*]" for box in boxes if box.kind is Kind.FINAL)

    def _box(self, box: Box) -> Iterator[str]:
        name = _id(box.name)
        tone = f" {_TONES[box.tone]}" if box.tone in _TONES else ""
        if box.kind is Kind.HISTORY:
            tone = f" <<history{'*' if box.state.depth is None else ''}>>"
        yield f'state "{_plain(box.title)}" as {name}{tone}{" {" if box.children else ""}'
        if box.children:
            yield from (f"  {line}" for line in self._body(box))
            yield "}"
        yield from (f"{name} : {_plain(line)}" for line in (*box.text, *self._ways.get(box.name, ())))

    def _body(self, box: Box) -> Iterator[str]:
        if box.kind is not Kind.PARALLEL:
            yield from self._inside(box.children, box.initial)
            return
        regions = [child for child in box.children if child.kind is not Kind.HISTORY]
        for index, region in enumerate(regions):
            if index:
                yield "--"
            yield from self._box(region)

    def _end(self, name: str) -> str:
        box = self._boxes[name]
        parent = self._boxes.get(box.state.parent or "")
        aside = box.kind is Kind.HISTORY and parent is not None and parent.kind is Kind.PARALLEL
        return _id(parent.name if aside and parent is not None else name)

    def _arrow(self, arrow: Arrow) -> str:
        colour = _TONES.get(arrow.tone) if arrow.tone is not Tone.VISITED else "#15803d,bold"
        if colour is None and arrow.cause is not None:
            colour = _CAUSES.get(arrow.cause)
        line = f"-[{colour}]->" if colour else "-->"
        label = f" : {_text(str(label) for label in arrow.labels)}" if arrow.labels else ""
        return f"{self._end(arrow.source)} {line} {self._end(arrow.target)}{label}"


def _id(name: str) -> str:
    return name.replace(".", "_")


def _text(lines: Iterable[str]) -> str:
    return "\\n".join(_plain(line) for line in lines)


def _plain(text: str) -> str:
    return _ANY_MARK.sub(lambda found: _MARKS[found[0]], text)
