"""What is found while all situations are looked at: effects of moves, breaches, and the graph."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from lupin_verify.situations.worlds import Deadlines, TimerName, WorldMoves


@dataclass(slots=True)
class Effect:
    """What a move does: the slots that change with what they are then, and what is told of it.

    What it `does` is from `Does`. `fresh` are the deadlines that it sets,
    `deadlines` those that there are after it (None: as before), `renamed` the attempts that get another
    name. One that is `cut` is beyond the bounds. The step has read what it `needs` (see
    `TrackedMemory.reads`); the slots that it `sets` it has written whatever they were. Of pairs that are
    `aside` the first is a variable that it sets, the second what nothing but that variable was made of; it
    counts as read only where the variable makes a difference.
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
    aside: tuple[tuple[int, int], ...] = ()

    @property
    def whole(self) -> Effect:
        """The same with all that the step has read."""
        return replace(self, needs=self.needs.union(slot for _, slot in self.aside), aside=())


class Breach(NamedTuple):
    """A property that is broken: in which situation by which move, how, and after how many moves."""

    name: str
    situation: int
    move: int
    text: str
    depth: int = 0


@dataclass
class ExplorationProgress:
    """How far an exploration is: `depth` in moves from the beginning, `steps` were made by the machine.

    `levels` are the situations that are so many moves away; the last one may not be complete.
    """

    situations: int = 0
    transitions: int = 0
    steps: int = 0
    depth: int = 0
    expanded: int = 0
    waiting: int = 0
    levels: list[int] = field(default_factory=list)

    @property
    def estimate(self) -> int | None:
        """About how many situations there are: None while levels still grow, which tells nothing.

        Levels grow and then shrink, faster and faster: each ratio to the level before is taken to be the one
        before times the last change of the ratio. What comes to more than three times what is known tells
        nothing either: at the widest level about half is known.
        """
        whole = self.levels[: self.depth + 1]
        if len(whole) < 3 or not whole[-3] > whole[-2] > whole[-1]:
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
    """What was found: the graph of situations by number, with what is known of each.

    `sources`, `targets` and `by` (moves) are the transitions that change something, are deadlines, or do
    something, which `does` says; `sets` are the deadlines that they set, as places in `deadlines`. `flags` of
    a situation are from `Is`, `timers` is the number of the deadlines that run in it; `parents` and
    `parent_moves` lead back to the beginning. `breaches` are those of each property after the fewest moves.
    `relevant` counts the steps that properties are about, `cut` what is beyond the bounds. One that is not
    `complete` was `stopped` for a reason.
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

    def take_in(self, effect: Effect) -> None:
        """Keep what an effect tells of the chart."""
        self.taken.update(effect.taken)
        self.entered.update(effect.entered)
        for name in effect.relevant:
            self.relevant[name] = self.relevant.get(name, 0) + 1


class Does:
    """What is known of a transition, as bits."""

    ADVANCES = 1  #: something is told of a target or of the mission
    MOVES = 2  #: an action that moves the robot is carried out
    ANSWERS = 4  #: an answer leads to a transition of the chart


class Is:
    """What is known of a situation, as bits."""

    OVER = 1  #: ready or done: a mission could begin
    TOLD = 2  #: somebody knows: held, paused, asked, over, or in a fault
    MOVES = 4  #: an operation that moves is under way
    MISSION = 8  #: a mission is under way
