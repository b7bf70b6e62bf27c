"""What must hold of a composed chart beyond each piece being right by itself: one small function per rule.

A rule looks at the composed states, so it sees parts expanded and targets resolved. Rules that follow
transitions through the whole chart run only when all of them could be resolved: after a misspelt target,
half the chart would seem unreachable.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from lupin_engine.chart.compose import Composed
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import Chart, Kind, State, Transition
from lupin_engine.errors import Diagnostic, Place

#: After one of these the ways through the chart are not known.
_BROKEN_WAYS = (
    "unknown-state",
    "unknown-event",
    "unknown-operation",
    "no-initial",
    "part-loop",
    "wrong-shape",
    "too-large",
    "bad-name",
    "not-supported",
    "unknown-key",
)
#: After one of these it is not known what is read.
_BROKEN_READS = ("bad-expression", "partial-expression", "unknown-parameter", *_BROKEN_WAYS)

Rule = Callable[[Composed], Iterator[Diagnostic]]


def check_composed(composed: Composed, findings: Findings) -> None:
    """Run every rule that still makes sense after what has been found so far."""
    ways, reads = not findings.has(*_BROKEN_WAYS), not findings.has(*_BROKEN_READS)
    found = [d for rule in LOCAL for d in rule(composed)]
    if ways:
        found += [d for rule in GLOBAL for d in rule(composed)]
    if reads:
        found += list(unused_parameter(composed))
    findings.extend(found)


def _path(state: State, word: str = "") -> str:
    return ".".join(part for part in (state.name, word) if part)


def never_wins(composed: Composed) -> Iterator[Diagnostic]:
    """Find a transition that an earlier one of the same state and event always takes the turn of."""
    for state in composed.chart.states.values():
        earlier: dict[str, list[Transition]] = {}
        for transition in state.transitions:
            before = earlier.setdefault(transition.event, [])
            winner = next((other for other in before if _hides(other, transition)), None)
            if winner is not None:
                line = winner.place.line
                problem = f"this can never be taken: the one in line {line} comes first and has no guard"
                hint = "move it up, or guard that one"
                yield Diagnostic(transition.place, "never-wins", transition.id, problem, hint)
            before.append(transition)


def _hides(earlier: Transition, later: Transition) -> bool:
    """Tell whether `earlier` is taken whenever `later` could be, also while a hold is engaged."""
    passes, needs = earlier.during | earlier.releases, later.during | later.releases
    return earlier.guard is None and needs <= passes


def unhandled_outcome(composed: Composed) -> Iterator[Diagnostic]:
    """Find an operation that can end in a way for which its state has no transition."""
    for state in composed.chart.states.values():
        invoke = state.invoke
        if invoke is None:
            continue
        handled = {transition.event for transition in state.transitions}
        fails = bool(invoke.operation.codes) or invoke.timeout_code is not None
        for event, key, happens in (("done", "on_done", True), ("error", "on_error", fails)):
            if event not in handled and happens:
                how = "ended" if event == "done" else "failed"
                problem = f"nothing says what follows when {invoke.name} has {how}"
                yield Diagnostic(
                    invoke.place, "unhandled-outcome", _path(state), problem, f"add '{key}: STATE'"
                )


def never_happens(composed: Composed) -> Iterator[Diagnostic]:
    """Find the handling of an ending in a state that has nothing to end."""
    for state in composed.chart.states.values():
        if state.invoke is not None or composed.drafts[state.name].node is None:
            continue
        node = composed.drafts[state.name].node
        if node is None or node.invoke is not None:
            continue
        if node.on_error:
            problem = "on_error without an invocation: nothing can fail here"
            yield Diagnostic(node.key_at("on_error"), "never-happens", _path(state), problem, "remove it")
        if node.on_done and not _can_be_done(composed.chart, state):
            problem = "on_done, but nothing is invoked here and no state inside is final"
            hint = "add 'type: final' to a state inside, or remove it"
            yield Diagnostic(node.key_at("on_done"), "never-happens", _path(state), problem, hint)


def _can_be_done(chart: Chart, state: State) -> bool:
    """Tell whether a state can end by one of its children: a final one, or for the slot a mission's."""
    children = [chart.states[name] for name in state.children]
    if state.slot:
        return any(_can_be_done(chart, child) for child in children) or not children
    if state.kind is Kind.PARALLEL:
        return all(child.kind is Kind.FINAL or _can_be_done(chart, child) for child in children)
    return any(child.kind is Kind.FINAL for child in children)


