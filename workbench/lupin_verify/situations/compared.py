"""What conditions compare with what: the bounds at which it matters what servers, sensors and requests tell.

Expressions are looked at as the checker has compiled them: units are gone there, and the parameters of parts
have their values. A comparison is understood where one side is constant (numbers, texts, parameters, what
functions make of these) and the other one reads one thing: by itself, in `min`, `max`, `abs` or `if`, or
calculated with constants. A variable hands its bounds on to what it is set from. What reads a number or a
text in any other way is noted.
"""

from __future__ import annotations

import ast
import itertools
import math
from collections import ChainMap
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from lupin_engine.chart import Chart, Compiled, Expression, Input, Value, to_function
from lupin_engine.machine import EvaluationScope, Memory, World
from lupin_engine.plugin import Type
from lupin_verify.situations.relevance import (
    KEEPING,
    Relevance,
    actions_of,
    deciding,
    heard_inputs,
    invokes,
)

#: What an expression reads: a root of the environment and the names below it; `ANY` is an element of a list.
Read = tuple[str, ...]
ANY = "*"
#: Roots of what the world tells, and of what is kept of it.
_ROOTS = frozenset({"input", "event", "request", "given", "context", "item", "target", "param"})
#: Of these, those that are read as a whole, too.
_WHOLE = frozenset({"event", "item", "target"})
#: With more bounds something is counted up, or handed round in circles.
_MOST_BOUNDS = 16
#: What a condition reads of the machine, which may be another at any moment.
_CHANGING = ("in_state", "held", "itinerary", "clock")
_ORDERINGS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)
#: What a straight expression consists of, and the calls that the checker writes into one.
_STRAIGHT = (ast.Add, ast.Sub, ast.USub)
_STRAIGHT_CALLS = frozenset({"_times", "_over", "_number", "_in_unit", "_in_base"})


