"""Writes a counterexample as a scenario that fails, and simulates it.

The scenario is kept only if its simulation breaks the same property. There is none for a path without times,
and for a page of outcomes, which scenarios do not read.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lupin_engine.chart import Chart, State
from lupin_engine.errors import LupinError
from lupin_engine.machine import Step
from lupin_engine.plugin import START
from lupin_engine.properties import STANDSTILL
from lupin_engine.replay import RunRecord, script_of, yaml_text
from lupin_engine.runtime import History, requests_of
from lupin_engine.sim import (
    SUFFIX,
    Missions,
    Run,
    StepLine,
    load_scenario_text,
    mission_name,
    narrate,
    short_name,
)
from lupin_verify.outcomes import OUTCOMES
from lupin_verify.proof import Proven
from lupin_verify.situations.graph import ABORT_STOPS, HOME_AGAIN, NO_LIVELOCK, NO_ZENO, SILENCE
from lupin_verify.situations.relevance import invokes

#: The digits of times: the first with which the scenario fails are taken.
_DIGITS = (3, 6, 12)
#: How many steps after the breach are shown.
_FOLLOW = 20
#: How long a scenario goes on that waits in vain.
_WAIT = "1 h"
#: How long a mission may go on unreported in a scenario of silent servers.
_SOON = "30 min"
#: How often what could help is asked for, and how long after each other, in seconds.
_ROUNDS, _PAUSE = 3, 60
#: Times of a run and of its scenario differ by less, in seconds.
_NEARLY = 1e-3


@dataclass(frozen=True)
class FailingScenario:
    """A scenario that fails because a property is broken: its file, its text and its run.

    The run is cut some steps after the breach; `more` steps follow. `breach` has the time and the cause.
    """

    file: Path
    text: str
    run: Run
    breach: StepLine
    more: int = 0

    @property
    def lines(self) -> list[StepLine]:
        """The printed steps, with the breach at its time."""
        shown = narrate(self.run.chart, self.run.history)
        before = [line for line in shown if line.time <= self.breach.time + _NEARLY]
        return [*before, self.breach, *shown[len(before) :]]

    @property
    def rest(self) -> str:
        """A note about steps that are not shown; '' where all are."""
        return f"and so on: {self.more} more steps" if self.more else ""


def failing_scenario(
    broken: Proven, mission: Path, parameters: Mapping[str, Any], missions: Missions
) -> FailingScenario | None:
    """Return a scenario of a broken property; None where none was found that breaks it in a simulation.

    It has what comes from outside and the property, and expects nothing else, so that it passes once the
    mission is corrected. For a property of the graph as a whole it expects the goal that cannot be reached,
    such as the mission's end, and asks for it.

    Args:
        broken: the property, with the steps that lead to where it is broken.
        mission: the file of the mission; the scenario stands beside it.
        parameters: the settings of the proof.
        missions: loads them.
    """
    if broken.steps is None:
        return None
    file = mission.with_name(f"{mission.stem}.{broken.name}{SUFFIX}")
    record = RunRecord(broken.steps, dict(parameters))
    chart = missions.chart(mission)
    tries = [(digits, _after) for digits in _DIGITS]
    for digits, after in tries if not broken.of_the_graph else [(_DIGITS[-1], _after), (_DIGITS[-1], _ends)]:
        parts = script_of(record, mission_name(mission, file, missions), broken.says, chart, digits, False)
        own = len(parts.get("mocks", ()))
        parts |= after(broken, chart, parts)
        text = yaml_text(parts)
        run = _failing(broken, text, file, missions)
        if run is not None and any(number >= own for number in run.unspent):
            # Of the servers that shall be silent these are never asked.
            asked = [m for n, m in enumerate(parts.pop("mocks")) if n < own or n not in run.unspent]
            text = yaml_text({**parts, "mocks": asked} if asked else parts)
            run = _failing(broken, text, file, missions)
        if run is not None:
            return _scenario_of(broken, len(broken.steps), file, text, run)
    return None


def _scenario_of(broken: Proven, steps: int, file: Path, text: str, run: Run) -> FailingScenario:
    """Return a scenario with its run up to `_FOLLOW` steps after the breach."""
    shown = run.history.steps[: steps + _FOLLOW]
    more = len(run.history.steps) - len(shown)
    shown_run = replace(run, history=History(shown), seconds=shown[-1].time) if more else run
    return FailingScenario(file, text, shown_run, _breach(broken, run), more)


def _breach(broken: Proven, run: Run) -> StepLine:
    """Return the line that shows the time and the cause of the breach."""
    assert broken.steps is not None, "a story has steps"
    time = broken.ends + _started(run.history.steps) - _started(broken.steps)
    if not (broken.of_the_graph or broken.waits):
        time = next((step.time for step, name, _ in run.violated if step and name == broken.name), time)
    how = broken.text.partition("): ")[2] if broken.text.startswith("property ") else broken.text
    return StepLine(time, f"✗ {broken.name}: {how}", "", (), (), refused=True, remark=True)


def _started(steps: Sequence[Step]) -> float:
    """Return the time of the first start of a mission; 0.0 if there is none."""
    return next((step.time for step in steps if step.event.name == START), 0.0)


def why_none(broken: Proven) -> str:
    """Return why no scenario was written for a property that is broken."""
    if broken.name == OUTCOMES and not broken.moves:
        return "no moves lead to what only the page says"
    if broken.steps is None:
        return "no times were found at which these moves can happen in this order, so it may hold:"
    if broken.name == OUTCOMES:
        return "no scenario was written, because scenarios do not read the page; these moves lead to it:"
    return "no scenario was written: a simulation of these moves does not break the property"


def _after(broken: Proven, chart: Chart, parts: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parts of a scenario about the time after the steps of the counterexample."""
    name = STANDSTILL if broken.name == NO_ZENO else broken.name
    found: dict[str, Any] = {"expect": {"only": name}}
    if broken.of_the_graph or broken.waits:
        found["limit"] = _WAIT
    if not broken.of_the_graph or broken.name == NO_ZENO:
        return found
    if broken.name in (SILENCE, NO_LIVELOCK):
        found |= _comes("somebody_is_told", ["this_step.waiting"])
    if broken.name == SILENCE:
        silent = dict.fromkeys(invoke.name for _, invoke in invokes(chart))
        found["mocks"] = [*parts.get("mocks", ()), *({"do": name, "then": "never"} for name in silent)]
    if broken.name == HOME_AGAIN:
        found |= _comes("comes_home", _home(chart))
        found["when"] = [*parts.get("when", ()), *_asking(broken, chart, _helpful(chart))]
    if broken.name == ABORT_STOPS:
        at_the_end = {"at": "end", "expect": {"running": []}}
        abort = f"operator.{chart.profile.abort}"
        found["when"] = [*parts.get("when", ()), *_asking(broken, chart, [abort]), at_the_end]
        found["expect"] = {"only": []}
    return {key: part for key, part in found.items() if part}


