"""Converts a tree of BehaviorTree.CPP, such as those of Nav2, to the skeleton of a mission.

Each node becomes a state with two ways out, for success and for failure. Control nodes and decorators become
states and transitions. What a leaf does is not in the tree, so it becomes a question that says what is to be
written there, and has the two outcomes as answers: the mission can be checked, drawn and simulated at once.

A tree is ticked, a chart is not. What a control node does with a child on each tick (`ReactiveSequence`,
`PipelineSequence`, `RateController`, ...) is noted: it is walked once, in order.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from lupin_engine.errors import UsageError
from lupin_scxml.elements import Element, parse
from lupin_scxml.importer import Imported
from lupin_scxml.notes import Notes

#: Version 3 writes `<Action ID="Spin"/>` for `<Spin/>`.
_EXPLICIT = ("Action", "Condition", "Control", "Decorator")
_TICKED = "its children are ticked together; here each one follows on the one before"
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
#: Every leaf takes so long where nobody answers.
_STEP = "1 s"
_CODE = "tree_failed"


class _Rounds(NamedTuple):
    """States: from `begin` to `first`, from `again` to `second` while rounds are left, else to `end`."""

    begin: str
    first: str
    again: str
    second: str
    end: str


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
    wanted = root.get("main_tree_to_execute")
    main = trees.get(wanted) if wanted else next(iter(trees.values()), None)
    if root.kind != "root" or main is None:
        what = f"has no tree {wanted!r}" if trees else f"is <{root.kind}> without a <BehaviorTree>"
        raise UsageError(f"line {root.line}: the document {what}")
    return _Converter(trees).mission(main, name)


class _Converter:
    def __init__(self, trees: Mapping[str, Element]) -> None:
        self._trees = trees
        self._notes = Notes()
        self._taken = {"TREE_FAILED"}
        self._counters: dict[str, Any] = {}
        #: The state that each child of a chain begins with.
        self._firsts: dict[Element, str] = {}

    def mission(self, tree: Element, name: str) -> Imported:
        """Convert the tree that is executed."""
        inside: dict[str, Any] = {}
        first = self._only_child(tree, _NextStates("done", "TREE_FAILED"), inside, (tree,))
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

    def _only_child(
        self, holder: Element, ways: _NextStates, states: dict[str, Any], around: tuple[Element, ...]
    ) -> str:
        """Convert the child of a tree or a decorator; return the state that it begins with."""
        children = [child for child in holder.children if child.kind != "Metadata"]
        if len(children) != 1:
            raise UsageError(
                f"line {holder.line}: <{holder.kind}> has {len(children)} children; one is wanted"
            )
        return self._node(children[0], ways, states, around)

    def _node(
        self, node: Element, ways: _NextStates, states: dict[str, Any], around: tuple[Element, ...]
    ) -> str:
        """Add the states of a node; return the one that it begins with."""
        for attribute in filter(_CONDITIONS.fullmatch, node.attributes):
            self._notes.lose(node, f"the condition {attribute}={node.get(attribute)!r}")
        kind = _kind(node)
        if kind in _OUTCOMES:
            changed = _NextStates(*(ways.success if good else ways.failure for good in _OUTCOMES[kind]))
            return self._only_child(node, changed, states, around)
        if kind in ("SubTree", "SubTreePlus"):
            return self._subtree(node, ways, states, around)
        if not node.children:
            return self._leaf(node, kind, ways, states)
        convert = _CONTROLS.get(kind)
        if convert is None and len(node.children) == 1:
            self._notes.lose(node, f"what the decorator {kind} does{_ports(node)}")
            return self._only_child(node, ways, states, around)
        name = self._name(node)
        inner: dict[str, Any] = {}
        initial = (convert or _Converter._sequence)(self, node, name, ways, inner, around)
        if convert is None and kind not in _SEQUENCES:
            self._notes.lose(
                node, f"what the control node {kind} does: its children follow on one another, which"
            )
        states[name] = {"initial": initial, "states": inner} if initial else inner
        return name

    def _chain(
        self,
        node: Element,
        states: dict[str, Any],
        around: tuple[Element, ...],
        ways_to: Callable[[str], _NextStates],
        end: str,
    ) -> str:
        """Convert the children, each of which leads to the next by `ways_to`, the last one to `end`."""
        following = end
        parts: list[dict[str, Any]] = []
        for child in reversed(node.children):
            part: dict[str, Any] = {}
            following = self._firsts[child] = self._node(child, ways_to(following), part, around)
            parts.append(part)
        for part in reversed(parts):
            states.update(part)
        return following

    def _sequence(
        self, node: Element, _: str, ways: _NextStates, states: dict[str, Any], around: tuple[Element, ...]
    ) -> str:
        if text := _SEQUENCES.get(_kind(node), ""):
            self._notes.note(node, f"{_kind(node)}: {text}")
        return self._chain(
            node, states, around, lambda target: _NextStates(target, ways.failure), ways.success
        )

    def _fallback(
        self, node: Element, _: str, ways: _NextStates, states: dict[str, Any], around: tuple[Element, ...]
    ) -> str:
        if text := _FALLBACKS[_kind(node)]:
            self._notes.note(node, f"{_kind(node)}: {text}")
        return self._chain(
            node, states, around, lambda target: _NextStates(ways.success, target), ways.failure
        )

    def _round_robin(
        self, node: Element, name: str, ways: _NextStates, states: dict[str, Any], around: tuple[Element, ...]
    ) -> str:
        """Nav2's: it begins with the next child each time; after a failure with the one that follows."""
        text = "after a failure it goes on to its last child; here not to those before"
        self._notes.note(node, f"RoundRobin: {text}")
        begin, counter = self._fresh(f"{name}_BEGIN"), f"{name.lower()}_next"
        self._counters[counter] = {"type": "count", "default": 0}
        states[begin] = {}
        self._chain(node, states, around, lambda target: _NextStates(ways.success, target), ways.failure)
        firsts = [self._firsts[child] for child in node.children]
        following = [*range(1, len(firsts)), 0]
        states[begin]["always"] = [
            {
                "target": first,
                **({"guard": f"{counter} == {index}"} if following[index] else {}),
                "do": {"set": {counter: following[index]}},
            }
            for index, first in enumerate(firsts)
        ]
        return begin

    def _recovery(
        self, node: Element, name: str, ways: _NextStates, states: dict[str, Any], around: tuple[Element, ...]
    ) -> str:
        """Nav2's: after a failure of the first child the second one, then the first again, so many times."""
        if len(node.children) != 2:
            raise UsageError(
                f"line {node.line}: <RecoveryNode> has {len(node.children)} children; two are wanted"
            )
        begin, again = self._helpers(name)
        work, recovery = node.children
        first = self._node(work, _NextStates(ways.success, again), states, around)
        second = self._node(recovery, _NextStates(first, ways.failure), states, around)
        loop = _Rounds(begin, first, again, second, ways.failure)
        return self._count(name, node.get("number_of_retries") or "1", loop, states)

    def _retry(
        self, node: Element, name: str, ways: _NextStates, states: dict[str, Any], around: tuple[Element, ...]
    ) -> str:
        begin, again = self._helpers(name)
        first = self._only_child(node, _NextStates(ways.success, again), states, around)
        most = _less_one(node.get("num_attempts") or "1")
        return self._count(name, most, _Rounds(begin, first, again, first, ways.failure), states)

    def _repeat(
        self, node: Element, name: str, ways: _NextStates, states: dict[str, Any], around: tuple[Element, ...]
    ) -> str:
        begin, again = self._helpers(name)
        first = self._only_child(node, _NextStates(again, ways.failure), states, around)
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
        self, node: Element, name: str, ways: _NextStates, states: dict[str, Any], around: tuple[Element, ...]
    ) -> str:
        """All children at once: it succeeds when all have, and fails with the first failure."""
        for threshold in ("success_count", "failure_count", "success_threshold", "failure_threshold"):
            if node.get(threshold):
                self._notes.lose(node, f"{threshold}={node.get(threshold)!r}")
        regions: dict[str, Any] = {}
        for child in node.children:
            inner: dict[str, Any] = {}
            region = self._fresh(f"{name}_REGION")
            first = self._node(child, _NextStates(f"{region}.over", ways.failure), inner, around)
            regions[region] = {"initial": first, "states": {**inner, "over": {"type": "final"}}}
        states.update({"type": "parallel", "states": regions, "on_done": ways.success})
        return ""

    def _if(
        self, node: Element, _: str, ways: _NextStates, states: dict[str, Any], around: tuple[Element, ...]
    ) -> str:
        if len(node.children) not in (2, 3):
            raise UsageError(
                f"line {node.line}: <IfThenElse> has {len(node.children)} children; two or three are"
            )
        condition, *branches = node.children
        targets = [self._node(branch, ways, states, around) for branch in branches]
        return self._node(condition, _NextStates(targets[0], [*targets, ways.failure][1]), states, around)

    def _subtree(
        self, node: Element, ways: _NextStates, states: dict[str, Any], around: tuple[Element, ...]
    ) -> str:
        tree = self._trees.get(node.get("ID"))
        if tree is None or tree in around:
            why = "contains itself" if tree else "is in another file"
            self._notes.lose(node, f"the subtree {node.get('ID')!r}, which {why},")
            return self._leaf(node, f"SubTree {node.get('ID')}", ways, states)
        name = self._name(node)
        inner: dict[str, Any] = {}
        first = self._only_child(tree, ways, inner, (*around, tree))
        states[name] = {"initial": first, "states": inner}
        return name

    def _leaf(self, node: Element, kind: str, ways: _NextStates, states: dict[str, Any]) -> str:
        name = self._name(node)
        waits = re.fullmatch(r"\d+(\.\d+)?", node.get("wait_duration"))
        if kind in ("AlwaysSuccess", "AlwaysFailure"):
            states[name] = {"always": ways.success if kind == "AlwaysSuccess" else ways.failure}
        elif kind == "Wait" and waits:
            states[name] = {"after": {f"{waits[0]} s": ways.success}}
        else:
            self._notes.lose(node, f"what {kind} does")
            states[name] = {
                "summary": f"To be written: {kind}{_ports(node)}",
                "ask": {
                    "question": f"{kind}: did it succeed?",
                    "choices": {"succeeded": "Yes", "failed": "No"},
                    "default": "succeeded",
                    "after": _STEP,
                },
                "on": {"answer.succeeded": ways.success, "answer.failed": ways.failure},
            }
        return name

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


_Convert = Callable[[_Converter, Element, str, _NextStates, dict[str, Any], tuple[Element, ...]], str]
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
    }
)


def _kind(node: Element) -> str:
    return node.get("ID") or node.kind if node.kind in _EXPLICIT else node.kind


def _ports(node: Element) -> str:
    """Return what a node is given, in brackets."""
    own = {name: text for name, text in node.attributes.items() if name not in ("ID", "name")}
    ports = ", ".join(f"{name}={text}" for name, text in own.items() if not _CONDITIONS.fullmatch(name))
    return f" ({ports})" if ports else ""


def _upper(text: str) -> str:
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", text)
    name = re.sub(r"\W+", "_", words).strip("_").upper()
    return name if name[:1].isalpha() else f"STATE_{name}"


def _less_one(number: str) -> str:
    return str(int(number) - 1) if re.fullmatch(r"[1-9]\d*", number) else number
