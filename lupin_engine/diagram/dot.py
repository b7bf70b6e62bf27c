"""A picture as Graphviz text: states are boxes, composite states are clusters, regions are dashed."""

from __future__ import annotations

from collections.abc import Iterator

from lupin_engine.chart.model import Kind
from lupin_engine.diagram.picture import Arrow, Box, Cause, Picture, Tone

_FONT = 'fontname="Helvetica"'
_HEAD = f"""digraph chart {{{{
  graph [label={{title}}, labelloc=t, {_FONT}, compound=true, rankdir=TB, nodesep=0.35, ranksep=0.45]
  node [shape=box, style="rounded,filled", fillcolor="#f5f7fa", color="#52606d", {_FONT}, fontsize=11]
  edge [color="#52606d", {_FONT}, fontsize=9, arrowsize=0.7]"""
_POINT = 'shape=point, width=0.12, label="", style=filled, fillcolor=black'
_CAUSES = {Cause.ERROR: "#dc2626", Cause.OPERATOR: "#2563eb", Cause.TIME: "#d97706", Cause.ALWAYS: "#94a3b8"}
_GREY = 'color="#cbd5e1", fontcolor="#94a3b8"'
_TONES = {Tone.PALE: _GREY, Tone.NEVER: _GREY, Tone.VISITED: 'color="#15803d", penwidth=2'}


def dot(picture: Picture) -> str:
    """Return the text of a picture."""
    boxes = {box.name: box for box in picture.every()}
    heads = (picture.title, *map(str, picture.notes), *filter(None, [picture.run]))
    lines = [_HEAD.format(title=_quoted(*heads))]
    lines += [f"  {line}" for line in _within("", picture.boxes, picture.initial)]
    lines += [f"  {_arrow(arrow, boxes)}" for arrow in picture.arrows]
    return "\n".join([*lines, "}"]) + "\n"


def _within(name: str, boxes: tuple[Box, ...], initial: str | None) -> Iterator[str]:
    if initial is not None:
        yield f"{_start(name)} [{_POINT}]"
    for box in boxes:
        yield from _box(box)
    if initial is not None:
        within = {box.name: box for top in boxes for box in top.below()}
        yield f"{_start(name)} -> {_anchor(within[initial])}{_ends({'lhead': within[initial]})}"


def _box(box: Box) -> Iterator[str]:
    tone = f", {_TONES[box.tone]}" if box.tone in _TONES else ""
    if box.children:
        yield f"subgraph {_cluster(box)} {{"
        colour = tone.replace(", ", "; ") or '; color="#9aa5b1"'
        yield f"  label={_left(box.title, *box.text)}; labeljust=l; fontsize=11; style={_style(box)}{colour}"
        yield from (f"  {line}" for line in _within(box.name, box.children, box.initial))
        yield "}"
    elif box.kind is Kind.HISTORY:
        shape = "shape=circle, width=0.3, fixedsize=true"
        yield f"{_quoted(box.name)} [label={_quoted(box.title)}, {shape}{tone}]"
    else:
        rings = ", peripheries=2" if box.kind is Kind.FINAL else ""
        yield f"{_quoted(box.name)} [label={_quoted(box.title, *box.text)}{rings}{tone}]"


def _style(box: Box) -> str:
    return '"rounded,dashed"' if box.kind is Kind.PARALLEL else "rounded"


def _arrow(arrow: Arrow, boxes: dict[str, Box]) -> str:
    source, target = boxes[arrow.source], boxes[arrow.target]
    more = [f"label={_quoted(*map(str, arrow.labels))}"] if arrow.labels else []
    if arrow.tone in _TONES:
        more.append(_TONES[arrow.tone])
    elif arrow.cause in _CAUSES:
        more.append(f'color="{_CAUSES[arrow.cause]}"')
    return f"{_anchor(source)} -> {_anchor(target)}{_ends({'ltail': source, 'lhead': target}, *more)}"


def _ends(ends: dict[str, Box], *more: str) -> str:
    """Return the attributes of an arrow, with the composite states at whose borders it begins or ends."""
    found = [*more, *(f"{word}={_cluster(box)}" for word, box in ends.items() if box.children)]
    return f" [{', '.join(found)}]" if found else ""


def _anchor(box: Box) -> str:
    """Return the node that stands for a state; an arrow cannot end at a cluster itself."""
    if not box.children:
        return _quoted(box.name)
    return _start(box.name) if box.initial is not None else _anchor(box.children[0])


def _start(name: str) -> str:
    return _quoted(f"{name}#start")


def _cluster(box: Box) -> str:
    return _quoted(f"cluster_{box.name}")


def _left(*lines: str) -> str:
    """Return lines that begin at the left; centred ones would be, under the name of a composite state."""
    return _quoted(*lines, "").replace("\\n", "\\l")


def _quoted(*lines: str) -> str:
    escaped = (line.replace("\\", "\\\\").replace('"', '\\"') for line in lines)
    return '"' + "\\n".join(escaped) + '"'
