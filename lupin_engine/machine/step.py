"""The record of one step: what happened, what follows, and why nothing happened if nothing did."""

from __future__ import annotations

from lupin_engine.machine.event import Command, Event
from lupin_engine.machine.plan import Plan
from lupin_engine.machine.reasons import Considered, Refusal
from lupin_engine.machine.turn import Turn
from lupin_engine.machine.view import Moment


class Step:
    """One macrostep: a view over the plans that were carried out, made to cost little when nobody looks.

    `sequence` counts from 1, `time` is the caller's. Of a step that only took prepared transitions there is
    no more than that; what else a step can hold is in its `Turn`. Nothing in it changes any more.
    """

    __slots__ = ("_plans", "_turn", "event", "sequence", "time")

    def __init__(
        self, sequence: int, time: float, event: Event, plans: tuple[Plan, ...], turn: Turn | None = None
    ) -> None:
        self.sequence = sequence
        self.time = time
        self.event = event
        self._plans = plans
        self._turn = turn

    @property
    def taken(self) -> tuple[str, ...]:
        """The ids of the transitions taken, in their order."""
        plans = self._plans
        return plans[0].taken if len(plans) == 1 else tuple(n for plan in plans for n in plan.taken)

    @property
    def exited(self) -> tuple[str, ...]:
        """The full names of the states left, in their order."""
        plans = self._plans
        return plans[0].exited if len(plans) == 1 else tuple(n for plan in plans for n in plan.exited)

    @property
    def entered(self) -> tuple[str, ...]:
        """The full names of the states entered, in their order."""
        plans = self._plans
        return plans[0].entered if len(plans) == 1 else tuple(n for plan in plans for n in plan.entered)

    @property
    def configuration(self) -> tuple[str, ...]:
        """The active states afterwards, in document order."""
        row = self._plans[-1].row if self._plans else self._turn.row if self._turn else None
        return row.configuration if row else ()

    @property
    def commands(self) -> tuple[Command, ...]:
        """What is to be done now, in this order."""
        return tuple(self._turn.commands) if self._turn else ()

    @property
    def accepted(self) -> bool | None:
        """The answer to a request; None for every other event."""
        return self._turn.accepted if self._turn else None

    @property
    def refusal(self) -> Refusal | None:
        """Why a request was not accepted."""
        return self._turn.refusal if self._turn else None

    @property
    def notes(self) -> tuple[str, ...]:
        """What was dropped, deferred or blocked and why, in sentences."""
        return tuple(self._turn.notes) if self._turn else ()

    @property
    def why(self) -> tuple[Considered, ...]:
        """The transitions that listen to the event, when none was taken."""
        return self._turn.why if self._turn else ()

    @property
    def trail(self) -> tuple[Moment, ...]:
        """What was to be seen after each microstep, the last one being now."""
        if self._turn is not None:
            seen = [Moment(row.label, row.phase, target) for row, target in self._turn.trail]
        else:
            seen = [plan.row.moment for plan in self._plans if not plan.row.passing]
        return tuple(dict.fromkeys(seen))

    @property
    def changed(self) -> bool:
        """Whether anything but the clock and the live values moved."""
        return bool(self._plans or self.commands)

    def _facts(self) -> tuple[object, ...]:
        return (
            self.sequence,
            self.time,
            self.event,
            self.taken,
            self.exited,
            self.entered,
            self.commands,
            self.configuration,
            self.accepted,
            self.refusal,
            self.notes,
            self.trail,
        )

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Step) and self._facts() == other._facts()

    __hash__ = None  # type: ignore[assignment]  # equal by content, which may hold what cannot be hashed

    def __repr__(self) -> str:
        what = ", ".join(self.taken) or ", ".join(self.notes) or "nothing"
        return f"<Step {self.sequence} at {self.time:g}: {self.event.name}: {what}>"
