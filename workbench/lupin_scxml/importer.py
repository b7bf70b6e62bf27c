"""Converts an SCXML document to a mission; parts without equivalent are left out and noted with their lines.

State ids become upper case, those of final states lower case; a character that no name may have becomes `_`.
Where the meaning differs, the nearest construct is written, and usually noted:

* an `initial` with actions, or whose target is no direct child, becomes a state `begin` with an `always`;
* a transition on `done.state.ID` of a descendant becomes the `on_done` of that descendant;
* for content, sends, variables, events and targets see their modules.

A document that the engine itself exported has its namespace: there, names stay and its attributes are read.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from lupin_engine.errors import UsageError
from lupin_scxml.content import TYPE, AfterEntry, Content
from lupin_scxml.data import DataModel, measure
from lupin_scxml.elements import OURS, Element, elements
from lupin_scxml.events import REGIONS, STATES, Events, Seen, snake, split
from lupin_scxml.notes import AlwaysFails, CannotSay, Note, Notes
from lupin_scxml.sends import DelayedSends
from lupin_scxml.targets import Targets, first_way

#: So many transitions are written, on each event that a descriptor covers one.
MAX_WRITTEN = 20_000


class Imported(NamedTuple):
    """A mission as YAML data, the ids that were renamed, and the notes by line.

    `binding` declares the events from outside; it is empty if there are none.
    """

    mission: dict[str, Any]
    names: Mapping[str, str]
    notes: tuple[Note, ...]
    binding: dict[str, Any]


def from_scxml(text: bytes, name: str, binding: str = "") -> Imported:
    """Return the mission that an SCXML document describes.

    Args:
        text: the document.
        name: the mission's name.
        binding: the name of a binding for events from outside; without one, they stay as they are.

    Raises:
        UsageError: it is no XML, no SCXML, or too large.
    """
    return _Importer(elements(text), OURS.strip().encode() in text, binding).mission(name)


class _Importer:
    def __init__(self, root: Element, own: bool, binding: str) -> None:
        self._root = root
        self._binding = binding
        self._own = own
        self._notes = Notes()
        if own:
            text = "'lupin diagram' wrote this: the lifecycle comes in as states, without what it declares"
            self._notes.note(root, f"{text}; rather use the mission's own file")
        self._names: dict[Element, str] = {}
        self._written = 0
        self._name_states(root, set())
        self._targets = Targets(root, self._names)
        self._events = Events(root, own, binding)
        names = {old: self._names[state] for old, state in self._targets.states.items()}
        self._data = DataModel(root, own, self._events, names, self._notes)
        self._content = Content(own, self._events, self._data, Notes())
        self._find_errors()
        self._content = Content(own, self._events, self._data, self._notes)
        self._sends = DelayedSends(root, own, self._events)
        self._content.sends = self._sends

    def _find_errors(self) -> None:
        """Convert all content once, to find the parts that are always errors."""
        if not self._own:
            for block in self._root.every("onentry", "onexit", "transition"):
                state = block.around[0]
                seen = (
                    self._events.seen_in(state, self._targets.ways.get(state, ()))
                    if block.kind == "onentry"
                    else None
                )
                self._content.block(block.children, seen, {})
            for data in self._root.every("donedata"):
                self._result(data)

    def mission(self, name: str) -> Imported:
        inside = self._inside(self._root)
        clocks = {region.name: region.state() for region in self._sends.regions.values() if region.delay}
        if clocks:
            inside = self._with_clocks(inside, clocks)
        entry = [] if self._own else [*self._data.beginning(), *self._top_scripts()]
        for script in self._root.all("script") if self._own else ():
            self._notes.lose(script, "a script")
        head = {"mission": name, **_slim({"context": self._data.context(), "entry": entry})}
        states = {old: self._names[state] for old, state in self._targets.states.items()}
        variables = {old: variable.name for old, variable in self._data.variables.items()}
        renamed = {old: new for old, new in (*states.items(), *variables.items()) if old != new}
        return Imported({**head, **inside}, renamed, self._notes.sorted(), self._outside())

    def _outside(self) -> dict[str, Any]:
        """Return a binding that declares the events from outside."""
        events = {}
        for event, fields in self._events.outside.items():
            name = event.partition(".")[2]
            kind = "String" if fields else "Empty"
            topic = {"name": f"/{self._binding}/{name}", "type": f"std_msgs/msg/{kind}"}
            found = {field: {"type": "any", "from": "${ message.data }"} for field in sorted(fields)}
            summary = f"The event {self._events.original(event)} of the chart."
            events[name] = _slim({"summary": summary, "topic": topic, "fields": found})
        summary = "What the chart hears from outside; say which topics tell of it."
        return {"binding": self._binding, "summary": summary, "events": events} if events else {}

    def _top_scripts(self) -> list[Any]:
        return self._content.block(self._root.all("script"), None)

    def _with_clocks(self, inside: dict[str, Any], clocks: dict[str, Any]) -> dict[str, Any]:
        """Put all but final states into a region, beside one for each delay that outlives its state."""
        finals = {self._names[final] for final in self._root.all("final")}
        states = {name: state for name, state in inside["states"].items() if name not in finals}
        chart = {**inside, "states": states}
        taken = set(self._names.values())
        whole, part = (_free(name, taken) for name in ("RUNNING", "CHART"))
        around = {whole: {"type": "parallel", "states": {part: chart, **clocks}}}
        return {
            "initial": whole,
            "states": around | {n: s for n, s in inside["states"].items() if n in finals},
        }

    def _name_states(self, parent: Element, taken: set[str]) -> None:
        for state in parent.all(*STATES):
            whole = state.get("id") or f"{parent.get('id') or 'chart'}_{state.kind}"
            name = whole.removeprefix(parent.get("id"))
            # The id of a state may begin with that of the state around it.
            name = name.lstrip("-.:") if parent.get("id") and name[:1] in ("-", ".", ":") else whole
            if not self._own:
                names = [
                    snake(text) if state.kind == "final" else snake(text).upper() for text in (name, whole)
                ]
                name = _free(next((one for one in names if one not in taken), names[0]), taken)
            taken.add(name)
            self._names[state] = name
            self._name_states(state, taken)

    # -- states ---------------------------------------------------------------------------------------------

    def _inside(self, parent: Element) -> dict[str, Any]:
        """Return `initial` and `states` of a state or of the document."""
        states: dict[str, Any] = {}
        for child in parent.all(*STATES):
            states |= (
                self._history(child) if child.kind == "history" else {self._names[child]: self._state(child)}
            )
        first = [self._names[child] for child in parent.all(*REGIONS)]
        rule = first_way(parent)
        wanted = (rule and rule.get("target")) or parent.get("initial")
        initial = None
        if parent in self._targets.begins:
            initial = self._names[self._targets.begins[parent]]
            self._notes.note(
                parent, f"{self._names[parent]!r} begins with {initial!r}, for nothing else begins there"
            )
        elif wanted and parent.kind != "parallel":
            with self._notes.or_lost(parent, " as the beginning"):
                initial = self._targets.path(parent, wanted)
                initial, states = self._beginning(parent, wanted, initial, states)
        elif len(first) > 1 and parent.kind != "parallel":
            initial = first[0]
        if ways := self._targets.forked_to(parent):
            initial, begin = self._begin_of_fork(parent, ways, initial or first[0], set(states))
            states = {initial: begin, **states}
        return _slim({"initial": initial, "states": states})

    def _beginning(
        self, parent: Element, wanted: str, initial: str, states: dict[str, Any]
    ) -> tuple[str, dict[str, Any]]:
        """Return the initial state, and the states with one more where the first needs a transition."""
        rule = first_way(parent)
        actions = self._content.block(rule.children, None) if rule else []
        actions += self._fork(wanted)
        for child in () if actions else parent.all(*REGIONS):
            if any(state.get("id") == wanted for state in self._targets.begun(child)):
                initial = self._names[child]  # it begins there anyway
        if not actions and "." not in initial and states.get(initial, {}).get("type") != "history":
            return initial, states
        helper = _free("begin", set(states))
        return helper, {helper: {"always": _short({"target": initial, "do": actions})}, **states}

    def _fork(self, ids: str) -> list[Any]:
        """Return the actions that choose the initial children of a parallel state's regions."""
        fork = self._targets.forks.get(" ".join(ids.split()), {})
        chosen = {
            self._data.way_into(self._names[region]): target.get("id") for region, target in fork.items()
        }
        return [{"set": chosen}] if chosen else []

    def _begin_of_fork(
        self, region: Element, ways: list[Element], otherwise: str, taken: set[str]
    ) -> tuple[str, dict[str, Any]]:
        """Return the initial state of a region that forks lead into, and its name."""
        way = self._data.way_into(self._names[region])
        rules: list[Any] = [
            {
                "target": self._targets.path(region, target.get("id")),
                "guard": f"{way} == {target.get('id')!r}",
                "do": [{"set": {way: ""}}],
            }
            for target in ways
        ]
        name = _free("begin", taken)
        text = f"several targets at once lead into {self._names[region]!r}: it begins with {name!r}, which"
        self._notes.note(region, f"{text} goes on to the one that the variable {way!r} has")
        return name, {"always": [*rules, otherwise]}

    def _state(self, state: Element) -> dict[str, Any]:
        found: dict[str, Any] = {} if state.kind == "state" else {"type": state.kind}
        found |= self._inside(state)
        after: AfterEntry = {}
        seen = self._events.seen_in(state, self._targets.ways.get(state, ()))
        entry = [
            a for block in state.all("onentry") for a in self._content.block(block.children, seen, after)
        ]
        leave = [a for block in state.all("onexit") for a in self._content.block(block.children, None)]
        if leave and state.kind == "final":
            self._notes.lose(state, "what an end does when it is left")
            leave = []
        result: dict[str, Any] = {}
        for element in state.all("donedata"):
            result, failed = self._result(element)
            entry += failed
        event = self._events.end_events.get(state.parent) if state.kind == "final" and state.parent else None
        if event:
            entry.append({"raise": _slim({"event": event, "with": result})})
            result = {}
        found |= _slim({"entry": entry, "exit": leave, "result": result})
        for invoke in state.all("invoke"):
            with self._notes.or_lost(invoke):
                found["invoke"] = self._invoke(invoke)
        if state.kind == "final" and state.parent is not None and state.parent.kind == "parallel":
            text = "a final region: the parallel state is over as it is entered, with all its regions"
            self._notes.note(state, text)
        for model in state.all("datamodel"):
            self._notes.note(model, "variables of a state are variables of the mission")
        return found | self._transitions(state, after)

    def _result(self, data: Element) -> tuple[dict[str, Any], list[Any]]:
        """Return an end's result, and the actions for one that is always an error."""
        try:
            with self._notes.or_lost(data):
                return self._content.params(data, None), []
        except AlwaysFails as problem:
            return {}, self._content.failure(data, problem)
        return {}, []

    def _history(self, state: Element) -> dict[str, Any]:
        """Return a history; one with actions by default leads to a state that has them."""
        name, parent = self._names[state], state.around[0]
        found: dict[str, Any] = {"type": "history", "depth": state.get("type") or "shallow"}
        states = {name: found}
        for rule in state.all("transition"):
            with self._notes.or_lost(rule):
                if self._fork(rule.get("target")):
                    raise CannotSay(f"several targets of a history ({rule.get('target')})")
                actions = self._content.block(rule.children, None)
                if actions:
                    found["initial"] = _free(f"{name}_begin".lower(), set(self._names.values()))
                    way = {"target": self._targets.path(parent, rule.get("target")), "do": actions}
                    states[found["initial"]] = {"always": way}
                elif self._targets.together(rule.get("target")) is not parent:
                    found["initial"] = self._targets.path(state, rule.get("target"))
        return states

    def _invoke(self, invoke: Element) -> dict[str, Any]:
        """Return an operation; an invoke of another type has no equivalent."""
        if invoke.get("type") != TYPE:
            raise CannotSay(f"an invoke of type {invoke.get('type') or 'scxml'!r}")
        after, code = invoke.get(f"{OURS}timeout"), invoke.get(f"{OURS}timeout.code")
        tries = {key: invoke.get(OURS + key) for key in ("attempts", "backoff", "factor", "jitter")}
        retry: dict[str, Any] = {key: measure(text) for key, text in tries.items() if text}
        retry |= _slim({"unless": invoke.get(f"{OURS}unless").split()})
        timeout = {"after": measure(after), "code": code} if after else "never"
        given = {
            "do": invoke.get(f"{OURS}do"),
            "with": self._content.params(invoke, None),
            "timeout": timeout,
        }
        update = invoke.get(f"{OURS}update")
        return _slim({**given, "retry": retry, "update": measure(update) if update else ""})

    # -- transitions ----------------------------------------------------------------------------------------

    def _transitions(self, state: Element, after: AfterEntry) -> dict[str, Any]:
        """Return the transitions of a state by keyword, those of `on` and `after` also by event or delay."""
        done = f"done.state.{state.get('id')}"
        outer = [rule for around in state.around for rule in around.all("transition") if done in split(rule)]
        if state in self._events.end_events:
            outer = []
        rules: dict[tuple[str, str], list[Any]] = {}
        waiting = [(rule, event) for rule in state.all("transition") for event in split(rule) or [""]]
        for rule, event in (*waiting, *((rule, done) for rule in outer)):
            with self._notes.or_lost(rule):
                self._add_rule(rules, state, rule, event, after)
        for delay, events in () if self._own else after.items():
            rules.setdefault(("after", delay), [{"do": [{"raise": written} for written in events]}])
        found: dict[str, Any] = {}
        for (key, name), those in sorted(rules.items(), key=lambda item: item[0][1] == "*"):
            short = [_short(rule) for rule in those]
            written = short[0] if len(short) == 1 else short
            found[key] = {**found.get(key, {}), name: written} if name else written
        return found

    def _add_rule(
        self,
        rules: dict[tuple[str, str], list[Any]],
        state: Element,
        rule: Element,
        event: str,
        after: AfterEntry,
    ) -> None:
        """Add a transition's rule for one of its events."""
        for key, name in self._places(state, event, after):
            self._count(rule)
            seen = frozenset({name}) if event == "*" and name != "*" else self._events.seen_by(event)
            try:
                said = self._transition(state, rule, seen)
            except AlwaysFails as problem:
                if self._events.heard_by("failed.execution"):
                    raise CannotSay(f"a condition that is always an error ({problem})") from None
                self._notes.note(rule, f"a transition whose condition is an error ({problem}) is never taken")
                return
            if said.get("guard") == "false":
                self._notes.note(rule, "a transition whose condition is always false is left out")
                return
            before = rules.setdefault((key, name), [])
            if not before or before[-1].get("guard") not in (None, said.get("guard")):
                before.append(said)
            elif event != "*":
                self._notes.note(rule, f"a transition on {event!r} that is never taken is left out")

    def _count(self, rule: Element) -> None:
        """Count a written transition.

        Raises:
            UsageError: there are more than `MAX_WRITTEN`.
        """
        self._written += 1
        if self._written > MAX_WRITTEN:
            problem = f"more than {MAX_WRITTEN} transitions, one for each event that a descriptor covers"
            raise UsageError(f"line {rule.line}: {problem}")

    def _places(self, state: Element, event: str, after: AfterEntry) -> Iterator[tuple[str, str]]:
        """Yield each keyword, with its event or delay, for a transition on `event`.

        A descriptor is written under each event that it matches, so that document order decides.
        """
        name = self._events.name(event) if event else ""
        keywords = _keywords(state)
        timer = next(
            (delay for delay, raised in after.items() if name in (one["event"] for one in raised)), None
        )
        if self._events.end(event):
            yield "on", self._events.end(event)
        elif event in keywords:
            yield keywords[event], ""
        elif event.startswith("done.state.") and self._is_within(event.removeprefix("done.state."), state):
            return  # written as `on_done` of that state
        elif event.partition(".")[0] == "done" or (self._own and event.partition(".")[0] == "error"):
            raise CannotSay(f"a transition on {event!r}, of another state or of the engine,")
        elif event.partition(".")[0] == "error":
            yield from self._errors(state, event)
        elif timer is not None and self._is_only_timer(state, name, after[timer]):
            yield "at" if self._own and name.startswith("at.") else "after", timer
        elif name in self._sends.ticks.get(state, {}):
            yield "every", self._content.delay(self._sends.ticks[state][name], None)
        elif name == "*":
            yield from (("on", other) for other in self._any(state, after))
        elif matched := self._events.matched(event):
            yield from (("on", other) for other in matched)
        elif name not in self._events.never:
            yield "on", name

    def _is_within(self, id: str, state: Element) -> bool:
        inner = self._targets.states.get(id)
        return inner is not None and state in inner.around

    def _is_only_timer(self, state: Element, event: str, raised: list[dict[str, Any]]) -> bool:
        """Return whether a delayed event is only the deadline of the state that sends it."""
        if self._own:
            return True
        heard = self._events.heard_by(event) | self._events.listening["*"]
        return heard == {state} and raised == [{"event": event}] and self._events.is_sent_once(event)

    def _any(self, state: Element, after: AfterEntry) -> Iterator[str]:
        """Yield the events that `*` is written under: those of the document, no operator's requests."""
        clocks = {raised[0]["event"]: raised for raised in after.values()}
        for event in self._events.all if not self._own else ["*"]:
            is_clock = event in clocks and self._is_only_timer(state, event, clocks[event])
            if not is_clock and event not in self._sends.ticks.get(state, {}):
                yield event

    def _errors(self, state: Element, event: str) -> Iterator[tuple[str, str]]:
        matched = self._events.matched(event)
        if not matched or event in ("error", "error.execution", "error.*"):
            rule = next(rule for rule in state.all("transition") if event in split(rule))
            text = f"{event!r}: what fails only when the mission runs leads to FAULT instead"
            self._notes.note_once(rule, text)
        yield from (("on", other) for other in matched)

    def _transition(self, state: Element, rule: Element, seen: Seen) -> dict[str, Any]:
        target, cond = rule.get("target"), rule.get("cond")
        found = {
            "target": target and self._targets.path(state, target),
            "guard": cond and self._data.condition(cond, seen),
            **{key: rule.get(OURS + key) for key in ("refuse", "code")},
            **{key: rule.get(OURS + key).split() for key in ("during", "releases")},
            "internal": (target and rule.get("type") == "internal") or None,
        }
        if found["guard"] == "true":
            found["guard"] = ""
        actions = [] if found["refuse"] else self._content.block(rule.children, seen)
        return _slim({**found, "do": [*actions, *self._fork(target)]})


def _keywords(state: Element) -> dict[str, str]:
    """Return the keyword of each event that the end of a state or of its operation raises."""
    own = state.get("id")
    keywords = {"": "always", f"done.state.{own}": "on_done"}
    keywords |= {f"done.invoke.{own}-operation": "on_done", f"error.invoke.{own}-operation": "on_error"}
    if not any(one.all("final") for one in state.every("state") if one is not state):
        keywords |= dict.fromkeys(("done", "done.state"), "on_done")  # only it can be done
    return keywords


def _short(rule: Mapping[str, Any]) -> Any:
    """Return a transition; in short form if it only has a target."""
    found = _slim(rule)
    return found["target"] if found.keys() == {"target"} else found


def _free(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    return name


def _slim(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries that are not empty."""
    return {key: value for key, value in given.items() if value not in (None, "", [], {})}
