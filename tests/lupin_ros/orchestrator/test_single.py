"""Two orchestrators would both carry out every request: the second one of a domain stands down."""

from __future__ import annotations

import re
import signal
import sys
from pathlib import Path

import pytest

from tests.lupin_ros.helpers import PATIENCE
from tests.lupin_ros.orchestrator.test_answers import folder
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

LUPIN = str(Path(sys.executable).with_name("lupin"))


@pytest.mark.core
def test_the_second_one_stands_down(world: World, operator: Operator, tmp_path: Path) -> None:
    """It ends with a sentence that names the first, which goes on; a name of its own does not help it."""
    missions = folder(tmp_path)
    world.start("mission_orchestrator", missions_path=missions)
    operator.in_state("READY")
    first = world.processes.pop("mission_orchestrator")
    world.processes["first"] = first
    said = world.log("mission_orchestrator")
    for name in ("mission_orchestrator", "another"):
        begun = len(said.read_text(encoding="utf-8"))
        renamed = ["--ros-args", "-r", f"__node:={name}", "-p", f"missions_path:={missions}"]
        second = world.run("mission_orchestrator", [LUPIN, "node", "mission_orchestrator", *renamed])
        assert second.wait(PATIENCE) == 1
        assert said.read_text(encoding="utf-8")[begun:].splitlines()[-1] == (
            f"lupin: {name} stands down: /mission_orchestrator (READY) is the orchestrator of this ROS "
            "domain already; stop that one, or start this one with another ROS_DOMAIN_ID"
        )
    assert first.poll() is None
    assert operator.start(mission="Ask").accepted
    operator.in_state("ASKING", "ASKING")


def test_of_two_that_miss_each_other_the_younger_stands_down(
    world: World, operator: Operator, tmp_path: Path
) -> None:
    """They start within the same second: neither looks, here."""
    missions = folder(tmp_path)
    blind = "import lupin_ros.orchestrator.single as single; single.LOOK_S = 0.0"
    run = f"{blind}; from lupin_cli.main import main; import sys; sys.exit(main(sys.argv[1:]))"
    words = ["node", "mission_orchestrator", "--ros-args", "-p", f"missions_path:={missions}"]
    both = [world.run(name, [sys.executable, "-c", run, *words]) for name in ("one", "other")]
    operator.until(lambda: any(process.poll() is not None for process in both), "one has ended")
    (stays,) = (process for process in both if process.poll() is None)
    ended = next(name for name, process in zip(("one", "other"), both, strict=True) if process is not stays)
    assert world.processes[ended].returncode == 1
    assert re.fullmatch(
        r"lupin: mission_orchestrator stands down: another orchestrator of this ROS domain began before it "
        r"\(boot \w{32}\); stop that one, or start this one with another ROS_DOMAIN_ID",
        world.log(ended).read_text(encoding="utf-8").splitlines()[-1],
    )
    assert operator.start(mission="Ask").accepted
    operator.in_state("ASKING", "ASKING")
    assert stays.poll() is None


def test_one_that_was_killed_is_replaced_at_once(world: World, operator: Operator, tmp_path: Path) -> None:
    """The network still shows it, but it says nothing any more."""
    missions = folder(tmp_path)
    killed = world.start("mission_orchestrator", missions_path=missions)
    operator.in_state("READY")
    assert operator.start(mission="Ask").accepted
    operator.in_state("ASKING", "ASKING")
    killed.send_signal(signal.SIGKILL)
    killed.wait(PATIENCE)
    operator.states.clear()
    world.start("mission_orchestrator", missions_path=missions)
    operator.held()
