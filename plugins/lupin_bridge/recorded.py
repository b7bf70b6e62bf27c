"""The backend that replays a recording, by the time of day or from its beginning.

Values are not interpolated, and not served for longer than `max_age`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, time, timedelta

from lupin_bridge.backend import (
    REAL_CLOCKS,
    SECONDS_PER_DAY,
    Clocks,
    Measurement,
    ReadingFailed,
    Sensors,
    TagValues,
    fresh_only,
    unknown_tag,
)
from lupin_bridge.catalog import RECORDING_CLOCKS
from lupin_bridge.recording import SensorRecording, load_recording
from lupin_bridge.stamps import time_of_day
from lupin_bridge.units import unit_of

#: The ways to replay.
TIME_OF_DAY, SINCE_START = RECORDING_CLOCKS
#: The longest replay, in seconds: thirty years.
_LONGEST_S = 1e9


@dataclass(frozen=True)
class ReplaySettings:
    """The file and how it is replayed.

    `clock` is one of RECORDING_CLOCKS. `fixed_hour` from 0 on holds the replay at that hour of its first day;
    `speed` is how many recorded seconds pass in a second since the start. `max_age` is in seconds.
    """

    file: str
    clock: str = TIME_OF_DAY
    max_age: float = 900.0
    fixed_hour: float = -1.0
    speed: float = 1.0


class Recorded:
    """A recording as a backend.

    Raises:
        LupinError: the file cannot be used; all errors with their places.
    """

    def __init__(
        self, settings: ReplaySettings, sensors: Sensors | None, clocks: Clocks = REAL_CLOCKS
    ) -> None:
        """`sensors` are those of a layout, and only they are served; without one every recorded sensor is."""
        self._recording = load_recording(settings.file)
        self._settings = settings
        self._sensors = sensors or {tag: tuple(own) for tag, own in self._recording.series.items()}
        self._known = "the recording has" if sensors is None else "the layout has"
        self._now = _replay(self._recording, settings, clocks)

    @property
    def tags(self) -> tuple[str, ...]:
        """All tags of the layout; without one, those of the recording."""
        return tuple(self._sensors)

    def read(self, tag_id: str) -> TagValues:
        """Return a tag's latest values at the replay's present time; raises as `Backend.read` does."""
        if tag_id not in self._sensors:
            raise unknown_tag(tag_id, len(self._sensors), self._known)
        now = self._now()
        own = self._recording.series.get(tag_id, {})
        found, absent = [], []
        for sensor in self._sensors[tag_id]:
            last = own[sensor].at(now) if sensor in own else None
            if last is None:
                absent.append(sensor)
            else:
                found.append(Measurement(sensor, last[1], unit_of(sensor), last[0], now - last[0]))
        try:
            values = fresh_only(tag_id, found, absent, self._settings.max_age)
        except ReadingFailed as error:
            moment = datetime.fromtimestamp(now).isoformat(" ", "seconds")
            over = ", after its end" if now > self._recording.last else ""
            raise ReadingFailed(f"{error}; the recording is at {moment}{over}") from None
        return TagValues(time_of_day(now), values)

    def close(self) -> None:
        """Do nothing: no resource is open."""


def _replay(recording: SensorRecording, settings: ReplaySettings, clocks: Clocks) -> Callable[[], float]:
    """Return a function that gives the replay's present time."""
    first_day = datetime.fromtimestamp(recording.first).date()
    if settings.fixed_hour >= 0.0:
        seconds = settings.fixed_hour * 3600.0 % SECONDS_PER_DAY
        fixed = (datetime.combine(first_day, time()) + timedelta(seconds=seconds)).timestamp()
        return lambda: fixed
    if settings.clock == SINCE_START:
        start = clocks.steady()
        # Nothing is served any more when the last value is too old: a fast replay would leave the calendar.
        end = recording.last + min(settings.max_age, _LONGEST_S) + SECONDS_PER_DAY
        return lambda: min(end, recording.first + (clocks.steady() - start) * settings.speed)
    days = (datetime.fromtimestamp(recording.last).date() - first_day).days + 1
    start_day = datetime.fromtimestamp(clocks.wall()).date()

    def by_time_of_day() -> float:
        # One recorded day for each day; after the last one the first one again.
        now = datetime.fromtimestamp(clocks.wall())
        day = first_day + timedelta(days=(now.date() - start_day).days % days)
        return datetime.combine(day, now.time()).timestamp()

    return by_time_of_day
