"""Find references, and the outline of a file."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from lupin_engine.chart import Meaning, MissionNode
from lupin_lsp.folder import Folder
from lupin_lsp.mentions import STATES, Mention, mention_at, mentions_in
from lupin_lsp.model import states_of
from lupin_lsp.places import Spanned, is_reported, meant, place_of
from lupin_lsp.scan import Scan, Steps, Token

#: Mentions of these say nothing about any one thing.
_NAMELESS = (Meaning.KEY, Meaning.WORD, Meaning.TEXT, Meaning.UNIT, Meaning.ROOT, Meaning.ATTRIBUTE)
#: What else a section holds besides states, in the outline.
_SECTIONS = ("types", "params", "inputs", "codes", "holds", "context", "invariants", "properties", "request")


@dataclass(frozen=True)
class Reference:
    """A mention in a file."""

    file: Path
    mention: Mention


def mention_under(folder: Folder, path: Path, offset: int) -> Mention | None:
    """Return the mention at an offset of a file; None where there is none, or the file's kind is unknown."""
    root = folder.kind(path)
    return mention_at(folder.scan(path), root, offset) if root else None


def references(folder: Folder, path: Path, mention: Mention) -> list[Reference]:
    """Return every mention of the same thing in the folder, declarations included."""
    wanted = identity(folder, path, mention)
    if not wanted:
        return []
    return [found for found in all_mentions(folder) if wanted & identity(folder, found.file, found.mention)]


def all_mentions(folder: Folder) -> Iterator[Reference]:
    """Yield all mentions in the files of the folder."""
    for file in folder.files():
        root = folder.kind(file)
        if root is not None:
            for mention in mentions_in(folder.scan(file), root):
                yield Reference(file, mention)


def identity(folder: Folder, path: Path, mention: Mention) -> frozenset[Hashable]:
    """Return the identity of a mentioned thing: the places of states, or kind and name of anything else."""
    meaning = meant(mention)
    if meaning in STATES:
        drafts = folder.model.find(path, mention) if folder.model else []
        return frozenset(place for draft in drafts if (place := place_of(folder, draft)) is not None)
    if meaning in _NAMELESS:
        return frozenset()
    if meaning is Meaning.VARIABLE and is_reported(folder, path, mention.name):
        return frozenset()  # each use has a variable of its own
    if meaning is Meaning.BINDING:
        used = folder.used(mention.of)
        if is_reported(folder, used, mention.name):
            return frozenset()
        if folder.kind(used) is MissionNode:
            return frozenset([(Meaning.FIELD, used, mention.name)])
        meaning = Meaning.PARAMETER
    if meaning is Meaning.FILE and folder.kind(path) is MissionNode:
        return frozenset([(Meaning.PART, path.stem)])
    if meaning is Meaning.FIELD and folder.kind(path) is MissionNode:
        return frozenset([(meaning, path, mention.name)])
    if meaning is Meaning.LEVEL:
        return frozenset([(meaning, mention.of, mention.name)])
    if meaning is Meaning.ARGUMENT:
        return frozenset([(meaning, mention.of, mention.name)])
    return frozenset([(meaning, mention.whole if meaning is Meaning.FUNCTION else mention.name)])


# -- outline -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Symbol:
    """An entry of the outline: the range of the whole, and that of its name."""

    name: str
    kind: str
    detail: str
    start: int
    end: int
    name_start: int
    name_end: int
    children: tuple[Symbol, ...] = field(default=())


def outline(folder: Folder, path: Path) -> list[Symbol]:
    """Return the outline of a file: its states and declarations."""
    scan = folder.scan(path)
    sections = [_section(scan, key) for key in scan.keys(()) if key.text in _SECTIONS]
    return [*sections, *_states(scan, ())]


def _section(scan: Scan, key: Token) -> Symbol:
    names = [
        _symbol(scan, inner, "name", scan.value(*inner.path, "type") or "") for inner in scan.keys(key.path)
    ]
    return _symbol(scan, key, "section", "", tuple(names))


def _states(scan: Scan, holder: Steps) -> list[Symbol]:
    found = []
    for key in scan.keys((*holder, "states")):
        if states_of(key.path):
            kind = scan.value(*key.path, "type") or "state"
            detail = scan.value(*key.path, "summary") or scan.value(*key.path, "invoke", "do") or ""
            inner = tuple(_states(scan, key.path))
            found.append(_symbol(scan, key, kind, detail, inner))
    return found


def _symbol(scan: Scan, key: Token, kind: str, detail: str, children: tuple[Symbol, ...] = ()) -> Symbol:
    name_end = key.inner + len(key.text)
    end = max([name_end, *(token.end for token in scan.tokens if token.path[: len(key.path)] == key.path)])
    return Symbol(key.text, kind, detail, key.start, end, key.inner, name_end, children)


def spans(found: list[Reference]) -> list[Spanned]:
    """Return references as ranges in files."""
    return [Spanned(each.file, each.mention.start, each.mention.end) for each in found]
