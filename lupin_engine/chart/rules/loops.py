"""The rules about livelocks: transitions that lead back to each other for ever, or in no time.

Eventless transitions, and those on a level, are taken one after the other within one moment: inputs do not
change meanwhile, and operations have not begun. So a circle of them never becomes stable unless its own
actions make a guard false. A circle that goes through operations as well takes no time when each of them
fails at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from lupin_engine.chart.expressions.evaluation import Constant
from lupin_engine.chart.expressions.guards import TRUE, Formula, formula_of, implies, negate, possible
from lupin_engine.chart.expressions.names import names_read
from lupin_engine.chart.findings import warning
from lupin_engine.chart.model import WRITING, ActionCall, Kind, State, Transition, every_call
from lupin_engine.chart.rules.graph import components, cycles
from lupin_engine.chart.rules.index import Index, always_taken, guard_of, local, taken_when
from lupin_engine.errors import Diagnostic

#: Where this is asked, targets of the sweep are left.
WITHIN_SWEEP = formula_of("itinerary.closed < itinerary.total")
#: So many steps are spent on finding a circle among transitions that lead back to each other.
MAX_STEPS = 500


def always_loop(index: Index) -> Iterator[Diagnostic]:
    """Find transitions that are taken again and again without anything happening in between."""
    loops = _Loops(index)
    for part in components(loops.following):
        if len(part) == 1 and part[0] not in loops.following[part[0]]:
            continue  # most of them lead back to nothing
        circles = cycles(loops.following, sorted(part, key=loops.place_of), MAX_STEPS)
        found = next((circle for circle in circles if loops.never_ends(circle)), None)
        if found is not None:
            yield _finding(loops, [loops.by_id[name] for name in found])


def no_time(index: Index) -> Iterator[Diagnostic]:
    """Find circles in which nothing but operations that may fail at once takes time."""
    failing = [t for s in index.states if _fails_at_once(s) for t in s.transitions if t.event == "error"]
    if not failing:
        return
    loops = _Loops(index, failing)
    failures = {t.id for t in failing}
    for part in components(loops.following):
        circle = _endless(loops, sorted(part, key=loops.place_of), failures)
        if circle:
            first = next(t for t in circle if t.id in failures)
            way = " -> ".join(loops.name_of(t.source) for t in (*circle, circle[0]))
            problem = f"where every operation fails at once, this goes round for ever in no time: {way}"
            hint = "wait in between with 'after', or add a guard that going round makes false"
            yield warning(first.place, "always-loop", first.id, problem, hint)


def _endless(loops: _Loops, part: Sequence[str], failures: set[str]) -> list[Transition]:
    """Return an endless circle of these transitions in which an operation fails; [] without one."""
    if failures.isdisjoint(part):
        return []
    failing = (c for c in cycles(loops.following, part, MAX_STEPS) if not failures.isdisjoint(c))
    found = next((c for c in failing if loops.never_ends(c, walks=True)), ())
    return [loops.by_id[name] for name in found]


def _fails_at_once(state: State) -> bool:
    """Say whether the operation of a state may end in an error without any time passing."""
    retry = state.invoke.retry if state.invoke is not None else None
    if retry is None or retry.backoff is None or retry.unless:
        return state.invoke is not None
    never = ((retry.backoff, 0), (retry.attempts, 1))
    return any(isinstance(value, Constant) and value.value == limit for value, limit in never)


def _finding(loops: _Loops, circle: Sequence[Transition]) -> Diagnostic:
    first = circle[0]
    if first.target is None:
        problem = "this is taken for ever: nothing that it does makes its guard false"
        hint = "add a target, or a guard that its actions make false"
        return Diagnostic(first.place, "always-loop", first.id, problem, hint)
    names = [loops.name_of(t.source) for t in circle]
    way = " -> ".join([*names, names[0]])
    problem = f"this is taken for ever, and the chart never comes to rest: {way}"
    hint = "guard one of the ways with something that going round makes false, or wait in between"
    return Diagnostic(first.place, "always-loop", first.id, problem, hint)


class _Loops:
    """Which eventless transition may follow which within one moment."""

    def __init__(self, index: Index, failing: Sequence[Transition] = ()) -> None:
        """Index the eventless transitions, and those that handle the failure of an operation."""
        looked_at = [*index.eventless, *failing]
        self._index = index
        self._of: dict[str, list[Transition]] = {}
        for transition in looked_at:
            self._of.setdefault(transition.source, []).append(transition)
        self.by_id = {t.id: t for t in looked_at}
        #: What is asked before each of those that may follow a transition.
        self._before: dict[tuple[str, str], list[Transition]] = {}
        self.following = {t.id: self._follow(t) for t in looked_at if self._can_be_taken(t)}

    def name_of(self, state: str) -> str:
        """Return the name of a state in a message."""
        return local(state) or self._index.chart.name

    def place_of(self, name: str) -> tuple[str, int, int]:
        """Return where a transition stands, to sort by."""
        place = self.by_id[name].place
        return (place.file, place.line, place.column)

    def _can_be_taken(self, transition: Transition) -> bool:
        """Say whether a transition is ever taken: the hold that its level engages has precedence."""
        holds = self._index.chart.holds.values()
        passes = transition.during | transition.releases
        if transition.event and any(h.engage == transition.event and h.name not in passes for h in holds):
            return False
        return guard_of(transition).constant is not False

    def _follow(self, transition: Transition) -> list[str]:
        """Return the transitions that may be taken right after one."""
        if transition.target is None and transition.event == "error":
            return []  # what failed is not begun again
        if transition.target is None:
            self._before[transition.id, transition.id] = []
            return [transition.id]
        if self._index.chart.states[transition.target].kind is Kind.HISTORY:
            return []  # what is remembered is not known
        found: dict[str, None] = {}
        for leaf in self._leaves(transition.target):
            asked: list[Transition] = []
            for candidate in self._asked_after(transition, leaf):
                found[candidate.id] = None
                self._before[transition.id, candidate.id] = list(asked)
                asked.append(candidate)
        return list(found)

    def _asked_after(self, transition: Transition, leaf: str) -> Iterator[Transition]:
        """Yield the candidates in an atomic state after a transition, up to one that is always taken."""
        for name in self._index.lineage[leaf]:
            candidates = self._of.get(name, ())
            yield from (t for t in candidates if t.event != "error" or self._begins(t, transition))
            if any(always_taken(t) and not t.event for t in candidates):
                break

    def _begins(self, failing: Transition, entering: Transition) -> bool:
        """Say whether a transition enters the state of an operation in a stable configuration."""
        domain = self._index.semantics.domain(entering, entering.target or "")
        around = (t for name in self._index.lineage[failing.source] for t in self._of.get(name, ()))
        return self._below(failing.source, domain) and not any(
            always_taken(t) and not t.event for t in around
        )

    def _leaves(self, target: str) -> list[str]:
        """Return the innermost states that entering a state leads to."""
        states = self._index.chart.states
        return [name for name in self._index.entered(target) if not self._index.begun(states[name])]

    def never_ends(self, circle: Sequence[str], walks: bool = False) -> bool:
        """Say whether a circle never ends once it is entered: its guards are compatible and stay true.

        With `walks`, advancing in an itinerary without end does not end one.
        """
        changed: set[str] = set()
        conditions: list[Formula] = []
        read: set[str] = set()
        for name, following in pairwise([*circle, circle[0]]):
            transition = self.by_id[name]
            changed |= self._changed(transition)
            asked = self._before[name, following]
            conditions += [taken_when(self.by_id[following]), *(negate(taken_when(t)) for t in asked)]
            guards = [guard_of(t) for t in (self.by_id[following], *asked) if guard_of(t)]
            if not all(guard.understood for guard in guards):
                return False
            read.update(*(names_read(guard.source) for guard in guards))
        if walks and not self._walks_end(circle):
            changed.discard("itinerary")
        return changed.isdisjoint(read) and possible(TRUE, *conditions)

    def _walks_end(self, circle: Sequence[str]) -> bool:
        """Say whether the itineraries around a circle end, however often they are advanced."""
        if any(implies(taken_when(self.by_id[name]), WITHIN_SWEEP) for name in circle):
            return True  # with the sweep
        states = self._index.chart.states
        around = {name for one in circle for name in self._index.lineage[self.by_id[one].source]}
        sweeps = [walk.sweeps for name in around if (walk := states[name].itinerary) is not None]
        return all(n is None or (isinstance(n, Constant) and bool(n.value)) for n in sweeps)

    def _changed(self, transition: Transition) -> set[str]:
        """Return the roots of the environment that a transition changes."""
        calls = list(transition.actions)
        found = {"held"} if transition.releases else set()
        if transition.target is not None:
            found.add("in_state")
            domain = self._index.semantics.domain(transition, transition.target)
            left = [name for name in self._index.lineage[transition.source] if self._below(name, domain)]
            entered = [name for name in self._index.lineage[transition.target] if self._below(name, domain)]
            states = self._index.chart.states
            for name in {*entered, *self._index.entered(transition.target)}:
                calls += states[name].on_entry
                found.update(use.variables if (use := states[name].use) is not None else ())
                found |= {"itinerary", "target"} if states[name].itinerary is not None else set()
            for name in left:
                calls += states[name].on_exit
        return found.union(*map(_written, every_call(calls)))

    def _below(self, name: str, ancestor: str) -> bool:
        return name != ancestor and self._index.inside(name, ancestor)


def _written(call: ActionCall) -> set[str]:
    """Return the roots of the environment that an action changes."""
    if call.name in WRITING:
        return set(call.arguments)
    return {"itinerary", "target"} if call.name.startswith("itinerary.") else set()
