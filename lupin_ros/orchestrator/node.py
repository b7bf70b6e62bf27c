"""The node `mission_orchestrator`: a machine, its plugins' clients, and the operator's services.

Callbacks of ROS queue events, which the machine steps on the node's thread; nothing blocks. The node knows no
mission and no plugin: its clients follow from the missions' operations, its parameters from the chart, its
topics and services from the profile. A request is answered from its step, after that is flushed. An exception
in one callback is logged and keeps no other from running.
"""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from typing import Any

from std_srvs.srv import Trigger

from lupin_engine.chart import Chart
from lupin_engine.errors import LupinError, shortened
from lupin_engine.machine import (
    CODE_REPORTED,
    NOTHING,
    RELEASED,
    UNKNOWN_MISSION,
    Event,
    Machine,
    Refusal,
    Step,
    is_idle,
    successor,
)
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import (
    ANSWER,
    CLOSED_CODE,
    EXECUTION_CODE,
    NUMBER,
    RESTARTED,
    START,
    START_VERB,
    TEXT,
    Parameter,
    StartAnswer,
    given_fields,
    list_of,
    load_catalog,
)
from lupin_engine.runtime import (
    STALE,
    STALE_AFTER_S,
    ClientClocks,
    Engine,
    make_machine,
    make_world,
    resumed,
    resumed_event,
)
from lupin_ros.adapter.executor import StaleAfter
from lupin_ros.adapter.node import RosNode
from lupin_ros.adapter.process import signals_call
from lupin_ros.adapter.status_socket import StatusSocket
from lupin_ros.interfaces.definitions import interface_class
from lupin_ros.orchestrator.clients import Clients
from lupin_ros.orchestrator.displays import Displays
from lupin_ros.orchestrator.journal_gate import JOURNAL_PARAMETERS, JournalGate
from lupin_ros.orchestrator.loop import Loop
from lupin_ros.orchestrator.outlet import NodeClock, RosOutlet
from lupin_ros.orchestrator.records import LOG_PARAMETERS, RecordPublisher
from lupin_ros.orchestrator.recovery import (
    CONTINUE,
    HEARD_S,
    POLICY,
    RESUME_PARAMETERS,
    Recovery,
    find_recovery,
)
from lupin_ros.orchestrator.single import other_orchestrator, watch_for_older_instance
from lupin_ros.orchestrator.step_publisher import StepPublisher
from lupin_ros.service import commands, messages
from lupin_ros.service.commands import CommandAnswer, CommandRequest
from lupin_ros.service.folder import LOOK_PERIOD_S, FolderWatch, MissionsFolder
from lupin_ros.service.names import ANSWER_SERVICE, COMMAND_SERVICE, COMMAND_TYPE, NODE

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


