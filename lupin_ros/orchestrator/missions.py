"""The missions that run: they come and go with their files, and with the values of their parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lupin_engine.errors import LupinError
from lupin_engine.machine import UNKNOWN_MISSION, Machine, Step, is_idle, successor
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import NUMBER, TEXT, Parameter, list_of
from lupin_engine.properties import LiveMonitor
from lupin_engine.runtime import make_world
from lupin_ros.adapter.node import RosNode
from lupin_ros.orchestrator.clients import PluginClients
from lupin_ros.orchestrator.journal_gate import JOURNAL_PARAMETERS, JournalGate
from lupin_ros.orchestrator.loop import Loop
from lupin_ros.orchestrator.records import LOG_PARAMETERS, RecordPublisher
from lupin_ros.orchestrator.recovery import RESUME_PARAMETERS
from lupin_ros.service.folder import FolderWatch, MissionsFolder

#: Parameters of the node itself, beside those of the missions.
OWN_PARAMETERS: Mapping[str, Parameter] = {
    "missions": Parameter(
        list_of(TEXT), [], "missions to offer, beside those added later; none: all there are"
    ),
    "missions_path": Parameter(
        TEXT, "", "folder of the missions, or a bundle; empty: the ones that come with the engine"
    ),
    "require_signed": Parameter(
        TEXT, "", "public key, or folder of some: only a bundle that one of them has signed is taken"
    ),
    "allow_bundles": Parameter(
        list_of(TEXT),
        [],
        "signed bundles that are taken although a newer one, or only others, of their key were run here: "
        "NAME, NAME@VERSION, or unnamed",
    ),
    "state_publish_rate_hz": Parameter(NUMBER, 5.0, "how often the state is repeated, in Hz", minimum=0.1),
    "mission_id_prefix": Parameter(TEXT, "lupin", "what mission ids begin with"),
    **JOURNAL_PARAMETERS,
    **RESUME_PARAMETERS,
    **LOG_PARAMETERS,
}


class MissionSwitch:
    """Switches the loop to other missions or values, while no mission is under way."""

    def __init__(
        self,
        ros: RosNode,
        folder: MissionsFolder,
        loop: Loop,
        records: RecordPublisher,
        gate: JournalGate,
        clients: PluginClients,
    ) -> None:
        self._ros = ros
        self._folder = folder
        self._loop = loop
        self._records = records
        self._gate = gate
        self._clients = clients
        self._watch = FolderWatch(folder, ros)
        #: The machine for new parameter values, until ROS has stored them.
        self._prepared: Machine | None = None
        ros.on_parameter(self._prepare_parameters, self._adopt_parameters)

    def close(self) -> None:
        """Look at no file any more."""
        self._watch.close()

    def look(self, then: Callable[[LoadedMissions | None], None]) -> None:
        """Look at the files as they are now; `then` gets what is to be adopted, on the node's thread."""
        self._watch.look(self._loop.loaded, then)

    def adopt(self, loaded: LoadedMissions | None) -> None:
        """Adopt changed missions, unless one has begun meanwhile; where that fails the old ones stay."""
        if not is_idle(self._loop.machine):
            return
        if loaded is not None and loaded.chart is not self._loop.chart:
            try:
                self._switch_chart(loaded)
                self._ros.log.info("missions loaded anew", missions=list(loaded.chart.missions))
            except LupinError as problem:
                self._folder.refuse(loaded, str(problem))
            except Exception as problem:  # the client of a new plugin may raise anything
                self._ros.log.exception("missions could not be loaded anew")
                self._folder.refuse(loaded, f"{type(problem).__name__}: {problem}")
        self.publish()

    def why_unknown(self, step: Step) -> str:
        """Return the problem of the missions' files where a step refused an unknown mission; else ''."""
        is_unknown = step.refusal is not None and step.refusal.code == UNKNOWN_MISSION
        problem = self._folder.problem if is_unknown else ""
        return f"; what is new cannot be used: {problem}" if problem else ""

    def _switch_chart(self, loaded: LoadedMissions) -> None:
        """Switch to another chart; a failure changes nothing.

        Clients of plugins that both charts use are kept with their state, unless their binding changed.

        Raises:
            LupinError: the profile is another, or a parameter or client does not fit.
        """
        chart = loaded.chart
        declared = {**OWN_PARAMETERS, **chart.parameters}
        if chart.profile is not self._loop.chart.profile:
            raise LupinError("another profile needs a new start")
        values = self._ros.values_with(declared)
        world = make_world(chart, {name: values[name] for name in chart.parameters})
        machine = successor(self._loop.machine, world)
        self._clients.switch(loaded, self._clients.prepared(loaded, world.parameters))
        self._ros.declare_anew(declared)
        self._loop.loaded = loaded
        self._records.switch_chart(loaded)
        self._switch_machine(machine)

    def _switch_machine(self, machine: Machine) -> None:
        """Switch to another machine of the chart, and report it the live values that it lacks."""
        self._loop.engine.watch = watch = LiveMonitor(machine.chart)
        self._gate.watched = watch.kept
        self._gate.begin(self._loop.loaded, machine)
        self._loop.engine.go_on_with(machine)
        heard = {name for name, found in machine.memory.inputs.items() if found.reported}
        self._clients.outlet.report_again(
            spec.value for spec in self._loop.chart.inputs.values() if spec.name not in heard
        )
        self._loop.work()

    def _prepare_parameters(self, values: Mapping[str, Any]) -> str | None:
        """Make a machine for new values of the missions' parameters, or return why not."""
        chart, self._prepared = self._loop.chart, None
        of_plugins = {name for plugin in chart.clients for name in chart.catalog.plugins[plugin].parameters}
        fixed = [name for name in values if name not in chart.parameters or name in of_plugins]
        if fixed:
            return f"{', '.join(fixed)}: read at the start of the node only; restart it with -p"
        if not is_idle(self._loop.machine):
            now = self._loop.machine.view.lifecycle
            return f"{', '.join(values)}: can be set where a mission can be started, which is not so in {now}"
        try:
            world = make_world(chart, {**self._loop.machine.world.parameters, **values})
            self._prepared = successor(self._loop.machine, world)
        except LupinError as problem:
            return str(problem)
        return None

    def _adopt_parameters(self, _: Mapping[str, Any]) -> None:
        """Switch to the prepared machine, after ROS has stored its values."""
        machine, self._prepared = self._prepared, None
        if machine is not None:
            self._switch_machine(machine)
            self.publish()

    def publish(self) -> None:
        """Publish the mission catalogue, with the problems of the missions' files."""
        if self._folder.warning:
            self._ros.log.warning("missions", problem=self._folder.warning)
        self._records.publish_missions(self._loop.machine, self._folder.problem.splitlines())
