"""Scenarios with chance: the same seed gives the same run, another one another."""

from __future__ import annotations

import json
import random
from collections import Counter
from pathlib import Path

import pytest

from lupin_engine.runtime.record import step_record
from lupin_engine.sim.scenario import Missions, Scenario, load_scenario
from lupin_engine.sim.scripted import AnyOf, Between, MockOutcome, Rule, drawn
from lupin_engine.sim.simulation import Run, Script, simulate
from tests import shipped

MISSIONS = Missions(shipped.catalog())

TEXT = """\
scenario: chance
mission: inspection
request: {tag_sequence: ["1", "2", "3"]}
seed: 5
mocks:
  - do: nav.go_to
    then:
      any_of:
        - {weight: 3, after: {between: [1 s, 9 s]}}
        - {weight: 25 %, fail: nav_status_6, after: {between: [0 s, 1 s]}}
expect: {final: DONE}
"""


def scenario(folder: Path, text: str = TEXT) -> Scenario:
    """Return the scenario of a text."""
    file = folder / "x.scenario.yaml"
    file.write_text(text, encoding="utf-8")
    return load_scenario(file, shipped.catalog(), MISSIONS)


def records(run: Run) -> list[str]:
    """Return the steps of a run as lines of a journal."""
    return [json.dumps(step_record(step), sort_keys=True) for step in run.steps]


def test_a_seed_is_a_run(tmp_path: Path) -> None:
    """What is drawn hangs on the seed and on nothing else."""
    found = scenario(tmp_path)
    assert found.is_random
    assert records(found.run()) == records(found.run())
    assert records(found.run(1)) != records(found.run())


def test_the_seed_of_the_run_is_added(tmp_path: Path) -> None:
    """Seed 5 shifted by 2 is seed 7."""
    one, other = scenario(tmp_path), scenario(tmp_path, TEXT.replace("seed: 5", "seed: 7"))
    assert records(one.run(2)) == records(other.run())


def test_what_one_mock_draws_does_not_hang_on_another(tmp_path: Path) -> None:
    """A second mock, and how often it is asked, leaves the first one's draws alone."""
    more = "  - {do: bridge.read_tag, then: {after: {between: [0 s, 1 s]}}}\nexpect:"
    one, other = scenario(tmp_path), scenario(tmp_path, TEXT.replace("expect:", more))

    def drives(run: Run) -> list[float]:
        states = [(step.time, name) for step in run.steps for name in (*step.exited, *step.entered)]
        times = [time for time, name in states if name.endswith(".NAVIGATING")]
        return [round(left - entered, 9) for entered, left in zip(times[::2], times[1::2], strict=True)]

    assert drives(one.run()) == drives(other.run())


def test_nothing_is_random_that_does_not_say_so(tmp_path: Path) -> None:
    """A plain mock is the same under every seed."""
    found = scenario(tmp_path, TEXT[: TEXT.index("mocks")] + "expect: {final: DONE}\n")
    assert not found.is_random
    assert records(found.run()) == records(found.run(17))


def test_weights_are_shares() -> None:
    """Three to one is three quarters; a duration lies between its bounds, anywhere."""
    choice = AnyOf(
        (MockOutcome(after=Between(2.0, 4.0)), AnyOf((MockOutcome(code="a"),), (1.0,))), (3.0, 1.0)
    )
    dice = random.Random(0)
    found = [drawn(choice, dice) for _ in range(4000)]
    share = Counter(outcome.code for outcome in found)
    assert share["a"] / 4000 == pytest.approx(0.25, abs=0.03)
    times = [outcome.after for outcome in found if not outcome.code]
    assert all(isinstance(time, float) and 2.0 <= time <= 4.0 for time in times)
    assert len(set(times)) > 2000


def test_the_servers_draw_acceptance_and_cancel_as_well() -> None:
    """Every duration of an outcome may lie between two."""
    outcome = MockOutcome(never=True, accepted_after=Between(1.0, 2.0), cancel_after=Between(0.5, 1.0))
    rules = (Rule("nav.go_to", (outcome,)),)
    assert rules[0].is_random
    script = Script("InspectionMission", {"tag_sequence": ["1"]}, rules)
    run = simulate(
        shipped.mission("inspection"),
        script,
        {"nav_timeout_s": 10.0, "nav_max_attempts": 1},
    )
    waits = [step.time for step in run.steps if step.event.name in ("attempt.accepted", "attempt.cancelled")]
    assert 1.5 <= waits[2] <= 2.5
    assert 11.0 <= waits[3] <= 11.5
