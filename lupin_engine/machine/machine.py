"""The machine: one chart, its memory, and the step from an event at a time to commands.

A macrostep is SCXML's: the event's transitions, then eventless ones, then internal events, until nothing
more happens; then the operations of the states that stayed are begun. What SCXML lacks, in this order:

* a level that engages a hold goes before everything else;
* while any hold is engaged, eventless transitions, levels, timers and the answers of operations wait, and
  what moves the robot is cancelled; a transition is taken all the same where it says `during` (the hold
  stays) or `releases` for every engaged hold;
* a request is resolved as a whole before anything changes: the chart's refusals first, then the holds that
  it engages or releases, then its transitions. Refused means that nothing changed.

Time is an argument of every call and must not go backwards.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from lupin_engine.chart.model import Expression, Hold, Itinerary, Kind, State, Transition, UnknownInput
from lupin_engine.errors import LupinError, Severity
from lupin_engine.machine.content import Content
from lupin_engine.machine.environment import NO_CAUSE, Cause, Inputs, World, environment
from lupin_engine.machine.event import Event
from lupin_engine.machine.memory import Memory, Visit, Walk
from lupin_engine.machine.operations import Operations
from lupin_engine.machine.request import read_request
from lupin_engine.machine.step import Refusal, Step
from lupin_engine.machine.structure import EXECUTION_ERROR, FAULT, FAULT_RULE, Structure
from lupin_engine.machine.timers import Timers
from lupin_engine.machine.turn import EXECUTION_CODE, Signal, Turn
from lupin_engine.machine.view import View, moment_of, view_of

#: More microsteps than this in one step is a cycle of the chart, not work.
MICROSTEP_LIMIT = 1000


class CycleError(LupinError):
    """A chart never comes to rest; the text names the transitions that repeat."""


class Machine:
    """Runs one chart. Nothing here reads a clock, a file or a network."""

    def __init__(self, world: World, structure: Structure | None = None) -> None:
        """Make a machine that is not started.

        Args:
            world: the chart with checked parameters and bound functions.
            structure: shared by machines of the same chart; built when absent.
        """
        self.world = world
        self.chart = world.chart
        self.memory = Memory()
        self._structure = structure or Structure(world.chart)
        self._timers = Timers(self.memory)
        self._content = Content(world, self.memory)
        self._operations = Operations(
            world, self.memory, self._timers, self._report, self._listens_while_held
        )
        self._turn = Turn(Event("start"), 0.0)

    # -- the interface ----------------------------------------------------------------------------------

    def start(self, now: float) -> Step:
        """Enter the chart's initial states at time `now`, in seconds of the caller's clock."""
        self._turn = Turn(Event("start"), now)
        for name, variable in self.chart.context.items():
            self.memory.context[name] = variable.default.evaluate(self._env("", NO_CAUSE))
        for name, spec in self.chart.inputs.items():
            if spec.initial is not None:
                self._set_input(name, spec.initial, now)
        self._enter(self._structure_defaults(), NO_CAUSE)
        return self._finish()

    def handle(self, event: Event, now: float) -> Step:
        """Process one event from outside; deadlines before `now` must have been fired by `advance`."""
        self._turn = Turn(event, now)
        if event.is_request:
            self._request(event)
        elif event.name == "value":
            self._observe(event)
        elif event.name.startswith("attempt."):
            self._operations.report(event, self._turn)
        else:
            self._turn.signals.append(Signal(event.name, None, Cause(event=event.data)))
        return self._finish()

    @property
    def next_deadline(self) -> float | None:
        """When `advance` must be called next, in seconds of the caller's clock; None when nothing is due."""
        return self._timers.next_due()

    def advance(self, now: float) -> Step | None:
        """Fire the earliest deadline that is due at `now`; None when there is none."""
        timer = self._timers.pop_due(now)
        if timer is None:
            return None
        self._turn = Turn(Event(f"timer.{timer.kind}", {"owner": timer.owner}), now)
        if timer.kind == "after":
            self._turn.signals.append(Signal(timer.event, timer.owner))
        elif timer.kind == "timeout":
            self._operations.timed_out(timer.owner, self._turn)
        elif timer.kind == "retry":
            self._operations.retry(timer.owner, self._turn)
        else:
            self._operations.abandon(timer.owner, self._turn)
        return self._finish()

    @property
    def view(self) -> View:
        """What the machine shows of itself now."""
        return view_of(self.chart, self.memory)

    def input_value(self, name: str, now: float) -> Any:
        """Return a live value as expressions see it, or None when it is unknown."""
        inputs = Inputs(self.chart, self.memory, now)
        return inputs[name] if inputs.known(name) else None

    # -- the macrostep ----------------------------------------------------------------------------------

    def _finish(self) -> Step:
        if not self._comes_to_rest():
            self._break_cycle()
        self.memory.sequence += 1
        return self._turn.step(self.memory)

    def _comes_to_rest(self) -> bool:
        return any(not self._progress() for _ in range(MICROSTEP_LIMIT))

    def _break_cycle(self) -> None:
        """Lead a chart that never comes to rest to FAULT; what it was doing is cancelled as it is left."""
        cycle = ", ".join(dict.fromkeys(self._turn.taken[-20:]))
        detail = f"the chart does not come to rest after {self._turn.event.name}: it repeats {cycle}"
        error = {"code": EXECUTION_CODE, "detail": detail}
        cause = Cause(event=error, error=error)
        self._turn.note(detail)
        self._turn.signals.clear()
        rules = self._listeners(Signal(EXECUTION_ERROR, None, cause))
        if rules:
            self._report(EXECUTION_CODE, detail)
            self._microstep(rules, cause)
        if not rules or not self._comes_to_rest():
            raise CycleError(detail)

    def _progress(self) -> bool:
        """Do the next thing of this macrostep; False when there is nothing left to do."""
        turn = self._turn
        if self._engage_levels():
            return True
        rules = self._enabled_levels()
        if rules:
            self._microstep(rules, NO_CAUSE)
            return True
        if turn.signals:
            self._signal(turn.signals.popleft())
            return True
        if self.memory.deferred and not self.memory.held:
            self._operations.report(self.memory.deferred.pop(0), turn)
            return True
        return self._operations.begin_missing(turn)

    def _signal(self, signal: Signal) -> None:
        """Offer an internal event to its state, or to all active ones."""
        raised = signal.cause.error.get("code") == EXECUTION_CODE
        rules = self._listeners(signal)
        if rules:
            if raised:
                self._report(EXECUTION_CODE, signal.cause.error["detail"])
            self._microstep(rules, signal.cause)
        elif signal.state is not None and signal.state not in self.memory.configuration and not raised:
            self._turn.note(f"dropped: {signal.name} of {signal.state}, which was left")
        elif signal.name == "error":
            self._turn.signals.append(Signal(EXECUTION_ERROR, None, signal.cause))
        elif signal.name == EXECUTION_ERROR:
            self._turn.note(f"nobody handles the error {signal.cause.error.get('detail', '')}")
        elif signal.state is None:
            self._turn.note(f"nobody listens to {signal.name}")

    def _listeners(self, signal: Signal) -> tuple[Transition, ...]:
        """Return the transitions that an internal event causes."""
        active = self.memory.configuration
        if signal.state is None:
            rules = self._enabled(self._structure.candidates(active, signal.name), signal.cause)
        elif signal.state in active:
            rules = self._enabled((self._structure.rules_of(signal.state, signal.name),), signal.cause)
        else:
            return ()
        # An error within FAULT does not lead there again, or a failing entry action would repeat for ever.
        return tuple(rule for rule in rules if not (rule.id == FAULT_RULE and FAULT in active))

    # -- which transitions ------------------------------------------------------------------------------

    def _enabled(self, candidates: Iterable[Sequence[Transition]], cause: Cause) -> tuple[Transition, ...]:
        chosen = []
        for offered in candidates:
            first = next((rule for rule in offered if self._holds(rule, cause)), None)
            if first is not None:
                chosen.append(first)
        return self._structure.without_conflicts(self.memory.configuration, chosen)

    def _enabled_levels(self) -> tuple[Transition, ...]:
        """Return the eventless transitions and the ones on a level of an input that can be taken now."""
        inputs = Inputs(self.chart, self.memory, self._turn.now)
        offered = [
            [rule for rule in rules if self._passes(rule) and (not rule.event or inputs.holds(rule.event))]
            for rules in self._structure.level_candidates(self.memory.configuration)
        ]
        return self._enabled(offered, NO_CAUSE) if any(offered) else ()

    def _passes(self, rule: Transition, staying: Iterable[str] | None = None) -> bool:
        """Say whether the engaged holds let a transition through."""
        held = self.memory.held if staying is None else staying
        return all(hold in rule.during or hold in rule.releases for hold in held)

    def _listens_while_held(self, state: str, event: str) -> bool:
        # All of them, for which one is taken is only known when the answer is looked at.
        rules = self._structure.rules_of(state, event)
        return bool(rules) and all(self._passes(rule) for rule in rules)

    def _holds(self, rule: Transition, cause: Cause) -> bool:
        """Evaluate a transition's guard; an unknown input is false, any other failure an error as well."""
        if rule.guard is None:
            return True
        return self._check(rule.guard, rule.source, cause)

    def _check(self, guard: Expression, state: str, cause: Cause) -> bool:
        try:
            return bool(guard.evaluate(self._env(state, cause)))
        except UnknownInput as unknown:
            self._turn.note(f"{guard.place}: {guard.source}: {unknown}")
        except Exception as problem:
            detail = f"{guard.place}: {guard.source}: {problem}"
            # Guards are asked again in every microstep; the error is one.
            if detail not in self._turn.failed_guards:
                self._turn.failed_guards.add(detail)
                self._turn.fail(state, detail)
        return False

    def _env(self, state: str, cause: Cause) -> Any:
        return environment(self.world, self.memory, state, self._turn.now, cause)

    # -- requests ---------------------------------------------------------------------------------------

    def _request(self, event: Event) -> None:
        cause = Cause(event=event.data)
        engaging, releasing, refusal = self._hold_changes(event)
        staying = [hold for hold in self.memory.held if hold not in releasing]
        rules, chart_refusal = self._requested(event, staying, cause)
        values: dict[str, Any] = {}
        starts = any(rule.target is not None and self.chart.states[rule.target].slot for rule in rules)
        refusal = chart_refusal or refusal
        if refusal is None and starts:
            values, refusal = read_request(self.world, event.data, self._env("", cause))
        if refusal is None and not (rules or engaging or releasing):
            refusal = self._impossible(event)
        self._turn.accepted = refusal is None
        if refusal is not None:
            self._turn.refusal = refusal
            return
        if starts:
            self._begin_mission(event, values)
        if rules:
            self._microstep(rules, cause)
        for name in releasing:
            self._release(name)
        for name in engaging:
            self._engage(self.chart.holds[name])

    def _hold_changes(self, event: Event) -> tuple[list[str], list[str], Refusal | None]:
        """Return the holds that a request engages and releases, or why it may not."""
        engaging, releasing = [], []
        refusal: Refusal | None = None
        for hold in self.chart.holds.values():
            engaged = hold.name in self.memory.held
            if event.name in hold.release and engaged:
                if self._allows(hold.release_guard):
                    releasing.append(hold.name)
                else:
                    refusal = refusal or self._refusal(event, hold.code)
            elif event.name == hold.engage:
                if not engaged and self._allows(hold.engage_guard):
                    engaging.append(hold.name)
                else:
                    refusal = refusal or self._refusal(
                        event, hold.code if engaged else hold.engage_code or hold.code
                    )
        return engaging, releasing, refusal

    def _allows(self, guard: Expression | None) -> bool:
        return guard is None or self._check(guard, "", NO_CAUSE)

    def _requested(
        self, event: Event, staying: list[str], cause: Cause
    ) -> tuple[tuple[Transition, ...], Refusal | None]:
        """Return the transitions that answer a request, or the first refusal among them."""
        chosen = []
        for offered in self._structure.candidates(self.memory.configuration, event.name):
            for rule in offered:
                if not self._holds(rule, cause):
                    continue
                if rule.refuse is not None:
                    return (), self._refusal(event, rule.refuse)
                if not self._passes(rule, staying):
                    blocking = next(h for h in staying if h not in rule.during and h not in rule.releases)
                    return (), self._refusal(event, self.chart.holds[blocking].code)
                chosen.append(rule)
                break
        return self._structure.without_conflicts(self.memory.configuration, chosen), None

    def _refusal(self, event: Event, code: str) -> Refusal:
        verb = event.name.rpartition(".")[2]
        label = self.chart.codes[code].label if code in self.chart.codes else code
        return Refusal(code, f"{verb} refused: {label}")

    def _impossible(self, event: Event) -> Refusal:
        """Say where a request would be possible, from the chart."""
        verb = event.name.rpartition(".")[2]
        view = self.view
        where = {
            "a running mission" if state.slot else state.label or state.local_name
            for state in self.chart.states.values()
            if any(rule.refuse is None for rule in self._structure.rules_of(state.name, event.name))
        } - {view.lifecycle}
        here = f"{view.lifecycle} {view.phase}".strip() or "this state"
        text = f"{verb} is not possible in {here}"
        resumes = any(event.name in hold.release for hold in self.chart.holds.values())
        if resumes and event.name != "mission.start":
            text += " because nothing is paused"
        elif where:
            text += "; it is possible in " + ", ".join(sorted(where))
        return Refusal("not_possible", text)

    def _begin_mission(self, event: Event, values: dict[str, Any]) -> None:
        memory = self.memory
        memory.mission = str(event.data["mission_type"])
        memory.mission_id = str(event.data.get("mission_id", ""))
        memory.started_at = self._turn.now
        memory.request = values
        memory.waiting_actions = []
        memory.walks.clear()
        memory.history.clear()
        memory.current_walk = ""
        memory.code = memory.detail = ""

    # -- holds ------------------------------------------------------------------------------------------

    def _engage_levels(self) -> bool:
        """Engage the holds whose level is true; say whether there were any."""
        inputs = Inputs(self.chart, self.memory, self._turn.now)
        rising = [
            hold
            for hold in self.chart.holds.values()
            if hold.engage.startswith("input.")
            and hold.name not in self.memory.held
            and inputs.holds(hold.engage)
        ]
        for hold in rising:
            self._engage(hold)
        return bool(rising)

    def _engage(self, hold: Hold) -> None:
        first = not self.memory.held
        self.memory.held.append(hold.name)
        self._turn.notes.append(f"hold {hold.name} engaged")
        self._report(hold.code, "")
        if first:
            self._timers.freeze(self._turn.now)
            self._operations.suspend(self._turn)

    def _release(self, name: str) -> None:
        if name not in self.memory.held:
            return
        self.memory.held.remove(name)
        self._turn.notes.append(f"hold {name} released")
        if not self.memory.held:
            self._timers.thaw(self._turn.now)
            self._content.release_actions(self._turn)
            self._operations.resume(self._turn)

    # -- inputs -----------------------------------------------------------------------------------------

    def _observe(self, event: Event) -> None:
        for name, spec in self.chart.inputs.items():
            if spec.value == event.data["name"]:
                self._set_input(name, event.data["value"], event.data["stamp"])

    def _set_input(self, name: str, value: Any, stamp: float) -> None:
        self.memory.inputs[name] = (value, stamp)
        for level in self.chart.inputs[name].levels:
            env = self._env("", NO_CAUSE)
            margin = float(level.hysteresis.evaluate(env)) if level.hysteresis else 0.0
            margin = margin if self.memory.levels.get((name, level.name), False) else 0.0
            if level.below is not None:
                reached = value < float(level.below.evaluate(env)) + margin
            else:
                reached = level.above is not None and value > float(level.above.evaluate(env)) - margin
            self.memory.levels[name, level.name] = reached

    def _report(self, code: str, detail: str) -> None:
        """Remember a code for `last_error`; what is mere information does not replace a warning."""
        declared = self.chart.codes.get(code)
        if declared is None or declared.severity > Severity.INFO:
            self.memory.code, self.memory.detail = code, detail

    # -- the microstep ----------------------------------------------------------------------------------

    def _microstep(self, rules: tuple[Transition, ...], cause: Cause) -> None:
        """Take transitions: exits, their actions, entries; then the holds that they release."""
        turn = self._turn
        exits = self._structure.exits(self.memory.configuration, rules)
        self._remember_history(exits)
        for name in exits:
            self._exit(self.chart.states[name], cause)
        for rule in rules:
            turn.taken.append(rule.id)
            self._content.run(rule.actions, rule.source, cause, turn)
            if rule.code is not None:
                self._report(rule.code, cause.error.get("detail", ""))
        for rule in rules:
            self._enter(self._entries(rule), cause)
        for name in dict.fromkeys(hold for rule in rules for hold in rule.releases):
            self._release(name)
        if not any(map(self._is_ended, self.memory.configuration)):
            turn.trail.append(moment_of(self.chart, self.memory))

    def _exit(self, state: State, cause: Cause) -> None:
        self._content.run(state.exit, state.name, cause, self._turn)
        self._content.forget_actions(state.name)
        self._operations.end(state.name, self._turn)
        self._timers.disarm("after", state.name)
        self.memory.configuration = tuple(n for n in self.memory.configuration if n != state.name)
        self._turn.exited.append(state.name)

    def _entries(self, rule: Transition) -> tuple[str, ...]:
        entered = self._structure.entries(rule, self._remembered, self._default_child, self._resume_child)
        return tuple(name for name in entered if name not in self.memory.configuration)

    def _enter(self, names: Iterable[str], cause: Cause) -> None:
        for name in names:
            state = self.chart.states[name]
            order = self._structure.order
            self.memory.configuration = tuple(
                sorted((*self.memory.configuration, name), key=order.__getitem__)
            )
            self._turn.entered.append(name)
            self._begin_walk(state, cause)
            self._content.run(state.entry, name, cause, self._turn)
            self._arm_timers(state, cause)
            if state.kind is Kind.FINAL:
                self._completed(state)

    def _arm_timers(self, state: State, cause: Cause) -> None:
        for timer in state.timers:
            try:
                delay = float(timer.after.evaluate(self._env(state.name, cause)))
            except Exception as problem:
                self._turn.fail(state.name, f"{timer.place}: after: {problem}")
            else:
                self._timers.arm("after", state.name, self._turn.now, delay, timer.event)

    def _completed(self, final: State) -> None:
        """Raise `done` for the state that a final state ends, and for a parallel one with it."""
        parent = self.chart.states[final.parent or ""]
        if parent.parent is not None and self.chart.states[parent.parent].slot:
            parent = self.chart.states[parent.parent]  # a mission's end is the slot's end
        self._turn.signals.append(Signal("done", parent.name))
        above = self.chart.states.get(parent.parent or "")
        if above is not None and above.kind is Kind.PARALLEL and all(map(self._is_final, above.children)):
            self._turn.signals.append(Signal("done", above.name))

    def _is_ended(self, name: str) -> bool:
        """A final state is a passage to what comes next: nobody should see it."""
        return self.chart.states[name].kind is Kind.FINAL

    def _is_final(self, region: str) -> bool:
        """Say whether a region of a parallel state has come to its end (SCXML: isInFinalState)."""
        state = self.chart.states[region]
        if state.kind is Kind.HISTORY:
            return True
        if state.kind is Kind.PARALLEL:
            return all(map(self._is_final, state.children))
        return any(
            self.chart.states[child].kind is Kind.FINAL and child in self.memory.configuration
            for child in state.children
        )

    # -- itineraries, history ---------------------------------------------------------------------------

    def _begin_walk(self, state: State, cause: Cause) -> None:
        """Lay out the itinerary of a state that is entered for the first time in this mission."""
        if state.itinerary is None:
            return
        if state.name not in self.memory.walks:
            items = self._items(state, state.itinerary, cause)
            self.memory.walks[state.name] = Walk(
                state.name, items, [Visit(_identity(item)) for item in items]
            )
        self.memory.current_walk = state.name

    def _items(self, state: State, itinerary: Itinerary, cause: Cause) -> list[Any]:
        try:
            return list(itinerary.items.evaluate(self._env(state.name, cause)))
        except Exception as problem:
            self._turn.fail(state.name, f"{itinerary.place}: itinerary: {problem}")
            return []

    def _remember_history(self, exits: Sequence[str]) -> None:
        leaving = set(exits)
        for name in exits:
            for child in self.chart.states[name].children:
                state = self.chart.states[child]
                if state.kind is Kind.HISTORY:
                    self.memory.history[child] = self._descendants(name, state.depth, leaving)

    def _descendants(self, name: str, depth: int | None, among: set[str]) -> tuple[str, ...]:
        """Return the active descendants `depth` levels down (None: the leaves), or leaves above that."""
        leaves = set(self._structure.leaves(among))
        base = len(self.chart.ancestors(name))
        found = [
            state
            for state in self.memory.configuration
            if state in among
            and self._structure.is_below(state, name)
            and (state in leaves if depth is None else self._at_depth(state, base + depth, leaves))
        ]
        return tuple(found)

    def _at_depth(self, state: str, depth: int, leaves: set[str]) -> bool:
        level = len(self.chart.ancestors(state))
        return level == depth or (level < depth and state in leaves)

    def _remembered(self, history: State) -> tuple[str, ...]:
        return self.memory.history.get(history.name, ())

    def _default_child(self, state: State) -> str | None:
        if state.slot and self.memory.mission:
            return self.chart.missions[self.memory.mission].state
        return state.initial or next(iter(state.children), None)

    def _resume_child(self, state: State) -> str | None:
        """Choose where a state goes on that comes back by history."""
        rule = next((rule for rule in state.resume_at if self._holds(rule, NO_CAUSE)), None)
        return rule.target if rule else None

    def _structure_defaults(self) -> tuple[str, ...]:
        """Return the states that the chart starts in."""
        start = Transition(
            "start",
            "start",
            "",
            self.chart.states[""].place,
            target=self._default_child(self.chart.states[""]),
        )
        return (
            "",
            *self._structure.entries(start, self._remembered, self._default_child, self._resume_child),
        )


def _identity(item: Any) -> str:
    """Return what a target is called in messages: its `id`, or itself."""
    return str(item["id"]) if isinstance(item, dict) and "id" in item else str(item)
