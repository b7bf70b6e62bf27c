"""The action by which a program runs a mission, over the code path of the other requests.

A goal starts a mission as the command service does, a cancel aborts it; a mission that somebody else started
has no goal. A refused goal is aborted at once, with the refusal in its result: ROS's rejection has no text.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from lupin_engine.errors import LupinError
from lupin_engine.machine import Step, View
from lupin_engine.plugin import DIVERT_CODE, RESTARTED, START_VERB, Fields, classify
from lupin_ros.adapter.actions import RESULT_KEPT_S
from lupin_ros.adapter.node import RosNode, ServedGoal
from lupin_ros.interfaces.definitions import interface_class
from lupin_ros.orchestrator.journal_gate import JournalGate
from lupin_ros.orchestrator.loop import Loop
from lupin_ros.orchestrator.requests import RequestServer
from lupin_ros.orchestrator.step_publisher import StepPublisher
from lupin_ros.service import messages
from lupin_ros.service.commands import MAX_WORD, CommandAnswer, CommandRequest
from lupin_ros.service.names import RUN_ACTION, RUN_TYPE

#: How long the end of the node waits until the result of a goal is sent, in seconds.
SENT_S = 1.0
#: How many goals are taken while the result of the first is kept: each is in every message about goals.
MOST_GOALS = 100


@dataclass
class _MissionGoal:
    """A goal whose mission is under way; `aborted` has the code and the words of the abort that ends it."""

    goal: ServedGoal
    mission_id: str
    aborted: tuple[str, str] | None = None
    is_cancelled: bool = False
    published: Fields | None = None


class MissionAction:
    """The server of the action; at most one goal has a mission under way."""

    def __init__(
        self, ros: RosNode, loop: Loop, gate: JournalGate, publisher: StepPublisher, requests: RequestServer
    ) -> None:
        self._ros = ros
        self._loop = loop
        self._gate = gate
        self._publisher = publisher
        self._requests = requests
        self._run: _MissionGoal | None = None
        try:
            self._kind = interface_class(RUN_TYPE)
        except LupinError as problem:  # a workspace that was built before this type existed
            ros.log.error("no program can run missions as an action", problem=str(problem))
            return
        #: When the last goals were taken, of the monotonic clock.
        self._taken: deque[float] = deque(maxlen=MOST_GOALS)
        self._host = ros.serve_action(
            self._kind, RUN_ACTION, admit=self._admit, started=self._start, cancelled=lambda _: None
        )
        self._host.refuses = self._refuses
        publisher.follower = self._stepped

    def close(self) -> None:
        """End the goal: the mission goes on with the next orchestrator, where nobody follows it."""
        if self._run is not None:
            detail = f"{self._ros.name} ends: its mission is held until somebody resumes it"
            self._end(self._run, self._run.goal.abort, RESTARTED, detail)
            self._ros.work_until(lambda: not self._host.is_serving, SENT_S)

    # -- requests ---------------------------------------------------------------------------------------

    def _admit(self, _: Any) -> bool:
        now = time.monotonic()
        if len(self._taken) == MOST_GOALS and now - self._taken[0] < RESULT_KEPT_S:
            self._ros.log.warning(f"goal rejected: {MOST_GOALS} came within {RESULT_KEPT_S} s")
            return False
        self._taken.append(now)
        return True

    def _start(self, goal: ServedGoal) -> None:
        asked, stamp = goal.request, goal.request.stamp
        command = CommandRequest(START_VERB, asked.mission, asked.request, by=asked.by)
        self._requests.start(command, stamp.sec + stamp.nanosec * 1e-9, partial(self._answered, goal))

    def _answered(self, goal: ServedGoal, answer: CommandAnswer) -> None:
        if not answer.accepted:
            goal.abort(self._kind.Result(code=answer.code, message=answer.message))
            return
        self._run = _MissionGoal(goal, answer.mission_id)
        self._follow(self._run, self._loop.machine.view)

    def _refuses(self, goal: ServedGoal) -> bool:
        """Abort the mission of a goal that is cancelled; return whether the engine refuses that."""
        run = self._run
        if run is None or run.goal is not goal:
            return True  # it has not begun
        run.is_cancelled = True
        run.is_cancelled = self._requests.abort(goal.request.by[:MAX_WORD])
        return not run.is_cancelled

    # -- the mission ------------------------------------------------------------------------------------

    def _stepped(self, step: Step, view: View) -> None:
        run = self._run
        if run is None or view.mission_id != run.mission_id:
            return
        if step.accepted and step.event.name == f"operator.{self._loop.chart.profile.abort}":
            code = next((each for each in step.codes if each.code != DIVERT_CODE), None)
            by = self._publisher.origin[1].get("by", "")
            text = f"{code.label if code else 'mission aborted'}{f' by {by}' if by else ''}"
            run.aborted = run.aborted or (code.code if code else "aborted", text)
        self._follow(run, view)

    def _follow(self, run: _MissionGoal, view: View) -> None:
        """Publish what has changed; end the goal of a mission that is over."""
        profile = self._loop.chart.profile
        counts = [{"outcome": each.name, "count": view.counts.get(each.name, 0)} for each in profile.outcomes]
        fields: Fields = {
            "mission_id": run.mission_id,
            "state": view.lifecycle,
            "phase": view.phase,
            "target": view.target,
            "paused": view.paused,
            "question": view.asking[0].question if view.asking else "",
            "total": view.total,
            "counts": counts,
        }
        if fields != run.published:
            run.published = fields
            run.goal.feedback(messages.write(self._kind.Feedback(), fields))
        if view.lifecycle in profile.stages.faulted:
            label = classify(view.code, self._loop.chart.codes).label
            self._end(run, run.goal.abort, view.code, f"{label}: {view.detail}" if view.detail else label)
        elif view.lifecycle in profile.stages.without_mission:
            self._over(run, view)

    def _over(self, run: _MissionGoal, view: View) -> None:
        """End the goal of a mission that came to its end, or was aborted: by its program, or by others."""
        if run.aborted is None:
            said = ", ".join(f"{count} {outcome}" for outcome, count in view.counts.items() if count)
            self._end(run, run.goal.succeed, "", f"{view.lifecycle}: {said or 'no target'}")
        else:
            self._end(run, run.goal.cancel if run.is_cancelled else run.goal.abort, *run.aborted)

    def _end(self, run: _MissionGoal, end: Callable[[Any], None], code: str, message: str) -> None:
        """End a goal, when what its result says is flushed."""
        self._run = None
        is_good = self._loop.chart.profile.is_good
        outcomes = [
            {
                "target": visit.target,
                "outcome": visit.status,
                "good": is_good(visit.status),
                "code": visit.code,
                "detail": visit.detail,
            }
            for visit in self._loop.machine.memory.outcomes
        ]
        fields = {"code": code, "message": message, "mission_id": run.mission_id, "outcomes": outcomes}
        result = messages.write(self._kind.Result(), fields)
        # Posted, because rclpy calls a goal cancelled only after the callback in which that was accepted.
        self._gate.when_flushed(lambda: self._ros.post(lambda: end(result)))
