"""An arm's drivers for tests: joints that are where a test says, servos that do what a test says."""

from __future__ import annotations

import json
import subprocess
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Time
from mirte_msgs.msg import ServoPosition
from mirte_msgs.srv import GetServoOffset, SetServoAngle, SetServoOffset
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header, String
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

from lupin_arm.calibration.offsets import HOMES
from lupin_arm.joints import ARM, JAW
from lupin_arm.node.arm import Arm
from lupin_arm.node.services import serve_all
from lupin_arm.node.settings import PARAMETERS
from lupin_msgs.msg import MissionState
from lupin_msgs.srv import ArmRecord, GetArmLibrary
from lupin_ros.adapter.node import CallFailure, Qos, RosNode
from tests.lupin_ros.helpers import spin_until
from tests.lupin_ros.plugins.arm.scene import near
from tests.lupin_ros.system.wire.wire import Asked, serve_by_hand
from tests.lupin_ros.world import PATIENCE, World

LIBRARY, CALIBRATE = "/lupin/arm/library", "/lupin/arm/calibrate"
SERVO, POWER, GATE = "/io/servo/hiwonder", "/io/servo/hiwonder/enable_all_servos", "/enable_arm_control"


class Drivers:
    """The vendor's side: joint states, the servos' power, the gate of commands, and each servo's services."""

    def __init__(self, ros: RosNode, servos: bool) -> None:
        self.ros = ros
        self.pose, self.jaw, self.stamp = [0.0] * len(ARM), 0.0, 1000.0
        self.telling = self.stamped = True
        #: What was switched, as (name, on), in order.
        self.switched: list[tuple[str, bool]] = []
        #: What is done with the next requests to switch, one each; without a plan they succeed at once.
        self.plan: deque[Callable[[Asked], Any]] = deque()
        self.trajectories: list[JointTrajectory] = []
        self.states = ros.publisher(JointState, "/joint_states", Qos.EVENT)
        ros.subscribe(
            JointTrajectory,
            "/mirte_master_arm_controller/joint_trajectory",
            Qos.EVENT,
            self.trajectories.append,
        )
        for name in (POWER, GATE):
            serve_by_hand(ros, SetBool, name, partial(self._switch, name))
        ros.timer(0.02, self.tell)
        self.calls: list[tuple[str, str, Any]] = []
        self.offsets = dict.fromkeys(HOMES, 0)
        self.counts: dict[str, int] = dict(HOMES)
        #: Servos that do not answer, by service, and those that do not tell their position.
        self.deaf: set[tuple[str, str]] = set()
        self.mute: set[str] = set()
        if servos:
            self._offer_servos()

    def tell(self) -> None:
        """Tell where the joints are, a fiftieth of a second later than before."""
        if not self.telling:
            return
        self.stamp += 0.02
        names = ["wheel_left_joint", *(joint.state_name for joint in ARM), JAW]
        whole = int(self.stamp)
        stamp = Time(sec=whole, nanosec=int((self.stamp - whole) * 1e9)) if self.stamped else Time()
        positions = [7.0, *self.pose, self.jaw]
        self.states.publish(JointState(header=Header(stamp=stamp), name=names, position=positions))

    def _switch(self, name: str, asked: Asked) -> None:
        self.switched.append((name, asked.request.data))
        (self.plan.popleft() if self.plan else succeed)(asked)

    def _offer_servos(self) -> None:
        for joint in HOMES:
            base = f"{SERVO}/{joint}"
            self.ros.serve(GetServoOffset, f"{base}/_offset", partial(self._read, joint))
            self.ros.serve(SetServoOffset, f"{base}/_set_offset", partial(self._write, joint))
            self.ros.serve(SetServoAngle, f"{base}/set_angle", partial(self._turn, joint))
        topics = {j: self.ros.publisher(ServoPosition, f"{SERVO}/{j}/position", Qos.EVENT) for j in HOMES}

        def tell() -> None:
            for joint, topic in topics.items():
                if joint not in self.mute:
                    topic.publish(ServoPosition(raw=self.counts[joint]))

        self.ros.timer(0.02, tell)

    def _read(self, joint: str, _: Any, response: Any) -> Any:
        self.calls.append(("read", joint, None))
        response.centidegrees = self.offsets[joint]
        return None if ("read", joint) in self.deaf else response

    def _write(self, joint: str, request: Any, response: Any) -> Any:
        self.calls.append(("write", joint, request.centidegrees))
        if ("write", joint) in self.deaf:
            return None
        self.offsets[joint] = request.centidegrees
        return response

    def _turn(self, joint: str, request: Any, response: Any) -> Any:
        self.calls.append(("turn", joint, request.angle))
        response.status = ("turn", joint) not in self.deaf
        return response


def succeed(asked: Asked) -> None:
    """Switch."""
    asked.answer(SetBool.Response(success=True))


def refuse(asked: Asked) -> None:
    """Do not switch, and say so."""
    asked.answer(SetBool.Response(success=False, message="the bus is silent"))


