"""`lupin run` with another source of readings: a parameter of a node, given with `--set`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.lupin_ros.launch.processes import Lupin

pytestmark = pytest.mark.timeout(240)

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


@pytest.mark.core
@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (
            ["--set", "greenhouse_bridg.backend=mqtt", "--set", "greenhouse_bridge.bakend=mqtt"],
            [
                "--set: unknown node 'greenhouse_bridg'; did you mean 'greenhouse_bridge'?",
                "--set greenhouse_bridge: unknown parameter 'bakend'; did you mean 'backend'?",
            ],
        ),
        (
            [
                *("--set", "resume_policy=continue", "--set", "backend=mqtt"),
                *("--set", "lupin_arm.dock_pose=[1,2,3]", "--sim", "mqtt_port=1"),
            ],
            [
                "--set: unknown parameter 'resume_policy'; it belongs to mission_orchestrator: "
                "write --set mission_orchestrator.resume_policy=VALUE",
                "--set: unknown parameter 'backend'; it belongs to greenhouse_bridge: "
                "write --set greenhouse_bridge.backend=VALUE",
                "--sim: unknown parameter 'mqtt_port'; it belongs to greenhouse_bridge: "
                "write --set greenhouse_bridge.mqtt_port=VALUE",
                "--set lupin_arm: unknown parameter 'dock_pose'; it belongs to the mission: "
                "write --set dock_pose=VALUE",
            ],
        ),
        (
            ["--set", "greenhouse_bridge.backend", "--set", "mission_orchestrator.nav_timeout_s=5 s"],
            [
                "--set greenhouse_bridge: 'greenhouse_bridge.backend' has no '='; "
                "write --set greenhouse_bridge.NAME=VALUE",
                "--set: parameters of the mission go without a node: write --set 'nav_timeout_s=5 s'",
            ],
        ),
        (
            ["--no-sim", "--set", "lupin_sim.speed=1 m/s", "--set", "greenhouse_bridge.backend=mqt"],
            [
                "--set greenhouse_bridge: parameter 'backend': "
                "expected one of simulator, recorded, mqtt, got 'mqt'; did you mean 'mqtt'?",
                "--set is for lupin_sim, which --no-sim leaves out",
            ],
        ),
        (
            ["--set", "greenhouse_bridge.backend=recorded", "--sim", "pests=1,2,3", "--sim", "fault=explode"],
            [
                "--sim: parameter 'fault': expected one of none, reject, abort, stall, refuse_cancel, "
                "lose_localization, got 'explode'",
                "parameter 'pests': expected x and y of each place, got 3 numbers",
                "backend 'recorded' needs the parameter recording_file, a CSV file",
            ],
        ),
        (
            [
                *("--set", "greenhouse_bridge.backend=mqtt", "--set", "greenhouse_bridge.mqtt_topic=x"),
                *("--set", "greenhouse_bridge.mqtt_host=mqtt://broker", "--set", "scan_timeout_s=0 s"),
                *("--set", "greenhouse_bridge.mqtt_ca_file=ca.pem", "--set", "greenhouse_bridge.tag_file=x"),
            ],
            [
                "--set: parameter 'scan_timeout_s': expected duration of at least 0.1 s, got '0 s'",
                "tag_file 'x' cannot be used: No such file or directory",
                "mqtt_topic 'x': expected {tag} once, and {sensor} at most once, "
                "such as greenhouse/{tag}/{sensor}",
                "mqtt_host 'mqtt://broker': expected a name or an address, such as broker.local; "
                "the port goes into mqtt_port",
                "mqtt_ca_file is given, but mqtt_tls is not set",
            ],
        ),
    ],
    ids=["misspelt", "belongs elsewhere", "not a setting", "not started", "recording", "broker"],
)
def test_what_nodes_cannot_be_started_with_is_told_at_once_and_nothing_starts(
    lupin: Start, arguments: list[str], told: list[str]
) -> None:
    """Of missions and nodes alike, with the words that the node itself would die with."""
    run = lupin("run", "inspection", "--tags", "1", *arguments)
    assert run.end() == 2
    assert run.errors == [f"lupin: {told[0]}", *told[1:]]
    assert run.lines == []
    assert list(run.log_dir.iterdir()) == []


def test_a_setting_of_a_node_that_the_mission_has_no_use_for_is_refused(lupin: Start) -> None:
    """It would have no effect, and whoever gives it means something by it."""
    patrol = Path(__file__).parents[3] / "docs" / "tutorial" / "patrol.yaml"
    run = lupin("run", str(patrol), "--set", "perception_aggregator.box_width=1 m")
    assert run.end() == 2
    told = "--set is for perception_aggregator, which PatrolMission has no use for"
    assert run.errors == [f"lupin: {told}"]


def test_the_orchestrator_gets_parameters_of_its_own(lupin: Start, tmp_path: Path) -> None:
    own = "mission_orchestrator.resume_policy=continue"
    run = lupin("run", "inspection", "--tags", "1", "--speed", "10", "--set", own, "--log-dir", str(tmp_path))
    assert run.end() == 0
    (given,) = tmp_path.rglob("mission_orchestrator.yaml")
    assert 'resume_policy: "continue"' in given.read_text(encoding="utf-8")
