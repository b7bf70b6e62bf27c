"""Stops a proof whose state space grows without end, and names the variable that must be bounded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from lupin_engine.chart import Chart
from lupin_engine.errors import Place
from lupin_engine.sim import shorten
from lupin_verify.situations.explorer import SituationExplorer
from lupin_verify.situations.found import Effect
from lupin_verify.situations.situation import Situation, SlotName, TooMany

#: A variable with more values than this may be the reason of an incomplete proof.
_MANY = 50
#: Words for slots that are not variables.
_WORDS: Mapping[str, str] = MappingProxyType(
    {
        "configuration": "the set of combinations of active states",
        "timers": "the set of running deadlines",
        "frozen": "the set of deadlines that a hold stops",
        "deferred": "the list of events that wait for the release of a hold",
        "waiting_actions": "the list of actions that wait for the release of a hold",
        "asked": "the set of open questions",
        "handled": "the set of elements taken up in",
        "itineraries": "the itinerary of",
        "budgets": "the time used up in",
        "given": "the request of the mission used in",
        "watched": "what the properties remember",
    }
)
_NUMBER = (
    "bound it, with a guard where it is set, or with 'max:' where it is declared (more is then an error)"
)
_OTHER = "bound it, so that it takes one of a few values"
_ENGINE = "bound the variables that it depends on; if there are none, please report this as a defect"


@dataclass(frozen=True)
class Growth:
    """A slot that grows without end: its declaration, the evidence, and advice."""

    place: Place
    path: str
    text: str
    hint: str

    def __str__(self) -> str:
        return f"{self.text}: {self.hint}"


class BoundedExplorer(SituationExplorer):
    """An explorer that records the first slot with too many values; its caller must stop then."""

    growth: Growth | None = None

    def step(self, situation: Situation, number: int) -> Effect:
        """Make the machine's step; one with too many values of a slot has no effect, and sets `growth`."""
        try:
            return super().step(situation, number)
        except TooMany as found:
            seen = f"({found.count} values, the last {shorten(found.last)})"
            self.growth = self.growth or _growth(self.chart, found.slot, seen)
            return Effect()

    def may_grow(self) -> Growth | None:
        """Return the variable with the most values, if they are so many that it may grow without end."""
        counts = {slot: self.table.count(slot) for slot in self.table.index if slot[0] == "context"}
        slot = max(counts, key=lambda one: counts[one], default=("", ""))
        if counts.get(slot, 0) <= _MANY:
            return None
        growth = _growth(self.chart, slot, "")
        return replace(growth, text=f"{slot[1]!r} has had {counts[slot]:,} values so far")


def _growth(chart: Chart, slot: SlotName, seen: str) -> Growth:
    field, key = slot
    if field == "context":
        variable = chart.context[key]
        hint = _NUMBER if variable.type.kind in ("number", "integer") else _OTHER
        return Growth(variable.place, f"context.{key}", f"{key!r} grows without end {seen}", hint)
    place = chart.states[key].place if key in chart.states else Place(chart.states[""].place.file, 1, 1)
    words = " ".join(filter(None, (_WORDS.get(field, field), key)))
    return Growth(place, key, f"{words} grows without end {seen}", _ENGINE)
