"""Exports a chart as SCXML 1.0, for other statechart tools: every state and transition, refusals too.

Expressions stay in the language of the chart, a small part of Python's. SCXML's extension points are used
where it has no word: an operation is an `invoke` of type `x-lupin`, actions and times of day are `send`s of
that type; a refusal is a transition that logs its code. Holds and itineraries are comments. Names have
hyphens instead of dots, which separate the parts of an event in SCXML.

The machine's additions to SCXML are made explicit: an input's level is a condition without an event, a hold
blocks eventless transitions by a condition, an unhandled error leads to FAULT, a mission begins with the
`initial` transition of its state, also an embedded one; an embedded mission's `request` is named after the
state that uses it. A history with `resume_at`, or of several levels, becomes transitions that ask which child
was left last (`left_STATE`). Known difference: where a `resume_at` holds in one region of a parallel state,
the document restarts its other regions.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from lupin_engine.chart import (
    FAULT,
    TIMERS,
    WRITING,
    ActionCall,
    Chart,
    Constant,
    Expression,
    Invoke,
    Kind,
    Prompt,
    Role,
    State,
    Timer,
    Transition,
    UnknownValue,
    Value,
    parts_of,
    walk,
)
from lupin_engine.diagram import LineRole, Picture, StateBox, escape, find_state, quoted
from lupin_engine.errors import UsageError

_NAMESPACES = 'xmlns="http://www.w3.org/2005/07/scxml" xmlns:lupin="urn:lupin-engine:chart"'
_TYPE = "x-lupin"
_ELEMENTS = {Kind.ATOMIC: "state", Kind.COMPOUND: "state", Kind.PARALLEL: "parallel", Kind.FINAL: "final"}
#: The request, where an expression reads a field of it.
_REQUEST = re.compile(r"(?<![\w.'])request(?=\.[A-Za-z])")
_IN_STATE = re.compile(r"in_state\('([^']+)'\)")


def scxml(picture: Picture) -> str:
    """Return the text of a picture; it must show the whole chart."""
    writer = _ScxmlWriter(picture)
    return "\n".join(['<?xml version="1.0" encoding="UTF-8"?>', *writer.document()]) + "\n"


class _ScxmlWriter:
    def __init__(self, picture: Picture) -> None:
        self._picture = picture
        self._chart: Chart = picture.chart
        self._defaults = {"param": {name: p.default for name, p in self._chart.parameters.items()}}
        self._uses = [state.name for state in self._chart.states.values() if state.use is not None]
        #: Of a state whose children history brings back one by one: where it is kept which was left last.
        self._left: dict[str, str] = {}
        self._ways = {
            state.name: tuple(self._ways_back(state))
            for state in self._chart.states.values()
            if state.kind is Kind.HISTORY
        }

    def document(self) -> Iterator[str]:
        """Yield the lines of the document."""
        root = self._chart.states[""]
        name = _attributes(name=self._picture.title, initial=_id(self._picture.initial))
        yield f'<scxml {_NAMESPACES} version="1.0" datamodel="python"{name}>'
        yield from (f"  <!-- {_comment(str(note))} -->" for note in self._picture.notes)
        data = [
            f"<data{_attributes(id=name, expr=_written(v.default))}/>"
            for name, v in self._chart.context.items()
        ]
        data += [f"<data{_attributes(id=name, expr=repr(''))}/>" for name in self._left.values()]
        yield from (f"  {line}" for line in _element("datamodel", {}, data))
        for box in self._picture.boxes:
            # The document itself has no transitions; one of its states is always active.
            yield from (f"  {line}" for line in self._box(box, root.transitions))
        yield "</scxml>"

    def _box(self, box: StateBox, more: Iterable[Transition] = ()) -> Iterator[str]:
        state = box.state
        if state.kind is Kind.HISTORY:
            yield from self._history(state)
            return
        inside = [f"<!-- {_comment(str(line))} -->" for line in box.lines if line.role is LineRole.NOTE]
        inside += [f"<!-- {_comment(str(line))} -->" for line in box.lines if str(line).startswith("resume")]
        if state.ask is not None:
            inside += self._ask(state.ask)
        wraps = state.parent is not None and self._chart.states[state.parent].slot
        begins = self._begin_mission(state) if wraps else self._begin_used(state)
        entry = () if wraps else state.entry
        inside += _element("onentry", {}, [*self._timers(state), *self._actions(entry)])
        sent = [self._timer(state, timer) for timer in _clocks(state)]
        sent += [f"{self._timer(state, timer)}.again" for timer in state.timers if timer.word == "every"]
        cancels = [f"<cancel{_attributes(sendid=each)}/>" for each in sent]
        inside += _element("onexit", {}, [*cancels, *self._actions(state.on_exit), *self._keep(state)])
        if begins:
            first = _element("transition", {"target": _id(box.initial)}, begins)
            inside += _element("initial", {}, first)
        inside += _element("donedata", {}, _params(state.result))
        for child in box.children:
            inside += [self._within(state, line) for line in self._box(child)]
        if state.kind is not Kind.FINAL:
            inside += self._ways_out(state, more)
        attributes = {"id": _id(state.name), "initial": None if begins else _id(box.initial)}
        yield from _element(_ELEMENTS[state.kind], attributes, inside)

    def _history(self, state: State) -> Iterator[str]:
        kind = "shallow" if state.depth == 1 else "deep"
        inside = [] if state.depth in (1, None) else [f"<!-- remembers {state.depth} levels -->"]
        inside.append(f"<transition{_attributes(target=self._begins(state))}/>")
        yield from _element("history", {"id": _id(state.name), "type": kind}, inside)

    def _ways_out(self, state: State, more: Iterable[Transition]) -> Iterator[str]:
        """Yield the transitions of a state, with further ones, and its operation."""
        for rule in (*state.transitions, *more):
            lines = self._transitions(state, rule)
            used = rule.id.startswith(f"{state.name}.use.")
            yield from (self._within(state, line) for line in lines) if used else lines
        if state.parent == "" and FAULT in self._chart.states and state.name != FAULT:
            yield f"<transition{_attributes(event='error', target=FAULT)}/>"
        if state.invoke is not None:
            yield from self._invoke(state, state.invoke)

    def _begins(self, state: State) -> str:
        """Return the default target of a history: its own, else the initial state of its parent."""
        parent = self._chart.states[state.parent or ""]
        if state.initial or parent.initial:
            return _id(state.initial or parent.initial)
        children = [
            _id(name) for name in parent.children if self._chart.states[name].kind is not Kind.HISTORY
        ]
        return " ".join(children if parent.kind is Kind.PARALLEL else children[:1])

    def _begin_mission(self, state: State) -> list[str]:
        """Return the actions of a mission's start, which a restore from history does not repeat."""
        variables = [name for name, v in self._chart.context.items() if v.of_mission]
        return [*self._anew(variables), *self._actions(state.entry)]

    def _begin_used(self, state: State) -> list[str]:
        """Return the actions of an embedded mission's start."""
        use = state.use
        if use is None:
            return []
        given = [
            f"<assign{_attributes(location=f'{_request(state)}.{name}', expr=_written(field.default))}/>"
            for name, field in use.request.items()
            if field.default is not None
        ]
        entry = [self._within(state, line) for line in self._actions(use.entry)]
        return [*given, *self._anew(use.variables), *entry]

    def _anew(self, variables: Iterable[str]) -> list[str]:
        values = ((name, self._chart.context[name].default) for name in variables)
        return [f"<assign{_attributes(location=name, expr=_written(value))}/>" for name, value in values]

    def _within(self, state: State, line: str) -> str:
        """Return a line of an embedded mission, with its `request` renamed."""
        return line if state.use is None else _REQUEST.sub(_request(state), line)

    # -- history ----------------------------------------------------------------------------------------

    def _ways_back(self, history: State) -> Iterator[tuple[str, str]]:
        """Yield conditions and targets of a transition to a history; the first that holds counts.

        As in `semantics`: the outermost state with a `resume_at` that holds, else the history value.
        """
        parent, depth = self._chart.states[history.parent or ""], history.depth
        found = [
            (state, below)
            for state, below in self._below(parent)
            if depth is None or below <= depth or self._of_used(state)
        ]
        for state, _ in found:
            for rule in state.resume_at if state.kind is Kind.COMPOUND else ():
                guard = self._condition(rule.guard.source)
                yield _all_of([*self._was_in(state, parent), guard]), _id(rule.target)
        inner = [state for state, below in found if depth is not None and below > depth]
        if depth in (1, None) and not inner:
            yield "", _id(history.name)
            return
        for state, below in sorted(found, key=lambda one: -one[1]):
            if below == depth or not state.children or (state in inner and self._is_used(state)):
                yield _all_of(self._was_in(state, parent)), _id(state.name)
        yield "", self._begins(history)

    def _of_used(self, state: State) -> bool:
        """Return whether a state leads into an embedded mission, or is an initial state of one."""
        above = f"{state.name}."
        return self._is_used(state) or any(f"{name}.".startswith(above) for name in self._uses)

    def _is_used(self, state: State) -> bool:
        """Return whether a state is a top state of an embedded mission."""
        return state.parent is not None and self._chart.states[state.parent].use is not None

    def _below(self, state: State, level: int = 0) -> Iterator[tuple[State, int]]:
        """Yield a state and its descendants, outer ones first, with their depths."""
        yield state, level
        for child in state.children:
            if self._chart.states[child].kind is not Kind.HISTORY:
                yield from self._below(self._chart.states[child], level + 1)

    def _was_in(self, state: State, parent: State) -> Iterator[str]:
        """Yield the conditions that `state` was active when `parent` was left."""
        inwards = self._chart.lineage[state.name][: self._chart.lineage[state.name].index(parent.name) + 1]
        for child, around in reversed(list(itertools.pairwise(inwards))):
            if self._chart.states[around].kind is Kind.COMPOUND:
                left = self._left.setdefault(around, f"left_{_id(around).replace('-', '_')}")
                yield f"{left} == {_id(child)!r}"

    def _keep(self, state: State) -> list[str]:
        """Return the action that stores a left state for history."""
        left = self._left.get(state.parent or "")
        return [f"<assign{_attributes(location=left, expr=repr(_id(state.name)))}/>"] if left else []

    # -- transitions ------------------------------------------------------------------------------------

    def _transitions(self, state: State, rule: Transition) -> Iterator[str]:
        """Yield a transition; one to a history may become several, of which the first that holds is taken."""
        for condition, target in self._ways.get(rule.target or "", (("", _id(rule.target)),)):
            yield from self._transition(state, rule, condition, target)

    def _transition(self, state: State, rule: Transition, condition: str, target: str) -> Iterator[str]:
        # What needs no event waits while a hold is engaged that does not let it through.
        eventless = not rule.event or rule.event.startswith("input.")
        holds = self._chart.holds.keys() - rule.during - rule.releases if eventless else ()
        level = rule.event if eventless else None
        guard = self._condition(rule.guard.source)
        free = [f"not held({hold})" for hold in sorted(holds)]
        refusal = [f"<log{_attributes(label='refuse', expr=repr(rule.refuse))}/>"] if rule.refuse else []
        attributes = {
            "event": None if eventless else self._event(state, rule.event),
            "cond": _all_of([*free, level, guard, condition]),
            "target": target,
            # It has a meaning only where a way leads into its own state.
            "type": "internal"
            if rule.internal and (rule.target or "").startswith(f"{state.name}.")
            else None,
            **_extensions(rule),
        }
        ticks = [timer for timer in state.timers if timer.word == "every" and timer.event == rule.event]
        again = [self._send(state, timer, ".again") for timer in ticks]
        inside = [*refusal, *again, *self._actions(rule.actions)]
        yield from _element("transition", attributes, inside, always=True)

    def _event(self, state: State, event: str) -> str | None:
        name = _id(state.name)
        if event.startswith(TIMERS) or event == "budget":
            return f"{event}.{name}"
        if event == "done" and state.invoke is None:
            # A slot is done when the mission in it is.
            done = state.children if state.slot else (state.name,)
            return " ".join(f"done.state.{_id(each)}" for each in done)
        if event in ("done", "error"):
            return f"{event}.invoke.{name}-operation"
        return event or None

    def _condition(self, source: str) -> str:
        return _IN_STATE.sub(self._in_state, " ".join(source.split()))

    def _in_state(self, found: re.Match[str]) -> str:
        try:
            return f"In({_id(find_state(self._chart, found[1]))!r})"
        except UsageError:
            return found[0]

    # -- what a state does ------------------------------------------------------------------------------

    def _timers(self, state: State) -> Iterator[str]:
        return (self._send(state, timer) for timer in _clocks(state))

    def _send(self, state: State, timer: Timer, mark: str = "") -> str:
        """Return the element that sets a deadline; `mark` makes the XML id of a second one unique."""
        event = self._timer(state, timer)
        if timer.word == "at":  # SCXML knows no time of day: who has a clock sends it then
            time = {"lupin:at": _written(timer.due)}
            return f"<send{_all_attributes({'type': _TYPE, 'event': event, 'id': event, **time})}/>"
        delay, expression = self._seconds(timer.due)
        return f"<send{_attributes(event=event, id=event + mark, delay=delay, delayexpr=expression)}/>"

    @staticmethod
    def _timer(state: State, timer: Timer) -> str:
        return f"{timer.event}.{_id(state.name)}"

    def _seconds(self, value: Value) -> tuple[str | None, str | None]:
        """Return a duration in seconds by the parameters' defaults; else its expression."""
        try:
            return f"{float(value.evaluate(self._defaults)):g}s", None
        except (KeyError, TypeError, ValueError, ArithmeticError, UnknownValue):
            return None, _written(value)

    def _ask(self, ask: Prompt) -> Iterator[str]:
        """Yield a question; its deadline is an event like any other."""
        choices = [
            f"<lupin:choice{_attributes(name=c.name, label=c.label, severity=c.severity.name.lower())}/>"
            for c in ask.choices.values()
        ]
        attributes = {"question": _written(ask.question), "default": ask.default}
        yield from _element("lupin:ask", attributes, choices)

    def _invoke(self, state: State, invoke: Invoke) -> Iterator[str]:
        attributes = {"type": _TYPE, "id": f"{_id(state.name)}-operation"}
        for words, _, value in walk(invoke, _SAID):
            seconds, _ = self._seconds(value) if _is_duration(value) else (None, None)
            attributes[f"lupin:{words[-1].removesuffix('.after')}"] = seconds or _text(value)
        yield from _element("invoke", attributes, _params(invoke.arguments), always=True)

    def _actions(self, actions: Iterable[ActionCall]) -> Iterator[str]:
        for action in actions:
            if action.name in WRITING:
                for name, value in action.arguments.items():
                    expression = self._assigned(action.name, name, _written(value))
                    yield f"<assign{_attributes(location=name, expr=expression)}/>"
            elif action.name == "raise":
                yield from _raised(action)
            elif action.guard:
                other = ["<else/>", *self._actions(action.otherwise)] if action.otherwise else []
                condition = {"cond": self._condition(action.guard.source)}
                yield from _element("if", condition, [*self._actions(action.then), *other])
            else:
                attributes = {"type": _TYPE, "event": action.name}
                yield from _element("send", attributes, _params(action.arguments), always=True)

    def _assigned(self, action: str, name: str, value: str) -> str:
        """Return a variable's new value after an action that writes it."""
        if action == "remove":
            return f"[each for each in {name} if each != {value}]"
        if action == "add" and self._chart.context[name].type.distinct:
            return f"{name} if {value} in {name} else {name} + [{value}]"
        return f"{name} + [{value}]" if action == "add" else value


