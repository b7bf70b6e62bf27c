"""`lupin types` says what the generated classes of rclpy have: every field, type, length and constant."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from rclpy.serialization import serialize_message

from lupin_gateway.encoding import as_json
from lupin_gateway.node.types import decode
from lupin_msgs.msg import MissionState, Observation, SensorReading, TagReading
from lupin_msgs.srv import StartMission
from lupin_ros.interfaces.definitions import interface_class
from lupin_ros.interfaces.files import InterfaceSet, names_in, read_interfaces
from lupin_ros.interfaces.json_schema import json_schema, reference
from lupin_ros.interfaces.typescript import type_names, typescript
from lupin_ros.interfaces.used import used_interfaces
from tests.npm import installed, run_node

CONSOLE = Path(__file__).parents[3] / "console" / "src" / "ros.ts"
_COMMENT = re.compile(r"^ */\*\*.*?\*/\n", re.DOTALL | re.MULTILINE)
#: The last one whose compiler is a library of JavaScript.
VERSION = "5.9.3"
#: Also what a run has none of: bytes, arrays of fixed length and with a limit, constants of other kinds.
PACKAGES = ("sensor_msgs", "diagnostic_msgs", "rcl_interfaces", "geometry_msgs", "lupin_msgs", "std_msgs")
#: A field as rclpy tells it: `sequence<float, 3>`, `double[36]`, `string<12>`, `geometry_msgs/Point`.
LISTED = re.compile(r"sequence<(?P<many>.+?)(?:, (?P<most>\d+))?>|(?P<some>.+)\[(?P<size>\d+)\]")
#: Arrays of these are texts in base64.
BYTES = ("uint8", "octet")
BOUNDED = re.compile(r"w?string<(\d+)>")


@pytest.fixture(scope="module")
def many() -> InterfaceSet:
    """What a run uses, and all of some packages."""
    return read_interfaces(used_interfaces().union(*map(names_in, PACKAGES)))


def class_of(name: str) -> Any:
    """Return the class of a message, or of a part of a service or action."""
    interface, part = name.rsplit("_", 1) if "/msg/" not in name else (name, "")
    found = interface_class(interface)
    return getattr(found, part) if part else found


def fields_of(name: str) -> dict[str, str]:
    """Return the fields of a message as rclpy tells them."""
    return dict(class_of(name).get_fields_and_field_types())


def element(declared: str) -> tuple[str, int | None, int | None]:
    """Return what a field is, or has elements of, with its lengths: at least and at most; 0 for no array."""
    found = LISTED.fullmatch(declared)
    if found is None:
        return declared, 0, 0
    size = int(found["size"]) if found["size"] else None
    return found["many"] or found["some"], size, size or (int(found["most"]) if found["most"] else None)


def in_typescript(declared: str, names: Mapping[str, str]) -> str:
    """Return what a field of rclpy is in TypeScript."""
    kind, _, most = element(declared)
    is_array = most != 0
    if is_array and kind in BYTES:
        return "string"
    if BOUNDED.fullmatch(kind) or kind in ("string", "wstring"):
        base = "string"
    elif "/" in kind:
        base = names[kind.replace("/", "/msg/")]
    else:
        base = {"boolean": "boolean", "float": "number | null", "double": "number | null"}.get(kind, "number")
    return base if not is_array else f"({base})[]" if "|" in base else f"{base}[]"


def constants_of(name: str) -> dict[str, Any]:
    """Return the constants of a class of rclpy; a byte is a number."""
    kept = getattr(type(class_of(name)), f"_{type(class_of(name)).__name__}__constants", {})
    return {key: value[0] if isinstance(value, bytes) else value for key, value in kept.items()}


@pytest.mark.node
@pytest.mark.timeout(400)
def test_typescript_has_what_rclpy_has(many: InterfaceSet, tmp_path: Path) -> None:
    """TypeScript's own compiler takes the module under --strict, and finds every field of every class."""
    module = tmp_path / "ros.ts"
    module.write_text(typescript(many), encoding="utf-8")
    script = Path(__file__).with_name("members.cjs")
    compiler = installed(f"typescript@{VERSION}") / "node_modules" / "typescript"
    found = json.loads(run_node(script, compiler, module))
    assert found["problems"] == []
    names = type_names(many.messages)
    assert len(names) > 180
    assert found["types"] == {
        short: {
            field: {"type": in_typescript(declared, names), "optional": name.endswith(("_Request", "_Goal"))}
            for field, declared in fields_of(name).items()
        }
        for name, short in names.items()
    }
    tables = {table: found["values"].pop(table) for table in ("MSG_TYPES", "SRV_TYPES", "ACTION_TYPES")}
    assert found["values"] == {
        names[name]: constants for name in many.messages if (constants := constants_of(name))
    }
    every = [full for table in tables.values() for full in table.values()]
    assert sorted(every) == sorted({*many.interfaces, *(name for name in many.messages if "/msg/" in name)})
    assert tables["SRV_TYPES"]["StartMission"] == "lupin_msgs/srv/StartMission"


