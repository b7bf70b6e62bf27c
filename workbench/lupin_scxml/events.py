"""Analyses the events of an SCXML document: who raises them, who reacts, and which fields expressions may
see.

A descriptor (`a`, `a.*`) is written under each event of the document that it matches, so that document order
decides. First words that the language reserves are renamed: `error.execution` becomes `failed.execution`, and
a state's done event that another state reacts to `STATE_done`.

`Seen` is the set of events that may have led to the place of an expression; None, unknown, makes everything
that depends on it unknown.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import accumulate, pairwise

from lupin_engine.chart import WORDS
from lupin_engine.plugin import RESERVED_EVENTS
from lupin_scxml.elements import Element
from lupin_scxml.expressions import UNDEFINED, Operand, assignments, constant
from lupin_scxml.notes import CannotSay

PROCESSOR = "http://www.w3.org/TR/scxml/#SCXMLEventProcessor"
PROCESSORS = ("", "scxml", PROCESSOR)
REGIONS = ("state", "parallel", "final")
STATES = (*REGIONS, "history")
QUOTED = re.compile(r"'[^']*'|\"[^\"]*\"")
_DONE = "done.state."
#: First words of events that the language keeps for itself, and what stands for them.
_RENAMED = {first: f"{first}_" for first in RESERVED_EVENTS} | {"error": "failed", "done": "ended"}
#: First words of descriptors that no event from outside has.
_NOT_OUTSIDE = ("*", _RENAMED["error"], _RENAMED["done"])

#: The events that may have led to where an expression stands; None: nobody knows.
Seen = frozenset[str] | None


def word(text: str) -> str:
    """Return a name that the language accepts."""
    found = re.sub(r"\W", "_", text, flags=re.ASCII)
    return found if found[:1].isalpha() else f"x{found}"


def snake(text: str) -> str:
    """Return a name in words of lower case: `waitForUser` is `wait_for_user`."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", word(re.sub(r"\W+", "_", text))).lower()


def field(text: str) -> str:
    """Return an event field's name: in snake case, and no word of expressions."""
    found = snake(text)
    return f"{found}_" if found in WORDS else found


def split(rule: Element) -> list[str]:
    """Return the event descriptors of a transition."""
    return rule.get("event").split()


def is_to_itself(send: Element) -> bool:
    """Return whether a `send` goes to the document's own session."""
    to = send.get("target") or send.get("targetexpr")
    return to in ("", "#_internal", "'#_internal'") and send.get("type") in PROCESSORS


def params_of(element: Element) -> set[str]:
    """Return the field names of an event or a result; a `content` is the field `data`."""
    names = {field(param.get("name")) for param in element.all("param")}
    return names | set(map(field, element.get("namelist").split())) | {"data" for _ in element.all("content")}


