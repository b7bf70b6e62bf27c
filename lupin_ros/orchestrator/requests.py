"""The services of the operator: each request is judged, stepped, and answered when its step is flushed."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from functools import partial
from typing import Any

from std_srvs.srv import Trigger

from lupin_engine.errors import LupinError, shortened
from lupin_engine.machine import NOTHING, Event, Refusal, Step, is_idle
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import ANSWER, EXECUTION_CODE, START, START_VERB, StartAnswer, given_fields
from lupin_engine.runtime import STALE, STALE_AFTER_S, ClientClocks
from lupin_ros.adapter.executor import StaleAfter
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
        self._serve_commands()
        self.serve_answers()

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
        for name in self._loop.chart.profile.requests:
            event = f"operator.{name}"
            refuse = partial(_refuse, field="message")
            judge = partial(self._too_old, event)
            self._answer_when_flushed(
                Trigger,
                self._wire.requests.format(name),
                _answering(self.ask, event),
                stale_after=judge,
                refuse=refuse,
            )

    def _too_old(self, event: str, _: Any, sent: float) -> float | None:
        """Return the age of a request that is too old; None where it must be carried out."""
        age = self._age("", sent)
        return age if age > STALE_AFTER_S and not self._counts_however_late(event) else None

    def _age(self, client: str, sent: float) -> float:
        return self._clients.age(client, sent, time.time_ns() * 1e-9, time.monotonic())

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
        self.serve_answers()

    def serve_answers(self) -> None:
        """Serve the missions' answers to questions; the machine refuses those of removed missions.

        None is stale: the machine accepts an answer only while its question is open.
        """
        for event in self._loop.chart.answers:
            if event not in self._answers:
                self._answers.add(event)
                self._answer_when_flushed(
                    Trigger,
                    ANSWER_SERVICE.format(event.removeprefix(ANSWER)),
                    _answering(self.ask, event),
                )

    def _serve_commands(self) -> None:
        """Serve the service for all requests; it carries out each command id once and records who asked."""

        def too_old(request: Any, sent: float) -> float | None:
            asked = _asked(request)
            age = self._age(asked.by[: commands.MAX_WORD], sent)
            event = commands.event_name(asked.verb, self._loop.chart) or ""
            if age <= STALE_AFTER_S or event == ANSWER or self._commands.knows(asked, time.monotonic()):
                return None
            return None if self._counts_however_late(event) else age

        def command(request: Any, response: Any) -> Any:
            answer = self._commands.once(_asked(request), self._loop.chart, time.monotonic(), self._carry_out)
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
        event = commands.read_command(asked, self._loop.chart, self._new_mission_id())
        if isinstance(event, Refusal):
            self._ros.log.info("command", verb=shortened(asked.verb), answer=event.text, **asked.origin)
            return commands.refused(event)
        step = self.ask(event, asked.origin)
        answer = commands.answered(asked, step)
        return replace(answer, message=answer.message + self._missions.why_unknown(step))

    def _start(self, request: Any, response: Any) -> Any:
        asked = self._wire.start.read_request(messages.read(request))
        mission_id = self._new_mission_id()
        named = {"mission_type": asked.mission, "mission_id": mission_id}
        step = self.ask(Event(START, {**named, **given_fields(asked.request)}))
        if step.accepted:
            return self._answer(response, StartAnswer(True, mission_id))
        reason = (step.refusal.text if step.refusal else "") + self._missions.why_unknown(step)
        return self._answer(response, StartAnswer(False, reason=reason))

    def _new_mission_id(self) -> str:
        return f"{self._prefix}-{uuid.uuid4().hex[:8]}"

    def _answer(self, response: Any, answer: StartAnswer) -> Any:
        return messages.write(response, self._wire.start.answer_fields(answer))

    def ask(self, event: Event, origin: Mapping[str, str] = NOTHING) -> Step:
        self._publisher.origin = event, origin
        self._loop.work()
        try:
            refusal = self._refusal(event)
        except Exception as problem:
            self._ros.log.exception("request could not be judged", request=event.name)
            # A request that stops the robot is carried out without a judgement.
            stops = commands.counts_however_late(event.name, self._loop.chart)
            why = f"{event.name.rpartition('.')[2]} refused: {type(problem).__name__}: {problem}"
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

    def _refusal(self, event: Event) -> Refusal | None:
        """Return why a request is refused without a step; else begin the file of a mission that it starts."""
        foreseen = self._loop.machine.dry_run(event, self._loop.engine.clock.now())
        refusal = self._gate.refusal(event, foreseen, self._loop.chart.profile)
        if refusal is None:
            self._gate.before_request(event, foreseen, self._loop.machine)
        return refusal


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
