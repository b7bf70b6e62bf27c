"""Resolves names in the missions of a folder, by their last valid texts.

The text in the editor may be newer, so lookups use names and paths, never offsets.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from lupin_engine.chart import (
    ELEMENT,
    Composed,
    Draft,
    FileNode,
    Findings,
    Forest,
    Fragment,
    Kind,
    Meaning,
    MissionNode,
    PartNode,
    Scope,
    UsedNode,
    check_expression,
    end_of,
    event_type,
    names_when_done,
    names_when_failed,
    text_at,
)
from lupin_engine.errors import Place
from lupin_engine.missions import Inspection
from lupin_engine.plugin import ANY, Catalog, Type
from lupin_lsp.mentions import Mention
from lupin_lsp.scan import Scan, Steps

#: The text of a state: its file, and the names from the top of that file.
Written = tuple[Path, tuple[str, ...]]
#: A list that a loop goes through, where it is a name or a call; with the name of its element, and without.
_LIST = r"([\w.]+(?:\([^()]*\))?)"
_LOOP = re.compile(rf"\bfor\s+(\w+)\s+in\s+{_LIST}")
_OF_ELEMENT = re.compile(rf"\b(?:find|sorted)\(\s*{_LIST}\s*,")


class Model:
    """A composed chart, queried by file and path."""

    def __init__(self, inspection: Inspection, composed: Composed, catalog: Catalog) -> None:
        self.documents = inspection.documents
        self.composed = composed
        self.catalog = catalog
        self._forest = Forest({}, Findings())
        self._drafts: dict[Written, list[Draft]] = {}
        self._written: dict[str, Written] = {}
        for draft in composed.drafts.values():
            self._enter(draft)

    def _enter(self, draft: Draft) -> None:
        """Index the text of a state; the states of a part belong to the part's file."""
        parent = draft.parent
        file = Path(draft.file.place.file)
        if parent is None or (draft.node is None and draft.kind is not Kind.HISTORY):
            local: tuple[str, ...] = ()
        elif parent.part is not None and draft.file is parent.part:
            local = (draft.local,)
        else:
            local = (*self._written[parent.name][1], draft.local)
        self._written[draft.name] = (file, local)
        files = self.composed.chart.lifecycle_files
        for each in files if draft.file.place.file in files else (file,):
            self._drafts.setdefault((Path(each), local), []).append(draft)
        if draft.part is not None:
            self._drafts.setdefault((Path(draft.part.place.file), ()), []).append(draft)

    def written(self, draft: Draft) -> Written:
        """Return the file and local path of a state's text."""
        return self._written[draft.name]

    def drafts_at(self, written: Written) -> list[Draft]:
        """Return the states of a text: one for every use of a part."""
        return self._drafts.get(written, [])

    def nearest(self, file: Path, local: tuple[str, ...]) -> tuple[list[Draft], bool]:
        """Return the states of a text, or of the innermost enclosing one, and whether it is its own."""
        for length in range(len(local), -1, -1):
            found = self.drafts_at((file, local[:length]))
            if found:
                return found, length == len(local)
        return [], False

    # -- names of states -----------------------------------------------------------------------------------

    def visible(self, file: Path, local: tuple[str, ...]) -> list[Draft]:
        """Return the states in scope of a text, the nearest first; hidden ones are left out."""
        found: dict[str, Draft] = {}
        for draft in self.nearest(file, local)[0]:
            inside = not local and self._stands_in(draft, file)
            last = [draft] if isinstance(draft.part, PartNode) else []
            for scope in [*self._forest.scopes(draft, inside), *last]:
                for name, child in scope.children.items():
                    if not scope.slot or child.kind is Kind.HISTORY:
                        found.setdefault(name, child)
        return list(found.values())

    def _stands_in(self, draft: Draft, file: Path) -> bool:
        """Return whether a state uses the file as a part."""
        return draft.part is not None and Path(draft.part.place.file) == file

    def children(self, file: Path, local: tuple[str, ...]) -> list[Draft]:
        """Return the children of a text's state."""
        found = [child for draft in self.nearest(file, local)[0] for child in draft.children.values()]
        return list({child.local: child for child in found}.values())

    def find(self, file: Path, mention: Mention) -> list[Draft]:
        """Return the states that a name refers to, one for every use of its part."""
        if mention.declares:
            return self.drafts_at((file, states_of(mention.path)))
        if mention.meaning is Meaning.ANYWHERE:
            return self._anywhere(mention)
        found, local = [], states_of(mention.path)
        for draft in self.drafts_at((file, local)):
            if mention.meaning is Meaning.CHILD:
                found += descend(draft, mention.so_far.split("."))
            else:
                inside = not local and self._stands_in(draft, file)
                found += self._forest.find(mention.so_far, draft, inside)[:1]
        return found

    def _anywhere(self, mention: Mention) -> list[Draft]:
        """Return the states that in_state refers to, or their ancestors for an earlier word of the name."""
        found = []
        for name, draft in self.composed.drafts.items():
            if name and (name == mention.whole or name.endswith(f".{mention.whole}")):
                above = list(draft.up())
                found.append(above[mention.whole.count(".") - mention.index])
        return found

    # -- other names ---------------------------------------------------------------------------------------

    def part(self, name: str) -> UsedNode | None:
        """Return a valid part, or the mission that is used by that name; None where there is none."""
        files = [file for file in self.documents.values() if isinstance(file, (PartNode, MissionNode))]
        return next((file for file in files if Path(file.place.file).stem == name), None)

    def file(self, path: Path) -> FileNode | None:
        """Return the parsed file; None where it is not valid."""
        return self.documents.get(path)

    # -- what expressions see ------------------------------------------------------------------------------

    def scope(self, file: Path, path: Steps, scan: Scan) -> Scope:
        """Return the scope of an expression at a path of a file."""
        local = states_of(path)
        drafts, own = self.nearest(file, local)
        draft = drafts[0] if drafts else self.composed.drafts[""]
        is_used = not local and self._stands_in(draft, file)
        scope = (draft.scope if own and not is_used else draft.inner) or Scope({})
        rest = path[2 * len(local) :]
        if not rest:
            return scope
        return self._with_event(draft, scope, file, path, rest, scan)

    def _with_event(
        self, draft: Draft, scope: Scope, file: Path, path: Steps, rest: Steps, scan: Scan
    ) -> Scope:
        state = self.composed.chart.states.get(draft.name)
        key = rest[0]
        if key == "on" and len(rest) > 1:
            return scope.with_names({"event": event_type(str(rest[1]), self.catalog, self.composed.carried)})
        if key == "on_done":
            if state is not None and state.invoke is None:
                return scope.with_event(self.composed.carried.fields_of(end_of(state.name)))
            return scope.with_names(names_when_done(state.invoke if state else None))
        if key == "on_error":
            return scope.with_names(names_when_failed(state.invoke if state else None))
        if key == "for_each":
            return self._in_for_each(draft, scope, path, rest, scan)
        if key in (
            "params",
            "inputs",
            "context",
            "itinerary",
            "budget",
            "before_divert",
            "invariants",
            "properties",
            "request",
            "holds",
        ):
            return scope
        return scope.with_names({"event": ANY})

    def _in_for_each(self, draft: Draft, scope: Scope, path: Steps, rest: Steps, scan: Scan) -> Scope:
        state = self.composed.chart.states.get(draft.name)
        for_each = state.for_each if state else None
        begin = path[: len(path) - len(rest) + 1]
        item = scan.value(*begin, "item")
        if not item or rest[1:2] in (("in",), ("limit",)):
            return scope
        kind = (for_each.items.type.item if for_each else None) or ANY
        scope = scope.with_item(item, kind)
        invoke = for_each.invoke if for_each else None
        if rest[1:2] == ("on_done",):
            return scope.with_names(names_when_done(invoke))
        return scope.with_names(names_when_failed(invoke)) if rest[1:2] == ("on_error",) else scope


