"""A chart of others, written in SCXML, as a mission: what can be said in the language, and the rest by line.

Names are mapped: states in upper case, ends in lower case, letters that a name cannot have to `_`. Where
SCXML and the language differ, an idiom stands for what is meant, and a note says so:

* a delayed `send` of a state is an `after` of it, so leaving the state ends it;
* a `send` to the chart itself is a `raise`, which is dealt with before what comes from outside;
* an `initial` that leads further in, or does something, is a helper state `begin` with an `always`;
* the end of a state that a state around it waits for is the `on_done` of the one that ends.
"""

from __future__ import annotations

import ast
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from lupin_engine.missions.scxml_elements import Element, elements

_OURS = "urn:lupin-engine:chart "
_STATES = ("state", "parallel", "final", "history")
_TYPE = "x-lupin"
_DELAY = re.compile(r"(\d*\.?\d+)\s*(ms|s|min|m|h)")
_UNITS = {"ms": "ms", "s": "s", "min": "min", "m": "min", "h": "h"}
_TEXT = re.compile(r"('[^']*'|\"[^\"]*\")")
#: What ECMAScript and others write where the language has a word.
_SIGNS = (
    (re.compile(r"===?"), "=="),
    (re.compile(r"!==?"), "!="),
    (re.compile(r"&&"), " and "),
    (re.compile(r"\|\|"), " or "),
    (re.compile(r"!(?!=)"), " not "),
    (re.compile(r"\b_event\.data\."), "event."),
    (re.compile(r"\bIn\("), "in_state("),
    (re.compile(r"\bTrue\b"), "true"),
    (re.compile(r"\bFalse\b"), "false"),
)
#: Of expressions of others what has no word here.
_FOREIGN = re.compile(r"[?;{}]|\b(_\w+|typeof|function|new|null|undefined|None)\b|\.\w+\(")


class Note(NamedTuple):
    """What could not be said as it stands, or not at all (`lost`)."""

    line: int
    text: str
    lost: bool


@dataclass
class Imported:
    """A mission as data, the names that were mapped, and what is to be said of it."""

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
    """What the language has no words for."""


