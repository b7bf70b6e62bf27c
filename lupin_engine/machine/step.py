"""The machine's output: the record of one step with the reasons why nothing happened in it, and the view."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from lupin_engine.chart.model import Chart
from lupin_engine.chart.records import record
from lupin_engine.errors import Place, Severity
from lupin_engine.machine.event import NO_TRIGGER, Command, Event, InternalEvent, Trigger
from lupin_engine.machine.memory import Memory, Phase
from lupin_engine.plugin.contract import EXECUTION_CODE, Code


@record(frozen=True)
class Refusal:
    """Why a request changed nothing: a declared code and a sentence for the operator."""

    code: str
    text: str


def _shown(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


@record(frozen=True)
class Considered:
    """A candidate transition for an event, with the reason against taking it.

    `held` names the hold that blocks it. `parts` are the operands of the guard's outermost and/or/not (or the
    whole guard) with their values; a text is the problem of one that could not be evaluated.
    """

    transition: str
    place: Place
    guard: str
    holds: bool
    held: str = ""
    parts: tuple[tuple[str, object], ...] = ()

    def __str__(self) -> str:
        if self.held:
            return f"{self.transition} ({self.place}) waits: {self.held} is engaged"
        if self.holds:
            return f"{self.transition} ({self.place}) can be taken"
        return f"{self.transition} ({self.place}): {self.reason()}"

    @property
    def informative(self) -> tuple[tuple[str, object], ...]:
        """The parts that say more than that the guard is false."""
        return tuple(part for part in self.parts if part[0] != self.guard or part[1] is not False)

    def reason(self, show: Callable[[object], str] = _shown) -> str:
        """Return why it is not taken, '' where it is; `show` writes the values."""
        if self.held:
            return f"{self.held} is engaged"
        if self.holds:
            return ""
        values = ", ".join(f"{text} is {show(value)}" for text, value in self.informative)
        return f"{self.guard} is false" + (f": {values}" if values else "")


@record(frozen=True)
class Moment:
    """The published state after a microstep: short phases are published although a step passes them."""

    lifecycle: str
    phase: str
    target: str


@record(frozen=True)
class CodeEvent:
    """A reported code with its declaration; `target` was the current one then."""

    code: str
    label: str
    severity: Severity
    detail: str
    target: str

    def __str__(self) -> str:
        return f"{self.code}: {self.detail}" if self.detail else self.code


@record(frozen=True)
class Step:
    """One macrostep, as it is logged.

    `sequence` counts from 1, `time` is the caller's. `taken` are the ids of the transitions, `exited` and
    `entered` full names of states, all in their order; `configuration` are the active states afterwards, in
    document order. `accepted` is the answer to a request (None for every other event), `refusal` the reason
    against it. `notes` name dropped, deferred and blocked events with the reason. `why` are the transitions
    that listen to the event, when none was taken. `trail` is the published state after each microstep, the
    last one being now. `codes` are those that were reported, in their order, `broken` the invariants that
    broke in this step, also those that hold again after it.
    """

    sequence: int
    time: float
    event: Event
    configuration: tuple[str, ...]
    taken: tuple[str, ...] = ()
    exited: tuple[str, ...] = ()
    entered: tuple[str, ...] = ()
    commands: tuple[Command, ...] = ()
    notes: tuple[str, ...] = ()
    trail: tuple[Moment, ...] = ()
    accepted: bool | None = None
    refusal: Refusal | None = None
    why: tuple[Considered, ...] = ()
    codes: tuple[CodeEvent, ...] = ()
    broken: tuple[str, ...] = ()

    @property
    def changed(self) -> bool:
        """Whether anything but the clock and the live values moved."""
        return bool(self.exited or self.entered or self.taken or self.commands)

    def __repr__(self) -> str:
        what = ", ".join(self.taken) or ", ".join(self.notes) or "nothing"
        return f"<Step {self.sequence} at {self.time:g}: {self.event.name}: {what}>"


class Macrostep:
    """The step in the making. `queue` are SCXML's internal events, `failed` the errors that were raised."""

    __slots__ = (
        "accepted",
        "bound",
        "broken",
        "codes",
        "commands",
        "entered",
        "event",
        "exited",
        "failed",
        "failed_use",
        "notes",
        "now",
        "queue",
        "refusal",
        "taken",
        "trail",
        "why",
    )

    def __init__(self, event: Event, now: float) -> None:
        self.event = event
        self.now = now
        self.queue: list[InternalEvent] = []
        #: What eventless transitions see: SCXML's `_event`, the event that was dealt with last.
        self.bound = NO_TRIGGER
        self.taken: tuple[str, ...] = ()
        self.exited: tuple[str, ...] = ()
        self.entered: tuple[str, ...] = ()
        self.commands: list[Command] = []
        self.codes: list[CodeEvent] = []
        self.broken: tuple[str, ...] = ()
        self.notes: list[str] = []
        self.trail: tuple[Moment, ...] = ()
        self.failed: list[str] = []
        #: A state whose mission could not begin: what fails in it follows from that.
        self.failed_use = ""
        self.why: tuple[Considered, ...] = ()
        self.accepted: bool | None = None
        self.refusal: Refusal | None = None

    def note(self, text: str) -> None:
        """Say something about this step, once."""
        if text not in self.notes:
            self.notes.append(text)

    def fail(self, state: str, detail: str) -> None:
        """Something written in `state` raised: an error for its `on_error`, else for the chart."""
        if self.failed_use and state.startswith(f"{self.failed_use}."):
            return
        self.note(detail)
        error = {"code": EXECUTION_CODE, "detail": detail}
        self.queue.append(InternalEvent("error", state, Trigger(event=error, error=error)))

    def fail_once(self, state: str, detail: str) -> None:
        """As `fail`, for expressions that are evaluated in every microstep: the error is raised once."""
        if detail not in self.failed:
            self.failed.append(detail)
            self.fail(state, detail)

    def record(self, sequence: int, configuration: tuple[str, ...]) -> Step:
        """Return the complete record."""
        trail = self.trail
        return Step(
            sequence,
            self.now,
            self.event,
            configuration,
            self.taken,
            self.exited,
            self.entered,
            tuple(self.commands) if self.commands else (),
            tuple(self.notes) if self.notes else (),
            tuple(dict.fromkeys(trail)) if len(trail) > 1 else trail,
            self.accepted,
            self.refusal,
            self.why,
            tuple(self.codes) if self.codes else (),
            self.broken,
        )