#: What an operation says in attributes of ours.
_SAID = frozenset({Role.PLAIN, Role.VALUE, Role.CODE})
#: What of a transition SCXML has a word for.
_STANDARD = ("target", "guard", "actions", "internal")


def _raised(action: ActionCall) -> Iterator[str]:
    """Yield a `raise`, or a `send` to the chart itself for one with data, which a `raise` cannot carry."""
    event = action.arguments["event"]
    name = str(event.value) if isinstance(event, Constant) else ""
    if action.data:
        yield from _element("send", {"event": name, "target": "#_internal"}, _params(action.data))
    else:
        yield f"<raise{_attributes(event=name)}/>"


def _extensions(rule: Transition) -> dict[str, str | None]:
    """Return further words of a transition as attributes of our namespace."""
    said = ((part, getattr(rule, part.field)) for part in parts_of(Transition) if part.field not in _STANDARD)
    return {f"lupin:{part.word}": _text(value) for part, value in said if part.word and value is not None}


def _all_of(conditions: Iterable[str | None]) -> str:
    """Return one condition for all of several."""
    found = [condition for condition in conditions if condition]
    loose = re.compile(r"\b(or|if)\b")
    return " and ".join(f"({one})" if len(found) > 1 and loose.search(one) else one for one in found)


def _is_duration(value: Any) -> bool:
    return isinstance(value, (Expression, Constant)) and value.type.unit == "s"


