"""Converts a tree of BehaviorTree.CPP, such as those of Nav2, to the skeleton of a mission.

Each node becomes a state with two ways out, for success and for failure. Control nodes and decorators become
states and transitions. What a leaf does is not in the tree, so it becomes a question that says what is to be
written there, and has the two outcomes as answers: the mission can be checked, drawn and simulated at once.

A tree is ticked, a chart is not. What a control node does with a child on each tick (`ReactiveSequence`,
`PipelineSequence`, `RateController`, ...) is noted: it is walked once, in order. The ports of a subtree are
written where its leaves use them.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from lupin_engine.chart import FAULT
from lupin_engine.errors import UsageError, meant
from lupin_scxml.elements import Element, parse
from lupin_scxml.importer import Imported
from lupin_scxml.notes import Notes

#: Version 3 writes `<Action ID="Spin"/>` for `<Spin/>`.
_EXPLICIT = ("Action", "Condition", "Control", "Decorator")
_TICKED = "each tick begins again with its first children; here each child runs once, after the one before"
_IN_ORDER = {"Sequence": "", "SequenceStar": "", "SequenceWithMemory": "", "AsyncSequence": ""}
_SEQUENCES = {**_IN_ORDER, "ReactiveSequence": _TICKED, "PipelineSequence": _TICKED, "PersistentSequence": ""}
_FALLBACKS = {
    "Fallback": "",
    "FallbackStar": "",
    "AsyncFallback": "",
    "Selector": "",
    "ReactiveFallback": _TICKED,
}
#: Decorators by the outcome that a child's success and its failure become; True is success.
_OUTCOMES: Mapping[str, tuple[bool, bool]] = MappingProxyType(
    {"Inverter": (False, True), "ForceSuccess": (True, True), "ForceFailure": (False, False)}
)
#: Attributes of version 4 that skip or end a node.
_CONDITIONS = re.compile(r"_(skip|success|failure|while|on)\w*|_post")
_SWITCH = re.compile(r"Switch\d+")
#: The time after which an unanswered leaf takes its default.
_STEP = "1 s"
#: Attributes of a node that are no ports.
_NO_PORTS = frozenset({"ID", "name", "_autoremap", "__shared_blackboard"})
#: A number of milliseconds.
_MILLISECONDS = re.compile(r"\d+")
_CODE = "tree_failed"


class _Rounds(NamedTuple):
    """States: from `begin` to `first`, from `again` to `second` while rounds are left, else to `end`."""

    begin: str
    first: str
    again: str
    second: str
    end: str


class _Around(NamedTuple):
    """The trees around a node, and what the ports of the innermost one stand for."""

    trees: tuple[Element, ...]
    ports: Mapping[str, str]


class _NextStates(NamedTuple):
    """The targets of the two outcomes."""

    success: str
    failure: str


def from_tree(text: bytes, name: str) -> Imported:
    """Return the skeleton of a mission that walks a behavior tree.

    Raises:
        UsageError: it is no XML, no behavior tree, or too large.
    """
    root = parse(text)
    trees = {tree.get("ID"): tree for tree in root.all("BehaviorTree")}
    if root.kind != "root" or not trees:
        raise UsageError(f"line {root.line}: the document is <{root.kind}> without a <BehaviorTree>")
    main = root.get("main_tree_to_execute") or (next(iter(trees)) if len(trees) == 1 else "")
    if main not in trees:
        problem = f"has no tree {main!r}" if main else "does not say which tree is executed"
        names = ", ".join(map(repr, trees))
        hint = f"write main_tree_to_execute=... of one of these: {names}"
        raise UsageError(f"line {root.line}: the document {problem}; {hint}")
    return _Converter(root, trees).mission(trees[main], name)


class _Converter:
    def __init__(self, root: Element, trees: Mapping[str, Element]) -> None:
        self._trees = trees
        self._notes = Notes()
        for include in root.all("include"):
            self._notes.lose(include, f"the file {include.get('path')!r} is not read: its trees")
        self._taken = {"TREE_FAILED", FAULT}
        self._counters: dict[str, Any] = {}

    def mission(self, tree: Element, name: str) -> Imported:
        """Convert the tree that is executed."""
        inside: dict[str, Any] = {}
        first = self._only_child(tree, _NextStates("done", "TREE_FAILED"), inside, _Around((tree,), {}))
        codes: dict[str, Any] = {}
        if "'TREE_FAILED'" in repr(inside):  # else nothing in it can fail
            codes[_CODE] = {"label": "the behavior tree has failed", "severity": "error"}
            inside["TREE_FAILED"] = {"always": {"target": "done", "code": _CODE}}
        mission: dict[str, Any] = {
            "mission": name,
            "summary": f"Walk the behavior tree {tree.get('ID')}.".replace(" .", "."),
            **({"codes": codes} if codes else {}),
            **({"context": self._counters} if self._counters else {}),
            "initial": first,
            "states": {**inside, "done": {"type": "final"}},
        }
        return Imported(mission, {}, self._notes.sorted(), {})

    def _only_child(self, holder: Element, ways: _NextStates, states: dict[str, Any], scope: _Around) -> str:
        """Convert the child of a tree or a decorator; return the state that it begins with."""
        children = [child for child in holder.children if child.kind != "Metadata"]
        if len(children) != 1:
            raise UsageError(
                f"line {holder.line}: <{holder.kind}> has {len(children)} children; one is wanted"
            )
        return self._node(children[0], ways, states, scope)

    def _node(self, node: Element, ways: _NextStates, states: dict[str, Any], scope: _Around) -> str:
        """Add the states of a node; return the one that it begins with."""
        for attribute in filter(_CONDITIONS.fullmatch, node.attributes):
            self._notes.lose(node, f"the condition {attribute}={node.get(attribute)!r}")
        kind = _kind(node)
        if kind in _OUTCOMES:
            changed = _NextStates(*(ways.success if good else ways.failure for good in _OUTCOMES[kind]))
            return self._only_child(node, changed, states, scope)
        if kind in ("SubTree", "SubTreePlus"):
            return self._subtree(node, ways, states, scope)
        if not node.children:
            return self._leaf(node, kind, ways, states, scope)
        convert = _CONTROLS.get(kind) or (_Converter._switch if _SWITCH.fullmatch(kind) else None)
        if convert is None:
            nearby = meant(kind, (*_CONTROLS, *_OUTCOMES, "SubTree"))
            unknown = f"what {kind}{_ports(node, scope)} does with its children{nearby and f' ({nearby})'}"
            self._notes.lose(node, unknown)
            if len(node.children) == 1:
                return self._only_child(node, ways, states, scope)
        name = self._name(node)
        inner: dict[str, Any] = {}
        initial = (convert or _Converter._sequence)(self, node, name, ways, inner, scope)
        states[name] = {"initial": initial, "states": inner, **inner.pop("", {})} if initial else inner
        return name

    def _chain(
        self,
        node: Element,
        states: dict[str, Any],
        scope: _Around,
        ways_to: Callable[[str], _NextStates],
        end: str,
    ) -> str:
        """Convert the children, each of which leads to the next by `ways_to`, the last one to `end`."""
        following = end
        parts: list[dict[str, Any]] = []
        for child in reversed(node.children):
            part: dict[str, Any] = {}
            following = self._node(child, ways_to(following), part, scope)
            parts.append(part)
        for part in reversed(parts):
            states.update(part)
        return following

    def _sequence(
        self, node: Element, _: str, ways: _NextStates, states: dict[str, Any], scope: _Around
    ) -> str:
        if text := _SEQUENCES.get(_kind(node), ""):
            self._notes.note(node, f"{_kind(node)}: {text}")
        return self._chain(
            node, states, scope, lambda target: _NextStates(target, ways.failure), ways.success
        )

    def _fallback(
        self, node: Element, _: str, ways: _NextStates, states: dict[str, Any], scope: _Around
    ) -> str:
        if text := _FALLBACKS[_kind(node)]:
            self._notes.note(node, f"{_kind(node)}: {text}")
        return self._chain(
            node, states, scope, lambda target: _NextStates(ways.success, target), ways.failure
        )

    def _round_robin(
        self, node: Element, name: str, ways: _NextStates, states: dict[str, Any], scope: _Around
    ) -> str:
        """Nav2's: each time, and after a failure, the next child; it fails when all have failed in a row."""
        begin, again = self._helpers(name)
        turn, counter = self._fresh(f"{name}_TURN"), f"{name.lower()}_next"
        self._counters[counter] = {"type": "count", "default": 0}
        firsts = [
            self._node(child, _NextStates(ways.success, again), states, scope) for child in node.children
        ]
        following = [*range(1, len(firsts)), 0]
        states[turn] = {
            "always": [
                {
                    "target": first,
                    **({"guard": f"{counter} == {index}"} if following[index] else {}),
                    "do": {"set": {counter: following[index]}},
                }
                for index, first in enumerate(firsts)
            ]
        }
        loop = _Rounds(begin, turn, again, turn, ways.failure)
        return self._count(name, str(len(firsts) - 1), loop, states)

    def _timeout(
        self, node: Element, name: str, ways: _NextStates, states: dict[str, Any], scope: _Around
    ) -> str:
        """A child that fails when it takes longer."""
        if limit := self._milliseconds(node, "msec"):
            states[""] = {"after": {limit: ways.failure}}
        return self._only_child(node, ways, states, scope)

    def _delay(
        self, node: Element, name: str, ways: _NextStates, states: dict[str, Any], scope: _Around
    ) -> str:
        first = self._only_child(node, ways, states, scope)
        begin = self._fresh(f"{name}_BEGIN")
        states[begin] = {"after": {self._milliseconds(node, "delay_msec") or _STEP: first}}
        return begin

    def _milliseconds(self, node: Element, port: str) -> str:
        """Return a duration in the language; '' after a note where it is an entry of the blackboard."""
        if _MILLISECONDS.fullmatch(node.get(port)):
            return f"{int(node.get(port)) / 1000:g} s"
        self._notes.lose(node, f"{port}={node.get(port)!r}")
        return ""

    def _recovery(
        self, node: Element, name: str, ways: _NextStates, states: dict[str, Any], scope: _Around
    ) -> str:
        """Nav2's: after a failure of the first child the second one, then the first again, so many times."""
        if len(node.children) != 2:
            raise UsageError(
                f"line {node.line}: <RecoveryNode> has {len(node.children)} children; two are wanted"
            )
        begin, again = self._helpers(name)
        work, recovery = node.children
        first = self._node(work, _NextStates(ways.success, again), states, scope)
        second = self._node(recovery, _NextStates(first, ways.failure), states, scope)
        loop = _Rounds(begin, first, again, second, ways.failure)
        return self._count(name, node.get("number_of_retries") or "1", loop, states)

    def _retry(
        self, node: Element, name: str, ways: _NextStates, states: dict[str, Any], scope: _Around
    ) -> str:
        begin, again = self._helpers(name)
        first = self._only_child(node, _NextStates(ways.success, again), states, scope)
        most = _less_one(node.get("num_attempts") or "1")
        return self._count(name, most, _Rounds(begin, first, again, first, ways.failure), states)

    def _repeat(
        self, node: Element, name: str, ways: _NextStates, states: dict[str, Any], scope: _Around
    ) -> str:
        begin, again = self._helpers(name)
        first = self._only_child(node, _NextStates(again, ways.failure), states, scope)
        most = "-1" if _kind(node) != "Repeat" else _less_one(node.get("num_cycles") or "1")
        return self._count(name, most, _Rounds(begin, first, again, first, ways.success), states)

    def _count(self, name: str, most: str, loop: _Rounds, states: dict[str, Any]) -> str:
        """Add the states that count the rounds of a loop; return the one that it begins with."""
        if not re.fullmatch(r"\d+", most):  # -1, or an entry of the blackboard
            states[loop.again] = {"always": loop.second}
            return loop.first
        counter = f"{name.lower()}_count"
        self._counters[counter] = {"type": "count", "default": 0}
        states[loop.begin] = {"always": {"target": loop.first, "do": {"set": {counter: 0}}}}
        more = {"set": {counter: f"${{ {counter} + 1 }}"}}
        next_round = {"target": loop.second, "guard": f"{counter} < {most}", "do": more}
        states[loop.again] = {"always": [next_round, loop.end]}
        return loop.begin

    def _parallel(
        self, node: Element, name: str, ways: _NextStates, states: dict[str, Any], scope: _Around
    ) -> str:
        """All children at once: it succeeds when all have, and fails with the first failure."""
        normal = {"success": ("", "-1", str(len(node.children))), "failure": ("", "1")}
        for threshold in ("success_count", "failure_count", "success_threshold", "failure_threshold"):
            if node.get(threshold) not in normal[threshold.partition("_")[0]]:
                self._notes.lose(node, f"{threshold}={node.get(threshold)!r}")
        regions: dict[str, Any] = {}
        for child in node.children:
            inner: dict[str, Any] = {}
            region = self._fresh(f"{name}_REGION")
            first = self._node(child, _NextStates(f"{region}.over", ways.failure), inner, scope)
            if f"'{region}.over'" in repr(inner):  # else it never succeeds
                inner["over"] = {"type": "final"}
            regions[region] = {"initial": first, "states": inner}
        states.update({"type": "parallel", "states": regions, "on_done": ways.success})
        return ""

    def _if(self, node: Element, _: str, ways: _NextStates, states: dict[str, Any], scope: _Around) -> str:
        kind = _kind(node)
        if len(node.children) not in (2, 3):
            raise UsageError(
                f"line {node.line}: <{kind}> has {len(node.children)} children; two or three are wanted"
            )
        if kind == "WhileDoElse":
            self._notes.note(node, f"{kind}: the condition is asked on each tick; here once, before the rest")
        condition, *branches = node.children
        targets = [self._node(branch, ways, states, scope) for branch in branches]
        return self._node(condition, _NextStates(targets[0], [*targets, ways.failure][1]), states, scope)

    def _switch(
        self, node: Element, name: str, ways: _NextStates, states: dict[str, Any], scope: _Around
    ) -> str:
        """Which child is walked depends on a variable: a question; the last child is the default."""
        cases = [node.get(f"case_{number}") or str(number) for number in range(1, len(node.children))]
        targets = [self._node(child, ways, states, scope) for child in node.children]
        labels = dict(
            zip([f"{name.lower()}_{n}" for n in range(1, len(targets) + 1)], [*cases, "another"], strict=True)
        )
        choose = self._fresh(f"{name}_CASE")
        states[choose] = self._question(
            node, choose, f"which case is {node.get('variable')}?", labels, targets
        )
        return choose

    def _subtree(self, node: Element, ways: _NextStates, states: dict[str, Any], scope: _Around) -> str:
        name = node.get("ID")
        tree = self._trees.get(name)
        if tree is None or tree in scope.trees:
            why = "contains itself" if tree else "is not in this file"
            self._notes.lose(node, f"the subtree {name!r}, which {why},")
            return self._leaf(node, f"SubTree {name}", ways, states, scope)
        state = self._name(node)
        inner: dict[str, Any] = {}
        within = _Around((*scope.trees, tree), _ports_of(node, scope))
        first = self._only_child(tree, ways, inner, within)
        states[state] = {"initial": first, "states": inner}
        return state

    def _leaf(
        self, node: Element, kind: str, ways: _NextStates, states: dict[str, Any], scope: _Around
    ) -> str:
        name = self._name(node)
        waits = re.fullmatch(r"\d+(\.\d+)?", node.get("wait_duration"))
        if kind in ("AlwaysSuccess", "AlwaysFailure"):
            states[name] = {"always": ways.success if kind == "AlwaysSuccess" else ways.failure}
        elif kind == "Wait" and waits:
            states[name] = {"after": {f"{waits[0]} s": ways.success}}
        else:
            labels = {f"{name.lower()}_succeeded": "Yes", f"{name.lower()}_failed": "No"}
            does = f"{kind}{_ports(node, scope)}"
            states[name] = self._question(node, name, f"{kind}: did it succeed?", labels, list(ways), does)
        return name

    def _question(
        self,
        node: Element,
        state: str,
        question: str,
        labels: Mapping[str, str],
        targets: Sequence[str],
        does: str = "",
    ) -> dict[str, Any]:
        """Return a state that asks for the part that the tree leaves open; its last answer is the default."""
        self._notes.write(node, f"{state}: {does or question}")
        return {
            "summary": f"To be written: {does or question}",
            "ask": {"question": question, "choices": dict(labels), "default": [*labels][-1], "after": _STEP},
            "on": {f"answer.{choice}": target for choice, target in zip(labels, targets, strict=True)},
        }

    def _helpers(self, name: str) -> tuple[str, str]:
        """Return fresh names for the states that count."""
        return self._fresh(f"{name}_BEGIN"), self._fresh(f"{name}_AGAIN")

    def _name(self, node: Element) -> str:
        """Return a name that no other state has, of a node's own name or its kind."""
        return self._fresh(_upper(node.get("name") or node.get("ID") or _kind(node)))

    def _fresh(self, wanted: str) -> str:
        name, number = wanted, 2
        while name in self._taken:
            name, number = f"{wanted}_{number}", number + 1
        self._taken.add(name)
        return name


