"""The machine's deadlines: armed, frozen while the chart is held, and fired in order of time then arming."""

from __future__ import annotations

from lupin_engine.machine.memory import Memory, Timer

#: Engine deadlines about the world go on while the chart is held: a server answers or it doesn't.
_NEVER_FROZEN = frozenset({"cancel"})


class Timers:
    """The timers of one memory."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def arm(self, kind: str, owner: str, now: float, delay: float, event: str = "") -> None:
        """Set a deadline `delay` seconds from `now`; it starts frozen when the chart is held."""
        frozen = bool(self._memory.held) and kind not in _NEVER_FROZEN
        due = delay if frozen else now + delay
        self._memory.timers.append(Timer(self._memory.fresh_id(), kind, owner, due, event, frozen))

    def disarm(self, kind: str, owner: str) -> None:
        """Forget the deadlines of that kind and owner."""
        self._memory.timers = [t for t in self._memory.timers if (t.kind, t.owner) != (kind, owner)]

    def freeze(self, now: float) -> None:
        """Stop the chart's clocks."""
        for timer in self._memory.timers:
            if not timer.frozen and timer.kind not in _NEVER_FROZEN:
                timer.frozen, timer.due = True, max(0.0, timer.due - now)

    def thaw(self, now: float) -> None:
        """Let the chart's clocks go on where they stopped."""
        for timer in self._memory.timers:
            if timer.frozen:
                timer.frozen, timer.due = False, now + timer.due

    def next_due(self) -> float | None:
        """Return when the next deadline is due, in the time of the caller's clock; None without one."""
        running = [timer.due for timer in self._memory.timers if not timer.frozen]
        return min(running, default=None)

    def pop_due(self, now: float) -> Timer | None:
        """Take the earliest deadline that is due at `now`, the one armed first among equals."""
        due = [timer for timer in self._memory.timers if not timer.frozen and timer.due <= now]
        if not due:
            return None
        first = min(due, key=lambda timer: (timer.due, timer.token))
        self._memory.timers.remove(first)
        return first
