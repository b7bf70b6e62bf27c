"""Serves `/lupin/arm/calibrate` by running the calibration's chart with the engine in the arm's process.

The service has no rules of its own: a request is an event of the chart, and a refusal is the chart's. An
accepted request is answered when the chart is stable: waiting for the pose, or back in IDLE.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from lupin_arm.calibration.offsets import Correction, refusals
from lupin_arm.node.arm import Arm
from lupin_arm.node.calibration.chart import CHART
from lupin_arm.node.calibration.servos import Servos
from lupin_arm.node.gates import Gates
from lupin_arm.node.library import library_path
from lupin_arm.node.mark import RestoreMarker
from lupin_arm.node.serving import STALE_AFTER_S, ArmRequestRefused, refuse
from lupin_engine.errors import Severity, nearest, shortened
from lupin_engine.machine import Event, Step
from lupin_engine.plugin import Driver
from lupin_engine.runtime import Engine, EngineOutlet, make_machine
from lupin_msgs.srv import CalibrateArm
from lupin_ros.adapter import RosNode, RosTimer

SERVICE = "/lupin/arm/calibrate"
#: Action of a request -> event of the chart.
EVENTS: Mapping[str, Event] = {
    "start": Event("mission.start", {"mission_type": "Calibration", "mission_id": "calibration"}),
    "commit": Event("operator.resume"),
    "cancel": Event("operator.abort"),
}
ACTIONS = (*EVENTS, "status")
#: The two states that callers know; everything else is IDLE to them.
IDLE, AWAITING_POSE = "IDLE", "AWAITING_POSE"
#: The state in which the chart waits for the operator.
POSING = "POSING"

#: Seconds that the end of the process waits for the arm to have its torque again.
LAST_WAIT_S = 3.0

POSE_NOW = "the arm has no torque: bring it into its zero pose by hand, then commit"


class _NodeTime:
    """The clock of the node's timers."""

    def __init__(self, ros: RosNode) -> None:
        self._ros = ros

    def now(self) -> float:
        """Return seconds."""
        return self._ros.elapsed()


class _Pending(NamedTuple):
    """An accepted request; `began` says whether a calibration was active before it."""

    action: str
    began: bool
    response: CalibrateArm.Response
    answer: Callable[[Any], None]


