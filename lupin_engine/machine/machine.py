"""The machine: one chart, its memory, and the step from an event at a time to commands.

A macrostep is SCXML's: the event's transitions, then eventless ones, then internal events, until nothing
more happens; then the operations of the states that stayed are begun. What SCXML lacks, in this order:

* a level that engages a hold goes before everything else;
* while any hold is engaged, eventless transitions, levels, timers and the answers of operations wait, and
  what moves the robot is cancelled; a transition is taken all the same where it says `during` (the hold
  stays) or `releases` for every engaged hold;
* a request is resolved as a whole before anything changes (see `answers`);
* an invariant that does not hold when the machine has come to rest is an error, once.

What depends on the configuration alone is prepared (see `plan`), and what needs no more than that is taken by
a shortcut (see `shortcut`). Time is an argument of every call and must not go backwards.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, cast

from lupin_engine.chart.model import Chart, Hold, Invariant, Kind, State, Transition
from lupin_engine.errors import reason
from lupin_engine.machine.answers import Answers, consider
from lupin_engine.machine.content import Content
from lupin_engine.machine.core import Core, passes
from lupin_engine.machine.environment import NO_CAUSE, Cause, Surroundings, World
from lupin_engine.machine.event import NO_EVENT, NOTHING, Event, flaw
from lupin_engine.machine.explain import Explainer, Possibility
from lupin_engine.machine.memory import Memory, Timer
from lupin_engine.machine.operations import Operations
from lupin_engine.machine.plan import MAX_PLANS, Heard, Plan, Planner, Row, Shortcut, planner_of
from lupin_engine.machine.reasons import Refusal
from lupin_engine.machine.request import BAD_REQUEST
from lupin_engine.machine.shortcut import shortcut
from lupin_engine.machine.snapshot import snapshot
from lupin_engine.machine.step import Step
from lupin_engine.machine.structure import ENGINE_EVENTS, EXECUTION_ERROR, FAULT, FAULT_RULE
from lupin_engine.machine.timers import seconds
from lupin_engine.machine.turn import EXECUTION_CODE, Signal, Turn
from lupin_engine.machine.values import Values
from lupin_engine.machine.view import View, target_of, view_of

#: More microsteps than this in one step is a cycle of the chart, not work.
MICROSTEP_LIMIT = 1000
#: More events of plugins than this do not wait for a release.
MAX_DEFERRED = 64
#: The code of an invariant that does not hold.
INVARIANT_CODE = "invariant_broken"

_NO_ANSWERS: Mapping[Heard, Shortcut | None] = {}


class Machine:
    """Runs one chart. Nothing here reads a clock, a file or a network."""

    __slots__ = (
        "_content",
        "_core",
        "_operations",
        "_planner",
        "_row",
        "_turn",
        "answers",
        "env",
        "memory",
    )

    def __init__(self, world: World, memory: Memory | None = None) -> None:
        """Make a machine that is not started.

        Args:
            world: the chart with checked parameters and bound functions.
            memory: what another machine of this chart remembered; this one goes on from there.
        """
        self.memory = memory or Memory()
        self._planner: Planner = planner_of(world.chart)
        self._core = core = Core(world, self.memory)
        self.env: Surroundings = core.env
        self._content = Content(core)
        self._operations = Operations(core, self._content)
        self._row = self._planner.row(self.memory.configuration)
        self._turn = _NO_TURN
        #: The shortcuts from here; none while the machine is not quiet.
        self.answers: Mapping[Heard, Shortcut | None] = _NO_ANSWERS

    # -- the interface ----------------------------------------------------------------------------------

    @property
    def world(self) -> World:
        """What never changes while the machine lives."""
        return self._core.world

    @property
    def chart(self) -> Chart:
        """The chart that it runs."""
        return self._core.chart

    def start(self, now: float) -> Step:
        """Enter the chart's initial states at time `now`, in seconds of the caller's clock."""
        turn = self._open(Event("start"), now)
        self._begin_context(turn)
        Values(self._core).begin(turn)
        self._microstep(self._planner.beginning(), NO_CAUSE)
        return self._finish()

    def go_on(self, now: float) -> Step:
        """Take over the memory of a machine of another chart (see `succession`): begin what is new here."""
        turn = self._open(Event("loaded"), now)
        self._begin_context(turn)
        Values(self._core).go_on(turn)
        return self._finish()

    def _begin_context(self, turn: Turn) -> None:
        """Give the variables that have none their first value."""
        context = self.memory.context
        for name, variable in self._core.chart.context.items():
            try:
                if name not in context:
                    context[name] = variable.default.evaluate(self._core.see("", turn))
            except Exception as problem:
                turn.fail("", f"{variable.place}: context {name}: {reason(problem)}")

    def handle(self, event: Event, now: float) -> Step:
        """Process one event from outside; deadlines before `now` must have been fired by `advance`."""
        answer = self.answers.get(event.name)
        if answer is not None:
            memory = self.memory
            taken = answer(memory, self.env, event, now)
            if taken is not None:
                self.answers = taken.answers
                memory.sequence = sequence = memory.sequence + 1
                return Step(sequence, now, event, taken.plans)
        return self.macrostep(event, now)

    @property
    def next_deadline(self) -> float | None:
        """When `advance` must be called next, in seconds of the caller's clock; None when nothing is due."""
        timers = self.memory.timers
        return timers[0][0] if timers else None

    def advance(self, now: float) -> Step | None:
        """Fire the earliest deadline that is due at `now`; None when there is none."""
        memory = self.memory
        timers = memory.timers
        if not timers or timers[0][0] > now:
            return None
        timer = timers.pop(0)
        answer = self.answers.get(timer[3])
        if answer is not None:
            taken = answer(memory, self.env, NO_EVENT, now)
            if taken is not None:
                self.answers = taken.answers
                memory.sequence = sequence = memory.sequence + 1
                return Step(sequence, now, taken.event, taken.plans)
        return self._fire(timer, now)

    @property
    def view(self) -> View:
        """What the machine shows of itself now."""
        return view_of(self._core.chart, self.memory)

    def input_value(self, name: str, now: float) -> Any:
        """Return a live value as expressions see it, or None when it is unknown."""
        inputs = self.env.inputs
        inputs.now = now
        return inputs[name] if inputs.known(name) else None

    def snapshot(self) -> str:
        """Return everything that the machine remembers as JSON; see `snapshot.restore`."""
        return snapshot(self._core.chart, self.memory)

    def explain(self, now: float) -> tuple[Possibility, ...]:
        """Return what every request and event of the chart would do now, and why not; nothing changes."""
        return Explainer(self._core, self._planner.structure, self._now()).explain(now)

    # -- one step ---------------------------------------------------------------------------------------

    def _now(self) -> Row:
        return self._planner.row(self.memory.configuration)

    def _open(self, event: Event, now: float) -> Turn:
        self._row = self._now()
        self._turn = Turn(event, now, self._row)
        return self._turn

    def macrostep(self, event: Event, now: float) -> Step:
        """Process one event by the general algorithm."""
        turn = self._open(event, now)
        wrong = flaw(event)
        if wrong and isinstance(event.name, str) and event.is_request:
            turn.accepted, turn.refusal = False, Refusal(BAD_REQUEST, wrong)
        elif wrong:
            turn.note(f"dropped: {wrong}")
        elif event.is_request:
            self._request(event)
        elif event.name == "value":
            Values(self._core).observe(event, turn)
        elif event.is_report:
            self._operations.report(event, turn)
        else:
            self._happened(event)
        return self._finish()

    def _happened(self, event: Event) -> None:
        """Take in an event of a plugin; while held it waits, unless all that listens to it may pass."""
        turn, held = self._turn, self.memory.held
        if event.name.partition(".")[0] in _OWN_EVENTS:
            turn.note(f"dropped: {event.name!r} is the engine's own event, and nobody else's")
            return
        candidates = self._row.candidates(self._planner.structure, event.name)
        if held and not all(passes(rule, held) for offered in candidates for rule in offered):
            self._defer(event)
            return
        turn.signals.append(_as_signal(event))
        self._learn(event.name, candidates)

    def _defer(self, event: Event) -> None:
        """Keep an event of a plugin for the release; of too many the oldest is dropped."""
        deferred = self.memory.deferred
        deferred.append(event)
        self._turn.note(f"{event.name} waits for the release")
        waiting = [index for index, other in enumerate(deferred) if not other.is_report]
        if len(waiting) > MAX_DEFERRED:
            oldest = deferred.pop(waiting[0])
            self._turn.note(f"dropped: {oldest.name}, because more than {MAX_DEFERRED} events wait")

    def _fire(self, timer: Timer, now: float) -> Step:
        _, _, kind, (owner, name) = timer
        event = Event(f"timer.{kind}", {"owner": owner})
        turn = self._open(event, now)
        if kind in ("after", "budget"):
            turn.signals.append(Signal(name, owner))
            self._learn(timer[3], (self._planner.structure.rules_of(owner, name),), event)
        elif kind == "timeout":
            self._operations.timed_out(owner, turn)
        elif kind == "retry":
            self._operations.retry(owner, turn)
        elif kind == "fresh":
            Values(self._core).grew_old(owner, turn)
        else:
            self._operations.abandon(owner, turn)
        return self._finish()

    def _learn(
        self,
        key: Heard,
        candidates: Sequence[Sequence[Transition]],
        fixed: Event | None = None,
    ) -> None:
        """Prepare a shortcut for an event that came for the first time in this row.

        Not where transitions need no event: they may have become possible since, and would go first.
        """
        answers = self._row.answers
        if key in answers or self._row.levels or len(answers) >= MAX_PLANS:
            return
        row = self._row
        structure = self._planner.structure
        answers[key] = shortcut(structure, candidates, lambda rules: self._plan(row, rules), fixed)

    def _finish(self) -> Step:
        turn, memory = self._turn, self.memory
        rests = self._comes_to_rest() or self._break_cycle()
        memory.sequence += 1
        quiet = rests and not (memory.held or memory.deferred or memory.walks)
        self.answers = self._row.answers if quiet else _NO_ANSWERS
        turn.row = self._row
        self._turn = _NO_TURN
        self.env.forget()
        return Step(memory.sequence, turn.now, turn.event, tuple(turn.plans), turn)

    def _comes_to_rest(self) -> bool:
        return any(not self._progress() for _ in range(MICROSTEP_LIMIT))

    def _break_cycle(self) -> bool:
        """Lead a chart that never comes to rest to FAULT, which cancels what it did; say whether it rests."""
        turn = self._turn
        last = [name for plan in turn.plans[-20:] for name in plan.taken]
        cycle = ", ".join(dict.fromkeys(last))
        detail = f"the chart does not come to rest after {turn.event.name}: it repeats {cycle}"
        error = {"code": EXECUTION_CODE, "detail": detail}
        cause = Cause(event=error, error=error)
        turn.note(detail)
        turn.signals.clear()
        self._core.report(EXECUTION_CODE, detail)
        rules = self._listeners(Signal(EXECUTION_ERROR, None, cause))
        if not rules:
            return False
        self._take(rules, cause)
        if self._comes_to_rest():
            return True
        turn.note("nor does it after the error: it is left as it is")
        turn.signals.clear()
        return False

    def _progress(self) -> bool:
        """Do the next thing of this macrostep; False when there is nothing left to do."""
        turn, memory = self._turn, self.memory
        if self._core.chart.holds and self._engage_levels():
            return True
        rules = self._enabled_levels() if self._row.levels else ()
        if rules:
            self._take(rules, NO_CAUSE)
            return True
        if turn.signals:
            self._signal(turn.signals.pop(0))
            return True
        if memory.deferred and not memory.held:
            self._come_back_to(memory.deferred.pop(0))
            return True
        if self._row.working and self._operations.begin_missing(self._row.working, turn):
            return True
        if self._core.chart.invariants:
            self._watch_invariants()
        return bool(turn.signals)

    def _come_back_to(self, event: Event) -> None:
        """Deal with what waited for the release."""
        if event.is_report:
            self._operations.report(event, self._turn)
        else:
            self._turn.signals.append(_as_signal(event))

    def _signal(self, signal: Signal) -> None:
        """Offer an internal event to its state, or to all active ones."""
        raised = signal.cause.error.get("code") == EXECUTION_CODE
        rules = self._listeners(signal)
        if rules:
            if raised:
                self._core.report(EXECUTION_CODE, signal.cause.error["detail"])
            self._take(rules, signal.cause)
        elif signal.state is not None and signal.state not in self.memory.configuration and not raised:
            self._turn.note(f"dropped: {signal.name} of {signal.state}, which was left")
        elif signal.name == "error":
            self._turn.signals.append(Signal(EXECUTION_ERROR, None, signal.cause))
        elif signal.name == EXECUTION_ERROR:
            self._turn.note(f"nobody handles the error {signal.cause.error.get('detail', '')}")
        else:
            self._say_why(signal)

    def _listeners(self, signal: Signal) -> list[Transition]:
        """Return the transitions that an internal event causes, for each leaf one."""
        rules = self._enabled(self._offered(signal), signal.cause)
        # An error within FAULT does not lead there again, or a failing entry action would repeat for ever.
        in_fault = FAULT in self.memory.configuration
        return [rule for rule in rules if not (rule.id == FAULT_RULE and in_fault)]

    def _offered(self, signal: Signal) -> Sequence[Sequence[Transition]]:
        structure = self._planner.structure
        if signal.state is None:
            return self._row.candidates(structure, signal.name)
        if signal.state in self.memory.configuration:
            return (structure.rules_of(signal.state, signal.name),)
        return ()

    def _say_why(self, signal: Signal) -> None:
        """Tell why an event did nothing."""
        rules = _distinct(self._offered(signal))
        self._turn.why = tuple(consider(self._core, rule, self._turn, signal.cause) for rule in rules)
        if not rules and signal.state is None:
            self._turn.note(f"nobody listens to {signal.name}")

    # -- which transitions ------------------------------------------------------------------------------

    def _enabled(self, candidates: Iterable[Sequence[Transition]], cause: Cause) -> list[Transition]:
        chosen = []
        for offered in candidates:
            for rule in offered:
                guard = rule.guard
                if guard is None or self._core.check(guard, rule.source, self._turn, cause):
                    chosen.append(rule)
                    break
        return chosen

    def _enabled_levels(self) -> list[Transition]:
        """Return the eventless transitions and the ones on a level of an input that can be taken now."""
        held, inputs = self.memory.held, self.env.inputs
        inputs.now = self._turn.now
        offered = [
            [r for r in rules if passes(r, held) and (not r.event or inputs.holds(r.event))]
            for rules in self._row.levels
        ]
        return self._enabled(offered, NO_CAUSE) if any(offered) else []

    # -- requests, holds --------------------------------------------------------------------------------

    def _request(self, event: Event) -> None:
        turn = self._turn
        answer = Answers(self._core, self._planner.structure).answer(event, self._row, turn)
        turn.accepted = answer.refusal is None
        if answer.refusal is not None:
            turn.refusal = answer.refusal
            explainer = Explainer(self._core, self._planner.structure, self._row)
            turn.why = explainer.considered(event.name, turn.now, Cause(event=event.data))
            return
        if answer.starts:
            self._begin_mission(event, answer.values)
        if answer.rules:
            self._take(answer.rules, Cause(event=event.data))
        for name in answer.releases:
            self._release(name)
        for name in answer.engages:
            self._engage(self._core.chart.holds[name])

    def _begin_mission(self, event: Event, values: dict[str, Any]) -> None:
        memory = self.memory
        memory.mission = str(event.data["mission_type"])
        memory.mission_id = str(event.data.get("mission_id", ""))
        memory.started_at = self._turn.now
        memory.request.clear()
        memory.request.update(values)
        for of_mission in (
            memory.waiting_actions,
            memory.walks,
            memory.history,
            memory.budgets,
            memory.handled,
        ):
            of_mission.clear()
        memory.current_walk = ""
        memory.code = memory.detail = ""
        Values(self._core).begin_mission(self._turn)

    def _engage_levels(self) -> bool:
        """Engage the holds whose level is true; say whether there were any."""
        inputs, held = self.env.inputs, self.memory.held
        inputs.now = self._turn.now
        rising = [
            hold
            for hold in self._core.chart.holds.values()
            if hold.engage.startswith("input.") and hold.name not in held and inputs.holds(hold.engage)
        ]
        for hold in rising:
            self._engage(hold)
        return bool(rising)

    def _engage(self, hold: Hold) -> None:
        first = not self.memory.held
        self.memory.held.append(hold.name)
        self._turn.note(f"hold {hold.name} engaged")
        self._core.report(hold.code, "")
        if first:
            self._core.timers.freeze(self._turn.now)
            self._operations.suspend(self._turn)

    def _release(self, name: str) -> None:
        if name not in self.memory.held:
            return
        self.memory.held.remove(name)
        self._turn.note(f"hold {name} released")
        if not self.memory.held:
            self._core.timers.thaw(self._turn.now)
            self._content.release_actions(self._turn)
            self._operations.resume(self._turn)

    # -- invariants -------------------------------------------------------------------------------------

    def _watch_invariants(self) -> None:
        """Make an error of each invariant that holds no more."""
        turn, broken = self._turn, self.memory.broken
        for invariant in self._core.chart.invariants.values():
            breach = self._breach(invariant)
            if not breach and invariant.name in broken:
                broken.remove(invariant.name)
            elif breach and invariant.name not in broken:
                broken.append(invariant.name)
                turn.note(breach)
                self._core.report(INVARIANT_CODE, breach)
                error = {"code": INVARIANT_CODE, "detail": breach}
                turn.signals.append(Signal(EXECUTION_ERROR, None, Cause(event=error, error=error)))

    def _breach(self, invariant: Invariant) -> str:
        """Return how an invariant is broken, or an empty text; one that cannot be evaluated is."""
        that, problem = invariant.that, ""
        try:
            if that.evaluate(self._core.see("", self._turn)):
                return ""
        except Exception as raised:
            problem = f": {reason(raised)}"
        return f"{invariant.place}: invariant {invariant.name} does not hold: {that.source}{problem}"

    # -- the microstep ----------------------------------------------------------------------------------

    def _plan(self, row: Row, chosen: Sequence[Transition]) -> Plan:
        return self._planner.plan(row, chosen, self.memory.mission, self._remembered, self._resume_child)

    def _remembered(self, history: State) -> tuple[str, ...]:
        return self.memory.history.get(history.name, ())

    def _resume_child(self, state: State) -> str | None:
        """Choose where a state goes on that comes back by history."""
        for rule in state.resume_at:
            if rule.guard is None or self._core.check(rule.guard, rule.source, self._turn):
                return rule.target
        return None

    def _take(self, chosen: Sequence[Transition], cause: Cause) -> None:
        self._microstep(self._plan(self._row, chosen), cause)

    def _microstep(self, plan: Plan, cause: Cause) -> None:
        """Carry out a plan: exits, the transitions' actions, entries; then the holds that they release."""
        turn, memory, rules = self._turn, self.memory, plan.rules
        memory.history.update(plan.remembers)
        for state, configuration in plan.exits:
            self._exit(state, configuration, cause)
        for rule in rules:
            if rule.actions:
                self._content.run(rule.actions, rule.source, cause, turn)
            if rule.code is not None:
                self._core.report(rule.code, cause.error.get("detail", ""))
        for state, configuration in plan.entries:
            self._enter(state, configuration, cause, state.name in plan.back)
        self._row = plan.row
        turn.plans.append(plan)
        for name in dict.fromkeys(hold for rule in rules for hold in rule.releases):
            self._release(name)
        if not plan.row.passing:
            turn.trail.append((plan.row, target_of(memory)))

    def _exit(self, state: State, configuration: tuple[str, ...], cause: Cause) -> None:
        turn = self._turn
        if state.exit:
            self._content.run(state.exit, state.name, cause, turn)
        self._content.forget_actions(state.name)
        self._operations.end(state, turn)
        if state.timers:
            self._core.timers.disarm("after", state.name)
        if state.budget is not None:
            self._keep_budget(state.name)
        self.memory.configuration = configuration

    def _keep_budget(self, state: str) -> None:
        """Remember what a state has left, unless it was entered before the mission began."""
        timers, known = self._core.timers, self.memory.budgets
        if state in known:
            known[state] = timers.left("budget", state, self._turn.now) or 0.0
        timers.disarm("budget", state)

    def _enter(self, state: State, configuration: tuple[str, ...], cause: Cause, comes_back: bool) -> None:
        self.memory.configuration = configuration
        self._content.walks.begin(state, cause, self._turn, comes_back)
        if state.entry:
            self._content.run(state.entry, state.name, cause, self._turn)
        if state.invoke is not None:
            self._operations.enter(state.name, cause.event)
        self._arm_timers(state, cause)
        if state.kind is Kind.FINAL:
            self._completed(state)

    def _arm_timers(self, state: State, cause: Cause) -> None:
        turn, known = self._turn, self.memory.budgets
        for timer in (*state.timers, *((state.budget,) if state.budget else ())):
            kind = "budget" if timer is state.budget else "after"
            try:
                delay = known.get(state.name) if kind == "budget" else None
                if delay is None:
                    delay = seconds(timer.after.evaluate(self._core.see(state.name, turn, cause)))
            except Exception as problem:
                turn.fail(state.name, f"{timer.place}: {kind}: {reason(problem)}")
                continue
            if kind == "budget":
                known[state.name] = delay
            self._core.timers.arm(kind, state.name, turn.now, delay, timer.event)

    def _completed(self, final: State) -> None:
        """Raise `done` for the state that a final state ends, and for the parallel ones that end with it."""
        states = self._core.chart.states
        parent = states[final.parent or ""]
        if parent.parent is not None and states[parent.parent].slot:
            parent = states[parent.parent]  # a mission's end is the slot's end
        self._turn.signals.append(Signal("done", parent.name))
        while parent.parent is not None:
            parent = states[parent.parent]
            if parent.kind is not Kind.PARALLEL or not self._is_final(parent.name):
                break
            self._turn.signals.append(Signal("done", parent.name))

    def _is_final(self, region: str) -> bool:
        """Say whether a region of a parallel state has come to its end (SCXML: isInFinalState)."""
        state = self._core.chart.states[region]
        if state.kind is Kind.HISTORY:
            return True
        if state.kind is Kind.PARALLEL:
            return all(map(self._is_final, state.children))
        return any(
            self._core.chart.states[child].kind is Kind.FINAL and child in self.memory.configuration
            for child in state.children
        )


def _as_signal(event: Event) -> Signal:
    """Return the internal event for one from outside; what are no fields are none."""
    data = event.data if isinstance(event.data, Mapping) else NOTHING
    return Signal(event.name, None, Cause(event=data))


def _distinct(candidates: Iterable[Sequence[Transition]]) -> list[Transition]:
    """Return the transitions offered to any leaf, each once."""
    return list({rule.id: rule for offered in candidates for rule in offered}.values())


#: First words of events that come from the machine itself, never from outside.
_OWN_EVENTS = ENGINE_EVENTS | {"", "input"}
#: Between two steps nothing is collected.
_NO_TURN = cast(Turn, None)
