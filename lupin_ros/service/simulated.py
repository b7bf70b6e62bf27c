"""A simulation for pages: an orchestrator's topics and services, in virtual time.

A further topic publishes the simulation's own state, and a service controls it: pause, run, step, speed, run
until a state, restart, and every fault that the catalogs declare. Only the last `KEPT` messages are kept as
history. A standstill pauses it, with its reason as a note.
"""

from __future__ import annotations

import json
import math
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any, TypedDict

from lupin_engine.errors import LupinError, nearest
from lupin_engine.machine import Step, World
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import Access, PageMessage
from lupin_engine.sim import (
    Effect,
    Hand,
    Read,
    Restart,
    Script,
    SetValue,
    Simulation,
    Standstill,
    Wrong,
    first,
    is_named,
)
from lupin_ros.service import messages, names
from lupin_ros.service.chart_record import chart_picture, chart_record
from lupin_ros.service.orchestrated import VirtualOrchestrator
from lupin_ros.service.pace import Pace

#: The topic with the simulation's state, as JSON, and the service that controls it.
SIMULATION_TOPIC, SIMULATION_SERVICE = "/simulation/state", "/simulation/do"
TEXT_TYPE = "std_msgs/msg/String"
#: The longest that one turn of work may take, and the time between two states that say nothing new, in
#: real seconds.
TURN_S, REPEAT_S = 0.01, 0.2
#: Events that publish nothing are skipped by a step, up to so many.
SILENT = 100
#: Messages that are kept for pages that come later.
KEPT = 200_000
_NOTHING_MORE = "nothing will happen by itself"


class FailureRecord(TypedDict):
    """A code in which an operation can end."""

    code: str
    label: str
    severity: int


class OperationRecord(TypedDict):
    """An operation that could end now: its codes, and the types of its result."""

    operation: str
    codes: list[FailureRecord]
    result: dict[str, str]


class InputRecord(TypedDict):
    """A live value of the chart; `choices` where it is one of a few words."""

    name: str
    type: str
    unit: str
    choices: tuple[str, ...]
    now: Any


class EventRecord(TypedDict):
    """An event that can be sent, and the types of its fields."""

    name: str
    fields: dict[str, str]


class _Standing(TypedDict):
    boot: str
    running: bool
    speed: float | None
    until: str
    note: str
    next: float | None
    operations: list[OperationRecord]
    silent: list[str]
    values: list[InputRecord]
    events: list[EventRecord]


class SimulationRecord(_Standing):
    """The state of a simulation, and the available controls and faults.

    `at` is in milliseconds since 1970, `time` in seconds since its beginning, `clock` the robot's wall clock
    as text. `speed` is a factor of real time, None: as fast as possible; `next` the time of the next event.
    """

    at: float
    time: float
    clock: str


