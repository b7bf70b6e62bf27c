"""Converts the executable content of an SCXML document to actions.

Content that SCXML always makes an error of (an undeclared variable, an invalid target) is written as the
event that it raises, `failed.execution`, and the rest of its block is left out, as there. Content that may
fail at run time leads to FAULT instead.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from lupin_scxml.data import DataModel, content_text, measure, spelled
from lupin_scxml.elements import OURS, Element
from lupin_scxml.events import PROCESSORS, QUOTED, Events, Seen, field, is_to_itself
from lupin_scxml.expressions import assignments, value_of
from lupin_scxml.notes import AlwaysFails, CannotSay, Notes
from lupin_scxml.sends import Delay, DelayedSends, Region, cancelled

TYPE = "x-lupin"
#: The most elements of a list that a `foreach` is written out for.
MAX_TURNS = 20
_PLACE = re.compile(r"[A-Za-z][\w+.-]*:|#_|basichttp$|x-", re.IGNORECASE)

#: The events that delayed sends of an `onentry` raise, by delay, with what each carries.
AfterEntry = dict[str, list[dict[str, Any]]]


class _Broken(Exception):
    """A <foreach> that ends by an error, with the actions before it."""

    def __init__(self, actions: list[Any]) -> None:
        super().__init__()
        self.actions = actions


class Content:
    """Converts executable content."""

    def __init__(self, own: bool, events: Events, data: DataModel, notes: Notes) -> None:
        """Make it for one document."""
        self._own = own
        self._events = events
        self._data = data
        self._notes = notes
        #: What becomes of sends; set when it is known what fails.
        self.sends: DelayedSends | None = None
        self._kinds: Mapping[str, Callable[[Element, Seen, AfterEntry | None], list[Any]]] = {
            "raise": self._raise,
            "assign": self._assign,
            "send": self._send,
            "if": self._if,
            "foreach": self._foreach,
            "script": self._script,
            "log": self._log,
            "cancel": self._cancel,
        }

    def block(self, actions: Iterable[Element], seen: Seen, after: AfterEntry | None = None) -> list[Any]:
        """Return the actions of a block; in an `onentry`, delayed events are added to `after` by delay."""
        return self._block(actions, seen, after)[0]

    def _block(
        self, actions: Iterable[Element], seen: Seen, after: AfterEntry | None
    ) -> tuple[list[Any], bool]:
        """Return actions, and whether the last of them is an error."""
        found: list[Any] = []
        rest = list(actions)
        while rest:
            action = rest.pop(0)
            try:
                with self._notes.or_lost(action):
                    if action.kind.endswith(" editorinfo"):  # where Qt's editor draws it
                        continue
                    if action.kind not in self._kinds:
                        raise CannotSay(f"<{action.kind.rpartition(' ')[2]}>")
                    found += self._kinds[action.kind](action, seen, after)
            except _Broken as broken:
                self._cut(rest)
                return [*found, *broken.actions], True
            except AlwaysFails as problem:
                if self._own:
                    self._notes.lose(action, f"<{action.kind}> {action.get('location')}".strip())
                    continue
                self._cut([action, *rest])
                return [*found, *self.failure(action, problem)], True
        return found, False

    def _cut(self, actions: Iterable[Element]) -> None:
        for action in actions:
            self._events.cut(action)

    def failure(self, element: Element, problem: AlwaysFails) -> list[Any]:
        """Return the event that SCXML raises for an always failing content, if anything reacts."""
        event = self._events.fails(element, problem.event)
        self._notes.note(
            element, f"{problem}: always an error, written as {event!r}; the rest of its block is left out"
        )
        heard = self._events.heard_by(event)
        return [{"raise": {"event": event, "with": {"detail": str(problem)}}}] if heard else []

    # -- what an event carries ------------------------------------------------------------------------------

    def params(self, element: Element, seen: Seen) -> dict[str, Any]:
        """Return the fields passed by `namelist`, the `param` elements and `content`."""
        listed = element.get("namelist").split()
        found = {field(name): f"${{ {self._data.location(name).name} }}" for name in listed}
        for param in element.all("param"):
            location = param.get("location")
            if location and not self._own:
                self._data.location(location)
            found[field(param.get("name"))] = self._data.value(param.get("expr") or location, seen)
        for content in element.all("content"):
            if self._own:
                raise CannotSay(f"<content> in line {content.line}")
            found["data"] = self._data.value(content.get("expr") or content_text(content), seen)
        return found

    # -- actions --------------------------------------------------------------------------------------------

    def _raise(self, action: Element, _: Seen, __: AfterEntry | None) -> list[Any]:
        event = self._events.name(action.get("event"))
        given = self._full(action, event, {})
        return [{"raise": {"event": event, **({"with": given} if given else {})}}]

    def _full(self, sender: Element, event: str, given: dict[str, Any]) -> dict[str, Any]:
        """Return the fields of an event; the language wants the same ones wherever it is raised."""
        fields = self._events.carried(frozenset({event})) or set()
        lacking = {name: self._data.lacking(event, name) for name in sorted(fields - given.keys())}
        known = {name: value for name, value in lacking.items() if value is not None}
        for name, value in {} if self._own else known.items():
            self._notes.note(
                sender, f"{event!r} carries {name} {spelled(value)} here, for it does so elsewhere"
            )
        return given if self._own else {**given, **known}

    def _assign(self, action: Element, seen: Seen, _: AfterEntry | None) -> list[Any]:
        return self._set(action.get("location"), action.get("expr") or action.text, seen)

    def _set(self, location: str, expression: str, seen: Seen) -> list[Any]:
        variable = self._data.variables.get(location.strip())
        if variable is not None and variable.type == "undefined":
            self._data.read(expression, seen)
            return []
        value = self._data.value(expression, seen, variable)
        return [{"set": {self._data.location(location).name: value}}]

    def _script(self, action: Element, seen: Seen, _: AfterEntry | None) -> list[Any]:
        if action.get("src"):
            raise CannotSay("a script")
        return [found for each in assignments(action.text) for found in self._set(*each, seen)]

    def _log(self, action: Element, seen: Seen, _: AfterEntry | None) -> list[Any]:
        label, text = action.get("label").strip().rstrip(":").strip(), action.get("expr")
        try:
            meaning = self._data.read(text, seen) if text else None
            shown = "" if meaning is None else value_of(meaning)
        except (CannotSay, AlwaysFails):
            self._notes.note(action, f"the log of {text!r} is left out")
            return []
        if meaning is not None and meaning.type != "text" and not label and str(shown).startswith("$"):
            label = " ".join(text.split())  # a text is wanted, and not a number alone
        shown = str(shown).lower() if isinstance(shown, bool) else str(shown)
        found = ": ".join(part for part in (label, shown) if part)
        return [{"report.note": {"text": found}}] if found and "\n" not in found else []

    def _if(self, action: Element, seen: Seen, _: AfterEntry | None) -> list[Any]:
        found, fails = self._branches(action.get("cond"), action.children, seen)
        if fails and action.parent is not None and action.parent.children[-1] is not action:
            raise CannotSay("an error in one branch of an <if>, which ends the block,")
        return found

    def _branches(self, cond: str, content: list[Element], seen: Seen) -> tuple[list[Any], bool]:
        """Return an `if`, or the actions of an `else`, and whether any of them always fails."""
        end = next((i for i, child in enumerate(content) if child.kind in ("elseif", "else")), len(content))
        other, fails = (
            self._branches(content[end].get("cond"), content[end + 1 :], seen)
            if content[end:]
            else ([], False)
        )
        then, breaks = self._block(content[:end], seen, None)
        if not cond:
            return then, breaks or fails
        guard = self._data.condition(cond, seen)
        if guard in ("true", "false"):
            self._cut(content[:end] if guard == "false" else content[end:])
            return (then, breaks) if guard == "true" else (other, fails)
        if not then and not other:
            return [], False
        if not then:
            guard, then, other = f"not ({guard})", other, []
        return [{"if": {"guard": guard, "then": then, **({"else": other} if other else {})}}], breaks or fails

    def _foreach(self, action: Element, seen: Seen, _: AfterEntry | None) -> list[Any]:
        """Unroll the loop; its list must be constant."""
        array, item, index = (action.get(name).strip() for name in ("array", "item", "index"))
        meaning = self._data.read(array, seen)
        if meaning.type and not meaning.type.startswith("list"):
            raise AlwaysFails(f"{array!r} is no list")
        if not re.fullmatch(r"[A-Za-z_$][\w$]*", item):
            raise AlwaysFails(f"{item!r} is no variable")
        variable = self._data.variables.get(array)
        elements = value_of(meaning) if variable is None else variable.default
        if not isinstance(elements, list) or (variable and self._data.is_changed(array)):
            raise CannotSay(f"a <foreach> over {array!r}, which is no list that stays the same,")
        if len(elements) > MAX_TURNS:
            raise CannotSay(f"a <foreach> over {len(elements)} elements")
        found: list[Any] = []
        counted = [(self._data.location(item).name, elements)]
        if index:
            counted.append((self._data.location(index).name, list(range(len(elements)))))
        self._notes.note(action, f"the turns of <foreach> over {array!r} are written one after the other")
        for turn in range(len(elements)):
            actions, fails = self._block(action.children, seen, None)
            found += [{"set": {name: values[turn] for name, values in counted}}, *actions]
            if fails:
                raise _Broken(found)
        return found

    def _cancel(self, action: Element, _: Seen, __: AfterEntry | None) -> list[Any]:
        sends = self.sends.stopped_by(action) if self.sends else []
        regions = [self.sends.regions[send] for send in sends if self.sends and send in self.sends.regions]
        name = cancelled(action)
        if not sends and not action.get("sendid"):
            raise CannotSay(f"<cancel> of {name!r}, which is known only when it is carried out,")
        if not regions:
            if sends and not self._own:
                self._notes.note_once(
                    action, "a cancel as the state is left is not written: its timers end then"
                )
            elif not self._own:
                self._notes.note(action, f"cancel of {name!r}: nothing is sent under that id")
            return []
        for region in regions:
            region.is_stopped = True
        words = dict.fromkeys(region.word for region in regions)
        return [{"raise": {"event": f"{each}.stop"}} for each in words]

    # -- sends ----------------------------------------------------------------------------------------------

    def _send(self, send: Element, seen: Seen, after: AfterEntry | None) -> list[Any]:
        if send.get(f"{OURS}at") and after is not None:
            time = self._time_of_day(send.get(f"{OURS}at"), seen)
            after.setdefault(time, []).append({"event": self._events.name(send.get("event"))})
            return []
        if send.get("type") == TYPE:
            params = self.params(send, seen)
            return [{send.get("event"): params} if params else send.get("event")]
        return self._send_to_itself(send, seen, after)

    def _send_to_itself(self, send: Element, seen: Seen, after: AfterEntry | None) -> list[Any]:
        """Return the actions for a `send` to the chart's own session.

        Raises:
            CannotSay: its event or its delay is known only when it is sent.
            AlwaysFails: it goes to another session or has a wrong type.
        """
        if not is_to_itself(send) or send.get("typeexpr"):
            raise self._elsewhere(send)
        events, given = self._events.raised_by(send), self.params(send, seen)
        if not events or (len(events) > 1 and DelayedSends.delay(send) != Delay()):
            raise CannotSay("a send of an event that is named when it is sent")
        event = next(iter(events.values()))
        given = self._full(send, event, given)
        raised = {"event": event, **({"with": given} if given else {})}
        kept = []
        if send.get("idlocation"):
            kept = self._set(send.get("idlocation"), repr(send.get("id") or send.get("event")), seen)
        wanted = self.sends.wanted(send) if self.sends else "raise"
        if wanted == "raise":
            if send.get("target") != "#_internal":
                meaning = "a send to the chart itself is a raise: dealt with before what comes from outside"
                self._notes.note_once(send, meaning)
            return [*kept, *self._chosen(send.get("eventexpr"), events, raised, seen)]
        if wanted == "tick":
            return kept
        return [*kept, *self._delayed(send, wanted, raised, seen, after)]

    def _delayed(
        self, send: Element, wanted: str, raised: dict[str, Any], seen: Seen, after: AfterEntry | None
    ) -> list[Any]:
        """Return the actions that start a delayed send; one that its state waits for is added to `after`."""
        delay = self.delay(send, seen)
        if wanted == "region" and self.sends is not None and send in self.sends.regions:
            return [self._started(send, self.sends.regions[send], delay, raised.get("with", {}))]
        if after is None or wanted != "after":
            raise CannotSay("a delayed send that is no plain one of `onentry`")
        if not self._own:
            self._notes.note_once(
                send, "a delayed send that its state waits for is `after`: leaving it ends it"
            )
        after.setdefault(delay, []).append(raised)
        return []

    def _chosen(
        self, variable: str, events: Mapping[str, str], raised: Mapping[str, Any], seen: Seen
    ) -> list[Any]:
        """Return actions that raise the event named by a variable: one `if` for each but the last."""
        *some, last = events.items()
        found: list[Any] = [{"raise": {**raised, "event": last[1]}}]
        for text, event in reversed(some):
            guard = self._data.condition(f"{variable} == {text!r}", seen)
            found = [{"if": {"guard": guard, "then": [{"raise": {**raised, "event": event}}], "else": found}}]
        return found

    def _elsewhere(self, send: Element) -> Exception:
        """Return the exception for a send to others: `AlwaysFails` for a wrong type, target or session."""
        to, kind = send.get("target"), send.get("type")
        if kind not in PROCESSORS and not _PLACE.match(kind):
            return AlwaysFails(f"{kind!r} is no type of a send")
        if to and not _PLACE.match(to):
            return AlwaysFails(f"{to!r} is no target of a send")
        if to.startswith("#_scxml_"):
            return AlwaysFails(f"there is no session {to!r}", "error.communication")
        return CannotSay("a send to others")

    def _time_of_day(self, text: str, seen: Seen) -> str:
        return text[1:-1] if QUOTED.fullmatch(text) else f"${{ {self._data.condition(text, seen)} }}"

    def delay(self, send: Element, seen: Seen) -> str:
        """Return the delay of a `send` in the language.

        Raises:
            CannotSay: it is no number with a unit, and no variable with one.
        """
        literal, computed = DelayedSends.delay(send)
        if literal or not computed:
            return measure(literal or "0s")
        if self._own:
            return f"${{ {self._data.condition(computed, seen)} }}"
        return self._data.delay(computed, seen)

    def _started(self, send: Element, region: Region, delay: str, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return the action that starts the clock of a region."""
        for name in given:
            if name not in region.kept:
                region.kept[name] = self._data.keep(region.event, name)
        region.delay = delay
        text = f"send of {region.event!r} after {delay} outlives its state: the region {region.name} waits"
        self._notes.note(
            send, f"{text}; a second send meanwhile starts its clock anew, where SCXML delivers both"
        )
        return {"raise": {"event": f"{region.word}.start", **({"with": dict(given)} if given else {})}}
