"""Live values, with range check, hysteresis of levels and freshness; and times of day on the wall clock."""

from __future__ import annotations

import reprlib
from collections.abc import Collection, Mapping
from functools import lru_cache
from typing import Any

from lupin_engine.chart.model import Chart, Input, Level, Timer
from lupin_engine.errors import reason
from lupin_engine.machine.event import Event
from lupin_engine.machine.memory import Memory, Reported
from lupin_engine.machine.schema import INPUTS, LEVELS, Life, levels_of
from lupin_engine.machine.scope import EvaluationScope, input_part
from lupin_engine.machine.step import Macrostep
from lupin_engine.plugin.types import TIME_OF_DAY, Notation, beyond, fitted, problems


class Inputs:
    """The live values of one machine."""

    __slots__ = ("_by_value", "_parts", "_scope")

    def __init__(self, scope: EvaluationScope) -> None:
        self._scope = scope
        self._parts, self._by_value = _parts_and_inputs(scope.chart)

    def begin(self, step: Macrostep) -> None:
        """Set the initial values of all inputs."""
        for spec in self._scope.chart.inputs.values():
            self._begin(spec, step)

    def go_on(self, step: Macrostep) -> None:
        """Set the initial values of unknown inputs, and compare known ones with the levels of this chart."""
        for spec in self._scope.chart.inputs.values():
            known = self._scope.memory.inputs.get(spec.name)
            if known is None or _flaw(spec, known.value):
                self._scope.memory.inputs.pop(spec.name, None)
                self._begin(spec, step)
            else:
                self._set(spec, known, step)

    def begin_mission(self, step: Macrostep) -> None:
        """Drop the values of inputs about a mission that were reported before it.

        The last report of a list is kept to compare with: elements that are only repeated are not new.
        """
        memory = self._scope.memory
        for spec in self._scope.chart.inputs.values():
            if spec.of_mission:
                if spec.name in memory.heard:
                    memory.before[spec.name] = memory.heard[spec.name]
                memory.drop(_known_of(self._scope.chart, spec.name))
                self._scope.timers.disarm("fresh", spec.name)
                self._scope.mark_dirty(self._parts[spec.name])
                self._begin(spec, step)

    def _begin(self, spec: Input, step: Macrostep) -> None:
        if spec.initial is not None:
            self._set(spec, Reported(spec.initial, step.now, reported=False), step)

    def observe(self, event: Event, step: Macrostep) -> None:
        """Take in a report; one that is too old, older than the last, or out of range, is dropped."""
        data = event.data
        self._project(data["name"], data["value"])
        for spec in self._by_value.get(data["name"], ()):
            known = self._scope.memory.inputs.get(spec.name)
            flaw = _flaw(spec, data["value"])
            if flaw:
                step.note(f"dropped: input.{spec.name} is {flaw}: {reprlib.repr(data['value'])}")
            elif spec.of_mission and not self._is_of_mission(data["stamp"]):
                if spec.type.kind == "list":
                    self._scope.memory.before[spec.name] = list(data["value"])
                step.note(f"dropped: a report of input.{spec.name} from before the mission")
            elif known is not None and known.reported and data["stamp"] < known.stamp:
                step.note(f"dropped: a report of input.{spec.name} that is older than the last")
            elif spec.freshness is not None and step.now >= data["stamp"] + spec.freshness:
                age = step.now - data["stamp"]
                step.note(f"dropped: a report of input.{spec.name} that is {age:g} s old, so too old already")
            else:
                self._set(spec, Reported(self._new_items(spec, data["value"]), data["stamp"]), step)

    def _project(self, name: str, value: Any) -> None:
        """Fold a report into the profile's projections; one of a wrong type is ignored."""
        chart, projected = self._scope.chart, self._scope.memory.projected
        keys = _projections(chart).get(name, ())
        if keys and not problems(value, chart.catalog.values[name].type, Notation.DATA):
            for key in keys:
                projected[key] = chart.profile.projections[key].fold(projected.get(key), name, value)

    def _new_items(self, spec: Input, value: Any) -> Any:
        """Return the part of a report that counts: of a list about the mission, its new elements.

        A source that forgets nothing repeats the elements of earlier missions. An element that was missing
        once, or changed, counts as new from then on, even if it comes back as it was.
        """
        if not spec.of_mission or spec.type.kind != "list":
            return value
        memory = self._scope.memory
        memory.heard[spec.name] = list(value)
        if spec.name not in memory.before:
            return value
        reported = _by_name(value)
        same = [item for item in memory.before[spec.name] if item in reported.get(_name_of(item), ())]
        memory.before[spec.name] = same
        old = _by_name(same)
        return [item for item in value if item not in old.get(_name_of(item), ())]

    def _is_of_mission(self, stamp: float) -> bool:
        started = self._scope.memory.started_at
        return started is not None and stamp >= started

    def _set(self, spec: Input, found: Reported, step: Macrostep) -> None:
        memory = self._scope.memory
        known = memory.inputs.get(spec.name)
        memory.inputs[spec.name] = found
        same = known is not None and not self._is_old(spec, known, step) and known.value == found.value
        for level in spec.levels:
            name = f"input.{spec.name}.{level.name}"
            before = memory.levels.get(name)
            try:
                memory.levels[name] = reached = self.is_reached(level, name, found.value, step)
                same = same and reached is before
            except Exception as problem:
                step.fail("", f"{level.place}: level {level.name}: {reason(problem)}")
        if not same:
            self._scope.mark_dirty(self._parts[spec.name])
        self._arm_freshness(spec, known, found, step)

    @staticmethod
    def _is_old(spec: Input, known: Reported, step: Macrostep) -> bool:
        return spec.freshness is not None and step.now >= known.stamp + spec.freshness

    def _arm_freshness(self, spec: Input, known: Reported | None, found: Reported, step: Macrostep) -> None:
        """Arm the timer that checks freshness; a newer report is noticed only when it fires."""
        if spec.freshness is None:
            return
        timers = self._scope.timers
        if known is not None and found.stamp < known.stamp:
            timers.disarm("fresh", spec.name)
        if timers.left("fresh", spec.name, step.now) is None:
            timers.arm("fresh", spec.name, found.stamp, spec.freshness)

    def is_reached(self, level: Level, name: str, value: float, step: Macrostep) -> bool:
        """Compare a value with a level; a level that was reached is left only beyond its hysteresis."""
        env = self._scope.see("", step)
        margin = 0.0
        if level.hysteresis is not None and self._scope.memory.levels.get(name, False):
            margin = float(level.hysteresis.evaluate(env))
        if level.below is not None:
            return value < float(level.below.evaluate(env)) + margin
        assert level.above is not None, f"{name} has no bound"
        return value > float(level.above.evaluate(env)) - margin

    def became_stale(self, name: str, step: Macrostep) -> None:
        """Make a value unknown whose freshness has passed; if a newer report came, arm the timer for that."""
        spec, found = self._scope.chart.inputs[name], self._scope.memory.inputs[name]
        assert spec.freshness is not None, f"input.{name} does not grow old"
        if step.now < found.stamp + spec.freshness:
            self._scope.timers.arm("fresh", name, found.stamp, spec.freshness)
        else:
            step.note(f"input.{name} is unknown: last reported {step.now - found.stamp:g} s ago")


