"""A small robot world for tests: nodes as separate processes on a private domain, and an operator."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import Parameter as RosParameter
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from std_srvs.srv import Trigger

from lupin_engine_msgs.srv import Command
from lupin_msgs.msg import MissionState, Observation
from lupin_msgs.srv import StartMission
from lupin_ros.adapter.node import CallFailure, Qos, RosNode
from lupin_ros.adapter.process import SUPERVISED
from lupin_ros.service.names import COMMAND_SERVICE

#: Every wait ends; generous, because the machine may be busy.
PATIENCE = 60.0


class Operator:
    """What an HMI does: watches the state and the observations, calls the services."""

    def __init__(self, name: str = "operator") -> None:
        self.ros = RosNode(name)
        self.states: list[MissionState] = []
        self.observations: list[Observation] = []
        self.ros.subscribe(MissionState, "/mission/state", Qos.BACKLOG, self.states.append)
        self.ros.subscribe(Observation, "/floranova/observations", Qos.BACKLOG, self.observations.append)
        self._callers: dict[str, Any] = {}

    def until(self, condition: Callable[[], Any], what: str, timeout: float = PATIENCE) -> None:
        """Work until `condition` holds; fail saying what was awaited and what was last seen."""
        end = time.monotonic() + timeout
        while not condition():
            last = self.states[-1] if self.states else None
            seen = f"{last.lifecycle_state}/{last.mission_phase} {last.last_error!r}" if last else "no state"
            assert time.monotonic() < end, f"{what}: not within {timeout:g} s; last seen: {seen}"
            self.ros.spin_once(0.05)

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """Call a service and return its answer."""
        if name not in self._callers:
            self._callers[name] = self.ros.service(kind, name)
        caller, answers = self._callers[name], []
        self.until(caller.ready, f"service {name}")
        caller.call(request, PATIENCE, answers.append)
        self.until(lambda: answers, f"answer of {name}")
        assert not isinstance(answers[0], CallFailure), answers[0]
        return answers[0]

    def start(self, *tags: str, mission: str = "InspectionMission") -> Any:
        """Call StartMission."""
        request = StartMission.Request(mission_type=mission, tag_sequence=list(tags))
        return self.call(StartMission, "/mission/start", request)

    def ask(self, name: str) -> Any:
        """Call one of the Trigger services."""
        return self.call(Trigger, f"/mission/{name}", Trigger.Request())

    def resume(self) -> None:
        """Resume what a new orchestrator holds, with an id, asked again until it is answered.

        A server that has just come may not know yet where to send its answer to, and a request may go to
        the one that died.
        """
        request = Command.Request(verb="resume", command_id=str(uuid.uuid4()))
        caller, answers = self.ros.service(Command, COMMAND_SERVICE), []

        def take(answer: Any) -> None:
            if isinstance(answer, CallFailure):
                caller.call(request, 3.0, take)
            else:
                answers.append(answer)

        caller.call(request, 3.0, take)
        self.until(lambda: answers, "the answer to resume")
        assert answers[0].accepted, answers[0].message

    def set_parameter(self, node: str, name: str, value: Any) -> None:
        """Set a parameter of another node, as `ros2 param set` does."""
        request = SetParameters.Request(parameters=[RosParameter(name=name, value=_value(value))])
        answer = self.call(SetParameters, f"/{node}/set_parameters", request)
        assert answer.results[0].successful, answer.results[0].reason

    def hit(self, goals: int, fault: str) -> None:
        """Let something go wrong with the next goals of the simulated robot, with each until it has ended."""
        self.set_parameter("lupin_sim", "fault_count", goals)
        self.set_parameter("lupin_sim", "fault", fault)

    def struck(self) -> None:
        """Wait until that has met the last of its goals: the state is told before the robot gets its goal."""
        request = GetParameters.Request(names=["fault"])

        def left() -> str:
            values = self.call(GetParameters, "/lupin_sim/get_parameters", request).values
            return str(values[0].string_value)

        self.until(lambda: left() == "none", "the goal that is hit")

    @property
    def state(self) -> MissionState:
        """The last state seen."""
        return self.states[-1]

    def in_state(self, lifecycle: str, phase: str | None = None) -> None:
        """Wait until the last state seen is that one."""
        self.until(
            lambda: (
                self.states
                and self.state.lifecycle_state == lifecycle
                and (phase is None or self.state.mission_phase == phase)
            ),
            f"{lifecycle}/{phase or '*'}",
        )

    def held(self) -> None:
        """Wait until the mission is held."""
        self.until(lambda: self.states and self.state.paused, "held")

    def until_done(self, published: int) -> None:
        """Wait until the mission has ended and so many observations have come: two topics keep no order."""
        self.in_state("DONE")
        self.until(lambda: len(self.observations) >= published, f"{published} observations")

    def seen(self) -> list[str]:
        """The states seen, each change once, as LIFECYCLE or LIFECYCLE/PHASE."""
        names = [s.lifecycle_state + (f"/{s.mission_phase}" if s.mission_phase else "") for s in self.states]
        return [name for i, name in enumerate(names) if i == 0 or names[i - 1] != name]


def _value(value: Any) -> ParameterValue:
    if isinstance(value, bool):
        return ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=value)
    if isinstance(value, str):
        return ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=value)
    if isinstance(value, int):
        return ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=value)
    return ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=float(value))


class World:
    """Node processes, started and stopped; whatever is left at the end is killed and is a failure."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        # Nobody writes: the nodes end with this process, however that ends (see `ros.adapter.process`).
        self._lifeline = [os.fdopen(end, mode) for end, mode in zip(os.pipe(), ("rb", "wb"), strict=True)]
        self.processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, node: str, **parameters: Any) -> subprocess.Popen[bytes]:
        """Start `lupin node NODE` with parameters; its output goes to a file of the test's folder."""
        given = [part for name, value in parameters.items() for part in ("-p", f"{name}:={_text(value)}")]
        command = [str(Path(sys.executable).with_name("lupin")), "node", node]
        if given:
            command += ["--ros-args", *given]
        return self.run(node, command)

    def run(self, node: str, command: Sequence[str]) -> subprocess.Popen[bytes]:
        """Start any process under the name of a node."""
        with self.log(node).open("ab") as output:
            self.processes[node] = subprocess.Popen(
                command,
                stdin=self._lifeline[0],
                stdout=output,
                stderr=subprocess.STDOUT,
                env={**os.environ, SUPERVISED: "1"},
                start_new_session=True,
            )
        return self.processes[node]

    def start_all(self, *, speed: float = 20.0, **parameters: Any) -> None:
        """Start what an inspection needs.

        A robot that is silent for 2 s counts as stopped; on a busy machine it is only not let work.
        """
        self.start("greenhouse_bridge")
        self.start("lupin_sim", speed=0.5 * speed)
        self.start("mission_orchestrator", **{"estop_timeout_s": 10.0, **parameters})

    def start_search(self, **given: Any) -> None:
        """Start what an exploration needs: somebody must say where tags are."""
        self.start("perception_aggregator")
        self.start_all(**given)

    def log(self, node: str) -> Path:
        """The file with a node's output."""
        return self._folder / f"{node}.log"

    def stop(self) -> list[str]:
        """Ask every process to end and wait; return the nodes that had to be killed."""
        for process in self.processes.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        stubborn = []
        for node, process in self.processes.items():
            try:
                process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait(10.0)
                stubborn.append(node)
        for end in self._lifeline:
            end.close()
        return stubborn


def _text(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
