"""A picture as Mermaid text (`stateDiagram-v2`), which documentation sites draw by themselves."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from lupin_engine.chart.model import Kind
from lupin_engine.diagram.outline import Arrow, Box, Outline

#: What would end or change a label, and what stands for it.
_ESCAPES = {"#": "#35;", ";": "#59;", "<": "#lt;", ">": "#gt;", '"': "#quot;", "{": "#123;", "}": "#125;"}


#: Words of the language that are no names of states.
_RESERVED = frozenset({"as", "class", "default", "direction", "end", "note", "state", "style"})


def mermaid(picture: Outline) -> str:
    """Return the text of a picture."""
    return _Writer(picture).text()


class _Writer:
    def __init__(self, picture: Outline) -> None:
        self._picture = picture
        self._ids: dict[str, str] = {}
        for top in picture.boxes:
            for box in top.below():
                self._ids[box.name] = self._new_id(box)

    def _new_id(self, box: Box) -> str:
        """Return a short name that no other state has: the last parts of its own, as many as are needed."""
        parts = box.name.split(".")
        taken = set(self._ids.values())
        names = ["_".join(parts[start:]) for start in range(len(parts) - 1, -1, -1)]
        numbered = (f"{names[-1]}_{number}" for number in itertools.count(2))
        free = (name for name in itertools.chain(names, numbered) if name not in taken)
        return next(name for name in free if name.lower() not in _RESERVED)

    def text(self) -> str:
        picture = self._picture
        lines = ["---", f"title: {picture.title}", "---", "stateDiagram-v2"]
        lines += [f"    {line}" for line in self._within(picture.boxes, picture.initial)]
        lines += [f"    {self._arrow(arrow)}" for arrow in picture.arrows]
        return "\n".join(lines) + "\n"

    def _within(self, boxes: tuple[Box, ...], initial: str | None) -> Iterator[str]:
        for box in boxes:
            yield from self._box(box)
        if initial is not None:
            yield f"[*] --> {self._ids[initial]}"
        for box in boxes:
            if box.kind is Kind.FINAL:
                yield f"{self._ids[box.name]} --> [*]"

    def _box(self, box: Box) -> Iterator[str]:
        label = "<br/>".join(_escaped(line) for line in (box.title, *box.lines))
        if not box.children:
            yield f'state "{label}" as {self._ids[box.name]}'
            return
        yield f'state "{label}" as {self._ids[box.name]} {{'
        yield from (f"    {line}" for line in self._inside(box))
        yield "}"

    def _inside(self, box: Box) -> Iterator[str]:
        if box.kind is not Kind.PARALLEL:
            yield from self._within(box.children, box.initial)
            return
        for index, region in enumerate(box.children):
            if index and region.kind is not Kind.HISTORY:
                yield "--"
            yield from self._box(region)

    def _arrow(self, arrow: Arrow) -> str:
        label = "<br/>".join(_escaped(label) for label in arrow.labels)
        return f"{self._ids[arrow.source]} --> {self._ids[arrow.target]} : {label}"


def _escaped(text: str) -> str:
    return "".join(_ESCAPES.get(char, char) for char in text)
