"""The services of the operator: each request is judged, stepped, and answered when its step is flushed."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

from std_srvs.srv import Trigger

from lupin_engine.errors import LupinError, shortened
from lupin_engine.machine import NOTHING, Event, Refusal, Step, all_holds, is_idle
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import (
    ANSWER,
    ANSWER_VERB,
    EXECUTION_CODE,
    START,
    START_VERB,
    StartAnswer,
    classify,
    given_fields,
)
from lupin_engine.runtime import STALE, STALE_AFTER_S, ClientClocks
from lupin_ros.adapter.node import RosNode
from lupin_ros.interfaces.definitions import interface_class
from lupin_ros.orchestrator.journal_gate import JournalGate
from lupin_ros.orchestrator.loop import Loop
from lupin_ros.orchestrator.missions import MissionSwitch
from lupin_ros.orchestrator.step_publisher import StepPublisher
from lupin_ros.service import commands, messages
from lupin_ros.service.commands import CommandAnswer, CommandMemory, CommandRequest
from lupin_ros.service.names import ANSWER_SERVICE, COMMAND_SERVICE, COMMAND_TYPE


class RequestServer:
    """Serves the requests of the profile, the answers of the missions, and the service for all of them."""

    def __init__(
        self,
        ros: RosNode,
        loop: Loop,
        gate: JournalGate,
        publisher: StepPublisher,
        missions: MissionSwitch,
        known: CommandMemory,
    ) -> None:
        """Serve; `known` has the commands that were carried out already."""
        self._ros = ros
        self._loop = loop
        self._wire = messages.wire_of(loop.chart.profile)
        self._gate = gate
        self._publisher = publisher
        self._missions = missions
        self._commands = known
        self._prefix = str(ros.parameters()["mission_id_prefix"])
        self._clients = ClientClocks()
        #: How many requests wait for a check of the folder.
        self._waiting = 0
        #: The events of answers that are served.
        self._answers: set[str] = set()
        self._serve()

    def _serve(self) -> None:
        """Serve all ways in which something can be asked of the mission; all go through `_take`."""
        start = self._wire.start
        self._take(
            _Way(
                interface_class(start.type),
                start.name,
                lambda _: CommandRequest(START_VERB),
                self._read_start,
                self._write_start,
            )
        )
        for name in self._loop.chart.profile.requests:
            self._take(_without_fields(self._wire.requests.format(name), name, Event(f"operator.{name}")))
        self._serve_answers()
        try:
            kind = interface_class(COMMAND_TYPE)
        except LupinError as problem:  # a workspace that was built before this type existed
            self._ros.log.error("no commands can be taken", problem=str(problem))
        else:
            self._take(_Way(kind, COMMAND_SERVICE, _asked, self._read_command, _write_answer))

    def _serve_answers(self) -> None:
        """Serve the missions' answers to questions; the machine refuses those of removed missions."""
        for event in self._loop.chart.answers:
            if event not in self._answers:
                self._answers.add(event)
                service = ANSWER_SERVICE.format(event.removeprefix(ANSWER))
                self._take(_without_fields(service, ANSWER_VERB, Event(event)))

    def _take(self, way: _Way) -> None:
        """Serve a way in: each request is judged by its age, waits for its turn, and is carried out once.

        Its answer leaves after its step is flushed, so it holds whatever happens then.
        """

        def later(request: Any, response: Any, answer: Callable[[Any], None]) -> None:
            def act() -> None:
                written = way.write(response, self._once(way, request))
                try:
                    self._gate.when_flushed(lambda: answer(written))
                except Exception:
                    self._ros.log.exception("answered without the journal", service=way.name)
                    answer(written)

            self._in_turn(act, begins=way.asked(request).verb == START_VERB)

        self._ros.serve_later(
            way.kind,
            way.name,
            later,
            stale_after=lambda request, sent: self._too_old(way.asked(request), sent),
            refuse=lambda response, reason: way.write(response, CommandAnswer(False, STALE, reason)),
            in_every_state=True,
        )

    def _once(self, way: _Way, request: Any) -> CommandAnswer:
        """Carry out a request unless its id is known; where that memory fails, only what stops the robot."""
        answers: list[CommandAnswer] = []

        def carry_out(asked: CommandRequest) -> CommandAnswer:
            answers.append(self._carry_out(asked, way.event(request)))
            return answers[0]

        asked = way.asked(request)
        try:
            return self._commands.once(asked, self._loop.chart, time.monotonic(), carry_out)
        except Exception as problem:
            self._ros.log.exception("the memory of commands failed", service=way.name)
            event = commands.event_name(asked.verb, self._loop.chart) or ""
            if not answers and commands.counts_however_late(event, self._loop.chart):
                carry_out(asked)
            why = f"{asked.verb} refused: {type(problem).__name__}: {problem}"
            return answers[0] if answers else CommandAnswer(False, EXECUTION_CODE, why)

    def _too_old(self, asked: CommandRequest, sent: float) -> float | None:
        """Return the age of a request that is too old; None where it must be carried out.

        No answer is: the machine accepts one only while its question is open.
        """
        now, event = time.monotonic(), commands.event_name(asked.verb, self._loop.chart) or ""
        age = self._clients.age(asked.by[: commands.MAX_WORD], sent, time.time_ns() * 1e-9, now)
        if age <= STALE_AFTER_S or event == ANSWER or self._commands.knows(asked, now):
            return None
        return None if self._counts_however_late(event) else age

    def _counts_however_late(self, event: str) -> bool:
        """Return whether a request is carried out at any age.

        One that would release a hold is not: the robot stands, and would begin to drive.
        """
        if not commands.counts_however_late(event, self._loop.chart):
            return False
        self._loop.work()
        return not self._loop.machine.dry_run(
            Event(event), self._loop.engine.clock.now(), skip_fields=True
        ).releases

    def _in_turn(self, act: Callable[[], None], begins: bool) -> None:
        """Carry out requests in their order; one that begins a mission waits for a check of the folder."""

        def looked(loaded: LoadedMissions | None) -> None:
            self._waiting -= 1
            self.adopt(loaded)
            act()

        if self._waiting or (begins and is_idle(self._loop.machine)):
            self._waiting += 1
            self._missions.look(looked)
        else:
            act()

    def adopt(self, loaded: LoadedMissions | None) -> None:
        """Adopt changed missions, and serve their answers."""
        self._missions.adopt(loaded)
        self._serve_answers()

    def _read_command(self, request: Any) -> Event | Refusal:
        return commands.read_command(_asked(request), self._loop.chart, self._new_mission_id())

    def _read_start(self, request: Any) -> Event:
        asked = self._wire.start.read_request(messages.read(request))
        named = {"mission_type": asked.mission, "mission_id": self._new_mission_id()}
        return Event(START, {**named, **given_fields(asked.request)})

    def _write_start(self, response: Any, answer: CommandAnswer) -> Any:
        reason = "" if answer.accepted else answer.message
        fields = self._wire.start.answer_fields(StartAnswer(answer.accepted, answer.mission_id, reason))
        return messages.write(response, fields)

    def _carry_out(self, asked: CommandRequest, event: Event | Refusal) -> CommandAnswer:
        if isinstance(event, Refusal):
            self._ros.log.info("command", verb=shortened(asked.verb), answer=event.text, **asked.origin)
            return commands.refused(event)
        step = self.ask(event, asked.origin)
        answer = commands.answered(asked, step)
        more = self._ros.guarded(partial(self._missions.why_unknown, step))() or ""
        return replace(answer, message=answer.message + more)

    def _new_mission_id(self) -> str:
        return f"{self._prefix}-{uuid.uuid4().hex[:8]}"

    def _inactive(self, event: Event) -> Refusal | None:
        """Return why a node that is not active refuses a request: it takes only what stops the robot."""
        if not self._ros.inactive or self._counts_however_late(event.name):
            return None
        return Refusal(commands.INACTIVE, f"{_verb(event)} refused: {self._ros.inactive}")

    # -- of programs ------------------------------------------------------------------------------------

    def start(self, asked: CommandRequest, sent: float, answered: Callable[[CommandAnswer], None]) -> None:
        """Start a mission for a program; `sent` is when it asked, in POSIX time, or 0."""

        def act() -> None:
            event = commands.read_command(asked, self._loop.chart, self._new_mission_id())
            answered(self._carry_out(asked, self._of_program(event)))

        if sent and (age := self._too_old(asked, sent)) is not None:
            text = f"refused: the goal is {age:.1f} s old, or the clocks of the two computers disagree"
            answered(CommandAnswer(False, STALE, text))
        else:
            self._in_turn(act, begins=True)

    def abort(self, by: str) -> bool:
        """Abort the mission for a program; return whether that is accepted."""
        asked = CommandRequest(self._loop.chart.profile.abort, by=by)
        event = self._of_program(Event(f"operator.{asked.verb}"))
        return self._carry_out(asked, event).accepted

    def _of_program(self, event: Event | Refusal) -> Event | Refusal:
        """Return what a program asks; a refusal where that would release a hold: only people do that."""
        if isinstance(event, Refusal):
            return event
        self._loop.work()
        machine, now = self._loop.machine, self._loop.engine.clock.now()
        released = machine.dry_run(event, now, skip_fields=True).releases
        if not released:
            return event
        code = all_holds(machine.chart)[released[0]].code
        label = classify(code, machine.chart.codes).label
        return Refusal(
            code, f"{_verb(event)} refused: {label}; only a person releases this hold: resume first"
        )

    # -- one step ---------------------------------------------------------------------------------------

    def ask(self, event: Event, origin: Mapping[str, str] = NOTHING) -> Step:
        self._publisher.origin = event, origin
        self._loop.work()
        try:
            now = self._loop.engine.clock.now()
            refusal = self._inactive(event) or self._gate.admit(event, self._loop.machine, now)
        except Exception as problem:
            self._ros.log.exception("request could not be judged", request=event.name)
            # A request that stops the robot is carried out without a judgement.
            stops = commands.counts_however_late(event.name, self._loop.chart)
            why = f"{_verb(event)} refused: {type(problem).__name__}: {problem}"
            refusal = None if stops else Refusal(EXECUTION_CODE, why)
        if refusal is None:
            step = self._loop.engine.request(event, origin)
        else:
            memory, now = self._loop.machine.memory, self._loop.engine.clock.now()
            step = Step(memory.sequence, now, event, memory.configuration, accepted=False, refusal=refusal)
        self._loop.work()
        answer = "accepted" if step.accepted else step.refusal.text if step.refusal else "refused"
        self._ros.guarded(
            partial(self._ros.log.info, "request", request=event.name, answer=answer, **origin)
        )()
        return step


@dataclass(frozen=True)
class _Way:
    """A service as a way of requests into the machine.

    `asked` says of a request who asks for what, `event` what that is for the machine, or why it is refused,
    when its turn has come; `write` writes the answer into a response.
    """

    kind: Any
    name: str
    asked: Callable[[Any], CommandRequest]
    event: Callable[[Any], Event | Refusal]
    write: Callable[[Any, CommandAnswer], Any]


def _verb(event: Event) -> str:
    return event.name.rpartition(".")[2]


def _without_fields(service: str, verb: str, event: Event) -> _Way:
    """Return the way of a request that says no more than its service's name."""

    def write(response: Any, answer: CommandAnswer) -> Any:
        response.success, response.message = answer.accepted, answer.message
        return response

    return _Way(Trigger, service, lambda _: CommandRequest(verb), lambda _: event, write)


def _asked(request: Any) -> CommandRequest:
    return CommandRequest(**messages.read(request))


def _write_answer(response: Any, answer: CommandAnswer) -> Any:
    return messages.write(response, asdict(answer))
