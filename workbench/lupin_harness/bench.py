"""The test bench of a driver: its servers, or stand-ins, on an isolated ROS domain."""

from __future__ import annotations

import contextlib
import itertools
import os
import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from lupin_engine.errors import LupinError, PluginError
from lupin_engine.plugin import Argument, Driver, Plugin, convert, make_client, told
from lupin_harness.domains import claimed_domain
from lupin_harness.examples import arguments_for, defaults_of
from lupin_harness.referee import ContractBroken, NeedsArguments, Referee, RefereedAttempt, Untried
from lupin_harness.rules import Given, changes, declarations
from lupin_ros.adapter import RosNode, child_environment, interfaces
from lupin_ros.launch import Death, Patience, Supervisor

#: Seconds in which everything that must happen has happened, on a busy machine.
PATIENCE_S = 30.0
#: Seconds that a call of a driver may take; it should be far less, but the machine may be busy.
AT_ONCE_S = 1.0
#: Linux's file with how long a thread has run and waited for a processor, in nanoseconds.
SCHEDULED = Path("/proc/thread-self/schedstat")
#: Seconds between two looks at the network while a driver misses somebody.
LOOK_S = 1.0
#: For how long a process that was killed is still seen on the network, at most, in seconds.
FORGOTTEN_S = 4.0
#: Seconds after which an attempt that may have no server is cancelled.
TRY_S = 5.0
#: What a process gets that is killed as a crash would.
CRASH = Patience(interrupt=None, terminate=None)

#: A step in a traceback: file and line.
_STEP = re.compile(r'\s+File "(.+)", line (\d+)')
#: Runs `module:function` with the ROS arguments that follow.
_RUN = (
    "import importlib, sys; from lupin_ros.adapter.environment import prepare; prepare(); "
    "from lupin_ros.adapter.process import end_with_supervisor; end_with_supervisor(); "
    "module, _, name = sys.argv[1].partition(':'); "
    "sys.exit(getattr(importlib.import_module(module), name)(sys.argv[2:]))"
)


@dataclass(frozen=True)
class Setting:
    """A plugin author's settings for testing a driver.

    `parameters` override defaults; `arguments` are by operation or action. `nodes` are run as processes, by
    name `module:function`, with `node_parameters`; `offer` adds stand-ins to a node of this process. `waits`:
    the driver names missing servers. `first` lists, by operation, those that a mission does before it: a
    robot is localized before it drives.
    """

    plugin: Plugin
    parameters: Mapping[str, Any] = field(default_factory=dict)
    arguments: Given = field(default_factory=dict)
    nodes: Mapping[str, str] = field(default_factory=dict)
    node_parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    offer: Callable[[RosNode], None] | None = None
    waits: bool = True
    first: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def arguments_for(self, name: str, declared: Mapping[str, Argument]) -> dict[str, Any]:
        """Return arguments for the operation or action `name`."""
        return arguments_for(declared, self.arguments.get(name, {}))

    def parameter_values(self) -> dict[str, Any]:
        """Return every parameter, in base units; an unknown name is a parameter of the mission.

        Raises:
            LupinError: a value is not of its parameter's type.
        """
        values = {**defaults_of(self.plugin.parameters), **self.parameters}
        for name in self.plugin.parameters.keys() & self.parameters.keys():
            try:
                values[name] = convert(values[name], self.plugin.parameters[name].type)
            except ValueError as problem:
                raise LupinError(f"parameter {name!r} of plugin {self.plugin.name!r}: {problem}") from None
        return values


