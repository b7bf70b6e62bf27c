"""Rules about alternatives: which of several transitions is taken, and whether one is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from lupin_engine.chart.expressions.evaluation import Constant
from lupin_engine.chart.expressions.guards import Formula, exclusive, fact, implies, possible, total
from lupin_engine.chart.findings import warning
from lupin_engine.chart.model import ActionCall, Invoke, Kind, State, Transition
from lupin_engine.chart.rules.index import (
    OF_ONE_STATE,
    Index,
    always_taken,
    event_name,
    groups_of,
    guard_of,
    line_of,
    local,
    taken_when,
)
from lupin_engine.chart.semantics import FAULT, matches
from lupin_engine.chart.strictness import stricter
from lupin_engine.errors import Diagnostic
from lupin_engine.plugin.profile import ANSWER

#: So many transitions may listen to one event in one state.
MAX_CHOICES = 200
_NEVER = "this can never be taken"

# -- never-wins -------------------------------------------------------------------------------------------


def _decided_beforehand(index: Index) -> Iterator[Diagnostic]:
    for call in index.calls:
        guard = guard_of(call.action)
        if guard and guard.understood and guard.constant is not None:
            problem = f"the guard of this 'if' is {'always' if guard.constant else 'never'} true"
            hint = "mend the guard, or write the actions without 'if'"
            yield Diagnostic(guard.place, "never-wins", f"{call.path}.if", problem, hint)


def never_wins(index: Index) -> Iterator[Diagnostic]:
    """Find a transition whose turn never comes: its guard is never true, or another is always before it."""
    hint = "mend the guard, or remove the transition"
    for transition in index.guarded:
        if guard_of(transition).constant is False:
            yield Diagnostic(transition.place, "never-wins", transition.id, "its guard is never true", hint)
    yield from _decided_beforehand(index)
    for group in index.groups:
        yield from _hidden_by_earlier(index, group)
    for state in index.states:
        yield from _hidden_by_deadline(index, state)
    for state in index.outer:
        if not state.slot:  # which missions stand in it is not known here
            yield from _hidden_by_inner(index, state)


def _hidden_by_deadline(index: Index, state: State) -> Iterator[Diagnostic]:
    """Find deadlines that are not before another one of the same state, which always leaves it."""
    due = {timer.event: timer.due.value for timer in state.timers if isinstance(timer.due, Constant)}
    after = [t for t in state.transitions if t.event in due and t.event.startswith("after.")]
    leaving = [t for t in after if t.target is not None and always_taken(t)]
    if not leaving:
        return
    first = min(leaving, key=lambda t: due[t.event])  # of equal ones the first that is written
    for later in after:
        if later.derived:
            continue  # it bounds the wait of a divert, and may come after the state's own end
        at, limit = due[later.event], due[first.event]
        if at > limit or (at == limit and after.index(later) > after.index(first)):
            when = "at the same time" if at == limit else "earlier"
            problem = f"{_NEVER}: {when} the deadline in {line_of(first.place, later.place)} leaves the state"
            yield warning(later.place, "never-wins", later.id, problem, "shorten it, or remove it")


def _hidden_by_earlier(index: Index, group: Sequence[Transition]) -> Iterator[Diagnostic]:
    """Find those of a group that the ones before them leave nothing to do."""
    if len(group) > MAX_CHOICES:  # each is held against all before it
        problem = f"more than {MAX_CHOICES} transitions listen to the same event in one state"
        more = group[MAX_CHOICES]
        yield Diagnostic(more.place, "too-large", more.id, problem, "choose by fewer guards, or by states")
        return
    # Asked once for all of them; which ones it is before each is asked only when there is something to tell.
    leaves_none = len(group) > 2 and total(_sure_conditions(index, group[:-1]))
    for at, later in enumerate(group):
        earlier = [other for other in group[:at] if _goes_before(other, later)]
        if not earlier or guard_of(later).constant is False:
            continue
        problem = _why_hidden(index, earlier, later)
        if not problem and leaves_none:
            problem = _why_none_is_left(index, earlier, later)
        if problem:
            hint = "move it up, or guard that one" if "no guard" in problem else "move it up, or remove it"
            yield Diagnostic(later.place, "never-wins", later.id, f"{_NEVER}: {problem}", hint)


def _goes_before(earlier: Transition, later: Transition) -> bool:
    """Say whether the earlier transition is evaluated first wherever the later one could be taken.

    A hold lets eventless transitions and levels through one by one; requests and answers are decided by the
    first whose guard holds, held or not.
    """
    if not matches(earlier.event, later.event):
        return False
    if later.event and not later.event.startswith("input."):
        return True
    return later.during | later.releases <= earlier.during | earlier.releases


def _why_hidden(index: Index, earlier: Sequence[Transition], later: Transition) -> str:
    """Say which one before a transition is always taken instead; nothing when none is."""
    for other in earlier:
        line = line_of(other.place, later.place)
        if not guard_of(other):
            return f"the one in {line} comes first and has no guard"
        if always_taken(other):
            return f"the guard of the one in {line} before it is always true"
        if guard_of(later) and _covered(index, other, later):
            return f"whenever its guard is true, that in {line} before it is too"
    return ""


def _why_none_is_left(index: Index, earlier: Sequence[Transition], later: Transition) -> str:
    """Say which of those before a transition leave nothing over between them."""
    covering = [t for t in earlier if guard_of(t).constant is not False]
    if not total(_sure_conditions(index, covering)):
        return ""
    # Two of them are often enough, and easier to understand.
    pairs = ([first, second] for at, second in enumerate(covering) for first in covering[:at])
    covering = next((pair for pair in pairs if total(_sure_conditions(index, pair))), covering)
    lines = " and ".join(line_of(t.place, later.place) for t in covering)
    return f"one of the guards in {lines} before it is always true"


def _covered(index: Index, earlier: Transition, later: Transition) -> bool:
    first, second = guard_of(earlier), guard_of(later)
    if first.source == second.source:
        return True
    return index.is_sure(first) and second.understood and implies(second.formula, first.formula)


def _sure_conditions(index: Index, transitions: Iterable[Transition]) -> list[Formula]:
    """Return the conditions of those guards that are not also false for another reason."""
    return [guard_of(t).formula for t in transitions if guard_of(t) and index.is_sure(guard_of(t))]


def _hidden_by_inner(index: Index, state: State) -> Iterator[Diagnostic]:
    """Find transitions of an outer state whose event never gets past the states inside."""
    inner = _resting(index, state)
    for transition in state.transitions:
        if transition.event.startswith(OF_ONE_STATE) or guard_of(transition).constant is False:
            continue
        if inner and all(_answers(index, child, transition) for child in inner):
            how = f"answers {transition.event!r}" if transition.event else "is left by an 'always'"
            problem = f"{_NEVER}: every state inside {how} without a guard"
            hint = "remove it, or guard one of those"
            yield Diagnostic(transition.place, "never-wins", transition.id, problem, hint)


def _resting(index: Index, state: State) -> list[State]:
    """Return the children that a state can rest in: not the final one that it leaves at once."""
    children = index.regions(state)
    above = index.chart.states[state.parent] if state.parent is not None else state
    ended = above if above.slot else state  # a mission's end is the slot's
    if any(t.event == "done" and t.target is not None and always_taken(t) for t in ended.transitions):
        return [child for child in children if child.kind is not Kind.FINAL]
    return children


def _answers(index: Index, state: State, outer: Transition) -> bool:
    """Say whether a state, or all states inside it, take an event before an outer transition can."""
    if any(always_taken(t) and _goes_before(t, outer) for t in state.transitions):
        return True
    inner = [] if state.slot else _resting(index, state)
    return bool(inner) and all(_answers(index, child, outer) for child in inner)


# -- both-can-win -----------------------------------------------------------------------------------------


def both_can_win(index: Index) -> Iterator[Diagnostic]:
    """Find two transitions of a state between which only the order of their keys decides.

    In the list under one key the first one whose guard is true is taken, as the language says. A refusal in
    front is an exception to the following ones, and one without a guard at the end is the rest.
    """
    for group in index.groups:
        # Sometimes true and sometimes not, as far as it was understood.
        guarded = [t for t in group if guard_of(t).constant is None and guard_of(t).understood]
        for at, later in enumerate(guarded):
            clash = next((t for t in guarded[:at] if _both_can_win(index, t, later)), None)
            if clash is not None:
                there = line_of(clash.place, later.place)
                problem = (
                    f"on {event_name(later.event)!r} both this and the one in {there} may be allowed: then"
                    " only their order decides"
                )
                hint = "write guards that exclude each other, or give the last one none"
                yield warning(later.place, "both-can-win", later.id, problem, hint)


def _both_can_win(index: Index, earlier: Transition, later: Transition) -> bool:
    if earlier.event == later.event:
        return False
    if earlier.refuse is not None or _effect(earlier) == _effect(later) or _covered(index, earlier, later):
        return False
    return not exclusive(guard_of(earlier).formula, guard_of(later).formula)


def _effect(transition: Transition) -> tuple[Any, ...]:
    """Return the effect of a transition, as a comparable value."""
    calls = _done(transition.actions)
    return (transition.target, transition.refuse, transition.code, transition.internal, calls)


def _done(actions: Iterable[ActionCall]) -> tuple[Any, ...]:
    return tuple(
        (
            call.name,
            tuple((name, _written(value)) for name, value in call.arguments.items()),
            guard_of(call).source,
            _done(call.then),
            _done(call.otherwise),
        )
        for call in actions
    )


def _written(value: Any) -> str:
    return repr(value.value) if isinstance(value, Constant) else f"${{ {value.source} }}"


def regions_clash(index: Index) -> Iterator[Diagnostic]:
    """Find an event that two regions answer while one of them leaves the parallel state: one is lost."""
    for parallel, answers in _answers_of_regions(index).items():
        for group in groups_of(answers):
            if len({_region(index, t, parallel) for t in group}) > 1:
                yield from _clashes(index, parallel, group)


def _answers_of_regions(index: Index) -> dict[str, list[Transition]]:
    """Return for each parallel state the transitions of its regions on events that all of them hear."""
    found: dict[str, list[Transition]] = {state.name: [] for state in index.parallel}
    for name, around in index.region_of.items():
        for transition in index.chart.states[name].transitions:
            heard = transition.event and not transition.event.startswith(OF_ONE_STATE)
            if heard and transition.target is not None:
                for parallel, _ in around:
                    found[parallel].append(transition)
    return found


def _region(index: Index, transition: Transition, parallel: str) -> str:
    return dict(index.region_of[transition.source])[parallel]


def _clashes(index: Index, parallel: str, group: Sequence[Transition]) -> Iterator[Diagnostic]:
    reported: set[str] = set()
    group = [transition for transition in group if guard_of(transition).understood]
    for leaver in group:
        domain = index.semantics.domain(leaver, leaver.target or "")
        if leaver.id in reported or index.inside(domain, parallel):
            continue
        others = (t for t in group if _region(index, t, parallel) != _region(index, leaver, parallel))
        other = next((t for t in others if not exclusive(taken_when(leaver), taken_when(t))), None)
        if other is not None:
            reported.add(other.id)
            problem = (
                f"{leaver.event!r} leaves {local(parallel)!r} here, and another region answers it in"
                f" {line_of(other.place, leaver.place)}: only the first of the two is carried out"
            )
            hint = "let one region answer it, or write guards that exclude each other"
            yield warning(leaver.place, "both-can-win", leaver.id, problem, hint)


# -- unhandled-outcome ------------------------------------------------------------------------------------


def unhandled_outcome(index: Index) -> Iterator[Diagnostic]:
    """Find an end for which its state has no transition, or only guarded ones."""
    for work in index.works:
        if work.state.invoke is work.invoke:
            yield from _without_answer(index, work.state)
    for state in index.answering:
        # Where nothing is invoked nothing fails, and answering that is told as such.
        for event in ("done",) if state.invoke is None else ("done", "error"):
            group = [t for t in state.transitions if t.event == event]
            if group and not any(map(always_taken, group)) and all(guard_of(t).understood for t in group):
                yield from _without_rest(index, state, event, group)
    yield from _unheard_finals(index)
    yield from _unheard_answers(index)


def _without_answer(index: Index, state: State) -> Iterator[Diagnostic]:
    """Find an end of an operation that no transition handles; in FAULT always also that with an error."""
    invoke = state.invoke
    assert invoke is not None
    handled = {transition.event for transition in state.transitions}
    is_late = not invoke.operation.codes and invoke.timeout_code is None and index.inside(state.name, FAULT)
    fails = bool(invoke.operation.codes) or invoke.timeout_code is not None or is_late
    for event, key, happens in (("done", "on_done", True), ("error", "on_error", fails)):
        if event not in handled and happens:
            how = "ended" if event == "done" else "failed"
            problem = f"nothing says what follows when {invoke.name} has {how}"
            hint = f"add '{key}: STATE'"
            if is_late and event == "error":
                yield stricter("wait-in-fault", invoke.place, state.name, problem, hint)
            else:
                yield Diagnostic(invoke.place, "unhandled-outcome", state.name, problem, hint)


def _without_rest(
    index: Index, state: State, event: str, group: Sequence[Transition]
) -> Iterator[Diagnostic]:
    """Find ends that are handled under guards only, none of which may hold."""
    what = state.invoke.name if state.invoke is not None else state.local_name
    guards = [taken_when(t) for t in group if guard_of(t)]
    sure = _sure_conditions(index, group)
    hint = f"let the last of '{event_name(event)}' have no guard"
    codes = _codes(state.invoke) if event == "error" and state.invoke is not None else []
    lost = [code for code in codes if not any(possible(fact("error.code", code), g) for g in guards)]
    if lost:
        problem = f"nothing says what follows when {what} has failed with {_or(lost)}"
        yield Diagnostic(group[0].place, "unhandled-outcome", state.name, problem, hint)
    left = [code for code in codes if code not in lost and not total(sure, fact("error.code", code))]
    if left or (not codes and not total(sure)):
        how = "ended" if event == "done" else "failed"
        with_ = f" with {_or(left)}" if left and len(left) < len(codes) else ""
        problem = f"nothing says what follows when {what} has {how}{with_} and no guard is true"
        yield warning(group[0].place, "unhandled-outcome", state.name, problem, hint)


def _unheard_answers(index: Index) -> Iterator[Diagnostic]:
    """Find a choice of a question without a listener: neither the state that asks nor one around it."""
    for state in index.states:
        if state.ask is None:
            continue
        around = [index.chart.states[name] for name in index.lineage[state.name]]
        heard = [rule.event for one in around for rule in one.transitions]
        for name in state.ask.choices:
            event = f"{ANSWER}{name}"
            if not any(matches(pattern, event) for pattern in heard):
                problem = f"nothing says what follows when the answer is {name!r}"
                hint = f"add 'on: {{{event}: STATE}}'"
                yield Diagnostic(state.ask.place, "unhandled-outcome", state.name, problem, hint)


def _codes(invoke: Invoke) -> list[str]:
    """Return the codes that an operation can fail with."""
    own = [invoke.timeout_code] if invoke.timeout_code is not None else []
    return [*dict.fromkeys([code.name for code in invoke.operation.codes] + own)]


def _or(names: Sequence[str]) -> str:
    quoted = [repr(name) for name in names]
    return quoted[0] if len(quoted) == 1 else f"{', '.join(quoted[:-1])} or {quoted[-1]}"


def _unheard_finals(index: Index) -> Iterator[Diagnostic]:
    """Find a final state that completes the one around it, which has no `on_done` and stays for ever."""
    for state in index.states:
        if state.kind is Kind.FINAL and state.parent:
            holder = _ended_by(index, index.chart.states[state.parent])
            if holder is not None and not _goes_on(index, holder):
                problem = f"nothing says what follows when {state.local_name!r} inside is reached"
                if holder.kind is Kind.PARALLEL:
                    problem = "nothing says what follows when all regions have ended"
                hint = "add 'on_done: STATE'"
                yield Diagnostic(holder.place, "unhandled-outcome", holder.name, problem, hint)


def _ended_by(index: Index, parent: State) -> State | None:
    """Return the state that must handle the completion by a final child of `parent`; None where none must."""
    above = index.chart.states[parent.parent or ""]
    if above.slot:
        return above
    if above.kind is Kind.PARALLEL:
        ends = all(
            any(index.chart.states[name].kind is Kind.FINAL for name in region.children)
            for region in index.regions(above)
        )
        return above if ends else None
    return None if parent.invoke is not None else parent


def _goes_on(index: Index, state: State) -> bool:
    """Say whether a state handles its completion, or is left some other way without a person."""
    if any(t.event == "done" or t.target is not None for t in state.transitions):
        return True
    around = (index.chart.states[name] for name in index.lineage[state.name][1:])
    by_others = ("done", "error", "operator.", "mission.", "input.")
    return any(
        t.target is not None and not t.event.startswith(by_others) for a in around for t in a.transitions
    )
