"""Selects the records of a mission from the store; pure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from lupin_engine.errors import UsageError, nearest
from lupin_twin.records import Anomaly, Discovery, Flowers, Observed, Reading, Record
from lupin_twin.state import Twin, TwinTag, observed_at
from lupin_twin.store import StoredRecord

#: Instead of a mission's id: the one that observed something last, and everything there is.
LATEST, ALL = "latest", "all"


class Observation(NamedTuple):
    """An observation, and its time in seconds of the twin's clock."""

    record: Observed
    time: float


@dataclass
class MissionSummary:
    """One mission: the number of its readings, flower observations and anomaly reports, and their times."""

    mission_id: str
    source: str
    first: float
    last: float
    readings: int = 0
    flowers: int = 0
    anomalies: int = 0

    def count(self, observation: Observation) -> None:
        """Add an observation."""
        self.first, self.last = min(self.first, observation.time), max(self.last, observation.time)
        match observation.record:
            case Reading():
                # Who drives the robot reads; others see flowers on the way.
                self.source = observation.record.source
                self.readings += 1
            case Flowers():
                self.flowers += 1
            case Anomaly():
                self.anomalies += 1


@dataclass(frozen=True)
class MissionRecord:
    """Observations in the order of their arrival, and the final state of the tags.

    Places of tags come from all records, values from these missions only.
    """

    name: str
    missions: tuple[MissionSummary, ...]
    observations: tuple[Observation, ...]
    twin: Twin

    @property
    def tags(self) -> list[TwinTag]:
        """The tags with an observation of these missions, in the order in which they became known."""
        return [tag for tag in self.twin.tags.values() if tag.last_observed is not None]

    @property
    def sensors(self) -> list[str]:
        """The sensors that were read, those of the interface first."""
        read = {name for tag in self.twin.tags.values() for name in tag.readings}
        return [name for name in self.twin.sensors if name in read]


def summaries(rows: Iterable[StoredRecord]) -> list[MissionSummary]:
    """Return the missions in the order of their first observation; "" is for those outside of missions."""
    found: dict[str, MissionSummary] = {}
    for observation in _observations(rows):
        record, time = observation
        summary = found.setdefault(
            record.mission_id, MissionSummary(record.mission_id, record.source, time, time)
        )
        summary.count(observation)
    return list(found.values())


def select(rows: Iterable[StoredRecord], wanted: str) -> MissionRecord:
    """Return the record of one mission, of the latest, or of all.

    Raises:
        UsageError: nothing was recorded, or there is no such mission; the text has the nearest id.
    """
    rows = list(rows)
    found = {summary.mission_id: summary for summary in summaries(rows)}
    if not found:
        raise UsageError("nothing has been observed yet: run a mission, or let a twin listen to one")
    chosen = set(found) if wanted == ALL else {_mission(found, wanted)}
    twin = Twin()
    for record, received in rows:
        for known in _known(record, chosen):
            twin.apply(known, received)
    observations = tuple(seen for seen in _observations(rows) if seen.record.mission_id in chosen)
    missions = tuple(summary for name, summary in found.items() if name in chosen)
    return MissionRecord(ALL if wanted == ALL else missions[0].mission_id, missions, observations, twin)


def _mission(found: dict[str, MissionSummary], wanted: str) -> str:
    ids = [name for name in found if name]
    if not ids:
        raise UsageError(f"no mission has observed anything; what was seen outside of one: --mission {ALL}")
    if wanted == LATEST:
        return max(ids, key=lambda name: found[name].last)
    if wanted not in ids:
        raise UsageError(
            f"no mission {wanted!r} has observed anything; {nearest(wanted, [*ids, LATEST, ALL])}"
        )
    return wanted


def _observations(rows: Iterable[StoredRecord]) -> Iterator[Observation]:
    for record, received in rows:
        if isinstance(record, (Reading, Flowers, Anomaly)):
            yield Observation(record, observed_at(record, received))


def _known(record: Record, chosen: set[str]) -> Iterator[Record]:
    """Yield a record of the chosen missions; of another mission's only the place of its tag."""
    if not isinstance(record, (Reading, Flowers, Anomaly)) or record.mission_id in chosen:
        yield record
    elif not isinstance(record, Anomaly) and record.pin is not None:
        yield Discovery(record.tag_id, record.pin)
