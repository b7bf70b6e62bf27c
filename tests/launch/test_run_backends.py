"""`lupin run` with another source of readings: a parameter of a node, given with `--set`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")

from tests.launch.processes import Lupin

pytestmark = [pytest.mark.ros, pytest.mark.timeout(240)]

Start = Callable[..., Lupin]


def test_a_mission_reads_a_recording(lupin: Start, tmp_path: Path) -> None:
    """One tag has a value at that time, the other one none: its scan fails with the reason."""
    file = tmp_path / "day.csv"
    file.write_text(
        "tag_id,sensor,value,stamp\n1,co2,431,2026-05-01T12:00:00\n5,co2,500,2026-05-01T09:00:00\n"
    )
    given = {"backend": "recorded", "recording_file": file, "debug_time_of_day": 12.1}
    settings = [
        part for name, value in given.items() for part in ("--set", f"greenhouse_bridge.{name}={value}")
    ]
    run = lupin("run", "inspection", "--tags", "1,5", "--speed", "20", "--json", *settings)
    assert run.end() == 1, run.output
    (result,) = run.records("result")
    assert [(r["tag"], r["status"], r["values"]) for r in result["readings"]] == [
        ("1", "OK", {"co2": 431.0}),
        ("5", "SCAN_FAILED", {}),
    ]
    reason = result["readings"][1]["reason"]
    assert reason.startswith("tag '5': nothing measured in the last 900 s (co2 is 11160 s old)")


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("greenhouse_bridg.backend=mqtt", "--set: unknown node 'greenhouse_bridg'; did you mean"),
        (
            "greenhouse_bridge.bakend=mqtt",
            "--set greenhouse_bridge: unknown parameter 'bakend'; did you mean",
        ),
        (
            "greenhouse_bridge.backend",
            "--set greenhouse_bridge: 'greenhouse_bridge.backend' has no '='; write",
        ),
        (
            "mission_orchestrator.nav_timeout_s=5 s",
            "--set: parameters of the mission go without a node: write",
        ),
        ("lupin_sim.speed=1", "--set is for lupin_sim, which these missions do not start"),
    ],
)
def test_a_setting_of_a_node_that_cannot_be_is_refused(lupin: Start, setting: str, told: str) -> None:
    run = lupin("run", "inspection", "--tags", "1", "--no-sim", "--set", setting)
    assert run.end() == 2
    assert any(line.startswith(f"lupin: {told}") for line in run.errors), run.errors
