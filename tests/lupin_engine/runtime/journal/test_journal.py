"""What entered a machine, on disk: its memory is made of it again, and what was promised waits for it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.machine.event import Event
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.scope import World
from lupin_engine.plugin.profile import Publish
from lupin_engine.runtime.clock import VirtualClock
from lupin_engine.runtime.engine import Engine
from lupin_engine.runtime.journal import journal as journals
from lupin_engine.runtime.journal.journal import Keep, journal_files
from lupin_engine.runtime.journal.records import JournalError, JournalFile, read_head, read_journal
from lupin_engine.runtime.journal.recovery import recover
from lupin_engine.runtime.journal.replay import replay
from lupin_engine.runtime.journal.writer import LOCK
from lupin_engine.sim.simulation import Ask, Happening, Script, SetValue, Simulation
from tests import shipped
from tests.lupin_engine.machine.charts import chart
from tests.lupin_engine.runtime.journal.keeper import Keeper

TAGS = {"tag_sequence": [str(number) for number in range(1, 6)]}
HAPPENINGS = (
    Happening(Ask("operator.pause"), 12.0),
    Happening(Ask("operator.resume"), 19.0),
    Happening(SetValue("robot.estop", True), 33.0),
    Happening(SetValue("robot.estop", False), 40.0),
    Happening(Ask("operator.resume"), 41.0),
    *(Happening(SetValue("robot.pose", {"x": 0.1 * t, "y": 1 / 3, "yaw": 0.0}), float(t)) for t in range(90)),
)


def only(folder: Path) -> JournalFile:
    """Return the one file of a folder."""
    (file,) = journal_files(folder)
    return read_journal(file)


def ran(folder: Path) -> tuple[Simulation, JournalFile]:
    """Run an inspection that keeps a journal, and return both."""
    script = Script("InspectionMission", TAGS, happenings=HAPPENINGS)
    keeper = Keeper(folder, VirtualClock(0.0, 1.8e9))
    run = Simulation(shipped.mission("inspection"), script, {}, log=keeper.journal)
    keeper.begin(run.machine, "sim-1")
    run.begin()
    while not run.is_over and run.advance():
        keeper.journal.compact(run.machine)
        keeper.settle()
    keeper.journal.close()
    return run, only(folder)


def test_a_mission_is_replayed_to_the_same_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same steps, and at every snapshot and in the end the same memory."""
    monkeypatch.setattr(journals, "SNAPSHOT_BYTES", 2_000)
    monkeypatch.setattr(journals, "SNAPSHOT_TIMES", 0)
    run, found = ran(tmp_path)
    kinds = [record.kind for record in found.records]
    assert kinds.count("snapshot") > 3
    steps = [each.step for each in replay(found, run.machine.world) if each.step is not None]
    assert [repr(step) for step in steps] == [repr(step) for step in run.steps]
    assert recover(found, run.machine.world).machine.snapshot() == run.machine.snapshot()


def test_another_engine_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that does otherwise than the one that was recorded is not gone on with."""
    monkeypatch.setattr(journals, "SNAPSHOT_BYTES", 2_000)
    monkeypatch.setattr(journals, "SNAPSHOT_TIMES", 0)
    run, found = ran(tmp_path)
    done = next(r for r in found.records[40:] if r.kind == "event" and r.data[0] == "attempt.done")
    found.records.remove(done)
    with pytest.raises(JournalError, match="the machine of now does not come to what was recorded"):
        list(replay(found, run.machine.world))


def test_a_large_memory_does_not_begin_one_file_after_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each begins with a snapshot, which alone may be more than a file of its kind has."""
    monkeypatch.setattr(journals, "IDLE_BYTES", 1_000)
    machine = Machine(World(chart({"A": {}}, context={"text": "x" * 2_000}), {}, {}, {}))
    machine.start(0.0)
    keeper = Keeper(tmp_path, VirtualClock(0.0, 1.8e9))
    keeper.begin(machine)
    assert not keeper.journal.compact(machine)
    size, count = len(machine.snapshot()), 0
    while not keeper.journal.compact(machine):
        keeper.journal.handled(1.0, Event("a", {"text": "x" * 200}), {})
        count += 1
    assert 6 * size < count * 250 < 8 * size
    keeper.journal.close()


