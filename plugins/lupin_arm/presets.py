"""The built-in presets: named poses of the arm, never of the jaw. Loads without ROS.

Missions use `travel` for driving; it is the rest pose.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from lupin_arm.joints import Pose
from lupin_engine.errors import shortened


def _degrees(pan: float, lift: float, elbow: float, wrist: float) -> Pose:
    return math.radians(pan), math.radians(lift), math.radians(elbow), math.radians(wrist)


#: The least load on the servo of the shoulder: where the arm rests, and how it drives.
_REST = (0.04, -0.01, 0.01, -1.57)
#: Over a plant in front of the robot; only the jaw differs before and after picking.
_PICK = _degrees(1.0, -58.0, -38.0, -2.0)

PRESETS: Mapping[str, Pose] = MappingProxyType(
    {
        "detect_left": _degrees(89.0, 12.0, -62.0, -78.0),
        "home": _REST,
        "inspect": (0.0, -0.40, 0.90, -0.80),
        "pick": (0.0, -0.81, -1.57, -1.04),
        "pick_closed": _PICK,
        "pick_open": _PICK,
        "place": (0.0, -0.23, -1.57, -1.54),
        "travel": _REST,
        "tuck": _degrees(1.0, 0.0, 90.0, -90.0),
        "zero": (0.0, 0.0, 0.0, 0.0),
    }
)


class UnknownPreset(ValueError):
    """The preset is unknown; the text lists the known ones."""


def find_preset(name: str) -> tuple[str, Pose]:
    """Return a preset's own name and pose; surrounding blanks and case are ignored.

    Raises:
        UnknownPreset: there is none.
    """
    wanted = name.strip().lower()
    if wanted not in PRESETS:
        raise UnknownPreset(f"unknown preset {shortened(wanted)!r}; allowed: {', '.join(sorted(PRESETS))}")
    return wanted, PRESETS[wanted]