def _ends(_: Proven, chart: Chart, __: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parts of a scenario that expects the mission to end by itself."""
    ended = (*chart.profile.stages.ended, *chart.profile.stages.ready)
    labels = {state.label for state in chart.states.values()}
    final = next((label for label in ended if label in labels), "")
    return {"limit": _WAIT, "expect": {"only": [], "final": final} if final else {}}


def _asking(broken: Proven, chart: Chart, requests: list[str]) -> Iterator[dict[str, Any]]:
    """Yield requests after a counterexample, again and again; before them it undoes reports of values."""
    assert broken.steps is not None, "a story has steps"
    reports = [one.event.data["name"] for one in broken.steps if one.event.name == "value"]
    usual = {one.value: one.initial for one in chart.inputs.values() if one.value in reports}
    time = math.ceil(broken.ends)
    for value, initial in usual.items() if broken.name == HOME_AGAIN else ():
        if initial is not None:
            yield {"at": f"{time + 1} s", "value": {value: initial}}
    for number, request in enumerate(requests * _ROUNDS, 1):
        yield {"at": f"{time + number * _PAUSE} s", "request": request}


def _helpful(chart: Chart) -> list[str]:
    """Return requests that may lead home: none that engages a hold or begins a mission, the abort last."""
    engaging = {hold.engage for hold in chart.holds.values()} | {START}
    names = dict.fromkeys(one.event.name for one in requests_of(chart))
    abort = f"operator.{chart.profile.abort}"
    return sorted((name for name in names if name not in engaging), key=lambda name: name == abort)


def _comes(name: str, conditions: Sequence[str]) -> dict[str, Any]:
    """Return the property that one of these conditions soon comes true, as what alone is expected."""
    some = " or ".join(conditions)
    rule = {"after": f"not ({some})", "eventually": some, "within": _SOON}
    return {"properties": {name: rule}, "expect": {"only": name}}


def _home(chart: Chart) -> list[str]:
    """Return conditions for the states in which a mission could begin."""
    stages = chart.profile.stages
    return _in_one_of(chart, lambda one: one.label in (*stages.ended, *stages.ready))


def _in_one_of(chart: Chart, is_one: Callable[[State], bool]) -> list[str]:
    """Return a condition for each outermost state that is one of those wanted."""
    found = [one for one in chart.states.values() if is_one(one)]
    outer = [one for one in found if one.parent is None or chart.states[one.parent] not in found]
    return [f"in_state('{short_name(chart, one.name)}')" for one in outer]


def _failing(broken: Proven, text: str, file: Path, missions: Missions) -> Run | None:
    """Return the run of a scenario that shows the breach; None where it does not."""
    try:
        scenario = load_scenario_text(text, file, missions)
        run = scenario.run()
    except LupinError:
        return None
    if broken.name == NO_ZENO:
        return run if any(name == STANDSTILL for _, name, _ in run.violated) else None
    if broken.of_the_graph:
        return run if scenario.failures(run) else None
    return run if any(name == broken.name for _, name, _ in run.violated) else None