@dataclass(frozen=True)
class Attempting:
    """An operation under way: which try, how far, and when it times out (None: never, or frozen).

    `limit` is how long it may take in all, in seconds; None: as long as it likes. While a hold stops its
    clock `left` seconds remain.
    """

    state: str
    operation: str
    tries: int
    phase: str
    detail: str
    deadline: float | None
    limit: float | None
    left: float | None = None


@dataclass(frozen=True)
class Question:
    """An open question: its choices, and the default that counts after `deadline`.

    During a hold its clock stands still: there is no deadline, and `left` seconds remain after it.
    """

    state: str
    question: str
    choices: tuple[Code, ...]
    default: str
    deadline: float | None
    left: float | None


@dataclass(frozen=True)
class Countdown:
    """A pending timer of a state: `event` is `after.0`, `every.0`, `at.0`, `budget`, or `retry`.

    While a hold stops its clock there is no deadline, and `left` seconds remain after it.
    """

    state: str
    event: str
    deadline: float | None
    left: float | None


@dataclass(frozen=True)
class View:
    """The machine at one moment. `lifecycle` is the published top state, `phase` the innermost phase.

    `total` and `counts` are about all itineraries of the mission: the number of targets, and the number of
    visits that ended in each of the profile's outcomes, over all sweeps. `cancelling` are abandoned
    operations whose end the server has not confirmed. `code` and `detail` are the newest of the worst
    reported codes, `codes` counts all reports. `paused`: held, or in a state that waits for the operator.
    """

    configuration: tuple[str, ...]
    lifecycle: str
    phase: str
    mission: str
    mission_id: str
    started_at: float | None
    target: str
    total: int
    counts: Mapping[str, int]
    code: str
    detail: str
    codes: int
    asking: tuple[Question, ...]
    held: tuple[str, ...]
    paused: bool
    attempts: tuple[Attempting, ...]
    cancelling: tuple[str, ...]
    dropped: int
    countdowns: tuple[Countdown, ...] = ()


