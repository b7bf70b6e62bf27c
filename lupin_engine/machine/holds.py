"""Holds suspend the whole chart (ISA-88: hold). Their rules, all of them implemented here:

* a request or the level of an input engages one; levels are checked before everything else in a step;
* while any is engaged, these wait: eventless transitions, levels, the chart's timers, transitions on times
  of day, ends of operations and events of plugins; no element of a `for_each` is started. Operations with
  `on_hold: cancel` are cancelled, or wait if they would begin now, as do actions that move the robot;
* a transition passes where it says `during` (the hold stays) or `releases` for every engaged hold; an event
  or an end waits unless all transitions that listen to it pass;
* when the last hold is released, timers and actions resume, then events in the order in which they came;
  operations begin at the stable configuration, in the states that are active then;
* every chart has three more, the engine's own: `restarted`, when a new process has recovered the mission,
  `unrecorded`, when the write-ahead log fails though it is required, and `breached`, when a property with
  `breach: hold` is broken. While one of them is engaged no operation of a plugin begins, moving or not;
  built-in ones do. The profile's request to resume releases them, and so does every request whose
  transition releases any hold; no other event does. The runner of the machine may release one of these
  (`event.RELEASED`), and never a hold of the chart.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache

from lupin_engine.chart.model import Chart, Hold, Invoke, Transition
from lupin_engine.errors import Place, Severity
from lupin_engine.machine.event import Event
from lupin_engine.machine.memory import Memory
from lupin_engine.machine.scope import HELD, EvaluationScope, Reads, Watch
from lupin_engine.machine.step import Macrostep
from lupin_engine.plugin.builtin import BUILTIN
from lupin_engine.plugin.contract import OWN_HOLDS, OnHold

#: More events of plugins than this do not wait for a release.
MAX_DEFERRED = 64


@lru_cache(maxsize=32)
def all_holds(chart: Chart) -> Mapping[str, Hold]:
    """Return the holds of a chart and the engine's own."""
    resume = chart.profile.resume
    release = (f"operator.{resume}",) if resume else ()
    own = {name: Hold(name, "", release, code, Place("", 1, 1)) for name, code in OWN_HOLDS.items()}
    return {**own, **chart.holds}


@dataclass(slots=True)
class HoldChanges:
    """The holds that a request engages and releases; `refused` is the first code that speaks against it.

    Those that it releases need not be engaged.
    """

    engages: list[str] = field(default_factory=list)
    releases: list[str] = field(default_factory=list)
    refused: str = ""


def passes(rule: Transition, memory: Memory) -> bool:
    """Say whether the engaged holds let a transition through."""
    return not memory.is_any_beside((*rule.during, *released_by(rule)))


def released_by(rule: Transition) -> tuple[str, ...]:
    """Return the holds that a transition releases; an operator's request releases the engine's own, too."""
    asked = bool(rule.releases) and rule.refuse is None and (rule.event or "").startswith("operator.")
    return (*rule.releases, *(OWN_HOLDS if asked else ()))


def blocking_hold(rule: Transition, memory: Memory, released: Iterable[str] = ()) -> str | None:
    """Return the first engaged hold that keeps a transition back; None where it may be taken.

    Holds that it works `during` or releases, and those `released` before, do not count.
    """
    blocking = memory.engaged_beside((*rule.during, *released_by(rule), *released))
    return blocking[0] if blocking else None


def is_held_back(memory: Memory, invoke: Invoke) -> bool:
    """Say whether an operation must not begin now: it moves the robot, or nothing at all may begin."""
    if not memory.held:
        return False
    return invoke.operation.on_hold is OnHold.CANCEL or (
        memory.is_any_engaged(OWN_HOLDS) and invoke.name.partition(".")[0] != BUILTIN
    )


