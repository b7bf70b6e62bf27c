"""The joints of the arm and its jaw: names, limits, units, clamping. Loads without ROS.

Angles are radians. A servo silently ignores an angle beyond its limits, so only angles in the command window
are sent: the part of the servo's range within a quarter turn, in whole degrees.
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
    """An angle that must not be sent; the text names joint, angle and limits."""


@dataclass(frozen=True)
class Joint:
    """One joint: its name in services, its command window and its servo's range in degrees."""

    name: str
    window_deg: tuple[float, float]
    servo_deg: tuple[float, float]

    @property
    def state_name(self) -> str:
        """The joint's name in `/joint_states` and trajectories."""
        return f"{self.name}_joint"

    @property
    def low(self) -> float:
        """The smallest angle of the command window."""
        return math.radians(self.window_deg[0])

    @property
    def high(self) -> float:
        """The largest angle of the command window."""
        return math.radians(self.window_deg[1])

    def reach(self, angle: float) -> float:
        """Clamp an angle to the servo's range."""
        low, high = self.servo_deg
        return min(max(angle, math.radians(low)), math.radians(high))

    def clamp(self, angle: float) -> float:
        """Clamp an angle to the command window.

        Raises:
            OutsideLimits: it is not finite.
        """
        return min(max(_finite(self.name, angle), self.low), self.high)

    def check(self, angle: float) -> None:
        """Check that an angle is in the command window.

        Raises:
            OutsideLimits: it is not, or is no number.
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
    """Return four angles, each clamped to its command window.

    Raises:
        OutsideLimits: there are not four, or one is not finite.
    """
    return _pose(joint.clamp(angle) for joint, angle in zip(ARM, _four(angles), strict=True))


def check_pose(angles: Iterable[float]) -> Pose:
    """Return four angles unchanged, after checking each against its command window.

    Raises:
        OutsideLimits: there are not four, or one is outside.
    """
    given = _four(angles)
    for joint, angle in zip(ARM, given, strict=True):
        joint.check(angle)
    return _pose(given)


def reach_pose(pose: Pose) -> Pose:
    """Return a measured pose clamped to the servos' ranges: a reading may be slightly outside."""
    return _pose(joint.reach(angle) for joint, angle in zip(ARM, pose, strict=True))


def read_pose(positions: Mapping[str, float]) -> Pose | None:
    """Return the arm's angles from those of `/joint_states`; None unless all four are given."""
    found = [positions.get(joint.state_name, math.nan) for joint in ARM]
    return _pose(found) if all(map(math.isfinite, found)) else None


def clamp_jaw(angle: float) -> float:
    """Clamp an angle of the jaw's joint.

    Raises:
        OutsideLimits: it is not finite.
    """
    return min(max(_finite("gripper", angle), JAW_OPEN), JAW_CLOSED)


def jaw_from_degrees(degrees: float) -> float:
    """Convert an operator's degrees (-30 open, +30 closed) to the jaw's joint angle, clamped.

    Raises:
        OutsideLimits: it is not finite.
    """
    share = (degrees - JAW_OPEN_DEG) / (JAW_CLOSED_DEG - JAW_OPEN_DEG)
    return clamp_jaw(JAW_OPEN + share * (JAW_CLOSED - JAW_OPEN))


def jaw_to_degrees(angle: float) -> float:
    """Convert the jaw's joint angle to an operator's degrees.

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
