"""Everything that a machine remembers between steps, as plain data that goes through JSON (`snapshot`)."""

from __future__ import annotations

import enum
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from lupin_engine.machine.event import Event


@dataclass(slots=True)
class Visit:
    """What became of one target. Closed exactly once; then nothing about it changes.

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
    """An itinerary under way: the items, one visit for each, and where we are.

    `sweep` counts from 1, `sweeps` is how many there will be (0: no end). `past` counts the visits of earlier
    sweeps by status, `earlier` is the newest of them for each target. With `leaves_open` nobody closes what
    was not visited. One that is not `begun` is known from the request alone. When its state is entered
    anew it is walked anew; `before` is how many targets it had until then.
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

    @property
    def item(self) -> Any:
        """The current target, or None when there is none."""
        return self.items[self.index] if self.index < len(self.items) else None

    @property
    def visit(self) -> Visit | None:
        """The current target's visit."""
        return self.visits[self.index] if self.index < len(self.visits) else None

    @property
    def outcomes(self) -> tuple[Visit, ...]:
        """What became of each target: its visit in this sweep, or while that is open the newest before it."""
        now = {visit.target for visit in self.visits}
        gone = [visit for target, visit in self.earlier.items() if target not in now]
        return (*gone, *[v if v.closed else self.earlier.get(v.target, v) for v in self.visits])

    @property
    def is_last_sweep(self) -> bool:
        """Whether no other sweep follows."""
        return 0 < self.sweeps <= self.sweep

    @property
    def remaining(self) -> int:
        """How many targets come after the current one; at the end of a sweep, those of the next one."""
        after = max(0, len(self.items) - self.index - 1)
        return after if after or self.is_last_sweep else len(self.items)

    def count(self, status: str) -> int:
        """How many visits were closed with `status`, over all sweeps."""
        return self.past.get(status, 0) + sum(1 for visit in self.visits if visit.status == status)


class Phase(str, enum.Enum):
    """The life of an attempt, as far as the engine must know it; `operations.LIFE` says what leads where."""

    WAITING = "waiting"  #: for the resource that an earlier attempt still uses
    REQUESTED = "requested"  #: the server was asked
    ACCEPTED = "accepted"  #: the server took it
    CANCELLING = "cancelling"  #: nobody wants it any more; the server may not know yet
    LOST = "lost"  #: the server did not confirm the cancel in time
    REFUSED = "refused"  #: the server refuses the cancel, which is repeated: it keeps what it uses to its end


@dataclass(slots=True)
class Attempt:
    """One request to a server. Only the current attempt of an invocation can speak.

    `answer` is its end, while that waits for the release of a hold. `detail` is its last progress, of one
    whose cancel is refused what that means.
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
    """What an attempt uses; one that `waits` has not begun yet, the cancel of one that is `refused` was."""

    attempt: str
    uses: tuple[str, ...]
    waits: bool
    refused: bool = False


def claim_of(attempt: Attempt) -> ResourceClaim | None:
    """Return the claim of an attempt, if it uses anything or waits."""
    waits = attempt.phase is Phase.WAITING
    refused = attempt.phase is Phase.REFUSED
    if attempt.phase is Phase.LOST or not (attempt.uses or waits or refused):
        return None
    return ResourceClaim(attempt.id, attempt.uses, waits, refused)


@dataclass(slots=True)
class CutShort:
    """What follows when an attempt that was cut short has ended, or does not say so in time.

    `way` is what `on_hold` says, or empty after a timeout.
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

    It is made when its state is entered. One that is not `begun`, which is also what a hold makes of it and
    what a back-off ends in, gets its next attempt when a step comes to rest. `event` is what led to the
    state, for arguments that read it, in every try. `item` is the element that a `for_each` started it for,
    `key` what that is called. With `cut` it waits for what its last attempt gives.
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
        """What it is kept under: its state, for an element of a `for_each` with the element's key."""
        return self.state if self.key is None else f"{self.state}[{self.key}]"


#: A deadline: when it is due, its number, its kind, and what it is about: the state, attempt, invocation or
#: input that it belongs to, with the event that it makes there (of an `at`, date and time of day follow).
#: `due` is a time of the caller's clock; of a frozen timer the time that is left. A plain tuple, because
#: thousands of them a second may be made.
Timer = tuple[float, int, str, tuple[str, str]]


class Reported(NamedTuple):
    """A live value, when it was true, and whether it was reported at all or is what the chart starts with."""

    value: Any
    stamp: float
    reported: bool = True


@dataclass(slots=True)
class Memory:
    """The whole state of a machine. `code` is the newest of the worst that were reported, with its detail,
    `codes` how many were reported.

    `given` is the request of each mission that is used as a part, by the state that uses it. `timers` are in
    the order in which they fire. `budgets` is the time that each state with a budget had left
    when it was last entered or left, `handled` the keys that each `for_each` has dealt with, both in this
    mission. `asked` are the open questions by their states. `levels` is by `input.NAME.LEVEL`. For
    inputs that are lists about the mission, `heard` is the last report as a whole, `before` that from before,
    as far as it is still reported just the same.
    `projected` is what the profile's projections have made of live values; no step reads it.
    `broken` names the invariants that do not hold. `wall` is how far the robot's clock, in POSIX time, is
    ahead of the caller's; nobody may have told. `reached` are the dates on which each state has dealt with
    each time of day of its `at`: those of a mission's states in this mission.
    What steps want to know of claims and holds has methods of its own, so that a proof knows what was asked.
    """

    configuration: tuple[str, ...] = ()
    history: dict[str, tuple[str, ...]] = field(default_factory=dict)
    context: dict[str, Any] = field(default_factory=dict)
    request: dict[str, Any] = field(default_factory=dict)
    given: dict[str, dict[str, Any]] = field(default_factory=dict)
    mission: str = ""
    mission_id: str = ""
    started_at: float | None = None
    itineraries: dict[str, Traversal] = field(default_factory=dict)
    current_itinerary: str = ""
    timers: list[Timer] = field(default_factory=list)
    frozen: list[Timer] = field(default_factory=list)
    budgets: dict[str, float] = field(default_factory=dict)
    invocations: dict[str, Invocation] = field(default_factory=dict)
    attempts: dict[str, Attempt] = field(default_factory=dict)
    handled: dict[str, list[str]] = field(default_factory=dict)
    asked: dict[str, str] = field(default_factory=dict)
    held: list[str] = field(default_factory=list)
    deferred: list[Event] = field(default_factory=list)
    waiting_actions: list[tuple[str, str, Mapping[str, Any]]] = field(default_factory=list)
    inputs: dict[str, Reported] = field(default_factory=dict)
    levels: dict[str, bool] = field(default_factory=dict)
    projected: dict[str, Any] = field(default_factory=dict)
    heard: dict[str, list[Any]] = field(default_factory=dict)
    before: dict[str, list[Any]] = field(default_factory=dict)
    broken: list[str] = field(default_factory=list)
    wall: float | None = None
    reached: dict[str, dict[str, list[str]]] = field(default_factory=dict)
    code: str = ""
    detail: str = ""
    codes: int = 0
    sequence: int = 0
    next_id: int = 0
    dropped: int = 0

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
        """The itinerary entered last in this mission."""
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
        """What became of the targets of all itineraries of this mission, one itinerary after the other.

        Of one that is not begun only those count that no other has.
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
        """How many targets all itineraries of this mission have, and had before they were begun anew."""
        begun = [walk for walk in self.itineraries.values() if walk.begun]
        return sum(walk.before + len(walk.items) for walk in begun) + len(self.ahead)
