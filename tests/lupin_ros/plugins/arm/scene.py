"""The arm's node and a simulated arm in one process, and somebody who asks and watches."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from control_msgs.action import GripperCommand
from mirte_msgs.srv import SetServoAngleWithSpeed
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter as RosParameter
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

from lupin_arm.joints import ARM, JAW, Pose, read_pose
from lupin_arm.node import PARAMETERS
from lupin_arm.node.services import serve_all
from lupin_arm.node.sim import PARAMETERS as SIM_PARAMETERS
from lupin_arm.node.sim import ArmSimNode
from lupin_arm.trajectory import Trajectory
from lupin_msgs.srv import SetArmPreset
from lupin_ros.adapter.node import Qos, RosNode, ServedGoal, ServiceCaller
from tests.lupin_ros.helpers import PATIENCE, spin_for, spin_until

MakeNode = Callable[..., RosNode]

TRAJECTORIES = "/mirte_master_arm_controller/joint_trajectory"

#: Radians within which the arm counts as being somewhere.
THERE = 0.01


def near(one: Sequence[float] | None, other: Sequence[float]) -> bool:
    """Tell whether two poses are the same for all that matters."""
    return one is not None and all(abs(a - b) < THERE for a, b in zip(one, other, strict=True))


class Bystander:
    """Watches the wire, presses the emergency stop, and calls services."""

    def __init__(self, make_node: MakeNode) -> None:
        self.ros = make_node("bystander")
        self.nodes: list[RosNode] = [self.ros]
        self.sent: list[JointTrajectory] = []
        self.angles: dict[str, float] = {}
        self.told = 0
        self.warnings: list[str] = []
        self._estop = self.ros.publisher(Bool, "/e_stop_state", Qos.EVENT)
        self._pressed: bool | None = None
        self._services: dict[str, ServiceCaller] = {}
        self.ros.timer(0.2, self._tell_estop)
        self.ros.subscribe(JointTrajectory, TRAJECTORIES, Qos.EVENT, self.sent.append)
        self.ros.subscribe(JointState, "/joint_states", Qos.DETECTION, self._on_states)
        self.ros.subscribe(Log, "/rosout", Qos.BACKLOG, self._on_log)

    def _on_states(self, message: JointState) -> None:
        self.angles.update(zip(message.name, message.position, strict=True))
        self.told += 1

    def _on_log(self, message: Log) -> None:
        if message.level >= 30 and message.name == "lupin_arm":
            self.warnings.append(message.msg)

    def until(self, condition: Callable[[], Any], what: str = "", timeout: float = PATIENCE) -> None:
        """Let everybody work until something holds."""
        spin_until(self.nodes, condition, timeout, what)

    def wait(self, seconds: float) -> None:
        """Let everybody work for a while: to show that something does not happen."""
        spin_for(self.nodes, seconds)

    @property
    def pose(self) -> Pose:
        """Where the arm was last said to be."""
        pose = read_pose(self.angles)
        assert pose is not None
        return pose

    @property
    def jaw(self) -> float:
        """Where the jaw was last said to be."""
        return self.angles[JAW]

    def is_at(self, pose: Pose) -> bool:
        """Tell whether the arm is there."""
        return near(self.pose, pose)

    def arrives(self, pose: Pose) -> None:
        """Wait until the arm is there."""
        self.until(lambda: self.is_at(pose), f"the arm at {pose}")

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """Return the answer of a service."""
        return self.call_later(kind, name, request)()

    def call_later(self, kind: Any, name: str, request: Any) -> Callable[[], Any]:
        """Send a request; what is returned waits for the answer."""
        if name not in self._services:
            self._services[name] = self.ros.service(kind, name)
        service, answers = self._services[name], []
        self.until(service.ready, f"service {name}")
        service.call(request, 10.0, answers.append)

        def answer() -> Any:
            self.until(lambda: answers, f"an answer of {name}")
            return answers[0]

        return answer

    def preset(self, name: str) -> Any:
        """Ask for a preset."""
        return self.call(SetArmPreset, "/lupin/arm/preset", SetArmPreset.Request(name=name))

    def turn(self, joint: str, angle: float, rate: float = 0.0, degrees: bool = True) -> bool:
        """Pull a slider."""
        name = "/lupin/gripper" if joint == "gripper" else f"/lupin/arm/{joint}"
        request = SetServoAngleWithSpeed.Request(angle=angle, rate=rate, degrees=degrees)
        return bool(self.call(SetServoAngleWithSpeed, f"{name}/set_angle_with_speed", request).status)

    def torque(self, on: bool) -> Any:
        """Switch the servos."""
        return self.call(SetBool, "/lupin/arm/set_torque", SetBool.Request(data=on))

    def init(self) -> Any:
        """Send the arm to the zero pose."""
        return self.call(Trigger, "/lupin/arm/init", Trigger.Request())

    def estop(self, engaged: bool) -> None:
        """Press or release the emergency stop, which from then on is told five times a second."""
        self._pressed = engaged
        self._tell_estop()

    def silence(self) -> None:
        """Let the emergency stop say nothing more."""
        self._pressed = None

    def _tell_estop(self) -> None:
        if self._pressed is not None:
            self._estop.publish(Bool(data=self._pressed))

    def set_parameter(self, node: str, name: str, value: Any) -> str:
        """Set a parameter of a node; returns why not, or nothing."""
        given = [RosParameter(name, value=value).to_parameter_msg()]
        answer = self.call(SetParameters, f"/{node}/set_parameters", SetParameters.Request(parameters=given))
        return str(answer.results[0].reason)


class Scene(Bystander):
    """All of it, and nobody has missed anything. `simulated=False`: the test says where the arm is."""

    def __init__(self, make_node: MakeNode, simulated: bool = True, **parameters: Any) -> None:
        super().__init__(make_node)
        self.sim: ArmSimNode | None = None
        if simulated:
            robot = make_node("lupin_arm_sim", (), SIM_PARAMETERS)
            self.sim = ArmSimNode(robot)
            self.nodes.append(robot)
        self._states = self.ros.publisher(JointState, "/joint_states", Qos.DETECTION)
        self._told_pose: Pose | None = None
        self.ros.timer(0.05, self._tell_again)
        said = [part for name, value in parameters.items() for part in ("-p", f"{name}:={value}")]
        self.node = make_node("lupin_arm", ["--ros-args", *said] if said else (), PARAMETERS)
        self.nodes.append(self.node)
        self.arm = serve_all(self.node)
        listeners = 2 if simulated else 1
        self.until(lambda: self.arm._trajectories.get_subscription_count() == listeners, "who listens")
        self.until(lambda: self.node.node.count_publishers("/e_stop_state") == 1, "the emergency stop")
        self.until(lambda: self._states.get_subscription_count() == 2, "who reads where the arm is")
        if simulated:
            self.until(lambda: self.told and self.arm.pose() and self.arm.jaw() is not None, "the arm")
            self.until(self.arm._gripper._action.ready, "the jaw's controller")
            self.arm.hold()
            self.command()
            self.sent.clear()

    def arrives(self, pose: Pose) -> None:
        """Wait until the arm is there, and its node has heard of it."""
        super().arrives(pose)
        self.until(lambda: near(self.arm.pose(), pose), f"the node to know that the arm is at {pose}")

    def command(self) -> Trajectory:
        """Return what the node has sent last, once that is seen on the wire."""
        motion = self.arm._motion
        assert motion is not None
        self.until(lambda: self.sent and _same(self.sent[-1], motion.trajectory), "what was sent last")
        return motion.trajectory

    def stays(self, pose: Pose) -> None:
        """Say where the arm is from now on, steadily as a driver does; its node has heard of it then."""
        self._told_pose = pose
        self.until(lambda: near(self.arm.pose(), pose), f"the node to know that the arm is at {pose}")

    def _tell_again(self) -> None:
        if self._told_pose is not None:
            self.tell(self._told_pose)

    def tell(self, pose: Pose, **changed: Any) -> None:
        """Say once where the arm is, among wheels."""
        angles: Mapping[str, float] = {
            "wheel_left_joint": math.pi,
            **{joint.state_name: angle for joint, angle in zip(ARM, pose, strict=True)},
        }
        message = JointState(name=list(angles), position=list(angles.values()))
        for name, value in changed.items():
            setattr(message, name, value)
        self._states.publish(message)


def late_jaw(scene: Bystander, make_node: MakeNode) -> list[ServedGoal]:
    """Start the jaw's controller, which leaves its goals to the test; return them as they come."""
    goals: list[ServedGoal] = []
    late = make_node("late")
    late.serve_action(
        GripperCommand,
        "/mirte_master_gripper_controller/gripper_cmd",
        admit=lambda goal: True,
        started=goals.append,
        cancelled=lambda served: served.cancel(GripperCommand.Result()),
    )
    scene.nodes.append(late)
    return goals


def _same(message: JointTrajectory, trajectory: Trajectory) -> bool:
    points = message.points
    told = [(*p.positions, p.time_from_start.sec + p.time_from_start.nanosec * 1e-9) for p in points]
    meant = [(*point.pose, point.time) for point in trajectory.points]
    return len(told) == len(meant) and bool(np.allclose(told, meant, rtol=0.0, atol=1e-6))
