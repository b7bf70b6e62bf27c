"""The cone of influence: the parts of a memory that can change a guard, a time, a list or a property.

It is closed over assignments, as a fixed point. Variables and inputs that only arguments of operations and
actions or texts read are outside; so are details of errors, readings, and how often something was counted.
Where an expression that decides is not compiled, all variables and inputs are inside.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Hashable, Iterator, Mapping
from typing import Any

from lupin_engine.chart import (
    COMPUTED,
    DECIDING,
    ActionCall,
    Chart,
    Compiled,
    Expression,
    ForEach,
    Invoke,
    Role,
    Value,
    every_call,
    walk,
)
from lupin_engine.machine import (
    CANCELLED_CODE,
    EVERYTHING,
    VARIABLES,
    Attempt,
    Compare,
    Event,
    FieldKind,
    Invocation,
    Memory,
    MemoryField,
    Phase,
    Reported,
    Timer,
    Traversal,
    reads_of,
)
from lupin_engine.plugin import is_builtin

#: Actions that store their arguments in variables.
STORING = ("set", "add", "remove")
_ROOTS = ("context", "input", "known", "param")


def reads(value: Value) -> frozenset[tuple[str, str]]:
    """Return the reads of an expression: pairs of a root of the environment and a name below it.

    Empty for a constant, and for an expression that is not compiled.
    """
    if not isinstance(value, Expression) or not isinstance(value.evaluate, Compiled):
        return frozenset()
    return frozenset(reads_of(value.evaluate.code))


def is_abandoned(name: str) -> bool:
    """Return whether a name is that of an abandoned attempt: cancelled, and no state waits for its end.

    Its end only frees its resources. So its origin does not matter: it is named by its class and a number.
    """
    return name[:1] == "~"


def kind_of(name: str) -> str:
    """Return the name of an attempt without its number: the invocation, or an abandoned one's class."""
    return name.partition("#")[0]


def abandoned_kind(attempt: Attempt) -> str:
    """Return the class of an abandoned attempt: `~` and its operation.

    It is `ANY_ABANDONED` for one of a plugin before whose end no other operation may begin.
    """
    any_one = EVERYTHING in attempt.uses and not is_builtin(attempt.operation)
    return ANY_ABANDONED if any_one else f"~{attempt.operation}"


#: The class of abandoned attempts of plugins before whose end no other operation may begin.
ANY_ABANDONED = "~*"


