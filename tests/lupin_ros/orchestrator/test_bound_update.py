"""An operation of a binding that is updated, with a server of rclpy that takes a new goal in place of one."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from std_msgs.msg import Bool, String

from lupin_engine.missions.folders import default_missions_folder
from lupin_ros.adapter.actions import ServedGoal
from lupin_ros.adapter.node import Qos
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

BINDING = """\
binding: chaser
summary: Drives after somebody.
codes: {lost: {label: nobody was reached, severity: warn}}
values:
  chaser.them:
    summary: where they are
    type: pose
    topic: {name: /chaser/them, type: geometry_msgs/msg/PoseStamped}
    from: ${ message.pose }
operations:
  chase:
    summary: Drive to where they are.
    arguments: {place: {type: pose, summary: where they are}}
    action: {name: /chaser/chase, type: nav2_msgs/action/NavigateToPose}
    with: {pose: {header: {frame_id: map}, pose: "${ place }"}}
    done_when: status == 'succeeded'
    updates: true
    code: lost
    uses: base
    on_hold: cancel
    mock: {after: 5 s}
"""
MISSION = """\
mission: Chase
summary: Drive after somebody.
inputs: {them: {value: chaser.them}}
initial: WAITING
states:
  WAITING: {phase: WAITING, always: {target: CHASING, guard: known(input.them)}, after: {1 min: done}}
  CHASING:
    phase: CHASING
    invoke:
      do: chaser.chase
      with: {place: "${ input.them if known(input.them) else param.dock_pose }"}
      timeout: {after: 1 min, code: lost}
      update: 1 s
    on_done: done
    on_error: done
  done: {type: final}
"""
#: A drive of the shipped plugin, to other tags meanwhile.
DRIVE = """\
mission: Drive
summary: Drive to the first tag, and change one's mind twice.
context: {n: {type: count, default: 0}}
initial: DRIVING
states:
  DRIVING:
    phase: DRIVING
    every: {400 ms: {do: {set: {n: "${ n + 1 }"}}}}
    invoke:
      do: nav.go_to
      with: {pose: "${ approach(tags.named(['1' if n < 1 else '5' if n < 2 else '2'])[0]) }"}
      timeout: {after: 2 min, code: nav_timeout}
      update: 100 ms
    on_done: done
    on_error: FAULT
  done: {type: final}
