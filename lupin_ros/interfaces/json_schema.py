"""Writes interfaces as JSON Schema, in the form of rosbridge's JSON; for `lupin types json-schema`."""

from __future__ import annotations

import json
from typing import Any

from lupin_ros.interfaces.files import FieldType, InterfaceSet, WrittenField, WrittenMessage

DRAFT = "https://json-schema.org/draft/2020-12/schema"


def json_schema(interfaces: InterfaceSet) -> str:
    """Return one document with a schema for each message, and part of a service or action, by its name."""
    document = {
        "$schema": DRAFT,
        "title": "Interfaces of ROS 2 as they travel through rosbridge in JSON",
        "description": "Made by `lupin types json-schema` from the interface files. NaN and infinity are "
        "null, arrays of bytes texts in base64. Of a request or a goal, what is left out has its default.",
        "$defs": {name: _message(message) for name, message in interfaces.messages.items()},
    }
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def reference(name: str) -> str:
    """Return the reference to a message in the document."""
    return f"#/$defs/{name.replace('/', '~1')}"


def _message(message: WrittenMessage) -> dict[str, Any]:
    fields = {one.name: _field(one) for one in message.fields}
    required = {} if message.is_filled or not fields else {"required": list(fields)}
    constants = {one.name: _constant(one) for one in message.constants}
    return {
        **_described(message.doc),
        "type": "object",
        "properties": fields,
        **required,
        "additionalProperties": False,
        **({"x-constants": constants} if constants else {}),
    }


def _field(one: WrittenField) -> dict[str, Any]:
    default = {} if one.value is None else {"default": one.value}
    return {**_described(one.doc), **_type(one.type), **default}


def _constant(one: WrittenField) -> dict[str, Any]:
    return {**_described(one.doc), "const": one.value}


def _described(doc: str) -> dict[str, str]:
    return {"description": doc} if doc else {}


def _type(kind: FieldType) -> dict[str, Any]:
    if kind.is_base64:
        return {"type": "string", "contentEncoding": "base64", **_length_of_base64(kind)}
    if not kind.is_array:
        return _element(kind)
    most = {} if kind.size is None else {"maxItems": kind.size}
    least = {} if kind.size is None or kind.bounded else {"minItems": kind.size}
    return {"type": "array", "items": _element(kind), **least, **most}


def _length_of_base64(kind: FieldType) -> dict[str, int]:
    if kind.size is None:
        return {}
    letters = (kind.size + 2) // 3 * 4
    return {"maxLength": letters} if kind.bounded else {"minLength": letters, "maxLength": letters}


def _element(kind: FieldType) -> dict[str, Any]:
    if kind.is_message:
        return {"$ref": reference(kind.base)}
    if kind.is_real:
        return {"type": ["number", "null"]}
    if kind.base == "bool":
        return {"type": "boolean"}
    if kind.span is not None:
        return {"type": "integer", "minimum": kind.span[0], "maximum": kind.span[1]}
    return {"type": "string", **({} if kind.longest is None else {"maxLength": kind.longest})}
