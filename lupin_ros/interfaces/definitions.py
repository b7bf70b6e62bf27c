"""Reads installed interfaces as types of the language, and converts messages to plain data and back.

A definition is read from the JSON file that its package installs, so no message package is imported for it.
Fields on the wire have no unit: the interface's documentation gives it. The driver of bindings uses this.
"""

from __future__ import annotations

import functools
import importlib
import re
from collections.abc import Iterator, Mapping
from typing import Any

from lupin_engine.errors import LupinError, meant, nearest
from lupin_engine.plugin import (
    ANY,
    BOOL,
    INTEGER,
    NUMBER,
    POSE,
    POSE_MESSAGE,
    TEXT,
    TIMES,
    Type,
    convert,
    list_of,
    pose_fields,
    seconds_of,
    time_fields,
)
from lupin_ros.interfaces.added import cut_down
from lupin_ros.interfaces.type_hashes import installed, local_fields, local_source

#: What an interface without any field has in its place.
_FILLER = "structure_needs_at_least_one_member"

#: The numbers of `type_description_interfaces/msg/FieldType`: of plain fields, and what is added for lists.
_NESTED = 1
_INTEGERS: Mapping[int, tuple[str, int]] = {
    2: ("int8", -8), 3: ("uint8", 8), 4: ("int16", -16), 5: ("uint16", 16), 6: ("int32", -32),
    7: ("uint32", 32), 8: ("int64", -64), 9: ("uint64", 64), 13: ("char", 8), 16: ("byte", 8),
}  # fmt: skip
_BOOLEAN = 15
_NUMBERS = frozenset({10, 11, 12})
_TEXTS = frozenset({17, 18, 19, 20, 21, 22})
_LISTS_FROM = 48
#: How the length of an array is declared that has always the same.
_FIXED = re.compile(r"\[(\d+)\]$")
#: The end of the name of a part of an interface, as definitions write it.
_PART = re.compile(r"_(Request|Response|Goal|Result|Feedback)$")


#: What an interface of a kind consists of: how its parts are called, and what is appended to the type's name.
_PARTS: Mapping[str, Mapping[str, str]] = {
    "srv": {"request": "_Request", "response": "_Response"},
    "action": {"goal": "_Goal", "result": "_Result", "feedback": "_Feedback"},
    "msg": {"message": ""},
}
#: What people call a kind, one and many.
_CALLED = {"srv": ("service", "services"), "action": ("action", "actions"), "msg": ("message", "messages")}

#: A constant in the text of an interface: its name and what it is.
_CONSTANT = re.compile(
    r"^[ \t]*([a-z]\w*)(?:<=\d+)?[ \t]+([A-Z]\w*)[ \t]*=[ \t]*([^#\n]*?)[ \t]*(?:#.*)?$", re.MULTILINE
)


@functools.cache
def interface_types(name: str) -> Mapping[str, Type]:
    """Return the parts of an interface such as `std_srvs/srv/Trigger`, each as a record of its fields.

    A service has `request` and `response`, an action `goal`, `result` and `feedback`, a message `message`;
    all have `constant`.

    Raises:
        LookupError: it is not installed; the text has the nearest spelling.
    """
    package, kind, local = name.split("/")
    packages = _packages(kind)
    one, many = _CALLED[kind]
    if package not in packages:
        hint = cut_down(package) or meant(package, packages)
        hint = hint or "add it by 'lupin interfaces add FOLDER', or source the workspace that has it"
        raise LookupError(f"no package {package!r} with {many} is installed here; {hint}")
    if local not in packages[package]:
        guess, whole = meant(local, packages[package]), cut_down(package)
        hint = f"{guess} Else {whole}" if guess and whole else whole or nearest(local, packages[package])
        raise LookupError(f"{package} has no {one} {local!r}; {hint}")
    parts = {part: _record(f"{name}{suffix}") for part, suffix in _PARTS[kind].items()}
    return {**parts, "constant": _type_of_constants(interface_constants(name))}


@functools.cache
def interface_constants(name: str) -> Mapping[str, Any]:
    """Return the constants of an interface by name; those of messages inside it in a record of its name."""
    package, kind, local = name.split("/")
    own = dict(_constants(local_source(name)))
    inside: dict[str, None] = {}
    for suffix in _PARTS[kind].values():
        _collect(_record(f"{package}/{kind}/{local}{suffix}"), inside)
    for message in inside:
        constants = dict(_constants(local_source(message)))
        if constants:
            own.setdefault(message.rpartition("/")[2], constants)
    return own


def _constants(source: str) -> Iterator[tuple[str, Any]]:
    for kind, name, written in _CONSTANT.findall(source):
        if kind in ("string", "wstring"):
            quoted = len(written) > 1 and written[0] == written[-1] and written[0] in "\"'"
            yield name, written[1:-1] if quoted else written
        else:
            yield name, written.lower() in ("true", "1") if kind == "bool" else _number(written)


def _number(written: str) -> int | float:
    try:
        return int(written, 0)
    except ValueError:
        return float(written)


def _collect(record: Type, found: dict[str, None]) -> None:
    """Note the messages inside of a record."""
    for kind in record.fields.values():
        inner = kind.item if kind.item is not None else kind
        if inner.kind == "record":
            found[inner.name] = None
            _collect(inner, found)