"""
#: How long somebody walks, and between two reports of where they are, in seconds.
WALK_S, REPORT_S = 5.5, 0.2


class Chaser(Operator):
    """A server that works on the newest goal alone, and an operator who tells where somebody is."""

    def __init__(self) -> None:
        super().__init__("chaser")
        self.handles: list[ServerGoalHandle] = []
        self.goals: list[ServedGoal] = []
        self.cancels: list[ServedGoal] = []
        self.most = 0
        self.commands: list[dict[str, Any]] = []
        self._walked, self._reported = 0.0, 0.0
        self._them = self.ros.publisher(PoseStamped, "/chaser/them", Qos.EVENT)
        self._server = ActionServer(
            self.ros.node,
            NavigateToPose,
            "/chaser/chase",
            self._until_ended,
            handle_accepted_callback=self._begin,
            cancel_callback=self._cancel,
        )
        self.ros.subscribe(String, "/mission_orchestrator/steps", Qos.BACKLOG, self._on_step)

    @property
    def active(self) -> list[ServedGoal]:
        """The goals that have not ended."""
        return [goal for goal in self.goals if goal.active]

    def _on_step(self, message: String) -> None:
        self.commands += json.loads(message.data)["step"].get("commands", ())

    def _begin(self, handle: ServerGoalHandle) -> None:
        before = self.active
        self.handles.append(handle)
        self.goals.append(ServedGoal(self.ros, handle, lambda _: None))
        self.most = max(self.most, len(self.active))
        handle.execute()
        for old in before:
            old.abort(NavigateToPose.Result(error_msg="preempted"))

    async def _until_ended(self, handle: ServerGoalHandle) -> Any:
        return await self._goal(handle).result

    def _goal(self, handle: ServerGoalHandle) -> ServedGoal:
        return next(goal for goal in self.goals if goal.key == bytes(handle.goal_id.uuid))

    def _cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        goal = self._goal(handle)
        self.cancels.append(goal)
        self.ros.post(lambda: goal.cancel(NavigateToPose.Result()))
        return CancelResponse.ACCEPT

    def walk(self, seconds: float) -> None:
        """Walk on for so long, and tell where that leads."""
        until = time.monotonic() + seconds

        def there() -> bool:
            now = time.monotonic()
            if now - self._reported > REPORT_S:
                self._reported, self._walked = now, self._walked + REPORT_S
                pose = PoseStamped()
                pose.pose.position.x, pose.pose.orientation.w = self._walked, 1.0
                self._them.publish(pose)
            return now > until

        self.until(there, "the walk", timeout=seconds + 30.0)


@pytest.fixture
def chaser(ros_domain: int, world: World, tmp_path: Path) -> Iterator[Chaser]:
    """The server, and a robot that is ready."""
    missions = tmp_path / "missions"
    (missions / "bindings").mkdir(parents=True)
    (missions / "bindings" / "chaser.yaml").write_text(BINDING)
    (missions / "chase.yaml").write_text(MISSION)
    (missions / "drive.yaml").write_text(DRIVE)
    allowed = "allow: {actions: /chaser/chase, subscribe: /chaser/them}"
    (tmp_path / "lupin.yaml").write_text(allowed)
    shutil.copy(default_missions_folder() / "lifecycle.yaml", missions)
    found = Chaser()
    world.start_all(missions_path=missions)
    found.in_state("READY")
    yield found
    found.ros.close()


def begin(chaser: Chaser) -> None:
    """Start the chase, and wait for its first goal."""
    assert chaser.start(mission="Chase").accepted
    chaser.walk(0.5)
    chaser.until(lambda: chaser.goals, "the first goal")


def test_an_updated_goal_is_one_drive(chaser: Chaser) -> None:
    """One goal a second, each where somebody is then; none is cancelled, and one has a result."""
    begin(chaser)
    chaser.walk(WALK_S)
    stands = time.monotonic()
    chaser.until(lambda: time.monotonic() > stands + 2.0, "the last update, while they stand")
    assert 4 <= len(chaser.goals) <= 7
    places = [goal.request.pose.pose.position.x for goal in chaser.goals]
    assert places == sorted(set(places))
    (live,) = chaser.active
    assert live is chaser.goals[-1]
    live.succeed(NavigateToPose.Result())
    chaser.in_state("DONE")
    ends = [handle.status for handle in chaser.handles]
    assert ends == [GoalStatus.STATUS_ABORTED] * (len(ends) - 1) + [GoalStatus.STATUS_SUCCEEDED]
    chases = [each for each in chaser.commands if each.get("operation") == "chaser.chase"]
    assert [each["command"] for each in chases] == ["start"] * len(chaser.goals)
    assert [each.get("updates", "") for each in chases] == ["", *(each["attempt"] for each in chases[:-1])]
    assert (chaser.cancels, chaser.state.last_error) == ([], "")
    assert chaser.most == 2


def test_an_emergency_stop_cancels_the_goal_that_lives(chaser: Chaser) -> None:
    """And nothing begins until the resume; then the newest place is the first."""
    begin(chaser)
    chaser.walk(2.5)
    stop = chaser.ros.publisher(Bool, "/e_stop_state", Qos.EVENT)

    def pressed() -> bool:
        stop.publish(Bool(data=True))
        return bool(chaser.state.estop_engaged and not chaser.active)

    chaser.until(pressed, "the stop ends the goal")
    before = len(chaser.goals)
    assert chaser.cancels == [chaser.goals[-1]]
    chaser.walk(1.5)
    assert len(chaser.goals) == before


def test_a_drive_of_navigation_is_updated(chaser: Chaser) -> None:
    """The simulated robot gives up the old goal for the new one, as Nav2 does."""
    assert chaser.start(mission="Drive").accepted
    chaser.in_state("DONE")
    drives = [each for each in chaser.commands if each.get("operation") == "nav.go_to"]
    assert [(each["command"], bool(each.get("updates"))) for each in drives] == [
        ("start", False),
        ("start", True),
        ("start", True),
    ]
    assert chaser.state.last_error == ""