def fields_text(fields: Mapping[str, object]) -> str:
    """Return the data of an event or of a final state as text, for a note."""
    return ", ".join(f"{name} {_shown(value)}" for name, value in fields.items())


def moment_of(chart: Chart, memory: Memory) -> Moment:
    """Return the published part of the configuration: outermost label, innermost phase, current target."""
    states = [chart.states[name] for name in memory.configuration]
    return Moment(
        lifecycle=next((state.label for state in states if state.label), ""),
        phase=next((state.phase for state in reversed(states) if state.phase), ""),
        target=memory.target,
    )


def view_of(chart: Chart, memory: Memory) -> View:
    """Return the view of `memory`."""
    moment = moment_of(chart, memory)
    walks = memory.itineraries.values()
    return View(
        configuration=memory.configuration,
        lifecycle=moment.lifecycle,
        phase=moment.phase,
        mission=memory.mission,
        mission_id=memory.mission_id,
        started_at=memory.started_at,
        target=moment.target,
        total=memory.total,
        counts={status: sum(walk.count(status) for walk in walks) for status in chart.profile.statuses},
        code=memory.code,
        detail=memory.detail,
        codes=memory.codes,
        asking=tuple(_asking(chart, memory)),
        held=tuple(memory.held),
        paused=bool(memory.held) or any(chart.states[name].paused for name in memory.configuration),
        attempts=tuple(_attempting(memory)),
        cancelling=tuple(a.operation for a in memory.attempts.values() if a.phase in _ENDING),
        dropped=memory.dropped,
        countdowns=tuple(_countdowns(memory)),
    )


def _asking(chart: Chart, memory: Memory) -> Iterator[Question]:
    due = {owner: due for due, _, kind, (owner, _) in memory.timers if kind == "ask"}
    left = {owner: left for left, _, kind, (owner, _) in memory.frozen if kind == "ask"}
    for state, question in memory.asked.items():
        ask = chart.states[state].ask
        if ask is not None:
            choices = tuple(ask.choices.values())
            yield Question(state, question, choices, ask.default, due.get(state), left.get(state))


def _attempting(memory: Memory) -> list[Attempting]:
    deadlines = {owner: due for due, _, kind, (owner, _) in memory.timers if kind == "timeout"}
    left = {owner: left for left, _, kind, (owner, _) in memory.frozen if kind == "timeout"}
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
                    deadlines.get(attempt.id, deadlines.get(invocation.id)),
                    attempt.timeout,
                    left.get(attempt.id, left.get(invocation.id)),
                )
            )
    return shown


#: What nobody wants any more and has not ended.
_ENDING = frozenset({Phase.CANCELLING, Phase.REFUSED})
#: Timers that are shown as countdowns; those of attempts and questions are shown with them.
_COUNTED = frozenset({"after", "budget", "at", "retry"})


def _serving(memory: Memory, attempt: str) -> str:
    """Return the state that an attempt is of; '' where it is not known."""
    return next((each.state for each in memory.invocations.values() if each.id == attempt), "")


def _countdowns(memory: Memory) -> Iterator[Countdown]:
    for timers, frozen in ((memory.timers, False), (memory.frozen, True)):
        for due, _, kind, (owner, event) in timers:
            if kind not in _COUNTED:
                continue
            state = _serving(memory, owner) if kind == "retry" else owner
            name = event.partition(" ")[0] or kind
            at, left = (None, due) if frozen else (due, None)
            yield Countdown(state, name, at, left)