class Orchestrator:
    """Wires the parts of the node. Everything runs on the thread that spins `ros`."""

    def __init__(self, ros: RosNode, loaded: LoadedMissions, folder: MissionsFolder) -> None:
        given = ros.parameters()
        self._ros, self._folder = ros, folder
        self._prefix = str(given["mission_id_prefix"])
        self._wire = wire = messages.wire_of(loaded.chart.profile)
        self._clock = clock = NodeClock(ros)
        self._loop = loop = Loop(ros, clock, loaded)
        self._records = records = RecordPublisher(ros, clock, loaded)
        self._gate = gate = JournalGate(ros, records.boot, loop)
        recovery, lost = find_recovery(ros, gate.folder, loaded, given)
        machine = _first_machine(ros, loaded, recovery)
        self._publisher = publisher = StepPublisher(ros, clock, loop, wire, gate, records)
        self._outlet = outlet = RosOutlet(loop, clock)
        is_resumed = recovery is not None and recovery.machine is not None
        self._clients = clients = Clients(ros, loaded, outlet, machine.world.parameters, is_resumed)
        drivers, journal = clients.drivers, gate.journal
        self._engine = engine = Engine(machine, clock, drivers, publisher.stepped, clock.wall, journal)
        engine.failed = publisher.failed
        loop.run(engine, gate, records)
        self._watch = FolderWatch(folder, ros)
        #: How many requests wait for a check of the folder; whether a periodic check is under way.
        self._waiting, self._is_checking = 0, False
        #: When the policy may end the hold `restarted`, of the monotonic clock; once in a process.
        self._continues_at = time.monotonic() + HEARD_S if given[POLICY] == CONTINUE else None
        #: The machine for new parameter values, until ROS has stored them.
        self._prepared: Machine | None = None
        #: The events of answers that are served.
        self._answers: set[str] = set()
        self._callers = ClientClocks()
        self._commands = gate.commands_of(recovery)
        #: The id of an older instance for which this one stands down; '' while there is none.
        self.older_boot = ""
        self._serve_all()
        self._begin(recovery, lost)
        # In real time: the state is repeated also while simulated time stands still.
        ros.steady_timer(1.0 / float(given["state_publish_rate_hz"]), publisher.repeat_state)
        ros.steady_timer(LOOK_PERIOD_S, self._check)
        watch_for_older_instance(ros, records.boot, self._stand_down)
        ros.on_stop(StatusSocket(ros, records).close)

    def _serve_all(self) -> None:
        """Serve operators and displays; what was open is closed at the end."""
        self._ros.on_stop(self._close)
        self._ros.on_parameter(self._prepare_parameters, self._adopt_parameters)
        self._serve()
        self._serve_commands()
        self._serve_answers()
        Displays(self._ros, self._clock, self._loop)

    def _begin(self, recovery: Recovery | None, lost: str) -> None:
        """Start or resume the machine; publish what there is to be known about it."""
        self._start_or_resume(recovery)
        if lost:
            self._loop.post(Event(CODE_REPORTED, {"code": CLOSED_CODE, "detail": lost}))
        self._loop.work()
        self._publish_missions()
        self._records.publish_chart()

    @property
    def _machine(self) -> Machine:
        """The running machine."""
        return self._engine.machine

    @property
    def _loaded(self) -> LoadedMissions:
        """The missions that run."""
        return self._loop.loaded

    @property
    def _chart(self) -> Chart:
        """Their chart."""
        return self._loop.loaded.chart

    def _start_or_resume(self, recovery: Recovery | None) -> None:
        """Resume the last process's machine, or start a new one; publish outcomes that were not published."""
        now, wall = self._clock.now(), time.time()
        if recovery is not None:
            self._gate.continue_file(recovery, self._loaded, recovery.left.shift(now, wall), now)
        is_resumed = recovery is not None and recovery.machine is not None
        if recovery is None or recovery.left.file.damaged or not (is_resumed or recovery.closing):
            self._gate.begin(self._loaded, self._machine)
        if recovery is not None:
            self._gate.republish(recovery, self._publisher.unpublished(recovery), self._publisher.outcomes)
        if recovery is None or recovery.machine is None:
            self._start_new(recovery.closing if recovery is not None else "", recovery)
            return
        machine = resumed(recovery.machine, recovery.left.shift(now, wall))
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
        self._gate.begin(self._loaded, self._machine)
        self._engine.start()
        detail = f"{head.mission} {head.mission_id}: {closing}; left out: {count}"
        self._loop.post(Event(CODE_REPORTED, {"code": CLOSED_CODE, "detail": detail}))

    def _stand_down(self, older_boot: str) -> None:
        self.older_boot = older_boot
        self._ros.stop()

    def _close(self) -> None:
        self._clients.close()
        self._watch.close()
        self._gate.close()

    # -- requests ---------------------------------------------------------------------------------------

    def _serve(self) -> None:
        start = self._wire.start
        self._answer_when_flushed(
            interface_class(start.type),
            start.name,
            self._start,
            begins=lambda _: True,
            stale_after=partial(self._too_old, START),
            refuse=lambda response, reason: self._answer(response, StartAnswer(False, reason=reason)),
        )
        for name in self._chart.profile.requests:
            event = f"operator.{name}"
            refuse = partial(_refuse, field="message")
            judge = partial(self._too_old, event)
            self._answer_when_flushed(
                Trigger,
                self._wire.requests.format(name),
                _answering(self._ask, event),
                stale_after=judge,
                refuse=refuse,
            )

    def _too_old(self, event: str, _: Any, sent: float) -> float | None:
        """Return the age of a request that is too old; None where it must be carried out."""
        age = self._age("", sent)
        return age if age > STALE_AFTER_S and not self._counts_however_late(event) else None

    def _age(self, client: str, sent: float) -> float:
        return self._callers.age(client, sent, time.time_ns() * 1e-9, time.monotonic())

    def _counts_however_late(self, event: str) -> bool:
        """Return whether a request is carried out at any age.

        One that would release a hold is not: the robot stands, and would begin to drive.
        """
        if not commands.counts_however_late(event, self._chart):
            return False
        self._loop.work()
        return not self._machine.dry_run(Event(event), self._clock.now(), skip_fields=True).releases

    def _answer_when_flushed(
        self,
        kind: Any,
        name: str,
        callback: Callable[[Any, Any], Any],
        begins: Callable[[Any], bool] = lambda _: False,
        stale_after: StaleAfter = None,
        refuse: Callable[[Any, str], Any] | None = None,
    ) -> None:
        """Serve requests; an answer leaves after its step is flushed, so it holds whatever happens then.

        Where `begins` is true for a request, changed missions are loaded before it.
        """

        def later(request: Any, response: Any, answer: Callable[[Any], None]) -> None:
            def act() -> None:
                found = callback(request, response)
                try:
                    self._gate.when_flushed(lambda: answer(found))
                except Exception:
                    self._ros.log.exception("answered without the journal", service=name)
                    answer(found)

            self._in_turn(act, begins(request))

        self._ros.serve_later(kind, name, later, stale_after=stale_after, refuse=refuse)

    def _in_turn(self, act: Callable[[], None], begins: bool) -> None:
        """Carry out requests in their order; one that begins a mission waits for a check of the folder."""

        def looked(loaded: LoadedMissions | None) -> None:
            self._waiting -= 1
            self._adopt_missions(loaded)
            act()

        if self._waiting or (begins and is_idle(self._machine)):
            self._waiting += 1
            self._watch.look(self._loaded, looked)
        else:
            act()

    def _serve_answers(self) -> None:
        """Serve the missions' answers to questions; the machine refuses those of removed missions.

        None is stale: the machine accepts an answer only while its question is open.
        """
        for event in self._chart.answers:
            if event not in self._answers:
                self._answers.add(event)
                self._answer_when_flushed(
                    Trigger,
                    ANSWER_SERVICE.format(event.removeprefix(ANSWER)),
                    _answering(self._ask, event),
                )

    def _serve_commands(self) -> None:
        """Serve the service for all requests; it carries out each command id once and records who asked."""

        def too_old(request: Any, sent: float) -> float | None:
            asked = _asked(request)
            age = self._age(asked.by[: commands.MAX_WORD], sent)
            event = commands.event_name(asked.verb, self._chart) or ""
            if age <= STALE_AFTER_S or event == ANSWER or self._commands.knows(asked, time.monotonic()):
                return None
            return None if self._counts_however_late(event) else age

        def command(request: Any, response: Any) -> Any:
            answer = self._commands.once(_asked(request), self._chart, time.monotonic(), self._carry_out)
            return messages.write(response, asdict(answer))

        def refuse(response: Any, reason: str) -> Any:
            return messages.write(response, asdict(CommandAnswer(False, STALE, reason)))

        try:
            kind = interface_class(COMMAND_TYPE)
        except LupinError as problem:  # a workspace that was built before this type existed
            self._ros.log.error("no commands can be taken", problem=str(problem))
        else:
            self._answer_when_flushed(kind, COMMAND_SERVICE, command, _begins, too_old, refuse)

    def _carry_out(self, asked: CommandRequest) -> CommandAnswer:
        event = commands.read_command(asked, self._chart, self._new_mission_id())
        if isinstance(event, Refusal):
            self._ros.log.info("command", verb=shortened(asked.verb), answer=event.text, **asked.origin)
            return commands.refused(event)
        step = self._ask(event, asked.origin)
        answer = commands.answered(asked, step)
        return replace(answer, message=answer.message + self._why_unknown(step))

    def _start(self, request: Any, response: Any) -> Any:
        asked = self._wire.start.read_request(messages.read(request))
        mission_id = self._new_mission_id()
        named = {"mission_type": asked.mission, "mission_id": mission_id}
        step = self._ask(Event(START, {**named, **given_fields(asked.request)}))
        if step.accepted:
            return self._answer(response, StartAnswer(True, mission_id))
        reason = (step.refusal.text if step.refusal else "") + self._why_unknown(step)
        return self._answer(response, StartAnswer(False, reason=reason))

    def _new_mission_id(self) -> str:
        return f"{self._prefix}-{uuid.uuid4().hex[:8]}"

    def _why_unknown(self, step: Step) -> str:
        """Return the problem of the missions' files where a step refused an unknown mission; else ''."""
        is_unknown = step.refusal is not None and step.refusal.code == UNKNOWN_MISSION
        problem = self._folder.problem if is_unknown else ""
        return f"; what is new cannot be used: {problem}" if problem else ""

    def _answer(self, response: Any, answer: StartAnswer) -> Any:
        return messages.write(response, self._wire.start.answer_fields(answer))

    def _ask(self, event: Event, origin: Mapping[str, str] = NOTHING) -> Step:
        self._publisher.origin = event, origin
        self._loop.work()
        try:
            refusal = self._refusal(event)
        except Exception as problem:
            self._ros.log.exception("request could not be judged", request=event.name)
            # A request that stops the robot is carried out without a judgement.
            stops = commands.counts_however_late(event.name, self._chart)
            why = f"{event.name.rpartition('.')[2]} refused: {type(problem).__name__}: {problem}"
            refusal = None if stops else Refusal(EXECUTION_CODE, why)
        if refusal is None:
            step = self._engine.request(event, origin)
        else:
            memory, now = self._machine.memory, self._clock.now()
            step = Step(memory.sequence, now, event, memory.configuration, accepted=False, refusal=refusal)
        self._loop.work()
        answer = "accepted" if step.accepted else step.refusal.text if step.refusal else "refused"
        self._ros.guarded(
            partial(self._ros.log.info, "request", request=event.name, answer=answer, **origin)
        )()
        return step

    def _refusal(self, event: Event) -> Refusal | None:
        """Return why a request is refused without a step; else begin the file of a mission that it starts."""
        foreseen = self._machine.dry_run(event, self._clock.now())
        refusal = self._gate.refusal(event, foreseen, self._chart.profile)
        if refusal is None:
            self._gate.before_request(event, foreseen, self._machine)
        return refusal

    # -- missions that come and go ----------------------------------------------------------------------

    def _check(self) -> None:
        """Check the clock, the disk, the resume policy and, while idle, the missions' folder; periodic."""
        self._loop.work()
        self._gate.check_disk(self._machine)
        self._continue()
        if is_idle(self._machine) and not self._is_checking:
            self._is_checking = True
            self._watch.look(self._loaded, self._folder_checked)

    def _folder_checked(self, loaded: LoadedMissions | None) -> None:
        self._is_checking = False
        self._adopt_missions(loaded)

    def _adopt_missions(self, loaded: LoadedMissions | None) -> None:
        """Adopt changed missions, unless one has begun meanwhile; where that fails the old ones stay."""
        if not is_idle(self._machine):
            return
        if loaded is not None and loaded.chart is not self._chart:
            try:
                self._switch_chart(loaded)
                self._ros.log.info("missions loaded anew", missions=list(loaded.chart.missions))
            except LupinError as problem:
                self._folder.refuse(loaded, str(problem))
            except Exception as problem:  # the client of a new plugin may raise anything
                self._ros.log.exception("missions could not be loaded anew")
                self._folder.refuse(loaded, f"{type(problem).__name__}: {problem}")
        self._publish_missions()

    def _continue(self) -> None:
        """Release the hold `restarted` where the policy is `continue`, and no other hold.

        It waits until all servers are there, no attempt of the last process is being cancelled, and every
        input that engages another hold has been reported to this process.
        """
        memory = self._machine.memory
        due = self._continues_at is not None and time.monotonic() >= self._continues_at
        if not (due and RESTARTED in memory.held):
            return
        ending = self._machine.view.cancelling
        if not (ending or self._clients.readiness.missing() or self._unheard_holds()):
            self._continues_at = None
            self._ros.log.info("the hold restarted is released", by=POLICY)
            self._engine.request(Event(RELEASED, {"hold": RESTARTED}), {"by": POLICY})
            self._loop.work()

    def _unheard_holds(self) -> bool:
        """Return whether an input that engages a hold was reported before the restart, and not since."""
        inputs = self._machine.memory.inputs
        levels = [hold.engage.split(".") for hold in self._chart.holds.values()]
        engaging = {name for word, name, *_ in levels if word == "input" and name in inputs}
        before = [self._chart.inputs[name].value for name in engaging if inputs[name].reported]
        return not all(map(self._outlet.was_reported, before))

    def _switch_chart(self, loaded: LoadedMissions) -> None:
        """Switch to another chart; a failure changes nothing.

        Clients of plugins that both charts use are kept with their state, unless their binding changed.

        Raises:
            LupinError: the profile is another, or a parameter or client does not fit.
        """
        chart = loaded.chart
        declared = {**OWN_PARAMETERS, **chart.parameters}
        if chart.profile is not self._chart.profile:
            raise LupinError("another profile needs a new start")
        values = self._ros.values_with(declared)
        world = make_world(chart, {name: values[name] for name in chart.parameters})
        machine = successor(self._machine, world)
        self._clients.switch(loaded, self._clients.prepared(loaded, world.parameters))
        self._ros.declare_anew(declared)
        self._loop.loaded = loaded
        self._records.switch_chart(loaded)
        self._serve_answers()
        self._switch_machine(machine)

    def _switch_machine(self, machine: Machine) -> None:
        """Switch to another machine of the chart, and report it the live values that it lacks."""
        self._gate.begin(self._loaded, machine)
        self._engine.go_on_with(machine)
        heard = {name for name, found in machine.memory.inputs.items() if found.reported}
        self._outlet.report_again(
            spec.value for spec in self._chart.inputs.values() if spec.name not in heard
        )
        self._loop.work()

    def _prepare_parameters(self, values: Mapping[str, Any]) -> str | None:
        """Make a machine for new values of the missions' parameters, or return why not."""
        chart, self._prepared = self._chart, None
        of_plugins = {name for plugin in chart.clients for name in chart.catalog.plugins[plugin].parameters}
        fixed = [name for name in values if name not in chart.parameters or name in of_plugins]
        if fixed:
            return f"{', '.join(fixed)}: read at the start of the node only; restart it with -p"
        if not is_idle(self._machine):
            now = self._machine.view.lifecycle
            return f"{', '.join(values)}: can be set where a mission can be started, which is not so in {now}"
        try:
            world = make_world(chart, {**self._machine.world.parameters, **values})
            self._prepared = successor(self._machine, world)
        except LupinError as problem:
            return str(problem)
        return None

    def _adopt_parameters(self, _: Mapping[str, Any]) -> None:
        """Switch to the prepared machine, after ROS has stored its values."""
        machine, self._prepared = self._prepared, None
        if machine is not None:
            self._switch_machine(machine)
            self._publish_missions()

    def _publish_missions(self) -> None:
        """Publish the mission catalogue, with the problems of the missions' files."""
        if self._folder.warning:
            self._ros.log.warning("missions", problem=self._folder.warning)
        self._records.publish_missions(self._machine, self._folder.problem.splitlines())


