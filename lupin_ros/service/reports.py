"""Builds a machine's reports as plain data: state and outcomes by the profile, steps, available requests.

Pure: no ROS, and clocks are arguments. The orchestrator publishes them; a simulation shows them to pages.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, Protocol, TypedDict

from lupin_engine.machine import Machine, Moment, Step, View
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import Fields, Publish, Wire
from lupin_engine.runtime import PossibleRecord, RequestPreview, step_record, view_record
from lupin_ros.service import messages


class Present(Protocol):
    """A machine at a moment."""

    @property
    def machine(self) -> Machine:
        """The machine."""

    def now(self) -> float:
        """Return the time of the machine's clock, in seconds."""

    def stamp(self) -> Fields:
        """Return the same moment as the fields of a `builtin_interfaces/msg/Time`."""


class StateMessages:
    """The profile's messages, by its `wire`, about one mission after the other."""

    def __init__(self, wire: Wire, present: Present) -> None:
        self._wire = wire
        self._present = present
        self._started: Fields | None = None
        self._published: tuple[object, ...] = ()

    def mission_started(self, at: Fields | None = None) -> None:
        """Record that a mission was accepted, now or at another moment."""
        self._started = at or self._present.stamp()

    def fields(self, view: View) -> Fields:
        """Return the state message."""
        machine = self._present.machine
        value, codes = partial(self._value, now=self._present.now()), machine.chart.codes
        return self._wire.state_fields(
            messages.situation(
                view, codes, machine.memory.request, value, self._started, self._present.stamp()
            )
        )

    def news(self, view: View, moment: Moment | None = None) -> Fields | None:
        """Return the state if lifecycle, phase, target or a flag has changed, or a code was reported; else
        None.

        With a `moment` it is that of a microstep in between.
        """
        if moment is not None:
            view = replace(view, lifecycle=moment.lifecycle, phase=moment.phase, target=moment.target)
        fields = self.fields(view)
        said = (view.lifecycle, view.phase, view.target, view.paused, view.codes, view.mission_id)
        shown = (*said, *(fields[name] for name in self._wire.urgent))
        if shown == self._published:
            return None
        self._published = shown
        return fields

    def outcome(self, published: Publish) -> Fields:
        """Return the message about a target."""
        return self._wire.outcome_fields(
            published, partial(self._value, now=self._present.now()), self._present.stamp()
        )

    def _value(self, name: str, now: float) -> Any:
        machine = self._present.machine
        if name in machine.chart.profile.projections:
            return machine.memory.projected.get(name)
        known = name in machine.chart.inputs
        return machine.input_value(name, now) if known else machine.memory.context.get(name)


class StepNews:
    """Filters the steps that are published."""

    def __init__(self) -> None:
        self._noted: dict[str, tuple[str, ...]] = {}

    def is_news(self, step: Step) -> bool:
        """Return whether to publish a step.

        Steps by live values are published only if they change something, or have other notes than the last
        one of that value. All others are, since watchers want to see attempts end.
        """
        if step.event.name != "value" or step.changed:
            return True
        name, notes = str(step.event.data["name"]), tuple(step.notes)
        known = self._noted.get(name, ())
        self._noted[name] = notes
        return notes not in ((), known)


@dataclass(frozen=True)
class StepMoment:
    """The time of a step: by the machine's clock and the network's, in seconds, and the wall clock."""

    time: float
    stamp: float
    wall_ns: int


class CommandOrigin(TypedDict, total=False):
    """Who commanded a step and by which id, if known."""

    by: str
    command_id: str


class _TakenStep(TypedDict):
    time: float
    stamp: float
    wall_ns: int
    boot: str
    chart: str
    step: Annotated[dict[str, Any], Step]
    view: Annotated[dict[str, Any], View]


class StepRecord(_TakenStep, total=False):
    """A step with its times, the orchestrator's session id (`boot`), the chart's hash, and the view after it.

    `time` is of the clock of the deadlines in `view`, `stamp` of the network's, `wall_ns` of the wall's.
    """

    command: Annotated[Mapping[str, str], CommandOrigin]


def published_step(
    step: Step, view: View, loaded: LoadedMissions, boot: str, at: StepMoment, origin: Mapping[str, str]
) -> StepRecord:
    """Return the record of a step; `origin` is its command's caller and id, if known."""
    record: StepRecord = {
        "time": at.time,
        "stamp": at.stamp,
        "wall_ns": at.wall_ns,
        "boot": boot,
        "chart": loaded.hash,
        "step": step_record(step),
        "view": view_record(view, loaded.chart),
    }
    if origin:
        record["command"] = origin
    return record


class PublishedPossible(TypedDict):
    """The dry run of each request after step `sequence` of an orchestrator's session (`boot`)."""

    boot: str
    chart: str
    sequence: int
    requests: list[PossibleRecord]


class PossibleNews:
    """The dry run of each request, published when it changes."""

    def __init__(self, boot: str) -> None:
        self._boot = boot
        self._foresight: tuple[Machine, RequestPreview] | None = None
        self._foreseen: list[PossibleRecord] = []

    def forget(self) -> None:
        """Publish the next one in any case."""
        self._foresight, self._foreseen = None, []

    def news(self, machine: Machine, chart_hash: str, now: float) -> PublishedPossible | None:
        """Return the record if it has changed, else None; cheap where nothing can have changed."""
        if self._foresight is None or self._foresight[0] is not machine:
            self._foresight = machine, RequestPreview(machine)
        found = self._foresight[1].news(now)
        if found is None or found == self._foreseen:
            return None
        self._foreseen = found
        return {
            "boot": self._boot,
            "chart": chart_hash,
            "sequence": machine.memory.sequence,
            "requests": found,
        }
