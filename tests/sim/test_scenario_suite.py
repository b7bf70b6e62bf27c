"""Many scenarios at once: seeds, processes, JUnit."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from lupin_engine.replay.coverage import CoverageObserver
from lupin_engine.sim import suite
from lupin_engine.sim.junit import junit
from lupin_engine.sim.scenario import scenario_files
from lupin_engine.sim.suite import ScenarioResult, Suite, run_all
from tests import shipped

SCENARIOS = Path(__file__).parents[1] / "scenarios" / "inspection"
HEAD = 'scenario: a promise\nmission: inspection\nrequest: {tag_sequence: ["1"]}\n'
CHANCE = "mocks: [{do: nav.go_to, then: {any_of: [{weight: 9}, {fail: nav_rejected}]}}]\n"


def written(folder: Path, name: str, text: str) -> Path:
    """Write a scenario."""
    file = folder / f"{name}.scenario.yaml"
    file.write_text(HEAD + text, encoding="utf-8")
    return file


def test_the_first_seed_that_fails_is_told(tmp_path: Path) -> None:
    """Seeds are tried in turn until one fails; that one alone fails as well."""
    file = written(
        tmp_path, "x", "parameters: {nav_max_attempts: 1}\n" + CHANCE + "expect: {visits: [1 OK]}\n"
    )
    found = Suite(shipped.catalog())
    result = found.run(file, range(100))
    assert result.seed is not None
    assert (result.holds, result.runs) == (False, result.seed + 1)
    assert not found.run(file, [result.seed]).holds
    assert found.run(file, range(result.seed)).holds


def test_without_chance_one_seed_will_do(tmp_path: Path) -> None:
    """Nothing is run twice for nothing."""
    result = Suite(shipped.catalog()).run(written(tmp_path, "x", "expect: {final: DONE}\n"), range(100))
    assert (result.runs, result.seed) == (1, None)


def told(results: list[ScenarioResult]) -> list[tuple[str, str, tuple[str, ...], float]]:
    """What must not hang on who ran them."""
    return [(r.name, r.problem, tuple(map(str, r.failures)), r.seconds) for r in results]


@pytest.mark.parametrize("threads", [1, 2], ids=["copied", "begun anew"])
def test_processes_tell_the_same(threads: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the order of the files, with failures and mistakes; copies are made only without other threads."""
    monkeypatch.setattr(suite.threading, "active_count", lambda: threads)
    wrong = [written(tmp_path, "fails", "expect: {final: FAULT}\n"), written(tmp_path, "broken", "")]
    files = [*scenario_files([SCENARIOS])[:8], *wrong]
    alone = list(run_all(shipped.catalog(), files, jobs=1, observe=CoverageObserver))
    shared = list(run_all(shipped.catalog(), files, jobs=2, observe=CoverageObserver))
    assert told(alone) == told(shared)
    assert [result.counts for result in alone] == [result.counts for result in shared]
    assert [result.holds for result in alone] == [True] * 8 + [False] * 2


def test_few_runs_stay_in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other processes begin only where there is work for them."""
    monkeypatch.setattr(suite, "ProcessPoolExecutor", None)
    assert all(result.holds for result in run_all(shipped.catalog(), scenario_files([SCENARIOS])[:3]))


def test_junit_is_told_everything(tmp_path: Path) -> None:
    """A case for each scenario; what fails and what cannot be run are told apart, with the whole report."""
    files = [
        written(tmp_path, "holds", "expect: {final: DONE}\n"),
        written(tmp_path, "fails", "expect: {final: FAULT, paused: true}\n"),
        written(tmp_path, "broken", "expect: {finel: FAULT}\n"),
    ]
    found = Suite(shipped.catalog())
    root = ElementTree.fromstring(junit([found.run(file) for file in files]))
    (testsuite,) = root
    assert {name: testsuite.get(name) for name in ("tests", "failures", "errors")} == {
        "tests": "3",
        "failures": "1",
        "errors": "1",
    }
    holds, fails, broken = testsuite
    assert (holds.get("name"), len(holds)) == ("holds", 0)
    assert [failure.get("message") for failure in fails] == [
        "final: expected FAULT, got DONE",
        "paused: expected True, got False",
    ]
    assert "nav.dock done" in str(fails[0].text)
    assert "did you mean 'final'?" in str(broken[0].text)
    assert broken[0].tag == "error"


def test_junit_survives_what_xml_cannot_hold() -> None:
    """A control character in a text is left out."""
    root = ElementTree.fromstring(
        junit([ScenarioResult(Path("a/b.scenario.yaml"), problem="bell \x07 & <tag>")])
    )
    case = root[0][0]
    assert (case.get("classname"), case[0].text) == ("a", "bell  & <tag>")
