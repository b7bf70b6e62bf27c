"""Reads the layout of a greenhouse, the positions of its tags and tables, and reports all errors at once.

Metres in frame `map`. The simulator, the bridge and the world read the same file: `{"units": "m", "tags":
{id: {"x", "y", "sensors", "facing"}}, "tables": {name: {"x0", "x1", "y0", "y1"}}}`; one without `tags` is
the tag map itself. `facing` is optional: the map axis of a plate's normal, "+x", "+y", "-x" or "-y". The
bundled `greenhouse.json` is that of mdp-greenhouse 1.0.8 (29 tags, 10 tables, no tag 8), whose plates have
no `facing`; ours are the guesses of `lupin_nav.plates`, and they were not checked on site.
"""

from __future__ import annotations

import json
import math
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from lupin_engine.errors import LupinError, shortened
from lupin_greenhouse.numbers import finite

BUNDLED = Path(__file__).with_name("greenhouse.json")
#: How a layout says where a plate faces, and the heading that it means.
FACINGS = {"+x": 0.0, "+y": math.pi / 2, "-x": math.pi, "-y": -math.pi / 2}
#: How many problems of a layout are reported.
MAX_PROBLEMS = 20


@dataclass(frozen=True)
class Tag:
    """A tag: the position of its plate in metres, and the sensors that it stands for, in order.

    `facing` is the heading of the plate's outward normal in radians; None where the layout has none.
    """

    id: str
    x: float
    y: float
    sensors: tuple[str, ...] = ()
    facing: float | None = None


@dataclass(frozen=True)
class Table:
    """A planter table: its axis-parallel footprint in metres, `x0 <= x1` and `y0 <= y1`."""

    id: str
    x0: float
    x1: float
    y0: float
    y1: float

    def distance(self, x: float, y: float) -> float:
        """Return the distance of a point from this table; 0 on it."""
        return math.hypot(max(self.x0 - x, 0.0, x - self.x1), max(self.y0 - y, 0.0, y - self.y1))


@dataclass(frozen=True)
class Layout:
    """All tags by id, and the usable tables in lexicographic order of their ids."""

    tags: Mapping[str, Tag]
    tables: tuple[Table, ...]

    def tag(self, tag_id: Any) -> Tag:
        """Return the tag with that id.

        Raises:
            ValueError: the layout has no such tag; the text lists those it has.
        """
        found = self.tags.get(tag_id) if isinstance(tag_id, str) else None
        if found is None:
            raise ValueError(self._unknown([tag_id]))
        return found

    def named(self, names: list[str]) -> list[Tag]:
        """Return the tags with these ids, in this order.

        Raises:
            ValueError: some ids are unknown; the text names every one of them.
        """
        unknown = [name for name in names if name not in self.tags]
        if unknown:
            raise ValueError(self._unknown(unknown))
        return [self.tags[name] for name in names]

    def numeric_order(self) -> list[Tag]:
        """Return all tags: numeric ids first and by number (2 before 10), then the others by name."""
        return [self.tags[tag_id] for tag_id in sorted(self.tags, key=numeric_key)]

    def _unknown(self, ids: list[Any]) -> str:
        known = ", ".join(tag.id for tag in self.numeric_order())
        wanted = ", ".join(repr(shortened(tag_id) if isinstance(tag_id, str) else tag_id) for tag_id in ids)
        return f"unknown tag {wanted}; the layout has {len(self.tags)} tags: {known}"


def numeric_key(tag_id: str) -> tuple[bool, int, str, str]:
    """Return the sort key of a tag id: numbers by value, before names."""
    is_number = tag_id.isascii() and tag_id.isdecimal()
    digits = tag_id.lstrip("0") if is_number else ""
    return not is_number, len(digits), digits, tag_id


def load(path: str = "", parameter: str = "tag_locations_file") -> Layout:
    """Read a layout file; an empty path means the bundled one.

    Raises:
        LupinError: the file cannot be read, is no JSON, has a name twice, or `parse` refuses it; all errors,
            each with the file's name and the `parameter` that named it.
    """
    # Unlike Path.expanduser, this leaves the home of a user that does not exist as it is written.
    file = Path(os.path.expanduser(path)) if path else BUNDLED
    try:
        text = file.read_text(encoding="utf-8")
        if text.startswith("\ufeff"):
            raise ValueError("it begins with a byte order mark; save it as UTF-8 without one")
        return _read(text)
    except OSError as error:
        reason = error.strerror or str(error)
    except (ValueError, RecursionError) as error:
        reason = str(error)
    about = f"{parameter} {str(file)!r} cannot be used: "
    raise LupinError("\n".join(about + line for line in reason.splitlines()))


