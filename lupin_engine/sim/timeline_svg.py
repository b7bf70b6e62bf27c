"""A timeline as SVG: one row a state, phase, operation, hold or input. The same run gives the same text."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from html import escape

from lupin_engine.sim.timeline import (
    CANCELLED,
    DONE,
    FAILED,
    OPEN,
    TIMED_OUT,
    Bar,
    Curve,
    Lane,
    Tick,
    Timeline,
)

WIDTH = 1200.0
_LEFT, _RIGHT = 168.0, 28.0
_PLOT = WIDTH - _LEFT - _RIGHT
_ROW, _BAR, _CURVE, _GAP = 20.0, 14.0, 44.0, 12.0
_TOP, _TICK_ROW, _MAX_TICK_ROWS = 52.0, 13.0, 4
_FONT = "Inter, 'DejaVu Sans', Arial, sans-serif"
#: Mean width of a letter, as a share of the size of the type.
_LETTER = 0.58

_INK, _PALE, _GRID = "#1f2933", "#6b7785", "#e4e8ec"
_COLOURS = {
    DONE: "#3f9d63",
    FAILED: "#cf4458",
    TIMED_OUT: "#e08a1e",
    CANCELLED: "#9aa5b1",
    OPEN: "#5b8def",
    "OK": "#3f9d63",
    "UNREACHABLE": "#cf4458",
    "SCAN_FAILED": "#cf4458",
    "SKIPPED": "#e0b31e",
}
_STATE, _PHASE, _HOLD, _FLAG, _LINE, _OPEN_VISIT = (
    "#4c6ef5",
    "#8c9eff",
    "#e0b31e",
    "#cf4458",
    "#3b7dd8",
    "#c3cad2",
)
_LEGEND = (DONE, FAILED, TIMED_OUT, CANCELLED, OPEN)


def svg(lanes: Timeline) -> str:
    """Draw a timeline."""
    drawing = _Drawing(lanes)
    body = list(drawing.body())
    return "\n".join([drawing.head(), *body, "</svg>", ""])


def axis_step(seconds: float, most: int) -> float:
    """Return the distance between two marks of the axis so that there are `most` at most."""
    steps = (0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400)
    rough = seconds / most
    return next((step for step in steps if step >= rough), 86400 * math.ceil(rough / 86400))


def axis_text(time: float, seconds: float) -> str:
    """Return what stands at a mark: seconds in a short run, else minutes or hours."""
    if seconds <= 180:
        return f"{time:g} s"
    if seconds <= 3 * 3600:
        return f"{time / 60:g} min"
    return f"{time / 3600:g} h"


def marks(seconds: float, most: int) -> list[float]:
    """Return where the axis has marks, the beginning included."""
    step = axis_step(seconds, most) if seconds > 0 else 1.0
    return [round(index * step, 6) for index in range(int(seconds / step + 1e-9) + 1)]


@dataclass(frozen=True)
class _Row:
    """One row: what it is called, and its bars with their colours, or a curve."""

    name: str
    bars: tuple[tuple[Bar, str], ...] = ()
    curve: Curve | None = None

    @property
    def height(self) -> float:
        return _CURVE if self.curve else _ROW


class _Drawing:
    """One picture in the making."""

    def __init__(self, lanes: Timeline) -> None:
        self._lanes = lanes
        self._seconds = lanes.seconds or 1.0
        self._groups = [(name, rows) for name, rows in _groups(lanes) if rows]
        self._ticks = self._placed(lanes.ticks)
        tick_rows = max((row for _, row in self._ticks if row is not None), default=-1) + 1
        self._plot_top = _TOP + (tick_rows * _TICK_ROW + 12 if lanes.ticks else 0)
        rows = sum(row.height for _, rows in self._groups for row in rows)
        self._plot_bottom = self._plot_top + rows + _GAP * len(self._groups)
        self._height = self._plot_bottom + 62

    def head(self) -> str:
        """Return the opening tag."""
        size = f'width="{WIDTH:g}" height="{self._height:g}" viewBox="0 0 {WIDTH:g} {self._height:g}"'
        title = escape(f"Timeline of {self._lanes.title or 'a mission'}")
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="{_FONT}" font-size="11" fill="{_INK}">'
            f"\n<title>{title}</title>"
        )

    def body(self) -> Iterator[str]:
        """Yield what is drawn, from back to front."""
        yield f'<rect width="{WIDTH:g}" height="{self._height:g}" fill="#ffffff"/>'
        yield _text(16, 28, self._lanes.title or "not started", size=16, bold=True)
        yield _text(WIDTH - _RIGHT, 28, self._subtitle(), anchor="end", colour=_PALE)
        yield from self._axis()
        yield from self._events()
        top = self._plot_top
        for name, rows in self._groups:
            yield _text(16, top + 14, name, colour=_PALE, size=10, bold=True)
            for row in rows:
                yield from self._row(row, top)
                top += row.height
            top += _GAP
            yield _line(16, top - _GAP / 2, WIDTH - _RIGHT, top - _GAP / 2, _GRID)
        yield from self._legend()

    def _subtitle(self) -> str:
        lasted = f"{self._lanes.seconds:.1f} s"
        if self._lanes.seconds > 180:
            lasted += f" ({self._lanes.seconds / 60:.1f} min)"
        return f"{lasted} of virtual time"

    def _x(self, time: float) -> float:
        return _LEFT + _PLOT * time / self._seconds

    # -- axis and events ------------------------------------------------------------------------------------

    def _axis(self) -> Iterator[str]:
        bottom = self._plot_bottom
        for time in marks(self._seconds, 12):
            x = self._x(time)
            yield _line(x, self._plot_top, x, bottom, _GRID)
            yield _text(x, bottom + 16, axis_text(time, self._seconds), anchor="middle", colour=_PALE)

    def _placed(self, ticks: Sequence[Tick]) -> list[tuple[Tick, int | None]]:
        """Give every label a row in which it covers no other; None where there is no room for it."""
        free = [0.0] * _MAX_TICK_ROWS
        placed: list[tuple[Tick, int | None]] = []
        for tick in ticks:
            x = self._x(tick.time)
            row = next((row for row, end in enumerate(free) if end <= x - 3), None)
            if row is not None:
                free[row] = x + 8 + _width(_label(tick))
            placed.append((tick, row))
        return placed

    def _events(self) -> Iterator[str]:
        for tick, row in self._ticks:
            x, colour = self._x(tick.time), _COLOURS[FAILED] if tick.refused else _INK
            top = self._plot_top - 4 - (row or 0) * _TICK_ROW
            yield f"<g>{_title(f'{tick.time:.1f} s  {_label(tick)}')}"
            yield _line(x, top - 8, x, self._plot_bottom, colour, dashed=True)
            if row is not None:
                label = _label(tick)
                fits = x + 4 + _width(label) <= WIDTH
                yield _text(x + 3 if fits else x - 3, top, label, anchor="" if fits else "end", colour=colour)
            yield "</g>"

    # -- rows -----------------------------------------------------------------------------------------------

    def _row(self, row: _Row, top: float) -> Iterator[str]:
        yield _text(_LEFT - 8, top + 14, _fitted(row.name, _LEFT - 70), anchor="end")
        if row.curve is not None:
            yield from self._curve(row.curve, top)
        for bar, colour in row.bars:
            yield from self._bar(bar, colour, top + (_ROW - _BAR) / 2)

    def _bar(self, bar: Bar, colour: str, top: float) -> Iterator[str]:
        x, end = self._x(bar.begin), self._x(bar.end)
        width = max(end - x, 1.2)
        yield f"<g>{_title(_told(bar))}"
        edge = f' stroke="{_INK}" stroke-width="1.2"' if bar.tries > 1 else ""
        yield f'<rect x="{x:.1f}" y="{top:.1f}" width="{width:.1f}" height="{_BAR:g}" rx="2" fill="{colour}"{edge}/>'
        if bar.wanted_until is not None and bar.wanted_until < bar.end:
            wanted = self._x(bar.wanted_until)
            yield (
                f'<rect x="{wanted:.1f}" y="{top:.1f}" width="{end - wanted:.1f}" height="{_BAR:g}" '
                f'fill="#ffffff" fill-opacity="0.55"/>'
            )
        label = _inside(bar, width - 6)
        if label:
            yield _text(x + width / 2, top + 11, label, anchor="middle", colour="#ffffff", size=10)
        yield "</g>"

    def _curve(self, curve: Curve, top: float) -> Iterator[str]:
        low, high = curve.bounds
        inner = _CURVE - 12

        def y(value: float) -> float:
            return top + 6 + inner * (1 - (value - low) / (high - low))

        for value in (low, high):
            yield _line(_LEFT, y(value), WIDTH - _RIGHT, y(value), _GRID)
            yield _text(WIDTH - _RIGHT + 3, y(value) + 3, f"{value:.3g}", colour=_PALE, size=8)
        points = list(curve.points)
        path = f"M{self._x(points[0][0]):.1f} {y(points[0][1]):.1f}"
        for time, value in points[1:]:
            path += f"H{self._x(time):.1f}V{y(value):.1f}"
        path += f"H{self._x(self._seconds):.1f}"
        yield f'<path d="{path}" fill="none" stroke="{_LINE}" stroke-width="1.6"/>'

    def _legend(self) -> Iterator[str]:
        x, y = _LEFT, self._plot_bottom + 42
        shown = {bar.outcome for lane in self._lanes.operations for bar in lane.bars}
        entries = [(name, _COLOURS[name], "") for name in _LEGEND if name in shown]
        if any(bar.tries > 1 for lane in self._lanes.operations for bar in lane.bars):
            entries.append(("retry", "#ffffff", f' stroke="{_INK}" stroke-width="1.2"'))
        for name, colour, edge in entries:
            yield f'<rect x="{x:.1f}" y="{y - 9:.1f}" width="12" height="10" rx="2" fill="{colour}"{edge}/>'
            yield _text(x + 17, y, name, colour=_PALE)
            x += 40 + _width(name)


def _groups(lanes: Timeline) -> Iterator[tuple[str, list[_Row]]]:
    """Yield the rows of the picture in groups."""
    yield "states", _split(lanes.states, _STATE)
    yield "phases", _split(lanes.phases, _PHASE)
    visits = tuple((bar, _COLOURS.get(bar.outcome, _OPEN_VISIT)) for bar in lanes.targets.bars)
    yield "targets", [_Row("target", visits)] if visits else []
    yield (
        "operations",
        [
            _Row(lane.name, tuple((bar, _COLOURS[bar.outcome]) for bar in lane.bars))
            for lane in lanes.operations
        ],
    )
    yield "holds", [_Row(lane.name, tuple((bar, _HOLD) for bar in lane.bars)) for lane in lanes.holds]
    flags = [_Row(lane.name, tuple((bar, _FLAG) for bar in lane.bars)) for lane in lanes.flags]
    yield "inputs", flags + [_Row(curve.name, curve=curve) for curve in lanes.curves]


def _split(lane: Lane, colour: str) -> list[_Row]:
    """Return a row for each thing that a lane shows, in the order of their first appearance."""
    names = dict.fromkeys(bar.text for bar in lane.bars)
    # The row says what it is; a bar need not say it again.
    return [
        _Row(name, tuple((replace(bar, outcome=""), colour) for bar in lane.bars if bar.text == name))
        for name in names
    ]


def _inside(bar: Bar, room: float) -> str:
    """Return what fits into a bar and says more than its row: a target's name, a code, the number of a try."""
    tried = f"try {bar.tries}" if bar.tries > 1 else ""
    told = bar.detail.partition(" ")[0] if bar.outcome in (FAILED, "UNREACHABLE", "SCAN_FAILED") else ""
    what = bar.text if bar.outcome not in (DONE, FAILED, TIMED_OUT, CANCELLED, OPEN, "") else ""
    seconds = f"{bar.seconds:.1f} s" if not bar.outcome else ""
    choices = (
        " ".join(filter(None, (tried, told))),
        tried,
        " ".join(filter(None, (what, told))),
        what,
        seconds,
    )
    return next((text for text in choices if text and _width(text, 10) <= room), "")


