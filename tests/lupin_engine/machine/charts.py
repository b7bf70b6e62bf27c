"""Charts from nested dicts, for tests of the machine that should not depend on the loader.

A state is a dict: `initial`, `states`, `on` (event to rules), `always`, `on_done`, `on_error`, `after`,
`every` and `budget` (seconds to rules), `at` (times of day to rules), `entry`, `exit`, `invoke`, `for_each`,
`itinerary`, `kind`, and any plain field of `chart.model.State`. A rule is a target, or a dict with fields of
`Transition`; targets are found in the nearest enclosing scope. Guards and argument values may be functions of
the environment, or expressions. An action is a name, or (name, arguments).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from lupin_engine.chart.expressions.condition import FREE, Condition
from lupin_engine.chart.expressions.evaluation import Constant, Expression, Value
from lupin_engine.chart.model import (
    ActionCall,
    Chart,
    Field,
    ForEach,
    Hold,
    Input,
    Invariant,
    Invoke,
    Itinerary,
    Kind,
    Level,
    Mission,
    Prompt,
    Retry,
    State,
    Timer,
    Transition,
    Variable,
)
from lupin_engine.errors import Place, Severity
from lupin_engine.machine import event as events
from lupin_engine.machine.event import Event, Start
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.scope import World
from lupin_engine.machine.snapshot import restore
from lupin_engine.machine.step import Step
from lupin_engine.plugin.contract import Action, Argument, Code, OnHold, Operation
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import ANY, BOOL, NUMBER, TEXT, within
from lupin_engine.runtime.clock import calendar_of
from lupin_greenhouse.profile import PROFILE

PLACE = Place("test.yaml", 1, 1)

#: Operations that tests invoke: two that drive, one that does so beside one that refuses to end, one that
#: uses nothing, two that use the arm and may go on while held, one of them with an argument that has a range,
#: one that uses both; a drive and a lamp that can be updated.
DRIVE = Operation("drive", uses=("base",), on_hold=OnHold.CANCEL)
DOCK = Operation("dock", uses=("base",), on_hold=OnHold.CANCEL)
HOME = Operation("home", uses=("base",), on_hold=OnHold.CANCEL, replaces=True)
READ = Operation("read", on_hold=OnHold.FINISH)
LOOK = Operation("look", uses=("arm",), on_hold=OnHold.FINISH)
TURN = Argument(within(NUMBER, 0.0, 2.0), "how far")
BEND = Operation("bend", {"by": TURN}, uses=("arm",), on_hold=OnHold.FINISH)
CARRY = Operation("carry", uses=("base", "arm"), on_hold=OnHold.CANCEL)
PATH = {"path": Argument(NUMBER, "where to"), "speed": Argument(NUMBER, "how fast", 1.0)}
FOLLOW = Operation("follow", PATH, uses=("base",), on_hold=OnHold.CANCEL, updates=True)
SHOW = Operation("show", PATH, updates=True, adopts=True)
GIVE = Operation("give", result={"flowed": NUMBER}, on_hold=OnHold.CANCEL, cut_short=True)
OPERATIONS = {
    "valve.give": GIVE,
    "nav.follow": FOLLOW,
    "lamp.show": SHOW,
    "nav.go": DRIVE,
    "nav.dock": DOCK,
    "nav.home": HOME,
    "bridge.read": READ,
    "arm.look": LOOK,
    "arm.bend": BEND,
    "arm.carry": CARRY,
}
#: The catalog's actions; others that tests name are taken as they are.
ACTIONS = {"arm.nod": Action("nod", {"by": TURN}), "arm.wave": Action("wave", moves=True)}

PAUSE: dict[str, Any] = {"engage": "operator.pause", "release": ("operator.resume",), "code": "paused"}


def value(given: Any) -> Value:
    """Return a constant, or an expression when `given` is one or a function of the environment."""
    if isinstance(given, Expression):
        return given
    if callable(given):
        return expression(given)
    return Constant(given, PLACE, ANY)


def expression(function: Callable[[Any], Any], source: str = "guard") -> Condition:
    """Return a condition that is a Python function of the environment."""
    return Condition(source, PLACE, BOOL, function)


def optional(fields: Mapping[str, Any], name: str) -> Value | None:
    """Return a field as a value, None when it is not given."""
    return value(fields[name]) if name in fields else None


def fails(_: Any) -> Any:
    """Raise, as a value that cannot be computed does."""
    return 1 / 0


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
            Timer(f"{word}.{index}", value(due), PLACE)
            for word in ("after", "every", "at")
            for index, due in enumerate(described.get(word, {}))
        )
        initial = described.get("initial")
        top = name.partition(".")[0]
        goes_on = described.get("during") == "divert"
        budget = next(
            (Timer("budget", value(t), PLACE, goes_on=goes_on) for t in described.get("budget", {})), None
        )
        children = self._children[name]
        first = next((child for child in children), None)
        plain = ("phase", "paused", "slot", "mission", "depth", "summary", "result")
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
            budget=budget,
            invoke=_invoke(described["invoke"]) if "invoke" in described else None,
            for_each=_for_each(described["for_each"]) if "for_each" in described else None,
            itinerary=_itinerary(described["itinerary"]) if "itinerary" in described else None,
            ask=_ask(described["ask"]) if "ask" in described else None,
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
        for word in ("after", "every", "at"):
            for index, rules in enumerate(described.get(word, {}).values()):
                found.extend(self._rules_of(name, f"{word}.{index}", rules))
        for rules in described.get("budget", {}).values():
            found.extend(self._rules_of(name, "budget", rules))
        return tuple(found)

    def _rules_of(self, source: str, event: str, rules: Any) -> tuple[Transition, ...]:
        listed = [rules] if isinstance(rules, (str, dict)) else list(rules)
        return tuple(self._rule(source, event, rule) for rule in listed)

    def _rule(self, source: str, event: str, rule: str | dict[str, Any]) -> Transition:
        fields: dict[str, Any] = {"target": rule} if isinstance(rule, str) else dict(rule)
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
            guard=guard if isinstance(guard, Condition) else expression(guard) if guard else FREE,
            actions=done,
            **fields,
        )


def actions(given: Any) -> tuple[ActionCall, ...]:
    """Return action calls from names and (name, arguments) pairs; `!name` is one that moves the robot.

    `("raise", {"event": ..., "with": {...}})` carries fields,
    `("if", {"guard": ..., "then": ..., "else": ...})` chooses between actions.
    """
    listed = [given] if isinstance(given, (str, tuple)) and given else list(given)
    return tuple(_action(item) for item in listed)


def _action(item: Any) -> ActionCall:
    name: str
    arguments: Mapping[str, Any]
    name, arguments = (item, {}) if isinstance(item, str) else item
    if name == "if":
        then, otherwise = actions(arguments["then"]), actions(arguments.get("else", ()))
        return ActionCall(name, {}, PLACE, False, {}, expression(arguments["guard"]), then, otherwise)
    data = {k: value(v) for k, v in arguments.get("with", {}).items()} if name == "raise" else {}
    arguments = {k: v for k, v in arguments.items() if k != "with" or name != "raise"}
    moves = name.startswith("!")
    return ActionCall(name.lstrip("!"), {k: value(v) for k, v in arguments.items()}, PLACE, moves, data)


def _invoke(described: str | Mapping[str, Any]) -> Invoke:
    fields: Mapping[str, Any] = {"do": described} if isinstance(described, str) else described
    retry = None
    if "attempts" in fields:
        retry = Retry(
            attempts=value(fields["attempts"]),
            backoff=optional(fields, "backoff"),
            unless=frozenset(fields.get("unless", ())),
            factor=optional(fields, "factor"),
            jitter=optional(fields, "jitter"),
        )
    return Invoke(
        name=fields["do"],
        operation=OPERATIONS[fields["do"]],
        arguments={name: value(given) for name, given in fields.get("with", {}).items()},
        place=PLACE,
        timeout=optional(fields, "timeout"),
        timeout_code=fields.get("timeout_code"),
        retry=retry,
        on_hold=fields.get("on_hold", ""),
        update=optional(fields, "update"),
    )


def _for_each(fields: Mapping[str, Any]) -> ForEach:
    """Return a `for_each`: `items`, `key` (the element itself), `limit`, `when`, and an `invoke`'s fields."""
    return ForEach(
        name="item",
        items=value(fields["items"]),
        key=value(fields.get("key", lambda env: env["item"])),
        invoke=_invoke({"with": {"item": lambda env: env["item"]}, **fields}),
        place=PLACE,
        limit=optional(fields, "limit"),
        when=expression(fields["when"]) if "when" in fields else FREE,
        on_done=actions(fields.get("on_done", ())),
        on_error=actions(fields.get("on_error", ())),
    )