class Relevance:
    """The cone of influence of one chart, and the keys by which values of slots are compared."""

    def __init__(self, chart: Chart) -> None:
        self.chart = chart
        #: The key of a moment of the robot's clock; all are one where no condition reads it (see `Classes`).
        self.clock_key: Callable[[float], Hashable] = lambda _: ()
        #: The reads that each variable is computed from.
        self._computed_from: dict[str, set[tuple[str, str]]] = {}
        decides: set[tuple[str, str]] = set()
        for value in deciding(chart):
            decides |= reads(value)
        for name, variable in chart.context.items():
            self._computed_from.setdefault(name, set()).update(reads(variable.default))
        for call in actions_of(chart):
            self._add_stored(call, decides)
        known = {found for found in decides if found[0] in _ROOTS}
        waiting = [name for root, name in known if root == "context"]
        while waiting:
            more = self._computed_from.get(waiting.pop(), set()) - known
            known |= more
            waiting += [name for root, name in more if root == "context"]
        values = [value for value in deciding(chart) if isinstance(value, Expression)]
        unclear = not all(isinstance(value.evaluate, Compiled) for value in values)
        variables = {name for root, name in known if root == "context"}
        self.variables = frozenset(chart.context if unclear else variables)
        self.parameters = frozenset(name for root, name in known if root == "param")
        inputs = {name for root, name in known if root in ("input", "known")}
        inputs |= heard_inputs(chart)
        inputs = set(chart.inputs) if unclear or ("input", "") in known else inputs
        #: The inputs whose values are compared; of others with levels only the levels are.
        self.inputs = frozenset(name for name in inputs if unclear or self._is_read(name))
        #: Unlimited sweeps are counted up to this: no condition distinguishes more.
        self.most_sweeps = max((_distinguished_sweeps(value.source) for value in _all(chart)), default=0)
        #: The codes that conditions distinguish from all others; None: any, as one is not understood.
        self.codes = distinguished_codes(chart)
        self._cause = {name: _reads_event(invoke) for name, invoke in invokes(chart)}
        self._updated = {name for name, invoke in invokes(chart) if invoke.update is not None}
        #: The states with a `for_each` that stores nothing of an element's end but that it has ended.
        self.keeps_nothing = frozenset(
            name for name, state in chart.states.items() if state.for_each and _keeps_nothing(state.for_each)
        )

    @property
    def irrelevant(self) -> list[str]:
        """The variables and inputs outside the cone, by their authors' names; no inputs with levels."""
        variables = [name for name in self.chart.context if name not in self.variables]
        specs = [spec for spec in self.chart.inputs.values() if not spec.levels]
        inputs = [f"input.{spec.name}" for spec in specs if spec.name not in self.inputs]
        return sorted(variables + inputs)

    def _is_read(self, name: str) -> bool:
        """Return whether the value of an input is read, not only its levels."""
        levels = "|".join(re.escape(level.name) for level in self.chart.inputs[name].levels)
        if not levels:
            return True
        value = re.compile(rf"\binput\.{re.escape(name)}\b(?!\.(?:{levels})\b)")
        return any(value.search(expression.source) for expression in _all(self.chart))

    def _add_stored(self, call: ActionCall, decides: set[tuple[str, str]]) -> None:
        """Add the variables that an action sets, and the reads that decide by what it raises or closes."""
        for name, value in call.arguments.items():
            if call.name in STORING:
                self._computed_from.setdefault(name, set()).update(reads(value))
        if call.name == "raise":
            for value in (*call.arguments.values(), *(call.data or {}).values()):
                decides |= reads(value)
        for name, value in call.arguments.items():
            if call.name == "itinerary.close" and name == "status":
                decides |= reads(value)

    def key(self, slot: tuple[str, str], value: Any) -> Hashable:
        """Return the key of a slot's value: values with equal keys are one."""
        field, name = slot
        of_field = _KEYS.get(field)
        return frozen(value) if of_field is None else of_field(self, name, value)

    def _variable(self, name: str, value: Any) -> Hashable:
        return frozen(value) if name in self.variables else ()

    def _input(self, name: str, value: Reported) -> Hashable:
        spec = self.chart.inputs[name]
        old = spec.freshness is not None and value.stamp + spec.freshness <= 0.0
        return frozen(value.value) if name in self.inputs else (), old

    def _attempt(self, name: str, value: Attempt) -> Hashable:
        if is_abandoned(name):
            return value.uses, value.phase.value
        answer = None if value.answer is None else self._outcome_event("", value.answer)
        # The machine distinguishes accepted from requested only where it updates an operation.
        is_same = value.phase is Phase.ACCEPTED and answer is None and value.invocation not in self._updated
        phase = Phase.REQUESTED if is_same else value.phase
        return value.invocation, value.operation, value.uses, phase.value, value.timeout, answer

    def _invocation(self, _: str, value: Invocation) -> Hashable:
        cause = frozen(value.event) if self._cause.get(value.state) else ()
        cut = value.cut
        cut_short = None if cut is None else (cut.attempt, cut.code, cut.way, cut.over, frozen(cut.result))
        return value.begun, value.tries, value.attempt, cause, frozen(value.item), cut_short

    def _traversal(self, _: str, value: Traversal) -> Hashable:
        sweep = value.sweep if value.sweeps > 0 else min(value.sweep, self.most_sweeps)
        again = value.again
        closed = tuple((visit.target, visit.closed, visit.status in again) for visit in value.visits)
        items = tuple(map(frozen, value.items))
        return items, closed, value.index, sweep, value.sweeps, value.leaves_open, value.begun

    def _timer(self, __: str, value: Timer) -> Hashable:
        due, _, kind, about = value
        return (kind, *about, due)

    def _outcome_event(self, _: str, event: Event) -> Hashable:
        name, data = event.name, {**event.data, "detail": ""}
        if name == "attempt.cancelled":  # a waiting invocation treats it as a failure with this code
            name, data["code"] = "attempt.failed", CANCELLED_CODE
        if self.codes is not None and data.get("code", "") not in self.codes:
            data["code"] = ""
        return name, frozen(data)


