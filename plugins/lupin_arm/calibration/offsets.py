"""Computes a servo's new offset from its position and its present offset, and refuses implausible ones.

Positions are in counts of 1/100 degree: the limits measured on the robot are (count - home) / 100 degrees.
Offsets are in 1/100 degree as well, so both add up directly. The servo stores an offset as -125 to 125 steps
of 24/100 degree, so none exceeds 30 degrees; older programs' numbers 24 and 125 are these, not a tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

#: Counts at which a servo stands when its joint is at zero. The pan servo's is not trusted.
HOMES: Mapping[str, int] = {
    "shoulder_lift": 11450,
    "elbow": 11750,
    "wrist": 12200,
    "gripper": 10524,
}
#: Hundredths of a degree in a step of the servo's own offset, and how many of those it can hold.
STEP, STEPS = 24, 125
#: The largest offset that a servo can hold, in radians.
HIGHEST = math.radians(STEP * STEPS / 100)
#: Smaller changes of an offset are not written, in hundredths of a degree.
SMALL = 200


@dataclass(frozen=True)
class Correction:
    """The correction of a servo.

    `difference` is its distance from home in 1/100 degree plus its present offset: the offset that it needs.
    `refused` says why it is not written; '' where it is, or where the servo is `in_place` already.
    """

    joint: str
    difference: int
    in_place: bool = False
    refused: str = ""


def corrections(counts: Mapping[str, int], offsets: Mapping[str, int], largest: float) -> list[Correction]:
    """Return the correction of each servo at its position in `counts`.

    It is refused where the offset is unknown or would be too large; a change of up to `SMALL` is not made.

    Args:
        counts: the position of every servo while its joint is held at zero.
        offsets: the present offset of every servo; one that could not be read is missing.
        largest: the largest offset that may be written, in radians.
    """
    return [_correction(joint, counts[joint], offsets.get(joint), largest) for joint in HOMES]


def _correction(joint: str, count: int, offset: int | None, largest: float) -> Correction:
    difference = count - HOMES[joint] + (offset or 0)
    if offset is None:
        return Correction(joint, difference, refused="its offset could not be read")
    if abs(difference) <= SMALL:
        return Correction(joint, difference, in_place=True)
    highest = math.degrees(min(largest, HIGHEST))
    if abs(difference) > round(highest * 100):
        wrong = f"it is off by {difference / 100:.1f} deg, more than {highest:.1f} deg: mount its horn anew"
        return Correction(joint, difference, refused=wrong)
    return Correction(joint, difference)


def to_write(found: Iterable[Correction], before: Mapping[str, int]) -> dict[str, int]:
    """Return the offsets to write: new ones, and the old offset of a servo that is not corrected."""
    moved = (one for one in found if not one.in_place)
    return {one.joint: before.get(one.joint, 0) if one.refused else one.difference for one in moved}


def refusals(found: Iterable[Correction]) -> str:
    """Return which servos cannot be corrected and why; '' when all can."""
    return "; ".join(f"{one.joint}: {one.refused}" for one in found if one.refused)
