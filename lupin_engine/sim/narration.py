"""Renders steps as lines for people: time, event, new state, commands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lupin_engine.chart.model import Chart, Kind
from lupin_engine.errors import Severity
from lupin_engine.machine.event import PROPERTY_BROKEN, Act, Cancel, Command, Event, Report, Start
from lupin_engine.machine.step import CodeEvent, Step
from lupin_engine.plugin.profile import Publish
from lupin_engine.runtime.history import History

#: Longest text of one argument.
_WIDTH = 48


@dataclass(frozen=True)
class StepLine:
    """One step: `moved` is the new state (empty: the old one), `commanded` its commands, `notes` the reasons.

    Each command has the rating of the outcome that it publishes; '' for every other command. `codes` are
    those that the event does not name, with their severity. A `remark` is no step: its event comments on the
    run at that time.
    """

    time: float
    event: str
    moved: str
    commanded: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]
    refused: bool = False
    codes: tuple[tuple[str, Severity], ...] = ()
    remark: bool = False

    def __str__(self) -> str:
        parts = (
            f"{self.time:8.1f} s  {self.event}",
            f"-> {self.moved}" if self.moved else "",
            *(text for text, _ in self.commanded),
            *(text for text, _ in self.codes),
        )
        return "   ".join(part for part in (*parts, *self.notes) if part)


def _is_news(step: Step) -> bool:
    """Say whether a live value is shown although it has no effect: not a pose, which changes all the time."""
    return step.event.name == "value" and not isinstance(step.event.data["value"], Mapping)


def narrate(chart: Chart, history: History, begin: int = 0, end: int | None = None) -> list[StepLine]:
    """Render the steps of a run that had an effect, in order; `begin` and `end` as in a slice."""
    narrator = _Narrator(chart, history)
    lines = [(step, narrator.line(step)) for step in history.steps[begin:end]]
    return [
        line
        for step, line in lines
        if step.changed or line.notes or line.codes or step.accepted is not None or _is_news(step)
    ]


def own_codes(step: Step) -> list[CodeEvent]:
    """Return the codes of a step that its event does not name."""
    return [code for code in step.codes if code.code != step.event.data.get("code")]


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
    """Renders the steps of one run."""

    def __init__(self, chart: Chart, history: History) -> None:
        self._chart = chart
        self._attempts = history.attempts

    def line(self, step: Step) -> StepLine:
        """Render one step."""
        details = {code.detail for code in step.codes}
        notes = [note for note in step.notes if note not in details]
        return StepLine(
            time=step.time,
            event=self._event(step),
            moved=self._moved(step),
            commanded=tuple((_command(command), self._rating(command)) for command in step.commands),
            notes=(*notes, *(() if step.refusal else map(str, step.why))),
            refused=step.accepted is False,
            codes=tuple((self._code(code), code.severity) for code in own_codes(step)),
        )

    def _code(self, code: CodeEvent) -> str:
        about = f" ({self._chart.profile.terminal.target} {code.target})" if code.target else ""
        return f"{code.severity.name.lower()} {code}{about}"

    def _rating(self, command: Command) -> str:
        return rating(self._chart, command.status) if isinstance(command, Publish) else ""

    def _event(self, step: Step) -> str:
        event = step.event
        if step.accepted is not None:
            answer = "accepted" if step.accepted else f"REFUSED: {step.refusal.text if step.refusal else ''}"
            return f"{event.name} {answer}"
        if event.name == "value":
            return f"{event.data['name']} = {shorten(event.data['value'])}"
        if event.name == PROPERTY_BROKEN:
            return f"the property {event.data['property']} is broken"
        if event.name.startswith("attempt."):
            return self._attempt(event)
        if event.name.startswith("timer."):
            return self._timer(event, step)
        return event.name

    def _attempt(self, event: Event) -> str:
        attempt = self._attempts.get(event.data["attempt"])
        operation = attempt.operation if attempt else "an operation"
        text = f"{operation} {event.name.removeprefix('attempt.')}"
        why = " ".join(filter(None, (event.data.get("code", ""), event.data.get("detail", ""))))
        return f"{text}: {why}" if why else text

    def _timer(self, event: Event, step: Step) -> str:
        kind, owner = event.name.removeprefix("timer."), str(event.data["owner"])
        if kind == "after" and any(taken.startswith(f"{owner}.every.") for taken in step.taken):
            return f"a tick in {short_name(self._chart, owner)}"
        if kind in ("after", "budget"):
            what = "time" if kind == "after" else "the budget"
            return f"{what} is up in {short_name(self._chart, owner)}"
        if kind == "at":
            return f"it is {event.data['time']} in {short_name(self._chart, owner)}"
        if kind == "ask":
            return f"nobody has answered in {short_name(self._chart, owner)}"
        if kind == "fresh":
            return f"input.{owner} is looked at again"
        if kind == "retry":
            return "next try"
        if kind == "update":
            return "time for an update"
        what = {
            "timeout": "timed out",
            "cancel": "does not confirm its cancel",
            "replaced": "is still there",
        }.get(kind, kind)
        return f"{self._attempts[owner].operation if owner in self._attempts else owner} {what}"

    def _moved(self, step: Step) -> str:
        """Name the innermost states entered: those that the step only passed through, then where it is now.

        It is in several states at once where they are regions of a parallel state.
        """
        innermost = [name for name in step.entered if not self._chart.states[name].children]
        names = [n for n in innermost if self._chart.states[n].kind is not Kind.FINAL] or innermost
        passed = [short_name(self._chart, name) for name in names if name not in step.configuration]
        here = dict.fromkeys(short_name(self._chart, name) for name in names if name in step.configuration)
        return " -> ".join([*passed, *([" + ".join(here)] if here else [])])


def rating(chart: Chart, status: str) -> str:
    """Return the rating of an outcome; '' where there is none yet."""
    return next((known.rating.value for known in chart.profile.outcomes if known.name == status), "")


def _command(command: Command) -> str:
    if isinstance(command, Start):
        word = "update" if command.updates else "start"
        return f"{word} {command.operation}{_arguments(command.arguments)}"
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