def test_what_was_told_is_numbered_and_marked(tmp_path: Path) -> None:
    """The outbox: what is written before it leaves, and the mark after it; numbers go on in the next file."""
    keeper = Keeper(tmp_path, VirtualClock(0.0, 1.8e9))
    machine = Machine(World(chart({"A": {}}), {}, {}, {}))
    keeper.begin(machine, "m1")
    told = Publish("M", "m1", "7", "OK", reading={"stamp": 1.5})
    assert keeper.journal.outcome(told, {"status": 0}) == 1
    keeper.journal.published(1)
    keeper.begin(machine, "m2")
    assert keeper.journal.outcome(told, {"status": 0}) == 2
    keeper.settle()
    keeper.journal.close()
    first, second = map(read_journal, journal_files(tmp_path))
    assert [(r.kind, r.data[0]) for r in first.records[1:]] == [("outcome", 1), ("published", 1)]
    assert first.records[1].data[1]["target"] == "7"
    assert (second.head.outcomes, second.records[1].data[0]) == (1, 2)


def test_the_wall_clock_of_each_record_is_known(tmp_path: Path) -> None:
    """Also when it is set: from there on the records show the other time."""
    clock = VirtualClock(100.0, 1.8e9)
    keeper = Keeper(tmp_path, clock)
    keeper.begin(Machine(World(chart({"A": {}}), {}, {}, {})))
    keeper.journal.handled(clock.now(), Event("a", {"b": [1, None]}), {"by": "hmi", "command_id": "c1"})
    clock.move_to(110.0)
    clock.set_wall(1.9e9)
    keeper.journal.handled(clock.now(), Event("value", {"name": "x", "value": 1, "stamp": 2.5}), {})
    keeper.journal.close()
    _, first, wall, second = only(tmp_path).records
    assert (first.time, first.wall, first.event) == (100.0, 1.8e9, Event("a", {"b": [1, None]}))
    assert first.origin == {"by": "hmi", "command_id": "c1"}
    assert (wall.kind, second.time, second.wall, second.kind) == ("wall", 110.0, 1.9e9, "value")
    assert second.event == Event("value", {"name": "x", "value": 1, "stamp": 2.5})


@pytest.mark.parametrize("another_process", [False, True])
def test_the_newest_file_is_the_newest_whatever_the_clock_says(tmp_path: Path, another_process: bool) -> None:
    """The clock was an hour ahead once: what was written then must not hide the mission of now."""
    clock = VirtualClock(0.0, 1.8e9)
    keeper, machine = Keeper(tmp_path, clock), Machine(World(chart({"A": {}}), {}, {}, {}))
    keeper.begin(machine)
    clock.set_wall(1.8e9 + 3600.0)
    keeper.begin(machine)
    clock.set_wall(1.8e9 + 1.0)
    if another_process:
        keeper.settle()
        keeper.journal.close()
        keeper = Keeper(tmp_path, clock)
    for mission_id in ("m1", "m2"):
        keeper.begin(machine, mission_id)
    keeper.settle()
    keeper.journal.close()
    heads = [read_head(file) for file in journal_files(tmp_path)]
    assert [head.mission_id for head in heads if head] == ["", "", "m1", "m2"]


def test_a_file_with_a_name_of_no_date_is_nobodys_newest(tmp_path: Path) -> None:
    """Somebody else put it there."""
    (tmp_path / "20269999T000000.000Z_x.journal").write_bytes(b"")
    keeper = Keeper(tmp_path, VirtualClock(0.0, 1.8e9))
    keeper.begin(Machine(World(chart({"A": {}}), {}, {}, {})))
    keeper.settle()
    keeper.journal.close()
    assert (tmp_path / "20270115T080000.000Z_idle.journal").exists()


def test_a_journal_of_another_version_is_called_so(tmp_path: Path) -> None:
    file = tmp_path / "x.journal"
    file.write_bytes(b"lupin journal 1\n" + b"x" * 100)
    with pytest.raises(JournalError) as told:
        read_journal(file)
    why = "was written by another version of the engine; this one does not read it"
    assert str(told.value) == f"{file} {why}"


