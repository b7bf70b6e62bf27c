"""Reads the operations of a state: its own, or one for every element of a list."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from lupin_engine.chart.compose.actions import ActionReader
from lupin_engine.chart.compose.declare import Declarer, check_code
from lupin_engine.chart.documents import ElementEndNode, ForEachNode, InvokeNode, LimitNode, RetryNode
from lupin_engine.chart.expressions.evaluation import Compiled, Expression, Value, roots_of
from lupin_engine.chart.expressions.scope import Scope
from lupin_engine.chart.expressions.values import (
    PerElement,
    Signature,
    read_arguments,
    read_condition,
    read_constant,
    read_key,
    read_list,
    read_per_element,
)
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import ActionCall, ForEach, Invoke, Retry
from lupin_engine.chart.semantics import MIN_PERIOD
from lupin_engine.chart.source import Map
from lupin_engine.plugin.contract import OPERATION_CODES, OnHold, Operation
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import ANY, COUNT, DURATION, TEXT, Type

_SOME = Type("integer", "count", minimum=1)
_FACTOR = Type("number", "number", minimum=1)
_SHARE = Type("number", "share", minimum=0, maximum=1)
#: The time between two ticks of an `every`, or two updates of an operation.
PERIOD = Type("number", "duration", unit="s", minimum=MIN_PERIOD)
#: Roots of the environment that keep their values while a state is active.
_CONSTANT_IN_A_STATE = frozenset({"param", "request", "given", "event", "functions"})


class InvokeReader:
    """Reads the operations of one chart."""

    def __init__(
        self,
        catalog: Catalog,
        declarer: Declarer,
        codes: Iterable[str],
        actions: ActionReader,
        findings: Findings,
    ) -> None:
        self._catalog = catalog
        self._declarer = declarer
        self._codes = set(codes)
        self._actions = actions
        self._findings = findings
        #: Names of all operations that were read.
        self.used: set[str] = set()

    def read(
        self, node: InvokeNode, scope: Scope, path: str, *, is_of_element: bool = False
    ) -> Invoke | None:
        """Read an operation with its limits; None when there is none of that name."""
        operation = self._catalog.operations.get(node.do)
        if operation is None:
            self._unknown(node, path)
            return None
        self.used.add(node.do)
        given = node.mapping("with")
        arguments = read_arguments(
            Signature(node.do, operation.arguments),
            given,
            node.at("do"),
            scope,
            self._findings,
            f"{path}.with",
        )
        timeout, code = self._timeout(node, scope, path)
        retry = self._retry(node.retry, operation, code, scope, f"{path}.retry") if node.retry else None
        self._check_on_hold(node, operation, path)
        on_hold = "" if node.on_hold == "again" else node.on_hold
        classes = tuple(self._classes(node, operation, f"{path}.classes"))
        update = read_key(node, "update", PERIOD, scope, self._findings, path)
        if node.update is not None:
            self._check_update(node, operation, arguments, f"{path}.update", is_of_element)
        return Invoke(
            node.do, operation, arguments, node.place, timeout, code, retry, on_hold, classes, update
        )

    def _check_update(
        self,
        node: InvokeNode,
        operation: Operation,
        arguments: Mapping[str, Value],
        path: str,
        is_of_element: bool,
    ) -> None:
        """Report an operation that cannot be updated, or of which no argument can change."""
        at = node.key_at("update")
        if is_of_element:
            problem = "the operation for an element keeps the arguments that it began with"
            self._findings.add(at, "not-updated", path, problem, "leave 'update' out")
        elif not operation.updates:
            problem = f"{node.do} does not say that its server takes a new goal in place of the old one"
            hint = (
                "leave the state and enter it again; if the server does, write 'updates: true' in its binding"
            )
            self._findings.add(at, "not-updated", path, problem, hint)
        elif arguments.keys() >= node.with_.keys() and not any(map(_may_change, arguments.values())):
            problem = f"no argument of {node.do} can change while it runs, so it is never updated"
            hint = "read an input or a variable under 'with', or leave 'update' out"
            self._findings.warn(at, "not-updated", path, problem, hint)

    def _classes(self, node: InvokeNode, operation: Operation, path: str) -> Iterator[Mapping[str, Any]]:
        """Yield results that a proof tries as well; each has the differences from the usual one."""
        for index, raw in enumerate(node.classes):
            at, fields = node.at("classes", index), operation.result
            strange = [name for name in raw if name not in fields] if isinstance(raw, Map) else []
            for name in strange:
                what = f"result of {node.do}"
                self._findings.unknown(at, "wrong-type", path, what, str(name), fields)
            if strange:
                continue
            if isinstance(raw, Map):
                fields = {name: kind for name, kind in fields.items() if name in raw}
            kind = Type("record", f"result of {node.do}", fields=fields)
            read = read_constant(raw, at, kind, self._findings, path)
            if read is not None:
                yield read.value

    def _check_on_hold(self, node: InvokeNode, operation: Operation, path: str) -> None:
        """Report a reaction to a hold's release that the operation does not allow."""
        at, path = node.at("on_hold"), f"{path}.on_hold"
        if node.on_hold != "again" and operation.on_hold is not OnHold.CANCEL:
            problem = f"a hold does not cancel {node.do}: it goes on, and its answer waits for the release"
            self._findings.add(at, "never-happens", path, problem, "leave 'on_hold' out")
        elif node.on_hold == "continue" and operation.result and not operation.cut_short:
            problem = f"{node.do} gives no result when it is cancelled, so it cannot count as done"
            self._findings.add(at, "never-happens", path, problem, "write 'on_hold: fail'")

    def _unknown(self, node: InvokeNode, path: str) -> None:
        if node.do in self._catalog.actions or node.do in self._actions.engine_actions:
            problem = f"{node.do!r} is an action, not an operation: it is done at once"
            hint = f"write it without 'invoke', such as 'entry: {{{node.do}: ...}}'"
            self._findings.add(node.at("do"), "unknown-operation", path, problem, hint)
            return
        known = self._catalog.operations
        self._findings.unknown(node.at("do"), "unknown-operation", path, "operation", node.do, known)

    def _timeout(self, node: InvokeNode, scope: Scope, path: str) -> tuple[Value | None, str | None]:
        limit = node.timeout
        if limit is None:
            problem, hint = f"nothing ends the wait for {node.do}", "add 'timeout: {after: 30 s, code: CODE}'"
            self._findings.add(node.place, "no-deadline", path, problem, hint + " or 'timeout: never'")
        if not isinstance(limit, LimitNode):
            return None, None
        path = f"{path}.timeout"
        check_code(limit.code, limit.at("code"), f"{path}.code", self._codes, self._findings)
        return read_key(limit, "after", DURATION, scope, self._findings, path), limit.code

    def _retry(
        self, node: RetryNode, operation: Operation, timeout_code: str | None, scope: Scope, path: str
    ) -> Retry | None:
        findings = self._findings
        attempts = read_key(node, "attempts", COUNT, scope, findings, path)
        backoff = read_key(node, "backoff", DURATION, scope, findings, path)
        factor = read_key(node, "factor", _FACTOR, scope, findings, path)
        jitter = read_key(node, "jitter", _SHARE, scope, findings, path)
        if node.unless:
            self._check_unless(node, operation, timeout_code, path)
        for key in ("factor", "jitter") if node.backoff is None else ():
            if getattr(node, key) is not None:
                problem = f"{key!r} changes the pauses between attempts, and there are none"
                findings.add(node.key_at(key), "missing-key", path, problem, "add 'backoff: 1 s'")
        if attempts is None:
            return None
        return Retry(attempts, backoff, frozenset(node.unless), factor, jitter)

    def _check_unless(
        self, node: RetryNode, operation: Operation, timeout_code: str | None, path: str
    ) -> None:
        """Report a code that the operation cannot end in."""
        possible = {code.name for code in operation.codes} | ({timeout_code} if timeout_code else set())
        for index, code in enumerate(node.unless):
            if code not in possible:
                at = node.at("unless", index)
                self._findings.unknown(at, "undeclared-code", path, "code of this operation", code, possible)

    # -- one for every element -----------------------------------------------------------------------------

    def for_each(self, node: ForEachNode, scope: Scope, path: str) -> ForEach | None:
        """Read a `for_each`; None after findings that leave it unusable."""
        findings = self._findings
        around = scope.without("event", "an element comes without an event")
        items = read_list(node.in_, node.at("in"), around, findings, f"{path}.in")
        kind = (items.type.item if items is not None else None) or ANY
        self._check_item(node, around, path)
        inner = around.with_item(node.item, kind)
        key = read_per_element(
            node, "key", PerElement(node.item, kind, ("text", "number")), inner, findings, path
        )
        limit = read_key(node, "limit", _SOME, around, findings, path)
        when = read_condition(node, "when", inner, findings, path)
        invoke = self.read(node.invoke, inner, f"{path}.invoke", is_of_element=True)
        done = self._end(node.on_done, inner.with_names(names_when_done(invoke)), f"{path}.on_done")
        error = self._end(node.on_error, inner.with_names(names_when_failed(invoke)), f"{path}.on_error")
        if items is None or key is None or invoke is None:
            return None
        return ForEach(node.item, items, key, invoke, node.place, limit, when, done, error)

    def _check_item(self, node: ForEachNode, scope: Scope, path: str) -> None:
        """Report a name of the element that is no name, or that is a variable of the chart."""
        place, path = node.at("item"), f"{path}.item"
        if self._declarer.good_name("element", node.item, place, path) and node.item in scope.names:
            problem = f"{node.item!r} is a variable of the chart, the element would hide it"
            self._findings.add(place, "bad-name", path, problem, "choose another name")

    def _end(self, node: ElementEndNode | None, scope: Scope, path: str) -> tuple[ActionCall, ...]:
        return self._actions.read(node.do, scope, f"{path}.do") if node else ()


def _may_change(argument: Value) -> bool:
    """Say whether an argument can have another value later in the same state."""
    if not isinstance(argument, Expression):
        return False
    code = argument.evaluate.code if isinstance(argument.evaluate, Compiled) else ""
    return not code or not roots_of(code) <= _CONSTANT_IN_A_STATE


def names_when_done(invoke: Invoke | None) -> Mapping[str, Type]:
    """Return the names that are visible after success of an operation, or after the end of a state."""
    return {"event": Type("record", "event", fields=invoke.operation.result) if invoke else ANY}


def names_when_failed(invoke: Invoke | None) -> Mapping[str, Type]:
    """Return the names that are visible after a failure: its code is one of the operation's."""
    code = TEXT
    if invoke is not None:
        known = {code.name for code in invoke.operation.codes} | {*OPERATION_CODES}
        known |= {invoke.timeout_code} if invoke.timeout_code else set()
        code = Type("text", "text", values=tuple(sorted(known)))
    fields = {"code": code, "detail": TEXT}
    if invoke is not None and invoke.operation.cut_short:
        fields["result"] = Type("record", "result", fields=invoke.operation.result)
    return {"error": Type("record", "error", fields=fields), "event": ANY}
