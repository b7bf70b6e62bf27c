"""Missions with all that Lupin ships, each a process of its own: the map, the twin, the deaths."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")

from rcl_interfaces.srv import GetParameters

from lupin_ros.adapter.node import CallFailure
from tests.lupin_ros.launch.processes import PATIENCE, Lupin
from tests.lupin_ros.plugins.gateway.conftest import free_port
from tests.lupin_ros.world import Operator

pytestmark = [
    pytest.mark.timeout(240),
    pytest.mark.filterwarnings("ignore:module 'sre_.*' is deprecated:DeprecationWarning"),
]

Start = Callable[..., Lupin]
Ends = tuple[set[str], set[str]]

PAGE = Path(__file__).parents[3] / "docs" / "interfaces.md"
KINDS = {"topic": "msg", "service": "srv", "action": "action"}
#: Interfaces that stand on the page themselves, and are called there by their last name.
SHOWN = ("lupin_msgs/", "lupin_engine_msgs/")
ORCHESTRATOR, BRIDGE, AGGREGATOR = "/mission_orchestrator", "/greenhouse_bridge", "/perception_aggregator"
TWIN, ARM, ROBOT, HMI = "/lupin_twin", "/lupin_arm", "/lupin_sim", "HMI"
WATCHDOG = "/nav_watchdog"
#: It hears what pages want, and keeps the past of some topics: that is no part of the interface.
GATEWAY = "/lupin_gateway"

#: What the interface document says: who fills each interface of lupin_msgs, and who reads or calls it. The
#: HMI is not among the processes; whoever runs `lupin run` watches and asks in its place.
SEED: dict[str, Ends] = {
    "/mission/state": ({ORCHESTRATOR}, {HMI, AGGREGATOR}),
    "/floranova/observations": ({ORCHESTRATOR, AGGREGATOR}, {TWIN, HMI}),
    "/perception/discovered_tags": ({AGGREGATOR}, {ORCHESTRATOR, TWIN}),
    "/twin/state": ({TWIN}, set()),
    "/mission/start": ({ORCHESTRATOR}, {HMI}),
    "/greenhouse_bridge/get_tag_reading": ({BRIDGE}, {ORCHESTRATOR}),
    "/perception/confirm_tag": ({AGGREGATOR}, {ORCHESTRATOR}),
    "/twin/get_field": ({TWIN}, set()),
    "/lupin/arm/preset": ({ARM}, {ORCHESTRATOR}),
    "/lupin/arm/calibrate": ({ARM}, set()),
    "/lupin/arm/library/list": ({ARM}, set()),
    "/lupin/arm/library/save_pose": ({ARM}, set()),
    "/lupin/arm/library/goto_pose": ({ARM}, set()),
    "/lupin/arm/library/record": ({ARM}, set()),
    "/lupin/arm/library/play": ({ARM}, set()),
    "/lupin/arm/library/delete": ({ARM}, set()),
}
#: Who reads or calls more than the document says: the simulated robot ends its faults with the mission, the
#: arm is left to a mission that begins, the watchdog listens whether an orchestrator is heard, and an idle
#: aggregator reads the climate of the tags in sight.
BEYOND: dict[str, set[str]] = {
    "/mission/state": {ROBOT, ARM, WATCHDOG},
    "/greenhouse_bridge/get_tag_reading": {AGGREGATOR},
}


def lupin_json(run: Lupin, *arguments: str) -> Any:
    """Run a `lupin` command beside another, to its end, and read what it prints."""
    done = subprocess.run(
        [sys.executable, "-m", "lupin_cli.main", *arguments, "--json"],
        env={
            **os.environ,
            "ROS_DOMAIN_ID": str(run.domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "XDG_STATE_HOME": str(run.state),
        },
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout)


def told_on_the_page() -> dict[str, tuple[str, Ends]]:
    """Return the rows of docs/interfaces.md: type, producers and consumers by name."""
    rows = {}
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| `/"):
            ends = [{f"/{node}" for node in cell.split(", ") if node != "outside"} for cell in cells[-2:]]
            rows[cells[0].strip("`")] = cells[1].partition("]")[0].lstrip("["), (ends[0], ends[1])
    return rows


def named(nodes: list[str]) -> set[str]:
    """Return node names, whoever runs a mission from a terminal under the operator's."""
    return {HMI if node.startswith("/lupin_operator_") else node for node in nodes}


