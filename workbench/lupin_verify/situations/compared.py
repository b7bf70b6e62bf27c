"""Finds the bounds of input classes: the numbers and texts that conditions compare inputs with.

It reads expressions as the checker has compiled them: in base units, with the parameters of embedded missions
filled in. A comparison is understood where one side is constant (also parameters and functions of constants)
and the other reads one value: directly, in `min`, `max`, `abs` or `if`, or in a linear expression. Bounds of
a variable are propagated to the values that it is set from. Any other read of a number or a text is recorded
as `unclear`, and the proof reports it.
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
from lupin_engine.plugin import DATE, TIME_OF_DAY, Notation, Type, problems
from lupin_verify.situations.relevance import (
    STORING,
    Relevance,
    actions_of,
    deciding,
    heard_inputs,
    invokes,
)

#: A read of an expression: a root of the environment and the names below it; `ANY` is an element of a list.
Read = tuple[str, ...]
ANY = "*"
#: Roots of reported values, and of variables that may store them.
_ROOTS = frozenset({"input", "event", "request", "given", "context", "item", "target", "param", "clock"})
#: Roots that may be read as a whole, too.
_WHOLE = frozenset({"event", "item", "target"})
#: With more bounds, a value is counted up or propagated in a cycle.
_MOST_BOUNDS = 16
#: The types of the robot's clock, and the names of both: texts that conditions compare by their order.
_CLOCK: Mapping[str, Type] = {"time": TIME_OF_DAY, "today": DATE}
_TIMES = frozenset(kind.name for kind in _CLOCK.values())
#: What elements are known by: all of them differ in it, and a plugin's function may read a whole one.
_IDENTITY: tuple[Read, ...] = ((), ("id",))
#: Roots of the machine's own state.
_CHANGING = ("in_state", "held", "itinerary")
_ORDERINGS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)
#: The operators of a linear expression, and the calls that the checker inserts into one.
_LINEAR = (ast.Add, ast.Sub, ast.USub)
_LINEAR_CALLS = frozenset({"_times", "_over", "_number", "_in_unit", "_in_base"})


class Compared:
    """The bounds of one chart's conditions, and the reads that are not understood."""

    def __init__(self, world: World, relevance: Relevance, targets: int) -> None:
        """Analyse every value that decides.

        Args:
            world: the chart with its parameters.
            relevance: the cone of influence.
            targets: the most elements of lists, and so the highest count that is a bound.
        """
        self.chart: Chart = world.chart
        #: The numbers and texts that each read is compared with.
        self.bounds: dict[Read, set[Any]] = {}
        #: The reads that decide; None: not known, as some expression is not compiled.
        self.read: set[Read] | None = set()
        #: The numbers and texts that elements of a request's list are compared with.
        self.of_elements: dict[Read, set[Any]] = {}
        #: The reads that are not understood, each with its condition.
        self.unclear: dict[Read, str] = {}
        #: What conditions read of elements of lists (see `part_of_element`), and what they compare it with.
        self.parts: dict[Read, set[Any]] = {}
        #: Those of them that conditions read in another way: each value counts.
        self._by_value: set[Read] = set()
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
                if id(value) not in orders:  # the order of targets does not matter
                    self._look(value, tree, is_reported=id(value) not in known)
                    self._parts_of(tree)
            elif isinstance(value, Expression):
                self.read = None
        self._levels()
        while self._waiting:
            self._propagate(*self._waiting.pop())
        if () in self.parts:
            self._keep_parts()

    def _parts_of(self, tree: _Tree) -> None:
        for read in tree.reads.values():
            of_element = part_of_element(read)
            if of_element is not None:
                self.parts.setdefault(of_element, set())

    def _keep_parts(self) -> None:
        """Add the fields that conditions read of variables: these may keep elements as a whole."""
        for read in self.read or ():
            if read[0] == "context" and read[2:] and ANY not in read:
                self.parts.setdefault(read[2:], set()).update(self.bounds.get(read, ()))
                if read in self.unclear:
                    self._by_value.add(read[2:])

    def _levels(self) -> None:
        """Add the numbers at which the levels of inputs change, and the inputs that are events themselves."""
        heard = heard_inputs(self.chart)
        for spec in self.chart.inputs.values():
            read = ("input", spec.name)
            if self.read is not None and (spec.levels or spec.name in heard):
                self.read.add(read)
            for edge in self._edges_of(spec):
                self.bounds.setdefault(read, set()).add(edge)

    def _edges_of(self, spec: Input) -> Iterator[float]:
        """Yield the numbers at which the levels of an input become true, and false again."""
        for level in spec.levels:
            margin = float(level.hysteresis.evaluate(self._env)) if level.hysteresis else 0.0
            edge = level.below if level.below is not None else level.above
            assert edge is not None
            value = float(edge.evaluate(self._env))
            yield value
            yield value + margin if level.below is not None else value - margin

    def _kept(self, relevance: Relevance) -> Iterator[Value]:
        """Yield the values that are stored in variables of the cone, or become data of an event."""
        for read, values in self._set_from.items():
            if read[0] != "context" or read[1] in relevance.variables:
                yield from values
        for call in actions_of(self.chart):
            if call.name == "itinerary.close" and "status" in call.arguments:
                yield call.arguments["status"]

    # -- queries ------------------------------------------------------------------------------------------

    def decides(self, read: Read) -> bool:
        """Return whether a decision depends on this read, on a part of it, or on a whole around it."""
        return self.read is None or any(one[: len(read)] == read[: len(one)] for one in self.read)

    def edges(self, read: Read) -> list[float]:
        """Return the numbers that a read is compared with."""
        return sorted(bound for bound in self.bounds.get(read, ()) if not isinstance(bound, str))

    def elements(self, read: Read, kind: Type) -> list[Any]:
        """Return the numbers or texts of a type that the elements of a request's list are compared with."""
        is_of_type = str if kind.kind == "text" else (int, float)
        return sorted(one for one in self.of_elements.get(read, ()) if isinstance(one, is_of_type))

    def kind_of_element(self, element: Any) -> str:
        """Return what conditions distinguish of an element: equal for two that they cannot tell apart."""
        found = []
        for names in self.told_apart_by:
            value, bounds = field_of(element, names), self.parts[names]
            is_of_type = str if isinstance(value, str) else (int, float)
            edges = sorted(one for one in bounds if isinstance(one, is_of_type))
            is_by_value = names in self._by_value and names not in _IDENTITY
            is_plain = isinstance(value, (str, int, float)) and not isinstance(value, bool)
            found.append(side(value, edges) if edges and is_plain and not is_by_value else value)
        return repr(found)

    @property
    def told_apart_by(self) -> list[Read]:
        """What conditions distinguish elements by; by their identity only where they name one."""
        return sorted(names for names, bounds in self.parts.items() if bounds or names not in _IDENTITY)

    def texts(self, read: Read) -> list[str]:
        """Return the texts that a read is compared with."""
        return sorted(bound for bound in self.bounds.get(read, ()) if isinstance(bound, str))

    def abstracted(self, read: Read, value: Any) -> Any:
        """Return the abstraction of a value: equal for two that no condition distinguishes."""
        if not self.decides(read):
            return None
        if self.read is None or any(one == read[: len(one)] for one in self.read):
            edges = self.texts(read) if isinstance(value, str) else self.edges(read)
            return side(value, edges) if self._is_clear(read, value) else repr(value)
        names = sorted({one[len(read)] for one in self.read if one[: len(read)] == read})
        if ANY in names:
            return repr(value)
        return [self.abstracted((*read, name), part(value, name)) for name in names]

    def _is_clear(self, read: Read, value: Any) -> bool:
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        is_time = isinstance(value, str) and any(kind.name in _TIMES for kind in self.kinds(read))
        return (is_number or is_time) and read in self.bounds and read not in self.unclear

    # -- one expression -----------------------------------------------------------------------------------

    def _look(self, value: Value, tree: _Tree, is_reported: bool) -> None:
        """Add the comparisons of an expression; record its other reads as unclear if `is_reported`."""
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
                self._note(read, source, _is_unbounded, unknown_too=True)
            elif is_reported and key not in dealt_with:
                is_meant: Callable[[Type], bool] = (lambda _: True) if ANY in read else _has_number
                of_element = part_of_element(read)
                unknown_too = of_element is not None and of_element not in _IDENTITY
                self._note(read, source, is_meant, unknown_too)

    def _compare_side(
        self, side: ast.expr, other: ast.expr, tree: _Tree, source: str, within: bool = False
    ) -> None:
        """Add the bounds of one side; its reads are unclear where the other is not constant.

        With `within` the condition is `side in other`: in one text are all of its parts.
        """
        bounds = self._constants(other, tree, within)
        for bound in bounds or ():
            self._carry(side, bound, tree, source)
        for read in {tree.reads[key] for key in tree.inside(side)} if bounds is None else ():
            self._note(read, source, _is_unbounded)

    def _call(self, node: ast.Call, tree: _Tree, source: str) -> None:
        """Record the arguments of a function as unclear, unless it is `known`, or `len` of a list."""
        if isinstance(node.func, ast.Name) and node.func.id != "_known":
            is_meant = _is_free_text if node.func.id == "len" else _is_list
            for key in filter(tree.reads.__contains__, map(id, node.args)):
                self._note(tree.reads[key], source, is_meant)
        elif isinstance(node.func, ast.Subscript):  # a function of a plugin
            for read in {tree.reads[key] for key in tree.inside(node)}:
                if not (_is_of_itinerary(read) or self._is_target(read)):
                    self._note(read, source, _is_unbounded)

    def _compare(
        self, operator: ast.cmpop, left: ast.expr, right: ast.expr, tree: _Tree, source: str
    ) -> None:
        is_in = isinstance(operator, (ast.In, ast.NotIn))
        self._compare_side(left, right, tree, source, within=is_in)
        self._compare_side(right, left, tree, source)
        one_text = is_in and not isinstance(right, ast.List)
        for read in {tree.reads[key] for key in tree.inside(right)} if one_text else ():
            self._note(read, source, _is_free_text)  # a text has more parts than can be tried
        reads = [{tree.reads[key] for key in tree.inside(one)} for one in (left, right)]
        of_world = [{read for read in one if read[0] != "param"} for one in reads]
        if not all(of_world) or self._is_count(left, tree) or self._is_count(right, tree):
            return
        if isinstance(operator, _ORDERINGS):
            self._carry(ast.BinOp(left, ast.Sub(), right), 0.0, tree, source)
        elif not (is_in and any(map(_is_of_itinerary, of_world[0]))):
            for read in itertools.chain(*of_world):
                self._note(read, source, _is_unbounded)

    def _constants(self, node: ast.expr, tree: _Tree, within: bool) -> list[Any] | None:
        """Return the constants of one side of a comparison; none if it reads a value, None if not known.

        Of a text these are its substrings if the condition looks for one `within` it.
        """
        if self._is_count(node, tree):
            return list(range(self._targets + 1))
        if any(tree.reads[key][0] != "param" for key in tree.inside(node)):
            return []
        if any(f"env['{name}']" in ast.unparse(node) for name in _CHANGING):
            return None
        try:
            value = to_function(ast.unparse(node))(self._env)
        except Exception:  # it reads an element of a list, or another value that is not constant
            return None
        every = value if isinstance(value, list) else _parts(value) if within else [value]
        if any(isinstance(one, (list, Mapping)) for one in every):
            return None
        return [one for one in every if isinstance(one, (int, float, str)) and not isinstance(one, bool)]

    def _is_count(self, node: ast.expr, tree: _Tree) -> bool:
        """Return whether this counts elements or targets."""
        is_length = isinstance(node, ast.Call) and ast.unparse(node.func) == "len"
        return is_length or (isinstance(node, ast.Subscript) and "env['itinerary']" in ast.unparse(node))

    def _carry(self, node: ast.expr, bound: Any, tree: _Tree, source: str, origin: Read = ()) -> None:
        """Solve for the reads with which an expression equals a bound; skip `origin`, which it came from."""
        call = node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""
        arguments = node.args if isinstance(node, ast.Call) else []
        if id(node) in tree.reads:
            self._add(tree.reads[id(node)], bound, source, origin)
        elif isinstance(node, ast.IfExp):
            self._carry(node.body, bound, tree, source, origin)
            self._carry(node.orelse, bound, tree, source, origin)
        elif call in ("min", "max"):
            for one in arguments:
                self._carry(one, bound, tree, source, origin)
        elif call == "abs":
            self._carry(arguments[0], bound, tree, source, origin)
            self._carry(arguments[0], -bound, tree, source, origin)
        elif call != "len":
            self._solve(node, bound, tree, source, origin)

    def _solve(self, node: ast.expr, bound: Any, tree: _Tree, source: str, origin: Read) -> None:
        reads = {tree.reads[key] for key in tree.inside(node)}
        of_world = {read for read in reads if read[0] != "param"}
        for read in of_world if len(of_world) > 1 else reads:
            if of_world and read not in of_world:
                continue
            others = of_world - {read}
            root = None if others or isinstance(bound, str) else self._root(node, bound, tree, read)
            if root is not None:
                self._add(read, root, source, origin)
            elif read != origin:
                self._note(read, source, _is_unbounded, unknown_too=True)

    def _root(self, node: ast.expr, bound: float, tree: _Tree, read: Read) -> float | None:
        """Return the number for which a linear expression equals a bound; None where it is not linear."""
        sought = {key for key in tree.inside(node) if tree.reads[key] == read}
        if not all(_is_linear(one) for one in ast.walk(node) if tree.inside(one) & sought - {id(one)}):
            return None
        if any(_is_nonlinear(one, tree, sought) for one in ast.walk(node)):
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
        except Exception:  # a division by zero, or a value that is not constant
            return None

    def _with(self, way: tuple[str | NamedStep, ...], value: Any) -> Mapping[str, Any]:
        """Return an environment in which one read has a value."""
        for step in reversed(way[1:]):
            value = [{"name": step.name, "value": value}] if isinstance(step, NamedStep) else {step: value}
        root = str(way[0])
        return ChainMap({root: ChainMap(value, self._env["param"]) if root == "param" else value}, self._env)

    # -- results ------------------------------------------------------------------------------------------

    def _add(self, read: Read, bound: Any, source: str, origin: Read = ()) -> None:
        """Add a bound and propagate it; the read is unclear where it has too many, or is no plain value."""
        found = self.bounds.get(read, set())
        if read == origin or bound in found:
            return
        if isinstance(bound, str) and self._is_no_value(read, bound):
            return
        is_whole = any(kind.kind not in ("number", "integer", "text", "bool") for kind in self.kinds(read))
        is_whole = is_whole or (read[0] == "request" and len(read) > 2 and self._is_target(read[:2]))
        if read[0] == "request" and read[2:] == (ANY,):
            self.of_elements.setdefault(read[:2], set()).add(bound)
        of_element = part_of_element(read)
        if of_element is not None:
            self.parts.setdefault(of_element, set()).add(bound)
            self._mark(read, source)
            return
        if ANY in read or is_whole or len(found) >= _MOST_BOUNDS:
            self._note(read, source, lambda _: True, unknown_too=True)
            return
        self.bounds.setdefault(read, found).add(bound)
        self._waiting.append((read, bound))

    def _is_no_value(self, read: Read, text: str) -> bool:
        """Return whether a read never has a text: it is none of its words, no time, or no date."""
        kinds = self.kinds(read)
        return bool(kinds) and all(_is_text(kind) and problems(text, kind, Notation.DATA) for kind in kinds)

    def _is_target(self, read: Read) -> bool:
        """Return whether a plugin reads this by name, as a target; only one is tried."""
        kinds = (kind if kind.item is None else kind.item for kind in self.kinds(read))
        return any(kind.name in self._env.world.readers for kind in kinds)

    def _note(
        self, read: Read, source: str, is_meant: Callable[[Type], bool], unknown_too: bool = False
    ) -> None:
        """Record a read as unclear if its type fulfils a condition, or is not known and `unknown_too`."""
        kinds, of_element = self.kinds(read), part_of_element(read)
        if of_element is not None:
            self._by_value.add(of_element)
        if any(map(is_meant, kinds)) if kinds else unknown_too:
            self._mark(read, source)

    def _mark(self, read: Read, source: str) -> None:
        """Record a read as unclear."""
        if read not in self.unclear and read[0] != "param":
            self.unclear[read] = source
            self._waiting.append((read, None))

    def _propagate(self, read: Read, bound: Any) -> None:
        """Propagate a bound to the values that a read is set from; None: propagate that it is unclear."""
        for size in range(2, len(read) + 1):
            for value in self._set_from.get(read[:size], ()):
                code = _code(value)
                if code is not None:
                    self._propagate_to(
                        _Tree(code, self.chart), getattr(value, "source", ""), read, size, bound
                    )

    def _propagate_to(self, tree: _Tree, source: str, read: Read, size: int, bound: Any) -> None:
        """Propagate a bound to the expression that sets the first `size` names of a read."""
        whole, inner = tree.reads.get(id(tree.root)), read[size:]
        if bound is not None and not inner:
            self._carry(tree.root, bound, tree, source, origin=read)
        elif whole is not None and ANY not in inner:
            there = (*whole, *inner)
            if bound is None:
                self._note(there, self.unclear[read], _is_unbounded)
            else:
                self._add(there, bound, source, origin=read)
        else:
            for other in set(tree.reads.values()) - {read}:
                self._note(other, self.unclear.get(read, source), _is_unbounded)

    def kinds(self, read: Read) -> tuple[Type, ...]:
        """Return the possible types of a read; none where they are not known."""
        if read not in self._kinds:
            first = _declared(self.chart, read)
            self._kinds[read] = tuple(kind for one in first for kind in types_below(one, read[2:]))
        return self._kinds[read]


