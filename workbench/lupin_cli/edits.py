"""Edits of a YAML file at places, which leave its comments and line breaks as they are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from lupin_engine.chart import Map, Seq


@dataclass(frozen=True, order=True)
class PlacedEdit:
    """Replaces `old` by `new`, at a line and column counted from 0; `old` must stand there."""

    line: int
    column: int
    old: str
    new: str


def edited(text: str, edits: Iterable[PlacedEdit]) -> str | None:
    """Return a text with edits, in its own line ends; None where one does not fit."""
    lines = text.splitlines(keepends=True)
    end = "\r\n" if "\r\n" in text else "\n"
    for edit in sorted(set(edits), reverse=True):
        if edit.line == len(lines):  # behind the last line
            if lines and not lines[-1].endswith("\n"):
                lines[-1] += end
            lines.append("")
        line = lines[edit.line]
        if not line.startswith(edit.old, edit.column):
            return None
        new = edit.new.replace("\n", end)
        lines[edit.line] = line[: edit.column] + new + line[edit.column + len(edit.old) :]
    return "".join(lines)


def maps_in(value: Any) -> Iterator[Map]:
    """Yield a mapping and all that are in it."""
    if isinstance(value, Map):
        yield value
    if isinstance(value, (Map, Seq)):
        for inner in value.values() if isinstance(value, Map) else value:
            yield from maps_in(inner)


def is_flow(value: Map | Seq) -> bool:
    """Say whether a mapping or list is written in braces or brackets."""
    place = value.file.place(value.start)
    return value.file.lines[place.line - 1].startswith(("{", "["), place.column - 1)


def first_key(holder: Map, text: str) -> PlacedEdit:
    """Return the edit that writes a key, or several lines, before the first key of a mapping."""
    place = min(holder.key_place(key) for key in holder)
    indent = " " * (place.column - 1)
    new = f"{text}, " if is_flow(holder) else text.replace("\n", f"\n{indent}") + f"\n{indent}"
    return PlacedEdit(place.line - 1, place.column - 1, "", new)


def key_after(holder: Map, key: str, text: str) -> PlacedEdit:
    """Return the edit that writes a key behind another one and its value."""
    place = holder.key_place(key)
    if is_flow(holder):
        return PlacedEdit(place.line - 1, place.column - 1, "", f"{text}, ")
    lines, row, indent = holder.file.lines, place.line, place.column - 1
    last = row
    while row < len(lines) and _belongs(lines[row], indent):
        row += 1
        if lines[row - 1].strip() and not lines[row - 1].lstrip().startswith("#"):
            last = row
    return PlacedEdit(last, 0, "", f"{' ' * indent}{text}\n")


def _belongs(line: str, indent: int) -> bool:
    """Say whether a line behind a key belongs to its value."""
    stripped = line.lstrip()
    depth = len(line) - len(stripped)
    return not stripped.strip() or depth > indent or (depth == indent and stripped.startswith("- "))


def list_edits(holder: Map, key: str, items: Sequence[int | str]) -> list[PlacedEdit]:
    """Return the edits that make a list one of old items, by number, and new ones.

    Empty where that cannot be written: a list in brackets on several lines, or one whose old items do not all
    stay.
    """
    found, place = holder[key], holder.value_place(key)
    if not isinstance(found, Seq):
        return []
    if not is_flow(found):
        return _block_edits(found, items)
    line, start = found.file.lines[place.line - 1], place.column - 1
    old = _items(line, start)
    if old is None or len(old[0]) != len(found):
        return []
    new = ", ".join(old[0][item] if isinstance(item, int) else item for item in items)
    return [PlacedEdit(place.line - 1, start, line[start : old[1]], f"[{new}]")]


def _block_edits(found: Seq, items: Sequence[int | str]) -> list[PlacedEdit]:
    lines, places = found.file.lines, found.places
    if [item for item in items if isinstance(item, int)] != list(range(len(places))) or not places:
        return []
    dash = lines[places[0].line - 1].rindex("-", 0, places[0].column - 1)
    row, edits = places[-1].line, []
    while row < len(lines) and len(lines[row]) - len(lines[row].lstrip()) > dash and lines[row].strip():
        row += 1
    for number, item in enumerate(items):
        if isinstance(item, str):
            behind = next((one for one in items[number:] if isinstance(one, int)), None)
            line = row if behind is None else places[behind].line - 1
            edits.append((line, f"{' ' * dash}- {item}\n"))
    at = dict.fromkeys(line for line, _ in edits)
    return [PlacedEdit(line, 0, "", "".join(text for where, text in edits if where == line)) for line in at]


def _items(line: str, start: int) -> tuple[list[str], int] | None:
    """Return the items of the list in brackets at `start`, and where it ends; None: not in this line."""
    depth, quote, items, begun = 0, "", [], start + 1
    for column in range(start, len(line)):
        char = line[column]
        if quote:
            quote = "" if char == quote else quote
        elif char in "\"'":
            quote = char
        elif char in "[{":
            depth += 1
        elif char in "]}" or (char == "," and depth == 1):
            depth -= char != ","
            if depth == (char == ","):
                items.append(line[begun:column].strip())
                begun = column + 1
            if not depth:
                return [item for item in items if item], column + 1
    return None
