"""Delta encoding of the records that come ten times a second: values and progress.

A value is `["v", time, name, age, value]`, progress of an attempt `["p", time, attempt, detail]`. A time is
relative to that of the input before, in whole microseconds, or a number with a point where that would not be
exact. A name is written once, then its number. `age` is how much earlier the value was true, in microseconds,
or null where the stamp stands behind the value. A plain value that is the same as before is not written
again.
"""

from __future__ import annotations

from typing import Any

from lupin_engine.machine.event import Event, flaw

#: Kinds of records.
SHORT_VALUE, SHORT_PROGRESS = "v", "p"
_PLAIN = (bool, int, float, str)
_VALUE, _PROGRESS = {"name", "value", "stamp"}, {"attempt", "detail"}
_PROGRESS_EVENT = "attempt.progress"


class Shorthand:
    """The encoder's state after the records before; a reader builds the same."""

    def __init__(self) -> None:
        #: The time of the last input, in seconds of the machine's clock.
        self.time = 0.0
        self._numbers: dict[str, int] = {}
        self._names: list[str] = []
        self._values: list[Any] = []

    # -- writing ----------------------------------------------------------------------------------------

    def written(self, now: float, event: Event) -> tuple[Any, ...] | None:
        """Return the record of an event at a time; None where there is no short form for it."""
        data = event.data
        if event.name == "value" and data.keys() == _VALUE and not flaw(event):
            value = self._value(now, data["name"], data["value"], data["stamp"])
            return SHORT_VALUE, self._time(now), *value
        if event.name == _PROGRESS_EVENT and data.keys() == _PROGRESS:
            return SHORT_PROGRESS, self._time(now), data["attempt"], data["detail"]
        return None

    def _time(self, now: float) -> int | float:
        later = _micros(now - self.time)
        return later if _after(self.time, later) == now else float(now)

    def _value(self, now: float, name: str, value: Any, stamp: float) -> tuple[Any, ...]:
        age = _micros(now - stamp)
        exact = isinstance(stamp, float) and _after(now, -age) == stamp
        number = self._numbers.get(name)
        same = number is not None and _is_same(self._values[number], value)
        if number is None:
            self._add(name)
        self._values[self._numbers[name]] = value
        rest = () if exact and same else (value,) if exact else (value, stamp)
        return (name if number is None else number, age if exact else None, *rest)

    def _add(self, name: str) -> None:
        self._numbers[name] = len(self._names)
        self._names.append(name)
        self._values.append(None)

    def name_in(self, record: tuple[Any, ...]) -> str:
        """Return the subject of a record, for people."""
        kind, _, *data = record
        about = data[0] if data else kind
        return self._names[about] if kind == SHORT_VALUE and isinstance(about, int) else str(about)

    # -- reading ----------------------------------------------------------------------------------------

    def read_time(self, written: int | float) -> float:
        """Return the time of a record."""
        return _after(self.time, written) if isinstance(written, int) else written

    def read_value(self, now: float, data: list[Any]) -> list[Any]:
        """Return name, value and stamp of a value at a time."""
        name, age, *rest = data
        if isinstance(name, str):
            self._add(name)
        else:
            name = self._names[name]
        number = self._numbers[name]
        if rest:
            self._values[number] = rest[0]
        return [name, self._values[number], rest[1] if age is None else _after(now, -age)]


def progress_of(data: list[Any]) -> list[Any]:
    """Return name and data of the event of a record of progress."""
    attempt, detail = data
    return [_PROGRESS_EVENT, {"attempt": attempt, "detail": detail}]


def _micros(seconds: float) -> int:
    return round(seconds * 1e6)


def _after(time: float, micros: int) -> float:
    return round(time + micros * 1e-6, 6) + 0.0  # not -0.0


def _is_same(before: Any, value: Any) -> bool:
    return type(value) in _PLAIN and type(before) is type(value) and repr(before) == repr(value)