def _told(bar: Bar) -> str:
    """Return what is shown when the mouse rests on a bar."""
    tried = f", try {bar.tries}" if bar.tries > 1 else ""
    detail = f": {bar.detail}" if bar.detail else ""
    outcome = f" {bar.outcome}" if bar.outcome else ""
    return f"{bar.text} {bar.begin:.1f} s to {bar.end:.1f} s ({bar.seconds:.1f} s){outcome}{tried}{detail}"


def _label(tick: Tick) -> str:
    return f"{tick.text} refused" if tick.refused else tick.text


def _width(text: str, size: float = 11) -> float:
    return len(text) * size * _LETTER


def _fitted(text: str, room: float) -> str:
    most = int(room / (11 * _LETTER))
    return text if len(text) <= most else text[: most - 1] + "…"


def _title(text: str) -> str:
    return f"<title>{escape(text)}</title>"


def _line(x1: float, y1: float, x2: float, y2: float, colour: str, dashed: bool = False) -> str:
    dashes = ' stroke-dasharray="2 3" stroke-opacity="0.6"' if dashed else ""
    ends = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
    return f'<line {ends} stroke="{colour}"{dashes}/>'


def _text(
    x: float,
    y: float,
    text: str,
    anchor: str = "",
    colour: str = _INK,
    size: float = 11,
    bold: bool = False,
) -> str:
    more = f' text-anchor="{anchor}"' if anchor else ""
    more += f' font-size="{size:g}"' if size != 11 else ""
    more += ' font-weight="600"' if bold else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}"{more}>{escape(text)}</text>'
