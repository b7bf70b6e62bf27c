"""Formats a run as a story in columns: time, state, event, commands."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from textwrap import wrap

from lupin_engine.errors import Severity
from lupin_engine.sim.narration import StepLine

#: A text and its tone: "time", "state", "event", "refused", "note", "command" or the rating of an outcome.
TonedText = tuple[str, str]
#: A line in texts that can be coloured.
TonedLine = list[TonedText]
#: Width of the column of the time, in cells.
_TIME = 12
#: A column is at most so wide, so that one long text does not take the room of all others.
_MOST_STATE, _MOST_EVENT = 30, 36
#: The columns of a story of which the lines are not known yet.
_USUAL_STATE, _USUAL_EVENT = 28, 34
#: With less room than this commands stand under their event.
_LEAST_COMMAND = 40
#: A command is cut after so many lines.
_COMMAND_LINES = 2
_GAP = 2
#: Times are shown with at most so many digits behind the point.
_MOST_DIGITS = 3
#: The tone of a code.
_TONES = {Severity.INFO: "dim", Severity.WARN: "note", Severity.ERROR: "refused"}


@dataclass(frozen=True)
class Columns:
    """The widths of a story's columns, in cells; with `command` 0 commands are below their event.

    Times have so many `digits` behind the point.
    """

    state: int
    event: int
    command: int
    digits: int = 1


def columns_for(lines: Sequence[StepLine], width: int) -> Columns:
    """Return the columns for these lines within `width` cells."""
    state = max((len(word) for line in lines for word in line.moved.split()), default=0)
    event = max((len(line.event) for line in lines if not line.remark), default=0)
    return _columns(min(_MOST_STATE, state), min(_MOST_EVENT, event), width)


def exact_columns(lines: Sequence[StepLine], width: int) -> Columns:
    """Return the same, with the fewest digits that keep different times apart, three at most."""
    times = {round(line.time, _MOST_DIGITS) for line in lines}
    digits = (n for n in range(1, _MOST_DIGITS) if len({f"{time:.{n}f}" for time in times}) == len(times))
    return replace(columns_for(lines, width), digits=next(digits, _MOST_DIGITS))


def usual_columns(width: int) -> Columns:
    """Return the columns for lines that are not known yet."""
    return _columns(_USUAL_STATE, _USUAL_EVENT, width)


def _columns(state: int, event: int, width: int) -> Columns:
    state = min(state, max(1, (width - _TIME) * 2 // 5))
    command = width - _TIME - state - event - 2 * _GAP
    if command < _LEAST_COMMAND:
        return Columns(state, max(1, width - _TIME - state - _GAP), 0)
    return Columns(state, event, command)


def _commands(line: StepLine, columns: Columns) -> Iterator[tuple[str, str]]:
    """Yield the lines of a step's commands, each with its tone."""
    width = columns.command or columns.event
    for command, rating in line.commanded:
        for text in wrap(command, width, max_lines=_COMMAND_LINES, placeholder=" ..."):
            yield text, rating or "command"


def laid_out(line: StepLine, columns: Columns) -> Iterator[TonedLine]:
    """Yield the rows of a story's line: time, new state, event, commands."""
    now = f"{line.time:8.{columns.digits}f} s"
    if line.remark:
        room = columns.state + _GAP + columns.event + (columns.command + _GAP if columns.command else 0)
        for index, text in enumerate(wrap(line.event, room)):
            yield _row([("" if index else now, "time", _TIME), (text, "refused", 0)])
        return
    states = [(text, "state") for text in _wrapped(line.moved, max(1, columns.state))]
    events = [(text, "refused" if line.refused else "event") for text in wrap(line.event, columns.event)]
    commands = list(_commands(line, columns))
    if not columns.command:
        events, commands = events + commands, []
    for index in range(max(len(states), len(events), len(commands))):
        time = now if index == 0 else ""
        yield _row(
            [
                (time, "time", _TIME),
                (*_at(states, index), columns.state + _GAP),
                (*_at(events, index), columns.event + _GAP),
                (*_at(commands, index), 0),
            ]
        )
    yield from _remarks(line, columns)


def _remarks(line: StepLine, columns: Columns) -> Iterator[TonedLine]:
    """Yield the lines below a step: its codes and notes."""
    room = columns.event + (columns.command + _GAP if columns.command else 0)
    codes = [(text, _TONES[severity]) for text, severity in line.codes]
    for whole, tone in (*codes, *((f"({note})", "note") for note in line.notes)):
        for text in wrap(whole, room):
            yield _row([("", "time", _TIME), ("", "", columns.state + _GAP), (text, tone, 0)])


def _wrapped(moved: str, width: int) -> list[str]:
    """Break names of states into lines: between two of them, or behind a dot."""
    lines = [""]
    for piece in re.split(r"(?<=[. ])", moved):
        if lines[-1] and len(lines[-1]) + len(piece.rstrip()) > width:
            lines.append("")
        lines[-1] += piece
    texts = [line.rstrip() for line in lines]
    return [text[start : start + width] for text in texts for start in range(0, len(text), width)]


def _at(pieces: TonedLine, index: int) -> TonedText:
    return pieces[index] if index < len(pieces) else ("", "")


def _row(cells: list[tuple[str, str, int]]) -> TonedLine:
    """Return cells as pieces of one line, padded to their widths, without blanks at its end."""
    while cells and not cells[-1][0]:
        cells.pop()
    padded = [(f"{text:<{width}}", tone) for text, tone, width in cells[:-1]]
    return padded + [(text, tone) for text, tone, _ in cells[-1:]]
