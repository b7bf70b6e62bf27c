"""`lupin run exploration` over real ROS 2: the robot finds tags by itself, watches them and comes home."""

from __future__ import annotations

import re
import signal
from collections.abc import Callable, Sequence
from typing import Any

import pytest

pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")

from tests.lupin_ros.launch.processes import Lupin

pytestmark = pytest.mark.timeout(240)

Start = Callable[..., Lupin]
State = dict[str, Any]

ONE_SWEEP = ("--set", "monitoring_sweeps=1", "--speed", "10")


def lifecycles(states: Sequence[State]) -> list[str]:
    """The lifecycle states, each change once."""
    names = [state["lifecycle_state"] for state in states]
    return [name for i, name in enumerate(names) if i == 0 or names[i - 1] != name]


def counters(state: State) -> tuple[int, ...]:
    return tuple(
        state[f"targets_{name}"] for name in ("total", "completed", "failed", "unreachable", "skipped")
    )


@pytest.mark.core
def test_tags_are_discovered_watched_for_a_sweep_and_the_robot_comes_home(lupin: Start) -> None:
    """Found by frontier search, read when seen and when visited; the counters tell of the search first."""
    run = lupin(
        "run", "exploration", "--goal", "5", "--set", "monitoring_sweeps=1", "--speed", "10", "--json"
    )
    assert run.end() == 0, run.output

    states = run.records("state")
    assert lifecycles(states) == ["PREPARE", "EXPLORING", "MONITORING", "RETURNING", "DONE"]
    assert {state["mission_type"] for state in states} == {"ExplorationMission"}
    assert {state["discovery_goal"] for state in states} == {5}

    search = [state for state in states if state["lifecycle_state"] == "EXPLORING"]
    assert [counters(state) for state in search] == [
        (5, state["tags_discovered"], 0, 0, 0) for state in search
    ]
    found = [state["tags_discovered"] for state in search]
    assert found == sorted(found)

    (result,) = run.records("result")
    total = result["total"]
    assert total >= 5
    assert result["counts"] == {"OK": total, "UNREACHABLE": 0, "SCAN_FAILED": 0, "SKIPPED": 0}
    seen = [observation["tag"] for observation in run.records("observation")]
    visited = seen[-total:]
    assert len(set(visited)) == total, "each once in a sweep"
    assert set(seen[:-total]) <= set(visited), "what was read on discovery is visited as well"
    assert run.processes() == {}


def test_the_story_tells_of_frontiers_and_of_tags_found(lupin: Start) -> None:
    """Where it drives to see more, how many of the goal it has, and what became of them."""
    run = lupin("run", "exploration", "--goal", "2", *ONE_SWEEP)
    assert run.end() == 0, run.output
    assert any("EXPLORING  0/2 tags found" in line for line in run.lines), run.output
    assert any("nav.choose_frontier: x " in line for line in run.lines), run.output
    assert any(line.endswith(" tags found") for line in run.lines if "EXPLORING" not in line), run.output
    *_, last = [line for line in run.lines if line]
    # A fast robot may see more than it was asked for.
    assert re.match(r"DONE: (2/2|\d) tags found, (\d) visited of \2 targets in ", last)
    assert run.errors == []


def test_without_a_number_of_sweeps_it_watches_until_it_is_interrupted_and_then_comes_home(
    lupin: Start,
) -> None:
    """Ctrl-C aborts; the robot drives home before everything ends."""
    run = lupin("run", "exploration", "--goal", "1", "--speed", "10", "--json")
    run.until_line('"targets_completed": 3')
    run.process.send_signal(signal.SIGINT)
    assert run.end() == 130, run.output
    states = run.records("state")
    assert lifecycles(states) == ["PREPARE", "EXPLORING", "MONITORING", "RETURNING", "DONE"]
    assert states[-1]["targets_completed"] >= 3, "more visits than targets"
    ends = [r["step"] for r in run.records("step") if r["step"]["event"] == "attempt.done"]
    assert ends[-1]["entered"][-1] == "DONE", "the drive home was awaited"
    assert run.processes() == {}


def test_a_search_that_finds_too_little_in_its_time_says_so(lupin: Start) -> None:
    """The budget of the search ends it; what was found is watched, and the exit code tells the rest."""
    run = lupin("run", "exploration", "--goal", "29", *ONE_SWEEP, "--set", "exploration_timeout_s=3 s")
    assert run.end() == 1, run.output
    assert any("exploration timed out (exploration_timeout)" in line for line in run.lines), run.output
    assert "/29 tags found, " in run.lines[-1]
