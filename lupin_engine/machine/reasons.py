"""Why nothing happened: how a request is refused, and what keeps a transition from being taken."""

from __future__ import annotations

from dataclasses import dataclass

from lupin_engine.errors import Place


@dataclass(frozen=True)
class Refusal:
    """Why a request changed nothing: a declared code and a sentence for the operator."""

    code: str
    text: str


@dataclass(frozen=True)
class Considered:
    """A transition that listens to an event, and what keeps it from being taken.

    `held` names the hold that it does not pass. `parts` are the operands of the guard's outermost and/or/not
    (or the whole guard) with what each of them is now; a text says what could not be evaluated.
    """

    transition: str
    place: Place
    guard: str
    holds: bool
    held: str = ""
    parts: tuple[tuple[str, object], ...] = ()

    def __str__(self) -> str:
        if self.held:
            return f"{self.transition} ({self.place}) waits: {self.held} is engaged"
        if self.holds:
            return f"{self.transition} ({self.place}) can be taken"
        values = ", ".join(f"{text} is {_shown(value)}" for text, value in self.parts)
        return f"{self.transition} ({self.place}): {self.guard} is false: {values}"


def _shown(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
