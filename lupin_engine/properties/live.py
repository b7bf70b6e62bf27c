"""Watches the properties of a robot's missions while they run: those of simulation and proof, step by step.

A property is asked only in steps that touch what can break it. A breach becomes an event of the machine,
`event.PROPERTY_BROKEN`, once until the property holds again; of a property whose breach is only reported, at
most once in `REPORT_EVERY_S`, with the number of those left out. What is remembered can be kept in the
journal, so that a new process neither forgets a breach nor reports it twice.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from lupin_engine.chart.expressions.evaluation import Compiled, Environment, Expression
from lupin_engine.chart.model import Chart, TemporalProperty
from lupin_engine.chart.records import DECIDING, walk
from lupin_engine.errors import Place, reason
from lupin_engine.machine.event import PROPERTY_BROKEN, Event, Start
from lupin_engine.machine.scope import (
    CONFIGURATION,
    ITINERARY,
    EvaluationScope,
    Reads,
    Watch,
    input_part,
    reads_of,
)
from lupin_engine.machine.step import Step
from lupin_engine.plugin.profile import START
from lupin_engine.plugin.types import BOOL
from lupin_engine.properties.authored import StepView, is_bounded, properties_of
from lupin_engine.properties.built_in import (
    Glance,
    Passage,
    Property,
    Remembered,
    Verdict,
    due,
    is_over,
    kind_of,
    unfinished,
)
from lupin_engine.properties.clauses import breaches

#: Events that change live values, clocks and texts only.
_QUIET = frozenset({"value", "clock", "attempt.progress", "timer.fresh"})
#: How often a breach that is only reported is reported in one mission, in seconds.
REPORT_EVERY_S = 60.0
#: A deadline has passed when the clock is beyond it by so much, in seconds: it counts microseconds.
_PASSED_S = 2e-6

#: The fields of `this_step`, as bits below those of the scope.
_FIELDS = ("accepted", "released", "begun", "succeeded", "failed", "codes", "moving", "was_in")
_ANSWERED, _RELEASED, _BEGUN, _SUCCEEDED, _FAILED, _CODES, _MOVING, _WAS_IN = (
    1 << number for number in range(len(_FIELDS))
)
_BITS: Mapping[str, int] = {
    **{name: 1 << number for number, name in enumerate(_FIELDS)},
    **dict.fromkeys(("refused", "because"), _ANSWERED),
    "given_up": _FAILED | _WAS_IN,
}
#: How far the bits of the scope are moved.
_SHIFT = len(_FIELDS)
#: What changes in many steps: a clause without it is the better one to wait for.
_OFTEN = CONFIGURATION << _SHIFT | _WAS_IN
_ANYTHING, _EVERY_FIELD = -1, (1 << _SHIFT) - 1


class _Asked:
    """A property of an author, and the bits of which one must be touched before its answer can change.

    For an `always` or a `never` it is enough that a clause of each alternative of its breach is false: only
    the bits of these clauses count then.
    """

    __slots__ = ("_is_never", "_ways", "bits", "every", "one")

    def __init__(self, one: Property, rule: TemporalProperty, chart: Chart) -> None:
        self.one = one
        codes = (_code_of(each.value) for each in walk(rule, DECIDING) if isinstance(each.value, Expression))
        every = 0
        for code in codes:
            every |= _bits_of(code, chart)
        if is_bounded(rule) and rule.after is None:
            every |= _ANSWERED  # it begins with a start
        #: All that it reads.
        self.every = every | (CONFIGURATION << _SHIFT if rule.not_meant or rule.mission else 0)
        self.bits = _ANYTHING
        self._is_never = rule.never is not None
        ways = [] if is_bounded(rule) else breaches(rule)
        self._ways = [[(clause.is_true, _bits_of(clause.code, chart)) for clause in way] for way in ways]
        for way in self._ways if self._is_never else ():
            way.sort(key=lambda one: bool(one[1] & _OFTEN))

    def is_kept(self, env: Environment) -> bool:
        """Return whether clauses are false that would be true at a breach, and wait for these."""
        found = 0
        try:
            for way in self._ways:
                read = 0
                for is_true, bits in way:
                    read |= bits
                    if not is_true(env):
                        # A clause before it that cannot be evaluated any more breaks an `always`.
                        found |= bits if self._is_never else read
                        break
                else:
                    return False
        except Exception:
            return False  # the property itself decides
        self.bits = found
        return bool(self._ways)


class LiveMonitor:
    """Watches the properties of a chart on one robot; see the head of this module."""

    def __init__(self, chart: Chart) -> None:
        """Watch the properties that the files of a chart write or name, as far as steps can break them."""
        rules = chart.properties
        self._says = {one.name: one for one in properties_of(chart) if one.name in rules}
        self._written = [
            _Asked(one, rules[name], chart) for name, one in self._says.items() if not rules[name].built_in
        ]
        self._named = [one for name, one in self._says.items() if rules[name].built_in]
        #: The states that are not the first, and the deadlines among them.
        self._states: dict[str, Remembered] = {}
        self._waits: dict[str, float] = {}
        #: Those that are broken now, and the reports that the machine has not got yet.
        self._broken: set[str] = set()
        self._pending: dict[str, str] = {}
        #: When each was reported last in this mission, and how many breaches were left out since then.
        self._reported: dict[str, tuple[float, int]] = {}
        self._rules = rules
        self._scope: EvaluationScope | None = None
        self._watch = Watch()
        self._before = Glance()
        self._fields = 0
        #: What touches any property of an author.
        self._bits = _ANYTHING

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
        fields = _fields_of(step) if not is_new else _EVERY_FIELD
        touched, self._fields = (dirty << _SHIFT) | fields | self._fields, fields
        new: list[Event] = []
        is_busy = bool(step.commands or step.taken or step.accepted)
        if touched & self._bits or is_busy or self._waits or self._broken:
            self._ask(Passage(self._before, step, scope), touched, is_busy, new)
        if fields:
            self._look(scope, dirty)
        return new

    def _ask(self, passage: Passage, touched: int, is_busy: bool, new: list[Event]) -> None:
        """Ask the properties whose answer a step can change."""
        if touched & self._bits:
            self._ask_written([each for each in self._written if each.bits & touched], passage, new)
        if self._waits:
            now = passage.step.time
            late = [each for each in self._written if self._waits.get(each.one.name, math.inf) < now]
            self._ask_written(late, passage, new)
        kind = kind_of(passage) if is_busy else None
        for one in self._named if is_busy or self._broken else ():
            if kind and one.is_asked(kind) and (one.about is None or one.about(passage)):
                self._judge(one, passage, new)
            else:
                self._broken.discard(one.name)

    def _ask_written(self, asked: list[_Asked], passage: Passage, new: list[Event]) -> None:
        env = passage.scope.at("", passage.step.time)
        passage.scope["this_step"] = StepView(passage)
        for each in asked:
            if each.is_kept(env):
                self._broken.discard(each.one.name)
            else:
                each.bits = self._judge(each.one, passage, new, each.every)
        self._bits = 0
        for each in self._written:
            self._bits |= each.bits

    def _judge(self, one: Property, passage: Passage, new: list[Event], every: int = 0) -> int:
        """Ask a property; return what must be touched before it is asked again."""
        name = one.name
        before = self._states.get(name, one.first)
        try:
            state, verdict = one.watch(before, passage)
        except Exception as problem:
            state, verdict = before, Verdict(True, f"could not be judged: {reason(problem)}")
        if state != before:
            self._remember(name, state)
        if not verdict.breach:
            if name not in self._waits:  # a deadline that starts anew does not restore the property
                self._broken.discard(name)
            return every if state == before else _ANYTHING
        if name not in self._broken:
            new += self._report(name, verdict.breach, passage.step.time)
        return _ANYTHING

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


def _fields_of(step: Step) -> int:
    """Return the fields of `this_step` that are not as usual, as bits; 0: nothing but live values."""
    if step.event.name in _QUIET and not (step.changed or step.codes or step.notes):
        return 0
    found = _MOVING
    if step.accepted is not None:
        found |= _ANSWERED
    if step.notes:
        found |= _RELEASED
    if step.commands and any(isinstance(command, Start) for command in step.commands):
        found |= _BEGUN
    if step.taken:
        found |= _SUCCEEDED
        if any(".on_error" in name for name in step.taken):
            found |= _FAILED
    if step.codes:
        found |= _CODES
    return found | _WAS_IN if step.exited or step.entered else found


def _code_of(value: Expression) -> str | None:
    """Return the checked code of an expression; None where it has none."""
    return value.evaluate.code if isinstance(value.evaluate, Compiled) else None


def _bits_of(code: str | None, chart: Chart) -> int:
    """Return what code reads as bits; everything, where that is not known or changes by itself."""
    if code is None:
        return _ANYTHING
    reads = Reads(chart, [Expression(code, Place("", 1, 1), BOOL, Compiled(code))])
    fields = 0
    for root, name in reads_of(code):
        fields |= _BITS.get(name, _EVERY_FIELD) if root == "this_step" else 0
    return reads.parts << _SHIFT | fields if reads.certain else _ANYTHING
