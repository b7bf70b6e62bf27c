"""Steps as lines that people read: when, what happened, where that led, what was commanded."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import Any

from lupin_engine.chart.model import Chart, Kind
from lupin_engine.machine.event import Act, Cancel, Command, Event, Publish, Report, Start
from lupin_engine.machine.step import Step

#: Longest text of one argument.
_WIDTH = 48

#: A text and what it is about: "time", "state", "event", "refused", "note", "command" or a target's status.
Piece = tuple[str, str]
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


@dataclass(frozen=True)
class Line:
    """One step: `moved` is where it led (empty: nowhere), `commanded` what follows, `notes` why (not)."""

    time: float
    event: str
    moved: str
    commanded: tuple[str, ...]
    notes: tuple[str, ...]
    refused: bool = False

    def __str__(self) -> str:
        parts = (
            f"{self.time:8.1f} s  {self.event}",
            f"-> {self.moved}" if self.moved else "",
            *self.commanded,
        )
        return "   ".join(part for part in (*parts, *self.notes) if part)


class Teller:
    """Tells steps one after the other; it remembers which attempt was of which operation."""

    def __init__(self, chart: Chart) -> None:
        self._narrator = _Narrator(chart)

    def tell(self, steps: Iterable[Step]) -> Iterator[Line]:
        """Tell the steps in which something happened, in order."""
        for step in steps:
            line = self._narrator.line(step)
            if step.changed or line.notes or step.accepted is not None or _is_news(step):
                yield line


def _is_news(step: Step) -> bool:
    """Say whether a live value is told although nothing follows: not a pose, which changes all the time."""
    return step.event.name == "value" and not isinstance(step.event.data["value"], Mapping)


def tell(chart: Chart, steps: Iterable[Step]) -> Iterator[Line]:
    """Tell the steps of a run in which something happened, in order."""
    return Teller(chart).tell(steps)


# -- lines in columns -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Columns:
    """How wide the columns of a story are, in cells; with `command` 0 commands stand under their event."""

    state: int
    event: int
    command: int


def columns_for(lines: Sequence[Line], width: int) -> Columns:
    """Return the columns in which lines are told in `width` cells."""
    state = max((_longest(line.moved) for line in lines), default=0)
    event = max((len(line.event) for line in lines), default=0)
    return _columns(min(_MOST_STATE, state), min(_MOST_EVENT, event), width)


def usual_columns(width: int) -> Columns:
    """Return the columns for lines that are not known yet."""
    return _columns(_USUAL_STATE, _USUAL_EVENT, width)


def _columns(state: int, event: int, width: int) -> Columns:
    state = min(state, max(1, (width - _TIME) * 2 // 5))
    command = width - _TIME - state - event - 2 * _GAP
    if command < _LEAST_COMMAND:
        return Columns(state, max(1, width - _TIME - state - _GAP), 0)
    return Columns(state, event, command)


def laid_out(line: Line, columns: Columns) -> Iterator[list[Piece]]:
    """Yield one line of a story in columns: the time, the state that it led to, the event, the commands."""
    states = [(text, "state") for text in _wrapped(line.moved, max(1, columns.state))]
    events = [(text, "refused" if line.refused else "event") for text in wrap(line.event, columns.event)]
    commands = [
        (text, _tone(command))
        for command in line.commanded
        for text in wrap(
            command, columns.command or columns.event, max_lines=_COMMAND_LINES, placeholder=" ..."
        )
    ]
    if not columns.command:
        events, commands = events + commands, []
    for index in range(max(len(states), len(events), len(commands))):
        time = f"{line.time:8.1f} s" if index == 0 else ""
        yield _row(
            [
                (time, "time", _TIME),
                (*_at(states, index), columns.state + _GAP),
                (*_at(events, index), columns.event + _GAP),
                (*_at(commands, index), 0),
            ]
        )
    room = columns.event + (columns.command + _GAP if columns.command else 0)
    for note in line.notes:
        for text in wrap(f"({note})", room):
            yield _row([("", "time", _TIME), ("", "", columns.state + _GAP), (text, "note", 0)])


def _wrapped(moved: str, width: int) -> list[str]:
    """Break names of states into lines: between two of them, or behind a dot."""
    lines = [""]
    for piece in re.split(r"(?<=[. ])", moved):
        if lines[-1] and len(lines[-1]) + len(piece.rstrip()) > width:
            lines.append("")
        lines[-1] += piece
    texts = [line.rstrip() for line in lines]
    return [text[start : start + width] for text in texts for start in range(0, len(text), width)]


def _longest(moved: str) -> int:
    """Return the length of the longest piece between which a text may be broken."""
    return max(map(len, moved.split()), default=0)


def _at(pieces: list[Piece], index: int) -> Piece:
    return pieces[index] if index < len(pieces) else ("", "")


def _row(cells: list[tuple[str, str, int]]) -> list[Piece]:
    """Return cells as pieces of one line, padded to their widths, without blanks at its end."""
    while cells and not cells[-1][0]:
        cells.pop()
    padded = [(f"{text:<{width}}", tone) for text, tone, width in cells[:-1]]
    return padded + [(text, tone) for text, tone, _ in cells[-1:]]


def _tone(command: str) -> str:
    words = command.split()
    return words[2] if words[0] == "publish" and len(words) > 2 else "command"


# -- one step ---------------------------------------------------------------------------------------------


def short_name(chart: Chart, name: str) -> str:
    """Return a state's name as it is published: without the slot and the mission that stands in it."""
    parts: list[str] = []
    state = chart.states[name]
    while state.name:
        wraps = state.parent is not None and chart.states[state.parent].slot
        if not (state.slot or wraps) or not parts:
            parts.append(state.local_name)
        state = chart.states[state.parent or ""]
    return ".".join(reversed(parts))


