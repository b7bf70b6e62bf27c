"""A search by frontiers, then sweeps over what was found: the words of the language at work, in virtual time.

The mission is the good chart `exploration`; its plugins are made up and its servers scripted.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart.load import LIFECYCLE, default_missions_folder, load_chart
from lupin_engine.chart.model import Chart
from lupin_engine.machine.event import Publish, Start
from lupin_engine.sim.scripted import Outcome, Rule
from lupin_engine.sim.simulation import Happening, Run, Script, Tell, simulate
from tests.chart.test_words import GOOD, wide_catalog

CATALOG = wide_catalog()
READING = {"reading": {"temperature": 21.0}}
FRONTIER = {"pose": {"x": 9.0, "y": 0.0, "yaw": 0.0}}


@pytest.fixture(scope="module")
def chart(tmp_path_factory: pytest.TempPathFactory) -> Chart:
    """The exploration in the shipped lifecycle, with the shipped part."""
    folder = tmp_path_factory.mktemp("missions")
    shutil.copytree(default_missions_folder(), folder, dirs_exist_ok=True)
    mission = shutil.copy(GOOD / "exploration" / "exploration.yaml", folder)
    return load_chart(folder / LIFECYCLE, [Path(mission)], CATALOG)


def tag(name: str, x: float) -> dict[str, Any]:
    """A tag as it is discovered."""
    return {"id": name, "x": x, "y": 0.0}


def seen(after: float, *tags: dict[str, Any]) -> Happening:
    """These tags are known from then on, `after` seconds into the search."""
    return Happening(Tell("tags.discovered", list(tags)), after, state="SEARCH")


def explore(chart: Chart, *happenings: Happening, reads: Outcome | None = None, **parameters: Any) -> Run:
    """Run a mission whose drives take 10 s, whose choices 1 s and whose readings `reads`."""
    rules = (
        Rule("nav.choose_frontier", (Outcome(after=1.0, result=FRONTIER),)),
        Rule("nav.go_to", (Outcome(after=10.0),)),
        Rule("bridge.read_tag", (reads or Outcome(after=1.0, result=READING),)),
    )
    script = Script("ExplorationMission", {"discovery_goal": 2}, rules, happenings, limit=3600.0)
    return simulate(chart, script, {"monitoring_sweeps": 1, **parameters})


def started(run: Run, operation: str) -> list[tuple[float, Any]]:
    """When an operation was started, and with what."""
    return [
        (step.time, command.arguments)
        for step in run.steps
        for command in step.commands
        if isinstance(command, Start) and command.operation == operation
    ]


def published(run: Run) -> list[tuple[float, str, str]]:
    """When which tag was published as what."""
    return [(time, found.target, found.status) for time, found in run.published]


def test_a_search_reaches_its_goal_and_what_was_found_is_visited(chart: Chart) -> None:
    """The nearest is visited first; the drive to the next frontier ends when there are tags enough."""
    run = explore(chart, seen(5.0, tag("7", 4.0)), seen(25.0, tag("7", 4.0), tag("3", 2.0)))
    assert run.lifecycles == (
        "BOOT",
        "READY",
        "PREPARE",
        "EXPLORING",
        "SEARCHED",
        "MONITORING",
        "RETURNING",
        "DONE",
    )
    assert [visit.target for visit in run.visits] == ["7", "3"], "without a pose the list's order counts"
    assert {visit.status for visit in run.visits} == {"OK"}
    assert len(started(run, "nav.choose_frontier")) == 3


def test_every_new_tag_is_read_once_while_the_search_goes_on(chart: Chart) -> None:
    """Reading a tag that was just seen neither waits for the drive nor interrupts it."""
    run = explore(chart, seen(5.0, tag("7", 4.0)), seen(25.0, tag("7", 4.0), tag("3", 2.0)))
    begun = next(step.time for step in run.steps if any(name.endswith(".SEARCH") for name in step.entered))
    first = [(time - begun, arguments["tag_id"]) for time, arguments in started(run, "bridge.read_tag")]
    assert first[0] == (5.0, "7")
    assert [name for _, name in first].count("7") == 2, "once when it was seen, once when it was visited"
    assert published(run)[0] == (begun + 6.0, "7", "OK")


def test_a_reading_that_hangs_holds_up_nothing(chart: Chart) -> None:
    """A bridge that never answers costs its own timeout, and the search its goal is reached all the same."""
    run = explore(
        chart,
        seen(5.0, tag("7", 4.0)),
        seen(25.0, tag("7", 4.0), tag("3", 2.0)),
        reads=Outcome(never=True),
    )
    assert run.ended
    assert [visit.status for visit in run.visits] == ["SCAN_FAILED", "SCAN_FAILED"]
    assert not any(isinstance(c, Publish) and c.status == "OK" for step in run.steps for c in step.commands)


def test_a_search_that_finds_nothing_comes_home(chart: Chart) -> None:
    """The budget ends the search, and its code is the mission's last word."""
    run = explore(chart, exploration_timeout_s=60.0)
    assert run.lifecycles == ("BOOT", "READY", "PREPARE", "EXPLORING", "SEARCHED", "RETURNING", "DONE")
    assert run.view.code == "exploration_timeout"


def test_sweeps_are_counted(chart: Chart) -> None:
    """Two sweeps over two tags are four visits, each published."""
    tags = (tag("7", 4.0), tag("3", 2.0))
    run = explore(chart, seen(5.0, *tags), monitoring_sweeps=2, seed_climate_on_discovery=False)
    assert [name for _, name, _ in published(run)] == ["7", "3", "7", "3"]
    assert (run.view.total, run.view.completed) == (2, 4)


def test_tags_of_the_last_mission_do_not_count(chart: Chart) -> None:
    """What was reported before this mission began is not discovered by it."""
    early = Happening(Tell("tags.discovered", [tag("1", 1.0), tag("2", 2.0)]), 0.0, state="BOOT")
    run = explore(chart, early, exploration_timeout_s=30.0)
    assert "MONITORING" not in run.lifecycles
