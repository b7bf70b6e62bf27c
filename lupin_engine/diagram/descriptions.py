"""The texts of a picture: values, events and actions, shortened to fit a label."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from lupin_engine.chart.expressions.evaluation import Constant, UnknownValue, Value
from lupin_engine.chart.model import (
    WRITING,
    ActionCall,
    Chart,
    ForEach,
    Hold,
    Invoke,
    Itinerary,
    State,
    Transition,
    UsedMission,
)
from lupin_engine.chart.semantics import DIVERT, DIVERT_DUE, TIMERS
from lupin_engine.diagram.picture import Label, LineRole, TextLine, TransitionCause
from lupin_engine.plugin.types import in_unit

#: Longest guard, value or list of actions, in characters.
WIDTH = 44
#: What an action is about -> the argument that says it.
_ABOUT = {"raise": "event", "itinerary.close": "status", "itinerary.close_rest": "status"}
#: Units of long durations, and the shortest one, in seconds, that is shown in each.
_LONG = {"h": 3600.0, "min": 120.0}
_PREFIXES = ("operator.", "mission.", "answer.")
#: Variables that no file names: what sets them comes from a `before_divert`.
_DERIVED = frozenset({DIVERT, DIVERT_DUE})
_CANNOT = (KeyError, TypeError, ValueError, ArithmeticError, UnknownValue)


class ElementTexts:
    """The texts of a chart's states and transitions, with the parameters' defaults filled in."""

    def __init__(self, chart: Chart) -> None:
        self._states = chart.states
        self._defaults = {"param": {name: p.default for name, p in chart.parameters.items()}}

    def label(self, rule: Transition) -> Label:
        """Return the label of a transition."""
        condition = rule.guard if rule.written is None else rule.written
        guard = f"[{_cut(condition.source)}]" if condition else ""
        event = self._event(rule) or ("" if guard else "always")
        actions = ", ".join(filter(None, (f"code {rule.code}" if rule.code else "", _actions(rule.actions))))
        return Label(event, _cause(rule.event), guard, actions, frozenset({rule.id}))

    def lines(self, state: State) -> Iterator[TextLine]:
        """Yield the lines of a state, without its transitions."""
        if state.use is not None:
            yield TextLine(_cut(self._use(state.use)), LineRole.NOTE)
        if state.before_divert is not None:
            first, within = state.before_divert.leave_by, self.duration(state.before_divert.within)
            way = f" {self._states[first].local_name}," if first else ""
            yield TextLine(f"before a divert:{way} within {within}", LineRole.NOTE)
        if state.itinerary is not None:
            yield from (TextLine(text, LineRole.NOTE) for text in self._itinerary(state.itinerary))
        if state.for_each is not None:
            yield from self._for_each(state.for_each)
        if state.ask is not None:
            yield TextLine(f"ask / {self._short(state.ask.question)}", LineRole.WORK)
            yield TextLine(f"{state.ask.default} after {self.duration(state.ask.after)}", LineRole.NOTE)
        if state.invoke is not None:
            yield from self._invoke(state.invoke)
        yield from _doings(("entry", state.on_entry), ("exit", state.on_exit))
        if state.result:
            given = ", ".join(_write("set", name, value) for name, value in state.result.items())
            yield TextLine(f"result / {_cut(given)}", LineRole.ACTION)

    def duration(self, value: Value) -> str:
        """Return a duration with the parameters' defaults; as written where it cannot be computed."""
        try:
            seconds = float(value.evaluate(self._defaults))
        except _CANNOT:
            return self._short(value)
        fits = (unit for unit, least in _LONG.items() if seconds >= least)
        unit = next((unit for unit in fits if in_unit(seconds, unit).is_integer()), "s")
        return f"{in_unit(seconds, unit):g} {unit}"

    def _event(self, rule: Transition) -> str:
        state = self._states[rule.source]
        if rule in state.resume_at:
            return "resume"
        if rule.event.startswith(TIMERS):
            timer = next(timer for timer in state.timers if timer.event == rule.event)
            when = self._short(timer.due) if timer.word == "at" else self.duration(timer.due)
            return f"{timer.word} {when}"
        if rule.event == "budget" and state.budget is not None:
            also = ", diverts included" if state.budget.goes_on else ""
            return f"budget {self.duration(state.budget.due)}{also}"
        return plain_event(rule.event)

    def _itinerary(self, itinerary: Itinerary) -> Iterator[str]:
        yield f"for each of {self._short(itinerary.items)}"
        if itinerary.order is not None:
            yield f"smallest {self._short(itinerary.order)} first"
        if itinerary.sweeps is not None:
            sweeps = self._short(itinerary.sweeps)
            yield f"sweeps: {'without end' if sweeps == '0' else sweeps}"
        if itinerary.again:
            yield f"once more: {', '.join(itinerary.again)}"

    def _use(self, use: UsedMission) -> str:
        """Return the mission embedded in a state, with the fields that its user gives."""
        given = [
            f"{name} {self.duration(field.default) if field.type.unit == 's' else self._short(field.default)}"
            for name, field in use.request.items()
            if field.default is not None and field.place.file == use.place.file
        ]
        return f"mission {use.mission}" + (f": {', '.join(given)}" if given else "")

    def _for_each(self, found: ForEach) -> Iterator[TextLine]:
        limit = f", {self._short(found.limit)} at a time" if found.limit else ""
        yield TextLine(f"for each {found.name} of {self._short(found.items)}{limit}", LineRole.NOTE)
        if found.when:
            yield TextLine(f"[{_cut(found.when.source)}]", LineRole.NOTE)
        yield from self._invoke(found.invoke)
        yield from _doings(("done", found.on_done), ("error", found.on_error))

    def _invoke(self, invoke: Invoke) -> Iterator[TextLine]:
        limit = f" ≤ {self.duration(invoke.timeout)}" if invoke.timeout else ""
        yield TextLine(f"do / {invoke.name}{limit}", LineRole.WORK)
        if invoke.retry is not None:
            yield TextLine(f"tries: {self._short(invoke.retry.attempts)}", LineRole.NOTE)
        if invoke.on_hold:
            yield TextLine(f"after a hold: {invoke.on_hold}", LineRole.NOTE)
        if invoke.update is not None:
            yield TextLine(f"updated every {self.duration(invoke.update)}", LineRole.NOTE)

    def _short(self, value: Value) -> str:
        if isinstance(value, Constant):
            return _cut(_written(value.value))
        try:
            found = value.evaluate(self._defaults)
        except _CANNOT:
            return _cut(value.source)
        return _cut(_written(found))


