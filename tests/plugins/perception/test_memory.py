"""What outlives the aggregator: written and read back, whole or not at all."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lupin_engine.errors import LupinError
from lupin_greenhouse.poses import pose_of
from lupin_perception.flowers import ColumnBloom, ScanSummary
from lupin_perception.memory import MissionFile, Past, memory_path
from lupin_perception.registry import Known

SUMMARY = ScanSummary(
    "tulip_red", 0.9, True, (ColumnBloom(3, "tulip_red", 0.9, False), ColumnBloom(5, "", 0.0, True))
)


def known(tag_id: str, distance: float = 1.5, summary: ScanSummary | None = None) -> Known:
    pose = pose_of((1.0, 2.0, 0.1), (0.0, 0.0, 0.6, 0.8))
    assert pose is not None
    return Known(tag_id, pose, distance, 7, 123.0, summary)


def test_what_was_written_is_read(tmp_path: Path) -> None:
    """All but when a tag was last seen, which is of another process' clock."""
    memory = MissionFile(tmp_path / "new" / "memory.json")
    assert memory.read() is None
    memory.write(Past("m0"))
    assert memory.read() == Past("m0", [], [], "")
    memory.write(Past("m1", [known("5", summary=SUMMARY), known("6", math.inf)], [(1.0, 2.0)], "5"))
    past = memory.read()
    assert past is not None
    assert (past.mission_id, past.reported, past.scanned) == ("m1", [(1.0, 2.0)], "5")
    five, six = past.tags
    assert (five.id, five.distance, five.sightings, five.summary) == ("5", 1.5, 7, SUMMARY)
    assert np.allclose(five.pose.position, (1.0, 2.0, 0.1))
    assert np.allclose(five.pose.rotation, (0.0, 0.0, 0.6, 0.8))
    assert (six.distance, six.summary, six.last_seen) == (math.inf, None, -math.inf)
    sure = ScanSummary("tulip_red", 1.0, False, (ColumnBloom(0, "tulip_red", 1.0, False),))
    once = known("7", summary=sure)
    once.sightings = 1
    memory.write(Past("m1", [once]))
    assert [(tag.sightings, tag.summary) for tag in (memory.read() or Past("")).tags] == [(1, sure)]
    assert [file.name for file in (tmp_path / "new").iterdir()] == ["memory.json"]


def test_a_memory_of_an_earlier_engine_is_read_as_it_was_written(tmp_path: Path) -> None:
    """Before scans were resumed nobody wrote down which one was under way."""
    file = tmp_path / "memory.json"
    file.write_text(
        '{"mission_id": "m1", "tags": [{"id": "5", "position": [1.0, 2.0, 0.1], "rotation": [0.0, 0.0, 0.6,'
        ' 0.8], "distance": null, "sightings": 7, "summary": {"species": "tulip_red", "confidence": 0.9,'
        ' "anomaly": true, "blooms": [[3, "tulip_red", 0.9, false], [5, "", 0.0, true]]}}],'
        ' "reported": [[1.0, 2.0]]}'
    )
    past = MissionFile(file).read()
    assert past is not None
    assert ([tag.summary for tag in past.tags], past.scanned) == ([SUMMARY], "")


@pytest.mark.parametrize(
    "wrong",
    [
        {"position": [1, 2]},
        {"position": [1, 2, math.nan]},
        {"position": [1, 2, 10**400]},
        {"rotation": [0, 0, 0, 0]},
        {"distance": math.nan},
        {"sightings": "many"},
        {"sightings": math.inf},
        {"sightings": 0},
        {"id": "\ud800"},
        {"summary": {"species": "", "confidence": 1e300, "anomaly": False, "blooms": []}},
        {"summary": {"species": "", "confidence": 0, "anomaly": False, "blooms": [[1, "", math.nan, 0]]}},
    ],
)
def test_a_tag_without_sense_makes_the_whole_unusable(tmp_path: Path, wrong: dict[str, Any]) -> None:
    """What no message could carry is told once at the start, and not each time that the tags are told."""
    file = tmp_path / "memory.json"
    MissionFile(file).write(Past("m1", [known("5")]))
    data = json.loads(file.read_text())
    data["tags"][0].update(wrong)
    file.write_text(json.dumps(data))
    with pytest.raises(
        LupinError, match=r"memory_file .* cannot be used: (Value|Overflow|UnicodeEncode)Error: "
    ):
        MissionFile(file).read()


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"position": [1, 2]}, "ValueError: tag '5' has no pose"),
        ({"sightings": 0}, "ValueError: tag '5' was never seen"),
        (
            {"summary": {"species": "", "confidence": 2, "anomaly": False, "blooms": []}},
            "ValueError: a confidence of 2",
        ),
    ],
)
def test_what_is_wrong_in_a_memory_is_told_with_the_file(
    tmp_path: Path, wrong: dict[str, Any], reason: str
) -> None:
    file = tmp_path / "memory.json"
    MissionFile(file).write(Past("m1", [known("5")]))
    data = json.loads(file.read_text())
    data["tags"][0].update(wrong)
    file.write_text(json.dumps(data))
    with pytest.raises(LupinError) as unusable:
        MissionFile(file).read()
    assert str(unusable.value) == f"memory_file {str(file)!r} cannot be used: {reason}"


def test_a_memory_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    path = tmp_path / "file" / "memory.json"
    with pytest.raises(LupinError) as refused:
        MissionFile(path).write(Past("m1"))
    assert str(refused.value) == f"memory_file {str(path)!r} cannot be written: File exists"


def test_a_path_that_cannot_be_is_told(tmp_path: Path) -> None:
    """Never a traceback at the start of the node."""
    with pytest.raises(LupinError, match=r"cannot be used: OSError: .*File name too long"):
        MissionFile(tmp_path / ("x" * 300)).read()


@pytest.mark.parametrize("path", ["~nobody-here/memory.json", f"{__file__}/memory.json"])
def test_a_folder_that_is_not_there_has_no_memory(path: str) -> None:
    assert MissionFile(memory_path(path, {})).read() is None


def test_where_nothing_is_kept_nothing_is_read() -> None:
    memory = MissionFile(memory_path("none", {}))
    memory.write(Past("m1"))
    assert memory.read() is None


def test_the_file_is_in_the_users_state_and_of_its_ros_domain(tmp_path: Path) -> None:
    """Two robots on one machine do not take each other's tags for their own."""
    state = {"XDG_STATE_HOME": str(tmp_path)}
    assert memory_path("", state) == tmp_path / "lupin" / "perception-0.json"
    assert memory_path("", {**state, "ROS_DOMAIN_ID": "42"}) == tmp_path / "lupin" / "perception-42.json"
    home = Path.home() / ".local" / "state"
    assert memory_path("", {"XDG_STATE_HOME": "relative"}) == home / "lupin" / "perception-0.json"
    assert memory_path("~/x.json", state) == Path.home() / "x.json"