def test_the_live_map_is_the_documents_and_the_twin_ends_with_all_that_was_seen(lupin: Start) -> None:
    """Eight processes; nothing that is sent fails to arrive; every tag with its readings, species, blooms."""
    pages = ("--hmi", "--set", f"lupin_gateway.port={free_port()}")
    goal = ("--goal", "5", "--set", "monitoring_sweeps=1", "--speed", "4", "--json")
    run = lupin("run", "exploration", *goal, *pages)
    run.until_line("pages at http://127.0.0.1:")
    run.until_line('"lifecycle_state": "EXPLORING"')
    seen = {i["name"]: i for i in lupin_json(run, "graph")}
    assert run.end() == 0, run.output

    ours = {name: i for name, i in seen.items() if i["type"].startswith("lupin_msgs/")}
    found = {name: (named(i["producers"]), named(i["consumers"]) - {GATEWAY}) for name, i in ours.items()}
    expected = {name: (fill, read | BEYOND.get(name, set())) for name, (fill, read) in SEED.items()}
    assert found == expected
    assert named(seen["/navigate_to_pose"]["producers"]) == {ROBOT}
    # The simulated robot sends itself the goals that somebody clicks on a map.
    assert named(seen["/navigate_to_pose"]["consumers"]) == {ORCHESTRATOR, ROBOT}
    assert named(seen["/mirte_master_arm_controller/joint_trajectory"]["producers"]) == {ARM}
    assert {name: i["problems"] for name, i in seen.items() if i["problems"]} == {}
    running = {ORCHESTRATOR, BRIDGE, AGGREGATOR, TWIN, ARM, ROBOT, "/lupin_arm_sim", GATEWAY}
    page = {
        name: (kind, (fill & running, read & running))
        for name, (kind, (fill, read)) in told_on_the_page().items()
    }
    found_now = {
        name: (
            i["type"].rpartition("/")[2]
            if i["type"].startswith(SHOWN)
            else i["type"].replace(f"/{KINDS[i['kind']]}/", "/"),
            # The gateway reads what a page asks for: only what it always reads is on the page.
            (set(i["producers"]) & running, set(i["consumers"]) & running - ({GATEWAY} - page[name][1][1])),
        )
        for name, i in seen.items()
    }
    assert found_now == {name: row for name, row in page.items() if name in found_now}
    assert {name for name, (_, ends) in page.items() if ends != (set(), set())} == set(found_now)

    (result,) = run.records("result")
    visited = {observation["tag"] for observation in run.records("observation")}
    assert len(visited) >= result["total"] >= 5
    kept = {tag["tag_id"]: tag for tag in lupin_json(run, "twin", "show")["tags"]}
    assert set(kept) >= visited
    assert all(kept[tag]["readings"] and kept[tag]["place"] for tag in visited)
    # Who was visited was looked at; the layout plants flowers in every box.
    swept = [o["tag"] for o in run.records("observation") if o["status"] == "OK"][-result["total"] :]
    assert all(kept[tag]["species"] and kept[tag]["blooms"] for tag in swept)
    assert run.processes() == {}


@pytest.fixture
def operator(lupin: Start, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[Lupin], Operator]]:
    """Make an operator in the domain of a run."""
    made: list[Operator] = []

    def make(run: Lupin) -> Operator:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(run.domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        made.append(Operator("tinkerer"))
        return made[-1]

    yield make
    for one in made:
        one.ros.close()


def until_answers(operator: Operator, node: str) -> None:
    """Wait until a node that was killed is back and does its work."""
    service = operator.ros.service(GetParameters, f"/{node}/get_parameters")
    answers: list[Any] = []

    def ask() -> None:
        service.call(GetParameters.Request(names=["use_sim_time"]), 2.0, hear)

    def hear(answer: Any) -> None:
        # The dead one is still seen for a while, and never answers; then nobody is there.
        if isinstance(answer, CallFailure):
            operator.ros.call_later(0.2, ask)
        else:
            answers.append(answer)

    ask()
    operator.until(lambda: answers, f"an answer of {node}", PATIENCE)


def test_who_is_killed_comes_back_and_the_mission_loses_nothing(
    lupin: Start, operator: Callable[[Lupin], Operator]
) -> None:
    """All four on the way to the second target: started again, and in the end everybody knows everything.

    Until they are back the robot does not move: without the bridge the next scan would fail, as it should.
    """
    nodes = ("lupin_twin", "perception_aggregator", "lupin_arm", "greenhouse_bridge")
    run = lupin("run", "inspection", "--tags", "1,21,12", "--speed", "2", "--json", "--separate")
    run.until_line('"current_target": "21"')
    tinkerer = operator(run)
    tinkerer.set_parameter("lupin_sim", "fault", "stall")
    for node in nodes:
        os.kill(run.pid_of(node), signal.SIGKILL)
    for node in nodes:
        until_answers(tinkerer, node)
    tinkerer.set_parameter("lupin_sim", "speed", 5.0)
    tinkerer.set_parameter("lupin_sim", "fault", "none")
    assert run.end() == 0, [*run.errors, *run.lines[-3:]]
    (result,) = run.records("result")
    assert result["counts"]["OK"] == 3
    told = "\n".join([*run.errors, *run.lines])
    assert [node for node in nodes if f"{node} is started again in 1 s (1 of 3)" not in told] == []
    kept = {tag["tag_id"]: tag for tag in lupin_json(run, "twin", "show")["tags"]}
    assert all(kept[tag]["readings"] for tag in ("1", "21", "12"))
    assert run.processes() == {}
