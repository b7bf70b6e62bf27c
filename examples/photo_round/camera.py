"""A camera with a light meter and a lamp, as a node: `python camera.py --ros-args -p light:=12.0`.

The photo is a picture of one colour, as bright as it is: a stand-in for a driver of your camera.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from std_msgs.msg import Bool, Float32
from std_srvs.srv import Trigger


class Camera(Node):
    """Tells how light it is, and writes a photo into its folder when asked."""

    def __init__(self) -> None:
        super().__init__("camera")
        self.folder = Path(self.declare_parameter("folder", ".").value)
        self.declare_parameter("light", 200.0)  # lx, as the greenhouse has it; may be set while it runs
        self.lamp = False
        self.photos = 0
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(Bool, "/camera/lamp", self.switch, latched)
        self.create_service(Trigger, "/camera/photo", self.photo)
        self.meter = self.create_publisher(Float32, "/camera/light", qos_profile_sensor_data)
        self.create_timer(0.2, lambda: self.meter.publish(Float32(data=self.light())))

    def light(self) -> float:
        """Return how light it is in front of the lens; the lamp gives 100 lx."""
        return self.get_parameter("light").value + (100.0 if self.lamp else 0.0)

    def switch(self, message: Any) -> None:
        """Switch the lamp."""
        self.lamp = message.data

    def photo(self, _: Any, response: Any) -> Any:
        """Take a photo; the answer is the name of its file."""
        self.photos += 1
        file = self.folder / f"photo{self.photos}.pgm"
        brightness = min(255, round(self.light()))
        try:
            file.write_bytes(b"P5 64 48 255\n" + bytes([brightness]) * (64 * 48))
        except OSError as error:
            response.message = str(error)
            return response
        response.success, response.message = True, file.name
        return response


def main() -> None:
    """Serve until the process is ended."""
    rclpy.init()
    try:
        rclpy.spin(Camera())
    except (KeyboardInterrupt, ExternalShutdownException):
        return


if __name__ == "__main__":
    main()