class NamedStep(NamedTuple):
    """A step into a list of records of name and value."""

    name: str


class _Tree:
    """Compiled code as a tree, with the reads of its nodes by their identity."""

    def __init__(self, code: str, chart: Chart) -> None:
        self.root = ast.parse(code, mode="eval").body
        #: The reads of nodes, their paths in the environment, and the nodes that only ask for being known.
        self.reads: dict[int, Read] = {}
        self.ways: dict[int, tuple[str | NamedStep, ...]] = {}
        self.asked: set[int] = set()
        self._chart = chart
        self._elements: dict[str, tuple[str | NamedStep, ...]] = {}
        self._find(self.root, asked=False)

    def inside(self, node: ast.AST) -> set[int]:
        """Return the reading nodes inside of a node."""
        return {id(one) for one in ast.walk(node) if id(one) in self.reads}

    def _enter(self, loop: ast.comprehension) -> None:
        """Bind the variable of a loop to the elements of its list."""
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
            for loop in node.generators:  # the checker allows one
                self._enter(loop)
        asks = isinstance(node, ast.Call) and ast.unparse(node.func) in ("_known", "len")
        for child in ast.iter_child_nodes(node):
            self._find(child, asks or (asked and (isinstance(node, ast.Lambda) or _converts(node))))

    def _way(self, node: ast.AST) -> tuple[str | NamedStep, ...] | None:
        """Return the path of a node through the environment; None where it is no path."""
        if isinstance(node, ast.Name):
            return self._elements.get(node.id) if isinstance(node.ctx, ast.Load) else None
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
        """Return the read of a path; None where no environment reports it."""
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


