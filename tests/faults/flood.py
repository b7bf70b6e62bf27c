"""Somebody in the robot's network who floods it: starts of missions that nobody knows, and poses of no place.

`flood.py SECONDS`.
"""

from __future__ import annotations

import math
import sys
import time
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from std_msgs.msg import Bool

from lupin_msgs.srv import StartMission
from lupin_ros.adapter.node import Qos, RosNode

#: So many requests wait for their answers; more of them would only fill the flood's own queues.
UNDER_WAY = 200


def main() -> None:
    """Flood for so many seconds."""
    with RosNode("flood") as ros:
        start = ros.service(StartMission, "/mission/start")
        poses = ros.publisher(PoseWithCovarianceStamped, "/amcl_pose", Qos.LATCHED)
        buttons = ros.publisher(Bool, "/e_stop_state", Qos.EVENT)
        nowhere = PoseWithCovarianceStamped()
        nowhere.header.frame_id = "map"
        nowhere.pose.pose.position.x = math.nan
        asked = StartMission.Request(mission_type="x" * 5000, tag_sequence=["y" * 500] * 20)
        answered: list[Any] = []
        sent, end = 0, time.monotonic() + float(sys.argv[1])
        while time.monotonic() < end:
            if sent - len(answered) < UNDER_WAY and start.ready():
                start.call(asked, 5.0, answered.append)
                sent += 1
            poses.publish(nowhere)
            buttons.publish(Bool(data=False))
            ros.spin_once(0.0)
        print(f"{sent} requests, {len(answered)} answers")


if __name__ == "__main__":
    main()
