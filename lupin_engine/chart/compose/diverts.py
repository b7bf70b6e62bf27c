"""Lets the diverts of the lifecycle wait for states that are finished, or left in order, first.

A divert is a transition that leads from the slot, or a state around it, out of the mission: on a request, a
level of an input or a time, or without an event. Errors and events of plugins lead out at once, and holds are
no transitions. `before_divert` becomes ordinary transitions. For a divert and a state that is left in order:

    WORK:                                        WORK:                         # and exit: {set: {divert: ""}}
      slot: mission                                always:
      on:                                            - {guard: divert == ID and not waits, target: AWAY}
        operator.away: AWAY                        on:
                                                     operator.away:
      CARRY:                                           - {guard: waits and divert != ID, do: set divert}
        before_divert:                                 - {guard: not waits, target: AWAY}
          leave_by: PUT_DOWN                       CARRY:
          within: 60 s                               always: {guard: a divert waits, target: PUT_DOWN}
        states: {PUT_DOWN: ...}                      states:
                                                       PUT_DOWN: {after: {60 s: set divert_due}}

Elsewhere in the mission what needs no event has the guard `divert == ''`: it is further in than a divert.
`waits` is `in_state('CARRY') and not divert_due`. A request takes the place of the divert that waits; a level
or a time does not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from lupin_engine.chart.compose.transitions import any_event, path_of
from lupin_engine.chart.compose.tree import Draft, Forest
from lupin_engine.chart.documents import BeforeDivertNode
from lupin_engine.chart.expressions.condition import Condition
from lupin_engine.chart.expressions.evaluation import Constant
from lupin_engine.chart.expressions.values import read_guard, read_key
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import ActionCall, BeforeDivert, Kind, State, Timer, Transition, Variable
from lupin_engine.chart.semantics import DIVERT, DIVERT_DUE, TIMERS
from lupin_engine.chart.source import text_at
from lupin_engine.errors import Place
from lupin_engine.plugin.contract import DIVERT_CODE
from lupin_engine.plugin.types import ANY, BOOL, DURATION, TEXT


class Diverts:
    """The states of one chart that diverts wait for; they are known when the tree is."""

    def __init__(self, forest: Forest, findings: Findings) -> None:
        self._forest = forest
        self._findings = findings
        #: Each with its text.
        self._waited_for: dict[str, BeforeDivertNode] = {}
        for draft in forest.drafts.values():
            if draft.node is not None and draft.node.before_divert is not None and self._is_apart(draft):
                self._waited_for[draft.name] = draft.node.before_divert

    def _is_apart(self, draft: Draft) -> bool:
        """Say whether a state may have a `before_divert`; a finding otherwise."""
        assert draft.node is not None
        place, problem, hint = draft.node.key_at("before_divert"), "", ""
        together = next((name for name in self._waited_for if self._are_active_together(name, draft)), None)
        if not draft.mission:
            problem = "only a state of a mission is left by a divert"
            hint = "move it into a state of the mission"
        elif together is not None:
            problem = f"{together!r} is active at the same time, and a divert waits for it already"
            hint = "let one of them have it"
        if problem:
            self._findings.add(place, "wrong-shape", path_of(draft.name, "before_divert"), problem, hint)
        return not problem

    def _are_active_together(self, name: str, other: Draft) -> bool:
        """Say whether a state can be active together with another one: around it, in it, or beside it."""
        above = list(other.up())
        for draft in self._forest.drafts[name].up():
            if draft in above:
                below = {name, other.name}
                return draft.kind is Kind.PARALLEL or draft.name in below
        return False

    def declare(self, context: dict[str, Variable]) -> None:
        """Declare the variables of a chart in which a divert may wait."""
        if not self._waited_for:
            return
        node = self._forest.drafts[next(iter(self._waited_for))].node
        assert node is not None
        place = node.key_at("before_divert")
        for variable, kind, default in ((DIVERT, TEXT, ""), (DIVERT_DUE, BOOL, False)):
            if variable in context:
                problem, at = f"the variable {variable!r} is that of 'before_divert'", context[variable].place
                path = f"context.{variable}"
                self._findings.add(at, "conflicting-definition", path, problem, "rename yours")
            context[variable] = Variable(variable, kind, Constant(default, place, kind), place, True)

    def put_off(self, states: Mapping[str, State]) -> dict[str, State]:
        """Return the states of the chart with the transitions that let diverts wait."""
        found = dict(states)
        for name, node in self._waited_for.items():
            self._leave_in_order(name, node, found)
        if self._waited_for:
            found = {name: self._after_diverts(state) for name, state in found.items()}
        around = {above.name for name in self._waited_for for above in _outside(self._forest.drafts[name])}
        for name in around:
            found[name] = self._that_waits(found[name])
            if found[name].slot:
                done = _set(DIVERT, "", found[name].place)
                found[name] = replace(found[name], exit=(*found[name].exit, done))
        return found

    # -- the states that are waited for -------------------------------------------------------------------

    def _leave_in_order(self, name: str, node: BeforeDivertNode, states: dict[str, State]) -> None:
        """Add the way on which a state is left, and its limit."""
        draft, path, place = self._forest.drafts[name], path_of(name, "before_divert"), node.place
        assert draft.scope is not None
        within = read_key(node, "within", DURATION, draft.scope, self._findings, path)
        way = None
        if node.leave_by is not None:
            way = self._forest.resolve_child(node.leave_by, draft, node.at("leave_by"), path)
        if within is None or (way is None and node.leave_by is not None):
            return
        state = replace(states[name], before_divert=BeforeDivert(within, way))
        states[name] = replace(state, entry=(_set(DIVERT_DUE, False, place), *state.entry))
        if way is not None:
            waits = f"{DIVERT} != '' and not {DIVERT_DUE} and not in_state('{way}')"
            leave = Transition(path, "", name, place, way, self._condition(waits, draft, place), derived=True)
            states[name] = replace(states[name], transitions=(leave, *state.transitions))
            states[way] = replace(states[way], entry=(_set(DIVERT_DUE, False, place), *states[way].entry))
        limited = way or name
        states[limited] = _with_limit(states[limited], Timer("", within, node.at("within")))

    def _after_diverts(self, state: State) -> State:
        """Return a state of a mission whose transitions without an event come after a divert that waits.

        They are further in, and would be preferred.
        """
        inside = any(above.name in self._waited_for for above in self._forest.drafts[state.name].up())
        if inside or not state.mission:
            return state
        rules = [
            self._only_if(rule, f"{DIVERT} == ''")
            if rule.event == "" or rule.event.startswith("input.")
            else rule
            for rule in state.transitions
        ]
        return replace(state, transitions=tuple(rules))

    # -- the diverts --------------------------------------------------------------------------------------

    def _that_waits(self, state: State) -> State:
        """Return the slot, or a state around it, with diverts that wait."""
        later: list[Transition] = []
        rules: list[Transition] = []
        for rule in state.transitions:
            if _is_divert(rule):
                *now, afterwards = self._written_out(rule)
                rules += now
                later.append(afterwards)
            else:
                rules.append(rule)
        return replace(state, transitions=(*later, *rules))

    def _written_out(self, rule: Transition) -> Iterator[Transition]:
        """Yield how a divert is put off, refused while it waits, taken at once and, last, taken later."""
        waits, own = self._waits, _own_guard(rule)
        asked = rule.event.startswith("operator.")
        others = f"{DIVERT} != '{rule.id}'" if asked else f"{DIVERT} == ''"
        yield replace(
            self._guarded(rule, "waits", f"{own}{waits} and {others}"),
            target=None,
            actions=(_set(DIVERT, rule.id, rule.place),),
            code=DIVERT_CODE,
            detail=None,
        )
        if asked:
            again = self._guarded(rule, "again", f"{own}{waits}")
            yield replace(again, target=None, actions=(), code=None, detail=None, refuse=DIVERT_CODE)
        yield self._only_if(rule, f"not ({waits})")
        afterwards = self._guarded(rule, "afterwards", f"{DIVERT} == '{rule.id}' and not ({waits})")
        yield replace(afterwards, event="")

    @property
    def _waits(self) -> str:
        """The condition under which a divert waits."""
        active = " or ".join(f"in_state('{name}')" for name in self._waited_for)
        return f"({active}) and not {DIVERT_DUE}"

    def _only_if(self, rule: Transition, condition: str) -> Transition:
        """Return a written transition that is taken only if a condition holds as well."""
        guarded = self._guarded(rule, "", f"{_own_guard(rule)}{condition}")
        return replace(guarded, derived=False, written=rule.guard)

    def _guarded(self, rule: Transition, word: str, guard: str) -> Transition:
        """Return a transition with another guard; `word` is the last of its id."""
        draft = self._forest.drafts[rule.source]
        inside = rule.id.startswith(path_of(rule.source, "use.on."))
        condition = self._condition(guard, draft, rule.place, inside)
        return replace(rule, id=f"{rule.id}.{word}".rstrip("."), guard=condition, derived=True)

    def _condition(self, text: str, draft: Draft, place: Place, inside: bool = False) -> Condition:
        """Read a condition; `inside`: of the mission that the state uses."""
        scope = draft.inner.with_names({"event": ANY}) if inside and draft.inner else any_event(draft)
        found = read_guard(text_at(text, place), place, scope, self._findings, path_of(draft.name, "on"))
        assert found is not None, f"{text} is no condition"
        return Condition(found.source, found.place, found.type, found.evaluate, found.parts)


def _own_guard(rule: Transition) -> str:
    """Return the guard of a transition, to be continued by a further condition."""
    return f"({rule.guard.source}) and " if rule.guard else ""


def _outside(draft: Draft) -> Iterator[Draft]:
    """Yield the slot that a state of a mission stands in, and the states around it."""
    return (above for above in draft.up() if not above.mission)


def _is_divert(rule: Transition) -> bool:
    """Say whether a transition of the slot, or of a state around it, is a divert: see above."""
    asked = rule.event.startswith(("operator.", "input.", *TIMERS)) or rule.event in ("", "budget")
    return asked and rule.target is not None


def _set(variable: str, value: object, place: Place) -> ActionCall:
    kind = BOOL if isinstance(value, bool) else TEXT
    return ActionCall("set", {variable: Constant(value, place, kind)}, place)


def _with_limit(state: State, limit: Timer) -> State:
    """Return a state with a clock at whose end no divert waits any more."""
    event = f"after.{sum(1 for timer in state.timers if timer.word == 'after')}"
    name, actions = f"{state.name}.before_divert.within", (_set(DIVERT_DUE, True, limit.place),)
    due = Transition(name, event, state.name, limit.place, actions=actions, derived=True)
    return replace(
        state, transitions=(*state.transitions, due), timers=(*state.timers, replace(limit, event=event))
    )
