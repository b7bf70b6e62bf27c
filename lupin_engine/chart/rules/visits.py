"""Rules about the visits of an itinerary: each is closed once, and only then the iteration advances.

A data-flow analysis: for every atomic state of an itinerary it computes whether the visit may be open or
closed there, along all ways from the itinerary's entry, with guards on `itinerary.open` and `in_state`. Parts
that are not followed (parallel states, an itinerary inside) are not judged, and only certain mistakes are
reported.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import takewhile

from lupin_engine.chart.expressions.evaluation import Constant, Expression, Value
from lupin_engine.chart.expressions.guards import Every, Formula, fact, negate, possible
from lupin_engine.chart.findings import warning
from lupin_engine.chart.model import ActionCall, Kind, State, Transition, every_call
from lupin_engine.chart.rules.index import OF_ONE_STATE, Index, always_taken, guard_of, local, taken_when
from lupin_engine.chart.semantics import matches
from lupin_engine.chart.strictness import stricter
from lupin_engine.errors import Diagnostic

#: What a visit may be.
OPEN, CLOSED = "open", "closed"
_EITHER = frozenset([OPEN, CLOSED])

Visit = frozenset[str]
#: What guards are followed for.
_ASKED = ("itinerary.open", "in_state(")
_IN_STATE = re.compile(r"""\bin_state\(\s*['"]([\w.]+)['"]\s*\)""")


def visits(index: Index) -> Iterator[Diagnostic]:
    """Find a visit that is closed a second time, and an advance over an open visit."""
    for walker in index.states:
        if walker.itinerary is not None:
            inside = list(_below(index, walker))
            followed = not any(
                state.kind is Kind.PARALLEL or state.for_each is not None or state.itinerary is not None
                for state in inside
                if state is not walker
            )
            analysis = _VisitAnalysis(index, walker, inside) if followed else None
            refused = [] if analysis is None else [*analysis.refused(), *analysis.refused_at_once()]
            yield from refused or _never_closed(index, walker)
            if analysis is not None and _may_be_empty(index, walker):
                yield from analysis.read_without_target()


def published_twice(index: Index) -> Iterator[Diagnostic]:
    """Find a publication about a target beside its visit, which publishes when it is closed."""
    for written in index.calls:
        publication = index.chart.catalog.profile.publications.get(written.action.name)
        lineage = index.lineage[written.state.name]
        if publication is None or all(index.chart.states[name].itinerary is None for name in lineage):
            continue
        target = written.action.arguments.get(publication.target[0])
        if isinstance(target, Expression) and _TARGET.search(target.source):
            problem = "a visit publishes what was read when it is closed, so this target is published twice"
            hint = f"hand it over there: 'itinerary.close: {{status: {publication.outcome}, reading: ...}}'"
            yield warning(written.action.place, "double-close", written.path, problem, hint)


def _never_closed(index: Index, walker: State) -> Iterator[Diagnostic]:
    """Find the going on of a walk that closes no visit anywhere, wherever the visits may come from."""
    calls = [call for state in _below(index, walker, stop_at_walks=True) for call in _calls(state)]
    if any(call.action.name.startswith("itinerary.close") for call in calls):
        return
    for call in calls:
        problem = f"no visit is ever closed in {local(walker.name)!r}, so this would be refused"
        hint = "close each before: 'itinerary.close: {status: ...}'"
        yield Diagnostic(call.action.place, "open-visit", call.path, problem, hint)


def _calls(state: State) -> Iterator[_VisitCall]:
    """Yield the itinerary actions of a state."""
    lists = [(f"{transition.id}.do", transition.actions) for transition in state.transitions]
    own = [(f"{state.name}.entry", state.on_entry), (f"{state.name}.exit", state.on_exit)]
    for path, actions in [*own, *lists]:
        calls = every_call(actions)
        yield from (_VisitCall(call, path) for call in calls if call.name.startswith("itinerary."))


def _below(index: Index, state: State, stop_at_walks: bool = False) -> Iterator[State]:
    """Yield a state and those inside it; a walk inside has its own visits."""
    yield state
    for child in (index.chart.states[name] for name in state.children):
        if not (stop_at_walks and child.itinerary is not None):
            yield from _below(index, child, stop_at_walks)


@dataclass(frozen=True)
class _VisitCall:
    """An action on the itinerary, and the path of the list that it stands in."""

    action: ActionCall
    path: str


@dataclass(frozen=True)
class _VisitStep:
    """The effect of a transition on the visit: its conditions, its calls, and the atomic states it enters.

    After a `vague` step, by a history or a guard with mistakes, the visit may be either.
    """

    transition: Transition
    when: tuple[Formula, ...]
    calls: tuple[_VisitCall, ...]
    leaves: tuple[str, ...]
    vague: bool = False


class _VisitAnalysis:
    """The possible visits in each atomic state of one itinerary."""

    def __init__(self, index: Index, walker: State, inside: Sequence[State]) -> None:
        self._index = index
        assert walker.itinerary is not None
        self._walker, self._items = walker, walker.itinerary.items
        self._inside = {state.name: state for state in inside}
        leaving = {state.name: list(_walking(f"{state.name}.exit", state.on_exit)) for state in inside}
        self._leaving = {name: calls for name, calls in leaving.items() if calls}
        leaves = [state for state in inside if state.kind is not Kind.HISTORY and not index.begun(state)]
        self._at: dict[str, Visit] = {leaf.name: frozenset() for leaf in leaves}
        self._known: dict[str, _VisitStep] = {}
        self._steps = {leaf.name: list(self._steps_of(leaf)) for leaf in leaves}
        self._settle()

    def refused(self) -> Iterator[Diagnostic]:
        """Report calls that the machine would refuse whenever they are reached."""
        reported: set[int] = set()
        for leaf, visit in self._at.items():
            for step in self._steps[leaf]:
                if not guard_of(step.transition).understood:
                    continue
                for call, before in self._along(step.calls, _those(visit, step.when))[0]:
                    if before == _REFUSED.get(call.action.name) and id(call.action) not in reported:
                        reported.add(id(call.action))
                        yield _finding(leaf, call)

    def refused_at_once(self) -> Iterator[Diagnostic]:
        """Report calls that the machine would refuse at the itinerary's start, although not later."""
        first, walker = frozenset([OPEN]), local(self._walker.name)
        reached = self._along(self._entries(self._walker.name), first)[0]
        for _, steps in self._at_once(_FIRST, first):
            for step in steps:
                reached += [one for one in self._along(step.calls, first)[0] if one[0] in step.calls]
        for call, before in reached:
            if call.action.name == "itinerary.advance" and before == first:
                problem = f"{walker!r} begins with its first target, whose visit is open: refused at once"
                hint = "let 'initial' name the state that works on a target, and advance when it is closed"
                yield stricter("first-visit-open", call.action.place, call.path, problem, hint)
                return

    def read_without_target(self) -> Iterator[Diagnostic]:
        """Report reads of a target before a check whether there is one."""
        entered = [self._inside[name] for name in self._index.entered(self._walker.name)]
        resting = [leaf for leaf, steps in self._at_once(_EMPTY, frozenset([CLOSED])) if not steps]
        around = dict.fromkeys(name for leaf in resting for name in self._index.lineage[leaf])
        waiting = [self._inside[name] for name in around if name in self._inside]
        for said in self._index.sayings:
            word = said.words[1] if len(said.words) > 1 else ""
            at_once = said.state in entered if word == "entry" else word == "invoke" and said.state in waiting
            if at_once and isinstance(said.value, Expression) and _TARGET.search(said.value.source):
                hint = "leave before: 'always: {target: ..., guard: itinerary.total == 0}'"
                if word == "entry":
                    hint = "do this in a state that is entered only where 'itinerary.total > 0'"
                if getattr(self._items, "source", "").startswith("request."):
                    hint += ", or refuse such a request with 'not_empty: CODE'"
                problem = f"there is no target where the itinerary of {local(self._walker.name)!r} is empty"
                path = ".".join(filter(None, said.words))
                yield warning(said.value.place, "no-target", path, problem, hint)
                return

    def _at_once(self, given: Formula, visit: Visit) -> Iterator[tuple[str, list[_VisitStep]]]:
        """Yield the atomic states that are entered at the itinerary's start, with the steps taken at once.

        It follows only conditions on the itinerary, and the visit stays as it is.
        """
        waiting, seen = [name for name in self._index.entered(self._walker.name) if name in self._at], set()
        while waiting:
            leaf = waiting.pop()
            steps = None if leaf in seen else self._taken_at_once(leaf, given)
            seen.add(leaf)
            if steps is not None:
                yield leaf, steps
                follow = (step for step in steps if self._along(step.calls, visit)[1] == visit)
                waiting += [name for step in follow if not step.vague for name in step.leaves]

    def _taken_at_once(self, leaf: str, given: Formula) -> list[_VisitStep] | None:
        """Return the steps without an event that may be the one taken; None where something else decides."""
        found, so_far = [], [given]
        for step in self._steps[leaf]:
            asked = taken_when(step.transition)
            if step.transition.event or not possible(*so_far, asked):
                continue
            if _OTHER_NAMES.search(guard_of(step.transition).source):
                return None
            found.append(step)
            so_far.append(negate(asked))
        return found

    # -- ways ----------------------------------------------------------------------------------------------

    def _steps_of(self, leaf: State) -> Iterator[_VisitStep]:
        """Yield the possible steps in an atomic state, up to the state with the itinerary."""
        around = [self._inside[name] for name in self._index.lineage[leaf.name] if name in self._inside]
        restless = any(not t.event and always_taken(t) for state in around for t in state.transitions)
        heard = (t for state in around for t in state.transitions if self._hears(leaf, t))
        sure: list[str] = []
        for transition in heard:
            if restless and transition.event:
                continue
            if not any(matches(event, transition.event) for event in sure):
                step, known = self._step_from(leaf, transition), self._states_asked(leaf, transition)
                yield replace(step, when=(*known, *step.when)) if known else step
            if always_taken(transition) and not transition.event.startswith(OF_ONE_STATE):
                sure.append(transition.event)

    def _states_asked(self, leaf: State, transition: Transition) -> tuple[Formula, ...]:
        """Return the values of `in_state` in an atomic state, as far as the guards of its transitions ask."""
        beside, found = self._inside[transition.source].transitions, []
        for name in dict.fromkeys(asked for t in beside for asked in _IN_STATE.findall(guard_of(t).source)):
            named = [full for full in self._index.chart.states if f".{full}".endswith(f".{name}")]
            around = self._index.lineage[leaf.name]
            if any(full in around for full in named):
                found.append(fact(f"in_state({name!r})", value=True))
            elif all(self._excluded(full, around) for full in named):
                found.append(fact(f"in_state({name!r})", value=False))
        return tuple(found)

    def _excluded(self, name: str, around: Sequence[str]) -> bool:
        """Say whether a state cannot be active together with those around an atomic one."""
        common = next(above for above in self._index.lineage[name] if above in around)
        return self._index.chart.states[common].kind is not Kind.PARALLEL

    def _hears(self, leaf: State, transition: Transition) -> bool:
        """Say whether an event can arrive in an atomic state; `done` means the state that has just ended."""
        source = self._inside[transition.source]
        if transition.event == "done":
            return source.invoke is not None or (leaf.kind is Kind.FINAL and source.name == leaf.parent)
        if transition.event == "error":
            return source is leaf or source.invoke is not None
        left = leaf.kind is Kind.FINAL and any(
            t.event == "done" and always_taken(t) for t in self._inside[leaf.parent or ""].transitions
        )
        return not left or not transition.event

    def _step_from(self, leaf: State, transition: Transition) -> _VisitStep:
        """Return a step with the exit actions of the atomic state."""
        step = self._known.get(transition.id)
        if step is None:
            step = self._known[transition.id] = self._step(transition)
        if transition.target is None:
            return replace(step, leaves=(leaf.name,))
        if self._leaving:
            path = self._path(leaf.name, self._index.semantics.domain(transition, transition.target))
            left = [call for state in path for call in self._leaving.get(state.name, ())]
            return replace(step, calls=(*left, *step.calls))
        return step

    def _step(self, transition: Transition) -> _VisitStep:
        """Return the effect of a transition, from wherever inside its source it is taken."""
        when = [taken_when(transition)] if _asks(transition) else []
        own = self._inside[transition.source].transitions
        before = takewhile(lambda other: other is not transition, own)
        asked = [other for other in before if other.event == transition.event and _asks(other)]
        when += [negate(taken_when(other)) for other in asked]
        calls = list(_walking(f"{transition.id}.do", transition.actions))
        vague = not guard_of(transition).understood
        if transition.target is None:
            return _VisitStep(transition, tuple(when), tuple(calls), (), vague)
        target = self._index.chart.states[transition.target]
        if target.kind is Kind.HISTORY:
            leaves = tuple(self._leaves_in(target.parent or ""))
            return _VisitStep(transition, tuple(when), tuple(calls), leaves, vague=True)
        domain = self._index.semantics.domain(transition, target.name)
        begun = [self._inside[name] for name in self._index.entered(target.name) if name in self._inside]
        for state in {s.name: s for s in (*self._path(target.name, domain)[::-1], *begun)}.values():
            calls += _walking(f"{state.name}.entry", state.on_entry)
        leaves = tuple(state.name for state in begun if state.name in self._at)
        return _VisitStep(transition, tuple(when), tuple(calls), leaves, vague)

    def _path(self, name: str, domain: str) -> list[State]:
        """Return a state and those around it below `domain`, as far as they belong to the walk."""
        names = self._index.lineage[name]
        below = names[: names.index(domain)] if domain in names else names
        return [self._inside[name] for name in below if name in self._inside]

    def _leaves_in(self, ancestor: str) -> Iterator[str]:
        return (leaf for leaf in self._at if self._index.inside(leaf, ancestor))

    # -- what the visit may be -----------------------------------------------------------------------------

    def _settle(self) -> None:
        """Follow all ways until nothing new comes out."""
        waiting = list(self._from_outside())
        while waiting:
            leaf, visit = waiting.pop()
            if visit <= self._at[leaf]:
                continue
            self._at[leaf] |= visit
            for step in self._steps[leaf]:
                _, after = self._along(step.calls, _those(self._at[leaf], step.when))
                after = _EITHER if step.vague else after
                waiting.extend((name, after) for name in step.leaves)

    def _along(
        self, calls: Iterable[_VisitCall], visit: Visit
    ) -> tuple[list[tuple[_VisitCall, Visit]], Visit]:
        """Return the calls with the possible visits before each, and those after all.

        None are reached where neither is possible.
        """
        found: list[tuple[_VisitCall, Visit]] = []
        for call in calls if visit else ():
            guard = guard_of(call.action)
            if not guard:
                found.append((call, visit))
                visit = self._called(call, visit)
                continue
            if not guard.understood:
                visit = _EITHER
                continue
            asked = guard.formula if "itinerary.open" in guard.source else None
            then, after_then = self._along(
                _walking(call.path, call.action.then), _those(visit, (asked,) if asked else ())
            )
            other, after_else = self._along(
                _walking(call.path, call.action.otherwise), _those(visit, (negate(asked),) if asked else ())
            )
            found, visit = [*found, *then, *other], after_then | after_else
        return found, visit

    def _called(self, call: _VisitCall, visit: Visit) -> Visit:
        if call.action.name == "itinerary.advance":
            return frozenset([OPEN])
        walk = self._walker.itinerary
        if call.action.name == "itinerary.close_rest" and walk is not None and walk.leaves_open:
            return visit
        return frozenset([CLOSED])

    # -- entering the walk ---------------------------------------------------------------------------------

    def _from_outside(self) -> Iterator[tuple[str, Visit]]:
        """Yield the atomic states in which the iteration starts or is restored, with the visit then.

        An itinerary that is entered starts with its first target; one restored from history goes on.
        """
        begins = [self._walker.name]
        for name, state in self._inside.items():
            if not any(t.source not in self._inside for t in self._index.ways_to.get(name, ())):
                continue
            if state.kind is Kind.HISTORY:
                yield from ((leaf, _EITHER) for leaf in self._leaves_in(state.parent or ""))
            else:
                begins.append(name)
        for name in begins:
            yield from self._entered(name, self._along(self._entries(name), frozenset([OPEN]))[1])
        for name in self._index.lineage[self._walker.name][1:]:
            for child in self._index.chart.states[name].children:
                if self._index.chart.states[child].kind is Kind.HISTORY:
                    yield from self._resumed(self._index.chart.states[child])

    def _entries(self, name: str) -> list[_VisitCall]:
        """Return the calls of a state's entry."""
        begun = [self._inside[inner] for inner in self._index.entered(name)]
        return [call for state in begun for call in _walking(f"{state.name}.entry", state.on_entry)]

    def _entered(self, name: str, visit: Visit) -> Iterator[tuple[str, Visit]]:
        return ((leaf, visit) for leaf in self._index.entered(name) if leaf in self._at)

    def _resumed(self, history: State) -> Iterator[tuple[str, Visit]]:
        """Yield the states that a history restores: all as they were, or those of `resume_at`."""
        if history.depth is None:
            yield from ((leaf, _EITHER) for leaf in self._at)
        else:
            yield from self._resumed_at(self._walker)

    def _resumed_at(self, state: State) -> Iterator[tuple[str, Visit]]:
        """Yield the states in which a restored state resumes: by `resume_at`, else its initial ones."""
        before: list[Formula] = []
        for transition in state.resume_at:
            visit = _those(_EITHER, (taken_when(transition), *map(negate, before)))
            before.append(taken_when(transition))
            yield from self._entered(transition.target or "", visit)
        yield from self._entered(state.name, _those(_EITHER, tuple(map(negate, before))))


#: What is known of an itinerary that has just been entered: of any, and of an empty one.
_FIRST = Every((fact("itinerary.open", True), fact("itinerary.closed", 0), fact("itinerary.sweep", 1)))
_NO_COUNT = (fact(f"itinerary.{name}", value=0) for name in ("total", "remaining", "closed"))
_EMPTY = Every((*_NO_COUNT, fact("itinerary.open", value=False)))
#: Words of a condition that ask for something else than the itinerary.
_OTHER_NAMES = re.compile(r"(?<![\w.])(?!(?:and|or|not|true|false)\b|itinerary\.)[A-Za-z_]")
_TARGET = re.compile(r"(?<![\w.'\"])target\b")


def _may_be_empty(index: Index, walker: State) -> bool:
    """Say whether a list may be empty, without a check for that in the chart."""
    assert walker.itinerary is not None
    source = getattr(walker.itinerary.items, "source", "")
    root, _, name = source.rpartition(".")
    mission = index.chart.missions.get(walker.mission)
    if root == "request" and mission is not None and name in mission.request:
        asked = mission.request[name]
        empty = asked.not_empty is None and (asked.default is None or _is_empty(asked.default))
    elif root == "":
        variable = index.chart.context.get(name)
        empty = variable is not None and _is_empty(variable.default)
    else:
        empty = root == "input" and name.isidentifier()
    return empty and not any(read.condition and source in read.expression.source for read in index.reads)


def _is_empty(value: Value | None) -> bool:
    return isinstance(value, Constant) and value.value == []


#: What the visit must not be, all ways considered.
_REFUSED = {"itinerary.close": frozenset([CLOSED]), "itinerary.advance": frozenset([OPEN])}


@lru_cache(256)
def _those(visit: Visit, when: tuple[Formula, ...]) -> Visit:
    """Return the possible visits that agree with conditions."""
    return frozenset(v for v in visit if not when or possible(fact("itinerary.open", v == OPEN), *when))


def _asks(transition: Transition) -> bool:
    """Say whether a guard reads the visit or a state."""
    return any(word in guard_of(transition).source for word in _ASKED)


def _walking(path: str, calls: Iterable[ActionCall]) -> Iterator[_VisitCall]:
    """Yield the actions of a list that do something to the itinerary, and an `if` that chooses such."""
    for call in calls:
        if call.name.startswith("itinerary.") or any(_walking(path, (*call.then, *call.otherwise))):
            yield _VisitCall(call, path)


def _finding(leaf: str, call: _VisitCall) -> Diagnostic:
    closes = call.action.name == "itinerary.close"
    how = "closed already" if closes else "still open"
    problem = f"the visit is {how} in {local(leaf)!r}, so this would be refused"
    if not closes:
        hint = "close it first: 'itinerary.close: {status: ...}'"
        return Diagnostic(call.action.place, "open-visit", call.path, problem, hint)
    hint = "add 'guard: itinerary.open'" if call.path.endswith(".do") else "remove it"
    return Diagnostic(call.action.place, "double-close", call.path, problem, hint)
