"""Actions: the engine's own and the plugins', read with typed arguments."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from lupin_engine.chart.compose.carried import Carried
from lupin_engine.chart.compose.declare import NAME, check_code, check_status
from lupin_engine.chart.documents import ActionNode, IfNode, RaiseNode
from lupin_engine.chart.expressions.evaluation import Constant, Value
from lupin_engine.chart.expressions.scope import Scope
from lupin_engine.chart.expressions.units import with_article
from lupin_engine.chart.expressions.values import (
    Signature,
    check_bound,
    read_arguments,
    read_condition,
    read_under,
)
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import WRITING, ActionCall, Variable
from lupin_engine.chart.source import Map
from lupin_engine.errors import Place, declared_as, nearest, or_else
from lupin_engine.plugin.contract import Argument
from lupin_engine.plugin.profile import Profile
from lupin_engine.plugin.registry import RESERVED_EVENTS, Catalog
from lupin_engine.plugin.types import ANY, TEXT, Type

#: The engine's own actions whose arguments are no fixed list.
STRUCTURED = (*WRITING, "raise", "if")

_CODE = Argument(TEXT, "the reason, a declared code", optional=True)
_DETAIL = Argument(TEXT, "free text for people", optional=True)
_READING = Argument(ANY, "what was read there", optional=True)


def builtin_actions(profile: Profile) -> Mapping[str, Mapping[str, Argument]]:
    """Return the engine's own actions with their arguments, besides those that are `STRUCTURED`."""
    status = Argument(TEXT, f"how the visit ended: {', '.join(profile.statuses)}")
    return {
        "itinerary.advance": {},
        "itinerary.close": {"status": status, "code": _CODE, "detail": _DETAIL, "reading": _READING},
        "itinerary.close_rest": {"status": status, "code": _CODE, "detail": _DETAIL},
        "report.clear": {},
        "report.note": {"text": Argument(TEXT, "what the log and the story of the run say")},
        "report.summary": {},
        **{name: publication.arguments for name, publication in profile.publications.items()},
    }


