"""Plans of runs with faults, and what is said of a run: without ROS."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from tests.faults.campaign import seeds_of, table
from tests.faults.plan import KINDS, NEED_ROOT, NODES, OF_STOPS, OF_THE_LINK, Fault, Plan, plan
from tests.faults.verdict import STOP_S, Lost, Outcome, Seen, driven, name_of, problems

PLAN = Plan(0, ("1", "5"), 2.0, (Fault("kill", 1.0, "mission_orchestrator"),), 0.5)
PLACES = {"1": (1.0, 0.0), "5": (5.0, 0.0), "7": (7.0, 0.0)}


def test_a_seed_is_one_plan() -> None:
    assert [str(plan(seed)) for seed in range(200)] == [str(plan(seed)) for seed in range(200)]
    assert len({str(plan(seed)) for seed in range(200)}) == 200


def test_a_plan_says_all_of_it() -> None:
    told = Plan(7, ("1", "5"), 2.0, (Fault("lossy", 1.5, lasts=3.0, amount=0.2),), 0.5)
    assert str(told) == "seed 7: tags 1,5 at 2 m/s, resume after 0.5 s\n  1.50 s: lossy by 0.2 for 3.0 s"


def test_every_kind_comes_and_every_node_is_hit() -> None:
    faults = [fault for seed in range(len(KINDS) * 60) for fault in plan(seed).faults]
    assert {fault.kind for fault in faults} == set(KINDS)
    for kind in ("kill", "stop", "terminate"):
        assert {fault.node for fault in faults if fault.kind == kind} == set(NODES)
    cuts = [fault.lasts for fault in faults if fault.kind == "cut"]
    assert min(cuts) >= 2.0
    assert max(cuts) <= 30.0


def test_no_two_faults_are_mended_by_the_same_means() -> None:
    for seed in range(500):
        kinds = [fault.kind for fault in plan(seed).faults]
        assert len(set(kinds)) == len(kinds), seed
        assert sum(kind in OF_THE_LINK for kind in kinds) <= 1, seed
        assert sum(kind in OF_STOPS for kind in kinds) <= 1, seed


def test_without_root_there_are_others() -> None:
    kinds = {fault.kind for seed in range(200) for fault in plan(seed, root=False).faults}
    assert kinds == set(KINDS) - set(NEED_ROOT)


def test_numbers_of_seeds() -> None:
    assert seeds_of("1-3,9,12-13") == [1, 2, 3, 9, 12, 13]


# --- what is said of a run --------------------------------------------------------------------------------


def sound() -> Seen:
    """A run in which the robot drove to both tags, and stood while nobody watched."""
    track = [(0.1 * step, min(5.0, 0.1 * step), 0.0) for step in range(100)]
    outcomes = {Outcome("1", 0, (1, 0)), Outcome("5", 0, (5, 0))}
    pulses = [0.1 * step for step in range(100)]
    return Seen("DONE", outcomes, ["1", "5"], [Lost("kill", 4.0, 9.0)], track, pulses)


def test_a_sound_run_has_no_problems() -> None:
    assert problems(PLAN, sound(), PLACES) == []


@pytest.mark.parametrize("end", ["held: restarted: nobody watched", "FAULT: dependencies not ready"])
def test_a_mission_may_be_held_or_in_fault_with_a_reason(end: str) -> None:
    seen = sound()
    seen.end = end
    assert problems(PLAN, seen, PLACES) == []


@pytest.mark.parametrize("end", ["held: ", "FAULT: ", "INSPECTING/NAVIGATING", "silence"])
def test_no_other_end_is_right(end: str) -> None:
    seen = sound()
    seen.end = end
    assert problems(PLAN, seen, PLACES) == [f"the mission ended as {end!r}"]


def test_what_is_wrong_with_outcomes_is_told() -> None:
    seen = sound()
    seen.outcomes = {Outcome("1", 0, (1, 0)), Outcome("1", 0, (2, 0)), Outcome("7", 1, (3, 0))}
    seen.rows = ["1", "1", "5"]
    assert problems(PLAN, seen, PLACES) == [
        "target 5 has no outcome",
        "target 1 has 2 outcomes",
        "an outcome of 7, which is no target",
        "the twin has 5, which was not read",
        "the twin has 1 2 times",
    ]
    seen = sound()
    seen.rows = ["1"]
    assert problems(PLAN, seen, PLACES) == ["the twin has nothing of 5, which was read"]


def test_a_search_says_of_each_tag_that_it_saw_what_became_of_it() -> None:
    """It is read twice: when it is seen, and when it is visited; who saw it may have been far away."""
    search = replace(PLAN, tags=(), search=2)
    seen = sound()
    seen.total = 2
    for tag in ("1", "5"):
        seen.outcomes.add(Outcome(name_of(tag, "ExplorationMission"), 0, (0, 0)))
        seen.rows.append(name_of(tag, "ExplorationMission"))
    assert problems(search, seen, PLACES) == []
    seen.outcomes -= {Outcome("5", 0, (5, 0))}
    assert problems(search, seen, PLACES) == [
        "target 5 has no outcome",
        "1 targets have outcomes, and the mission had 2",
        "the twin has 5, which was not read",
    ]
    damaged = replace(search, faults=(Fault("bit flip", 1.0, "mission_orchestrator", 0.3),))
    assert "target 5 has no outcome" in problems(damaged, seen, PLACES)
    seen.outcomes -= {Outcome("1", 0, (1, 0))}
    assert not [text for text in problems(damaged, seen, PLACES) if "no outcome" in text]
    assert str(search).startswith("seed 0: search for 2 at 2 m/s")


def test_who_read_a_tag_was_there() -> None:
    assert problems(PLAN, sound(), {**PLACES, "5": (9.0, 0.0)}) == [
        "5 was read, and the robot was 4.0 m away at the nearest"
    ]


def test_a_robot_that_drives_on_is_told() -> None:
    seen = sound()
    seen.track = [(0.1 * step, 0.1 * step, 0.0) for step in range(100)]
    seen.lost = [Lost("kill", 2.0, 9.0)]
    assert problems(PLAN, seen, PLACES) == [
        "7.00 m in 7.0 s after kill; allowed are 3.4 s at 2 m/s",
    ]


def test_what_the_computer_kept_waiting_is_allowed_on_top() -> None:
    seen = sound()
    seen.track = [(0.1 * step, 0.1 * step, 0.0) for step in range(60)]
    seen.lost = [Lost("kill", 2.0, 9.0)]
    assert problems(PLAN, seen, PLACES) != []
    seen.pulses = [1.5, 2.0, 3.5, 4.0, 9.0]
    assert problems(PLAN, seen, PLACES) == []


def test_under_a_stop_it_stands_sooner_and_what_a_stranger_sends_waits_for_nobody() -> None:
    """Without a stop a goal of somebody else is carried out, also while no orchestrator is heard."""
    seen = sound()
    seen.track = [(0.1 * step, 0.1 * step, 0.0) for step in range(40)]
    seen.lost = [Lost("kill", 2.0, 9.0)]
    assert problems(PLAN, seen, {}) == []
    seen.lost = [Lost("foreign stop", 2.0, 9.0, STOP_S, by_stop=True)]
    assert problems(PLAN, seen, {}) == [
        "1.90 m in 1.9 s after foreign stop; allowed are 1.2 s at 2 m/s",
    ]
    seen.track = [(0.1 * step, 0.1 * step, 0.0) for step in range(100)]
    seen.strange = [3.0]
    assert len(problems(PLAN, seen, {})) == 1
    seen.lost = [Lost("kill", 2.0, 9.0)]
    assert problems(PLAN, seen, {}) == []


def test_a_process_that_ended_by_itself_is_told() -> None:
    seen = sound()
    seen.ended = ["lupin_twin ended with 1"]
    assert problems(PLAN, seen, PLACES) == ["lupin_twin ended with 1: nobody had ended it"]


def test_a_robot_that_begins_elsewhere_has_not_driven_there() -> None:
    track = [(0.0, 0.0, 0.0), (0.1, 0.1, 0.0), (2.0, 0.5, 0.5), (2.1, 0.5, 0.5)]
    assert driven(track, 0.0, math.inf) == (pytest.approx(0.1), pytest.approx(0.1))


def test_the_table_counts_by_kind() -> None:
    runs = [
        {"plan": str(PLAN), "verdict": "ok", "end": "DONE", "resumes": "1", "driven": "1.5"},
        {"plan": str(PLAN), "verdict": "violation", "end": "silence", "resumes": "0", "driven": "3.0"},
        {"plan": str(PLAN), "verdict": "not begun", "end": "", "resumes": "", "driven": ""},
    ]
    assert table(runs).splitlines()[2:] == [
        "| kill | 3 | 1 | 0 | 0 | 1 | 1 | 3.0 | 1 |",
        "| all | 3 | 1 | 0 | 0 | 1 | 1 | 3.0 | 1 |",
    ]
