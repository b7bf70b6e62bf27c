"""A mission that breaks a property on the robot: reported in the next step, and once over a restart."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import String

from lupin_engine.machine.event import PROPERTY_BROKEN
from lupin_engine.runtime.journal.journal import journal_files
from lupin_engine.runtime.journal.records import read_journal
from lupin_ros.adapter.node import Qos
from lupin_ros.service.names import DIAGNOSTICS_TOPIC, STEPS_TOPIC
from tests.lupin_ros.orchestrator.test_answers import LIFECYCLE
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

NODE = "mission_orchestrator"
PLANTED = """\
mission: Planted
codes: {too_long: {label: it stood for too long, severity: error, advice: Look why.}}
properties:
  skipped_soon:
    {after: in_state('STANDING'), eventually: in_state('GONE'), within: 1 s, code: too_long, breach: hold}
  never_gone: {never: in_state('GONE')}
states:
  STANDING: {on: {operator.skip_current: GONE}}
  GONE: {on: {operator.skip_current: done}}
  done: {type: final}
initial: STANDING
"""
LATE = "property skipped_soon (line 4): in_state('GONE') did not become true within 1 s"
GONE = "property never_gone (line 6): in_state('GONE') became true; it must never be"


def missions(folder: Path) -> str:
    """Write the mission, and return its folder."""
    (found := folder / "missions").mkdir()
    (found / "lifecycle.yaml").write_text(LIFECYCLE, encoding="utf-8")
    (found / "planted.yaml").write_text(PLANTED, encoding="utf-8")
    return str(found)


def reports(folder: Path) -> list[tuple[str, str]]:
    """Return the breaches in the journal."""
    records = [record for file in journal_files(folder) for record in read_journal(file).records]
    events = [record.event for record in records if record.kind == "event"]
    return [(e.data["property"], e.data["detail"]) for e in events if e.name == PROPERTY_BROKEN]


def lupin(*words: str) -> dict[str, Any]:
    """Return the JSON that the command prints."""
    command = [str(Path(sys.executable).with_name("lupin")), *words, "--json"]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def test_a_breach_is_published_in_the_next_step(
    world: World, operator: Operator, own_state: Path, tmp_path: Path
) -> None:
    """As its code in the state, the steps, `why`, the journal and the diagnostics; a resume ends its hold."""
    steps, troubles = list[dict[str, Any]](), list[str]()

    def take(message: DiagnosticArray) -> None:
        troubles.extend(one.message for one in message.status if one.name == f"/{NODE}")

    operator.ros.subscribe(String, STEPS_TOPIC, Qos.BACKLOG, lambda one: steps.append(json.loads(one.data)))
    operator.ros.subscribe(DiagnosticArray, DIAGNOSTICS_TOPIC, Qos.EVENT, take)
    world.start(NODE, missions_path=missions(tmp_path))
    operator.in_state("READY")
    assert operator.start(mission="Planted").accepted
    operator.held()
    assert operator.state.last_error == f"too_long: {LATE}"
    operator.resume()
    assert operator.ask("skip_current").success
    operator.until(lambda: GONE in "".join(troubles), "the diagnostics")
    assert any(LATE in text and GONE in text for text in troubles)
    events = [(one["step"]["event"], one["step"]["sequence"]) for one in steps]
    skip = next(number for name, number in events if name == "operator.skip_current")
    assert (PROPERTY_BROKEN, skip + 1) in events
    assert reports(own_state) == [("skipped_soon", LATE), ("never_gone", GONE)]
    why = lupin("why", "never_gone")
    assert why["text"].endswith(GONE)
    assert [cause["event"] for cause in why["causes"]][:2] == [
        "the property never_gone is broken",
        "operator.skip_current accepted",
    ]


def test_a_restart_neither_loses_nor_repeats_a_breach(
    world: World, operator: Operator, own_state: Path, tmp_path: Path
) -> None:
    """It is killed before the time is up, and again after the report."""
    folder = missions(tmp_path)
    world.start(NODE, missions_path=folder)
    operator.in_state("READY")
    assert operator.start(mission="Planted").accepted
    for _ in range(2):
        process = world.processes[NODE]
        process.send_signal(signal.SIGKILL)
        process.wait(10.0)
        operator.states.clear()
        world.start(NODE, missions_path=folder)
        operator.held()
        operator.until(lambda: LATE in operator.state.last_error or reports(own_state), "the report")
    assert reports(own_state) == [("skipped_soon", LATE)]
    operator.resume()
    assert operator.ask("skip_current").success
    operator.until(lambda: len(reports(own_state)) == 2, "the other one")
    assert reports(own_state)[1] == ("never_gone", GONE)
