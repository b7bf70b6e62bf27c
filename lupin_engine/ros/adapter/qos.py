"""The quality-of-service profiles of the system: declared once, so that two ends cannot disagree.

A TRANSIENT_LOCAL subscriber never matches a VOLATILE publisher, and says nothing about it; that is why a
topic is created with one of these names and never with a profile of its own.
"""

from __future__ import annotations

import enum

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

#: Requests kept per service. The default of 10 is shared by all clients and loses the rest silently.
SERVICE_DEPTH = 1000


class Qos(enum.Enum):
    """Names of the profiles; `profile()` is what rclpy wants."""

    LATCHED = "latched"  #: reliable, transient local, depth 1: a state that late joiners must see
    BACKLOG = "backlog"  #: reliable, transient local, depth 50: observations
    EVENT = "event"  #: reliable, volatile, depth 10: a button, a charge
    DETECTION = "detection"  #: reliable, volatile, depth 5: detections, joint states
    SENSOR = "sensor"  #: best effort, volatile, depth 5: camera images
    TRANSFORMS = "transforms"  #: reliable, volatile, depth 100: /tf, many small messages of many publishers
    STATIC_TRANSFORMS = "static transforms"  #: reliable, transient local, depth 100: /tf_static
    SERVICES = "services"  #: reliable, volatile, depth 1000: service requests and answers

    def profile(self) -> QoSProfile:
        """Return a fresh rclpy profile."""
        reliable, latched, depth = _PROFILES[self]
        return QoSProfile(
            history=HistoryPolicy.KEEP_LAST,
            depth=depth,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )


#: profile -> (reliable, transient local, depth)
_PROFILES = {
    Qos.LATCHED: (True, True, 1),
    Qos.BACKLOG: (True, True, 50),
    Qos.EVENT: (True, False, 10),
    Qos.DETECTION: (True, False, 5),
    Qos.SENSOR: (False, False, 5),
    Qos.TRANSFORMS: (True, False, 100),
    Qos.STATIC_TRANSFORMS: (True, True, 100),
    Qos.SERVICES: (True, False, SERVICE_DEPTH),
}
