"""What of a memory decides what a machine does, and what only travels through it.

A variable or an input that is read for nothing but the arguments of operations and actions, or for texts, is
never distinguished. Details, readings, and how often something was counted are not either.
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

#: Actions whose arguments stay in the memory, or go on as an event.
KEEPING = ("set", "add", "remove")
_ROOTS = ("context", "input", "known", "param")


def reads(value: Value) -> frozenset[tuple[str, str]]:
    """Return what an expression reads: the roots of the environment, and what of each."""
    if not isinstance(value, Expression) or not isinstance(value.evaluate, Compiled):
        return frozenset()
    return frozenset(reads_of(value.evaluate.code))


def is_orphan(name: str) -> bool:
    """Say whether a name is that of a cancelled attempt for which nobody waits any more.

    All that still comes of it is its end, which leaves its resource free. So it does not matter whose it was:
    it is named by its kind and a number.
    """
    return name[:1] == "~"


def kind_of(name: str) -> str:
    """Return the name of an attempt without its number: the invocation, or the kind of an orphan."""
    return name.partition("#")[0]


def orphan_kind(attempt: Attempt) -> str:
    """Return the class of an abandoned attempt: its operation; `ANY_ORPHAN` if it blocks all others."""
    any_one = EVERYTHING in attempt.uses and not is_builtin(attempt.operation)
    return ANY_ORPHAN if any_one else f"~{attempt.operation}"


#: The kind of the orphans that are a plugin's, and before whose end nothing may begin.
ANY_ORPHAN = "~*"


class Relevance:
    """What of the memories of one chart is compared."""

    def __init__(self, chart: Chart) -> None:
        self.chart = chart
        #: What each variable is computed of, and what decides anything by itself.
        self._made_of: dict[str, set[tuple[str, str]]] = {}
        decides: set[tuple[str, str]] = set()
        for value in deciding(chart):
            decides |= reads(value)
        for name, variable in chart.context.items():
            self._made_of.setdefault(name, set()).update(reads(variable.default))
        for call in actions_of(chart):
            self._take(call, decides)
        known = {found for found in decides if found[0] in _ROOTS}
        waiting = [name for root, name in known if root == "context"]
        while waiting:
            more = self._made_of.get(waiting.pop(), set()) - known
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
        #: Of an input of which only the levels are read, they are what is compared.
        self.inputs = frozenset(name for name in inputs if unclear or self._is_read(name))
        #: So far sweeps without end are counted; no condition tells more of them apart.
        self.most_sweeps = max((_sweeps_told_apart(value.source) for value in _all(chart)), default=0)
        #: The codes that something tells apart from all others; None where that is not seen.
        self.codes = codes_told_apart(chart)
        self._cause = {name: _reads_event(invoke) for name, invoke in invokes(chart)}
        #: The states with a `for_each` that keeps nothing of how an element ends but that it was dealt with.
        self.keeps_nothing = frozenset(
            name for name, state in chart.states.items() if state.for_each and _keeps_nothing(state.for_each)
        )

    @property
    def passengers(self) -> list[str]:
        """What is never distinguished: variables and inputs, by the names that authors give them."""
        variables = [name for name in self.chart.context if name not in self.variables]
        specs = [spec for spec in self.chart.inputs.values() if not spec.levels]
        inputs = [f"input.{spec.name}" for spec in specs if spec.name not in self.inputs]
        return sorted(variables + inputs)

    def _is_read(self, name: str) -> bool:
        """Say whether the value of an input is read, and not its levels alone."""
        levels = "|".join(re.escape(level.name) for level in self.chart.inputs[name].levels)
        if not levels:
            return True
        value = re.compile(rf"\binput\.{re.escape(name)}\b(?!\.(?:{levels})\b)")
        return any(value.search(expression.source) for expression in _all(self.chart))

    def _take(self, call: ActionCall, decides: set[tuple[str, str]]) -> None:
        """Take in what an action keeps, and of what."""
        for name, value in call.arguments.items():
            if call.name in KEEPING:
                self._made_of.setdefault(name, set()).update(reads(value))
        if call.name == "raise":
            for value in (*call.arguments.values(), *(call.data or {}).values()):
                decides |= reads(value)
        for name, value in call.arguments.items():
            if call.name == "itinerary.close" and name == "status":
                decides |= reads(value)

    def key(self, slot: tuple[str, str], value: Any) -> Hashable:
        """Return what is compared of a slot."""
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
        if is_orphan(name):
            return value.uses, value.phase.value
        answer = None if value.answer is None else self._told("", value.answer)
        # Whether the server has accepted already makes no difference to the machine.
        phase = Phase.REQUESTED if value.phase is Phase.ACCEPTED and answer is None else value.phase
        return value.invocation, value.operation, value.uses, phase.value, value.timeout, answer

    def _invocation(self, _: str, value: Invocation) -> Hashable:
        cause = frozen(value.event) if self._cause.get(value.state) else ()
        cut = value.cut
        told = None if cut is None else (cut.attempt, cut.code, cut.way, cut.over, frozen(cut.result))
        return value.begun, value.tries, value.attempt, cause, frozen(value.item), told

    def _walk(self, _: str, value: Traversal) -> Hashable:
        sweep = value.sweep if value.sweeps > 0 else min(value.sweep, self.most_sweeps)
        closed = tuple((visit.target, visit.closed) for visit in value.visits)
        items = tuple(map(frozen, value.items))
        return items, closed, value.index, sweep, value.sweeps, value.leaves_open, value.begun

    def _timer(self, __: str, value: Timer) -> Hashable:
        due, _, kind, about = value
        return (kind, *about, due)

    def _told(self, _: str, event: Event) -> Hashable:
        name, data = event.name, {**event.data, "detail": ""}
        if name == "attempt.cancelled":  # who waits for the end takes it for a failure with this code
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
#: Of types that have more than decides anything.
_BY_TYPE: Mapping[Any, _Key] = {
    Reported: Relevance._input,
    Attempt: Relevance._attempt,
    Invocation: Relevance._invocation,
    Traversal: Relevance._walk,
    Timer: Relevance._timer,
    Event: Relevance._told,
}


def _key_of(one: MemoryField) -> _Key:
    """Return how values of a field, or of its entries, are compared."""
    of = Relevance._variable if one.owner is VARIABLES else _BY_TYPE.get(one.holds)
    if of is None:
        return _BY_COMPARE.get(one.compared, lambda _, __, value: frozen(value))
    if one.empty is list:
        return lambda self, name, value: tuple([of(self, name, each) for each in value])
    if one.kind is FieldKind.ORDERED:  # without a name it is the order of the entries
        return lambda self, name, value: of(self, name, value) if name else value
    return of


_KEYS: Mapping[str, _Key] = {one.name: _key_of(one) for one in Memory.schema()}


def frozen(value: Any) -> Hashable:
    """Return plain data as something that can be compared and hashed."""
    if isinstance(value, Mapping):
        return tuple(sorted((name, frozen(each)) for name, each in value.items()))
    if isinstance(value, (list, tuple)):
        return tuple(map(frozen, value))
    if isinstance(value, set):
        return frozenset(value)
    hash(value)
    return value  # type: ignore[no-any-return]


def _sweeps_told_apart(source: str) -> float:
    """Return from which sweep on an expression is always the same; `math.inf` where that is not seen."""
    return _told_apart(source, "itinerary.sweep", _is_count)


def elements_told_apart(chart: Chart, name: str) -> float:
    """Return from how many elements of an input on every expression is the same; `math.inf` if not seen."""
    what = f"input.{name}"
    every = [value for value in said_in(chart, COMPUTED) if isinstance(value, Expression)]
    if not all(isinstance(expression.evaluate, Compiled) for expression in every):
        return math.inf
    return max(
        (_told_apart(one.source, what, lambda node: ast.unparse(node) == f"len({what})") for one in every),
        default=0,
    )


def _told_apart(source: str, what: str, is_count: Callable[[ast.expr], bool]) -> float:
    """Return from which number on an expression is always the same; `math.inf` where that is not seen.

    It is seen where a count is compared with a number: beyond that all are too many alike.
    """
    if what not in source:
        return 0
    try:
        nodes = list(ast.walk(ast.parse(source, mode="eval")))
    except SyntaxError:  # the language has words that Python has not
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


def codes_told_apart(chart: Chart) -> frozenset[str] | None:
    """Return the codes that a condition or a retry names: all others are alike. None where that is not seen.

    It is seen where the code of an error is compared with texts that are written out, and kept nowhere.
    """
    found = {code for _, invoke in invokes(chart) if invoke.retry for code in invoke.retry.unless}
    keeping = [call for call in actions_of(chart) if call.name in (*KEEPING, "raise")]
    kept = [value for call in keeping for value in (*call.arguments.values(), *(call.data or {}).values())]
    for value in (*deciding(chart), *kept):
        if isinstance(value, Expression) and any(word in value.source for word in ("error", "event")):
            named = _codes_named(value.source)
            if named is None:
                return None
            found |= named
    return frozenset(found)


def _codes_named(source: str) -> set[str] | None:
    """Return the texts with which an expression compares the code of an error; None where it does more."""
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
            found.update(t for text in texts for t in ([text] if isinstance(text, str) else text))
            seen += 1
    return found if seen == sum(f"{root}.{name}" in _CODES for root, name in named) else None


_CODES = ("error.code", "event.code")
_ORDERS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq)
_COUNTS = tuple(f"itinerary.{name}" for name in ("sweep", "closed", "remaining", "total"))


def _is_count(node: ast.expr) -> bool:
    """Say whether this is a count of an itinerary, or a sum of some."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _is_count(node.left) and _is_count(node.right)
    return ast.unparse(node) in _COUNTS


