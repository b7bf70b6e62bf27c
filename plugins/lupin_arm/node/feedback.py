"""Measured joint angles, from `/joint_states`; angles older than 0.5 s count as unknown."""

from __future__ import annotations

from collections.abc import Callable

from sensor_msgs.msg import JointState

from lupin_arm.joints import ARM, FARTHEST, JAW, Pose, read_pose
from lupin_engine.plugin import seconds_of
from lupin_ros.adapter import Qos, RosNode

#: Seconds for which a measured angle counts as present.
FRESH_S = 0.5

#: Gets the seconds of the message's stamp (of its arrival where it has none), the arm and the jaw.
Listener = Callable[[float, Pose, float | None], None]

_NAMES = frozenset((*(joint.state_name for joint in ARM), JAW))


class Feedback:
    """The last angles of the arm's joints and of the jaw; impossible angles are ignored."""

    def __init__(self, ros: RosNode, topic: str) -> None:
        self._ros = ros
        self._angles: dict[str, float] = {}
        self._seen: dict[str, float] = {}
        self._listeners: list[Listener] = []
        self._topic = topic
        self._strange: set[str] = set()
        ros.subscribe(JointState, topic, Qos.DETECTION, self._on_states)

    def listen(self, listener: Listener) -> None:
        """Call `listener` with every message that has a joint of the arm, once all joints are known."""
        self._listeners.append(listener)

    def pose(self) -> Pose | None:
        """Return the pose; None where an angle is missing or too old."""
        return read_pose(self._fresh())

    def jaw(self) -> float | None:
        """Return the angle of the jaw's joint; None where it is missing or too old."""
        return self._fresh().get(JAW)

    def _fresh(self) -> dict[str, float]:
        now = self._ros.elapsed()
        return {name: angle for name, angle in self._angles.items() if now - self._seen[name] <= FRESH_S}

    def _on_states(self, message: JointState) -> None:
        reported = zip(message.name, message.position, strict=False)  # a driver may leave positions out
        found = {name: angle for name, angle in reported if name in _NAMES and self._is_angle(name, angle)}
        now = self._ros.elapsed()
        self._angles.update(found)
        self._seen.update(dict.fromkeys(found, now))
        pose = self.pose()
        if pose is not None and found.keys() - {JAW}:
            stamp = seconds_of(message.header.stamp)
            for listener in self._listeners:
                listener(stamp or self._ros.now(), pose, self.jaw())

    def _is_angle(self, name: str, angle: float) -> bool:
        """Return whether a joint can have this angle: an impossible one must not become a target."""
        if abs(angle) <= FARTHEST:
            return True
        if name not in self._strange:
            self._strange.add(name)
            wrong = f"{name} at {angle:g} rad is left out: no joint of this arm gets there"
            self._ros.log.warning(f"{self._topic}: {wrong}; angles are radians")
        return False