def waits_for_ever(composed: Composed) -> Iterator[Diagnostic]:
    """Find an operation that has no timeout on purpose, and no other way out of its state either."""
    for state in composed.chart.states.values():
        node = composed.drafts[state.name].node
        if state.invoke is None or node is None or node.invoke is None or node.invoke.timeout != "never":
            continue
        if not _has_way_out(composed.chart, state, without=("done", "error")):
            problem = f"{state.invoke.name} may take for ever, and nothing else leaves this state"
            hint = "add an 'after', an 'always' or an answer to an event"
            yield Diagnostic(node.invoke.at("timeout"), "no-deadline", _path(state), problem, hint)


def dead_end(composed: Composed) -> Iterator[Diagnostic]:
    """Find a state without children that nothing leads out of."""
    for state in composed.chart.states.values():
        if state.kind is Kind.ATOMIC and state.invoke is None and not _has_way_out(composed.chart, state):
            problem = "nothing leads out of this state"
            yield Diagnostic(
                state.place, "dead-end", _path(state), problem, "add a transition, or 'type: final'"
            )


def _has_way_out(chart: Chart, state: State, without: Iterable[str] = ()) -> bool:
    """Tell whether a transition of the state, or of one around it, goes somewhere."""
    if any(t.target is not None and t.event not in without for t in state.transitions):
        return True
    around = [chart.states[name] for name in chart.ancestors(state.name)]
    return any(
        t.target is not None and t.event not in ("done", "error") for a in around for t in a.transitions
    )


def unreachable_state(composed: Composed) -> Iterator[Diagnostic]:
    """Find a state that no initial state and no transition leads to; told for the outermost of them."""
    chart = composed.chart
    reached = _reached(chart)
    for state in chart.states.values():
        missing = state.name not in reached
        if missing and state.parent in reached and not _is_implied(composed, state):
            hint = "add a transition to it, or remove it"
            yield Diagnostic(
                state.place, "unreachable-state", _path(state), "no way leads to this state", hint
            )


def _is_implied(composed: Composed, state: State) -> bool:
    """Tell whether a state is not written as one: the history that a `history:` key stands for."""
    return state.kind is Kind.HISTORY and composed.drafts[state.name].node is None


def _reached(chart: Chart) -> set[str]:
    """Follow everything that can enter a state, from the root on, guards aside."""
    reached: set[str] = set()
    waiting = [""]
    while waiting:
        name = waiting.pop()
        if name in reached or name not in chart.states:
            continue
        reached.add(name)
        waiting.extend(_next(chart, chart.states[name]))
    return reached


def _next(chart: Chart, state: State) -> Iterator[str]:
    """Yield what being in a state can lead to: those around it, its beginnings, its targets."""
    if state.parent is not None:
        yield state.parent
    if state.slot:
        yield from (child for child in state.children if chart.states[child].kind is not Kind.HISTORY)
    elif state.kind is Kind.PARALLEL:
        yield from state.children
    if state.initial is not None:
        yield state.initial
    for transition in (*state.transitions, *state.resume_at):
        if transition.target is not None:
            yield transition.target


def unused_parameter(composed: Composed) -> Iterator[Diagnostic]:
    """Find a parameter that a file declares and no expression reads."""
    for name, place in _declared_parameters(composed):
        if name not in composed.usage.parameters:
            problem = f"nothing reads the parameter {name!r}"
            hint = f"read it as param.{name}, or remove it"
            yield Diagnostic(place, "unused-parameter", f"params.{name}", problem, hint)


def _declared_parameters(composed: Composed) -> Iterator[tuple[str, Place]]:
    for (family, name), place in composed.declared.places.items():
        if family == "parameter":
            yield name, place


#: Rules that look at one state at a time.
LOCAL: tuple[Rule, ...] = (never_wins, unhandled_outcome)
#: Rules that follow transitions through the chart, or ask what a state contains.
GLOBAL: tuple[Rule, ...] = (never_happens, waits_for_ever, dead_end, unreachable_state)
