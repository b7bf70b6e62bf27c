"""The warehouse's robot without ROS: checked, simulated and tried by scenarios, in its own words."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.warehouse.installed import HERE, install

#: Of another profile, which is installed as well.
FOREIGN = re.compile(r"\b(tags?|sensors?|OK|READY|BOOT|DONE|RETURNING)\b")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return where the package is installed."""
    folder = tmp_path_factory.mktemp("site")
    install(folder)
    return folder


def lupin(site: Path, *arguments: str, code: int = 0, folder: Path = HERE) -> str:
    """Run `lupin` beside the missions; return what it prints, which has no word of another profile."""
    done = subprocess.run(
        [sys.executable, "-m", "lupin_cli.main", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(site), "COLUMNS": "200", "NO_COLOR": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=120,
    )
    assert done.returncode == code, done.stdout
    assert FOREIGN.findall(done.stdout) == []
    return done.stdout


@pytest.mark.slow
def test_the_files_have_no_finding(site: Path) -> None:
    """The lifecycle names its profile; states, requests and outcomes are its own."""
    assert lupin(site, "check", "missions") == "1 mission, no errors, no warnings\n"


@pytest.mark.slow
def test_an_order_is_simulated(site: Path) -> None:
    """A line for each state, a row for each shelf, and one sentence."""
    story, table = lupin(site, "simulate", "fetch", "--shelves", "A1,B2").split("\n\n", 1)
    doing = [line.split()[2] for line in story.splitlines() if re.match(r" +\d+\.\d s  [A-Z]", line)]
    legs = ["FETCHING.DRIVING", "FETCHING.GRIPPING", "FETCHING.CHOOSING"]
    assert doing == ["WAKING", "IDLE", *legs, "FETCHING.GRIPPING", "FETCHING.CHOOSING", "PARKED"]
    rows = [line.split() for line in table.splitlines()]
    assert rows[1:3] == [["width", "force"], ["shelf", "status", "m", "N", "reason"]]
    assert ["A1", "PICKED", "0.12", "8"] in rows
    assert table.splitlines()[-1] == "PARKED: 2 picked of 2 targets in 19.0 s of virtual time"


def test_a_shelf_that_is_empty_counts(site: Path) -> None:
    """The exit code is that of a mission which missed some of its targets."""
    last = lupin(site, "simulate", "scenarios/fetch.scenario.yaml", code=1).splitlines()[-1]
    assert last.startswith("PARKED: 2 picked, 1 missing of 3 targets in 26.0 s of virtual time")


def test_an_empty_order_is_refused(site: Path) -> None:
    """As on the robot."""
    last = lupin(site, "simulate", "fetch", code=2).splitlines()[-1]
    assert last == "IDLE in 0.0 s of virtual time; the order names no shelf"


@pytest.mark.slow
def test_a_proof_names_the_states_of_this_lifecycle(site: Path, tmp_path: Path) -> None:
    """Its FAULT is never left, which is where it says so."""
    shutil.copytree(HERE / "missions", tmp_path / "missions")
    options = ("--no-restarts", "--targets", "1", "-j", "1")
    told = lupin(site, "prove", "fetch", *options, code=1, folder=tmp_path)
    assert "home_again: From every situation, IDLE or PARKED can be reached if servers answer." in told
    assert "home_again: no answer, request or deadline certainly leads to IDLE or PARKED\n" in told


@pytest.mark.slow
def test_the_counters_are_the_profiles(site: Path) -> None:
    """In the record, for programs."""
    record = json.loads(lupin(site, "simulate", "fetch", "--shelves", "A1,B2", "--json"))
    assert {name: record["view"][name] for name in ("total", "picked", "missing", "left")} == {
        "total": 2,
        "picked": 2,
        "missing": 0,
        "left": 0,
    }


def test_the_scenarios_hold(site: Path) -> None:
    """The outcomes in them are the profile's."""
    assert lupin(site, "test", "scenarios").splitlines()[-1] == "2 scenarios: all hold"


def test_an_option_of_another_profile_is_refused(site: Path) -> None:
    """Each mission takes the request that it declares."""
    done = subprocess.run(
        [sys.executable, "-m", "lupin_cli.main", "simulate", "fetch", "--tags", "1"],
        cwd=HERE,
        env={**os.environ, "PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert "FetchOrder has no use for --tags" in done.stderr


@pytest.mark.slow
def test_a_profile_that_cannot_be_used_is_told(tmp_path: Path) -> None:
    """Before the options are read, which are the profile's; exit code 1 would say that shelves were empty."""
    install(tmp_path)
    (tmp_path / "lupin_warehouse" / "profile.py").write_text("PROFILE = 1\n")
    told = lupin(tmp_path, "simulate", "fetch", "--shelves", "A1", code=2)
    assert "profile 'warehouse' (lupin_warehouse.profile:PROFILE of lupin-warehouse" in told
    assert told.endswith("names something of type int; it must name a Profile\n")
