"""How near runs came to breaking properties: the times and numbers of which a property has a limit."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from lupin_engine.chart.expressions.evaluation import Environment, to_function
from lupin_engine.chart.model import Chart, Level, TemporalProperty
from lupin_engine.machine.event import Event
from lupin_engine.machine.scope import EvaluationScope, reads_of
from lupin_engine.machine.step import Step
from lupin_engine.machine.timers import seconds
from lupin_engine.plugin.types import UNITS, Type, in_unit
from lupin_engine.properties.clauses import Clause, breaches
from lupin_engine.properties.live import LiveMonitor

#: The comparisons by which a number breaks a property from below.
_BELOW, _COMPARED = (ast.Lt, ast.LtE), (ast.Lt, ast.LtE, ast.Gt, ast.GtE)
_Number = Callable[[Environment], Any]


class Margin(NamedTuple):
    """How near a number came to a limit: `left` is negative, or 0, at a breach; all in `unit`."""

    what: str
    came: float
    limit: float
    left: float
    unit: str

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.what} {self.came:.4g} of {self.limit:.4g}{unit}"


@dataclass(frozen=True)
class _Gauge:
    """A comparison of a property, measured while the `others`, which a breach needs, too, are true."""

    what: str
    unit: str
    number: _Number
    limit: _Number
    is_below: bool
    others: tuple[Clause, ...]

    def read(self, env: Environment) -> Margin | None:
        """Return the margin now; None where a breach is not near at all, or a value is unknown."""
        try:
            if not all(clause.is_true(env) for clause in self.others):
                return None
            came, limit = (_in(float(one(env)), self.unit) for one in (self.number, self.limit))
        except Exception:
            return None
        return Margin(self.what, came, limit, came - limit if self.is_below else limit - came, self.unit)


class MarginMonitor(LiveMonitor):
    """Measures margins while it watches; for runs that are replayed, because that takes time."""

    def __init__(self, chart: Chart) -> None:
        """Watch the properties of a chart."""
        super().__init__(chart)
        self._rules = {name: chart.properties[name] for name in self._says}
        self._gauges = {name: list(_gauges(rule, chart)) for name, rule in self._rules.items()}
        self._since: dict[str, tuple[float, float]] = {}
        #: The smallest margin of each property that has any, and the breaches that were reported.
        self.margins: dict[str, Margin] = {}
        self.breaches: list[str] = []

    def take(self, step: Step, scope: EvaluationScope) -> list[Event]:
        """Judge a step, and measure."""
        new = super().take(step, scope)
        self.breaches += [str(event.data["property"]) for event in new]
        env = scope.at("", step.time)
        for name in [name for name in self._since if self._since[name][1] != self._waits.get(name)]:
            begun, due = self._since.pop(name)
            self._note(name, Margin("after", step.time - begun, due - begun, due - step.time, "s"))
        for name, due in self._waits.items():
            if name not in self._since:
                self._since[name] = self._begun(name, due, step.time, env), due
        for name, gauges in self._gauges.items():
            for gauge in gauges:
                self._note(name, gauge.read(env))
        return new

    def shift(self, seconds: float) -> None:
        """Go on by a clock that is so many seconds ahead."""
        super().shift(seconds)
        self._since = {name: (begun + seconds, due + seconds) for name, (begun, due) in self._since.items()}

    def _begun(self, name: str, due: float, now: float, env: Environment) -> float:
        """Return when the time of a deadline began: a new process finds it under way."""
        within = self._rules[name].within
        return now if within is None else due - seconds(within.evaluate(env))

    def _note(self, name: str, found: Margin | None) -> None:
        known = self.margins.get(name)
        if found is not None and (known is None or found.left < known.left):
            self.margins[name] = found


def _gauges(rule: TemporalProperty, chart: Chart) -> Iterator[_Gauge]:
    """Yield the comparisons with numbers that decide a property, except one that begins with an `after`."""
    for way in breaches(rule) if rule.after is None else ():
        for clause in way:
            others = tuple(other for other in way if other is not clause)
            compared = _compared(clause, chart)
            if compared is not None:
                yield _Gauge(*compared, others)


def _compared(clause: Clause, chart: Chart) -> tuple[str, str, _Number, _Number, bool] | None:
    """Return name, unit, number and limit of a comparison, and whether a breach is below the limit."""
    level = _level(clause.node, chart)
    if level is not None:
        name, of = level
        bound = of.below if of.below is not None else of.above
        assert bound is not None, f"the level {of.name} has no bound"
        number = to_function(f"env['input'][{name!r}]['value']")
        is_below = (of.below is not None) is not clause.negated
        return f"input.{name}", _unit(chart.inputs[name].type), number, bound.evaluate, is_below
    node = clause.node
    if not (isinstance(node, ast.Compare) and len(node.ops) == 1 and isinstance(node.ops[0], _COMPARED)):
        return None
    is_below = isinstance(node.ops[0], _BELOW) is not clause.negated
    sides = [node.left, node.comparators[0]]
    if not _read(sides[0]) and _read(sides[1]):
        sides.reverse()
        is_below = not is_below
    if not _read(sides[0]):
        return None
    root, name = _read(sides[0])[0]
    spec = chart.inputs.get(name) if root == "input" else chart.context.get(name)
    unit = _unit(spec.type) if spec is not None else ""
    what = f"input.{name}" if root == "input" else name
    number, limit = (to_function(ast.unparse(side)) for side in sides)
    return what, unit, number, limit, is_below


def _level(node: ast.expr, chart: Chart) -> tuple[str, Level] | None:
    """Return the input and the level that a clause reads; None where it is no level."""
    names = [each.value for each in ast.walk(node) if isinstance(each, ast.Constant)]
    if not isinstance(node, ast.Subscript) or len(names) != 3 or "input" not in names:
        return None
    for name, spec in chart.inputs.items():
        found = next((level for level in spec.levels if {name, level.name} <= {*map(str, names)}), None)
        if found is not None:
            return name, found
    return None


def _read(side: ast.expr) -> list[tuple[str, str]]:
    """Return the inputs and variables that one side of a comparison reads."""
    return [one for one in reads_of(ast.unparse(side)) if one[0] in ("input", "context")]


def _unit(kind: Type) -> str:
    """Return the unit that a number is shown in: of a share in percent."""
    return "%" if not kind.unit and (kind.minimum, kind.maximum) == (0.0, 1.0) else kind.unit


def _in(value: float, unit: str) -> float:
    return in_unit(value, unit) if unit in UNITS else value
