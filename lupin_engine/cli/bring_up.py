"""What `run` and `up` have in common: from options to the settings of a session."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lupin_engine.cli.settings import read_settings
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
        UsageError: ROS is not there, or a `--sim` is wrong.
    """
    close_the_doors(wanted.domain)
    prepare_ros()
    from lupin_engine.launch.session import Settings  # needs rclpy

    parameters = _parameters(wanted, loaded, catalog, values)
    folder = new_run_folder(wanted.log_dir)
    return Settings(
        folder=folder,
        environment=for_children(folder),
        parameters=parameters,
        insisted=_insisted(wanted, catalog),
        simulate=not wanted.no_sim,
        settle=bool(wanted.sim),
        patience=patience,
        respawn=not wanted.no_respawn,
    )


def _parameters(
    wanted: Wanted, loaded: Loaded, catalog: Catalog, values: Mapping[str, Any]
) -> dict[str, Values]:
    """Return the parameters of the nodes: the mission's for the orchestrator, --sim for the robot."""
    found: dict[str, Values] = {ORCHESTRATOR: {**loaded.parameters(), **values}}
    simulated = simulators(catalog)
    for name, node in nodes_of(catalog).items():
        if name == ORCHESTRATOR:
            continue
        declared = node.parameters()
        # What several know, such as the layout of the greenhouse, must be the same for all.
        found[name] = {shared: value for shared, value in values.items() if shared in declared}
        if name in simulated:
            given = read_settings("--sim", wanted.sim, declared)
            found[name] = {**found[name], **_faster(wanted.speed, declared), **given}
    return found


def _faster(speed: float, declared: Mapping[str, Parameter]) -> dict[str, Any]:
    """Return the speed of a simulated robot that is so many times as fast as usual."""
    spec = declared.get("speed")
    return {"speed": spec.default * speed} if spec is not None and speed != 1.0 else {}


def _insisted(wanted: Wanted, catalog: Catalog) -> dict[str, str]:
    """Name the nodes that must be ours, because an option sets something of theirs, with that option."""
    found = {ORCHESTRATOR: "--set"} if wanted.settings else {}
    if wanted.sim or wanted.speed != 1.0:
        found.update(dict.fromkeys(simulators(catalog), "--sim" if wanted.sim else "--speed"))
    return found
