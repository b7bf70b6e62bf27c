"""Proves the properties of a chart by state-space exploration, within bounds that the proof names.

A broken property comes with a counterexample: a shortest path, and its timed run. Where no times are found
for the path, the property is not shown. Without a complete exploration nothing is proven, but breaches of
single steps are found all the same.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from lupin_engine.chart import Chart
from lupin_engine.errors import Place, Problems, UsageError
from lupin_engine.machine import Step, World
from lupin_engine.properties import properties_of
from lupin_verify.growth import BoundedExplorer, Growth
from lupin_verify.outcome_table import CauseOutcome, OutcomeTable, collected, read_outcomes
from lupin_verify.outcomes import OUTCOMES, OutcomePage
from lupin_verify.reached import Reached, Unreached, reached, unreached
from lupin_verify.situations.compared import part_of_element
from lupin_verify.situations.explorer import (
    NO_EXCEPTION,
    Bounds,
    SituationExplorer,
)
from lupin_verify.situations.found import INTERRUPTED, Breach, ExplorationProgress, Explored
from lupin_verify.situations.graph import NAMED_OF_THE_GRAPH, OF_THE_GRAPH, Graph, GraphProperty, broken
from lupin_verify.situations.levels import explore
from lupin_verify.situations.moves import move_text
from lupin_verify.situations.relevance import reads
from lupin_verify.situations.timing import timed_run
from lupin_verify.situations.ways import ShortestWays
from lupin_verify.situations.worlds import OF_PROPERTY

#: The most breaches of a property that are tried for one with times.
_TRIED = 64
_NO_EXCEPTION = "The engine completes every step."


class ProofVerdict(enum.Enum):
    """The verdict on a property."""

    HOLDS = "holds"
    BROKEN = "broken"
    NOT_RELEVANT = "not relevant"  #: no explored step concerns it
    NOT_PROVEN = "not proven"  #: no breach was found, but not everything was explored
    NOT_SHOWN = "not shown"  #: moves that break it were found, but no times at which they can happen
    NOT_MEANT = "not meant"  #: the missions of the chart are exempt from it, for a reason


@dataclass(frozen=True)
class Proven:
    """A property and its verdict.

    If it is broken, `text` says how, and `steps` are those of a shortest run that breaks it at the time
    `ends`. If it is not shown, `text` and `moves` are of a path that may not be feasible. One
    `of_the_graph` is broken by a goal that cannot be reached after the steps, one that `waits` by a deadline
    that passes.
    `taken` are the transitions of the last step, `configuration` the active states after it.
    """

    name: str
    says: str
    verdict: ProofVerdict
    text: str = ""
    moves: tuple[str, ...] = ()
    steps: tuple[Step, ...] | None = None
    ends: float = 0.0
    of_the_graph: bool = False
    waits: bool = False
    taken: tuple[str, ...] = ()
    configuration: tuple[str, ...] = ()


@dataclass(frozen=True)
class Proof:
    """The verdicts on a chart's properties; `bounds` has sentences about the scope of the exploration.

    `dead` are states and transitions that were never reached; empty unless it is `complete`. If it is not, it
    was `stopped` for a reason; `growth` is a slot that grows without end, or may. `untried` names reads of
    which not all classes were tried, `cut` all that the proof is limited to. `parameters` has all values;
    `varied` says which one is not as given. `outcomes` were collected for a page. `targets` is the most
    elements of a list that the world gives, None in a chart without one; `beyond` says why the default went
    no further. It took so many `seconds`, and so much time of the `processor` (s).
    """

    chart: Chart
    properties: tuple[Proven, ...]
    bounds: tuple[str, ...]
    progress: ExplorationProgress
    complete: bool
    stopped: str = ""
    dead: tuple[Unreached, ...] = ()
    taken: frozenset[str] = frozenset()
    entered: frozenset[str] = field(default_factory=frozenset)
    growth: Growth | None = None
    untried: tuple[str, ...] = ()
    cut: tuple[str, ...] = ()
    parameters: Mapping[str, Any] = field(default_factory=dict)
    varied: str = ""
    outcomes: tuple[CauseOutcome, ...] = ()
    targets: int | None = None
    beyond: str = ""
    seconds: float = 0.0
    processor: float = 0.0

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C has ended it, or its continuation with longer lists."""
        return INTERRUPTED in (self.stopped, self.beyond)

    @property
    def broken(self) -> list[Proven]:
        """The properties that are broken."""
        return [one for one in self.properties if one.verdict is ProofVerdict.BROKEN]

    @property
    def not_shown(self) -> list[Proven]:
        """The properties that are neither shown to hold nor to be broken."""
        return [one for one in self.properties if one.verdict is ProofVerdict.NOT_SHOWN]

    @property
    def never_applied(self) -> list[Proven]:
        """The author's own properties that no explored step concerns."""
        own = [one for one in self.properties if is_own(self.chart, one.name)]
        return [one for one in own if one.verdict is ProofVerdict.NOT_RELEVANT]

    @property
    def reached(self) -> Reached:
        """How much of the chart was reached."""
        return reached(self.chart, self.taken, self.entered)


