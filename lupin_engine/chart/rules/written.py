"""All actions and expressions that stand in a chart, each with the path that it is told under."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from lupin_engine.chart.expressions.evaluation import Constant, Expression
from lupin_engine.chart.model import ActionCall, Chart, State
from lupin_engine.chart.records import Role, walk


class Read(NamedTuple):
    """An expression of the chart: whether it is a condition (else a value), and where it is told.

    There are many and most are in order, so the path is put together when it is asked for.
    """

    expression: Expression
    condition: bool
    mission: str
    words: tuple[str, ...]

    @property
    def path(self) -> str:
        """What the expression is for."""
        return ".".join(word for word in self.words if word)


class WrittenAction(NamedTuple):
    """An action of the chart, the state that it is written in and what its list is called."""

    action: ActionCall
    state: State
    words: tuple[str, ...]

    @property
    def path(self) -> str:
        """The list that the action stands in."""
        return ".".join(word for word in self.words if word)


_COMPUTED = frozenset({Role.VALUE, Role.CONDITION})
_ACTIONS = frozenset({Role.ACTIONS})
_CODES = frozenset({Role.CODE})


def calls_of(chart: Chart) -> list[WrittenAction]:
    """Return every action of a chart."""
    return [
        WrittenAction(action, state, found.words)
        for state in chart.states.values()
        for found in walk(state, _ACTIONS, (state.name,))
        for action in found.value
    ]


def codes_of(chart: Chart) -> set[str]:
    """Return every code that a chart names under a word of its own."""
    found: set[str] = set()
    for _, thing, words in _things(chart):
        for code in walk(thing, _CODES, words):
            found |= {code.value} if isinstance(code.value, str) else set(code.value)
    return found


def reads_of(chart: Chart) -> list[Read]:
    """Return every expression of a chart."""
    return [
        Read(found.value, found.role is Role.CONDITION, mission, found.words)
        for mission, thing, words in _things(chart)
        for found in walk(thing, _COMPUTED, words)
        if not isinstance(found.value, Constant)
    ]


def _things(chart: Chart) -> Iterator[tuple[str, Any, tuple[str, ...]]]:
    """Yield the records that a chart consists of, each with its mission and the words that lead to it."""
    for state in chart.states.values():
        yield state.mission, state, (state.name,)
    for mission in chart.missions.values():
        yield mission.name, mission, ()
    for word in ("holds", "invariants", "inputs", "context"):
        for name, thing in getattr(chart, word).items():
            yield "", thing, (word, name)


class Texts:
    """All expressions of a chart as text, by mission; asked when nothing quicker has found a name."""

    def __init__(self, found: Iterable[tuple[str, str]]) -> None:
        by_mission: dict[str, list[str]] = {}
        for mission, text in found:
            by_mission.setdefault(mission, []).append(text)
        self._by_mission = {mission: "\n".join(texts) for mission, texts in by_mission.items()}

    def names(self, name: str, mission: str | None = None) -> bool:
        """Tell whether a name is read, by anyone or within one mission."""
        word = re.compile(rf"(?<![\w.'\"]){re.escape(name)}(?![\w'\"])")
        return any(name in text and word.search(text) for text in self._of(mission))

    def quotes(self, text: str) -> bool:
        """Tell whether a text is written out in an expression."""
        return any(f"'{text}'" in found or f'"{text}"' in found for found in self._of(None))

    def _of(self, mission: str | None) -> Iterable[str]:
        return self._by_mission.values() if mission is None else [self._by_mission.get(mission, "")]
