"""A tray that always says yes: it stands for the service of your robot."""

import contextlib

import rclpy
from rclpy.executors import ExternalShutdownException
from std_srvs.srv import Trigger


def unload(_: Trigger.Request, answer: Trigger.Response) -> Trigger.Response:
    answer.success, answer.message = True, "one parcel less"
    return answer


rclpy.init()
node = rclpy.create_node("tray")
node.create_service(Trigger, "/tray/unload", unload)
with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(node)