def listed(chart: Chart) -> Iterator[tuple[str, str, Place | None]]:
    """Yield the properties of a chart: name, sentence and place; None where the engine brings it."""
    stages, own = chart.profile.stages, chart.properties
    named = [one for one in NAMED_OF_THE_GRAPH if one.name in own]
    for one in properties_of(chart):
        yield one.name, one.says, own[one.name].place if one.name in own else None
    yield NO_EXCEPTION, _NO_EXCEPTION, None
    for rule in (*OF_THE_GRAPH, *named):
        yield rule.name, rule.named(stages).says, own[rule.name].place if rule in named else None


def is_own(chart: Chart, name: str) -> bool:
    """Return whether a property stands in a mission or a part, not in the lifecycle or the engine."""
    rule = chart.properties.get(name)
    return rule is not None and rule.place.file not in chart.lifecycle_files


def prove(
    world: World,
    bounds: Bounds,
    stop_reason: Callable[[ExplorationProgress], str] = lambda _: "",
    outcomes: Path | None = None,
) -> Proof:
    """Explore every situation of a chart, and judge its properties.

    Args:
        world: the chart with its parameters.
        bounds: how far is explored.
        stop_reason: called now and then; returns why to stop, or nothing.
        outcomes: a page of outcomes whose cells are a property, too; `NEW`: collect what stands on one.

    Raises:
        UsageError: the page cannot be read, or reads values outside the cone of influence.
    """
    page = None if outcomes is None else read_outcomes(outcomes, world.chart)
    watched = (*properties_of(world.chart), *((page.watched,) if page else ()))
    explorer = BoundedExplorer(world, watched, bounds)
    if page is not None:
        _check_seen(page, explorer)

    def look(progress: ExplorationProgress) -> str:
        return str(explorer.growth or "") or stop_reason(progress)

    found, explored, exact = _judged(explorer, look)
    growth = explorer.growth
    if growth is None and not explored.complete:
        growth = explorer.may_grow()
    if exact.complete and any(one.verdict is ProofVerdict.NOT_SHOWN for one in found):
        explorer.differences = True
        again, *finer = _judged(explorer, look)
        if finer[1].complete:
            found, (explored, exact) = again, finer
    if isinstance(page, OutcomeTable) and explored.complete:
        found = [_compared(one, page, explored) for one in found]
    dead = unreached(world.chart, explored.taken, explored.entered) if explored.complete else ()
    return Proof(
        world.chart,
        tuple(found),
        (*in_words(explorer, explored), *(page.in_words(explored.relevant) if page else ())),
        explored.progress,
        exact.complete,
        exact.stopped,
        dead,
        frozenset(explored.taken),
        frozenset(explored.entered),
        growth,
        tuple(explorer.classes.left_out),
        tuple(_cut(explorer)),
        dict(world.parameters),
        outcomes=tuple(collected(explored.relevant)),
        targets=bounds.targets if explorer.classes.cuts_lists else None,
    )


def _judged(
    explorer: BoundedExplorer, look: Callable[[ExplorationProgress], str]
) -> tuple[list[Proven], Explored, Explored]:
    """Explore, and judge each property; returns the explorations for those of steps, and of the graph."""
    explored = explore(explorer, look)
    if explorer.growth is not None:
        explored.complete, explored.stopped = False, str(explorer.growth)
    judge = _Judge(explorer, explored)
    found = [judge.of_steps(one.name, one.says) for one in explorer.properties]
    if NO_EXCEPTION in explored.breaches:
        found.append(judge.of_steps(NO_EXCEPTION, _NO_EXCEPTION))
    exact = explored
    if any(judge.broken.values()):
        # With unconstrained inputs the attractor is an under-approximation: the breach may be spurious.
        exact = explore(explorer, look, open_values=False)
        judge = _Judge(explorer, exact)
    return [*found, *judge.of_graph()], explored, exact