class Servers:
    """The servers of a driver: processes, and stand-ins in this process."""

    def __init__(self, setting: Setting) -> None:
        self._setting = setting
        self._logs = tempfile.TemporaryDirectory(prefix="lupin-harness-")
        self._started: set[str] = set()
        self._deaths: list[Death] = []
        self._supervisor: Supervisor | None = None
        self.here: RosNode | None = None

    def start(self) -> None:
        """Start the servers that do not run."""
        if self._supervisor is None:
            path = os.pathsep.join(filter(None, sys.path))
            self._supervisor = Supervisor(Path(self._logs.name), {**child_environment(), "PYTHONPATH": path})
        for name in self._setting.nodes:
            if name not in self._started:
                self._supervisor.start(name, self._command(name))
                self._started.add(name)
        if self._setting.offer is not None and self.here is None:
            self.here = RosNode("harness_stand_ins")
            self._setting.offer(self.here)

    def kill(self) -> None:
        """Kill the servers and their child processes, as a crash would."""
        self._end(CRASH)

    def stop(self) -> None:
        """Ask the servers to end; kill those that do not."""
        self._end(Patience())
        self._logs.cleanup()

    def check(self) -> None:
        """Raise ContractBroken when a process has ended by itself."""
        self._deaths += self._supervisor.deaths() if self._supervisor else []
        for death in self._deaths:
            log = death.log.read_text(encoding="utf-8", errors="replace")
            raise ContractBroken(f"node {death.name!r} has ended with code {death.code}: {last_words(log)}")

    def _command(self, name: str) -> list[str]:
        command = [sys.executable, "-c", _RUN, self._setting.nodes[name]]
        given = self._setting.node_parameters.get(name, {})
        if given:
            command.append("--ros-args")
        for parameter, value in given.items():
            said = str(value).lower() if isinstance(value, bool) else str(value)
            command += ["-p", f"{parameter}:={said}"]
        return command

    def _end(self, patience: Patience) -> None:
        if self._supervisor is not None:
            self._supervisor.stop(patience)
        self._started.clear()
        self._deaths.clear()
        if self.here is not None:
            self.here.close()
            self.here = None


def last_words(log: str) -> str:
    """Return the last output of a process; of a traceback the error and its last frame."""
    lines = log.strip().splitlines()
    steps = [step for step in map(_STEP.match, lines) if step is not None]
    if steps and not lines[-1].startswith(" "):
        return f"{lines[-1]}; at {steps[-1][1]}:{steps[-1][2]}"
    return "\n".join(lines[-5:]) or "it said nothing"


def _time_of_ours() -> float:
    """Return the time without this thread's waits for a processor, no fault of the driver."""
    try:
        waited = int(SCHEDULED.read_text().split()[1])
    except (OSError, IndexError, ValueError):  # another system, or a kernel that does not count
        waited = 0
    return time.monotonic() - waited * 1e-9


