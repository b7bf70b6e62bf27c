"""The implementation of the verbs of `lupin twin`."""

from __future__ import annotations

import json
import math
import os
import time
from pathlib import Path
from typing import Any

import click

from lupin_engine.errors import LupinError, Problems, UsageError, nearest
from lupin_engine.plugin import write_atomically
from lupin_greenhouse import numeric_key
from lupin_twin.export.forms import finite, utc
from lupin_twin.export.geojson import geojson
from lupin_twin.export.georeference import FORM, Georeference
from lupin_twin.export.table import DESCRIPTION, description, table
from lupin_twin.missions import MissionRecord, MissionSummary, select, summaries
from lupin_twin.place import store_path
from lupin_twin.records import Bloom
from lupin_twin.state import Twin, TwinTag
from lupin_twin.store import StoreContent, read
from lupin_twin.text import QUANTITIES, number, printable

#: What the name of a file may end in, and the format that it says.
ENDINGS = {".csv": "csv", ".geojson": "geojson"}
PRINT = "-"


class CannotWrite(LupinError):
    """A file cannot be written; the text names it and the reason."""


def _content(store: str, domain: int | None) -> StoreContent:
    """Return the content of the store; damaged rows are reported and left out."""
    content = read(store_path(store, domain))
    for problem in content.unreadable:
        click.echo(f"lupin: {problem}", err=True)
    return content


def _write(path: Path, content: bytes) -> None:
    try:
        write_atomically(path, content)
    except OSError as problem:
        raise CannotWrite(f"cannot write {str(path)!r}: {problem.strerror}") from None
    click.echo(f"wrote {path}", err=True)


# --- show ---------------------------------------------------------------------------------------------------


def show(store: str, domain: int | None, as_json: bool) -> int:
    """List the tags."""
    twin = Twin()
    for record, received in _content(store, domain).rows:
        twin.apply(record, received)
    now = time.time()
    tags = sorted(twin.tags.values(), key=lambda tag: numeric_key(tag.tag_id))
    if as_json:
        shown = {"observations": twin.observation_count, "tags": [_tag_json(tag, now) for tag in tags]}
        click.echo(json.dumps(shown, ensure_ascii=False, indent=2))
    elif not tags:
        click.echo("no tag is known yet")
    else:
        _print_table(("tag", "at", "species", "blooms", "readings", "age"), [_row(tag, now) for tag in tags])
    return 0


def _tag_json(tag: TwinTag, now: float) -> dict[str, Any]:
    pin = tag.pin
    place = None if pin is None else {"x": finite(pin.x), "y": finite(pin.y), "heading": _heading(tag)}
    return {
        "tag_id": tag.tag_id,
        "place": place,
        "species": tag.species,
        "species_confidence": finite(tag.confidence),
        "pest": tag.anomaly,
        "blooms": [_bloom_json(bloom) for bloom in tag.blooms],
        "readings": {name: finite(value) for name, value in tag.readings.items()},
        "observed_at": None if tag.last_observed is None else utc(tag.last_observed),
        "age_s": None if tag.last_observed is None else round(tag.stale_seconds(now), 3),
    }


def _bloom_json(bloom: Bloom) -> dict[str, Any]:
    place = {"x": finite(bloom.x), "y": finite(bloom.y), "species": bloom.species}
    return {**place, "confidence": finite(bloom.confidence), "pest": bloom.anomaly}


def _heading(tag: TwinTag) -> float | None:
    return None if tag.pin is None else finite(2.0 * math.atan2(tag.pin.z, tag.pin.w))


def _row(tag: TwinTag, now: float) -> tuple[str, ...]:
    place = "" if tag.pin is None else f"{tag.pin.x:.2f}, {tag.pin.y:.2f}"
    species = f"{tag.species} {tag.confidence:.0%}" if tag.species else ""
    pest = " pest" if tag.anomaly else ""
    blooms = str(len(tag.blooms)) if tag.blooms else ""
    readings = "  ".join(f"{name} {_value(name, value)}" for name, value in tag.readings.items())
    age = "never read" if tag.last_observed is None else _duration(tag.stale_seconds(now))
    return tag.tag_id, place, f"{species}{pest}".strip(), blooms, readings, age


def _value(sensor: str, value: float) -> str:
    symbol = QUANTITIES[sensor].symbol if sensor in QUANTITIES else "1"
    return number(value) if symbol == "1" else f"{number(value)} {symbol}"


def _duration(seconds: float) -> str:
    """Return a duration in its largest two units."""
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    days, hours = divmod(hours, 24)
    parts = [(days, "d"), (hours, "h"), (minutes, "min"), (rest, "s")]
    while len(parts) > 1 and not parts[0][0]:
        parts.pop(0)
    return " ".join(f"{count} {unit}" for count, unit in parts[:2])