class Compared:
    """What the conditions of one chart compare, with what, and what else they read."""

    def __init__(self, world: World, relevance: Relevance, targets: int) -> None:
        """Look at everything that decides.

        Args:
            world: the chart with its parameters.
            relevance: which variables decide anything.
            targets: how many elements lists have at most; so far counts are compared.
        """
        self.chart: Chart = world.chart
        #: The numbers and texts with which something is compared.
        self.bounds: dict[Read, set[Any]] = {}
        #: On what anything depends; None: nobody knows.
        self.read: set[Read] | None = set()
        #: What is read in a way that is not understood, each with the condition.
        self.unclear: dict[Read, str] = {}
        self._targets = targets
        self._env = EvaluationScope(world, Memory())
        self._kinds: dict[Read, tuple[Type, ...]] = {}
        self._set_from = _set_from(world.chart)
        self._waiting: list[tuple[Read, Any]] = []
        kept = list(self._kept(relevance))
        known = set(map(id, kept))
        orders = {id(s.itinerary.order) for s in world.chart.states.values() if s.itinerary is not None}
        for value in (*deciding(world.chart), *kept):
            code = _code(value)
            if value is not None and code is not None:
                tree = _Tree(code, world.chart)
                if self.read is not None:
                    self.read.update(read for read in tree.reads.values() if read[0] != "param")
                if id(value) not in orders:  # which target is the next one makes no difference
                    self._look(value, tree, told=id(value) not in known)
            elif isinstance(value, Expression):
                self.read = None
        self._levels()
        while self._waiting:
            self._hand_on(*self._waiting.pop())

    def _levels(self) -> None:
        """Take in at which numbers the levels of inputs change, and the inputs that are events themselves."""
        heard = heard_inputs(self.chart)
        for spec in self.chart.inputs.values():
            read = ("input", spec.name)
            if self.read is not None and (spec.levels or spec.name in heard):
                self.read.add(read)
            for edge in self._edges_of(spec):
                self.bounds.setdefault(read, set()).add(edge)

    def _edges_of(self, spec: Input) -> Iterator[float]:
        """Yield at which numbers the levels of an input become true, and at which they are false again."""
        for level in spec.levels:
            margin = float(level.hysteresis.evaluate(self._env)) if level.hysteresis else 0.0
            edge = level.below if level.below is not None else level.above
            assert edge is not None
            value = float(edge.evaluate(self._env))
            yield value
            yield value + margin if level.below is not None else value - margin

    def _kept(self, relevance: Relevance) -> Iterator[Value]:
        """Yield what is kept in variables on which something depends, or goes on as an event."""
        for read, values in self._set_from.items():
            if read[0] != "context" or read[1] in relevance.variables:
                yield from values
        for call in actions_of(self.chart):
            if call.name == "itinerary.close" and "status" in call.arguments:
                yield call.arguments["status"]

    # -- what is asked ------------------------------------------------------------------------------------

    def decides(self, read: Read) -> bool:
        """Say whether anything depends on this, on a part of it, or on something of which it is a part."""
        return self.read is None or any(one[: len(read)] == read[: len(one)] for one in self.read)

    def edges(self, read: Read) -> list[float]:
        """Return the numbers with which this is compared."""
        return sorted(bound for bound in self.bounds.get(read, ()) if not isinstance(bound, str))

    def texts(self, read: Read) -> list[str]:
        """Return the texts with which this is compared."""
        return sorted(bound for bound in self.bounds.get(read, ()) if isinstance(bound, str))

    def told_apart(self, read: Read, value: Any) -> Any:
        """Return what conditions can see of a value: equal for two between which none makes a difference."""
        if not self.decides(read):
            return None
        if self.read is None or any(one == read[: len(one)] for one in self.read):
            return side(value, self.edges(read)) if self._is_clear(read, value) else repr(value)
        names = sorted({one[len(read)] for one in self.read if one[: len(read)] == read})
        if ANY in names:
            return repr(value)
        return [self.told_apart((*read, name), part(value, name)) for name in names]

    def _is_clear(self, read: Read, value: Any) -> bool:
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        return is_number and read in self.bounds and read not in self.unclear

    # -- one expression -----------------------------------------------------------------------------------

    def _look(self, value: Value, tree: _Tree, told: bool) -> None:
        """Take in what an expression compares; what else it reads is noted where that is `told`."""
        source = getattr(value, "source", "")
        dealt_with = set(tree.asked)
        for node in ast.walk(tree.root):
            if isinstance(node, ast.Call):
                self._call(node, tree, source)
            elif isinstance(node, ast.Compare):
                dealt_with |= tree.inside(node)
                sides = [node.left, *node.comparators]
                for operator, left, right in zip(node.ops, sides, sides[1:], strict=False):
                    self._compare(operator, left, right, tree, source)
        for key, read in tree.reads.items():
            if read[0] == "error":
                self._note(read, source, _is_open, open_=True)
            elif told and key not in dealt_with:
                self._note(read, source, (lambda _: True) if ANY in read else _has_number)

    def _compare_side(self, side: ast.expr, other: ast.expr, tree: _Tree, source: str) -> None:
        """Take in with what one side is compared; what it reads is open where that is not known."""
        bounds = self._constants(other, tree)
        for bound in bounds or ():
            self._carry(side, bound, tree, source)
        for read in {tree.reads[key] for key in tree.inside(side)} if bounds is None else ():
            self._note(read, source, _is_open)

    def _call(self, node: ast.Call, tree: _Tree, source: str) -> None:
        """Note what a function is called with."""
        if isinstance(node.func, ast.Name) and node.func.id != "_known":
            is_meant = _is_word if node.func.id == "len" else _is_list
            for key in filter(tree.reads.__contains__, map(id, node.args)):
                self._note(tree.reads[key], source, is_meant)
        elif isinstance(node.func, ast.Subscript):  # a function of a plugin
            for read in {tree.reads[key] for key in tree.inside(node)}:
                if not (_is_of_itinerary(read) or self._is_target(read)):
                    self._note(read, source, _is_open)

    def _compare(
        self, operator: ast.cmpop, left: ast.expr, right: ast.expr, tree: _Tree, source: str
    ) -> None:
        self._compare_side(left, right, tree, source)
        self._compare_side(right, left, tree, source)
        reads = [{tree.reads[key] for key in tree.inside(one)} for one in (left, right)]
        of_world = [{read for read in one if read[0] != "param"} for one in reads]
        if not all(of_world) or self._is_count(left, tree) or self._is_count(right, tree):
            return
        if isinstance(operator, _ORDERINGS):
            self._carry(ast.BinOp(left, ast.Sub(), right), 0.0, tree, source)
        elif not (isinstance(operator, (ast.In, ast.NotIn)) and any(map(_is_of_itinerary, of_world[0]))):
            for read in itertools.chain(*of_world):
                self._note(read, source, _is_open)

    def _constants(self, node: ast.expr, tree: _Tree) -> list[Any] | None:
        """Return with what a side of a comparison compares the other one; None where that is not known."""
        if self._is_count(node, tree):
            return list(range(self._targets + 1))
        if any(tree.reads[key][0] != "param" for key in tree.inside(node)):
            return []
        if any(f"env['{name}']" in ast.unparse(node) for name in _CHANGING):
            return None
        try:
            value = to_function(ast.unparse(node))(self._env)
        except Exception:  # it reads the clock, an element of a list, or whatever else is not there yet
            return None
        every = value if isinstance(value, list) else [value]
        if any(isinstance(one, (list, Mapping)) for one in every):
            return None
        return [one for one in every if isinstance(one, (int, float, str)) and not isinstance(one, bool)]

    def _is_count(self, node: ast.expr, tree: _Tree) -> bool:
        """Say whether this counts elements or targets."""
        is_length = isinstance(node, ast.Call) and ast.unparse(node.func) == "len"
        return is_length or (isinstance(node, ast.Subscript) and "env['itinerary']" in ast.unparse(node))

    def _carry(self, node: ast.expr, bound: Any, tree: _Tree, source: str, but: Read = ()) -> None:
        """Find what something must be for an expression to come to a bound; `but` is looked for nowhere."""
        call = node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""
        arguments = node.args if isinstance(node, ast.Call) else []
        if id(node) in tree.reads:
            self._add(tree.reads[id(node)], bound, source, but)
        elif isinstance(node, ast.IfExp):
            self._carry(node.body, bound, tree, source, but)
            self._carry(node.orelse, bound, tree, source, but)
        elif call in ("min", "max"):
            for one in arguments:
                self._carry(one, bound, tree, source, but)
        elif call == "abs":
            self._carry(arguments[0], bound, tree, source, but)
            self._carry(arguments[0], -bound, tree, source, but)
        elif call != "len":
            self._solve(node, bound, tree, source, but)

    def _solve(self, node: ast.expr, bound: Any, tree: _Tree, source: str, but: Read) -> None:
        reads = {tree.reads[key] for key in tree.inside(node)}
        of_world = {read for read in reads if read[0] != "param"}
        for read in of_world if len(of_world) > 1 else reads:
            if of_world and read not in of_world:
                continue
            others = of_world - {read}
            root = None if others or isinstance(bound, str) else self._root(node, bound, tree, read)
            if root is not None:
                self._add(read, root, source, but)
            elif read != but:
                self._note(read, source, _is_open, open_=True)

    def _root(self, node: ast.expr, bound: float, tree: _Tree, read: Read) -> float | None:
        """Return the number for which a straight expression comes to a bound."""
        sought = {key for key in tree.inside(node) if tree.reads[key] == read}
        if not all(_is_straight(one) for one in ast.walk(node) if tree.inside(one) & sought - {id(one)}):
            return None
        if any(_is_bent(one, tree, sought) for one in ast.walk(node)):
            return None
        function, way = to_function(ast.unparse(node)), tree.ways[min(sought)]

        def beyond(value: float) -> float:
            return float(function(self._with(way, value))) - bound

        try:
            below, at, above, far = map(beyond, (-1.0, 0.0, 1.0, 3.0))
            rise = above - at
            even = math.isclose(at - below, rise, rel_tol=1e-6)
            if not rise or not even or not math.isclose(far - above, 2.0 * rise, rel_tol=1e-6):
                return None
            found = -at / rise
            near = (found, math.nextafter(found, math.inf), math.nextafter(found, -math.inf))
            return next((value for value in near if beyond(value) == 0.0), found)
        except Exception:  # a division by nothing, or what is not there yet
            return None

    def _with(self, way: tuple[str | NamedStep, ...], value: Any) -> Mapping[str, Any]:
        """Return an environment in which one thing has a value."""
        for step in reversed(way[1:]):
            value = [{"name": step.name, "value": value}] if isinstance(step, NamedStep) else {step: value}
        root = str(way[0])
        return ChainMap({root: ChainMap(value, self._env["param"]) if root == "param" else value}, self._env)

    # -- what comes of it ---------------------------------------------------------------------------------

    def _add(self, read: Read, bound: Any, source: str, but: Read = ()) -> None:
        """Note a bound, and hand it on if it is that of a variable."""
        found = self.bounds.get(read, set())
        if read == but or bound in found:
            return
        is_whole = any(kind.kind not in ("number", "integer", "text", "bool") for kind in self.kinds(read))
        is_whole = is_whole or (read[0] == "request" and len(read) > 2 and self._is_target(read[:2]))
        if ANY in read or is_whole or read[0] in ("item", "target") or len(found) >= _MOST_BOUNDS:
            self._note(read, source, lambda _: True, open_=True)
            return
        self.bounds.setdefault(read, found).add(bound)
        self._waiting.append((read, bound))

    def _is_target(self, read: Read) -> bool:
        """Say whether this is one of the things that a plugin reads by name, of which one alone is tried."""
        kinds = (kind if kind.item is None else kind.item for kind in self.kinds(read))
        return any(kind.name in self._env.world.readers for kind in kinds)

    def _note(self, read: Read, source: str, is_meant: Callable[[Type], bool], open_: bool = False) -> None:
        """Note what is read in a way that is not understood, if its type is meant; `open_`: or not known."""
        kinds = self.kinds(read)
        is_told = any(map(is_meant, kinds)) if kinds else open_
        if is_told and read not in self.unclear and read[0] != "param":
            self.unclear[read] = source
            self._waiting.append((read, None))

    def _hand_on(self, read: Read, bound: Any) -> None:
        """Give a bound of something that is set to what it is set from; None: it is not understood."""
        for size in range(2, len(read) + 1):
            for value in self._set_from.get(read[:size], ()):
                code = _code(value)
                if code is not None:
                    self._hand_to(_Tree(code, self.chart), getattr(value, "source", ""), read, size, bound)

    def _hand_to(self, tree: _Tree, source: str, read: Read, size: int, bound: Any) -> None:
        """Give a bound to what something is set to, of which the first names in `read` are set."""
        whole, inner = tree.reads.get(id(tree.root)), read[size:]
        if bound is not None and not inner:
            self._carry(tree.root, bound, tree, source, but=read)
        elif whole is not None and ANY not in inner:
            there = (*whole, *inner)
            if bound is None:
                self._note(there, self.unclear[read], _is_open)
            else:
                self._add(there, bound, source, but=read)
        else:
            for other in set(tree.reads.values()) - {read}:
                self._note(other, self.unclear.get(read, source), _is_open)

    def kinds(self, read: Read) -> tuple[Type, ...]:
        """Return the types that this may have; none where that is not known."""
        if read not in self._kinds:
            first = _declared(self.chart, read)
            self._kinds[read] = tuple(kind for one in first for kind in _below(one, read[2:]))
        return self._kinds[read]


