"""Rules about reachability: unreachable states, dead ends, and circles without an end."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from lupin_engine.chart.expressions.evaluation import Constant
from lupin_engine.chart.model import Chart, Kind, State, Transition
from lupin_engine.chart.rules.graph import components
from lupin_engine.chart.rules.index import Index
from lupin_engine.chart.semantics import FAULT, TIMERS
from lupin_engine.errors import Diagnostic, Severity
from lupin_engine.plugin.profile import ANSWER, START

# -- never-happens, no-deadline ---------------------------------------------------------------------------


def never_happens(index: Index) -> Iterator[Diagnostic]:
    """Find the handling of an ending in a state that has nothing to end."""
    for state in index.answering:
        node = index.composed.drafts[state.name].node
        if state.invoke is not None or node is None or node.invoke is not None:
            continue
        if node.on_error:
            problem = "on_error without an invocation: nothing can fail here"
            yield Diagnostic(node.key_at("on_error"), "never-happens", state.name, problem, "remove it")
        if node.on_done and not _can_be_done(index.chart, state):
            yield Diagnostic(node.key_at("on_done"), "never-happens", state.name, *_endless(index, state))


def names_no_mission(index: Index) -> Iterator[Diagnostic]:
    """Find a request that would begin a mission and names none, so that it is always refused."""
    if index.slot is None:
        return
    slot = index.slot
    back = next((name for name in slot.children if index.chart.states[name].kind is Kind.HISTORY), "")
    go_on = f"write 'target: {'.'.join(back.split('.')[-2:])}' to go on with the one that was left"
    for rule in index.ways_to.get(slot.name, ()):
        if rule.event != START and rule.event.startswith(("operator.", ANSWER)):
            problem = f"{rule.event} names no mission to begin, so it would be refused"
            hint = go_on if back else f"give {slot.local_name} a history, and lead there"
            yield Diagnostic(rule.place, "never-wins", rule.id, problem, hint, Severity.WARN)


def _endless(index: Index, state: State) -> tuple[str, str]:
    """Return why a state without an operation cannot complete, and the remedy."""
    if state.kind is not Kind.PARALLEL:
        problem = "on_done, but nothing is invoked here and no state inside is final"
        return problem, "add 'type: final' to a state inside, or remove it"
    regions = [region for region in index.regions(state) if region.kind is not Kind.FINAL]
    endless = [region for region in regions if not _can_be_done(index.chart, region)]
    names = ", ".join(repr(region.name.rpartition(".")[2]) for region in endless)
    return f"on_done, but not every region can end: {names} has no final state", "add one, or remove it"


def _can_be_done(chart: Chart, state: State) -> bool:
    """Say whether a state can be completed by a child; in the slot, other missions may do that."""
    children = [chart.states[name] for name in state.children]
    if state.slot:
        return True
    if state.kind is Kind.PARALLEL:
        proper = (child for child in children if child.kind is not Kind.HISTORY)
        return all(child.kind is Kind.FINAL or _can_be_done(chart, child) for child in proper)
    return any(child.kind is Kind.FINAL for child in children)


def waits_for_ever(index: Index) -> Iterator[Diagnostic]:
    """Find an operation that has no timeout on purpose, and no other way out of its state either.

    A way out that only the lifecycle has, such as an abort, is a warning: no operator is asked to take it. So
    is one that only a live value or an event of a plugin opens, because that may never come.
    """
    for work in index.works:
        node = index.composed.drafts[work.state.name].node
        if node is None or node.invoke is None or node.invoke.timeout != "never":
            continue
        if not _has_way_out(index, work.state, without=("done", "error")):
            problem = f"{work.invoke.name} may take for ever, and nothing else leaves this state"
            hint = "add an 'after', an 'always' or an answer to an event"
            yield Diagnostic(node.invoke.at("timeout"), "no-deadline", work.state.name, problem, hint)
        elif work.state.mission:
            why = _why_no_end(index, work.state)
            hint = "write 'timeout: {after: 30 s, code: CODE}', or add an 'after' or an 'on' here"
            problem = f"{work.invoke.name} may take for ever, and {why}"
            if why:
                place = node.invoke.at("timeout")
                yield Diagnostic(place, "no-deadline", work.state.name, problem, hint, Severity.WARN)


def _why_no_end(index: Index, state: State) -> str:
    """Return why a mission itself may never leave a state whose operation does not end; '' where it does."""
    around = [index.chart.states[name] for name in index.lineage[state.name]]
    inner = [one for one in around if one.mission]
    if any(map(_ends_in_time, inner)):
        return ""
    every = (t for one in inner for t in one.transitions)
    ways = [t for t in every if t.target is not None and t.event not in ("done", "error")]
    raised = _raised(index)
    if not ways:
        return "only the lifecycle leads out, and nothing reports the wait"
    if all(_comes_from_the_world(t.event, raised) for t in ways):
        return f"{ways[0].event}, which leads out, may never come"
    return ""


def _raised(index: Index) -> set[str]:
    """Return the events that actions raise."""
    events = [call.action.arguments["event"] for call in index.calls if call.action.name == "raise"]
    return {str(event.value) for event in events if isinstance(event, Constant)}


def waits_for_the_world(index: Index) -> Iterator[Diagnostic]:
    """Find a state of a mission that only live values and events of plugins lead out of, and no time."""
    raised = _raised(index)
    for state in index.states:
        if not state.mission or state.kind is not Kind.ATOMIC or _does_something(index, state):
            continue
        leading = _ways_out_of_waiting(index, state)
        if leading and all(_comes_from_the_world(t.event, raised) for t in leading):
            problem = f"nothing ends the wait for {leading[0].event} should it never come"
            hint = "add 'after: {DURATION: STATE}'"
            place = leading[0].place
            yield Diagnostic(place, "no-deadline", state.name, problem, hint, Severity.WARN)


def _ways_out_of_waiting(index: Index, state: State) -> list[Transition]:
    """Return the transitions out of a mission's waiting state; none where a state around it works."""
    around = [index.chart.states[name] for name in index.lineage[state.name]]
    inner = [one for one in around if one.mission]
    if any(_does_something(index, one) for one in inner):
        return []
    ways = [t for one in inner for t in one.transitions if t.target is not None]
    # Nothing is invoked here, so an end can only be that of a state inside, and this is not final.
    return [t for t in ways if t.event not in ("done", "error")]


