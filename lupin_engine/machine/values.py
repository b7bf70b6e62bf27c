"""Live values: taken in, bounded, compared with their levels, and growing old."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from typing import Any

from lupin_engine.chart.model import Input, Level
from lupin_engine.errors import reason
from lupin_engine.machine.core import Core
from lupin_engine.machine.event import Event
from lupin_engine.machine.memory import Reported
from lupin_engine.machine.turn import Turn
from lupin_engine.plugin.types import Notation, problems


class Values:
    """The live values of one machine."""

    __slots__ = ("_core",)

    def __init__(self, core: Core) -> None:
        self._core = core

    def begin(self, turn: Turn) -> None:
        """Set what the chart starts with."""
        for spec in self._core.chart.inputs.values():
            self._begin(spec, turn)

    def go_on(self, turn: Turn) -> None:
        """Begin what is not known, and compare what is known with the levels as they are now."""
        for spec in self._core.chart.inputs.values():
            known = self._core.memory.inputs.get(spec.name)
            if known is None or _flaw(spec, known.value):
                self._core.memory.inputs.pop(spec.name, None)
                self._begin(spec, turn)
            else:
                self._set(spec, known, turn)

    def begin_mission(self, turn: Turn) -> None:
        """Forget what was reported before the mission of those inputs that are about it.

        Of a list the last report is remembered all the same: who tells it again has nothing new to tell.
        """
        memory = self._core.memory
        for spec in self._core.chart.inputs.values():
            if spec.of_mission:
                if spec.name in memory.heard:
                    memory.before[spec.name] = memory.heard.pop(spec.name)
                memory.inputs.pop(spec.name, None)
                for level in spec.levels:
                    memory.levels.pop(f"input.{spec.name}.{level.name}", None)
                self._core.timers.disarm("fresh", spec.name)
                self._begin(spec, turn)

    def _begin(self, spec: Input, turn: Turn) -> None:
        if spec.initial is not None:
            self._set(spec, Reported(spec.initial, turn.now, reported=False), turn)

    def observe(self, event: Event, turn: Turn) -> None:
        """Take in a report; one that is older than the last, or out of the declared range, is dropped."""
        data = event.data
        for spec in self._core.chart.inputs.values():
            if spec.value != data["name"]:
                continue
            known = self._core.memory.inputs.get(spec.name)
            flaw = _flaw(spec, data["value"])
            if flaw:
                turn.note(f"dropped: input.{spec.name} is {flaw}: {reprlib.repr(data['value'])}")
            elif spec.of_mission and not self._is_of_mission(data["stamp"]):
                if spec.type.kind == "list":
                    self._core.memory.before[spec.name] = list(data["value"])
                turn.note(f"dropped: a report of input.{spec.name} from before the mission")
            elif known is not None and known.reported and data["stamp"] < known.stamp:
                turn.note(f"dropped: a report of input.{spec.name} that is older than the last")
            else:
                self._set(spec, Reported(self._news(spec, data["value"]), data["stamp"]), turn)

    def _news(self, spec: Input, value: Any) -> Any:
        """Return what counts of a report: of a list about the mission, what was not the same before it.

        A registry that forgets nothing tells the finds of earlier missions again and again.
        """
        if not spec.of_mission or spec.type.kind != "list":
            return value
        self._core.memory.heard[spec.name] = list(value)
        before = self._core.memory.before.get(spec.name, ())
        return [item for item in value if item not in before]

    def _is_of_mission(self, stamp: float) -> bool:
        started = self._core.memory.started_at
        return started is not None and stamp >= started

    def _set(self, spec: Input, found: Reported, turn: Turn) -> None:
        known = self._core.memory.inputs.get(spec.name)
        self._core.memory.inputs[spec.name] = found
        for level in spec.levels:
            name = f"input.{spec.name}.{level.name}"
            try:
                self._core.memory.levels[name] = self._is_reached(level, name, found.value, turn)
            except Exception as problem:
                turn.fail("", f"{level.place}: level {level.name}: {reason(problem)}")
        self._watch_age(spec, known, found, turn)

    def _watch_age(self, spec: Input, known: Reported | None, found: Reported, turn: Turn) -> None:
        """Look again when the value will have grown old; a newer report is looked for only then."""
        if spec.freshness is None:
            return
        timers = self._core.timers
        if known is not None and found.stamp < known.stamp:
            timers.disarm("fresh", spec.name)
        if timers.left("fresh", spec.name, turn.now) is None:
            timers.arm("fresh", spec.name, found.stamp, spec.freshness)

    def _is_reached(self, level: Level, name: str, value: float, turn: Turn) -> bool:
        """Compare a value with a level; a level that was reached is left only beyond its hysteresis."""
        env = self._core.see("", turn)
        margin = 0.0
        if level.hysteresis is not None and self._core.memory.levels.get(name, False):
            margin = float(level.hysteresis.evaluate(env))
        if level.below is not None:
            return value < float(level.below.evaluate(env)) + margin
        assert level.above is not None, f"{name} has no bound"
        return value > float(level.above.evaluate(env)) - margin

    def grew_old(self, name: str, turn: Turn) -> None:
        """A value that was to be looked at again is unknown now, unless a newer one came: then look later."""
        spec, found = self._core.chart.inputs[name], self._core.memory.inputs[name]
        assert spec.freshness is not None, f"input.{name} does not grow old"
        if turn.now < found.stamp + spec.freshness:
            self._core.timers.arm("fresh", name, found.stamp, spec.freshness)
        else:
            turn.note(f"input.{name} is unknown: last reported {turn.now - found.stamp:g} s ago")


#: What a value of a kind is made of.
_MADE_OF: Mapping[str, type | tuple[type, ...]] = {
    "bool": bool,
    "integer": int,
    "number": (int, float),
    "text": str,
    "list": (list, tuple),
    "record": Mapping,
    "any": object,
}


def _flaw(spec: Input, value: Any) -> str:
    """Return why a report cannot be the input's value, or an empty text."""
    kind = "number" if spec.levels or (spec.minimum, spec.maximum) != (None, None) else spec.type.kind
    fits = isinstance(value, _MADE_OF[kind]) and (kind in ("bool", "any") or not isinstance(value, bool))
    is_nan = kind == "number" and value != value
    if not fits or is_nan:
        return f"no {spec.type if spec.type.kind != 'any' else kind}"
    if kind in ("list", "record"):
        inside = problems(value, spec.type, Notation.DATA)
        return f"no {spec.type} ({inside[0].at()})" if inside else ""
    if spec.minimum is not None and value < spec.minimum:
        return "out of range"
    return "out of range" if spec.maximum is not None and value > spec.maximum else ""
