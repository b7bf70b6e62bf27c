"""The machine's memory: its whole state between steps, as plain data for JSON (see `snapshot`)."""

from __future__ import annotations

import enum
import operator
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Any, NamedTuple

from lupin_engine.chart.model import Chart, State
from lupin_engine.machine.event import Event
from lupin_engine.machine.schema import (
    BUDGETS,
    COLLECTIONS,
    HISTORIES,
    HOLDS,
    INPUTS,
    INVARIANTS,
    LEVELS,
    MISSIONS,
    QUESTIONS,
    REQUEST_FIELDS,
    STATES,
    TIMED,
    USES,
    VARIABLES,
    WALKS,
    Compare,
    FieldKind,
    GoesOn,
    Life,
    MemoryField,
    Owner,
    fields_of,
    kept,
)


@dataclass(slots=True)
class Visit:
    """The outcome of one target. Closed exactly once; then it never changes.

    `tries` counts the attempts of each operation; one that a hold or a divert ended does not count.
    """

    target: str
    status: str = ""
    code: str = ""
    detail: str = ""
    reading: Mapping[str, Any] | None = None
    tries: dict[str, int] = field(default_factory=dict)

    @property
    def closed(self) -> bool:
        """Whether the visit has its outcome."""
        return bool(self.status)


@dataclass(slots=True)
class Traversal:
    """The iteration over an itinerary: its items, one visit for each, and the current index.

    `sweep` counts from 1, `sweeps` is their number (0: no end). `past` counts the visits of earlier sweeps by
    status, `earlier` is the newest of them for each target. With `again` the last sweep is over the targets
    whose visit in the one before ended with such a status. With `leaves_open` open visits stay open at the
    end. Without `begun` it is registered from the request alone. When its state is entered anew the iteration
    restarts; `before` counts the targets until then.
    """

    state: str
    items: list[Any]
    visits: list[Visit]
    index: int = 0
    sweep: int = 1
    sweeps: int = 1
    past: dict[str, int] = field(default_factory=dict)
    earlier: dict[str, Visit] = field(default_factory=dict)
    leaves_open: bool = False
    begun: bool = True
    before: int = 0
    again: tuple[str, ...] = ()

    @property
    def item(self) -> Any:
        """The current target, or None when there is none."""
        return self.items[self.index] if self.index < len(self.items) else None

    @property
    def visit(self) -> Visit | None:
        """The current target's visit; None after the last one."""
        return self.visits[self.index] if self.index < len(self.visits) else None

    @property
    def outcomes(self) -> tuple[Visit, ...]:
        """The visit of each target: of this sweep, or while that is open the newest one before."""
        now = {visit.target for visit in self.visits}
        gone = [visit for target, visit in self.earlier.items() if target not in now]
        return (*gone, *[v if v.closed else self.earlier.get(v.target, v) for v in self.visits])

    @property
    def failed(self) -> list[Any]:
        """The targets of this sweep that are visited again, as far as it has gone."""
        both = zip(self.items, self.visits, strict=True)
        return [item for item, visit in both if visit.status in self.again]

    @property
    def is_last_sweep(self) -> bool:
        """Whether no other sweep follows, as far as this one has gone."""
        return 0 < self.sweeps <= self.sweep or (self.precedes_failed and not self.failed)

    @property
    def precedes_failed(self) -> bool:
        """Whether the next sweep is over what failed in this one."""
        return bool(self.again) and self.sweep + 1 == self.sweeps

    @property
    def remaining(self) -> int:
        """How many targets come after the current one; at the end of a sweep, those of the next one."""
        after = max(0, len(self.items) - self.index - 1)
        if after or self.is_last_sweep:
            return after
        return len(self.failed if self.precedes_failed else self.items)

    def count(self, status: str) -> int:
        """How many visits were closed with `status`, over all sweeps."""
        return self.past.get(status, 0) + sum(1 for visit in self.visits if visit.status == status)


class Phase(str, enum.Enum):
    """The phases of an attempt; `operations.LIFE` is their transition table."""

    WAITING = "waiting"  #: for the resource that an earlier attempt still uses
    REQUESTED = "requested"  #: the server was asked
    ACCEPTED = "accepted"  #: the server took it
    REPLACED = "replaced"  #: an update was sent in its place; it may go on until the server takes that
    CANCELLING = "cancelling"  #: nobody wants it any more; the server may not know yet
    LOST = "lost"  #: the server did not confirm the cancel in time
    REFUSED = "refused"  #: the server refuses the cancel, which is repeated: it keeps what it uses to its end


@dataclass(slots=True)
class Attempt:
    """One request to a server. Only the current attempt of an invocation is listened to.

    `answer` is its end, while that waits for the release of a hold. `detail` is its last progress, or the
    reason for which the server refuses the cancel.
    """

    id: str
    invocation: str
    operation: str
    arguments: Mapping[str, Any]
    uses: tuple[str, ...]
    phase: Phase
    detail: str = ""
    timeout: float | None = None
    answer: Event | None = None