def _does_something(index: Index, state: State) -> bool:
    """Say whether a state works, watches the clock (as it is written), or stands beside others that do."""
    if _ends_in_time(state) or state.invoke is not None or state.kind is Kind.PARALLEL:
        return True
    node = index.composed.drafts[state.name].node
    return node is not None and bool(node.invoke or node.for_each or node.after or node.budget or node.ask)


def _ends_in_time(state: State) -> bool:
    """Say whether a timer leads out of a state, be its time right or wrong."""
    return any(t.target is not None and t.event.startswith(TIMERS) for t in state.transitions)


def _comes_from_the_world(event: str, raised: set[str]) -> bool:
    """Say whether an event comes neither from the chart nor from an operator."""
    first = event.partition(".")[0]
    return event not in raised and first not in ("", "*", "budget", "operator", "mission")


def _has_way_out(index: Index, state: State, without: Iterable[str] = ()) -> bool:
    """Say whether a transition of the state, or of one around it, has a target.

    Events in `without` do not count, nor do ends of what the states around have begun.
    """
    if any(t.target is not None and t.event not in without for t in state.transitions):
        return True
    around = (index.chart.states[name] for name in index.lineage[state.name][1:])
    return any(
        t.target is not None and t.event not in ("done", "error") for a in around for t in a.transitions
    )


# -- unreachable-state ------------------------------------------------------------------------------------


def unreachable_state(index: Index) -> Iterator[Diagnostic]:
    """Find a state that no initial state and no transition leads to; only the outermost ones."""
    reached = index.reached
    if len(reached) == len(index.states):
        return
    for state in index.states:
        missing = state.name not in reached
        if missing and state.parent in reached and not _is_implied(index, state):
            problem, hint = "no way leads to this state", "add a transition to it, or remove it"
            yield Diagnostic(state.place, "unreachable-state", state.name, problem, hint)


def _is_implied(index: Index, state: State) -> bool:
    """Say whether a state is not written as one: the history that a `history:` key stands for."""
    return state.kind is Kind.HISTORY and index.composed.drafts[state.name].node is None


# -- dead-end ---------------------------------------------------------------------------------------------


