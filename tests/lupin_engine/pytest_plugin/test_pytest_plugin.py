"""pytest runs scenarios: collected by name, told as `lupin test` does; nothing is loaded without any."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest

from lupin_engine import pytest_plugin

pytestmark = pytest.mark.slow

HEAD = 'scenario: a promise\nmission: inspection\nrequest: {tag_sequence: ["1"]}\n'
HOLDS = HEAD + "expect: {final: DONE}\n"
FAILS = HEAD + "expect: {final: FAULT}\n"
CHANCE = (
    HEAD + "parameters: {nav_max_attempts: 1}\n"
    "mocks: [{do: nav.go_to, then: {any_of: [done, {fail: nav_rejected}]}}]\nexpect: {visits: [1 OK]}\n"
)


def ran(folder: Path, *arguments: str, **files: str) -> subprocess.CompletedProcess[str]:
    """Run pytest in a folder with these scenarios."""
    for name, text in files.items():
        (folder / f"{name}.scenario.yaml").write_text(text, encoding="utf-8")
    (folder / "pytest.ini").write_text("[pytest]\n", encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=100)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a scenario that holds, one that fails, one that is mistaken, and a mission."""
    found = tmp_path_factory.mktemp("scenarios")
    (found / "mission.yaml").write_text("mission: X\n", encoding="utf-8")
    return found


@pytest.fixture(scope="module")
def done(folder: Path) -> subprocess.CompletedProcess[str]:
    """Return what pytest says of that folder."""
    return ran(folder, "-v", "--junit-xml", "junit.xml", good=HOLDS, bad=FAILS, broken=HEAD)


def test_scenarios_are_tests(folder: Path, done: subprocess.CompletedProcess[str]) -> None:
    """Each is one, with its file and name as its id; other YAML files are left alone."""
    lines = done.stdout.splitlines()
    assert done.returncode == 1, done.stdout
    assert any(line.startswith("good.scenario.yaml::good PASSED") for line in lines)
    assert any(line.startswith("bad.scenario.yaml::bad FAILED") for line in lines)
    assert "1 passed" in lines[-1]
    assert "2 failed" in lines[-1]
    root = ElementTree.parse(folder / "junit.xml").getroot()
    assert {case.get("name") for case in root.iter("testcase")} == {"good", "bad", "broken"}


def test_a_failure_is_the_report_and_no_traceback(done: subprocess.CompletedProcess[str]) -> None:
    """Expected against actual, the lines of both files, the story."""
    assert "final\n    expected: FAULT\n    actual:   DONE\n" in done.stdout
    assert "      4 | expect: {final: FAULT}\n        |                 ^\n" in done.stdout
    assert "nav.dock done   -> DONE" in done.stdout
    assert "error: the key 'expect' is missing; write 'expect: ...'" in done.stdout
    assert "Traceback" not in done.stdout
    assert "pytest_plugin.py" not in done.stdout


def test_seeds_and_coverage_are_options(tmp_path: Path) -> None:
    """The seed that fails is named as it is typed; what was not reached is told at the end."""
    done = ran(tmp_path, "--lupin-seeds", "50", "--lupin-coverage", "-q", chance=CHANCE)
    assert "with --lupin-seed " in done.stdout
    assert "inspection: states that were not reached" in done.stdout
    seed = done.stdout.partition("with --lupin-seed ")[2].partition(":")[0]
    again = ran(tmp_path, "--lupin-seed", seed)
    assert f"with --lupin-seed {seed}:" in again.stdout
    assert "states that were not reached" not in again.stdout


def test_without_a_scenario_nothing_is_loaded(tmp_path: Path) -> None:
    """Other people's test runs pay nothing for an engine that is installed."""
    heavy = "('yaml', 'pydantic', 'transitions', 'numpy', 'lupin_engine.sim.suite', 'lupin_engine.chart')"
    test = (
        f"import sys\n\ndef test_light():\n    assert not [name for name in {heavy} if name in sys.modules]\n"
    )
    (tmp_path / "test_light.py").write_text(test, encoding="utf-8")
    done = ran(tmp_path)
    assert done.returncode == 0, done.stdout
    assert "1 passed" in done.stdout


def test_a_defect_is_told_as_one(tmp_path: Path) -> None:
    """What is no failure of a scenario keeps its traceback."""
    (tmp_path / "conftest.py").write_text(
        "from lupin_engine.sim.suite import Suite\n\ndef broken(*_):\n    raise RuntimeError('a defect')\n\n"
        "Suite.run = broken\n",
        encoding="utf-8",
    )
    done = ran(tmp_path, good=HOLDS)
    assert "RuntimeError: a defect" in done.stdout
    assert "raise RuntimeError" in done.stdout


def test_workers_tell_what_they_reached() -> None:
    """pytest-xdist hands over plain data; it is added up where the run began."""
    config: Any = SimpleNamespace(stash=pytest.Stash(), option=SimpleNamespace(lupin_coverage=True))
    pytest_plugin.pytest_configure(config)
    key = ("states", "DONE", "")
    for _ in range(2):
        worker: Any = SimpleNamespace(stash=pytest.Stash(), workeroutput={})
        pytest_plugin.pytest_configure(worker)
        pytest_plugin._reach(worker, Path("inspection.yaml"), pytest_plugin.Counter({key: 2}))
        pytest_plugin.pytest_sessionfinish(SimpleNamespace(config=worker))  # type: ignore[arg-type]
        node = SimpleNamespace(config=config, workeroutput=worker.workeroutput)
        pytest_plugin.pytest_testnodedown(node)
    pytest_plugin.pytest_testnodedown(SimpleNamespace(config=config))
    assert config.stash[pytest_plugin._REACHED] == {Path("inspection.yaml"): {key: 4}}


def test_processes_of_pytest_xdist_share_the_scenarios(tmp_path: Path) -> None:
    """The outcomes and the coverage are those of one process."""
    pytest.importorskip("xdist")
    done = ran(tmp_path, "-n", "2", "--lupin-coverage", good=HOLDS, better=HOLDS, bad=FAILS)
    assert "1 failed, 2 passed" in done.stdout
    assert "inspection: states that were not reached" in done.stdout
