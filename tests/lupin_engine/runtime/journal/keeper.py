"""A loop that keeps a journal in a folder, as the orchestrator's does."""

from __future__ import annotations

import queue
from collections.abc import Callable
from pathlib import Path

from lupin_engine.machine.machine import Machine
from lupin_engine.machine.scope import World
from lupin_engine.runtime.clock import VirtualClock
from lupin_engine.runtime.journal.journal import Journal, Keep
from lupin_engine.runtime.journal.records import JournalHead


class Keeper:
    """A journal whose calls come when `settle` is called, on the thread that does."""

    def __init__(self, folder: Path, clock: VirtualClock, keep: Keep | None = None) -> None:
        self.calls: queue.Queue[Callable[[], None]] = queue.Queue()
        self.problems: list[str] = []
        self.clock = clock
        self.journal = Journal(folder, keep or Keep(), self, self._wall_ns)

    def post(self, call: Callable[[], None]) -> None:
        """Keep a call for `settle`."""
        self.calls.put(call)

    def disk_changed(self, problem: str) -> None:
        """Keep what is wrong."""
        self.problems.append(problem)

    def _wall_ns(self) -> int:
        return round(self.clock.wall() * 1e9)

    def begin(self, machine: Machine, mission_id: str = "", boot: str = "boot1") -> None:
        """Begin a file about a machine."""
        self.journal.begin(head_of(machine.world, machine, self.clock, mission_id, boot))

    def settle(self) -> None:
        """Wait until all that was written is on the disk, or has failed, and let what waits for it go on."""
        done: list[bool] = []
        self.journal.when_flushed(lambda: done.append(True))
        while not done:
            self.calls.get(timeout=10.0)()


def head_of(world: World, machine: Machine, clock: VirtualClock, mission_id: str, boot: str) -> JournalHead:
    """Return the head of a file about a machine as it is."""
    return JournalHead(
        boot=boot,
        engine="test",
        chart="hash",
        chart_name=world.chart.name,
        profile=world.chart.profile.name,
        parameters=dict(world.parameters),
        time=clock.now(),
        ahead_ns=round((clock.wall() - clock.now()) * 1e9),
        mission_id=mission_id,
        seed=world.seed,
        snapshot=machine.snapshot() if machine.memory.sequence else "",
    )
