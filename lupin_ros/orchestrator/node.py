"""The node `mission_orchestrator`: a machine, its plugins' clients, and the operator's services.

Callbacks of ROS queue events, which the machine steps on the node's thread; nothing blocks. The node knows no
mission and no plugin: its clients follow from the missions' operations, its parameters from the chart, its
topics and services from the profile. A request is answered from its step, after that is flushed. An exception
in one callback is logged and keeps no other from running.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

from lupin_engine.errors import LupinError
from lupin_engine.machine import (
    CODE_REPORTED,
    HELD_BACK,
    RELEASED,
    Event,
    Machine,
    is_idle,
)
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import (
    CLOSED_CODE,
    PROPERTY_CODE,
    RESTARTED,
    Parameter,
    load_catalog,
)
from lupin_engine.properties import LiveMonitor
from lupin_engine.runtime import (
    Engine,
    make_machine,
    resumed,
    resumed_event,
)
from lupin_ros.adapter.node import RosNode
from lupin_ros.adapter.process import signals_call
from lupin_ros.adapter.status_socket import StatusSocket
from lupin_ros.orchestrator.clients import PluginClients
from lupin_ros.orchestrator.displays import Displays
from lupin_ros.orchestrator.journal_gate import JournalGate
from lupin_ros.orchestrator.loop import Loop
from lupin_ros.orchestrator.markers import MarkerPublisher
from lupin_ros.orchestrator.mission_action import MissionAction
from lupin_ros.orchestrator.missions import OWN_PARAMETERS, MissionSwitch
from lupin_ros.orchestrator.outlet import NodeClock, RosOutlet
from lupin_ros.orchestrator.records import RecordPublisher
from lupin_ros.orchestrator.recovery import (
    CONTINUE,
    HEARD_S,
    POLICY,
    Recovery,
    find_recovery,
)
from lupin_ros.orchestrator.requests import RequestServer
from lupin_ros.orchestrator.single import other_orchestrator, watch_for_older_instance
from lupin_ros.orchestrator.step_publisher import StepPublisher
from lupin_ros.service import messages
from lupin_ros.service.folder import LOOK_PERIOD_S, MissionsFolder
from lupin_ros.service.names import NODE


class Orchestrator:
    """Wires the parts of the node. Everything runs on the thread that spins `ros`."""

    def __init__(self, ros: RosNode, loaded: LoadedMissions, folder: MissionsFolder) -> None:
        given = ros.parameters()
        clock = NodeClock(ros)
        loop = Loop(ros, clock, loaded)
        records = RecordPublisher(ros, clock, loaded)
        gate = JournalGate(ros, records.boot, loop)
        recovery, lost = find_recovery(ros, gate.folder, loaded, given)
        machine = _first_machine(ros, loaded, recovery)
        publisher = StepPublisher(ros, clock, loop, gate, records)
        outlet = RosOutlet(loop, clock)
        is_resumed = recovery is not None and recovery.machine is not None
        clients = PluginClients(ros, loaded, outlet, machine.world.parameters, is_resumed)
        drivers, journal = clients.drivers, gate.journal
        engine = Engine(machine, clock, drivers, publisher.stepped, clock.wall, journal)
        engine.on_failure(publisher.failed)
        engine.watch = watch = _first_watch(loaded, recovery)
        gate.watched = watch.kept
        loop.run(engine, gate, records)
        missions = MissionSwitch(ros, folder, loop, records, gate, clients)
        requests = RequestServer(ros, loop, gate, publisher, missions, gate.commands_of(recovery))
        Displays(ros, clock, loop)
        MarkerPublisher(ros, clock, loop)
        self._ros, self._clock, self._loop, self._engine = ros, clock, loop, engine
        self._gate, self._publisher, self._records = gate, publisher, records
        self._clients, self._missions, self._requests = clients, missions, requests
        #: When the policy may end the hold `restarted`, of the monotonic clock; once in a process.
        self._continues_at = time.monotonic() + HEARD_S if given[POLICY] == CONTINUE else None
        self._is_checking = False
        #: The id of an older instance for which this one stands down; '' while there is none.
        self.older_boot = ""
        self._begin(recovery, lost)
        runs = MissionAction(ros, loop, gate, publisher, requests)
        # In real time: the state is repeated also while simulated time stands still.
        ros.steady_timer(1.0 / float(given["state_publish_rate_hz"]), publisher.repeat_state)
        ros.steady_timer(LOOK_PERIOD_S, self._check)
        watch_for_older_instance(ros, records.boot, self._stand_down)
        ros.on_inactive(self._hold)
        for part in (runs, clients, missions, gate, StatusSocket(ros, records, ros.namespace)):
            ros.on_stop(part.close)

    def _begin(self, recovery: Recovery | None, lost: str) -> None:
        """Start or resume the machine; publish what there is to be known about it."""
        self._start_or_resume(recovery)
        if lost:
            self._loop.post(Event(CODE_REPORTED, {"code": CLOSED_CODE, "detail": lost}))
        self._loop.work()
        self._missions.publish()
        self._records.publish_chart()

    def _start_or_resume(self, recovery: Recovery | None) -> None:
        """Resume the last process's machine, or start a new one; publish outcomes that were not published."""
        now, wall = self._clock.now(), time.time()
        if recovery is not None:
            self._gate.continue_file(recovery, self._loop.loaded, recovery.left.shift(now, wall), now)
        is_resumed = recovery is not None and recovery.machine is not None
        if recovery is None or recovery.left.file.damaged or not (is_resumed or recovery.closing):
            self._gate.begin(self._loop.loaded, self._engine.machine)
        if recovery is not None:
            self._gate.republish(recovery, self._publisher.unpublished(recovery), self._publisher.outcomes)
        if recovery is None or recovery.machine is None:
            self._start_new(recovery.closing if recovery is not None else "", recovery)
            for lost in recovery.watch.unreported if recovery is not None and recovery.watch else ():
                self._loop.post(Event(CODE_REPORTED, {"code": PROPERTY_CODE, "detail": lost.data["detail"]}))
            return
        shift = recovery.left.shift(now, wall)
        machine = resumed(recovery.machine, shift)
        if recovery.watch is not None:
            recovery.watch.shift(shift)
        started = machine.memory.started_at
        if started is not None:
            self._publisher.mission_resumed(now - started)
        self._engine.resume(machine, resumed_event(recovery.left, machine, wall))

    def _start_new(self, closing: str, recovery: Recovery | None) -> None:
        """Start the machine; where recovery closed a mission, record and report why."""
        if not closing or recovery is None:
            self._engine.start()
            return
        head, count = recovery.left.file.head, len(recovery.left_out)
        self._gate.record_closed(closing)
        self._gate.begin(self._loop.loaded, self._engine.machine)
        self._engine.start()
        detail = f"{head.mission} {head.mission_id}: {closing}; left out: {count}"
        self._loop.post(Event(CODE_REPORTED, {"code": CLOSED_CODE, "detail": detail}))

    def _stand_down(self, older_boot: str) -> None:
        self.older_boot = older_boot
        self._ros.stop()

    def _hold(self) -> None:
        """Hold a mission that is under way: the node was deactivated, and only a person lets it go on."""
        self._continues_at = None
        machine = self._engine.machine
        if machine.view.lifecycle not in machine.chart.profile.stages.without_mission:
            detail = f"{self._ros.name} was deactivated: activate it, then resume"
            self._loop.post(Event(HELD_BACK, {"hold": RESTARTED, "detail": detail}))
            self._loop.work()

    # -- periodic work ----------------------------------------------------------------------------------

    def _check(self) -> None:
        """Check the clock, the disk, the resume policy and, while idle, the missions' folder; periodic."""
        self._loop.work()
        self._gate.check_disk(self._engine.machine)
        self._continue()
        if is_idle(self._engine.machine) and not self._is_checking:
            self._is_checking = True
            self._missions.look(self._folder_checked)

    def _folder_checked(self, loaded: LoadedMissions | None) -> None:
        self._is_checking = False
        self._requests.adopt(loaded)

    def _continue(self) -> None:
        """Release the hold `restarted` where the policy is `continue`, and no other hold.

        It waits until all servers are there, no attempt of the last process is being cancelled, and every
        input that engages another hold has been reported to this process.
        """
        memory = self._engine.machine.memory
        due = self._continues_at is not None and time.monotonic() >= self._continues_at
        if self._ros.inactive or not (due and RESTARTED in memory.held):
            return
        ending = self._engine.machine.view.cancelling
        if not (ending or self._clients.readiness.missing() or self._unheard_holds()):
            self._continues_at = None
            self._ros.log.info("the hold restarted is released", by=POLICY)
            self._engine.request(Event(RELEASED, {"hold": RESTARTED}), {"by": POLICY})
            self._loop.work()

    def _unheard_holds(self) -> bool:
        """Return whether an input that engages a hold was reported before the restart, and not since."""
        inputs = self._engine.machine.memory.inputs
        levels = [hold.engage.split(".") for hold in self._loop.chart.holds.values()]
        engaging = {name for word, name, *_ in levels if word == "input" and name in inputs}
        before = [self._loop.chart.inputs[name].value for name in engaging if inputs[name].reported]
        return not all(map(self._clients.outlet.was_reported, before))