class Bench:
    """The arm's node, in this process or in `world` as one of its own; its drivers, and an operator."""

    def __init__(
        self,
        make_node: Callable[..., RosNode],
        path: Path,
        servos: bool = False,
        world: World | None = None,
        **given: Any,
    ) -> None:
        settings = {"library_path": path, **given}
        self.ros = make_node("bench")
        self.nodes = [self.ros]
        self.drivers = Drivers(self.ros, servos)
        self.drivers.telling = False
        self.told: list[dict[str, Any]] = []
        self.ros.subscribe(String, f"{LIBRARY}/state", Qos.LATCHED, self._on_state)
        self.estop = self.ros.publisher(Bool, "/e_stop_state", Qos.EVENT)
        self._pressed: bool | None = None
        self.ros.timer(0.2, self._tell_estop)
        self._mission = self.ros.publisher(MissionState, "/mission/state", Qos.LATCHED)
        self._lifecycle = ""
        self.ros.timer(0.2, self._tell_mission)
        #: The arm, where its node is in this process.
        self.arm: Arm | None = None
        self._callers: dict[str, Any] = {}
        if world is None:
            arguments = [part for name, value in settings.items() for part in ("-p", f"{name}:={value}")]
            self.nodes.insert(0, make_node("lupin_arm", ["--ros-args", *arguments], PARAMETERS))
            self.arm = serve_all(self.nodes[0])
        else:
            world.start("lupin_arm", **settings)
        # Who hears the state is known to the arm's node, and so is who has listened before to what it sends.
        self.until(lambda: self.told, "a first state")
        self.drivers.telling = True
        self.until(lambda: self.drivers.trajectories, "the arm is pinned")
        for topic in (self.estop, self._mission):
            self.until(topic.get_subscription_count, "the arm listens")
        # Ends are found in the order of their making: who answers this has found the drivers' services.
        self.call(GetArmLibrary, f"{LIBRARY}/list")

    def _on_state(self, message: String) -> None:
        self.told.append(json.loads(message.data))

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Work until a condition holds."""
        spin_until(self.nodes, condition, PATIENCE, what)

    def ask(self, kind: Any, service: str, /, **fields: Any) -> list[Any]:
        """Send a request; return the list that its answer comes into."""
        if service not in self._callers:
            self._callers[service] = self.ros.service(kind, service)
        caller, answers = self._callers[service], []
        self.until(caller.ready, f"service {service}")
        caller.call(kind.Request(**fields), 20.0, answers.append)
        return answers

    def call(self, kind: Any, service: str, /, **fields: Any) -> Any:
        """Call a service and return its answer."""
        answers = self.ask(kind, service, **fields)
        self.until(lambda: answers, f"answer of {service}")
        assert not isinstance(answers[0], CallFailure), answers[0]
        return answers[0]

    def dies(self, process: subprocess.Popen[bytes]) -> None:
        """Kill the arm's node; it is over when nobody waits for its answers any more."""
        process.kill()
        process.wait()
        self.until(lambda: not any(caller.ready() for caller in self._callers.values()), "its services go")

    def record(self, action: str, **fields: Any) -> Any:
        """Call the recorder."""
        return self.call(ArmRecord, f"{LIBRARY}/record", action=action, **fields)

    def state(self, **wanted: Any) -> Mapping[str, Any]:
        """Wait for a state that says what is wanted, and return it."""
        known = len(self.told)

        def found() -> list[Mapping[str, Any]]:
            return [told for told in self.told[known:] if wanted.items() <= told.items()]

        self.until(found, f"state {wanted}; last {self.told[-1:]}")
        return found()[0]

    @property
    def points(self) -> Sequence[Any]:
        """The points of what the arm's controller was sent last."""
        return list(self.drivers.trajectories[-1].points)

    def is_sent_to(self, pose: Sequence[float]) -> bool:
        """Tell whether what the arm was sent last is one point, at a pose: to go there, or to stay."""
        return len(self.points) == 1 and near(self.points[0].positions, pose)

    def move_by_hand(self, *poses: list[float]) -> None:
        """Have the arm in these poses, each for some messages, and until a node in this process has it."""
        for pose in poses:
            self.drivers.pose = list(pose)
            end = self.drivers.stamp + 0.15
            self.until(lambda end=end, pose=pose: self.drivers.stamp > end and self._known(pose), "a pose")

    def _known(self, pose: list[float]) -> bool:
        return self.arm is None or near(self.arm.pose(), pose)

    def stop(self, engaged: bool = True) -> None:
        """Press or release the emergency stop, which from then on is told five times a second."""
        self._pressed = engaged
        self._tell_estop()

    def until_stopped(self) -> None:
        """Press the emergency stop, and wait until the arm has heard of it."""
        self.stop()
        self.until(lambda: self.arm is not None and self.arm.stopped, "the stop is heard")

    def mission_is(self, lifecycle: str) -> None:
        """Have the orchestrator in a state, which from then on is told five times a second, as it does."""
        self._lifecycle = lifecycle
        self._tell_mission()

    def _tell_mission(self) -> None:
        if self._lifecycle:
            self._mission.publish(MissionState(lifecycle_state=self._lifecycle))

    def _tell_estop(self) -> None:
        if self._pressed is not None:
            self.estop.publish(Bool(data=self._pressed))
