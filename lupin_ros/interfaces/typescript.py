"""Writes interfaces as TypeScript, in the form of rosbridge's JSON; for `lupin types ts`."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping

from lupin_ros.interfaces.files import FieldType, InterfaceSet, WrittenField, WrittenMessage

_HEAD = """\
// Made by `lupin types ts` from the interface files of ROS 2. Do not edit it: make it anew.
//
// Values as they travel through rosbridge in JSON. NaN and infinity are null. Arrays of bytes are texts in
// base64. Integers of 64 bits are numbers, exact up to Number.MAX_SAFE_INTEGER. Of a request or a goal, what
// is left out has its default."""
#: Names that mean something else to whoever reads TypeScript; they get their package in front.
_TAKEN = frozenset(
    {"Boolean", "Date", "Error", "Function", "Map", "Number", "Object", "Record", "Set", "String"}
)
#: From here on integers are not exact in JavaScript.
_SAFE = 2**53


def typescript(interfaces: InterfaceSet) -> str:
    """Return a module of TypeScript: an interface for each message, its constants, and the names of types."""
    names = type_names(interfaces.messages)
    parts = [_HEAD]
    for message in interfaces.messages.values():
        parts.append("\n".join(_interface(message, names)))
        if message.constants:
            parts.append("\n".join(_constants(message, names[message.name])))
    for kind, table in (("msg", "MSG_TYPES"), ("srv", "SRV_TYPES"), ("action", "ACTION_TYPES")):
        parts.append("\n".join(_table(table, list(interfaces.of_kind(kind)))))
    return "\n".join(f"{part}\n" for part in parts)


def type_names(full_names: Iterable[str]) -> dict[str, str]:
    """Return each message's TypeScript name: its own; with the package in front if two have it or TS does."""
    full = list(full_names)
    own = {name: name.rpartition("/")[2].replace("_", "") for name in full}
    count = Counter(own.values())
    return {
        name: f"{_camel(name.partition('/')[0])}{short}" if count[short] > 1 or short in _TAKEN else short
        for name, short in own.items()
    }


def _camel(package: str) -> str:
    return "".join(word.capitalize() for word in package.split("_"))


def _interface(message: WrittenMessage, names: Mapping[str, str]) -> Iterator[str]:
    yield from _comment(f"`{message.name}`", *message.doc.splitlines())
    if not message.fields:
        yield f"export type {names[message.name]} = Record<string, never>;"
        return
    optional = "?" if message.is_filled else ""
    yield f"export interface {names[message.name]} {{"
    for one in message.fields:
        yield from _comment(*_field_doc(one), indent="  ")
        yield f"  {one.name}{optional}: {type_of(one.type, names)};"
    yield "}"


def _field_doc(one: WrittenField) -> Iterator[str]:
    yield from one.doc.splitlines()
    span = one.type.span
    hides = one.type.size is not None or one.type.longest is not None or one.type.is_base64
    if hides or (span is not None and span[1] >= _SAFE):
        yield f"`{one.type}`"
    if one.value is not None:
        yield f"Default: {json.dumps(one.value)}"


def type_of(kind: FieldType, names: Mapping[str, str]) -> str:
    """Return a type of TypeScript."""
    if kind.is_base64:
        return "string"
    base = _base(kind, names)
    if not kind.is_array:
        return base
    return f"({base})[]" if " " in base else f"{base}[]"


def _base(kind: FieldType, names: Mapping[str, str]) -> str:
    if kind.is_message:
        return names[kind.base]
    if kind.is_real:
        return "number | null"
    return {"bool": "boolean", "string": "string", "wstring": "string"}.get(kind.base, "number")


def _constants(message: WrittenMessage, name: str) -> Iterator[str]:
    yield f"export const {name} = {{"
    for one in message.constants:
        yield from _comment(*one.doc.splitlines(), indent="  ")
        yield f"  {one.name}: {json.dumps(one.value)},"
    yield "} as const;"


def _table(table: str, full_names: list[str]) -> Iterator[str]:
    names = type_names(full_names)
    yield f"export const {table} = {{"
    yield from (f"  {name}: {json.dumps(full)}," for full, name in names.items())
    yield "} as const;"


def _comment(*lines: str, indent: str = "") -> Iterator[str]:
    """Yield a comment for documentation; nothing without a line."""
    safe = [re.sub(r"\*/", "*\\/", line).rstrip() for line in lines]
    if len(safe) == 1:
        yield f"{indent}/** {safe[0]} */"
    elif safe:
        yield f"{indent}/**"
        yield from (f"{indent} * {line}".rstrip() for line in safe)
        yield f"{indent} */"