class NamedStep(NamedTuple):
    """A step into a list of records of name and value."""

    name: str


class _Tree:
    """Checked code as a tree: what its nodes read, by their identity."""

    def __init__(self, code: str, chart: Chart) -> None:
        self.root = ast.parse(code, mode="eval").body
        #: What nodes read; the way there in the environment; those that only ask whether something is known.
        self.reads: dict[int, Read] = {}
        self.ways: dict[int, tuple[str | NamedStep, ...]] = {}
        self.asked: set[int] = set()
        self._chart = chart
        self._elements: dict[str, tuple[str | NamedStep, ...]] = {}
        self._find(self.root, asked=False)

    def inside(self, node: ast.AST) -> set[int]:
        """Return the nodes inside of a node that read something."""
        return {id(one) for one in ast.walk(node) if id(one) in self.reads}

    def _enter(self, loop: ast.comprehension) -> None:
        """Remember what the elements of a loop are of."""
        values = self._way(loop.iter)
        if values is not None and isinstance(loop.target, ast.Name):
            self._elements[loop.target.id] = (*values, ANY)

    def _find(self, node: ast.AST, asked: bool) -> None:
        way = self._way(node)
        read = None if way is None else self._read(way)
        if way is not None and read is not None:
            self.reads[id(node)], self.ways[id(node)] = read, way
            if asked:
                self.asked.add(id(node))
            return
        if isinstance(node, (ast.ListComp, ast.GeneratorExp)):
            for loop in node.generators:  # one, says the checker
                self._enter(loop)
        asks = isinstance(node, ast.Call) and ast.unparse(node.func) in ("_known", "len")
        for child in ast.iter_child_nodes(node):
            self._find(child, asks or (asked and (isinstance(node, ast.Lambda) or _converts(node))))

    def _way(self, node: ast.AST) -> tuple[str | NamedStep, ...] | None:
        """Return the way that a node takes through the environment; None for what is more than a way."""
        if isinstance(node, ast.Name):
            return self._elements.get(node.id)
        if isinstance(node, ast.Subscript):
            if isinstance(node.value, ast.Name) and node.value.id == "env":
                return (str(ast.literal_eval(node.slice)),)
            inner = self._way(node.value)
            is_name = isinstance(node.slice, ast.Constant) and isinstance(node.slice.value, str)
            return None if inner is None else (*inner, ast.literal_eval(node.slice) if is_name else ANY)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.args:
            return self._way_called(node.func.id, node.args)
        return None

    def _way_called(self, function: str, given: Sequence[ast.expr]) -> tuple[str | NamedStep, ...] | None:
        inner = self._way(given[0])
        if function == "_named" and inner is not None:
            return (*inner, NamedStep(ast.literal_eval(given[1])))
        if function == "_first" and inner is not None:
            return (*inner, ANY)
        return inner if function == "_bounded" else None

    def _read(self, way: tuple[str | NamedStep, ...]) -> Read | None:
        """Return what is read on a way; None for what no world tells."""
        names = tuple(step.name if isinstance(step, NamedStep) else step for step in way)
        root, *below = names
        if root == "error":
            if below == ["detail"]:
                return names
            return ("event", *below[1:]) if below[:1] == ["result"] and below[1:] else None
        if root not in _ROOTS or (not below and root not in _WHOLE):
            return None
        spec = self._chart.inputs.get(below[0]) if root == "input" else None
        if spec is not None and spec.levels:  # its value and its levels are read as a record
            return (root, below[0], *below[2:]) if below[1:2] == ["value"] else None
        return names


