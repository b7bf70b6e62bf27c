"""Representative values: a few of each type stand for all that a mission can tell apart.

They follow from what is there: both truth values, every word of a text that is one of a few, and of a
number what lies below, at and above each bound that the chart compares it with. Of records, places and texts
there is one; lists hold as many elements as there are targets. Nobody has to write anything; the author of
a mission may add `classes` to an input or an operation.
"""

from __future__ import annotations

import ast
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from lupin_engine.chart.expressions.evaluation import Expression
from lupin_engine.chart.model import Chart, Field, Input, Mission
from lupin_engine.machine import event as events
from lupin_engine.machine.event import Event
from lupin_engine.machine.itineraries import identity_of
from lupin_engine.machine.memory import Memory
from lupin_engine.machine.scope import EvaluationScope, World
from lupin_engine.plugin.contract import OPERATION_CODES
from lupin_engine.plugin.profile import START
from lupin_engine.plugin.types import Type
from lupin_engine.runtime.possible import requests_of
from lupin_engine.verify.situations.relevance import (
    Relevance,
    deciding,
    elements_told_apart,
    invokes,
    reads,
)

#: What missions are called whose steps are looked at.
MISSION_ID = "proof"
#: More combinations of the fields of one result, event or request are not looked at.
MOST_COMBINED = 16


