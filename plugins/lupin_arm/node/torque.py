"""Switches the servos on and off: bus power and command gate, always both, in order, one request at a time.

The two switches are the vendor's and independent. With power off and gate open, the hardware keeps its last
target and the arm jumps there when power returns. So the measured pose is commanded before power comes on.
A step that fails is reverted where possible, and the reason is reported.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from std_srvs.srv import SetBool

from lupin_arm.node.waiting import when_ready
from lupin_ros.adapter import CallFailure, RosNode

#: Seconds in which a switch must be found, and in which it must answer.
LOOK_UP_S = 0.5
ANSWER_S = 2.0

#: Gets None when it is done, or the reason why it is not.
Done = Callable[[str | None], None]


class _ServiceResponse(NamedTuple):
    """The result of a switch's call: `problem` is None when it worked."""

    there: bool
    problem: str | None


class _Switch:
    """One of the vendor's switches."""

    def __init__(self, ros: RosNode, name: str) -> None:
        self._ros = ros
        self._service = ros.service(SetBool, name)

    def call(self, on: bool, done: Callable[[_ServiceResponse], None]) -> None:
        """Switch; `done` is called once: also where no server is found, or it refuses or does not answer."""

        def found(there: bool) -> None:
            if there:
                self._service.call(
                    SetBool.Request(data=on), ANSWER_S, lambda answer: done(self._read(answer))
                )
            else:
                done(_ServiceResponse(False, f"{self._service.name}: no server within {LOOK_UP_S:g} s"))

        when_ready(self._ros, self._service.ready, LOOK_UP_S, found)

    def _read(self, answer: Any) -> _ServiceResponse:
        if isinstance(answer, CallFailure):
            return _ServiceResponse(True, answer.detail)
        if not answer.success:
            return _ServiceResponse(
                True, f"{self._service.name} refused: {answer.message or 'no reason given'}"
            )
        return _ServiceResponse(True, None)


class Torque:
    """The servos' power. `state` is the last confirmed one; None before."""

    def __init__(
        self,
        ros: RosNode,
        power: str,
        gate: str,
        pin: Callable[[], bool],
        refusal: Callable[[], str | None],
    ) -> None:
        """Switch by the services `power` and `gate`.

        `pin` commands the measured pose, if there is one; `refusal` returns why power must not come on now,
        None if it may.
        """
        self._ros = ros
        self._power = _Switch(ros, power)
        self._gate = _Switch(ros, gate)
        self._pin = pin
        self._refusal = refusal
        self._waiting: deque[tuple[bool, Done]] = deque()
        self.state: bool | None = None
        self.switching = False

    def set(self, on: bool, done: Done) -> None:
        """Switch the servos on or off, after earlier requests; `done` gets None, or why it failed."""
        self._waiting.append((on, done))
        self._next()

    def _next(self) -> None:
        if self.switching or not self._waiting:
            return
        self.switching = True
        on, done = self._waiting.popleft()
        (self._switch_on if on else self._switch_off)(partial(self._end, done))

    def _end(self, done: Done, problem: str | None) -> None:
        self.switching = False
        if problem is not None:
            self._ros.log.warning(f"servos not switched: {problem}")
        try:
            done(problem)
        finally:
            self._next()

    def _switch_on(self, end: Done) -> None:
        def pinned(known: bool) -> None:
            problem = self._refusal()  # what was asked for may have waited
            if problem is None and not known:
                problem = "the arm might jump: it is not told where it is"
            if problem is not None:
                end(problem)
            else:
                self._power.call(True, powered)

        def powered(answer: _ServiceResponse) -> None:
            if answer.problem is not None:
                end(answer.problem)
                return
            self.state = True
            self._gate.call(True, gated)

        def gated(answer: _ServiceResponse) -> None:
            if answer.problem is None or not answer.there:  # a simulation has no gate
                end(None)
            else:
                self._power.call(False, partial(self._powered_off_again, end, answer.problem))

        when_ready(self._ros, self._pin, LOOK_UP_S, pinned)

    def _powered_off_again(self, end: Done, problem: str, answer: _ServiceResponse) -> None:
        if answer.problem is None:
            self.state = False
            end(f"{problem}; the servos are off again")
        else:
            end(f"{problem}; and the servos could not be switched off again: {answer.problem}")

    def _switch_off(self, end: Done) -> None:
        def gated(gate: _ServiceResponse) -> None:
            if gate.there and gate.problem is not None:
                self._ros.log.warning(f"the gate of commands stays open: {gate.problem}")
            closed = gate.problem is None
            self._power.call(False, partial(powered, closed))

        def powered(closed: bool, answer: _ServiceResponse) -> None:
            if answer.problem is None:
                self.state = False
                end(None)
            elif closed:
                self._pin()
                self._gate.call(True, partial(self._gate_opened_again, end, answer.problem))
            else:
                end(answer.problem)

        self._gate.call(False, gated)

    def _gate_opened_again(self, end: Done, problem: str, answer: _ServiceResponse) -> None:
        if answer.problem is None:
            end(f"{problem}; commands are taken again")
        else:
            end(f"{problem}; and commands are not taken any more: {answer.problem}")
