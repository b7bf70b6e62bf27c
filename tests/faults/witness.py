"""A bystander beside the robot: writes where it is, and when the computer did not let anybody work.

`witness.py FILE`: lines of `SECONDS X Y`, of the monotonic clock, which all computers of a test share; a line
of `SECONDS` alone ten times a second.
"""

from __future__ import annotations

import sys
import time

from tf2_msgs.msg import TFMessage

from lupin_ros.adapter.node import Qos, RosNode
from lupin_ros.adapter.process import end_with_supervisor

#: Seconds between two lines without a place.
PULSE_S = 0.1


def main() -> None:
    """Write until the node is told to end."""
    end_with_supervisor()
    with RosNode("witness") as ros, open(sys.argv[1], "a", buffering=1) as file:

        def on_transforms(message: TFMessage) -> None:
            for found in message.transforms:
                if found.child_frame_id == "base_link":
                    place = found.transform.translation
                    file.write(f"{time.monotonic():.3f} {place.x:.3f} {place.y:.3f}\n")

        ros.subscribe(TFMessage, "/tf", Qos.TRANSFORMS, on_transforms)
        ros.steady_timer(PULSE_S, lambda: file.write(f"{time.monotonic():.3f}\n") and None)
        ros.spin()


if __name__ == "__main__":
    main()