class _Narrator:
    """Remembers which attempt was of which operation."""

    def __init__(self, chart: Chart) -> None:
        self._chart = chart
        self._operations: dict[str, str] = {}

    def line(self, step: Step) -> Line:
        """Tell one step."""
        for command in step.commands:
            if isinstance(command, Start):
                self._operations[command.attempt] = command.operation
        return Line(
            time=step.time,
            event=self._event(step),
            moved=self._moved(step),
            commanded=tuple(_command(command) for command in step.commands),
            notes=(*step.notes, *(() if step.refusal else map(str, step.why))),
            refused=step.accepted is False,
        )

    def _event(self, step: Step) -> str:
        event = step.event
        if step.accepted is not None:
            answer = "accepted" if step.accepted else f"REFUSED: {step.refusal.text if step.refusal else ''}"
            return f"{event.name} {answer}"
        if event.name == "value":
            return f"{event.data['name']} = {shorten(event.data['value'])}"
        if event.name.startswith("attempt."):
            return self._attempt(event)
        if event.name.startswith("timer."):
            return self._timer(event)
        return event.name

    def _attempt(self, event: Event) -> str:
        operation = self._operations.get(event.data["attempt"], "an operation")
        text = f"{operation} {event.name.removeprefix('attempt.')}"
        why = " ".join(filter(None, (event.data.get("code", ""), event.data.get("detail", ""))))
        return f"{text}: {why}" if why else text

    def _timer(self, event: Event) -> str:
        kind, owner = event.name.removeprefix("timer."), str(event.data["owner"])
        if kind in ("after", "budget"):
            what = "time" if kind == "after" else "the budget"
            return f"{what} is up in {short_name(self._chart, owner)}"
        if kind == "fresh":
            return f"input.{owner} is looked at again"
        if kind == "retry":
            return "next try"
        what = {"timeout": "timed out", "cancel": "does not confirm its cancel"}.get(kind, kind)
        return f"{self._operations.get(owner, owner)} {what}"

    def _moved(self, step: Step) -> str:
        """Name the innermost states entered: those that the step only passed through, then where it is now.

        It is in several states at once where they are regions of a parallel state.
        """
        innermost = [name for name in step.entered if not self._chart.states[name].children]
        told = [n for n in innermost if self._chart.states[n].kind is not Kind.FINAL] or innermost
        passed = [short_name(self._chart, name) for name in told if name not in step.configuration]
        here = dict.fromkeys(short_name(self._chart, name) for name in told if name in step.configuration)
        return " -> ".join([*passed, *([" + ".join(here)] if here else [])])


def _command(command: Command) -> str:
    if isinstance(command, Start):
        return f"start {command.operation}{_arguments(command.arguments)}"
    if isinstance(command, Cancel):
        return f"cancel {command.operation}"
    if isinstance(command, Act):
        return f"do {command.action}{_arguments(command.arguments)}"
    if isinstance(command, Publish):
        why = command.detail or command.code
        return f"publish {command.target} {command.status}" + (f" ({why})" if why else "")
    if isinstance(command, Report):
        return f"report {len(command.visits)} visits"
    return str(command)


def _arguments(arguments: Mapping[str, Any]) -> str:
    return (
        f"({', '.join(f'{name}: {shorten(value)}' for name, value in arguments.items())})"
        if arguments
        else ""
    )


def shorten(value: Any) -> str:
    """Return a value in few characters."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        text = "{" + ", ".join(f"{name} {shorten(inner)}" for name, inner in value.items()) + "}"
    elif isinstance(value, (list, tuple)):
        text = "[" + ", ".join(shorten(inner) for inner in value) + "]"
    else:
        text = str(value)
    return text if len(text) <= _WIDTH else text[: _WIDTH - 3] + "..."