class ResourceClaim(NamedTuple):
    """The resources of an attempt; `waits`: it has not begun yet; `refused`: its cancel was refused.

    `updated` is the invocation of a replaced attempt.
    """

    attempt: str
    uses: tuple[str, ...]
    waits: bool
    refused: bool = False
    updated: str = ""


def claim_of(attempt: Attempt) -> ResourceClaim | None:
    """Return the claim of an attempt; None where it is lost, or uses nothing and is not held up.

    An attempt is held up while it waits for a resource, or refuses to end.
    """
    waits = attempt.phase is Phase.WAITING
    refused = attempt.phase is Phase.REFUSED
    updated = attempt.invocation if attempt.phase is Phase.REPLACED else ""
    if attempt.phase is Phase.LOST or not (attempt.uses or waits or refused or updated):
        return None
    return ResourceClaim(attempt.id, attempt.uses, waits, refused, updated)


@dataclass(slots=True)
class CutShort:
    """The pending result of an attempt that was cut short: taken at its end, or when its cancel times out.

    `way` is the value of `on_hold`, or empty after a timeout.
    """

    attempt: str
    code: str
    detail: str
    way: str = ""
    over: bool = False
    result: Mapping[str, Any] | None = None


@dataclass(slots=True)
class Invocation:
    """One activation of an `invoke`: its tries and its current attempt.

    It is made when its state is entered. When it is not `begun`, at first and after a hold or a back-off, it
    gets its next attempt at the end of a step. `event` led to the state; its fields are arguments in every
    try. `item` is the element of a `for_each`, `key` its key. With `cut` it waits for the result of its last
    attempt.
    """

    id: str
    state: str
    event: Mapping[str, Any] = field(default_factory=dict)
    begun: bool = False
    tries: int = 0
    attempt: str | None = None
    key: str | None = None
    item: Any = None
    cut: CutShort | None = None

    @property
    def name(self) -> str:
        """Its key in the memory: its state, for an element of a `for_each` with the element's key."""
        return self.state if self.key is None else f"{self.state}[{self.key}]"


#: A deadline: when it is due, its number, its kind, and what it is about: the state, attempt, invocation or
#: input that it belongs to, with the event that it makes there (of an `at`, date and time of day follow).
#: `due` is a time of the caller's clock; of a frozen timer the time that is left. A plain tuple, because
#: thousands of them a second may be made.
Timer = tuple[float, int, str, tuple[str, str]]


def _later(timer: Timer, seconds: float) -> Timer:
    due, token, kind, about = timer
    return due + seconds, token, kind, about


class Reported(NamedTuple):
    """A live value, its time stamp, and whether it was reported or is the input's initial value."""

    value: Any
    stamp: float
    reported: bool = True

    def later(self, seconds: float) -> Reported:
        """Return the same by a clock that is so many seconds ahead."""
        return self._replace(stamp=self.stamp + seconds)


