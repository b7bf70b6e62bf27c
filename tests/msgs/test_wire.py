"""What goes over the wire is what users' systems speak: every type's hash, fields in order, and constants.

`wire.json` was not read off the generated packages. The message texts of the published interface reference
were hashed by an implementation of RIHS01 written from the specification, and again by `rosbags`. The two
agree except where a service's event record comes in, in which `rosbags` takes `char` for a type of its own
and rosidl writes `uint8`. For nav2 and tf2 the table equals what public builds of Jazzy announce.
"""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.errors import UsageError
from lupin_ros.interfaces.type_hashes import local_fields, local_hash
from lupin_ros.launch.health import RIHS
from lupin_ros.service.names import COMMAND_HASH, COMMAND_TYPE

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros

WIRE: dict[str, dict[str, Any]] = json.loads(
    Path(__file__).with_name("wire.json").read_text(encoding="utf-8")
)
PRIMITIVES = {
    2: "int8",
    3: "uint8",
    4: "int16",
    5: "uint16",
    6: "int32",
    7: "uint32",
    8: "int64",
    9: "uint64",
    10: "float32",
    11: "float64",
    15: "bool",
    17: "string",
}
ARRAY, BOUNDED, UNBOUNDED = 48, 96, 144


def spelled(described: dict[str, Any]) -> str:
    """A type of a description as it would stand in a .msg file."""
    identifier, capacity = described["type_id"], described["capacity"]
    base = described["nested_type_name"] or PRIMITIVES[identifier % 48]
    if identifier > UNBOUNDED:
        return f"{base}[]"
    if identifier > BOUNDED:
        return f"{base}[<={capacity}]"
    return f"{base}[{capacity}]" if identifier > ARRAY else base


def generated(type_name: str) -> Any:
    """The Python class of a type, or of a part of one."""
    package, kind, name = type_name.split("/")
    module = importlib.import_module(f"{package}.{kind}")
    outer, *parts = name.split("_")
    found = getattr(module, outer)
    for part in parts:
        found = getattr(found, part)
    return found


@pytest.mark.parametrize("type_name", WIRE)
def test_hash(type_name: str) -> None:
    assert local_hash(type_name) == WIRE[type_name]["hash"]


def test_the_hash_of_our_own_interface() -> None:
    """A change to it is another type to every program that was built before."""
    assert local_hash(COMMAND_TYPE) == f"{RIHS}{COMMAND_HASH}"


@pytest.mark.parametrize("type_name", WIRE)
def test_fields_in_order(type_name: str) -> None:
    fields = [[name, spelled(described)] for name, described in local_fields(type_name)]
    # A type without fields is given one by the generators, as C has no empty structures.
    assert fields == (WIRE[type_name]["fields"] or [["structure_needs_at_least_one_member", "uint8"]])


@pytest.mark.parametrize("type_name", [name for name in WIRE if "constants" in WIRE[name]])
def test_constants(type_name: str) -> None:
    cls = generated(type_name)
    expected = WIRE[type_name]["constants"]
    assert {name: getattr(cls, name) for name in expected} == expected


def test_python_class_has_the_same_fields() -> None:
    for type_name, expected in WIRE.items():
        if type_name.startswith("lupin_msgs/msg/"):
            python = list(generated(type_name).get_fields_and_field_types())
            assert python == [name for name, _ in expected["fields"]], type_name


def test_the_eleven_messages_and_eleven_services_are_all_there() -> None:
    whole = [name for name in WIRE if name.startswith("lupin_msgs/") and "_" not in name.split("/")[2]]
    assert sum("/msg/" in name for name in whole) == 11
    assert sum("/srv/" in name for name in whole) == 11
    source = Path(__file__).parents[2] / "lupin_msgs"
    files = {
        f"lupin_msgs/{path.parent.name}/{path.stem}"
        for path in source.glob("*/*")
        if path.suffix in (".msg", ".srv")
    }
    assert files == set(whole)


def test_unknown_type_is_told_with_the_places_looked_at() -> None:
    with pytest.raises(
        UsageError, match=r"lupin_msgs/msg/Nothing is not installed: no .*Nothing\.json below"
    ):
        local_hash("lupin_msgs/msg/Nothing")
    with pytest.raises(UsageError, match="is not the full name of a type"):
        local_hash("lupin_msgs/Observation")
