"""Writes plain data as YAML like a person's: block style, with flow style where it fits on a line."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

#: Longest line, and how many keys may stand on one that need not.
WIDTH = 110
FEW = 5
#: Texts that need no quotes anywhere, as long as they do not read as something else.
_PLAIN = re.compile(r"[A-Za-z0-9_.][A-Za-z0-9_./%+-]*( [A-Za-z0-9_./%+-]+)*")
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|0[ox][0-9a-fA-F]+")
_WORDS = {"", "~", "null", "true", "false", "yes", "no", "on", "off"}


def yaml_text(data: Mapping[str, Any]) -> str:
    """Return a mapping as a YAML document."""
    return "\n".join(_lines(data, "")) + "\n"


def _lines(data: Mapping[str, Any], indent: str) -> Iterator[str]:
    for key, value in data.items():
        head = f"{indent}{_key(key)}:"
        line = f"{head} {flow(value)}"
        nested = isinstance(value, Mapping) and value
        if len(line) <= WIDTH and not (nested and len(value) > FEW) and not _is_list_of_mappings(value):
            yield line
        elif nested:
            yield head
            yield from _lines(value, f"{indent}  ")
        elif _is_list_of_mappings(value):
            yield head
            for element in value:
                yield from _element(element, f"{indent}  ")
        else:
            yield from _wrapped(head, value, f"{indent}    ")


def _is_list_of_mappings(value: Any) -> bool:
    is_list = isinstance(value, Sequence) and not isinstance(value, str)
    return is_list and any(isinstance(element, Mapping) for element in value)


def _element(element: Any, indent: str) -> Iterator[str]:
    """Yield an element of a list: on one line, or a key on each."""
    line = f"{indent}- {flow(element)}"
    if len(line) <= WIDTH or not isinstance(element, Mapping):
        yield line
        return
    first, *rest = _lines(element, f"{indent}  ")
    yield f"{indent}- {first.lstrip()}"
    yield from rest


def _wrapped(head: str, value: Any, indent: str) -> Iterator[str]:
    """Yield a list of scalars over several lines; a text that is too long stays on its own."""
    if not isinstance(value, Sequence) or isinstance(value, str):
        yield f"{head} {flow(value)}"
        return
    line = f"{head} ["
    for number, element in enumerate(value):
        text = flow(element) + ("," if number + 1 < len(value) else "]")
        if len(line) + len(text) > WIDTH:
            yield line.rstrip()
            line = indent
        line += f"{text} "
    yield line.rstrip()


def flow(value: Any) -> str:
    """Return data on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)}: {flow(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(map(flow, value)) + "]"
    return _scalar(value)


def _key(key: str) -> str:
    # A word of the language: as in mission files, `on` is a word and no truth value.
    return key if key == "on" else _scalar(key)


def _scalar(value: Any) -> str:
    if isinstance(value, str):
        ambiguous = value.lower() in _WORDS or _NUMBER.fullmatch(value)
        return value if _PLAIN.fullmatch(value) and not ambiguous else json.dumps(value, ensure_ascii=False)
    return json.dumps(value)
