"""Settings given as `name=value` on the command line, read as the type that is declared for them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import yaml

from lupin_engine.plugin import (
    Notation,
    Parameter,
    Type,
    broken_text,
    innermost,
    named,
    sorted_out,
    without_repetition,
)

_BOOLEANS = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}


def settings_in(
    option: str,
    given: Iterable[str],
    declared: Mapping[str, Parameter],
    node: str = "",
    elsewhere: Callable[[str], str] = lambda name: "",
) -> tuple[dict[str, Any], list[str]]:
    """Return the valid values of settings `name=value`, in base units, and the problems of the others.

    Problems are: no `=`, an unknown name, a value of another type, without its unit or out of range.

    Args:
        option: the option of the settings.
        given: the texts as written; those of a node without the node's name.
        declared: all parameters, by name.
        node: whose parameters they are; '' for the mission's.
        elsewhere: returns where an undeclared name belongs (see `plugin.parameters.sorted_out`).
    """
    texts, problems = split(option, given, f"{node}." if node else "")
    values, wrong = sorted_out(declared, texts, _read, elsewhere)
    where = f"{option} {node}".rstrip()
    return values, [f"{where}: {problem}" for problem in [*problems, *wrong]]


def _read(name: str, spec: Parameter, text: str) -> Any:
    try:
        value = read_value(text, spec.type)
    except ValueError as problem:
        raise ValueError(f"parameter {name!r}: {problem}") from None
    return named(name, spec, value, Notation.FILE)


def split(option: str, given: Iterable[str], before: str = "") -> tuple[dict[str, str], list[str]]:
    """Return the texts by name, and the problems; `before` is the prefix of each name on the command line."""
    texts: dict[str, str] = {}
    problems = []
    for item in given:
        name, equals, text = item.partition("=")
        if equals and name.strip():
            texts[name.strip()] = text.strip()
        else:
            lacks = "name before its '='" if equals else "'='"
            problems.append(f"{before + item!r} has no {lacks}; write {option} {before}NAME=VALUE")
    return texts, problems


def of_the_mission(given: Iterable[str]) -> list[str]:
    """Return the settings that name no node."""
    return [item for item in given if not _node(item)]


def of_nodes(given: Iterable[str]) -> dict[str, list[str]]:
    """Return the settings of nodes, given as `node.name=value`, as `name=value` by node."""
    found: dict[str, list[str]] = {}
    for item in given:
        node = _node(item)
        if node:
            found.setdefault(node, []).append(item.partition(".")[2])
    return found


def _node(item: str) -> str:
    """Return the part of a name before its dot; '' where there is none."""
    node, dot, _ = item.partition("=")[0].partition(".")
    return node.strip() if dot else ""


def read_value(text: str, kind: Type) -> Any:
    """Return the text as data; unchanged where it does not fit, which the check then reports.

    Raises:
        ValueError: a record or list of records that is not written to its end, or has a field twice.
    """
    match kind.kind:
        case "bool":
            return _BOOLEANS.get(text.lower(), text)
        case "text":
            return text
        case "integer" | "number":
            return _as_number(text)
        case "list" if innermost(kind).kind != "record":
            return _as_list(text, kind)
    return _as_yaml(text, kind)


def _as_number(text: str) -> Any:
    for convert in (int, float):
        try:
            return convert(text)
        except ValueError:
            continue
    return text  # perhaps a quantity, such as `60 s`


def _as_list(text: str, kind: Type) -> Any:
    """Read `1,5,12` or `[1, 5, 12]`; elements of a list of text need no quotes."""
    inner = text[1:-1] if text.startswith("[") and text.endswith("]") else text
    if kind.item is None:
        return text
    return [read_value(part.strip().strip("'\""), kind.item) for part in inner.split(",") if part.strip()]


class _Once(yaml.SafeLoader):
    """Reads YAML, and refuses a mapping with a key twice."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        without_repetition([(self.construct_object(key, deep=True), None) for key, _ in node.value])
        return super().construct_mapping(node, deep)


def _as_yaml(text: str, kind: Type) -> Any:
    """Read a record: `{x: 1 m, y: 2 m, yaw: 90 deg}`, or its fields in order as `[1 m, 2 m, 90 deg]`.

    Records in a list are read likewise, without the short form.
    """
    try:
        value = yaml.load(text, _Once)
    except yaml.MarkedYAMLError as error:
        if not text.startswith(("[", "{")) or error.problem_mark is None:
            return text
        raise ValueError(broken_text(text, error.problem_mark.index, str(error.problem))) from None
    except yaml.YAMLError:
        return text
    if value is None:
        return text
    if kind.fields and isinstance(value, list) and len(value) == len(kind.fields):
        return dict(zip(kind.fields, value, strict=True))
    return value
