"""A journal with a flipped bit: every target of a mission that was broken off is accounted for, once."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from lupin_engine.machine.step import Step
from lupin_engine.missions.load import LoadedMissions
from lupin_engine.missions.selection import load_missions
from lupin_engine.runtime.journal.frames import MAGIC, frame, read_frames
from lupin_engine.runtime.journal.journal import journal_files, mission_in_name
from lupin_engine.runtime.journal.recovery import outcomes_of
from lupin_engine.sim.simulation import Happening, Script, SetValue, Simulation
from lupin_ros.orchestrator.journal_gate import JournalGate
from lupin_ros.orchestrator.recovery import RESUME_PARAMETERS, Recovery, find_recovery
from tests import shipped
from tests.lupin_ros.orchestrator.test_journal_gate import Node
from tests.lupin_ros.orchestrator.test_resume import NODE, kill, outcomes, start_again
from tests.lupin_ros.world import Operator, World

TARGETS = ["1", "5", "12", "21", "29"]
GIVEN = {name: one.default for name, one in RESUME_PARAMETERS.items()}
POSES = tuple(
    Happening(SetValue("robot.pose", {"x": 0.1 * at, "y": 1 / 3, "yaw": 0.0}), float(at)) for at in range(40)
)


class BrokenOff:
    """The journal of an inspection of five tags whose process is gone after two of them, and what it told."""

    def __init__(self, folder: Path, loaded: LoadedMissions) -> None:
        self.folder, self.loaded = folder, loaded
        self.told: list[str] = []
        self.node = Node(journal_path=str(folder))
        self._gate = JournalGate(self.node, "boot", Mock())  # type: ignore[arg-type]
        script = Script("InspectionMission", {"tag_sequence": TARGETS}, happenings=POSES)
        self._run = Simulation(loaded.chart, script, {}, log=self._gate.journal)
        self.node.elapsed = lambda: self._run.now  # type: ignore[method-assign]
        self._run.listener = self._stepped
        self._gate.begin(loaded, self._run.machine, "InspectionMission", "sim-1")
        self._run.begin()
        while len(self.told) < 2 or self._run.machine.view.phase != "NAVIGATING":
            assert self._run.advance()
            self._settle()
        self._gate.close()
        (self.file,) = (file for file in journal_files(folder) if mission_in_name(file))
        self.data = self.file.read_bytes()

    def _stepped(self, step: Step) -> None:
        def send(fields: Mapping[str, Any]) -> None:
            self.told.append(fields["tag"])

        channel = Mock(fields=lambda told: {"tag": told.target}, publish=send)
        self._gate.publish(outcomes_of(step), channel)
        self._gate.after_step(step, self._run.machine.view, self._run.machine)

    def _settle(self) -> None:
        done: list[bool] = []
        self._gate.when_flushed(lambda: done.append(True))
        self.node.work_until(lambda: bool(done))

    def with_data(self, data: bytes) -> Recovery | None:
        """Return what the next orchestrator finds."""
        self.file.write_bytes(data)
        return find_recovery(self.node, self.folder, self.loaded, GIVEN)[0]  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def broken(tmp_path_factory: pytest.TempPathFactory) -> BrokenOff:
    """Return it."""
    loaded = load_missions(["inspection"], shipped.catalog())
    return BrokenOff(tmp_path_factory.mktemp("journal"), loaded)


def accounted(broken: BrokenOff, found: Recovery | None) -> list[str]:
    """Return the targets that have an outcome or will get one, each as often as it does."""
    told = list(broken.told)
    if found is None:
        return told
    if found.machine is not None:
        return told + [visit.target for visit in found.machine.memory.outcomes if visit.target not in told]
    untold = [told.target for _, told in found.recovered.unreported] if found.recovered else []
    return told + untold + [one.target for one in found.left_out]


def flips(data: bytes) -> list[int]:
    """Return places of bits: in the magic, and in each record's length, checksum and content."""
    dice = random.Random(31)
    places = [8 * at + dice.randrange(8) for at in range(len(MAGIC))]
    at = len(MAGIC)
    for end in read_frames(data).ends:
        places += [8 * (at + 4 * part) + dice.randrange(32) for part in (0, 1)]
        places += [dice.randrange(8 * (at + 8), 8 * end) for _ in range(6)]
        at = end
    return places


