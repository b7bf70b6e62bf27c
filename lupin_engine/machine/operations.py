"""Operations in attempts: requested, accepted, perhaps cancelling, ended.

An `Invocation` is one activation of a state's `invoke`; it lives from the end of the step that entered the
state until the state is left. It speaks through one `Attempt` at a time. The rules, all kept here:

* only the current attempt of a live invocation can speak; what another one says is dropped and counted;
* leaving the state, a hold, a timeout or a retry ends the attempt: it is cancelled, and cancelled again
  when the server accepts it late; one whose answer waits for a release has ended, and is only forgotten;
* an attempt waits until every earlier one that uses one of its resources has ended, or has been cancelling
  for `CANCEL_DEADLINE` seconds, so that a late cancel can never hit the new goal;
* a failed attempt is tried again up to the number that `retry` gives; one that a hold ended is refunded.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lupin_engine.chart.model import Invoke
from lupin_engine.machine.environment import Cause, World, environment
from lupin_engine.machine.event import Cancel, Event, Start
from lupin_engine.machine.memory import Attempt, Invocation, Memory, Phase
from lupin_engine.machine.timers import Timers
from lupin_engine.machine.turn import EXECUTION_CODE, Signal, Turn
from lupin_engine.plugin.contract import OnHold

#: How long a cancelled attempt may keep its resource, in seconds (the reference's grace before docking).
CANCEL_DEADLINE = 3.0
#: What a state's transitions call the end that a server reports.
_ENDS = {"done": "done", "failed": "error", "cancelled": "error"}
CANCELLED_CODE = "operation_cancelled"


class Operations:
    """The invocations and attempts of one memory."""

    def __init__(
        self,
        world: World,
        memory: Memory,
        timers: Timers,
        report: Callable[[str, str], None],
        passes_holds: Callable[[str, str], bool],
    ) -> None:
        """Make the operations of `memory`.

        Args:
            report: takes a code and its detail for `last_error`.
            passes_holds: says whether a state has a transition for an event that engaged holds let through.
        """
        self._world = world
        self._memory = memory
        self._timers = timers
        self._report = report
        self._passes_holds = passes_holds

    # -- invocations ------------------------------------------------------------------------------------

    def begin_missing(self, turn: Turn) -> bool:
        """Begin the invocations of the active states that have none yet; say whether there were any."""
        begun = False
        for name in self._memory.configuration:
            invoke = self._world.chart.states[name].invoke
            if invoke is not None and name not in self._memory.invocations:
                self._begin(name, invoke, turn)
                begun = True
        return begun

    def _begin(self, state: str, invoke: Invoke, turn: Turn) -> None:
        invocation = Invocation(f"i{self._memory.fresh_id()}", state)
        self._memory.invocations[state] = invocation
        if self._memory.held and invoke.operation.on_hold is OnHold.CANCEL:
            invocation.suspended = True
        else:
            self._issue(invocation, turn)

    def end(self, state: str, turn: Turn) -> None:
        """End the invocation of a state that is being left."""
        invocation = self._memory.invocations.pop(state, None)
        if invocation is None:
            return
        self._timers.disarm("retry", invocation.id)
        self._cancel_current(invocation, turn)

    def suspend(self, turn: Turn) -> None:
        """A hold was engaged: cancel what moves the robot, and refund the try."""
        for invocation in self._memory.invocations.values():
            if self._invoke(invocation).operation.on_hold is OnHold.CANCEL and invocation.attempt:
                self._cancel_current(invocation, turn)
                invocation.tries -= 1
                invocation.suspended = True

    def resume(self, turn: Turn) -> None:
        """The last hold was released: issue again what was suspended."""
        for invocation in list(self._memory.invocations.values()):
            if invocation.suspended:
                invocation.suspended = False
                self._issue(invocation, turn)

    # -- attempts ---------------------------------------------------------------------------------------

    def _invoke(self, invocation: Invocation) -> Invoke:
        invoke = self._world.chart.states[invocation.state].invoke
        assert invoke is not None, f"{invocation.state} was invoked without an invoke"
        return invoke

    def _issue(self, invocation: Invocation, turn: Turn) -> None:
        """Make a new attempt, evaluating the arguments now; start it when its resources are free."""
        invoke = self._invoke(invocation)
        env = environment(self._world, self._memory, invocation.state, turn.now, Cause())
        try:
            arguments = {name: value.evaluate(env) for name, value in invoke.arguments.items()}
            timeout = float(invoke.timeout.evaluate(env)) if invoke.timeout else None
        except Exception as problem:
            self._signal_error(invocation, EXECUTION_CODE, f"{invoke.place}: {problem}", turn)
            return
        number = f"a{self._memory.fresh_id()}"
        uses = invoke.operation.uses
        attempt = Attempt(number, invocation.state, invoke.name, arguments, uses, Phase.WAITING, "", timeout)
        self._memory.attempts[number] = attempt
        invocation.attempt = number
        invocation.tries += 1
        self._start_if_free(attempt, turn)

    def _start_if_free(self, attempt: Attempt, turn: Turn) -> None:
        for other in self._memory.attempts.values():
            if other is attempt:
                break
            if set(other.uses) & set(attempt.uses):
                turn.notes.append(f"{attempt.operation} waits until {other.operation} has ended")
                return
        attempt.phase = Phase.REQUESTED
        turn.commands.append(Start(attempt.id, attempt.operation, attempt.arguments))
        if attempt.timeout is not None:
            self._timers.arm("timeout", attempt.id, turn.now, attempt.timeout)

    def _cancel_current(self, invocation: Invocation, turn: Turn) -> None:
        attempt = self._memory.attempts.get(invocation.attempt or "")
        invocation.attempt = None
        if attempt is None:
            return
        self._timers.disarm("timeout", attempt.id)
        if attempt.phase is Phase.WAITING or self._forget_answer(attempt, turn):
            self._remove(attempt, turn)
            return
        turn.commands.append(Cancel(attempt.id, attempt.operation))
        if attempt.uses:
            self._timers.arm("cancel", attempt.id, turn.now, CANCEL_DEADLINE)
        elif attempt.phase is Phase.ACCEPTED:
            self._remove(attempt, turn)
            return
        attempt.phase = Phase.CANCELLING

    def _forget_answer(self, attempt: Attempt, turn: Turn) -> bool:
        """Drop the answer that waits for a release, if the attempt has one."""
        waiting = [event for event in self._memory.deferred if event.data["attempt"] == attempt.id]
        for event in waiting:
            self._memory.deferred.remove(event)
            self._drop(event.name.removeprefix("attempt."), attempt.id, turn)
        return bool(waiting)

    def _remove(self, attempt: Attempt, turn: Turn) -> None:
        """Forget an attempt that ended, and start what waited for its resources."""
        self._timers.disarm("timeout", attempt.id)
        self._timers.disarm("cancel", attempt.id)
        self._memory.attempts.pop(attempt.id, None)
        self._start_waiting(turn)

    def _start_waiting(self, turn: Turn) -> None:
        for waiting in list(self._memory.attempts.values()):
            if waiting.phase is Phase.WAITING and not self._memory.held:
                self._start_if_free(waiting, turn)

    # -- what servers and clocks say --------------------------------------------------------------------

    def report(self, event: Event, turn: Turn) -> None:
        """Take in what a server says of an attempt."""
        kind = event.name.removeprefix("attempt.")
        attempt = self._memory.attempts.get(event.data["attempt"])
        if attempt is None:
            self._drop(kind, event.data["attempt"], turn)
        elif attempt.phase is Phase.CANCELLING:
            self._report_unwanted(kind, attempt, turn)
        elif kind == "accepted":
            attempt.phase = Phase.ACCEPTED
        elif kind == "progress":
            attempt.detail = event.data["detail"]
        elif self._memory.held and not self._passes_holds(attempt.invocation, _ENDS[kind]):
            self._timers.disarm("timeout", attempt.id)
            self._memory.deferred.append(event)
            turn.notes.append(f"the answer of {attempt.operation} waits for the release")
        else:
            self._end_current(kind, attempt, event.data, turn)

    def _drop(self, kind: str, attempt: str, turn: Turn) -> None:
        if kind in ("done", "failed"):
            self._memory.dropped += 1
            turn.notes.append(f"dropped: {kind} of attempt {attempt}, which nobody waits for")

    def _report_unwanted(self, kind: str, attempt: Attempt, turn: Turn) -> None:
        if kind == "accepted":
            turn.commands.append(Cancel(attempt.id, attempt.operation))
            turn.notes.append(f"{attempt.operation} was accepted after its cancel: cancelled again")
        elif kind != "progress":
            self._drop(kind, attempt.id, turn)
            self._remove(attempt, turn)

    def _end_current(self, kind: str, attempt: Attempt, data: Mapping[str, Any], turn: Turn) -> None:
        invocation = self._memory.invocations[attempt.invocation]
        invocation.attempt = None
        self._remove(attempt, turn)
        if kind == "done":
            turn.signals.append(Signal("done", invocation.state, Cause(event=data["result"])))
        elif kind == "failed":
            self._failed(invocation, data["code"], data["detail"] or attempt.detail, turn)
        else:
            self._failed(invocation, CANCELLED_CODE, "ended by the server", turn)

    def timed_out(self, attempt_id: str, turn: Turn) -> None:
        """The attempt took too long: cancel it and count it as failed."""
        attempt = self._memory.attempts[attempt_id]
        invocation = self._memory.invocations[attempt.invocation]
        invoke = self._invoke(invocation)
        self._cancel_current(invocation, turn)
        self._failed(invocation, invoke.timeout_code or "timeout", attempt.detail, turn)

    def abandon(self, attempt_id: str, turn: Turn) -> None:
        """The cancel was never confirmed: stop waiting for it. A late accept is still cancelled."""
        attempt = self._memory.attempts[attempt_id]
        attempt.uses = ()
        turn.notes.append(f"{attempt.operation} did not confirm its cancel in {CANCEL_DEADLINE:g} s")
        self._start_waiting(turn)

    def retry(self, invocation_id: str, turn: Turn) -> None:
        """The back-off is over: try again."""
        for invocation in list(self._memory.invocations.values()):
            if invocation.id == invocation_id:
                self._issue(invocation, turn)

    def _failed(self, invocation: Invocation, code: str, detail: str, turn: Turn) -> None:
        self._report(code, detail)
        if not self._try_again(invocation, code, turn):
            self._signal_error(invocation, code, detail, turn)

    def _try_again(self, invocation: Invocation, code: str, turn: Turn) -> bool:
        rule = self._invoke(invocation).retry
        if rule is None or code in rule.unless:
            return False
        env = environment(self._world, self._memory, invocation.state, turn.now, Cause())
        try:
            attempts = int(rule.attempts.evaluate(env))
            backoff = float(rule.backoff.evaluate(env)) if rule.backoff else 0.0
        except Exception as problem:
            turn.note(f"{rule.attempts.place}: retry: {problem}")
            return False
        if invocation.tries >= attempts:
            return False
        turn.notes.append(f"try {invocation.tries} failed ({code}); next in {backoff:g} s")
        self._timers.arm("retry", invocation.id, turn.now, backoff)
        return True

    def _signal_error(self, invocation: Invocation, code: str, detail: str, turn: Turn) -> None:
        error = {"code": code, "detail": detail}
        turn.signals.append(Signal("error", invocation.state, Cause(event=error, error=error)))
