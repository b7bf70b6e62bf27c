"""A picture as SVG, drawn here: no program, no package and no font is needed.

Every text has its width, so a picture looks the same in any typeface. For programs that highlight them, the
group of a state carries `data-state`, and the group or line of text of transitions `data-transition`: their
ids, with spaces between.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from lupin_engine.chart.model import Kind
from lupin_engine.diagram.layout.cluster import Point
from lupin_engine.diagram.layout.compound import CompoundEdge, CompoundNode, GraphLayout, Rect, lay_out
from lupin_engine.diagram.picture import (
    Arrow,
    Label,
    LineRole,
    Picture,
    StateBox,
    TextLine,
    Tone,
    TransitionCause,
    times,
)
from lupin_engine.diagram.text_metrics import text_width
from lupin_engine.diagram.xml_text import escape, quoted

_FAMILY = "Inter, 'Helvetica Neue', Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif"
_INK, _SOFT, _PALE = "#1e293b", "#64748b", "#94a3b8"
_BORDER, _BAR, _VISITED, _VISITED_BAR = "#475569", "#e8edf4", "#15803d", "#d6f0de"
_AMBER, _FAINT = "#b45309", "#b6bfcc"
#: Cause -> colour of the line, and of its text.
_COLOURS = {
    TransitionCause.DONE: ("#475569", _INK),
    TransitionCause.EVENT: ("#475569", _INK),
    TransitionCause.ERROR: ("#dc2626", "#b91c1c"),
    TransitionCause.OPERATOR: ("#2563eb", "#1d4ed8"),
    TransitionCause.TIME: ("#d97706", _AMBER),
    TransitionCause.ALWAYS: (_PALE, _SOFT),
}
_LEGEND = {
    TransitionCause.DONE: "done, event",
    TransitionCause.ERROR: "error",
    TransitionCause.OPERATOR: "request",
    TransitionCause.TIME: "time",
    TransitionCause.ALWAYS: "no event",
}

_TITLE, _NAME, _TEXT, _SMALL = 17.0, 13.0, 11.0, 9.5
_LEADING = 15
_BAR_HEIGHT = 27
_PAD = 12
_LEAST = 72
_MARGIN = 24
_RADIUS = 9
_BEND = 6
#: Room over the state that is entered first, for the dot and its arrow.
_DOT_ROOM = 25
#: Room for a transition from a state to itself, beside the text of its label.
_LOOP = 24
#: Longest line of a label, as far as it can be broken.
_LABEL_WIDTH = 190
#: Size of a history, and the room around one that stands beside regions.
_ROUND, _AIR = 26, 12


def svg(picture: Picture) -> str:
    """Return a picture as the text of an SVG file."""
    return _SvgDrawing(picture).text()


def plan(picture: Picture) -> tuple[CompoundNode, list[CompoundEdge], GraphLayout]:
    """Return the layout of a picture, and the boxes and arrows that it places."""
    drawing = _SvgDrawing(picture)
    return drawing.root, drawing.links, drawing.layout


@dataclass(frozen=True)
class _TextBlock:
    """A line of text with its colour, and the ids of the transitions that it stands for."""

    text: str
    colour: str
    size: float = _TEXT
    bold: bool = False
    ids: str = ""

    @property
    def width(self) -> float:
        return text_width(self.text, self.size, self.bold)

    def at(self, x: float, y: float) -> str:
        weight = ' font-weight="600"' if self.bold else ""
        length = f' textLength="{_n(self.width)}" lengthAdjust="spacingAndGlyphs"'
        place = f'x="{_n(x)}" y="{_n(y)}" font-size="{_n(self.size)}"'
        way = f" data-transition={quoted(self.ids)}" if self.ids else ""
        return f'<text{way} {place}{weight} fill="{self.colour}"{length}>{escape(self.text)}</text>'


def _n(number: float) -> str:
    """Return a number without needless digits."""
    return f"{number:.1f}".removesuffix(".0")


# -- what stands in a box and beside a line -------------------------------------------------------------


def _label_texts(arrow: Arrow) -> list[_TextBlock]:
    found = []
    for label in arrow.labels:
        # A transition that was never taken may share an arrow with one that was.
        faint = arrow.tone is Tone.VISITED and label.count == 0
        colour = _FAINT if faint else _COLOURS[label.cause][1]
        found += [_TextBlock(line, colour) for line in _broken(label.parts)]
    return found


def _broken(parts: Iterable[str]) -> list[str]:
    """Join parts into lines of a readable width."""
    lines: list[str] = []
    for part in parts:
        joined = f"{lines[-1]} {part}" if lines else part
        # A short word does not stand alone, and neither does a count.
        short = len(part) < 8 or bool(lines and len(lines[-1]) < 8)
        if lines and text_width(joined, _TEXT) <= _LABEL_WIDTH + (60 if short else 0):
            lines[-1] = joined
        else:
            lines.append(part)
    return lines


def _line_text(line: TextLine) -> _TextBlock:
    if line.label is not None:
        return _TextBlock(str(line), _COLOURS[line.label.cause][1], ids=_ids([line.label]))
    return _TextBlock(
        str(line), {LineRole.WORK: _INK, LineRole.ACTION: _SOFT, LineRole.NOTE: _SOFT}[line.role]
    )


def _texts(box: StateBox) -> list[_TextBlock]:
    found = [_line_text(line) for line in box.lines]
    return [*found, _TextBlock(box.more, _SOFT)] if box.more else found


def _badges(box: StateBox) -> list[tuple[_TextBlock, str]]:
    """Return the badges of a box with the colours behind them."""
    found = []
    if box.phase:
        found.append((_TextBlock(box.phase, "#0f766e", _SMALL, True), "#ccf0ea"))
    if box.state.paused:
        found.append((_TextBlock("paused", _AMBER, _SMALL, True), "#fdebc8"))
    if box.count:
        found.append((_TextBlock(times(box.count), "#ffffff", _SMALL, True), _VISITED))
    return found


def _name(box: StateBox) -> _TextBlock:
    return _TextBlock(box.title, _INK, _NAME, True)


def _bar_width(box: StateBox) -> float:
    badges = sum(text.width + 10 + 6 for text, _ in _badges(box))
    return _name(box).width + (badges + 8 if badges else 0) + 2 * _PAD


def _block(
    box: StateBox, initial: bool, loops: dict[str, float], among_regions: bool = False
) -> CompoundNode:
    """Return a box as the layout sees it."""
    above = _DOT_ROOM if initial else 0
    if box.kind is Kind.HISTORY:
        air = _AIR if among_regions else 0
        return CompoundNode(box.name, _ROUND, _ROUND, above=air, beside=air)
    texts = _texts(box)
    width = max([_bar_width(box), *(text.width + 2 * _PAD for text in texts), _LEAST])
    height = _BAR_HEIGHT + (len(texts) * _LEADING + 9 if texts else 4)
    if box.kind is Kind.FINAL:
        width, height = max(width, _bar_width(box) + 16), height if texts else _BAR_HEIGHT
    if not box.children:
        beside = loops.get(box.name)
        room = 0 if beside is None else math.ceil(beside) + _LOOP
        return CompoundNode(box.name, math.ceil(width), height, above=above, beside=room)
    row = box.kind is Kind.PARALLEL
    children = [_block(child, child.name == box.initial, loops, row) for child in box.children]
    heading = height - (0 if row and texts else 4)
    return CompoundNode(box.name, math.ceil(width), heading, children, above, 0, row, box.initial)


def _size(texts: Sequence[_TextBlock]) -> tuple[int, int]:
    return math.ceil(max(text.width for text in texts)), len(texts) * (_LEADING - 1) + 2


# -- the drawing ----------------------------------------------------------------------------------------


class _SvgDrawing:
    def __init__(self, picture: Picture) -> None:
        self._picture = picture
        self._loops = {a.source: _label_texts(a) for a in picture.arrows if a.source == a.target}
        self._arrows = [arrow for arrow in picture.arrows if arrow.source != arrow.target]
        self._texts = [_label_texts(arrow) for arrow in self._arrows]
        self._heading = list(self._head())
        loops = {name: float(_size(texts)[0]) for name, texts in self._loops.items()}
        tops = [_block(box, box.name == picture.initial, loops) for box in picture.boxes]
        self.root = CompoundNode("", 0, 0, tops, first=picture.initial)
        self.links = [
            CompoundEdge(arrow.source, arrow.target, _size(texts) if texts else None)
            for arrow, texts in zip(self._arrows, self._texts, strict=True)
        ]
        self.layout = lay_out(self.root, self.links)

    def _head(self) -> Iterator[_TextBlock]:
        yield _TextBlock(self._picture.title, _INK, _TITLE, True)
        for note in self._picture.notes:
            yield _line_text(note)
        if self._picture.run:
            yield _TextBlock(self._picture.run, _VISITED)

    def text(self) -> str:
        layout = self.layout
        top = 30 + (len(self._heading) - 1) * _LEADING
        legend = self._legend()
        legend_width = _MARGIN + sum(text_width(_LEGEND[cause], _TEXT) + 46 for cause in legend)
        widest = max([layout.width, *(text.width + 16 for text in self._heading), legend_width])
        width, height = math.ceil(widest) + 16, layout.height + top + 44
        size = f'width="{width}" height="{height}" viewBox="0 0 {width} {height}"'
        lines = [
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="{_FAMILY}" role="img">',
            f"<title>{escape(self._picture.title)}</title>",
            f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
            *self._heads(),
            f'<g transform="translate(8 {top})">',
            *(piece for box in self._picture.boxes for piece in self._box(box, 0)),
            *(piece for index in range(len(self._arrows)) for piece in self._arrow(index)),
            *self._initial(self._picture.initial),
            "</g>",
            *self._legend_pieces(legend, height - 20),
            "</svg>",
        ]
        return "\n".join(lines) + "\n"

    def _heads(self) -> Iterator[str]:
        for number, text in enumerate(self._heading):
            yield text.at(_MARGIN, 30 + number * _LEADING + (3 if number else 0))

    # -- boxes ------------------------------------------------------------------------------------------

    def _box(self, box: StateBox, level: int, region: bool = False) -> Iterator[str]:
        opacity = {Tone.PALE: ' opacity="0.5"', Tone.NEVER: ' opacity="0.5"'}.get(box.tone, "")
        yield f"<g data-state={quoted(box.name)}>"
        yield f"<g{opacity}>" if opacity else "<g>"
        rect = self.layout.rects[box.name]
        if box.kind is Kind.HISTORY:
            yield from self._history(box, rect)
        elif box.kind is Kind.FINAL and not box.lines:
            yield from self._final(box, rect)
        else:
            yield from self._state(box, rect, level, region)
        yield "</g>"
        regions = box.kind is Kind.PARALLEL and bool(box.children)  # they may be collapsed
        for child in box.children:
            yield from self._box(child, level + (not region), regions and child.kind is not Kind.HISTORY)
        if regions:
            yield from self._separators(box, rect)
        yield from self._loop(box, rect)
        if box.children:
            yield from self._initial(box.initial)
        yield "</g>"

    def _state(self, box: StateBox, rect: Rect, level: int, region: bool) -> Iterator[str]:
        border, bar = (_VISITED, _VISITED_BAR) if box.tone is Tone.VISITED else (_BORDER, _BAR)
        texts = _texts(box)
        if not region:
            fill = "#ffffff" if not box.children else ("#f8fafc", "#ffffff")[level % 2]
            yield _rounded(rect, fill, border)
            yield _bar(rect, bar) if texts or box.children else _rounded(rect, bar, border)
            yield _rounded(rect, "none", border)
        middle = rect.height if not (texts or box.children) and not region else _BAR_HEIGHT
        if box.kind is Kind.FINAL:
            yield from _ring(rect.x + 15, rect.y + middle / 2, _INK if border == _BORDER else border)
            yield from self._name(box, Rect(rect.x + 15, rect.y, rect.width, rect.height), middle)
        else:
            yield from self._name(box, rect, middle)
        for number, text in enumerate(texts):
            y = rect.y + _BAR_HEIGHT + 15 + number * _LEADING
            yield from _timed(text, rect.x + _PAD, y)

    def _name(self, box: StateBox, rect: Rect, bar: int) -> Iterator[str]:
        name = _name(box)
        badges = _badges(box)
        baseline = rect.y + bar / 2 + 4.7
        centred = not box.children and not badges and not _texts(box)
        x = rect.x + ((rect.width - name.width) / 2 if centred else _PAD)
        yield name.at(x, baseline)
        x += name.width + 10
        for text, behind in badges:
            width = text.width + 10
            place = f'x="{_n(x)}" y="{_n(rect.y + bar / 2 - 7.5)}" width="{_n(width)}" height="15" rx="7.5"'
            yield f'<rect {place} fill="{behind}"/>'
            yield text.at(x + 5, baseline - 1.4)
            x += width + 6

    def _history(self, box: StateBox, rect: Rect) -> Iterator[str]:
        x, y = rect.x + rect.width / 2, rect.y + rect.height / 2
        yield f'<circle cx="{_n(x)}" cy="{_n(y)}" r="{_ROUND // 2}" fill="#ffffff" stroke="{_BORDER}"/>'
        text = _TextBlock(box.title, _INK, 12, True)
        yield text.at(x - text.width / 2, y + 4.3)

    def _final(self, box: StateBox, rect: Rect) -> Iterator[str]:
        colour = _VISITED if box.tone is Tone.VISITED else _INK
        place = f'x="{rect.x}" y="{rect.y}" width="{rect.width}" height="{rect.height}"'
        yield f'<rect {place} rx="{rect.height / 2:g}" fill="#ffffff" stroke="{_BORDER}"/>'
        yield from _ring(rect.x + 15, rect.y + rect.height / 2, colour)
        yield from self._name(box, Rect(rect.x + 15, rect.y, rect.width - 15, rect.height), rect.height)

    def _separators(self, box: StateBox, rect: Rect) -> Iterator[str]:
        drawn = [child.name for child in box.children if child.kind is not Kind.HISTORY]
        regions = [self.layout.rects[name] for name in drawn]
        top = min(region.y for region in regions)
        dash = f'stroke="{_BORDER}" stroke-dasharray="6 4"'
        yield f'<path d="M{rect.x} {top}H{rect.x + rect.width}" {dash}/>'
        for region in sorted(regions, key=lambda r: r.x)[1:]:
            yield f'<path d="M{region.x} {top}V{rect.y + rect.height}" {dash}/>'

    def _initial(self, name: str | None) -> Iterator[str]:
        if name is None or name not in self.layout.rects:
            return
        rect = self.layout.rects[name]
        x = rect.x + min(16, rect.width // 2)
        yield f'<circle cx="{x}" cy="{rect.y - 19}" r="5" fill="{_INK}"/>'
        yield from _line([(x, rect.y - 14), (x, rect.y)], _INK, 1.3)

    # -- transitions ------------------------------------------------------------------------------------

    def _loop(self, box: StateBox, rect: Rect) -> Iterator[str]:
        texts = self._loops.get(box.name)
        if texts is None:
            return
        arrow = next(a for a in self._picture.arrows if a.source == a.target == box.name)
        right, y = rect.x + rect.width, rect.y + rect.height // 2
        yield f"<g data-transition={quoted(_ids(arrow.labels))}{_faint(arrow)}>"
        corners = [(right, y - 8), (right + 15, y - 8), (right + 15, y + 8), (right, y + 8)]
        yield from _line(corners, _colour(arrow), _weight(arrow))
        for number, text in enumerate(texts):
            yield text.at(right + 20, y + 4 + (number - (len(texts) - 1) / 2) * (_LEADING - 1))
        yield "</g>"

    def _arrow(self, index: int) -> Iterator[str]:
        arrow = self._arrows[index]
        yield f"<g data-transition={quoted(_ids(arrow.labels))}{_faint(arrow)}>"
        yield from _line(self.layout.lines[index], _colour(arrow), _weight(arrow))
        place = self.layout.labels[index]
        if place is not None:
            for number, text in enumerate(self._texts[index]):
                yield text.at(place[0], place[1] + 11 + number * (_LEADING - 1))
        yield "</g>"

    # -- legend -----------------------------------------------------------------------------------------

    def _legend(self) -> list[TransitionCause]:
        met = {label.cause for arrow in self._picture.arrows for label in arrow.labels}
        met = {TransitionCause.DONE if cause is TransitionCause.EVENT else cause for cause in met}
        return [cause for cause in _LEGEND if cause in met]

    @staticmethod
    def _legend_pieces(legend: Sequence[TransitionCause], y: int) -> Iterator[str]:
        x = float(_MARGIN)
        for cause in legend:
            text = _TextBlock(_LEGEND[cause], _SOFT)
            yield from _line([(round(x), y - 4), (round(x) + 20, y - 4)], _COLOURS[cause][0], 1.4)
            yield text.at(x + 26, y)
            x += text.width + 46


def _ids(labels: Iterable[Label]) -> str:
    return " ".join(sorted(id for label in labels for id in label.ids))


def _colour(arrow: Arrow) -> str:
    cause = arrow.cause
    return _COLOURS[TransitionCause.DONE if cause is None else cause][0]


def _weight(arrow: Arrow) -> float:
    if arrow.tone is Tone.VISITED:
        return 2.4
    return 1.1 if arrow.cause is TransitionCause.ERROR else 1.3


def _faint(arrow: Arrow) -> str:
    return ' opacity="0.5"' if arrow.tone is Tone.NEVER else ""


def _rounded(rect: Rect, fill: str, border: str) -> str:
    place = f'x="{rect.x}" y="{rect.y}" width="{rect.width}" height="{rect.height}" rx="{_RADIUS}"'
    return f'<rect {place} fill="{fill}" stroke="{border}"/>'


def _ring(x: float, y: float, colour: str) -> Iterator[str]:
    yield f'<circle cx="{_n(x)}" cy="{_n(y)}" r="7" fill="#ffffff" stroke="{colour}" stroke-width="1.3"/>'
    yield f'<circle cx="{_n(x)}" cy="{_n(y)}" r="4" fill="{colour}"/>'


def _bar(rect: Rect, fill: str) -> str:
    """Return the bar behind a name: rounded above, straight below."""
    x, y, right, r = rect.x, rect.y, rect.x + rect.width, _RADIUS
    bottom = y + _BAR_HEIGHT
    path = f"M{x} {bottom}V{y + r}Q{x} {y} {x + r} {y}H{right - r}Q{right} {y} {right} {y + r}V{bottom}Z"
    return f'<path d="{path}" fill="{fill}"/>'


def _timed(text: _TextBlock, x: float, y: float) -> Iterator[str]:
    """Draw a line of text; a deadline in it stands out."""
    work, sign, limit = text.text.partition(" ≤ ")
    if not sign or not work.startswith("do / "):
        yield text.at(x, y)
        return
    yield _TextBlock(work, text.colour).at(x, y)
    yield _TextBlock(f"≤ {limit}", _AMBER).at(x + text_width(f"{work} ", _TEXT), y)


def _line(corners: Sequence[Point], colour: str, weight: float) -> Iterator[str]:
    """Draw a line with round bends and a head at its end."""
    (x, y), (before_x, before_y) = corners[-1], corners[-2]
    dx, dy = _sign(x - before_x), _sign(y - before_y)
    ends = [*corners[:-1], (x - 6 * dx, y - 6 * dy)]
    path = [f"M{ends[0][0]} {ends[0][1]}"]
    for one, corner, other in zip(ends, ends[1:], ends[2:], strict=False):
        path.append(_bend(one, corner, other))
    path.append(f"L{ends[-1][0]} {ends[-1][1]}")
    yield f'<path d="{"".join(path)}" fill="none" stroke="{colour}" stroke-width="{weight:g}"/>'
    left, right = (x - 9 * dx + 4 * dy, y - 9 * dy + 4 * dx), (x - 9 * dx - 4 * dy, y - 9 * dy - 4 * dx)
    yield f'<path d="M{x} {y}L{left[0]} {left[1]}L{right[0]} {right[1]}Z" fill="{colour}"/>'


def _bend(one: Point, corner: Point, other: Point) -> str:
    """Return the path up to and around a corner."""
    x, y = corner
    into = min(_BEND, (abs(x - one[0]) + abs(y - one[1])) / 2)
    out = min(_BEND, (abs(other[0] - x) + abs(other[1] - y)) / 2)
    begin = x - into * _sign(x - one[0]), y - into * _sign(y - one[1])
    end = x + out * _sign(other[0] - x), y + out * _sign(other[1] - y)
    return f"L{_n(begin[0])} {_n(begin[1])}Q{x} {y} {_n(end[0])} {_n(end[1])}"


def _sign(number: float) -> int:
    return (number > 0) - (number < 0)
