"""An orchestrator that is killed or hangs while the robot moves: real processes, and how far it goes on."""

from __future__ import annotations

import math
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from action_msgs.msg import GoalStatus
from nav2_msgs.action import NavigateToPose
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage

from lupin_msgs.srv import SetArmPreset
from lupin_ros.adapter.node import GoalCallbacks, Qos
from lupin_ros.adapter.process import StoodStill
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(240)

#: Speed of the robot in metres a second, and seconds until it stands by `docs/safety.md`: the timeout, and
#: the look that notices. What a busy machine adds is allowed on top.
SPEED, BOUND_S, BUSY_S = 0.5, 2.25, 4.0
#: A tag that is far from the start.
FAR_TAG = "29"


class Bystander(Operator):
    """An operator who sees where base and arm are."""

    def __init__(self, world: World) -> None:
        super().__init__()
        self.world = world
        self.place = (0.0, 0.0)
        self.lift = 0.0
        self.ros.subscribe(TFMessage, "/tf", Qos.TRANSFORMS, self._on_transforms)
        self.ros.subscribe(JointState, "/joint_states", Qos.DETECTION, self._on_joints)

    def _on_transforms(self, message: TFMessage) -> None:
        for found in message.transforms:
            if found.child_frame_id == "base_link":
                self.place = found.transform.translation.x, found.transform.translation.y

    def _on_joints(self, message: JointState) -> None:
        self.lift = message.position[message.name.index("shoulder_lift_joint")]

    def driving(self) -> None:
        """Start a mission and let the robot drive its first metre."""
        self.in_state("READY")
        assert self.start(FAR_TAG).accepted
        start = self.place
        self.until(lambda: math.dist(self.place, start) > 1.0, "the first metre")

    def until_logged(self, node: str, text: str) -> None:
        """Wait for a line of a node's log."""
        self.until(lambda: text in self.world.log(node).read_text(), f"{node}: {text}")


@pytest.fixture
def bystander(world: World) -> Iterator[Bystander]:
    found = Bystander(world)
    yield found
    found.ros.close()


def kill(world: World) -> None:
    world.processes["mission_orchestrator"].kill()


def hang(world: World) -> None:
    world.processes["mission_orchestrator"].send_signal(signal.SIGSTOP)


def _assert_stood_in_time(driven: float) -> None:
    assert SPEED * (BOUND_S - 0.75) < driven < SPEED * (BOUND_S + BUSY_S)


@pytest.mark.core
@pytest.mark.parametrize("lose", [kill, hang])
def test_base_and_arm_stop_when_the_orchestrator_is_not_heard(
    world: World,
    bystander: Bystander,
    lose: Callable[[World], None],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    record_property: Callable[[str, object], None],
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    world.start("lupin_arm_sim")
    world.start("lupin_arm", preset_duration=60.0)
    world.start_all(speed=2.0 * SPEED)
    bystander.until(lambda: bystander.lift != 0.0, "the arm")
    bystander.driving()
    preset = SetArmPreset.Request(name="inspect")
    assert bystander.call(SetArmPreset, "/lupin/arm/preset", preset).success
    lose(world)
    lost_at = bystander.place
    bystander.until_logged("lupin_sim", "the robot stops (reason='the orchestrator is silent for 2 s')")
    bystander.until_logged("lupin_arm", "the arm stops (reason='the orchestrator is silent for 2 s')")
    bystander.until(_still(bystander), "base and arm at rest")
    driven = math.dist(bystander.place, lost_at)
    record_property("driven_m", round(driven, 2))
    _assert_stood_in_time(driven)
    if lose is hang:  # others may have forgotten it: it is let go on, and ends without having moved anything
        orchestrator, rest = world.processes["mission_orchestrator"], bystander.place
        orchestrator.send_signal(signal.SIGCONT)
        bystander.until(lambda: orchestrator.poll() is not None, "its end")
        assert orchestrator.returncode == StoodStill.exit_code
        assert math.dist(bystander.place, rest) < 0.1


def test_nav2_is_told_to_stop_by_its_watchdog(world: World, bystander: Bystander) -> None:
    """As Nav2 does, this base follows its goal whoever is gone."""
    world.start("nav_watchdog")
    world.start("greenhouse_bridge")
    world.start("lupin_sim", speed=SPEED, orchestrator_timeout_s=0.0)
    world.start("mission_orchestrator", estop_timeout_s=10.0)
    bystander.driving()
    kill(world)
    lost_at = bystander.place
    text = "all goals are cancelled (action='navigate_to_pose' reason='the orchestrator is silent for 2 s')"
    bystander.until_logged("nav_watchdog", text)
    bystander.until(_still(bystander), "the base at rest")
    _assert_stood_in_time(math.dist(bystander.place, lost_at))
    assert "robot may drive on" not in world.log("nav_watchdog").read_text()


def test_a_stop_ends_a_drive_that_nobody_would_ask_for_again(world: World, bystander: Bystander) -> None:
    """Nav2 would go on with a goal of a display as soon as the stop is released."""
    world.start("nav_watchdog")
    world.start("greenhouse_bridge")
    world.start("lupin_sim", speed=SPEED)
    world.start("mission_orchestrator", estop_timeout_s=10.0)
    bystander.in_state("READY")
    ended: list[int] = []
    goal = NavigateToPose.Goal()
    goal.pose.header.frame_id = "map"
    goal.pose.pose.position.y = 4.0
    goal.pose.pose.orientation.w = 1.0
    bystander.ros.action(NavigateToPose, "navigate_to_pose").send(
        goal, GoalCallbacks(ended=lambda status, _: ended.append(status), rejected=lambda: ended.append(0))
    )
    start = bystander.place
    bystander.until(lambda: math.dist(bystander.place, start) > 0.2, "the drive")
    stop = bystander.ros.publisher(Bool, "/lupin/hmi/estop", Qos.EVENT)
    bystander.until(lambda: stop.get_subscription_count() > 0, "the robot")
    stop.publish(Bool(data=True))
    text = "all goals are cancelled (action='navigate_to_pose' reason='the stop is engaged')"
    bystander.until_logged("nav_watchdog", text)
    bystander.until(lambda: ended, "the end of the drive")
    assert ended == [GoalStatus.STATUS_CANCELED]


def _still(bystander: Bystander) -> Callable[[], bool]:
    """Return a condition that comes true when nothing has moved between so many looks in a row."""
    seen: list[tuple[object, ...]] = []

    def is_still() -> bool:
        seen.append((bystander.place, round(bystander.lift, 3)))
        return len(seen) > 20 and len(set(seen[-20:])) == 1

    return is_still