class _Importer:
    def __init__(self, root: Element, own: bool) -> None:
        self._root = root
        self._own = own
        for content in [element for element in root.every() if element.kind == "content"]:
            content.children.clear()  # another chart, of which nothing is a part of this one
        self._notes: dict[Note, None] = {}
        self._states = {e.get("id"): e for e in root.every() if e.kind in _STATES and e.get("id")}
        self._variables = {e.get("id"): _word(e.get("id")) for e in root.every() if e.kind == "data"}
        self._names: dict[int, str] = {}
        self._name_states(root, set())
        sends = (e.get("event") for e in root.every() if e.kind in ("raise", "send") and e.get("event"))
        self._events = {_event(event) for event in sends}

    def mission(self, name: str) -> Imported:
        root = self._root
        result: dict[str, Any] = {"mission": name}
        context = dict(self._context())
        if context:
            result["context"] = context
        result |= self._inside(root)
        for element in root.all("script"):
            self._lose(element, "a script")
        mapped = {old: self._names[id(e)] for old, e in self._states.items() if old != self._names[id(e)]} | {
            old: new for old, new in self._variables.items() if old != new
        }
        return Imported(result, mapped, tuple(sorted(self._notes)))

    # -- what is said of it -----------------------------------------------------------------------------

    def _lose(self, element: Element, what: str) -> None:
        self._notes[Note(element.line, f"{what} cannot be said; it is left out", True)] = None

    def _tell(self, element: Element, text: str) -> None:
        self._notes[Note(element.line, text, False)] = None

    # -- names ------------------------------------------------------------------------------------------

    def _name_states(self, parent: Element, taken: set[str]) -> None:
        for state in parent.all(*_STATES):
            written = state.get("id") or f"{parent.get('id') or 'chart'}_{state.kind}"
            local = written.removeprefix(f"{parent.get('id')}-")
            if not self._own:
                local = _word(local).lower() if state.kind == "final" else _word(local).upper()
            while local in taken and not self._own:
                local += "_"
            taken.add(local)
            self._names[id(state)] = local
            self._name_states(state, taken)

    def _target(self, source: Element, ids: str) -> str:
        """Return a target as it is found from a state: from the nearest state around that holds it."""
        if " " in ids.strip():
            whole = self._parallel(ids)
            if whole is not None:
                return self._target(source, whole.get("id"))
            raise _CannotSay(f"several targets at once ({ids})")
        target = self._states.get(ids.strip())
        if target is None:
            raise _CannotSay(f"the target {ids!r}, which does not exist,")
        above = [target, *target.around]
        inner: list[Element] = []
        for scope in (source, *source.around):
            if scope in above[1:]:
                path = [self._names[id(e)] for e in reversed(above[: above.index(scope)])]
                if not any(self._names[id(e)] == path[0] for s in inner for e in s.all(*_STATES)):
                    return ".".join(path)
            inner.append(scope)
        raise _CannotSay(f"the target {ids!r}, whose name a nearer state has,")

    def _parallel(self, ids: str) -> Element | None:
        """Return the parallel state of which these are all regions."""
        wanted = {self._states.get(one) for one in ids.split()}
        around = {state.parent for state in wanted if state is not None}
        whole = around.pop() if len(around) == 1 else None
        if whole is None or whole.kind != "parallel":
            return None
        return (
            whole if wanted == {child for child in whole.all(*_STATES) if child.kind != "history"} else None
        )

    # -- expressions ------------------------------------------------------------------------------------

    def _expression(self, text: str) -> str:
        """Return an expression in the words of the language."""
        parts = _TEXT.split(" ".join(text.split()))
        for index in range(0, len(parts), 2):
            for sign, word in _SIGNS:
                parts[index] = sign.sub(word, parts[index])
            parts[index] = re.sub(r"\b[A-Za-z_]\w*", lambda m: self._variables.get(m[0], m[0]), parts[index])
        for index in range(1, len(parts), 2):
            if parts[index - 1].endswith("in_state("):
                state = self._states.get(parts[index][1:-1])
                parts[index] = repr(self._names[id(state)] if state else parts[index][1:-1])
        found = " ".join("".join(parts).split())
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                ast.parse(found, mode="eval")
            foreign = not self._own and any(map(_FOREIGN.search, parts[::2]))
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            foreign = True
        if foreign:
            raise _CannotSay(f"the expression {text!r}")
        return found

    def _value(self, text: str) -> Any:
        """Return what is written for a value: itself where it is written out."""
        found = self._expression(text)
        try:
            value = ast.literal_eval({"true": "True", "false": "False"}.get(found, found))
        except (ValueError, SyntaxError):
            return f"${{ {found} }}"
        return value

    def _context(self) -> Iterator[tuple[str, dict[str, Any]]]:
        for data in (e for e in self._root.every() if e.kind == "data"):
            try:
                value = self._value(data.get("expr") or data.text)
            except _CannotSay:
                value = None
            kinds = {bool: "bool", int: "number", float: "number", str: "text"}
            kind = kinds.get(type(value))
            if kind is None or (isinstance(value, str) and "${" in value):
                self._lose(data, f"the variable {data.get('id')!r} without a number, text or truth value")
            else:
                yield self._variables[data.get("id")], {"type": kind, "default": value}

    # -- states -----------------------------------------------------------------------------------------

    def _inside(self, parent: Element) -> dict[str, Any]:
        """Return `initial` and `states` of a state or of the document."""
        children = parent.all(*_STATES)
        states = {self._names[id(child)]: self._state(child) for child in children}
        found: dict[str, Any] = {}
        element = next(iter(parent.all("initial")), None)
        content = element.all("transition")[0] if element and element.all("transition") else parent
        wanted = content.get("target") or parent.get("initial")
        proper = [child for child in children if child.kind != "history"]
        if wanted and parent.kind != "parallel":
            try:
                path, actions = self._target(parent, wanted), self._actions(content) if element else []
                if actions or "." in path or self._states[wanted.strip()].kind == "history":
                    begin = "begin" if "begin" not in states else "begin_here"
                    states = {
                        begin: {"always": {"target": path, "do": actions} if actions else path},
                        **states,
                    }
                    path = begin
                found["initial"] = path
            except _CannotSay as problem:
                self._lose(parent, f"{problem} as the beginning")
        elif len(proper) > 1 and parent.kind != "parallel":
            found["initial"] = self._names[id(proper[0])]
        if states:
            found["states"] = states
        return found

    def _state(self, state: Element) -> dict[str, Any]:
        if state.kind == "history":
            return self._history(state)
        found: dict[str, Any] = {} if state.kind == "state" else {"type": state.kind}
        found |= self._inside(state)
        timers: dict[str, list[Any]] = {}
        entry = [a for e in state.all("onentry") for a in self._actions(e, timers)]
        left = [a for e in state.all("onexit") for a in self._actions(e)]
        if left and state.kind == "final":
            self._lose(state, "what an end does when it is left")
            left.clear()
        found |= _slim({"entry": entry, "exit": left})
        for invoke in state.all("invoke"):
            try:
                found["invoke"] = self._invoke(invoke)
            except _CannotSay as problem:
                self._lose(invoke, str(problem))
        for end in state.all("donedata"):
            try:
                found |= _slim({"result": self._params(end)})
            except _CannotSay as problem:
                self._lose(end, str(problem))
        for other in state.all("datamodel"):
            self._tell(other, "variables of a state are variables of the mission")
        self._transitions(state, found, timers)
        return found

    def _history(self, state: Element) -> dict[str, Any]:
        found = {"type": "history", "depth": state.get("type") or "shallow"}
        for rule in state.all("transition"):
            try:
                if rule.children:
                    self._lose(rule, "what a history does where nothing is remembered")
                if self._parallel(rule.get("target")) is not state.parent:
                    found["initial"] = self._target(state, rule.get("target"))
            except _CannotSay as problem:
                self._lose(rule, str(problem))
        return found

    def _transitions(self, state: Element, found: dict[str, Any], timers: dict[str, list[Any]]) -> None:
        """Add the transitions of a state to what is written of it, each under its word and its event."""
        written = state.all("transition")
        listens = {_event(event) for rule in written for event in rule.get("event").split()}
        ends = f"done.state.{state.get('id')}"
        outer = [rule for around in state.around for rule in around.all("transition")]
        rules: dict[tuple[str, str], list[Any]] = {}
        for rule in (*written, *(rule for rule in outer if ends in rule.get("event").split())):
            try:
                said = self._transition(state, rule)
                for event in rule.get("event").split() or [""]:
                    if self._inner(state, event) or (rule in outer and event != ends):
                        continue
                    for place in self._places(state, event, timers, listens):
                        before = rules.setdefault(place, [])
                        if before and before[-1].get("guard") in (None, said.get("guard")):
                            if event != "*":
                                self._tell(rule, f"a transition on {event!r} that is never taken is left out")
                        else:
                            before.append(said)
            except _CannotSay as problem:
                self._lose(rule, str(problem))
        for delay, events in () if self._own else timers.items():
            rules.setdefault(("after", delay), [{"do": [{"raise": {"event": event}} for event in events]}])
        for (word, name), those in sorted(rules.items(), key=lambda item: item[0][1] == "*"):
            plain = [rule["target"] if rule.keys() == {"target"} else rule for rule in those]
            told = plain[0] if len(plain) == 1 else plain
            if name:
                found.setdefault(word, {})[name] = told
            else:
                found[word] = told

    def _inner(self, state: Element, event: str) -> bool:
        """Say whether an event is the end of a state within this one."""
        ending = self._states.get(event.removeprefix("done.state."))
        return event.startswith("done.state.") and ending is not None and state in ending.around

    def _places(
        self, state: Element, event: str, timers: Mapping[str, Sequence[str]], listens: set[str]
    ) -> Iterator[tuple[str, str]]:
        """Yield the words, and with `on` and `after` the names, under which transitions on an event stand.

        A pattern stands under each event that it covers, so that their order stays that of the document.
        """
        name, own = _event(event), state.get("id")
        invoked = [f"{own}-operation"] if self._own else []
        timer = next((delay for delay, events in timers.items() if name in events), None)
        if not event:
            yield "always", ""
        elif event in (f"done.state.{own}", *(f"done.invoke.{one}" for one in invoked)):
            yield "on_done", ""
        elif event in [f"error.invoke.{one}" for one in invoked]:
            yield "on_error", ""
        elif name.split(".")[0] in ("done", "error"):
            raise _CannotSay(f"a transition on {event!r}, of another state or of the engine,")
        elif timer is not None and (self._own or self._heard_by(name) == [state]):
            yield "after", timer
        elif name == "*":
            yield from (("on", other) for other in sorted(listens & self._events))
            yield "on", "*"
        else:
            covered = sorted(e for e in self._events if e == name or e.startswith(f"{name}."))
            yield from (("on", other) for other in (not self._own and covered) or [name])

    def _heard_by(self, name: str, every: str = "*") -> list[Element]:
        found = []
        for rule in (e for e in self._root.every() if e.kind == "transition" and e.parent is not None):
            names = [_event(event) for event in rule.get("event").split()]
            if (
                any(name == n or n == every or name.startswith(f"{n}.") for n in names)
                and rule.parent not in found
            ):
                found.append(rule.parent)
        return [state for state in found if state is not None]

    def _transition(self, state: Element, rule: Element) -> dict[str, Any]:
        found: dict[str, Any] = {}
        if rule.get("target"):
            found["target"] = self._target(state, rule.get("target"))
        if rule.get("cond"):
            found["guard"] = self._expression(rule.get("cond"))
        for word in ("refuse", "code"):
            found |= _slim({word: rule.get(f"{_OURS}{word}")})
        for word in ("during", "releases"):
            found |= _slim({word: rule.get(f"{_OURS}{word}").split()})
        if rule.get("type") == "internal" and found.get("target"):
            found["internal"] = True
        found |= _slim({"do": [] if "refuse" in found else self._actions(rule)})
        return found

    def _invoke(self, invoke: Element) -> dict[str, Any]:
        """Return an operation of ours."""
        if invoke.get("type") != _TYPE:
            raise _CannotSay(f"an invoke of type {invoke.get('type') or 'scxml'!r}")
        after, code = invoke.get(f"{_OURS}timeout"), invoke.get(f"{_OURS}timeout.code")
        timeout = {"after": _measure(after), "code": code} if after else "never"
        tries = {word: invoke.get(f"{_OURS}{word}") for word in ("attempts", "backoff", "factor", "jitter")}
        retry = _slim({word: text and _measure(text) for word, text in tries.items()})
        retry |= _slim({"unless": invoke.get(f"{_OURS}unless").split()})
        given = {"do": invoke.get(f"{_OURS}do"), "with": self._params(invoke), "timeout": timeout}
        return _slim({**given, "retry": retry})

    # -- actions ----------------------------------------------------------------------------------------

    def _actions(self, block: Element, timers: dict[str, list[Any]] | None = None) -> list[Any]:
        found: list[Any] = []
        for action in block.children:
            try:
                found += self._action(action, timers)
            except _CannotSay as problem:
                self._lose(action, str(problem))
        return found

    def _action(self, action: Element, timers: dict[str, list[Any]] | None) -> list[Any]:
        match action.kind:
            case "raise":
                return [{"raise": {"event": _event(action.get("event"))}}]
            case "assign" if action.get("location") in self._variables:
                return [
                    {
                        "set": {
                            self._variables[action.get("location")]: self._value(
                                action.get("expr") or action.text
                            )
                        }
                    }
                ]
            case "send":
                return self._send(action, timers)
            case "if":
                return [self._if(action)]
            case "log":
                return []
            case "cancel" if self._ends_timer(action):
                self._tell(action, f"cancel of {action.get('sendid')!r}: a timer ends when its state is left")
                return []
        raise _CannotSay(f"<{action.kind.rpartition(' ')[2]}> {action.get('location')}".strip())

    def _ends_timer(self, cancel: Element) -> bool:
        """Say whether a state cancels on leaving what it sent on entering."""
        block, state = cancel.around[0], cancel.around[1]
        sent = [send for entry in state.all("onentry") for send in entry.all("send")]
        return block.kind == "onexit" and any(send.get("id") == cancel.get("sendid") for send in sent)

    def _send(self, send: Element, timers: dict[str, list[Any]] | None) -> list[Any]:
        if send.get("type") == _TYPE:
            params = self._params(send)
            return [{send.get("event"): params} if params else send.get("event")]
        to = send.get("target") or send.get("targetexpr")
        if to not in ("", "#_internal") or not send.get("event") or send.get("type") not in ("", *_PROCESSOR):
            raise _CannotSay("a send to others")
        event, given = _event(send.get("event")), self._params(send)
        if not send.get("delay") and not send.get("delayexpr"):
            if not to:
                self._tell(send, f"send of {event!r} is a raise: dealt with before what comes from outside")
            return [{"raise": _slim({"event": event, "with": given})}]
        if timers is None or given:
            raise _CannotSay("a delayed send that is no plain one of `onentry`")
        computed = send.get("delayexpr")
        literal = send.get("delay") or (computed.strip()[1:-1] if _TEXT.fullmatch(computed.strip()) else "")
        delay = _measure(literal) if literal else f"${{ {self._expression(computed)} }}"
        state = send.around[1]
        if any(heard is not state and state not in heard.around for heard in self._heard_by(event, "")):
            raise _CannotSay(f"a delayed send of {event!r}, which is waited for outside of its state,")
        if not send.get("event").startswith("after."):
            self._tell(send, f"send of {event!r} after {delay}: leaving the state ends it")
        timers.setdefault(delay, []).append(event)
        return []

    def _if(self, element: Element) -> dict[str, Any]:
        branches: list[tuple[str, list[Element]]] = [(element.get("cond"), [])]
        for child in element.children:
            if child.kind in ("elseif", "else"):
                branches.append((child.get("cond"), []))
            else:
                branches[-1][1].append(child)
        rest: list[Any] = []
        for condition, actions in reversed(branches):
            done = self._actions(Element("", {}, element.line, actions))
            if condition:
                guard = self._expression(condition)
                rest = [{"if": _slim({"guard": guard, "then": done, "else": rest})}]
            else:
                rest = done
        return dict(rest[0])

    def _params(self, element: Element) -> dict[str, Any]:
        for other in element.all("content"):
            raise _CannotSay(f"<content> in line {other.line}")
        if element.get("namelist"):
            return {
                self._variables.get(n, n): f"${{ {self._variables.get(n, n)} }}"
                for n in element.get("namelist").split()
            }
        return {
            _word(p.get("name")): self._value(p.get("expr") or p.get("location"))
            for p in element.all("param")
        }


_PROCESSOR = ("scxml", "http://www.w3.org/TR/scxml/#SCXMLEventProcessor")


def _word(text: str) -> str:
    """Return a name that the language takes."""
    found = re.sub(r"\W", "_", text, flags=re.ASCII)
    return found if found[:1].isalpha() else f"x{found}"


def _event(text: str) -> str:
    """Return the name of an event: words with dots; `a.*` and `a.` mean `a`."""
    text = re.sub(r"\.\*?$", "", text.strip())
    return "*" if text == "*" else ".".join(_word(word) for word in text.split("."))


def _measure(text: str) -> str:
    """Return a delay with its unit; anything else is an expression."""
    found = _DELAY.fullmatch(text.strip())
    return f"{float(found[1]):g} {_UNITS[found[2]]}" if found else f"${{ {text} }}"


def _slim(given: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in given.items() if value not in (None, "", [], {})}
