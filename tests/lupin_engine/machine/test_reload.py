"""Missions loaded anew: another chart goes on where an idle machine rests, and nothing is lost."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart.model import Chart
from lupin_engine.machine.event import Act, Event, Start, done, observed
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.reload import is_idle, successor
from lupin_engine.machine.snapshot import SnapshotError
from lupin_engine.missions.folders import default_missions_folder, mission_files
from lupin_engine.missions.load import load_chart
from lupin_engine.runtime.setup import make_machine, make_world
from tests import shipped

TUTORIAL = Path(__file__).parents[3] / "docs" / "tutorial"
Edit = tuple[str, str]
HOME = Act("arm.preset", {"name": "home"})


@pytest.fixture
def load(tmp_path: Path) -> Callable[..., Chart]:
    """Load a folder with the inspection; with `patrol` also the tutorial's mission; the lifecycle edited."""

    def loaded(*edits: Edit, patrol: bool = False, inspection: bool = True) -> Chart:
        folder = tmp_path / f"missions{len(list(tmp_path.iterdir()))}"
        shutil.copytree(default_missions_folder() / "parts", folder / "parts")
        shutil.copytree(TUTORIAL / "bindings", folder / "bindings")
        text = (default_missions_folder() / "lifecycle.yaml").read_text(encoding="utf-8")
        for old, new in edits:
            assert old in text
            text = text.replace(old, new)
        (folder / "lifecycle.yaml").write_text(text, encoding="utf-8")
        if inspection:
            shutil.copy(default_missions_folder() / "inspection.yaml", folder)
        if patrol:
            shutil.copy(TUTORIAL / "patrol.yaml", folder)
        return load_chart(folder / "lifecycle.yaml", mission_files(folder), shipped.catalog())

    return loaded


class Robot:
    """A machine, and the answers that it waits for."""

    def __init__(self, chart: Chart) -> None:
        self.now = 0.0
        self.machine: Machine = make_machine(chart, {})
        self.waiting: dict[str, str] = {}
        self._take(self.machine.start(0.0))

    def _take(self, step: Any) -> Any:
        for command in step.commands:
            if isinstance(command, Start):
                self.waiting[command.operation] = command.attempt
        return step

    def tell(self, event: Event) -> Any:
        """Let something happen, a second later."""
        self.now += 1.0
        return self._take(self.machine.handle(event, self.now))

    def value(self, name: str, value: Any) -> None:
        """Report a live value."""
        self.tell(observed(name, value, self.now + 1.0))

    def end(self, operation: str, **result: Any) -> None:
        """Let an operation end well."""
        self.tell(done(self.waiting.pop(operation), result))

    def ready(self) -> Robot:
        """Start up."""
        self.end("plugins.ready")
        assert self.machine.view.lifecycle == "READY"
        return self

    def go_on_with(self, chart: Chart) -> Machine:
        """Take another chart; return the machine of before."""
        before = self.machine
        self.now += 1.0
        self.machine = successor(before, make_world(chart, {}))
        self._take(self.machine.go_on(self.now))
        return before

    def start(self, mission: str) -> Any:
        """Ask for a mission, to the tag 1."""
        return self.tell(Event("mission.start", {"mission_type": mission, "tag_sequence": ["1"]}))


def test_a_mission_that_came_can_be_started(load: Callable[..., Chart]) -> None:
    """READY stays READY, without looking at anything again; the binding is among the plugins."""
    robot = Robot(load()).ready()
    assert robot.start("PatrolMission").refusal.code == "unknown_mission"
    robot.go_on_with(load(patrol=True))
    assert robot.machine.view.lifecycle == "READY"
    assert "photo_arm" in robot.machine.chart.plugins
    assert robot.start("PatrolMission").accepted


def test_what_counts_as_idle(load: Callable[..., Chart]) -> None:
    """Nothing is touched while a mission runs, drives home, or waits at the dock to be resumed."""
    robot = Robot(load())
    assert robot.machine.view.lifecycle == "BOOT"
    assert is_idle(robot.machine)  # it waits for servers, which others may not need
    robot.ready()
    assert is_idle(robot.machine)
    robot.start("InspectionMission")
    assert not is_idle(robot.machine)
    robot.end("nav.localize")
    robot.tell(Event("operator.dock"))
    assert not is_idle(robot.machine)
    robot.tell(Event("attempt.cancelled", {"attempt": robot.waiting["nav.go_to"]}))
    robot.end("nav.dock")
    assert robot.machine.view.configuration[-1] == "RETURNING.DOCKED"
    assert not is_idle(robot.machine)
    robot.tell(Event("operator.abort"))
    assert robot.machine.view.lifecycle == "DONE"
    assert is_idle(robot.machine)


def test_waiting_for_servers_goes_on(load: Callable[..., Chart]) -> None:
    """The answer that comes later is heard, and so is the deadline."""
    robot = Robot(load())
    due = robot.machine.next_deadline
    robot.go_on_with(load(patrol=True))
    assert robot.machine.next_deadline == due
    robot.ready()


