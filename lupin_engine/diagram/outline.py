"""Selects the content of a chart's picture: which states, arrows and lines of text are drawn.

A state that wraps a single mission is left out: it would be a box within a box. Refusals are too: they lead
nowhere. A transition between a box and one within it, between two regions, or without a target makes no good
arrow, and becomes a line of text in its source's box. Everything keeps the order of the file, so a picture
changes only where the chart does.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from itertools import accumulate

from lupin_engine.chart.model import Chart, Kind, State, Transition
from lupin_engine.diagram.descriptions import ElementTexts, hold_line
from lupin_engine.diagram.picture import Arrow, Label, LineRole, Picture, StateBox, TextLine, Tone
from lupin_engine.errors import UsageError, nearest

#: Boxes in a picture that one still reads without a finger on it.
READABLE = 40


def outline(
    chart: Chart,
    *,
    focus: str | None = None,
    depth: int | None = None,
    folded: Collection[str] = (),
    whole: bool = False,
) -> Picture:
    """Return the picture of `chart`.

    Args:
        chart: The chart.
        focus: Show this state with its inside, and greyed neighbours that lead there or follow.
        depth: Show so many levels of boxes; deeper states are collapsed.
        folded: Full names of states that are collapsed as well.
        whole: Show the state that wraps a single mission, too.

    Raises:
        UsageError: there is no such state, or several have this name.
    """
    centre = None if focus is None else find_state(chart, focus)
    return _Outliner(chart, centre, depth, folded, whole).picture()


def readable_depth(picture: Picture) -> int | None:
    """Return the greatest depth with at most `READABLE` boxes, 1 at least; None for all levels."""
    totals = list(accumulate(_levels(picture.boxes)))
    if not totals or totals[-1] <= READABLE:
        return None
    return max(1, sum(total <= READABLE for total in totals))


def find_state(chart: Chart, name: str) -> str:
    """Return the full name of a state, given in full or by the last parts of its name.

    Raises:
        UsageError: there is none, or there are several.
    """
    names = [full for full in chart.states if full]
    found = [full for full in names if full == name] or [n for n in names if n.endswith(f".{name}")]
    if len(found) == 1:
        return found[0]
    if found:
        raise UsageError(f"{len(found)} states are called {name!r}; say which: {', '.join(found)}")
    known = {full.rpartition(".")[2] for full in names}
    raise UsageError(f"no state {name!r} in {_title(chart)}; {nearest(name, known)}")


def _title(chart: Chart) -> str:
    return ", ".join(chart.missions) or chart.name


def _levels(boxes: Iterable[StateBox]) -> Iterator[int]:
    row = list(boxes)
    while row:
        yield len(row)
        row = [child for box in row for child in box.children]


class _Outliner:
    def __init__(
        self, chart: Chart, focus: str | None, depth: int | None, folded: Collection[str], whole: bool
    ) -> None:
        self._chart = chart
        self._states = chart.states
        self._words = ElementTexts(chart)
        only = next(iter(chart.missions.values())).state if len(chart.missions) == 1 else ""
        self._wrapper = "" if whole or only == focus else only
        self._focus = focus
        self._depth = depth
        self._folded = folded
        #: State -> the box that stands for it in this picture.
        self._shown: dict[str, str] = {}

    def picture(self) -> Picture:
        root = self._states[""]
        tops = self._children(root) if self._focus is None else self._around(self._focus)
        boxes = tuple(self._box(self._states[name], 1) for name in tops)
        arrows = tuple(self._arrows())
        title = _title(self._chart)
        if self._focus is not None:
            return Picture(
                f"{title}: {self._states[self._focus].local_name}", boxes, None, arrows, self._chart
            )
        notes = (*self._ways(root), *map(hold_line, self._chart.holds.values()))
        return Picture(title, boxes, self._initial(root), arrows, self._chart, notes)

    # -- boxes ------------------------------------------------------------------------------------------

    def _children(self, state: State) -> list[str]:
        found: list[str] = []
        for name in state.children:
            found += self._states[name].children if name == self._wrapper else [name]
        return found

    def _box(self, state: State, level: int) -> StateBox:
        self._shown[state.name] = state.name
        pale = self._focus is not None and not self._inside(state.name)
        collapsed = pale or level == self._depth or state.name in self._folded
        children = self._children(state)
        return StateBox(
            state.name,
            self._title_of(state),
            state,
            () if pale else tuple(self._lines(state, collapsed)),
            () if collapsed else tuple(self._box(self._states[name], level + 1) for name in children),
            None if collapsed else self._initial(state),
            self._hide(state, state.name) if collapsed else 0,
            Tone.PALE if pale else Tone.PLAIN,
        )

    def _title_of(self, state: State) -> str:
        if state.kind is Kind.HISTORY:
            return "H*" if state.depth is None else "H"
        return f"{state.local_name}: {_title(self._chart)}" if self._wraps(state) else state.local_name

    def _wraps(self, state: State) -> bool:
        return bool(self._wrapper) and self._states[self._wrapper].parent == state.name

    def _hide(self, state: State, under: str) -> int:
        """Collapse a state to one box; return the number of states inside, histories aside."""
        count = 0
        for name in self._children(state):
            self._shown.setdefault(name, under)
            count += (self._states[name].kind is not Kind.HISTORY) + self._hide(self._states[name], under)
        return count

    def _initial(self, state: State) -> str | None:
        """Return the child that is drawn as the initial one; None in a state that is not compound."""
        if state.kind is not Kind.COMPOUND:
            return None
        first = state.initial or next(iter(state.children), None)
        return self._initial(self._states[first]) if first and first == self._wrapper else first

    def _lines(self, state: State, collapsed: bool) -> Iterator[TextLine]:
        for each in (state, self._states[self._wrapper]) if self._wraps(state) else (state,):
            yield from self._words.lines(each)
            within = f"{state.name}."
            yield from (way for way in self._ways(each) if not (collapsed and way.target.startswith(within)))

    def _ways(self, state: State) -> Iterator[TextLine]:
        """Yield the transitions of a state that have no arrow."""
        for rule in (*state.transitions, *state.resume_at):
            target = rule.target
            if rule.derived:
                continue
            if target is None and rule.actions:
                yield TextLine("", LineRole.WAY, self._words.label(rule))
            elif target is not None and not self._has_arrow(self._end(rule.source), self._end(target)):
                yield TextLine("", LineRole.WAY, self._words.label(rule), target)

    # -- a state and what is around it ------------------------------------------------------------------

    def _inside(self, name: str) -> bool:
        return name == self._focus or name.startswith(f"{self._focus}.")

    def _around(self, focus: str) -> list[str]:
        """Return the state in focus and its neighbours, in the order of the file."""
        met = {focus}
        for source, target, _ in self._pairs():
            if self._inside(source) != self._inside(target):
                met.add(target if self._inside(source) else source)
        return [name for name in self._states if name in met]

    # -- arrows -----------------------------------------------------------------------------------------

    def _pairs(self) -> Iterator[tuple[str, str, Transition | None]]:
        """Yield source, target and transition; a history leads to its default, with None as its transition.

        Transitions without a target are left out.
        """
        for state in self._states.values():
            if state.kind is Kind.HISTORY and state.initial is not None:
                yield state.name, state.initial, None
            for rule in state.transitions:
                if rule.target is not None and not rule.derived:
                    yield self._end(rule.source), self._end(rule.target), rule

    def _arrows(self) -> Iterator[Arrow]:
        found: dict[tuple[str, str], dict[str, Label]] = {}
        for source, target, rule in self._pairs():
            ends = self._ends(source, target)
            if ends is not None:
                labels = found.setdefault(ends, {})
                if rule is not None:
                    _add(labels, self._words.label(rule))
        for (source, target), labels in found.items():
            yield Arrow(source, target, tuple(labels.values()))

    def _ends(self, source: str, target: str) -> tuple[str, str] | None:
        """Return the boxes that the arrow of a transition connects; None when the picture has none."""
        begins, ends = self._shown.get(source), self._shown.get(target)
        if begins is None or ends is None or not self._has_arrow(begins, ends):
            return None
        if self._focus is not None and not (self._inside(source) or self._inside(target)):
            return None
        return None if begins == ends and (source, target) != (begins, ends) else (begins, ends)

    def _has_arrow(self, source: str, target: str) -> bool:
        """Say whether a transition is an arrow, and not a line of text."""
        if source == target:
            return not self._states[source].children
        above, over = self._chart.lineage[source][1:], self._chart.lineage[target][1:]
        if source in over or target in above:
            return False
        common = next(name for name in above if name in over)
        return self._states[common].kind is not Kind.PARALLEL

    def _end(self, name: str) -> str:
        """Return the state at the end of an arrow; the state that wraps a mission has no box."""
        return (self._states[name].parent or "") if self._wrapper and name == self._wrapper else name


def _add(labels: dict[str, Label], label: Label) -> None:
    """Add a label; equal labels are written once."""
    before = labels.get(str(label))
    ids = label.ids | before.ids if before else label.ids
    labels[str(label)] = Label(label.event, label.cause, label.guard, label.actions, ids)
