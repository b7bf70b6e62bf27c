"""Writes the launch files of ros_package/ from what `lupin up` starts: one declaration for two launchers.

python tools/launch_files.py ros_package
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from lupin_engine.plugin import load_catalog
from lupin_ros.launch import PresentEndpoints, describe_launch

#: The arguments of a launch: name, default, and what it is.
ARGUMENTS = (
    ("robot", "", "namespace of the robot; empty: its names are those of the reference"),
    (
        "parameters",
        "$(find-pkg-share lupin_engine)/config/parameters.yaml",
        "parameters of the nodes",
    ),
    ("log_level", "info", "level of the nodes' logs"),
)
PACKAGE = "lupin_engine"
#: As `lupin up`: a node that has died comes back, after seconds.
RESPAWN_DELAY = 1.0
KINDS = {"robot": False, "simulation": True}
MADE = "made by tools/launch_files.py from what `lupin up` starts, and not run: ROS 2's launch was not there"


def nodes(simulated: bool) -> list[str]:
    """Return the nodes of all plugins that missions of the greenhouse may use, in the order of starting."""
    catalog = load_catalog().with_profile("greenhouse")
    clients = [name for name, plugin in catalog.plugins.items() if plugin.client]
    found = describe_launch(clients, catalog, PresentEndpoints(), {}, simulate=simulated)
    return list(found.starts)


def yaml_file(kind: str) -> Iterator[str]:
    """Yield the lines of a launch file in YAML."""
    yield f"# {MADE}."
    yield f"# ros2 launch {PACKAGE} {kind}.launch.yaml robot:=robot2"
    yield "launch:"
    for name, default, about in ARGUMENTS:
        yield f'  - arg: {{name: {name}, default: "{default}", description: "{about}"}}'
    for node in nodes(KINDS[kind]):
        yield "  - node:"
        yield f"      pkg: {PACKAGE}"
        yield f"      exec: {node}"
        yield f"      name: {node}"
        yield "      namespace: $(var robot)"
        yield "      output: screen"
        yield "      respawn: true"
        yield f"      respawn_delay: {RESPAWN_DELAY}"
        yield "      ros_args: --log-level $(var log_level)"
        yield "      param: [{from: $(var parameters)}]"


def python_file(kind: str) -> Iterator[str]:
    """Yield the lines of a launch file in Python."""
    yield f'"""Starts the nodes of Lupin: ros2 launch {PACKAGE} {kind}.launch.py robot:=robot2'
    yield ""
    yield f"It was {MADE}."
    yield '"""'
    yield ""
    yield "from launch import LaunchDescription"
    yield "from launch.actions import DeclareLaunchArgument"
    yield "from launch.substitutions import LaunchConfiguration, PathJoinSubstitution"
    yield "from launch_ros.actions import Node"
    yield "from launch_ros.substitutions import FindPackageShare"
    yield ""
    yield "NODES = ["
    yield from (f'    "{node}",' for node in nodes(KINDS[kind]))
    yield "]"
    yield f'PARAMETERS = PathJoinSubstitution([FindPackageShare("{PACKAGE}"), "config", "parameters.yaml"])'
    yield ""
    yield ""
    yield "def generate_launch_description():"
    yield "    arguments = ["
    for name, default, about in ARGUMENTS:
        shown = "PARAMETERS" if name == "parameters" else f'"{default}"'
        yield "        DeclareLaunchArgument("
        yield f'            "{name}",'
        yield f"            default_value={shown},"
        yield f'            description="{about}",'
        yield "        ),"
    yield "    ]"
    yield "    nodes = ["
    yield "        Node("
    yield f'            package="{PACKAGE}",'
    yield "            executable=name,"
    yield "            name=name,"
    yield '            namespace=LaunchConfiguration("robot"),'
    yield '            output="screen",'
    yield "            respawn=True,"
    yield f"            respawn_delay={RESPAWN_DELAY},"
    yield '            ros_arguments=["--log-level", LaunchConfiguration("log_level")],'
    yield '            parameters=[LaunchConfiguration("parameters")],'
    yield "        )"
    yield "        for name in NODES"
    yield "    ]"
    yield "    return LaunchDescription([*arguments, *nodes])"


def files() -> dict[str, str]:
    """Return the files by name."""
    made = {f"{kind}.launch.yaml": yaml_file(kind) for kind in KINDS}
    made |= {f"{kind}.launch.py": python_file(kind) for kind in KINDS}
    texts = {name: "\n".join(lines) + "\n" for name, lines in made.items()}
    every = dict.fromkeys(name for simulated in KINDS.values() for name in nodes(simulated))
    return {**texts, "nodes.txt": "\n".join(every) + "\n"}


if __name__ == "__main__":
    for file, text in files().items():
        (Path(sys.argv[1]) / file).write_text(text, encoding="utf-8")
