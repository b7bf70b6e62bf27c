"""Reads YAML as plain data in which every key and value knows its place.

Promises:
- YAML 1.2 core scalars but `.inf` and `.nan`: `on` and `12:30:45` are words, none is a date. Keys are text.
- A duplicate key is an error that names both lines; the first one counts.
- Nothing in a file is executed: tags are refused, aliases are shared and counted, size and depth are bounded.
- No exception for a bad file: a finding with a place, and None.

The tree is built from parser events (the C parser where PyYAML has it) rather than from `yaml.compose`: only
events have the places of aliases, it takes half the time, and the depth can be bounded. This is the only
module of the chart that reads files.
"""

from __future__ import annotations

import errno
import re
import stat
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, Protocol, TypeVar

import yaml
from yaml import (
    AliasEvent,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
    StreamEndEvent,
)

from lupin_engine.chart.findings import Findings
from lupin_engine.errors import Place

MAX_BYTES = 1_000_000
MAX_NODES = 100_000
MAX_DEPTH = 60
MAX_NUMBER = 40

_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

_NO_TAG = "write the plain value; in a condition, 'not' for '!'"
_NULL = ("", "~", "null", "Null", "NULL")
_TRUE = ("true", "True", "TRUE")
_FALSE = ("false", "False", "FALSE")
#: Plain scalars that are no text and no number.
_WORDS: Mapping[str, bool | None] = {
    **dict.fromkeys(_NULL),
    **dict.fromkeys(_TRUE, True),
    **dict.fromkeys(_FALSE, False),
}
_INTEGER = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
#: What a plain scalar begins with that is perhaps no text.
_STARTS = frozenset([*"+-.0123456789", *(word[:1] for word in _WORDS)])
#: Where an expression begins that does not stand in quotes.
_EXPRESSION = re.compile(r"""'[^']*'|"[^"]*"|(\$\{)""")
_QUOTES = ("'", '"')
#: What may stand between the beginning of a node and that of its value.
_ANCHOR = re.compile(r"&\S+[ \t]*")
_HEAD = re.compile(r"^(lifecycle|mission|part|binding)[ \t]*:[ \t]*[\"']?([^\s\"'#]+)", re.MULTILINE)

_N = TypeVar("_N", "_Whole", "_Real")

_new = tuple.__new__
_new_text = str.__new__


class Mark(Protocol):
    """Line and column, counted from 0.

    The parser's own marks are kept as they are: a file has tens of thousands of them, and most are never
    asked for.
    """

    @property
    def line(self) -> int:
        """How many lines stand before."""
        ...

    @property
    def column(self) -> int:
        """How many characters stand before in the line."""
        ...


class _Position(NamedTuple):
    """A mark that the parser did not make."""

    line: int
    column: int


class File:
    """The name of a file and its lines, which are split on demand; shared by all its places."""

    def __init__(self, name: str, text: str) -> None:
        self.name = name
        self._text = text

    @cached_property
    def lines(self) -> list[str]:
        """The lines without their ends, as YAML counts them."""
        # Python also ends lines at some control characters, which no YAML text may contain.
        return self._text.splitlines()

    def place(self, mark: Mark) -> Place:
        """Return the place of a mark."""
        return _new(Place, (self.name, mark.line + 1, mark.column + 1))

    def at(self, line: int, column: int) -> Place:
        """Return the place of a line and column, counted from 0."""
        # As `Place(...)` does it, but in half the time: every piece of a chart has its place.
        return _new(Place, (self.name, line + 1, column + 1))


def _spot_of(place: Place) -> _Position:
    return _Position(place.line - 1, place.column - 1)