class WallClock:
    """The robot's wall clock: fires the times of day (`at`) of active states.

    It runs on during a hold; a time that it reaches then waits for the release, once. A state handles a time
    once on a date, also where the clock is set back. A time that it is set forward over fires at once.
    """

    __slots__ = ("_scope", "_timers")

    def __init__(self, scope: EvaluationScope) -> None:
        self._scope = scope
        self._timers = _times_of_day(scope.chart)

    def set(self, event: Event, step: Macrostep) -> None:
        """Take in how far the robot's clock is ahead of the machine's: at the start, or when it was set."""
        if "ahead" not in event.data:
            return
        memory, calendar = self._scope.memory, self._scope.world.calendar
        if not 0.0 <= step.now + event.data["ahead"] <= LAST_MOMENT:
            step.note(f"dropped: a clock that says {step.now + event.data['ahead']:g} s since 1970")
            return
        before, memory.wall = memory.wall, float(event.data["ahead"])
        forward = 0.0 if before is None else memory.wall - before
        if before is not None:
            step.note(f"the clock was set {_long(abs(forward))} {'forward' if forward > 0 else 'back'}")
        if calendar is not None:
            step.note(f"the clock says {calendar.as_text(step.now + memory.wall)}")
        self.arm_all(step, forward)

    def arm_all(self, step: Macrostep, forward: float = 0.0) -> None:
        """Set the deadlines of the active states anew; those that the clock has come to are due now.

        `forward` is by how many seconds it was set forward.
        """
        memory = self._scope.memory
        passed = [
            about for due, _, kind, about in memory.timers if kind == "at" and due - forward <= step.now
        ]
        memory.timers[:] = [timer for timer in memory.timers if timer[2] != "at"]
        for state, about in passed:
            step.note(f"it has passed {about.partition(' ')[2]}")
            self._scope.timers.arm("at", state, step.now, 0.0, about)
        for state in self._timers:
            if state in memory.configuration:
                self.arm(state, step, [about.partition(" ")[0] for owner, about in passed if owner == state])

    def arm(self, state: str, step: Macrostep, without: Collection[str] = ()) -> None:
        """Set the deadlines of a state, but for those of the events `without`."""
        for timer in self._timers.get(state, ()):
            if timer.event not in without:
                self._arm(state, timer, step)

    def _arm(self, state: str, timer: Timer, step: Macrostep) -> None:
        scope = self._scope
        try:
            time = fitted(timer.due.evaluate(scope.see(state, step)), TIME_OF_DAY)
            wall, calendar = scope.wall, scope.world.calendar
            if wall is None or calendar is None:
                return
            dealt_with = scope.memory.reached.get(state, {}).get(time, ())
            moment, date = calendar.next(time, wall, dealt_with)
        except Exception as problem:
            step.fail(state, f"{timer.place}: at: {reason(problem)}")
            return
        scope.timers.arm("at", state, step.now, moment - wall, f"{timer.event} {date} {time}")

    def came_to(self, state: str, about: str, step: Macrostep) -> None:
        """Note that a state has dealt with a time on a date, and wait for the next."""
        event, date, time = about.split(" ")
        dates = self._scope.memory.reached.setdefault(state, {}).setdefault(time, [])
        dates[:] = [*dates, date][-MOST_DATES:]
        for timer in self._timers[state]:
            if timer.event == event:
                self._arm(state, timer, step)

    def defer(self, state: str, event: str, step: Macrostep) -> None:
        """Queue a time of day for the release, once however often it comes."""
        waiting = Event(WAITS, {"owner": state, "event": event})
        if waiting not in self._scope.memory.deferred:
            self._scope.memory.deferred.append(waiting)
            step.note(f"{step.event.data['time']} waits for the release")

    def leave(self, state: str) -> None:
        """Drop the timers and waiting times of a state that is left."""
        if state not in self._timers:
            return
        self._scope.timers.disarm("at", state)
        deferred = self._scope.memory.deferred
        deferred[:] = [e for e in deferred if e.name != WAITS or e.data["owner"] != state]


