"""The launch description of missions: the nodes to start with their parameters, and the running ones to use.

Pure: the state of the network is an argument. A running node is used and left alone. A simulation is started
only where no server that it replaces is present, and only if a mission may use it.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from lupin_engine.plugin import Catalog, Plugin, name_of, robot_namespace
from lupin_ros.adapter.frames import FRAME_PREFIX
from lupin_ros.launch.nodes import ORCHESTRATOR, LaunchableNode, is_composable, nodes_of

#: Values of ROS parameters by name.
ParameterValues = Mapping[str, Any]
#: The process of the nodes that share one.
COMPOSED = "composed"


@dataclass(frozen=True)
class PresentEndpoints:
    """The endpoints of a robot on the network: nodes, services and actions without its namespace."""

    nodes: frozenset[str] = frozenset()
    services: frozenset[str] = frozenset()
    actions: frozenset[str] = frozenset()

    def offers(self, name: str) -> bool:
        """Say whether a node serves the action or service `name`."""
        full = name if name.startswith("/") else f"/{name}"
        return full in self.actions or full in self.services


@dataclass(frozen=True)
class NodeLaunch:
    """A node to start, with its parameters."""

    node: LaunchableNode
    parameters: ParameterValues = field(default_factory=dict)


@dataclass(frozen=True)
class LaunchDescription:
    """The nodes to start, and those present already, or the servers that a simulation would replace.

    `composed` names the nodes that share a process.
    """

    launches: tuple[NodeLaunch, ...]
    joined: tuple[str, ...] = ()
    composed: frozenset[str] = frozenset()

    @property
    def starts(self) -> tuple[str, ...]:
        """Names of the nodes to start."""
        return tuple(launch.node.name for launch in self.launches)

    @property
    def processes(self) -> Mapping[str, Sequence[NodeLaunch]]:
        """The processes to start by name, in their order, each with its nodes."""
        found: dict[str, list[NodeLaunch]] = {}
        for launch in self.launches:
            name = launch.node.name
            found.setdefault(COMPOSED if name in self.composed else name, []).append(launch)
        return found


def simulators(catalog: Catalog) -> Mapping[str, LaunchableNode]:
    """Return the nodes that simulate a part of the robot."""
    nodes = nodes_of(catalog)
    return {name: nodes[name] for plugin in catalog.plugins.values() for name in plugin.stands_in}


def describe_launch(
    plugins: Iterable[str],
    catalog: Catalog,
    present: PresentEndpoints,
    parameters: Mapping[str, ParameterValues],
    *,
    simulate: bool = True,
    known: Container[str] = (),
) -> LaunchDescription:
    """Decide which nodes to start for missions that use `plugins`.

    Args:
        plugins: names of the plugins that the missions use.
        catalog: all plugins, and the profile of the missions.
        present: the endpoints on the network.
        parameters: by node name; nodes not named get none.
        simulate: whether simulated robots may be started.
        known: names of the parameters that the missions have.
    """
    starting, joined = [], []
    for node in _needed(set(plugins), catalog, simulate):
        there = _already(node, catalog, present)
        if there:
            joined.append(there)
        else:
            starting.append(node)
    given = {
        **parameters,
        ORCHESTRATOR: {**_assumed(starting, catalog, known), **parameters.get(ORCHESTRATOR, {})},
    }
    return LaunchDescription(
        tuple(NodeLaunch(node, given.get(node.name, {})) for node in starting),
        tuple(joined),
    )


def composed(description: LaunchDescription, catalog: Catalog, wanted: bool | None) -> LaunchDescription:
    """Let the nodes that may share a process do so if `wanted`; None: if one of them is simulated."""
    nodes = [launch.node for launch in description.launches]
    if wanted is None:
        wanted = any(node.name in simulators(catalog) for node in nodes)
    names = frozenset(node.name for node in nodes if wanted and is_composable(node, catalog))
    return replace(description, composed=names if len(names) > 1 else frozenset())


def _assumed(starting: Iterable[LaunchableNode], catalog: Catalog, known: Container[str]) -> ParameterValues:
    """Return the defaults that these simulations set for parameters of the missions."""
    simulated = simulators(catalog)
    plugins = [catalog.plugins[node.plugin] for node in starting if node.name in simulated]
    return {name: v for plugin in plugins for name, v in plugin.simulated_defaults.items() if name in known}


def _needed(plugins: set[str], catalog: Catalog, simulate: bool) -> Iterator[LaunchableNode]:
    """Yield simulations first and the orchestrator last, so that it is also the first to be stopped.

    One whose plugin no mission can use directly, such as the robot itself, is there for all missions of its
    profile, and so are companions.
    """
    nodes = nodes_of(catalog)
    stand_ins = simulators(catalog)
    own = [each for each in catalog.plugins.values() if each.profile in ("", catalog.profile.name)]
    robots = {each.name for each in own if not each.client}
    if simulate:
        yield from (n for n in stand_ins.values() if n.plugin in plugins | robots)
    companions = {name for plugin in own for name in plugin.companions}
    wanted = (n for n in nodes.values() if n.plugin in plugins or n.name in companions)
    yield from (n for n in wanted if n.name not in stand_ins)
    yield nodes[ORCHESTRATOR]


def _already(node: LaunchableNode, catalog: Catalog, present: PresentEndpoints) -> str:
    """Return the endpoint that makes this node unnecessary; '' when it must be started."""
    if node.name in present.nodes:
        return node.name
    replaced = _owner(node, catalog).stands_in.get(node.name, ())
    return ", ".join(replaced) if replaced and all(present.offers(name) for name in replaced) else ""


def _owner(node: LaunchableNode, catalog: Catalog) -> Plugin:
    return catalog.plugins.get(node.plugin) or Plugin("engine", "What the engine itself starts.")


def command(launches: Sequence[NodeLaunch], folder: Path, frame_prefix: str = "") -> list[str]:
    """Return the command line of the process of these nodes; parameters are written to files in `folder`."""
    line = [sys.executable, "-m", "lupin_cli.main", "node", *(launch.node.name for launch in launches)]
    files: list[str] = []
    for launch in launches:
        if launch.parameters:
            file = folder / f"{launch.node.name}.yaml"
            name = name_of(robot_namespace(), launch.node.name)
            file.write_text(parameter_file(name, launch.parameters), encoding="utf-8")
            files += ["--params-file", str(file)]
    if frame_prefix:
        files += ["-p", f"{FRAME_PREFIX}:={json.dumps(frame_prefix)}"]
    return [*line, *(["--ros-args", *files] if files else [])]


def parameter_file(node: str, values: ParameterValues) -> str:
    """Return a ROS parameter file; arguments of a command line cannot carry lists, or mark texts."""
    lines = [f"{node}:", "  ros__parameters:"]
    lines += [f"    {name}: {_ros_value(value)}" for name, value in sorted(values.items())]
    return "\n".join(lines) + "\n"


def _ros_value(value: Any) -> str:
    """Write a value so that ROS' own reader of YAML takes it for the same: JSON is YAML, and quotes texts.

    A record of numbers, such as a pose, travels as the list of its fields, other records as a text of JSON.
    """
    if isinstance(value, Mapping) and all(isinstance(each, float) for each in value.values()):
        value = list(value.values())
    elif _has_records(value):
        value = json.dumps(value, ensure_ascii=False)
    return json.dumps(value, ensure_ascii=False)


def _has_records(value: Any) -> bool:
    return isinstance(value, Mapping) or (isinstance(value, list) and any(map(_has_records, value)))