def test_so_many_missions_are_kept(tmp_path: Path) -> None:
    """The oldest go first, the idle times between them as well."""
    clock = VirtualClock(0.0, 1.8e9)
    keeper = Keeper(tmp_path, clock, Keep(missions=3))
    machine = Machine(World(chart({"A": {}}), {}, {}, {}))
    for number in range(8):
        for mission_id in (f"m{number}", ""):
            keeper.begin(machine, mission_id)
            clock.move_to(clock.now() + 1.0)
    keeper.settle()
    keeper.journal.close()
    heads = [read_head(file) for file in journal_files(tmp_path)]
    kept = [head.mission_id for head in heads if head]
    assert [name for name in kept if name] == ["m5", "m6", "m7"]
    assert kept.count("") == 3


def test_who_is_old_goes(tmp_path: Path) -> None:
    """By days, where there are fewer than may be kept."""
    clock = VirtualClock(0.0, 1.8e9)
    keeper = Keeper(tmp_path, clock, Keep(days=1.0))
    machine = Machine(World(chart({"A": {}}), {}, {}, {}))
    keeper.begin(machine, "old")
    keeper.settle()
    (file,) = journal_files(tmp_path)
    os.utime(file, (1.7e9, 1.7e9))
    clock.move_to(1.0)
    keeper.begin(machine, "new")
    keeper.settle()
    keeper.journal.close()
    assert only(tmp_path).head.mission_id == "new"


def test_what_is_too_large_together_goes(tmp_path: Path) -> None:
    """The oldest first; the file that is written stays however large it is."""
    clock = VirtualClock(0.0, 1.8e9)
    keeper = Keeper(tmp_path, clock, Keep(size=2500))
    machine = Machine(World(chart({"A": {}}), {}, {}, {}))
    for number in range(4):
        keeper.begin(machine, f"m{number}")
        keeper.settle()
        newest = journal_files(tmp_path)[-1]
        newest.write_bytes(newest.read_bytes() + b"x" * 1000)
        clock.move_to(clock.now() + 1.0)
    keeper.journal.close()
    assert [file.stem[-2:] for file in journal_files(tmp_path)] == ["m2", "m3"]


# -- the disk ---------------------------------------------------------------------------------------------


def test_a_disk_that_fails_is_told_once_and_tried_again(tmp_path: Path) -> None:
    """What waits goes on, nothing half written is read; a new file begins with the memory."""
    keeper = Keeper(tmp_path, VirtualClock(0.0, 1.8e9))
    machine = Machine(World(chart({"A": {}}), {}, {}, {}))
    sync = keeper.journal._writer._sync

    def fails(_: int) -> None:
        raise OSError(28, "No space left on device")

    keeper.begin(machine, "m1")
    keeper.settle()
    keeper.journal._writer._sync = fails
    keeper.journal.handled(0.0, Event("a"), {})
    keeper.settle()
    assert keeper.problems == [keeper.journal.problem] == ["No space left on device"]
    keeper.begin(machine, "m1")
    keeper.settle()
    assert len(keeper.problems) == 1
    keeper.journal._writer._sync = sync
    keeper.begin(machine, "m1")
    keeper.settle()
    assert keeper.problems == ["No space left on device", ""]
    assert keeper.journal.problem == ""
    keeper.journal.close()


def test_a_folder_that_cannot_be_is_a_problem_and_no_exception(tmp_path: Path) -> None:
    """For example a file in its place."""
    (tmp_path / "journal").write_text("")
    keeper = Keeper(tmp_path / "journal" / "domain-0", VirtualClock())
    keeper.begin(Machine(World(chart({"A": {}}), {}, {}, {})))
    keeper.settle()
    assert keeper.problems == ["Not a directory"]
    keeper.journal.close()


