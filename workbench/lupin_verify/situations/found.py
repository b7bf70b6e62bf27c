"""The results of an exploration: cached effects of moves, breaches of properties, and the explored graph."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from lupin_verify.situations.worlds import Deadlines, TimerName, WorldMoves

#: The reason of an exploration that was stopped by Ctrl-C.
INTERRUPTED = "interrupted"


@dataclass(slots=True)
class Effect:
    """The cached change of a step: `delta` has the changed slots with their new values.

    `does` is from `Does`. `fresh` are the deadlines that it sets, `deadlines` those after it (None: as
    before), `renamed` the attempts that get another name. A `cut` one leads beyond the bounds. `needs` is the
    read set (see `TrackedMemory.reads`), `sets` the slots that it writes without reading. A pair in `lazy` is
    a variable that it sets and the input that only this variable is computed from; the input counts as read
    only where the variable is live.
    """

    delta: tuple[tuple[int, int], ...] = ()
    breaches: tuple[tuple[str, str], ...] = ()
    relevant: frozenset[str] = frozenset()
    taken: tuple[str, ...] = ()
    entered: tuple[str, ...] = ()
    does: int = 0
    fresh: frozenset[TimerName] = frozenset()
    deadlines: Deadlines | None = None
    renamed: tuple[tuple[str, str], ...] = ()
    cut: bool = False
    needs: frozenset[int] = frozenset()
    sets: frozenset[int] = frozenset()
    lazy: tuple[tuple[int, int], ...] = ()

    @property
    def whole(self) -> Effect:
        """The same with lazy reads in the read set."""
        return replace(self, needs=self.needs.union(slot for _, slot in self.lazy), lazy=())


class Breach(NamedTuple):
    """A breach of a property: its situation and move, how it breaks, and its depth in moves."""

    name: str
    situation: int
    move: int
    text: str
    depth: int = 0


@dataclass
class ExplorationProgress:
    """The progress of an exploration: `depth` in moves, `steps` that the machine made (others were cached).

    `levels` has the number of situations at each depth; the last one may not be complete. A walk that only
    `learns` what is live has other situations than the exploration.
    """

    situations: int = 0
    transitions: int = 0
    steps: int = 0
    depth: int = 0
    expanded: int = 0
    waiting: int = 0
    levels: list[int] = field(default_factory=list)
    learns: bool = False

    @property
    def estimate(self) -> int | None:
        """A rough estimate of the number of situations; None while levels still grow, or it learns.

        Levels grow and then shrink, faster and faster: each ratio to the level before is extrapolated as the
        ratio before times its last change. An estimate above three times the known number is None, too.
        """
        whole = self.levels[: self.depth + 1]
        if self.learns or len(whole) < 3 or not whole[-3] > whole[-2] > whole[-1]:
            return None
        shrinks = whole[-1] / whole[-2]
        faster = min(1.0, shrinks / (whole[-2] / whole[-3]))
        follows, found = float(whole[-1]), float(sum(whole))
        while follows >= 1.0:
            shrinks *= faster
            follows *= shrinks
            found += follows
            if found > 3 * sum(whole):
                return None
        return round(found)


@dataclass
class Explored:
    """The explored graph of situations by number.

    `sources`, `targets` and `by` (moves) are the transitions that change something, are deadlines, or do
    something (`does`); `sets` are the deadlines that they set, as indices of `deadlines`. `flags` of a
    situation are from `Is`, `timers` is the number of the deadlines that run in it; `parents` and
    `parent_moves` lead back to the initial situation. `breaches` are those of each property after the fewest
    moves. `relevant` counts the steps that properties are about, `cut` the moves beyond the bounds. An
    exploration that is not `complete` was `stopped` for a reason.
    """

    moves: WorldMoves
    progress: ExplorationProgress = field(default_factory=ExplorationProgress)
    sources: array[int] = field(default_factory=lambda: array("I"))
    targets: array[int] = field(default_factory=lambda: array("I"))
    by: array[int] = field(default_factory=lambda: array("H"))
    sets: array[int] = field(default_factory=lambda: array("H"))
    deadlines: list[frozenset[TimerName]] = field(default_factory=list)
    does: bytearray = field(default_factory=bytearray)
    timers: array[int] = field(default_factory=lambda: array("H"))
    flags: bytearray = field(default_factory=bytearray)
    parents: array[int] = field(default_factory=lambda: array("I"))
    parent_moves: array[int] = field(default_factory=lambda: array("i"))
    cut: int = 0
    breaches: dict[str, list[Breach]] = field(default_factory=dict)
    relevant: dict[str, int] = field(default_factory=dict)
    taken: set[str] = field(default_factory=set)
    entered: set[str] = field(default_factory=set)
    complete: bool = False
    stopped: str = ""

    def add_coverage(self, effect: Effect) -> None:
        """Add the transitions, states and properties that an effect covers."""
        self.taken.update(effect.taken)
        self.entered.update(effect.entered)
        for name in effect.relevant:
            self.relevant[name] = self.relevant.get(name, 0) + 1


class Does:
    """Flags of a transition."""

    ADVANCES = 1  #: an outcome of a target or a report of the mission is published
    MOVES = 2  #: an action that moves the robot is carried out
    ANSWERS = 4  #: an answer leads to a transition of the chart


class Is:
    """Flags of a situation."""

    OVER = 1  #: ready or done: a mission could begin
    REPORTED = 2  #: an operator can see that it waits: held, paused, asked, over, or in a fault
    MOVES = 4  #: an operation that moves is under way
    MISSION = 8  #: a mission is under way
    WORKS = 16  #: in a state of the mission's own; nobody has stopped or asked anything, no divert waits
    AWAY = 32  #: a mission waits for a person in a state of the lifecycle
    ENDLESS = 64  #: in an itinerary whose sweeps have no end
