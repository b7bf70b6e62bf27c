"""A diagram independent of any format: nested boxes for states, and arrows for transitions."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from dataclasses import dataclass, field

from lupin_engine.chart.model import Chart, Kind, State


class TransitionCause(enum.Enum):
    """The kind of event that triggers a transition; arrows are coloured by it."""

    DONE = "done"
    ERROR = "error"
    OPERATOR = "operator"
    TIME = "time"
    ALWAYS = "always"
    EVENT = "event"


class Tone(enum.Enum):
    """The emphasis of an element: a greyed neighbour, visited by a run, or never visited."""

    PLAIN = "plain"
    PALE = "pale"
    VISITED = "visited"
    NEVER = "never"


class LineRole(enum.Enum):
    """The kind of a line of text in a box."""

    WORK = "work"
    NOTE = "note"
    ACTION = "action"
    WAY = "way"


@dataclass(frozen=True)
class Label:
    """The label of a transition: `event [guard] / actions`. `ids` are the transitions that it stands for."""

    event: str
    cause: TransitionCause
    guard: str = ""
    actions: str = ""
    ids: frozenset[str] = frozenset()
    count: int | None = None

    @property
    def parts(self) -> tuple[str, ...]:
        """The parts of the text, between which a line may be broken."""
        found = (self.event, self.guard, self.actions and f"/ {self.actions}", times(self.count))
        return tuple(part for part in found if part)

    def __str__(self) -> str:
        return " ".join(self.parts)


@dataclass(frozen=True)
class TextLine:
    """A line of text in a box. A transition without an arrow has a label; `target` is its full target."""

    text: str
    role: LineRole
    label: Label | None = None
    target: str = ""

    def __str__(self) -> str:
        if self.label is None:
            return self.text
        return f"{self.label} → {self.target.rpartition('.')[2]}" if self.target else str(self.label)


@dataclass(frozen=True)
class StateBox:
    """A state. `lines` stand under its name; `initial` names the child that is entered first, in full.

    `hidden` is how many states a collapsed box does not show; `count` how often a run entered it.
    """

    name: str
    title: str
    state: State
    lines: tuple[TextLine, ...] = ()
    children: tuple[StateBox, ...] = ()
    initial: str | None = None
    hidden: int = 0
    tone: Tone = Tone.PLAIN
    count: int | None = None

    @property
    def kind(self) -> Kind:
        """The kind of the state."""
        return self.state.kind

    @property
    def phase(self) -> str:
        """The phase that the state reports, where it is not called so itself."""
        return self.state.phase if self.state.phase and self.state.phase != self.state.local_name else ""

    @property
    def more(self) -> str:
        """The mark of a collapsed box."""
        return f"… {self.hidden} state{'s' if self.hidden > 1 else ''}" if self.hidden else ""

    @property
    def text(self) -> tuple[str, ...]:
        """The lines under the name, for text-only formats."""
        phase = f"phase {self.phase}" if self.phase else ""
        paused = "paused" if self.state.paused else ""
        found = (phase, paused, *map(str, self.lines), self.more, times(self.count))
        return tuple(line for line in found if line)

    def below(self) -> Iterator[StateBox]:
        """Yield this box and all within it, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.below()


@dataclass(frozen=True)
class Arrow:
    """All transitions from one box to another, each with its label; without labels: a history's default."""

    source: str
    target: str
    labels: tuple[Label, ...]
    tone: Tone = Tone.PLAIN

    @property
    def cause(self) -> TransitionCause | None:
        """The cause that all of its transitions share; None when they differ."""
        causes = {label.cause for label in self.labels}
        return next(iter(causes)) if len(causes) == 1 else None


@dataclass(frozen=True)
class Picture:
    """Top-level boxes, the initial one, arrows, and notes about the whole.

    `run` is the origin of a coloured picture's counts; '' for a plain one.
    """

    title: str
    boxes: tuple[StateBox, ...]
    initial: str | None
    arrows: tuple[Arrow, ...]
    chart: Chart = field(repr=False)
    notes: tuple[TextLine, ...] = ()
    run: str = ""

    def every(self) -> Iterator[StateBox]:
        """Yield all boxes, in the order of the file."""
        for top in self.boxes:
            yield from top.below()


def times(count: int | None) -> str:
    """Return a count as text; '' for none."""
    return f"\u00d7{count}" if count else ""