def states_of(path: Steps) -> tuple[str, ...]:
    """Return the names of the states that a path leads through, from the top of its file."""
    found = []
    for at in range(0, len(path) - 1, 2):
        if path[at] != "states":
            break
        found.append(str(path[at + 1]))
    return tuple(found)


def steps_of(local: Iterable[str]) -> Steps:
    """Return the path of a state in its file."""
    return tuple(step for name in local for step in ("states", name))


def descend(draft: Draft, names: Iterable[str]) -> list[Draft]:
    """Return the state that names lead to from an ancestor; nothing where they lead nowhere."""
    found: Draft | None = draft
    for word in names:
        found = found.children.get(word) if found is not None else None
    return [found] if found is not None else []


def with_elements(scope: Scope, expression: str) -> Scope:
    """Return a scope with the loop elements of an expression, also of an incomplete one."""
    named = dict(_LOOP.findall(expression))
    named.update((ELEMENT, source) for source in _OF_ELEMENT.findall(expression))
    found: dict[str, Type] = {}
    for name, source in named.items():
        kind = kind_of(scope, source)
        if kind is not None and kind.item is not None:
            found[name] = kind.item
    return scope.with_names(found) if found else scope


def kind_of(scope: Scope, source: str) -> Type | None:
    """Return the type of an expression; None where it has a mistake."""
    fragment = Fragment(source, text_at(source, Place("", 1, 1)))
    typed = check_expression(fragment, scope, ANY, Findings(), "")
    return None if typed is None else typed.type


def type_of(scope: Scope, words: Iterable[str]) -> Type | None:
    """Return the type of a chain such as `input.charge.low`; None where it leads nowhere."""
    first, *rest = words
    found = scope.names.get(first)
    for word in rest:
        found = found.fields.get(word) if found is not None else None
    return found
