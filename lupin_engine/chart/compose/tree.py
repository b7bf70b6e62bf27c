"""Builds the tree of states before they are filled, and resolves names in it.

The lifecycle's tree is grown with the missions in its slot and every part expanded where it is used, so that
all full names are known before the first expression or target is read.

A name is resolved in the nearest enclosing scope: among a state's own children, then its parent's, up to the
root's. Further words of a dotted name descend from there. The states of a part come last in the scope of the
state that uses it. An embedded mission resolves names as it does alone: its own states, then those of the
lifecycle.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias, TypeVar

from lupin_engine.chart.compose.declare import NAME
from lupin_engine.chart.documents import FileNode, LifecycleNode, MissionNode, PartNode, StateNode
from lupin_engine.chart.expressions.scope import Scope
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import Kind
from lupin_engine.chart.nodes import Node
from lupin_engine.chart.source import map_at
from lupin_engine.errors import Place, nearest

MAX_STATES = 5000

_KINDS: Mapping[str | None, Kind] = {
    "parallel": Kind.PARALLEL,
    "final": Kind.FINAL,
    "history": Kind.HISTORY,
    None: Kind.ATOMIC,
}
_DEPTHS: Mapping[str | None, int | None] = {"shallow": 1, "deep": None, None: 1}

#: What a state can use.
UsedNode: TypeAlias = PartNode | MissionNode
_F = TypeVar("_F", bound=FileNode)


@dataclass(slots=True)
class Draft:
    """A state that is being composed.

    `node` is its text (None for the root, a mission's wrapper and an implied history state); `file` is the
    file of that text, `part` its part or mission; `within` is the innermost state around that uses a mission.
    `scope` is that of its own expressions, `inner` that of its children's; both are filled from the top down,
    as is `out`: the variables that the used part writes, by its own names.
    """

    name: str
    kind: Kind
    place: Place
    file: FileNode
    parent: Draft | None = None
    node: StateNode | None = None
    part: UsedNode | None = None
    mission: str = ""
    within: str = ""
    slot: bool = False
    label: str = ""
    depth: int | None = None
    children: dict[str, Draft] = field(default_factory=dict)
    scope: Scope | None = None
    inner: Scope | None = None
    out: Mapping[str, str] = field(default_factory=dict)

    @property
    def local(self) -> str:
        """The last word of the name."""
        return self.name.rpartition(".")[2]

    @property
    def initial(self) -> tuple[str, Place] | None:
        """The written initial child, and its place; None where none is written, and for the slot."""
        if self.slot or (self.kind is Kind.HISTORY and self.node is None):
            return None
        holder: FileNode | StateNode = self.node or self.file
        if holder.initial is None and self.part is not None:
            holder = self.part
        return None if holder.initial is None else (holder.initial, holder.at("initial"))

    def up(self) -> Iterator[Draft]:
        """Yield this state and its ancestors, innermost first."""
        draft: Draft | None = self
        while draft is not None:
            yield draft
            draft = draft.parent


class Forest:
    """Grows the tree of a chart and resolves names in it."""

    def __init__(self, parts: Mapping[str, UsedNode], findings: Findings) -> None:
        self._parts = parts
        self._findings = findings
        self._circles: set[frozenset[Place]] = set()
        self.drafts: dict[str, Draft] = {}

    def grow(self, lifecycle: LifecycleNode, missions: list[MissionNode]) -> Draft:
        """Grow the whole tree; `drafts` then holds it in document order."""
        root = Draft("", Kind.COMPOUND, lifecycle.key_at("lifecycle"), lifecycle)
        self.drafts[""] = root
        self._children(root, lifecycle.states, lifecycle, missions)
        slots = [draft for draft in self.drafts.values() if draft.slot]
        if not slots:
            hint = "add a state with 'slot: mission'"
            self._findings.add(
                lifecycle.key_at("states"), "wrong-shape", "", "no state takes the missions", hint
            )
        for extra in slots[1:]:
            at = extra.node.key_at("slot") if extra.node else extra.place
            self._findings.add(at, "wrong-shape", extra.name, f"a second slot, after {slots[0].name!r}")
        return root

    # -- growing -------------------------------------------------------------------------------------------

    def _children(
        self,
        parent: Draft,
        states: Mapping[str, StateNode | None],
        file: FileNode,
        missions: list[MissionNode] | None = None,
    ) -> None:
        holder = parent.part or parent.node or file
        written = holder.mapping("states")
        for name, node in states.items():
            place = holder.place if written is None else written.key_place(name)
            if not NAME.fullmatch(name):
                problem, hint = (
                    f"{name!r} cannot be the name of a state",
                    "use letters, digits and underscores",
                )
                self._findings.add(place, "bad-name", parent.name, problem, hint)
                continue
            self._state(parent, name, node or _empty(place), place, file, missions)

    def _state(
        self,
        parent: Draft,
        name: str,
        node: StateNode,
        place: Place,
        file: FileNode,
        missions: list[MissionNode] | None,
    ) -> None:
        full = f"{parent.name}.{name}" if parent.name else name
        if len(self.drafts) >= MAX_STATES:
            problem = f"more than {MAX_STATES} states, parts counted as often as they are used"
            self._findings.add(place, "too-large", "", problem)
            return
        within = parent.name if isinstance(parent.part, MissionNode) else parent.within
        draft = Draft(full, _KINDS[node.type], place, file, parent, node, None, parent.mission, within)
        draft.label = _label(parent, name)
        self._check_shape(draft, node)
        self.drafts[full] = parent.children[name] = draft
        if node.slot:
            self._fill_slot(draft, node, missions)
        elif node.use is not None:
            self._use(draft, node, node.use)
        elif node.states:
            self._children(draft, node.states, file, missions)
        if not draft.children:
            self._check_filled(draft, node)
        else:
            self._check_one_end(draft, node)
        if node.history is not None:
            self._add_history(draft, node)
        if draft.children and draft.kind is Kind.ATOMIC:
            draft.kind = Kind.COMPOUND

    def _enter(self, parent: Draft, draft: Draft) -> None:
        self.drafts[draft.name] = draft
        parent.children[draft.local] = draft

    def _fill_slot(self, draft: Draft, node: StateNode, missions: list[MissionNode] | None) -> None:
        if missions is None:
            problem = "only the lifecycle has a slot, and not inside a mission or part"
            self._findings.add(node.key_at("slot"), "wrong-shape", draft.name, problem)
            return
        draft.slot, draft.label, draft.kind = True, "", Kind.COMPOUND
        for mission in missions:
            place = mission.at("mission")
            full = f"{draft.name}.{mission.name}"
            if not NAME.fullmatch(mission.name):
                problem, hint = (
                    f"{mission.name!r} cannot name a mission",
                    "use letters, digits and underscores",
                )
                self._findings.add(place, "bad-name", "mission", problem, hint)
                continue
            if full in self.drafts:
                problem = f"a second mission is called {mission.name!r}"
                first = self.drafts[full].place.file
                self._findings.add(
                    place, "conflicting-definition", "mission", problem, f"the other is in {first}"
                )
                continue
            wrapper = Draft(full, Kind.COMPOUND, place, mission, draft, mission=mission.name)
            self._enter(draft, wrapper)
            self._children(wrapper, mission.states, mission)

    def _use(self, draft: Draft, node: StateNode, name: str) -> None:
        part = self._parts[name]  # the loader goes no further without one
        if node.states:
            problem = "a state has either states of its own or a part's"
            self._findings.add(node.key_at("states"), "wrong-shape", draft.name, problem, "drop one of them")
            return
        if isinstance(part, MissionNode) and not self._can_use(draft, node, name):
            return
        if any(above.part is part or above.file is part for above in draft.up()):
            self._report_circle(draft, node, part)
            return
        draft.part = part
        self._children(draft, part.states, part)

    def _can_use(self, draft: Draft, node: StateNode, name: str) -> bool:
        """Say whether a state may use a mission; a finding outside of missions and in a parallel state."""
        problem, hint, key = "", "write a part of the states that both need", "use"
        if not draft.mission:
            problem = f"{name!r} is a mission, and only a mission can use one"
        elif draft.kind is Kind.PARALLEL:
            problem, key = f"the mission {name!r} begins in one of its states, not in all of them", "type"
            hint = "give it a state of its own inside"
        if problem:
            self._findings.add(node.key_at(key), "wrong-shape", draft.name, problem, hint)
        return not problem

    def _report_circle(self, draft: Draft, node: StateNode, part: UsedNode) -> None:
        """Report parts and missions that contain each other, once however many of them are loaded."""
        circle = [draft]
        for above in draft.up():
            if above.part is part or above.node is None:
                break
            if above.part is not None:
                circle.append(above)
        nodes = [each.node for each in reversed(circle) if each.node is not None]
        if (places := frozenset(node.at("use") for node in nodes)) in self._circles:
            return
        self._circles.add(places)
        what = "part" if isinstance(part, PartNode) else "mission"
        problem = f"the {what} {str(node.use)!r} contains itself"
        if len(nodes) > 1:
            problem += ": " + ", ".join(f"{each.at('use')} uses {str(each.use)!r}" for each in nodes)
        self._findings.add(node.at("use"), "part-loop", draft.name, problem)

    def _add_history(self, draft: Draft, node: StateNode) -> None:
        if "history" in draft.children:
            problem = "a child is already called 'history'"
            self._findings.add(node.key_at("history"), "bad-name", draft.name, problem, "rename that child")
            return
        depth = None if node.history == "deep" else 2 if draft.slot else 1
        history = Draft(f"{draft.name}.history", Kind.HISTORY, node.key_at("history"), draft.file, draft)
        history.depth, history.mission, history.within = depth, draft.mission, draft.within
        self._enter(draft, history)

    def _check_shape(self, draft: Draft, node: StateNode) -> None:
        """Report keys that have no meaning in a state of this kind."""
        if draft.kind is Kind.FINAL:
            allowed = {"type", "summary", "entry", "phase", "result"}
        elif draft.kind is Kind.HISTORY:
            allowed, draft.depth = {"type", "summary", "depth", "initial"}, _DEPTHS[node.depth]
        else:
            self._check_ordinary(draft, node)
            return
        for key in sorted(node.model_fields_set - allowed):
            shown = key.rstrip("_")
            problem = f"a {draft.kind.value} state has no {shown!r}"
            self._findings.add(node.key_at(shown), "wrong-shape", draft.name, problem)

    def _check_filled(self, draft: Draft, node: StateNode) -> None:
        """Report keys of compound states in a state without children."""
        if draft.slot or node.use is not None:
            return
        for key, written in (("type", node.type == "parallel"), ("history", node.history is not None)):
            if written:
                problem = f"a state with '{key}: {getattr(node, key)}' has states inside, this has none"
                self._findings.add(node.key_at(key), "wrong-shape", draft.name, problem, f"drop {key!r}")

    def _check_ordinary(self, draft: Draft, node: StateNode) -> None:
        if node.result:
            problem = "only a final state has a result"
            at = node.key_at("result")
            self._findings.add(at, "wrong-shape", draft.name, problem, "add 'type: final'")
        if node.depth is not None:
            hint = "write 'type: history' beside it, or 'history: deep'"
            self._findings.add(
                node.key_at("depth"), "wrong-shape", draft.name, "only a history state has a depth", hint
            )
        if node.with_ and node.use is None:
            problem, hint = "'with' gives a part its parameters, but no part is used", "add 'use: PART'"
            self._findings.add(node.key_at("with"), "wrong-shape", draft.name, problem, hint)
        if node.out and not isinstance(self._parts.get(node.use or ""), PartNode):
            problem = "'out' takes what a part reports, but no part is used"
            hint = "add 'use: PART'" if node.use is None else "of a mission, 'on_done' reads the 'result'"
            self._findings.add(node.key_at("out"), "wrong-shape", draft.name, problem, hint)
        if node.slot and (node.states or node.use or node.initial):
            problem = "the missions stand in a slot, it has no states of its own"
            self._findings.add(node.key_at("slot"), "wrong-shape", draft.name, problem)
        if node.invoke is not None and node.slot:
            problem = "a slot invokes nothing: its on_done is the end of the mission"
            self._findings.add(
                node.key_at("invoke"), "wrong-shape", draft.name, problem, "leave 'invoke' out"
            )
        if node.for_each is not None:
            self._check_for_each(draft, node)

    def _check_for_each(self, draft: Draft, node: StateNode) -> None:
        """Report keys that exclude a `for_each`."""
        alone = "give the for_each a state of its own, a region of a 'type: parallel' state"
        inside = "an element's end is handled inside 'for_each'"
        hints = {"invoke": alone, "states": alone, "use": alone, "slot": alone}
        hints |= {"on_done": inside, "on_error": inside}
        for key in sorted(node.model_fields_set & hints.keys()):
            problem = f"a state with 'for_each' has no {key!r}"
            self._findings.add(node.key_at(key), "wrong-shape", draft.name, problem, hints[key])

    def _check_one_end(self, draft: Draft, node: StateNode) -> None:
        """Report a state that ends with its operation and with a child: both would be one event."""
        if node.invoke is None or draft.slot or not _can_end(draft):
            return
        inside = "all its regions end" if draft.kind is Kind.PARALLEL else "a final state inside is reached"
        problem = f"this state ends when {node.invoke.do} does, and also when {inside}"
        hint = "move the invocation into a state inside, or let nothing inside be final"
        self._findings.add(node.key_at("invoke"), "wrong-shape", draft.name, problem, hint)

    # -- names ---------------------------------------------------------------------------------------------

    def scopes(self, start: Draft, inside: bool = False) -> Iterator[Draft]:
        """Yield the states among whose children a name in `start` is resolved, in order.

        A state that uses a part looks around itself: the names inside a part are private. With `inside` the
        name is written in the file of the mission that `start` uses.
        """
        scope = start if start.part is None or inside else start.parent
        while scope is not None:
            yield scope
            used = isinstance(scope.part, MissionNode)
            scope = scope.parent
            while used and scope is not None and scope.mission:
                scope = scope.parent

    def find(self, name: str, start: Draft, inside: bool = False) -> list[Draft]:
        """Return the states that `name` means seen from `start`, the nearest first; see `scopes`.

        The states of a part come last in the scope of the state that uses it.
        """
        first, dot, rest = name.partition(".")
        found = [s.children[first] for s in self.scopes(start, inside) if first in s.children]
        if isinstance(start.part, PartNode) and first in start.children:
            found.append(start.children[first])
        for word in rest.split(".") if dot else ():
            found = [draft.children[word] for draft in found if word in draft.children]
        return found

    def resolve(
        self, name: str, start: Draft, node: Node, key: str, path: str, inside: bool = False
    ) -> str | None:
        """Return the full name of the state that `name` means seen from `start`; None after a finding.

        The name stands in `node` under `key`; `inside` as in `scopes`.
        """
        found = self.find(name, start, inside)
        if len(found) == 1:
            return found[0].name
        place = node.at(key)
        if not found:
            scopes = self.scopes(start, inside)
            visible = {child for scope in scopes for child in scope.children if not scope.slot}
            hint = self._hint(name, start, visible)
            self._findings.add(place, "unknown-state", path, f"no state is called {name!r} here", hint)
            return None
        for hidden in found[1:]:
            if _apart(found[0], hidden):
                continue
            problem = f"{name!r} means {found[0].name!r} here, which hides {hidden.name!r}"
            self._findings.warn(place, "shadowed-state", path, problem, "rename one of them")
        return found[0].name

    def resolve_child(self, name: str, parent: Draft, place: Place, path: str) -> str | None:
        """Return the full name of a descendant that is entered; None after a finding."""
        draft: Draft | None = parent
        for word in name.split("."):
            draft = draft.children.get(word) if draft is not None else None
        if draft is None:
            problem = f"{parent.name or 'the root'} has no state {name!r}"
            self._findings.add(place, "unknown-state", path, problem, nearest(name, parent.children))
            return None
        if draft.kind is Kind.HISTORY:
            problem = f"{name!r} only remembers: nothing can begin there"
            self._findings.add(place, "wrong-shape", path, problem, "name a state that can be active")
            return None
        return draft.name

    def _hint(self, name: str, start: Draft, visible: set[str]) -> str:
        """Offer the nearest name in scope, or say where a state of that name stands."""
        if name.count("."):
            first, _, last = name.rpartition(".")
            holders = self.find(first, start)
            if holders:
                inside = holders[0].children
                return nearest(last, inside) if inside else f"{holders[0].name!r} has no states inside"
        elsewhere = sorted(draft.name for draft in self.drafts.values() if draft.name and draft.local == name)
        if elsewhere:
            return f"{elsewhere[0]!r} is out of scope from here"
        return nearest(name, visible)


def each_once(files: Iterable[_F]) -> list[_F]:
    """Return files, each once: a mission may be offered and used."""
    return list({id(file): file for file in files}.values())


def texts_of(draft: Draft) -> list[StateNode | FileNode]:
    """Return the nodes of a state, with the file of a mission that it uses."""
    own: StateNode | FileNode = draft.node or draft.file
    return [own, draft.part] if isinstance(draft.part, MissionNode) else [own]


def _apart(one: Draft, other: Draft) -> bool:
    """Say whether two states stand in different files, one of them in a part: neither can name the other."""
    files = (one.file, other.file)
    return one.file is not other.file and (
        any(isinstance(file, PartNode) for file in files)
        and not any(isinstance(file, LifecycleNode) for file in files)
    )


def _can_end(draft: Draft) -> bool:
    """Say whether a state can complete: it has a final child, or is parallel and every region can."""
    children = [child for child in draft.children.values() if child.kind is not Kind.HISTORY]
    if draft.kind is Kind.PARALLEL:
        return bool(children) and all(child.kind is Kind.FINAL or _can_end(child) for child in children)
    return any(child.kind is Kind.FINAL for child in children)


def _label(parent: Draft, name: str) -> str:
    """Return the lifecycle state that a state is published as: the outermost one, or the mission's child."""
    outermost = not parent.name or (parent.node is None and parent.mission)
    return name if outermost else parent.label


def _empty(place: Place) -> StateNode:
    """Return the node of a state of which nothing is written but the name."""
    return StateNode.model_validate(map_at(place))