def _itinerary(given: Any) -> Itinerary:
    """Return an itinerary from its items, or from a dict of its fields."""
    fields = given if isinstance(given, Mapping) else {"items": given}
    return Itinerary(
        items=value(fields["items"]),
        place=PLACE,
        order=optional(fields, "order"),
        sweeps=optional(fields, "sweeps"),
        again=fields.get("again", ()),
        leaves_open=fields.get("leaves_open", False),
        source=fields.get("source", ""),
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
    invariants: Mapping[str, Callable[[Any], Any]] | None = None,
) -> Chart:
    """Return a chart.

    Args:
        states: the top-level states.
        initial: the first state; the first one written when absent.
        on: transitions of the root.
        holds: fields of `Hold` by name; guards are functions.
        context: variables and what they start with.
        inputs: fields of `Input` by name; `levels` maps a level to (below, hysteresis), or to a dict.
        missions: by name, with `state` and `request` (field name to fields of `Field`).
        codes: labels by code, all warnings; `paused` (information) and `crashed` (an error) are always there.
        kind: of the root, when it is not compound.
        invariants: conditions by name; the name is also their source.
    """
    root: dict[str, Any] = {"states": states, "initial": initial, "label": "", "on": on or {}}
    if kind is not None:
        root["kind"] = kind
    labels = {name: Code(name, label) for name, label in (codes or {}).items()}
    return Chart(
        name="test",
        files=("test.yaml",),
        catalog=Catalog(actions=ACTIONS, profile=PROFILE),
        states=Builder().build(root),
        missions={name: _mission(name, fields) for name, fields in (missions or {}).items()},
        holds={name: _hold(name, fields) for name, fields in (holds or {}).items()},
        context={
            name: Variable(name, TEXT if isinstance(start, str) else ANY, value(start), PLACE)
            for name, start in (context or {}).items()
        },
        inputs={name: _input(name, fields) for name, fields in (inputs or {}).items()},
        codes={
            "paused": Code("paused", "paused by the operator", Severity.INFO),
            "crashed": Code("crashed", "crashed", Severity.ERROR),
            **labels,
        },
        invariants={
            name: Invariant(name, expression(that, name), PLACE) for name, that in (invariants or {}).items()
        },
    )