class Bench:
    """A driver on a node of its own, with a referee."""

    def __init__(self, setting: Setting, servers: Servers | None) -> None:
        self._setting = setting
        self._servers = servers
        self.plugin = setting.plugin
        self.waits = setting.waits
        self.ros = RosNode(f"harness_{self.plugin.name}")
        self._open: list[Driver] = []
        self._declared = declarations(self.plugin)
        self._numbers = itertools.count(1)
        try:
            self.referee, self.driver = self.make_driver()
        except ContractBroken:
            self.ros.close()
            raise

    def make_driver(self) -> tuple[Referee, Driver]:
        """Make a driver with a referee of its own; ContractBroken where it cannot be made."""
        again = lambda attempt: self.ros.post(lambda: self._cancel_again(attempt))  # noqa: E731
        referee = Referee(self.plugin, again, self._numbers)
        try:
            driver = make_client(self.plugin, self.ros, referee, self._setting.parameter_values())
        except PluginError as problem:
            raise ContractBroken(str(problem)) from problem
        self._open.append(driver)
        return referee, driver

    # --- what the engine does

    def begin(self, operation: str) -> str:
        """Start an attempt and return its name."""
        name = self.referee.begin(operation)
        arguments = self._setting.arguments_for(operation, self.plugin.operations[operation].arguments)
        self.quickly(f"start of {operation!r}", lambda: self.driver.start(name, operation, arguments))
        return name

    def cancel(self, attempt: str) -> None:
        """Ask for an attempt's end."""
        if attempt in self.referee.attempts:
            self.referee.attempts[attempt].cancelled = True
        self.quickly(f"cancel of {attempt!r}", lambda: self.driver.cancel(attempt))

    def act(self, action: str) -> None:
        """Carry out an action."""
        arguments = self._setting.arguments_for(action, self.plugin.actions[action].arguments)
        self.quickly(f"action {action!r}", lambda: self.driver.act(action, arguments))

    def missing(self) -> list[str]:
        """Return the driver's missing servers."""
        found: list[str] = []
        self.quickly("missing()", lambda: found.extend(self.driver.missing()))
        return found

    def close_driver(self) -> None:
        """Close the driver; every later report is a violation."""
        self._open.remove(self.driver)
        self.quickly("close()", self.driver.close)
        self.referee.closed = True

    def _cancel_again(self, attempt: str) -> None:
        if not self.referee.closed:
            self.cancel(attempt)

    def quickly(self, what: str, call: Callable[[], object]) -> None:
        """Call the driver: it must neither block nor raise."""
        begun = _time_of_ours()
        try:
            call()
        except Exception as problem:
            why = told(problem, self.plugin.client.partition(":")[0])
            raise ContractBroken(f"{what} raises {why}") from problem
        took = _time_of_ours() - begun
        if took > AT_ONCE_S:
            raise ContractBroken(f"{what} blocks: it took {took:.1f} s; call back when there is an answer")

    # --- time

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Spin all nodes until a condition holds.

        Raises:
            ContractBroken: it does not within `PATIENCE_S`, or a server's process has ended.
        """
        end = time.monotonic() + PATIENCE_S
        while not condition():
            if self._servers is not None:
                self._servers.check()
            if time.monotonic() > end:
                raise ContractBroken(f"{what}: not within {PATIENCE_S:g} s{self._seen()}")
            self.ros.spin_once(0.005)
            if self._servers is not None and self._servers.here is not None:
                self._servers.here.spin_once(0.005)

    def _seen(self) -> str:
        reports = [f"{name}: {attempt}" for name, attempt in self.referee.attempts.items()]
        return f"; reports so far: {'; '.join(reports)}" if reports else ""

    def until_ready(self) -> None:
        """Wait until the driver misses nothing.

        Raises:
            ContractBroken: it does not within `PATIENCE_S`, or a network problem explains why it cannot.
        """
        apart: list[str] = []
        since: dict[str, float] = {}
        look_at = time.monotonic() + LOOK_S

        def is_ready_or_apart() -> bool:
            nonlocal look_at, since
            now = time.monotonic()
            if now > look_at:
                since = {problem: since.get(problem, now) for problem in self.network_problems()}
                apart.extend(problem for problem, begun in since.items() if now - begun > FORGOTTEN_S)
                look_at = now + LOOK_S
            return bool(apart) or not self.missing()

        self.until(is_ready_or_apart, f"missing() is to become empty; it names {self.missing()}")
        if apart:
            raise ContractBroken("\n".join(apart))

    def look_around(self) -> None:
        """Wait for discovery: the name of a node that was just found is not known yet."""
        end = time.monotonic() + LOOK_S
        self.until(lambda: time.monotonic() > end, "a look around")

    def network_problems(self) -> list[str]:
        """Return endpoints on the driver's domain whose messages do not arrive (QoS or types)."""
        found = interfaces(self.ros.node)
        return [f"{interface.name}: {problem}" for interface in found for problem in interface.problems]

    def until_heard(self, attempt: str) -> None:
        """Wait until an attempt is accepted, or has ended; raises as `until` does."""
        known = self.referee.attempts[attempt]
        self.until(lambda: known.reports, f"{attempt} is to be accepted")

    def until_ended(self, attempt: str) -> RefereedAttempt:
        """Wait until an attempt has ended; raises as `until` does."""
        known = self.referee.attempts[attempt]
        self.until(lambda: known.ended, f"the end of {attempt}")
        return known

    def prepare(self, operation: str) -> None:
        """Carry out the operations before this one, and reach servers that the driver does not name."""
        for earlier in self._setting.first.get(operation, ()):
            self.succeed(earlier)
        if not self.waits:
            self._insist(operation)

    def succeed(self, operation: str) -> str:
        """Run one attempt to success; return its name."""
        attempt = self.begin_prepared(operation)
        self.until_done(attempt)
        return attempt

    def begin_prepared(self, operation: str) -> str:
        """Start an attempt after all that comes before it; return its name."""
        self.prepare(operation)
        return self.begin(operation)

    def until_done(self, attempt: str) -> None:
        """Wait until an attempt has succeeded; ContractBroken where it ends otherwise, or not in time."""
        known = self.until_ended(attempt)
        if "done" not in known.reports:
            broken = NeedsArguments if "failed" in known.reports else ContractBroken
            raise broken(f"{attempt}: {known}; give arguments with which it succeeds")

    def _insist(self, operation: str) -> str:
        """Repeat attempts until one is done: a driver that does not wait names no missing server."""
        done: list[str] = []
        failed = ""
        attempt, given_up = self.begin(operation), time.monotonic() + TRY_S

        def has_worked() -> bool:
            nonlocal attempt, failed, given_up
            known = self.referee.attempts[attempt]
            if "done" in known.reports:
                done.append(attempt)
            elif known.ended:
                failed = f"{attempt}: {known}" if "failed" in known.reports else failed
                attempt, given_up = self.begin(operation), time.monotonic() + TRY_S
            elif time.monotonic() > given_up and not known.cancelled:
                self.cancel(attempt)
            return bool(done)

        try:
            self.until(has_worked, f"{operation!r} is to be done; give arguments with which it succeeds")
        except ContractBroken as broken:
            if failed:
                raise NeedsArguments(f"{failed}; give arguments with which it succeeds") from None
            raise broken
        return done[0]

    def close(self) -> None:
        """Release everything; raise the violations that the referee has recorded."""
        try:
            for driver in self._open:
                driver.close()
        finally:
            self.ros.close()
        changed = changes(self._declared, declarations(self.plugin))
        problems = [f"the driver changes the catalog: {name}; it is data" for name, *_ in changed]
        problems += dict.fromkeys(self.referee.problems)
        if problems:
            raise ContractBroken("\n".join(problems))