class Text(str):
    """A text from a file; `at(offset)` is the place of one of its characters."""

    __slots__ = ("file", "start", "style")

    file: File
    start: Mark
    style: str | None

    @property
    def place(self) -> Place:
        """Where the text begins, its quotes included."""
        return self.file.place(self.start)

    def at(self, offset: int) -> Place:
        """Return where the character `offset` stands in the file, through quotes, escapes and folding.

        Characters other than blanks come in the same order in the file and in the value, so the n-th of the
        value is the n-th of the file; blanks may have been folded.
        """
        file, line, first = self.file, self.start.line, self.start.column + bool(self.style)
        if offset < len(self) and not self[offset].isspace():
            lines = file.lines
            if line < len(lines) and lines[line].startswith(self, first):  # it stands there as it is
                return file.at(line, first + offset)
        wanted, there = _ink(self[:offset]), _ink(self)
        if wanted < there or self.style in _QUOTES:
            return file.place(self._inked(wanted))  # behind the last one stands the closing quote
        last = self._inked(there - 1) if there else None
        return self.place if last is None else file.at(last.line, last.column + 1)

    def _inked(self, number: int) -> Mark:
        """Return where the character with that number stands, blanks not counted."""
        return next(islice(_inked(self), number, None), self.start)


def text_at(value: str, place: Place) -> Text:
    """Make a text that stands at `place` on one line, for a value that is not written as text."""
    line, column = place.line - 1, place.column - 1
    return _text(value, File(place.file, "\n" * line + " " * column + value), _spot_of(place), None)


def _text(value: str, file: File, start: Mark, style: str | None) -> Text:
    text = _new_text(Text, value)
    text.file = file
    text.start = start
    text.style = style
    return text


def _ink(text: str) -> int:
    """Return how many characters are no blanks."""
    return sum(1 for char in text if not char.isspace())


def _inked(text: Text) -> Iterator[_Position]:
    """Yield the place of every non-blank character of the file.

    It continues behind the end of the text, which only its caller knows.
    """
    lines, style = text.file.lines, text.style or ""
    line, column = _first_character(text)
    while line < len(lines):
        row = lines[line]
        if column >= len(row):
            line, column = line + 1, 0
            continue
        width, blank = _character(row, column, style)
        if not blank:
            yield _Position(line, column)
        column += width


def _first_character(text: Text) -> tuple[int, int]:
    """Return line and column of the first character, behind anchor and quotes."""
    line, column = text.start.line, text.start.column
    if text.style in ("|", ">"):
        return line + 1, 0
    anchor = _ANCHOR.match(text.file.lines[line], column) if line < len(text.file.lines) else None
    return line, (anchor.end() if anchor else column) + bool(text.style)


#: How many columns an escape takes in a text in double quotes, where it is not two; which of them are blanks.
_ESCAPE_WIDTHS: Mapping[str, int] = {"x": 4, "u": 6, "U": 10}
_BLANK_ESCAPES = frozenset({"", " ", "n", "t", "r", "_", "N", "L", "P"})


def _character(row: str, column: int, style: str) -> tuple[int, bool]:
    """Return how many columns one character of the value takes in the file, and whether it is a blank."""
    if style == "'" and row.startswith("''", column):
        return 2, False
    if style == '"' and row[column] == "\\":
        escape = row[column + 1 : column + 2]
        return _ESCAPE_WIDTHS.get(escape, 2), escape in _BLANK_ESCAPES
    return 1, row[column].isspace()