def part_of_element(read: Read) -> Read | None:
    """Return the path of the field that is read of a list element, () for all of it; None for other reads."""
    if _is_of_itinerary(read):
        return read[1:]
    if ANY not in read or read[0] in ("input", "param"):
        return None
    below = read[read.index(ANY) + 1 :]
    return below[: below.index(ANY)] if ANY in below else below


def field_of(element: Any, names: Read) -> Any:
    """Return a field of a list's element by its names; the element if there are none, None if it has none."""
    for name in names:
        element = element.get(name) if isinstance(element, Mapping) else None
    return element


def part(value: Any, name: str) -> Any:
    """Return a field of a record, or the value of a name in a list of records; None where there is none."""
    if isinstance(value, Mapping):
        return value.get(name)
    return next((one["value"] for one in value or () if one["name"] == name), None)


def _code(value: Value | None) -> str | None:
    compiled = value.evaluate if isinstance(value, Expression) else None
    return compiled.code if isinstance(compiled, Compiled) else None


def side(value: Any, edges: Sequence[Any]) -> tuple[int, ...]:
    """Return for each edge whether a number, time of day or date lies below (-1), at (0) or above (1) it."""
    return tuple((value > edge) - (value < edge) for edge in edges)


def _parts(text: Any) -> list[Any]:
    """Return a text and its parts, up to one more than are tried; of another value that itself."""
    if not isinstance(text, str):
        return [text]
    sizes = range(min(len(text), _MOST_BOUNDS))
    parts = (text[at : at + size] for size in sizes for at in range(len(text) - size + 1))
    return list(dict.fromkeys((text, *parts)))[: _MOST_BOUNDS + 1]


