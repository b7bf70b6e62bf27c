"""How far base and arm went, as a bystander sees it: by the transforms and joint states on the network."""

from __future__ import annotations

import math
import time
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from action_msgs.msg import GoalStatusArray
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from lupin_ros.adapter.node import Qos, RosNode

#: Seconds between two pulses, which show when this process itself was kept waiting.
PULSE_S = 0.02
#: Values of a goal's status that are not its end: accepted, executing, canceling.
ACTIVE = (1, 2, 3)


@dataclass(frozen=True)
class Moved:
    """Metres of the base; radians of its heading and of all joints of the arm together."""

    metres: float
    radians: float

    def exceeds(self, metres: float, radians: float) -> bool:
        """Whether it is more than that."""
        return self.metres > metres or self.radians > radians


class Bystander:
    """Notes where everything is; times are those of the senders, in seconds of the wall clock."""

    def __init__(self, ros: RosNode) -> None:
        self.base: list[tuple[float, float, float, float]] = []
        self.joints: list[tuple[float, ...]] = []
        self._pulses: list[float] = []
        #: How many goals of navigation are under way, whoever sent them.
        self.goals = 0
        ros.subscribe(TFMessage, "/tf", Qos.TRANSFORMS, self._on_transforms)
        ros.subscribe(JointState, "/joint_states", Qos.DETECTION, self._on_joints)
        ros.subscribe(GoalStatusArray, "/navigate_to_pose/_action/status", Qos.LATCHED, self._on_status)
        ros.steady_timer(PULSE_S, lambda: self._pulses.append(time.time()))

    def _on_transforms(self, message: TFMessage) -> None:
        for found in message.transforms:
            if found.child_frame_id == "base_link":
                place, turn = found.transform.translation, found.transform.rotation
                yaw = 2.0 * math.atan2(turn.z, turn.w)
                self.base.append((_seconds(found.header.stamp), place.x, place.y, yaw))

    def _on_joints(self, message: JointState) -> None:
        self.joints.append((_seconds(message.header.stamp), *message.position))

    def _on_status(self, message: GoalStatusArray) -> None:
        self.goals = sum(one.status in ACTIVE for one in message.status_list)

    def forget(self) -> None:
        """Keep the last places only."""
        for kept in (self.base, self.joints, self._pulses):
            del kept[:-1]

    def moved(self, begin: float, end: float) -> Moved:
        """Return how far everything went between two times."""
        base = _within(self.base, begin, end)
        metres = sum(math.dist(one[1:3], other[1:3]) for one, other in pairwise(base))
        turned = sum(abs(math.remainder(other[3] - one[3], math.tau)) for one, other in pairwise(base))
        joints = pairwise(_within(self.joints, begin, end))
        return Moved(
            metres, turned + sum(abs(a - b) for p, q in joints for a, b in zip(p[1:], q[1:], strict=True))
        )

    def waited(self, begin: float, end: float) -> float:
        """Return for how long this process was kept waiting at the worst, in seconds."""
        pulses = [begin, *(pulse for pulse in self._pulses if begin <= pulse <= end), end]
        return max(0.0, max(b - a for a, b in pairwise(pulses)) - PULSE_S)


def _within(track: Sequence[tuple[float, ...]], begin: float, end: float) -> Sequence[tuple[float, ...]]:
    """Return the places between two times, and the one before: from there it came."""
    times = [place[0] for place in track]
    return track[max(0, bisect_left(times, begin)) : bisect_left(times, end)]


def _seconds(stamp: object) -> float:
    return float(stamp.sec + stamp.nanosec * 1e-9)  # type: ignore[attr-defined]