def _type_of_constants(constants: Mapping[str, Any]) -> Type:
    kinds: Mapping[type, Type] = {bool: BOOL, int: INTEGER, float: NUMBER, str: TEXT}
    fields = {
        name: _type_of_constants(value) if isinstance(value, Mapping) else kinds[type(value)]
        for name, value in constants.items()
    }
    return Type("record", "constant", fields=fields)


def installed_types(name: str) -> Mapping[str, Type] | None:
    """Return `interface_types`; None if the package is not installed; LookupError if it has no such name.

    One that is cut down counts as installed: what is missing there is certainly missing.
    """
    package, kind, _ = name.split("/")
    return interface_types(name) if package in _packages(kind) or cut_down(package) else None


def knows_interfaces() -> bool:
    """Return whether any interfaces are installed here: on a computer without ROS there are none."""
    return next(installed("srv"), None) is not None


def _packages(kind: str) -> dict[str, list[str]]:
    """Return the interfaces of a kind that are installed, by package."""
    found: dict[str, list[str]] = {}
    for package, name in installed(kind):
        found.setdefault(package, []).append(name)
    return found


def _record(name: str) -> Type:
    fields = {field: _type(kind) for field, kind in local_fields(name) if field != _FILLER}
    called = _PART.sub(lambda part: f".{part[1]}", name)
    return Type("record", called, fields=fields)


def _type(kind: Mapping[str, Any]) -> Type:
    number = int(kind["type_id"])
    if number > _LISTS_FROM:
        return list_of(_type({**kind, "type_id": number % _LISTS_FROM}))
    if number == _NESTED:
        return _record(str(kind["nested_type_name"]))
    if number in _INTEGERS:
        name, bits = _INTEGERS[number]
        low, high = (0, 2**bits - 1) if bits > 0 else (-(2 ** (-bits - 1)), 2 ** (-bits - 1) - 1)
        return Type("integer", name, minimum=low, maximum=high)
    if number in _NUMBERS:
        return NUMBER
    if number in _TEXTS:
        return TEXT
    return BOOL if number == _BOOLEAN else ANY


def interface_class(name: str) -> Any:
    """Return the class of an interface that is installed.

    Raises:
        LupinError: its definition is there, but no Python code for it.
    """
    package, kind, local = name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), local)
    except (ImportError, AttributeError) as problem:
        raise LupinError(f"{name} is installed, but cannot be used from Python: {problem}") from problem


def fill(message: Any, data: Any, kind: Type) -> Any:
    """Write plain data into a message of a type; fields that are not named keep their values.

    A record may have more fields than the message. Seconds fill a time, a `pose` of the language fills the
    pose of a message.

    Raises:
        ValueError: a value does not fit its field, such as a number that is too large; rclpy's messages do
            not check that, and would send garbage.
    """
    given = _fields_of(data, kind)
    for name in filter(kind.fields.__contains__, given):
        wanted, value = kind.fields[name], given[name]
        try:
            if wanted.kind == "record":
                fill(getattr(message, name), value, wanted)
            else:
                setattr(message, name, _carried(message, name, value, wanted))
        except _Misfit:
            raise
        except ValueError as problem:
            raise _Misfit(f"{kind}.{name}: {problem}") from problem
    return message


class _Misfit(ValueError):
    """A value that does not fit, and that says already where."""


def _fields_of(data: Any, kind: Type) -> Mapping[str, Any]:
    if kind.name in TIMES and not isinstance(data, Mapping):
        return time_fields(data)
    if not isinstance(data, Mapping):
        raise ValueError(f"expected {kind}, got {data!r}")
    return pose_fields(data) if kind.name == POSE_MESSAGE and data.keys() == POSE.fields.keys() else data


def _carried(message: Any, name: str, value: Any, wanted: Type) -> Any:
    declared = type(message).get_fields_and_field_types()[name]
    length = _FIXED.search(declared)
    if length is not None and len(value) != int(length[1]):
        raise ValueError(f"expected {declared}, got {len(value)} elements")
    if wanted.item is not None and wanted.item.kind == "record":
        return [fill(element_of(declared), each, wanted.item) for each in value]
    if wanted.name == "byte":  # of which Python's side of ROS wants the bytes themselves
        return bytes([convert(value, wanted)])
    return convert(value, wanted)


def element_of(listed: str) -> Any:
    """Make an element of a list declared as `sequence<geometry_msgs/Point>` or `geometry_msgs/Point[3]`."""
    name = listed.partition("<")[2].rstrip(">").partition(",")[0] or listed.partition("[")[0]
    package, _, local = name.partition("/")
    return getattr(importlib.import_module(f"{package}.msg"), local)()


def plain(value: Any) -> Any:
    """Return a message as dictionaries, lists and scalars; a time as seconds."""
    if type(value).__module__.startswith("builtin_interfaces."):  # it has Time and Duration only
        return seconds_of(value)
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, bytes):
        return value[0] if len(value) == 1 else list(value)
    if isinstance(value, str) or not hasattr(value, "__iter__"):
        return value.item() if hasattr(value, "item") else value
    return [plain(element) for element in value]
