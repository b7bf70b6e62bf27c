"""Starts the nodes of Lupin: ros2 launch lupin_engine robot.launch.py robot:=robot2

It was made by tools/launch_files.py from what `lupin up` starts, and not run: ROS 2's launch was not there.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

NODES = [
    "lupin_arm",
    "greenhouse_bridge",
    "nav_watchdog",
    "perception_aggregator",
    "lupin_twin",
    "mission_orchestrator",
]
PARAMETERS = PathJoinSubstitution([FindPackageShare("lupin_engine"), "config", "parameters.yaml"])


def generate_launch_description():
    arguments = [
        DeclareLaunchArgument(
            "robot",
            default_value="",
            description="namespace of the robot; empty: its names are those of the reference",
        ),
        DeclareLaunchArgument(
            "parameters",
            default_value=PARAMETERS,
            description="parameters of the nodes",
        ),
        DeclareLaunchArgument(
            "log_level",
            default_value="info",
            description="level of the nodes' logs",
        ),
    ]
    nodes = [
        Node(
            package="lupin_engine",
            executable=name,
            name=name,
            namespace=LaunchConfiguration("robot"),
            output="screen",
            respawn=True,
            respawn_delay=1.0,
            ros_arguments=["--log-level", LaunchConfiguration("log_level")],
            parameters=[LaunchConfiguration("parameters")],
        )
        for name in NODES
    ]
    return LaunchDescription([*arguments, *nodes])
