"""The machine's timers: armed, frozen while the chart is held, and fired in order of deadline, then arming.

Timers about the world (`NEVER_FROZEN`) run on during a hold.
"""

from __future__ import annotations

import math
from bisect import insort
from operator import itemgetter
from typing import Any

from lupin_engine.chart.semantics import MIN_PERIOD
from lupin_engine.machine.memory import Memory
from lupin_engine.machine.step import Macrostep
from lupin_engine.plugin.types import MAX_SECONDS

#: Deadlines about the world go on while the chart is held: a server answers or it doesn't, a value grows old,
#: it becomes half past six.
NEVER_FROZEN = frozenset({"cancel", "replaced", "fresh", "at"})
#: Between two deadlines that have passed and come now, in seconds.
_APART = 1e-6
#: Names of deadlines that are noted when they have passed.
_NAMES = {"after": "the time", "budget": "the budget", "ask": "the time to answer", "at": "the time of day"}


def seconds(value: Any) -> float:
    """Return a delay; a negative one is 0.

    Raises:
        ValueError: it is longer than 100 years, or no finite number.
    """
    found = float(value)
    if not math.isfinite(found):
        raise ValueError(f"{found:g} s is no time to wait")
    if found > MAX_SECONDS:
        raise ValueError(f"{found:g} s is too long to wait; at most 100 years ({MAX_SECONDS:.0f} s)")
    return max(0.0, found)


def period(value: Any) -> float:
    """Return the time between two ticks.

    Raises:
        ValueError: it is too short, or as `seconds` says.
    """
    found = seconds(value)
    if found < MIN_PERIOD:
        raise ValueError(f"{found:g} s is too often, the shortest is {MIN_PERIOD:g} s")
    return found


class Timers:
    """The timers of one memory."""

    __slots__ = ("_memory",)

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def arm(self, kind: str, owner: str, now: float, delay: float, event: str = "") -> None:
        """Set a deadline `delay` seconds from `now`; it starts frozen when the chart is held."""
        memory = self._memory
        if memory.held and kind not in NEVER_FROZEN:
            memory.frozen.append((delay, memory.fresh_id(), kind, (owner, event)))
        else:
            insort(memory.timers, (now + delay, memory.fresh_id(), kind, (owner, event)))

    def disarm(self, kind: str, owner: str) -> None:
        """Forget the deadlines of that kind and owner."""
        for timers in (self._memory.timers, self._memory.frozen):
            for index in range(len(timers) - 1, -1, -1):
                if timers[index][2] == kind and timers[index][3][0] == owner:
                    del timers[index]

    def left(self, kind: str, owner: str, now: float) -> float | None:
        """Return how much time a deadline has left, in seconds; None when it is not armed."""
        for timers, since in ((self._memory.timers, now), (self._memory.frozen, 0.0)):
            for due, _, its_kind, (its_owner, _) in timers:
                if (its_kind, its_owner) == (kind, owner):
                    return max(0.0, due - since)
        return None

    def note_passed(self, step: Macrostep) -> None:
        """Note the deadlines that passed while no process ran; a hold lets them wait, due at once."""
        for due, _, kind, (owner, _) in self._memory.timers:
            if due <= step.now and kind in _NAMES:
                step.note(f"{_NAMES[kind]} of {owner} has passed meanwhile, {step.now - due:.1f} s ago")

    def freeze(self, now: float) -> None:
        """Stop the chart's clocks."""
        memory = self._memory
        for due, token, kind, about in memory.timers:
            if kind not in NEVER_FROZEN:
                memory.frozen.append((max(0.0, due - now), token, kind, about))
        memory.timers[:] = [timer for timer in memory.timers if timer[2] in NEVER_FROZEN]

    def thaw(self, now: float) -> None:
        """Restart the chart's clocks; passed deadlines keep their order."""
        memory = self._memory
        those = [(now + left, token, kind, about) for left, token, kind, about in memory.frozen]
        memory.timers[:] = sorted([*memory.timers, *those], key=itemgetter(0))
        memory.frozen.clear()

    def catch_up(self, now: float) -> None:
        """Move deadlines that passed while no process ran to now, a microsecond apart.

        So the consequences of the first are handled before the second, as they would have been in time.
        """
        timers = self._memory.timers
        later = (
            (now + _APART * place, *timer[1:]) if timer[0] <= now else timer
            for place, timer in enumerate(timers)
        )
        timers[:] = sorted(later, key=itemgetter(0))
