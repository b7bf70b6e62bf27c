"""Coverage of a chart: the states entered and transitions taken, and those that never were."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

from lupin_engine.chart import Chart, Constant, Kind, State, Transition, Value
from lupin_engine.errors import Place


@dataclass(frozen=True)
class Unreached:
    """A state that is never entered, or a transition that is never taken, with its name in the chart."""

    place: Place
    path: str
    text: str
    is_state: bool

    @property
    def says(self) -> str:
        """The verb: never entered, or never taken."""
        return "never entered" if self.is_state else "never taken"

    def sentence(self, place: str) -> str:
        """Return a sentence with the given text for the place."""
        return f"{self.says}: {place}, {self.text}"


@dataclass(frozen=True)
class Reached:
    """How many transitions were taken and states entered, and how many there are; refusals do not count."""

    taken: int
    transitions: int
    entered: int
    states: int

    def __str__(self) -> str:
        return (
            f"{self.taken} of {self.transitions} transitions taken,"
            f" {self.entered} of {self.states} states entered"
        )


def reached(chart: Chart, taken: Collection[str], entered: Collection[str]) -> Reached:
    """Return how much of a chart was reached."""
    states = [state.name for state in _states(chart)]
    rules = [rule.id for state in chart.states.values() for rule in _rules(state)]
    counted = sum(rule in taken for rule in rules)
    return Reached(counted, len(rules), sum(name in entered for name in states), len(states))


def unreached(chart: Chart, taken: Collection[str], entered: Collection[str]) -> tuple[Unreached, ...]:
    """Return the states that were never entered, and the transitions of the others that were never taken."""
    found = [
        Unreached(state.place, state.name, f"state {state.local_name}", is_state=True)
        for state in _states(chart)
        if state.name not in entered
    ]
    for state in chart.states.values():
        if state.name in entered or not state.name:
            rules = [rule for rule in _rules(state) if rule.id not in taken]
            found += [Unreached(rule.place, rule.id, _way(state, rule), is_state=False) for rule in rules]
    return tuple(found)


def _states(chart: Chart) -> Iterator[State]:
    """Yield the states that can be entered."""
    return (state for state in chart.states.values() if state.name and state.kind is not Kind.HISTORY)


def _rules(state: State) -> Iterator[Transition]:
    """Yield the transitions that can be taken."""
    return (rule for rule in state.transitions if rule.refuse is None)


def _way(state: State, rule: Transition) -> str:
    """Return a transition in words: where it begins, on which event, and where it leads."""
    timer = next((timer for timer in state.timers if timer.event == rule.event), None)
    event = rule.event or "always"
    if timer is not None:
        event = f"{timer.word} {_due(timer.due)}"
    to = f" → {rule.target.rpartition('.')[2]}" if rule.target else ""
    return f"{state.local_name} {event}{to}".strip()


def _due(value: Value) -> str:
    """Return a time as its author wrote it."""
    if isinstance(value, Constant):
        return f"{value.value:g} s" if isinstance(value.value, (int, float)) else str(value.value)
    return value.source
