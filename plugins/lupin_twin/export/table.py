"""Exports a mission's record as CSV (RFC 4180), with a description by the W3C's CSV on the Web.

One row for each observation. The description has units, types and meanings; its name is the table's with
`-metadata.json`, where readers of CSV on the Web look for it. Of blooms the table has only the number.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

from lupin_twin.export.forms import to_json, utc
from lupin_twin.missions import ALL, MissionRecord, Observation
from lupin_twin.records import Anomaly, Flowers, Observed, Pin, Reading
from lupin_twin.text import QUANTITIES

#: What the name of a table ends in for that of its description.
DESCRIPTION = "-metadata.json"

#: How the table is written. Some readers would trim the cells if nothing was said.
_DIALECT = {"encoding": "utf-8", "header": True, "delimiter": ",", "quoteChar": '"', "trim": False}

#: What no column's name may have as it is: it is a variable of URI templates (RFC 6570), and does not begin
#: with the underscore of the vocabulary's own names.
_NO_LETTER = re.compile(r"[^A-Za-z0-9_]|^_")


@dataclass(frozen=True)
class Column:
    """A column: header, XML Schema type, description, unit, and the function that gives a row's cell."""

    title: str
    datatype: str
    doc: str
    cell: Callable[[Observation], str]
    symbol: str = ""
    unece: str = ""

    def described(self) -> dict[str, Any]:
        """Return the column's entry in the description."""
        known = {
            "name": _NO_LETTER.sub(_percent, self.title),
            "titles": self.title,
            "datatype": self.datatype,
            "dc:description": self.doc,
        }
        units = {"schema:unitText": self.symbol, "schema:unitCode": self.unece} if self.symbol else {}
        return known | units


def table(record: MissionRecord) -> bytes:
    """Return the table."""
    columns = list(_columns(record))
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow([column.title for column in columns])
    for observation in record.observations:
        writer.writerow([column.cell(observation) for column in columns])
    return text.getvalue().encode()


def description(record: MissionRecord, url: str) -> bytes:
    """Return the description of the table that is at `url`, relative to the description."""
    return to_json(
        {
            "@context": ["http://www.w3.org/ns/csvw", {"@language": "en"}],
            "url": quote(url),
            "dc:title": f"Observations of {_title(record)}",
            "dc:description": (
                "One row for each observation. x and y are metres in the frame of the robot's map, "
                "not geographic coordinates."
            ),
            "dialect": _DIALECT,
            "tableSchema": {"columns": [column.described() for column in _columns(record)]},
        }
    )


def _title(record: MissionRecord) -> str:
    return "all missions" if record.name == ALL else f"mission {record.name}"


def _columns(record: MissionRecord) -> Iterator[Column]:
    yield Column("observed_at", "dateTime", "when it was observed, UTC", lambda seen: utc(seen.time))
    yield Column("kind", "string", "reading, flowers or anomaly", lambda seen: seen.record.kind)
    yield Column("mission_id", "string", "the mission, if any", lambda seen: seen.record.mission_id)
    yield Column("source", "string", "who observed it", lambda seen: seen.record.source)
    yield Column("tag_id", "string", "the tag, except for anomalies", lambda seen: _tag(seen.record))
    yield from _places(record)
    for sensor in record.sensors:
        yield _sensor(sensor)
    yield from _FLOWERS


def _places(record: MissionRecord) -> Iterator[Column]:
    """Yield the columns of places: an anomaly's own, else the tag's."""

    def place(seen: Observation) -> Pin | None:
        if isinstance(seen.record, Anomaly):
            return Pin(seen.record.x, seen.record.y, math.nan, math.nan)
        return record.twin.tags[seen.record.tag_id].pin

    def cell(read: Callable[[Pin], float]) -> Callable[[Observation], str]:
        return lambda seen: "" if (pin := place(seen)) is None else _number(read(pin))

    yield Column("x", "double", "where it is on the map", cell(lambda pin: pin.x), "m", "MTR")
    yield Column("y", "double", "where it is on the map", cell(lambda pin: pin.y), "m", "MTR")

    def heading(seen: Observation) -> str:
        pin = None if isinstance(seen.record, Anomaly) else place(seen)
        return "" if pin is None else _number(2.0 * math.atan2(pin.z, pin.w))

    doc = "where the tag points, anticlockwise from the map's x axis"
    yield Column("heading", "double", doc, heading, "rad", "C81")


def _title_of(sensor: str) -> str:
    """Return a unique column title for a sensor."""
    fixed = _FIXED | {column.title for column in _FLOWERS}
    return f"{_PREFIX}{sensor}" if sensor in fixed or sensor.startswith(_PREFIX) else sensor


def _sensor(sensor: str) -> Column:
    title = _title_of(sensor)

    def cell(seen: Observation) -> str:
        values = dict(seen.record.readings) if isinstance(seen.record, Reading) else {}
        return _number(values[sensor]) if sensor in values else ""

    quantity = QUANTITIES.get(sensor)
    if quantity is None:
        return Column(title, "double", "as its sensor told, in an unknown unit", cell)
    return Column(title, "double", quantity.label, cell, quantity.symbol, quantity.unece)


def _flowers(title: str, datatype: str, doc: str, read: Callable[[Flowers], str]) -> Column:
    return Column(
        title, datatype, doc, lambda seen: read(seen.record) if isinstance(seen.record, Flowers) else ""
    )


def _anomaly(title: str, datatype: str, doc: str, read: Callable[[Anomaly], str]) -> Column:
    return Column(
        title, datatype, doc, lambda seen: read(seen.record) if isinstance(seen.record, Anomaly) else ""
    )


_FLOWERS = (
    _flowers("species", "string", "what grows there", lambda flowers: flowers.species),
    _flowers("species_confidence", "double", "0 to 1", lambda flowers: _number(flowers.confidence)),
    _flowers("pest", "boolean", "whether a pest was seen", lambda flowers: str(flowers.anomaly).lower()),
    _flowers("blooms", "integer", "how many blooms", lambda flowers: str(len(flowers.blooms))),
    _anomaly("description", "string", "what is unusual", lambda anomaly: anomaly.description),
    _anomaly("severity", "integer", "0 is information, more is more urgent", lambda a: str(a.severity)),
)
_PREFIX = "sensor "
_FIXED = {"observed_at", "kind", "mission_id", "source", "tag_id", "x", "y", "heading"}


def _tag(record: Observed) -> str:
    return "" if isinstance(record, Anomaly) else record.tag_id


def _number(value: float) -> str:
    """Return a number as XML Schema writes it: the exponent with a large E."""
    if math.isfinite(value):
        return repr(value).upper()
    return "NaN" if math.isnan(value) else "INF" if value > 0 else "-INF"


def _percent(letter: re.Match[str]) -> str:
    return "".join(f"%{byte:02X}" for byte in letter[0].encode())