class Events:
    """The events of one document."""

    def __init__(self, root: Element, own: bool, binding: str = "") -> None:
        """Index a document.

        Args:
            root: the document.
            own: the engine exported it.
            binding: the binding for events that nothing in the document raises.
        """
        self._own = own
        #: By event, what raises it; of the end of a state its `donedata`, of an error nothing.
        self._sources: defaultdict[str, list[Element]] = defaultdict(list)
        #: By event descriptor, the events that it matches, and the states with a transition on it.
        self._matched: defaultdict[str, list[str]] = defaultdict(list)
        self.listening: defaultdict[str, set[Element]] = defaultdict(set)
        #: What `carried` has answered, as long as nothing that it hangs on changes.
        self._carried: dict[Seen, set[str] | None] = {}
        #: What is always an error.
        self.failing: set[Element] = set()
        #: Events that nothing raises, because what would comes after an error.
        self.never: set[str] = set()
        self._original: dict[str, str] = {}
        #: By variable, the texts that it can have; None stands for what is no literal.
        self._texts: defaultdict[str, list[str | None]] = defaultdict(list)
        self._states = {state.get("id"): state for state in root.every(*STATES) if state.get("id")}
        self._index(root)
        #: States to whose end another state reacts that is not around them, and the event for it.
        self.end_events = {} if own else dict(self._ends_heard_elsewhere(root))
        for state, event in self.end_events.items():
            self._sources[event] += [data for final in state.all("final") for data in final.all("donedata")]
        for event in sorted(self._sources):
            self._match(event)
        #: By event that comes from outside, the fields of it that are read.
        self.outside: dict[str, set[str]] = {}
        if binding and not own:
            self._bind(binding)

    def _index(self, root: Element) -> None:
        """Record the texts of variables, what raises an event, and which states wait for one."""
        for name, expression in _written(root):
            text = expression.strip()
            self._texts[name].append(text[1:-1] if QUOTED.fullmatch(text) else None)
        for element in root.every("raise", "send"):
            for event in self.raised_by(element).values():
                self._sources[event].append(element)
        for rule in root.every("transition"):
            for descriptor in split(rule):
                if rule.parent is not None:
                    self.listening[self.name(descriptor)].add(rule.parent)

    def _bind(self, binding: str) -> None:
        """Name the events that nothing in the document raises as events of a binding."""
        for descriptor in sorted(self.listening):
            if not self._matched[descriptor] and descriptor.partition(".")[0] not in _NOT_OUTSIDE:
                event = f"{binding}.{snake(descriptor.replace('.', '_'))}"
                while event in self.outside:
                    event += "_"
                self._original[event] = self._original[descriptor]
                self.outside[event] = set()
                self._match(event, descriptor)

    def _ends_heard_elsewhere(self, root: Element) -> Iterator[tuple[Element, str]]:
        for rule in root.every("transition"):
            for descriptor in split(rule):
                state = (
                    self._states.get(descriptor.removeprefix(_DONE)) if descriptor.startswith(_DONE) else None
                )
                if state is not None and state.kind == "state" and rule.parent not in (state, *state.around):
                    yield state, f"{word(state.get('id'))}_done"

    def _match(self, event: str, known_as: str = "") -> None:
        for descriptor in accumulate((known_as or event).split("."), "{}.{}".format):
            if event not in self._matched[descriptor]:
                self._matched[descriptor].append(event)

    def raised_by(self, element: Element) -> dict[str, str]:
        """Return the events that a `raise` or `send` may raise, by the texts that name them."""
        text = element.get("eventexpr").strip()
        texts: list[str | None] = [element.get("event") or None]
        if text and not element.get("event"):
            texts = [text[1:-1]] if QUOTED.fullmatch(text) else self._texts[text]
        return {one: self.name(one) for one in texts if one} if all(texts) else {}

    def sent(self, event: str) -> list[Element]:
        """Return the elements that raise an event."""
        return self._sources.get(event, [])

    def matches(self, rule: Element, event: str) -> bool:
        """Return whether a transition's descriptor matches an event."""
        names = map(self.name, split(rule))
        return any(event == name or event.startswith(f"{name}.") for name in names)

    def is_sent_once(self, event: str) -> bool:
        """Return whether exactly one element raises an event."""
        return len(self.sent(event)) == 1

    def fails(self, element: Element, event: str) -> str:
        """Record an element that always raises an error; return the event for it."""
        self._carried.clear()
        self.failing.add(element)
        found = self.name(event)
        self._sources.setdefault(found, [])
        self._match(found)
        return found

    def cut(self, action: Element) -> None:
        """Record an action that is never carried out."""
        self._carried.clear()
        for element in action.every("raise", "send"):
            for name in self.raised_by(element).values():
                self._remove_source(name, element)

    def _remove_source(self, event: str, element: Element) -> None:
        """Remove an element from those that raise an event; the last one removes the event."""
        sources = self._sources.get(event, [])
        if element in sources:
            sources.remove(element)
        if sources or event not in self._sources:
            return
        del self._sources[event]
        self.never.add(event)
        for matched in self._matched.values():
            if event in matched:
                matched.remove(event)

    def name(self, text: str) -> str:
        """Return an event's name, or a descriptor without the `.*` or `.` at its end."""
        text = re.sub(r"\.\*?$", "", text.strip())
        if text in ("*", ""):
            return "*"
        first, *rest = map(word, text.split("."))
        found = ".".join((first if self._own else _RENAMED.get(first, first), *rest))
        self._original[found] = text
        return found

    def end(self, descriptor: str) -> str:
        """Return the event for a state's end, where another state reacts to it; else ''."""
        state = self._states.get(descriptor.removeprefix(_DONE)) if descriptor.startswith(_DONE) else None
        return self.end_events.get(state, "") if state is not None else ""

    @property
    def all(self) -> list[str]:
        """All events that the document raises, and those from outside."""
        return sorted({*self._sources, *self.outside})

    def original(self, event: str) -> str:
        """Return an event's name in the document."""
        return self._original.get(event, event)

    def matched(self, descriptor: str) -> list[str]:
        """Return the events of the document that a descriptor matches."""
        if self._own:
            return []
        end = self.end(descriptor)
        return [end] if end else self._matched[self.name(descriptor)]

    def heard_by(self, event: str) -> set[Element]:
        """Return the states with a transition on an event, other than by `*`."""
        descriptors = accumulate(event.split("."), "{}.{}".format)
        return {state for descriptor in descriptors for state in self.listening[descriptor]}

    # -- what an expression sees ----------------------------------------------------------------------------

    def seen_by(self, descriptor: str) -> Seen:
        """Return the events that a transition with this descriptor may see."""
        if not descriptor or descriptor == "*":
            return None
        if descriptor.startswith(_DONE):
            return frozenset({descriptor})
        return frozenset(self.matched(descriptor) or {self.name(descriptor)})

    def seen_in(self, state: Element, ways: Sequence[Element]) -> Seen:
        """Return the events that a state's entry may see, when these transitions lead to it.

        At the beginning of the document there is none.
        """
        around = (state, *state.around)
        if not ways and all(one in outer.all(*REGIONS)[:1] for one, outer in pairwise(around)):
            return frozenset()
        found: set[str] = set()
        for rule in ways:
            for descriptor in split(rule) or [""]:
                seen = self.seen_by(descriptor)
                if seen is None:
                    return None
                found |= seen
        beginning = state.parent is None or state.parent.all(*REGIONS)[:1] == [state]
        return frozenset(found) if found and not beginning else None

    def senders(self, seen: Seen) -> list[Element] | None:
        """Return the elements that may have raised the seen event; None where unknown."""
        found: list[Element] = []
        for event in seen or ():
            state = self._states.get(event.removeprefix(_DONE)) if event.startswith(_DONE) else None
            if state is not None:
                finals = state.all("final")
                found += [(final.all("donedata") or [final])[0] for final in finals]
            elif event not in self._sources:
                return None
            else:
                found += self._sources[event]
        return found or None

    def carried(self, seen: Seen) -> set[str] | None:
        """Return the fields that the seen event may have; None where unknown."""
        if seen not in self._carried:
            senders = self.senders(seen)
            fields = [set() if sender in self.failing else params_of(sender) for sender in senders or ()]
            self._carried[seen] = set().union(*fields) if fields else None
        return self._carried[seen]

    def property(self, name: str, seen: Seen) -> Operand | None:
        """Return the value of `_event.NAME`, where it is the same for all events that may be seen."""
        if name == "name":
            names = {self.original(event) for event in seen or ()}
            return constant(names.pop()) if len(names) == 1 else None
        senders = self.senders(seen)
        found = {_properties(sender).get(name, "") for sender in senders or ()}
        if len(found) != 1 or name not in _PROPERTIES or (name == "origin" and found != {""}):
            return None
        value = found.pop()
        return constant(value) if value else UNDEFINED


_PROPERTIES = ("type", "sendid", "origintype", "invokeid", "origin")


def _properties(sender: Element) -> Mapping[str, str]:
    """Return an event's properties in SCXML besides name and data."""
    if sender.kind == "send" and sender.get("target") != "#_internal":
        external = {"type": "external", "origintype": PROCESSOR, "origin": "the session"}
        return {**external, "sendid": sender.get("id") or sender.get("idlocation")}
    return {"type": "internal" if sender.kind in ("raise", "send") else "platform"}


def _written(root: Element) -> Iterator[tuple[str, str]]:
    """Yield every variable that something writes, with the expression; "" where it writes no expression."""
    for element in root.every("data", "assign"):
        yield element.get("id") or element.get("location"), element.get("expr") or element.text
    for script in root.every("script"):
        # The importer leaves out a script that is not a list of assignments.
        with suppress(CannotSay):
            yield from assignments(script.text)
    for element in root.every("foreach", "send", "invoke"):
        yield from ((element.get(key), "") for key in ("item", "index", "idlocation"))
