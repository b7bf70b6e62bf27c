"""Draws a timeline as SVG: one row a state, phase, operation, hold or input. Deterministic."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

from lupin_engine.plugin.profile import Rating
from lupin_engine.replay.timeline import Bar, Curve, Timeline
from lupin_engine.replay.timeline_rows import (
    CURVE,
    FLAG,
    HOLD,
    PHASE,
    STATE,
    TimelineRow,
    axis_text,
    description,
    groups,
    inside,
    is_bad,
    lasting,
    marks,
    placed,
    tick_text,
)
from lupin_engine.runtime.history import CANCELLED, DONE, FAILED, OPEN, TIMED_OUT

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
    Rating.GOOD.value: "#3f9d63",
    Rating.BAD.value: "#cf4458",
    Rating.LEFT_OUT.value: "#e0b31e",
}
_KINDS = {STATE: "#4c6ef5", PHASE: "#8c9eff", HOLD: "#e0b31e", FLAG: "#cf4458"}
_LINE, _OPEN_VISIT = "#3b7dd8", "#c3cad2"
#: The style of a heading, and of a text that stands over lines.
_TITLE: Mapping[str, Any] = {"font_size": 16, "font_weight": 600}
_HALO: Mapping[str, Any] = {"stroke": "#ffffff", "stroke_width": 3, "paint_order": "stroke"}
_LEGEND = (DONE, FAILED, TIMED_OUT, CANCELLED, OPEN)


def svg(lanes: Timeline) -> str:
    """Draw a timeline."""
    drawing = _SvgTimeline(lanes)
    body = list(drawing.body())
    return "\n".join([drawing.head(), *body, "</svg>", ""])


class _SvgTimeline:
    """One drawing."""

    def __init__(self, lanes: Timeline) -> None:
        self._lanes = lanes
        self._seconds = lanes.seconds or 1.0
        self._groups = groups(lanes)
        self._ticks = placed(
            lanes.ticks,
            lambda tick: self._x(tick.time),
            lambda tick: 11 + _width(tick_text(tick)),
            _MAX_TICK_ROWS,
        )
        tick_rows = max((row for _, row in self._ticks if row is not None), default=-1) + 1
        self._plot_top = _TOP + (tick_rows * _TICK_ROW + 12 if lanes.ticks else 0)
        rows = sum(_height(row) for _, rows in self._groups for row in rows)
        self._plot_bottom = self._plot_top + rows + _GAP * len(self._groups)
        self._height = self._plot_bottom + 62

    def head(self) -> str:
        """Return the opening tag."""
        size = f'width="{WIDTH:g}" height="{self._height:g}" viewBox="0 0 {WIDTH:g} {self._height:g}"'
        title = f"Timeline of {self._lanes.title or 'a mission'}"
        fonts = f'font-family="{_FONT}" font-size="11"'
        return f'<svg xmlns="http://www.w3.org/2000/svg" {size} {fonts}>\n{_title(title)}'

    def body(self) -> Iterator[str]:
        """Yield the elements from back to front."""
        yield _rect(0, 0, WIDTH, self._height, "#ffffff")
        yield _text(16, 28, self._lanes.title or "not started", **_TITLE)
        subtitle = f"{lasting(self._lanes.seconds)} of virtual time"
        yield _text(WIDTH - _RIGHT, 28, subtitle, _PALE, text_anchor="end")
        yield from self._axis()
        yield from self._events()
        top = self._plot_top
        for name, rows in self._groups:
            yield _text(16, top + 14, name, _PALE, font_size=10, font_weight=600)
            for row in rows:
                yield from self._row(row, top)
                top += _height(row)
            top += _GAP
            yield _line(16, top - _GAP / 2, WIDTH - _RIGHT, top - _GAP / 2, _GRID)
        yield from self._legend()

    def _x(self, time: float) -> float:
        return _LEFT + _PLOT * time / self._seconds

    # -- axis and events ------------------------------------------------------------------------------------

    def _axis(self) -> Iterator[str]:
        bottom = self._plot_bottom
        for time in marks(self._seconds, 12):
            x = self._x(time)
            yield _line(x, self._plot_top, x, bottom, _GRID)
            yield _text(x, bottom + 16, axis_text(time, self._seconds), _PALE, text_anchor="middle")

    def _events(self) -> Iterator[str]:
        for tick, row in self._ticks:
            x, colour = self._x(tick.time), _COLOURS[FAILED] if is_bad(tick) else _INK
            top = self._plot_top - 4 - (row or 0) * _TICK_ROW
            yield f"<g>{_title(f'{tick.time:.1f} s  {tick_text(tick)}')}"
            yield _line(x, top - 8, x, self._plot_bottom, colour, dashed=True)
            if row is not None:
                label = tick_text(tick)
                fits = x + 4 + _width(label) <= WIDTH
                where, anchor = (x + 3, {}) if fits else (x - 3, {"text_anchor": "end"})
                yield _text(where, top, label, colour, **anchor, **_HALO)
            yield "</g>"

    # -- rows -----------------------------------------------------------------------------------------------

    def _row(self, row: TimelineRow, top: float) -> Iterator[str]:
        yield _text(_LEFT - 8, top + 14, _fitted(row.name, _LEFT - 70), text_anchor="end")
        if row.curve is not None:
            yield from self._curve(row.curve, top)
        for bar in row.bars:
            yield from self._bar(bar, row.kind, top + (_ROW - _BAR) / 2)

    def _bar(self, bar: Bar, kind: str, top: float) -> Iterator[str]:
        x, end = self._x(bar.begin), self._x(bar.end)
        width = max(end - x, 1.2)
        yield f"<g>{_title(description(bar))}"
        edge = f' stroke="{_INK}" stroke-width="1.2"' if bar.tries > 1 else ""
        colour = _KINDS.get(kind) or _COLOURS.get(bar.rating or bar.outcome, _OPEN_VISIT)
        yield _rect(x, top, width, _BAR, colour, f' rx="2"{edge}')
        if bar.wanted_until is not None and bar.wanted_until < bar.end:
            wanted = self._x(bar.wanted_until)
            yield _rect(wanted, top, end - wanted, _BAR, "#ffffff", ' fill-opacity="0.55"')
        label = next((text for text in inside(bar, kind) if _width(text, 10) <= width - 6), "")
        if label:
            yield _text(x + width / 2, top + 11, label, "#ffffff", text_anchor="middle", font_size=10)
        yield "</g>"

    def _curve(self, curve: Curve, top: float) -> Iterator[str]:
        low, high = curve.bounds
        inner = _CURVE - 12

        def y(value: float) -> float:
            return top + 6 + inner * (1 - (value - low) / (high - low))

        for value in (low, high):
            yield _line(_LEFT, y(value), WIDTH - _RIGHT, y(value), _GRID)
            yield _text(WIDTH - _RIGHT + 3, y(value) + 3, f"{value:.3g}", _PALE, font_size=8)
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
            yield _rect(x, y - 9, 12, 10, colour, f' rx="2"{edge}')
            yield _text(x + 17, y, name, _PALE)
            x += 40 + _width(name)


def _height(row: TimelineRow) -> float:
    return _CURVE if row.kind == CURVE else _ROW


def _width(text: str, size: float = 11) -> float:
    return len(text) * size * _LETTER


def _fitted(text: str, room: float) -> str:
    most = int(room / (11 * _LETTER))
    return text if len(text) <= most else text[: most - 1] + "…"


def _title(text: str) -> str:
    return f"<title>{escape(text)}</title>"


def _rect(x: float, y: float, width: float, height: float, colour: str, more: str = "") -> str:
    size = f'x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"'
    return f'<rect {size} fill="{colour}"{more}/>'


def _line(x1: float, y1: float, x2: float, y2: float, colour: str, dashed: bool = False) -> str:
    dashes = ' stroke-dasharray="2 3" stroke-opacity="0.6"' if dashed else ""
    ends = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
    return f'<line {ends} stroke="{colour}"{dashes}/>'


def _text(x: float, y: float, text: str, colour: str = _INK, **style: Any) -> str:
    """Return a text; `style` are further attributes, with `_` for `-`."""
    more = "".join(f' {name.replace("_", "-")}="{value}"' for name, value in style.items())
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}"{more}>{escape(text)}</text>'