class Classes:
    """The values that stand for all, for one chart with its parameters.

    `left_out` says what is looked at with fewer values than there are.
    """

    def __init__(self, world: World, relevance: Relevance, targets: int) -> None:
        """Work out the values.

        Args:
            world: the chart with its parameters.
            relevance: what decides anything.
            targets: how many elements lists have at most.
        """
        self.world = world
        self.chart: Chart = world.chart
        self.targets = targets
        self.left_out: list[str] = []
        self._relevance = relevance
        self._bounds = _bounds(world)
        self._env = EvaluationScope(world, Memory())
        self._operations = {invoke.name: invoke.operation for _, invoke in invokes(world.chart)}
        #: What authors have added, by the operation.
        self._more: dict[str, list[Mapping[str, Any]]] = {name: [] for name in self._operations}
        for _, invoke in invokes(world.chart):
            self._more[invoke.name] += [one for one in invoke.classes if one not in self._more[invoke.name]]
        self.names: list[str] = []
        starts = {m.name: self._starts(m) for m in self.chart.missions.values()}
        self.requests = tuple(self._requests(starts))
        self.values = tuple(self._values())
        self.events = tuple(self._events())

    # -- requests -----------------------------------------------------------------------------------------

    def _requests(self, starts: Mapping[str, list[Event]]) -> Iterator[Event]:
        for request in requests_of(self.chart):
            if request.event.name == START:
                yield from starts[request.mission]
            else:
                yield request.event

    def _starts(self, mission: Mission) -> list[Event]:
        """Return the starts of a mission with each of its requests."""
        fields = {name: self._field(field) for name, field in mission.request.items()}
        given = {"mission_type": mission.name, "mission_id": MISSION_ID}
        return [
            Event(START, {**given, **each}) for each in self._combined(f"start of {mission.name}", fields)
        ]

    def _field(self, field: Field) -> list[Any]:
        if field.type.item is None:
            if field.type.kind == "integer":
                least = int(max(field.minimum or 0, field.type.minimum or 0))
                return list(range(least, max(least, self.targets) + 1))
            usual = self._default(field)
            if usual is not None and field.type.name in self.world.readers:
                return [identity_of(usual)]
            return self._of_type(field.type, field.name)
        items = self._named_by_default(field)
        if not items:
            items = [self._sample(field.type.item, n) for n in range(1, self.targets + 1)]
        elif field.type.item.name in self.world.readers:
            items = [identity_of(item) for item in items]
        self.names += [str(item) for item in items if isinstance(item, str)]
        # Which targets they are tells nothing apart: the first of them stand for all.
        least = 0 if field.not_empty else min(1, self.targets)
        return [items[:count] for count in range(least, self.targets + 1)]

    def _named_by_default(self, field: Field) -> list[Any]:
        found = self._default(field)
        return list(found)[: self.targets] if isinstance(found, list) else []

    def _default(self, field: Field) -> Any:
        try:
            return None if field.default is None else field.default.evaluate(self._env)
        except Exception:  # an input that is not known, or whatever a plugin's function raises
            return None

    # -- live values and events ---------------------------------------------------------------------------

    def _values(self) -> Iterator[Event]:
        for name in sorted({spec.value for spec in self.chart.inputs.values()}):
            specs = [spec for spec in self.chart.inputs.values() if spec.value == name]
            declared = self.chart.catalog.values.get(name)
            kind = declared.type if declared is not None else specs[0].type
            found: dict[str, Any] = {}
            for spec in specs:
                for value in self._of_input(spec, kind):
                    found[repr(value)] = value
            if all(spec.name not in self._relevance.inputs and not spec.levels for spec in specs):
                found = dict(list(found.items())[:1])
            for value in found.values():
                yield events.observed(name, value, 0.0)

    def _of_input(self, spec: Input, kind: Type) -> list[Any]:
        bounds = [float(b) for level in spec.levels for b in self._level(spec, level)]
        bounds += self._bounds.get(f"input.{spec.name}", [])
        if kind.kind in ("number", "integer") and bounds:
            return [*_around(bounds, kind), *spec.classes]
        found = self._of_type(kind, spec.name)
        if kind.kind == "list" and not spec.of_mission:
            most = elements_told_apart(self.chart, spec.name)  # more are too many alike
            found = [value for value in found if len(value) <= most]
        return [*found, *spec.classes]

    def _level(self, spec: Input, level: Any) -> list[float]:
        margin = float(level.hysteresis.evaluate(self._env)) if level.hysteresis else 0.0
        if level.below is not None:
            edge = float(level.below.evaluate(self._env))
            return [edge, edge + margin]
        edge = float(level.above.evaluate(self._env))
        return [edge, edge - margin]

    def _events(self) -> Iterator[Event]:
        heard = {rule.event for state in self.chart.states.values() for rule in state.transitions}
        for name, kind in sorted(self.chart.catalog.events.items()):
            if name in heard or any(e.endswith("*") and name.startswith(e[:-1]) for e in heard if e):
                fields = {field: self._of_field(field, of) for field, of in kind.fields.items()}
                yield from (Event(name, data) for data in self._combined(name, fields))

    # -- what servers say ---------------------------------------------------------------------------------

    def results(self, operation: str, arguments: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
        """Return the results that an operation may end well with."""
        declared = self._operations[operation]
        mocked = declared.mock.result
        usual = mocked(arguments, self.world.parameters) if callable(mocked) else mocked
        fields = {}
        for name, kind in declared.result.items():
            known = [usual[name]] if name in usual else []
            told = self._of_field(name, kind)
            plain = kind.kind in ("bool", "text", "number", "integer") and len(told) > 1
            fields[name] = told if plain or not known else known
        found = self._combined(operation, fields)
        return [*found, *({**found[0], **one} for one in self._more[operation])]

    def codes(self, operation: str) -> list[str]:
        """Return the codes that an operation may end in."""
        own = [code.name for code in self._operations[operation].codes]
        return [*own, OPERATION_CODES[0]]

    def tells(self, operation: str, arguments: Mapping[str, Any]) -> tuple[str, ...]:
        """Return the inputs that are certainly known once an operation has ended well."""
        known = self._operations[operation].mock.values
        names = known(arguments, self.world.parameters) if callable(known) else known
        return tuple(spec.name for spec in self.chart.inputs.values() if spec.value in names)

    def told(self, operation: str, arguments: Mapping[str, Any]) -> list[Event]:
        """Return what an operation may tell of these inputs before it ends well."""
        values = {self.chart.inputs[name].value for name in self.tells(operation, arguments)}
        return [event for event in self.values if event.data["name"] in values]

    def gives(self, operation: str) -> bool:
        """Say whether an operation that was cut short gives a result."""
        return self._operations[operation].cut_short

    # -- types --------------------------------------------------------------------------------------------

    def _of_field(self, name: str, kind: Type) -> list[Any]:
        bounds = self._bounds.get(f"event.{name}", []) + self._bounds.get(f"error.result.{name}", [])
        if kind.kind in ("number", "integer") and bounds:
            return _around(bounds, kind)
        return self._of_type(kind, name)

    def _of_type(self, kind: Type, about: str) -> list[Any]:
        if kind.kind == "bool":
            return [False, True]
        if kind.values:
            return list(kind.values)
        if kind.kind == "list" and kind.item is not None:
            most = int(min(self.targets, kind.maximum if kind.maximum is not None else self.targets))
            items = [self._sample(kind.item, n) for n in range(1, max(1, most) + 1)]
            return [items[:count] for count in range(len(items) + 1)]
        return [self._sample(kind, 1)]

    def _sample(self, kind: Type, number: int) -> Any:
        """Return a value of a type; others with other numbers where it can be one of many."""
        if kind.kind == "bool":
            return False
        if kind.kind in ("number", "integer"):
            low = kind.minimum if kind.minimum is not None else 0.0
            return int(low) if kind.kind == "integer" else float(low)
        if kind.kind == "record":
            return {name: self._sample(of, number) for name, of in kind.fields.items()}
        if kind.kind == "list":
            return [self._sample(kind.item, number)] if kind.item is not None else []
        if kind.kind != "text":
            return None
        if kind.values:
            return kind.values[0]
        if kind.example:
            return kind.example
        return self.names[number - 1] if number <= len(self.names) else f"x{number}"

    def _combined(self, what: str, fields: Mapping[str, Sequence[Any]]) -> list[dict[str, Any]]:
        """Return records with every combination of the fields' values, up to a number."""
        every = itertools.product(*fields.values())
        found = [
            dict(zip(fields, values, strict=True)) for values in itertools.islice(every, MOST_COMBINED + 1)
        ]
        if len(found) > MOST_COMBINED:
            self.left_out.append(f"{what}: {MOST_COMBINED} combinations of its fields")
        return found[:MOST_COMBINED]


def parameter_classes(world: World) -> Iterator[tuple[str, Any]]:
    """Yield a value of each class of each parameter that a condition reads, but that of the value it has.

    Classes are both truth values, every word, and of a number what lies below, at and above each number that
    a condition compares it with.
    """
    read = {name for value in deciding(world.chart) for root, name in reads(value) if root == "param"}
    bounds = _bounds(world)
    for name, parameter in world.chart.parameters.items():
        given, kind = world.parameters.get(name, parameter.default), parameter.type
        if name not in read:
            continue
        if kind.kind == "bool":
            yield name, not given
        elif kind.values:
            yield from ((name, word) for word in kind.values if word != given)
        elif kind.kind in ("number", "integer"):
            edges = bounds.get(f"param.{name}", [])
            low = -math.inf if parameter.minimum is None else parameter.minimum
            high = math.inf if parameter.maximum is None else parameter.maximum
            for value in _around(edges, kind) if edges else ():
                if low <= value <= high and _side(value, edges) != _side(given, edges):
                    yield name, value


def _side(value: float, edges: Sequence[float]) -> tuple[int, ...]:
    """Return of each edge whether a number lies below, at or above it."""
    return tuple((value > edge) - (value < edge) for edge in edges)


def _around(bounds: Sequence[float], kind: Type) -> list[Any]:
    """Return a number below, at and between some bounds, and above them, as far as the type has them."""
    edges = sorted(set(bounds))
    low = kind.minimum if kind.minimum is not None else edges[0] - 2.0
    high = kind.maximum if kind.maximum is not None else edges[-1] + 2.0
    found = [(low + edges[0]) / 2.0]
    for edge, after in itertools.pairwise([*edges, high]):
        found += [edge, (edge + after) / 2.0]
    inside = dict.fromkeys(value for value in found if low <= value <= high)
    return list(dict.fromkeys(map(round, inside))) if kind.kind == "integer" else list(inside)


def _bounds(world: World) -> dict[str, list[float]]:
    """Return the numbers that conditions compare something with, by what that is called in the expression."""
    found: dict[str, list[float]] = {}
    env = EvaluationScope(world, Memory())
    for expression in deciding(world.chart):
        if isinstance(expression, Expression):
            for name, bound in _compared(expression, env):
                found.setdefault(name, []).append(bound)
    return found


def _compared(expression: Expression, env: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    try:
        tree = ast.parse(expression.source, mode="eval")
    except SyntaxError:  # the language has words that Python has not
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare) and len(node.comparators) == 1:
            for one, other in ((node.left, node.comparators[0]), (node.comparators[0], node.left)):
                value = _constant(other, env)
                if value is not None and isinstance(one, (ast.Attribute, ast.Name)):
                    yield ast.unparse(one), value


def _constant(node: ast.expr, env: Mapping[str, Any]) -> float | None:
    """Return what a number or a parameter is; None for everything else."""
    if (
        isinstance(node, ast.Constant)
        and isinstance(node.value, (int, float))
        and not isinstance(node.value, bool)
    ):
        return float(node.value)
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "param":
        value = env["param"].get(node.attr)
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return float(value)
    return None