class Lab:
    """Makes benches: with servers, and on an empty domain."""

    def __init__(self, setting: Setting) -> None:
        if not setting.plugin.client:
            raise LupinError(f"plugin {setting.plugin.name!r} has no client: there is no driver to try")
        self.setting = setting
        self.plugin = setting.plugin
        self._domain, self._lonely = 0, 0
        self._hopeless = False
        self.servers: Servers

    @contextlib.contextmanager
    def open(self) -> Iterator[Lab]:
        """Claim the domains; end all servers afterwards."""
        with claimed_domain() as self._domain, claimed_domain() as self._lonely:
            self.servers = Servers(self.setting)
            try:
                yield self
            finally:
                self.servers.stop()

    @contextlib.contextmanager
    def bench(self) -> Iterator[Bench]:
        """Make a bench with servers, and wait until its driver is ready.

        Raises:
            ContractBroken: the driver does not get ready.
            Untried: an earlier one did not, so this one is not waited for.
        """
        if self._hopeless:
            raise Untried("not tried: the driver does not come to work among its servers")
        self._hopeless = True
        self.restart()
        with _on_domain(self._domain):
            bench = Bench(self.setting, self.servers)
        with _closed_after(bench):
            bench.until_ready()
            self._hopeless = False
            yield bench

    def find_out_whether_it_waits(self) -> None:
        """Set `waits` of the setting: the driver waits for servers if it misses one where there is none."""
        with self.lonely_bench() as bench:
            self.setting = replace(self.setting, waits=bool(bench.missing()))

    def restart(self) -> None:
        """Start the servers that do not run."""
        with _on_domain(self._domain):
            self.servers.start()

    @contextlib.contextmanager
    def lonely_bench(self) -> Iterator[Bench]:
        """Make a bench on an empty domain."""
        with _on_domain(self._lonely):
            bench = Bench(self.setting, None)
        with _closed_after(bench):
            yield bench


@contextlib.contextmanager
def _closed_after(bench: Bench) -> Iterator[None]:
    try:
        yield
    except ContractBroken as broken:
        try:
            bench.close()
        except ContractBroken as noted:  # what the referee noted is often the reason
            raise ContractBroken(f"{broken}\n{noted}") from None
        raise
    except BaseException:
        with contextlib.suppress(ContractBroken):
            bench.close()
        raise
    bench.close()


@contextlib.contextmanager
def _on_domain(domain: int) -> Iterator[None]:
    """Run nodes and processes of this block on a domain, on this machine only."""
    wanted = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
