"""Looks up classes, shapes and decoders of ROS types by name; results are cached."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable
from typing import Any

from lupin_gateway.cdr import decoder
from lupin_gateway.shapes import MessageShape, NotCarried, shape_of


@functools.cache
def class_of(name: str) -> Any:
    """Return the class of a type such as `std_msgs/msg/String`.

    Raises:
        NotCarried: it is not installed here.
    """
    package, kind, local = name.split("/")
    try:
        found = getattr(importlib.import_module(f"{package}.{kind}"), local)
        # Compiled type support is loaded when it is first used: say now if it is missing.
        found.__import_type_support__()
    except Exception as problem:
        raise NotCarried(f"type {name} is not installed where the gateway runs: {problem}") from problem
    return found


@functools.cache
def shape(name: str, part: str = "") -> MessageShape:
    """Return the shape of a message, or of a `part` of a service or action (Request, Goal and so on).

    Raises:
        NotCarried: the type is not installed here, or has a field that is not supported.
    """
    kind = class_of(name)
    return shape_of(getattr(kind, part) if part else kind, _message_class, f"{name}.{part}" if part else name)


def _message_class(name: str) -> Any:
    package, _, local = name.rpartition("/")
    return class_of(f"{package}/msg/{local}")


@functools.cache
def decode(name: str, part: str = "") -> Callable[[bytes], dict[str, Any]]:
    """Return the decoder of a type; see `cdr.decoder`. NotCarried: pages cannot get this type."""
    return decoder(shape(name, part))
