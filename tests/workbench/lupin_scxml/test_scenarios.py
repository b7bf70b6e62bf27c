"""What the shipped missions do in every one of their scenarios, their SCXML does in an engine of others.

Our machine runs a scenario, and what it dealt with is kept: each event, and after each microstep what guards,
levels and holds say. Then the exported document runs in python-statemachine: it gets the same events and asks
for the same guards, whose data is ours. Which states are left, entered and remembered is its own work.
"""

from __future__ import annotations

import re
import shutil
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from statemachine.io import load

from lupin_engine.chart.model import Chart, Transition
from lupin_engine.chart.semantics import EXECUTION_ERROR
from lupin_engine.diagram.outline import outline
from lupin_engine.machine.event import NO_TRIGGER, Event, InternalEvent, Trigger
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.memory import Memory
from lupin_engine.machine.scope import World
from lupin_engine.machine.step import Macrostep, Step
from lupin_engine.machine.structure import Microstep
from lupin_engine.missions.folders import MISSIONS
from lupin_engine.sim import simulation
from lupin_engine.sim.scenario import Missions, load_scenario, scenario_files
from lupin_scxml.exporter import scxml
from tests import shipped

SCXML = "{http://www.w3.org/2005/07/scxml}"
SCENARIOS = Path(__file__).parents[2] / "scenarios"
FILES = scenario_files([SCENARIOS / name for name in ("inspection", "exploration", "war_stories")])
COOKBOOK = Path(__file__).parents[3] / "docs" / "cookbook"
#: An event that nobody listens to: what needs no event is looked at again.
NOTHING = "nothing.of.ours"


def said(source: str) -> str:
    """A guard as the document writes it, states aside."""
    return " ".join(source.split())


@dataclass
class Dealt:
    """An event, what conditions were after each microstep that it caused, and the states at the end."""

    event: str
    told: list[dict[str, bool]] = field(default_factory=lambda: [{}])
    configuration: tuple[str, ...] = ()


class Watched(Machine):
    """Our machine, which keeps what it deals with."""

    __slots__ = ("dealt",)
    dealt: list[Dealt]

    def _open(self, event: Event, now: float) -> Macrostep:
        step = super()._open(event, now)
        self.dealt.append(Dealt(NOTHING))
        self._tell_levels()
        return step

    def _finish(self) -> Step:
        step = super()._finish()
        self.dealt[-1].configuration = step.configuration
        return step

    def _deal(self, event: str) -> None:
        self.dealt[-1].configuration = self.memory.configuration
        self.dealt.append(Dealt(event))

    def _tell(self, rules: Iterable[Transition], trigger: Trigger) -> None:
        """Keep what the conditions of some transitions are now."""
        told, step, scope = self.dealt[-1].told[-1], self._step, self.scope
        told.update({f"held({name})": name in self.memory.held for name in self.chart.holds})
        scope.inputs.now = step.now
        for state in self.chart.states.values():
            rules = (*rules, *state.resume_at)
        for rule in rules:
            if rule.event.startswith("input."):
                told[rule.event] = scope.inputs.holds(rule.event)
            if rule.guard:
                try:
                    holds = bool(rule.guard.evaluate(scope.at(rule.source, step.now, trigger)))
                except Exception:  # unknown, or not in this state: false in both
                    holds = False
                told[said(rule.guard.source)] = holds

    def _tell_levels(self) -> None:
        self._tell([rule for some in self._active.levels.offered for rule in some], self._step.bound)

    def _levels_move(self) -> bool:
        self._tell_levels()
        return super()._levels_move()

    def _offer(self, internal: InternalEvent) -> None:
        event = self._event(internal)
        if event:
            self._deal(event)
        self._tell(
            [rule for some in self._selection.offered(internal, self._active) for rule in some],
            internal.trigger,
        )
        super()._offer(internal)

    def _event(self, internal: InternalEvent) -> str:
        """How the document calls an event; nothing for one that an engine makes itself."""
        name, state = internal.name, (internal.state or "").replace(".", "-")
        if name == EXECUTION_ERROR and self.dealt[-1].event.startswith("error.invoke"):
            return ""  # it has gone outwards already
        if not state:
            return name
        if name == "done" and self.chart.states[internal.state or ""].invoke is None:
            return ""
        return f"{name}.invoke.{state}-operation" if name in ("done", "error") else f"{name}.{state}"

    def _request(self, event: Event) -> None:
        trigger = Trigger(event=event.data)
        offered = self._active.candidates(event.name)
        before = self.dealt[-1]
        self._deal(event.name)
        self._tell([rule for some in offered for rule in some], trigger)
        super()._request(event)
        if not self._step.accepted:
            self.dealt[-1:] = []  # the caller is answered, the chart is not told
            assert self.dealt[-1] is before

    def _microstep(self, plan: Microstep, trigger: Trigger) -> None:
        super()._microstep(plan, trigger)
        if trigger is not NO_TRIGGER or plan.rules[0].id:
            self.dealt[-1].told.append({})
            self._tell_levels()


