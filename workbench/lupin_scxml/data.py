"""Converts the variables of an SCXML document, infers their types, and converts expressions.

ECMAScript has no types: a variable's is inferred from its first value, else from its assignments; of an
unknown type it cannot be converted. One without a first value begins with that type's false (0, '', false).
An object becomes a variable for each field.
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

from lupin_engine.chart import BUILTIN_CALLS, ROOTS, WORDS
from lupin_scxml.elements import Element
from lupin_scxml.events import QUOTED, Events, Seen, field, word
from lupin_scxml.expressions import (
    UNDEFINED,
    Operand,
    assignments,
    constant,
    own_expression,
    read,
    truth,
    value_of,
    written,
)
from lupin_scxml.notes import AlwaysFails, CannotSay, Notes

_DELAY = re.compile(r"(\d*\.?\d+)\s*(ms|s|min|m|h|)")
_PYTHON = {bool: "bool", int: "number", float: "number", str: "text"}
_NEUTRAL = {"number": 0, "text": "", "bool": False}
_LOCATION = re.compile(r"[A-Za-z_$][\w$]*(\.[A-Za-z_$][\w$]*)*")


class Given(NamedTuple):
    """An assignment: the element, the variable, and the expression."""

    element: Element
    location: str
    expression: str


@dataclass
class DataItem:
    """A variable: its name in the language, its type ('' unknown), and its first value."""

    name: str
    type: str = ""
    default: Any = None
    #: How it begins, where that is no literal: the mission does it as it begins.
    begin: Any = None
    #: The `data` that declares it; none where the first thing does that writes it.
    declared: Element | None = None
    #: ECMAScript has no value for it at first.
    begins_unset: bool = False
    #: The expression that it begins with, where the language has no such value.
    unsaid: str = ""


def measure(text: str) -> str:
    """Return a duration as number and unit, without one in ms; and any other expression as `${ ... }`."""
    found = _DELAY.fullmatch(text.strip())
    unit = {"m": "min", "": "ms"}.get(found[2], found[2]) if found else ""
    return f"{float(found[1]):g} {unit}" if found else f"${{ {text} }}"


class DataModel:
    """Variables and expressions of one document."""

    def __init__(
        self, root: Element, own: bool, events: Events, states: dict[str, str], notes: Notes
    ) -> None:
        """Convert the declarations; `states` are the names of states by id."""
        self._root = root
        self._own = own
        self._events = events
        self._states = states
        self._notes = notes
        self.variables: dict[str, DataItem] = {}
        self._taken: set[str] = {*WORDS, *ROOTS, *BUILTIN_CALLS}
        #: Variables that are objects; each of their fields is a variable of its own.
        self._objects: dict[str, Element] = {}
        #: By event field, the type that each sender gives it, as far as it is known.
        self._fields: defaultdict[str, dict[Element, str]] = defaultdict(dict)
        #: There are scripts that cannot be read, which may declare more.
        self._has_code = False
        self._durations = {
            send.get("delayexpr").strip()
            for send in root.every("send")
            if _LOCATION.fullmatch(send.get("delayexpr"))
        }
        self._assigned = list(self._assignments())
        self._declare()
        for _ in () if own else range(4):  # a type follows from another, and that from one more
            self._infer()
        if not own:
            self._begin()
            self._note_several_types()

    # -- declarations ---------------------------------------------------------------------------------------

    def _declare(self) -> None:
        first: list[tuple[Element, str, str]] = []
        for data in self._root.every("data"):
            name = data.get("id")
            added = self._add(name, data)
            is_late = self._root.get("binding") == "late" and self._root not in data.around[:2]
            added.begins_unset = is_late or not (data.get("expr") or data.text).strip()
            if begin := (data.get("expr") or data.text).strip():
                first.append((data, name, begin))
            elif data.get("src"):
                self.variables[name].unsaid = data.get("src")
        for each in (*first, *first):  # one may need another that stands behind it
            if each[1] in self.variables and not self.variables[each[1]].type:
                self._initial(*each)
        for given in self._assigned:
            whole = self._objects.get(given.location.partition(".")[0])
            if whole is not None and _LOCATION.fullmatch(given.location) and "." in given.location:
                self._add(given.location, whole)
        for loop in self._root.every("foreach"):
            for name in (loop.get("item"), loop.get("index")):
                if name not in self.variables and _LOCATION.fullmatch(name):
                    self._add(name, None)
        for script in self._root.every("script"):
            try:
                for name, _ in assignments(script.text):
                    if name.partition(".")[0] not in self.variables and not name.startswith("_"):
                        self._add(name, None)
                self._has_code |= bool(script.get("src"))
            except CannotSay:
                self._has_code = True

    def _add(self, name: str, declared: Element | None) -> DataItem:
        if name not in self.variables:
            found = word(name)
            while not self._own and found in self._taken:
                found += "_"
            self._taken.add(found)
            self.variables[name] = DataItem(found, declared=declared)
        return self.variables[name]

    def _initial(self, data: Element, name: str, given: str) -> None:
        """Give a variable its first value, as a literal or by an action at the beginning."""
        variable = self.variables[name]
        variable.unsaid = ""
        if name in self._durations and QUOTED.fullmatch(given) and _DELAY.fullmatch(given[1:-1]):
            variable.type, variable.default = "duration", measure(given[1:-1])
            return
        try:
            if self._own:
                found = Operand(
                    ast.parse(given, mode="eval").body, _PYTHON.get(type(self.value(given, None)), "")
                )
            else:
                found = self.read(given, None)
            if found.type == "object":
                del self.variables[name]
                self._objects[name] = data
                for part in found.fields:
                    self._object(data, f"{name}.{part}", found.fields[part])
            elif found.type != "undefined":
                self._first(variable, found)
        except (CannotSay, AlwaysFails, SyntaxError):
            variable.unsaid = given

    def _object(self, data: Element, path: str, found: Operand) -> None:
        if found.type == "object":
            for part, inner in found.fields.items():
                self._object(data, f"{path}.{part}", inner)
        else:
            self._first(self._add(path, data), found)

    def _first(self, variable: DataItem, found: Operand) -> None:
        if found.type == "undefined":
            return
        value = value_of(found)
        # Of which type an empty list is follows from what is assigned to it.
        variable.type = "" if value == [] else found.type
        if isinstance(value, str) and "${" in value:
            variable.begin = value
        else:
            variable.default = value

    # -- types ----------------------------------------------------------------------------------------------

    def _assignments(self) -> Iterator[Given]:
        """Yield all assignments of a document."""
        for element in self._root.every("assign", "script", "foreach", "send"):
            if element.kind == "assign":
                yield Given(element, element.get("location").strip(), element.get("expr") or element.text)
            elif element.kind == "script":
                with suppress(CannotSay):
                    yield from (Given(element, *pair) for pair in assignments(element.text))
            elif element.kind == "foreach":
                yield Given(element, element.get("index"), "0")
            elif element.get("idlocation"):
                yield Given(
                    element, element.get("idlocation"), repr(element.get("id") or element.get("event"))
                )

    def _infer(self) -> None:
        """Infer the types of variables and of events' fields from assigned values."""
        for element, location, expression in self._assigned:
            variable = self.variables.get(location)
            if variable is not None and not variable.type:
                variable.type = self._type(expression, self._around(element))
        for loop in self._root.every("foreach"):
            array = self._type(loop.get("array"), None)
            variable = self.variables.get(loop.get("item"))
            if variable is not None and not variable.type and array.startswith("list of "):
                variable.type = array.removeprefix("list of ")
        for holder in self._root.every("send", "donedata"):
            given = {name: name for name in holder.get("namelist").split()}
            for param in holder.all("param", "content"):
                text = param.get("expr") or param.get("location") or content_text(param)
                given[param.get("name") or "data"] = text
            for name, text in given.items():
                if kind := self._type(text, None):
                    self._fields[field(name)][holder] = kind

    def _field_types(self, name: str, seen: Seen) -> set[str]:
        """Return the known types that the senders of the seen events give a field; unknown events: of all."""
        by_sender, senders = self._fields.get(name, {}), self._events.senders(seen)
        return {by_sender[one] for one in (by_sender if senders is None else senders) if one in by_sender}

    def _field_type(self, name: str, seen: Seen) -> str:
        """Return the type of a field of the seen events; '' where none is known, or several are."""
        kinds = self._field_types(name, seen)
        return kinds.pop() if len(kinds) == 1 else ""

    def _note_several_types(self) -> None:
        for event in self._events.all:
            seen = frozenset({event})
            for name in sorted(self._events.carried(seen) or ()):
                if len(kinds := self._field_types(name, seen)) > 1:
                    several = f"{event!r} carries {name} as {' and as '.join(sorted(kinds))}"
                    self._notes.note(self._events.sent(event)[-1], f"{several}: its type is not known")

    def _around(self, element: Element) -> Seen:
        """Return the events that an assignment may see, by its transition."""
        rule = next((one for one in element.around if one.kind == "transition"), None)
        found = [self._events.seen_by(one) for one in (rule.get("event").split() if rule else ())]
        return frozenset().union(*(one or () for one in found)) or None

    def _type(self, text: str, seen: Seen) -> str:
        try:
            found = self.read(text, seen)
        except (CannotSay, AlwaysFails):
            # A name is a text whatever it is.
            return "text" if "_event.name" in text else ""
        return found.type if found.type in _NEUTRAL or found.type.startswith("list of ") else ""

    def _begin(self) -> None:
        """Set the first values of variables without a literal."""
        for name, variable in self.variables.items():
            data = variable.declared
            if not variable.type and variable.default == []:
                variable.type = "list of number"
            if variable.unsaid:
                given = " ".join(variable.unsaid.split())
                self._notes.lose(data or self._root, f"the variable {name!r} that begins with {given!r}")
                variable.type = ""
            elif not variable.type and self._is_never_set(name):
                variable.type = "undefined"
            elif not variable.type:
                self._notes.note(
                    data or self._root, f"the variable {name!r} never has a value; it is left out"
                )
            elif variable.default is None:
                variable.default = [] if variable.type.startswith("list") else _NEUTRAL[variable.type]
                if data is not None and variable.begin is None:
                    self._notes.note(
                        data, f"the variable {name!r} is {spelled(variable.default)} until it is set"
                    )

    def _is_never_set(self, name: str) -> bool:
        """Return whether all assignments of a variable are undefined, or errors."""
        for given in self._assigned:
            if given.location == name:
                try:
                    if self.read(given.expression, self._around(given.element)).type != "undefined":
                        return False
                except CannotSay:
                    return False
                except AlwaysFails:
                    continue
        return all(
            loop.get("item") != name or loop.get("array") in ("", name)
            for loop in self._root.every("foreach")
        )

    def _known(self) -> list[DataItem]:
        return [variable for variable in self.variables.values() if variable.type not in ("", "undefined")]

    def context(self) -> dict[str, Any]:
        """Return the variables as a mission declares them."""
        known = self._known()
        return {each.name: {"type": each.type, "default": each.default} for each in known}

    def beginning(self) -> list[Any]:
        """Return the actions that set first values which are no literals."""
        return [{"set": {each.name: each.begin}} for each in self._known() if each.begin is not None]

    # -- expressions ----------------------------------------------------------------------------------------

    def read(self, text: str, seen: Seen) -> Operand:
        """Convert an expression, where these events may be seen."""
        return read(text, lambda words: self._resolve(words, seen))

    def _resolve(self, words: list[str], seen: Seen) -> tuple[Operand, int]:
        first = words[0]
        if first == "In" and len(words) == 2:
            return constant(self._states.get(words[1], words[1])), 2
        for used in range(len(words), 0, -1):
            variable = self.variables.get(".".join(words[:used]))
            if variable is not None and (variable.type or not variable.declared):
                if variable.type == "undefined":
                    return UNDEFINED, used
                optional = variable.begins_unset
                return Operand(ast.Name(variable.name), variable.type, is_optional=optional), used
        found = None
        if first == "_name":
            found, used = constant(self._root.get("name")), 1
        elif first == "_event" and words[1:2] == ["data"]:
            found, used = self._event_data(words[2:], seen), min(len(words), 3)
        elif first == "_event" and len(words) > 1:
            found, used = self._events.property(words[1], seen), 2
        elif first == "_event" and seen is not None:
            found, used = constant(True) if seen else UNDEFINED, 1
        if found is None:
            raise CannotSay(f"the expression {'.'.join(words)!r}")
        return found, used

    def _event_data(self, words: list[str], seen: Seen) -> Operand | None:
        carried = self._events.carried(seen)
        name = field(words[0]) if words else "data"
        if carried is not None and name not in carried:
            # Of several fields there is no name for all of them.
            return UNDEFINED if words or not carried else None
        for event in seen or ():
            if event in self._events.outside:
                self._events.outside[event].add(name)
        return Operand(ast.Attribute(ast.Name("event"), name), self._field_type(name, seen))

    def condition(self, text: str, seen: Seen) -> str:
        """Return a condition of the language.

        Raises:
            CannotSay: it has no equivalent.
            AlwaysFails: it is no expression in any engine.
        """
        if self._own:
            return own_expression(text, self._states)
        try:
            found = self.read(text, seen)
            if found.parts or found.type in ("object", "typeof"):
                raise CannotSay
        except CannotSay:
            raise CannotSay(f"the expression {' '.join(text.split())!r}") from None
        return written(truth(found))

    def value(self, text: str, seen: Seen, wanted: DataItem | None = None) -> Any:
        """Return a literal as it is, and any other expression as `${ ... }`.

        Raises:
            CannotSay, AlwaysFails: as `condition`.
        """
        if self._own:
            found = own_expression(text, self._states)
            try:
                return ast.literal_eval({"true": "True", "false": "False"}.get(found, found))
            except (ValueError, TypeError, SyntaxError):
                return f"${{ {found} }}"
        try:
            meaning = self.read(text, seen)
            if wanted is not None and wanted.type == "duration" and QUOTED.fullmatch(text.strip()):
                return measure(text.strip()[1:-1])
            if wanted is not None and meaning.type == "undefined":
                return wanted.default
            if wanted is not None and wanted.type and meaning.type and wanted.type != meaning.type:
                raise CannotSay
            return value_of(meaning)
        except CannotSay:
            raise CannotSay(f"the expression {' '.join(text.split())!r}") from None

    def location(self, name: str) -> DataItem:
        """Return the variable that an assignment writes.

        Raises:
            CannotSay: its type is not known.
            AlwaysFails: nothing declares it, and no script can have done so.
        """
        variable, first = self.variables.get(name.strip()), name.strip().partition(".")[0]
        is_known = first in self.variables or first in self._objects or not _LOCATION.fullmatch(name.strip())
        if variable is None and (is_known or self._has_code):
            raise CannotSay(f"an assignment to {name.strip()!r}")
        if variable is None:
            raise AlwaysFails(f"nothing declares {name.strip()!r}")
        if not self._own and not variable.type:
            raise CannotSay(f"a value of {name.strip()!r}")
        return variable

    def delay(self, text: str, seen: Seen) -> str:
        """Return a delay that is computed: a variable, or a number and the text of its unit.

        Raises:
            CannotSay: it is something else.
        """
        meaning = self.read(text, seen)
        number, *unit = meaning.parts or (meaning,)
        item = self.variables.get(text.partition("+")[0].strip())
        if meaning.type == "duration":
            return f"${{ {written(meaning.node)} }}"
        units = [value_of(part) for part in unit]
        if number.type != "number" or len(units) != 1 or units[0] not in ("ms", "s"):
            raise CannotSay(f"the delay {text!r}")
        if item is not None and not self.is_changed(text.partition("+")[0].strip()) and item.begin is None:
            return measure(f"{item.default}{units[0]}")
        one = self._add(units[0], None)
        one.type, one.default = "duration", f"1 {units[0]}"
        return f"${{ {written(ast.BinOp(number.node, ast.Mult(), ast.Name(one.name)))} }}"

    def keep(self, event: str, name: str) -> str:
        """Return the variable that keeps a field of an event.

        Raises:
            CannotSay: its type is not known.
        """
        variable = self._add(f"{event}.{name}", None)
        variable.type, variable.default = (
            self._field_type(name, frozenset({event})),
            self.lacking(event, name),
        )
        if not variable.type:
            raise CannotSay(f"a delayed event with the field {name!r}")
        return variable.name

    def way_into(self, region: str) -> str:
        """Return the variable with the initial state of a region; empty: the default."""
        variable = self._add(f"{region.lower()}_begin", None)
        variable.type, variable.default = "text", ""
        return variable.name

    def lacking(self, event: str, name: str) -> Any:
        """Return the default of a field that an event is sent without; None if its type is unknown."""
        kind = self._field_type(name, frozenset({event}))
        return [] if kind.startswith("list") else _NEUTRAL.get(kind)

    def is_changed(self, name: str) -> bool:
        """Return whether there is an assignment to a variable."""
        return any(given.location == name for given in self._assigned)


def content_text(content: Element) -> str:
    """Return the text of a `content` as an expression: a number, else a quoted text."""
    text = " ".join(content.text.split())
    return text if re.fullmatch(r"-?\d+(\.\d+)?", text) else repr(text)


def spelled(value: Any) -> str:
    """Return a first value as the language writes it."""
    return str(value).lower() if isinstance(value, bool) else repr(value)
