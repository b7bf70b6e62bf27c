"""Draws a timeline for the terminal: a line for each row, a cell for each interval, in coloured pieces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from textwrap import wrap

from lupin_engine.replay.story import TonedLine, TonedText
from lupin_engine.replay.timeline import Bar, Curve, Tick, Timeline
from lupin_engine.replay.timeline_rows import (
    CURVE,
    FLAG,
    HOLD,
    TARGET,
    TimelineRow,
    axis_text,
    groups,
    is_bad,
    marks,
    placed,
    tick_text,
)
from lupin_engine.runtime.history import CANCELLED, FAILED, OPEN, TIMED_OUT

_MOST_LABEL = 24
_TICK_ROWS = 3
#: Between two marks of the axis, in cells.
_MARK = 10
#: Attempts that did not end well are marked where they end; the worst of a cell is shown.
_ENDS = {FAILED: "x", TIMED_OUT: "t", CANCELLED: "c", OPEN: ">"}
_WORST = (FAILED, TIMED_OUT, CANCELLED, OPEN)


@dataclass(frozen=True)
class Signs:
    """The characters: fill of a cell, height of a curve, an event, the beginning of a target."""

    full: str
    high: str
    event: str
    edge: str


UNICODE = Signs(full=" ░▒▓█", high="▁▂▃▄▅▆▇█", event="▼", edge="▏")
ASCII = Signs(full=" .:+#", high="_.-~^", event="v", edge="|")


def text(lanes: Timeline, width: int, signs: Signs = UNICODE) -> list[TonedLine]:
    """Return a timeline as lines of at most `width` cells."""
    return list(_TextTimeline(lanes, width, signs).lines())


class _TextTimeline:
    """One drawing."""

    def __init__(self, lanes: Timeline, width: int, signs: Signs) -> None:
        self._lanes, self._signs = lanes, signs
        self._groups = groups(lanes)
        names = [_name(row) for _, rows in self._groups for row in rows]
        self._label = min(_MOST_LABEL, max(map(len, names), default=0), width // 3)
        self._cells = max(8, width - self._label - 1)
        self._seconds = lanes.seconds or 1.0

    def lines(self) -> Iterator[TonedLine]:
        """Yield the lines from top to bottom."""
        yield from self._events()
        for _, rows in self._groups:
            for row in rows:
                yield [(f"{_cut(_name(row), self._label):>{self._label}} ", ""), *self._row(row)]
        yield from self._axis()
        shown = {bar.outcome for lane in self._lanes.operations for bar in lane.bars}
        legend = [f"{sign} {outcome}" for outcome, sign in _ENDS.items() if outcome in shown]
        for line in wrap("  ".join(legend), self._cells):
            yield [(" " * (self._label + 1) + line, "dim")]

    def _cell(self, time: float) -> int:
        return min(self._cells - 1, int(time / self._seconds * self._cells + 1e-9))

    # -- above and below ------------------------------------------------------------------------------------

    def _events(self) -> Iterator[TonedLine]:
        ticks = placed(
            self._lanes.ticks,
            lambda tick: self._cell(tick.time),
            lambda tick: len(tick_text(tick)) + 2,
            _TICK_ROWS,
        )
        used = max((row for _, row in ticks if row is not None), default=-1) + 1
        for row in reversed(range(used)):
            yield self._event_row(ticks, row)

    def _event_row(self, ticks: list[tuple[Tick, int | None]], row: int) -> TonedLine:
        cells = [(" ", "")] * self._cells
        for tick, its in ticks:
            tone = "refused" if is_bad(tick) else "event"
            sign, cell = self._signs.event, self._cell(tick.time)
            # An event without room for its label is at least seen, in the lowest row.
            shown = its == row and self._put(cells, cell, sign + tick_text(tick), tone)
            if not shown and (row if its is None else its - row) == 0:
                self._put(cells, cell, sign, tone)
        return [(" " * (self._label + 1), ""), *_joined(cells)]

    def _put(self, cells: TonedLine, cell: int, shown: str, tone: str) -> bool:
        """Write a text at a cell, or so that it ends with the line; return False where it would overlap."""
        start = max(0, min(cell, self._cells - len(shown)))
        if start + len(shown) > self._cells or any(
            char != " " for char, _ in cells[start : start + len(shown)]
        ):
            return False
        cells[start : start + len(shown)] = [(char, tone) for char in shown]
        return True

    def _axis(self) -> Iterator[TonedLine]:
        line = ""
        for time in marks(self._seconds, self._cells // _MARK):
            line = line.ljust(self._cell(time)) + axis_text(time, self._seconds)
            if len(line) > self._cells:
                line = line[: self._cell(time)].rstrip()
        yield [(" " * (self._label + 1) + line, "dim")]

    # -- rows -----------------------------------------------------------------------------------------------

    def _row(self, row: TimelineRow) -> TonedLine:
        if row.kind == CURVE and row.curve is not None:
            return [("".join(self._curve(row.curve)), CURVE)]
        return _joined(self._targets(row) if row.kind == TARGET else self._bars(row))

    def _bars(self, row: TimelineRow) -> TonedLine:
        """Fill each cell by its share of activity; the worst outcome that ends in it marks it."""
        shares = [0.0] * self._cells
        ends: list[set[str]] = [set() for _ in range(self._cells)]
        each = self._seconds / self._cells
        for bar in row.bars:
            for cell in range(self._cell(bar.begin), self._cell(bar.end) + 1):
                covered = min(bar.end, (cell + 1) * each) - max(bar.begin, cell * each)
                shares[cell] += max(0.0, covered) / each
                ends[cell].add(bar.outcome)
            shares[self._cell(bar.begin)] = max(shares[self._cell(bar.begin)], 0.01)
        last = {(self._last(bar), bar.outcome) for bar in row.bars}
        return [self._filled(row, cell, shares[cell], ends[cell], last) for cell in range(self._cells)]

    def _last(self, bar: Bar) -> int:
        """Return the last cell of a bar: one that ends at a cell's border does not reach into the next."""
        return max(self._cell(bar.begin), self._cell(bar.end - 1e-6))

    def _filled(
        self, row: TimelineRow, cell: int, share: float, ends: set[str], last: set[tuple[int, str]]
    ) -> TonedText:
        if not share:
            return " ", ""
        worst = next((outcome for outcome in _WORST if outcome in ends), "")
        if worst and (cell, worst) in last:
            return _ENDS[worst], worst
        level = max(1, min(len(self._signs.full) - 1, round(share * (len(self._signs.full) - 1))))
        return self._signs.full[level], worst or row.kind

    def _targets(self, row: TimelineRow) -> TonedLine:
        cells = [(" ", "")] * self._cells
        # In a narrow picture the next one may begin in the cell in which one ends.
        nexts = [self._cell(bar.begin) for bar in row.bars[1:]] + [self._cells]
        for bar, following in zip(row.bars, nexts, strict=True):
            begin = self._cell(bar.begin)
            end = max(begin + 1, min(self._last(bar) + 1, following))
            name = bar.text if len(bar.text) < end - begin else ""
            shown = self._signs.edge + name
            for cell in range(begin, end):
                offset = cell - begin
                cells[cell] = (shown[offset] if offset < len(shown) else " ", bar.rating or "open")
        return cells

    def _curve(self, curve: Curve) -> Iterator[str]:
        low, high = curve.bounds
        index, levels = 0, self._signs.high
        for cell in range(self._cells):
            end = (cell + 1) * self._seconds / self._cells
            while index + 1 < len(curve.points) and curve.points[index + 1][0] < end:
                index += 1
            share = (curve.points[index][1] - low) / (high - low)
            yield levels[min(len(levels) - 1, int(share * len(levels)))]


def _joined(cells: TonedLine) -> TonedLine:
    """Join neighbours of one tone, and drop the blanks at the end."""
    found = [
        ("".join(char for char, _ in group), tone) for tone, group in groupby(cells, key=lambda cell: cell[1])
    ]
    while found and not found[-1][0].strip():
        found.pop()
    return found


def _name(row: TimelineRow) -> str:
    """Return the heading of a row: a hold and an input may have the same name."""
    word = {HOLD: "hold ", FLAG: "input ", CURVE: "input "}.get(row.kind, "")
    return f"{word}{row.name}"


def _cut(name: str, most: int) -> str:
    return name if len(name) <= most else name[: max(0, most - 1)] + "."