class Map(dict[str, Any]):
    """A mapping from a file, with the places of its keys and values.

    `model` is set by the document model that read it, for hints about unknown keys.
    """

    __slots__ = ("_elsewhere", "file", "key_starts", "model", "start")

    def __init__(self, file: File, start: Mark) -> None:
        self.file = file
        self.start = start
        self.key_starts: dict[str, Mark] = {}
        self._elsewhere: dict[str, Mark] | None = None
        self.model: Any = None

    def note(self, key: str, start: Mark) -> None:
        """Record the place of a value that has none itself (a number, yes or no, null), or of an alias."""
        if self._elsewhere is None:
            self._elsewhere = {}
        self._elsewhere[key] = start

    def put(self, key: str, value: Any, start: Mark) -> None:
        """Set a key that stands at `start`, and its value, unless that has a place itself."""
        self[key] = value
        self.key_starts[key] = start
        if type(value) not in _PLACED:
            self.note(key, start)

    def drop(self, key: str) -> None:
        """Remove a key with its places; KeyError without it."""
        del self[key], self.key_starts[key]
        if self._elsewhere is not None:
            self._elsewhere.pop(key, None)

    @property
    def place(self) -> Place:
        """Where the mapping begins."""
        return self.file.place(self.start)

    def value_place(self, key: str) -> Place:
        """Return where a value stands; KeyError without it."""
        if self._elsewhere is not None and key in self._elsewhere:
            return self.file.place(self._elsewhere[key])
        return self.file.place(self[key].start)

    def key_place(self, key: str) -> Place:
        """Return where a key stands; KeyError without it."""
        return self.file.place(self.key_starts[key])

    def key_text(self, key: str) -> Text:
        """Return a key as a text with its place, for an expression or a quantity; KeyError without it."""
        start = self.key_starts[key]
        row, column = self.file.lines[start.line], start.column
        first = row[column : column + 1]
        if first == "&":
            anchor = _ANCHOR.match(row, column)
            column = anchor.end() if anchor else column
            first = row[column : column + 1]
        return _text(key, self.file, start, first if first in _QUOTES else None)


def map_at(place: Place) -> Map:
    """Make an empty mapping that stands at `place`, for one that is not written."""
    return Map(File(place.file, ""), _spot_of(place))


class Merged(Map):
    """A mapping of two files: what stands in `own` replaces, or is added to, what stands in `base`."""

    __slots__ = ("_owners", "base")

    def __init__(self, own: Map, base: Map) -> None:
        super().__init__(own.file, own.start)
        self.base = base
        self._owners: dict[str, Map] = {}

    def take(self, key: str, value: Any, owner: Map) -> None:
        """Enter a value under a key that stands in `owner`."""
        self[key] = value
        self.key_starts[key] = owner.key_starts[key]
        self._owners[key] = owner

    def value_place(self, key: str) -> Place:
        """Return where a value stands; KeyError without it."""
        return self._owners[key].value_place(key)

    def key_place(self, key: str) -> Place:
        """Return where a key stands; KeyError without it."""
        return self._owners[key].key_place(key)

    def key_text(self, key: str) -> Text:
        """Return a key as a text with its place; KeyError without it."""
        return self._owners[key].key_text(key)


def data_at(value: Any, place: Place) -> Any:
    """Return plain data as if all of it stood at `place`, for what is not written; placed data stays."""
    if type(value) in _PLACED or not isinstance(value, (str, dict, list)):
        return value
    if isinstance(value, str):
        return text_at(value, place)
    spot = _spot_of(place)
    file = File(place.file, "\n" * spot.line + " " * spot.column)
    if isinstance(value, list):
        listed = Seq(file, spot)
        listed.extend(data_at(each, place) for each in value)
        listed.starts = [spot] * len(value)
        return listed
    found = Map(file, spot)
    for key, each in value.items():
        found.put(key, data_at(each, place), spot)
    return found


class Seq(list[Any]):
    """A list from a file, which knows where each of its elements stands."""

    __slots__ = ("file", "start", "starts")

    def __init__(self, file: File, start: Mark) -> None:
        self.file = file
        self.start = start
        self.starts: list[Mark] = []

    @property
    def places(self) -> list[Place]:
        """Where each element stands."""
        return [self.file.place(start) for start in self.starts]

    def place_of(self, index: int) -> Place:
        """Return where an element stands."""
        return self.file.place(self.starts[index])


#: What knows itself where it stands.
_PLACED = frozenset([Text, Map, Seq])


def read(path: Path, findings: Findings) -> Map | None:
    """Read a mission file into a mapping with places; None after a finding that leaves nothing to read."""
    raw = read_bytes(path, findings)
    return None if raw is None else parse_bytes(raw, str(path), findings)


