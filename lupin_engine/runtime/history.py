"""Folds steps into attempts, holds, states, targets and codes: the one place for all reports of a run.

It takes steps in their order, live or read back from records.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from lupin_engine.machine.event import Cancel, Command, Report, Start
from lupin_engine.machine.step import CodeEvent, Step
from lupin_engine.plugin.contract import EXECUTION_CODE
from lupin_engine.plugin.profile import Publish

#: How an attempt can end, beside the codes of its operation.
DONE, FAILED, CANCELLED, TIMED_OUT, OPEN = "done", "failed", "cancelled", "timed out", "open"


@dataclass(slots=True)
class AttemptHistory:
    """The course of one attempt, by times of steps; None: it did not happen.

    `ended` is the time of the server's answer, `answer` is done, failed or cancelled, and `data` its fields;
    `late`: it came after the cancel, and counts only where it was cut short. `abandoned`: the server did not
    confirm a cancel in time, and later reports are ignored. `updated` are the times of its updates, which
    took its place: these attempts are one here, with the newest `arguments`.
    """

    operation: str
    arguments: Mapping[str, Any]
    state: str
    tries: int
    started: float
    accepted: float | None = None
    progress: str = ""
    timed_out: bool = False
    cancelled: float | None = None
    abandoned: float | None = None
    ended: float | None = None
    answer: str = ""
    data: Mapping[str, Any] = field(default_factory=dict)
    late: bool = False
    updated: list[float] = field(default_factory=list)

    @property
    def over(self) -> float | None:
        """When the machine was done with it; None: it is under way."""
        return self.ended if self.abandoned is None else self.abandoned

    @property
    def outcome(self) -> str:
        """How it ended, as far as the machine knows."""
        if self.timed_out:
            return TIMED_OUT
        return CANCELLED if self.abandoned is not None else self.answer or OPEN

    @property
    def detail(self) -> str:
        """The code and the detail of its end."""
        data = self.data if self.abandoned is None else {}
        return " ".join(filter(None, (data.get("code"), data.get("detail"))))

    def hear(self, word: str, data: Mapping[str, Any], time: float) -> None:
        """Add a report of the server; after its end reports are ignored."""
        if self.ended is not None:
            return
        if word == "accepted":
            self.accepted = time if self.accepted is None else self.accepted
        elif word == "progress":
            self.progress = str(data["detail"])
        else:
            self.ended, self.answer, self.data = time, word, data
            self.late = self.cancelled is not None


class History:
    """Totals over the steps of one machine.

    `attempts` are by id, in the order of their start; one that was updated is by the last id. `published` and
    `reports` are the published outcomes, each with its step, and summaries; `lifecycles` the published states
    in the order of their appearance. `held` are the holds with the times of their changes; `holds` and
    `broken` the engaged holds and broken invariants, with their steps.
    """

    def __init__(self, steps: Iterable[Step] = ()) -> None:
        self.steps: list[Step] = []
        self.attempts: dict[str, AttemptHistory] = {}
        self.published: list[tuple[Step, Publish]] = []
        self.reports: list[Report] = []
        self.lifecycles: list[str] = []
        self.held: list[tuple[float, tuple[str, ...]]] = []
        self.holds: list[tuple[Step, str]] = []
        self.broken: list[tuple[Step, str]] = []
        self._held: tuple[str, ...] = ()
        for step in steps:
            self.take(step)

    def take(self, step: Step, held: Sequence[str] = ()) -> None:
        """Add a step, with the holds after it."""
        self.steps.append(step)
        name = step.event.name
        if name.startswith(("attempt.", "timer.")):
            self._hear(name, step.event.data, step.time)
        for moment in step.trail:
            if moment.lifecycle and (not self.lifecycles or moment.lifecycle != self.lifecycles[-1]):
                self.lifecycles.append(moment.lifecycle)
        for command in step.commands:
            self._follow(command, step)
        if (held or self._held) and tuple(held) != self._held:
            self.holds += [(step, name) for name in held if name not in self._held]
            self._held = tuple(held)
            self.held.append((step.time, self._held))
        self.broken += [(step, name) for name in step.broken]

    def _follow(self, command: Command, step: Step) -> None:
        if isinstance(command, Start) and command.updates in self.attempts:
            known = self.attempts[command.attempt] = self.attempts.pop(command.updates)
            known.arguments = command.arguments
            known.updated.append(step.time)
        elif isinstance(command, Start):
            self.attempts[command.attempt] = AttemptHistory(
                command.operation, command.arguments, command.state, command.tries, step.time
            )
        elif isinstance(command, Cancel):
            if command.attempt in self.attempts:
                self.attempts[command.attempt].cancelled = step.time
        elif isinstance(command, Publish):
            self.published.append((step, command))
        elif isinstance(command, Report):
            self.reports.append(command)

    def _hear(self, name: str, data: Mapping[str, Any], time: float) -> None:
        """Add a report about an attempt, or a timer of it that has fired."""
        kind, _, word = name.partition(".")
        attempt = self.attempts.get(data["attempt"] if kind == "attempt" else data["owner"])
        if attempt is None:
            return
        if kind == "attempt":
            attempt.hear(word, data, time)
        elif word == "timeout":
            attempt.timed_out = True
        elif word == "cancel" and attempt.ended is None:
            attempt.abandoned = time

    @property
    def phases(self) -> list[tuple[Step, str]]:
        """The published phases in the order of their appearance, each with its step."""
        phases = [(step, moment.phase) for step in self.steps for moment in step.trail]
        before = ["", *(phase for _, phase in phases)]
        return [(step, phase) for (step, phase), last in zip(phases, before, strict=False) if phase != last]

    @property
    def codes(self) -> list[tuple[Step, CodeEvent]]:
        """The codes that were reported, each with its step."""
        return [(step, code) for step in self.steps for code in step.codes]

    @property
    def errors(self) -> list[str]:
        """The details of expressions and actions that failed."""
        return [code.detail for _, code in self.codes if code.code == EXECUTION_CODE]

    @property
    def refused(self) -> list[Step]:
        """The requests that were refused."""
        return [step for step in self.steps if step.accepted is False]

    @property
    def entered(self) -> list[tuple[Step, str]]:
        """Every entry of a state, with its step."""
        return [(step, name) for step in self.steps for name in step.entered]
