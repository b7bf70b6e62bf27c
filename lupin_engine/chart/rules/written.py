"""All actions and expressions of a chart, each with its path for findings."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, NamedTuple

from lupin_engine.chart.expressions.evaluation import Constant, Expression
from lupin_engine.chart.model import ActionCall, Chart, State, TemporalProperty
from lupin_engine.chart.records import COMPUTED, Role, walk


class Read(NamedTuple):
    """An expression of the chart: whether it is a condition (else a value), and its path.

    There are many and most are in order, so the path is built on demand.
    """

    expression: Expression
    condition: bool
    mission: str
    words: tuple[str, ...]

    @property
    def path(self) -> str:
        """The path of the expression, for findings."""
        return ".".join(word for word in self.words if word)


class WrittenAction(NamedTuple):
    """An action of the chart, its state and the name of its list."""

    action: ActionCall
    state: State
    words: tuple[str, ...]

    @property
    def path(self) -> str:
        """The list that the action stands in."""
        return ".".join(word for word in self.words if word)


class Saying(NamedTuple):
    """An expression, a code or a list of actions of a chart, with its mission and (within states) its state.

    In place of a mission that is used as a part stands the state that uses it.
    """

    mission: str
    state: State | None
    words: tuple[str, ...]
    role: Role
    value: Any


_ROLES = COMPUTED | {Role.ACTIONS, Role.CODE}


def sayings_of(chart: Chart) -> list[Saying]:
    """Return all actions, expressions and codes of a chart, walked once."""
    found, readers = list[Saying](), dict[str, str]()
    for state in chart.states.values():
        above = chart.states.get(state.parent or "")
        uses = above is not None and above.use is not None
        readers[state.name] = reader = (
            state.parent if uses else readers.get(state.parent or "")
        ) or state.mission
        found += [Saying(reader, state, *said) for said in walk(state, _ROLES, (state.name,))]
    for mission in chart.missions.values():
        found += [Saying(mission.name, None, *said) for said in walk(mission, _ROLES)]
    for word in ("holds", "invariants", "properties", "inputs", "context"):
        for name, thing in getattr(chart, word).items():
            reader = thing.mission if isinstance(thing, TemporalProperty) else ""
            found += [Saying(reader, None, *said) for said in walk(thing, _ROLES, (word, name))]
    return found


def calls_of(sayings: Iterable[Saying]) -> list[WrittenAction]:
    """Return every action."""
    return [
        WrittenAction(action, said.state, said.words)
        for said in sayings
        if said.role is Role.ACTIONS and said.state is not None
        for action in said.value
    ]


def codes_of(sayings: Iterable[Saying]) -> set[str]:
    """Return every code that is written under a key for codes; those among arguments are not there."""
    codes = [said.value for said in sayings if said.role is Role.CODE]
    return {code for found in codes for code in ((found,) if isinstance(found, str) else found)}


def reads_of(sayings: Iterable[Saying]) -> list[Read]:
    """Return every expression."""
    return [
        Read(said.value, said.role is Role.CONDITION, said.mission, said.words)
        for said in sayings
        if said.role in COMPUTED and not isinstance(said.value, Constant)
    ]


class Texts:
    """All expressions of a chart as text, by mission: a slow search, for names that no index has."""

    def __init__(self, found: Iterable[tuple[str, str]]) -> None:
        by_mission: dict[str, list[str]] = {}
        for mission, text in found:
            by_mission.setdefault(mission, []).append(text)
        self._by_mission = {mission: "\n".join(texts) for mission, texts in by_mission.items()}

    def names(self, name: str, mission: str | None = None) -> bool:
        """Say whether a name is read, anywhere or within one mission."""
        word = re.compile(rf"(?<![\w.'\"]){re.escape(name)}(?![\w'\"])")
        return any(name in text and word.search(text) for text in self._of(mission))

    def quotes(self, text: str) -> bool:
        """Say whether a text occurs as a literal in an expression."""
        return any(f"'{text}'" in found or f'"{text}"' in found for found in self._of(None))

    def _of(self, mission: str | None) -> Iterable[str]:
        return self._by_mission.values() if mission is None else [self._by_mission.get(mission, "")]
