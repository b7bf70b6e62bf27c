"""Reads the hash, the fields and the source of an interface as it is installed on this machine.

Two processes whose definitions of a type differ still match over DDS and then exchange nothing, or nonsense,
without a warning. The hash that a peer announces (`topic_type_hash`) compared with ours is the only sign. A
type that is not installed raises UsageError, except where '' or None is returned.
"""

from __future__ import annotations

import functools
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

from lupin_engine.errors import UsageError


def local_hash(type_name: str) -> str:
    """Return the hash, `RIHS01_...`, of a type such as `nav2_msgs/action/NavigateToPose_Goal`.

    Raises:
        UsageError: it is not installed, or its definition carries no hash.
    """
    for entry in _description(type_name)["type_hashes"]:
        if entry["type_name"] == type_name:
            return cast("str", entry["hash_string"])
    raise UsageError(f"the installed definition of {type_name} carries no hash")


def local_fields(type_name: str) -> tuple[tuple[str, dict[str, Any]], ...]:
    """Return name and type description of each field on the wire, in order; constants are not there.

    Raises:
        UsageError: it is not installed, or its definition does not describe it.
    """
    message = _description(type_name)["type_description_msg"]
    for described in [message["type_description"], *message["referenced_type_descriptions"]]:
        if described["type_name"] == type_name:
            return tuple((field["name"], field["type"]) for field in described["fields"])
    raise UsageError(f"the installed definition of {type_name} has no description")


def installed(kind: str) -> Iterator[tuple[str, str]]:
    """Yield package and name of every interface of a kind (`msg`, `srv`, `action`) that is installed."""
    for prefix in _prefixes():
        for file in sorted(prefix.glob(f"share/*/{kind}/*.json")):
            yield file.parents[1].name, file.stem


def local_source(type_name: str) -> str:
    """Return the text of a type's .msg, .srv or .action file; '' where it is not installed."""
    file = find_source(type_name)
    return file.read_text(encoding="utf-8") if file else ""


def find_source(type_name: str) -> Path | None:
    """Return a type's .msg, .srv or .action file; None where it is not installed."""
    package, kind, name = _split(type_name)
    files = (prefix / "share" / package / kind / f"{name}.{kind}" for prefix in _prefixes())
    return next((file for file in files if file.is_file()), None)


@functools.cache
def _description(type_name: str) -> dict[str, Any]:
    """Return the generator's description of a type, of a part such as X_Request that of service X.

    Raises:
        UsageError: it is not installed.
    """
    package, kind, name = _split(type_name)
    relative = Path("share", package, kind, f"{name.split('_')[0]}.json")
    for prefix in _prefixes():
        if (prefix / relative).is_file():
            return cast("dict[str, Any]", json.loads((prefix / relative).read_text(encoding="utf-8")))
    looked = ", ".join(str(prefix) for prefix in _prefixes())
    raise UsageError(f"{type_name} is not installed: no {relative} below {looked}")


def _split(type_name: str) -> tuple[str, str, str]:
    parts = type_name.split("/")
    if len(parts) != 3 or parts[1] not in ("msg", "srv", "action"):
        raise UsageError(f"{type_name!r} is not the full name of a type, such as std_msgs/msg/String")
    return parts[0], parts[1], parts[2]


def _prefixes() -> Iterator[Path]:
    """Yield the roots of installed interfaces in ROS's search order; the environment's own root is last."""
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield Path(prefix)
    yield Path(sys.prefix)