class ActionReader:
    """Reads actions of one chart."""

    def __init__(
        self,
        catalog: Catalog,
        variables: Mapping[str, Variable],
        codes: Iterable[str],
        carried: Carried,
        findings: Findings,
    ) -> None:
        self._catalog = catalog
        self._builtin = builtin_actions(catalog.profile)
        #: Names of the engine's own actions.
        self.engine_actions = (*self._builtin, *STRUCTURED)
        self._variables = variables
        self._codes = set(codes)
        self._carried = carried
        self._findings = findings
        #: Names of all actions that were read.
        self.used: set[str] = set()

    def read(self, nodes: Sequence[ActionNode], scope: Scope, path: str) -> tuple[ActionCall, ...]:
        """Read a list of actions; those with findings are left out."""
        found = [self._action(node, scope, f"{path}.{node.name}") for node in nodes]
        return tuple([action for action in found if action is not None])

    def _action(self, node: ActionNode, scope: Scope, path: str) -> ActionCall | None:
        given = node.arguments if isinstance(node.arguments, Map) else None
        if node.name in WRITING:
            return self._write(node, given, scope, path)
        if node.name == "raise":
            return self._raise(node.raise_, node.place, scope, path)
        if node.name == "if":
            return self._if(node.if_, node.place, scope, path)
        action = self._catalog.actions.get(node.name)
        wanted = action.arguments if action else self._builtin.get(node.name)
        if wanted is None:
            self._unknown(node, path)
            return None
        if node.name in ("itinerary.advance", "itinerary.close") and "itinerary" in scope.absent:
            problem = f"{node.name} needs an itinerary, and no state around this one has one"
            self._findings.add(
                node.place, "missing-itinerary", path, problem, "add 'itinerary: {items: ...}'"
            )
            return None
        arguments = read_arguments(
            Signature(node.name, wanted), given, node.place, scope, self._findings, path
        )
        if node.name.startswith("itinerary."):
            self._check_close(arguments, path)
        self.used.add(node.name)
        return ActionCall(node.name, arguments, node.place, action.moves if action else False)

    def _if(self, node: IfNode | None, place: Place, scope: Scope, path: str) -> ActionCall | None:
        if node is None:
            hint = "write 'if: {guard: CONDITION, then: ACTIONS}'"
            self._findings.add(place, "missing-argument", path, "if has no guard and no actions", hint)
            return None
        guard = read_condition(node, "guard", scope, self._findings, path)
        then = self.read(node.then, scope, f"{path}.then")
        otherwise = self.read(node.else_, scope, f"{path}.else")
        return ActionCall("if", {}, place, False, {}, guard, then, otherwise)

    def _unknown(self, node: ActionNode, path: str) -> None:
        if node.name in self._catalog.operations:
            problem = f"{node.name!r} is an operation, not an action: it takes time"
            hint = f"give it a state with 'invoke: {{do: {node.name}, timeout: ...}}'"
            self._findings.add(node.place, "unknown-action", path, problem, hint)
            return
        known = [*self.engine_actions, *self._catalog.actions]
        self._findings.unknown(node.place, "unknown-action", path, "action", node.name, known)

    def _write(self, node: ActionNode, given: Map | None, scope: Scope, path: str) -> ActionCall | None:
        """Read `set`, which writes variables, and `add` and `remove`, which change the elements of a list.

        A variable with a finding is left out; None after a finding that no variable is named.
        """
        if not given:
            hint = f"write '{node.name}: {{NAME: VALUE}}'"
            problem = f"{node.name} names no variable"
            self._findings.add(node.place, "missing-argument", path, problem, hint)
            return None
        found: dict[str, Value] = {}
        for name in given:
            variable = scope.out.get(name, str(name))
            if not variable:
                continue  # the use of the part has a finding about it
            if variable not in self._variables:
                known = {**scope.out, **self._variables}
                hint = nearest(name, known) if known else ""
                hint, problem = or_else(hint, declared_as("context", name)), f"unknown variable {str(name)!r}"
                self._findings.add(given.key_place(name), "unknown-argument", path, problem, hint)
                continue
            kind = self._variables[variable].type
            at = given.key_place(name)
            wanted = kind if node.name == "set" else self._element(node, at, name, kind, path)
            if wanted is None:
                continue
            value = read_under(given, name, wanted, scope, self._findings, f"{path}.{name}")
            if value is not None:
                check_bound(value, wanted, str(name), self._findings, f"{path}.{name}")
                found[variable] = value
        return ActionCall(node.name, found, node.place)

    def _element(self, node: ActionNode, place: Place, name: str, kind: Type, path: str) -> Type | None:
        """Return the element type of a list that actions change; None after findings."""
        if kind.item is None:
            problem, hint = f"{name!r} is {with_article(kind)}", f"{node.name} needs a list or a set"
            self._findings.add(place, "wrong-type", path, problem, hint)
        elif kind.maximum is None and node.name == "add":
            problem = f"nothing says how many elements {name!r} holds at most, so it could grow without end"
            self._findings.add(place, "unbounded", path, problem, "declare it with 'max: NUMBER'")
        else:
            return kind.item
        return None

    def _raise(self, node: RaiseNode | None, place: Place, scope: Scope, path: str) -> ActionCall | None:
        if node is None:
            hint = "write 'raise: {event: NAME}'"
            self._findings.add(place, "missing-argument", path, "raise names no event", hint)
            return None
        name, at = node.event, node.at("event")
        words = name.split(".")
        if not all(map(NAME.fullmatch, words)):
            hint = "use words of letters, digits and underscores, with dots between"
            self._findings.add(at, "bad-name", path, f"{str(name)!r} cannot be an event", hint)
            return None
        if words[0] in RESERVED_EVENTS or name in self._catalog.events:
            whose = "the engine itself" if words[0] in RESERVED_EVENTS else "the plugin itself"
            problem = f"{str(name)!r} cannot be raised: events of {words[0]!r} come from {whose}"
            self._findings.add(at, "bad-name", path, problem, "begin it with another word")
            return None
        data = self._carried.read(str(name), node.mapping("with"), at, scope, f"{path}.with")
        return ActionCall("raise", {"event": Constant(str(name), at, TEXT)}, place, False, data)

    def _check_close(self, arguments: Mapping[str, Value], path: str) -> None:
        status, code = arguments.get("status"), arguments.get("code")
        allowed = self._catalog.profile.statuses
        if isinstance(status, Constant):
            check_status(status.value, status.place, f"{path}.status", allowed, self._findings)
        if isinstance(code, Constant):
            check_code(code.value, code.place, f"{path}.code", self._codes, self._findings)


def raised_events(nodes: Iterable[ActionNode]) -> Iterator[str]:
    """Yield the names that these actions raise."""
    return (str(node.raise_.event) for node in nodes if node.raise_ is not None)