def test_a_flipped_bit_leaves_no_target_without_an_outcome_and_none_with_two(broken: BrokenOff) -> None:
    """Wherever it is: in the magic, in the head, in the start, in what was told, in the last record."""
    places = flips(broken.data)
    assert len(places) > 300
    wrong: dict[int, list[str]] = {}
    for place in places:
        data = bytearray(broken.data)
        data[place // 8] ^= 1 << place % 8
        found = sorted(accounted(broken, broken.with_data(bytes(data))))
        if found != sorted(TARGETS):
            wrong[place] = found
    assert not wrong, f"{len(wrong)} of {len(places)} flips"


def wrong_records() -> list[bytes]:
    """Return contents of records that are none, each of which a checksum may fit."""
    deep, long = "[" * 200_000, "9" * 5_000
    records = [
        ["event", 1.0],
        ["event", "soon", "mission.start", {}],
        ["event", 1e300, "mission.start", {}],
        ["event", 1.0, 7, {}],
        ["event", 1.0, "mission.start", []],
        ["event", 1.0, "operator.pause", {}, {"by": 7}],
        ["event", True, "operator.pause", {}],
        ["v", 5, 99, 0],
        ["v", 10**400, "robot.pose", 0, 1],
        ["v", 5, "robot.pose", None],
        ["p", 5, "a"],
        ["timer"],
        ["timer", None],
        ["timer", float("nan")],
        ["start", 0.0, "x"],
        ["start", 0.0, None],
        ["resumed", 1.0, {}],
        ["resumed", 1.0, {"boot": 1, "ahead_ns": 0, "shift": 0.0}],
        ["resumed", 1.0, {"boot": "b", "ahead_ns": 10**40, "shift": 0.0}],
        ["resumed", 1.0, {"boot": "b", "ahead_ns": 0, "shift": 1e300}],
        ["outcome", 1],
        ["outcome", "one", {}, {}],
        ["outcome", 1, {"target": "29"}, {}],
        ["outcome", 1, {"target": ["29"], "mission_id": "sim-1"}, {}],
        ["published", "1"],
        ["answered", "c", "resume", None],
        ["wall", "now"],
        ["wall", 10**40],
        ["snapshot", {"memory": {}}],
        ["snapshot", "{}"],
        ["targets", "M", "sim-1", [7]],
        ["targets", "M", "sim-1"],
        ["end"],
        ["head", {}],
        ["what", 1, 2],
        [7],
        [],
        {},
        None,
        [["event"]],
    ]
    bare = [b"", b"\xff\xfe", b"7", b'["', deep.encode(), f'["event",{long},"x",{{}}]'.encode()]
    bare.append(b'["event",1.0,"x",' + b'{"a":' * 100_000 + b"1" + b"}" * 100_000 + b"]")
    return [*(json.dumps(record).encode() for record in records), *bare]


@pytest.mark.parametrize("before_the_end", [True, False])
def test_a_record_of_another_shape_is_damage(broken: BrokenOff, before_the_end: bool) -> None:
    """Its checksum fits, whoever wrote it; what comes before it is used, and nothing raises."""
    ends = read_frames(broken.data).ends
    at = ends[len(ends) // 2] if before_the_end else ends[-1]
    for content in wrong_records():
        data = broken.data[:at] + frame(content) + broken.data[at:]
        found = sorted(accounted(broken, broken.with_data(data)))
        assert found == sorted(TARGETS), content[:80]


def test_what_is_in_the_journal_and_no_outcome_is_not_published(broken: BrokenOff) -> None:
    """The rest is: a message that cannot be made of its fields ends nothing."""
    back = broken.with_data(broken.data)
    assert back is not None
    gate = JournalGate(Node(journal_path=str(broken.folder)), "boot", Mock())  # type: ignore[arg-type]
    sent: list[Any] = []

    def send(fields: Mapping[str, Any]) -> None:
        if fields["tag"] == TARGETS[0]:
            raise TypeError("no such field")
        sent.append(fields["tag"])

    gate.republish(back, [], Mock(publish=send))
    gate.close()
    assert sent == broken.told[1:]


@pytest.mark.parametrize("part", ["head", "start", "middle", "outcome"])
@pytest.mark.timeout(180)
def test_after_a_flipped_bit_every_target_has_one_outcome(
    world: World, operator: Operator, own_state: Path, part: str
) -> None:
    """On the topic, whoever listens: those that were published and those that are left."""
    world.start_all(speed=4.0)
    operator.in_state("READY")
    assert operator.start("1", "5", "12", "21").accepted
    operator.until(lambda: len(operator.observations) == 2, "two outcomes")
    operator.in_state("INSPECTING", "NAVIGATING")
    kill(world)
    (file,) = (file for file in journal_files(own_state) if mission_in_name(file))
    data = bytearray(file.read_bytes())
    frames = read_frames(bytes(data))
    kinds = [content[:9] for content in frames.contents]
    index = {"head": 0, "start": 1, "middle": len(kinds) // 2, "outcome": kinds.index(b'["outcome')}[part]
    data[frames.ends[index] - 20] ^= 4
    file.write_bytes(data)
    operator.states.clear()
    world.start(NODE, estop_timeout_s=10.0)
    operator.until(lambda: len(outcomes(operator)) == 4, "what became of every target")
    operator.until(lambda: "mission_closed" in operator.state.last_error, "that the mission is closed")
    operator.in_state("READY")
    assert outcomes(operator) == {("1", 0): 1, ("5", 0): 1, ("12", 3): 1, ("21", 3): 1}
    place = f"{file} is damaged at byte {frames.ends[index - 1] if index else 0}"
    assert {o.status_detail.partition(":")[0] for o in operator.observations if o.status} == {place}


@pytest.mark.timeout(180)
def test_a_removed_journal_is_noticed(world: World, operator: Operator, own_state: Path) -> None:
    """Within a second: the mission is held, and is written anew; then it can go on, and survives a kill."""
    world.start_all(speed=1.0)
    operator.in_state("READY")
    assert operator.start("1", "5").accepted
    operator.in_state("INSPECTING", "NAVIGATING")
    shutil.rmtree(own_state)
    removed = operator.ros.now()
    operator.until(lambda: operator.state.paused, "the mission is held")
    assert operator.ros.now() - removed < 1.0
    assert operator.state.last_error == f"journal_failed: its file was removed: {own_state}"
    operator.until(lambda: operator.ask("resume").success, "the journal is written again")
    kill(world)
    start_again(world, operator)
    operator.resume()
    operator.until_done(published=2)
    assert outcomes(operator) == {("1", 0): 1, ("5", 0): 1}
