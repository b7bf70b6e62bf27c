"""What a machine shows of itself: the published state, ready to become `MissionState` or a terminal line."""

from __future__ import annotations

from dataclasses import dataclass

from lupin_engine.chart.model import Chart
from lupin_engine.machine.memory import Memory, Phase


@dataclass(frozen=True)
class Attempting:
    """An operation under way: which try, how far, and when it times out (None: never, or frozen)."""

    state: str
    operation: str
    tries: int
    phase: str
    detail: str
    deadline: float | None


@dataclass(frozen=True)
class Moment:
    """What was published-worthy between two microsteps: short phases are seen although a step passes them."""

    lifecycle: str
    phase: str
    target: str


@dataclass(frozen=True)
class View:
    """The machine at one moment. `lifecycle` is the published top state, `phase` the innermost phase.

    `cancelling` are the operations that nobody wants any more and whose end the server has not confirmed.
    `code` and `detail` are what was reported last. `paused`: held, or in a state that waits for the operator.
    """

    configuration: tuple[str, ...]
    lifecycle: str
    phase: str
    mission: str
    mission_id: str
    started_at: float | None
    target: str
    total: int
    completed: int
    failed: int
    unreachable: int
    skipped: int
    code: str
    detail: str
    held: tuple[str, ...]
    paused: bool
    attempts: tuple[Attempting, ...]
    cancelling: tuple[str, ...]
    dropped: int


def moment_of(chart: Chart, memory: Memory) -> Moment:
    """Return the published part of the configuration: outermost label, innermost phase, current target."""
    states = [chart.states[name] for name in memory.configuration]
    return Moment(
        lifecycle=next((state.label for state in states if state.label), ""),
        phase=next((state.phase for state in reversed(states) if state.phase), ""),
        target=target_of(memory),
    )


def view_of(chart: Chart, memory: Memory) -> View:
    """Return what `memory` shows."""
    moment = moment_of(chart, memory)
    walk = memory.walk
    return View(
        configuration=memory.configuration,
        lifecycle=moment.lifecycle,
        phase=moment.phase,
        mission=memory.mission,
        mission_id=memory.mission_id,
        started_at=memory.started_at,
        target=moment.target,
        total=len(walk.items) if walk else 0,
        completed=walk.count("OK") if walk else 0,
        failed=walk.count("SCAN_FAILED") if walk else 0,
        unreachable=walk.count("UNREACHABLE") if walk else 0,
        skipped=walk.count("SKIPPED") if walk else 0,
        code=memory.code,
        detail=memory.detail,
        held=tuple(memory.held),
        paused=bool(memory.held) or any(chart.states[name].paused for name in memory.configuration),
        attempts=tuple(_attempting(memory)),
        cancelling=tuple(a.operation for a in memory.attempts.values() if a.phase is Phase.CANCELLING),
        dropped=memory.dropped,
    )


def target_of(memory: Memory) -> str:
    """Return the target being processed: only while the state that walks is active."""
    walk = memory.walk
    if walk is None or walk.state not in memory.configuration or walk.visit is None:
        return ""
    return walk.visit.target


def _attempting(memory: Memory) -> list[Attempting]:
    deadlines = {owner: due for due, _, kind, (owner, _) in memory.timers if kind == "timeout"}
    shown = []
    for invocation in memory.invocations.values():
        attempt = memory.attempts.get(invocation.attempt or "")
        if attempt is not None:
            shown.append(
                Attempting(
                    invocation.state,
                    attempt.operation,
                    invocation.tries,
                    attempt.phase.value,
                    attempt.detail,
                    deadlines.get(attempt.id),
                )
            )
    return shown
