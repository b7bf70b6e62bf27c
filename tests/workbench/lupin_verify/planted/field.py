"""A field that the memory does not have, planted before anybody has seen the memory; then all who walk it.

python -m tests.workbench.lupin_verify.planted.field
"""

# ruff: noqa: E402
from __future__ import annotations

import operator
from dataclasses import dataclass, field
from typing import Any

import pytest

import lupin_engine.machine.memory as holder
from lupin_engine.machine.schema import FieldKind, Life, kept, states_with

MARKED = states_with("entry", "mark in state")


@dataclass(slots=True)
class PlantedMemory(holder.Memory):
    """When each state was marked, in this mission."""

    marks: dict[str, float] = field(
        default_factory=dict, metadata=kept(Life.USE, FieldKind.BY_KEY, MARKED, later=operator.add)
    )


holder.Memory = PlantedMemory  # type: ignore[misc]

from lupin_engine.chart import Chart
from lupin_engine.machine import ExecutableContent, World, successor
from lupin_engine.machine.snapshot import SnapshotError, restore, shift
from lupin_verify.situations.explorer import Bounds, SituationExplorer
from lupin_verify.situations.levels import explore
from tests.lupin_engine.machine.charts import Bench, chart

usual = ExecutableContent.carry_out


def marking(self: ExecutableContent, action: Any, state: str, *more: Any) -> None:
    """Mark a state with every other entry: what the planted word does."""
    marks: dict[str, float] = getattr(self._scope.memory, "marks")  # noqa: B009
    marks[state] = 1.0 - marks.get(state, 0.0)
    usual(self, action, state, *more)


def missions(*marked: str) -> Chart:
    """Return a chart with a mission, and the states that mark themselves when they are entered."""
    states: dict[str, Any] = {
        "READY": {"on": {"mission.start": "SLOT", "operator.skip_current": "C"}},
        "SLOT": {"slot": True, "states": {"M": {"mission": "M"}}, "on": {"operator.dock": "READY"}},
        "C": {"on": {"operator.dock": "READY"}},
    }
    for name in marked:
        states[name]["entry"] = "arm.nod"
    return chart(states, missions={"M": {"state": "SLOT.M"}})


def marks(bench: Bench) -> dict[str, float]:
    """Return the marks of a machine."""
    found: dict[str, float] = getattr(bench.machine.memory, "marks")  # noqa: B009
    return found


def marked() -> Bench:
    """Return a machine in `READY` with both states marked."""
    bench = Bench(missions("SLOT", "C"))
    bench.send("mission.start", mission_type="M")
    bench.send("operator.dock")
    bench.send("operator.skip_current")
    bench.send("operator.dock")
    assert marks(bench) == {"SLOT": 1.0, "C": 1.0}
    return bench


def main() -> None:
    """Look at everything that follows from how a field is kept."""
    setattr(ExecutableContent, "carry_out", marking)  # noqa: B010
    bench = marked()
    bench.restart()
    assert marks(bench) == {"SLOT": 1.0, "C": 1.0}, "a snapshot keeps it"
    shift(bench.machine.memory, 5.0)
    assert marks(bench) == {"SLOT": 6.0, "C": 6.0}, "another clock moves it"
    with pytest.raises(SnapshotError, match="there is no mark in state 'C'"):
        restore(missions("SLOT"), bench.machine.snapshot())
    bench.send("mission.start", mission_type="M")
    assert marks(bench) == {"SLOT": 1.0}, "a mission begins it anew"
    bench = marked()
    bench.machine = successor(bench.machine, World(missions("SLOT"), {}))
    assert marks(bench) == {"SLOT": 1.0}, "another chart takes over what it has, too"
    assert explored(missions("C")) > explored(missions()), "a proof tells it apart"


def explored(given: Chart) -> int:
    """Return how many situations a machine comes to."""
    explorer = SituationExplorer(World(given, {}), (), Bounds(restarts=False))
    return explore(explorer).progress.situations


if __name__ == "__main__":
    main()
