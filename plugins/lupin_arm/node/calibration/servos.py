"""The driver of the calibration chart's operations, over the vendor's servo services.

The chart runs inside the arm's node (`procedure.Calibration`), not in the orchestrator.
Servos are handled one after the other. The first failure ends the operation, and the chart restores all
servos; restoring offsets, and reading them to measure, goes on with the next servo.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from mirte_msgs.msg import ServoPosition
from mirte_msgs.srv import GetServoOffset, SetServoAngle, SetServoOffset
from std_srvs.srv import SetBool

from lupin_arm.calibration.offsets import HOMES, STEP, STEPS, Correction, corrections, to_write
from lupin_arm.node.arm import Arm
from lupin_arm.node.gates import SERVOS
from lupin_arm.node.mark import RestoreMarker
from lupin_arm.node.serving import ArmRequestRefused
from lupin_arm.node.waiting import when_ready
from lupin_engine.plugin import Outlet
from lupin_ros.adapter import CallFailure, Qos, RosNode, ServiceCaller

#: The name under which the arm is calibrated.
OWNER = "calibration"
#: Seconds in which a service must be found, and in which it must answer.
LOOK_UP_S, ANSWER_S = 2.0, 3.0

CUT_OFF = (
    "an earlier calibration has left the servos without their offsets, and maybe without torque: support the "
    "arm; start, then cancel writes the offsets back"
)
LIMP = (
    "an earlier calibration has left the arm maybe without torque: support it, then switch torque on "
    "(/lupin/arm/set_torque)"
)


class ServoCall(NamedTuple):
    """A call of a servo's service."""

    service: ServiceCaller
    request: Any


#: Gets the answers in order; a `CallFailure` ends them.
Answers = Callable[[list[Any]], None]


class _Connection:
    """The servos' services and positions; connected only during a calibration.

    Positions arrive 100 times a second, and every subscription costs the node time.
    """

    def __init__(self, ros: RosNode, gate: str) -> None:
        self._ros = ros
        self.counts: dict[str, int] = {}
        self.gate = ros.service(SetBool, gate)
        self.read = {j: ros.service(GetServoOffset, f"{SERVOS}/{j}/_offset") for j in HOMES}
        self.write = {j: ros.service(SetServoOffset, f"{SERVOS}/{j}/_set_offset") for j in HOMES}
        self.turn = {j: ros.service(SetServoAngle, f"{SERVOS}/{j}/set_angle") for j in HOMES}
        self._positions = [
            ros.subscribe(ServoPosition, f"{SERVOS}/{j}/position", Qos.SENSOR, partial(self._on_position, j))
            for j in HOMES
        ]

    def _on_position(self, joint: str, message: ServoPosition) -> None:
        self.counts[joint] = int(message.raw)

    def close(self) -> None:
        """Release all of them."""
        for subscription in self._positions:
            self._ros.node.destroy_subscription(subscription)
        for service in (self.gate, *self.read.values(), *self.write.values(), *self.turn.values()):
            service.close()


