"""Operations run in attempts: requested, accepted, perhaps cancelling, ended (`LIFE` is the table).

An `Invocation` is one activation of a state's `invoke`, or of its `for_each` for one element; it lives from
the end of the step that entered the state until the state is left, and has one current `Attempt` at a time.
The rules, all implemented here:

* only the current attempt of a live invocation is listened to; other reports are dropped and counted;
* leaving the state, a hold, a timeout or a retry cancels the attempt, and again when the server accepts it
  late; an attempt whose answer waits for a release has ended, and is only forgotten;
* an attempt waits until every earlier one that uses one of its resources has ended, or has been cancelling
  for `CANCEL_DEADLINE` seconds, so that a late cancel can never hit the new goal; it then starts at the end
  of a step, if its invocation still exists;
* a server that does not answer the cancel ends that wait, one that refuses it does not: that attempt keeps
  its resources to its end, and is reported after `REFUSAL_LIMIT` seconds. Only an operation that `replaces`
  begins beside it;
* an attempt that is cut short by a timeout, or by a hold with `on_hold` other than `again`, is awaited for
  up to a cancel's deadline if its operation gives a result then; the state gets failure and result together;
* with `update` the arguments are evaluated again so often. Where an accepted attempt has others, a new
  attempt takes its place: no try more, the same timeout. The old one is replaced: its end is dropped, and it
  is cancelled when the new one ends or is cancelled, or `CANCEL_DEADLINE` seconds after the acceptance of
  that. There is at most one replaced attempt of an invocation;
* a failed attempt is retried up to the number that `retry` gives; one that a hold ended is not counted;
* attempts begin when the configuration is stable, after a hold and a back-off too, so nothing begins in a
  state that the same step leaves.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

from lupin_engine.chart.expressions.evaluation import UnknownValue
from lupin_engine.chart.model import ForEach, Invoke, Retry, State
from lupin_engine.errors import reason
from lupin_engine.machine.actions import ExecutableContent
from lupin_engine.machine.event import (
    ANSWERED,
    NOTHING,
    Cancel,
    Event,
    Failure,
    InternalEvent,
    Start,
    Trigger,
)
from lupin_engine.machine.holds import is_held_back, passes
from lupin_engine.machine.memory import Attempt, CutShort, Invocation, Phase, ResourceClaim
from lupin_engine.machine.scope import OPERATIONS, Arguments, EvaluationScope, Watch
from lupin_engine.machine.step import Macrostep, fields_text
from lupin_engine.machine.structure import Configuration
from lupin_engine.machine.timers import period, seconds
from lupin_engine.plugin.contract import EXECUTION_CODE, REFUSED_CODE, OnHold

#: How long a cancelled attempt may keep its resource, in seconds.
CANCEL_DEADLINE = 3.0
#: How long a server may refuse a cancel until that is reported, in seconds.
REFUSAL_LIMIT = 1.0
#: How many lost attempts are remembered, so that they can be cancelled should they be accepted after all.
MAX_LOST = 64
CANCELLED_CODE = "operation_cancelled"
#: How long the end of what another process began is waited for, in seconds: its server must be found first.
RECOVERY_DEADLINE = 30.0
#: What such an attempt uses: nothing else may begin before it has ended.
EVERYTHING = "*"

#: The deadlines of a replaced attempt: until it is cancelled, and until its cancel is confirmed.
_ENDING = ("replaced", "cancel")
#: What a state's transitions call the end that a server reports.
_ENDS = {"done": "done", "failed": "error", "cancelled": "error"}

_W, _R, _A, _P, _C, _L, _F = Phase
#: The life of an attempt: phase and what happens -> the next phase; None: it has ended and is forgotten.
#: docs/diagrams/attempt.mmd is drawn from this.
LIFE: Mapping[tuple[Phase, str], Phase | None] = MappingProxyType(
    {
        (_W, "resource free"): _R,
        (_W, "not wanted"): None,
        (_R, "accepted"): _A,
        (_R, "done"): None,
        (_R, "failed"): None,
        (_R, "cancelled"): None,
        (_R, "not wanted"): _C,
        (_A, "done"): None,
        (_A, "failed"): None,
        (_A, "cancelled"): None,
        (_A, "not wanted"): _C,
        (_A, "updated"): _P,
        (_P, "done"): None,
        (_P, "failed"): None,
        (_P, "cancelled"): None,
        (_P, "not wanted"): _C,
        (_P, "not ended in time"): _P,
        (_P, "no answer in time"): _L,
        (_P, "cancel_refused"): _F,
        (_C, "accepted"): _C,
        (_C, "done"): None,
        (_C, "failed"): None,
        (_C, "cancelled"): None,
        (_C, "no answer in time"): _L,
        (_C, "cancel_refused"): _F,
        (_L, "accepted"): _L,
        (_L, "done"): None,
        (_L, "failed"): None,
        (_L, "cancelled"): None,
        (_L, "cancel_refused"): _F,
        (_F, "accepted"): _F,
        (_F, "cancel_refused"): _F,
        (_F, "done"): None,
        (_F, "failed"): None,
        (_F, "cancelled"): None,
    }
)


class Operations:
    """The invocations and attempts of one machine."""

    __slots__ = ("_arguments", "_content", "_scope", "watch")

    def __init__(
        self, scope: EvaluationScope, content: ExecutableContent, arguments: dict[int, Arguments]
    ) -> None:
        """Make the operations of a machine.

        Args:
            scope: that of the machine.
            content: runs the `for_each` actions at an element's end.
            arguments: those of the chart's invokes, by id of the invoke.
        """
        self._scope = scope
        self._content = content
        self._arguments = arguments
        self.watch = Watch()
        scope.watches.append(self.watch)

    # -- invocations ------------------------------------------------------------------------------------

    def enter(self, state: str, event: Mapping[str, Any]) -> None:
        """Make the invocation of a state that is entered by an event; it begins at the end of the step."""
        self._scope.memory.invocations[state] = Invocation(self._name(), state, dict(event))

    def begin_missing(self, active: Configuration, step: Macrostep) -> bool:
        """Start waiting attempts and the operations that active states lack; say whether there were any."""
        scope = self._scope
        if not self.watch.is_due(active.work, step.now):
            return False
        scope.doubtful = False
        begun = self._start_waiting(step)
        begun = self._settle(active, step) or begun
        for state in active.working:
            if state.for_each is not None:
                begun = self._take_up(state.name, state.for_each, step) or begun
        waiting = [
            found
            for found in self._of(active.working)
            if not found.begun and not is_held_back(scope.memory, self._invoke(found))
        ]
        # Before anything is begun: what an attempt that cannot be made changes is looked at again.
        self.watch.cache_false(active.work, scope, step.now)
        for invocation in waiting:
            invocation.begun = True
            self._issue(invocation, step)
        return begun or bool(waiting)

    def _name(self) -> str:
        return f"i{self._scope.memory.fresh_id()}"

    def end(self, state: State, step: Macrostep) -> None:
        """End the invocations of a state that is being left."""
        for invocation in self._of((state,)):
            del self._scope.memory.invocations[invocation.name]
            if invocation.attempt:
                self._count(invocation, -1)
            self._scope.timers.disarm("retry", invocation.id)
            self._cancel_current(invocation, step)

    def _of(self, states: Iterable[State]) -> list[Invocation]:
        """Return the invocations of some states; those of the elements of one in their order."""
        invocations, found = self._scope.memory.invocations, []
        for state in states:
            if state.invoke is not None and state.name in invocations:
                found.append(invocations[state.name])
            if state.for_each is not None:
                found += [invocations[name] for name in self._elements(state.name)]
        return found

    def _elements(self, state: str) -> list[str]:
        """Return the names of the invocations of a state's elements, in their order."""
        prefix = f"{state}["
        return [name for name in self._scope.memory.invocations if name.startswith(prefix)]

    def _every(self) -> list[Invocation]:
        """Return all invocations, in the order of the document."""
        return self._of(map(self._scope.chart.states.__getitem__, self._scope.memory.configuration))

    def suspend(self, step: Macrostep) -> None:
        """Interrupt the operations with `on_hold: cancel` when the first hold is engaged."""
        for invocation in self._every():
            invoke = self._invoke(invocation)
            if invoke.operation.on_hold is OnHold.CANCEL and invocation.attempt:
                self._interrupt(invocation, "hold", step)

    def recover(self, step: Macrostep) -> None:
        """Take over after a restart: cancel the attempts of the old process, to begin them again later.

        Operations that can be adopted and finish during a hold go on. Results of the others are ignored.
        Nothing begins before their end is confirmed, or `RECOVERY_DEADLINE` has passed.
        """
        memory = self._scope.memory
        for invocation in self._every():
            attempt = memory.attempts.get(invocation.attempt or "")
            if attempt is None:
                continue
            invoke = self._invoke(invocation)
            begun = attempt.phase in (Phase.REQUESTED, Phase.ACCEPTED)
            goes_on = begun and invoke.operation.adopts and invoke.operation.on_hold is OnHold.FINISH
            if goes_on and self._replaced(invocation) is None:
                continue
            self._interrupt(invocation, "restart", step)
        for attempt in memory.attempts.values():
            if attempt.phase in (Phase.REQUESTED, Phase.ACCEPTED):
                attempt.phase = Phase.ACCEPTED  # or the server does not know it, and will say so
                step.note(f"{attempt.operation} goes on")
                continue
            for kind in _ENDING:
                self._scope.timers.disarm(kind, attempt.id)
            self._scope.timers.arm("cancel", attempt.id, step.now, RECOVERY_DEADLINE)
            if not any(isinstance(c, Cancel) and c.attempt == attempt.id for c in step.commands):
                step.commands.append(Cancel(attempt.id, attempt.operation))
            attempt.phase, attempt.uses = Phase.CANCELLING, (EVERYTHING,)
        self._scope.mark_dirty(OPERATIONS)

    def _interrupt(self, invocation: Invocation, why: str, step: Macrostep) -> None:
        """Cancel the attempt: it is begun again later and its try refunded, or fails as `on_hold` says."""
        attempt = self._scope.memory.attempts[invocation.attempt or ""]
        on_hold = self._invoke(invocation).on_hold
        if on_hold and attempt.phase is not Phase.WAITING:
            cut = CutShort(attempt.id, CANCELLED_CODE, f"cut short by a {why}", on_hold)
            self._cut_short(invocation, cut, step)
            return
        self._cancel_current(invocation, step)
        invocation.tries -= 1
        self._count(invocation, -1)
        invocation.begun = False

    def _cut_short(self, invocation: Invocation, cut: CutShort, step: Macrostep) -> None:
        """Cancel the attempt, and await its result where its operation declares one."""
        self._cancel_current(invocation, step)
        gives = self._invoke(invocation).operation.cut_short
        cut.over = not gives or cut.attempt not in self._scope.memory.attempts
        invocation.cut = cut
        self._scope.mark_dirty(OPERATIONS)

    def _gave(self, attempt: Attempt, result: Mapping[str, Any] | None, step: Macrostep) -> bool:
        """Store the result of an attempt that was cut short; say whether its invocation waits for it."""
        invocation = self._scope.memory.invocations.get(attempt.invocation)
        cut = None if invocation is None else invocation.cut
        if cut is None or cut.attempt != attempt.id or cut.over:
            return False
        cut.over, cut.result = True, result
        if result:
            step.note(f"{attempt.operation} gave {fields_text(result)}")
        self._scope.mark_dirty(OPERATIONS)
        return True

    def _settle(self, active: Configuration, step: Macrostep) -> bool:
        """Signal the ends of operations that were cut short; say whether there were any."""
        memory = self._scope.memory
        over = [found for found in self._of(active.working) if found.cut is not None and found.cut.over]
        for invocation in () if memory.held else over:
            cut, invocation.cut = invocation.cut, None
            assert cut is not None
            result = cut.result if self._invoke(invocation).operation.result else NOTHING
            if cut.way == "continue" and result is not None:
                self._signal("done", invocation, Trigger(event=result), step)
            elif cut.way:  # no try: nothing was wrong with it
                self._scope.record_code(cut.code, cut.detail, step)
                self._signal("error", invocation, _failure(cut.code, cut.detail, cut.result), step)
            else:
                self._failed(invocation, cut.code, cut.detail, step, cut.result)
        return bool(over) and not memory.held

    # -- one invocation for each element ------------------------------------------------------------------

    def _take_up(self, state: str, rule: ForEach, step: Macrostep) -> bool:
        """Start the operations of new elements, as many as may run at once; say whether there were any."""
        memory = self._scope.memory
        if memory.held:
            return False
        try:
            items = list(rule.items.evaluate(self._scope.see(state, step)))
            limit = int(rule.limit.evaluate(self._scope.see(state, step))) if rule.limit else None
        except UnknownValue:
            return False  # nothing is known of the collection yet
        except Exception as problem:
            self._scope.doubtful = True
            step.fail_once(state, f"{rule.place}: for_each: {reason(problem)}")
            return False
        new: dict[str, Any] = {}
        for item in items:
            key = self._key(state, rule, item, step)
            if key is not None and self._is_new(state, key):
                new.setdefault(key, item)
        running = len(self._elements(state))
        begun = list(new.items())[: None if limit is None else max(0, limit - running)]
        for key, item in begun:
            found = Invocation(self._name(), state, key=key, item=item)
            memory.invocations[found.name] = found
        return bool(begun)

    def _key(self, state: str, rule: ForEach, item: Any, step: Macrostep) -> str | None:
        """Return an element's key, or None when the element is not wanted, or cannot be judged now."""
        env = self._scope.see(state, step, Trigger(item=item))
        try:
            wanted = rule.when.evaluate(env)
            return str(rule.key.evaluate(env)) if wanted else None
        except UnknownValue:
            return None
        except Exception as problem:
            self._scope.doubtful = True
            step.fail_once(state, f"{rule.place}: for_each: {reason(problem)}")
            return None

    def _is_new(self, state: str, key: str) -> bool:
        memory = self._scope.memory
        return key not in memory.handled.get(state, ()) and f"{state}[{key}]" not in memory.invocations

    def _end_element(self, invocation: Invocation, word: str, trigger: Trigger, step: Macrostep) -> None:
        """The operation for one element has ended for good: never take that element up again."""
        rule = self._scope.chart.states[invocation.state].for_each
        assert rule is not None, f"{invocation.name} has no for_each"
        self._scope.memory.handled.setdefault(invocation.state, []).append(str(invocation.key))
        del self._scope.memory.invocations[invocation.name]
        self._scope.mark_dirty(OPERATIONS)
        if trigger.error.get("code") == EXECUTION_CODE:
            step.fail(invocation.state, trigger.error["detail"])
        actions = rule.on_done if word == "done" else rule.on_error
        self._content.run(actions, invocation.state, trigger, step)

    # -- attempts ---------------------------------------------------------------------------------------

    def _invoke(self, invocation: Invocation) -> Invoke:
        state = self._scope.chart.states[invocation.state]
        invoke = state.for_each.invoke if invocation.key is not None and state.for_each else state.invoke
        assert invoke is not None, f"{invocation.name} was invoked without an invoke"
        return invoke

    def _issue(self, invocation: Invocation, step: Macrostep) -> None:
        """Make a new attempt, evaluating the arguments now; start it when its resources are free."""
        invoke = self._invoke(invocation)
        env = self._scope.see(invocation.state, step, _cause(invocation))
        try:
            arguments = self._arguments_of(invoke).evaluate(env)
            timeout = seconds(invoke.timeout.evaluate(env)) if invoke.timeout else None
        except Exception as problem:
            self._signal(
                "error", invocation, _failure(EXECUTION_CODE, f"{invoke.place}: {reason(problem)}"), step
            )
            return
        number = f"a{self._scope.memory.fresh_id()}"
        uses = invoke.operation.uses
        attempt = Attempt(number, invocation.name, invoke.name, arguments, uses, Phase.WAITING, "", timeout)
        self._scope.memory.attempts[number] = attempt
        invocation.attempt = number
        invocation.tries += 1
        self._count(invocation, 1)
        other = self._before(attempt)
        if other is None:
            self._start(attempt, step)
        else:
            step.note(f"{attempt.operation} waits until {other.operation} has ended")

    def _arguments_of(self, invoke: Invoke) -> Arguments:
        found = self._arguments.get(id(invoke))
        if found is None:
            # The chart keeps its invokes as long as it lives, so that an id means one of them.
            found = self._arguments[id(invoke)] = Arguments(invoke.arguments, invoke.operation.arguments)
        return found

    def _count(self, invocation: Invocation, by: int) -> None:
        """Count a try, or take it back, for the visit that it serves: the open one of a state around it."""
        memory = self._scope.memory
        if memory.current_itinerary not in self._scope.chart.lineage[invocation.state]:
            return
        traversal = memory.traversal
        visit = traversal.visit if traversal is not None else None
        if visit is not None and not visit.closed:
            name = self._invoke(invocation).name
            visit.tries[name] = visit.tries.get(name, 0) + by

    def _move(self, attempt: Attempt, word: str, step: Macrostep) -> None:
        """Lead an attempt on in its life; one that has ended or is lost leaves its resources free."""
        phase = LIFE[attempt.phase, word]
        if phase is None or phase is Phase.LOST:
            self._scope.mark_dirty(OPERATIONS)
        if phase is not None:
            attempt.phase = phase
            return
        ending = attempt.phase in (Phase.CANCELLING, Phase.REFUSED)
        deadlines = ("cancel",) if ending else _ENDING if attempt.phase is Phase.REPLACED else ("timeout",)
        for deadline in deadlines:
            self._scope.timers.disarm(deadline, attempt.id)
        del self._scope.memory.attempts[attempt.id]

    def _before(self, attempt: Attempt) -> Attempt | None:
        """Return the attempt that holds a resource of this one, or waits longer for it; None: all are free.

        One that has begun later is an update, which took the place of an earlier one.
        """
        memory, is_later = self._scope.memory, False
        replaces = self._invoke(memory.invocations[attempt.invocation]).operation.replaces
        for claim in memory.claims:
            is_later = is_later or claim.attempt == attempt.id
            if (claim.refused and replaces) or (is_later and claim.waits):
                continue
            if _meets(claim, attempt):
                return memory.attempts[claim.attempt]
        return None

    def _start(self, attempt: Attempt, step: Macrostep) -> None:
        self._move(attempt, "resource free", step)
        serves, timers = self._scope.memory.invocations[attempt.invocation], self._scope.timers
        command = Start(attempt.id, attempt.operation, attempt.arguments, serves.state, serves.tries)
        step.commands.append(command)
        if attempt.timeout is not None:
            # The limit of one that is updated goes on with the next attempt.
            is_updated = self._invoke(serves).update is not None
            timers.arm("timeout", serves.id if is_updated else attempt.id, step.now, attempt.timeout)
        self._await_update(serves, step)

    def _await_update(self, invocation: Invocation, step: Macrostep) -> None:
        """Set the time of the next update; if that is an error now, the step has it, and none follows."""
        update = self._invoke(invocation).update
        if update is None:
            return
        try:
            delay = period(update.evaluate(self._scope.see(invocation.state, step, _cause(invocation))))
        except Exception as problem:
            step.fail(invocation.state, f"{update.place}: update: {reason(problem)}")
            return
        self._scope.timers.arm("update", invocation.id, step.now, delay)

    def _start_waiting(self, step: Macrostep) -> bool:
        """Start the attempts whose resources have become free; say whether there were any."""
        memory = self._scope.memory
        waiting = [memory.attempts[claim.attempt] for claim in memory.claims if claim.waits]
        free = [attempt for attempt in waiting if self._before(attempt) is None]
        for attempt in free:
            self._start(attempt, step)
        return bool(free)

    def update(self, attempt_id: str, step: Macrostep) -> None:
        """Send an accepted attempt's arguments anew where they have changed: the time for that has come.

        A server that has not answered the last update, or has not ended what that replaced, gets none.
        """
        attempt = self._scope.memory.attempts[attempt_id]
        invocation = self._scope.memory.invocations[attempt.invocation]
        self._await_update(invocation, step)
        claims = (claim for claim in self._scope.memory.claims if not claim.waits)
        is_busy = any(claim.updated == invocation.name or _meets(claim, attempt) for claim in claims)
        if attempt.phase is not Phase.ACCEPTED or attempt.answer is not None or is_busy:
            return
        arguments = self.new_arguments(invocation, attempt, step)
        if arguments is None:
            return
        number, uses = f"a{self._scope.memory.fresh_id()}", attempt.uses
        after = Attempt(
            number, invocation.name, attempt.operation, arguments, uses, Phase.REQUESTED, "", attempt.timeout
        )
        self._scope.memory.attempts[number] = after
        invocation.attempt = number
        self._move(attempt, "updated", step)
        step.commands.append(
            Start(number, after.operation, arguments, invocation.state, invocation.tries, attempt.id)
        )

    def new_arguments(
        self, invocation: Invocation, attempt: Attempt, step: Macrostep
    ) -> Mapping[str, Any] | None:
        """Return the arguments as they are now; None where they are the attempt's, or are not known."""
        invoke = self._invoke(invocation)
        try:
            env = self._scope.see(invocation.state, step, _cause(invocation))
            found = self._arguments_of(invoke).evaluate(env)
        except UnknownValue:
            return None
        except Exception as problem:
            step.note(f"{attempt.operation} is not updated: {invoke.place}: {reason(problem)}")
            return None
        return None if found == attempt.arguments else found

    def _replaced(self, invocation: Invocation) -> Attempt | None:
        """Return the attempt that the current one of an invocation has replaced, unless it has ended."""
        if self._invoke(invocation).update is None:
            return None
        memory = self._scope.memory
        found = (claim.attempt for claim in memory.claims if claim.updated == invocation.name)
        return next((memory.attempts[name] for name in found), None)

    def _cancel_current(self, invocation: Invocation, step: Macrostep) -> None:
        attempt = self._scope.memory.attempts.get(invocation.attempt or "")
        invocation.attempt = None
        if attempt is None:
            return
        self._stop_clocks(invocation, attempt)
        if attempt.phase is Phase.WAITING:
            self._move(attempt, "not wanted", step)
        elif not self._forget_answer(attempt, step):
            self._cancel(attempt, step)
        self._cancel_replaced(invocation, step)

    def _stop_clocks(self, invocation: Invocation, attempt: Attempt) -> None:
        """Stop the deadlines of an attempt that is not waited for any more."""
        self._scope.timers.disarm("timeout", attempt.id)
        if self._invoke(invocation).update is not None:
            self._scope.timers.disarm("timeout", invocation.id)
            self._scope.timers.disarm("update", invocation.id)

    def _cancel(self, attempt: Attempt, step: Macrostep) -> None:
        step.commands.append(Cancel(attempt.id, attempt.operation))
        self._scope.timers.arm("cancel", attempt.id, step.now, CANCEL_DEADLINE)
        self._move(attempt, "not wanted", step)

    def _cancel_replaced(self, invocation: Invocation, step: Macrostep) -> None:
        """Cancel what the current attempt has replaced, now that this has ended or is cancelled itself."""
        replaced = self._replaced(invocation)
        if replaced is not None:
            for kind in _ENDING:
                self._scope.timers.disarm(kind, replaced.id)
            self._cancel(replaced, step)

    def not_ended(self, attempt_id: str, step: Macrostep) -> None:
        """Cancel a replaced attempt, which its server has not ended in time."""
        attempt = self._scope.memory.attempts[attempt_id]
        step.note(f"{attempt.operation} still works on a goal that was replaced")
        step.commands.append(Cancel(attempt.id, attempt.operation))
        self._scope.timers.arm("cancel", attempt.id, step.now, CANCEL_DEADLINE)
        self._move(attempt, "not ended in time", step)

    def _forget_answer(self, attempt: Attempt, step: Macrostep) -> bool:
        """Drop the answer that waits for a release, if the attempt has one."""
        if attempt.answer is None:
            return False
        self._scope.memory.deferred.remove(_answered(attempt))
        kind = attempt.answer.name.removeprefix("attempt.")
        self._drop(kind, attempt.id, step)
        self._move(attempt, kind, step)
        return True

    # -- what servers and clocks say --------------------------------------------------------------------

    def report(self, event: Event, step: Macrostep) -> None:
        """Handle a server's report about an attempt."""
        kind = event.name.removeprefix("attempt.")
        attempt = self._scope.memory.attempts.get(event.data["attempt"])
        if attempt is None:
            self._drop(kind, event.data["attempt"], step)
            if kind == "cancel_refused" and self._scope.memory.held:  # its server has said that it ended
                self._scope.record_code(REFUSED_CODE, event.data["detail"], step)
        elif attempt.phase in (Phase.CANCELLING, Phase.LOST, Phase.REFUSED):
            self._report_unwanted(kind, attempt, event.data, step)
        elif kind == "progress":
            attempt.detail = event.data["detail"]
        elif (attempt.phase, kind) not in LIFE or attempt.answer is not None:
            now = attempt.phase.value if attempt.answer is None else "over: its answer waits for the release"
            step.note(f"dropped: {kind} of attempt {attempt.id}, which is {now}")
        elif attempt.phase is Phase.REPLACED:
            self._report_replaced(kind, attempt, event.data, step)
        elif kind == "accepted":
            self._move(attempt, kind, step)
            replaced = self._replaced(self._scope.memory.invocations[attempt.invocation])
            if replaced is not None:
                self._scope.timers.arm("replaced", replaced.id, step.now, CANCEL_DEADLINE)
        elif self._scope.memory.held and not self._may_pass(attempt, kind):
            self._scope.timers.disarm("timeout", attempt.id)
            attempt.phase, attempt.answer = Phase.ACCEPTED, event  # who answers has accepted
            self._scope.memory.deferred.append(_answered(attempt))
            step.note(f"the answer of {attempt.operation} waits for the release")
        else:
            self._end_current(kind, attempt, event.data, step)

    def hear_answer(self, attempt_id: str, step: Macrostep) -> None:
        """Take in the answer of an attempt that has waited for the release."""
        attempt = self._scope.memory.attempts[attempt_id]
        event, attempt.answer = attempt.answer, None
        assert event is not None, f"{attempt_id} has not answered"
        self.report(event, step)

    def _may_pass(self, attempt: Attempt, kind: str) -> bool:
        """Say whether every transition for this end of the operation passes the engaged holds.

        All are asked because guards are evaluated only when the answer is handled.
        """
        state = self._scope.chart.states.get(attempt.invocation)
        rules = [rule for rule in state.transitions if rule.event == _ENDS[kind]] if state else []
        return bool(rules) and all(passes(rule, self._scope.memory) for rule in rules)

    def _drop(self, kind: str, attempt: str, step: Macrostep) -> None:
        if kind in ("done", "failed"):
            self._scope.memory.dropped += 1
            step.note(f"dropped: {kind} of attempt {attempt}, which nobody waits for")

    def _report_replaced(self, kind: str, attempt: Attempt, data: Mapping[str, Any], step: Macrostep) -> None:
        """Drop what a server says about an attempt that an update has replaced."""
        if kind == "cancel_refused":
            self._scope.timers.disarm("replaced", attempt.id)
            self._be_refused(attempt, data["detail"], step)
        self._move(attempt, kind, step)

    def _report_unwanted(self, kind: str, attempt: Attempt, data: Mapping[str, Any], step: Macrostep) -> None:
        if kind == "progress":
            return
        if kind == "accepted":
            step.commands.append(Cancel(attempt.id, attempt.operation))
            step.note(f"{attempt.operation} was accepted after its cancel: cancelled again")
        elif kind == "cancel_refused":
            self._be_refused(attempt, data["detail"], step)
        elif not self._gave(attempt, data.get("result"), step):
            self._drop(kind, attempt.id, step)
        self._move(attempt, kind, step)

    def _be_refused(self, attempt: Attempt, detail: str, step: Macrostep) -> None:
        """Note that the server refuses the cancel: the attempt keeps its resources to its end."""
        if attempt.phase is Phase.REFUSED:
            return
        declared = self._scope.chart.catalog.operations.get(attempt.operation)
        if EVERYTHING in attempt.uses and declared is not None:
            attempt.uses = declared.uses  # what another process has left behind is there, and known
        attempt.detail = detail
        step.note(f"{attempt.operation} refuses to end")
        self._scope.timers.disarm("cancel", attempt.id)
        self._scope.timers.arm("cancel", attempt.id, step.now, REFUSAL_LIMIT)
        self._scope.mark_dirty(OPERATIONS)

    def _end_current(self, kind: str, attempt: Attempt, data: Mapping[str, Any], step: Macrostep) -> None:
        invocation = self._scope.memory.invocations[attempt.invocation]
        invocation.attempt = None
        self._stop_clocks(invocation, attempt)
        self._move(attempt, kind, step)
        self._cancel_replaced(invocation, step)
        if kind == "done":
            self._signal("done", invocation, Trigger(event=data["result"]), step)
        elif kind == "failed":
            self._failed(invocation, data["code"], data["detail"] or attempt.detail, step)
        else:
            self._failed(invocation, CANCELLED_CODE, "ended by the server", step)

    def of_deadline(self, owner: str) -> str:
        """Return the attempt that a deadline is about, given its owner: that itself, or its invocation."""
        if owner in self._scope.memory.attempts:
            return owner
        return next(found.attempt or "" for found in self._every() if found.id == owner)

    def timed_out(self, attempt_id: str, step: Macrostep) -> None:
        """The attempt took too long: cancel it and count it as failed."""
        attempt = self._scope.memory.attempts[attempt_id]
        invocation = self._scope.memory.invocations[attempt.invocation]
        invoke = self._invoke(invocation)
        code = invoke.timeout_code or "timeout"
        if invoke.operation.cut_short:
            self._cut_short(invocation, CutShort(attempt_id, code, attempt.detail), step)
            return
        self._cancel_current(invocation, step)
        self._failed(invocation, code, attempt.detail, step)

    def abandon(self, attempt_id: str, step: Macrostep) -> None:
        """Stop waiting for a cancel that was never confirmed; a late accept is still cancelled.

        An attempt whose cancel was refused is reported, and stays.
        """
        attempts = self._scope.memory.attempts
        attempt = attempts[attempt_id]
        if attempt.phase is Phase.REFUSED:
            self._scope.record_code(REFUSED_CODE, attempt.detail, step)
        else:
            self._move(attempt, "no answer in time", step)
            limit = RECOVERY_DEADLINE if EVERYTHING in attempt.uses else CANCEL_DEADLINE
            step.note(f"{attempt.operation} did not confirm its cancel in {limit:g} s")
        self._gave(attempt, None, step)
        lost = [found.id for found in attempts.values() if _keeps_nothing(found)]
        for oldest in lost[:-MAX_LOST]:
            self._scope.timers.disarm("cancel", oldest)
            del attempts[oldest]

    def retry(self, invocation_id: str) -> None:
        """Mark the invocation to be tried again at the end of this step: the back-off is over."""
        next(found for found in self._every() if found.id == invocation_id).begun = False
        self._scope.mark_dirty(OPERATIONS)

    def _failed(
        self,
        invocation: Invocation,
        code: str,
        detail: str,
        step: Macrostep,
        result: Mapping[str, Any] | None = None,
    ) -> None:
        self._scope.record_code(code, detail, step)
        if not self._try_again(invocation, code, step):
            self._signal("error", invocation, _failure(code, detail, result), step)

    def _try_again(self, invocation: Invocation, code: str, step: Macrostep) -> bool:
        rule = self._invoke(invocation).retry
        if rule is None or code in rule.unless:
            return False
        env = self._scope.see(invocation.state, step, _cause(invocation))
        try:
            attempts = int(rule.attempts.evaluate(env))
            pause = self._pause(rule, invocation, env)
        except Exception as problem:
            step.note(f"{rule.attempts.place}: retry: {reason(problem)}")
            return False
        if invocation.tries >= attempts:
            return False
        step.note(f"try {invocation.tries} failed ({code}); next in {pause:g} s")
        self._scope.timers.arm("retry", invocation.id, step.now, pause)
        return True

    def _pause(self, rule: Retry, invocation: Invocation, env: Mapping[str, Any]) -> float:
        """Return how long to wait before the next try, in seconds.

        The share of the jitter is drawn from the world's seed, the mission and the attempt, so that the same
        inputs give the same pauses, and two robots different ones.
        """
        pause = float(rule.backoff.evaluate(env)) if rule.backoff else 0.0
        factor = float(rule.factor.evaluate(env)) if rule.factor else 1.0
        jitter = float(rule.jitter.evaluate(env)) if rule.jitter else 0.0
        drawn = f"{self._scope.world.seed}/{self._scope.memory.mission_id}/{invocation.id}/{invocation.tries}"
        share = zlib.crc32(drawn.encode(errors="replace")) / 0xFFFFFFFF
        return seconds(pause * factor ** (invocation.tries - 1) * (1.0 + jitter * (2.0 * share - 1.0)))

    def _signal(self, word: str, invocation: Invocation, trigger: Trigger, step: Macrostep) -> None:
        """Raise the operation's end for the state; for an element of a `for_each`, handle it at once."""
        if invocation.key is None:
            step.queue.append(InternalEvent(word, invocation.state, trigger))
        else:
            with_item = Trigger(trigger.event, trigger.error, invocation.item)
            self._end_element(invocation, word, with_item, step)


def _meets(claim: ResourceClaim, attempt: Attempt) -> bool:
    """Say whether a claim is on a resource of an attempt that is another's."""
    shares = EVERYTHING in claim.uses or not set(attempt.uses).isdisjoint(claim.uses)
    return shares and claim.attempt != attempt.id


def _keeps_nothing(attempt: Attempt) -> bool:
    """Say whether nothing waits for the end of an attempt that did not end when it was to."""
    return attempt.phase is Phase.LOST or (attempt.phase is Phase.REFUSED and not attempt.uses)


def _answered(attempt: Attempt) -> Event:
    """Return the deferred event that stands for an attempt's answer."""
    return Event(ANSWERED, {"attempt": attempt.id})


def _cause(invocation: Invocation) -> Trigger:
    """Return the event and element that expressions of an invocation see."""
    return Trigger(event=invocation.event, item=invocation.item)


def _failure(code: str, detail: str, result: Mapping[str, Any] | None = None) -> Trigger:
    error = Failure({"code": code, "detail": detail})
    if result is not None:
        error["result"] = result
    return Trigger(event=error, error=error)