def _begins(request: Any) -> bool:
    return bool(request.verb == START_VERB)


def _asked(request: Any) -> CommandRequest:
    return CommandRequest(**messages.read(request))


def _refuse(response: Any, reason: str, field: str) -> Any:
    """Write a refusal's reason into a response."""
    setattr(response, field, reason)
    return response


def _answering(ask: Callable[[Event], Step], name: str) -> Callable[[Any, Any], Any]:
    def answer(_: Any, response: Any) -> Any:
        step = ask(Event(name))
        response.success = bool(step.accepted)
        response.message = step.refusal.text if step.refusal else f"{name.rpartition('.')[2]} accepted"
        return response

    return answer


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
        LupinError: the domain has an orchestrator already, or something is wrong with the missions.
    """
    catalog = load_catalog()
    loaded: list[tuple[LoadedMissions, MissionsFolder]] = []

    def declared(given: Mapping[str, Any]) -> Mapping[str, Parameter]:
        folder = MissionsFolder(given, catalog)
        loaded.append((folder.load(), folder))
        return {**OWN_PARAMETERS, **loaded[-1][0].chart.parameters}

    ros = RosNode(NODE, arguments, declared)
    with signals_call(ros.stop):  # from here on, and not only while it spins
        other = other_orchestrator(ros, messages.wire_of(loaded[-1][0].chart.profile))
        if other:
            ros.leave()
            raise LupinError(
                f"{ros.name} stands down: {other} is the orchestrator of this ROS domain already; "
                "stop that one, or start this one with another ROS_DOMAIN_ID"
            )
        orchestrator = Orchestrator(ros, *loaded[-1])
        ros.spin()
    if orchestrator.older_boot:
        raise LupinError(
            f"{ros.name} stands down: another orchestrator of this ROS domain began before it "
            f"(boot {orchestrator.older_boot}); stop that one, or start this one with another ROS_DOMAIN_ID"
        )
    return 0