def part(value: Any, name: str) -> Any:
    """Return a field of a record, or what a list of records of name and value tells; None if nothing."""
    if isinstance(value, Mapping):
        return value.get(name)
    return next((one["value"] for one in value or () if one["name"] == name), None)


def _code(value: Value | None) -> str | None:
    compiled = value.evaluate if isinstance(value, Expression) else None
    return compiled.code if isinstance(compiled, Compiled) else None


def side(value: float, edges: Sequence[float]) -> tuple[int, ...]:
    """Return of each edge whether a number lies below, at or above it."""
    return tuple((value > edge) - (value < edge) for edge in edges)


def _set_from(chart: Chart) -> dict[Read, list[Value]]:
    """Return from what variables are set, and the fields of the chart's own events and requests."""
    found: dict[Read, list[Value]] = {("context", name): [one.default] for name, one in chart.context.items()}
    for read, value in itertools.chain(_set_by_actions(chart), _set_by_states(chart)):
        found.setdefault(read, []).append(value)
    return found


def _set_by_actions(chart: Chart) -> Iterator[tuple[Read, Value]]:
    for call in actions_of(chart):
        for name, value in call.arguments.items() if call.name in KEEPING else ():
            yield ("context", name), value
        for name, value in call.data.items():
            yield ("event", name), value


