"""Metadata of the memory's fields: lifetime, owner of the entries, and comparison in a proof.

Each field declares it once (`kept`). Reset with a mission or an embedded one, hot reload, validation of
snapshots, change of clock and equality of abstract states all follow from it: no other place lists fields.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, fields
from functools import cache
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

from lupin_engine.chart.model import Chart, Kind, State
from lupin_engine.chart.records import same_meaning
from lupin_engine.plugin.contract import OWN_HOLDS


class Life(enum.Enum):
    """How long a field is kept."""

    #: As long as the machine lives; its writers remove it themselves.
    CHART = enum.auto()
    #: Until the next mission begins.
    MISSION = enum.auto()
    #: As MISSION; entries of states in an embedded mission also end when that mission is entered.
    USE = enum.auto()
    #: Each entry as long as its owner: the chart, a mission or a part.
    OWNER = enum.auto()


class FieldKind(enum.Enum):
    """Of which pieces a field is made, each of which can be known without the others."""

    WHOLE = enum.auto()
    #: Entries in whatever order, under names of their `Owner`.
    BY_KEY = enum.auto()
    #: Entries in their order.
    ORDERED = enum.auto()
    #: Names of the `Owner`, each there or not.
    NAMES = enum.auto()


class Compare(enum.Enum):
    """Which part of a field, or of an entry, a proof compares."""

    #: The value; of what has a class of its own, what matters of that.
    VALUE = enum.auto()
    #: What it holds, in whatever order.
    UNORDERED = enum.auto()
    #: The names in it.
    NAMES = enum.auto()
    #: Whether there is one: it is a time.
    PRESENCE = enum.auto()
    #: Nothing: it begins anew in every step.
    NOTHING = enum.auto()


class GoesOn(enum.Enum):
    """Which entries another chart takes over at a reload."""

    #: Nothing.
    NONE = enum.auto()
    #: Those whose owner it has too.
    SAME = enum.auto()
    #: All, whatever they are called.
    ALL = enum.auto()


@dataclass(frozen=True, eq=False)
class Owner:
    """A kind of chart element that entries are named after; `word` names one in errors.

    Without a word a snapshot is not checked against the chart's names. Those `of_mission` begin anew with
    each mission, those `in_part` with the state that embeds one. `same` compares one between two charts.
    """

    word: str
    names: Callable[[Chart], Iterable[str]]
    of_states: bool = False
    goes_on: GoesOn = GoesOn.SAME
    of_mission: Callable[[Chart], Iterable[str]] = lambda _: ()
    same: Callable[[Chart, Chart, str], bool] = lambda _before, _chart, _name: True
    in_part: Callable[[Iterable[str], State], list[str]] = lambda _names, _part: []

    def known(self, before: Chart, chart: Chart) -> set[str]:
        """Return the names that another chart takes over: those that it has, and has the same."""
        if self.goes_on is GoesOn.NONE:
            return set()
        return {name for name in self.names(chart) if self.same(before, chart, name)}


def states_with(part: str, word: str, goes_on: GoesOn = GoesOn.SAME, **more: Any) -> Owner:
    """Return the states that have a part, as owners."""

    def names(chart: Chart) -> list[str]:
        return [name for name, state in chart.states.items() if getattr(state, part)]

    def of_mission(chart: Chart) -> list[str]:
        return [name for name in names(chart) if chart.states[name].mission]

    return Owner(word, names, True, goes_on, of_mission, in_part=_inside, **more)


def levels_of(chart: Chart, of_input: str = "") -> list[str]:
    """Return the names of the levels of all inputs, or of one."""
    specs = [chart.inputs[of_input]] if of_input else chart.inputs.values()
    return [f"input.{spec.name}.{level.name}" for spec in specs for level in spec.levels]


def _inside(names: Iterable[str], part: State) -> list[str]:
    return [name for name in names if name.startswith(f"{part.name}.")]


def _variables_of(names: Iterable[str], part: State) -> list[str]:
    return [name for name in part.use.variables if name in names] if part.use is not None else []


def _histories(chart: Chart) -> list[str]:
    return [name for name, state in chart.states.items() if state.kind is Kind.HISTORY]


def _variables_of_mission(chart: Chart) -> list[str]:
    return [name for name, variable in chart.context.items() if variable.of_mission]


def _asks_the_same(before: Chart, chart: Chart, name: str) -> bool:
    return name in before.states and same_meaning(before.states[name].ask, chart.states[name].ask)


def _is_same_variable(before: Chart, chart: Chart, name: str) -> bool:
    return name in before.context and before.context[name].type == chart.context[name].type


def _is_same_input(before: Chart, chart: Chart, name: str) -> bool:
    return name in before.inputs and before.inputs[name].value == chart.inputs[name].value


STATES = Owner("state", lambda chart: chart.states, True, GoesOn.ALL)
HISTORIES = Owner("state", _histories, True, GoesOn.NONE, in_part=_inside)
USES = states_with("use", "mission in state", GoesOn.NONE)
WALKS = states_with("itinerary", "itinerary in state")
BUDGETS = states_with("budget", "budget in state", GoesOn.NONE)
OPERATIONS = states_with("invoke", "operation in state")
COLLECTIONS = states_with("for_each", "for_each in state", GoesOn.NONE)
QUESTIONS = states_with("ask", "question in state", same=_asks_the_same)
TIMED = states_with("timers", "timer in state")
VARIABLES = Owner(
    "variable",
    lambda chart: chart.context,
    of_mission=_variables_of_mission,
    same=_is_same_variable,
    in_part=_variables_of,
)
REQUEST_FIELDS = Owner(
    "", lambda chart: {name for m in chart.missions.values() for name in m.request}, goes_on=GoesOn.ALL
)
MISSIONS = Owner("mission", lambda chart: chart.missions)
HOLDS = Owner("hold", lambda chart: (*OWN_HOLDS, *chart.holds), goes_on=GoesOn.ALL)
#: `Inputs` discards reports about a mission when the mission's variables have begun.
INPUTS = Owner("input", lambda chart: chart.inputs, same=_is_same_input)
LEVELS = Owner("", levels_of)
INVARIANTS = Owner("invariant", lambda chart: chart.invariants)


class MemoryField(NamedTuple):
    """The metadata of a field, with its empty value and the type of the field or of its entries.

    `later` shifts a value, or an entry, to a clock that is so many seconds ahead.
    """

    life: Life
    kind: FieldKind
    owner: Owner | None
    compared: Compare
    later: Callable[[Any, float], Any] | None
    name: str = ""
    empty: Callable[[], Any] = type(None)
    holds: Any = object


def kept(
    life: Life,
    kind: FieldKind = FieldKind.WHOLE,
    owner: Owner | None = None,
    compared: Compare = Compare.VALUE,
    later: Callable[[Any, float], Any] | None = None,
) -> Mapping[str, MemoryField]:
    """Return the metadata of a field."""
    return {"kept": MemoryField(life, kind, owner, compared, later)}


@cache
def fields_of(memory: type) -> tuple[MemoryField, ...]:
    """Return the fields of a memory, in their order.

    Raises:
        TypeError: a field has no metadata, or its entries no owner.
    """
    types = get_type_hints(memory)
    return tuple(_field(memory, one, types[one.name]) for one in fields(memory))


def _field(memory: type, one: Field[Any], of: Any) -> MemoryField:
    how: MemoryField | None = one.metadata.get("kept")
    if how is None:
        raise TypeError(f"{memory.__name__}.{one.name} does not say how it is kept: add metadata=kept(...)")
    if how.owner is None and (how.kind in (FieldKind.BY_KEY, FieldKind.NAMES) or how.life is Life.OWNER):
        raise TypeError(f"{memory.__name__}.{one.name} does not say what owns its entries: add an Owner")
    empty = (lambda: one.default) if one.default_factory is MISSING else one.default_factory
    holds = get_args(of)[-1] if get_origin(of) in (list, dict) else of
    return how._replace(name=one.name, empty=empty, holds=holds)
