"""Many scenarios at once: seeds."""

from __future__ import annotations

from pathlib import Path

from lupin_engine.sim.suite import Suite
from tests import shipped

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