def test_the_types_of_the_console_are_those_of_a_run() -> None:
    """Their comments aside, which are the interface files' own, and may differ between releases of ROS 2."""
    command = "bin/lupin types ts --output console/src/ros.ts"
    told, made = CONSOLE.read_text(encoding="utf-8"), typescript(read_interfaces(used_interfaces()))
    if _COMMENT.sub("", told) != _COMMENT.sub("", made):
        pytest.fail(f"out of date; write it anew: .venv/{command}", pytrace=False)


def test_json_schema_has_what_rclpy_has(many: InterfaceSet) -> None:
    """The same fields, in the same order, with the lengths and spans that rclpy checks."""
    document = json.loads(json_schema(many))
    jsonschema.Draft202012Validator.check_schema(document)
    assert list(document["$defs"]) == list(many.messages)
    for name, schema in document["$defs"].items():
        declared = fields_of(name)
        assert list(schema["properties"]) == list(declared), name
        for field, written in schema["properties"].items():
            kind, least, most = element(declared[field])
            if most != 0 and kind in BYTES:
                assert written["contentEncoding"] == "base64"
                continue
            assert (written.get("minItems"), written.get("maxItems")) == (least or None, most or None), name
            inner = written.get("items", written)
            assert inner.get("$ref") == (reference(kind.replace("/", "/msg/")) if "/" in kind else None)
            longest = BOUNDED.fullmatch(kind)
            assert inner.get("maxLength") == (int(longest[1]) if longest else None)
        kept = {key: value["const"] for key, value in schema.get("x-constants", {}).items()}
        assert kept == constants_of(name), name


def sent(name: str, value: Any) -> Any:
    """Return a message as our gateway sends it."""
    interface, part = name.rsplit("_", 1) if "/msg/" not in name else (name, "")
    return json.loads(as_json(decode(interface, part)(serialize_message(value))))


def validator(many: InterfaceSet, name: str) -> Any:
    """Return what checks JSON against the schema of a message."""
    document = json.loads(json_schema(many))
    return jsonschema.Draft202012Validator({**document, "$ref": reference(name)})


def test_an_empty_message_of_every_type_is_valid(many: InterfaceSet) -> None:
    """As their classes make them, with the defaults that their authors gave."""
    document = json.loads(json_schema(many))
    for name in many.messages:
        schema = jsonschema.Draft202012Validator({**document, "$ref": reference(name)})
        assert [error.message for error in schema.iter_errors(sent(name, class_of(name)()))] == [], name


def test_real_messages_are_valid_and_wrong_ones_are_not(many: InterfaceSet) -> None:
    """NaN, what is left out of a request, a field that nobody knows."""
    reading = SensorReading(name="temperature", value=math.nan)
    told = Observation(tag_reading=TagReading(tag_id="5", readings=[reading]))
    valid = validator(many, "lupin_msgs/msg/Observation")
    arrived = sent("lupin_msgs/msg/Observation", told)
    assert list(valid.iter_errors(arrived)) == []
    assert arrived["tag_reading"]["readings"][0]["value"] is None
    state = sent("lupin_msgs/msg/MissionState", MissionState(targets_total=3))
    wrong = {**state, "targets_total": -1, "paused": "no", "lost": 1}
    del wrong["mission_id"]
    errors = validator(many, "lupin_msgs/msg/MissionState").iter_errors(wrong)
    assert sorted(error.message for error in errors) == [
        "'mission_id' is a required property",
        "'no' is not of type 'boolean'",
        "-1 is less than the minimum of 0",
        "Additional properties are not allowed ('lost' was unexpected)",
    ]
    request = validator(many, "lupin_msgs/srv/StartMission_Request")
    assert list(request.iter_errors({"mission_type": "InspectionMission"})) == []
    assert (
        list(request.iter_errors(sent("lupin_msgs/srv/StartMission_Request", StartMission.Request()))) == []
    )
    assert [error.message for error in request.iter_errors({"mission": ""})] == [
        "Additional properties are not allowed ('mission' was unexpected)"
    ]
