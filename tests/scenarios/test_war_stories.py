"""Each scenario of a war story fails on a design with the old flaw: here the flaws are put back, one at a time.

A flaw is an edit of a copy of the shipped missions, or a piece of the engine that is replaced by what the old
design did. A scenario that holds all the same would not have found the story.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
import yaml

from lupin_engine.chart.load import default_missions_folder
from lupin_engine.machine import operations
from lupin_engine.machine.operations import Operations
from lupin_engine.machine.timers import Timers
from lupin_engine.plugin.registry import Catalog
from lupin_engine.runtime.engine import EngineOutlet
from lupin_engine.sim import SUFFIX
from lupin_engine.sim.scenario import Missions, Scenario, load_scenario
from lupin_engine.sim.scripted import ScriptedDriver
from lupin_nav.approach import Tables
from tests import shipped

STORIES = Path(__file__).parent / "war_stories"
LIFECYCLE, INSPECTION, EXPLORATION = "lifecycle.yaml", "inspection.yaml", "exploration.yaml"
VISIT = "parts/visit_targets.yaml"


class Loader(yaml.SafeLoader):
    """YAML in which `on` is a word."""


Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if not (tag.endswith(":bool") and first in "oOyYnN")]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}


@dataclass(frozen=True)
class Edit:
    """In a file of the missions, what stands at a path of keys is replaced; None removes it."""

    file: str
    path: tuple[str | int, ...]
    value: Any

    def make(self, missions: Path) -> None:
        """Carry it out."""
        file = missions / self.file
        document = yaml.load(file.read_text(encoding="utf-8"), Loader)
        *parents, last = self.path
        found = document
        for key in parents:
            found = found[key]
        if self.value is None:
            del found[last]
        else:
            found[last] = self.value
        file.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")


Patch = Callable[[pytest.MonkeyPatch], None]


@dataclass(frozen=True)
class Flaw:
    """An old flaw, as far as it can be put back: in the missions, in the engine, or in what a plugin says."""

    edits: tuple[Edit, ...] = ()
    patch: Patch = lambda patch: None
    catalog: Callable[[Catalog], Catalog] = lambda catalog: catalog


def edit(file: str, *path: str | int, to: Any) -> Flaw:
    """Return the flaw that is one edit of the missions."""
    return Flaw((Edit(file, path, to),))


def refused(code: str, guard: str) -> list[Any]:
    """Return the answer that refuses a request in some states."""
    return [{"refuse": code, "guard": guard}]


def on(state: str, request: str, *first: Any) -> Flaw:
    """Return the flaw that a state of the lifecycle answers a request in another way before its own."""
    return Flaw((Edit(LIFECYCLE, (*_path(state), "on", request), list(first)),))


def _path(state: str) -> tuple[str, ...]:
    return tuple(key for name in state.split(".") for key in ("states", name))


# -- flaws of the engine ---------------------------------------------------------------------------------


def stale_answers_speak(patch: pytest.MonkeyPatch) -> None:
    """An answer is taken in whoever asked for it."""

    def report(self: Operations, kind: str, attempt: Any, turn: Any) -> None:
        self._end_current(kind, attempt, {"result": {}}, turn)

    patch.setattr(Operations, "_report_unwanted", report)


def cancels_are_waited_for(patch: pytest.MonkeyPatch) -> None:
    """A cancel has no deadline."""
    patch.setattr(operations, "CANCEL_DEADLINE", 1e9)


def timers_run_through_holds(patch: pytest.MonkeyPatch) -> None:
    """A hold does not stop the clocks of states."""
    patch.setattr(Timers, "freeze", lambda self, now: None)


def no_deadline_before_acceptance(patch: pytest.MonkeyPatch) -> None:
    """A request that nobody answers never times out."""
    start = Operations._start

    def begin(self: Operations, attempt: Any, turn: Any) -> None:
        start(self, attempt, turn)
        self._core.timers.disarm("timeout", attempt.id)

    patch.setattr(Operations, "_start", begin)


def servers_say_nothing(patch: pytest.MonkeyPatch) -> None:
    """What an operation waits for reaches nobody."""
    patch.setattr(EngineOutlet, "progress", lambda self, attempt, detail: None)


def cancels_are_stolen(patch: pytest.MonkeyPatch) -> None:
    """Another server answers the cancels."""

    def cancel(self: ScriptedDriver, attempt: str) -> None:
        self._stage.outlet.cancelled(attempt)

    patch.setattr(ScriptedDriver, "cancel", cancel)


def tables_are_air(patch: pytest.MonkeyPatch) -> None:
    """No goal lies in a table."""
    patch.setattr(Tables, "inside", lambda self, points: np.zeros(len(points), dtype=bool))


def nobody_owns_the_base(catalog: Catalog) -> Catalog:
    """The drive home does not say that it moves the base."""
    dock = replace(catalog.operations["nav.dock"], uses=())
    return replace(catalog, operations=MappingProxyType({**catalog.operations, "nav.dock": dock}))


# -- which flaw belongs to which scenario ------------------------------------------------------------------

DOCKED, HOME = "RETURNING.DOCKED", "RETURNING.DRIVING_HOME"
TO_DONE = [{"target": "DONE"}]

FLAWS: dict[str, Flaw] = {
    "01_abort_while_localizing": on("MISSION", "operator.abort", {"target": "FAULT", "during": "estop"}),
    "02_answer_after_abort": Flaw(patch=stale_answers_speak),
    "03_cancel_never_confirmed": Flaw(patch=cancels_are_waited_for),
    "04_resume_of_monitoring": on(DOCKED, "operator.resume", {"target": "MISSION"}),
    "05_dock_unreachable_on_low_battery": edit(LIFECYCLE, *_path(HOME), "on_error", to=TO_DONE),
    "06_pause_on_a_battery_return": edit(LIFECYCLE, *_path(HOME), "on", "operator.pause", to=None),
    "07_battery_low_while_localizing": edit(
        LIFECYCLE, *_path("MISSION"), "on", "input.battery.low", "guard", to="not in_state('PREPARE')"
    ),
    "08_dock_while_exploring": edit(
        LIFECYCLE, *_path("MISSION"), "on", "operator.dock", 0, "guard", to="not in_state('INSPECTING')"
    ),
    "09_abort_of_docked_monitoring": edit(
        EXPLORATION, *_path("MONITORING"), "itinerary", "on_abort", to=None
    ),
    "10_abort_twice": on(HOME, "operator.abort", {"refuse": "already_returning"}),
    "11_pause_while_dwelling": Flaw(patch=timers_run_through_holds),
    "12_drive_never_answered": Flaw(patch=no_deadline_before_acceptance),
    "13_drive_home_never_ends": edit(
        LIFECYCLE, *_path(HOME), "invoke", "timeout", "after", to="${ 100 * param.dock_timeout_s }"
    ),
    # The old timer sent the robot to its tag from wherever the mission was by then.
    "14_abort_while_folding": edit(LIFECYCLE, *_path(HOME), "after", to={"100 ms": "MISSION.history"}),
    "15_start_while_booting": on("BOOT", "mission.start", {"target": "MISSION"}),
    "16_one_sweep_nearest_first": edit(EXPLORATION, *_path("MONITORING"), "itinerary", "order", to=None),
    "16_sweeps_until_told_otherwise": edit(
        EXPLORATION, *_path("MONITORING"), "itinerary", "sweeps", to="${ 1 + 0 * param.monitoring_sweeps }"
    ),
    "17_notices_are_no_errors": edit(LIFECYCLE, "codes", "paused_by_operator", "severity", to="warn"),
    "18_goals_beside_walls": edit(
        EXPLORATION, *_path("EXPLORING.SEARCH.BLOCKED"), "after", to={"100 ms": "CHOOSING"}
    ),
    "19_goal_inside_the_next_table": Flaw(patch=tables_are_air),
    "20_charge_out_of_range": edit(LIFECYCLE, "inputs", "battery", "max", to=None),
    "21_home_is_the_start": edit(
        LIFECYCLE,
        *_path("READY"),
        "on",
        "mission.start",
        1,
        "do",
        0,
        "set",
        "home",
        to="${ param.dock_pose }",
    ),
    "22_search_finds_nothing": Flaw(patch=servers_say_nothing),
    "24_drifted_while_exploring": edit(EXPLORATION, *_path("MONITORING"), "with", "max_variance", to=0.25),
    "24_drifted_while_inspecting": edit(
        INSPECTION,
        *_path("INSPECTING"),
        "with",
        "max_variance",
        to="${ 1e6 + param.nav_localization_cov_threshold }",
    ),
    "25_climate_on_discovery": edit(EXPLORATION, *_path("EXPLORING.SEED_CLIMATE"), "for_each", "limit", to=1),
    "25_climate_switched_off": edit(
        EXPLORATION,
        *_path("EXPLORING.SEED_CLIMATE"),
        "for_each",
        "when",
        to="param.seed_climate_on_discovery or len(input.discovered) > 0",
    ),
    "26_pause_is_repeatable": Flaw(patch=cancels_are_stolen),
    "27_dock_while_publishing": edit(VISIT, "resume_at", to="NAVIGATING"),
    "65_pose_of_a_dead_publisher": edit(
        INSPECTION, *_path("PREPARE.LOCALIZING"), "on_error", to="INSPECTING"
    ),
    "66_out_of_fault": edit(LIFECYCLE, *_path("FAULT"), "on", "operator.reset", "target", to="READY"),
    "67_servers_come_up_late": edit(LIFECYCLE, *_path("FAULT.LATE"), "on_done", "target", to="FAILED"),
    "71_one_owner_of_the_base": Flaw(catalog=nobody_owns_the_base),
}


@cache
def fine(name: str) -> bool:
    """Say whether a scenario holds as things are."""
    scenario = load_scenario(STORIES / f"{name}{SUFFIX}", shipped.catalog())
    return not scenario.failures(scenario.run())


@pytest.fixture
def missions(tmp_path: Path) -> Iterator[Path]:
    """A copy of the missions, which the scenario beside it is about."""
    yield Path(shutil.copytree(default_missions_folder(), tmp_path / "missions"))


def with_flaw(name: str, flaw: Flaw, missions: Path) -> Scenario:
    """Return a scenario about missions with a flaw."""
    for one in flaw.edits:
        one.make(missions)
    catalog = flaw.catalog(shipped.catalog())
    file = shutil.copy(STORIES / f"{name}{SUFFIX}", missions.parent)
    return load_scenario(file, catalog, Missions(catalog))


def breaks(scenario: Scenario) -> list[str]:
    """Return what a scenario finds, an error of the engine included: the old loop died of one."""
    try:
        return [str(failure) for failure in scenario.failures(scenario.run())]
    except KeyError as error:
        return [f"the loop died: {error!r}"]


@pytest.mark.parametrize("name", FLAWS)
def test_the_old_flaw_is_found(name: str, missions: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The scenario holds; with the flaw put back it does not."""
    assert fine(name)
    FLAWS[name].patch(monkeypatch)
    assert breaks(with_flaw(name, FLAWS[name], missions))
