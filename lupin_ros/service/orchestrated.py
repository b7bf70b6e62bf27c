"""A simulation with an orchestrator's interface: publishes its messages, and takes its commands."""

from __future__ import annotations

import json
import uuid
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Protocol

from lupin_engine.errors import LupinError
from lupin_engine.machine import NOTHING, Event, Machine, Refusal, Step, World
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import START, Fields, PageMessage, Publish, time_fields
from lupin_engine.runtime import explanation, missions_record
from lupin_engine.sim import Script, Simulation
from lupin_ros.service import commands, messages, names
from lupin_ros.service.commands import CommandAnswer, CommandMemory, CommandRequest
from lupin_ros.service.drawn import drawn, shown
from lupin_ros.service.reports import PossibleNews, StateMessages, StepMoment, StepNews, published_step


class Audience(Protocol):
    """The receiver of a simulated orchestrator's messages and steps."""

    def take(self, message: PageMessage) -> None:
        """Take a message that is published."""

    def stepped(self, step: Step) -> None:
        """A step was made, and its messages are published."""


class VirtualOrchestrator:
    """A simulated orchestrator, in virtual time.

    Args:
        loaded: the missions, with the chart that is simulated.
        script: the scripted servers and events.
        world: of the chart and its parameters.
        audience: of its messages and steps.
    """

    def __init__(
        self,
        loaded: LoadedMissions,
        script: Script,
        world: World,
        audience: Audience,
    ) -> None:
        self.boot = uuid.uuid4().hex
        #: How many steps were published.
        self.published = 0
        self._loaded = loaded
        self._wire = messages.wire_of(loaded.chart.profile)
        self._audience = audience
        self.simulation = Simulation(loaded.chart, script, {}, world, crashes=True)
        self.simulation.listener = self._stepped
        self._began_ms = self._published_at = self.simulation.wall * 1000.0
        self._origin: tuple[Event | None, Mapping[str, str]] = (None, NOTHING)
        self._commands = CommandMemory()
        self._news, self._foreseen = StepNews(), PossibleNews(self.boot)
        self._offered: Any = None
        self._state = StateMessages(self._wire, self)

    @property
    def at(self) -> float:
        """The time in milliseconds since 1970: it advances with virtual time, also when a clock is set."""
        return max(self._published_at, self._began_ms + self.simulation.now * 1000.0)

    def _moment(self) -> float:
        """Return a unique time for a message, in the order of publishing (up to 1000 in a ms)."""
        self._published_at = max(self._published_at + 0.001, self.at)
        return self._published_at

    def begin(self, picture: Mapping[str, Any]) -> None:
        """Enter the chart's initial states; `picture` is the record of the chart."""
        self._publish_text(names.CHART_TOPIC, {"boot": self.boot, **picture})
        self.simulation.begin()

    def command(self, arguments: Mapping[str, Any], now: float) -> Mapping[str, Any]:
        """Take a command by the fields of its request, at a time of a steady clock; return the response.

        Raises:
            LupinError: a field is no text.
        """
        fields = {name: arguments.get(name, "") for name in CommandRequest.__dataclass_fields__}
        wrong = [name for name, value in fields.items() if not isinstance(value, str)]
        if wrong:
            raise LupinError(f"{names.COMMAND_SERVICE}: {', '.join(wrong)} must be a text")
        asked = CommandRequest(**fields)
        return asdict(self._commands.once(asked, self._loaded.chart, now, self._carry_out))

    def _carry_out(self, asked: CommandRequest) -> CommandAnswer:
        event = commands.read_command(asked, self._loaded.chart, f"sim-{uuid.uuid4().hex[:8]}")
        if isinstance(event, Refusal):
            return commands.refused(event)
        self._origin = event, asked.origin
        return commands.answered(asked, self.simulation.request(event))

    def draw(self, arguments: Mapping[str, Any]) -> Mapping[str, Any]:
        """Draw the chart by the fields of `lupin_engine_msgs/srv/Draw`; errors as for `drawn`."""
        return drawn(self._loaded, arguments)

    def explain(self, arguments: Mapping[str, Any]) -> Mapping[str, Any]:
        """Explain a state or transition by the fields of `lupin_engine_msgs/srv/Explain`, errors included."""

        def explained() -> dict[str, str]:
            machine, now = self.simulation.machine, self.simulation.now
            found = explanation(machine, str(arguments.get("element", "")), now)
            return {"explanation": json.dumps(found, default=str)}

        return shown(self._loaded, arguments, "explanation", explained)

    # -- published messages -----------------------------------------------------------------------------

    def _stepped(self, step: Step) -> None:
        if step.event.name == START and step.accepted:
            self._state.mission_started()
        view = self.simulation.machine.view
        if self._news.is_news(step):
            for command in step.commands:
                if isinstance(command, Publish):
                    self._publish_fields(self._wire.outcomes.name, self._state.outcome(command))
            for moment in step.trail[:-1]:
                self._publish_state(self._state.news(view, moment))
            self._publish_state(self._state.news(view))
            asked, origin = self._origin
            published_at = self._moment()
            at = StepMoment(self.simulation.now, published_at / 1000.0, round(published_at * 1e6))
            origin = origin if step.event is asked else NOTHING
            self._publish_text(
                names.STEPS_TOPIC, published_step(step, view, self._loaded, self.boot, at, origin)
            )
            self.published += 1
        else:
            self._publish_state(self._state.news(view))
        self._audience.stepped(step)

    def publish_news(self) -> None:
        """Publish the available requests and the missions, where they have changed."""
        machine, now = self.simulation.machine, self.simulation.now
        found = self._foreseen.news(machine, self._loaded.hash, now)
        if found is not None:
            self._publish_text(names.POSSIBLE_TOPIC, found)
        missions = missions_record(machine, now, ())
        if missions != self._offered:
            self._offered = missions
            self._publish_text(names.MISSIONS_TOPIC, missions)

    def state(self) -> PageMessage:
        """Return the present state, for periodic publishing."""
        fields = self._state.fields(self.simulation.machine.view)
        return PageMessage(self._wire.state.name, self.at, fields)

    def _publish_state(self, fields: Fields | None) -> None:
        if fields is not None:
            self._publish_fields(self._wire.state.name, fields)

    def _publish_text(self, topic: str, data: Any) -> None:
        self._publish_fields(topic, {"data": json.dumps(data, default=str)})

    def _publish_fields(self, topic: str, fields: Fields) -> None:
        self._audience.take(PageMessage(topic, self._moment(), fields))

    # -- the present, for messages ----------------------------------------------------------------------

    @property
    def machine(self) -> Machine:
        """The machine of the simulation."""
        return self.simulation.machine

    def now(self) -> float:
        """Return the virtual time, in seconds."""
        return self.simulation.now

    def stamp(self) -> Fields:
        """Return the time of the messages as the fields of a `builtin_interfaces/msg/Time`."""
        return time_fields(self.at / 1000.0)