_Convert = Callable[[_Converter, Element, str, _NextStates, dict[str, Any], _Around], str]
_CONTROLS: Mapping[str, _Convert] = MappingProxyType(
    {
        **dict.fromkeys(_SEQUENCES, _Converter._sequence),
        **dict.fromkeys(_FALLBACKS, _Converter._fallback),
        "RoundRobin": _Converter._round_robin,
        "RecoveryNode": _Converter._recovery,
        "RetryUntilSuccessful": _Converter._retry,
        "RetryUntilSuccesful": _Converter._retry,  # so it was spelt
        "Repeat": _Converter._repeat,
        "KeepRunningUntilFailure": _Converter._repeat,
        "Parallel": _Converter._parallel,
        "ParallelAll": _Converter._parallel,
        "IfThenElse": _Converter._if,
        "WhileDoElse": _Converter._if,
        "Timeout": _Converter._timeout,
        "Delay": _Converter._delay,
    }
)


def _kind(node: Element) -> str:
    return node.get("ID") or node.kind if node.kind in _EXPLICIT else node.kind


def _ports_of(node: Element, scope: _Around) -> dict[str, str]:
    """Return what a node is given, with the ports of the tree around replaced by what that is given."""
    own = {name: text for name, text in node.attributes.items() if name not in _NO_PORTS}
    return {
        name: scope.ports.get(text[1:-1], text) if text.startswith("{") else text
        for name, text in own.items()
        if not _CONDITIONS.fullmatch(name)
    }


def _ports(node: Element, scope: _Around) -> str:
    """Return what a node is given, in brackets."""
    ports = ", ".join(f"{name}={text}" for name, text in _ports_of(node, scope).items())
    return f" ({ports})" if ports else ""


def _upper(text: str) -> str:
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", text)
    plain = unicodedata.normalize("NFKD", words).encode("ascii", "ignore").decode()
    name = re.sub(r"\W+", "_", plain).strip("_").upper()
    return name if name[:1].isalpha() else f"STATE_{name}".rstrip("_")


def _less_one(number: str) -> str:
    return str(int(number) - 1) if re.fullmatch(r"[1-9]\d*", number) else number
