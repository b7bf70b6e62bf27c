"""How a field of the memory is kept: how long, what its entries are named after, and what a proof compares.

A field says so once, in its metadata (`kept`). What begins anew with a mission or with a part, what another
chart takes over, what a snapshot may speak of, what another clock moves, and which situations a proof tells
apart follow from that: nobody else lists fields.
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

    #: As long as the machine lives; whoever puts something there takes it out.
    CHART = enum.auto()
    #: Until the next mission begins.
    MISSION = enum.auto()
    #: So too; and what is of a state in a mission that is used as a part, until that is entered.
    USE = enum.auto()
    #: Each entry as long as what owns it, be that the chart, a mission or a part.
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
    """What a proof compares of a field, or of an entry."""

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
    """What of entries another chart takes over."""

    #: Nothing.
    NONE = enum.auto()
    #: Those whose owner it has too.
    SAME = enum.auto()
    #: All, whatever they are called.
    ALL = enum.auto()


@dataclass(frozen=True, eq=False)
class Owner:
    """A kind of things of the chart that entries are named after; `word` is what one is called in errors.

    Without a word nobody looks whether the chart has them. Those `of_mission` begin anew with each mission,
    of some names those `in_part` with a state that uses one. Two charts may have one that is not the `same`.
    """

    word: str
    names: Callable[[Chart], Iterable[str]]
    of_states: bool = False
    goes_on: GoesOn = GoesOn.SAME
    of_mission: Callable[[Chart], Iterable[str]] = lambda _: ()
    same: Callable[[Chart, Chart, str], bool] = lambda _before, _chart, _name: True
    in_part: Callable[[Iterable[str], State], list[str]] = lambda _names, _part: []

    def known(self, before: Chart, chart: Chart) -> set[str]:
        """Return the names of those that go on in another chart, which has them as the one before had."""
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
    """Return what the levels of all inputs are called, or those of one."""
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
#: What is known of those that are about a mission is forgotten when its variables have begun: see `Inputs`.
INPUTS = Owner("input", lambda chart: chart.inputs, same=_is_same_input)
LEVELS = Owner("", levels_of)
INVARIANTS = Owner("invariant", lambda chart: chart.invariants)


class MemoryField(NamedTuple):
    """How a field of the memory is kept; what it is when it is empty; the type of it, or of what it holds.

    `later` gives the value, or one that it holds, by a clock that is so many seconds ahead.
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
        TypeError: one does not say how it is kept, or not what owns its entries.
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
