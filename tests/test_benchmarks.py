"""Benchmarks measure what they say: a machine is moved and gets where it should; workers take their time."""

from __future__ import annotations

import importlib
import json
import pickle
import re
import shutil
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from lupin_verify.campaign import CampaignSum
from lupin_verify.dealing import BATCH, CampaignTask
from tests.benchmarking import BENCHMARKS, started

CHARTS = ["cycle", "guarded", "parallel", "timed", "load-10", "bytes"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "printed"),
    [
        ("campaign.py --seeds 1 --batches 1 --workers 1", " missions a second of processor"),
        ("diagram.py --rounds 1 --formats mermaid", "| mermaid | "),
        ("editor.py --rounds 1", "completion "),
        ("learning.py --robots 1 --missions 4 --then 4", "durations are predicted within "),
        ("loading.py --rounds 1 --states 10", "without collection "),
        ("mission.py --rounds 1", "simulate all 29 tags "),
        ("possible.py --rounds 1", "the chart, "),
        ("proofs.py --only calibration", "| calibration, "),
        ("restarts.py journal", "events a second of processor time"),
        ("wheels.py --states 3", "27 situations"),
    ],
)
def test_a_benchmark_runs(line: str, printed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # where restarts.py puts a journal
    assert printed in started(*line.split()).stdout


def test_every_benchmark_is_started_by_a_test() -> None:
    texts = [file.read_text(encoding="utf-8") for file in Path(__file__).parent.rglob("test_*.py")]
    starting = "".join(text for text in texts if "from tests.benchmarking import" in text)
    named = set(re.findall(r'"(\w+)\.py[ "]', starting))
    assert {file.stem for file in BENCHMARKS.glob("*.py")} - named == {"mirror"}  # idle_cpu.py starts it


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The benchmark as a module."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return importlib.import_module("dispatch")


@pytest.fixture
def idle(bench: ModuleType) -> Any:
    """A process of an engine that does nothing, quickly."""

    class Idle:
        engine = bench.ENGINES[0]

        def ask(self, do: str, **arguments: Any) -> dict[str, Any]:
            return {"seconds": 1e-3} if do == "run" else {"active": ["a"], "count": None}

    return Idle()


@pytest.mark.slow
def test_measures_ours_and_gets_where_it_should(tmp_path: Path) -> None:
    figures, engines = tmp_path / "figures.json", ["lupin", "lupin-fresh", "floor"]
    # No peer is asked for, so nothing is installed.
    asked = ["--engines", *engines, "--charts", *CHARTS, "--json", str(figures)]
    done = started("dispatch.py", "--rounds", "2", "--block", "0.002", *asked)
    assert "lupin, a new Event each time" in done.stdout
    found = json.loads(figures.read_text(encoding="utf-8"))["figures"]
    assert list(found) == CHARTS
    for chart, row in found.items():
        assert row["lupin"]["missing"] == "", chart
        assert row["lupin"]["median"] > 0, chart
    assert all(found[chart][engine]["median"] > 0 for chart in CHARTS[:3] for engine in engines)


@pytest.mark.long
@pytest.mark.node
@pytest.mark.timeout(600)
@pytest.mark.skipif(shutil.which("npm") is None, reason="Node.js is not installed")
def test_measures_the_peers_too(tmp_path: Path) -> None:
    """Each of them gets where it should; they are installed anew, from their registries."""
    asked = ["--charts", "cycle", "parallel", "load-10", "bytes", "--env", str(tmp_path / "peers")]
    done = started("dispatch.py", "--rounds", "1", "--block", "0.002", *asked, timeout=580)
    assert "not installed" not in done.stdout + done.stderr


def test_an_engine_that_dispatches_into_nothing_is_told(bench: ModuleType, idle: Any) -> None:
    trial = bench.Trial(idle, "cycle")
    trial.begin(0.01)
    assert trial.finish().missing.startswith("wrong: after 1 events")


@pytest.mark.parametrize("states", [10, 23, 100, 1000])
def test_the_peers_charts_have_the_states_they_say(bench: ModuleType, states: int) -> None:
    generated = importlib.import_module("peers.generated")

    def count(found: list[dict[str, Any]]) -> int:
        return sum(1 + count(state["states"]) for state in found)

    assert count(generated.tree(states)) == states


def test_writes_its_section_and_nothing_else(bench: ModuleType, tmp_path: Path) -> None:
    table = importlib.import_module("peers.table")
    file = tmp_path / "performance.md"
    file.write_text("# Performance\n\nBefore.\n", encoding="utf-8")
    results = table.Results([bench.ENGINES[0]], method={"rounds": 7, "block_s": 0.2})
    for median in (2.0, 3.0):
        results.figures["cycle"] = {"lupin": table.Figure(median, 1.0)}
        table.write_section(file, table.document(results))
    text = file.read_text(encoding="utf-8")
    assert text.startswith("# Performance\n\nBefore.\n\n<!-- dispatch:begin -->\n")
    assert text.count("| lupin | 3 (1) |") == 1
    assert "2 (1)" not in text


@pytest.mark.parametrize(("workers", "seconds"), [(1, 17.0), (4, 5.0), (16, 2.0)])
def test_a_campaign_is_dealt_out_on_a_virtual_clock(
    workers: int, seconds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sixteen batches of a second each, by workers that are ready after one; dealing takes almost none."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    campaign: Any = importlib.import_module("campaign")
    batch = campaign.Batch(pickle.dumps(CampaignSum(seeds=BATCH)), 1.0)
    task = CampaignTask("hash", "folder", "lifecycle.yaml", "mission.yaml", ())
    clock = campaign.Workers(workers, 1.0, [batch])
    found = campaign.simulated(None, task, 16 * BATCH, clock, workers)
    assert found.seconds == pytest.approx(seconds, abs=0.2)
    assert 0.0 < found.a_batch < 0.02
