"""What one step collects while it is computed; frozen into a `Step` at its end."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from lupin_engine.machine.environment import NO_CAUSE, Cause
from lupin_engine.machine.event import Command, Event
from lupin_engine.machine.memory import Memory
from lupin_engine.machine.step import Refusal, Step
from lupin_engine.machine.view import Moment

#: The code of an expression or action that raised.
EXECUTION_CODE = "execution_error"


@dataclass(frozen=True)
class Signal:
    """An internal event. With `state` only that state's transitions listen to it."""

    name: str
    state: str | None = None
    cause: Cause = NO_CAUSE


@dataclass
class Turn:
    """The step in the making."""

    event: Event
    now: float
    commands: list[Command] = field(default_factory=list)
    taken: list[str] = field(default_factory=list)
    exited: list[str] = field(default_factory=list)
    entered: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    trail: list[Moment] = field(default_factory=list)
    signals: deque[Signal] = field(default_factory=deque)
    failed_guards: set[str] = field(default_factory=set)
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

    def step(self, memory: Memory) -> Step:
        """Return the finished record."""
        return Step(
            sequence=memory.sequence,
            time=self.now,
            event=self.event,
            taken=tuple(self.taken),
            exited=tuple(self.exited),
            entered=tuple(self.entered),
            commands=tuple(self.commands),
            configuration=memory.configuration,
            accepted=self.accepted,
            refusal=self.refusal,
            notes=tuple(self.notes),
            trail=tuple(dict.fromkeys(self.trail)),
        )
