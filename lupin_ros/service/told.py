"""What is told of a machine, as plain data: the profile's state and outcomes, steps, what is possible.

Pure: nothing of ROS is imported, and clocks are arguments. The orchestrator publishes it; a simulation shows
it to pages.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, TypedDict

from lupin_engine.machine import Machine, Moment, Step, View
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import Fields, Publish, Wire
from lupin_engine.runtime import Foresight, PossibleRecord, step_record, view_record
from lupin_ros.service import messages


class ToldState:
    """The profile's messages about one mission after the other.

    Args:
        wire: of the profile.
        machine: returns the machine as it is now.
        now: the clock of the machine, in seconds.
        stamp: the same moment as the fields of a `builtin_interfaces/msg/Time`.
    """

    def __init__(
        self,
        wire: Wire,
        machine: Callable[[], Machine],
        now: Callable[[], float],
        stamp: Callable[[], Fields],
    ) -> None:
        self._wire = wire
        self._machine = machine
        self._now = now
        self._stamp = stamp
        self._started: Fields | None = None
        self._told: tuple[object, ...] = ()

    def mission_started(self, at: Fields | None = None) -> None:
        """Note that a mission was accepted, now or at another moment."""
        self._started = at or self._stamp()

    def fields(self, view: View) -> Fields:
        """Return the state as it is."""
        machine = self._machine()
        value, codes = partial(self._value, now=self._now()), machine.chart.codes
        return self._wire.state_fields(
            messages.situation(view, codes, machine.memory.request, value, self._started, self._stamp())
        )

    def news(self, view: View, moment: Moment | None = None) -> Fields | None:
        """Return the state when lifecycle, phase, target or a flag is new, or a code was reported; else None.

        With a `moment` it is that of a view in between.
        """
        if moment is not None:
            view = replace(view, lifecycle=moment.lifecycle, phase=moment.phase, target=moment.target)
        fields = self.fields(view)
        said = (view.lifecycle, view.phase, view.target, view.paused, view.codes, view.mission_id)
        shown = (*said, *(fields[name] for name in self._wire.urgent))
        if shown == self._told:
            return None
        self._told = shown
        return fields

    def outcome(self, published: Publish) -> Fields:
        """Return the message about a target."""
        return self._wire.outcome_fields(published, partial(self._value, now=self._now()), self._stamp())

    def _value(self, name: str, now: float) -> Any:
        machine = self._machine()
        if name in machine.chart.profile.projections:
            return machine.memory.projected.get(name)
        known = name in machine.chart.inputs
        return machine.input_value(name, now) if known else machine.memory.context.get(name)


class StepNews:
    """Which steps are worth telling."""

    def __init__(self) -> None:
        self._noted: dict[str, tuple[str, ...]] = {}

    def is_news(self, step: Step) -> bool:
        """Say whether a step is worth telling.

        Live values come all the time: they are when they change something, or when there is something to note
        that was not noted the last time. The reports of attempts are told even when they change nothing: who
        watches sees what is waited for, and when the last goal has ended.
        """
        if step.event.name != "value" or step.changed:
            return True
        name, notes = str(step.event.data["name"]), tuple(step.notes)
        known = self._noted.get(name, ())
        self._noted[name] = notes
        return notes not in ((), known)


@dataclass(frozen=True)
class StepMoment:
    """When a step was taken: by the machine's clock and the network's, in seconds, and on the wall."""

    time: float
    stamp: float
    wall_ns: int


class CommandOrigin(TypedDict, total=False):
    """Who commanded a step and by which id, as far as that was told."""

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
    """A step, when it was taken, in which start of the orchestrator, on which chart, and what was to be seen.

    `time` is of the clock by which deadlines in `view` are told, `stamp` of the network's, `wall_ns` of the
    wall's.
    """

    command: Annotated[Mapping[str, str], CommandOrigin]


def step_told(
    step: Step, view: View, loaded: LoadedMissions, boot: str, at: StepMoment, origin: Mapping[str, str]
) -> StepRecord:
    """Return the record of a step; `origin` is who commanded it, as far as that is known."""
    told: StepRecord = {
        "time": at.time,
        "stamp": at.stamp,
        "wall_ns": at.wall_ns,
        "boot": boot,
        "chart": loaded.hash,
        "step": step_record(step),
        "view": view_record(view, loaded.chart),
    }
    if origin:
        told["command"] = origin
    return told


class PossibleTold(TypedDict):
    """What each request would do after a step of a start of the orchestrator."""

    boot: str
    chart: str
    sequence: int
    requests: list[PossibleRecord]


class ToldPossible:
    """What each request would do now, when that is other than before."""

    def __init__(self, boot: str) -> None:
        self._boot = boot
        self._foresight: tuple[Machine, Foresight] | None = None
        self._foreseen: list[PossibleRecord] = []

    def forget(self) -> None:
        """Tell it again in any case."""
        self._foreseen = []

    def news(self, machine: Machine, chart_hash: str, now: float) -> PossibleTold | None:
        """Return what is new; where nothing can have changed it costs next to nothing, and None comes."""
        if self._foresight is None or self._foresight[0] is not machine:
            self._foresight = machine, Foresight(machine)
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
