"""The backend of the greenhouse simulator `mdp-greenhouse`. No ROS.

An adapter: the package wants path objects, returns nothing for unknown tags, and raises a dozen exception
types; here a path is text, and there are two errors.
"""

from __future__ import annotations

import math
import os
import random
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from lupin_bridge.backend import (
    REAL_CLOCKS,
    SECONDS_PER_DAY,
    Clocks,
    Measurement,
    ReadingFailed,
    TagValues,
    no_sensors,
    unknown_tag,
)
from lupin_bridge.units import unit_of
from lupin_engine.errors import LupinError

if TYPE_CHECKING:
    from greenhouse_sim import GreenhouseSimulator

#: The package puts the time of day among the sensor values under this name.
_TIME_KEY = "timestamp"


@dataclass(frozen=True)
class SimulatorSettings:
    """The simulator's files and clock; the defaults are the package's own.

    `debug_time_of_day` (hours) from 0 on fixes the time. `debug_seed` from 0 on makes the noise repeatable,
    and fixes the time to the climate file's unless it is given. `speedup_factor` above 0 replaces that
    file's.
    """

    tag_file: str = ""
    sim_config_file: str = ""
    debug_time_of_day: float = -1.0
    debug_seed: int = -1
    speedup_factor: float = 0.0


class Greenhouse:
    """The simulated greenhouse: its tags and their readings.

    Raises:
        LupinError: a file cannot be used; the text names it.
    """

    def __init__(
        self, settings: SimulatorSettings = SimulatorSettings(), clocks: Clocks = REAL_CLOCKS
    ) -> None:
        self._clocks = clocks
        self._simulator = _simulator(settings)
        self._tags = tuple(self._simulator.tags())
        _adjust_clock(self._simulator, settings)

    @property
    def tags(self) -> tuple[str, ...]:
        """The ids of all tags, in the order of the layout."""
        return self._tags

    def unmeasurable(self) -> dict[str, list[str]]:
        """Return the tags with sensors that the climate file does not describe, and these sensors."""
        known = set(self._simulator.sensors())
        missing = {tag: [s for s in self._sensors_of(tag) if s not in known] for tag in self._tags}
        return {tag: sensors for tag, sensors in missing.items() if sensors}

    def read(self, tag_id: str) -> TagValues:
        """Measure at one tag, with the sensors that the layout gives it.

        Raises:
            UnknownTag: there is no such tag.
            ReadingFailed: the simulator failed, for instance over a sensor without a climate.
        """
        if tag_id not in self._tags:
            raise unknown_tag(tag_id, len(self._tags), "the layout has")
        if not self._sensors_of(tag_id):
            raise no_sensors(tag_id)
        try:
            data = self._simulator.get_sensor_data(tag_id)
            time_of_day = float(data[_TIME_KEY]) % SECONDS_PER_DAY
            values = {name: float(value) for name, value in data.items() if name != _TIME_KEY}
        except Exception as error:
            # The package may raise anything; a tag that cannot be read must not end the program.
            raise ReadingFailed(f"tag {tag_id!r}: {self._why(tag_id, error)}") from error
        if not all(map(math.isfinite, values.values())):
            raise ReadingFailed(f"tag {tag_id!r}: the simulator returned {values}")
        now = self._clocks.wall()
        measured = (Measurement(name, value, unit_of(name), now) for name, value in values.items())
        return TagValues(time_of_day, tuple(measured))

    def close(self) -> None:
        """Do nothing: no resource is open."""

    def _sensors_of(self, tag_id: str) -> Iterable[str]:
        tag = self._simulator.tag_manager.get_tags()[tag_id]
        sensors: Iterable[str] = tag.get("sensors", ()) if isinstance(tag, dict) else ()
        return sensors

    def _why(self, tag_id: str, error: Exception) -> str:
        missing = self.unmeasurable().get(tag_id)
        if missing:
            return f"the climate file does not describe its sensors {', '.join(missing)}"
        return f"the simulator failed: {type(error).__name__}: {error}"


def _simulator(settings: SimulatorSettings) -> GreenhouseSimulator:
    # Imported late: the package brings matplotlib, which a catalog or a client does not need.
    try:
        from greenhouse_sim import GreenhouseSimulator
    except ImportError as error:
        raise LupinError("the greenhouse simulator is not installed: pip install mdp-greenhouse") from error
    tag_file = _existing(settings.tag_file, "layout")
    config_file = _existing(settings.sim_config_file, "climate")
    files = ", ".join(str(file) for file in (tag_file, config_file) if file) or "its own files"
    try:
        simulator = GreenhouseSimulator(tag_file, config_file)
        tags = simulator.tags()
    except Exception as error:  # as for a reading: it has no errors of its own
        raise LupinError(f"the greenhouse simulator cannot use {files}: {error}") from error
    if not tags:
        raise LupinError(f"the greenhouse has no tags in {files}")
    return simulator


def _existing(file: str, what: str) -> Path | None:
    """Return the path as the package wants it, None for the package's own file; LupinError: no such file."""
    if not file:
        return None
    path = Path(os.path.expanduser(file))
    if not path.is_file():
        # The package takes a layout that does not exist for one without tags.
        raise LupinError(f"{what} file {file} does not exist")
    return path


def _adjust_clock(simulator: GreenhouseSimulator, settings: SimulatorSettings) -> None:
    time = simulator.sim_config["time"]
    if settings.speedup_factor > 0:
        time["speedup_factor"] = settings.speedup_factor
    if settings.debug_time_of_day >= 0:
        time["debug_mode"] = True
        time["debug_time_of_day"] = settings.debug_time_of_day
    if settings.debug_seed >= 0:
        time["debug_mode"] = True
        random.seed(settings.debug_seed)  # the package draws its noise from the process-wide generator
