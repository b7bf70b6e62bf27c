"""What a proof says of itself: by which engine, of what, when, and what it assumes."""

from __future__ import annotations

import functools
import json
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import lupin_engine
from lupin_cli.main import main
from lupin_cli.proofs import evidence
from lupin_cli.proofs.evidence import (
    ASSUMPTIONS,
    MEANINGS,
    NOT_SHOWN,
    catalogs_hash,
    engine_hash,
)
from lupin_engine.missions.load import LoadedMissions
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.contract import Mock
from tests import shipped

LIFECYCLE = Path(__file__).parents[2] / "charts" / "mini" / "lifecycle.yaml"
MISSION = """\
mission: Short
initial: A
states:
  A:
    invoke: {do: nav.localize, with: {max_variance: 1.0}, timeout: {after: 10 s, code: late}}
    on_done: done
    on_error: done
  done: {type: final}
"""


@pytest.fixture
def loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> LoadedMissions:
    """A mission in the current folder."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(LIFECYCLE, tmp_path)
    Path("short.yaml").write_text(MISSION, encoding="utf-8")
    return load_missions(["short.yaml"], shipped.catalog())


def test_the_result_says_what_made_it(loaded: LoadedMissions, capsys: pytest.CaptureFixture[str]) -> None:
    """As JSON and on the page: hashes, command line, date, time, processor, parameters, assumptions."""
    asked = ["prove", "short.yaml", "--targets", "0", "--no-restarts", "--set", "approach_yaw=90 deg"]
    assert main([*asked, "--json", "--report", "proof.html"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    made = found["made"]
    command = "lupin prove short.yaml --set 'approach_yaw=90 deg' --targets 0 --no-restarts"
    assert made["command"] == f"{command} --report proof.html --json"
    assert made["version"] == lupin_engine.__version__
    assert made["engine"] == engine_hash()
    assert made["date"].endswith(" UTC")
    assert made["machine"].endswith(" cores")
    assert made["seconds"] > 0.0 < made["processor"]
    assert found["catalogs"] == catalogs_hash(loaded)
    assert found["parameters"]["approach_yaw"] == pytest.approx(1.5708, abs=1e-4)
    assert found["reached"] == {"taken": 5, "transitions": 5, "entered": 5, "states": 5}
    assert (found["assumptions"], found["not_shown"]) == (list(ASSUMPTIONS), list(NOT_SHOWN))
    page = Path("proof.html").read_text(encoding="utf-8")
    for text in (engine_hash(), catalogs_hash(loaded), loaded.hash, made["date"], "--targets 0"):
        assert text in page
    for text in (*ASSUMPTIONS, *NOT_SHOWN, *MEANINGS.values()):
        assert text.replace("'", "&#x27;") in page
    assert "<td><code>approach_yaw</code></td><td>1.5708 rad</td>" in page
    assert "<h2>Assumptions</h2>" in page
    assert "<h2>What a proof does not show</h2>" in page
    assert "5 of 5 transitions taken, 5 of 5 states entered" in page


def test_the_hash_of_the_engine_covers_its_sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their names, and each of their bytes."""
    (tmp_path / "__init__.py").write_text("")
    (tmp_path / "one.py").write_text("1\n")
    monkeypatch.setattr(evidence.lupin_engine, "__file__", str(tmp_path / "__init__.py"))
    of = engine_hash.__wrapped__
    first = of()
    assert of() == first
    (tmp_path / "one.py").write_text("2\n")
    second = of()
    (tmp_path / "one.py").rename(tmp_path / "two.py")
    assert len({first, second, of()}) == 3


def _gives(arguments: Mapping[str, Any], parameters: Any) -> Mapping[str, Any]:
    return {}


MOCKS = [
    Mock(after=3.0),
    Mock(after=3.0, values={"robot.pose": {"x": 1.0}}),
    Mock(after=3.0, values={"robot.pose": {"x": 2.0}}),
    Mock(after=3.0, values=_gives),
    Mock(after=3.0, result=_gives),
    Mock(after=3.0, result=functools.partial(_gives, {})),
]


def test_the_hash_of_the_catalogs_covers_mocks(loaded: LoadedMissions) -> None:
    """They decide which results a proof tries."""
    seen = {catalogs_hash(loaded)}
    for mock in MOCKS[:-1]:
        seen.add(catalogs_hash(_with(loaded, mock)))
        assert catalogs_hash(_with(loaded, mock)) in seen
    assert len(seen) == len(MOCKS)
    assert catalogs_hash(_with(loaded, MOCKS[-1])) == catalogs_hash(_with(loaded, MOCKS[-2]))


def _with(loaded: LoadedMissions, mock: Mock) -> LoadedMissions:
    """Return missions for which an operation has another mock."""
    chart = loaded.chart
    nav = chart.catalog.plugins["nav"]
    operations = {**nav.operations, "localize": replace(nav.operations["localize"], mock=mock)}
    plugins = {**chart.catalog.plugins, "nav": replace(nav, operations=operations)}
    return replace(loaded, chart=replace(chart, catalog=replace(chart.catalog, plugins=plugins)))
