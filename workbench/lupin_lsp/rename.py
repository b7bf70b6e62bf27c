"""Renames a state in all files of its folder, or says why not.

The new texts are composed first: apart from the name, states, targets and the states of in_state must stay
the same. So a name that would hide another state, or be hidden by one, is refused with the consequence.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from lupin_engine.chart import FAULT, NAME, Composed, Draft, Kind, Meaning, Node
from lupin_engine.errors import LupinError, Severity
from lupin_lsp.folder import Folder
from lupin_lsp.mentions import STATES, Mention, mentions_in
from lupin_lsp.navigation import Reference, identity, mention_under, references
from lupin_lsp.places import place_of
from lupin_lsp.scan import Scan, scan


class Refused(LupinError):
    """The state cannot be renamed so; the text says why."""


@dataclass(frozen=True)
class Edit:
    """A new text for a piece of a file."""

    start: int
    end: int
    text: str


def renamable(folder: Folder, path: Path, offset: int) -> Mention:
    """Return the renamable name at an offset.

    Raises:
        Refused: there is no name of a state there, or it is ambiguous.
    """
    mention = mention_under(folder, path, offset)
    if mention is None or mention.meaning not in STATES:
        raise Refused("only states can be renamed; this is none")
    _drafts(folder, path, mention)
    return mention


def rename(folder: Folder, path: Path, offset: int, name: str) -> dict[Path, list[Edit]]:
    """Return the edits that rename a state.

    Raises:
        Refused: the text says why.
    """
    mention = renamable(folder, path, offset)
    drafts = _drafts(folder, path, mention)
    if not NAME.fullmatch(name):
        raise Refused(f"{name!r} cannot be the name of a state; use letters, digits and underscores")
    for draft in drafts:
        if draft.parent is not None and name in draft.parent.children:
            raise Refused(f"there is a state {draft.parent.children[name].name!r} already")
    found = references(folder, path, mention)
    if any(each.file == folder.base for each in found):
        raise Refused(f"{mention.name!r} is a state of the lifecycle that this one extends")
    _refuse_shared(folder, found, identity(folder, path, mention))
    edits: dict[Path, list[Edit]] = {}
    for each in found:
        edits.setdefault(each.file, []).append(Edit(each.mention.start, each.mention.end, name))
    _verify(folder, edits, {draft.name for draft in drafts}, name)
    return edits


def _drafts(folder: Folder, path: Path, mention: Mention) -> list[Draft]:
    """Return the states to rename; Refused where there is none, or it has a name that must stay."""
    model = folder.model
    if model is None or folder.inspect_with(folder.current()).composed is None:
        raise Refused("a file of this folder cannot be read; mend that first")
    found = model.find(path, mention)
    if not found:
        raise Refused(f"no state is called {mention.so_far or mention.name!r} here")
    for draft in found:
        if draft.node is None:
            what = "is made by the key 'history'" if draft.kind is Kind.HISTORY else "is a mission"
            raise Refused(f"{draft.local!r} {what}, and not a state that can be renamed")
        if draft.name == FAULT or draft.name in folder.catalog.profile.stages.anchors:
            raise Refused(f"the engine knows {draft.name!r} by its name")
    places = {place_of(folder, draft) for draft in found}
    if len(places) > 1:
        names = " and ".join(sorted(repr(draft.name) for draft in found))
        raise Refused(f"{mention.name!r} means {names} here; rename one of them where it is written")
    return [draft for draft in model.composed.drafts.values() if place_of(folder, draft) in places]


def _refuse_shared(folder: Folder, found: Iterable[Reference], wanted: frozenset[object]) -> None:
    """Raise Refused where a mention means other states too: they would lose it."""
    for each in found:
        others = identity(folder, each.file, each.mention) - wanted
        if others:
            line = folder.scan(each.file).lines.position(each.mention.start)[0] + 1
            where = f"{each.file.name}:{line}"
            raise Refused(f"{each.mention.name!r} in {where} also means another state; change that by hand")


def _verify(folder: Folder, edits: Mapping[Path, list[Edit]], renamed: set[str], name: str) -> None:
    """Compare the inspections before and after; Refused where anything else would change its meaning."""
    texts = folder.current()
    before = folder.inspect_with(texts)
    changed = {path: apply(texts.get(path, folder.text(path)), found) for path, found in edits.items()}
    after = folder.inspect_with({**texts, **changed})
    known = {(d.place.file, d.place.line, d.rule) for d in before.found}
    for finding in after.found:
        if (finding.place.file, finding.place.line, finding.rule) not in known:
            kind = "error" if finding.severity is Severity.ERROR else "warning"
            where = f"{Path(finding.place.file).name}:{finding.place.line}"
            raise Refused(f"this would make a new {kind}: {where}: {finding.problem}")
    if before.composed is None or after.composed is None:
        raise Refused("a file of this folder cannot be read; mend that first")
    if list(_meanings(before.composed, renamed, name)) != list(_meanings(after.composed, set(), name)):
        raise Refused(f"with the name {name!r} something else would be meant somewhere")
    for old, new in _asked(folder, changed):
        asked = {_renamed(full, renamed, name) for full in _ending(before.composed, old)}
        if asked != _ending(after.composed, new):
            raise Refused(f"with the name {name!r} an in_state would ask for another state")


def _meanings(composed: Composed, renamed: set[str], name: str) -> Iterator[tuple[str | None, ...]]:
    """Yield each state with its initial child, and each transition with its event and target (None: none).

    States have the names that they will have.
    """
    for state in composed.chart.states.values():
        yield (_renamed(state.name, renamed, name), _renamed(state.initial, renamed, name))
        for transition in (*state.transitions, *state.resume_at):
            yield (transition.event, _renamed(transition.target, renamed, name))


def _asked(folder: Folder, changed: Mapping[Path, str]) -> Iterator[tuple[str, str]]:
    """Yield the names that in_state asks for, as they are and as they will be."""
    for file in folder.files():
        root = folder.kind(file)
        if root is not None and file in changed:
            yield from zip(_names(folder.scan(file), root), _names(scan(changed[file]), root), strict=True)
        elif root is not None:
            yield from ((whole, whole) for whole in _names(folder.scan(file), root))


def _names(found: Scan, root: type[Node]) -> list[str]:
    mentions = mentions_in(found, root)
    return [each.whole for each in mentions if each.meaning is Meaning.ANYWHERE and each.index == 0]


def _ending(composed: Composed, name: str) -> set[str | None]:
    return {full for full in composed.drafts if f".{full}".endswith(f".{name}")}


def _renamed(full: str | None, renamed: set[str], name: str) -> str | None:
    """Return the full name that a state will have; None for None."""
    if full is None:
        return None
    words = full.split(".")
    for index in range(len(words)):
        if ".".join(full.split(".")[: index + 1]) in renamed:
            words[index] = name
    return ".".join(words)


def apply(text: str, edits: Iterable[Edit]) -> str:
    """Return a text with some of its pieces replaced."""
    for edit in sorted(edits, key=lambda edit: edit.start, reverse=True):
        text = text[: edit.start] + edit.text + text[edit.end :]
    return text
