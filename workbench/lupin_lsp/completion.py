"""Completion: the possible texts at the cursor.

Names come from the last valid model, the cursor's context from the present text. Every offer has the range
that it replaces, so that a dotted name is one word in every editor.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from lsprotocol.types import CompletionItemKind as ItemKind

from lupin_engine.chart import (
    BUILTIN_CALLS,
    STRUCTURED,
    WRITING,
    ActionNode,
    InvokeNode,
    Meaning,
    MissionNode,
    Node,
    PartNode,
    RetryNode,
    Scope,
    StateNode,
    builtin_actions,
    level_events,
    named_in,
)
from lupin_engine.missions import PARTS, shipped_lifecycles
from lupin_engine.plugin import ANY, UNITS, Argument, Catalog, Type, parse_type
from lupin_lsp import docs
from lupin_lsp.folder import Folder
from lupin_lsp.grammar import FILES, Shape, Spot, fields_of, shapes_of, spot_at
from lupin_lsp.mentions import ExpressionPiece, expressions_in, owner_of, pieces, value_meaning
from lupin_lsp.model import Model, descend, kind_of, states_of, type_of, with_elements
from lupin_lsp.scan import Cursor, Scan, Steps, TokenRole

#: An element of a list by its number, perhaps a field of it, before the dot of what is typed.
_INDEXED = re.compile(r"([A-Za-z_][\w.]*(?:\[\w+\](?:\.[A-Za-z_]\w*)*)+)\.\w*$")
_OPERATORS = ("and", "or", "not", "in", "if", "else", "for", "true", "false")


@dataclass(frozen=True)
class Offer:
    """A completion; `insert` is the text to write where it is more than the label."""

    label: str
    kind: ItemKind
    detail: str = ""
    doc: str = ""
    insert: str = ""


@dataclass(frozen=True)
class Offers:
    """The completions, the likeliest first, and the range from `start` to `end` that they replace."""

    start: int
    end: int
    found: tuple[Offer, ...] = ()


def complete(folder: Folder, path: Path, offset: int) -> Offers:
    """Return the completions at an offset of a file."""
    scan, root = folder.scan(path), folder.kind(path)
    cursor = scan.cursor(offset)
    if cursor is None:
        return Offers(offset, offset)
    if scan.key_token(("scenario",)) is not None:
        return _offers(cursor, ())  # the schema completes scenarios
    if root is None or not scan.keys(()):
        return _offers(cursor, _heads(scan))
    return _Completion(folder, path, scan, root, cursor, offset).offers()


def _offers(cursor: Cursor, found: Iterable[Offer]) -> Offers:
    return Offers(cursor.start, cursor.end, tuple(found))


def _heads(scan: Scan) -> Iterator[Offer]:
    for word, model in FILES.items():
        if scan.key_token((word,)) is None:
            doc = " ".join((model.__doc__ or "").split())
            yield Offer(word, ItemKind.Property, doc, docs.key(word, fields_of(model)[word]), f"{word}: ")


class _Completion:
    """One request for completion, with its context."""

    def __init__(
        self, folder: Folder, path: Path, scan: Scan, root: type[Node], cursor: Cursor, offset: int
    ) -> None:
        self._folder = folder
        self._path = path
        self._scan = scan
        self._root = root
        self._cursor = cursor
        self._offset = offset
        self._catalog: Catalog = folder.catalog
        self._model: Model | None = folder.model
        #: The expression that the cursor is in.
        self._written = ""

    def offers(self) -> Offers:
        """Return the completions."""
        cursor = self._cursor
        if cursor.role is TokenRole.KEY:
            mapping = cursor.path[:-1] if cursor.token else cursor.path
            spot = spot_at(self._root, mapping)
            expression = self._expression(Meaning.VALUE)
            if expression is not None:
                return expression
            keys = self._keys(spot, mapping) if spot else ()
            return _offers(cursor, [*keys, *self._record_keys(mapping)])
        spot = spot_at(self._root, cursor.path)
        if spot is None:
            is_open = cursor.role is TokenRole.OPEN
            return _offers(cursor, self._record_keys(cursor.path) if is_open else ())
        meaning = value_meaning(self._scan, spot)
        expression = self._expression(meaning)
        if expression is not None:
            return expression
        found = list(self._values(spot, meaning))
        if cursor.role is TokenRole.OPEN:
            found = [*self._keys(spot, cursor.path), *self._record_keys(cursor.path), *found]
        return _offers(cursor, found)

    # -- keys ----------------------------------------------------------------------------------------------

    def _record_keys(self, mapping: Steps) -> Iterator[Offer]:
        """Offer the fields of the record at a path of a declaration's default, without present ones."""
        if mapping[2:3] != ("default",):
            return
        try:
            kind = parse_type(self._scan.value(*mapping[:2], "type") or "", self._known_types())
        except ValueError:
            return
        for step in mapping[3:]:
            inner = kind.item if isinstance(step, int) else kind.fields.get(step)
            kind = inner or ANY
        yield from self._absent(
            mapping, (Offer(name, ItemKind.Property, docs.type_text(of)) for name, of in kind.fields.items())
        )

    def _keys(self, spot: Spot, mapping: Steps) -> Iterator[Offer]:
        """Offer the keys of the mapping at a path, without present ones."""
        return self._absent(mapping, (*self._all_keys(spot), *self._inherited(spot, mapping)))

    def _absent(self, mapping: Steps, offers: Iterable[Offer]) -> Iterator[Offer]:
        token = self._cursor.token
        there = {key.text for key in self._scan.keys(mapping) if key is not token}
        colon = (
            "" if token is not None and token.role is TokenRole.KEY and self._has_colon(token.end) else ": "
        )
        for offer in offers:
            if offer.label not in there:
                yield replace(offer, insert=f"{offer.insert or offer.label}{colon}")

    def _inherited(self, spot: Spot, mapping: Steps) -> Iterator[Offer]:
        """Offer the names that the extended lifecycle declares here, in the one that extends it."""
        base = self._folder.base if spot.declares and self._path == self._folder.lifecycle else None
        if base is None:
            return
        scan, origin = self._folder.scan(base), self._folder.scan(self._path).value("extends") or ""
        for key in scan.keys(mapping):
            yield Offer(key.text, ItemKind.Property, origin, scan.value(*key.path, "summary") or "")

    def _has_colon(self, end: int) -> bool:
        return self._scan.text[end:].lstrip(" \t").startswith(":")

    def _all_keys(self, spot: Spot) -> Iterable[Offer]:
        meaning = spot.name_meaning
        if meaning is Meaning.ACTION:
            return (offer for offer in self._actions() if offer.insert)
        if meaning in (Meaning.ARGUMENT, Meaning.BINDING):
            return self._arguments(spot)
        if meaning is Meaning.EVENT:
            return self._events()
        shape = spot.shape.item if spot.shape.item and not spot.shape.model else spot.shape
        return _words_of(shape.model) if shape.model else ()

    def _arguments(self, spot: Spot) -> Iterator[Offer]:
        owner = owner_of(self._scan, spot)
        if spot.holder is StateNode and spot.key == "out":
            yield from self._reported(owner)
        elif spot.holder is StateNode:
            yield from self._bindings(owner)
        elif spot.holder is ActionNode and owner in WRITING:
            yield from self._variables(owner)
        else:
            for name, argument in _arguments_of(owner, spot.holder, self._catalog).items():
                can_miss = argument.optional or argument.default is not None
                detail = f"{argument.type}{' (optional)' if can_miss else ''}"
                yield Offer(name, ItemKind.Property, detail, docs.argument_line(name, argument))

    def _reported(self, part: str) -> Iterator[Offer]:
        found = self._model.part(part) if self._model else None
        for name, node in found.out.items() if isinstance(found, PartNode) else ():
            yield Offer(name, ItemKind.Property, node.type, node.summary)

    def _bindings(self, part: str) -> Iterator[Offer]:
        found = self._model.part(part) if self._model else None
        if found is None or self._model is None:
            return
        if isinstance(found, MissionNode):
            mission = self._model.composed.chart.missions.get(found.name)
            for name, field in mission.request.items() if mission else ():
                doc = docs.request_field(field, found.request[name].summary)
                yield Offer(name, ItemKind.Property, str(field.type), doc)
            return
        declared = self._model.composed.declared.by_file.get(found.title, {})
        for name, parameter in declared.items():
            yield Offer(name, ItemKind.Property, str(parameter.type), docs.parameter(name, parameter))

    # -- values --------------------------------------------------------------------------------------------

    def _values(self, spot: Spot, meaning: Meaning) -> Iterator[Offer]:
        offers: dict[Meaning, Callable[[], Iterator[Offer]]] = {
            Meaning.STATE: partial(self._states, spot),
            Meaning.CHILD: self._children,
            Meaning.PART: partial(self._parts, spot),
            Meaning.LIFECYCLE: self._lifecycles,
            Meaning.OPERATION: self._operations,
            Meaning.ACTION: self._plain_actions,
            Meaning.EVENT: self._events,
            Meaning.REQUEST: self._requests,
            Meaning.ENGAGE: self._engaging,
            Meaning.CODE: partial(self._codes, spot),
            Meaning.HOLD: self._holds,
            Meaning.TYPE: self._types,
            Meaning.UNIT: lambda: (Offer(name, ItemKind.Unit, docs.unit(name)) for name in UNITS),
            Meaning.LIVE_VALUE: self._live_values,
            Meaning.VARIABLE: partial(self._variables, "set"),
        }
        yield from offers.get(meaning, partial(self._plain, spot))()
        yield from (Offer(word, ItemKind.Keyword) for word in _shape(spot).words)

    def _operations(self) -> Iterator[Offer]:
        for name, operation in self._catalog.for_missions.operations.items():
            yield Offer(name, ItemKind.Method, operation.doc, docs.operation(name, operation))

    def _plain_actions(self) -> Iterator[Offer]:
        yield from (offer for offer in self._actions() if not offer.insert)

    def _engaging(self) -> Iterator[Offer]:
        yield from self._requests()
        yield from self._levels()

    def _live_values(self) -> Iterator[Offer]:
        for name, value in self._catalog.for_missions.values.items():
            yield Offer(name, ItemKind.Variable, str(value.type), docs.live_value(name, value))

    def _plain(self, spot: Spot) -> Iterator[Offer]:
        if spot.holder is ActionNode and spot.name == "status":
            yield from (Offer(word, ItemKind.Keyword) for word in self._catalog.profile.statuses)

    def _states(self, spot: Spot) -> Iterator[Offer]:
        """Offer the states in scope, the nearest first; after a dot, the children of the state before it."""
        if self._model is None:
            return
        local = states_of(self._cursor.path)
        before, dot, _ = self._typed().rpartition(".")
        for draft in self._model.visible(self._path, local):
            if not dot:
                yield self._state(draft.local, draft.name)
        if dot:
            for name in self._inside(before, local):
                yield self._state(f"{before}.{name.rpartition('.')[2]}", name)

    def _inside(self, name: str, local: tuple[str, ...]) -> list[str]:
        """Return the full names of the children of the state that a dotted name means."""
        first, *rest = name.split(".")
        assert self._model is not None
        nearest = [draft for draft in self._model.visible(self._path, local) if draft.local == first]
        found = [inner for draft in nearest[:1] for inner in descend(draft, rest)]
        return [child.name for draft in found for child in draft.children.values()]

    def _children(self) -> Iterator[Offer]:
        if self._model is not None:
            for draft in self._model.children(self._path, states_of(self._cursor.path)):
                yield self._state(draft.local, draft.name)

    def _state(self, label: str, name: str) -> Offer:
        assert self._model is not None
        chart = self._model.composed.chart
        state, file = chart.states[name], chart.file_of(chart.states[name].place)
        detail = f"{name} ({file}:{state.place.line})"
        return Offer(label, ItemKind.EnumMember, detail, docs.state(name, state, file))

    def _lifecycles(self) -> Iterator[Offer]:
        for name, file in shipped_lifecycles().items():
            summary = self._folder.scan(file).value("summary") or ""
            yield Offer(name, ItemKind.File, summary, summary)

    def _parts(self, spot: Spot) -> Iterator[Offer]:
        if spot.holder is PartNode:
            yield Offer(self._path.stem, ItemKind.File, "the name of the file")
            return
        missions = {file for file in self._folder.missions() if file != self._path}
        for file in self._folder.files():
            if file.parent.name == PARTS or file in missions:
                summary = self._folder.scan(file).value("summary") or ""
                yield Offer(file.stem, ItemKind.File, summary, summary)

    def _actions(self) -> Iterator[Offer]:
        """Offer actions; `insert` marks those with arguments as keys."""
        profile = self._catalog.profile
        wanted, docs_of = builtin_actions(profile), docs.builtin_actions_of(profile)
        for name in (*STRUCTURED, *wanted):
            takes = name in STRUCTURED or bool(wanted[name])
            doc = docs.builtin_action(name, profile)
            yield Offer(name, ItemKind.Method, docs_of[name], doc, name if takes else "")
        for name, action in self._catalog.actions.items():
            insert = name if action.arguments else ""
            yield Offer(name, ItemKind.Method, action.doc, docs.action(name, action), insert)

    def _events(self) -> Iterator[Offer]:
        yield from self._requests()
        yield from self._levels()
        for name, choice in (self._model.composed.chart.answers if self._model is not None else {}).items():
            yield Offer(name, ItemKind.Event, choice.label)
        for name, event in self._catalog.events.items():
            yield Offer(name, ItemKind.Event, event.doc, docs.event(name, event))
        for name in self._raised():
            yield Offer(name, ItemKind.Event, "raised in this chart")

    def _requests(self) -> Iterator[Offer]:
        for name, doc in self._catalog.profile.events.items():
            yield Offer(name, ItemKind.Event, doc)

    def _levels(self) -> Iterator[Offer]:
        if self._model is not None:
            for name in level_events(self._model.composed.declared.inputs):
                yield Offer(name, ItemKind.Event, "while this is true")

    def _raised(self) -> list[str]:
        """Return the events that some file raises."""
        found = set()
        for file in self._folder.files():
            for token in self._folder.scan(file).tokens:
                if token.path[-2:] == ("raise", "event") and token.role is not TokenRole.KEY:
                    found.add(token.text)
        return sorted(found)

    def _codes(self, spot: Spot) -> Iterator[Offer]:
        if self._model is None:
            return
        codes = self._model.composed.chart.codes
        if spot.holder is RetryNode:
            codes = {name: codes[name] for name in self._ends(spot.mapping[:-1]) if name in codes}
        for name, found in codes.items():
            yield Offer(name, ItemKind.Constant, found.label, docs.reason(found))

    def _ends(self, invoke: Steps) -> list[str]:
        """Return the codes that the operation at a path can fail with."""
        operation = self._catalog.operations.get(self._scan.value(*invoke, "do") or "")
        limit = self._scan.value(*invoke, "timeout", "code")
        return [*(code.name for code in (operation.codes if operation else ())), *([limit] if limit else [])]

    def _holds(self) -> Iterator[Offer]:
        if self._model is not None:
            for name, hold in self._model.composed.declared.holds.items():
                yield Offer(name, ItemKind.Constant, f"engaged by {hold.engage}", docs.hold(hold))

    def _known_types(self) -> Mapping[str, Type]:
        records = self._model.composed.declared.records if self._model is not None else {}
        return {**self._catalog.for_missions.known_types, **records}

    def _types(self) -> Iterator[Offer]:
        known = self._known_types()
        for name, kind in known.items():
            yield Offer(name, ItemKind.TypeParameter, docs.type_text(kind))
        for gathered in ("list", "set"):
            yield from (Offer(f"{gathered} of {name}", ItemKind.TypeParameter) for name in known)

    def _typed(self) -> str:
        """Return the typed part of the word at the cursor."""
        token = self._cursor.token
        return self._scan.text[token.inner : self._offset] if token is not None else ""

    # -- expressions ---------------------------------------------------------------------------------------

    def _expression(self, meaning: Meaning) -> Offers | None:
        """Return the continuations of an expression; None when the cursor is in none."""
        token = self._cursor.token
        if token is None:
            if meaning is not Meaning.CONDITION:
                return None
            return Offers(self._offset, self._offset, tuple(self._beginnings()))
        for found, begin in expressions_in(token, meaning):
            if begin <= self._offset <= begin + len(found):
                return self._in_expression(found, begin)
        return None

    def _in_expression(self, expression: str, start: int) -> Offers:
        self._written = expression
        here = next(
            (piece for piece in pieces(expression, start) if piece.start < self._offset <= piece.end), None
        )
        before = pieces(expression[: self._offset - start], start)
        call = _open_call([piece.text for piece in before])
        if call in ("held", "in_state", "was_in_state"):
            return self._named(call, here.start if here and here.text not in "(" else self._offset)
        if here is not None and here.text[0] in "'\"":
            return self._quoted(here, before)
        indexed = _INDEXED.search(expression[: self._offset - start])
        if indexed is not None:
            begin, end = start + indexed.start(), max(self._offset, here.end if here is not None else 0)
            return Offers(begin, end, tuple(self._fields(indexed[1])))
        word = here.text[: self._offset - here.start] if here and (here.text[0].isalpha()) else ""
        if not word and self._scan.text[self._offset - 1] == ".":
            word = (before[-2].text if len(before) > 1 else "") + "."
        begin = self._offset - len(word)
        owner, dot, _ = word.rpartition(".")
        found = self._fields(owner) if dot else self._beginnings()
        return Offers(
            begin, here.end if here and word and not word.endswith(".") else self._offset, tuple(found)
        )

    def _quoted(self, here: ExpressionPiece, before: list[ExpressionPiece]) -> Offers:
        """Offer the possible values of the text that is compared, where they are known."""
        scope = self._scope()
        kinds = (type_of(scope, piece.text.split(".")) for piece in reversed(before) if piece is not here)
        values = next((kind.values for kind in kinds if kind is not None and kind.values), ())
        if len(before) > 2 and before[-2].text == "[":
            owner = type_of(scope, before[-3].text.split("."))
            named = named_in(owner) if owner is not None else None
            values = tuple(named[1].named) if named is not None else ()
        end = here.end - (len(here.text) > 1 and here.text[-1] == here.text[0])
        return Offers(here.start + 1, end, tuple(Offer(value, ItemKind.Constant) for value in values))

    def _scope(self) -> Scope:
        if self._model is None:
            return Scope({})
        return with_elements(self._model.scope(self._path, self._cursor.path, self._scan), self._written)

    def _beginnings(self) -> Iterator[Offer]:
        scope = self._scope()
        for name, kind in scope.names.items():
            yield Offer(name, ItemKind.Field, kind.name, docs.ROOTS.get(name, ""))
        for name, function in scope.functions.items():
            doc = docs.function(name, function)
            yield Offer(name, ItemKind.Function, str(function.returns), doc, f"{name}(")
        for name in BUILTIN_CALLS:
            yield Offer(name, ItemKind.Function, docs.CALLS[name][0], docs.call(name), f"{name}(")
        yield from (Offer(word, ItemKind.Keyword) for word in _OPERATORS)

    def _fields(self, owner: str) -> Iterator[Offer]:
        """Offer the fields of a record by their whole names: editors disagree about words."""
        scope = self._scope()
        kind = kind_of(scope, owner) if "[" in owner else type_of(scope, owner.split("."))
        fields = dict(kind.fields) if kind else {}
        nearest = self._nearest_parameters() if owner == "param" else []
        for name in sorted(fields, key=lambda name: nearest.index(name) if name in nearest else len(nearest)):
            inner = fields[name]
            doc = self._field_doc(owner, name)
            yield Offer(f"{owner}.{name}", ItemKind.Field, docs.type_text(inner), doc)
        for name, function in scope.functions.items():
            if name.startswith(f"{owner}."):
                doc = docs.function(name, function)
                yield Offer(name, ItemKind.Function, str(function.returns), doc, f"{name}(")

    def _nearest_parameters(self) -> list[str]:
        """Return the parameters of this file and of the lifecycle, in that order."""
        files = [self._path, self._folder.lifecycle, *([self._folder.base] if self._folder.base else [])]
        return [key.text for file in files for key in self._folder.scan(file).keys(("params",))]

    def _field_doc(self, owner: str, name: str) -> str:
        if self._model is None:
            return ""
        declared = self._model.composed.declared
        parameter = declared.parameters.get(name) or self._catalog.parameters.get(name)
        if owner == "param" and parameter is not None:
            return docs.parameter(name, parameter)
        if owner == "input" and name in declared.inputs:
            found = declared.inputs[name]
            return docs.live_input(found, "", self._catalog.values.get(found.value))
        return ""

    def _named(self, call: str, start: int) -> Offers:
        """Offer holds or states as the argument of a call, in the quotes that are there already."""
        text, end = self._scan.text, self._offset
        quoted = start < end and text[start] in "'\""
        begin = start + quoted
        while end < len(text) and (text[end].isalnum() or text[end] in "_."):
            end += 1
        if call == "held":
            return Offers(begin, end, tuple(self._holds()))
        names = self._model.composed.drafts if self._model else {}
        mark = "" if quoted else "'"
        found = [self._state(name.rpartition(".")[2], name) for name in names if name]
        unique = {
            offer.label: replace(offer, insert=f"{mark}{offer.label}{mark}") for offer in reversed(found)
        }
        return Offers(begin, end, tuple(reversed(unique.values())))

    def _variables(self, action: str) -> Iterator[Offer]:
        """Offer the variables that an action can write: all but `set` change lists."""
        known = self._model.composed.declared.context if self._model is not None else {}
        for name, found in known.items():
            if action == "set" or found.type.item is not None:
                yield Offer(name, ItemKind.Field, str(found.type), docs.variable(found, ""))


def _words_of(model: type[Node]) -> Iterator[Offer]:
    for name, field in fields_of(model).items():
        words = shapes_of(model)[name].words
        yield Offer(name, ItemKind.Property, field.description or "", docs.key(name, field, words))


def _shape(spot: Spot) -> Shape:
    return spot.shape.item if spot.shape.item is not None and not spot.shape.words else spot.shape


def _arguments_of(owner: str, holder: type[Node] | None, catalog: Catalog) -> Mapping[str, Argument]:
    if holder is InvokeNode:
        operation = catalog.operations.get(owner)
        return operation.arguments if operation else {}
    action = catalog.actions.get(owner)
    return action.arguments if action else builtin_actions(catalog.profile).get(owner, {})


def _open_call(words: list[str]) -> str:
    """Return the function whose brackets are open where some pieces of an expression end."""
    depth = 0
    for index in range(len(words) - 1, -1, -1):
        if words[index] == ")":
            depth += 1
        elif words[index] == "(":
            if depth == 0:
                return words[index - 1] if index else ""
            depth -= 1
    return ""