def _ask(described: Mapping[str, Any]) -> Prompt:
    """Return a question; `choices` are names, `default` the first of them."""
    choices = {name: Code(name, name.upper(), Severity.INFO) for name in described["choices"]}
    return Prompt(
        value(described["question"]),
        choices,
        described["choices"][0],
        value(described.get("after", 10.0)),
        PLACE,
    )


def _mission(name: str, fields: Mapping[str, Any]) -> Mission:
    request = {
        field: Field(field, place=PLACE, **given) for field, given in fields.get("request", {}).items()
    }
    return Mission(name, fields["state"], fields.get("file", "test.yaml"), "", request, PLACE)


def _hold(name: str, fields: Mapping[str, Any]) -> Hold:
    guards = {key: expression(fields[key]) for key in ("engage_guard", "release_guard") if key in fields}
    return Hold(name=name, place=PLACE, **{**fields, **guards})


def _input(name: str, fields: Mapping[str, Any]) -> Input:
    levels = tuple(_level(level, given) for level, given in fields.get("levels", {}).items())
    rest = {"value": name, "type": ANY, **fields, "levels": levels}
    return Input(name=name, place=PLACE, **rest)


def _level(name: str, given: Any) -> Level:
    fields = given if isinstance(given, Mapping) else {"below": given[0], "hysteresis": given[1]}
    bounds = {side: value(fields[side]) for side in ("below", "above") if side in fields}
    return Level(name, optional(fields, "hysteresis"), PLACE, **bounds)


