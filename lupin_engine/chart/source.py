"""YAML as a tired human wrote it: plain data in which every key and value knows its place.

Promises:
- YAML 1.2 core scalars: `on`, `off`, `yes` and `12:30:45` are words, no scalar is a date. Keys are text.
- A key that stands twice is an error that names both lines; the first one counts.
- Nothing in a file is executed: tags are refused, aliases are shared and counted, size and depth are bounded.
- No exception for a bad file: a finding with a place, and None.

The tree is built from parser events (the C parser where PyYAML has it) rather than from `yaml.compose`:
only events still know where an alias stands, it takes half the time, and the nesting is ours to bound.
This is the only module of the chart that reads files.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NoReturn

import yaml

from lupin_engine.chart.findings import Findings
from lupin_engine.errors import Place

MAX_BYTES = 1_000_000
MAX_NODES = 100_000
MAX_DEPTH = 60
MAX_NUMBER = 40

_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

_NULL = frozenset({"", "~", "null", "Null", "NULL"})
_TRUE = frozenset({"true", "True", "TRUE"})
_FALSE = frozenset({"false", "False", "FALSE"})
_INTEGER = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_LINE_BREAK = re.compile("\r\n|[\r\n\x85\u2028\u2029]")
_HEAD = re.compile(r"^(lifecycle|mission|part)[ \t]*:[ \t]*[\"']?([^\s\"'#]+)", re.MULTILINE)


class Text(str):
    """A text from a file; `at(offset)` is the place of one of its characters."""

    __slots__ = ("end", "lines", "place", "style")

    place: Place
    lines: list[str]
    end: tuple[int, int]
    style: str

    def at(self, offset: int) -> Place:
        """Return where the character `offset` stands in the file, through quotes, escapes and folding.

        Characters other than blanks come in the same order in the file and in the value, so the n-th of the
        value is the n-th of the file; blanks may have been folded.
        """
        wanted = sum(1 for char in self[:offset] if not char.isspace())
        after = self.place
        for line, column in _inked(self):
            if wanted == 0:
                return Place(self.place.file, line + 1, column + 1)
            wanted, after = wanted - 1, Place(self.place.file, line + 1, column + 2)
        return after


def text_at(value: str, place: Place) -> Text:
    """Make a text that stands at `place` on one line, for what is not written as text in the file."""
    text = Text(value)
    text.place = place
    line, column = place.line - 1, place.column - 1
    text.lines = [""] * line + [" " * column + value]
    text.end = (line, column + len(value))
    text.style = ""
    return text


def _inked(text: Text) -> Iterator[tuple[int, int]]:
    """Yield (line, column) of every character of the file that stands for a character other than a blank."""
    line, column = text.place.line - 1, text.place.column - 1
    if text.style in ("|", ">"):
        line, column = line + 1, 0
    elif text.style:
        column += 1
    while (line, column) < text.end and line < len(text.lines):
        row = text.lines[line]
        if column >= len(row):
            line, column = line + 1, 0
            continue
        width, blank = _character(row, column, text.style)
        if not blank:
            yield line, column
        column += width


def _character(row: str, column: int, style: str) -> tuple[int, bool]:
    """Return how many columns one character of the value takes in the file, and whether it is a blank."""
    if style == "'" and row.startswith("''", column):
        return 2, False
    if style == '"' and row[column] == "\\":
        escape = row[column + 1 : column + 2]
        return {"x": 4, "u": 6, "U": 10}.get(escape, 2), escape in (
            "",
            " ",
            "n",
            "t",
            "r",
            "_",
            "N",
            "L",
            "P",
        )
    return 1, row[column].isspace()


class Map(dict[str, Any]):
    """A mapping from a file; `keys_as_text` and `places` say where each key and value stands.

    `model` is set by the document model that read it, so that an unknown key can be answered with what is
    known there.
    """

    __slots__ = ("keys_as_text", "model", "place", "places")

    def __init__(self, place: Place) -> None:
        super().__init__()
        self.place = place
        self.keys_as_text: dict[str, Text] = {}
        self.places: dict[str, Place] = {}
        self.model: Any = None

    def key_place(self, key: str) -> Place:
        """Return where a key stands."""
        return self.keys_as_text[key].place


class Seq(list[Any]):
    """A list from a file; `places` says where each element stands."""

    __slots__ = ("place", "places")

    def __init__(self, place: Place) -> None:
        super().__init__()
        self.place = place
        self.places: list[Place] = []


def read(path: Path, findings: Findings) -> Map | None:
    """Read a mission file into a mapping with places; None after a finding that leaves nothing to read."""
    name = str(path)
    text = _read_text(path, name, findings)
    return None if text is None else parse(text, name, findings)


def head(path: Path) -> tuple[str, str] | None:
    """Return the kind and name that a file gives itself (`mission`, `InspectionMission`)."""
    try:
        found = _HEAD.search(path.read_bytes()[:MAX_BYTES].decode("utf-8-sig", "replace"))
    except OSError:
        return None
    return (found.group(1), found.group(2)) if found else None


def parse(text: str, name: str, findings: Findings) -> Map | None:
    """Turn the text of a file into a mapping with places; `name` is what places call the file."""
    builder = _Builder(text, name, findings)
    try:
        root = builder.document()
    except _Unreadable:
        return None
    if not isinstance(root, Map):
        findings.add(
            Place(name, 1, 1), "wrong-yaml", "", f"expected a mapping of keys to values, got {root!r}"
        )
        return None
    return root


def _read_text(path: Path, name: str, findings: Findings) -> str | None:
    start = Place(name, 1, 1)
    try:
        raw = path.read_bytes()
    except OSError as error:
        findings.add(start, "no-file", "", f"cannot read the file: {error.strerror}")
        return None
    if len(raw) > MAX_BYTES:
        findings.add(
            start, "too-large", "", f"the file has {len(raw)} bytes", f"at most {MAX_BYTES} are read"
        )
        return None
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        column = error.start - raw.rfind(b"\n", 0, error.start)
        findings.add(
            Place(name, line, column), "wrong-yaml", "", "this is not UTF-8", "save the file as UTF-8"
        )
        return None


class _Unreadable(Exception):
    """Nothing sensible can be read after this; the finding has been made."""


class _Builder:
    """One pass over the events of a file."""

    def __init__(self, text: str, name: str, findings: Findings) -> None:
        self._text = text
        self._lines = _LINE_BREAK.split(text)
        self._name = name
        self._findings = findings
        self._nodes = 0
        self._anchors: dict[str, tuple[Any, int] | None] = {}
        self._events: Iterator[Any] = yaml.parse(text, Loader=_Loader)

    def document(self) -> Any:
        """Build the one document of the file."""
        self._next()
        event = self._next()
        if isinstance(event, yaml.StreamEndEvent):
            self._refuse(Place(self._name, 1, 1), "wrong-yaml", "the file is empty")
        root = self._node(self._next(), 0)
        self._next()
        event = self._next()
        if not isinstance(event, yaml.StreamEndEvent):
            self._refuse(
                self._place(event), "wrong-yaml", "a second document starts here", "use one file each"
            )
        return root

    def _next(self) -> Any:
        try:
            return next(self._events)
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            place = Place(self._name, mark.line + 1, mark.column + 1) if mark else Place(self._name, 1, 1)
            context = f" {error.context}" if error.context else ""
            self._refuse(place, "wrong-yaml", f"{error.problem or 'not YAML'}{context}", _yaml_hint(error))
        except yaml.YAMLError as error:
            position = int(getattr(error, "position", 0) or 0)
            line = self._text.count("\n", 0, position) + 1
            column = position - self._text.rfind("\n", 0, position)
            reason = getattr(error, "reason", None) or "not YAML"
            self._refuse(Place(self._name, line, column), "wrong-yaml", str(reason))

    def _refuse(self, place: Place, rule: str, problem: str, hint: str = "") -> NoReturn:
        self._findings.add(place, rule, "", problem, hint)
        raise _Unreadable

    def _place(self, event: Any) -> Place:
        return Place(self._name, event.start_mark.line + 1, event.start_mark.column + 1)

    def _count(self, nodes: int, place: Place) -> None:
        self._nodes += nodes
        if self._nodes > MAX_NODES:
            problem = f"more than {MAX_NODES} values, aliases counted as often as they are used"
            self._refuse(place, "too-large", problem, "write less, or alias less")

    def _node(self, event: Any, depth: int) -> Any:
        place = self._place(event)
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event.anchor or "", place)
        self._count(1, place)
        if depth > MAX_DEPTH:
            self._refuse(place, "too-large", f"more than {MAX_DEPTH} levels of nesting")
        if event.tag is not None:
            self._refuse(
                place, "wrong-yaml", f"the tag {event.tag!r} is not allowed", "write the plain value"
            )
        if event.anchor is None:
            return self._content(event, place, depth)
        self._anchors[event.anchor] = None
        before = self._nodes
        value = self._content(event, place, depth)
        self._anchors[event.anchor] = (value, self._nodes - before + 1)
        return value

    def _alias(self, anchor: str, place: Place) -> Any:
        known = self._anchors.get(anchor)
        if known is None:
            reason = "contains itself" if anchor in self._anchors else "is not defined above"
            self._refuse(place, "wrong-yaml", f"the alias '*{anchor}' {reason}")
        self._count(known[1], place)
        return known[0]

    def _content(self, event: Any, place: Place, depth: int) -> Any:
        if isinstance(event, yaml.ScalarEvent):
            return self._scalar(event, place)
        if isinstance(event, yaml.SequenceStartEvent):
            return self._sequence(place, depth)
        return self._mapping(place, depth)

    def _sequence(self, place: Place, depth: int) -> Seq:
        found = Seq(place)
        while not isinstance(event := self._next(), yaml.SequenceEndEvent):
            found.places.append(self._place(event))
            found.append(self._node(event, depth + 1))
        return found

    def _mapping(self, place: Place, depth: int) -> Map:
        found = Map(place)
        while not isinstance(event := self._next(), yaml.MappingEndEvent):
            key = self._key(event)
            value_event = self._next()
            value = self._node(value_event, depth + 1)
            if key in found:
                first = found.keys_as_text[key].place
                problem = (
                    f"the key {str(key)!r} stands twice, in line {first.line} and in line {key.place.line}"
                )
                self._findings.add(key.place, "duplicate-key", "", problem, "remove or rename one")
                continue
            found[key] = value
            found.keys_as_text[key] = key
            found.places[key] = self._place(value_event)
        return found

    def _key(self, event: Any) -> Text:
        place = self._place(event)
        if not isinstance(event, yaml.ScalarEvent):
            self._refuse(place, "wrong-yaml", "a key must be a plain word")
        self._count(1, place)
        if event.tag is not None:
            self._refuse(place, "wrong-yaml", f"the tag {event.tag!r} is not allowed", "write the plain key")
        text = self._text_of(event, place)
        if event.anchor is not None:
            self._anchors[event.anchor] = (text, 1)
        return text

    def _scalar(self, event: Any, place: Place) -> Any:
        value: str = event.value
        if event.style:
            return self._text_of(event, place)
        if value in _NULL:
            return None
        if value in _TRUE:
            return True
        if value in _FALSE:
            return False
        if _INTEGER.fullmatch(value):
            return self._number(value, place, lambda text: int(text, 0 if text[:2] in ("0x", "0o") else 10))
        if _FLOAT.fullmatch(value):
            return self._number(value, place, float)
        return self._text_of(event, place)

    def _number(self, value: str, place: Place, convert: Callable[[str], Any]) -> Any:
        if len(value) > MAX_NUMBER:
            self._refuse(
                place, "too-large", f"a number of {len(value)} digits", f"at most {MAX_NUMBER} are read"
            )
        return convert(value)

    def _text_of(self, event: Any, place: Place) -> Text:
        text = Text(event.value)
        text.place = place
        text.lines = self._lines
        text.end = (event.end_mark.line, event.end_mark.column)
        text.style = event.style or ""
        return text


def _yaml_hint(error: yaml.MarkedYAMLError) -> str:
    problem = str(error.problem)
    if "mapping values are not allowed" in problem:
        return "quote a text that contains ': '"
    if "cannot start any token" in problem:
        return "indent with blanks and quote a text that starts with a special character"
    return ""
