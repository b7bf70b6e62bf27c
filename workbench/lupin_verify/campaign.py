"""Campaigns: randomised testing of a mission in simulated worlds, with all properties as monitors.

The result of a seed is the same on every machine, and the sum of seeds does not depend on their order: of
equal findings the smallest seed counts. A campaign without violations proves nothing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from lupin_engine.chart import Chart, Kind, State, Transition
from lupin_engine.machine import Step, World
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import START
from lupin_engine.properties import STANDSTILL, Monitor, Property, WatchPlans, properties_of
from lupin_engine.replay import RunRecord
from lupin_engine.runtime import make_world
from lupin_engine.sim import Run, Script, Simulation, Standstill
from lupin_verify.draws import draw, pool_of
from lupin_verify.rates import Rates

#: Two transitions, one taken after the other, no third between them.
Pair = tuple[str, str]


@dataclass(frozen=True)
class Violation:
    """The first violation of a property in a run: after so many `steps`, or at its end."""

    name: str
    seed: int
    text: str
    time: float
    steps: int


@dataclass
class CampaignSum:
    """The sum of some seeds, in `seconds` of virtual time and with so many `processor` seconds.

    `pairs`, `transitions` and entered `states` have the smallest seed that reached each, `runs_of_pair` how
    many seeds did. `first` has each property's violation after the fewest steps.
    """

    seeds: int = 0
    missions: int = 0
    steps: int = 0
    seconds: float = 0.0
    processor: float = 0.0
    relevant: Counter[str] = field(default_factory=Counter)
    violated: Counter[str] = field(default_factory=Counter)
    first: dict[str, Violation] = field(default_factory=dict)
    transitions: dict[str, int] = field(default_factory=dict)
    states: dict[str, int] = field(default_factory=dict)
    pairs: dict[Pair, int] = field(default_factory=dict)
    runs_of_pair: Counter[Pair] = field(default_factory=Counter)
    ended: Counter[str] = field(default_factory=Counter)

    def add(self, other: CampaignSum) -> None:
        """Add the sum of other seeds."""
        for name in ("seeds", "missions", "steps", "seconds", "processor"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for name in ("relevant", "violated", "runs_of_pair", "ended"):
            getattr(self, name).update(getattr(other, name))
        _keep_smallest(self.transitions, other.transitions)
        _keep_smallest(self.states, other.states)
        _keep_smallest(self.pairs, other.pairs)
        for violation in other.first.values():
            self.keep(violation)

    def keep(self, violation: Violation) -> None:
        """Keep a violation if it has the fewest steps, and among equals the smallest seed."""
        known = self.first.get(violation.name)
        if known is None or (violation.steps, violation.seed) < (known.steps, known.seed):
            self.first[violation.name] = violation

    @property
    def last_new(self) -> int:
        """The last seed that reached a pair which none before it had."""
        return max(self.pairs.values(), default=0)

    @property
    def chance_of_new(self) -> float:
        """An upper estimate of the chance that a further seed reaches a new pair, by Good and Turing."""
        once = sum(1 for count in self.runs_of_pair.values() if count == 1)
        return min(1.0, once / self.seeds) if self.seeds else 1.0


def _keep_smallest(known: dict[Any, int], found: Mapping[Any, int]) -> None:
    for key, seed in found.items():
        if seed < known.get(key, seed + 1):
            known[key] = seed


# -- one seed --------------------------------------------------------------------------------------------


class Campaign:
    """A loaded mission with its properties, and the random world of each seed."""

    def __init__(self, loaded: LoadedMissions, rates: Rates, parameters: Mapping[str, Any]) -> None:
        self.loaded = loaded
        self.rates = rates
        self.parameters = {**rates.parameters, **parameters}
        self.world: World = make_world(loaded.chart, self.parameters)
        self.properties: tuple[Property, ...] = properties_of(loaded.chart)
        self.plans = WatchPlans(self.properties)
        #: All monitored properties, with their sentences.
        self.watched = {
            **{one.name: one.says for one in self.properties},
            STANDSTILL: "No mission runs in a cycle that takes no time.",
        }
        self._pool = pool_of(self.world, rates.script.mission)
        #: The folder that files were read from, and the one that texts name instead.
        self.folders = ("", "")
        rules = (rule for state in self.chart.states.values() for rule in state.transitions)
        self.rules = {rule.id: rule for rule in rules if rule.refuse is None}

    @property
    def chart(self) -> Chart:
        """The chart of the mission."""
        return self.loaded.chart

    @property
    def begins_on_request(self) -> bool:
        """Whether a mission of the chart begins by request, and not by itself."""
        return any(rule.event == START for rule in self.rules.values())

    @property
    def can_be_taken(self) -> int:
        """The number of transitions that do more than refuse."""
        return len(self.rules)

    def never_taken(self, found: CampaignSum) -> list[Transition]:
        """Return the transitions that no seed took."""
        return [rule for name, rule in self.rules.items() if name not in found.transitions]

    def never_entered(self, found: CampaignSum) -> list[State]:
        """Return the states that no seed entered."""
        return [
            state
            for name, state in self.chart.states.items()
            if name not in found.states and state.parent is not None and state.kind is not Kind.HISTORY
        ]

    def script(self, seed: int) -> Script:
        """Return the world of a seed."""
        return draw(self.rates, seed, self._pool)

    def run(self, seed: int, into: CampaignSum) -> Run | None:
        """Run a seed and add its result; return None when time stood still in it, which is a violation."""
        simulation = Simulation(self.chart, self.script(seed), self.parameters, self.world)
        monitor = Monitor(self.plans)
        simulation.listener = lambda step: monitor.take(step, simulation.machine.scope)
        into.seeds += 1
        run = None
        try:
            run = simulation.run()
            monitor.end(run.watched_until)
            into.ended[run.view.lifecycle] += 1
        except Standstill as problem:
            # The step that does not end is an execution error with the same text, too: count it once.
            others = {name: one for name, one in monitor.breaches.items() if one[1] != str(problem)}
            monitor.breaches = {**others, STANDSTILL: (simulation.steps[-1], str(problem))}
        into.seconds += simulation.now
        into.relevant.update(monitor.relevant)
        into.relevant[STANDSTILL] += len(simulation.steps)
        self._count(simulation.steps, seed, into)
        for name, text, step in monitor.found:
            into.violated[name] += 1
            number = step.sequence if step is not None else len(simulation.steps)
            text = text.replace(*self.folders) if self.folders[0] else text
            violation = Violation(name, seed, text, simulation.now if step is None else step.time, number)
            into.keep(violation)
        return run

    def _count(self, steps: Sequence[Step], seed: int, into: CampaignSum) -> None:
        taken = [rule for step in steps for rule in step.taken if rule in self.rules]
        pairs = set(pairwise(taken))
        into.steps += len(steps)
        into.missions += sum(1 for step in steps if step.event.name == START and step.accepted)
        into.runs_of_pair.update(pairs)
        _keep_smallest(into.transitions, dict.fromkeys(taken, seed))
        _keep_smallest(into.states, {name: seed for step in steps for name in step.entered})
        _keep_smallest(into.pairs, dict.fromkeys(pairs, seed))

    def recorded(self, violation: Violation) -> RunRecord:
        """Run a violation's seed again; return the run up to the violating step."""
        script = self.script(violation.seed)
        simulation = Simulation(self.chart, script, self.parameters, self.world)
        with suppress(Standstill):  # time stands still: the steps are there all the same
            simulation.run()
        return RunRecord(tuple(simulation.steps[: violation.steps]), self.parameters, script.seed)
