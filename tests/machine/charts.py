"""Charts from nested dicts, for tests of the machine that should not depend on the loader.

A state is a dict: `initial`, `states`, `on` (event to rules), `always`, `on_done`, `on_error`, `after`
(seconds to rules), `entry`, `exit`, `invoke`, `kind`, and any plain field of `chart.model.State`. A rule is
a target, or a dict with fields of `Transition`; targets are found in the nearest enclosing scope. Guards and
argument values may be functions of the environment. An action is a name, or (name, arguments).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lupin_engine.chart.model import (
    ActionCall,
    Chart,
    Constant,
    Expression,
    Field,
    Hold,
    Input,
    Invoke,
    Itinerary,
    Kind,
    Level,
    Mission,
    Retry,
    State,
    Timer,
    Transition,
    Value,
    Variable,
)
from lupin_engine.errors import Place, Severity
from lupin_engine.machine.environment import World
from lupin_engine.machine.event import Event, Start
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.step import Step
from lupin_engine.plugin.contract import Code, OnHold, Operation
from lupin_engine.plugin.types import ANY, BOOL

PLACE = Place("test.yaml", 1, 1)

#: Operations that tests invoke: one that moves the robot, one that does not, a second that moves it.
DRIVE = Operation("drive", uses=("base",), on_hold=OnHold.CANCEL)
DOCK = Operation("dock", uses=("base",), on_hold=OnHold.CANCEL)
READ = Operation("read", on_hold=OnHold.FINISH)
OPERATIONS = {"nav.go": DRIVE, "nav.dock": DOCK, "bridge.read": READ}

PAUSE: dict[str, Any] = {"engage": "operator.pause", "release": ("operator.resume",), "code": "paused"}


def value(given: Any) -> Value:
    """Return a constant, or an expression when `given` is a function of the environment."""
    if callable(given):
        return expression(given)
    return Constant(given, PLACE, ANY)


def expression(function: Callable[[Any], Any], source: str = "guard") -> Expression:
    """Return an expression that is a Python function of the environment."""
    return Expression(source, PLACE, BOOL, function)


class Builder:
    """Collects the states of one chart."""

    def __init__(self) -> None:
        self.states: dict[str, State] = {}
        self._children: dict[str, tuple[str, ...]] = {}
        self._parents: dict[str, str | None] = {}
        self._rules = 0

    def build(self, tree: Mapping[str, Any]) -> dict[str, State]:
        """Return the states of a chart whose root is described by `tree`."""
        self._survey("", tree, None)
        self._build("", tree)
        return self.states

    def _survey(self, name: str, described: Mapping[str, Any], parent: str | None) -> None:
        self._parents[name] = parent
        prefix = f"{name}." if name else ""
        children = {f"{prefix}{child}": inner for child, inner in described.get("states", {}).items()}
        self._children[name] = tuple(children)
        for child, inner in children.items():
            self._survey(child, inner, name)

    def _resolve(self, target: str, source: str) -> str:
        scope: str | None = source
        while scope is not None:
            candidate = f"{scope}.{target}" if scope else target
            if candidate in self._parents:
                return candidate
            scope = self._parents[scope]
        raise KeyError(f"{target} is not to be found from {source!r}")

    def _build(self, name: str, described: Mapping[str, Any]) -> None:
        kind = described.get("kind") or ("compound" if described.get("states") else "atomic")
        timers = tuple(
            Timer(f"after.{index}", value(delay), PLACE)
            for index, delay in enumerate(described.get("after", {}))
        )
        initial = described.get("initial")
        top = name.partition(".")[0]
        invoke = described.get("invoke")
        itinerary = described.get("itinerary")
        children = self._children[name]
        first = next((child for child in children), None)
        plain = ("phase", "paused", "slot", "mission", "depth", "summary")
        self.states[name] = State(
            name=name,
            kind=Kind(kind),
            place=PLACE,
            parent=self._parents[name],
            children=children,
            initial=self._resolve(initial, name) if initial else (first if kind == "compound" else None),
            label=described.get("label", top),
            entry=actions(described.get("entry", ())),
            exit=actions(described.get("exit", ())),
            transitions=self._transitions(name, described),
            timers=timers,
            invoke=_invoke(name, invoke) if invoke else None,
            itinerary=Itinerary(value(itinerary), PLACE) if itinerary is not None else None,
            resume_at=self._rules_of(name, "", described.get("resume_at", ())),
            **{key: described[key] for key in plain if key in described},
        )
        for child, inner in zip(children, described.get("states", {}).values(), strict=True):
            self._build(child, inner)

    def _transitions(self, name: str, described: Mapping[str, Any]) -> tuple[Transition, ...]:
        found = list(self._rules_of(name, "", described.get("always", ())))
        for event, rules in described.get("on", {}).items():
            found.extend(self._rules_of(name, event, rules))
        found.extend(self._rules_of(name, "done", described.get("on_done", ())))
        found.extend(self._rules_of(name, "error", described.get("on_error", ())))
        for index, rules in enumerate(described.get("after", {}).values()):
            found.extend(self._rules_of(name, f"after.{index}", rules))
        return tuple(found)

    def _rules_of(self, source: str, event: str, rules: Any) -> tuple[Transition, ...]:
        listed = [rules] if isinstance(rules, (str, dict)) else list(rules)
        return tuple(self._rule(source, event, rule) for rule in listed)

    def _rule(self, source: str, event: str, rule: str | dict[str, Any]) -> Transition:
        fields = {"target": rule} if isinstance(rule, str) else dict(rule)
        self._rules += 1
        target = fields.pop("target", None)
        guard = fields.pop("guard", None)
        done = actions(fields.pop("do", ()))
        number = fields.pop("id", f"{source}#{event or 'always'}#{self._rules}")
        for name in ("during", "releases"):
            fields[name] = frozenset(fields.get(name, ()))
        return Transition(
            id=number,
            event=event,
            source=source,
            place=PLACE,
            target=self._resolve(target, source) if target else None,
            guard=expression(guard) if guard else None,
            actions=done,
            **fields,
        )


def actions(given: Any) -> tuple[ActionCall, ...]:
    """Return action calls from names and (name, arguments) pairs; `!name` is one that moves the robot."""
    listed = [given] if isinstance(given, (str, tuple)) and given else list(given)
    return tuple(_action(item) for item in listed)


def _action(item: Any) -> ActionCall:
    name, arguments = (item, {}) if isinstance(item, str) else item
    moves = name.startswith("!")
    return ActionCall(name.lstrip("!"), {k: value(v) for k, v in arguments.items()}, PLACE, moves)


def _invoke(state: str, described: str | Mapping[str, Any]) -> Invoke:
    fields = {"do": described} if isinstance(described, str) else described
    retry = None
    if "attempts" in fields:
        backoff = value(fields["backoff"]) if "backoff" in fields else None
        retry = Retry(value(fields["attempts"]), backoff, frozenset(fields.get("unless", ())))
    return Invoke(
        name=fields["do"],
        operation=OPERATIONS[fields["do"]],
        arguments={name: value(given) for name, given in fields.get("with", {}).items()},
        place=PLACE,
        timeout=value(fields["timeout"]) if "timeout" in fields else None,
        timeout_code=fields.get("timeout_code"),
        retry=retry,
    )


def chart(
    states: Mapping[str, Any],
    *,
    initial: str | None = None,
    on: Mapping[str, Any] | None = None,
    holds: Mapping[str, Mapping[str, Any]] | None = None,
    context: Mapping[str, Any] | None = None,
    inputs: Mapping[str, Mapping[str, Any]] | None = None,
    missions: Mapping[str, Mapping[str, Any]] | None = None,
    codes: Mapping[str, str] | None = None,
    kind: str | None = None,
) -> Chart:
    """Return a chart.

    Args:
        states: the top-level states.
        initial: the first state; the first one written when absent.
        on: transitions of the root.
        holds: fields of `Hold` by name; guards are functions.
        context: variables and what they start with.
        inputs: fields of `Input` by name; `levels` maps a level to (below, hysteresis).
        missions: by name, with `state` and `request` (field name to fields of `Field`).
        codes: labels by code, all warnings; `paused` is always there, as information.
        kind: of the root, when it is not compound.
    """
    root: dict[str, Any] = {"states": states, "initial": initial, "label": "", "on": on or {}}
    if kind is not None:
        root["kind"] = kind
    labels = {name: Code(name, label) for name, label in (codes or {}).items()}
    return Chart(
        name="test",
        files=("test.yaml",),
        states=Builder().build(root),
        missions={name: _mission(name, fields) for name, fields in (missions or {}).items()},
        holds={name: _hold(name, fields) for name, fields in (holds or {}).items()},
        context={name: Variable(name, ANY, value(start), PLACE) for name, start in (context or {}).items()},
        inputs={name: _input(name, fields) for name, fields in (inputs or {}).items()},
        codes={"paused": Code("paused", "paused by the operator", Severity.INFO), **labels},
    )


def _mission(name: str, fields: Mapping[str, Any]) -> Mission:
    request = {
        field: Field(field, place=PLACE, **given) for field, given in fields.get("request", {}).items()
    }
    return Mission(name, fields["state"], "test.yaml", "", request, PLACE)


def _hold(name: str, fields: Mapping[str, Any]) -> Hold:
    guards = {key: expression(fields[key]) for key in ("engage_guard", "release_guard") if key in fields}
    return Hold(name=name, place=PLACE, **{**fields, **guards})


def _input(name: str, fields: Mapping[str, Any]) -> Input:
    levels = tuple(
        Level(level, value(margin) if margin else None, PLACE, below=value(below))
        for level, (below, margin) in fields.get("levels", {}).items()
    )
    rest = {key: given for key, given in fields.items() if key != "levels"}
    return Input(name=name, value=rest.pop("value", name), type=ANY, place=PLACE, levels=levels, **rest)


class Bench:
    """A machine on a bench: what happens at which time is said by the test."""

    def __init__(self, given: Chart, **parameters: Any) -> None:
        self.machine = Machine(World(given, parameters, {}, {}))
        self.now = 0.0
        self.steps: list[Step] = [self.machine.start(0.0)]

    def send(self, name: str | Event, /, **data: Any) -> Step:
        """Let an event happen now."""
        event = name if isinstance(name, Event) else Event(name, data)
        step = self.machine.handle(event, self.now)
        self.steps.append(step)
        return step

    def wait(self, seconds: float) -> list[Step]:
        """Let time pass, firing every deadline at its time; return the steps that made."""
        end, found = self.now + seconds, []
        while (due := self.machine.next_deadline) is not None and due <= end:
            self.now = max(self.now, due)
            step = self.machine.advance(self.now)
            assert step is not None
            found.append(step)
        self.now = end
        self.steps.extend(found)
        return found

    @property
    def leaves(self) -> list[str]:
        """The innermost active states."""
        active = self.machine.memory.configuration
        return [name for name in active if not any(other.startswith(f"{name}.") for other in active) and name]

    @property
    def attempt(self) -> str:
        """The id of the attempt that was started last."""
        started = [command for step in self.steps for command in step.commands if isinstance(command, Start)]
        return started[-1].attempt

    @property
    def context(self) -> dict[str, Any]:
        """The context variables."""
        return self.machine.memory.context

    @property
    def commands(self) -> list[str]:
        """What the last step commands, one word and one name each."""
        return said(self.steps[-1])


def said(step: Step) -> list[str]:
    """Return a step's commands as `start a1`, `cancel a1`, `act arm.preset`, `publish 7 OK`, `report`."""
    found = []
    for command in step.commands:
        fields = (getattr(command, name, "") for name in ("attempt", "action", "target", "status"))
        found.append(" ".join(filter(None, (type(command).__name__.lower(), *fields))))
    return found
