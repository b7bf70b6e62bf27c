"""Small charts, by hand and by chance, that are explored whole; and an explorer that keeps what it saw."""

from __future__ import annotations

import json
import random
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lupin_engine.chart.model import Chart
from lupin_engine.machine.event import NOTHING
from lupin_engine.missions.load import load_chart
from lupin_engine.plugin.types import BOOL, TEXT, list_of
from lupin_engine.properties.built_in import BUILT_IN
from lupin_engine.runtime.setup import make_world
from lupin_verify.situations.explorer import Bounds, SituationExplorer
from lupin_verify.situations.found import Effect, Explored
from lupin_verify.situations.graph import OF_THE_GRAPH, Graph
from lupin_verify.situations.levels import explore
from lupin_verify.situations.memo import Rows
from lupin_verify.situations.situation import Situation
from tests import shipped
from tests.lupin_engine.machine.charts import PAUSE, chart

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


# -- missions by chance ----------------------------------------------------------------------------------

#: A mission by chance stands in this lifecycle, and begins so.
LIFECYCLE = """\
lifecycle: Random
profile: greenhouse
inputs:
  estop: {value: robot.estop, initial: false}
  battery:
    {value: robot.battery, initial: 100 %, freshness: 6 s, levels: {low: {below: 20 %, hysteresis: 5 %}}}
codes: {paused: {label: paused}, stopped: {label: stopped}, slow: {label: slow}}
holds:
  pause: {engage: operator.pause, release: operator.resume, code: paused}
  estop: {engage: input.estop, release: operator.resume, release_guard: not input.estop, code: stopped}
initial: READY
states:
  READY: {on: {mission.start: MISSION}}
  MISSION:
    slot: mission
    history: shallow
    on_done: READY
    on: {operator.abort: {target: READY, releases: pause, during: pause}}
"""
HEAD = """\
mission: Chance
inputs:
  missing: {value: plugins.missing, initial: []}
context:
  n: {type: count, default: 0}
  m: {type: count, default: 0}
  way: {type: text, default: left}
  on: {type: bool, default: false}
  here: {type: pose, default: "${ param.dock_pose }"}
properties: {few: {never: n > 1 and on}, back: {eventually: n == 0, within: 8 s, after: n > 0}}
initial: A
"""
REQUESTS = ("operator.abort", "operator.dock", "operator.skip_current", "operator.reset")
CONDITIONS = (
    "n > 0",
    "n == 1",
    "m > 0 or way == 'right'",
    "way == 'left'",
    "not on",
    "input.estop",
    "input.battery.value > '30 %'",
    "input.battery.low",
    "len(input.missing) > 0",
    "in_state('B')",
)
ACTIONS: tuple[dict[str, Any], ...] = (
    {"n": 2},
    {"n": "${ 0 if n >= 2 else n + 1 }"},
    {"way": "right"},
    {"way": "${ 'left' if on else way }"},
    {"on": "${ not on }"},
    {"on": "${ on or input.estop }", "n": "${ m if m < 3 else 0 }"},
    {"m": "${ 1 if input.estop else n }"},
    {"m": "${ len(input.missing) }"},
)
RETRY = {"attempts": 2, "backoff": "3 s", "jitter": 0.5}
OPERATIONS: tuple[dict[str, Any], ...] = (
    {"do": "nav.dock", "with": {"pose": "${ here }"}},
    {"do": "nav.localize", "with": {"max_variance": 0.25}, "retry": RETRY},
    {"do": "bridge.read_tag", "with": {"tag_id": "1"}},
)


class _Chance:
    """One mission; a few conditions and actions, so that they have to do with each other."""

    def __init__(self, seed: int) -> None:
        self._dice = random.Random(seed)
        self._conditions = self._dice.sample(CONDITIONS, 2)
        self._actions = self._dice.sample(ACTIONS, 2)

    def states(self) -> dict[str, Any]:
        """Return A, which has states inside, and B, which perhaps has regions; each leads on at last."""
        inside = {f"A{n}": self._state(("A0", "A1", "B"), f"A{1 - n}") for n in range(2)}
        budget = {"after": "6 s", "target": "B", "code": "slow"}
        a = {"initial": "A0", "history": "shallow", "states": inside, "budget": budget}
        b = self._state(("A", "B"), "done")
        if self._dice.random() < 0.4:
            regions = {"P": self._region("P"), "Q": self._region("Q")}
            b = {"type": "parallel", "states": regions, "after": {"7 s": "done"}}
        return {"A": a, "B": b, "done": {"type": "final"}}

    def _region(self, name: str) -> dict[str, Any]:
        names = (f"{name}0", f"{name}1")
        inside = {one: self._state(names, other) for one, other in (names, names[::-1])}
        return {"initial": names[0], "states": inside}

    def _state(self, targets: Sequence[str], then: str) -> dict[str, Any]:
        dice, found = self._dice, dict[str, Any]()
        operation = {**dice.choice(OPERATIONS), "timeout": {"after": "5 s", "code": "slow"}}
        kind = dice.random()
        if kind < 0.3:
            ends = {"on_done": self._rules(targets), "on_error": self._rules(targets)}
            found.update({"invoke": operation, **ends})
        elif kind < 0.4:
            each = {"item": "one", "in": "${ input.missing }", "key": "${ one }", "limit": 2}
            found["for_each"] = {**each, "invoke": operation, "on_done": {"do": self._action()}}
        if dice.random() < 0.4:
            found["after"] = {"3 s": self._rules(targets)}
        if dice.random() < 0.2:
            found["always"] = [{"target": then, "guard": self._dice.choice(self._conditions)}]
        if dice.random() < 0.4:
            found[dice.choice(("entry", "exit"))] = [self._action()]
        first, second = dice.sample(REQUESTS, 2)
        return {**found, "on": {first: self._rules(targets), second: [{"target": then}]}}

    def _rules(self, targets: Sequence[str]) -> list[dict[str, Any]]:
        dice = self._dice
        guarded = {"target": dice.choice(targets), "guard": dice.choice(self._conditions)}
        last: dict[str, Any] = {"do": [self._action()]}
        if dice.random() < 0.6:
            last["target"] = dice.choice(targets)
        if dice.random() < 0.2:
            last["during"] = dice.choice(("pause", "estop"))
        return [guarded, last]

    def _action(self) -> dict[str, Any]:
        return {"set": self._dice.choice(self._actions)}


def random_mission(seed: int, folder: Path, declared: str = "") -> Chart:
    """Return the chart of a mission by chance, written into a folder; it may have `declared` more.

    Raises:
        ChartError: the checker refuses it.
    """
    lifecycle, mission = folder / "lifecycle.yaml", folder / "chance.yaml"
    lifecycle.write_text(LIFECYCLE, encoding="utf-8")
    states = json.dumps(_Chance(seed).states())  # JSON is YAML
    mission.write_text(f"{HEAD}{declared}states: {states}\n", encoding="utf-8")
    return load_chart(lifecycle, [mission], shipped.catalog())