def _compared(one: Proven, table: OutcomeTable, explored: Explored) -> Proven:
    """Return the verdict on a written page: it is broken by outcomes that only it, or only the graph, has."""
    lines = table.differences(collected(explored.relevant)) if one.name == OUTCOMES else []
    return replace(one, verdict=ProofVerdict.BROKEN, text="\n      ".join(lines)) if lines else one


def _check_seen(page: OutcomePage | OutcomeTable, explorer: SituationExplorer) -> None:
    """Refuse conditions that read values outside the cone of influence: situations do not store them."""
    problems, seen = Problems(UsageError), explorer.relevance
    levelled = {name for name, spec in explorer.chart.inputs.items() if spec.levels}
    for condition in page.conditions:
        for root, name in reads(condition):
            known = {"context": seen.variables, "input": seen.inputs | levelled}.get(root)
            if known is not None and name not in known:
                problems.add(
                    f"{condition.place.shown}: no condition of the mission reads {name!r}, so situations with"
                    " different values are one; leave it out"
                )
    problems.raise_any()


class _Judge:
    """Judges each property of an exploration, and builds the counterexamples."""

    def __init__(self, explorer: SituationExplorer, explored: Explored) -> None:
        self._explorer = explorer
        self._explored = explored

    @cached_property
    def _ways(self) -> ShortestWays:
        return ShortestWays(self._explored)

    def of_steps(self, name: str, says: str) -> Proven:
        """Judge a safety property, which is watched in every step."""
        explored = self._explored
        if name in explored.breaches:
            nearest = self._ways.first(explored.breaches[name])[:_TRIED]
            return self._first(self._way_of(one, says) for one in nearest)
        if reason := _exempt(self._explorer.chart, name):
            return Proven(name, says, ProofVerdict.NOT_MEANT, reason)
        if not explored.complete:
            return Proven(name, says, ProofVerdict.NOT_PROVEN)
        return Proven(
            name, says, ProofVerdict.HOLDS if explored.relevant.get(name) else ProofVerdict.NOT_RELEVANT
        )

    def _way_of(self, breach: Breach, says: str) -> Proven:
        last = self._explored.moves.each(breach.move) if breach.move >= 0 else ()
        return self._broken([*self._ways.to(breach.situation), *last], breach.name, says, breach.text)

    @cached_property
    def broken(self) -> dict[str, list[int]]:
        """The liveness properties that apply, each with the situations that break it."""
        if not self._explored.complete:
            return {}
        graph, chart = Graph(self._explored), self._explorer.chart
        labels = {state.label for state in chart.states.values()}
        begins = not labels.isdisjoint({*chart.profile.stages.ready, *chart.profile.stages.ended})
        return {one.name: broken(graph, one) for one in self._of_graph if begins or not one.of_missions}

    @property
    def _of_graph(self) -> list[GraphProperty]:
        stages = self._explorer.chart.profile.stages
        chart = self._explorer.chart
        own = [one for one in NAMED_OF_THE_GRAPH if _is_meant(chart, one.name)]
        return [one.named(stages) for one in (*OF_THE_GRAPH, *own)]

    def of_graph(self) -> list[Proven]:
        """Judge the liveness properties, of the graph as a whole."""
        chart = self._explorer.chart
        named = [one.named(chart.profile.stages) for one in NAMED_OF_THE_GRAPH]
        reasons = [(one, _exempt(chart, one.name)) for one in named]
        exempt = [Proven(one.name, one.says, ProofVerdict.NOT_MEANT, why) for one, why in reasons if why]
        if not self._explored.complete:
            open = [Proven(one.name, one.says, ProofVerdict.NOT_PROVEN) for one in self._of_graph]
            return [*open, *exempt]
        found = exempt
        for one in self._of_graph:
            situations = self.broken.get(one.name)
            if situations is None:
                found.append(Proven(one.name, one.says, ProofVerdict.NOT_RELEVANT))
            elif not situations:
                found.append(Proven(one.name, one.says, ProofVerdict.HOLDS))
            else:
                ways = map(self._ways.to, self._ways.nearest(situations)[:_TRIED])
                counterexample = self._first(self._broken(way, one.name, one.says, one.why) for way in ways)
                found.append(replace(counterexample, of_the_graph=True, taken=()))
        return found

    def _first(self, counterexamples: Iterable[Proven]) -> Proven:
        """Return the first counterexample with times, or else the first."""
        tried = []
        for one in counterexamples:
            if one.steps is not None:
                return one
            tried.append(one)
        return tried[0]

    def _broken(self, way: Sequence[int], name: str, says: str, text: str) -> Proven:
        explorer, way = self._explorer, self._explorer.without_idle(way)
        moves = tuple(move_text(explorer.chart, explorer.moves.all[number]) for number in way)
        run = timed_run(explorer, way)
        waits = bool(way) and explorer.moves.all[way[-1]].timer[0] == OF_PROPERTY
        steps, ends = (None, 0.0) if run is None else (tuple(run.steps), run.ends)
        situation, effect = explorer.walk(way)[-1]
        there = tuple(explorer.table.get(situation, ("configuration", "")) or ())
        # An engine that raises has no run to its end.
        shown = steps is not None or name == NO_EXCEPTION
        verdict = ProofVerdict.BROKEN if shown else ProofVerdict.NOT_SHOWN
        return Proven(name, says, verdict, text, moves, steps, ends, False, waits, effect.taken, there)


