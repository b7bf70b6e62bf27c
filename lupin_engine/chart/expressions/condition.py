"""The type of a guard. It has a value also where no guard is written, and where one has mistakes."""

from __future__ import annotations

from typing import Any

from lupin_engine.chart.expressions.evaluation import Environment, Expression, never
from lupin_engine.chart.expressions.guards import TRUE, Formula, constant, formula_of
from lupin_engine.chart.expressions.names import unknowns_asked
from lupin_engine.chart.records import record
from lupin_engine.errors import Place
from lupin_engine.plugin.types import BOOL


def _free(_: Environment) -> bool:
    return True


@record(frozen=True)
class Condition(Expression):
    """A yes or no that decides: of a transition, an `if`, a hold or a `for_each`.

    `FREE` stands where none is written: it is falsy, and always true. One with mistakes is false and not
    `understood`.
    """

    def __bool__(self) -> bool:
        return self.evaluate is not _free

    @property
    def constant(self) -> bool | None:
        """Its value, where it depends on nothing; else None."""
        return constant(self.source) if self else True

    @property
    def formula(self) -> Formula:
        """Its normal form, to compare it with others."""
        return formula_of(self.source) if self else TRUE

    def known_when(self, outcome: bool) -> frozenset[str]:
        """Return the values that may be unknown, and are known when it has this outcome."""
        return unknowns_asked(self.source, outcome) if self else frozenset()


FREE = Condition("", Place("", 1, 1), BOOL, _free)


def mistaken(raw: Any, place: Place) -> Condition:
    """Return the condition that replaces one with mistakes: always false, with the source as written."""
    return Condition(str(raw), place, BOOL, never)
