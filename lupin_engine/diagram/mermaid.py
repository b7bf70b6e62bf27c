"""A picture as Mermaid text (`stateDiagram-v2`), which documentation sites draw by themselves."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from lupin_engine.chart.model import Kind
from lupin_engine.diagram.picture import Arrow, Picture, StateBox, Tone

#: What would end or change a label, and what stands for it.
_ESCAPES = {"#": "#35;", ";": "#59;", "<": "#lt;", ">": "#gt;", '"': "#quot;", "{": "#123;", "}": "#125;"}
#: Words of the language that are no names of states.
_RESERVED = frozenset({"as", "class", "classdef", "default", "direction", "end", "note", "state", "style"})
_TONES = {
    Tone.PALE: "fill:#f8fafc,stroke:#cbd5e1,color:#94a3b8",
    Tone.VISITED: "fill:#d6f0de,stroke:#15803d,color:#1e293b",
    Tone.NEVER: "fill:#f8fafc,stroke:#cbd5e1,color:#94a3b8",
}


def mermaid(picture: Picture) -> str:
    """Return the text of a picture."""
    return _MermaidWriter(picture).text()


class _MermaidWriter:
    def __init__(self, picture: Picture) -> None:
        self._picture = picture
        self._ids: dict[str, str] = {}
        for box in picture.every():
            self._ids[box.name] = self._new_id(box)

    def _new_id(self, box: StateBox) -> str:
        """Return a short name that no other state has: the last parts of its own, as many as are needed."""
        parts = box.name.split(".")
        taken = set(self._ids.values())
        names = ["_".join(parts[start:]) for start in range(len(parts) - 1, -1, -1)]
        numbered = (f"{names[-1]}_{number}" for number in itertools.count(2))
        free = (name for name in itertools.chain(names, numbered) if name not in taken)
        return next(name for name in free if name.lower() not in _RESERVED)

    def text(self) -> str:
        picture = self._picture
        lines = ["---", f"title: {_quoted(picture.title)}", "---", "stateDiagram-v2"]
        lines += [f"    %% {line}" for line in (*picture.notes, picture.run) if str(line)]
        lines += [f"    {line}" for line in self._within(picture.boxes, picture.initial)]
        lines += [f"    {self._arrow(arrow)}" for arrow in picture.arrows]
        lines += [f"    {line}" for line in self._tones()]
        return "\n".join(lines) + "\n"

    def _within(self, boxes: tuple[StateBox, ...], initial: str | None) -> Iterator[str]:
        for box in boxes:
            yield from self._box(box)
        if initial is not None:
            yield f"[*] --> {self._ids[initial]}"
        for box in boxes:
            if box.kind is Kind.FINAL:
                yield f"{self._ids[box.name]} --> [*]"

    def _box(self, box: StateBox) -> Iterator[str]:
        label = "<br/>".join(_escaped(line) for line in (box.title, *box.text))
        if not box.children:
            yield f'state "{label}" as {self._ids[box.name]}'
            return
        yield f'state "{label}" as {self._ids[box.name]} {{'
        yield from (f"    {line}" for line in self._inside(box))
        yield "}"

    def _inside(self, box: StateBox) -> Iterator[str]:
        if box.kind is not Kind.PARALLEL:
            yield from self._within(box.children, box.initial)
            return
        for index, region in enumerate(box.children):
            if index and region.kind is not Kind.HISTORY:
                yield "--"
            yield from self._box(region)

    def _arrow(self, arrow: Arrow) -> str:
        label = "<br/>".join(_escaped(str(label)) for label in arrow.labels)
        return f"{self._ids[arrow.source]} --> {self._ids[arrow.target]}{f' : {label}' if label else ''}"

    def _tones(self) -> Iterator[str]:
        """Yield the classes of a picture that is not all of one tone; Mermaid colours no boxes in boxes."""
        for tone, style in _TONES.items():
            names = [
                self._ids[box.name] for box in self._picture.every() if box.tone is tone and not box.children
            ]
            if names:
                yield f"classDef {tone.value} {style}"
                yield f"class {','.join(names)} {tone.value}"


def _quoted(title: str) -> str:
    """Return a title for the YAML at the head of the text."""
    return f'"{title}"' if ":" in title else title


def _escaped(text: str) -> str:
    return "".join(_ESCAPES.get(char, char) for char in text)
