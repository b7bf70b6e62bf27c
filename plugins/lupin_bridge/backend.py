"""The port `Backend` for sources of readings, and its types. No ROS."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

from lupin_engine.errors import LupinError, Severity, shortened

SECONDS_PER_DAY = 86400.0

#: The sensors of each tag, in their order.
Sensors = Mapping[str, tuple[str, ...]]

#: Callback for messages to people; safe from every thread.
Report = Callable[[Severity, str], None]


class UnknownTag(LupinError):
    """There is no tag with that id."""


class ReadingFailed(LupinError):
    """A tag that exists has no reading now; the text says why."""


@dataclass(frozen=True)
class Clocks:
    """The clocks of a backend, in seconds: the wall clock, and one that is never stepped."""

    wall: Callable[[], float] = time.time
    steady: Callable[[], float] = time.monotonic


REAL_CLOCKS = Clocks()


@dataclass(frozen=True)
class Measurement:
    """The value of one sensor, in its `unit`; `stamp` is seconds since 1970, `age` is in seconds."""

    sensor: str
    value: float
    unit: str
    stamp: float
    age: float = 0.0


@dataclass(frozen=True)
class TagValues:
    """The readings of a tag: time of day in [0, 86400) seconds, and at most one value a sensor."""

    time_of_day: float
    sensors: tuple[Measurement, ...]


class Backend(Protocol):
    """A source of readings: a simulator, a recording, or sensors on a network."""

    @property
    def tags(self) -> tuple[str, ...]:
        """The ids of all known tags."""

    def read(self, tag_id: str) -> TagValues:
        """Return the readings of a tag; values that are too old or missing are left out.

        Raises:
            UnknownTag: there is no such tag.
            ReadingFailed: the tag has no value now.
        """

    def close(self) -> None:
        """Release files and connections."""


def unknown_tag(tag_id: str, known: int, where: str) -> UnknownTag:
    """Return the error for a tag that is not among those `known` to `where`."""
    return UnknownTag(f"unknown tag {shortened(tag_id)!r}; {where} {known} tag{'' if known == 1 else 's'}")


def no_sensors(tag_id: str) -> ReadingFailed:
    """Return the error for a tag at which nothing can be measured."""
    return ReadingFailed(f"tag {shortened(tag_id)!r}: the layout gives it no sensors")


def fresh_only(
    tag_id: str, found: Iterable[Measurement], absent: Iterable[str], max_age: float
) -> tuple[Measurement, ...]:
    """Return the values that are at most `max_age` seconds old.

    Raises:
        ReadingFailed: all are older, or there are none; the text lists their ages and the `absent` sensors.
    """
    values = tuple(found)
    fresh = tuple(value for value in values if value.age <= max_age)
    if fresh:
        return fresh
    reasons = [f"{value.sensor} is {value.age:.0f} s old" for value in values]
    reasons += [f"no {sensor}" for sensor in absent]
    if not reasons:
        raise no_sensors(tag_id)
    nothing = f"nothing measured in the last {max_age:g} s"
    raise ReadingFailed(f"tag {shortened(tag_id)!r}: {nothing} ({', '.join(reasons)})")
