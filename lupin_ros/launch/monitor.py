"""Follows one mission by its messages: state, targets, results, events, and its exit code.

Pure: it takes arrivals as plain data (see `operator`), which the profile interprets. Messages of other
missions are ignored, because latched topics deliver old ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from lupin_engine.errors import Severity
from lupin_engine.plugin import Profile, Progress, Remark, TargetResult
from lupin_engine.runtime import History, OpenQuestion, open_questions, read_step
from lupin_ros.service.messages import wire_of

#: Exit codes of a run.
ALL_VISITED, SOME_MISSED, NOT_DONE = 0, 1, 2


@dataclass(frozen=True)
class RunEvent:
    """An event for the log of the run: seconds since the start, severity and text."""

    elapsed: float
    severity: Severity
    text: str


@dataclass(frozen=True)
class RunningOperation:
    """A running operation: its try, its time so far, and its limit (None: no limit)."""

    operation: str
    tries: int
    phase: str
    detail: str
    since: float
    limit: float | None


@dataclass
class RunMonitor:
    """The mission `mission_id`; fill it with `take`. Times are of the monotonic clock of this process."""

    profile: Profile
    mission_id: str
    began: float
    progress: Progress = field(default_factory=Progress)
    view: dict[str, Any] = field(default_factory=dict)
    #: The last result of each target, the newest last; and the number of received results.
    results: dict[str, TargetResult] = field(default_factory=dict)
    received: int = 0
    happenings: list[RunEvent] = field(default_factory=list)
    heard: float = 0.0
    #: Monotonic time of this process minus the orchestrator's, as of the last step.
    _offset: float = 0.0
    _begun: dict[tuple[str, str, int], float] = field(default_factory=dict)
    _history: History = field(default_factory=History)
    _ended_at: float | None = None

    def take(self, kind: str, data: Mapping[str, Any], at: float) -> bool:
        """Take a `state`, an `observation` or a step; return whether it belongs to this mission."""
        if kind == "state":
            return self._take_state(data, at)
        if kind == "observation":
            return self._take_observation(data, at)
        return self._take_step(data, at)

    def note(self, at: float, severity: Severity, text: str) -> None:
        """Add an event of the run itself."""
        self.happenings.append(RunEvent(at - self.began, severity, text))

    # -- what it amounts to -----------------------------------------------------------------------------

    @property
    def lifecycle(self) -> str:
        """The published state; '' before the first."""
        return self.progress.lifecycle

    @property
    def ended(self) -> bool:
        """Whether the mission is over, well or not."""
        return self.lifecycle in self.profile.stages.over

    @property
    def faulted(self) -> bool:
        """Whether the mission ended in a fault."""
        return self.lifecycle in self.profile.stages.faulted

    @property
    def returning(self) -> bool:
        """Whether the robot is on its way home, or there."""
        return self.lifecycle in self.profile.stages.returning

    @property
    def waits(self) -> bool:
        """Whether the mission waits for an operator."""
        return self.progress.paused and not self.ended

    @property
    def busy(self) -> bool:
        """Whether a server still executes an operation of this mission, even a cancelled one."""
        return any(attempt.ended is None for attempt in self._history.attempts.values())

    @property
    def total(self) -> int:
        """The number of targets."""
        return self.progress.total

    def count(self, status: str) -> int:
        """Return the published counter of targets that ended with a status."""
        return self.progress.counts.get(status, 0)

    @property
    def closed(self) -> int:
        """The number of published outcomes; a target may have several in several sweeps."""
        return 0 if self.searching else sum(self.progress.counts.values())

    @property
    def finds(self) -> str:
        """The targets found in words: of the goal, or beyond it."""
        goal, found, targets = self.progress.goal, self.progress.found, self.profile.terminal.targets
        return f"{found}/{goal} {targets} found" if found <= goal else f"{found} {targets} found"

    @property
    def searching(self) -> bool:
        """Whether there is no list of targets yet: then the published counters are those of the search."""
        return self.progress.goal > 0 and not self.view.get("total") and not self.progress.target

    @property
    def all_received(self) -> bool:
        """Whether every published result has been received, as far as counters and steps show."""
        return self.received >= max(self.closed, len(self._history.published))

    @property
    def verdict(self) -> int:
        """The exit code: `ALL_VISITED`, `SOME_MISSED`, or `NOT_DONE` where the mission has not ended well."""
        if self.lifecycle not in self.profile.stages.ended:
            return NOT_DONE
        good = sum(self.count(status) for status in self.profile.statuses if self.profile.is_good(status))
        missed = self.searching or self.progress.found < self.progress.goal or good < self.total
        return SOME_MISSED if missed else ALL_VISITED

    def elapsed(self, now: float) -> float:
        """Return how long the mission has run at `now`; the clock stops at its end."""
        return (self._ended_at or now) - self.began

    def running(self, now: float) -> list[RunningOperation]:
        """Return the operations under way at `now`."""
        return [self._running(attempt, now) for attempt in self.view.get("attempts", ())]

    def asking(self, now: float) -> list[OpenQuestion]:
        """Return the questions that are open at `now`."""
        return open_questions(self.view, now - self._offset)

    # -- arrivals ---------------------------------------------------------------------------------------

    def _take_state(self, data: Mapping[str, Any], at: float) -> bool:
        progress = wire_of(self.profile).read_state(data)
        if progress.mission_id != self.mission_id:
            return False
        self.heard = at
        before, self.progress = self.progress, progress
        if self.ended and self._ended_at is None:
            self._ended_at = at
        self._note_changes(before, at)
        return True

    def _note_changes(self, before: Progress, at: float) -> None:
        new = self.progress
        if new.found > before.found:
            self.note(at, Severity.INFO, self.finds)
        for name, flag in self.profile.terminal.flags.items():
            is_up = new.flags.get(name, False)
            # An engaged hold reports a code already.
            if is_up != before.flags.get(name, False) and not (is_up and new.event == flag.on):
                self.note(at, Severity.WARN if is_up else Severity.INFO, flag.on if is_up else flag.off)

    def _take_observation(self, data: Mapping[str, Any], at: float) -> bool:
        found = wire_of(self.profile).read_outcome(data)
        if found is None or found.mission_id != self.mission_id:
            return False
        if isinstance(found, Remark):
            self.note(at, found.severity, found.text)
            return True
        self.received += 1
        name = found.target or f"#{self.received}"
        self.results.pop(name, None)
        self.results[name] = found
        self.note(
            at,
            Severity.INFO if self.profile.is_good(found.status) else Severity.WARN,
            self._result_text(found),
        )
        return True

    def _result_text(self, found: TargetResult) -> str:
        details = found.reason or ", ".join(f"{name} {value:.4g}" for name, value in found.values.items())
        text = f"{self.profile.terminal.target} {found.target} {found.status}"
        return f"{text}: {details}" if details else text

    def _take_step(self, data: Mapping[str, Any], at: float) -> bool:
        view = dict(data.get("view", {}))
        if view.get("mission_id") != self.mission_id:
            return False
        before = {asked.state for asked in self.asking(at)}
        self.view = view
        self._offset = at - float(data.get("time", 0.0))
        for asked in self.asking(at):
            if asked.state not in before:
                answers = " or ".join(f"lupin answer {name}" for name, _ in asked.choices)
                self.note(at, Severity.WARN, f"{asked.question} ({answers})")
        self._follow(data.get("step"), at)
        current = {_key(attempt) for attempt in view.get("attempts", ())}
        self._begun = {key: begun for key, begun in self._begun.items() if key in current}
        for key in current:
            self._begun.setdefault(key, at)
        return True

    def _follow(self, record: Any, at: float) -> None:
        """Add a step to the history; a record that is no step of this version is ignored."""
        try:
            step = read_step(record)
        except ValueError:
            return
        self._history.take(step)
        for code in step.codes:
            about = f"{self.profile.terminal.target} {code.target}: " if code.target else ""
            text = code.label if code.label == str(code) else f"{code.label} ({code})"
            self.note(at, code.severity, f"{about}{text}")
        pose = step.event.data.get("result", {}).get("pose") if step.event.name == "attempt.done" else None
        attempt = self._history.attempts.get(step.event.data["attempt"]) if pose else None
        if pose and attempt is not None:
            self.note(at, Severity.INFO, f"{attempt.operation}: x {pose['x']:.2f} m, y {pose['y']:.2f} m")

    def _running(self, attempt: Mapping[str, Any], now: float) -> RunningOperation:
        begun = self._begun.get(_key(attempt), now)
        deadline = attempt.get("deadline")
        limit = None if deadline is None else max(0.0, float(deadline) + self._offset - begun)
        return RunningOperation(
            operation=str(attempt["operation"]),
            tries=int(attempt["tries"]),
            phase=str(attempt["phase"]),
            detail=str(attempt["detail"]),
            since=max(0.0, now - begun),
            limit=limit,
        )


def _key(attempt: Mapping[str, Any]) -> tuple[str, str, int]:
    return str(attempt["state"]), str(attempt["operation"]), int(attempt["tries"])
