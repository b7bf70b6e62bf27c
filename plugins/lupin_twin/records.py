"""The records: facts about the greenhouse in frame `map`, metres, and their form on disk."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from typing import Annotated, Literal, TypeAlias

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

_STRICT = ConfigDict(extra="forbid")

#: No place in a greenhouse is farther from the origin of its map, and no box is larger, in metres.
FARTHEST_M = 10_000.0


def is_near(x: float, y: float) -> bool:
    """Return whether a place is finite, and at most `FARTHEST_M` from the origin of the map."""
    return math.hypot(x, y) <= FARTHEST_M  # false for NaN


@dataclass(frozen=True)
class Pin:
    """A tag's position on the floor, and its heading as the quaternion (0, 0, z, w) of length 1."""

    __pydantic_config__ = _STRICT
    x: float
    y: float
    z: float
    w: float


@dataclass(frozen=True)
class Bloom:
    """One flower in a planter box; `species` is empty where only a pest was seen."""

    __pydantic_config__ = _STRICT
    x: float
    y: float
    z: float
    species: str
    confidence: float
    anomaly: bool


#: Corners (x, y) of a planter box: front left, front right, back right, back left.
Corners: TypeAlias = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Reading:
    """The measured values at a tag; `stamp` is seconds of the observer's clock."""

    __pydantic_config__ = _STRICT
    tag_id: str
    stamp: float
    mission_id: str
    source: str
    readings: tuple[tuple[str, float], ...]
    pin: Pin | None = None
    kind: Literal["reading"] = "reading"


@dataclass(frozen=True)
class Flowers:
    """The flowers at a tag."""

    __pydantic_config__ = _STRICT
    tag_id: str
    stamp: float
    mission_id: str
    source: str
    species: str
    confidence: float
    anomaly: bool
    blooms: tuple[Bloom, ...] = ()
    footprint: Corners = ()
    pin: Pin | None = None
    kind: Literal["flowers"] = "flowers"


@dataclass(frozen=True)
class Anomaly:
    """Something unusual at a place, not at a tag; the higher `severity`, the more urgent."""

    __pydantic_config__ = _STRICT
    stamp: float
    mission_id: str
    source: str
    x: float
    y: float
    z: float
    description: str
    severity: int
    kind: Literal["anomaly"] = "anomaly"


@dataclass(frozen=True)
class Discovery:
    """A tag was seen at a place: its number of sightings so far, and its flowers ("": none yet)."""

    __pydantic_config__ = _STRICT
    tag_id: str
    pin: Pin
    sightings: int = 0
    species: str = ""
    confidence: float = 0.0
    anomaly: bool = False
    kind: Literal["discovery"] = "discovery"


@dataclass(frozen=True)
class BoxOutline:
    """The planter box at a tag, from the geometry topic."""

    __pydantic_config__ = _STRICT
    tag_id: str
    footprint: Corners
    kind: Literal["box"] = "box"


#: Made once by somebody at some time; the same one may arrive twice, because latecomers get the backlog.
Observed: TypeAlias = Reading | Flowers | Anomaly

Record: TypeAlias = Observed | Discovery | BoxOutline

_RECORDS: TypeAdapter[Record] = TypeAdapter(Annotated[Record, Field(discriminator="kind")])


def to_json(record: Record) -> str:
    """Return a record as one line of JSON, NaN included; equal records give equal lines."""
    return json.dumps(asdict(record), separators=(",", ":"))


def from_json(text: str | bytes) -> Record:
    """Return a record written by `to_json`; of bytes, in UTF-8.

    Raises:
        ValueError: it is none.
    """
    try:
        return _RECORDS.validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise ValueError(f"not a record of the twin: {place or 'text'}: {first['msg']}") from None
