"""A flood of requests that are refused: some are written, the others counted, and the run is the same."""

from __future__ import annotations

from pathlib import Path

from lupin_engine.machine.event import Event
from lupin_engine.machine.machine import Machine
from lupin_engine.replay.journaled import replay_run, runs_of
from lupin_engine.replay.why import Inquiry
from lupin_engine.runtime.clock import VirtualClock
from lupin_engine.runtime.engine import Engine
from lupin_engine.runtime.journal.journal import journal_files
from lupin_engine.runtime.journal.records import read_journal
from lupin_engine.runtime.journal.recovery import recover
from lupin_engine.runtime.journal.refusals import WINDOW_BYTES, Refusals
from lupin_engine.runtime.setup import make_world
from tests import shipped
from tests.lupin_engine.runtime.journal.keeper import Keeper

#: As long as those of `tests.faults.flood`: 15 kB.
LONG = {"mission_type": "x" * 5000, "tag_sequence": ["y" * 500] * 20, "mission_id": "lupin-1"}
START = Event("mission.start", LONG)


class Told(list[tuple[str, str, int]]):
    """What is recorded."""

    def refused(self, request: str, code: str, more: int) -> None:
        """Keep it."""
        self.append((request, code, more))


def test_some_of_each_kind_are_written_and_the_others_are_counted() -> None:
    told = Told()
    refusals = Refusals(told)
    counted = [refusals.is_one_more(START, "unknown_mission", 0.003 * number) for number in range(477)]
    assert counted == [False] * 4 + [True] * 473
    assert not refusals.is_one_more(START, "not_possible", 1.5)
    assert not refusals.is_one_more(Event("operator.pause"), "unknown_mission", 1.5)
    refusals.report_due(9.9)
    assert told == []
    refusals.report_due(10.0)
    assert told == [("mission.start", "unknown_mission", 473)]
    assert not refusals.is_one_more(START, "unknown_mission", 10.1)


def test_answers_that_nobody_asked_for_are_alike_whatever_they_are_called() -> None:
    told = Told()
    refusals = Refusals(told)
    names = [f"answer.{number:0100}" for number in range(2000)]
    counted = [refusals.is_one_more(Event(name), "not_possible", 1.0) for name in names]
    assert 400 < counted.count(False) < WINDOW_BYTES // 100
    refusals.report_all()
    assert told == [("answer.", "not_possible", counted.count(True))]


def test_a_request_that_is_too_large_to_be_written_is_counted() -> None:
    told = Told()
    refusals = Refusals(told)
    assert refusals.is_one_more(Event("mission.start", {"tags": ["1"] * 40_000}), "bad_request", 0.0)
    refusals.report_all()
    assert told == [("mission.start", "bad_request", 1)]


def test_a_run_with_a_flood_in_it_is_the_same_when_it_is_replayed(tmp_path: Path) -> None:
    """Its memory, and the number of its steps; who asks why is told how many more there were."""
    loaded, clock = shipped.mission("inspection"), VirtualClock(0.0, 1.8e9)
    keeper = Keeper(tmp_path, clock)
    world = make_world(loaded, {})
    machine = Machine(world)
    engine = Engine(machine, clock, {}, lambda step: None, log=keeper.journal)
    keeper.begin(machine)
    engine.start()
    refusals, sent = Refusals(keeper.journal), 0
    for number in range(477):
        clock.move_to(0.003 * number)
        foreseen = machine.dry_run(START, clock.now()).refusal
        assert foreseen is not None
        if not refusals.is_one_more(START, foreseen.code, clock.now()):
            assert engine.request(START).refusal == foreseen
            sent += 1
    refusals.report_all()
    keeper.settle()
    keeper.journal.close()
    (file,) = journal_files(tmp_path)
    assert (sent, file.stat().st_size < 70_000) == (4, True)
    assert recover(read_journal(file), world).machine.snapshot() == machine.snapshot()
    (run,) = runs_of(tmp_path)
    lived, again = replay_run(run, loaded)
    assert again.memory.sequence == machine.memory.sequence
    assert [each.step.notes[-1:] for each in lived[-2:]] == [(), ("and 473 more like it",)]
    told = Inquiry(loaded, lived, 1).moment(1.8e9 + 2.0)
    assert told.causes