def _set_from(chart: Chart) -> dict[Read, list[Value]]:
    """Return the values that set variables, and fields of the chart's own events and requests."""
    found: dict[Read, list[Value]] = {("context", name): [one.default] for name, one in chart.context.items()}
    for read, value in itertools.chain(_set_by_actions(chart), _set_by_states(chart)):
        found.setdefault(read, []).append(value)
    return found


def _set_by_actions(chart: Chart) -> Iterator[tuple[Read, Value]]:
    for call in actions_of(chart):
        for name, value in call.arguments.items() if call.name in STORING else ():
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
    """Return the declared types of the first name below a root."""
    root, name = read[0], read[1] if len(read) > 1 else ""
    if root == "clock" and name:
        return [_CLOCK[name]]
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


def types_below(kind: Type, names: Sequence[str]) -> Iterator[Type]:
    """Yield the type of a path below a type, if there is one."""
    if not names:
        yield kind
    elif names[0] == ANY and kind.item is not None:
        yield from types_below(kind.item, names[1:])
    else:
        inner = {**kind.fields, **kind.named}.get(names[0])
        if inner is not None:
            yield from types_below(inner, names[1:])


def _has_number(kind: Type) -> bool:
    return kind.kind in ("number", "integer") or any(map(_has_number, kind.fields.values()))