def _set_by_states(chart: Chart) -> Iterator[tuple[Read, Value]]:
    for state in chart.states.values():
        for name, value in state.result.items():
            yield ("event", name), value
        for name, field in state.use.request.items() if state.use is not None else ():
            if field.default is not None:
                yield ("given", state.name, name), field.default


def _declared(chart: Chart, read: Read) -> list[Type]:
    """Return the types of what stands below a root."""
    root, name = read[0], read[1] if len(read) > 1 else ""
    if root == "input" and name in chart.inputs:
        spec = chart.inputs[name]
        declared = chart.catalog.values.get(spec.value)
        return [declared.type if declared is not None else spec.type]
    if root == "context" and name in chart.context:
        return [chart.context[name].type]
    if root == "request":
        return [one.request[name].type for one in chart.missions.values() if name in one.request]
    if root == "event":
        results = [invoke.operation.result for _, invoke in invokes(chart)]
        carried = [*results, *(event.fields for event in chart.catalog.events.values())]
        return [fields[name] for fields in carried if name in fields]
    return []


def _below(kind: Type, names: Sequence[str]) -> Iterator[Type]:
    """Yield the type of what stands below something, if there is such a thing."""
    if not names:
        yield kind
    elif names[0] == ANY and kind.item is not None:
        yield from _below(kind.item, names[1:])
    else:
        inner = {**kind.fields, **kind.named}.get(names[0])
        if inner is not None:
            yield from _below(inner, names[1:])