def test_a_deadline_of_the_chart_goes_on_where_it_is_still_written(load: Callable[..., Chart]) -> None:
    """Counted from when the state was entered; what is not written any more never comes."""
    edit = ("  READY:\n", "  READY:\n    after: {1 h: FAULT}\n")
    robot = Robot(load(edit)).ready()
    due = next(due for due, _, kind, _ in robot.machine.memory.timers if kind == "after")
    for chart, expected in ((load(edit, patrol=True), [due]), (load(patrol=True), [])):
        robot.go_on_with(chart)
        timers = robot.machine.memory.timers
        assert [due for due, _, kind, _ in timers if kind == "after"] == expected


def test_an_emergency_stop_is_not_lost(load: Callable[..., Chart]) -> None:
    """It holds in the other chart, and only a person releases it."""
    robot = Robot(load()).ready()
    robot.value("robot.estop", True)
    robot.go_on_with(load(patrol=True))
    assert robot.machine.view.held == ("estop",)
    assert robot.start("PatrolMission").refusal.code == "estop_engaged"
    robot.value("robot.estop", False)
    assert robot.machine.view.held == ("estop",)
    assert robot.start("PatrolMission").accepted


def test_what_waits_for_the_release_waits_on_while_its_plugin_is_there(load: Callable[..., Chart]) -> None:
    """An action of a plugin that the other chart does not use is not carried out any more."""
    edit = ("  READY:\n", "  READY:\n    entry: {arm.preset: {name: home}}\n")
    for chart, expected in ((load(edit, patrol=True), [HOME]), (load(patrol=True, inspection=False), [])):
        robot = Robot(load(edit))
        robot.value("robot.estop", True)
        robot.ready()
        robot.go_on_with(chart)
        robot.value("robot.estop", False)
        released = robot.tell(Event("operator.resume"))
        assert [command for command in released.commands if isinstance(command, Act)] == expected


def test_battery_and_pose_are_not_lost(load: Callable[..., Chart]) -> None:
    """A battery that was low and has not risen far enough is low all the same."""
    robot = Robot(load()).ready()
    robot.value("robot.pose", {"x": 1.0, "y": 2.0, "yaw": 0.0})
    robot.value("robot.battery", 0.15)
    robot.value("robot.battery", 0.22)
    robot.go_on_with(load(patrol=True))
    assert robot.machine.input_value("battery", robot.now) == {"value": 0.22, "low": True}
    assert robot.machine.input_value("pose", robot.now) == {"x": 1.0, "y": 2.0, "yaw": 0.0}
    assert robot.start("PatrolMission").refusal.code == "battery_low"


def test_levels_are_those_of_the_new_chart(load: Callable[..., Chart]) -> None:
    """A threshold that was raised counts at once."""
    robot = Robot(load()).ready()
    robot.value("robot.battery", 0.3)
    robot.go_on_with(
        load(
            (
                "battery_low_threshold: {type: number, default: 20 %",
                "battery_low_threshold: {type: number, default: 40 %",
            )
        )
    )
    assert robot.machine.input_value("battery", robot.now) == {"value": 0.3, "low": True}


def test_what_the_last_mission_came_to_stays_on_display(load: Callable[..., Chart]) -> None:
    """Until its file is gone."""
    robot = Robot(load()).ready()
    robot.start("InspectionMission")
    robot.end("nav.localize")
    robot.tell(Event("operator.abort"))
    robot.tell(Event("attempt.cancelled", {"attempt": robot.waiting["nav.go_to"]}))
    robot.end("nav.dock")
    robot.go_on_with(load(patrol=True))
    view = robot.machine.view
    assert (view.lifecycle, view.mission, view.counts["SKIPPED"], view.code) == (
        "DONE",
        "InspectionMission",
        1,
        "mission_aborted",
    )
    robot.go_on_with(load(patrol=True, inspection=False))
    view = robot.machine.view
    assert (view.lifecycle, view.mission, view.total, view.code) == ("DONE", "", 0, "mission_aborted")


def test_a_variable_that_is_new_has_its_first_value(load: Callable[..., Chart]) -> None:
    """Those of before keep theirs."""
    robot = Robot(load()).ready()
    robot.machine.memory.context["reason"] = "kept"
    new = ("\ncontext:\n", "\ncontext:\n  mood: {type: text, default: good}\n")
    robot.go_on_with(load(new, patrol=True))
    assert robot.machine.memory.context["mood"] == "good"
    assert robot.machine.memory.context["reason"] == "kept"


def test_a_chart_without_the_hold_that_is_engaged_is_refused(load: Callable[..., Chart]) -> None:
    """A stop that nothing could release, or that was forgotten, would be worse than old missions."""
    robot = Robot(load()).ready()
    robot.value("robot.estop", True)
    renamed = (
        ("  estop:      ", "  stop:       "),
        ("during: estop", "during: stop"),
        ("pause, estop]", "pause, stop]"),
        ("held(estop)", "held(stop)"),
        ("'estop' in", "'stop' in"),
    )
    other = load(*renamed, patrol=True, inspection=False)
    with pytest.raises(SnapshotError, match="there is no hold 'estop'"):
        successor(robot.machine, make_world(other, {}))
    assert robot.machine.view.held == ("estop",)
