"""Everything that a machine remembers between steps, as plain data."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from lupin_engine.machine.event import Event


@dataclass
class Visit:
    """What became of one target. Closed exactly once; then nothing about it changes."""

    target: str
    status: str = ""
    code: str = ""
    detail: str = ""
    reading: Mapping[str, Any] | None = None

    @property
    def closed(self) -> bool:
        """Whether the visit has its outcome."""
        return bool(self.status)


@dataclass
class Walk:
    """An itinerary under way: the items, one visit for each, and where we are."""

    state: str
    items: list[Any]
    visits: list[Visit]
    index: int = 0

    @property
    def item(self) -> Any:
        """The current target, or None when there is none."""
        return self.items[self.index] if self.index < len(self.items) else None

    @property
    def visit(self) -> Visit | None:
        """The current target's visit."""
        return self.visits[self.index] if self.index < len(self.visits) else None

    @property
    def remaining(self) -> int:
        """How many targets come after the current one."""
        return max(0, len(self.items) - self.index - 1)

    def count(self, status: str) -> int:
        """How many visits were closed with `status`."""
        return sum(1 for visit in self.visits if visit.status == status)


class Phase(enum.Enum):
    """The life of an attempt, as far as the engine must know it."""

    WAITING = "waiting"  #: for the resource that an earlier attempt still uses
    REQUESTED = "requested"  #: the server was asked
    ACCEPTED = "accepted"  #: the server took it
    CANCELLING = "cancelling"  #: nobody wants it any more; the server may not know yet


@dataclass
class Attempt:
    """One request to a server. Only the current attempt of an invocation can speak."""

    id: str
    invocation: str
    operation: str
    arguments: Mapping[str, Any]
    uses: tuple[str, ...]
    phase: Phase
    detail: str = ""
    timeout: float | None = None


@dataclass
class Invocation:
    """One activation of a state's `invoke`: its tries, its current attempt, whether a hold suspended it."""

    id: str
    state: str
    tries: int = 0
    attempt: str | None = None
    suspended: bool = False


@dataclass
class Timer:
    """A deadline of the chart (frozen while held) or of the engine (`cancel`, never frozen).

    `kind` is after, timeout, retry or cancel; `owner` is the state, attempt or invocation it belongs to.
    While frozen, `due` is the time that is left.
    """

    token: int
    kind: str
    owner: str
    due: float
    event: str = ""
    frozen: bool = False


@dataclass
class Memory:
    """The whole state of a machine. `reason` is the code last reported, with its detail."""

    configuration: tuple[str, ...] = ()
    history: dict[str, tuple[str, ...]] = field(default_factory=dict)
    context: dict[str, Any] = field(default_factory=dict)
    request: dict[str, Any] = field(default_factory=dict)
    mission: str = ""
    mission_id: str = ""
    started_at: float | None = None
    walks: dict[str, Walk] = field(default_factory=dict)
    current_walk: str = ""
    timers: list[Timer] = field(default_factory=list)
    invocations: dict[str, Invocation] = field(default_factory=dict)
    attempts: dict[str, Attempt] = field(default_factory=dict)
    held: list[str] = field(default_factory=list)
    deferred: list[Event] = field(default_factory=list)
    waiting_actions: list[tuple[str, str, Mapping[str, Any]]] = field(default_factory=list)
    inputs: dict[str, tuple[Any, float]] = field(default_factory=dict)
    levels: dict[tuple[str, str], bool] = field(default_factory=dict)
    code: str = ""
    detail: str = ""
    sequence: int = 0
    next_id: int = 0
    dropped: int = 0

    def fresh_id(self) -> int:
        """Return a number that no attempt, invocation or timer had before."""
        self.next_id += 1
        return self.next_id

    @property
    def walk(self) -> Walk | None:
        """The itinerary entered last in this mission."""
        return self.walks.get(self.current_walk)
