"""How much a folder of missions may have, and that the state is told while it is understood."""

from __future__ import annotations

import itertools
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from std_srvs.srv import Trigger

from lupin_engine.errors import LupinError
from lupin_engine.missions.folders import MAX_BYTES, MAX_FILES, default_missions_folder, mission_files
from lupin_engine.plugin.registry import load_catalog
from lupin_msgs.msg import MissionState
from lupin_msgs.srv import StartMission
from lupin_ros.adapter.node import Qos
from lupin_ros.service.folder import MissionsFolder
from tests.lupin_ros.world import Operator, World

#: Seconds that a machine with much else to do may take for as many missions as there may be.
LOADING = 180.0


@pytest.fixture
def missions(tmp_path: Path) -> Path:
    """A folder with the shipped missions."""
    shutil.copytree(default_missions_folder(), tmp_path / "missions")
    return tmp_path / "missions"


def made(missions: Path) -> MissionsFolder:
    return MissionsFolder({"missions_path": str(missions)}, load_catalog())


def test_too_many_missions_are_refused_before_they_are_read(missions: Path) -> None:
    for number in range(MAX_FILES - 1):
        (missions / f"m{number}.yaml").write_text(f"mission: M{number}\n")
    with pytest.raises(LupinError) as caught:
        made(missions).load()
    assert str(caught.value) == (
        f"{MAX_FILES + 1} missions in {missions}; at most {MAX_FILES} are offered: "
        "name some with -p missions:=[NAME, ...], or move others elsewhere"
    )


def test_too_many_bytes_are_refused_and_a_running_node_goes_on(missions: Path) -> None:
    """Parts count, too; when the file is small again all is as it was."""
    found = made(missions)
    loaded = found.load()
    part = missions / "parts" / "visit_targets.yaml"
    text = part.read_text(encoding="utf-8")
    part.write_text(text + "#" * MAX_BYTES)
    sizes = [file.stat().st_size for file in (*missions.glob("[ei]*.yaml"), *missions.glob("parts/*.yaml"))]
    assert found.changed(loaded) is None
    assert found.problem == (
        f"the missions and parts in {missions} have {sum(sizes)} bytes; at most {MAX_BYTES} are "
        f"read; the largest is visit_targets.yaml with {part.stat().st_size}"
    )
    part.write_text(text)
    assert found.changed(loaded) is None
    assert found.problem == ""


class Watched:
    """Someone who hears the state all the time, and when each was told."""

    def __init__(self, operator: Operator) -> None:
        self.operator = operator
        self.times: list[float] = []
        operator.ros.subscribe(MissionState, "/mission/state", Qos.BACKLOG, self._hear)

    def _hear(self, state: MissionState) -> None:
        self.times.append(state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec)

    @property
    def longest_silence(self) -> float:
        """The longest time between two states, in seconds."""
        return max(after - before for before, after in itertools.pairwise(self.times))


def many(missions: Path) -> str:
    """Fill a folder with as many missions as it may have; return the name of the last."""
    text = (missions / "inspection.yaml").read_text(encoding="utf-8")
    names = [f"Inspection{number}" for number in range(MAX_FILES - len(mission_files(missions)))]
    for name in names:
        (missions / f"{name.lower()}.yaml").write_text(text.replace("InspectionMission", name), "utf-8")
    return names[-1]


def large(missions: Path) -> str:
    """Add a mission of nearly as many states as there may be; return its name."""
    states = "".join(f"  S{number}:\n    after: {{1 h: S{number + 1}}}\n" for number in range(4000))
    head = "mission: Large\nsummary: A long way.\ninitial: S0\nstates:\n"
    (missions / "large.yaml").write_text(f"{head}{states}  S4000: {{type: final}}\n", "utf-8")
    return "Large"


@pytest.mark.timeout(LOADING + 120)
@pytest.mark.parametrize("fill", [many, large])
def test_the_state_is_told_while_missions_are_loaded(
    world: World,
    operator: Operator,
    missions: Path,
    fill: Callable[[Path], str],
    record_property: Callable[[str, object], None],
) -> None:
    """A mission that is started meanwhile is begun when its file is read; what came after that waits."""
    world.start_all(missions_path=missions)
    operator.in_state("READY")
    watched = Watched(operator)
    operator.until(lambda: len(watched.times) > 10, "states")
    name = fill(missions)
    answers: dict[str, Any] = {}
    start, abort = (
        operator.ros.service(StartMission, "/mission/start"),
        operator.ros.service(Trigger, "/mission/abort"),
    )
    operator.until(lambda: start.ready() and abort.ready(), "the services")
    start.call(
        StartMission.Request(mission_type=name, tag_sequence=["1"]),
        LOADING,
        partial(answers.__setitem__, "start"),
    )
    abort.call(Trigger.Request(), LOADING, partial(answers.__setitem__, "abort"))
    operator.until(lambda: len(answers) == 2, "answers", LOADING)
    assert (answers["start"].accepted, answers["start"].error_message) == (True, "")
    assert answers["abort"].message == "abort accepted"
    told = len(watched.times)
    operator.until(lambda: len(watched.times) > told + 20, "states after that")
    record_property("silence_s", round(watched.longest_silence, 2))
    assert watched.longest_silence < 3.0, "the thread is let go on while files are read"
