"""`lupin new --profile`: a kind of robot that can be checked, tried and run at once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from lupin_cli.main import main

#: The files, in the order in which they are written.
WRITTEN = """\
wrote lupin-courier/pyproject.toml
wrote lupin-courier/lupin_courier/__init__.py
wrote lupin-courier/lupin_courier/profile.py
wrote lupin-courier/lupin_courier/messages.py
wrote missions/lifecycle.yaml
wrote missions/rounds.yaml
wrote scenarios/rounds.scenario.yaml
next: pip install --editable lupin-courier; lupin check; lupin test; lupin run rounds
"""
#: An example of a name, and what was meant.
NEAREST = (("water_beds", "rounds"), ("courier", "courier"))
_SETUP = ("-W", "ignore", "-c", "from setuptools import setup; setup()", "--quiet")


def install(package: Path, site: Path) -> None:
    """Build a package into a folder, as an installer does; nothing is downloaded."""
    pytest.importorskip("setuptools", reason="the package is built with it")
    site.mkdir()
    subprocess.run(
        [sys.executable, *_SETUP, "egg_info", "--egg-base", str(site), "build_py", "--build-lib", str(site)],
        cwd=package,
        check=True,
        capture_output=True,
    )


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Stand in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_what_it_writes_is_right(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Once the package is installed: no finding, the scenario holds, and every property is proven."""
    assert main(["new", "rounds", "--profile", "courier"]) == 0
    assert capsys.readouterr().out == WRITTEN
    install(folder / "lupin-courier", folder / "site")

    def lupin(*arguments: str) -> str:
        done = subprocess.run(
            [sys.executable, "-m", "lupin_cli.main", *arguments],
            env={**os.environ, "PYTHONPATH": str(folder / "site"), "COLUMNS": "200", "NO_COLOR": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=120,
        )
        assert done.returncode == 0, done.stdout
        return done.stdout

    assert lupin("check", "--strict") == "1 mission, no errors, no warnings\n"
    assert lupin("test").endswith("1 scenario: all hold\n")
    assert "ENDED: 2 visited of 2 targets in 4.0 s" in lupin("simulate", "rounds", "--places", "x,y")
    assert lupin("prove", "rounds", "--no-restarts", "--quiet").startswith("Rounds: proven")


def test_all_that_is_wrong_is_told_at_once(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The names, and every file that exists; nothing is written then."""
    (folder / "missions").mkdir()
    (folder / "missions" / "lifecycle.yaml").write_text("mine")
    assert main(["new", "Rounds", "--profile", "greenhouse"]) == 2
    assert main(["new", "rounds", "--profile", "Courier"]) == 2
    assert main(["new", "rounds", "--profile", "nav"]) == 2
    assert main(["new", "rounds", "--profile", "courier", "--like", "inspection"]) == 2
    exists = "'missions/lifecycle.yaml' exists; begin in another folder\n"
    wanted = "at most 60 lower-case letters, digits and underscores, such as"
    rounds, courier = (f"{name}; did you mean '{meant}'?" for name, meant in NEAREST)
    assert capsys.readouterr().err == (
        f"lupin: 'Rounds' cannot be the name of a mission's file: write {wanted} {rounds}\n"
        f"there is a profile 'greenhouse' already, from lupin-engine 0.1.0; choose another name\n{exists}"
        f"lupin: 'Courier' cannot be the name of a profile: write {wanted} {courier}\n{exists}"
        f"lupin: there is a package lupin_nav already; choose another name for the profile\n{exists}"
        "lupin: --profile excludes --like and --copy: it comes with a lifecycle of its own\n"
    )
    assert [file.name for file in folder.rglob("*")] == ["missions", "lifecycle.yaml"]