_Key = Callable[[Relevance, str, Any], Hashable]
_BY_COMPARE: Mapping[Compare, _Key] = {
    Compare.UNORDERED: lambda _, __, value: frozenset(value),
    Compare.NAMES: lambda _, __, value: tuple(value),
    Compare.PRESENCE: lambda _, __, ___: True,
}
#: Keys of types with fields outside the cone.
_BY_TYPE: Mapping[Any, _Key] = {
    Reported: Relevance._input,
    Attempt: Relevance._attempt,
    Invocation: Relevance._invocation,
    Traversal: Relevance._traversal,
    Timer: Relevance._timer,
    Event: Relevance._outcome_event,
}


def _key_of(one: MemoryField) -> _Key:
    """Return the function that makes keys for a field, or for its entries."""
    of = Relevance._variable if one.owner is VARIABLES else _BY_TYPE.get(one.holds)
    if of is None:
        return _BY_COMPARE.get(one.compared, lambda _, __, value: frozen(value))
    if one.empty is list:
        return lambda self, name, value: tuple([of(self, name, each) for each in value])
    if one.kind is FieldKind.ORDERED:  # without a name it is the order of the entries
        return lambda self, name, value: of(self, name, value) if name else value
    return of


_KEYS: Mapping[str, _Key] = {
    **{one.name: _key_of(one) for one in Memory.schema()},
    "wall": lambda self, _, value: self.clock_key(value),
}


def frozen(value: Any) -> Hashable:
    """Return plain data as a hashable value; TypeError where it holds anything else unhashable."""
    if isinstance(value, Mapping):
        return tuple(sorted((name, frozen(each)) for name, each in value.items()))
    if isinstance(value, (list, tuple)):
        return tuple(map(frozen, value))
    if isinstance(value, set):
        return frozenset(value)
    hash(value)
    return value  # type: ignore[no-any-return]


def _distinguished_sweeps(source: str) -> float:
    """Return the sweep from which on an expression is constant; `math.inf` where that is not understood."""
    return _distinguished_from(source, "itinerary.sweep", _is_count)


def distinguished_lengths(chart: Chart, name: str) -> float:
    """Return the length of an input from which on expressions are constant; `math.inf` if not understood."""
    what = f"input.{name}"
    every = [value for value in said_in(chart, COMPUTED) if isinstance(value, Expression)]
    if not all(isinstance(expression.evaluate, Compiled) for expression in every):
        return math.inf
    return max(
        (
            _distinguished_from(one.source, what, lambda node: ast.unparse(node) == f"len({what})")
            for one in every
        ),
        default=0,
    )


def _distinguished_from(source: str, what: str, is_count: Callable[[ast.expr], bool]) -> float:
    """Return the count from which on an expression is constant; `math.inf` where that is not understood.

    It is understood where each use of the count is a comparison with a number.
    """
    if what not in source:
        return 0
    try:
        nodes = list(ast.walk(ast.parse(source, mode="eval")))
    except SyntaxError:  # the language has words that Python does not have
        return math.inf
    compared = [node for node in nodes if isinstance(node, ast.Compare) and len(node.comparators) == 1]
    found, seen = 0.0, 0
    for node in compared:
        left, right = node.left, node.comparators[0]
        bound = right.value if isinstance(right, ast.Constant) else None
        if isinstance(bound, (int, float)) and isinstance(node.ops[0], _ORDERS) and is_count(left):
            found = max(found, math.floor(bound) + 1)
            seen += ast.unparse(left).count(what)
    return found if seen == source.count(what) else math.inf


def distinguished_codes(chart: Chart) -> frozenset[str] | None:
    """Return the codes that a condition or a retry names: all others are one class. None if not understood.

    It is understood where the code of an error is only compared with literal texts, and not stored.
    """
    found = {code for _, invoke in invokes(chart) if invoke.retry for code in invoke.retry.unless}
    keeping = [call for call in actions_of(chart) if call.name in (*STORING, "raise")]
    kept = [value for call in keeping for value in (*call.arguments.values(), *(call.data or {}).values())]
    for value in (*deciding(chart), *kept):
        if isinstance(value, Expression) and any(word in value.source for word in ("error", "event")):
            named = _codes_named(value.source)
            if named is None:
                return None
            found |= named
    return frozenset(found)


