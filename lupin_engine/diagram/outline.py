"""What a picture of a chart shows, before any drawing language: boxes within boxes, and labelled arrows.

The state that wraps a mission is left out where it is the only one: it would be a box within a box. Refusals
are left out as well: they are answers, not ways. A way between a box and one within it is a line of text in
the box where it begins, because drawing programs have no good answer to it. Everything comes in the order of
the file, so the text of a picture changes only where the chart does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from lupin_engine.chart.model import (
    Chart,
    Constant,
    ForEach,
    Invoke,
    Itinerary,
    Kind,
    State,
    Transition,
    UnknownInput,
    Value,
)

#: Longest guard on an arrow, in characters.
GUARD_WIDTH = 44


@dataclass(frozen=True)
class Box:
    """A state. `lines` stand under its name; `initial` names the child that is entered first, in full."""

    name: str
    title: str
    kind: Kind
    lines: tuple[str, ...]
    children: tuple[Box, ...] = ()
    initial: str | None = None

    def below(self) -> Iterator[Box]:
        """Yield this box and all within it, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.below()


@dataclass(frozen=True)
class Arrow:
    """All ways from one state to another, each with its label."""

    source: str
    target: str
    labels: tuple[str, ...]


@dataclass(frozen=True)
class Outline:
    """A picture: boxes at the top, the one that is entered first, arrows."""

    title: str
    boxes: tuple[Box, ...]
    initial: str | None
    arrows: tuple[Arrow, ...]


def outline(chart: Chart) -> Outline:
    """Return what a picture of `chart` shows."""
    return _Outliner(chart).outline()


