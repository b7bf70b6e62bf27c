"""Diagnostics of a proof with places in the mission's file, for checks, pull requests and editors."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from lupin_engine.chart import Chart
from lupin_engine.errors import Diagnostic, Place, Severity
from lupin_engine.properties import BUILT_IN
from lupin_engine.sim import SUFFIX, Scenario
from lupin_verify.proof import Proof, Proven
from lupin_verify.situations.graph import NAMED_OF_THE_GRAPH, OF_THE_GRAPH

#: The rules of the checker that such findings belong to.
RULE = "broken-property"
GROWS, UNREACHED, UNUSED = "grows-without-end", "never-reached", "never-applies"
UNPROVEN = "not-proven"
RULES = (RULE, GROWS, UNREACHED, UNUSED, UNPROVEN)


def findings(proof: Proof, mission: str) -> list[Diagnostic]:
    """Return the diagnostics of a proof: an error for each broken property, and warnings.

    Args:
        proof: the proof.
        mission: the argument of `lupin prove`.
    """
    hint = f"lupin prove {shlex.quote(mission)} tells how it comes to that"
    shown = [_finding(proof.chart, one, hint) for one in proof.broken]
    return [*shown, *(_not_shown(proof.chart, one, hint) for one in proof.not_shown), *_warnings(proof)]


def _warnings(proof: Proof) -> Iterator[Diagnostic]:
    """Yield warnings: growth, an incomplete proof, properties that never apply, unreached states."""
    chart, warn, grows = proof.chart, Severity.WARN, proof.growth
    if grows is not None:
        yield Diagnostic(grows.place, GROWS, grows.path, grows.text, grows.hint, warn)
    if not proof.complete and proof.stopped != str(grows or ""):
        places = [*(mission.place for mission in chart.missions.values()), chart.states[""].place]
        hint = "nothing is known of the rest: give the proof more time"
        yield Diagnostic(places[0], UNPROVEN, "", f"not proven: {proof.stopped}", hint, warn)
    for one in proof.never_applied:
        place, why = chart.properties[one.name].place, "it never applied: no explored step concerns it"
        hint = "see whether its conditions can ever be true"
        yield Diagnostic(place, UNUSED, f"properties.{one.name}", why, hint, warn)
    for part in proof.dead:
        hint = "see what should lead there, or leave it out"
        text = f"{part.text} is {part.says}, with these parameters and bounds"
        yield Diagnostic(part.place, UNREACHED, part.path, text, hint, warn)


def _not_shown(chart: Chart, one: Proven, hint: str) -> Diagnostic:
    why = f"not shown: {one.name}: moves that break it were found, but no times at which they can happen"
    found = _finding(chart, one, hint)
    return replace(found, rule=UNPROVEN, path="", problem=why, severity=Severity.WARN)


def _finding(chart: Chart, one: Proven, hint: str) -> Diagnostic:
    return _at(chart, one.taken, one.configuration, one.name, one.text, hint)


def counterexamples(mission: Path) -> dict[Path, str]:
    """Return the scenarios that `lupin prove` has written beside a mission, each with its property."""
    found = sorted(mission.parent.glob(f"{mission.stem}.*{SUFFIX}"))
    names = {file: file.name.removeprefix(f"{mission.stem}.").removesuffix(SUFFIX) for file in found}
    return {file: name for file, name in names.items() if "." not in name}


def shown_by(scenario: Scenario, name: str) -> Diagnostic | None:
    """Run a scenario that `lupin prove` has written; return its breach, None where there is none any more.

    Errors as for `simulate`.
    """
    known = {one.name for one in BUILT_IN} | {one.name for one in OF_THE_GRAPH}
    if name not in known | scenario.chart.properties.keys():
        return None
    run = scenario.run()
    hint = f"lupin test {shlex.quote(scenario.file.name)} shows it"
    for one in (*OF_THE_GRAPH, *NAMED_OF_THE_GRAPH):
        if one.name == name:
            if not scenario.failures(run):
                return None
            why = one.named(scenario.chart.profile.stages).why
            return _at(scenario.chart, (), run.steps[-1].configuration, name, why, hint)
    for step, violated, text in run.violated:
        if violated == name:
            taken = step.taken if step is not None else ()
            configuration = (step or run.steps[-1]).configuration
            return _at(scenario.chart, taken, configuration, name, text, hint)
    return None


def _at(
    chart: Chart, taken: Iterable[str], configuration: Sequence[str], name: str, text: str, hint: str
) -> Diagnostic:
    """Return a finding at the last taken transition, or without one at the innermost state."""
    rules = {rule.id: rule for state in chart.states.values() for rule in state.transitions}
    place, where = Place(chart.states[""].place.file, 1, 1), ""
    if configuration:
        where = configuration[-1]
        place = chart.states[where].place
    for rule in (rules[one] for one in taken if one in rules):
        place, where = rule.place, rule.id
    known = chart.properties.get(name)
    message = f"{name}: {text}" if known is None or known.built_in else text  # an author's own names itself
    return Diagnostic(place, RULE, where, message, hint)
