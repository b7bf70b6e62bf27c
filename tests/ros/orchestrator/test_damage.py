"""A journal with a flipped bit: every target of a mission that was broken off is accounted for, once."""

from __future__ import annotations

import json
import random
import signal
import struct
import zlib
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.machine.step import Step
from lupin_engine.missions.load import LoadedMissions
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.profile import Publish
from lupin_engine.ros.keeping import Keeping
from lupin_engine.ros.resuming import RESUME_PARAMETERS, LookBack, look_back
from lupin_engine.runtime.journal.frames import MAGIC, frame, read_frames
from lupin_engine.runtime.journal.journal import journal_files, mission_in_name
from lupin_engine.runtime.journal.recovery import outcomes_of
from lupin_engine.sim.simulation import Happening, Script, Simulation, Tell
from tests import shipped
from tests.ros.orchestrator.test_keeping import Node
from tests.ros.orchestrator.test_resume import NODE, kill, outcomes
from tests.ros.world import Operator, World

TARGETS = ["1", "5", "12", "21", "29"]
GIVEN = {name: one.default for name, one in RESUME_PARAMETERS.items()}
POSES = tuple(
    Happening(Tell("robot.pose", {"x": 0.1 * at, "y": 1 / 3, "yaw": 0.0}), float(at)) for at in range(40)
)


class BrokenOff:
    """The journal of an inspection of five tags whose process is gone after two of them, and what it told."""

    def __init__(self, folder: Path, loaded: LoadedMissions) -> None:
        self.folder, self.loaded = folder, loaded
        self.told: list[str] = []
        self.node = Node(journal_path=str(folder))
        self._keeping = Keeping(self.node, "boot", lambda: None, lambda _: None)  # type: ignore[arg-type]
        script = Script("InspectionMission", {"tag_sequence": TARGETS}, happenings=POSES)
        self._run = Simulation(loaded.chart, script, {}, log=self._keeping.journal)
        self.node.elapsed = lambda: self._run.now  # type: ignore[method-assign]
        self._run.listener = self._stepped
        self._keeping.begin(loaded, self._run.machine, "InspectionMission", "sim-1")
        self._run.begin()
        while len(self.told) < 2 or self._run.machine.view.phase != "NAVIGATING":
            assert self._run.go_on()
            self._settle()
        self._keeping.close()
        (self.file,) = (file for file in journal_files(folder) if mission_in_name(file))
        self.data = self.file.read_bytes()

    def _stepped(self, step: Step) -> None:
        self._keeping.publish(
            outcomes_of(step), lambda told: {"tag": told.target}, lambda fields: self.told.append(fields["tag"])
        )
        self._keeping.after(step, self._run.machine.view, self._run.machine)

    def _settle(self) -> None:
        done: list[bool] = []
        self._keeping.when_kept(lambda: done.append(True))
        self.node.work_until(lambda: bool(done))

    def with_data(self, data: bytes) -> LookBack | None:
        """Return what the next orchestrator finds."""
        self.file.write_bytes(data)
        return look_back(self.node, self.folder, self.loaded, GIVEN)[0]  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def broken(tmp_path_factory: pytest.TempPathFactory) -> BrokenOff:
    """Return it."""
    loaded = load_missions(["inspection"], shipped.catalog())
    return BrokenOff(tmp_path_factory.mktemp("journal"), loaded)


def accounted(broken: BrokenOff, found: LookBack | None) -> list[str]:
    """Return the targets that have an outcome or will get one, each as often as it does."""
    told = list(broken.told)
    if found is None:
        return told
    if found.machine is not None:
        return told + [visit.target for visit in found.machine.memory.outcomes if visit.target not in told]
    again = [told.target for _, told in found.recovered.untold] if found.recovered else []
    assert set(again) <= set(told), "what was published is published again as it was, nothing else"
    return told + [one.target for one in found.left_out]


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
