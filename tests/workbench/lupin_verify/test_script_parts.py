"""What a script says is written as scenarios say it."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.replay.yaml_text import yaml_text
from lupin_engine.sim.scenario import Missions, load_scenario_text
from lupin_verify.script_parts import parts_of
from tests import shipped

FILE = Path(__file__).with_name("written.scenario.yaml")
HEAD = "scenario: All is said.\nmission: inspection\nexpect: {}\n"


@pytest.mark.parametrize(
    "said",
    [
        "request: {tag_sequence: ['27', '4']}\nseed: 7\nclock: 2026-03-01 06:30\n",
        "parameters: {nav_max_attempts: 3}\n",
        "mocks: [{do: nav.go_to, then: [done, {accepted: 0.125 s}, {accepted: never}]}]\n",
        "mocks: [{do: nav.go_to, then: [{fail: nav_status_6, detail: no way, after: 0 s}]}]\n",
        "mocks: [{do: nav.go_to, then: [{never: true, cancel: ignored}, {cancel: 2 s, progress: half}]}]\n",
        "mocks: [{do: nav.go_to, then: {after: 12.000001 s, cancel: unconfirmed}}]\n",
        "when: [{at: 1.5 s, request: operator.pause}]\n",
        "when: [{on: DONE, nth: 2, after: 3 s, clock: 2026-03-01 12:00}]\n",
        "limit: 90 s\nwhen: [{start_of: nav.go_to, nth: every, value: {estop: true}}]\n",
        "when: [{at: 2 s, fail: {do: nav.go_to, code: nav_status_6}}, {at: 3 s, finish: {do: nav.go_to}}]\n",
        "when: [{at: 1 s, server_gone: nav.go_to}, {at: 2 s, server_back: nav.go_to}]\n",
        "when: [{at: 1 s, clock: 2026-03-01 12:00}, {at: 4 s, restart: 2 s}]\n",
    ],
)
def test_what_is_read_is_written_again(said: str) -> None:
    """To the last digit."""
    missions = Missions(shipped.catalog())
    scenario = load_scenario_text(HEAD + said, FILE, missions)
    again = load_scenario_text(yaml_text({**parts_of(scenario), "expect": {}}), FILE, missions)
    assert (again.script, again.parameters) == (scenario.script, scenario.parameters)
