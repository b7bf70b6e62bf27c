"""A wait that is longer than any clock counts: refused, or an error of the state that computes it."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lupin_engine.missions.folders import default_missions_folder
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

COMPUTED = """\
mission: TooLong
summary: Computes how long it waits.
params: {wait: {type: duration, default: 10 s, summary: what is multiplied}}
context: {factor: {type: number, default: 1e10}}
initial: WAITING
states:
  WAITING:
    after: {"${ factor * param.wait }": done}
  done: {type: final}
"""


def test_what_is_computed_is_an_error_at_its_place(world: World, operator: Operator, tmp_path: Path) -> None:
    """It came to a timer of ROS, in which nanoseconds have 64 bits; every callback failed from then on."""
    folder = tmp_path / "missions"
    shutil.copytree(default_missions_folder(), folder)
    (folder / "too_long.yaml").write_text(COMPUTED)
    world.start_all(missions_path=folder)
    operator.in_state("READY")
    assert operator.start(mission="TooLong").accepted
    operator.in_state("FAULT")
    place, told = "too_long.yaml:8:13", "1e+11 s is too long to wait; at most 100 years (3155760000 s)"
    assert f"{place}: after: {told}" in operator.state.last_error
    assert operator.ask("reset").success
    operator.in_state("READY")
    assert operator.start("1").accepted
    operator.in_state("INSPECTING", "NAVIGATING")
    assert operator.ask("pause").success
    operator.held()


@pytest.mark.parametrize("verb", ["up", "run"])
def test_a_parameter_is_refused(verb: str, ros_domain: int) -> None:
    """Before anything is started."""
    lupin = str(Path(sys.executable).with_name("lupin"))
    command = [lupin, verb, "inspection", "--set", "nav_timeout_s=1e11 s"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    told = "expected duration of at most 100 years (3155760000 s), got '1e11 s'"
    assert (done.returncode, done.stderr) == (2, f"lupin: --set: parameter 'nav_timeout_s': {told}\n")


def test_a_parameter_of_the_node_is_refused(world: World) -> None:
    """As `ros2 run` gives it; one beyond 64 bits ended the node with a traceback."""
    for given, told in (
        ({"nav_timeout_s": 1e11}, "'nav_timeout_s': expected duration of at most 100 years"),
        ({"max_targets": 2**60}, "'max_targets': expected count of at most 9007199254740991"),
    ):
        process = world.start("mission_orchestrator", **given)
        assert process.wait(60) == 1
        assert told in world.log("mission_orchestrator").read_text()
