"""A whole run, recorded by `lupin run --record` and by `lupin record` beside it."""

from __future__ import annotations

import json
import re
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.lupin_ros.launch.processes import Lupin, until
from tests.lupin_ros.recording.reading import channels, whole

pytestmark = pytest.mark.timeout(240)

Start = Callable[..., Lupin]

#: What Foxglove shows of a robot: the map, where it is on it, the way that it plans, and the mission.
SHOWN = {
    "/map": "nav_msgs/msg/OccupancyGrid",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/plan": "nav_msgs/msg/Path",
    "/mission/state": "lupin_msgs/msg/MissionState",
    "/floranova/observations": "lupin_msgs/msg/Observation",
    "/twin/state": "lupin_msgs/msg/TwinState",
    "/mission_orchestrator/steps": "std_msgs/msg/String",
    "/mission_orchestrator/chart": "std_msgs/msg/String",
    "/mission_orchestrator/missions": "std_msgs/msg/String",
    "/rosout": "rcl_interfaces/msg/Log",
}


def test_a_run_is_recorded_from_within_and_from_beside(lupin: Start, tmp_path: Path) -> None:
    """Every step without a gap, every topic that is looked at, all decoded; the one beside ends by itself."""
    within, beside = tmp_path / "within.mcap", tmp_path / "beside.mcap"
    onlooker = lupin("record", "--output", str(beside))
    run = lupin("run", "inspection", "--tags", "1,5", "--speed", "5", "--json", "--record", str(within))
    assert run.end() == 0, run.output
    assert onlooker.end(30.0) == 0, onlooker.output
    seen = [record["step"]["sequence"] for record in run.records("step")]
    assert len(seen) > 20
    for file, command in ((within, run), (beside, onlooker)):
        found = whole(file)
        assert {name: schema.name for name, (_, schema) in channels(file).items()}.items() >= SHOWN.items()
        assert found.keys() >= SHOWN.keys()
        charts = {json.loads(one.value.data)["hash"] for one in found["/mission_orchestrator/chart"]}
        steps = [json.loads(one.value.data) for one in found["/mission_orchestrator/steps"]]
        assert {record["chart"] for record in steps} == charts
        numbers = [record["step"]["sequence"] for record in steps]
        assert [number for number in numbers if seen[0] <= number <= seen[-1]] == seen
        assert {one.value.lifecycle_state for one in found["/mission/state"]} >= {"INSPECTING", "DONE"}
        assert {one.value.status for one in found["/floranova/observations"]} == {0}
        times = [one.heard for messages in found.values() for one in messages]
        assert max(times) - min(times) < 240e9
        count = sum(map(len, found.values()))
        told = re.search(
            r"recorded ([\d,]+) messages of \d+ topics, [\d.]+ [kM]B, in (\S+\.mcap)", command.output
        )
        assert told is not None, command.output
        assert (told[1], told[2]) == (f"{count:,}", str(file))


def test_ctrl_c_ends_a_recording_and_not_its_file(lupin: Start, tmp_path: Path) -> None:
    """The one beside ends at once, with exit code 0; the run's own has the way home, and exit code 130."""
    within, beside = tmp_path / "within.mcap", tmp_path / "beside.mcap"
    onlooker = lupin("record", "--output", str(beside))
    run = lupin("run", "inspection", "--tags", "1,21", "--speed", "4", "--json", "--record", str(within))
    run.until_line('"INSPECTING"')
    until(lambda: beside.stat().st_size > 10_000, "something to be recorded")
    onlooker.process.send_signal(signal.SIGINT)
    assert onlooker.end(30.0) == 0, onlooker.output
    run.process.send_signal(signal.SIGINT)
    assert run.end() == 130, run.output
    seen = [{one.value.lifecycle_state for one in whole(file)["/mission/state"]} for file in (within, beside)]
    assert seen[0] >= {"INSPECTING", "RETURNING", "DONE"}
    assert "RETURNING" not in seen[1]


@pytest.mark.core
def test_all_that_is_wrong_is_told_before_anything_starts(lupin: Start, tmp_path: Path) -> None:
    """A file that is there, a folder that cannot be made, no regular expression; exit code 2."""
    there = tmp_path / "there.mcap"
    there.touch()
    run = lupin("run", "inspection", "--tags", "99x", "--record", str(there))
    record = lupin("record", "--output", "/dev/null/x.mcap", "--without", "[")
    assert (run.end(), record.end()) == (2, 2)
    assert f"{str(there)!r} is there already; name another file" in run.output
    assert record.errors == [
        "lupin: no recording can be written to '/dev/null': File exists",
        "--without: '[' is no regular expression: unterminated character set at position 0",
    ]
    assert there.read_bytes() == b""