@dataclass(slots=True)
class Memory:
    """The whole state of a machine.

    `code` is the newest of the worst reported codes, with its `detail`; `codes` counts all that were
    reported. `given` is the request of each embedded mission, by the state that uses it. `timers` are in
    firing order. `budgets` is the time that each state with a budget had left when it was last entered or
    left, `handled` the keys that each `for_each` has finished, both in this mission. `asked` are the open
    questions by their states. `levels` is by `input.NAME.LEVEL`. For inputs that are lists about the mission,
    `heard` is the last report as a whole, `before` the elements from before the mission that are still
    reported unchanged. `projected` holds the profile's projections of live values; no step reads it. `broken`
    names the invariants that do not hold. `wall` is how far the robot's clock, in POSIX time, is ahead of the
    caller's, or None. `reached` are the dates on which each state has handled each time of day of its `at`:
    those of a mission's states in this mission. Steps read claims and holds through methods, so that a proof
    can record these reads.
    """

    configuration: tuple[str, ...] = field(default=(), metadata=kept(Life.CHART, owner=STATES))
    history: dict[str, tuple[str, ...]] = field(
        default_factory=dict, metadata=kept(Life.USE, FieldKind.BY_KEY, HISTORIES)
    )
    context: dict[str, Any] = field(
        default_factory=dict, metadata=kept(Life.OWNER, FieldKind.BY_KEY, VARIABLES)
    )
    request: dict[str, Any] = field(
        default_factory=dict, metadata=kept(Life.MISSION, FieldKind.BY_KEY, REQUEST_FIELDS)
    )
    given: dict[str, dict[str, Any]] = field(
        default_factory=dict, metadata=kept(Life.MISSION, FieldKind.BY_KEY, USES)
    )
    mission: str = field(default="", metadata=kept(Life.MISSION, owner=MISSIONS))
    mission_id: str = field(default="", metadata=kept(Life.MISSION))
    started_at: float | None = field(
        default=None, metadata=kept(Life.MISSION, compared=Compare.PRESENCE, later=operator.add)
    )
    itineraries: dict[str, Traversal] = field(
        default_factory=dict, metadata=kept(Life.MISSION, FieldKind.ORDERED, WALKS)
    )
    current_itinerary: str = field(default="", metadata=kept(Life.MISSION))
    timers: list[Timer] = field(default_factory=list, metadata=kept(Life.CHART, later=_later))
    frozen: list[Timer] = field(default_factory=list, metadata=kept(Life.CHART))
    budgets: dict[str, float] = field(
        default_factory=dict, metadata=kept(Life.USE, FieldKind.BY_KEY, BUDGETS)
    )
    invocations: dict[str, Invocation] = field(
        default_factory=dict, metadata=kept(Life.CHART, FieldKind.ORDERED)
    )
    attempts: dict[str, Attempt] = field(default_factory=dict, metadata=kept(Life.CHART, FieldKind.ORDERED))
    handled: dict[str, list[str]] = field(
        default_factory=dict, metadata=kept(Life.USE, FieldKind.BY_KEY, COLLECTIONS, Compare.UNORDERED)
    )
    asked: dict[str, str] = field(
        default_factory=dict, metadata=kept(Life.CHART, owner=QUESTIONS, compared=Compare.NAMES)
    )
    held: list[str] = field(default_factory=list, metadata=kept(Life.CHART, FieldKind.NAMES, HOLDS))
    deferred: list[Event] = field(default_factory=list, metadata=kept(Life.CHART))
    waiting_actions: list[tuple[str, str, Mapping[str, Any]]] = field(
        default_factory=list, metadata=kept(Life.MISSION)
    )
    inputs: dict[str, Reported] = field(
        default_factory=dict, metadata=kept(Life.OWNER, FieldKind.BY_KEY, INPUTS, later=Reported.later)
    )
    levels: dict[str, bool] = field(default_factory=dict, metadata=kept(Life.OWNER, FieldKind.BY_KEY, LEVELS))
    projected: dict[str, Any] = field(
        default_factory=dict, metadata=kept(Life.CHART, compared=Compare.NOTHING)
    )
    heard: dict[str, list[Any]] = field(
        default_factory=dict, metadata=kept(Life.OWNER, FieldKind.BY_KEY, INPUTS, Compare.NOTHING)
    )
    before: dict[str, list[Any]] = field(
        default_factory=dict, metadata=kept(Life.CHART, FieldKind.BY_KEY, INPUTS, Compare.NOTHING)
    )
    broken: list[str] = field(
        default_factory=list, metadata=kept(Life.MISSION, owner=INVARIANTS, compared=Compare.UNORDERED)
    )
    wall: float | None = field(
        default=None, metadata=kept(Life.CHART, compared=Compare.PRESENCE, later=operator.sub)
    )
    reached: dict[str, dict[str, list[str]]] = field(
        default_factory=dict, metadata=kept(Life.OWNER, FieldKind.BY_KEY, TIMED, Compare.NOTHING)
    )
    code: str = field(default="", metadata=kept(Life.MISSION, compared=Compare.NOTHING))
    detail: str = field(default="", metadata=kept(Life.MISSION, compared=Compare.NOTHING))
    codes: int = field(default=0, metadata=kept(Life.CHART, compared=Compare.NOTHING))
    sequence: int = field(default=0, metadata=kept(Life.CHART, compared=Compare.NOTHING))
    next_id: int = field(default=0, metadata=kept(Life.CHART, compared=Compare.NOTHING))
    dropped: int = field(default=0, metadata=kept(Life.CHART, compared=Compare.NOTHING))

    @classmethod
    def schema(cls) -> tuple[MemoryField, ...]:
        """Return how its fields are kept."""
        kind: type = cls
        return fields_of(kind)

    def begin_mission(self, chart: Chart) -> None:
        """Reset the fields of a mission; values of its inputs stay (see `Inputs`)."""
        kind: type = type(self)
        cleared, others = _of_missions(kind)
        for found in cleared(self):
            found.clear()
        for name, value in others:
            setattr(self, name, value)
        self.drop(_entries_of_missions(kind, chart))

    def begin_part(self, part: State) -> list[str]:
        """Reset the states and variables of an embedded mission; return these states."""
        kind: type = type(self)
        states: list[str] = []
        for field_name, owner in _of_parts(kind):
            entries = getattr(self, field_name)
            names = owner.in_part(entries, part)
            for name in names:
                entries.pop(name)
            states += names if owner.of_states else []
        return states

    def drop(self, entries: Iterable[tuple[str, Iterable[str]]]) -> None:
        """Take entries out, each by its field and its name, as far as they are there."""
        for field_name, names in entries:
            found = getattr(self, field_name)
            for name in names:
                if name in found:
                    del found[name]

    def go_on(self, before: Chart, chart: Chart) -> None:
        """Drop the entries that another chart does not take over (see `Owner.goes_on`)."""
        for one in self.schema():
            if one.owner is None or one.owner.goes_on is GoesOn.ALL:
                continue
            found, names = getattr(self, one.name), one.owner.known(before, chart)
            if isinstance(found, dict):
                setattr(self, one.name, {name: value for name, value in found.items() if name in names})
            elif isinstance(found, list):
                found[:] = [name for name in found if name in names]
            elif found not in names:
                setattr(self, one.name, one.empty())

    def fresh_id(self) -> int:
        """Return a number that no attempt, invocation or timer had before."""
        self.next_id += 1
        return self.next_id

    @property
    def claims(self) -> list[ResourceClaim]:
        """The claims of all attempts, in the order in which they were made."""
        return [claim for claim in map(claim_of, self.attempts.values()) if claim is not None]

    def is_any_engaged(self, holds: Iterable[str]) -> bool:
        """Say whether one of some holds is engaged."""
        return any(hold in self.held for hold in holds)

    def is_any_beside(self, holds: Container[str]) -> bool:
        """Say whether a hold is engaged that is not among some."""
        return any(hold not in holds for hold in self.held)

    def engaged_beside(self, holds: Container[str]) -> list[str]:
        """Return the engaged holds that are not among some."""
        return [hold for hold in self.held if hold not in holds]

    def release(self, holds: Iterable[str]) -> list[str]:
        """Release some holds, of which any may be engaged; return those that were."""
        released = [hold for hold in self.held if hold in holds]
        for hold in released:
            self.held.remove(hold)
        return released

    @property
    def traversal(self) -> Traversal | None:
        """The itinerary entered last in this mission; None before the first."""
        return self.itineraries.get(self.current_itinerary)

    @property
    def target(self) -> str:
        """The target that is processed, for displays; "" unless the state of its itinerary is active."""
        traversal = self.traversal
        if traversal is None or traversal.state not in self.configuration:
            # The one that was entered last is over; one around it may go on.
            walks = self.itineraries.values()
            traversal = next((walk for walk in walks if walk.state in self.configuration), None)
        visit = traversal.visit if traversal is not None else None
        return "" if visit is None else visit.target

    @property
    def outcomes(self) -> tuple[Visit, ...]:
        """The visits of all itineraries of this mission, one itinerary after the other.

        An itinerary that is not begun adds only targets that no other has.
        """
        begun = [visit for walk in self.itineraries.values() if walk.begun for visit in walk.outcomes]
        return (*begun, *self.ahead)

    @property
    def ahead(self) -> list[Visit]:
        """The visits that follow from the request, of itineraries not begun yet: those that no other has."""
        walks = self.itineraries.values()
        known = {visit.target for walk in walks if walk.begun for visit in walk.visits}
        found: list[Visit] = []
        for walk in walks:
            if not walk.begun:
                found += [visit for visit in walk.visits if visit.target not in known]
                known.update(visit.target for visit in walk.visits)
        return found

    @property
    def total(self) -> int:
        """How many targets all itineraries of this mission have, with those before they were restarted."""
        begun = [walk for walk in self.itineraries.values() if walk.begun]
        return sum(walk.before + len(walk.items) for walk in begun) + len(self.ahead)


@cache
def _of_missions(kind: type) -> tuple[operator.attrgetter[Any], list[tuple[str, Any]]]:
    """Return a getter of the collections that begin with a mission, and other such fields' initial values."""
    lives = (Life.MISSION, Life.USE)
    empty = [(one.name, one.empty()) for one in fields_of(kind) if one.life in lives]
    cleared = [name for name, value in empty if isinstance(value, (dict, list))]
    return operator.attrgetter(*cleared), [(name, value) for name, value in empty if name not in cleared]


@lru_cache(maxsize=32)
def _entries_of_missions(kind: type, chart: Chart) -> list[tuple[str, list[str]]]:
    """Return the entries of other fields that begin with a mission."""
    owned = ((one.name, one.owner) for one in fields_of(kind) if one.life is Life.OWNER and one.owner)
    found = [(name, list(owner.of_mission(chart))) for name, owner in owned]
    return [(name, names) for name, names in found if names]


@cache
def _of_parts(kind: type) -> list[tuple[str, Owner]]:
    """Return the fields with entries that a part may reset when it begins."""
    lives = (Life.USE, Life.OWNER)
    return [(one.name, one.owner) for one in fields_of(kind) if one.life in lives and one.owner is not None]
