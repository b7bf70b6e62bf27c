"""Convert an SCXML document to a mission; whatever has no equivalent is left out and noted with its line.

State ids become upper case, those of final states lower case; a character that no name may have becomes `_`.
Where the meaning differs, the nearest construct is written, and most of the time noted:

* a delayed `send` becomes an `after` of its state, which ends when the state is left;
* a `send` to the session itself becomes a `raise`, which is handled before external events;
* an `initial` that has actions, or whose target is no plain child, becomes a state `begin` with an `always`;
* a transition on `done.state.ID` of a descendant becomes the `on_done` of that descendant.

A document that the engine itself exported has its namespace: there, names stay and its attributes are read.
"""

from __future__ import annotations

import ast
import re
import warnings
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import accumulate
from typing import Any, NamedTuple

from lupin_engine.missions.scxml_elements import Element, elements

_OURS = "urn:lupin-engine:chart "
_TYPE = "x-lupin"
_PROCESSORS = ("", "scxml", "http://www.w3.org/TR/scxml/#SCXMLEventProcessor")
_REGIONS = ("state", "parallel", "final")
_STATES = (*_REGIONS, "history")
_DELAY = re.compile(r"(\d*\.?\d+)\s*(ms|s|min|m|h)")
_QUOTED = re.compile(r"'[^']*'|\"[^\"]*\"")
_TYPES = {bool: "bool", int: "number", float: "number", str: "text"}
#: Operators and names of ECMAScript and Python, and their equivalents.
_WORDS = {"===": "==", "!==": "!=", "&&": " and ", "||": " or ", "!": " not ", "In": "in_state"}
_WORDS |= {"_event.data.": "event.", "True": "true", "False": "false"}
_TOKEN = re.compile(rf"{_QUOTED.pattern}|===?|!==?|&&|\|\||!|\b_event\.data\.|\b[A-Za-z_]\w*")
#: The events that delayed sends of an `onentry` raise, by delay.
_Timers = dict[str, list[str]]
#: What no expression of the language contains, though Python can parse some of it.
_FOREIGN = re.compile(r"[?;{}]|\b(_\w+|typeof|function|new|null|undefined|None)\b|\.\w+\(")


class Note(NamedTuple):
    """A message about a line; `lost` if something is left out, else it is converted with another meaning."""

    line: int
    text: str
    lost: bool


class Imported(NamedTuple):
    """A mission as YAML data, the ids that were renamed, and the notes by line."""

    mission: dict[str, Any]
    names: Mapping[str, str]
    notes: tuple[Note, ...]


def from_scxml(text: bytes, name: str) -> Imported:
    """Return the mission `name` that an SCXML document describes.

    Raises:
        UsageError: it is no XML, no SCXML, or beyond the bounds.
    """
    return _Importer(elements(text), _OURS.strip().encode() in text).mission(name)


class _CannotSay(Exception):
    """The language has no equivalent of this."""