def read_bytes(path: Path, findings: Findings) -> bytes | None:
    """Return the bytes of a file; None after a finding: it cannot be read, or has more than `MAX_BYTES`."""
    start = Place(str(path), 1, 1)
    try:
        raw, size = _content(path)
    except OSError as error:
        findings.add(start, "no-file", "", f"cannot read the file: {error.strerror}")
        return None
    if size > MAX_BYTES:
        problem = f"the file has {size} bytes"
        findings.add(start, "too-large", "", problem, f"at most {MAX_BYTES} are read")
        return None
    return raw


def head(path: Path) -> tuple[str, str] | None:
    """Return the kind and name that a file gives itself (`mission`, `InspectionMission`).

    None where the file cannot be read, or has no such line.
    """
    try:
        raw, _ = _content(path)
    except OSError:
        return None
    found = _HEAD.search(raw.decode("utf-8-sig", "replace"))
    return (found.group(1), found.group(2)) if found else None


def _content(path: Path) -> tuple[bytes, int]:
    """Return the bytes of a file, no more than may be read, and how many it has.

    Raises:
        OSError: there is none, or it is no file: a pipe would be waited for, a device has no end.
    """
    known = path.stat()
    if not (stat.S_ISREG(known.st_mode) or stat.S_ISDIR(known.st_mode)):
        raise OSError(errno.EINVAL, "it is no file")
    with path.open("rb") as file:
        raw = file.read(MAX_BYTES)
    return raw, max(len(raw), known.st_size)


def parse_bytes(raw: bytes, name: str, findings: Findings) -> Map | None:
    """Parse the bytes of a file to a mapping with places; `name` is the file's name in them.

    None after a finding: it is not UTF-8, or `parse` cannot read it.
    """
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        column = error.start - raw.rfind(b"\n", 0, error.start)
        place = Place(name, line, column)
        findings.add(place, "wrong-yaml", "", "this is not UTF-8", "save the file as UTF-8")
        return None
    return parse(text, name, findings)


def parse(text: str, name: str, findings: Findings) -> Map | None:
    """Parse the text of a file to a mapping with places; `name` is the file's name in them.

    None after a finding: it is no YAML, not one document, no mapping, has a tag or a key that is no scalar,
    or is beyond a bound. After a duplicate key there is a finding and a mapping. The length of the text is
    bounded by `read_bytes`, not here.
    """
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


_BEGINNING = _Position(0, 0)


class _Unreadable(Exception):
    """Nothing sensible can be read after this; the finding has been made."""