def _has_number(kind: Type) -> bool:
    return kind.kind in ("number", "integer") or any(map(_has_number, kind.fields.values()))


def _is_open(kind: Type) -> bool:
    """Say whether a type has more values than can be told: numbers, and texts that may be any."""
    inner = (*kind.fields.values(), *((kind.item,) if kind.item is not None else ()))
    return _has_number(kind) or (kind.kind == "text" and not kind.values) or any(map(_is_open, inner))


def _is_of_itinerary(read: Read) -> bool:
    """Say whether this is about a target or an element, of which it tells nothing apart which one it is."""
    return read[0] in ("item", "target")


def _is_word(kind: Type) -> bool:
    return kind.kind == "text"


def _is_list(kind: Type) -> bool:
    return kind.kind == "list" and not kind.named


def _is_bent(node: ast.AST, tree: _Tree, sought: set[int]) -> bool:
    """Say whether something is multiplied with itself, or divides."""
    if not isinstance(node, ast.Call) or ast.unparse(node.func) not in ("_times", "_over"):
        return False
    left, right = (bool(tree.inside(operand) & sought) for operand in node.args)
    return right and (left or ast.unparse(node.func) == "_over")


def _converts(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and ast.unparse(node.func) in _STRAIGHT_CALLS


def _is_straight(node: ast.AST) -> bool:
    if isinstance(node, ast.Call):
        return _converts(node)
    return isinstance(node, (ast.BinOp, ast.UnaryOp)) and isinstance(node.op, _STRAIGHT)