def _long(seconds: float) -> str:
    """Return a time in the unit in which it is easily read."""
    unit, size = next(((unit, size) for unit, size in _UNITS.items() if seconds >= size), ("s", 1.0))
    return f"{seconds / size:.4g} {unit}"


_UNITS: Mapping[str, float] = {"days": 86400.0, "h": 3600.0, "min": 60.0}
#: The last moment that calendars are asked for: there are none of the years 10000 and later.
LAST_MOMENT = 2e11
#: So many dates a state remembers: no clock is set back by more than a year.
MOST_DATES = 366
#: What is kept of a time that came during a hold.
WAITS = "at.waits"
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


def _by_name(items: Collection[Any]) -> dict[Any, list[Any]]:
    """Index the elements of a list by `_name_of`."""
    found: dict[Any, list[Any]] = {}
    for item in items:
        found.setdefault(_name_of(item), []).append(item)
    return found


def _name_of(item: Any) -> Any:
    """Return the index key of an element: equal elements share it, different ones seldom do."""
    name = item.get("id") if isinstance(item, Mapping) else item
    return name if isinstance(name, (str, int, float)) else None


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
    return "out of range" if _is_outside(spec, value) else ""


def _is_outside(spec: Input, value: Any) -> bool:
    """Say whether a value is outside the input's range, or of the range of its type."""
    if spec.minimum is not None and value < spec.minimum:
        return True
    if spec.type.kind in ("integer", "number") and beyond(value, spec.type):
        return True
    return spec.maximum is not None and value > spec.maximum


@lru_cache(maxsize=256)
def _known_of(chart: Chart, name: str) -> list[tuple[str, list[str]]]:
    """Return the memory's entries about an input, by field."""
    own = {INPUTS: [name], LEVELS: levels_of(chart, name)}
    fields = ((one.name, one.owner) for one in Memory.schema() if one.life is Life.OWNER)
    return [(field, own[owner]) for field, owner in fields if owner in own]


@lru_cache(maxsize=32)
def _parts_and_inputs(chart: Chart) -> tuple[Mapping[str, int], Mapping[str, list[Input]]]:
    """Return the dependency bit of each input, and the inputs that each live value is bound to."""
    by_value: dict[str, list[Input]] = {}
    for spec in chart.inputs.values():
        by_value.setdefault(spec.value, []).append(spec)
    return {name: input_part(chart, name) for name in chart.inputs}, by_value


@lru_cache(maxsize=32)
def _projections(chart: Chart) -> Mapping[str, list[str]]:
    """Return the names of the profile's projections by the live value that they read."""
    found: dict[str, list[str]] = {}
    for key, projection in chart.profile.projections.items():
        for value in projection.values:
            if value in chart.catalog.values:
                found.setdefault(value, []).append(key)
    return found


@lru_cache(maxsize=32)
def _times_of_day(chart: Chart) -> Mapping[str, list[Timer]]:
    """Return the times of day that states wait for."""
    timed = ((s.name, [t for t in s.timers if t.word == "at"]) for s in chart.states.values())
    return {name: timers for name, timers in timed if timers}