def _cut(explorer: SituationExplorer) -> Iterator[str]:
    """Yield what a proof is limited to, of what this chart has."""
    most = explorer.bounds.targets
    if explorer.classes.cuts_lists:
        yield f"lists of up to {most} element{'' if most == 1 else 's'}" if most else "empty lists"
    if explorer.moves.cuts_waiting:
        yield f"up to {explorer.bounds.deferred} events of each kind that wait in a hold"
    if explorer.classes.left_out:
        yield "the values that were tried"


def _is_meant(chart: Chart, name: str) -> bool:
    """Return whether a file names a built-in property, and one of the missions means it."""
    rule = chart.properties.get(name)
    return rule is not None and rule.built_in and any(map(rule.is_meant, chart.missions))


def _exempt(chart: Chart, name: str) -> str:
    """Return why a property is meant of none of the chart's missions; '' where it is meant of one."""
    rule = chart.properties.get(name)
    if rule is None or not chart.missions or not chart.missions.keys() <= rule.not_meant.keys():
        return ""
    return "; ".join(dict.fromkeys(rule.not_meant[mission] for mission in chart.missions))


def _lists(explorer: SituationExplorer) -> Iterator[str]:
    """Yield sentences about the lists of a chart: those that the world gives, and the constant ones."""
    classes, most = explorer.classes, explorer.bounds.targets
    unclear = {part_of_element(read) for read in classes.untried_reads} - {None}
    parts = sorted({".".join(names or ()) or "name" for names in unclear | {*classes.compared.told_apart_by}})
    apart = f"conditions tell them apart by {', '.join(parts)}"
    alike = apart if parts else "which they are makes no difference"
    if classes.cuts_lists:
        elements = f"0 to {most} different elements; {alike}" if most else "no elements"
        yield f"Itineraries and lists have {elements}."
    fixed = [
        f"{name} ({number} element{'' if number == 1 else 's'})" for name, number in classes.fixed.items()
    ]
    if fixed:
        yield f"These lists are fixed, and walked whole: {', '.join(fixed)}."


def in_words(explorer: SituationExplorer, explored: Explored) -> list[str]:
    """Return sentences about the scope and the bounds of an exploration."""
    bounds, classes = explorer.bounds, explorer.classes
    late = "Late answers, to orders that were given up and hold back no other, are not explored;"
    late += " --late 1 adds them."
    if bounds.owed:
        late = f"Of the orders already given up, up to {bounds.owed} may still be answered at any time."
    found = [
        *_lists(explorer),
        late,
        "Servers that refuse a cancel are not explored; meanwhile, nothing else begins with what they use.",
        "A deadline fires at any time, but not before one that was certainly due earlier.",
        f"{len(classes.requests)} requests, {len(classes.values)} values of inputs and {len(classes.events)}"
        " events of plugins come at any time.",
        f"During a hold at most {bounds.deferred} events of each kind, and as many times of day, wait for the"
        " release.",
        "The robot's clock may come to any time of day between two steps; it is not adjusted.",
        "If an operation sets a live value (such as the pose), that value is known before the operation"
        " succeeds.",
    ]
    if bounds.restarts:
        found.append("The process may end at any time; a new one continues from the journal.")
        found.append(
            "The same missions may be reloaded at any time; during a mission the reload waits for its end."
        )
    else:
        found.append("The process does not end, and missions are not reloaded.")
    if explorer.relevance.irrelevant:
        names = ", ".join(explorer.relevance.irrelevant)
        found.append(f"Values on which no condition depends are not distinguished: {names}.")
    if explored.cut:
        found.append(
            f"{explored.cut:,} moves were not followed, because they lead beyond these bounds: one more event"
            " of a kind in a hold, one more order given up, success before a live value is known."
        )
    found += classes.words()
    found += [f"Not all values were tried: {text}." for text in classes.left_out]
    return found