def _text(value: Any) -> str:
    if isinstance(value, (Expression, Constant)):
        return _written(value)
    return " ".join(sorted(value)) if isinstance(value, frozenset) else str(value)


def _request(state: State) -> str:
    """Return the request's name of an embedded mission."""
    return f"request_{_id(state.name).replace('-', '_')}"


def _id(name: str | None) -> str:
    return (name or "").replace(".", "-")


def _clocks(state: State) -> tuple[Timer, ...]:
    asked = (state.ask.timer,) if state.ask is not None else ()
    return (*state.timers, *((state.budget,) if state.budget else ()), *asked)


def _params(arguments: Mapping[str, Value]) -> list[str]:
    return [f"<param{_attributes(name=name, expr=_written(value))}/>" for name, value in arguments.items()]


def _written(value: Value) -> str:
    """Return a value as an expression; a text with expressions in it is quoted."""
    if isinstance(value, Constant):
        return repr(value.value)
    source = " ".join(value.source.split())
    return repr(source) if "${" in source else source


def _attributes(**given: str | None) -> str:
    return _all_attributes(given)


def _all_attributes(given: Mapping[str, str | None]) -> str:
    return "".join(f" {name}={quoted(value)}" for name, value in given.items() if value)


def _element(
    name: str, attributes: Mapping[str, str | None], inside: Iterable[str], always: bool = False
) -> Iterator[str]:
    """Yield an element; an empty one without attributes only when it is `always` there."""
    lines = list(inside)
    head = f"{name}{_all_attributes(attributes)}"
    if lines:
        yield f"<{head}>"
        yield from (f"  {line}" for line in lines)
        yield f"</{name}>"
    elif attributes or always:
        yield f"<{head}/>"


def _comment(text: str) -> str:
    """Return a text that may stand in a comment, where two hyphens may not."""
    return escape(text).replace("--", "- -")