@cache
def missions() -> Missions:
    """The shipped missions, each loaded once."""
    return Missions(shipped.catalog())


class Other:
    """The document of a chart in the other engine."""

    def __init__(self, chart: Chart, dealt: Sequence[Dealt]) -> None:
        self._told = dealt[0].told
        self._taken = 0
        other, data = document(chart)
        # It gives them their first value once for all its machines.
        variables = {"state": None, **dict.fromkeys(data, "")}
        model = type("Model", (), variables)()
        model.holds, model.take, model.taken = self._holds, self._take, 0
        self._machine = other(model=model)

    def _holds(self, text: str) -> bool:
        return self._taken < len(self._told) and self._told[self._taken].get(text, False)

    def _take(self) -> int:
        self._taken += 1
        return self._taken

    def deal(self, dealt: Dealt) -> None:
        """Give it an event."""
        self._told, self._taken = dealt.told, 0
        self._machine.send(dealt.event)

    @property
    def configuration(self) -> set[str]:
        """Its active states."""
        return set(self._machine.configuration_values)


@cache
def document(chart: Chart) -> tuple[Any, Sequence[str]]:
    """The document with our conditions in it, without what needs data, servers or a clock; its variables."""
    ElementTree.register_namespace("", SCXML.strip("{}"))
    tree = ElementTree.fromstring(scxml(outline(chart, whole=True)).encode())
    conditions = sorted(_conditions(chart), key=len, reverse=True)
    for parent in tree.iter():
        for child in list(parent):
            name = child.tag.removeprefix(SCXML)
            ours = name == "assign" and not child.attrib["location"].startswith("left_")
            if ours or name in ("send", "cancel", "invoke", "log", "donedata"):
                parent.remove(child)
    for rule in tree.iter(f"{SCXML}transition"):
        if "cond" in rule.attrib:
            rule.set("cond", _asked(rule.attrib["cond"], conditions))
        if rule.get("event") or rule.get("cond"):
            rule.insert(0, ElementTree.Element(f"{SCXML}assign", location="taken", expr="take()"))
    data = tree.find(f"{SCXML}datamodel")
    assert data is not None
    tree.remove(data)
    variables = [element.attrib["id"] for element in data if element.attrib["id"].startswith("left_")]
    other = load(ElementTree.tostring(tree, encoding="unicode"), format="scxml", trusted=True)
    return other, variables


def _conditions(chart: Chart) -> set[str]:
    rules = [rule for state in chart.states.values() for rule in (*state.transitions, *state.resume_at)]
    levels = {rule.event for rule in rules if rule.event.startswith("input.")}
    guards = {said(rule.guard.source) for rule in rules if rule.guard}
    return guards | levels | {f"held({name})" for name in chart.holds}


def _asked(condition: str, known: Sequence[str]) -> str:
    """Let a condition ask us for what it says of our data."""
    condition = re.sub(r"In\('(?:[^']+-)?([^'-]+)'\)", r"in_state('\1')", condition)
    for index, text in enumerate(known):
        condition = condition.replace(text, f"<{index}>")
    return re.sub(r"<(\d+)>", lambda found: f"holds({known[int(found[1])]!r})", condition)


def ids(names: Iterable[str]) -> set[str]:
    """States, the root aside, as the document calls them."""
    return {name.replace(".", "-") for name in names if name}


@pytest.mark.slow
@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parent.name}-{file.stem.partition('.')[0]}")
def test_the_document_does_what_the_machine_does(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After every event it is in the same states."""
    compare(file, missions(), monkeypatch)


@pytest.mark.parametrize("name", ["evening", "evening_dock"])
def test_a_mission_that_is_used_as_a_part(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It begins with the state that uses it, and a history goes back into it."""
    shutil.copytree(COOKBOOK, tmp_path / MISSIONS)
    file = tmp_path / MISSIONS / f"{name}.scenario.yaml"
    compare(file, Missions(shipped.catalog()), monkeypatch)


def compare(file: Path, known: Missions, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let both engines do a scenario."""
    every: list[Dealt] = []

    def watched(world: World, memory: Memory | None = None) -> Watched:
        machine = Watched(world, memory)
        machine.dealt = every  # also of one that goes on after a crash
        return machine

    monkeypatch.setattr(simulation, "Machine", watched)
    scenario = load_scenario(file, shipped.catalog(), known)
    other = Other(scenario.run(0).chart, every)
    moved = 0
    for number, dealt in enumerate(every):
        if number:
            other.deal(dealt)
        moved += len(dealt.told) - 1
        assert other.configuration == ids(dealt.configuration), f"{number}: {dealt.event}"
    assert moved