def dead_end(index: Index) -> Iterator[Diagnostic]:
    """Find states from which no way leads to an end: one that cannot be left, or several in a circle."""
    states, ways = index.chart.states, _Ways(index)
    last = [part for part in components(ways.leads) if not ways.leads_on(part)]
    reached = index.reached if last else set()
    for part in last:
        rest = [states[name] for name in part if name in reached and states[name].kind is Kind.ATOMIC]
        if rest:
            rest.sort(key=lambda state: state.place)
            yield from _dead_end_finding(index, rest)


def _dead_end_finding(index: Index, rest: Sequence[State]) -> Iterator[Diagnostic]:
    state, hint = rest[0], "add a transition, or 'type: final'"
    if len(rest) > 1:
        problem = f"from here only {_and([s.local_name for s in rest])} can be reached, and never an end"
        hint = "add a way to a final state, to FAULT or out of the mission"
        yield Diagnostic(state.place, "dead-end", state.name, problem, hint)
    elif _has_way_out(index, state):
        problem = "from here only this state itself can be reached, and never an end"
        yield Diagnostic(state.place, "dead-end", state.name, problem, hint)
    elif state.invoke is None:  # an operation whose end is not handled is told as that
        yield Diagnostic(state.place, "dead-end", state.name, "nothing leads out of this state", hint)


def _and(names: Sequence[str]) -> str:
    shown = [repr(name) for name in names[:4]]
    if len(names) > 4:
        shown[3] = f"{len(names) - 3} others"
    return f"{', '.join(shown[:-1])} and {shown[-1]}"


class _Ways:
    """The graph of possible successors, ignoring guards: a node for a state, and one for entering it anew.

    An end is a final state without a successor: a mission's or the chart's own. FAULT counts as one; for a
    mission also every way out of the slot, and for the lifecycle the slot, for then a mission begins. States
    inside one with such a way out are skipped.
    """

    def __init__(self, index: Index) -> None:
        self._index = index
        self._states = index.chart.states
        self._slot = index.slot.name if index.slot else None
        self._ends: set[str] = set()
        self._handler: dict[str, str | None] = {}
        self.leads: dict[str, list[str]] = {}
        for state in index.states:
            if state.parent in self._ends:
                self._ends.add(state.name)
            else:
                self._add(state)

    def leads_on(self, part: Sequence[str]) -> bool:
        """Say whether a strongly connected component holds an end, or leads out of it."""
        own = set(part)
        return not own.isdisjoint(self._ends) or any(
            after not in own for node in part for after in self.leads[node]
        )

    def _add(self, state: State) -> None:
        name = state.name
        above = self._handler[state.parent] if state.parent is not None else None
        ways = [above] if above is not None else []
        inside = self._slot is not None and bool(state.mission or state.slot)
        moves = (*state.transitions, *state.resume_at)
        targets = [t.target for t in moves if t.target and (t.event != "done" or state.invoke is not None)]
        ways += map(self._entering, targets)
        if inside and any(self._slot not in self._index.lineage[target] for target in targets):
            self._ends.add(name)
        self._handler[name] = name if targets else above
        if state.kind is Kind.FINAL:
            ways.extend(self._after_end(state))
        elif name == FAULT:
            self._ends.add(name)
        if state.children:
            # Once a mission has begun, its own states are looked at.
            begun = [] if state.slot else self._index.begun(state)
            self.leads[f"{name}+"] = [*map(self._entering, begun)]
        self.leads[name] = ways

    def _entering(self, name: str) -> str:
        """Return the node of entering a state; of a history, that of all that it may stand for."""
        state = self._states[name]
        if state.kind is not Kind.HISTORY:
            return f"{name}+" if state.children else name
        if f"{name}+" not in self.leads:
            parent = self._states[state.parent or ""]
            self.leads[f"{name}+"] = [self._entering(child.name) for child in self._index.regions(parent)]
        return f"{name}+"

    def _after_end(self, final: State) -> list[str]:
        """Return the successors of a final state; without any it is an end."""
        parent = self._states[final.parent or ""]
        above = self._states[parent.parent] if parent.parent is not None else None
        if above is None or above.slot:
            self._ends.add(final.name)
            return []
        holders = [parent, above] if above.kind is Kind.PARALLEL else [parent]
        return [
            self._entering(t.target)
            for holder in holders
            for t in holder.transitions
            if t.event == "done" and t.target is not None
        ]