def plain_event(event: str) -> str:
    """Return an event in a person's words: `operator.abort` is `abort`."""
    if event.startswith("input."):
        return event.removeprefix("input.").replace(".", " ")
    for prefix in _PREFIXES:
        event = event.removeprefix(prefix)
    return event


def hold_line(hold: Hold) -> TextLine:
    """Return the events that engage and release a hold."""
    release = " or ".join(plain_event(event) for event in hold.release)
    return TextLine(f"hold {hold.name}: from {plain_event(hold.engage)} until {release}", LineRole.NOTE)


def _cause(event: str) -> TransitionCause:
    if event.startswith(TIMERS) or event == "budget":
        return TransitionCause.TIME
    if event.startswith(_PREFIXES):
        return TransitionCause.OPERATOR
    return {"": TransitionCause.ALWAYS, "done": TransitionCause.DONE, "error": TransitionCause.ERROR}.get(
        event, TransitionCause.EVENT
    )


def _doings(*doings: tuple[str, Iterable[ActionCall]]) -> Iterator[TextLine]:
    for word, actions in doings:
        if text := _actions(actions):
            yield TextLine(f"{word} / {text}", LineRole.ACTION)


def _actions(actions: Iterable[ActionCall]) -> str:
    return _cut(", ".join(_action(action) for action in actions if not action.arguments.keys() & _DERIVED))


def _action(action: ActionCall) -> str:
    """Return an action with its main argument, if that is a constant."""
    if action.guard:
        other = f", else: {_actions(action.otherwise)}" if action.otherwise else ""
        return f"if {action.guard.source}: {_actions(action.then)}{other}"
    if action.name in WRITING:
        return ", ".join(_write(action.name, *written) for written in action.arguments.items())
    main = action.arguments.get(_ABOUT.get(action.name, ""))
    name = action.name.removeprefix("itinerary.")
    return f"{name} {main.value}" if isinstance(main, Constant) else name


def _write(action: str, name: str, value: Value) -> str:
    known = isinstance(value, Constant)
    written = value.value if isinstance(value, Constant) else None
    shown = repr(written) if isinstance(written, str) else _written(written)
    if action == "set":
        return f"{name} = {shown}" if known else f"set {name}"
    return f"{action}{f' {shown}' * known} {'to' if action == 'add' else 'from'} {name}"


def _written(value: Any) -> str:
    """Return a value as missions write it, without its quotes and units."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{name}: {_written(inner)}" for name, inner in value.items()) + "}"
    return f"[{', '.join(map(_written, value))}]" if isinstance(value, (list, tuple)) else str(value)


def _cut(text: str) -> str:
    plain = " ".join(text.split())
    return plain if len(plain) <= WIDTH else plain[: WIDTH - 1].rstrip() + "…"
