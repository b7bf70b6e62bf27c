"""One mission as it was seen from outside: state, targets, readings, events, and how it ended.

Pure: fed with arrivals as plain data (see `ros.operator`), read by whoever shows them. What belongs to
another mission is not taken in, because latched topics bring the past.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from lupin_engine.errors import Severity
from lupin_engine.runtime.history import History
from lupin_engine.runtime.record import read_step

#: Values of `Observation.status`, by number.
STATUSES = ("OK", "UNREACHABLE", "SCAN_FAILED", "SKIPPED")
#: The published counter of each status.
COUNTERS: Mapping[str, str] = {
    "OK": "targets_completed",
    "UNREACHABLE": "targets_unreachable",
    "SCAN_FAILED": "targets_failed",
    "SKIPPED": "targets_skipped",
}

#: Values of `Observation.kind`; those of later builds are passed over.
TAG_READING, FLOWER, ANOMALY = 0, 1, 2

#: Exit codes of a run.
ALL_VISITED, SOME_MISSED, NOT_DONE, INTERRUPTED = 0, 1, 2, 130

#: What a lifecycle state means for a run.
ENDED = ("DONE",)
FAULTED = ("FAULT",)
RETURNING = ("RETURNING",)


@dataclass(frozen=True)
class TargetReading:
    """What became of one target: the status, why, and what its sensors said."""

    tag: str
    status: str
    reason: str
    values: Mapping[str, float]

    def __str__(self) -> str:
        details = self.reason or ", ".join(f"{name} {value:.4g}" for name, value in self.values.items())
        return f"tag {self.tag} {self.status}" + (f": {details}" if details else "")


@dataclass(frozen=True)
class RunEvent:
    """Something worth a line: seconds since the start, how bad, and the text."""

    elapsed: float
    severity: Severity
    text: str


@dataclass(frozen=True)
class RunningOperation:
    """An operation under way: which try, for how long, and how long it may take (None: no limit)."""

    operation: str
    tries: int
    phase: str
    detail: str
    since: float
    limit: float | None


@dataclass
class RunMonitor:
    """The mission `mission_id`; fill it with `take`. Times are of the monotonic clock of this process."""

    mission_id: str
    began: float
    state: dict[str, Any] = field(default_factory=dict)
    view: dict[str, Any] = field(default_factory=dict)
    #: What is known of each target, the newest last; and how many observations that took.
    readings: dict[str, TargetReading] = field(default_factory=dict)
    observed: int = 0
    happenings: list[RunEvent] = field(default_factory=list)
    heard: float = 0.0
    #: Monotonic time of this process minus the orchestrator's, as of the last step.
    _offset: float = 0.0
    _begun: dict[tuple[str, str, int], float] = field(default_factory=dict)
    _history: History = field(default_factory=History)
    _ended_at: float | None = None

    def take(self, kind: str, data: Mapping[str, Any], at: float) -> bool:
        """Take in one arrival; say whether it belongs to this mission."""
        if kind == "state":
            return self._take_state(data, at)
        if kind == "observation":
            return self._take_observation(data, at)
        return self._take_step(data, at)

    def note(self, at: float, severity: Severity, text: str) -> None:
        """Add a happening of our own."""
        self.happenings.append(RunEvent(at - self.began, severity, text))

    # -- what it amounts to -----------------------------------------------------------------------------

    @property
    def lifecycle(self) -> str:
        """The published state; '' before the first."""
        return str(self.state.get("lifecycle_state", ""))

    @property
    def ended(self) -> bool:
        """Whether the mission is over, well or not."""
        return self.lifecycle in ENDED or self.faulted

    @property
    def faulted(self) -> bool:
        """Whether the orchestrator is in FAULT."""
        return self.lifecycle in FAULTED

    @property
    def returning(self) -> bool:
        """Whether the robot is on its way home, or there."""
        return self.lifecycle in RETURNING

    @property
    def waits(self) -> bool:
        """Whether the mission does nothing until an operator does something."""
        return bool(self.state.get("paused")) and not self.ended

    @property
    def busy(self) -> bool:
        """Whether a server still carries something out for this mission, wanted or not."""
        return any(attempt.ended is None for attempt in self._history.attempts.values())

    @property
    def total(self) -> int:
        """How many targets there are."""
        return int(self.state.get("targets_total", 0))

    def count(self, status: str) -> int:
        """How many targets ended so; asked of the published counters."""
        return int(self.state.get(COUNTERS[status], 0))

    @property
    def closed(self) -> int:
        """How many targets have their outcome; several sweeps give one several."""
        return 0 if self.searching else sum(self.count(status) for status in STATUSES)

    @property
    def goal(self) -> int:
        """How many tags are to be discovered; 0 for a mission that knows its targets."""
        return int(self.state.get("discovery_goal", 0))

    @property
    def found(self) -> int:
        """How many tags were discovered."""
        return int(self.state.get("tags_discovered", 0))

    @property
    def finds(self) -> str:
        """The tags discovered in words: of the goal, or beyond it."""
        return (
            f"{self.found}/{self.goal} tags found" if self.found <= self.goal else f"{self.found} tags found"
        )

    @property
    def searching(self) -> bool:
        """Whether there is no list of targets yet: the published counters then tell of the search."""
        return self.goal > 0 and not self.view.get("total") and not self.state.get("current_target")

    @property
    def all_told(self) -> bool:
        """Whether every observation has come that was published, as far as is known."""
        return self.observed >= max(self.closed, len(self._history.published))

    @property
    def verdict(self) -> int:
        """The exit code: all found and visited, some missed, or not done."""
        if self.lifecycle not in ENDED:
            return NOT_DONE
        missed = self.searching or self.found < self.goal or self.count("OK") < self.total
        return SOME_MISSED if missed else ALL_VISITED

    def elapsed(self, now: float) -> float:
        """Return how long the mission has run at `now`; the clock stops at its end."""
        return (self._ended_at or now) - self.began

    def running(self, now: float) -> list[RunningOperation]:
        """Return the operations under way at `now`."""
        return [self._running(attempt, now) for attempt in self.view.get("attempts", ())]

    # -- taking in --------------------------------------------------------------------------------------

    def _take_state(self, data: Mapping[str, Any], at: float) -> bool:
        if data.get("mission_id") != self.mission_id:
            return False
        self.heard = at
        before, self.state = self.state, dict(data)
        if self.ended and self._ended_at is None:
            self._ended_at = at
        self._tell_changes(before, at)
        return True

    def _tell_changes(self, before: Mapping[str, Any], at: float) -> None:
        new = self.state
        told = ""
        if new.get("last_error") and new["last_error"] != before.get("last_error"):
            told = str(new.get("last_event", ""))
            self.note(at, Severity(new.get("last_event_severity", 0)), _event_text(new))
        if self.found > int(before.get("tags_discovered", 0)):
            self.note(at, Severity.INFO, self.finds)
        for flag, on, off in (
            ("estop_engaged", "e-stop engaged", "e-stop released"),
            ("paused", "paused", "resumed"),
            ("battery_low", "battery low", "battery charged"),
        ):
            if bool(new.get(flag)) != bool(before.get(flag)) and told != on:
                severity = Severity.WARN if new.get(flag) else Severity.INFO
                self.note(at, severity, on if new.get(flag) else off)

    def _take_observation(self, data: Mapping[str, Any], at: float) -> bool:
        if data.get("mission_id") != self.mission_id:
            return False
        kind = int(data.get("kind", TAG_READING))
        if kind != TAG_READING:
            finding = FINDINGS.get(kind)
            if finding is not None:
                self.note(at, *finding(data))
            return finding is not None
        reading = reading_of(data)
        self.observed += 1
        name = reading.tag or f"#{self.observed}"
        self.readings.pop(name, None)
        self.readings[name] = reading
        self.note(at, Severity.INFO if reading.status == "OK" else Severity.WARN, str(reading))
        return True

    def _take_step(self, data: Mapping[str, Any], at: float) -> bool:
        view = dict(data.get("view", {}))
        if view.get("mission_id") != self.mission_id:
            return False
        self.view = view
        self._offset = at - float(data.get("time", 0.0))
        self._follow(data.get("step"), at)
        current = {_key(attempt) for attempt in view.get("attempts", ())}
        self._begun = {key: begun for key, begun in self._begun.items() if key in current}
        for key in current:
            self._begun.setdefault(key, at)
        return True

    def _follow(self, record: Any, at: float) -> None:
        """Add a step to the history; what is none, such as one of a later build, is passed over."""
        try:
            step = read_step(record)
        except ValueError:
            return
        self._history.take(step)
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


def _event_text(state: Mapping[str, Any]) -> str:
    label, raw = str(state.get("last_event", "")), str(state["last_error"])
    return label if label == raw or not label else f"{label} ({raw})"


def reading_of(data: Mapping[str, Any]) -> TargetReading:
    """Return the outcome that an observation tells."""
    status = int(data.get("status", 0))
    reading = data.get("tag_reading", {})
    return TargetReading(
        tag=str(reading.get("tag_id", "")),
        status=STATUSES[status] if status < len(STATUSES) else f"status {status}",
        reason=str(data.get("status_detail", "")),
        values={str(sensor["name"]): float(sensor["value"]) for sensor in reading.get("readings", ())},
    )


def flowers_of(data: Mapping[str, Any]) -> tuple[Severity, str]:
    """Return what an observation says of the flowers at a tag, and how bad that is."""
    flower = data["flower"]
    species, confidence = flower["species"] or "no species", float(flower["confidence"])
    text = f"tag {flower['tag_id']}: {species} ({confidence:.2f}), blooms: {len(flower['flowers'])}"
    return (Severity.WARN, f"{text}, anomaly") if flower["anomaly"] else (Severity.INFO, text)


def anomaly_of(data: Mapping[str, Any]) -> tuple[Severity, str]:
    """Return what an observation says of an anomaly at no tag."""
    place = data["anomaly"]["pose"]["pose"]["position"]
    text = f"anomaly at x {place['x']:.2f} m, y {place['y']:.2f} m: {data['anomaly']['description']}"
    return Severity.WARN, text


FINDINGS: Mapping[int, Callable[[Mapping[str, Any]], tuple[Severity, str]]] = {
    FLOWER: flowers_of,
    ANOMALY: anomaly_of,
}
