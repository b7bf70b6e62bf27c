"""Each scenario of a war story fails on a design with the old flaw: here the flaws are put back, one by one.

A flaw is an edit of a copy of the shipped missions, or a piece of the engine that is replaced by what the old
design did. A scenario that holds all the same would not have found the story.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
import yaml

from lupin_engine.machine import operations
from lupin_engine.machine.event import Start
from lupin_engine.machine.inputs import Inputs
from lupin_engine.machine.itineraries import Itineraries
from lupin_engine.machine.memory import Phase, Visit
from lupin_engine.machine.operations import Operations
from lupin_engine.machine.timers import Timers
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.plugin.contract import OnHold
from lupin_engine.plugin.profile import Publish
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import NUMBER
from lupin_engine.runtime.engine import EngineOutlet
from lupin_engine.sim import SUFFIX
from lupin_engine.sim.scenario import Missions, Scenario, load_scenario
from lupin_engine.sim.scripted import ScriptedDriver
from lupin_nav.approach import Tables, approach
from tests import shipped

STORIES = Path(__file__).parent / "war_stories"
LIFECYCLE, INSPECTION, EXPLORATION = "lifecycle.yaml", "inspection.yaml", "exploration.yaml"
VISIT = "parts/visit_targets.yaml"
#: A design with a flaw may go round in circles; this is enough to see it, in seconds of virtual time.
LIMIT = 7200.0


class Loader(yaml.CSafeLoader):
    """YAML in which `on` is a word."""


Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if not (tag.endswith(":bool") and first in "oOyYnN")]
    for first, resolvers in yaml.CSafeLoader.yaml_implicit_resolvers.items()
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
        file.write_text(yaml.dump(document, Dumper=yaml.CSafeDumper, sort_keys=False), encoding="utf-8")


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

    def report(self: Operations, kind: str, attempt: Any, data: Any, step: Any) -> None:
        self._end_current(kind, attempt, {"result": {}}, step)

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

    def begin(self: Operations, attempt: Any, step: Any) -> None:
        start(self, attempt, step)
        self._scope.timers.disarm("timeout", attempt.id)

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
    patch.setattr("lupin_nav.approach.approach", approach.__wrapped__)  # nothing of it may be remembered


def late_accepts_are_kept(patch: pytest.MonkeyPatch) -> None:
    """A goal that is accepted after its cancel is driven to."""
    report = Operations._report_unwanted

    def keep(self: Operations, kind: str, attempt: Any, data: Any, step: Any) -> None:
        before = len(step.commands)
        report(self, kind, attempt, data, step)
        del step.commands[before:]

    patch.setattr(Operations, "_report_unwanted", keep)


def confirmed_cancels_free_nothing(patch: pytest.MonkeyPatch) -> None:
    """Only the watchdog lets the next drive begin."""
    report = Operations._report_unwanted

    def wait(self: Operations, kind: str, attempt: Any, data: Any, step: Any) -> None:
        if kind != "cancelled":
            report(self, kind, attempt, data, step)

    patch.setattr(Operations, "_report_unwanted", wait)


def results_are_answered_by_a_new_goal(patch: pytest.MonkeyPatch) -> None:
    """A goal that nobody wants any more is sent again when it fails."""
    report = Operations._report_unwanted

    def send_again(self: Operations, kind: str, attempt: Any, data: Any, step: Any) -> None:
        if kind == "failed":
            step.commands.append(Start(attempt.id, attempt.operation, attempt.arguments))
        else:
            report(self, kind, attempt, data, step)

    patch.setattr(Operations, "_report_unwanted", send_again)


def answers_go_to_whoever_waits(patch: pytest.MonkeyPatch) -> None:
    """A late answer is booked on what is asked just then."""
    report = Operations._report_unwanted

    def book(self: Operations, kind: str, attempt: Any, data: Any, step: Any) -> None:
        asked = [found for found in self._scope.memory.attempts.values() if found.phase is Phase.ACCEPTED]
        if kind == "done" and asked:
            self._end_current(kind, asked[0], {"result": {}}, step)
        else:
            report(self, kind, attempt, data, step)

    patch.setattr(Operations, "_report_unwanted", book)


def holds_keep_no_answer(patch: pytest.MonkeyPatch) -> None:
    """Answers are processed while stopped."""
    patch.setattr(Operations, "_may_pass", lambda self, attempt, kind: True)


def failures_name_no_target(patch: pytest.MonkeyPatch) -> None:
    """Only a reading is published with the id of its tag."""

    def publish(self: Itineraries, visit: Visit, step: Any, source: str = "") -> None:
        target = visit.target if visit.status == "OK" else ""
        told = (target, visit.status, visit.code, visit.detail, visit.reading)
        step.commands.append(Publish(source, self._scope.memory.mission_id, *told))

    patch.setattr(Itineraries, "publish", publish)


def old_finds_count_again(patch: pytest.MonkeyPatch) -> None:
    """Whatever is reported in a mission is of that mission."""
    patch.setattr(Inputs, "_new_items", lambda self, spec, value: value)


def aborted_is_called_canceled(patch: pytest.MonkeyPatch) -> None:
    """Two ends of a goal have one code."""
    failed = EngineOutlet.failed

    def confuse(self: EngineOutlet, attempt: str, code: str, detail: str = "") -> None:
        failed(self, attempt, code.replace("nav_status_6", "nav_status_5"), detail)

    patch.setattr(EngineOutlet, "failed", confuse)


def the_dock_goal_is_sent_while_stopped(catalog: Catalog) -> Catalog:
    """A hold does not keep the drive home."""
    dock = replace(catalog.operations["nav.dock"], on_hold=OnHold.FINISH)
    return replace(catalog, operations=MappingProxyType({**catalog.operations, "nav.dock": dock}))


def any_number_is_a_charge(catalog: Catalog) -> Catalog:
    """Nobody says between which numbers a charge lies."""
    battery = replace(catalog.values["robot.battery"], type=NUMBER)
    return replace(catalog, values=MappingProxyType({**catalog.values, "robot.battery": battery}))


def nobody_owns_the_base(catalog: Catalog) -> Catalog:
    """The drive home does not say that it moves the base."""
    dock = replace(catalog.operations["nav.dock"], uses=())
    return replace(catalog, operations=MappingProxyType({**catalog.operations, "nav.dock": dock}))


# -- which flaw belongs to which scenario ------------------------------------------------------------------

DOCKED, HOME = "RETURNING.DOCKED", "RETURNING.DRIVING_HOME"
TO_DONE = [{"target": "DONE"}]
BACK_ONCE = {"target": "MISSION.history", "guard": "reason == 'abort'", "do": {"set": {"reason": "done"}}}

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
    # The old timer led back into the mission from wherever it was by then.
    "14_abort_while_folding": edit(
        LIFECYCLE,
        *_path(HOME),
        "after",
        to={"100 ms": BACK_ONCE},
    ),
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
    "20_charge_out_of_range": Flaw(catalog=any_number_is_a_charge),
    "21_home_is_the_start": edit(
        LIFECYCLE, *_path("READY"), "on", "mission.start", -1, "do", "set", "home", to="${ param.dock_pose }"
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


# -- the same for what was found by reading ---------------------------------------------------------------


def stays_paused(*divert: str | int) -> Flaw:
    """Return the flaw that a divert of the lifecycle leaves the pause engaged."""
    path = (*_path("MISSION"), "on", *divert)
    return Flaw((Edit(LIFECYCLE, (*path, "releases"), None), Edit(LIFECYCLE, (*path, "during"), STOPS)))


def patient(state: str) -> Flaw:
    """Return the flaw that a search goes on without frontiers."""
    path = (*_path(state), "invoke", "timeout", "after")
    return edit(EXPLORATION, *path, to="${ 100 * param.frontier_timeout_s }")


STOPS = ["pause", "estop"]
CHOOSING = "EXPLORING.SEARCH.CHOOSING"
FAILED_DOCK: tuple[str | int, ...] = (*_path(HOME), "on_error", 0, "guard")
#: A hold that a low battery engages wherever the robot is.
LOW_PAUSES = {
    "engage": "input.battery.low",
    "release": ["operator.resume"],
    "release_guard": "not input.battery.low",
    "code": "battery_low",
}

FLAWS |= {
    # The flag that asked for the return was not cleared on the way.
    "A01_resume_after_dock": Flaw(
        (
            Edit(LIFECYCLE, (*_path(DOCKED), "on", "operator.resume"), [{"target": "MISSION.history"}]),
            Edit(VISIT, (*_path("PUBLISHING"), "always", 0, "guard"), "reason == 'done'"),
        )
    ),
    "A02_exploration_times_out_mid_leg": Flaw(patch=confirmed_cancels_free_nothing),
    "A02_skip_last_while_driving": Flaw(patch=confirmed_cancels_free_nothing),
    "A03_divert_while_exploring": Flaw(patch=confirmed_cancels_free_nothing),
    "A04_accepted_after_estop": Flaw(patch=late_accepts_are_kept),
    "A04_accepted_after_pause": Flaw(patch=late_accepts_are_kept),
    "A05_server_keeps_cancelling": edit(
        LIFECYCLE, *_path(HOME), "invoke", "retry", "attempts", to="${ 50 + param.dock_retry_max }"
    ),
    "A05_stopped_on_the_way_home": Flaw(catalog=the_dock_goal_is_sent_while_stopped),
    "A06_start_while_stopped": edit(LIFECYCLE, "holds", "estop", "release_guard", to=None),
    "A07_battery_low_while_paused": stays_paused("input.battery.low"),
    "A07_dock_while_paused": stays_paused("operator.dock", 1),
    "A08_estop_on_the_way_to_the_dock": on(HOME, "operator.resume", {"target": "MISSION.history"}),
    "A09_exploration_clock_goes_on": on(DOCKED, "operator.resume", {"target": "MISSION"}),
    "A09_sweep_goes_on": on(DOCKED, "operator.resume", {"target": "MISSION"}),
    "A10_reset_with_an_empty_battery": on("READY", "mission.start", {"target": "MISSION"}),
    "A11_reset_looks_again": edit(LIFECYCLE, *_path("FAULT"), "on", "operator.reset", "target", to="READY"),
    "A12_pause_stops_the_clock_of_exploring": Flaw(patch=timers_run_through_holds),
    "A12_pause_stops_the_clocks": Flaw(patch=timers_run_through_holds),
    # Closing the visit again, as the old skip did, is refused when the chart is loaded.
    "A13_skip_while_dwelling": edit(
        VISIT,
        *_path("SCANNING.DWELLING"),
        "on",
        "operator.skip_current",
        to={"target": "PUBLISHING", "during": "pause"},
    ),
    "A14_late_answer": Flaw(patch=answers_go_to_whoever_waits),
    "A15_dock_goal_refused": edit(LIFECYCLE, *_path(HOME), "on_error", to=TO_DONE),
    "A16_every_outcome_names_its_tag": Flaw(patch=failures_name_no_target),
    "A17_second_exploration": Flaw(patch=old_finds_count_again),
    "A18_flickering_battery": edit(
        LIFECYCLE, "inputs", "battery", "levels", "low", "hysteresis", to="${ 0 * param.battery_hysteresis }"
    ),
    "A19_dead_localizer": edit(INSPECTION, *_path("PREPARE.LOCALIZING"), "on_error", to="INSPECTING"),
    "A20_low_battery_at_rest": edit(LIFECYCLE, "holds", "low", to=LOW_PAUSES),
    "A21_nothing_left_to_explore": patient(CHOOSING),
    "A21_what_was_found_is_watched": patient(CHOOSING),
    "A22_send_fails": edit(EXPLORATION, *_path("EXPLORING.SEARCH.BLOCKED"), "after", to={"60 s": "CHOOSING"}),
    "A23_rejecting_server": edit(VISIT, *_path("NAVIGATING.DRIVING"), "invoke", "retry", "backoff", to="0 s"),
    "A24_skip_where_it_means_nothing": edit(
        VISIT,
        *_path("PUBLISHING"),
        "on",
        "operator.skip_current",
        to={"target": "PUBLISHING", "during": "pause"},
    ),
    "A34_result_after_the_end": Flaw(patch=results_are_answered_by_a_new_goal),
    "A35_divert_and_result_at_once": edit(
        LIFECYCLE, *_path("MISSION"), "on", "input.battery.low", "guard", to="not in_state('SCANNING')"
    ),
    "A36_abort_while_paused": stays_paused("operator.abort"),
    "A38_battery_recovers_on_the_way": edit(LIFECYCLE, *FAILED_DOCK, to="input.battery.low"),
    "A39_manual_dock_fails": edit(LIFECYCLE, *FAILED_DOCK, to="reason == 'battery'"),
    "A40_status_by_name": Flaw(patch=aborted_is_called_canceled),
    "A41_snapshot_older_than_the_mission": edit(EXPLORATION, "inputs", "discovered", "since", to=None),
    "A42_answers_wait": Flaw(patch=holds_keep_no_answer),
}


def test_every_scenario_has_its_flaw() -> None:
    """One without has not been seen to fail."""
    assert sorted(FLAWS) == sorted(file.name.removesuffix(SUFFIX) for file in STORIES.glob(f"*{SUFFIX}"))


@pytest.fixture
def missions(tmp_path: Path) -> Path:
    """A copy of the missions, which the scenario beside it is about."""
    return Path(shutil.copytree(default_missions_folder(), tmp_path / "missions"))


def with_flaw(name: str, flaw: Flaw, missions: Path) -> Scenario:
    """Return a scenario about missions with a flaw."""
    for one in flaw.edits:
        one.make(missions)
    catalog = flaw.catalog(shipped.catalog())
    file = shutil.copy(STORIES / f"{name}{SUFFIX}", missions.parent)
    scenario = load_scenario(file, catalog, Missions(catalog))
    return replace(scenario, script=replace(scenario.script, limit=min(scenario.script.limit, LIMIT)))


def breaks(scenario: Scenario) -> list[str]:
    """Return what a scenario finds, an error of the engine included: the old loop died of one."""
    try:
        return [str(failure) for failure in scenario.failures(scenario.run())]
    except KeyError as error:
        return [f"the loop died: {error!r}"]


@pytest.mark.slow
@pytest.mark.parametrize("name", FLAWS)
def test_the_old_flaw_is_found(name: str, missions: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The scenario holds, which pytest runs as a test of its own; with the flaw put back it does not."""
    FLAWS[name].patch(monkeypatch)
    assert breaks(with_flaw(name, FLAWS[name], missions))
