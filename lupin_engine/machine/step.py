"""The record of one step: what happened, what follows, and why nothing happened if nothing did."""

from __future__ import annotations

from dataclasses import dataclass

from lupin_engine.machine.event import Command, Event
from lupin_engine.machine.view import Moment


@dataclass(frozen=True)
class Refusal:
    """Why a request changed nothing: a declared code and a sentence for the operator."""

    code: str
    text: str


@dataclass(frozen=True)
class Step:
    """One macrostep. `taken` are transition ids; states are full names, in the order left and entered.

    `accepted` answers a request and is None for every other event. `notes` say what was dropped, deferred
    or blocked and why. `trail` is what was to be seen after each microstep, the last one being now.
    """

    sequence: int
    time: float
    event: Event
    taken: tuple[str, ...]
    exited: tuple[str, ...]
    entered: tuple[str, ...]
    commands: tuple[Command, ...]
    configuration: tuple[str, ...]
    accepted: bool | None = None
    refusal: Refusal | None = None
    notes: tuple[str, ...] = ()
    trail: tuple[Moment, ...] = ()

    @property
    def changed(self) -> bool:
        """Whether anything but the clock and the live values moved."""
        return bool(self.taken or self.commands or self.exited or self.entered)
