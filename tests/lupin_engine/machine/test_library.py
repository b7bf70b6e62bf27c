"""Changes of state are the work of `transitions`: with stand-ins for the package no mission runs."""

from __future__ import annotations

import subprocess
import sys

import pytest
from transitions.extensions.nesting import NestedEventData

from lupin_engine.machine.structure import ChartTransition
from tests.lupin_engine.machine.charts import Bench, chart

#: Whatever is imported of the package is a class that keeps what it is given, and whose methods do nothing.
STAND_INS = """
import sys, types

class StandIn:
    def __init__(self, name="", dest=None, *_, initial=None, **__):
        self.name = self.source = name
        self.dest, self.initial = dest, initial
        self.states, self.events, self.transitions = {}, {}, {}
    def add_transition(self, transition):
        self.transitions.setdefault(transition.source, []).append(transition)
    def __getattr__(self, _):
        return lambda *_, **__: self

StandIn.event_cls = StandIn
for name in ("transitions", "transitions.core", "transitions.extensions", "transitions.extensions.nesting"):
    sys.modules[name] = types.ModuleType(name)
    sys.modules[name].__getattr__ = lambda _: StandIn
"""
SIMULATE = """
import sys
from lupin_cli.main import main
sys.argv = ["lupin", "simulate", "inspection"]
sys.exit(main())
"""


def simulate(before: str = "") -> tuple[int, str]:
    """Simulate the shipped inspection in a process of its own; return its exit code and last line."""
    command = [sys.executable, "-c", before + SIMULATE]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=100)
    return done.returncode, (done.stdout.splitlines() or [done.stderr])[-1]


@pytest.mark.slow
def test_without_the_library_no_mission_runs() -> None:
    """Loading fills the stand-ins, but nobody enters a state."""
    code, last = simulate()
    assert (code, last[:5]) == (0, "DONE:")
    code, last = simulate(STAND_INS)
    assert (code, last[:11]) == (2, "not started")


def test_each_transition_is_executed_once_in_a_configuration(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the library did is remembered; a way through history by where it leads."""
    executed, execute = [], ChartTransition.execute

    def spy(transition: ChartTransition, event_data: NestedEventData) -> bool:
        executed.append(transition.rule.event)
        return execute(transition, event_data)

    monkeypatch.setattr(ChartTransition, "execute", spy)
    inner = {"A": {"on": {"next": "B"}}, "B": {"on": {"next": "A"}}, "H": {"kind": "history", "depth": 1}}
    bench = Bench(chart({"M": {"states": inner, "on": {"out": "Z"}}, "Z": {"on": {"back": "M.H"}}}))
    assert executed == ["start"]
    round_trip = ("out", "back", "next", "out", "back", "next")
    for event in round_trip:
        bench.send(event)
    assert executed == ["start", *round_trip]
    for event in round_trip * 3:
        assert bench.send(event).taken
    assert executed == ["start", *round_trip]
