"""Definitions of services as types of the language, messages as plain data: for what is known by name only.

A definition is read from what its package installed beside the code, so nothing is imported to look at it.
Fields on the wire carry no unit: they are seconds, metres, radians, or whatever the interface says.
"""

from __future__ import annotations

import functools
import importlib
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from lupin_engine.errors import LupinError, nearest
from lupin_engine.middleware.type_hashes import installed, local_fields
from lupin_engine.plugin.types import ANY, BOOL, NUMBER, TEXT, Type, convert, list_of

#: What an interface without any field has in its place.
_FILLER = "structure_needs_at_least_one_member"

#: The numbers of `type_description_interfaces/msg/FieldType`: of plain fields, and what is added for lists.
_NESTED = 1
_INTEGERS: Mapping[int, tuple[str, int]] = {
    2: ("int8", -8), 3: ("uint8", 8), 4: ("int16", -16), 5: ("uint16", 16), 6: ("int32", -32),
    7: ("uint32", 32), 8: ("int64", -64), 9: ("uint64", 64), 13: ("char", 8),
}  # fmt: skip
_BOOLEAN = 15
_NUMBERS = frozenset({10, 11, 12})
_TEXTS = frozenset({17, 18, 19, 20, 21, 22})
_LISTS_FROM = 48
#: How the length of an array is declared that has always the same.
_FIXED = re.compile(r"\[(\d+)\]$")


class ServiceTypes(NamedTuple):
    """What the request and the response of a type of service are: records."""

    request: Type
    response: Type


@functools.cache
def service_types(name: str) -> ServiceTypes:
    """Return the fields of a type of service such as `std_srvs/srv/Trigger`.

    Raises:
        LookupError: it is not installed; the text says what is, with the nearest spelling.
    """
    package, kind, local = name.split("/")
    packages = _packages(kind)
    if package not in packages:
        hint = nearest(package, packages)
        hint = hint if hint.startswith("did you mean") else "install it, or source the workspace that has it"
        raise LookupError(f"no package {package!r} with services is installed here; {hint}")
    if local not in packages[package]:
        raise LookupError(f"{package} has no service {local!r}; {nearest(local, packages[package])}")
    return ServiceTypes(_record(f"{name}_Request"), _record(f"{name}_Response"))


def installed_types(name: str) -> ServiceTypes | None:
    """Return the same, or None where the package is not installed; LookupError of a package without it."""
    package, kind, _ = name.split("/")
    return service_types(name) if package in _packages(kind) else None


def knows_services() -> bool:
    """Tell whether any services are installed here: on a computer without ROS there are none."""
    return next(installed("srv"), None) is not None


def _packages(kind: str) -> dict[str, list[str]]:
    """Return the interfaces of a kind that are installed, by package."""
    found: dict[str, list[str]] = {}
    for package, name in installed(kind):
        found.setdefault(package, []).append(name)
    return found


def _record(name: str) -> Type:
    fields = {field: _type(kind) for field, kind in local_fields(name) if field != _FILLER}
    called = name.replace("_Request", ".Request").replace("_Response", ".Response")
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


def service_class(name: str) -> Any:
    """Return the class of a type of service that is installed.

    Raises:
        LupinError: its definition is there, but no Python code for it.
    """
    package, kind, local = name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), local)
    except (ImportError, AttributeError) as problem:
        raise LupinError(f"{name} is installed, but cannot be used from Python: {problem}") from problem


def fill(message: Any, data: Mapping[str, Any], kind: Type) -> Any:
    """Write plain data into a message of a type; what is not named stays as it is.

    Raises:
        ValueError: a value does not fit its field, for example a number that is too large. The messages
            themselves do not look, and what they then send is garbage.
    """
    for name, value in data.items():
        wanted = kind.fields[name]
        if wanted.kind == "record":
            fill(getattr(message, name), value, wanted)
            continue
        try:
            setattr(message, name, _carried(message, name, value, wanted))
        except ValueError as problem:
            raise ValueError(f"{kind}.{name}: {problem}") from problem
    return message


def _carried(message: Any, name: str, value: Any, wanted: Type) -> Any:
    declared = type(message).get_fields_and_field_types()[name]
    length = _FIXED.search(declared)
    if length is not None and len(value) != int(length[1]):
        raise ValueError(f"expected {declared}, got {len(value)} elements")
    if wanted.item is not None and wanted.item.kind == "record":
        return [fill(_element(declared), each, wanted.item) for each in value]
    return convert(value, wanted)


def _element(listed: str) -> Any:
    """Make an element of a list declared as `sequence<geometry_msgs/Point>` or `geometry_msgs/Point[3]`."""
    name = listed.partition("<")[2].rstrip(">").partition(",")[0] or listed.partition("[")[0]
    package, _, local = name.partition("/")
    return getattr(importlib.import_module(f"{package}.msg"), local)()


def plain(value: Any) -> Any:
    """Return a message as dictionaries, lists and scalars."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, (str, bytes)) or not hasattr(value, "__iter__"):
        return value.item() if hasattr(value, "item") else value
    return [plain(element) for element in value]
