"""Predicts a mission: many runs in virtual time with learned rates, and remarks on these."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from lupin_engine.machine import World
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import READY, START
from lupin_engine.sim import LIMIT, Happening, Run, Script, SetValue, Simulation
from lupin_verify.learning import ENOUGH
from lupin_verify.rates import Rates

#: How many targets a remark names.
MOST = 5
#: An operation, a target, and the number of the rule that answered.
Answer = tuple[str, str, int | None]


@dataclass
class Expected:
    """The results of the runs.

    `seconds` are durations of the missions that ended, `left` what live values that drain were at their ends,
    `missed` the number of targets that were not visited, and `missed_at` in how many runs each was not.
    `stuck` counts the others by the state in which they stopped. `remarks` say which rates were too few.
    """

    runs: int = 0
    targets: int = 0
    seconds: list[float] = field(default_factory=list)
    left: dict[str, list[float]] = field(default_factory=dict)
    missed: list[int] = field(default_factory=list)
    missed_at: Counter[str] = field(default_factory=Counter)
    stuck: Counter[str] = field(default_factory=Counter)
    remarks: list[str] = field(default_factory=list)


def learned_script(
    rates: Rates, mission: str, request: Mapping[str, Any], values: Mapping[str, Any] | None = None
) -> Script:
    """Return a script that draws from a file of rates alone.

    Args:
        request: over that of the file.
        values: live values at the beginning, over those of the file.
    """
    own = rates.own
    began = (Happening(SetValue(name, value)) for name, value in (values or {}).items())
    happenings, limit = (*own.happenings, *began), max(own.limit, LIMIT)
    request = {**own.request, **request}
    return replace(own, mission=mission, request=request, happenings=happenings, limit=limit)


def expect(
    loaded: LoadedMissions,
    rates: Rates,
    script: Script,
    world: World,
    seeds: Iterable[int],
    report: Callable[[int], object] = lambda runs: None,
) -> Expected:
    """Run a script of learned rates once for each seed; `report` is called with the number of runs done."""
    found, answers = Expected(), Counter[Answer]()
    for seed in seeds:
        seeded = replace(script, seed=script.seed + seed)
        simulation = Simulation(loaded.chart, seeded, {}, world)
        _add(found, simulation.run())
        for (operation, target, _, rule), count in simulation.answered.items():
            answers[operation, target, rule] += count
        report(found.runs)
    found.remarks = [
        *_remarks(rates, answers, loaded.chart.profile.terminal.target),
        *_constant(found, rates),
    ]
    return found


def mission_seconds(run: Run) -> float:
    """Return how long a mission took, from its start."""
    started = (step.time for step in run.steps if step.event.name == START and step.accepted)
    return run.seconds - next(started, run.seconds)


def _add(found: Expected, run: Run) -> None:
    found.runs += 1
    found.targets = max(found.targets, len(run.visits))
    if not run.ended or run.history.errors:
        refused = [step.refusal.text for step in run.history.refused if step.refusal]
        said = (run.view.lifecycle, run.view.phase, run.view.code)
        found.stuck["; ".join([" ".join(filter(None, said)), *refused[-1:]])] += 1
        return
    found.seconds.append(mission_seconds(run))
    missed = [visit.target for visit in run.visits if not run.chart.profile.is_good(visit.status)]
    found.missed.append(len(missed))
    found.missed_at.update(set(missed))
    levels = {spec.value: spec.initial for spec in run.chart.inputs.values() if spec.levels}
    for step in run.steps:
        if step.event.name == "value" and step.event.data["name"] in levels:
            levels[step.event.data["name"]] = step.event.data["value"]
    for name, level in levels.items():
        found.left.setdefault(name, []).append(float(level or 0.0))


# -- what the runs were drawn from ---------------------------------------------------------------------------


def _constant(found: Expected, rates: Rates) -> Iterator[str]:
    """Yield a remark for each live value of which no loss was learned."""
    losing = {one.value for one in rates.own.measured.drains if one.per_metre or one.per_minute}
    yield from (
        f"{name}: no loss was seen; it stays as it begins" for name in found.left if name not in losing
    )


def _remarks(rates: Rates, answers: Mapping[Answer, int], word: str) -> Iterator[str]:
    """Yield remarks on answers drawn from attempts at other places; the most frequent first."""
    known = rates.learned.seen if rates.learned else {}
    coarse = defaultdict[tuple[str, int | None], dict[str, int]](dict)
    for (operation, target, number), _ in sorted(answers.items(), key=lambda item: -item[1]):
        is_coarse = bool(target and known and number is not None and rates.own.rules[number].target is None)
        if operation != READY and (number is None or is_coarse):
            coarse[operation, number][target] = known.get(operation, {}).get(target, 0)
    for (operation, number), by_target in coarse.items():
        seen = known.get(operation, {})
        if number is None:
            few = f"{sum(seen.values())} seen, too few" if seen else "never seen"
            yield f"{operation}: {few}; it answers as the mock of its plugin does"
            continue
        metres = rates.own.rules[number].metres
        here = f" of {metres.low:g} m to {metres.high:g} m" if metres else ""
        targets = [f"{target} ({count} seen)" for target, count in by_target.items()]
        more = f" and {len(targets) - MOST} more" if len(targets) > MOST else ""
        few = f"fewer than {ENOUGH}{here}; those to any {word} are used"
        yield f"{operation} at {', '.join(targets[:MOST])}{more}: {few}"
