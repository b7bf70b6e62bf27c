"""What one step collects while it is computed; its `Step` is a view over it."""

from __future__ import annotations

from dataclasses import dataclass, field

from lupin_engine.machine.environment import NO_CAUSE, Cause
from lupin_engine.machine.event import Command, Event
from lupin_engine.machine.plan import Plan, Row
from lupin_engine.machine.reasons import Considered, Refusal

#: The code of an expression or action that raised.
EXECUTION_CODE = "execution_error"


@dataclass(frozen=True, slots=True)
class Signal:
    """An internal event. With `state` only that state's transitions listen to it."""

    name: str
    state: str | None = None
    cause: Cause = NO_CAUSE


@dataclass(slots=True)
class Turn:
    """The step in the making. `trail` are what was to be seen: configurations, each with its target."""

    event: Event
    now: float
    row: Row
    commands: list[Command] = field(default_factory=list)
    plans: list[Plan] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    trail: list[tuple[Row, str]] = field(default_factory=list)
    signals: list[Signal] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)
    why: tuple[Considered, ...] = ()
    accepted: bool | None = None
    refusal: Refusal | None = None

    def note(self, text: str) -> None:
        """Say something about this step, once."""
        if text not in self.notes:
            self.notes.append(text)

    def fail(self, state: str, detail: str) -> None:
        """Something written in `state` raised: an error for its `on_error`, else for the chart."""
        self.note(detail)
        error = {"code": EXECUTION_CODE, "detail": detail}
        self.signals.append(Signal("error", state, Cause(event=error, error=error)))

    def fail_once(self, state: str, detail: str) -> None:
        """As `fail`, for what is evaluated in every microstep: however often it raises, the error is one."""
        if detail not in self.failed:
            self.failed.append(detail)
            self.fail(state, detail)
