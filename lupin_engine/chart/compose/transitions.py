"""Reads the transitions of a state: on ends, events and time, in the order of the language."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from lupin_engine.chart.compose.actions import ActionReader
from lupin_engine.chart.compose.carried import Carried, end_of
from lupin_engine.chart.compose.declare import NAME, Declared, check_code
from lupin_engine.chart.compose.invoke import names_when_done, names_when_failed
from lupin_engine.chart.compose.tree import Draft, Forest
from lupin_engine.chart.documents import (
    AskNode,
    BudgetNode,
    FileNode,
    MissionNode,
    PartNode,
    StateNode,
    TransitionNode,
)
from lupin_engine.chart.expressions.evaluation import Constant
from lupin_engine.chart.expressions.scope import Scope
from lupin_engine.chart.expressions.values import read_condition, read_key
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import Invoke, Prompt, Transition
from lupin_engine.chart.semantics import TIMERS, matches
from lupin_engine.chart.strictness import stricter
from lupin_engine.errors import Place, Severity, nearest
from lupin_engine.plugin.contract import Code
from lupin_engine.plugin.profile import ANSWER, START
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import ANY, DURATION, TEXT, Type

_START = Type("record", "event", fields={"mission_type": TEXT, "mission_id": TEXT})
_ANSWER = Type("record", "event", fields={"by": Type("text", "text", values=("default", "operator"))})
_NOTHING = Type("record", "event")
_NO_HOLDS: frozenset[str] = frozenset()

_Names = Callable[[Invoke | None], Mapping[str, Type]]


@dataclass(frozen=True)
class TransitionSite:
    """The key of a state under which transitions are written, and their event and evaluation scope.

    `owner` writes them and `source` takes them: they differ for copies only. `inside`: they are written in
    the file of the mission that the state uses.
    """

    source: Draft
    owner: Draft
    key: str
    event: str
    scope: Scope
    inside: bool = False


@dataclass(frozen=True)
class CompositionContext:
    """The shared data of a composition; `outer` returns the scope around a state."""

    catalog: Catalog
    declared: Declared
    forest: Forest
    codes: Mapping[str, Code]
    events: Mapping[str, None]
    carried: Carried
    outer: Callable[[Draft], Scope]
    findings: Findings


class TransitionReader:
    """Reads the transitions of one chart."""

    def __init__(self, context: CompositionContext, actions: ActionReader) -> None:
        self._catalog = context.catalog
        self._declared = context.declared
        self._forest = context.forest
        self._codes = context.codes
        self._events = context.events
        self._carried = context.carried
        self._outer = context.outer
        self._findings = context.findings
        self._actions = actions
        self._event_types: dict[str, Type] = {}
        self._after_work: dict[tuple[Scope, _Names, str, str | None], Scope] = {}
        #: Names of all events that are listened to.
        self.heard: set[str] = set()

    def read(
        self, draft: Draft, node: StateNode, invoke: Invoke | None, any_event: Scope
    ) -> tuple[Transition, ...]:
        """Compose the transitions of a state on ends, events and time, in the order of the language."""
        assert draft.scope is not None
        scope = draft.scope
        found: list[Transition] = []
        if node.on_done:
            ended = self._after(scope, names_when_done, invoke)
            if node.invoke is None and node.for_each is None:
                ended = scope.with_event(self._carried.fields_of(end_of(draft.name)))
            found += self._list(node.on_done, TransitionSite(draft, draft, "on_done", "done", ended))
        if node.on_error:
            failed = self._after(scope, names_when_failed, invoke)
            found += self._list(node.on_error, TransitionSite(draft, draft, "on_error", "error", failed))
        if node.on:
            found += self.handlers(draft, node, node.on)
        if node.always:
            found += self._list(node.always, TransitionSite(draft, draft, "always", "", any_event))
        for word, timed in (("after", node.after), ("every", node.every), ("at", node.at_)):
            for index, nodes in enumerate(timed.values()):
                event = f"{word}.{index}"
                found += self._list(nodes, TransitionSite(draft, draft, event, event, any_event))
        if node.budget is not None:
            found.append(self._when_used_up(draft, node.budget))
        return tuple(found)

    def _after(self, scope: Scope, names: _Names, invoke: Invoke | None) -> Scope:
        """Return the scope after an operation, cached for all states that invoke it."""
        key = (scope, names, invoke.name if invoke else "", invoke.timeout_code if invoke else None)
        found = self._after_work.get(key)
        if found is None:
            found = self._after_work[key] = scope.with_names(names(invoke))
        return found

    def of_used(self, draft: Draft) -> list[Transition]:
        """Compose the transitions of an embedded mission that its file declares for all its states."""
        return self.handlers(draft, draft.part, draft.part.on) if isinstance(draft.part, MissionNode) else []

    def handlers(
        self, draft: Draft, holder: StateNode | FileNode, handlers: Mapping[str, list[TransitionNode]]
    ) -> list[Transition]:
        """Compose the event handlers of a state: its own, or those of the file of the mission it uses."""
        found: list[Transition] = []
        inside = holder is draft.part
        for event, nodes in handlers.items():
            # What an unknown event leads to is read all the same: a slip in its name hides no other.
            known = self._is_event(event, holder, draft) or event.startswith("operator.")
            heard = event if known else f"unknown.{event}"
            found += self._handler(draft, event, nodes, heard, inside)
        return found

    def _handler(
        self, draft: Draft, event: str, nodes: list[TransitionNode], heard: str, inside: bool
    ) -> list[Transition]:
        self._check_release(draft, event, nodes)
        copies = [node for node in nodes if node.use is not None]
        if not copies:
            scope, key = self._event_scope(draft, event, inside), f"{'use.' if inside else ''}on.{event}"
            return self._list(nodes, TransitionSite(draft, draft, key, heard, scope, inside))
        node, path = copies[0], path_of(draft.name, f"on.{event}")
        if len(nodes) > 1 or node.model_fields_set != {"use"}:
            problem, hint = "'use' copies all that the other state answers", "let it stand alone"
            self._findings.add(node.key_at("use"), "wrong-shape", path, problem, hint)
            return []
        return self._copy(draft, event, node, path, inside)

    def _check_release(self, draft: Draft, event: str, nodes: list[TransitionNode]) -> None:
        """Report that a mission refuses, whatever happens, what alone releases a hold."""
        last = nodes[-1].guard if nodes else ""
        if not draft.mission or last not in (None, "true") or any(node.refuse is None for node in nodes):
            return
        for hold in self._declared.holds.values():
            asked = [request for request in hold.release if request != START]
            if asked and all(matches(event, request) for request in asked):
                problem = f"only {' or '.join(map(repr, asked))} releases the hold {hold.name!r} here"
                problem += ", and this always refuses it: the robot is held for ever"
                place, path = nodes[-1].key_at("refuse"), path_of(draft.name, f"on.{event}")
                hint = "add a guard, or remove it"
                self._findings.extend([stricter("refused-release", place, path, problem, hint)])
                return

    def _copy(
        self, draft: Draft, event: str, node: TransitionNode, path: str, inside: bool
    ) -> list[Transition]:
        """Compose another state's transitions for an event again, with this state as their source."""
        name = self._forest.resolve(node.use or "", draft, node, "use", path, inside)
        other = self._forest.drafts[name] if name is not None else None
        if other is None:
            return []
        answers = other.node.on.get(event, []) if other.node else []
        if not answers or any(answer.use for answer in answers):
            problem = f"{other.name!r} has no answer of its own to {event!r}"
            self._findings.add(node.at("use"), "unknown-state", path, problem, "name a state that answers it")
            return []
        if other.scope is None:
            other.scope = self._outer(other)
        site = TransitionSite(draft, other, f"on.{event}", event, self._event_scope(other, event))
        return self._list(answers, site)

    def _when_used_up(self, draft: Draft, node: BudgetNode) -> Transition:
        """Compose the transition of a state's budget."""
        path = path_of(draft.name, "budget")
        check_code(node.code, node.at("code"), f"{path}.code", self._codes, self._findings)
        return Transition(
            id=path,
            event="budget",
            source=draft.name,
            place=node.place,
            target=self._forest.resolve(node.target, draft, node, "target", path),
            actions=self._actions.read(node.do, any_event(draft), f"{path}.do"),
            code=node.code,
            detail=read_key(node, "detail", TEXT, any_event(draft), self._findings, path),
        )

    def ask(self, draft: Draft, node: AskNode) -> Prompt | None:
        """Compose the question of a state; None after findings about its text or its time limit."""
        path, findings = path_of(draft.name, "ask"), self._findings
        scope = any_event(draft)
        question = read_key(node, "question", TEXT, scope, findings, path)
        after = read_key(node, "after", DURATION, scope, findings, path)
        for name in node.choices:
            if not NAME.fullmatch(name):
                hint = "use letters, digits and underscores"
                place, problem = node.key_at("choices", name), f"{name!r} cannot be a choice"
                findings.add(place, "bad-name", f"{path}.choices", problem, hint)
        if node.default not in node.choices:
            findings.unknown(
                node.at("default"),
                "unknown-argument",
                f"{path}.default",
                "choice",
                node.default,
                node.choices,
            )
        if question is None or after is None:
            return None
        if isinstance(after, Constant) and not after.value:
            problem = "nobody can answer: the time to answer is over when the question is asked"
            hint = "write a time, such as '2 min'"
            findings.warn(node.at("after"), "out-of-range", f"{path}.after", problem, hint)
        choices = {
            name: Code(name, choice.label, Severity[choice.severity.upper()])
            for name, choice in node.choices.items()
        }
        return Prompt(question, choices, node.default, after, node.place)

    def _is_event(self, event: str, holder: StateNode | FileNode, draft: Draft) -> bool:
        """Say whether an event that `holder` listens to can arrive."""
        if event in self._events or event == "*":
            return True
        return self._check_event(event, holder.key_at("on", event), path_of(draft.name, f"on.{event}"))

    def _check_event(self, event: str, place: Place, path: str) -> bool:
        if event.endswith(".*") and any(known.startswith(event[:-1]) for known in self._events):
            if event.startswith("input."):
                problem = "levels cannot be listened to all at once"
                self._findings.add(place, "unknown-event", path, problem, "name each of them")
                return False
            return True
        allowed = self._events
        named = event.removeprefix("input.").partition(".")[0]
        if event == f"input.{named}" and named in self._declared.inputs:
            levels = [name for name in allowed if name.startswith(f"{event}.")]
            problem = f"{event!r} is a {self._declared.inputs[named].type}, which is no event"
            hint = nearest(event, levels) if levels else "only a yes or no, or a level, can be listened to"
            self._findings.add(place, "unknown-event", path, problem, hint)
            return False
        self._findings.unknown(place, "unknown-event", path, "event", event, allowed)
        return False

    def _event_scope(self, draft: Draft, event: str, inside: bool = False) -> Scope:
        scope = draft.inner if inside else draft.scope
        assert scope is not None
        if event not in self._event_types:  # a scope remembers what it derived by the type's identity
            known = event in self._events or event.startswith("operator.")
            self._event_types[event] = event_type(event, self._catalog, self._carried) if known else ANY
        return scope.with_event(self._event_types[event])

    def _list(self, nodes: Sequence[TransitionNode], site: TransitionSite) -> list[Transition]:
        """Compose the transitions of one key of a state."""
        self.heard.add(site.event)
        prefix, found = path_of(site.source.name, site.key), []
        for index, node in enumerate(nodes):
            id = prefix if index == 0 and site.key.startswith(TIMERS) else f"{prefix}.{index}"
            found.append(self._transition(node, id, site))
        return found

    def _transition(self, node: TransitionNode, id: str, site: TransitionSite) -> Transition:
        event, scope, path = site.event, site.scope, path_of(site.owner.name, site.key)
        if node.use is not None:
            problem = "only the answer to an event can be copied"
            self._findings.add(node.key_at("use"), "wrong-shape", path, problem)
        target, refuse, code = node.target, node.refuse, node.code
        resolved = None
        if target is not None:
            resolved = self._forest.resolve(target, site.owner, node, "target", path, site.inside)
        if refuse is not None or code is not None:
            self._check_codes(node, path)
        if refuse is not None or target is None or node.detail is not None or node.value is not None:
            self._check_sense(node, event, path)
        return Transition(
            id,
            event,
            site.source.name,
            node.place,
            resolved,
            read_condition(node, "guard", scope, self._findings, path),
            self._actions.read(node.do, scope, f"{path}.do") if node.do else (),
            refuse,
            self._hold_names(node, "during", path) if node.during else _NO_HOLDS,
            self._hold_names(node, "releases", path) if node.releases else _NO_HOLDS,
            code,
            node.internal,
            None if node.detail is None else read_key(node, "detail", TEXT, scope, self._findings, path),
            None if node.value is None else read_key(node, "value", ANY, scope, self._findings, path),
        )

    def _check_codes(self, node: TransitionNode, path: str) -> None:
        for word in ("refuse", "code"):
            code = getattr(node, word)
            if code is not None:
                check_code(code, node.at(word), path, self._codes, self._findings)

    def _check_sense(self, node: TransitionNode, event: str, path: str) -> None:
        """Report keys that contradict each other."""
        is_request = event in self._catalog.profile.events or event.startswith(("operator.", ANSWER))
        if node.refuse is not None and not is_request:
            problem = "only a request can be refused"
            self._findings.add(node.key_at("refuse"), "wrong-shape", path, problem, "leave 'refuse' out")
        elif node.refuse is not None and (node.target is not None or node.do):
            problem = "a refusal changes nothing, so it has no target and no actions"
            self._findings.add(node.key_at("refuse"), "wrong-shape", path, problem, "write two transitions")
        elif node.value is not None and node.refuse is None:
            problem, hint = "'value' stands beside a refusal", "leave it out, or add 'refuse: CODE'"
            self._findings.add(node.key_at("value"), "wrong-shape", path, problem, hint)
        elif node.detail is not None and node.code is None:
            problem = "'detail' stands beside a code"
            hint = "leave it out" if node.refuse is not None else "add 'code: CODE'"
            self._findings.add(node.key_at("detail"), "wrong-shape", path, problem, hint)
        elif event.startswith("input.") and node.target is None:
            problem = f"while {event} is true this would be taken for ever"
            self._findings.add(node.place, "level-without-target", path, problem, "add 'target: STATE'")

    def _hold_names(self, node: TransitionNode, key: str, path: str) -> frozenset[str]:
        found = set()
        for index, name in enumerate(getattr(node, key)):
            place = node.at(key, index)
            hold = self._declared.holds.get(name)
            if hold is None:
                self._findings.unknown(place, "unknown-hold", path, "hold", name, self._declared.holds)
            elif key == "releases" and hold.engage.startswith("input."):
                problem = f"the hold {name!r} follows {hold.engage} and can only be released by a person"
                self._findings.add(place, "releases-level-hold", path, problem, f"write 'during: {name}'")
            else:
                found.add(name)
        return frozenset(found)

    def resume_at(self, draft: Draft, node: StateNode) -> tuple[Transition, ...]:
        """Compose which child is entered on coming back; a use may decide otherwise than its part."""
        part = draft.part if isinstance(draft.part, PartNode) else None
        own = node.resume_at or (part.resume_at if part else [])
        if not own:
            return ()
        inner = draft.scope if node.resume_at else draft.inner
        assert inner is not None
        scope = inner.with_names({"event": ANY})
        path = path_of(draft.name, "resume_at")
        found = []
        for index, written in enumerate(own):
            if written.target is None:
                hint = "add 'target: CHILD'"
                self._findings.add(written.place, "missing-key", path, "'resume_at' names a child", hint)
                continue
            target = self._forest.resolve_child(written.target, draft, written.at("target"), path)
            guard = read_condition(written, "guard", scope, self._findings, path)
            found.append(
                Transition(f"{path}.{index}", "resume", draft.name, written.place, target=target, guard=guard)
            )
        return tuple(found)


def event_type(event: str, catalog: Catalog, carried: Carried) -> Type:
    """Return the payload type of an event."""
    if event == "mission.start":
        return _START
    if event in catalog.events:
        return Type("record", "event", fields=catalog.events[event].fields)
    if event.startswith("operator."):
        return _NOTHING
    if event.startswith(ANSWER):
        return _ANSWER
    return ANY if event.endswith("*") else carried.fields_of(event)


def any_event(draft: Draft) -> Scope:
    """Return a state's scope with the event that led there, of which nothing is known beforehand."""
    assert draft.scope is not None
    return draft.scope.with_event(ANY)


def path_of(state: str, word: str) -> str:
    """Return the path of a word in a state, for findings."""
    return f"{state}.{word}" if state else word
