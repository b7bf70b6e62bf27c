"""Small charts that are explored as a whole, and an explorer that keeps what it has seen."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lupin_engine.chart.model import Chart
from lupin_engine.machine.event import NOTHING
from lupin_engine.plugin.types import BOOL, TEXT, list_of
from lupin_engine.runtime.setup import make_world
from lupin_engine.verify.properties import BUILT_IN
from lupin_engine.verify.situations.explorer import Bounds, SituationExplorer
from lupin_engine.verify.situations.found import Effect, Explored
from lupin_engine.verify.situations.graph import OF_THE_GRAPH, Graph
from lupin_engine.verify.situations.levels import explore
from lupin_engine.verify.situations.memo import Rows
from lupin_engine.verify.situations.situation import Situation
from tests.machine.charts import PAUSE, chart

#: Drives, may be paused, goes on to a read, and begins again.
ROUND: dict[str, Any] = {
    "A": {
        "invoke": {"do": "nav.go", "timeout": 10.0},
        "on_done": "B",
        "on_error": "B",
        "on": {"operator.skip_current": "B"},
    },
    "B": {"label": "DONE", "on": {"operator.dock": "C"}},
    "C": {"invoke": {"do": "bridge.read", "timeout": 5.0}, "on_done": "A", "on_error": "A"},
    "FAULT": {},
}


#: Lets go of a pause and goes even while a stop is pressed.
ABORT = {"target": "B", "releases": ["pause"], "during": ["stop"]}


def round_trip() -> Chart:
    """Return the chart of `ROUND`, with a hold."""
    return chart(ROUND, holds={"pause": PAUSE}, codes={"paused": "paused"})


def wheels(regions: int, spokes: int) -> Chart:
    """Return a chart of some regions, each of which goes round by a request of its own."""
    names = ("operator.abort", "operator.dock", "operator.skip_current")
    inside = {
        f"R{r}": {"states": {f"S{n}": {"on": {names[r]: f"S{(n + 1) % spokes}"}} for n in range(spokes)}}
        for r in range(regions)
    }
    return chart({"P": {"kind": "parallel", "states": inside}})


def two_holds() -> Chart:
    """Return a chart that drives, with two holds that one request releases."""
    stop = {"engage": "input.stop", "release": ("operator.resume",), "code": "paused"}
    stop["release_guard"] = lambda env: not env["input"]["stop"]
    drive = {"invoke": "nav.go", "on_done": "A", "on_error": "B", "on": {"operator.abort": ABORT}}
    return chart(
        {"A": drive, "B": {"on": {"operator.reset": {"target": "A", "during": ["stop"]}}}, "FAULT": {}},
        inputs={"stop": {"type": BOOL, "initial": False}},
        holds={"pause": PAUSE, "stop": stop},
    )


def search() -> Chart:
    """Return a chart that drives about while it reads what is seen, and counts that when it stops."""
    seen = {"seen": {"type": list_of(TEXT), "initial": []}}
    reads = {"do": "bridge.read", "items": lambda env: env["input"]["seen"], "timeout": 5.0, "limit": 4}
    drives = {
        "GO": {"invoke": {"do": "nav.go", "timeout": 60.0}, "on_done": "GO", "on_error": "STAY"},
        "STAY": {"after": {1.0: "GO"}},
    }
    states = {
        "LOOK": {
            "kind": "parallel",
            "exit": [("set", {"found": lambda env: len(env["input"]["seen"])})],
            "on": {"operator.dock": "AGAIN", "operator.abort": "DONE"},
            "states": {"D": {"states": drives}, "R": {"for_each": reads}},
        },
        "AGAIN": {"on": {"operator.reset": [{"target": "LOOK", "guard": found}, {"target": "DONE"}]}},
        "DONE": {"on": {"operator.reset": "LOOK"}},
        "FAULT": {},
    }
    return chart(states, inputs=seen, context={"found": 0}, holds={"pause": PAUSE}, codes={"paused": "p"})


def found(env: Any) -> bool:
    """Say whether something was found."""
    return bool(env["context"]["found"] > 0)


class KeepingExplorer(SituationExplorer):
    """An explorer that keeps every situation."""

    def __init__(self, of: Chart, parameters: Mapping[str, Any] = NOTHING, **bounds: Any) -> None:
        self.situations: list[Situation] = []
        super().__init__(make_world(of, parameters), BUILT_IN, Bounds(**bounds))

    def initial(self) -> tuple[Situation, Effect]:
        """Begin with none."""
        self.situations.clear()
        return super().initial()

    def keep(self, rows: Rows) -> None:
        """Keep all situations."""
        self.situations += map(tuple, rows.T.tolist())


def explored(of: Chart, memo: bool = True, open_values: bool = True, **bounds: Any) -> Explored:
    """Return what is found in a chart."""
    return explore(KeepingExplorer(of, **bounds), memo=memo, open_values=open_values)


def broken(of: Chart, **bounds: Any) -> set[str]:
    """Return the names of the properties that are broken in a chart."""
    found = explored(of, **{"restarts": False, **bounds})
    assert found.complete
    graph = Graph(found)
    return {*found.breaches, *(one.name for one in OF_THE_GRAPH if one.broken(graph).any())}
