"""The missions of the examples, whose orchestrator dies between every two of their steps: nothing is lost.

A person resumes each time. Every target has its one outcome, the same as if nobody had died; but water that
was cut off is not given again, as the mission says (`on_hold: fail`).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.machine.step import Step
from lupin_engine.plugin.contract import RESTARTED
from lupin_engine.runtime.history import History
from lupin_engine.sim.scenario import Missions, Scenario, load_scenario
from lupin_engine.sim.simulation import Ask, Restart, SetValue, Simulation
from tests import shipped

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).parents[3] / "examples"
MISSIONS = Missions(shipped.catalog())
#: Seconds until the next orchestrator is there.
AWAY_S = 3.0

Outcome = tuple[str, str, str]


class Killed(Exception):
    """The orchestrator is gone in the midst of its work: what it had queued is lost."""


def outcomes(history: History) -> list[Outcome]:
    """Return what was published of targets: target, status and code."""
    return [(publish.target, publish.status, publish.code) for _, publish in history.published]


class Trial:
    """A run whose orchestrator dies after so many steps; `speaks` are values that are told steadily."""

    def __init__(self, scenario: Scenario, after: int, speaks: Mapping[str, Any]) -> None:
        world = MISSIONS.world(scenario.chart, scenario.parameters)
        self._run = Simulation(scenario.chart, scenario.script, scenario.parameters, world, crashes=True)
        self._run.listener = self._listen
        self._after, self._speaks = after, speaks
        #: Where it stood when it died: the mission, the target that was under way, and its states.
        self.mission = self.target = ""
        self.states: list[str] = []

    def _listen(self, _: Step) -> None:
        if len(self._run.steps) == self._after:
            raise Killed

    def carry_out(self) -> list[Outcome]:
        """Run to the end; return what was published."""
        run, begun = self._run, False
        while not run.is_over:
            try:
                if not begun:
                    begun = True
                    run.begin()
                elif not run.advance():
                    break
            except Killed:
                self._die()
            if self.states and run.machine.view.mission:
                for value, is_now in self._speaks.items():
                    run.do(SetValue(value, is_now))
            if RESTARTED in run.machine.memory.held:
                run.do(Ask("operator.resume"))
        return outcomes(run.history)

    def _die(self) -> None:
        run = self._run
        view = run.machine.view
        self.mission, self.target = view.mission, view.target
        self.states = [name.rpartition(".")[2] for name in run.machine.memory.configuration]
        run.listener = lambda step: None
        run.do(Restart(AWAY_S))


@pytest.mark.parametrize(
    ("name", "speaks"),
    [
        ("night_watch/scenarios/rounds", {}),
        ("photo_round/scenarios/light", {"camera.light": 200.0}),
        ("watering/scenarios/all", {}),
    ],
)
def test_a_kill_between_any_two_steps_changes_no_outcome(name: str, speaks: Mapping[str, Any]) -> None:
    """Also where several steps are made at one moment: the rest of them is lost with the process."""
    scenario = load_scenario(EXAMPLES / f"{name}.scenario.yaml", shipped.catalog(), MISSIONS)
    whole = scenario.run()
    wanted = outcomes(whole.history)
    assert wanted
    killed = 0
    for after in range(1, len(whole.steps) + 1):
        trial = Trial(scenario, after, speaks)
        found = trial.carry_out()
        assert trial.states, after
        if not trial.mission and "READY" in trial.states:
            continue  # the request for the mission was lost as well, and its sender told so
        killed += 1
        cut_off = trial.target if "GIVING" in trial.states else ""
        assert found == [_cut_off(each) if each[0] == cut_off else each for each in wanted], trial.states
    assert killed >= len(whole.steps) - 2


def _cut_off(outcome: Outcome) -> Outcome:
    return outcome[0], "SCAN_FAILED", "operation_cancelled"
