"""What was measured of a robot: what drains live values, and which values missions began with."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from lupin_engine.plugin.contract import Operation
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import POSE


@dataclass(frozen=True)
class Drain:
    """What a live value loses with each metre that is driven, and with each minute."""

    value: str
    per_metre: float
    per_minute: float


@dataclass(frozen=True)
class Measured:
    """What was measured of a robot.

    `values` are the live values with which missions began: mocks that report fixed ones report these instead.
    """

    drains: tuple[Drain, ...] = ()
    values: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Metres:
    """A range of distances in metres, its end not included."""

    low: float
    high: float

    def __contains__(self, distance: float | None) -> bool:
        return distance is not None and self.low <= distance < self.high


def is_pose(catalog: Catalog, value: str) -> bool:
    """Say whether a live value is a pose: the robot's."""
    return value in catalog.values and catalog.values[value].type == POSE


def distance_of(operation: Operation, arguments: Mapping[str, Any], pose: Any) -> float | None:
    """Return how far an attempt drives as the crow flies, in metres; None where it goes nowhere.

    Args:
        pose: of the robot at its start; None while it is unknown.
    """
    for name, argument in operation.arguments.items():
        goal = arguments.get(name)
        if argument.type == POSE and goal is not None and pose is not None:
            return math.hypot(goal["x"] - pose["x"], goal["y"] - pose["y"])
    return None
