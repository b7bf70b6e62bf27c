"""The topics of displays such as RViz: the robot's plan, and goals by a click on the map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from geometry_msgs.msg import Point as Position
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseStamped, Quaternion
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import Path

from lupin_engine.plugin import turn_fields
from lupin_ros.adapter import Goal, GoalCallbacks, Qos, RosNode
from lupin_sim.floor import Point


class Display:
    """The topics `/plan` and `/goal_pose`, as real navigation has them."""

    def __init__(self, ros: RosNode) -> None:
        self._ros = ros
        self._plans = ros.publisher(Path, "/plan", Qos.LATCHED)  # a page that is opened on the way shows it
        # As Nav2 does it: a click is a goal like any other, and whoever cancels all goals cancels it too.
        self._navigation = ros.action(NavigateToPose, "navigate_to_pose")
        #: The drive to the last click; it may be over.
        self._clicked: Goal | None = None
        self._stopped = False
        ros.subscribe(PoseStamped, "/goal_pose", Qos.EVENT, self._on_click)

    def publish_plan(self, path: Sequence[Point], yaw: float) -> None:
        """Publish the corners of the remaining path, from the robot on; it ends with heading `yaw`."""
        headings = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(path)]
        message = Path()
        message.header.frame_id = "map"
        message.header.stamp = self._ros.stamp()
        for (x, y), heading in zip(path, [*headings, yaw], strict=True):
            pose = PoseMessage(position=Position(x=x, y=y, z=0.0), orientation=quaternion(heading))
            message.poses.append(PoseStamped(header=message.header, pose=pose))
        self._plans.publish(message)

    def _on_click(self, pose: PoseStamped) -> None:
        place = pose.pose.position
        if self._stopped:
            self._ros.log.warning("a click while the stop is engaged moves nothing")
            return
        self._ros.log.info("driving to where somebody clicked", x=round(place.x, 2), y=round(place.y, 2))
        self._clicked = self._navigation.send(NavigateToPose.Goal(pose=pose), GoalCallbacks())

    def stop(self, engaged: bool) -> None:
        """Take the stop's state: engaged, it cancels the drive to a click; a release moves nothing."""
        self._stopped = engaged
        if engaged and self._clicked is not None:
            self._clicked.abandon()
            self._clicked = None


def quaternion(yaw: float) -> Quaternion:
    """Return the rotation by `yaw` radians about the vertical."""
    return Quaternion(**turn_fields(yaw))


def _nothing(*_: object) -> None:
    """Ignore the result of a clicked goal: the display shows the robot."""
