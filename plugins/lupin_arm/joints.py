"""The joints of the arm and its jaw: names, limits, units. The one place that has them; loads without ROS.

Angles are radians. The servos ignore an angle beyond their limits without a word, so nothing may ever be
sent that is not inside the command window: the part of the servo's range within a quarter turn, in whole
degrees.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

#: Angles of the four joints in the order of `ARM`, in radians.
Pose = tuple[float, float, float, float]

#: No joint of this arm is farther from its zero, in radians; what says so has other units.
FARTHEST = math.pi

#: The highest rate of a joint, and the default rate, in radians a second.
MAX_RATE = math.radians(180.0)
DEFAULT_RATE = math.radians(60.0)


class OutsideLimits(ValueError):
    """An angle that must not be sent; the text names joint, angle and what is allowed."""


@dataclass(frozen=True)
class Joint:
    """One joint: its name in services, its command window and its servo's range in degrees."""

    name: str
    window_deg: tuple[float, float]
    servo_deg: tuple[float, float]

    @property
    def state_name(self) -> str:
        """What the joint is called in `/joint_states` and trajectories."""
        return f"{self.name}_joint"

    @property
    def low(self) -> float:
        """Smallest angle that may be commanded."""
        return math.radians(self.window_deg[0])

    @property
    def high(self) -> float:
        """Largest angle that may be commanded."""
        return math.radians(self.window_deg[1])

    def reach(self, angle: float) -> float:
        """Return the nearest angle within the range of the servo."""
        low, high = self.servo_deg
        return min(max(angle, math.radians(low)), math.radians(high))

    def clamp(self, angle: float) -> float:
        """Return the nearest angle that may be commanded.

        Raises:
            OutsideLimits: it is not finite, which nobody means.
        """
        return min(max(_finite(self.name, angle), self.low), self.high)

    def check(self, angle: float) -> None:
        """Refuse an angle that may not be commanded.

        Raises:
            OutsideLimits: it is outside the command window, or not a number.
        """
        if not self.low <= angle <= self.high:
            low, high = self.window_deg
            raise OutsideLimits(
                f"{self.name}: {math.degrees(angle):.1f} deg is not within {low:g} to {high:g}"
            )


#: The joints of the arm, from the base to the hand; every list of angles is in this order.
ARM = (
    Joint("shoulder_pan", (-86.0, 90.0), (-86.0, 90.0)),
    Joint("shoulder_lift", (-86.0, 85.0), (-86.2, 85.5)),
    Joint("elbow", (-90.0, 90.0), (-116.3, 92.5)),
    Joint("wrist", (-90.0, 88.0), (-110.7, 88.0)),
)

#: What the jaw's joint is called in `/joint_states`.
JAW = "gripper_joint"
#: The jaw as its controller has it, in radians, and as operators say it, in degrees: open, then closed.
JAW_OPEN, JAW_CLOSED = -0.20, 0.25
JAW_OPEN_DEG, JAW_CLOSED_DEG = -30.0, 30.0
#: Most that the jaw's motor may exert.
JAW_EFFORT = 2.0


def clamp_pose(angles: Iterable[float]) -> Pose:
    """Return four angles, each the nearest that may be commanded.

    Raises:
        OutsideLimits: there are not four, or one is not finite.
    """
    return _pose(joint.clamp(angle) for joint, angle in zip(ARM, _four(angles), strict=True))


def check_pose(angles: Iterable[float]) -> Pose:
    """Return four angles as they are, all of which may be commanded.

    Raises:
        OutsideLimits: there are not four, or one may not.
    """
    given = _four(angles)
    for joint, angle in zip(ARM, given, strict=True):
        joint.check(angle)
    return _pose(given)


def reach_pose(pose: Pose) -> Pose:
    """Return a pose that the servos can keep, where a joint is told to be a little beyond its range."""
    return _pose(joint.reach(angle) for joint, angle in zip(ARM, pose, strict=True))


def read_pose(positions: Mapping[str, float]) -> Pose | None:
    """Return the arm's angles from those of `/joint_states`; None unless all four are given."""
    found = [positions.get(joint.state_name, math.nan) for joint in ARM]
    return _pose(found) if all(map(math.isfinite, found)) else None


def clamp_jaw(angle: float) -> float:
    """Return the nearest angle of the jaw's joint that may be commanded.

    Raises:
        OutsideLimits: it is not finite.
    """
    return min(max(_finite("gripper", angle), JAW_OPEN), JAW_CLOSED)


def jaw_from_degrees(degrees: float) -> float:
    """Return the angle of the jaw's joint for what an operator says: -30 is open, +30 is closed.

    Raises:
        OutsideLimits: it is not finite.
    """
    share = (degrees - JAW_OPEN_DEG) / (JAW_CLOSED_DEG - JAW_OPEN_DEG)
    return clamp_jaw(JAW_OPEN + share * (JAW_CLOSED - JAW_OPEN))


def jaw_to_degrees(angle: float) -> float:
    """Return what an operator says for an angle of the jaw's joint.

    Raises:
        OutsideLimits: it is not finite.
    """
    share = (clamp_jaw(angle) - JAW_OPEN) / (JAW_CLOSED - JAW_OPEN)
    return JAW_OPEN_DEG + share * (JAW_CLOSED_DEG - JAW_OPEN_DEG)


def farthest(one: Pose, other: Pose) -> float:
    """Return the largest distance of a joint between two poses, in radians."""
    return max(abs(a - b) for a, b in zip(one, other, strict=True))


def _finite(name: str, angle: float) -> float:
    if not math.isfinite(angle):
        raise OutsideLimits(f"{name}: {angle} is not an angle")
    return angle


def _four(angles: Iterable[float]) -> list[float]:
    given = list(angles)
    if len(given) != len(ARM):
        names = ", ".join(joint.name for joint in ARM)
        raise OutsideLimits(f"expected {len(ARM)} angles ({names}), got {len(given)}")
    return given


def _pose(angles: Iterable[float]) -> Pose:
    pan, lift, elbow, wrist = angles
    return pan, lift, elbow, wrist
