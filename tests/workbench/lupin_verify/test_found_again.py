"""What the first explorer found in missions and engine: each mending taken back, its defect is found again.

Charts, missions and engine are today's but for that mending. With it, nothing is broken.
"""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart.model import Chart, TemporalProperty
from lupin_engine.chart.strictness import STRICTER, as_of
from lupin_engine.machine.holds import Holds
from lupin_engine.machine.mission_start import MissionStart
from lupin_engine.machine.requests import Requests
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.missions.load import load_chart
from lupin_engine.plugin.types import BOOL
from lupin_engine.runtime.setup import make_world
from lupin_verify.proof import prove
from lupin_verify.situations.explorer import Bounds
from lupin_verify.situations.found import ExplorationProgress
from tests import shipped
from tests.lupin_engine.machine.charts import PAUSE, PLACE, chart, expression

#: A sweep in which no target could be driven to ends the walk: text of the part -> what stood there before.
LIVELOCK = {
    '            - set: {unreachable: "${ unreachable + 1 }"}\n': "",
    """\
        guard: itinerary.remaining > 0 and unreachable < itinerary.total   # a sweep of nothing else ends it
        do:
          - set: {unreachable: "${ unreachable if itinerary.closed < itinerary.total else 0 }"}
          - itinerary.advance
      - target: visited
        do:
          - set: {unreachable: 0}
""": """\
        guard: itinerary.remaining > 0
        do: itinerary.advance
      - target: visited
""",
    "context:\n  unreachable: {type: count, default: 0,"
    " summary: targets of this sweep that could not be driven to}\n": "",
}
#: FAULT tells what became of the targets that are left: the same, of the lifecycle.
UNTOLD = {"    entry:\n      - itinerary.close_rest: {status: SKIPPED, code: mission_failed}\n": ""}


def as_before(mission: str, file: str, mended: dict[str, str], folder: Path) -> Chart:
    """Return a shipped mission without what was mended in one of its files."""
    shutil.copytree(default_missions_folder(), folder, dirs_exist_ok=True)
    text = (folder / file).read_text(encoding="utf-8")
    for now, before in mended.items():
        assert text.count(now) == 1, f"{file} does not have it once any more:\n{now}"
        text = text.replace(now, before)
    (folder / file).write_text(text, encoding="utf-8")
    return load_chart(folder / "lifecycle.yaml", [folder / f"{mission}.yaml"], shipped.catalog())


def broken(of: Chart, most: int = 100_000) -> list[str]:
    """Return the names of what is broken among so many situations with one target."""

    def far(progress: ExplorationProgress) -> str:
        return "far enough" if progress.situations > most else ""

    proof = prove(make_world(of, {}), Bounds(targets=1, restarts=False), far)
    return [one.name for one in proof.broken]


@pytest.mark.proof
def test_monitoring_without_a_way_to_any_target(tmp_path: Path) -> None:
    """Each drive fails, and the next sweep begins: `test_prove.py` proves the mission as it is."""
    old = as_before("exploration", "parts/visit_targets.yaml", LIVELOCK, tmp_path)
    assert broken(old) == ["silence_is_told"]


@pytest.mark.slow
def test_targets_of_a_mission_that_fails(tmp_path: Path) -> None:
    """Nothing is told of them in FAULT: `test_prove.py` proves the mission as it is.

    Until the rule is an error, `all_closed` does not ask a lifecycle for it.
    """
    old = as_before("inspection", "lifecycle.yaml", UNTOLD, tmp_path)
    with as_of(STRICTER["silent-fault"].refused):
        assert broken(old, 300) == ["all_closed"]


@pytest.mark.slow
def test_targets_of_a_mission_that_ends_before_it_walks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Aborted while localizing, the engine knew nothing of them."""
    monkeypatch.setattr(MissionStart, "_register_targets", lambda *_: None)
    assert broken(shipped.mission("inspection"), 300) == ["all_closed"]


# -- of the engine ------------------------------------------------------------------------------------------

#: Drives until nobody needs that any more, which comes true in a hold as well.
LEFT_BY_ITSELF: dict[str, Any] = {
    "A": {
        "invoke": {"do": "nav.go", "timeout": 10.0},
        "always": {"target": "DONE", "guard": expression(lambda env: env["input"]["enough"], "input.enough")},
        "on_done": "DONE",
        "on_error": "DONE",
    },
    "DONE": {"on": {"operator.dock": "A"}},
    "FAULT": {},
}


def left_by_itself() -> Chart:
    """Return the chart of `LEFT_BY_ITSELF`."""
    inputs = {"enough": {"type": BOOL, "initial": False}}
    return chart(LEFT_BY_ITSELF, holds={"pause": PAUSE}, inputs=inputs)


RELEASE, BEGIN = Holds.release, MissionStart.begin


def _release_and_begin(self: Holds, name: str, step: Any) -> None:
    """Release a hold, and begin at once what it stopped, before the chart comes to rest."""
    RELEASE(self, name, step)
    operations: Any = getattr(self._suspend, "__self__", None)
    waiting = [one for one in operations._scope.memory.invocations.values() if not one.begun]
    for invocation in () if self._scope.memory.held else waiting:
        invocation.begun = True
        operations._issue(invocation, step)


def test_a_drive_that_is_begun_and_cancelled_in_one_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """A resume began it, and a transition of the same step left it."""
    assert broken(left_by_itself()) == []
    monkeypatch.setattr(Holds, "release", _release_and_begin)
    assert broken(left_by_itself()) == ["no_false_start"]


def _set(number: int) -> dict[str, Any]:
    return {"operator.dock": {"do": ("set", {"n": number})}}


#: A mission that breaks an invariant leads to FAULT; from there a person goes on as if nothing was.
GOES_WRONG: dict[str, Any] = {
    "READY": {"on": {"mission.start": "MISSION"}},
    "MISSION": {"slot": True, "states": {"M": {"mission": "M", "states": {"WORK": {"on": _set(7)}}}}},
    "FAULT": {"on": {"operator.reset": "READY", **_set(1)}},
}
#: What its author says of the mission.
STOPS = "nothing works where the invariant does not hold"


def goes_wrong() -> Chart:
    """Return the chart of `GOES_WRONG`, with the property of its author."""
    found = chart(
        GOES_WRONG,
        context={"n": 1},
        invariants={"n < 5": lambda env: env["context"]["n"] < 5},
        missions={"M": {"state": "MISSION.M"}},
    )
    never = expression(lambda env: env["in_state"](["MISSION"]) and env["context"]["n"] >= 5)
    return replace(found, properties={STOPS: TemporalProperty(STOPS, PLACE, never=never)})


def _begin_and_forget(self: MissionStart, *how: Any) -> None:
    """Begin a mission, and take what is broken for known."""
    memory = self._scope.memory
    broken_before = list(memory.broken)
    BEGIN(self, *how)
    memory.broken[:] = broken_before


def test_a_broken_invariant_that_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mission started beside it, and nothing told of it again."""
    assert STOPS not in broken(goes_wrong())
    monkeypatch.setattr(Requests, "_broken", lambda _: None)
    assert STOPS not in broken(goes_wrong())
    monkeypatch.setattr(MissionStart, "begin", _begin_and_forget)
    assert STOPS in broken(goes_wrong())