class Bench:
    """A machine on a bench: what happens at which time is said by the test."""

    machine_type: type[Machine] = Machine

    def __init__(
        self, given: Chart, /, *, seed: int = 0, clock: str = "", zone: str = "UTC", **parameters: Any
    ) -> None:
        calendar = calendar_of(zone)
        self.machine = self.machine_type(World(given, parameters, {}, {}, seed, calendar))
        self.calendar = calendar
        self.now = 0.0
        self.steps: list[Step] = [self.machine.start(0.0, calendar.moment(clock) if clock else None)]

    def set_clock(self, text: str) -> Step:
        """Set the robot's clock."""
        return self.send(events.clock(self.calendar.moment(text) - self.now))

    @property
    def clock(self) -> str:
        """What the robot's clock shows."""
        return self.calendar.as_text(self.now + (self.machine.memory.wall or 0.0))

    def send(self, name: str | Event, /, **data: Any) -> Step:
        """Let an event happen now."""
        event = name if isinstance(name, Event) else Event(name, data)
        step = self.machine.handle(event, self.now)
        self.steps.append(step)
        return step

    def observe(self, name: str, value: Any, stamp: float | None = None) -> Step:
        """Let a live value be reported, as true now when nothing else is said."""
        return self.send(events.observed(name, value, self.now if stamp is None else stamp))

    def restart(self) -> None:
        """Go on with a new machine that knows nothing but the snapshot."""
        world = self.machine.world
        self.machine = self.machine_type(world, restore(world.chart, self.machine.snapshot()))

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

    def wait_for_next(self) -> float:
        """Let time pass until the next deadline has fired; return how long that took."""
        due = self.machine.next_deadline
        assert due is not None
        passed, self.now = due - self.now, due
        self.wait(0.0)
        return passed

    @property
    def leaves(self) -> list[str]:
        """The innermost active states."""
        active = self.machine.memory.configuration
        return [name for name in active if not any(other.startswith(f"{name}.") for other in active) and name]

    @property
    def started(self) -> list[Start]:
        """The attempts that were started, in their order."""
        return [command for step in self.steps for command in step.commands if isinstance(command, Start)]

    @property
    def attempt(self) -> str:
        """The id of the attempt that was started last."""
        return self.started[-1].attempt

    @property
    def context(self) -> dict[str, Any]:
        """The context variables."""
        return self.machine.memory.context

    @property
    def commands(self) -> list[str]:
        """What the last step commands, one word and one name each."""
        return said(self.steps[-1])


def legal(given: Chart, configuration: Iterable[str]) -> bool:
    """Say whether states may be active together: one child of a compound state, all of a parallel one."""
    active = set(configuration)
    if tuple(configuration) != tuple(name for name in given.states if name in active):
        return False
    return all(_is_complete(given, given.states[name], active) for name in active)


def _is_complete(given: Chart, state: State, active: set[str]) -> bool:
    children = [child for child in state.children if given.states[child].kind is not Kind.HISTORY]
    inside = [child for child in children if child in active]
    complete = inside == children if state.kind is Kind.PARALLEL else len(inside) == min(1, len(children))
    return complete and (state.parent is None or state.parent in active)


def said(step: Step) -> list[str]:
    """Return a step's commands as `start a1`, `cancel a1`, `act arm.preset`, `publish 7 OK`, `report`."""
    found = []
    for command in step.commands:
        fields = (getattr(command, name, "") for name in ("attempt", "action", "target", "status"))
        found.append(" ".join(filter(None, (type(command).__name__.lower(), *fields))))
    return found