class _Builder:
    """One pass over the events of a file."""

    def __init__(self, text: str, name: str, findings: Findings) -> None:
        self._text = text
        self._file = File(name, text)
        self._findings = findings
        self._nodes = 0
        self._anchors: dict[str, tuple[Any, int] | None] = {}
        #: Values with an anchor, and how many levels of nesting they have, by identity.
        self._levels: dict[int, tuple[Any, int]] = {}
        self._next: Callable[[], Any] = _Loader(text).get_event

    def document(self) -> Any:
        """Build the one document of the file."""
        try:
            return self._document()
        except yaml.MarkedYAMLError as error:
            mark: Mark = error.problem_mark or error.context_mark or _BEGINNING
            if "nesting depth" in str(error.problem):  # libyaml's own bound; its scanner reads far ahead
                self._refuse_depth(mark)
            context = f" {error.context}" if error.context else ""
            hint = _yaml_hint(error)
            if "flow" in context:
                mark, hint = self._unquoted(mark)
            self._refuse(mark, "wrong-yaml", f"{error.problem or 'not YAML'}{context}", hint)
        except yaml.YAMLError as error:
            position = int(getattr(error, "position", 0) or 0)
            line = self._text.count("\n", 0, position)
            column = position - self._text.rfind("\n", 0, position) - 1
            reason = getattr(error, "reason", None) or "not YAML"
            self._refuse(_Position(line, column), "wrong-yaml", str(reason))

    def _unquoted(self, mark: Mark) -> tuple[Mark, str]:
        """Return where an expression without quotes stands that ended the reading at `mark`, and a hint."""
        lines = self._file.lines
        before = lines[mark.line][: mark.column + 1] if mark.line < len(lines) else ""
        found = next((match for match in _EXPRESSION.finditer(before) if match[1]), None)
        if found is None:
            return mark, ""
        return _Position(mark.line, found.start()), 'quote it inside of braces and brackets: "${ ... }"'

    def _document(self) -> Any:
        self._next()
        event = self._next()
        if isinstance(event, StreamEndEvent):
            self._refuse(_BEGINNING, "wrong-yaml", "the file is empty")
        event = self._next()
        root = self._node(event, event.start_mark, 0)
        self._next()
        event = self._next()
        if not isinstance(event, StreamEndEvent):
            problem = "a second document starts here"
            self._refuse(event.start_mark, "wrong-yaml", problem, "use one file each")
        return root

    def _refuse(self, start: Mark, rule: str, problem: str, hint: str = "") -> NoReturn:
        self._findings.add(self._file.place(start), rule, "", problem, hint)
        raise _Unreadable

    def _check_count(self, start: Mark) -> None:
        if self._nodes > MAX_NODES:
            problem = f"more than {MAX_NODES} values, aliases counted as often as they are used"
            self._refuse(start, "too-large", problem, "write less, or alias less")

    def _node(self, event: Any, start: Mark, depth: int) -> Any:
        kind = type(event)
        if kind is AliasEvent:
            return self._alias(event.anchor or "", start, depth)
        self._nodes += 1
        if self._nodes > MAX_NODES or depth > MAX_DEPTH or event.tag is not None:
            self._refuse_node(event, start, depth)
        if event.anchor is not None:
            return self._anchored(event, start, depth)
        return _BUILDERS[kind](self, event, start, depth + 1)

    def _refuse_node(self, event: Any, start: Mark, depth: int) -> NoReturn:
        self._check_count(start)
        if depth > MAX_DEPTH:
            self._refuse_depth(start)
        self._refuse(start, "wrong-yaml", f"the tag {event.tag!r} is not allowed", _NO_TAG)

    def _refuse_depth(self, mark: Mark) -> NoReturn:
        self._refuse(mark, "too-large", f"more than {MAX_DEPTH} levels of nesting")

    def _anchored(self, event: Any, start: Mark, depth: int) -> Any:
        self._anchors[event.anchor] = None
        before = self._nodes
        value = _BUILDERS[type(event)](self, event, start, depth + 1)
        self._anchors[event.anchor] = (value, self._nodes - before + 1)
        self._levels[id(value)] = (value, self._levels_of(value))
        return value

    def _levels_of(self, value: Any) -> int:
        if id(value) in self._levels:
            return self._levels[id(value)][1]
        inner = value.values() if isinstance(value, Map) else value if isinstance(value, Seq) else None
        return 0 if inner is None else 1 + max(map(self._levels_of, inner), default=0)

    def _alias(self, anchor: str, start: Mark, depth: int) -> Any:
        known = self._anchors.get(anchor)
        if known is None:
            reason = "contains itself" if anchor in self._anchors else "is not defined above"
            self._refuse(start, "wrong-yaml", f"the alias '*{anchor}' {reason}")
        value, nodes = known
        self._nodes += nodes
        self._check_count(start)
        if depth + self._levels_of(value) > MAX_DEPTH:
            self._refuse_depth(start)
        return value

    def _sequence(self, _: Any, start: Mark, depth: int) -> Seq:
        found = Seq(self._file, start)
        while type(event := self._next()) is not SequenceEndEvent:
            at = event.start_mark
            found.starts.append(at)
            found.append(self._node(event, at, depth))
        return found

    def _mapping(self, _: Any, start: Mark, depth: int) -> Map:
        found = Map(self._file, start)
        following, key_starts = self._next, found.key_starts
        most = MAX_NODES if depth <= MAX_DEPTH else 0
        while type(event := following()) is not MappingEndEvent:
            key_start = event.start_mark
            self._nodes += 1
            plain = type(event) is ScalarEvent and event.tag is None and event.anchor is None
            if not plain or self._nodes > MAX_NODES:
                self._check_key(event, key_start)
            key: str = event.value
            event = following()
            at = event.start_mark
            plain = type(event) is ScalarEvent and event.tag is None and event.anchor is None
            if plain and self._nodes < most:  # as `_node` does it: most values are no more than that
                self._nodes += 1
                value = self._scalar(event, at, depth)
            else:
                value = self._node(event, at, depth)
            if key in key_starts:
                self._report_duplicate(key, found.key_place(key), self._file.place(key_start))
                continue
            found[key] = value
            key_starts[key] = key_start
            if type(value) not in _PLACED or value.start is not at:
                found.note(key, at)
        return found

    def _report_duplicate(self, key: str, first: Place, second: Place) -> None:
        problem = f"the key {key!r} stands twice, in line {first.line} and in line {second.line}"
        self._findings.add(second, "duplicate-key", "", problem, "remove or rename one")

    def _check_key(self, event: Any, start: Mark) -> None:
        """Check a key that is not just a word: one with an anchor may be, and is stored under it."""
        if type(event) is not ScalarEvent:
            self._refuse(start, "wrong-yaml", "a key must be a plain word")
        self._check_count(start)
        if event.tag is not None:
            self._refuse(start, "wrong-yaml", f"the tag {event.tag!r} is not allowed", "write the plain key")
        self._anchors[event.anchor or ""] = (_text(event.value, self._file, start, event.style or None), 1)

    def _scalar(self, event: Any, start: Mark, _: int) -> Any:
        value: str = event.value
        if not event.style and value[:1] in _STARTS:
            if value in _WORDS:
                return _WORDS[value]
            if _INTEGER.fullmatch(value):
                return self._number(value, start, _integer)
            if _FLOAT.fullmatch(value):
                return self._number(value, start, _float)
        text = _new_text(Text, value)  # as `_text` does it, but there are thousands of them
        text.file = self._file
        text.start = start
        text.style = event.style or None
        return text

    def _number(self, value: str, start: Mark, convert: Callable[[str], Any]) -> Any:
        if len(value) > MAX_NUMBER:
            problem = f"a number of {len(value)} digits"
            self._refuse(start, "too-large", problem, f"at most {MAX_NUMBER} are read")
        return convert(value)