def _is_unbounded(kind: Type) -> bool:
    """Return whether a type has numbers, or texts without a list of values."""
    inner = (*kind.fields.values(), *((kind.item,) if kind.item is not None else ()))
    return _has_number(kind) or _is_free_text(kind) or any(map(_is_unbounded, inner))


def _is_of_itinerary(read: Read) -> bool:
    """Return whether this reads a target or an element; targets are interchangeable."""
    return read[0] in ("item", "target")


def _is_text(kind: Type) -> bool:
    return kind.kind == "text"


def _is_free_text(kind: Type) -> bool:
    """Return whether a type has texts without a list of values."""
    return _is_text(kind) and not kind.values


def _is_list(kind: Type) -> bool:
    return kind.kind == "list" and not kind.named


def _is_nonlinear(node: ast.AST, tree: _Tree, sought: set[int]) -> bool:
    """Return whether a sought read is multiplied with itself, or is a divisor."""
    if not isinstance(node, ast.Call) or ast.unparse(node.func) not in ("_times", "_over"):
        return False
    left, right = (bool(tree.inside(operand) & sought) for operand in node.args)
    return right and (left or ast.unparse(node.func) == "_over")


def _converts(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and ast.unparse(node.func) in _LINEAR_CALLS


def _is_linear(node: ast.AST) -> bool:
    if isinstance(node, ast.Call):
        return _converts(node)
    return isinstance(node, (ast.BinOp, ast.UnaryOp)) and isinstance(node.op, _LINEAR)
