"""What is possible now, and why not the rest: the HMI's buttons, the terminal's answer to `why`."""

from __future__ import annotations

from dataclasses import dataclass

from lupin_engine.chart.model import REQUESTS
from lupin_engine.machine.answers import Answers, consider
from lupin_engine.machine.core import Core
from lupin_engine.machine.environment import NO_CAUSE, Cause
from lupin_engine.machine.event import Event
from lupin_engine.machine.plan import Row
from lupin_engine.machine.reasons import Considered, Refusal
from lupin_engine.machine.structure import ENGINE_EVENTS, Structure
from lupin_engine.machine.turn import Turn

#: How eventless transitions are called where an event's name is expected.
ALWAYS = "always"


@dataclass(frozen=True)
class Possibility:
    """What an event would do if it came now.

    The level of an input is no event that comes: it is possible when it is true, which `level` says. `taken`
    are the transitions that the event would take, `engages` and `releases` the holds. `refusal` says why a
    request would be refused. `considered` are the transitions that listen to the event, each with what keeps
    it from being taken.
    """

    event: str
    possible: bool
    taken: tuple[str, ...] = ()
    engages: tuple[str, ...] = ()
    releases: tuple[str, ...] = ()
    refusal: Refusal | None = None
    considered: tuple[Considered, ...] = ()
    level: bool | None = None

    def __str__(self) -> str:
        if self.refusal is not None:
            return f"{self.event}: {self.refusal.text}"
        if self.level is False and self.considered:
            return f"{self.event}: it is not true now"
        if not self.possible:
            return f"{self.event}: " + ("; ".join(map(str, self.considered)) or "nobody listens to it here")
        holds = [f"engages {name}" for name in self.engages] + [f"releases {name}" for name in self.releases]
        return f"{self.event}: {', '.join((*self.taken, *holds))}"


class Explainer:
    """Answers what one machine could do in a row, without changing anything."""

    __slots__ = ("_core", "_row", "_structure")

    def __init__(self, core: Core, structure: Structure, row: Row) -> None:
        self._core = core
        self._structure = structure
        self._row = row

    def explain(self, now: float) -> tuple[Possibility, ...]:
        """Return for every request and every event of the chart what it would do at time `now`.

        Requests come first, then the other events by name, with `always` for transitions without one; how
        operations end and time passes is not asked for. What a mission's request must carry is
        looked at only when it comes, and a guard that reads the event's data sees none.
        """
        others = [n for n in (*self._structure.events, "") if n not in REQUESTS and not _is_internal(n)]
        found = [self._request(name, now) for name in REQUESTS] + [self._event(name, now) for name in others]
        return tuple(one for one in found if one.considered or one.event != ALWAYS)

    def considered(self, event: str, now: float, cause: Cause = NO_CAUSE) -> tuple[Considered, ...]:
        """Return the transitions that listen to an event here, and what keeps each from being taken."""
        turn = Turn(Event(event), now, self._row)
        offered = self._row.candidates(self._structure, event)
        rules = {rule.id: rule for some in offered for rule in some}
        return tuple(consider(self._core, rule, turn, cause) for rule in rules.values())

    def _request(self, name: str, now: float) -> Possibility:
        turn = Turn(Event(name), now, self._row)
        answer = Answers(self._core, self._structure).answer(turn.event, self._row, turn, dry=True)
        taken = tuple(dict.fromkeys(rule.id for rule in answer.rules))
        return Possibility(
            event=name,
            possible=answer.refusal is None,
            taken=taken,
            engages=tuple(answer.engages),
            releases=tuple(answer.releases),
            refusal=answer.refusal,
            considered=self.considered(name, now),
        )

    def _event(self, name: str, now: float) -> Possibility:
        found = self.considered(name, now)
        ready = {one.transition for one in found if one.holds and not one.held}
        first = [
            next((rule.id for rule in offered if rule.id in ready), "")
            for offered in self._row.candidates(self._structure, name)
        ]
        level = self._level(name, now) if name.startswith("input.") else None
        taken = () if level is False else tuple(dict.fromkeys(filter(None, first)))
        return Possibility(name or ALWAYS, bool(taken), taken, considered=found, level=level)

    def _level(self, name: str, now: float) -> bool:
        self._core.env.inputs.now = now
        return self._core.env.inputs.holds(name)


def _is_internal(event: str) -> bool:
    return event.partition(".")[0] in ENGINE_EVENTS
