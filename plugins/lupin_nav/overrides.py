"""Reads approach poses that were set by hand for single tags.

The file is YAML: `overrides: {tag id: {yaw, standoff, goal_x, goal_y}}`, every key of a tag optional; radians
and metres in frame `map`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any

import yaml

from lupin_engine.errors import LupinError
from lupin_greenhouse import finite


@dataclass(frozen=True)
class Override:
    """The values set by hand for one tag; None keeps the computed value."""

    yaw: float | None = None
    standoff: float | None = None
    goal_x: float | None = None
    goal_y: float | None = None


#: The keys that an entry may have; others are dropped, so a file may carry notes.
KEYS = tuple(field.name for field in fields(Override))


class _Loader(yaml.SafeLoader):
    """A YAML loader that refuses duplicate keys: one of them would be lost silently."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        names = [str(self.construct_object(key)) for key, _ in node.value]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"{name!r} is there twice in what begins in line {node.start_mark.line + 1}")
        found: dict[Any, Any] = super().construct_mapping(node, deep)
        return found


def load(path: str) -> Mapping[str, Override]:
    """Read an overrides file; an empty path means none.

    Raises:
        LupinError: the file cannot be read, is no YAML, or `parse` refuses it. That is an error, so that the
            robot does not drive to the poses which the file would have replaced.
    """
    if not path:
        return MappingProxyType({})
    file = Path(os.path.expanduser(path))
    try:
        return parse(_Loader(file.read_text(encoding="utf-8")).get_single_data())
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        raise LupinError(f"approach_overrides_file {str(file)!r} cannot be used: {error}") from error


def parse(data: Any) -> Mapping[str, Override]:
    """Build the overrides by tag id from parsed YAML.

    Ids become text, unknown keys are dropped, an entry that is no mapping is skipped, and without the key
    `overrides` there are none.

    Raises:
        ValueError: `overrides` is no mapping, or a value is no finite number.
    """
    raw = data.get("overrides", {}) if isinstance(data, Mapping) else {}
    if not isinstance(raw, Mapping):
        raise ValueError(f"'overrides' must map tag ids to values, got {type(raw).__name__}")
    entries = {str(tag_id): entry for tag_id, entry in raw.items() if isinstance(entry, Mapping)}
    return MappingProxyType({tag_id: _override(tag_id, entry) for tag_id, entry in entries.items()})


def _override(tag_id: str, entry: Mapping[str, Any]) -> Override:
    return Override(**{key: _number(tag_id, key, entry[key]) for key in KEYS if key in entry})


def _number(tag_id: str, key: str, value: Any) -> float:
    number = finite(value)
    if number is None:
        raise ValueError(f"{key} of tag {tag_id!r} must be a finite number, got {value!r}")
    return number