def defer(memory: Memory, event: Event, step: Macrostep) -> None:
    """Keep an event of a plugin for the release; of too many the oldest is dropped."""
    deferred = memory.deferred
    deferred.append(event)
    step.note(f"{event.name} waits for the release")
    waiting = [i for i, other in enumerate(deferred) if not other.name.startswith(("attempt.", "timer."))]
    if len(waiting) > MAX_DEFERRED:
        oldest = deferred.pop(waiting[0])
        step.note(f"dropped: {oldest.name}, because more than {MAX_DEFERRED} events wait")


class Holds:
    """The holds of one machine."""

    __slots__ = ("_levels", "_reads", "_resume", "_scope", "_suspend", "watch")

    def __init__(
        self,
        scope: EvaluationScope,
        reads: Reads,
        suspend: Callable[[Macrostep], None],
        resume: Callable[[Macrostep], None],
    ) -> None:
        """Make the holds of a machine.

        Args:
            scope: that of the machine.
            reads: the dependencies of the levels.
            suspend: called when the first hold is engaged, after the clocks have stopped.
            resume: called when the last one is released, after the clocks have started.
        """
        self._scope = scope
        self._suspend = suspend
        self._resume = resume
        self._levels = [hold for hold in scope.chart.holds.values() if hold.engage.startswith("input.")]
        self._reads = reads
        self.watch = Watch()
        scope.watches.append(self.watch)

    def engage_levels(self, step: Macrostep) -> bool:
        """Engage the holds whose level is true; return whether any was newly engaged."""
        if not self.watch.is_due(self._reads, step.now):
            return False
        inputs, held = self._scope.inputs, self._scope.memory.held
        inputs.now = step.now
        self._scope.doubtful = False
        self.watch.cache_false(self._reads, self._scope, step.now)
        rising = [hold for hold in self._levels if hold.name not in held and inputs.holds(hold.engage)]
        for hold in rising:
            self.engage(hold, step)
        return bool(rising)

    @property
    def false_until(self) -> float:
        """The time until which no level can engage a hold, if nothing changes."""
        return self.watch.false_until

    def engage(self, hold: Hold, step: Macrostep, detail: str = "") -> None:
        """Engage a hold; the first one stops the chart."""
        scope = self._scope
        first = not scope.memory.held
        scope.memory.held.append(hold.name)
        scope.mark_dirty(HELD)
        step.note(f"hold {hold.name} engaged")
        # That it is held shows by itself, and is over with the release: mere information is not remembered.
        scope.record_code(hold.code, detail, step, least=Severity.WARN)
        if first:
            scope.timers.freeze(step.now)
            self._suspend(step)

    def release(self, names: Iterable[str], step: Macrostep) -> None:
        """Release those of some holds that are engaged; after the last one the chart resumes."""
        memory = self._scope.memory
        if not memory.held:
            return
        for name in memory.release(names):
            step.note(f"hold {name} released")
        self._scope.mark_dirty(HELD)
        if not memory.held:
            self._scope.timers.thaw(step.now)
            self._resume(step)

    def asked(self, event: Event, step: Macrostep) -> HoldChanges:
        """Return the holds that a request engages and releases, or the code of its refusal."""
        found = HoldChanges()
        for hold in all_holds(self._scope.chart).values():
            code = self._ask(hold, event.name, found, step)
            found.refused = found.refused or code
        return found

    def _ask(self, hold: Hold, request: str, found: HoldChanges, step: Macrostep) -> str:
        engages = request == hold.engage
        engaged = engages and hold.name in self._scope.memory.held
        if request in hold.release and (engaged or not engages):
            if self._keeps(hold, step):
                return hold.code
            found.releases.append(hold.name)
        elif engages:
            if engaged:
                return hold.code
            if not self._scope.check(hold.engage_guard, "", step):
                return hold.engage_code or hold.code
            found.engages.append(hold.name)
        return ""

    def _keeps(self, hold: Hold, step: Macrostep) -> bool:
        """Say whether the guard of an engaged hold forbids its release; only then note its failures."""
        guard, check = hold.release_guard, self._scope.check
        if check(guard, "", Macrostep(step.event, step.now)):
            return False
        # What keeps the guard from being true is told only where that matters.
        return hold.name in self._scope.memory.held and not check(guard, "", step)
