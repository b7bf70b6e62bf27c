"""War stories of bring-up and arm that need real DDS to be told; docs/war-stories.md links here."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from lupin_cli.main import main
from lupin_msgs.srv import PlayArmSequence
from lupin_ros.adapter.node import Qos, RosNode
from tests.lupin_ros.launch.processes import until
from tests.lupin_ros.plugins.arm.bench import LIBRARY, Bench
from tests.lupin_ros.world import Operator, World


def see_ends(topic: str, ends: tuple[list[str], list[str]], capsys: pytest.CaptureFixture[str]) -> None:
    """See who publishes and who hears a topic, as `lupin graph` shows it once it has discovered them."""

    def seen() -> bool:
        code, text = main(["graph", "--json", topic]), capsys.readouterr().out
        if code != 0:
            return False
        (interface,) = json.loads(text)
        return (interface["producers"], interface["consumers"]) == ends

    until(seen, f"{topic} with {ends}")


def test_a_stop_button_that_nobody_tells_of_is_seen(
    world: World, operator: Operator, make_node: Callable[..., RosNode], capsys: pytest.CaptureFixture[str]
) -> None:
    """Story 29: the button was pressed, and nothing led from it to the topic that the mission hears."""
    world.start("mission_orchestrator", estop_topic="/robot/stop")
    operator.in_state("BOOT")
    see_ends("/robot/stop", ([], ["/mission_orchestrator"]), capsys)
    make_node("button").publisher(Bool, "/robot/stop", Qos.EVENT)
    see_ends("/robot/stop", (["/button"], ["/mission_orchestrator"]), capsys)


def motions(bench: Bench) -> int:
    """Return how many motions the arm was sent, beside the single points that hold it where it is."""
    return sum(len(trajectory.points) > 1 for trajectory in bench.drivers.trajectories)


def test_of_two_replays_asked_for_at_once_one_is_played(
    make_node: Callable[..., RosNode], tmp_path: Path
) -> None:
    """Story 45: both were let in, because the check and what it allowed lay apart."""
    bench = Bench(make_node, tmp_path / "arm_library.json")
    assert bench.record("start", mode="teleop").success
    bench.move_by_hand([0.0, 0.0, 0.0, 0.0], [0.2, 0.0, 0.0, 0.0])
    assert bench.record("save", name="sweep").success
    bench.move_by_hand([1.5, 1.0, 0.0, 0.0])
    asked = [bench.ask(PlayArmSequence, f"{LIBRARY}/play", name="sweep", speed=0.25) for _ in range(2)]
    bench.until(lambda: all(asked), "both answers")
    first, second = (answers[0] for answers in asked)
    assert first.success, first.message
    assert (second.success, second.message) == (False, "'sweep' is being played; stop it first")
    bench.until(lambda: motions(bench), "the replay")
    assert bench.call(Trigger, f"{LIBRARY}/stop").success
    assert motions(bench) == 1
