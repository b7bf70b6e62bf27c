"""The machine: runs one chart on its memory, an event at a time, to completion (SCXML's macrostep).

A macrostep begins with what is true without its event: time alone may have made a hold's level or a guard of
an eventless transition true, and that is acted on first. Then come the event's transitions, eventless ones,
and internal events, each after the levels that have become true, until the configuration is stable; then the
operations of the active states begin. A request is different: it is resolved as a whole, before anything
changes (see `requests`). More than `MICROSTEP_LIMIT` microsteps lead to FAULT. Beyond SCXML there are also
holds (see `holds`) and invariants: one that is false in a stable configuration is an error, once.

`structure` compiles and caches everything that depends on the configuration alone. Time is an argument of
every call and must not go backwards.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, cast

from lupin_engine.chart.model import Chart, State, Transition
from lupin_engine.chart.semantics import ENGINE_EVENTS, EXECUTION_ERROR
from lupin_engine.errors import reason
from lupin_engine.machine.actions import ExecutableContent
from lupin_engine.machine.entry_exit import EntryExit
from lupin_engine.machine.event import (
    ANSWERED,
    CLOCK,
    CODE_REPORTED,
    NO_TRIGGER,
    NOTHING,
    PROPERTY_BROKEN,
    RELEASED,
    RESUMED,
    RUNNERS,
    STANDSTILL,
    Event,
    InternalEvent,
    Trigger,
    flaw,
)
from lupin_engine.machine.holds import Holds, all_holds, defer, passes
from lupin_engine.machine.inputs import WAITS, Inputs, WallClock
from lupin_engine.machine.invariants import watch_invariants
from lupin_engine.machine.memory import Memory
from lupin_engine.machine.memory import Timer as Deadline
from lupin_engine.machine.mission_start import MissionStart
from lupin_engine.machine.operations import Operations
from lupin_engine.machine.requests import (
    BAD_REQUEST,
    BY_DEFAULT,
    Explainer,
    Possibility,
    Requests,
    consider,
)
from lupin_engine.machine.scope import (
    CONFIGURATION,
    EvaluationScope,
    Reads,
    Watch,
    World,
)
from lupin_engine.machine.selection import Selection
from lupin_engine.machine.snapshot import snapshot
from lupin_engine.machine.state_timers import StateTimers
from lupin_engine.machine.step import (
    Considered,
    Macrostep,
    Moment,
    Refusal,
    Step,
    View,
    view_of,
)
from lupin_engine.machine.structure import (
    MAX_MICROSTEPS,
    DispatchTable,
    Microstep,
    dispatch_table,
)
from lupin_engine.plugin.contract import BREACHED, EXECUTION_CODE, OWN_HOLDS, PROPERTY_CODE, RESTARTED
from lupin_engine.plugin.profile import ANSWER

#: More microsteps than this in one step is a cycle of the chart, not work.
MICROSTEP_LIMIT = 1000


class Machine:
    """Runs one chart. Nothing here reads a clock, a file or a network."""

    __slots__ = (
        "_active",
        "_content",
        "_has_invariants",
        "_holds",
        "_inputs",
        "_missions",
        "_operations",
        "_requests",
        "_selection",
        "_state_timers",
        "_states",
        "_step",
        "_table",
        "_wall",
        "_without_mission",
        "memory",
        "scope",
    )

    #: What carries out its actions, what runs its operations, and what takes in its live values.
    content: ClassVar[type[ExecutableContent]] = ExecutableContent
    operations: ClassVar[type[Operations]] = Operations
    inputs: ClassVar[type[Inputs]] = Inputs

    def __init__(self, world: World, memory: Memory | None = None) -> None:
        """Make a machine that is not started.

        Args:
            world: the chart with checked parameters and bound functions.
            memory: that of another machine of this chart, to go on from.
        """
        self.memory = memory or Memory()
        self._table: DispatchTable = dispatch_table(world.chart)
        self.scope = scope = EvaluationScope(world, self.memory)
        self._content = self.content(scope, self._table.actions)
        self._operations = self.operations(scope, self._content, self._table.arguments)
        self._holds = Holds(scope, self._table.hold_reads, self._operations.suspend, self._content.resume)
        self._requests = Requests(scope, self._holds, self._table.structure)
        self._inputs = self.inputs(scope)
        self._wall = WallClock(scope)
        self._state_timers = StateTimers(scope, self._wall)
        self._missions = MissionStart(scope, self._content, self._table.walks)
        self._states = EntryExit(
            scope,
            self._content,
            self._operations,
            self._requests.questions,
            self._missions,
            self._state_timers,
        )
        self._has_invariants = bool(world.chart.invariants)
        self._without_mission = world.chart.profile.stages.without_mission
        self._selection = Selection(scope)
        self._active = self._table.configuration(self.memory.configuration)
        self._step = _NO_STEP

    # -- the interface ----------------------------------------------------------------------------------

    @property
    def world(self) -> World:
        """The chart, parameters and functions, constant while the machine lives."""
        return self.scope.world

    @property
    def chart(self) -> Chart:
        """The chart that it runs."""
        return self.scope.chart

    def start(self, now: float, ahead: float | None = None) -> Step:
        """Enter the chart's initial states.

        Args:
            now: the time, in seconds of the caller's clock.
            ahead: how far the robot's clock, in POSIX time, is ahead of that one; without, the time of day is
                unknown.
        """
        step = self._open(Event("start") if ahead is None else Event("start", {"ahead": ahead}), now)
        self._wall.set(step.event, step)
        self._missions.begin_context(step)
        self._inputs.begin(step)
        self._microstep(self._table.beginning(), NO_TRIGGER)
        return self._finish()

    def go_on(self, now: float) -> Step:
        """Take the first step after a reload (see `reload`): begin what is new in this chart."""
        step = self._open(Event("loaded"), now)
        self._missions.begin_context(step)
        self._inputs.go_on(step)
        self._wall.arm_all(step)
        return self._finish()

    def handle(self, event: Event, now: float) -> Step:
        """Process one event from outside; deadlines before `now` must have been fired by `advance`."""
        name, active, step = event.name, self._active, self._open(event, now)
        if type(name) is str and name in active.known and not self.memory.held:
            step.queue.append(_as_internal(event))
            return self._finish()
        wrong = flaw(event)
        if wrong and isinstance(event.name, str) and event.is_request:
            step.accepted, step.refusal = False, Refusal(BAD_REQUEST, wrong)
        elif wrong:
            step.note(f"dropped: {wrong}")
        elif name == "value":
            self._inputs.observe(event, step)
        elif name == CLOCK:
            self._wall.set(event, step)
        elif event.is_attempt_event:
            self._operations.report(event, step)
        elif event.is_request:
            self._request(event)
        elif name in RUNNERS:
            self._handle_runner(event)
        else:
            self._happened(event)
        return self._finish()

    @property
    def next_deadline(self) -> float | None:
        """When `advance` must be called next, in seconds of the caller's clock; None when nothing is due."""
        timers = self.memory.timers
        return timers[0][0] if timers else None

    def advance(self, now: float) -> Step | None:
        """Fire the earliest deadline that is due at `now`; None when there is none."""
        timers = self.memory.timers
        if not timers or timers[0][0] > now:
            return None
        return self._fire(timers.pop(0), now)

    @property
    def view(self) -> View:
        """The machine's displayed state now."""
        return view_of(self.chart, self.memory)

    @property
    def known_false(self) -> tuple[bool, ...]:
        """For holds, levels and work to begin: whether their conditions are cached as false.

        A machine made of a memory evaluates all of them in its first step. With `restore_known_false` it
        skips those that the original machine had cached.
        """
        return tuple(watch.is_known_false(reads) for watch, reads in self._watched())

    def restore_known_false(self, known: tuple[bool, ...]) -> None:
        """Restore the cache of false conditions that a machine with the same memory had."""
        for (watch, reads), is_false in zip(self._watched(), known, strict=True):
            if is_false:
                watch.mark_false(reads)

    def _watched(self) -> tuple[tuple[Watch, Reads], ...]:
        active = self._active
        return (
            (self._holds.watch, self._table.hold_reads),
            (self._selection.watch, active.levels.reads),
            (self._operations.watch, active.work),
        )

    def input_value(self, name: str, now: float) -> Any:
        """Return a live value as expressions see it, or None when it is unknown."""
        inputs = self.scope.inputs
        inputs.now = now
        return inputs[name] if inputs.known(name) else None

    def snapshot(self) -> str:
        """Return everything that the machine remembers as JSON; see `snapshot.restore`."""
        return snapshot(self.chart, self.memory)

    def explain(self, now: float) -> tuple[Possibility, ...]:
        """Dry-run every request and event of the chart, each with the reasons against it; nothing changes."""
        return self._explainer().explain(now)

    def explain_event(self, event: str, now: float) -> Possibility:
        """Dry-run one request or event, as `explain` does with all."""
        return self._explainer().one(event, now)

    def consider(self, rule: Transition, now: float) -> Considered:
        """Return why a transition could not be taken now, were its state active; nothing changes."""
        return consider(self.scope, rule, Macrostep(Event(rule.event), now))

    def dry_run(self, request: Event, now: float, skip_fields: bool = False) -> Possibility:
        """Return the result that `handle` would have for a request at time `now`; nothing changes.

        Deadlines before `now` must have been fired, as for `handle`. The evaluated candidates are left out.
        With `skip_fields` the fields of a mission's request are not checked.
        """
        return self._explainer().request(request, now, skip_fields)

    def _explainer(self) -> Explainer:
        return Explainer(self.scope, self._requests, self._table.structure, self._active)

    # -- one step ---------------------------------------------------------------------------------------

    def _open(self, event: Event, now: float) -> Macrostep:
        self._step = step = Macrostep(event, now)
        return step

    def _happened(self, event: Event) -> None:
        """Take in an event of a plugin; while held it waits, unless all that listens to it may pass."""
        step, held = self._step, self.memory.held
        if event.name.partition(".")[0] in _OWN_EVENTS:
            step.note(f"dropped: {event.name!r} is the engine's own event, and nobody else's")
            return
        if held:
            offered = self._active.candidates(event.name)
            if not all(passes(rule, self.memory) for rules in offered for rule in rules):
                defer(self.memory, event, step)
                return
        elif len(self._active.known) < MAX_MICROSTEPS:
            self._active.known.add(event.name)
        step.queue.append(_as_internal(event))

    def _handle_runner(self, event: Event) -> None:
        """Handle an event of the machine's runner: see `event.RUNNERS`."""
        step, data = self._step, event.data
        if event.name == CODE_REPORTED:
            self.scope.record_code(data["code"], data["detail"], step)
            return
        if event.name == STANDSTILL:
            step.fail("", data["detail"])
            return
        if event.name == PROPERTY_BROKEN:
            self._property_broken(data["property"], data["detail"])
            return
        if event.name == RELEASED:
            self._holds.release({data["hold"]} & OWN_HOLDS.keys(), step)
            return
        name = data.get("hold", RESTARTED)
        if event.name == RESUMED:
            self._operations.recover(step)
            self.scope.timers.note_passed(step)
            self.scope.timers.catch_up(step.now)
        if (event.name != RESUMED or data["held"]) and name not in self.memory.held:
            self._holds.engage(all_holds(self.chart)[name], step, data["detail"])

    def _property_broken(self, name: str, detail: str) -> None:
        """Report the breach of a property, and do what its author has chosen; nothing is released."""
        step, rule = self._step, self.chart.properties.get(name)
        code = PROPERTY_CODE if rule is None or rule.code is None else rule.code
        step.note(detail)
        if rule is not None and rule.breach == "hold" and BREACHED not in self.memory.held:
            self._holds.engage(replace(all_holds(self.chart)[BREACHED], code=code), step, detail)
            return
        self.scope.record_code(code, detail, step)
        if rule is not None and rule.breach == "fault":
            error = {"code": code, "detail": detail}
            step.queue.append(InternalEvent(EXECUTION_ERROR, None, Trigger(event=error, error=error)))

    def _fire(self, timer: Deadline, now: float) -> Step:
        due, _, kind, (owner, name) = timer
        owner = self._operations.of_deadline(owner) if kind in ("timeout", "update") else owner
        data = {"owner": owner, "time": name.rpartition(" ")[2]} if kind == "at" else {"owner": owner}
        step = self._open(Event(f"timer.{kind}", data), now)
        if kind == "budget" and owner not in self.memory.configuration:
            self.memory.budgets[owner] = 0.0  # told when the robot comes back
        elif kind in ("after", "budget"):
            self._state_timers.tick_again(owner, name, due, step)
            step.queue.append(InternalEvent(name, owner))
        elif kind == "at":
            self._came_to(owner, name)
        elif kind == "ask":
            self._requests.questions.answered(Event(name))
            step.queue.append(InternalEvent(name, None, Trigger(event=BY_DEFAULT)))
        elif kind == "timeout":
            self._operations.timed_out(owner, step)
        elif kind == "retry":
            self._operations.retry(owner)
        elif kind == "update":
            self._operations.update(owner, step)
        elif kind == "replaced":
            self._operations.not_ended(owner, step)
        elif kind == "fresh":
            self._inputs.became_stale(owner, step)
        else:
            self._operations.abandon(owner, step)
        return self._finish()

    def _came_to(self, state: str, about: str) -> None:
        """Fire an `at`; during a hold its event waits, unless all transitions that listen to it pass."""
        event, memory = about.partition(" ")[0], self.memory
        self._wall.came_to(state, about, self._step)
        rules = [rule for some in self._active.rules_of(state, event) for rule in some]
        if memory.held and not all(passes(rule, memory) for rule in rules):
            self._wall.defer(state, event, self._step)
        else:
            self._step.queue.append(InternalEvent(event, state))

    def _finish(self) -> Step:
        step, memory = self._step, self.memory
        if not self._comes_to_rest():
            self._break_cycle()
        memory.sequence += 1
        self._step = _NO_STEP
        self.scope.clear_event()
        return step.record(memory.sequence, memory.configuration)

    def _comes_to_rest(self) -> bool:
        left = MICROSTEP_LIMIT
        while left and self._progress():
            left -= 1
        return left > 0

    def _break_cycle(self) -> None:
        """Lead a chart without a stable configuration to FAULT, whose exits cancel its operations."""
        step = self._step
        cycle = ", ".join(dict.fromkeys(step.taken[-20:]))
        detail = f"the chart does not come to rest after {step.event.name}: it repeats {cycle}"
        error = {"code": EXECUTION_CODE, "detail": detail}
        trigger = Trigger(event=error, error=error)
        step.note(detail)
        step.queue.clear()
        self.scope.record_code(EXECUTION_CODE, detail, step)
        raised = InternalEvent(EXECUTION_ERROR, None, trigger)
        rules = self._selection.caused_by(raised, self._active, step)
        if not rules:
            return
        self._take(rules, trigger)
        if self._comes_to_rest():
            return
        step.note("nor does it after the error: it is left as it is")
        step.queue.clear()

    def _progress(self) -> bool:
        """Do the next thing of this macrostep; False when there is nothing left to do."""
        step, memory = self._step, self.memory
        if step.now >= self.scope.false_until and self._levels_move():
            return True
        if step.queue:
            self._offer(step.queue.pop(0))
            return True
        if not memory.held and memory.deferred:
            self._come_back_to(memory.deferred.pop(0))
            return True
        if self._active.working and self._operations.begin_missing(self._active, step):
            return True
        if self._has_invariants:
            watch_invariants(self.scope, step)
        return bool(step.queue)

    def _levels_move(self) -> bool:
        """Engage the holds and take the transitions that need no event; say whether there were any."""
        step, levels, scope = self._step, self._active.levels, self.scope
        if self._holds.engage_levels(step):
            return True
        rules = self._selection.without_event(levels, step)
        if rules:
            self._take(rules, step.bound)
            return True
        scope.false_until = min(self._holds.false_until, self._selection.watch.false_until)
        scope.level_reads = self._table.hold_reads.parts | levels.reads.parts
        return False

    def _come_back_to(self, event: Event) -> None:
        """Handle an event that waited for the release."""
        if event.name == ANSWERED:
            self._operations.hear_answer(event.data["attempt"], self._step)
        elif event.name == WAITS:
            self._step.queue.append(InternalEvent(event.data["event"], event.data["owner"]))
        else:
            self._step.queue.append(_as_internal(event))

    def _offer(self, internal: InternalEvent) -> None:
        """Offer an internal event to its state, or to all active ones."""
        trigger = internal.trigger
        self._step.bound = trigger if trigger.error is NOTHING else Trigger(trigger.event)
        rules = self._selection.caused_by(internal, self._active, self._step)
        raised = trigger.error is not NOTHING and trigger.error.get("code") == EXECUTION_CODE
        if raised and internal.name == "error":
            self.scope.record_code(EXECUTION_CODE, trigger.error["detail"], self._step)
        if rules:
            self._take(rules, trigger)
        elif internal.state is not None and internal.state not in self.memory.configuration and not raised:
            self._step.note(f"dropped: {internal.name} of {internal.state}, which was left")
        elif internal.name == "error":
            self._step.queue.insert(0, InternalEvent(EXECUTION_ERROR, None, trigger))
        elif internal.name == EXECUTION_ERROR:
            self._step.note(f"nobody handles the error {trigger.error.get('detail', '')}")
        else:
            self._step.why = self._selection.why_none(internal, self._active, self._step)
            if not self._step.why and internal.state is None:
                self._step.note(f"nobody listens to {internal.name}")

    # -- requests, holds --------------------------------------------------------------------------------

    def _request(self, event: Event) -> None:
        step = self._step
        found = self._requests.resolve(event, self._active, step)
        step.accepted = found.refusal is None
        if found.refusal is not None:
            step.refusal = found.refusal
            step.why = self._explainer().considered(event.name, step.now, found.trigger)
            return
        if found.starts:
            self._state_timers.stop_budgets()
            self._missions.begin(event, found.values, step)
            self._inputs.begin_mission(step)
        if event.name.startswith(ANSWER):
            self._requests.questions.answered(event)
        if found.rules:
            step.bound = found.trigger
            self._take(found.rules, found.trigger)
        if found.releases:
            self._holds.release(found.releases, step)
        for name in found.engages:
            self._holds.engage(all_holds(self.chart)[name], step)

    # -- the microstep ----------------------------------------------------------------------------------

    def _remembered(self, history: State) -> tuple[str, ...]:
        return self.memory.history.get(history.name, ())

    def _resume_child(self, state: State) -> str | None:
        """Return the child in which a state resumes that is restored from history, by its `resume_at`.

        None where no guard there is true.
        """
        return next((rule.target for rule in self.scope.enabled((state.resume_at,), self._step)), None)

    def _take(self, chosen: Sequence[Transition], trigger: Trigger) -> None:
        mission = self.memory.mission
        key = (mission, chosen[0].id) if len(chosen) == 1 else (mission, *[rule.id for rule in chosen])
        plan = self._active.microsteps.get(key)
        if plan is None:
            plan = self._table.microstep(self._active, chosen, mission, self._remembered, self._resume_child)
        self._microstep(plan, trigger)

    def _microstep(self, plan: Microstep, trigger: Trigger) -> None:
        """Carry out a microstep: exits, actions, entries; then the holds that its transitions release."""
        step, memory = self._step, self.memory
        target = memory.target if memory.itineraries else ""
        if plan.remembers:
            memory.history.update(plan.remembers)
        if plan.moves:
            self.scope.mark_dirty(CONFIGURATION)
            if memory.waiting_actions:
                self._content.forget_actions(plan.exited)
        for state, configuration in plan.exits:
            memory.configuration = configuration
            self._states.exit(state, trigger, plan.exited, step)
        memory.configuration = plan.between
        for rule in plan.active_rules:
            self._act(rule, trigger, target)
        for state, configuration in plan.entries:
            memory.configuration = configuration
            self._states.enter(state, trigger, state.name in plan.back, step)
        active = plan.leads_to
        if active.levels is not self._active.levels:
            self.scope.false_until = -math.inf
        self._active = active
        memory.configuration = active.states
        if memory.budgets and plan.moves and active.label in self._without_mission:
            self._state_timers.stop_budgets()
        self._follow(plan)
        if plan.releases:
            self._holds.release(plan.releases, step)
        if not active.passing:
            self._pass_through()

    def _act(self, rule: Transition, trigger: Trigger, target: str) -> None:
        """Carry out the actions of a transition, and report its code."""
        if rule.actions:
            self._content.run(rule.actions, rule.source, trigger, self._step)
        if rule.code is not None:
            self._report_code(rule, rule.code, trigger, target)

    def _follow(self, plan: Microstep) -> None:
        """Record the transitions, exits and entries of a microstep in the step."""
        step = self._step
        if step.taken or step.exited or step.entered:
            step.taken += plan.taken
            step.exited += plan.exited
            step.entered += plan.entered
        else:
            step.taken, step.exited, step.entered = plan.taken, plan.exited, plan.entered

    def _pass_through(self) -> None:
        """Append the published state after a microstep to the step's trail."""
        step, memory, active = self._step, self.memory, self._active
        target = memory.target if memory.itineraries else ""
        moment = Moment(active.label, active.phase, target) if target else active.moment
        step.trail = (*step.trail, moment) if step.trail else active.trail if not target else (moment,)

    def _report_code(self, rule: Transition, code: str, trigger: Trigger, target: str) -> None:
        """Report the code of a transition that is taken, about the target of the states that it left."""
        step, detail = self._step, trigger.error.get("detail", "")
        if rule.detail is not None:
            try:
                detail = rule.detail.evaluate(self.scope.see(rule.source, step, trigger))
            except Exception as problem:
                step.fail(rule.source, f"{rule.detail.place}: detail: {reason(problem)}")
        self.scope.record_code(code, detail, step, target)


def _as_internal(event: Event) -> InternalEvent:
    """Return the internal event for an external one; data that is no mapping is dropped."""
    data = event.data
    # To ask whether something is a Mapping takes ten times as long as the rest.
    if data is not NOTHING and type(data) is not dict and not isinstance(data, Mapping):
        data = NOTHING
    return InternalEvent(event.name, None, Trigger(data))


#: First words of events that come from the machine itself, never from outside.
_OWN_EVENTS = ENGINE_EVENTS | {"", "input"}
#: Between two steps nothing is collected.
_NO_STEP = cast(Macrostep, None)
