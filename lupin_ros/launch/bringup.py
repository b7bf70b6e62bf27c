"""One run: nodes brought up, the mission started and followed, everything stopped.

A single loop on the caller's thread spins the operator's node, checks processes and interrupts, and calls the
observer. Every wait has a deadline, except for the end of the mission and the watch of the nodes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

from lupin_engine.errors import LupinError, Severity
from lupin_engine.plugin import RESTARTED, Catalog, Profile, Progress
from lupin_ros.launch.dds_discovery import settled
from lupin_ros.launch.description import (
    COMPOSED,
    LaunchDescription,
    NodeLaunch,
    ParameterValues,
    PresentEndpoints,
    command,
    composed,
    describe_launch,
)
from lupin_ros.launch.environment import open_to
from lupin_ros.launch.interrupts import Interrupts
from lupin_ros.launch.monitor import RunMonitor
from lupin_ros.launch.nodes import ORCHESTRATOR
from lupin_ros.launch.operator import Answer, Operator
from lupin_ros.launch.respawn import Respawns
from lupin_ros.launch.supervisor import IMPATIENT, Death, Patience, Supervisor
from lupin_ros.service.messages import wire_of

#: Period of the loop, in seconds; and while nothing is waited for.
TICK_S, WATCH_TICK_S = 0.05, 0.25
#: How long nodes may take to appear and serve, in seconds; the death of one is reported at once.
APPEAR_LIMIT_S = 90.0
#: A shorter wait is not reported, in seconds.
UNREPORTED_S = 4.0
#: How long the orchestrator may wait for servers. It has a limit of its own, a parameter, and faults then.
SERVERS_LIMIT_S = 600.0
#: The time in which latched inputs (a stop, a charge) reach the orchestrator, in seconds.
SETTLE_S = 1.5
#: On a busy machine that takes longer: so many states must be received meanwhile, or this time pass, in
#: seconds.
SETTLE_STATES = 8
SETTLE_LIMIT_S = 20.0
#: How long the orchestrator may take to answer a request, in seconds.
ANSWER_S = 5.0
#: The state comes five times a second: this long without it and the orchestrator is gone.
SILENCE_S = 6.0
#: How long an abort may take until nothing moves, in seconds.
ABORT_LIMIT_S = 5.0
#: How long the robot may take to come home after an abort, in seconds; the missions' own limits are shorter.
HOME_LIMIT_S = 300.0
#: How long the publishers of topics that bindings read may take to be seen, in seconds.
PUBLISHERS_LIMIT_S = 2.0
#: How long the last observations may come after the last state, in seconds.
STRAGGLER_S = 2.0


class RunFailed(LupinError):
    """The run could not be done, or not be started; the text says why."""

    exit_code = 2


class Observer(Protocol):
    """The interface of a run's display, for people or machines."""

    def note(self, text: str, severity: Severity = Severity.INFO) -> None:
        """Report an event of the run itself, such as a start, a wait or a stop."""

    def arrived(self, kind: str, data: Mapping[str, Any], monitor: RunMonitor) -> None:
        """Handle a message that the monitor has just accepted: `state`, `observation` or `step`."""

    def show(self, monitor: RunMonitor) -> None:
        """Show the progress of the mission; called in every cycle."""


@dataclass(frozen=True)
class BringupSettings:
    """The settings of a run of missions of the `profile`.

    `parameters` are by node name, `known` the names of those that the missions have. `insisted` names nodes
    that must be started here, each with the option that requires it: a running one would ignore the option.
    `patience` is how long a mission may wait for an operator, in seconds; None is for ever. `respawn`:
    restart nodes that die. `compose`: let nodes share a process; None: where the robot is simulated. With
    `stays_in_fault` an orchestrator in a fault is left to an operator. `frame_prefix` is a parameter of every
    node.
    """

    profile: Profile
    folder: Path
    environment: Mapping[str, str]
    parameters: Mapping[str, ParameterValues] = field(default_factory=dict)
    known: Container[str] = ()
    insisted: Mapping[str, str] = field(default_factory=dict)
    simulate: bool = True
    settle: bool = False
    patience: float | None = None
    respawn: bool = True
    compose: bool | None = None
    stays_in_fault: bool = False
    frame_prefix: str = ""


