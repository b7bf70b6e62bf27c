"""One run: a mission, its faults, and a person who lets it go on when it is held."""

from __future__ import annotations

import heapq
import itertools
import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from std_srvs.srv import Trigger

from lupin_msgs.msg import Observation
from lupin_ros.adapter.node import CallFailure
from lupin_ros.adapter.process import StoodStill
from tests.faults.arena import Arena
from tests.faults.plan import ORCHESTRATOR, Fault, Plan
from tests.faults.verdict import BOUND_S, OK, STOP_S, Lost, Outcome, Seen, name_of

#: A run takes at most so many seconds after its last fault.
LIMIT_S = 90.0
#: What is started again, is so after as many seconds as `lupin up` takes.
RESPAWN_S = 1.0
#: Seconds for which outcomes and rows may be under way when the mission has ended.
STRAGGLER_S = 15.0
#: A state that is older, in seconds, says nothing of now.
FRESH_S = 1.0
#: Seconds that a request may take, and between two of them.
ANSWER_S, AGAIN_S = 5.0, 1.0


class Run:
    """Carries a plan out; `go` returns what was seen."""

    def __init__(self, arena: Arena, plan: Plan) -> None:
        self._arena, self._plan = arena, plan
        self._operator = arena.operator
        self._seen = Seen()
        self._order = itertools.count()
        self._due: list[tuple[float, int, Callable[[], None]]] = []
        self._faults = len(plan.faults)
        self._gone: set[str] = set()
        self._stopped = {fault.node for fault in plan.faults if fault.kind == "stop"}
        self._heard, self._heard_at = 0, -math.inf
        self._held_since: float | None = None
        self._asked_at = -math.inf
        self._fault = ""
        self.mission_id = ""

    def go(self) -> Seen:
        """Carry it out.

        Raises:
            Broken: it could not be begun.
        """
        plan = self._plan
        track = self._arena.track.stat().st_size if self._arena.track.exists() else 0
        self.mission_id = self._arena.begin(plan)
        begin = time.monotonic()
        for fault in plan.faults:
            self._at(begin + fault.at, lambda fault=fault: self._put(fault))  # type: ignore[misc]
        self._work(max(fault.end for fault in plan.faults) + begin + LIMIT_S)
        self._settle()
        self._read_track(track)
        return self._seen

    # -- faults -----------------------------------------------------------------------------------------

    def _at(self, when: float, then: Callable[[], None]) -> None:
        heapq.heappush(self._due, (when, next(self._order), then))

    def _put(self, fault: Fault) -> None:
        now = time.monotonic()
        self._gone |= (ended := set(self._arena.put(fault)))
        if ORCHESTRATOR in ended or fault.kind == "cut" or (fault.kind, fault.node) == ("stop", ORCHESTRATOR):
            self._seen.lost.append(Lost(str(fault), now))
        if fault.kind == "foreign stop":
            alone = len(self._plan.faults) == 1
            self._seen.lost.append(Lost(str(fault), now, bound=STOP_S if alone else BOUND_S, by_stop=True))
        if fault.kind == "stranger's goal":
            self._seen.strange.append(now)
        self._at(now + fault.lasts, lambda: self._lift(fault))

    def _lift(self, fault: Fault) -> None:
        self._arena.lift(fault)
        if fault.kind == "stop":  # who stood still for long ends a moment later
            self._at(time.monotonic() + RESPAWN_S, self._pass)
        else:
            self._pass()
        for number, lost in enumerate(self._seen.lost):
            if lost.why == str(fault) and fault.kind in ("cut", "stop"):
                self._seen.lost[number] = replace(lost, end=min(lost.end, time.monotonic()))

    def _pass(self) -> None:
        self._faults -= 1

    def _look_after(self) -> None:
        """Start again what has ended."""
        for node in list(self._arena.world.processes):
            code = self._arena.process(node).poll()
            if code is None or node in ("flood", "witness") or node in self._respawning:
                continue
            if node not in self._gone and (node not in self._stopped or code != StoodStill.exit_code):
                self._seen.ended.append(f"{node} ended with {code}")
            self._gone.add(node)
            self._respawning.add(node)
            self._at(time.monotonic() + RESPAWN_S, lambda node=node: self._respawn(node))  # type: ignore[misc]

    def _respawn(self, node: str) -> None:
        self._respawning.discard(node)
        self._gone.discard(node)
        self._arena.start(node)

    # -- the person -------------------------------------------------------------------------------------

    def _work(self, limit: float) -> None:
        self._respawning: set[str] = set()
        over_since: float | None = None
        while time.monotonic() < limit:
            self._operator.ros.spin_once(0.02)
            now = time.monotonic()
            while self._due and self._due[0][0] <= now:
                heapq.heappop(self._due)[2]()
            self._look_after()
            self._hear(now)
            if now - self._heard_at > FRESH_S or self._faults or self._gone:
                continue
            over_since = (over_since or now) if self._is_over() else None
            if over_since and (self._all_told() or now - over_since > STRAGGLER_S):
                return
            if over_since is None:
                self._operate(now)

    def _hear(self, now: float) -> None:
        if len(self._operator.states) != self._heard:
            self._heard, self._heard_at = len(self._operator.states), now

    def _is_over(self) -> bool:
        state = self._operator.state
        return state.lifecycle_state == "READY" or (
            state.lifecycle_state == "DONE" and state.mission_id == self.mission_id
        )

    def _operate(self, now: float) -> None:
        """Do what a person would: look at what is held for a while, then let it go on."""
        state = self._operator.state
        if state.lifecycle_state == "FAULT":
            self._fault = state.last_error
            self._ask("reset", now)
        elif state.paused:
            self._held_since = self._held_since or now
            if now - self._held_since >= self._plan.waits:
                self._ask("resume", now)
        else:
            self._held_since = None

    def _ask(self, what: str, now: float) -> None:
        if now - self._asked_at < AGAIN_S:
            return
        self._asked_at = now
        caller = self._operator.ros.service(Trigger, f"/mission/{what}")

        def answered(answer: Any) -> None:
            if not isinstance(answer, CallFailure) and answer.success:
                self._seen.resumes += 1
            caller.close()

        if what == "resume":
            self._close_lost(now)
        caller.call(Trigger.Request(), ANSWER_S, answered)

    def _close_lost(self, now: float) -> None:
        """From when somebody says resume the robot may move, whenever the answer comes."""
        self._seen.lost = [replace(lost, end=min(lost.end, now)) for lost in self._seen.lost]

    # -- what came of it --------------------------------------------------------------------------------

    def _outcomes(self) -> set[Outcome]:
        return {
            Outcome(
                name_of(o.tag_reading.tag_id, o.source),
                o.status,
                (o.header.stamp.sec, o.header.stamp.nanosec),
            )
            for o in self._operator.observations
            if o.mission_id == self.mission_id and o.kind == Observation.KIND_TAG_READING
        }

    def _all_told(self) -> bool:
        outcomes = self._outcomes()
        told = {outcome.tag for outcome in outcomes}
        if not told >= set(self._plan.tags) or len(told) < self._operator.state.targets_total:
            return False
        read = {outcome.tag for outcome in outcomes if outcome.status == OK}
        return read <= set(self._arena.rows(self.mission_id))

    def _settle(self) -> None:
        seen, states = self._seen, self._operator.states
        seen.outcomes = self._outcomes()
        seen.rows = self._arena.rows(self.mission_id)
        seen.lost = [replace(lost, end=min(lost.end, time.monotonic())) for lost in seen.lost]
        state = states[-1] if states else None
        if state is not None and state.lifecycle_state == "DONE":
            seen.total = state.targets_total
        if self._fault:
            seen.end = f"FAULT: {self._fault}"
        elif state is not None and self._is_over():
            seen.end = "DONE"
        elif state is not None and state.paused:
            seen.end = f"held: {state.last_error}"
        else:
            seen.end = (
                f"{state.lifecycle_state}/{state.mission_phase} {state.last_error}" if state else "silence"
            )

    def _read_track(self, begin: int) -> None:
        with self._arena.track.open() as file:
            file.seek(begin)
            for line in file:
                numbers = [float(word) for word in line.split()]
                if len(numbers) == 3:
                    self._seen.track.append((numbers[0], numbers[1], numbers[2]))
                elif numbers:
                    self._seen.pulses.append(numbers[0])