def _codes_named(source: str) -> set[str] | None:
    """Return the texts with which an expression compares an error's code; None where it uses it otherwise."""
    try:
        nodes = list(ast.walk(ast.parse(source, mode="eval")))
    except SyntaxError:  # the language has words that Python has not
        return None
    fields = [node for node in nodes if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)]
    named = [(node.value.id, node.attr) for node in fields if isinstance(node.value, ast.Name)]
    whole = [node for node in nodes if isinstance(node, ast.Name) and node.id in ("error", "event")]
    if len(whole) != sum(root in ("error", "event") for root, _ in named):
        return None
    found: set[str] = set()
    seen = 0
    for node in nodes:
        if isinstance(node, ast.Compare) and ast.unparse(node.left) in _CODES:
            try:
                texts = [ast.literal_eval(one) for one in node.comparators]
            except ValueError:
                return None
            pairs = zip(node.ops, texts, strict=True)
            if any(isinstance(op, (ast.In, ast.NotIn)) and isinstance(text, str) for op, text in pairs):
                return None  # every code that is a part of that text counts
            found.update(t for text in texts for t in ([text] if isinstance(text, str) else text))
            seen += 1
    return found if seen == sum(f"{root}.{name}" in _CODES for root, name in named) else None


_CODES = ("error.code", "event.code")
_ORDERS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq)
_COUNTS = tuple(f"itinerary.{name}" for name in ("sweep", "closed", "remaining", "total"))


def _is_count(node: ast.expr) -> bool:
    """Return whether this is a count of an itinerary, or a sum of some."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _is_count(node.left) and _is_count(node.right)
    return ast.unparse(node) in _COUNTS


def _reads_event(invoke: Invoke) -> bool:
    """Return whether an operation reads the event that led to its state."""
    return any(root == "event" for said in walk(invoke, COMPUTED) for root, _ in reads(said.value))


def _keeps_nothing(each: ForEach) -> bool:
    """Return whether elements have no retries, and their actions store nothing in the memory."""
    calls = [call.name for call in every_call((*each.on_done, *each.on_error))]
    return each.invoke.retry is None and not any(
        name in (*STORING, "raise") or name.startswith("itinerary.") for name in calls
    )


def heard_inputs(chart: Chart) -> set[str]:
    """Return the inputs that are events themselves: they engage a hold or trigger a transition."""
    heard = {rule.event for state in chart.states.values() for rule in state.transitions}
    heard |= {hold.engage for hold in chart.holds.values()}
    return {name for name in chart.inputs if f"input.{name}" in heard}


def invokes(chart: Chart) -> Iterator[tuple[str, Invoke]]:
    """Yield every invoke of a chart, of a `for_each` too, behind the name of its state."""
    for name, state in chart.states.items():
        if state.invoke is not None:
            yield name, state.invoke
        if state.for_each is not None:
            yield name, state.for_each.invoke


def said_in(chart: Chart, roles: frozenset[Role]) -> Iterator[Any]:
    """Yield every part of a chart with one of some roles."""
    for family in ("holds", "invariants", "properties", "inputs", "missions", "context", "states"):
        for thing in getattr(chart, family).values():
            yield from (said.value for said in walk(thing, roles))


def actions_of(chart: Chart) -> Iterator[ActionCall]:
    """Yield every action of a chart, nested ones too."""
    return (call for actions in said_in(chart, frozenset({Role.ACTIONS})) for call in actions)


def deciding(chart: Chart) -> Iterator[Value]:
    """Yield the values that decide: conditions, times, lists, and data of events and requests."""
    return said_in(chart, DECIDING)


def _all(chart: Chart) -> Iterator[Expression]:
    """Yield every expression that decides or is computed: a variable, or an event raised, may carry it on."""
    yield from (value for value in said_in(chart, COMPUTED) if isinstance(value, Expression))
