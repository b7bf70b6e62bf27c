"""Watches the properties of a robot's missions while they run: those of simulation and proof, step by step.

After a step a property is asked as in simulations and proofs, by the kind of the step; after one that changes
only live values, only if it reads one that changed. A breach becomes an event of the machine,
`event.PROPERTY_BROKEN`, once until the property holds again; of a property whose breach is only reported, at
most once in `REPORT_EVERY_S`, with the number of those left out. What is remembered can be kept in the
journal, so that a new process neither forgets a breach nor reports it twice.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import reduce
from operator import or_
from typing import Any

from lupin_engine.chart.expressions.evaluation import Compiled, Expression
from lupin_engine.chart.model import Chart, TemporalProperty
from lupin_engine.chart.records import DECIDING, walk
from lupin_engine.errors import reason
from lupin_engine.machine.event import PROPERTY_BROKEN, Event
from lupin_engine.machine.scope import (
    ITINERARY,
    EvaluationScope,
    Reads,
    Watch,
    input_part,
    reads_of,
)
from lupin_engine.machine.step import Step
from lupin_engine.plugin.profile import START
from lupin_engine.properties.authored import properties_of
from lupin_engine.properties.built_in import (
    Glance,
    Passage,
    Property,
    Remembered,
    Verdict,
    WatchPlans,
    due,
    is_over,
    kind_of,
    unfinished,
)

#: Events that change live values, clocks and texts only.
_QUIET = frozenset({"value", "clock", "attempt.progress", "timer.fresh"})
#: How often a breach that is only reported is reported in one mission, in seconds.
REPORT_EVERY_S = 60.0
#: A deadline has passed when the clock is beyond it by so much, in seconds: it counts microseconds.
_PASSED_S = 2e-6

#: What a property reads beside the scope: `this_step`, and what changes by itself; below the scope's bits.
_STEP, _ALWAYS, _SHIFT = 1, 2, 2
_ANYTHING = -1


class LiveMonitor:
    """Watches the properties of a chart on one robot; see the head of this module."""

    def __init__(self, chart: Chart) -> None:
        """Watch the properties that the files of a chart write or name, as far as steps can break them."""
        rules = chart.properties
        self._says = {one.name: one for one in properties_of(chart) if one.name in rules}
        self._plans = WatchPlans(tuple(self._says.values()))
        #: Those that live values alone may break, with what they read.
        self._quietly = [
            (one, _reads(rules[name], chart))
            for name, one in self._says.items()
            if one.of_values and not rules[name].built_in
        ]
        self._of_values = {one.name for one, _ in self._quietly}
        self._read = reduce(or_, (reads for _, reads in self._quietly), 0)
        #: The states that are not the first, and the deadlines among them.
        self._states: dict[str, Remembered] = {}
        self._waits: dict[str, float] = {}
        #: Those that are broken now, and the reports that the machine has not got yet.
        self._broken: set[str] = set()
        self._pending: dict[str, str] = {}
        #: When each was reported last in this mission, and how many breaches were left out since then.
        self._reported: dict[str, tuple[float, int]] = {}
        self._rules = rules
        #: Those whose state has changed in the last step.
        self._changed: set[str] = set()
        self._scope: EvaluationScope | None = None
        self._watch = Watch()
        self._before = Glance()
        self._was_busy = True

    @property
    def names(self) -> tuple[str, ...]:
        """The properties that it watches."""
        return tuple(self._says)

    # -- steps ------------------------------------------------------------------------------------------

    def take(self, step: Step, scope: EvaluationScope) -> list[Event]:
        """Judge a step that the machine has just made; return the events that report new breaches."""
        is_new = scope is not self._scope
        if is_new:
            self._bind(scope)
        if step.event.name == PROPERTY_BROKEN:
            self._pending.pop(step.event.data["property"], None)
            self._broken.add(step.event.data["property"])
        if step.event.name == START and step.accepted:
            self._reported.clear()
        dirty, self._watch.dirty = self._watch.dirty, 0
        if step.event.name == "timer.fresh":
            dirty |= input_part(scope.chart, step.event.data["owner"])
        is_quiet = not is_new and _is_quiet(step)
        touched = dirty << _SHIFT | _ALWAYS | (_STEP if self._was_busy else 0)
        self._was_busy = not is_quiet
        new: list[Event] = []
        if not is_quiet or touched & self._read or self._changed or self._waits or self._broken:
            self._ask(Passage(self._before, step, scope), touched if is_quiet else None, new)
        if not is_quiet:
            self._look(scope, dirty)
        return new

    def _ask(self, passage: Passage, touched: int | None, new: list[Event]) -> None:
        """Ask the properties whose answer a step can change; `touched` is what a quiet one has changed."""
        changed, self._changed = self._changed, set()
        if touched is not None:
            now = passage.step.time
            for one, reads in self._quietly:
                if reads & touched or one.name in changed or self._waits.get(one.name, math.inf) < now:
                    self._judge(one, passage, new)
            self._broken &= self._of_values | self._waits.keys()
            return
        plans, asked = self._plans, set[str]()
        for index, _ in plans[kind_of(passage)].asked:
            one = plans.properties[index]
            if one.about is None or one.about(passage):
                asked.add(one.name)
                self._judge(one, passage, new)
        if self._broken:
            self._broken &= asked | self._waits.keys()

    def _judge(self, one: Property, passage: Passage, new: list[Event]) -> None:
        """Ask a property."""
        name = one.name
        before = self._states.get(name, one.first)
        try:
            state, verdict = one.watch(before, passage)
        except Exception as problem:
            state, verdict = before, Verdict(True, f"could not be judged: {reason(problem)}")
        if state != before:
            self._changed.add(name)
            self._remember(name, state)
        if not verdict.breach:
            # A deadline that starts anew does not restore the property.
            if self._broken and name not in self._waits:
                self._broken.discard(name)
        elif name not in self._broken:
            new += self._report(name, verdict.breach, passage.step.time)

    def _remember(self, name: str, state: Remembered) -> None:
        self._states[name], self._waits[name] = state, due(state)
        if not state:
            del self._states[name]
        if math.isinf(self._waits[name]):
            del self._waits[name]

    def _report(self, name: str, breach: str, now: float) -> list[Event]:
        """Return the report of a breach; none where it comes too soon after the last one."""
        self._broken.add(name)
        last, left_out = self._reported.get(name, (-math.inf, 0))
        if self._rules[name].breach == "report" and now - last < REPORT_EVERY_S:
            self._reported[name] = last, left_out + 1
            return []
        self._reported[name] = now, 0
        often = f"; {left_out} times more since the last report" if left_out else ""
        breach = breach if breach.startswith("property ") else f"property {name}: {breach}"
        self._pending[name] = f"{breach}{often}"
        return [Event(PROPERTY_BROKEN, {"property": name, "detail": self._pending[name]})]

    def _bind(self, scope: EvaluationScope) -> None:
        """Watch another machine of this chart from now on: all of it is new."""
        self._scope, self._watch = scope, Watch()
        scope.watches.append(self._watch)

    def _look(self, scope: EvaluationScope, dirty: int) -> None:
        """Take the glance before the next step, without what only properties of every chart read."""
        memory = scope.memory
        self._before = Glance(
            settled=frozenset(one.name for one in memory.invocations.values() if is_over(one, memory)),
            mission_id=memory.mission_id,
            unfinished=unfinished(memory) if dirty & ITINERARY else self._before.unfinished,
            configuration=memory.configuration,
            history=tuple(memory.history.items()),
            asked=tuple(memory.asked),
        )

    # -- time -------------------------------------------------------------------------------------------

    @property
    def next_deadline(self) -> float | None:
        """When time alone breaks a property, of the machine's clock; None: never."""
        if not self._waits:
            return None
        waiting = [at for name, at in self._waits.items() if name not in self._broken]
        return min(waiting) + _PASSED_S if waiting else None

    def late(self, now: float) -> list[Event]:
        """Return the events that report what time alone has broken."""
        if not self._waits:
            return []
        late = [
            name for name, at in self._waits.items() if name not in self._broken and at + _PASSED_S <= now
        ]
        ends = [(name, self._says[name].end(self._states[name], now)) for name in late]
        return [
            one for name, verdict in ends if verdict.breach for one in self._report(name, verdict.breach, now)
        ]

    # -- restarts ---------------------------------------------------------------------------------------

    @property
    def unreported(self) -> list[Event]:
        """The events of breaches that the machine has not got."""
        return [
            Event(PROPERTY_BROKEN, {"property": name, "detail": text}) for name, text in self._pending.items()
        ]

    def kept(self) -> dict[str, Any]:
        """Return what it remembers, as JSON data."""
        states = {name: list(state) for name, state in self._states.items()}
        reported = {name: list(one) for name, one in self._reported.items()}
        kept = {"states": states, "broken": sorted(self._broken), "pending": dict(self._pending)}
        return {**kept, "reported": reported}

    def begin(self, kept: Mapping[str, Any], scope: EvaluationScope) -> None:
        """Go on from what was kept, with a machine of then; unknown names are left out."""
        known, states = self._says, kept.get("states", {})
        self._states, self._waits = {}, {}
        for name, state in states.items():
            if name in known:
                self._remember(name, tuple(state))
        self._broken = {name for name in kept.get("broken", ()) if name in known}
        self._pending = {name: text for name, text in kept.get("pending", {}).items() if name in known}
        reported = kept.get("reported", {}).items()
        self._reported = {name: (at, left_out) for name, (at, left_out) in reported if name in known}
        self._bind(scope)
        self._look(scope, ITINERARY)

    def shift(self, seconds: float) -> None:
        """Go on by a clock that is so many seconds ahead."""
        for name, state in list(self._states.items()):
            self._remember(name, tuple(at + seconds for at in state))
        self._reported = {name: (at + seconds, left_out) for name, (at, left_out) in self._reported.items()}


def _is_quiet(step: Step) -> bool:
    """Return whether a step changes live values, clocks and texts only."""
    return step.event.name in _QUIET and not (step.changed or step.codes or step.notes)


def _reads(rule: TemporalProperty, chart: Chart) -> int:
    """Return what a property reads as bits; everything, where that is not known or changes by itself."""
    conditions = [each.value for each in walk(rule, DECIDING) if isinstance(each.value, Expression)]
    reads = Reads(chart, conditions)
    codes = (one.evaluate.code for one in conditions if isinstance(one.evaluate, Compiled))
    of_step = any(root == "this_step" for code in codes for root, _ in reads_of(code))
    return reads.parts << _SHIFT | (_STEP if of_step else 0) if reads.certain else _ANYTHING