class SimulatedPages:
    """A simulation as a source of pages, which can command it (`plugin.pages.PageSource`).

    Args:
        loaded: the missions, with the chart that is simulated.
        script: the scripted servers and events.
        world: of the chart and its parameters.
        read: parses values as people write them.
        steady: the steady clock, in seconds, by which a turn of work is measured.
        speed: the factor from the beginning on; None: it is paused until a page lets it run.
    """

    def __init__(
        self,
        loaded: LoadedMissions,
        script: Script,
        world: World,
        read: Read,
        steady: Callable[[], float],
        speed: float | None = None,
    ) -> None:
        self._loaded = loaded
        self._chart = loaded.chart
        self._script = script
        self._world = world
        self._steady = steady
        self._wire = messages.wire_of(loaded.chart.profile)
        self._hand = Hand(script, world, read, lambda: self._simulation)
        self._pace = Pace()
        self._page: Callable[[PageMessage], None] = lambda message: None
        self._forget: Callable[[], None] = lambda: None
        self._kept: deque[PageMessage] = deque(maxlen=KEPT)
        self._picture = {**chart_record(loaded), **chart_picture(loaded)}
        self._stopped = False
        self._until = self._note = ""
        self._repeated_at = -math.inf
        self._shown: _Standing | None = None
        self._orchestrator = self._made()
        self._begin()
        if speed is not None:
            self._pace.set_speed(speed, steady(), 0.0)
            self._pace.go(steady(), 0.0)

    @property
    def _simulation(self) -> Simulation:
        return self._orchestrator.simulation

    # -- as a page source -----------------------------------------------------------------------------------

    @property
    def topics(self) -> Mapping[str, str]:
        """The topics of an orchestrator and of the simulation, each with its type."""
        own = (names.STEPS_TOPIC, names.MISSIONS_TOPIC, names.CHART_TOPIC, names.POSSIBLE_TOPIC)
        channels = {one.name: one.type for one in (self._wire.state, self._wire.outcomes)}
        return {**dict.fromkeys((*own, SIMULATION_TOPIC), TEXT_TYPE), **channels}

    @property
    def events(self) -> Collection[str]:
        """The topics of which every message counts: steps and outcomes."""
        return (names.STEPS_TOPIC, self._wire.outcomes.name)

    @property
    def access(self) -> Access:
        """Return the access: viewers may read, operators command the orchestrator and the simulation."""
        viewer = (SIMULATION_TOPIC, *names.ACCESS.viewer)
        return Access(viewer, (SIMULATION_SERVICE, *names.ACCESS.operator))

    def about(self) -> Mapping[str, Any]:
        """Return the mode and the mission's name."""
        return {"mode": "simulation", "title": self._script.mission}

    def begin(self, publish: Callable[[PageMessage], None], forget: Callable[[], None]) -> None:
        """Publish what pages need first; `forget` is called when a simulation begins anew."""
        self._page, self._forget = publish, forget
        for message in {message.topic: message for message in self._kept}.values():
            publish(message)
        self._publish_news(in_any_case=True)

    def clock(self, now: float) -> float:
        """Return the virtual time, in milliseconds since 1970."""
        return self._orchestrator.at

    def stop(self, stopped: bool) -> None:
        """Set the live value of the robot's stop, if the chart has that input."""
        self._stopped = stopped
        spec = self._chart.inputs.get(self._chart.profile.stop)
        if spec is not None:
            self._simulation.do(SetValue(spec.value, stopped))
            self._publish_news()

    def history(self, since: float, topics: Collection[str]) -> Iterator[PageMessage]:
        """Yield the kept messages later than `since`, at most `KEPT`; no topics: of all."""
        for message in list(self._kept):
            if message.at > since and (not topics or message.topic in topics):
                yield message

    def call(self, service: str, arguments: Mapping[str, Any], now: float) -> Mapping[str, Any]:
        """See `PageSource`; LupinError for a service that a simulation does not have."""
        if service == SIMULATION_SERVICE:
            return self._do(arguments, now)
        if service == names.COMMAND_SERVICE:
            answer = self._orchestrator.command(arguments, now)
            self._publish_news()
            return answer
        if service == names.DRAW_SERVICE:
            return self._orchestrator.draw(arguments)
        if service == names.EXPLAIN_SERVICE:
            return self._orchestrator.explain(arguments)
        raise LupinError(f"{service}: a simulation does not have this service")

    def work(self, now: float) -> float | None:
        """Advance for at most `TURN_S`; return the seconds until the next call, None while paused."""
        end = self._steady() + TURN_S
        while self._pace.is_running and self._advance(now) and self._steady() < end:
            pass
        self._publish_news()
        if not self._pace.is_running:
            return None
        due = self._simulation.next_due
        return REPEAT_S if due is None else min(REPEAT_S, self._pace.wait(now, due))

    def _advance(self, now: float) -> bool:
        """Process the next event if it is due; else let time pass."""
        due, target = self._simulation.next_due, self._pace.target(now, self._simulation.now)
        if due is not None and due <= target:
            self._advance_to(due)
            return True
        if target == math.inf:
            self._stand(_NOTHING_MORE)
        else:
            self._simulation.wait_until(max(target, self._simulation.now))
        return False

    # -- what pages do to it --------------------------------------------------------------------------------

    def _do(self, arguments: Mapping[str, Any], now: float) -> Mapping[str, Any]:
        """Carry out a page's request; a wrong one is answered with a message and changes nothing.

        Raises:
            LupinError: the fields are not those of a request.
        """
        word, words = arguments.get("command"), arguments.get("words", [])
        if not isinstance(word, str) or not _are_texts(words):
            raise LupinError(f"{SIMULATION_SERVICE}: it takes a command, and words, which are texts")
        self._note = ""
        try:
            self._act(word, list(words), now)
        except LupinError as wrong:
            return {"success": False, "message": str(wrong)}
        finally:
            self._publish_news()
        return {"success": True, "message": self._note}

    def _act(self, word: str, words: list[str], now: float) -> None:
        controls, effects = self._controls(words, now), self._effects(words)
        if word in controls:
            controls[word]()
        elif word not in effects:
            raise Wrong(f"unknown command {word!r}; {nearest(word, [*controls, *effects])}")
        elif not self._simulation.do(effects[word]()):
            raise Wrong("nothing came of that")

    def _controls(self, words: list[str], now: float) -> Mapping[str, Callable[[], object]]:
        return {
            "run": lambda: self._run(now),
            "pause": lambda: self._stand(""),
            "step": self._step,
            "speed": lambda: self._pace.set_speed(_speed(words), now, self._simulation.now),
            "until": lambda: self._run_until(words, now),
            "again": self._restart,
        }

    def _effects(self, words: list[str]) -> Mapping[str, Callable[[], Effect]]:
        hand = self._hand
        return {
            "fail": lambda: hand.fail(words),
            "done": lambda: hand.done(words),
            "silence": lambda: hand.silence(words),
            "answer": lambda: hand.answer(words),
            "late": lambda: hand.late(words),
            "set": lambda: hand.set(words),
            "send": lambda: hand.send(words),
            "clock": lambda: hand.clock(words),
            "crash": Restart,
        }

    def _run(self, now: float) -> None:
        self._until = ""
        self._pace.go(now, self._simulation.now)

    def _stand(self, note: str) -> None:
        self._pace.stand()
        self._until, self._note = "", note

    def _run_until(self, words: list[str], now: float) -> None:
        known = [name for name in self._chart.states if name]
        wanted = first(words, "until which state", ())
        if not any(is_named(name, wanted) for name in known):
            raise Wrong(f"no state {wanted!r}; {nearest(wanted, known)}")
        self._run(now)
        self._until = wanted

    def _step(self) -> None:
        """Advance to the next event that publishes something."""
        self._stand("")
        before = self._orchestrator.published
        for _ in range(SILENT):
            due = self._simulation.next_due
            if due is None:
                self._note = _NOTHING_MORE
                return
            self._advance_to(due)
            if self._orchestrator.published > before:
                return

    def _advance_to(self, due: float) -> None:
        try:
            self._simulation.advance()
        except Standstill as problem:
            self._stand(str(problem))

    def _restart(self) -> None:
        """Restart the simulation; the history is cleared."""
        self._stand("")
        self._kept.clear()
        self._forget()
        self._orchestrator = self._made()
        self._begin()

    def _made(self) -> VirtualOrchestrator:
        return VirtualOrchestrator(self._loaded, self._script, self._world, self)

    def _begin(self) -> None:
        self._orchestrator.begin(self._picture)
        # Starting up takes no time in most charts; nobody wants to wait for it.
        while self._simulation.next_due == 0.0 and not self._simulation.is_over:
            self._simulation.advance()
        if self._stopped:
            self.stop(True)
        self._publish_news(in_any_case=True)

    def stepped(self, step: Step) -> None:
        """Pause after a step that enters the state up to which the simulation is to run."""
        if self._until and any(is_named(name, self._until) for name in step.entered):
            self._stand(f"{self._until} was entered")

    # -- published messages ---------------------------------------------------------------------------------

    def take(self, message: PageMessage) -> None:
        """Keep a message, and pass it to the page."""
        self._kept.append(message)
        self._page(message)

    def _publish_news(self, in_any_case: bool = False) -> None:
        """Publish changes, the simulation's state, and periodically the mission's state."""
        self._orchestrator.publish_news()
        real = self._steady()
        is_time = in_any_case or real - self._repeated_at >= REPEAT_S
        if is_time:
            self._repeated_at = real
            self._page(self._orchestrator.state())
        shown = self._standing()
        if shown != self._shown or is_time:
            self._shown = shown
            state: SimulationRecord = {
                **shown,
                "at": self._orchestrator.at,
                "time": self._simulation.now,
                "clock": self._simulation.clock,
            }
            text = json.dumps(state, default=str)
            self._page(PageMessage(SIMULATION_TOPIC, self._orchestrator.at, {"data": text}))

    def _standing(self) -> _Standing:
        """Return the simulation's state and the available controls, without the time."""
        catalog, used = self._chart.catalog, self._chart.plugins
        events = {name: event for name, event in catalog.events.items() if name.partition(".")[0] in used}
        return {
            "boot": self._orchestrator.boot,
            "running": self._pace.is_running,
            "speed": None if self._pace.speed == math.inf else self._pace.speed,
            "until": self._until,
            "note": self._note,
            "next": self._simulation.next_due,
            "operations": [self._operation(name) for name in self._hand.operations_under_way()],
            "silent": self._simulation.away,
            "values": [self._value(name) for name in self._chart.inputs],
            "events": [
                {"name": name, "fields": {field: kind.name for field, kind in event.fields.items()}}
                for name, event in events.items()
            ],
        }

    def _operation(self, name: str) -> OperationRecord:
        known = self._chart.catalog.operations[name]
        codes: list[FailureRecord] = [
            {"code": c.name, "label": c.label, "severity": int(c.severity)} for c in known.codes
        ]
        return {"operation": name, "codes": codes, "result": {n: k.name for n, k in known.result.items()}}

    def _value(self, name: str) -> InputRecord:
        kind = self._chart.catalog.values[self._chart.inputs[name].value].type
        return {
            "name": name,
            "type": kind.name,
            "unit": kind.unit,
            "choices": self._hand.choices(name),
            "now": self._simulation.machine.input_value(name, self._simulation.now),
        }


def _are_texts(words: Any) -> bool:
    return isinstance(words, list) and all(isinstance(word, str) for word in words)


def _speed(words: list[str]) -> float:
    text = first(words, "how fast", ("0.1 to 100", "max"))
    try:
        return math.inf if text == "max" else float(text)
    except ValueError:
        raise Wrong(f"{text!r} is no speed; write 0.1 to 100, or max") from None