@lru_cache(maxsize=8)
def _read(text: str) -> Layout:
    """Return the layout in a file; nothing is cached."""
    twice: list[str] = []
    data = json.loads(text, object_pairs_hook=partial(_once, twice))
    return _checked(data, twice)


def _once(problems: list[str], pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Record duplicate names: JSON would keep the last one, and lose a tag silently."""
    found = dict(pairs)
    if len(found) < len(pairs):
        counts = Counter(name for name, _ in pairs)
        twice = ", ".join(repr(shortened(name)) for name, count in counts.items() if count > 1)
        problems.append(f"{twice} more than once in one object")
    return found


def parse(data: Any) -> Layout:
    """Build a layout from parsed JSON; tables that are not four finite numbers are left out.

    Raises:
        ValueError: `data` holds no tags, is not in metres, or tags have no position, no list of sensors, or a
            facing that is none of `FACINGS`. The text has all of that, each on a line.
    """
    return _checked(data, [])


def _checked(data: Any, known: Sequence[str]) -> Layout:
    """As `parse`; `known` are errors that have been found before."""
    problems = [*known, *_problems(data)]
    if problems:
        raise ValueError(_joined(problems))
    raw_tags, raw_tables = data.get("tags", data), data.get("tables", {}) if "tags" in data else {}
    tags = {str(tag_id): _tag(str(tag_id), raw) for tag_id, raw in raw_tags.items()}
    tables = [_table(str(name), raw) for name, raw in sorted(raw_tables.items())]
    return Layout(MappingProxyType(tags), tuple(table for table in tables if table is not None))


def _problems(data: Any) -> Iterator[str]:
    """Yield the problems of a layout."""
    if not isinstance(data, Mapping):
        yield f"expected a JSON object, got {type(data).__name__}"
        return
    is_whole = "tags" in data
    units = data.get("units", "m") if is_whole else "m"
    if units != "m":
        # The greenhouse simulator reads the same file, and takes every number for metres.
        yield f'"units" is {units!r}; write all positions in metres, and "units": "m"'
    raw_tags = data.get("tags", data)
    if not isinstance(raw_tags, Mapping) or (is_whole and not isinstance(data.get("tables", {}), Mapping)):
        yield "'tags' and 'tables' must be JSON objects"
    elif not raw_tags:
        yield "it has no tags"
    if isinstance(raw_tags, Mapping):
        for tag_id, raw in raw_tags.items():
            yield from _problems_of_tag(str(tag_id), raw)


def _joined(problems: Sequence[str]) -> str:
    """Return errors, one a line; beyond `MAX_PROBLEMS` a note that there are more."""
    more = [f"and {len(problems) - MAX_PROBLEMS} more"] if len(problems) > MAX_PROBLEMS else []
    return "\n".join([*problems[:MAX_PROBLEMS], *more])


def _problems_of_tag(tag_id: str, raw: Any) -> Iterator[str]:
    """Yield the problems of a tag."""
    if None in (_metres(raw, "x"), _metres(raw, "y")):
        yield f"tag {tag_id!r} has no position: expected numbers x and y in metres, got {raw!r}"
    if not isinstance(raw, Mapping):
        return
    sensors = raw.get("sensors", [])
    if not isinstance(sensors, list) or not all(isinstance(name, str) for name in sensors):
        yield f"the sensors of tag {tag_id!r} are no list of names, but {sensors!r}"
    facing = raw.get("facing")
    if "facing" in raw and (not isinstance(facing, str) or facing not in FACINGS):
        yield (
            f"the facing of tag {tag_id!r} is {shortened(repr(facing))}; write the axis of the map along "
            f"which its plate looks, one of {', '.join(FACINGS)}, or leave it out if you do not know it"
        )


def _tag(tag_id: str, raw: Mapping[str, Any]) -> Tag:
    """Return a tag that has no problems."""
    x, y = float(raw["x"]), float(raw["y"])
    facing = FACINGS[raw["facing"]] if "facing" in raw else None
    return Tag(tag_id, x, y, tuple(raw.get("sensors", [])), facing)


def _table(name: str, raw: Any) -> Table | None:
    x0, x1, y0, y1 = (_metres(raw, key) for key in ("x0", "x1", "y0", "y1"))
    if x0 is None or x1 is None or y0 is None or y1 is None:
        return None
    return Table(name, min(x0, x1), max(x0, x1), min(y0, y1), max(y0, y1))


def _metres(raw: Any, key: str) -> float | None:
    return finite(raw.get(key)) if isinstance(raw, Mapping) else None
