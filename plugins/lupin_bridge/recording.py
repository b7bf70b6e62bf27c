"""Reads a recording, a CSV file with a header in one of two forms, and reports all errors with their places.

Long: a row for each value, with the columns `tag_id`, `sensor`, `value`, `stamp` and optionally `unit`; other
columns are ignored. A row without a value means that the sensor measured nothing from then on.

Wide: a row for each reading of a tag, with the columns `tag_id` and `stamp`, and one for each sensor. An
empty cell means nothing, `NaN` that the sensor measured nothing from then on. The digital twin exports this
form: `observed_at` stands for `stamp`, rows whose `kind` is not `reading` are skipped, as are its columns
that are no sensors.
"""

from __future__ import annotations

import bisect
import csv
import io
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from lupin_bridge.stamps import number, seconds_since_1970
from lupin_bridge.units import checked
from lupin_engine.errors import LupinError, Place, shortened

TAG, SENSOR, VALUE, STAMP, UNIT, KIND = "tag_id", "sensor", "value", "stamp", "unit", "kind"
#: What the twin calls the stamp.
OBSERVED_AT = "observed_at"
#: Columns of the twin's export that are no sensors; a sensor of such a name has the word before it there.
NO_SENSORS = {TAG, STAMP, OBSERVED_AT, KIND, "mission_id", "source", "x", "y", "heading", "species"}
NO_SENSORS |= {"species_confidence", "pest", "blooms", "description", "severity"}
SENSOR_PREFIX = "sensor "

#: The most mistakes that are reported one by one.
MAX_REPORTED = 100


@dataclass
class Series:
    """The values of one sensor with rising stamps; None is where it stopped measuring."""

    stamps: list[float] = field(default_factory=list)
    values: list[float | None] = field(default_factory=list)

    def at(self, moment: float) -> tuple[float, float] | None:
        """Return stamp and value of the last measurement until `moment`; None before it and in a gap."""
        index = bisect.bisect_right(self.stamps, moment) - 1
        value = self.values[index] if index >= 0 else None
        return None if value is None else (self.stamps[index], value)


@dataclass(frozen=True)
class SensorRecording:
    """The series of every sensor by tag and sensor name, and the first and last stamp of all."""

    series: Mapping[str, Mapping[str, Series]]
    first: float
    last: float


