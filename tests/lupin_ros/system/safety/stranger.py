"""A stranger on another computer: looks for the service that starts missions, and calls it.

`stranger.py SECONDS` prints what it was answered, or `nobody` when nothing was found within that time.
"""

from __future__ import annotations

import sys
import time
from typing import Any

from lupin_msgs.srv import StartMission
from lupin_ros.adapter.node import RosNode

if __name__ == "__main__":
    ros, answers, end = RosNode("stranger"), [], time.monotonic() + float(sys.argv[1])
    start = ros.service(StartMission, "/mission/start")
    while not start.ready() and time.monotonic() < end:
        ros.spin_once(0.05)
    if start.ready():
        start.call(StartMission.Request(mission_type="InspectionMission"), 20.0, answers.append)
        while not answers:
            ros.spin_once(0.05)
    found: Any = answers[0] if answers else None
    print(getattr(found, "error_message", found) if answers else "nobody")
    ros.close()