def _print_table(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    drawn = Table(box=None, pad_edge=False, header_style="bold")
    for title in header:
        drawn.add_column(title, overflow="fold")
    for row in rows:
        drawn.add_row(*(Text(printable(cell)) for cell in row))
    Console(width=None if os.isatty(1) else 200).print(drawn)


# --- missions -----------------------------------------------------------------------------------------------


def missions(store: str, domain: int | None, as_json: bool) -> int:
    """List the missions."""
    found = summaries(_content(store, domain).rows)
    if as_json:
        click.echo(
            json.dumps({"missions": [_mission_json(one) for one in found]}, ensure_ascii=False, indent=2)
        )
    elif not found:
        click.echo("no mission has observed anything yet")
    else:
        header = ("mission", "source", "first", "last", "readings", "flowers", "anomalies")
        _print_table(header, [_mission_row(one) for one in found])
    return 0


def _mission_json(mission: MissionSummary) -> dict[str, Any]:
    return {
        "mission_id": mission.mission_id,
        "source": mission.source,
        "first": utc(mission.first),
        "last": utc(mission.last),
        "readings": mission.readings,
        "flowers": mission.flowers,
        "anomalies": mission.anomalies,
    }


def _mission_row(mission: MissionSummary) -> tuple[str, ...]:
    shown = {**_mission_json(mission), "mission_id": mission.mission_id or "(outside of missions)"}
    shown |= {name: str(shown[name])[:19].replace("T", " ") for name in ("first", "last")}
    return tuple(str(value) for value in shown.values())


# --- export -------------------------------------------------------------------------------------------------


def export(
    store: str, domain: int | None, mission: str, format_: str | None, output: str, origin: str | None
) -> int:
    """Write the record of a mission.

    Raises:
        UsageError: all problems of the options.
        LupinError: the store cannot be read, or a file cannot be written.
    """
    problems = Problems(UsageError)
    with problems.collecting():
        wanted = _format(format_, output)
    with problems.collecting():
        where = None if origin is None else Georeference.parse(origin)
    problems.raise_any()
    if where is None and wanted == "geojson":
        raise UsageError(
            f"{wanted} has longitude and latitude, and the map is in metres from its own origin: "
            f"say where that is with --origin {FORM} in degrees"
        )
    if where is not None and wanted == "csv":
        raise UsageError("csv has metres on the map: leave --origin out")
    record = select(_content(store, domain).rows, mission)
    content = table(record) if where is None else geojson(record, where)
    if output == PRINT:
        click.echo(content, nl=False)
        return 0
    path = Path(output)
    if wanted == "csv":
        # First the description: who sees the table can read it.
        _write(path.with_name(path.name + DESCRIPTION), description(record, path.name))
    _write(path, content)
    return 0


def _format(given: str | None, output: str) -> str:
    if given is not None:
        return given
    name = Path(output).name
    found = next((wanted for ending, wanted in ENDINGS.items() if name.endswith(ending)), None)
    if found is None:
        raise UsageError(f"{output!r} says no format: end it in {', '.join(ENDINGS)}, or add --format")
    return found


# --- plot ---------------------------------------------------------------------------------------------------


def plot(
    store: str, domain: int | None, mission: str, sensor: str, output: Path, distance: float | None
) -> int:
    """Draw the field of one sensor, or of all.

    Raises:
        UsageError: all problems of the options.
        LupinError: the store cannot be read, a file cannot be written, or nothing can be drawn.
    """
    from lupin_twin.picture import ENDINGS as PICTURES
    from lupin_twin.picture import picture

    problems = Problems(UsageError)
    if distance is not None and not (math.isfinite(distance) and distance > 0.0):
        problems.add(f"--distance {distance:g}: must be above 0 m")
    ending = output.suffix.lower()
    if ending and ending not in PICTURES and not output.is_dir():
        problems.add(f"{str(output)!r} is no picture: end it in {' or '.join(PICTURES)}, or name a folder")
    problems.raise_any()
    content = _content(store, domain)
    record = select(content.rows, mission)
    sensors = _sensors(record, sensor)
    to_file = ending in PICTURES and not output.is_dir()
    if to_file and len(sensors) > 1:
        raise UsageError(f"one file has one sensor: add --sensor ({', '.join(sensors)}), or name a folder")
    if not to_file:
        _make_folder(output)
    for name in sensors:
        files = [output] if to_file else [output / f"{_file_name(name)}{kind}" for kind in PICTURES]
        for file in files:
            _write(file, picture(record, name, content.map, file.suffix.lower(), distance))
    return 0


def _sensors(record: MissionRecord, wanted: str) -> list[str]:
    drawable = [name for name in record.sensors if len(record.twin.samples(name)[1])]
    if not drawable:
        raise UsageError("there is nothing to draw: no tag has both a place and a reading")
    if wanted == "all":
        return drawable
    if wanted not in drawable:
        raise UsageError(
            f"no tag with a place has a reading of {wanted!r}; {nearest(wanted, [*drawable, 'all'])}"
        )
    return [wanted]


def _file_name(sensor: str) -> str:
    """Return a sensor's name as a safe file name: names come from the network."""
    return "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in sensor)[:80] or "_"


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise CannotWrite(f"cannot make folder {str(folder)!r}: {problem.strerror}") from None