class _Importer:
    def __init__(self, root: Element, own: bool) -> None:
        self._root = root
        self._own = own
        self._notes: set[Note] = set()
        self._names: dict[Element, str] = {}
        self._name_states(root, set())
        self._states = {state.get("id"): state for state in self._names if state.get("id")}
        self._variables = {data.get("id"): _word(data.get("id")) for data in root.every("data")}
        self._events = {_event(e.get("event")) for e in root.every("raise", "send") if e.get("event")}
        #: By event descriptor, the events that it matches, and the states with a transition on it.
        self._matched: defaultdict[str, list[str]] = defaultdict(list)
        self._listening: defaultdict[str, set[Element | None]] = defaultdict(set)
        for event in sorted(self._events):
            for descriptor in _descriptors(event):
                self._matched[descriptor].append(event)
        for rule in root.every("transition"):
            for descriptor in _split(rule):
                self._listening[_event(descriptor)].add(rule.parent)

    def mission(self, name: str) -> Imported:
        for script in self._root.all("script"):
            self._lose(script, "a script")
        mission = {"mission": name, **_slim({"context": self._context()}), **self._inside(self._root)}
        states = {old: self._names[state] for old, state in self._states.items()}
        pairs = (*states.items(), *self._variables.items())
        return Imported(mission, {old: new for old, new in pairs if old != new}, tuple(sorted(self._notes)))

    def _tell(self, element: Element, text: str) -> None:
        self._notes.add(Note(element.line, text, False))

    def _lose(self, element: Element, what: str) -> None:
        self._notes.add(Note(element.line, f"{what} cannot be said; it is left out", True))

    @contextmanager
    def _or_lost(self, element: Element, role: str = "") -> Iterator[None]:
        """Note what the block cannot convert, and go on after it."""
        try:
            yield
        except _CannotSay as problem:
            self._lose(element, f"{problem}{role}")

    def _name_states(self, parent: Element, taken: set[str]) -> None:
        for state in parent.all(*_STATES):
            name = state.get("id") or f"{parent.get('id') or 'chart'}_{state.kind}"
            name = name.removeprefix(f"{parent.get('id')}-")
            if not self._own:
                name = _word(name).lower() if state.kind == "final" else _word(name).upper()
                while name in taken:
                    name += "_"
            taken.add(name)
            self._names[state] = name
            self._name_states(state, taken)

    def _target(self, source: Element, ids: str) -> str:
        """Return the path of a target from the nearest ancestor-or-self of `source` that contains it."""
        several = len(ids.split()) > 1
        target = self._parallel(ids) if several else self._states.get(ids.strip())
        if target is None:
            missing = f"the target {ids!r}, which does not exist,"
            raise _CannotSay(f"several targets at once ({ids})" if several else missing)
        nearer: set[str] = set()
        for scope in (source, *source.around):
            if scope in target.around:
                outer = reversed(target.around[: target.around.index(scope)])
                path = [self._names[state] for state in (*outer, target)]
                if path[0] not in nearer:
                    return ".".join(path)
            nearer |= {self._names[state] for state in scope.all(*_STATES)}
        raise _CannotSay(f"the target {ids!r}, whose name a nearer state has,")

    def _parallel(self, ids: str) -> Element | None:
        """Return the parallel state whose regions are exactly these."""
        wanted = {self._states.get(one) for one in ids.split()}
        parents = {state.parent if state else None for state in wanted}
        whole = parents.pop() if len(parents) == 1 else None
        return whole if whole and whole.kind == "parallel" and wanted == set(whole.all(*_REGIONS)) else None

    def _expression(self, text: str) -> str:
        found = " ".join(_TOKEN.sub(self._token, " ".join(text.split())).split())
        foreign = not self._own and bool(_FOREIGN.search(_QUOTED.sub("''", found)))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                ast.parse(found, mode="eval")
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            foreign = True
        if foreign:
            raise _CannotSay(f"the expression {text!r}")
        return found

    def _token(self, found: re.Match[str]) -> str:
        token = found[0]
        if found.string.endswith("In(", 0, found.start()) and _QUOTED.fullmatch(token):
            state = self._states.get(token[1:-1])
            return repr(self._names[state] if state else token[1:-1])
        return self._variables.get(token) or _WORDS.get(token, token)

    def _value(self, text: str) -> Any:
        """Return the value of a literal, and any other expression as `${ ... }`."""
        found = self._expression(text)
        try:
            return ast.literal_eval({"true": "True", "false": "False"}.get(found, found))
        except (ValueError, TypeError, SyntaxError):
            return f"${{ {found} }}"

    def _context(self) -> dict[str, Any]:
        found = {}
        for data in self._root.every("data"):
            with suppress(_CannotSay):
                value = self._value(data.get("expr") or data.text)
                if type(value) in _TYPES and "${" not in str(value):
                    found[self._variables[data.get("id")]] = {"type": _TYPES[type(value)], "default": value}
                    continue
            self._lose(data, f"the variable {data.get('id')!r} without a number, text or truth value")
        return found

    def _params(self, element: Element) -> dict[str, Any]:
        """Return what `namelist` or the `param` elements pass."""
        for content in element.all("content"):
            raise _CannotSay(f"<content> in line {content.line}")
        listed = [self._variables.get(name, name) for name in element.get("namelist").split()]
        return {name: f"${{ {name} }}" for name in listed} or {
            _word(param.get("name")): self._value(param.get("expr") or param.get("location"))
            for param in element.all("param")
        }

    def _inside(self, parent: Element) -> dict[str, Any]:
        """Return `initial` and `states` of a state or of the document."""
        states = {self._names[child]: self._state(child) for child in parent.all(*_STATES)}
        first = [self._names[child] for child in parent.all(*_REGIONS)]
        rule = next((rule for each in parent.all("initial") for rule in each.all("transition")), None)
        wanted = (rule and rule.get("target")) or parent.get("initial")
        initial = None
        if wanted and parent.kind != "parallel":
            with self._or_lost(parent, " as the beginning"):
                initial = self._target(parent, wanted)
                actions = self._actions(rule.children) if rule else []
                if actions or "." in initial or states.get(initial, {}).get("type") == "history":
                    always = {"target": initial, "do": actions} if actions else initial
                    initial = "begin" if "begin" not in states else "begin_here"
                    states = {initial: {"always": always}, **states}
        elif len(first) > 1 and parent.kind != "parallel":
            initial = first[0]
        return _slim({"initial": initial, "states": states})

    def _state(self, state: Element) -> dict[str, Any]:
        if state.kind == "history":
            return self._history(state)
        found: dict[str, Any] = {} if state.kind == "state" else {"type": state.kind}
        found |= self._inside(state)
        timers: _Timers = {}
        entry = self._actions((a for block in state.all("onentry") for a in block.children), timers)
        leave = self._actions(a for block in state.all("onexit") for a in block.children)
        if leave and state.kind == "final":
            self._lose(state, "what an end does when it is left")
            leave = []
        found |= _slim({"entry": entry, "exit": leave})
        for kind, word, read in (("invoke", "invoke", self._invoke), ("donedata", "result", self._params)):
            for element in state.all(kind):
                with self._or_lost(element):
                    found |= _slim({word: read(element)})
        for model in state.all("datamodel"):
            self._tell(model, "variables of a state are variables of the mission")
        return found | self._transitions(state, timers)

    def _history(self, state: Element) -> dict[str, Any]:
        found = {"type": "history", "depth": state.get("type") or "shallow"}
        for rule in state.all("transition"):
            with self._or_lost(rule):
                if rule.children:
                    self._lose(rule, "what a history does where nothing is remembered")
                if self._parallel(rule.get("target")) is not state.parent:
                    found["initial"] = self._target(state, rule.get("target"))
        return found

    def _invoke(self, invoke: Element) -> dict[str, Any]:
        """Return an operation; an invoke of another type has no equivalent."""
        if invoke.get("type") != _TYPE:
            raise _CannotSay(f"an invoke of type {invoke.get('type') or 'scxml'!r}")
        after, code = invoke.get(f"{_OURS}timeout"), invoke.get(f"{_OURS}timeout.code")
        tries = {word: invoke.get(_OURS + word) for word in ("attempts", "backoff", "factor", "jitter")}
        retry: dict[str, Any] = {word: _measure(text) for word, text in tries.items() if text}
        retry |= _slim({"unless": invoke.get(f"{_OURS}unless").split()})
        timeout = {"after": _measure(after), "code": code} if after else "never"
        given = {"do": invoke.get(f"{_OURS}do"), "with": self._params(invoke), "timeout": timeout}
        return _slim({**given, "retry": retry})

    def _transitions(self, state: Element, timers: _Timers) -> dict[str, Any]:
        """Return the transitions of a state by keyword, those of `on` and `after` also by event or delay."""
        done = f"done.state.{state.get('id')}"
        inner = {f"done.state.{other.get('id')}" for other in state.every(*_STATES)} - {done}
        outer = [rule for around in state.around for rule in around.all("transition") if done in _split(rule)]
        rules: dict[tuple[str, str], list[Any]] = {}
        for rule in (*state.all("transition"), *outer):
            with self._or_lost(rule):
                said = self._transition(state, rule)
                for event in [done] if rule in outer else _split(rule) or [""]:
                    for place in () if event in inner else self._places(state, event, timers):
                        before = rules.setdefault(place, [])
                        if not before or before[-1].get("guard") not in (None, said.get("guard")):
                            before.append(said)
                        elif event != "*":
                            self._tell(rule, f"a transition on {event!r} that is never taken is left out")
        for delay, events in () if self._own else timers.items():
            rules.setdefault(("after", delay), [{"do": [{"raise": {"event": event}} for event in events]}])
        found: dict[str, Any] = {}
        for (word, name), those in sorted(rules.items(), key=lambda item: item[0][1] == "*"):
            short = [rule["target"] if rule.keys() == {"target"} else rule for rule in those]
            told = short[0] if len(short) == 1 else short
            found[word] = {**found.get(word, {}), name: told} if name else told
        return found

    def _places(self, state: Element, event: str, timers: _Timers) -> Iterator[tuple[str, str]]:
        """Yield each keyword, with its event or delay, under which a transition on `event` is written.

        An event descriptor is written under each event that it matches, so that document order decides.
        """
        name, own = _event(event), state.get("id")
        keywords = {"": "always", f"done.state.{own}": "on_done"}
        keywords |= {f"done.invoke.{own}-operation": "on_done", f"error.invoke.{own}-operation": "on_error"}
        timer = next((delay for delay, events in timers.items() if name in events), None)
        if event in keywords:
            yield keywords[event], ""
        elif name.split(".")[0] in ("done", "error"):
            raise _CannotSay(f"a transition on {event!r}, of another state or of the engine,")
        elif timer is not None and (self._own or self._heard_by(name) | self._listening["*"] == {state}):
            yield "after", timer
        elif name == "*":
            listed = {_event(each) for rule in state.all("transition") for each in _split(rule)}
            yield from (("on", other) for other in (*sorted(listed & self._events), "*"))
        else:
            matched = [] if self._own else self._matched[name]
            yield from (("on", other) for other in matched or [name])

    def _heard_by(self, event: str) -> set[Element | None]:
        """Return the states with a transition on an event, other than by `*`."""
        return {state for descriptor in _descriptors(event) for state in self._listening[descriptor]}

    def _transition(self, state: Element, rule: Element) -> dict[str, Any]:
        target, cond = rule.get("target"), rule.get("cond")
        found = {
            "target": target and self._target(state, target),
            "guard": cond and self._expression(cond),
            **{word: rule.get(_OURS + word) for word in ("refuse", "code")},
            **{word: rule.get(_OURS + word).split() for word in ("during", "releases")},
            "internal": (target and rule.get("type") == "internal") or None,
        }
        return _slim({**found, "do": [] if found["refuse"] else self._actions(rule.children)})

    def _actions(self, block: Iterable[Element], timers: _Timers | None = None) -> list[Any]:
        """Return the actions of a block; in an `onentry`, delayed events are added to `timers` by delay."""
        found: list[Any] = []
        for action in block:
            with self._or_lost(action):
                found += self._action(action, timers)
        return found

    def _action(self, action: Element, timers: _Timers | None) -> list[Any]:
        match action.kind:
            case "raise":
                return [{"raise": {"event": _event(action.get("event"))}}]
            case "assign" if action.get("location") in self._variables:
                value = self._value(action.get("expr") or action.text)
                return [{"set": {self._variables[action.get("location")]: value}}]
            case "send":
                return self._send(action, timers)
            case "if":
                return self._if(action.get("cond"), action.children)
            case "log":
                return []
            case "cancel" if self._ends_timer(action):
                self._tell(action, f"cancel of {action.get('sendid')!r}: a timer ends when its state is left")
                return []
        raise _CannotSay(f"<{action.kind.rpartition(' ')[2]}> {action.get('location')}".strip())

    def _ends_timer(self, cancel: Element) -> bool:
        """Say whether a `cancel` of an `onexit` is of a `send` in the same state's `onentry`."""
        block, state, *_ = cancel.around
        sent = {send.get("id") for entry in state.all("onentry") for send in entry.all("send")}
        return block.kind == "onexit" and cancel.get("sendid") in sent

    def _send(self, send: Element, timers: _Timers | None) -> list[Any]:
        if send.get("type") == _TYPE:
            params = self._params(send)
            return [{send.get("event"): params} if params else send.get("event")]
        to = send.get("target") or send.get("targetexpr")
        if to not in ("", "#_internal") or not send.get("event") or send.get("type") not in _PROCESSORS:
            raise _CannotSay("a send to others")
        event, given = _event(send.get("event")), self._params(send)
        literal, computed = send.get("delay"), send.get("delayexpr").strip()
        if not literal and not computed:
            if not to:
                self._tell(send, f"send of {event!r} is a raise: dealt with before what comes from outside")
            return [{"raise": _slim({"event": event, "with": given})}]
        if timers is None or given:
            raise _CannotSay("a delayed send that is no plain one of `onentry`")
        if not literal and _QUOTED.fullmatch(computed):
            literal = computed[1:-1]
        delay = _measure(literal) if literal else f"${{ {self._expression(computed)} }}"
        state = send.around[1]
        if any(heard and state not in (heard, *heard.around) for heard in self._heard_by(event)):
            raise _CannotSay(f"a delayed send of {event!r}, which is waited for outside of its state,")
        if not send.get("event").startswith("after."):
            self._tell(send, f"send of {event!r} after {delay}: leaving the state ends it")
        timers.setdefault(delay, []).append(event)
        return []

    def _if(self, cond: str, content: list[Element]) -> list[Any]:
        """Return an `if`, or the actions of an `else`, which has no condition."""
        end = next((i for i, child in enumerate(content) if child.kind in ("elseif", "else")), len(content))
        other = self._if(content[end].get("cond"), content[end + 1 :]) if content[end:] else []
        then = self._actions(content[:end])
        if not cond:
            return then
        return [{"if": _slim({"guard": self._expression(cond), "then": then, "else": other})}]


def _word(text: str) -> str:
    """Return a name that the language accepts."""
    found = re.sub(r"\W", "_", text, flags=re.ASCII)
    return found if found[:1].isalpha() else f"x{found}"


def _split(rule: Element) -> list[str]:
    """Return the event descriptors of a transition."""
    return rule.get("event").split()


def _event(text: str) -> str:
    """Return an event's name, or a descriptor without its `.*` or `.` at the end, which has no meaning."""
    text = re.sub(r"\.\*?$", "", text.strip())
    return "*" if text == "*" else ".".join(_word(word) for word in text.split("."))


def _descriptors(event: str) -> Iterator[str]:
    """Yield the event descriptors that match an event, other than `*`: `a`, `a.b` of `a.b`."""
    return accumulate(event.split("."), "{}.{}".format)


def _measure(text: str) -> str:
    """Return a duration as number and unit, and any other expression as `${ ... }`."""
    found = _DELAY.fullmatch(text.strip())
    return f"{float(found[1]):g} {'min' if found[2] == 'm' else found[2]}" if found else f"${{ {text} }}"


def _slim(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is not empty."""
    return {key: value for key, value in given.items() if value not in (None, "", [], {})}
