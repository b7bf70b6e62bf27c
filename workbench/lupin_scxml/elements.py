"""Parses an XML document to elements with their lines; refuses a DOCTYPE (entities), and documents too
large."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from xml.parsers import expat

from lupin_engine.errors import UsageError, shortened

#: A larger or deeper document is refused.
MAX_BYTES = 1_000_000
MAX_DEPTH = 60
#: So many elements, letters in an attribute, and words in one (events, targets, names) are read.
MAX_ELEMENTS, MAX_LETTERS, MAX_WORDS = 3_000, 10_000, 50
#: Attributes that are lists of words.
_LISTS = ("event", "target", "initial", "namelist")
#: What attributes of ours begin with, in a document that the engine exported.
OURS = "urn:lupin-engine:chart "
_SCXML = "http://www.w3.org/2005/07/scxml "


@dataclass(eq=False)
class Element:
    """An XML element. `kind` is its name; one of another namespace has that and a space in front."""

    kind: str
    attributes: Mapping[str, str]
    line: int
    children: list[Element] = field(default_factory=list)
    parent: Element | None = None
    text: str = ""
    _of_kinds: dict[tuple[str, ...], list[Element]] = field(default_factory=dict, repr=False)
    _inside: dict[tuple[str, ...], list[Element]] = field(default_factory=dict, repr=False)

    def get(self, name: str) -> str:
        """Return an attribute, empty if absent."""
        return self.attributes.get(name, "")

    def all(self, *kinds: str) -> list[Element]:
        """Return the children of these kinds; asked of a read document, in which they stay as they are."""
        found = self._of_kinds.get(kinds)
        if found is None:
            found = self._of_kinds[kinds] = [child for child in self.children if child.kind in kinds]
        return found

    def every(self, *kinds: str) -> list[Element]:
        """Return this element and its descendants in document order; with `kinds`, only those."""
        found = self._inside.get(kinds)
        if found is None:
            found = self._inside[kinds] = list(self._every(kinds))
        return found

    def _every(self, kinds: tuple[str, ...]) -> Iterator[Element]:
        if not kinds or self.kind in kinds:
            yield self
        for child in self.children:
            yield from child._every(kinds)

    @property
    def around(self) -> list[Element]:
        """Its ancestors, innermost first."""
        return [] if self.parent is None else [self.parent, *self.parent.around]


def _check_sizes(attributes: Mapping[str, str], line: int) -> None:
    """Refuse attributes that are too long: converting them would take quadratic time."""
    for name, value in attributes.items():
        problem = f"line {line}: the attribute {shortened(name)!r} has"
        if len(value) > MAX_LETTERS:
            raise UsageError(f"{problem} {len(value)} characters; {MAX_LETTERS} are the most")
        words = len(value.split()) if name in _LISTS else 0
        if words > MAX_WORDS:
            raise UsageError(f"{problem} {words} words; {MAX_WORDS} are the most")
        if name == "event" and value.count(".") > MAX_WORDS:
            raise UsageError(f"{problem} {value.count('.')} dots; {MAX_WORDS} are the most")


def read_document(file: Path) -> bytes:
    """Return the bytes of a document, unless it is too large.

    Raises:
        UsageError: it is beyond the bounds.
    """
    with file.open("rb") as document:
        text = document.read(MAX_BYTES)
        size = len(text) + (file.stat().st_size - len(text) if document.read(1) else 0)
    if size > MAX_BYTES:
        raise UsageError(f"the document has {size} bytes; {MAX_BYTES} are the most")
    return text


def elements(text: bytes) -> Element:
    """Return the root of an SCXML document.

    Raises:
        UsageError: it is no XML, no SCXML, or beyond the bounds.
    """
    root = parse(text)
    if root.kind != "scxml":
        wanted = f"<scxml xmlns={_SCXML.strip()!r}>"
        raise UsageError(f"line {root.line}: the document is <{root.kind}>, not {wanted}")
    return root


def parse(text: bytes) -> Element:
    """Return the root of a document. `content` has no children: they are data or another document.

    Raises:
        UsageError: it is no XML, or beyond the bounds.
    """
    if len(text) > MAX_BYTES:
        raise UsageError(f"the document has {len(text)} bytes; {MAX_BYTES} are the most")
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text, parser.buffer_size = True, MAX_BYTES  # else each line of a text comes by itself
    stack = [Element("", {}, 0)]
    numbers = count(1)

    def start(kind: str, attributes: dict[str, str]) -> None:
        if len(stack) > MAX_DEPTH:
            raise UsageError(f"line {parser.CurrentLineNumber}: elements are nested deeper than {MAX_DEPTH}")
        if next(numbers) > MAX_ELEMENTS:
            raise UsageError(f"line {parser.CurrentLineNumber}: more than {MAX_ELEMENTS} elements")
        if attributes:
            _check_sizes(attributes, parser.CurrentLineNumber)
        element = Element(kind.removeprefix(_SCXML), attributes, parser.CurrentLineNumber, parent=stack[-1])
        stack[-1].children.append(element)
        stack.append(element)

    def end(_: str) -> None:
        element = stack.pop()
        if element.kind == "content":
            element.children.clear()

    def characters(data: str) -> None:
        stack[-1].text += data

    def refused(*_: object) -> None:
        raise UsageError(f"line {parser.CurrentLineNumber}: a document type is not read; remove it")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = characters, refused
    try:
        parser.Parse(text, True)
    except expat.ExpatError as problem:
        raise UsageError(f"line {problem.lineno}: no XML: {expat.ErrorString(problem.code)}") from None
    except (LookupError, ValueError) as problem:  # an encoding that Python or expat does not know
        raise UsageError(f"line 1: no XML: {problem}") from None
    root = stack[0].children[0]
    root.parent = None
    return root