def _first_watch(loaded: LoadedMissions, recovery: Recovery | None) -> LiveMonitor:
    """Return the watch of the last process where its machine goes on, else a new one."""
    known = recovery.watch if recovery is not None and recovery.machine is not None else None
    return known or LiveMonitor(loaded.chart)


def _first_machine(ros: RosNode, loaded: LoadedMissions, recovery: Recovery | None) -> Machine:
    """Return the machine of the last process where it goes on, else a new one."""
    if recovery is not None and recovery.machine is not None:
        ros.lineage = recovery.left.file.head.lineage or ros.lineage
        return recovery.machine
    given = ros.parameters()
    return make_machine(loaded.chart, {name: given[name] for name in loaded.chart.parameters})


def main(arguments: Sequence[str] = ()) -> int:
    """Run the node until SIGINT or SIGTERM; `arguments` are ROS arguments.

    Raises:
        LupinError: the robot has an orchestrator already, or something is wrong with the missions.
    """
    catalog = load_catalog()
    loaded: list[tuple[LoadedMissions, MissionsFolder]] = []

    def declared(given: Mapping[str, Any]) -> Mapping[str, Parameter]:
        folder = MissionsFolder(given, catalog)
        loaded.append((folder.load(), folder))
        return {**OWN_PARAMETERS, **loaded[-1][0].chart.parameters}

    ros = RosNode(NODE, arguments, declared, managed=True)
    where = ros.namespace and f"robot {ros.namespace} in "
    where += "this ROS domain"
    with signals_call(ros.stop):  # from here on, and not only while it spins
        other = other_orchestrator(ros, messages.wire_of(loaded[-1][0].chart.profile))
        if other:
            ros.leave()
            raise LupinError(
                f"{ros.name} stands down: {other} is the orchestrator of {where} already; "
                "stop that one, or start this one with another ROS_DOMAIN_ID"
            )
        orchestrator = Orchestrator(ros, *loaded[-1])
        ros.spin()
    if orchestrator.older_boot:
        raise LupinError(
            f"{ros.name} stands down: another orchestrator of {where} began before it "
            f"(boot {orchestrator.older_boot}); stop that one, or start this one with another ROS_DOMAIN_ID"
        )
    return 0