class Calibration:
    """The chart, its loop, and its service."""

    def __init__(self, ros: RosNode, arm: Arm, gates: Gates, parameters: Mapping[str, Any]) -> None:
        self._ros = ros
        self._gates = gates
        self._pending: list[_Pending] = []
        self._deadline: RosTimer | None = None
        self._machine = make_machine(CHART, {name: parameters[name] for name in CHART.parameters})
        drivers: dict[str, Driver] = {}
        self._engine = Engine(self._machine, _NodeTime(ros), drivers, ros.guarded(self._stepped))
        library = library_path(parameters["library_path"])
        mark = RestoreMarker(ros, library.with_name(f"{library.stem}.offsets"))
        outlet = EngineOutlet(self._engine, self._work)
        self._servos = Servos(ros, arm, outlet, parameters["gate_service"], mark)
        left = self._servos.left_behind()
        if left:
            ros.log.error(left)
        drivers["calibration"] = self._servos
        self._engine.start()
        gates.mission.listen(self._call_off)
        ros.on_stop(self._close)
        ros.serve_later(CalibrateArm, SERVICE, self._ask, stale_after=STALE_AFTER_S, refuse=self._refuse)

    # --- requests -----------------------------------------------------------------------------------------

    def _ask(
        self,
        request: CalibrateArm.Request,
        response: CalibrateArm.Response,
        answer: Callable[[CalibrateArm.Response], None],
    ) -> None:
        action = request.action.strip().lower()
        began = self._where() != IDLE
        try:
            accepted = self._asked(action)
        except ArmRequestRefused as reason:
            answer(self._refuse(response, str(reason)))
            return
        if accepted:
            self._pending.append(_Pending(action, began, response, answer))
            self._answer()
        else:
            response.success, response.state, response.message = True, self.state, self._doing()
            answer(response)

    def _asked(self, action: str) -> bool:
        """Send a request to the chart as an event; return whether the chart accepted it.

        Raises:
            ArmRequestRefused: the action is unknown, there are no real servos, or the chart refuses it now.
        """
        if action == "status":
            return False
        if action not in EVENTS:
            raise ArmRequestRefused(
                f"unknown action {shortened(action)!r}; {nearest(shortened(action), ACTIONS)}"
            )
        if action == "start":
            self._gates.require()
        self._servos.publish_stopped()
        step = self._engine.request(EVENTS[action])
        self._work()
        if step.refusal is not None:
            known = CHART.codes.get(step.refusal.code)
            raise ArmRequestRefused(known.label if known else step.refusal.text)
        return True

    def _refuse(self, response: CalibrateArm.Response, reason: str) -> CalibrateArm.Response:
        response.state = self.state
        return refuse(response, reason)

    def _call_off(self, reason: str) -> None:
        """Switch the torque on again: the robot starts to drive, or the process ends."""
        if self._where() != IDLE and self._engine.request(EVENTS["cancel"]).refusal is None:
            self._ros.log.warning("calibration cancelled", reason=reason)
            self._work()

    # --- the loop -----------------------------------------------------------------------------------------

    def _work(self) -> None:
        """Process queued events and due timers, then sleep until the next deadline."""
        self._engine.drain()
        if self._deadline is not None:
            self._deadline.cancel()
        due = self._engine.next_deadline
        self._deadline = None if due is None else self._ros.call_later(due - self._ros.elapsed(), self._work)

    def _stepped(self, step: Step) -> None:
        if step.taken:
            view = self._machine.view
            reason = f"{view.code}: {view.detail}" if view.detail else view.code
            self._ros.log.info("calibration", on=step.event.name, now=self._where(), reason=reason)
        self._ros.post(self._answer)  # the answers of this step's operations may be in the queue

    # --- answers ------------------------------------------------------------------------------------------

    @property
    def state(self) -> str:
        """The state in the words of callers."""
        return AWAITING_POSE if self._machine.view.lifecycle == AWAITING_POSE else IDLE

    def _where(self) -> str:
        return self._machine.view.configuration[-1].rpartition(".")[2]

    def _doing(self) -> str:
        where = self._where()
        if where == IDLE:
            return self._servos.left_behind() or "ready"
        return POSE_NOW if where == POSING else f"under way: {where.lower().replace('_', ' ')}"

    def _answer(self) -> None:
        """Answer the waiting requests once the chart is stable."""
        where = self._where()
        if where not in (IDLE, POSING):
            return
        pending, self._pending = self._pending, []
        for action, began, response, answer in pending:
            response.state = self.state
            if action == "cancel" and not began:
                response.success, response.message = True, CHART.codes["nothing_to_cancel"].label
            else:
                response.success, response.message = self._outcome(action, where)
            if action == "commit":
                _fill(response, self._found())
            answer(response)

    def _outcome(self, action: str, where: str) -> tuple[bool, str]:
        """Return success and message of a request."""
        if where == POSING:
            return True, POSE_NOW
        view = self._machine.view
        code = CHART.codes.get(view.code)
        # A code of severity info, as of a calibration that was cancelled, is no failure.
        if view.code and (code is None or code.severity is not Severity.INFO):
            label = code.label if code is not None else view.code
            return False, f"{label}: {view.detail}" if view.detail else label
        found = self._found()
        if action == "commit" and found:
            wrong = refusals(found)
            return not wrong, wrong or "calibrated; the arm keeps its pose, with torque"
        return action == "cancel", CHART.codes["cancelled"].label

    def _found(self) -> list[Correction]:
        """Return the corrections of the last calibration."""
        return [Correction(**one) for one in self._machine.memory.context["found"]]

    def _close(self) -> None:
        """Switch the torque on at the end of the process."""
        self._call_off("the program ends")
        self._ros.work_until(lambda: self._where() == IDLE, LAST_WAIT_S)
        self._servos.left_behind()  # what somebody has put right since is not told to the next one
        self._servos.close()


def _fill(response: CalibrateArm.Response, found: list[Correction]) -> None:
    """Write the corrections into a response: the offset written to each servo, and its difference."""
    response.joint_names = [one.joint for one in found]
    response.offsets_applied = [0 if one.in_place or one.refused else one.difference for one in found]
    response.diffs_observed = [one.difference for one in found]


def serve_calibration(ros: RosNode, arm: Arm, gates: Gates, parameters: Mapping[str, Any]) -> Calibration:
    """Offer the service."""
    return Calibration(ros, arm, gates, parameters)