def load_recording(file: str) -> SensorRecording:
    """Read a recording.

    Raises:
        LupinError: it cannot be read, or has errors, up to `MAX_REPORTED`, each as FILE:LINE:COLUMN.
    """
    if not file:
        raise LupinError("backend 'recorded' needs the parameter recording_file, a CSV file")
    try:
        text = Path(os.path.expanduser(file)).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise LupinError(f"recording {file}: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise LupinError(f"recording {file} is not in UTF-8: byte {error.start}") from None
    mistakes = _Mistakes(file)
    series = _series(_values(text, mistakes), mistakes)
    mistakes.complain()
    stamps = [stamp for own in series.values() for one in own.values() for stamp in one.stamps]
    if not stamps:
        raise LupinError(f"recording {file} has no readings")
    return SensorRecording(series, min(stamps), max(stamps))


@dataclass(frozen=True)
class _CsvRow:
    """The cells of a row, and its source text, which begins in `line`."""

    line: int
    lines: Sequence[str]
    cells: Sequence[str]

    def cell(self, index: int) -> str:
        return self.cells[index].strip()

    def place(self, index: int) -> tuple[int, int]:
        """Return line and column where a cell begins, counted from 1."""
        line, column, cell, quoted = self.line, 1, 0, False
        for character in "\n".join(self.lines):
            if cell == index:
                break
            column += 1
            if character == "\n":
                line, column = line + 1, 1
            elif character == '"':
                quoted = not quoted
            elif character == "," and not quoted:
                cell += 1
        return line, column


@dataclass(frozen=True)
class _Value:
    """One value; `line` is for messages about contradictions."""

    tag: str
    sensor: str
    stamp: float
    line: int
    value: float | None


class _Mistakes:
    """Collects the errors of a file."""

    def __init__(self, file: str) -> None:
        self._file = file
        self._found: list[tuple[int, int, str]] = []

    def add(self, place: tuple[int, int], problem: str) -> None:
        self._found.append((*place, problem))

    def complain(self) -> None:
        """Raise LupinError if there are any."""
        self._found.sort()
        problems = [
            f"{Place(self._file, line, column)}: {text}" for line, column, text in self._found[:MAX_REPORTED]
        ]
        if len(self._found) > MAX_REPORTED:
            problems.append(f"and {len(self._found) - MAX_REPORTED} more")
        if problems:
            raise LupinError("\n".join(problems))


def _series(values: Iterator[_Value], mistakes: _Mistakes) -> dict[str, dict[str, Series]]:
    """Sort the values into series; two of a sensor at the same time are an error."""
    series: dict[str, dict[str, Series]] = {}
    before: _Value | None = None
    for value in sorted(values, key=lambda one: (one.tag, one.sensor, one.stamp, one.line)):
        one = series.setdefault(value.tag, {}).setdefault(value.sensor, Series())
        if before is not None and one.stamps and one.stamps[-1] == value.stamp:
            if before.value != value.value:
                what = f"{value.sensor} of tag {shortened(value.tag)!r}"
                text = f"{what} has another value at this time in line {before.line}"
                mistakes.add((value.line, 1), text)
            continue
        one.stamps.append(value.stamp)
        one.values.append(value.value)
        before = value
    return series


def _values(text: str, mistakes: _Mistakes) -> Iterator[_Value]:
    """Yield the values of a file, in the order of its rows; none where its header is wrong."""
    rows = _rows(text, mistakes)
    first = next(rows, None)
    header = [name.strip() for name in first.cells] if first else []
    columns = _columns(header, mistakes)
    if columns is None:
        return
    nameless = [index for index, name in enumerate(header) if not name]  # spreadsheets leave some at the end
    read = _long if _is_long(columns) else _wide
    for row in rows:
        if len(row.cells) != len(header):
            problem = f"expected {len(header)} cells as in the header, got {len(row.cells)}"
            mistakes.add((row.line, 1), problem)
            continue
        for index in nameless:
            if row.cell(index):
                mistakes.add(row.place(index), "this column has no name in the header")
        yield from read(row, columns, mistakes)


def _columns(header: Sequence[str], mistakes: _Mistakes) -> Mapping[str, int] | None:
    """Return the index of each column, the stamps' by their own name; None where the header has errors."""
    if not any(header):
        expected = ",".join((TAG, SENSOR, VALUE, STAMP, UNIT))
        mistakes.add((1, 1), f"no header; expected such as {expected}")
        return None
    columns = {name: index for index, name in enumerate(header) if name}
    if OBSERVED_AT in columns:
        columns.setdefault(STAMP, columns[OBSERVED_AT])
    needed = (TAG, SENSOR, VALUE, STAMP) if _is_long(columns) else (TAG, STAMP)
    missing = [name for name in needed if name not in columns]
    for name in missing:
        mistakes.add((1, 1), f"no column {name!r}; {_instead(header)}")
    twice = sorted({name for name in columns if header.count(name) > 1})
    if twice:
        mistakes.add((1, 1), f"more than one column {_quoted(twice)}")
    return None if missing or twice else columns


def _is_long(columns: Iterable[str]) -> bool:
    """Return whether a file has a row for each value."""
    return bool({SENSOR, VALUE}.intersection(columns))


def _rows(text: str, mistakes: _Mistakes) -> Iterator[_CsvRow]:
    """Yield the rows that are not empty; a quoted cell may span several lines."""
    lines = text.split("\n")
    reader = csv.reader(io.StringIO(text))
    begin = 0
    try:
        for cells in reader:
            if any(cells):
                yield _CsvRow(begin + 1, lines[begin : reader.line_num], cells)
            begin = reader.line_num
    except csv.Error as error:  # a cell of more than 128 KiB: a quote that is never closed
        mistakes.add((begin + 1, 1), f"this and what follows is no CSV: {error}")


def _instead(header: Sequence[str]) -> str:
    """Describe a header that lacks a column."""
    if len(header) == 1 and ";" in header[0]:
        return "cells are separated by commas, not by semicolons"
    return f"the file has {_quoted(header)}"


def _quoted(names: Iterable[str]) -> str:
    return ", ".join(repr(shortened(name)) for name in names)


def _long(row: _CsvRow, columns: Mapping[str, int], mistakes: _Mistakes) -> Iterator[_Value]:
    """Yield the one value of a row, unless a cell is wrong."""
    sensor, written = row.cell(columns[SENSOR]), row.cell(columns[VALUE])
    unit = row.cell(columns[UNIT]) if UNIT in columns else ""
    tag = _name(row, columns[TAG], TAG, mistakes)
    stamp = _stamp(row, columns[STAMP], mistakes)
    named = _name(row, columns[SENSOR], SENSOR, mistakes)
    value: float | None = None
    try:
        value = checked(sensor, _number(written), unit) if written else None
    except ValueError as error:
        mistakes.add(row.place(columns[VALUE]), str(error))
        return
    if tag and named and stamp is not None:
        yield _Value(tag, sensor, stamp, row.line, value)


def _wide(row: _CsvRow, columns: Mapping[str, int], mistakes: _Mistakes) -> Iterator[_Value]:
    """Yield the values of a row; one for each cell of a sensor that is not empty."""
    if KIND in columns and row.cell(columns[KIND]) != "reading":
        return
    tag = _name(row, columns[TAG], TAG, mistakes)
    stamp = _stamp(row, columns[STAMP], mistakes)
    for column, index in columns.items():
        written = "" if column in NO_SENSORS else row.cell(index)
        if not written:
            continue
        sensor = column.removeprefix(SENSOR_PREFIX)
        try:
            number = _number(written)
            value = None if math.isnan(number) else checked(sensor, number)
        except ValueError as error:
            mistakes.add(row.place(index), f"{sensor}: {error}")
            continue
        if tag and stamp is not None:
            yield _Value(tag, sensor, stamp, row.line, value)


def _name(row: _CsvRow, index: int, column: str, mistakes: _Mistakes) -> str:
    name = row.cell(index)
    if not name:
        mistakes.add(row.place(index), f"no {column}")
    return name


def _stamp(row: _CsvRow, index: int, mistakes: _Mistakes) -> float | None:
    try:
        return seconds_since_1970(row.cell(index))
    except ValueError as error:
        mistakes.add(row.place(index), str(error))
        return None


def _number(written: str) -> float:
    try:
        return number(written)
    except ValueError:
        raise ValueError(f"{shortened(written)!r} is no number") from None
