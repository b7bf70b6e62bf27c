"""What `run` and `up` have in common: from options to the settings of a session."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lupin_engine.cli.settings import of_nodes, of_the_mission, read_settings
from lupin_engine.errors import UsageError, nearest
from lupin_engine.launch.environment import close_the_doors, for_children
from lupin_engine.launch.folders import new_run_folder
from lupin_engine.launch.mission import Loaded
from lupin_engine.launch.nodes import ORCHESTRATOR, nodes_of
from lupin_engine.launch.plan import Values, simulators
from lupin_engine.launch.requirements import prepare_ros
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.registry import Catalog

if TYPE_CHECKING:
    from lupin_engine.launch.session import Settings


@dataclass(frozen=True)
class Wanted:
    """The options that `run` and `up` share, as the command line gives them."""

    settings: tuple[str, ...] = ()
    sim: tuple[str, ...] = ()
    speed: float = 1.0
    no_sim: bool = False
    no_respawn: bool = False
    domain: int | None = None
    log_dir: Path | None = None


def session_settings(
    wanted: Wanted, loaded: Loaded, catalog: Catalog, values: Mapping[str, Any], patience: float | None = None
) -> Settings:
    """Make this process ready for ROS and return how the nodes of checked missions are to be started.

    Raises:
        UsageError: ROS is not there, or a `--sim` or a `--set` of a node is wrong.
    """
    close_the_doors(wanted.domain)
    prepare_ros()
    from lupin_engine.launch.session import Settings  # needs rclpy

    declared = {name: node.parameters() for name, node in nodes_of(catalog).items() if name != ORCHESTRATOR}
    given = _of_simulators(wanted, {name: declared[name] for name in simulators(catalog)})
    for name, values_of_node in _of_nodes(wanted, declared).items():
        given[name] = {**given.get(name, {}), **values_of_node}
    parameters = _parameters(loaded, values, declared, given)
    folder = new_run_folder(wanted.log_dir)
    return Settings(
        folder=folder,
        environment=for_children(folder),
        parameters=parameters,
        known=loaded.chart.parameters,
        insisted=_insisted(wanted, given),
        simulate=not wanted.no_sim,
        settle=bool(wanted.sim),
        patience=patience,
        respawn=not wanted.no_respawn,
    )


def _parameters(
    loaded: Loaded,
    values: Mapping[str, Any],
    declared: Mapping[str, Mapping[str, Parameter]],
    given: Mapping[str, Values],
) -> dict[str, Values]:
    """Return the parameters of the nodes: the mission's for the orchestrator, those given for simulations."""
    found: dict[str, Values] = {ORCHESTRATOR: {**loaded.parameters(), **values}}
    for name, known in declared.items():
        # What several know, such as the layout of the greenhouse, must be the same for all.
        shared = {setting: value for setting, value in values.items() if setting in known}
        found[name] = {**shared, **given.get(name, {})}
    return found


def _of_simulators(wanted: Wanted, declared: Mapping[str, Mapping[str, Parameter]]) -> dict[str, Values]:
    """Return what `--sim` and `--speed` say of each simulation that has such a parameter."""
    together = {name: spec for known in declared.values() for name, spec in known.items()}
    given = {**_faster(wanted.speed, together), **read_settings("--sim", wanted.sim, together)}
    return {
        simulator: {name: value for name, value in given.items() if name in known}
        for simulator, known in declared.items()
    }


def _of_nodes(wanted: Wanted, declared: Mapping[str, Mapping[str, Parameter]]) -> dict[str, Values]:
    """Return what `--set NODE.NAME=VALUE` says, by node."""
    found = of_nodes(wanted.settings)
    for name, given in found.items():
        if name == ORCHESTRATOR:
            raise UsageError(f"--set: parameters of the mission go without a node: write --set {given[0]!r}")
        if name not in declared:
            raise UsageError(f"--set: unknown node {name!r}; {nearest(name, declared)}")
    return {name: read_settings("--set", given, declared[name], name) for name, given in found.items()}


def _faster(speed: float, declared: Mapping[str, Parameter]) -> dict[str, Any]:
    """Return the speed of a simulated robot that is so many times as fast as usual."""
    spec = declared.get("speed")
    return {"speed": spec.default * speed} if spec is not None and speed != 1.0 else {}


def _insisted(wanted: Wanted, given: Mapping[str, Values]) -> dict[str, str]:
    """Name the nodes that must be ours, because an option sets something of theirs, with that option."""
    found = {ORCHESTRATOR: "--set"} if of_the_mission(wanted.settings) else {}
    option = "--sim" if wanted.sim else "--speed"
    simulated = {simulator: option for simulator, values in given.items() if values}
    return {**found, **simulated, **dict.fromkeys(of_nodes(wanted.settings), "--set")}
