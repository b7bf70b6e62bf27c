"""Checks the types of a catalog's declarations at run time, before their meaning is checked.

Catalogs are Python that may have passed no type checker: a text for a list, a missing class, a forgotten
comma. All errors are reported at once, each with its place. The expected types are the annotations of the
contract; types of the mission language are checked where they are used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import is_dataclass
from functools import cache
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from lupin_engine.errors import Severity, shortened
from lupin_engine.plugin.contract import OnHold, Plugin
from lupin_engine.plugin.types import Type

#: Tells what is wrong with a value that stands at a place.
Shape = Callable[[str, Any], Iterator[str]]


def misshapen(plugin: Plugin) -> Iterator[str]:
    """Yield an error for each part that is not of the contract's type."""
    for name, shape in _shapes(Plugin).items():
        yield from shape(name, getattr(plugin, name))


@cache
def _shapes(kind: type) -> Mapping[str, Shape]:
    """Return the shapes of the fields of a declaration."""
    return {name: _wanted(name, hint) for name, hint in get_type_hints(kind).items()}


def _wanted(name: str, hint: Any) -> Shape:
    """Return the shape of a field with an annotation."""
    if name in _NAMED or hint in _PLAIN:
        return _NAMED.get(name) or _PLAIN[hint]
    origin, inner = get_origin(hint), get_args(hint)[:1]
    if origin is UnionType:
        return _GIVEN
    if origin is tuple:
        return _several(_called(*inner), _wanted("", *inner))
    if origin is Mapping:
        word = _ONE_OF.get(name) or name.removesuffix("s").replace("_", " ")
        return _by_name(word, _wanted("", get_args(hint)[1]))
    is_part = isinstance(hint, type) and is_dataclass(hint) and hint is not Type
    return _made_with(hint) if is_part else _anything


def _called(hint: Any) -> str:
    """Return the word for the elements of a tuple."""
    if get_origin(hint) is Mapping:
        return "mappings by name"
    return {str: "names", Any: "values"}.get(hint) or f"{hint.__name__}(...)"


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
        for name, inner in _shapes(wanted).items():
            yield from inner(f"{where}: {name}", getattr(value, name))

    return shape


def _by_name(word: str, inner: Shape) -> Shape:
    """Return the shape of a mapping; its elements are named by `word` and their name, not by their place."""

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


_GIVEN = _must_be(
    "a mapping by name, or a function of arguments and parameters",
    lambda value: isinstance(value, Mapping) or callable(value),
)
#: Fields that ask for more than their annotation tells.
_NAMED: Mapping[str, Shape] = {
    "after": _must_be("a number of seconds, such as 2.0", _is_number),
    "freshness": _must_be(
        "a number of seconds, such as 2.0", lambda value: value is None or _is_number(value)
    ),
    "bind": _must_be("a function of the parameters", callable),
}
_PLAIN: Mapping[Any, Shape] = {
    str: _must_be("a text", lambda value: isinstance(value, str)),
    bool: _must_be("True or False", lambda value: isinstance(value, bool)),
    float | None: _must_be("a number", lambda value: value is None or _is_number(value)),
    OnHold: _must_be("OnHold.CANCEL or OnHold.FINISH", lambda value: isinstance(value, OnHold)),
    Severity: _must_be("a Severity", lambda value: isinstance(value, Severity)),
}
#: What one thing in a mapping is called, where that is not the name of the field without its s.
_ONE_OF = {"result": "field", "stands_in": "stands_in", "guards": "guards"}