class _Outliner:
    def __init__(self, chart: Chart) -> None:
        self._chart = chart
        self._defaults = {"param": {name: p.default for name, p in chart.parameters.items()}}
        only = next(iter(chart.missions.values()), None) if len(chart.missions) == 1 else None
        self._wrapper = only.state if only else ""
        self._title = ", ".join(chart.missions) or chart.name

    def outline(self) -> Outline:
        root = self._chart.states[""]
        boxes = tuple(self._box(self._chart.states[name]) for name in self._children(root))
        return Outline(self._title, boxes, self._initial(root), tuple(self._arrows()))

    # -- boxes ------------------------------------------------------------------------------------------

    def _children(self, state: State) -> list[str]:
        found: list[str] = []
        for name in state.children:
            inner = self._chart.states[name]
            found += inner.children if name == self._wrapper else [name]
        return found

    def _box(self, state: State) -> Box:
        children = tuple(self._box(self._chart.states[name]) for name in self._children(state))
        title = state.local_name
        if state.slot and self._wrapper:
            title = f"{title}: {self._title}"
        if state.kind is Kind.HISTORY:
            title = "H*" if state.depth is None else "H"
        return Box(state.name, title, state.kind, tuple(self._lines(state)), children, self._initial(state))

    def _initial(self, state: State) -> str | None:
        if state.kind is not Kind.COMPOUND:
            return None
        first = state.initial or next(iter(state.children), None)
        return self._initial(self._chart.states[first]) if first and first == self._wrapper else first

    def _lines(self, state: State) -> Iterator[str]:
        if state.phase and state.phase != state.local_name:
            yield f"phase {state.phase}"
        if state.paused:
            yield "paused"
        if state.itinerary is not None:
            yield from self._itinerary(state.itinerary)
        if state.for_each is not None:
            yield from self._for_each(state.for_each)
        if state.invoke is not None:
            yield from self._invoke(state.invoke)
        for word, actions in (("entry", state.entry), ("exit", state.exit)):
            if actions:
                yield f"{word} / {', '.join(action.name for action in actions)}"
        for rule in (*state.transitions, *state.resume_at):
            if rule.target is not None and self._nested(rule.source, rule.target):
                yield f"{self._label(rule)} → {self._chart.states[rule.target].local_name}"

    def _itinerary(self, itinerary: Itinerary) -> Iterator[str]:
        yield f"for each of {self._short(itinerary.items)}"
        if itinerary.order is not None:
            yield f"smallest {self._short(itinerary.order)} first"
        if itinerary.sweeps is not None:
            sweeps = self._short(itinerary.sweeps)
            yield f"sweeps: {'without end' if sweeps == '0' else sweeps}"

    def _for_each(self, found: ForEach) -> Iterator[str]:
        limit = f", {self._short(found.limit)} at a time" if found.limit else ""
        yield f"for each {found.name} of {self._short(found.items)}{limit}"
        if found.when is not None:
            yield f"[{_cut(found.when.source)}]"
        yield from self._invoke(found.invoke)
        for word, actions in (("done", found.on_done), ("error", found.on_error)):
            if actions:
                yield f"{word} / {', '.join(action.name for action in actions)}"

    def _invoke(self, invoke: Invoke) -> Iterator[str]:
        limit = f" ≤ {self._seconds(invoke.timeout)}" if invoke.timeout else ""
        yield f"{invoke.name}{limit}"
        if invoke.retry is not None:
            yield f"tries: {self._short(invoke.retry.attempts)}"

    # -- arrows -----------------------------------------------------------------------------------------

    def _arrows(self) -> Iterator[Arrow]:
        found: dict[tuple[str, str], list[str]] = {}
        for state in self._chart.states.values():
            for rule in state.transitions:
                if rule.target is not None and not self._nested(rule.source, rule.target):
                    ends = (self._shown(rule.source), self._shown(rule.target))
                    found.setdefault(ends, []).append(self._label(rule))
        for (source, target), labels in found.items():
            yield Arrow(source, target, tuple(dict.fromkeys(labels)))

    def _nested(self, source: str, target: str) -> bool:
        """Say whether one end of a way lies within the other, or both are the same composite state."""
        source, target = self._shown(source), self._shown(target)
        if source == target:
            return bool(self._chart.states[source].children)
        return source in self._chart.ancestors(target) or target in self._chart.ancestors(source)

    def _shown(self, name: str) -> str:
        """Return the box that stands for a state: the wrapper has none."""
        return (self._chart.states[name].parent or "") if name == self._wrapper else name

    def _label(self, rule: Transition) -> str:
        guard = f"[{_cut(rule.guard.source)}]" if rule.guard else ""
        event = "resume" if rule in self._chart.states[rule.source].resume_at else self._event(rule)
        return " ".join(filter(None, (event, guard))) or "always"

    def _event(self, rule: Transition) -> str:
        if rule.event.startswith("after."):
            timers = self._chart.states[rule.source].timers
            delay = next(timer.after for timer in timers if timer.event == rule.event)
            return f"after {self._seconds(delay)}"
        if rule.event == "budget":
            budget = self._chart.states[rule.source].budget
            return f"budget {self._seconds(budget.after)}" if budget else "budget"
        if rule.event.startswith("input."):
            return rule.event.removeprefix("input.").replace(".", " ")
        return rule.event.removeprefix("operator.").removeprefix("mission.")

    # -- values -----------------------------------------------------------------------------------------

    def _seconds(self, value: Value) -> str:
        """Return a duration as the parameters' defaults make it, else as it is written."""
        try:
            return f"{float(value.evaluate(self._defaults)):g} s"
        except (KeyError, TypeError, ValueError, ArithmeticError, UnknownInput):
            return self._short(value)

    def _short(self, value: Value) -> str:
        if isinstance(value, Constant):
            return _cut(str(value.value))
        try:
            found = value.evaluate(self._defaults)
        except (KeyError, TypeError, ValueError, ArithmeticError, UnknownInput):
            return _cut(value.source)
        return _cut(f"{found:g}" if isinstance(found, float) else str(found))


def _cut(text: str) -> str:
    plain = " ".join(text.split())
    return plain if len(plain) <= GUARD_WIDTH else plain[: GUARD_WIDTH - 1].rstrip() + "…"