class Servos:
    """The driver of the servos; `plugin.contract.Driver` has the contract of each call."""

    def __init__(self, ros: RosNode, arm: Arm, outlet: Outlet, gate: str, mark: RestoreMarker) -> None:
        """`gate` is the vendor's service that lets the controller command the servos.

        `mark` exists from the first change of the servos to the last one and holds their original offsets, so
        that they can be restored after a crash.
        """
        self._ros = ros
        self._arm = arm
        self._outlet = outlet
        self._mark = mark
        #: Offsets that must be restored: the servos do not have them now.
        self._owed = _kept(mark.text()) if mark.left_behind else {}
        self._running: set[str] = set()
        self._gate_name = gate
        self._connection: _Connection | None = None
        self._operations: Mapping[str, Callable[[str, Mapping[str, Any]], None]] = {
            "take_arm": self._take_arm,
            "read_offsets": self._read_offsets,
            "clear_offsets": self._clear_offsets,
            "write_offsets": self._write_offsets,
            "move_to_zero": self._move_to_zero,
            "release": lambda attempt, _: self._switch(attempt, False, "servo_failed"),
            "measure": self._measure,
            "correct": self._correct,
            "enable": lambda attempt, _: self._switch(attempt, True, "still_limp"),
        }

    @property
    def _servos(self) -> _Connection:
        if self._connection is None:
            self._connection = _Connection(self._ros, self._gate_name)
        return self._connection

    def _disconnect(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def left_behind(self) -> str:
        """Return a text about servos that an earlier calibration left unrestored, else ""."""
        if not self._owed and self._arm.torque and self._mark.left_behind:
            self._mark.remove()  # somebody has switched it on since
        if not self._mark.left_behind:
            return ""
        return CUT_OFF if self._owed else LIMP

    # --- the driver ---------------------------------------------------------------------------------------

    def missing(self) -> list[str]:
        """Return nothing: a missing service fails the operation that calls it."""
        return []

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Begin one of the chart's operations; KeyError for any other."""
        self._running.add(attempt)
        self._outlet.accepted(attempt)
        self._operations[operation](attempt, arguments)

    def cancel(self, attempt: str) -> None:
        """Send no further requests to the servos; the last one is still carried out."""
        if attempt in self._running:
            self._running.discard(attempt)
            self._outlet.cancelled(attempt)

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Raise ValueError: there are no actions."""
        raise ValueError(f"calibration has no action {action!r}")

    def close(self) -> None:
        """Report nothing more."""
        self._running.clear()

    def _done(self, attempt: str, **result: Any) -> None:
        if attempt in self._running:
            self._running.discard(attempt)
            self._outlet.done(attempt, result)

    def _failed(self, attempt: str, code: str, detail: str) -> None:
        if attempt in self._running:
            self._running.discard(attempt)
            self._outlet.failed(attempt, code, detail)

    # --- the arm ------------------------------------------------------------------------------------------

    def _take_arm(self, attempt: str, _: Mapping[str, Any]) -> None:
        try:
            self._arm.must_be_known()  # else the torque could not come back
            self._arm.claim(OWNER, "it is being calibrated", self._interrupted)
        except ArmRequestRefused as reason:
            self._failed(attempt, "arm_not_free", str(reason))
            return
        if not self._owed:
            self._mark.set("{}")
        call = ServoCall(self._servos.gate, SetBool.Request(data=False))
        self._ask(attempt, [call], lambda _: self._done(attempt))

    def _interrupted(self, _: str) -> None:
        """Report a stop to the chart, which leaves its operation; the driver ends nothing itself."""
        self.publish_stopped()

    def publish_stopped(self) -> None:
        """Report to the chart whether the arm is stopped."""
        self._outlet.value("calibration.stopped", self._arm.stopped, self._ros.elapsed())

    def _switch(self, attempt: str, on: bool, code: str) -> None:
        def switched(problem: str | None) -> None:
            if on:
                self._let_go(problem)
            if problem is None:
                self._done(attempt)
            else:
                self._failed(attempt, code, problem)

        try:
            self._arm.set_torque(on, OWNER, switched)
        except ArmRequestRefused as reason:
            switched(str(reason))

    def _let_go(self, problem: str | None) -> None:
        """Release the claim of the arm; `problem` is why it is still limp."""
        self._arm.release(OWNER)
        self._disconnect()
        if problem is not None:
            self._mark.leave()
        elif not self._owed:
            self._mark.remove()

    # --- the servos ---------------------------------------------------------------------------------------

    def _read_offsets(self, attempt: str, _: Mapping[str, Any]) -> None:
        def read(answers: list[Any]) -> None:
            replies = zip(HOMES, answers, strict=True)
            # Where offsets are owed, the servos say what an earlier calibration has left.
            before = {joint: answer.centidegrees for joint, answer in replies} | self._owed
            self._done(attempt, offsets=[{"joint": j, "centidegrees": o} for j, o in before.items()])

        self._ask(attempt, self._reads(), read)

    def _reads(self) -> list[ServoCall]:
        return [ServoCall(service, GetServoOffset.Request()) for service in self._servos.read.values()]

    def _clear_offsets(self, attempt: str, arguments: Mapping[str, Any]) -> None:
        self._owe(_offsets(arguments["before"]))
        self._ask(attempt, self._writes(dict.fromkeys(HOMES, 0)), lambda _: self._done(attempt))

    def _write_offsets(self, attempt: str, arguments: Mapping[str, Any]) -> None:
        """Write all offsets back; a silent servo fails the attempt after the others are done."""
        calls = self._writes(_offsets(arguments["offsets"]))

        def written(answers: list[Any]) -> None:
            problems = (_problem(call.service, answer) for call, answer in zip(calls, answers, strict=True))
            wrong = [problem for problem in problems if problem is not None]
            if wrong:
                self._mark.leave()
                self._failed(attempt, "servo_failed", "; ".join(wrong))
            else:
                self._owe({})
                self._done(attempt)

        self._ask(attempt, calls, written, code=None)

    def _owe(self, offsets: Mapping[str, int]) -> None:
        """Save the offsets that the servos must get back ({}: none), in memory and on disk."""
        self._owed = dict(offsets)
        self._mark.set(json.dumps(self._owed))

    def _writes(self, offsets: Mapping[str, int]) -> list[ServoCall]:
        return [
            ServoCall(self._servos.write[j], SetServoOffset.Request(centidegrees=o))
            for j, o in offsets.items()
        ]

    def _move_to_zero(self, attempt: str, _: Mapping[str, Any]) -> None:
        self._ask(attempt, self._turns(HOMES), lambda _: self._done(attempt))

    def _turns(self, joints: Sequence[str] | Mapping[str, int]) -> list[ServoCall]:
        return [
            ServoCall(self._servos.turn[joint], SetServoAngle.Request(angle=0.0, degrees=False))
            for joint in joints
        ]

    def _measure(self, attempt: str, arguments: Mapping[str, Any]) -> None:
        """Measure by positions that arrive from now on: older ones are from before the pose.

        It fails with `no_position` where a servo reports none within the window.
        """
        self._servos.counts.clear()
        self._ros.call_later(arguments["window"], lambda: self._measured(attempt, arguments["largest"]))

    def _measured(self, attempt: str, largest: float) -> None:
        if attempt not in self._running:
            return  # cancelled meanwhile; to look at the servos would connect to them again
        counts = dict(self._servos.counts)
        silent = [joint for joint in HOMES if joint not in counts]
        if silent:
            self._failed(attempt, "no_position", f"nothing was heard of {', '.join(silent)}")
            return

        def read(answers: list[Any]) -> None:
            replies = zip(HOMES, answers, strict=True)
            offsets = {j: answer.centidegrees for j, answer in replies if not isinstance(answer, CallFailure)}
            found = corrections(counts, offsets, largest)
            self._done(attempt, corrections=[_record(one) for one in found])

        self._ask(attempt, self._reads(), read, code=None)

    def _correct(self, attempt: str, arguments: Mapping[str, Any]) -> None:
        found = [Correction(**one) for one in arguments["corrections"]]
        writes = self._writes(to_write(found, _offsets(arguments["before"])))
        turns = self._turns([one.joint for one in found if not one.refused])

        def corrected(_: list[Any]) -> None:
            self._owe({})
            self._done(attempt)

        self._ask(attempt, [*writes, *turns], corrected)

    # --- calls --------------------------------------------------------------------------------------------

    def _ask(
        self, attempt: str, calls: Sequence[ServoCall], then: Answers, code: str | None = "servo_failed"
    ) -> None:
        """Make calls one after the other, then `then`; the first failure ends the attempt with `code`.

        Without a code all calls are made, and failures are among the answers.
        """
        answers: list[Any] = []

        def next_one() -> None:
            if given_up():
                return
            if len(answers) == len(calls):
                then(answers)
                return
            service = calls[len(answers)].service
            self._outlet.progress(attempt, f"{service.name} was asked")
            # Of an attempt that nobody wants any more the services may be gone.
            when_ready(self._ros, lambda: given_up() or service.ready(), LOOK_UP_S, lambda _: call())

        def given_up() -> bool:
            return attempt not in self._running

        def call() -> None:
            if not given_up():
                service, request = calls[len(answers)]
                service.call(request, ANSWER_S, answered)

        def answered(answer: Any) -> None:
            problem = _problem(calls[len(answers)].service, answer)
            if problem is not None and code is not None:
                self._failed(attempt, code, problem)
                return
            answers.append(answer)
            next_one()

        next_one()


def _problem(service: ServiceCaller, answer: Any) -> str | None:
    """Return the error in an answer; None without one."""
    if isinstance(answer, CallFailure):
        return answer.detail
    if not getattr(answer, "status", True) or not getattr(answer, "success", True):
        return f"{service.name} refused: {getattr(answer, 'message', '') or 'no reason given'}"
    return None


def _offsets(records: Sequence[Mapping[str, Any]]) -> dict[str, int]:
    return {record["joint"]: record["centidegrees"] for record in records}


def _kept(text: str) -> dict[str, int]:
    """Return the offsets in a mark's text; invalid entries are dropped."""
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    entries = data.items() if isinstance(data, dict) else ()
    return {
        joint: offset
        for joint, offset in entries
        if joint in HOMES and type(offset) is int and abs(offset) <= STEP * STEPS
    }


def _record(one: Correction) -> dict[str, Any]:
    return {name: getattr(one, name) for name in ("joint", "difference", "in_place", "refused")}