def _reads_event(invoke: Invoke) -> bool:
    """Say whether an operation reads the event that led to its state."""
    return any(root == "event" for said in walk(invoke, COMPUTED) for root, _ in reads(said.value))


def _keeps_nothing(each: ForEach) -> bool:
    """Say whether elements are not tried again, and their actions leave nothing in the memory."""
    calls = [call.name for call in every_call((*each.on_done, *each.on_error))]
    return each.invoke.retry is None and not any(
        name in (*KEEPING, "raise") or name.startswith("itinerary.") for name in calls
    )


def heard_inputs(chart: Chart) -> set[str]:
    """Return the inputs that are events themselves: a hold or a transition waits until they are true."""
    heard = {rule.event for state in chart.states.values() for rule in state.transitions}
    heard |= {hold.engage for hold in chart.holds.values()}
    return {name for name in chart.inputs if f"input.{name}" in heard}


def invokes(chart: Chart) -> Iterator[tuple[str, Invoke]]:
    """Yield every invoke of a chart with its state."""
    for name, state in chart.states.items():
        if state.invoke is not None:
            yield name, state.invoke
        if state.for_each is not None:
            yield name, state.for_each.invoke


def said_in(chart: Chart, roles: frozenset[Role]) -> Iterator[Any]:
    """Yield everything of some roles that a chart says."""
    for family in ("holds", "invariants", "properties", "inputs", "missions", "context", "states"):
        for thing in getattr(chart, family).values():
            yield from (said.value for said in walk(thing, roles))


def actions_of(chart: Chart) -> Iterator[ActionCall]:
    """Yield every action of a chart, also those in others."""
    return (call for actions in said_in(chart, frozenset({Role.ACTIONS})) for call in actions)


def deciding(chart: Chart) -> Iterator[Value]:
    """Yield what decides something: conditions, times, lists, and what goes on as an event or a request."""
    return said_in(chart, DECIDING)


def _all(chart: Chart) -> Iterator[Expression]:
    """Yield every expression that decides or is computed: a variable, or an event raised, may carry it on."""
    yield from (value for value in said_in(chart, COMPUTED) if isinstance(value, Expression))