class _OperatorView:
    """What an operator's node sees, until Ctrl-C."""

    def __init__(self, operator: Operator, interrupts: Interrupts) -> None:
        self._operator = operator
        self._interrupts = interrupts

    def spin(self) -> None:
        self._operator.spin(TICK_S)
        self._interrupts.check()

    def look(self) -> PresentEndpoints:
        return PresentEndpoints(self._operator.nodes(), self._operator.services(), self._operator.actions())

    def strangers(self) -> int:
        return self._operator.strangers()


class Bringup:
    """Runs nodes and a mission; a context manager, so that no process survives an exception."""

    def __init__(self, settings: BringupSettings, observer: Observer, interrupts: Interrupts) -> None:
        self.supervisor = Supervisor(settings.folder, settings.environment)
        self.description = LaunchDescription(())
        self._settings = settings
        self._observer = observer
        self._interrupts = interrupts
        self._operator = Operator(settings.profile)
        self._wire = wire_of(settings.profile)
        self._progress = Progress()
        self._states = 0
        self._view: dict[str, Any] = {}
        #: The mission, once it was started.
        self.monitor: RunMonitor | None = None
        self._is_up = False
        self._respawns = Respawns(settings.respawn)
        self._pending: list[tuple[str, dict[str, Any], float]] = []
        #: Until when the orchestrator may be silent, because it is being started again.
        self._excused_until = 0.0

    # -- bringing up ------------------------------------------------------------------------------------

    def bring_up(
        self, plugins: Iterable[str], catalog: Catalog, heard: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        """Start the missing nodes for missions that use `plugins`, and wait until the orchestrator is ready.

        `heard` are topics that bindings read, each with its value's name: one without a publisher is
        reported.

        Raises:
            RunFailed: a node that an option configures runs already, or a second one of ours appeared; a
                process could not be started or died; our orchestrator reports a fault; or something is still
                missing after its time.
            Interrupted: the user wants to stop.
        """
        doors = open_to()
        if doors:
            self._observer.note(doors, Severity.WARN)
        self._observer.note("looking for nodes that run already")
        self.description = self._describe(
            list(plugins), catalog, settled(_OperatorView(self._operator, self._interrupts))
        )
        if self.description.joined:
            self._observer.note(f"using what is there: {', '.join(self.description.joined)}")
        folder = self._settings.folder
        if self.description.starts:
            self._observer.note(f"starting {', '.join(self._processes())}; logs in {folder}")
        for name, launches in self.description.processes.items():
            self._start(name, launches)
        self._wait_for(self._missing_nodes, APPEAR_LIMIT_S)
        self._wait_for(self._missing_servers, SERVERS_LIMIT_S)
        self.supervisor.note_segments()
        if self._settings.settle or self.description.joined:
            settled_at, enough = time.monotonic() + SETTLE_S, self._states + SETTLE_STATES
            self._wait_until(
                lambda: time.monotonic() >= settled_at and self._states >= enough,
                SETTLE_LIMIT_S,
                checked=True,
            )
        self._note_silent(heard)
        self._is_up = True

    def _note_silent(self, heard: Mapping[str, str]) -> None:
        def silent() -> list[str]:
            return [topic for topic in heard if not self._operator.is_published(topic)]

        self._wait_until(lambda: not silent(), PUBLISHERS_LIMIT_S, checked=True)
        for topic in silent():
            self._observer.note(f"nobody publishes {topic}: no {heard[topic]} until then", Severity.WARN)

    def _processes(self) -> Iterator[str]:
        """Yield the names of the processes, a composed one with the names of its nodes."""
        for name, launches in self.description.processes.items():
            nodes = " + ".join(launch.node.name for launch in launches)
            yield f"{name} ({nodes})" if name == COMPOSED else name

    def _start(self, name: str, launches: Sequence[NodeLaunch]) -> None:
        folder = self._settings.folder
        try:
            prefix = self._settings.frame_prefix
            self.supervisor.start(name, command(launches, folder, prefix))
        except OSError as problem:  # the disk is full, or no further process can be started
            reason = problem.strerror
            raise RunFailed(f"{name} cannot be started with its files in {folder}: {reason}") from None

    def _describe(
        self, plugins: Sequence[str], catalog: Catalog, present: PresentEndpoints
    ) -> LaunchDescription:
        """Return the launch description.

        Raises:
            RunFailed: a node that an option configures runs already.
        """
        settings = self._settings
        wanted = describe_launch(
            plugins,
            catalog,
            present,
            settings.parameters,
            simulate=settings.simulate,
            known=settings.known,
        )
        taken = [
            f"{option} is for {name}, which runs already; stop it or choose another --domain"
            for name, option in settings.insisted.items()
            if name not in wanted.starts
        ]
        if taken:
            raise RunFailed("\n".join(taken))
        return composed(wanted, catalog, settings.compose)

    @property
    def owns_orchestrator(self) -> bool:
        """Whether this bringup started the orchestrator."""
        return ORCHESTRATOR in self.description.starts

    def _wait_for(self, missing: Callable[[], Sequence[str]], limit: float) -> None:
        """Wait until nothing is missing; report changes of the list of missing names.

        Raises:
            RunFailed: something is missing after `limit` seconds.
        """
        begin = time.monotonic()
        reported: Sequence[str] = ()
        while waiting := missing():
            if time.monotonic() - begin > limit:
                logs = self._settings.folder
                raise RunFailed(f"still missing after {limit:g} s: {', '.join(waiting)}; logs in {logs}")
            if waiting != reported and time.monotonic() - begin > UNREPORTED_S:
                self._observer.note(f"waiting for {', '.join(waiting)}")
                reported = waiting
            self._tick()
            self._interrupts.check()

    def _missing_nodes(self) -> list[str]:
        for name in self.description.starts:
            if self._operator.count(name) > 1:
                text = f"a second {name} has appeared in this ROS domain; stop it or choose another --domain"
                raise RunFailed(text)
        there = self._operator.nodes()
        missing = [f"node {name}" for name in self.description.starts if name not in there]
        if missing:
            return missing
        if not self._operator.ready():
            return [f"the services of {self._wire.start.name.rpartition('/')[0]}"]
        return [] if self._states else [f"topic {self._wire.state.name}"]

    def _missing_servers(self) -> list[str]:
        """Return the servers that the orchestrator waits for; RunFailed after a fault of our own one."""
        lifecycle, stages = self._progress.lifecycle, self._settings.profile.stages
        if lifecycle in stages.faulted and self.owns_orchestrator:
            problem = f"the orchestrator is in {lifecycle}: {_last_event(self._progress)}"
            reset, stays = self._settings.profile.verbs.get("reset"), self._settings.stays_in_fault
            if reset:
                problem += f"; mend it, then {'' if stays else '`lupin up`, and beside it '}`lupin {reset}`"
            if not stays:
                raise RunFailed(problem)
            self._observer.note(problem, Severity.ERROR)
        if lifecycle not in stages.starting:
            return []
        details = [str(attempt["detail"]) for attempt in self._view.get("attempts", ()) if attempt["detail"]]
        return details or [f"the orchestrator, which is in {lifecycle}"]

    # -- the mission ------------------------------------------------------------------------------------

    def start(self, mission: str, request: Mapping[str, Any], *, any_field: bool = False) -> RunMonitor:
        """Start a mission with the fields of a request; for `any_field` see `Operator.start`.

        Raises:
            RunFailed: it was refused, or no orchestrator answered.
            UsageError: the interface of commands, which `any_field` needs, is not installed.
        """
        began = time.monotonic()
        answer = self._operator.start(mission, request, ANSWER_S, any_field=any_field)
        if not answer.reached:
            raise RunFailed(f"the mission could not be started: {answer.text}")
        if not answer.accepted:
            raise RunFailed(f"{mission} was not started: {answer.text}{self._held_before()}")
        monitor = RunMonitor(self._settings.profile, answer.mission_id, began, heard=time.monotonic())
        self.monitor = monitor
        self._observer.note(f"{mission} {answer.mission_id} started")
        for arrival in self._pending:
            self._pass_to_monitor(*arrival)
        self._pending.clear()
        return monitor

    def _held_before(self) -> str:
        """Return how to resume a mission that was under way before the orchestrator started; '' for none."""
        if RESTARTED not in self._view.get("held", ()):
            return ""
        of_before = f"{self._progress.mission} {self._progress.mission_id} was under way before"
        profile = self._settings.profile
        then = [f"`lupin {profile.verbs[name]}`" for name in (profile.resume, profile.abort) if name]
        return f"; {of_before}: `lupin up` brings it back" + (f", then {' or '.join(then)}" if then else "")

    def follow(self, monitor: RunMonitor, look: Callable[[], None] = lambda: None) -> None:
        """Follow a mission until it has ended, calling `look` again and again.

        Raises:
            RunFailed: the orchestrator is gone, or the mission waits for an operator who does not come.
            Interrupted: the user wants to stop.
        """
        waiting_since: float | None = None
        while not monitor.ended:
            self._tick()
            self._interrupts.check()
            look()
            now = time.monotonic()
            if now - monitor.heard > SILENCE_S and now > self._excused_until:
                raise RunFailed(f"no {self._wire.state.name} for {SILENCE_S:g} s: the orchestrator is gone")
            waiting_since = (waiting_since or now) if monitor.waits else None
            self._check_patience(monitor, now - (waiting_since or now))
        self._wait_until(lambda: monitor.all_received, STRAGGLER_S)

    def command(self, verb: str, request: Mapping[str, Any]) -> Answer:
        """Send a command of the user; messages that arrive meanwhile are handled later.

        Without an orchestrator, or without its answer in time, the `Answer` is one that was not `reached`.

        Raises:
            UsageError: the interface of commands is not installed.
        """
        return self._operator.command(verb, request=request)

    def _check_patience(self, monitor: RunMonitor, waited: float) -> None:
        patience = self._settings.patience
        if patience is not None and waited > patience:
            why = _last_event(monitor.progress)
            raise RunFailed(f"the mission waits for an operator ({why}); nobody came within {patience:g} s")

    def abort(self, monitor: RunMonitor) -> None:
        """Abort the mission, which sends the robot home; stop it on the way if there is no time for that.

        There is time only after Ctrl-C, until it is pressed again, the robot cannot go on without help, or
        `HOME_LIMIT_S` have passed. An abort that fails, or is unknown to the profile, is reported to the
        observer. Our own orchestrator is not asked if it is dead.

        Raises:
            RunFailed: our orchestrator died meanwhile, and is not started again.
        """
        if self.owns_orchestrator and ORCHESTRATOR not in self.supervisor.names:
            return  # nobody is left to ask
        home = self._interrupts.at_leisure
        then = " or ".join(self._settings.profile.stages.returning)
        text = f"aborting the mission{f': {then} follows' if then else ''}; once more to stop it on the way"
        self._observer.note(text if home else "aborting the mission", Severity.WARN)
        # A robot that is already returning is not stopped by an abort.
        if not (home and monitor.returning) and not self._request_abort():
            return
        if home:
            self._wait_until(
                lambda: monitor.ended or monitor.waits or self._interrupts.insisted, HOME_LIMIT_S
            )
        if not monitor.ended and not self._request_abort():
            return
        self._wait_for_the_end(monitor, home)

    def _wait_for_the_end(self, monitor: RunMonitor, home: bool) -> None:
        """Wait for the end of the aborted mission, or for another Ctrl-C; report one that still runs."""

        def enough() -> bool:
            return self._interrupts.insisted_twice if home else self._interrupts.insisted

        if not self._wait_until(lambda: (monitor.ended and not monitor.busy) or enough(), ABORT_LIMIT_S):
            self._observer.note(f"the mission still runs after {ABORT_LIMIT_S:g} s", Severity.ERROR)
        self._wait_until(lambda: monitor.all_received or enough(), STRAGGLER_S)

    def _request_abort(self) -> bool:
        """Request an abort; return whether there was an answer, also a refusal."""
        abort = self._settings.profile.abort
        if not abort:
            self._observer.note("no request of this profile ends a mission", Severity.ERROR)
            return False
        answer = self._operator.ask(abort, ANSWER_S)
        self._take()
        if not answer.reached:
            self._observer.note(f"the mission could not be aborted: {answer.text}", Severity.ERROR)
        elif not answer.accepted:
            self._observer.note(answer.text, Severity.WARN)
        return answer.reached

    # -- the loop ---------------------------------------------------------------------------------------

    def watch(self, show: Callable[[Progress], None]) -> None:
        """Keep the nodes running, and show the published state periodically.

        Raises:
            RunFailed: the orchestrator that this bringup started died, and is not started again; the end of
                another one is not noticed.
            Interrupted: the user wants to stop.
        """
        while True:
            show(self._progress)
            self._tick(WATCH_TICK_S)
            self._interrupts.check()

    def _wait_until(self, condition: Callable[[], bool], limit: float, checked: bool = False) -> bool:
        """Wait for a condition; return whether it came. `checked` raises when the user wants to stop."""
        until = time.monotonic() + limit
        while not condition():
            if time.monotonic() > until:
                return False
            self._tick()
            if checked:
                self._interrupts.check()
        return True

    def _tick(self, seconds: float = TICK_S) -> None:
        self._operator.spin(seconds)
        self._take()
        self._look_at_processes()
        if self.monitor is not None:
            self._observer.show(self.monitor)

    def _take(self) -> None:
        for arrival in self._operator.take():
            if arrival.kind == "state":
                self._progress = self._wire.read_state(arrival.data)
                self._states += 1
            elif arrival.kind == "step":
                self._view = arrival.data.get("view", {})
            if self.monitor is None:  # messages before the answer to the start may be of the mission
                self._pending = [*self._pending[-200:], (arrival.kind, arrival.data, arrival.at)]
            else:
                self._pass_to_monitor(arrival.kind, arrival.data, arrival.at)

    def _pass_to_monitor(self, kind: str, data: dict[str, Any], at: float) -> None:
        assert self.monitor is not None
        if self.monitor.take(kind, data, at):
            self._observer.arrived(kind, data, self.monitor)

    def _look_at_processes(self) -> None:
        self.supervisor.cut_logs()
        deaths = self.supervisor.deaths()
        # At the start everything is needed. Later the mission has its own answer to a dead plugin: a declared
        # error; and a new orchestrator goes on with it, held.
        if deaths and not self._is_up:
            raise RunFailed("\n".join(death.text for death in deaths))
        now = time.monotonic()
        for death in deaths:
            self._observer.note(death.text, Severity.ERROR)
            if self.monitor is not None:
                self.monitor.note(now, Severity.ERROR, f"{death.name} {death.how}")
            outlook = self._respawns.died(death.name, now, time.strftime("%H:%M:%S"))
            self._observer.note(outlook, Severity.WARN)
            if death.name == ORCHESTRATOR:
                self._note_interrupted_mission(death)
        for name in self._respawns.due(now):
            self.supervisor.start_again(name)
            if name == ORCHESTRATOR:
                self._excused_until = now + APPEAR_LIMIT_S
        for text in self._respawns.back(self.supervisor.names, now):
            self._observer.note(text)
            self.supervisor.note_segments()

    def _note_interrupted_mission(self, death: Death) -> None:
        """Report that the next orchestrator will hold the mission until an operator resumes it.

        Raises:
            RunFailed: the orchestrator is not started again.
        """
        if not self._respawns.comes_back(death.name):
            raise RunFailed(death.text)
        self._excused_until = time.monotonic() + APPEAR_LIMIT_S
        before, self._progress = self._progress, Progress()
        if before.lifecycle and before.lifecycle not in self._settings.profile.stages.without_mission:
            resume = self._settings.profile.verbs.get(self._settings.profile.resume, "")
            text = f"{before.mission} {before.mission_id} was under way ({before.lifecycle}) and will be held"
            advice = f": look where the robot is, then `lupin {resume}`" if resume else ""
            self._observer.note(f"{text}{advice}", Severity.ERROR)

    # -- the end ----------------------------------------------------------------------------------------

    def close(self) -> None:
        """Stop every process that this bringup started; a second interrupt shortens the patience."""
        # First ourselves: Fast DDS can deadlock in a node that leaves while others do.
        self._operator.close()
        names = self.supervisor.names
        if names:
            self._observer.note(f"stopping {', '.join(names)}")
        killed = self.supervisor.stop(lambda: IMPATIENT if self._interrupts.insisted else Patience())
        if killed:
            self._observer.note(f"had to be killed: {', '.join(killed)}", Severity.WARN)

    def __enter__(self) -> Bringup:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _last_event(progress: Progress) -> str:
    return progress.error or progress.event or "no reason was published"