def test_two_processes_do_not_write_one_journal(tmp_path: Path) -> None:
    """The second is told; when the first is gone it can be tried again."""
    machine = Machine(World(chart({"A": {}}), {}, {}, {}))
    first, second = Keeper(tmp_path, VirtualClock()), Keeper(tmp_path, VirtualClock(5.0))
    first.begin(machine)
    first.settle()
    second.begin(machine)
    second.settle()
    assert second.problems == [f"another process writes to {tmp_path}"]
    first.journal.close()
    second.begin(machine)
    second.settle()
    assert second.problems[1:] == [""]
    second.journal.close()
    assert (tmp_path / LOCK).exists()


def test_a_disk_that_does_not_answer_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What waits for it goes on after `PATIENCE_S`."""
    monkeypatch.setattr(journals, "PATIENCE_S", 0.0)
    keeper = Keeper(tmp_path, VirtualClock())
    keeper.begin(Machine(World(chart({"A": {}}), {}, {}, {})))
    keeper.settle()
    hangs = keeper.calls
    blocked: list[int] = []

    def hang(descriptor: int) -> None:
        blocked.append(descriptor)
        hangs.get(timeout=10.0)()

    keeper.journal._writer._sync = hang
    done: list[str] = []
    keeper.journal.when_flushed(lambda: done.append("went on"))
    while not blocked:
        keeper.journal.when_flushed(lambda: done.append("as well"))
    keeper.journal.check_disk()
    assert keeper.problems == ["the disk has not answered for 0 s"]
    hangs.put(lambda: None)
    keeper.journal.close()


# -- the loop ---------------------------------------------------------------------------------------------


class Held:
    """A log that keeps nothing before it is told to."""

    def __init__(self) -> None:
        self.noted: list[str] = []
        self.waiting: list[Any] = []

    def started(self, now: float, ahead: float | None) -> None:
        """Note it."""
        self.noted.append("start")

    def handled(self, now: float, event: Event, origin: Any) -> None:
        """Note it."""
        self.noted.append(event.name)

    def fired(self, now: float) -> None:
        """Note it."""
        self.noted.append("timer")

    def loaded(self, now: float) -> None:
        """Note it."""
        self.noted.append("loaded")

    def when_flushed(self, then: Any) -> None:
        """Wait."""
        self.waiting.append(then)

    def keep(self) -> None:
        """Let all go on that waits."""
        waiting, self.waiting = self.waiting, []
        for then in waiting:
            then()


class Base:
    """A driver that notes what it is told."""

    def __init__(self) -> None:
        self.told: list[str] = []

    def start(self, attempt: str, operation: str, arguments: Any) -> None:
        """Note it."""
        self.told.append(f"start {attempt}")

    def cancel(self, attempt: str) -> None:
        """Note it."""
        self.told.append(f"cancel {attempt}")

    def act(self, action: str, arguments: Any) -> None:
        """Note it."""
        self.told.append(f"act {action}")


def driven(log: Held) -> tuple[Engine, Base]:
    """Return a started loop whose chart drives, and is stopped by an event."""
    states = {"A": {"invoke": "nav.go", "on": {"stop": "B"}}, "B": {"entry": "!arm.preset"}}
    base, clock = Base(), VirtualClock()
    machine = Machine(World(chart(states), {}, {}, {}))
    engine = Engine(machine, clock, {"nav": base, "arm": base}, lambda _: None, log=log)  # type: ignore[dict-item]
    engine.start()
    return engine, base


def test_nothing_begins_before_it_is_kept() -> None:
    """The input is written before the step, the goal is sent after the disk has it."""
    log = Held()
    engine, base = driven(log)
    assert (log.noted, base.told) == (["start"], [])
    log.keep()
    assert base.told == ["start a2"]
    engine.post(Event("stop"))
    engine.drain()
    assert base.told == ["start a2", "cancel a2"]  # what stops waits for no disk
    log.keep()
    assert base.told == ["start a2", "cancel a2", "act preset"]


def test_what_is_not_wanted_any_more_never_begins() -> None:
    """Its server has not heard of it, so there is nothing to cancel, and the attempt has ended."""
    log = Held()
    engine, base = driven(log)
    engine.post(Event("stop"))
    engine.drain()
    assert not engine.machine.memory.attempts
    log.keep()
    assert base.told == ["act preset"]
