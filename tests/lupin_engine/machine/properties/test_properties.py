"""Whatever happens to the shipped mission in whatever order: what must always be true of the machine."""

from __future__ import annotations

import copy

from hypothesis import given
from hypothesis import strategies as st

from lupin_engine.chart.model import Chart
from lupin_engine.machine import event as events
from lupin_engine.machine.event import Event
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.memory import Memory, Phase
from lupin_engine.machine.snapshot import restore
from lupin_engine.machine.step import Step
from lupin_engine.machine.timers import NEVER_FROZEN
from lupin_engine.plugin.contract import OnHold
from lupin_engine.plugin.profile import Publish
from lupin_engine.runtime.setup import make_machine
from lupin_greenhouse.profile import PROFILE
from tests import shipped
from tests.lupin_engine.machine.charts import legal

READING = {"reading": {"tag_id": "1", "stamp": 0.0, "sim_time_of_day_seconds": 0.0, "readings": []}}
START = Event("mission.start", {"mission_type": "InspectionMission", "tag_sequence": ["1", "2"]})

REQUESTS = st.sampled_from([START, *(Event(f"operator.{verb}") for verb in PROFILE.requests)])
VALUES = st.sampled_from(
    [events.observed("robot.estop", engaged, 0.0) for engaged in (True, False)]
    + [events.observed("robot.battery", charge, 0.0) for charge in (0.1, 0.22, 0.9)]
)
#: What servers say of attempts: (which of the known ones, what); most of it of the newest one.
REPORTS = st.tuples(
    st.integers(-4, -1),
    st.sampled_from(["accepted", "progress", "done", "failed", "cancelled", "cancel_refused"]),
)
WAITS = st.sampled_from([0.1, 1.0, 3.0, 20.0, 100.0])
HAPPENINGS = st.lists(REQUESTS | VALUES | REPORTS | WAITS, max_size=60)


class World:
    """A machine and its clock, with the invariants looked at after every step."""

    def __init__(self) -> None:
        self.chart: Chart = shipped.mission("inspection")
        self.machine: Machine = make_machine(self.chart, {"flower_scan_dwell_s": 2.0})
        self.now = 0.0
        self.published = 0
        self.attempts: list[str] = []
        self.steps: list[Step] = []
        self.look(self.machine.start(0.0))

    def twin(self) -> World:
        """Return a second one whose machine knows nothing but this one's snapshot."""
        other = copy.copy(self)
        other.machine = Machine(self.machine.world, restore(self.chart, self.machine.snapshot()))
        other.attempts, other.steps = list(self.attempts), list(self.steps)
        return other

    @property
    def memory(self) -> Memory:
        """What the machine remembers."""
        return self.machine.memory

    def happen(self, happening: Event | tuple[int, str] | float) -> None:
        """Let something happen."""
        if isinstance(happening, float):
            self.wait(happening)
        elif isinstance(happening, Event):
            self.send(happening)
        else:
            self.report(*happening)

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        end = self.now + seconds
        while (due := self.machine.next_deadline) is not None and due <= end:
            self.now = max(self.now, due)
            step = self.machine.advance(self.now)
            assert step is not None
            self.look(step)
        self.now = end

    def report(self, which: int, what: str) -> None:
        """Let a server say something of one of the last attempts, also of one that is over."""
        if len(self.attempts) < -which:
            return
        attempt = self.attempts[which]
        made = {
            "accepted": events.accepted(attempt),
            "progress": events.progress(attempt, "on its way"),
            "done": events.done(attempt, READING),
            "failed": events.failed(attempt, "nav_status_6", "blocked"),
            "cancelled": events.cancelled(attempt),
            "cancel_refused": events.cancel_refused(attempt, "it goes on"),
        }
        self.send(made[what])

    def send(self, event: Event) -> None:
        """Hand over an event; a refused request must not have changed anything."""
        before = copy.deepcopy(self.memory) if event.is_request else None
        step = self.machine.handle(event, self.now)
        if before is not None and step.accepted is False:
            before.sequence += 1
            assert before == self.memory
            assert step.refusal is not None
            assert not step.changed
        self.look(step)

    def look(self, step: Step) -> None:
        """Check what must always be true."""
        self.steps.append(step)
        begun = [command for command in step.commands if isinstance(command, events.Start)]
        self.attempts += [command.attempt for command in begun]
        refused = [a for a in self.memory.attempts.values() if "base" in a.uses and a.phase is Phase.REFUSED]
        assert not (refused and any(command.operation == "nav.go_to" for command in begun))
        assert self.memory.code != "execution_error", self.memory.detail
        self._configuration()
        self._deadlines()
        self._operations()
        self._visits(step)

    def _configuration(self) -> None:
        assert legal(self.chart, self.memory.configuration)

    def _deadlines(self) -> None:
        owners = {"after": set(self.memory.configuration)}
        owners["timeout"] = owners["cancel"] = set(self.memory.attempts)
        owners["retry"] = {invocation.id for invocation in self.memory.invocations.values()}
        for _, _, kind, (owner, _) in (*self.memory.timers, *self.memory.frozen):
            assert owner in owners[kind], (kind, owner)
        if self.memory.held:
            assert all(kind in NEVER_FROZEN for _, _, kind, _ in self.memory.timers)
        else:
            assert not self.memory.frozen

    def _operations(self) -> None:
        invoking = {name for name in self.memory.configuration if self.chart.states[name].invoke}
        assert set(self.memory.invocations) == invoking
        current = {invocation.attempt for invocation in self.memory.invocations.values()} - {None}
        idle = (Phase.WAITING, Phase.LOST, Phase.REFUSED)
        busy = [a for a in self.memory.attempts.values() if "base" in a.uses and a.phase not in idle]
        assert len(busy) <= 1, "two goals at the base"
        for attempt in self.memory.attempts.values():
            wanted = attempt.phase not in (Phase.CANCELLING, Phase.LOST, Phase.REFUSED)
            assert (attempt.id in current) == wanted
            moves = shipped.catalog().operations[attempt.operation].on_hold is OnHold.CANCEL
            assert not (wanted and moves and self.memory.held), "it drives while held"

    def _visits(self, step: Step) -> None:
        if step.event.name == "mission.start" and step.accepted:
            self.published = 0
        self.published += sum(isinstance(command, Publish) for command in step.commands)
        walk = self.memory.traversal
        assert self.published == (sum(visit.closed for visit in walk.visits) if walk else 0)


@given(HAPPENINGS)
def test_nothing_breaks_the_machine(happenings: list[Event | tuple[int, str] | float]) -> None:
    """One active child, no orphaned timer, one goal at the base, no drive while held, one outcome a visit."""
    world = World()
    world.report(-1, "done")
    world.send(START)
    for happening in happenings:
        world.happen(happening)
