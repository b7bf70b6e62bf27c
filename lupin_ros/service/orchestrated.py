"""One simulation that tells what an orchestrator tells, and takes its commands; from its beginning on."""

from __future__ import annotations

import json
import uuid
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

from lupin_engine.errors import LupinError
from lupin_engine.machine import NOTHING, Event, Refusal, Step, World
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import START, Fields, PageMessage, Publish, time_fields
from lupin_engine.runtime import explanation, missions_record
from lupin_engine.sim import Script, Simulation
from lupin_ros.service import commands, messages, names
from lupin_ros.service.commands import CommandAnswer, CommandMemory, CommandRequest
from lupin_ros.service.drawn import drawn, shown
from lupin_ros.service.told import StepMoment, StepNews, ToldPossible, ToldState, step_told


class VirtualOrchestrator:
    """A simulation with an orchestrator's mouth and ears.

    Args:
        loaded: the missions, with the chart that is simulated.
        script: what happens by itself.
        world: of the chart and its parameters.
        tell: is called with every message.
        stepped: is called after every step, when it has been told.
    """

    def __init__(
        self,
        loaded: LoadedMissions,
        script: Script,
        world: World,
        tell: Callable[[PageMessage], None],
        stepped: Callable[[Step], None],
    ) -> None:
        self.boot = uuid.uuid4().hex
        #: How many steps were told.
        self.told = 0
        self._loaded = loaded
        self._wire = messages.wire_of(loaded.chart.profile)
        self._tell = tell
        self._listener = stepped
        self.simulation = Simulation(loaded.chart, script, {}, world, crashes=True)
        self.simulation.listener = self._stepped
        self._began_ms = self._told_at = self.simulation.wall * 1000.0
        self._origin: tuple[Event | None, Mapping[str, str]] = (None, NOTHING)
        self._commands = CommandMemory()
        self._news, self._foreseen = StepNews(), ToldPossible(self.boot)
        self._offered: Any = None
        self._state = ToldState(
            self._wire, lambda: self.simulation.machine, lambda: self.simulation.now, self._stamp
        )

    @property
    def at(self) -> float:
        """The time in milliseconds since 1970: it goes on as virtual time does, also when a clock is set."""
        return max(self._told_at, self._began_ms + self.simulation.now * 1000.0)

    def _moment(self) -> float:
        """Return the time for something that is told; of what happens at once, each has its own.

        So whoever puts it in order does so as it happened. A millisecond has room for a thousand.
        """
        self._told_at = max(self._told_at + 0.001, self.at)
        return self._told_at

    def begin(self, picture: Mapping[str, Any]) -> None:
        """Enter the chart's initial states; `picture` is the record of the chart."""
        self._tell_text(names.CHART_TOPIC, {"boot": self.boot, **picture})
        self.simulation.begin()

    def command(self, arguments: Mapping[str, Any], now: float) -> Mapping[str, Any]:
        """Take a command by the fields of its request, at a time of a steady clock, and return the response.

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
        """Draw the chart as a display asks for it by the fields of `lupin_engine_msgs/srv/Draw`."""
        return drawn(self._loaded, arguments)

    def explain(self, arguments: Mapping[str, Any]) -> Mapping[str, Any]:
        """Explain a state or transition by the fields of `lupin_engine_msgs/srv/Explain`."""

        def told() -> dict[str, str]:
            machine, now = self.simulation.machine, self.simulation.now
            found = explanation(machine, str(arguments.get("element", "")), now)
            return {"explanation": json.dumps(found, default=str)}

        return shown(self._loaded, arguments, "explanation", told)

    # -- what is told -----------------------------------------------------------------------------------

    def _stepped(self, step: Step) -> None:
        if step.event.name == START and step.accepted:
            self._state.mission_started()
        view = self.simulation.machine.view
        if self._news.is_news(step):
            for command in step.commands:
                if isinstance(command, Publish):
                    self._say(self._wire.outcomes.name, self._state.outcome(command))
            for moment in step.trail[:-1]:
                self._say_state(self._state.news(view, moment))
            self._say_state(self._state.news(view))
            asked, origin = self._origin
            told_at = self._moment()
            at = StepMoment(self.simulation.now, told_at / 1000.0, round(told_at * 1e6))
            origin = origin if step.event is asked else NOTHING
            self._tell_text(names.STEPS_TOPIC, step_told(step, view, self._loaded, self.boot, at, origin))
            self.told += 1
        else:
            self._say_state(self._state.news(view))
        self._listener(step)

    def tell_news(self) -> None:
        """Tell what is possible and which missions there are, where that is new."""
        machine, now = self.simulation.machine, self.simulation.now
        found = self._foreseen.news(machine, self._loaded.hash, now)
        if found is not None:
            self._tell_text(names.POSSIBLE_TOPIC, found)
        missions = missions_record(machine, now, ())
        if missions != self._offered:
            self._offered = missions
            self._tell_text(names.MISSIONS_TOPIC, missions)

    def state(self) -> PageMessage:
        """Return the state as it is, to be told again."""
        fields = self._state.fields(self.simulation.machine.view)
        return PageMessage(self._wire.state.name, self.at, fields)

    def _say_state(self, fields: Fields | None) -> None:
        if fields is not None:
            self._say(self._wire.state.name, fields)

    def _tell_text(self, topic: str, data: Any) -> None:
        self._say(topic, {"data": json.dumps(data, default=str)})

    def _say(self, topic: str, fields: Fields) -> None:
        self._tell(PageMessage(topic, self._moment(), fields))

    def _stamp(self) -> Fields:
        return time_fields(self.at / 1000.0)
