"""An SCXML document as a tree of elements that know their line; document types and entities are refused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.parsers import expat

from lupin_engine.errors import UsageError

#: Larger or deeper documents are no charts that anybody reads.
MAX_BYTES = 1_000_000
MAX_DEPTH = 60
_SCXML = "http://www.w3.org/2005/07/scxml "


@dataclass(eq=False)
class Element:
    """An element; those of SCXML without their namespace."""

    kind: str
    attributes: Mapping[str, str]
    line: int
    children: list[Element] = field(default_factory=list)
    parent: Element | None = None
    text: str = ""

    def get(self, name: str) -> str:
        """An attribute; empty where there is none."""
        return self.attributes.get(name, "")

    def all(self, *kinds: str) -> list[Element]:
        """The children of some kinds."""
        return [child for child in self.children if child.kind in kinds]

    def every(self) -> Iterator[Element]:
        """This and all below, in the order of the document."""
        yield self
        for child in self.children:
            yield from child.every()

    @property
    def around(self) -> list[Element]:
        """What it stands in, innermost first."""
        return [] if self.parent is None else [self.parent, *self.parent.around]


def elements(text: bytes) -> Element:
    """Return the root of a document.

    Raises:
        UsageError: it is no XML, no SCXML, or beyond the bounds.
    """
    if len(text) > MAX_BYTES:
        raise UsageError(f"the document has {len(text)} bytes; {MAX_BYTES} are the most")
    parser = expat.ParserCreate(namespace_separator=" ")
    top = Element("", {}, 0)
    stack = [top]

    def start(kind: str, attributes: dict[str, str]) -> None:
        if len(stack) > MAX_DEPTH:
            raise UsageError(f"line {parser.CurrentLineNumber}: elements are nested deeper than {MAX_DEPTH}")
        element = Element(kind.removeprefix(_SCXML), attributes, parser.CurrentLineNumber, parent=stack[-1])
        stack[-1].children.append(element)
        stack.append(element)

    def end(_: str) -> None:
        stack.pop()

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
    root = top.children[0]
    if root.kind != "scxml":
        wanted = f"<scxml xmlns={_SCXML.strip()!r}>"
        raise UsageError(f"line {root.line}: the document is <{root.kind}>, not {wanted}")
    root.parent = None
    return root
