"""Turns the options of `run` and `up` into the settings of a bringup, with all their problems at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lupin_cli.run_folders import new_run_folder, writable
from lupin_cli.settings import of_nodes, of_the_mission, settings_in
from lupin_engine.errors import LupinError, PluginError, Problems, UsageError, nearest
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import Catalog, Parameter
from lupin_ros.launch import (
    ORCHESTRATOR,
    LaunchableNode,
    NodeLaunch,
    ParameterValues,
    PresentEndpoints,
    close_the_doors,
    describe_launch,
    for_children,
    nodes_of,
    prepare_ros,
    simulators,
)

if TYPE_CHECKING:
    from lupin_ros.launch import BringupSettings


@dataclass(frozen=True)
class GivenOptions:
    """The options that `run` and `up` share, as the command line gives them."""

    settings: tuple[str, ...] = ()
    sim: tuple[str, ...] = ()
    speed: float = 1.0
    no_sim: bool = False
    no_respawn: bool = False
    compose: bool | None = None
    hmi: bool = False
    opened: bool = False
    domain: int | None = None
    frame_prefix: str = ""
    log_dir: Path | None = None


class CheckedOptions:
    """The options of `run` and `up`, checked against the declarations of missions and nodes.

    `problems` collects all errors; `values` are the valid values of the missions' parameters.
    """

    def __init__(self, wanted: GivenOptions, loaded: LoadedMissions, catalog: Catalog) -> None:
        self.problems = Problems(UsageError)
        self._wanted = wanted
        self._loaded = loaded
        self._catalog = catalog
        given = of_the_mission(wanted.settings)
        self.values = self._read("--set", given, loaded.chart.parameters)

    @property
    def plugins(self) -> tuple[str, ...]:
        """The plugins whose nodes are wanted: those that the missions use, and those that serve pages."""
        pages = [name for name, plugin in self._catalog.plugins.items() if plugin.hmi]
        return (*self._loaded.plugins, *(pages if self._wanted.hmi else ()))

    def addresses(self, launches: Iterable[NodeLaunch]) -> list[str]:
        """Return where people find the pages that nodes serve, in words, one line each."""
        lines: list[str] = []
        for launch in launches:
            if launch.node.plugin and self._catalog.plugins[launch.node.plugin].hmi:
                known = self._declared[launch.node.name]
                values = {name: spec.default for name, spec in known.items()} | dict(launch.parameters)
                lines += launch.node.addresses(values)
        return lines

    def settings(self, patience: float | None = None) -> BringupSettings:
        """Prepare this process for ROS and return the settings with which the nodes are started.

        Raises:
            UsageError: ROS is missing, or an option is wrong; the text has all collected problems.
        """
        self._look_at_the_surroundings()
        if self._wanted.opened and not self._wanted.hmi:
            self.problems.add("--open: nothing is served that could be opened; add --hmi")
        if self._wanted.hmi and not any(plugin.hmi for plugin in self._catalog.plugins.values()):
            self.problems.add("--hmi: none of the installed plugins serves pages")
        # Importing the nodes takes ROS and a second, so only where their parameters are given.
        wanted = self._wanted
        if self.problems and not (wanted.sim or wanted.opened or of_nodes(wanted.settings)):
            self.problems.raise_any()
        with self.problems.collecting():
            given = self._given()
            parameters = self._parameters(given)
            self._check_nodes(parameters, given)
        self.problems.raise_any()
        from lupin_ros.launch import BringupSettings  # needs rclpy

        folder = new_run_folder(self._wanted.log_dir)
        return BringupSettings(
            profile=self._loaded.chart.profile,
            folder=folder,
            environment=for_children(folder),
            parameters=parameters,
            known=self._loaded.chart.parameters,
            insisted=self._insisted(given),
            simulate=not self._wanted.no_sim,
            settle=bool(self._wanted.sim),
            patience=patience,
            respawn=not self._wanted.no_respawn,
            compose=self._wanted.compose,
            frame_prefix=self._wanted.frame_prefix,
        )

    def _look_at_the_surroundings(self) -> None:
        with self.problems.collecting():
            close_the_doors(self._wanted.domain)
        with self.problems.collecting():
            if self._wanted.log_dir is not None:
                writable(self._wanted.log_dir)

    # -- what nodes are given -----------------------------------------------------------------------------

    @cached_property
    def _declared(self) -> Mapping[str, Mapping[str, Parameter]]:
        """The parameters of every node but the orchestrator, whose are those of the missions.

        Nodes that serve pages are left out unless they are asked for: importing them takes long. Nodes that
        cannot be loaded, such as those whose messages are missing, are left to `_check_nodes`.
        """
        return self._parameters_of(self._wants)

    def _wants(self, node: LaunchableNode) -> bool:
        is_page = self._catalog.plugins[node.plugin].hmi
        return not is_page or self._wanted.hmi or node.name in of_nodes(self._wanted.settings)

    def _parameters_of(
        self, which: Callable[[LaunchableNode], bool]
    ) -> Mapping[str, Mapping[str, Parameter]]:
        prepare_ros()
        found = {}
        for name, node in nodes_of(self._catalog).items():
            if name == ORCHESTRATOR or not which(node):
                continue
            try:
                found[name] = node.parameters()
            except PluginError as problem:
                if self._catalog.plugins[node.plugin].hmi and self._wants(node):
                    raise UsageError(f"{problem}; pages need `pip install 'lupin-engine[hmi]'`") from problem
        return found

    @cached_property
    def _own(self) -> Mapping[str, Parameter]:
        """The orchestrator's own parameters, which are not the missions'."""
        prepare_ros()
        from lupin_ros.orchestrator import OWN_PARAMETERS

        return OWN_PARAMETERS

    def _read(
        self, option: str, given: Iterable[str], declared: Mapping[str, Parameter], node: str = ""
    ) -> dict[str, Any]:
        values, wrong = settings_in(option, given, declared, node, self._elsewhere)
        self.problems.add(*wrong)
        return values

    def _elsewhere(self, name: str) -> str:
        """Return how to give a parameter that belongs to another node; '' where no node has it."""
        if name in self._loaded.chart.parameters:
            return f"it belongs to the mission: write --set {name}=VALUE"
        try:
            owners = [node for node, known in self._parameters_of(lambda _: True).items() if name in known]
            owners += [ORCHESTRATOR] * (name in self._own)
        except LupinError:
            return ""  # without ROS only the parameters of missions are known
        written = " or ".join(f"--set {node}.{name}=VALUE" for node in owners)
        return f"it belongs to {' and '.join(owners)}: write {written}" if owners else ""

    def _given(self) -> dict[str, ParameterValues]:
        """Return the parameters that options give, by node."""
        found: dict[str, ParameterValues] = self._of_simulators()
        for name, values in (*self._of_pages().items(), *self._of_nodes().items()):
            found[name] = {**found.get(name, {}), **values}
        return found

    def _of_pages(self) -> dict[str, ParameterValues]:
        """Return the parameters that `--open` sets, for each node that serves pages and can be opened."""
        if not (self._wanted.opened and self._wanted.hmi):
            return {}
        pages = [name for plugin in self._catalog.plugins.values() if plugin.hmi for name in plugin.nodes]
        return {name: {"open": True} for name in pages if "open" in self._declared[name]}

    def _of_simulators(self) -> dict[str, ParameterValues]:
        """Return the parameters that `--sim` and `--speed` set, for each simulation that has them."""
        declared = {name: self._declared.get(name, {}) for name in simulators(self._catalog)}
        together = {name: spec for known in declared.values() for name, spec in known.items()}
        given = {**_faster(self._wanted.speed, together), **self._read("--sim", self._wanted.sim, together)}
        return {
            simulator: {name: value for name, value in given.items() if name in known}
            for simulator, known in declared.items()
        }

    def _of_nodes(self) -> dict[str, ParameterValues]:
        """Return the parameters that `--set NODE.NAME=VALUE` sets, by node."""
        found: dict[str, ParameterValues] = {}
        for name, given in of_nodes(self._wanted.settings).items():
            if name in self._declared:
                found[name] = self._read("--set", given, self._declared[name], name)
            elif name == ORCHESTRATOR:
                own = [setting for setting in given if setting.partition("=")[0].strip() in self._own]
                found[name] = self._read("--set", own, self._own, name)
                hints = " ".join(f"--set {setting!r}" for setting in given if setting not in own)
                if hints:
                    self.problems.add(f"--set: parameters of the mission go without a node: write {hints}")
            elif name in nodes_of(self._catalog):
                nodes_of(self._catalog)[name].load()  # which says why it cannot be loaded
            else:
                self.problems.add(f"--set: unknown node {name!r}; {nearest(name, nodes_of(self._catalog))}")
        return found

    def _parameters(self, given: Mapping[str, ParameterValues]) -> dict[str, ParameterValues]:
        """Return the parameters of the nodes: the mission's for the orchestrator, and those given."""
        missions = {**self._loaded.parameters(), **self.values}
        found: dict[str, ParameterValues] = {ORCHESTRATOR: {**missions, **given.get(ORCHESTRATOR, {})}}
        for name, known in self._declared.items():
            # What several know, such as a map or the missions' folder, must be the same for all.
            shared = {setting: value for setting, value in missions.items() if setting in known}
            found[name] = {**shared, **given.get(name, {})}
        return found

    # -- what would keep them from starting ---------------------------------------------------------------

    def _check_nodes(
        self, parameters: Mapping[str, ParameterValues], given: Mapping[str, ParameterValues]
    ) -> None:
        """Check that the nodes with given parameters are started at all, and accept them."""
        simulate = not self._wanted.no_sim
        alone = describe_launch(
            self.plugins, self._catalog, PresentEndpoints(), parameters, simulate=simulate
        )
        for name, option in self._insisted(given).items():
            if name not in alone.starts:
                self.problems.add(f"{option} is for {name}, which {self._why_not(name)}")
        for launch in alone.launches:
            known = self._declared.get(launch.node.name, {})
            with self.problems.collecting():
                if launch.node.name not in (ORCHESTRATOR, *self._declared):
                    launch.node.load()  # which says why it cannot be loaded
                if launch.parameters and known:
                    defaults = {name: spec.default for name, spec in known.items()}
                    launch.node.check({**defaults, **launch.parameters})

    def _why_not(self, name: str) -> str:
        if self._wanted.no_sim and name in simulators(self._catalog):
            return "--no-sim leaves out"
        node = nodes_of(self._catalog).get(name)
        if node is not None and node.plugin and self._catalog.plugins[node.plugin].hmi:
            return "only --hmi starts"
        return f"{', '.join(self._loaded.names)} has no use for"

    def _insisted(self, given: Mapping[str, ParameterValues]) -> dict[str, str]:
        """Return the nodes that must be ours, each with the option that sets a parameter of it."""
        found = {ORCHESTRATOR: "--set"} if of_the_mission(self._wanted.settings) else {}
        option = "--sim" if self._wanted.sim else "--speed"
        simulated = {name: option for name in simulators(self._catalog) if given.get(name)}
        named = [name for name in of_nodes(self._wanted.settings) if name in self._declared]
        return {**found, **simulated, **dict.fromkeys(named, "--set")}


def _faster(speed: float, declared: Mapping[str, Parameter]) -> dict[str, Any]:
    """Return the parameter `speed` of a simulated robot, as a multiple of its default."""
    spec = declared.get("speed")
    return {"speed": spec.default * speed} if spec is not None and speed != 1.0 else {}