#: What makes a node of an event.
_BUILDERS: Mapping[type, Callable[[_Builder, Any, Mark, int], Any]] = {
    ScalarEvent: _Builder._scalar,
    SequenceStartEvent: _Builder._sequence,
    MappingStartEvent: _Builder._mapping,
}


class _Whole(int):
    """A whole number that is written otherwise than Python writes it, such as `007`."""

    written: str

    def __repr__(self) -> str:
        return self.written


class _Real(float):
    """A number that is written otherwise than Python writes it, such as `1.10`."""

    written: str

    def __repr__(self) -> str:
        return self.written


def _integer(text: str) -> int:
    number = int(text, 0 if text[:2] in ("0x", "0o") else 10)
    return number if repr(number) == text else _as_written(_Whole(number), text)


def _float(text: str) -> float:
    number = float(text)
    return number if repr(number) == text else _as_written(_Real(number), text)


def _as_written(number: _N, text: str) -> _N:
    number.written = text
    return number


def _yaml_hint(error: yaml.MarkedYAMLError) -> str:
    problem = str(error.problem)
    if "mapping values are not allowed" in problem:
        return "quote a text that contains ': '"
    if "cannot start any token" in problem:
        return "indent with blanks and quote a text that starts with a special character"
    if "a tag" in str(error.context):
        return _NO_TAG
    return ""
