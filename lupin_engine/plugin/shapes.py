"""Whether a catalog is made of what the contract wants, before anybody looks at what it means.

Catalogs are Python that no type checker may have seen: a text where a list is wanted, a class left out, a
comma forgotten. Each is told in the words of its place, all of them at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from lupin_engine.errors import Severity, shortened
from lupin_engine.plugin.contract import (
    Action,
    Argument,
    Code,
    EventKind,
    Function,
    LiveValue,
    Mock,
    OnHold,
    Operation,
    Parameter,
    Plugin,
    Reader,
)

#: Tells what is wrong with a value that stands at a place.
Shape = Callable[[str, Any], Iterator[str]]


def misshapen(plugin: Plugin) -> Iterator[str]:
    """Tell all that is not of the kind that the contract wants; types are looked at where they are used."""
    for name, shape in _SHAPES[Plugin].items():
        yield from shape(name, getattr(plugin, name))


def _must_be(wanted: str, fits: Callable[[Any], bool]) -> Shape:
    def shape(where: str, value: Any) -> Iterator[str]:
        if not fits(value):
            yield f"{where} must be {wanted}, got {shortened(repr(value))}"

    return shape


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _made_with(wanted: type) -> Shape:
    def shape(where: str, value: Any) -> Iterator[str]:
        if not isinstance(value, wanted):
            yield f"{where} must be made with {wanted.__name__}(...), got {shortened(repr(value))}"
            return
        for name, inner in _SHAPES[wanted].items():
            yield from inner(f"{where}: {name}", getattr(value, name))

    return shape


def _by_name(word: str, inner: Shape) -> Shape:
    """Return the shape of a mapping; what stands in it is called `word` and its name, not by its place."""

    def shape(where: str, value: Any) -> Iterator[str]:
        if not isinstance(value, Mapping):
            yield f"{where} must be a mapping by name, such as {{'name': ...}}, got {shortened(repr(value))}"
            return
        above = where.rpartition(": ")[0]
        for name, element in value.items():
            here = f"{word} {name!r}"
            place = f"{above}: the {here}" if above else here
            if isinstance(name, str):
                yield from inner(place, element)
            else:
                yield f"{place}: a name must be a text"

    return shape


def _several(wanted: str, inner: Shape) -> Shape:
    """Return the shape of a tuple; the commonest slip is that of one element without its comma."""

    def shape(where: str, value: Any) -> Iterator[str]:
        if not isinstance(value, (tuple, list)):
            written = shortened(repr(value))
            yield f"{where} must be a tuple of {wanted}, got {written}; of one, with a comma: (ONE,)"
            return
        for number, element in enumerate(value, 1):
            yield from inner(f"{where}: number {number}", element)

    return shape


def _anything(_: str, __: Any) -> Iterator[str]:
    yield from ()


_TEXT = _must_be("a text", lambda value: isinstance(value, str))
_SECONDS = _must_be("a number of seconds, such as 2.0", _is_number)
_LASTING = _must_be("a number of seconds, such as 2.0", lambda value: value is None or _is_number(value))
_LIMIT = _must_be("a number", lambda value: value is None or _is_number(value))
_YES_OR_NO = _must_be("True or False", lambda value: isinstance(value, bool))
_FUNCTION = _must_be("a function of the parameters", callable)
_GIVEN = _must_be(
    "a mapping by name, or a function of arguments and parameters",
    lambda value: isinstance(value, Mapping) or callable(value),
)
_TYPED = _by_name("field", _anything)
_ARGUMENTS = _by_name("argument", _made_with(Argument))

#: Of everything that a catalog is made of: what its parts must be.
_SHAPES: Mapping[type, Mapping[str, Shape]] = {
    Plugin: {
        "name": _TEXT,
        "doc": _TEXT,
        "operations": _by_name("operation", _made_with(Operation)),
        "actions": _by_name("action", _made_with(Action)),
        "functions": _by_name("function", _made_with(Function)),
        "values": _by_name("value", _made_with(LiveValue)),
        "events": _by_name("event", _made_with(EventKind)),
        "types": _by_name("type", _anything),
        "readers": _by_name("reader", _made_with(Reader)),
        "parameters": _by_name("parameter", _made_with(Parameter)),
        "client": _TEXT,
        "nodes": _by_name("node", _TEXT),
        "stands_in": _by_name("stands_in", _several("names", _TEXT)),
        "companions": _several("names", _TEXT),
        "simulated_defaults": _by_name("simulated default", _anything),
        "internal": _YES_OR_NO,
        "serves": _several("names", _TEXT),
        "profile": _TEXT,
    },
    Operation: {
        "doc": _TEXT,
        "arguments": _ARGUMENTS,
        "result": _TYPED,
        "codes": _several("Code(...)", _made_with(Code)),
        "uses": _several("names", _TEXT),
        "on_hold": _must_be("OnHold.CANCEL or OnHold.FINISH", lambda value: isinstance(value, OnHold)),
        "mock": _made_with(Mock),
    },
    Action: {"doc": _TEXT, "arguments": _ARGUMENTS, "moves": _YES_OR_NO},
    Function: {"doc": _TEXT, "arguments": _ARGUMENTS, "bind": _FUNCTION},
    LiveValue: {"doc": _TEXT, "freshness": _LASTING},
    EventKind: {"doc": _TEXT, "fields": _TYPED},
    Parameter: {"doc": _TEXT, "minimum": _LIMIT, "maximum": _LIMIT},
    Argument: {"doc": _TEXT, "optional": _YES_OR_NO},
    Mock: {"after": _SECONDS, "result": _GIVEN, "values": _GIVEN},
    Reader: {"code": _made_with(Code), "bind": _FUNCTION},
    Code: {
        "name": _TEXT,
        "label": _TEXT,
        "severity": _must_be("a Severity", lambda value: isinstance(value, Severity)),
    },
}
