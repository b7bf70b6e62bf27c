"""The loop of the orchestrator: what runs, on the node's thread, and the timer of the next deadline."""

from __future__ import annotations

from typing import Protocol

from lupin_engine.chart import Chart
from lupin_engine.machine import Event, Machine
from lupin_engine.missions import LoadedMissions
from lupin_engine.runtime import Engine
from lupin_ros.adapter.node import RosNode, RosTimer
from lupin_ros.orchestrator.outlet import NodeClock


class JournalUpkeep(Protocol):
    """The journal, after steps."""

    def maintain(self, machine: Machine) -> None:
        """Write a snapshot, or begin the next file, where one is due."""


class PossiblePublisher(Protocol):
    """The records, after steps."""

    def publish_possible(self, machine: Machine) -> None:
        """Publish what can be asked, where it has changed."""


class Loop:
    """Steps queued and due events; made first, because all parts report to it, and `run` gives it the engine.

    What is posted before that waits for it; there is no machine before that.
    """

    def __init__(self, ros: RosNode, clock: NodeClock, loaded: LoadedMissions) -> None:
        self._ros = ros
        self._clock = clock
        #: The missions that run.
        self.loaded = loaded
        self._early: list[Event] = []
        self._running: tuple[Engine, JournalUpkeep, PossiblePublisher] | None = None
        self._deadline: tuple[float, RosTimer] | None = None

    def run(self, engine: Engine, gate: JournalUpkeep, records: PossiblePublisher) -> None:
        """Run an engine, with what is to be done after its steps."""
        self._running = engine, gate, records
        for event in self._early:
            engine.post(event)

    def _parts(self) -> tuple[Engine, JournalUpkeep, PossiblePublisher]:
        if self._running is None:
            raise RuntimeError("the loop has no engine yet")
        return self._running

    @property
    def engine(self) -> Engine:
        """The engine.

        Raises:
            RuntimeError: there is none before `run`.
        """
        return self._parts()[0]

    @property
    def machine(self) -> Machine:
        """The machine that runs; see `engine`."""
        return self.engine.machine

    @property
    def chart(self) -> Chart:
        """The chart of the missions that run."""
        return self.loaded.chart

    def post(self, event: Event) -> None:
        """Queue an event for the next `work`."""
        if self._running is None:
            self._early.append(event)
        else:
            self._running[0].post(event)

    def work(self) -> None:
        """Step all queued and due events, then set the timer of the next deadline.

        An exception in one part keeps no other from its turn, and no request from being carried out.
        """
        if self._running is None:
            return
        drain = self._running[0].drain
        for part in (drain, self._sleep, self._maintain_journal, self._publish_possible):
            self._ros.guarded(part)()

    def _maintain_journal(self) -> None:
        engine, gate, _ = self._parts()
        gate.maintain(engine.machine)

    def _publish_possible(self) -> None:
        engine, _, records = self._parts()
        records.publish_possible(engine.machine)

    def _sleep(self) -> None:
        self._sleep_until(self.engine.next_deadline)

    def _sleep_until(self, due: float | None) -> None:
        if self._deadline is not None:
            if self._deadline[0] == due:
                return
            self._deadline[1].cancel()
            self._deadline = None
        if due is not None:
            self._deadline = due, self._ros.call_later(due - self._clock.now(), self._deadline_reached)

    def _deadline_reached(self) -> None:
        self._deadline = None
        self.work()
