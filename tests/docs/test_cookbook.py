"""The recipe of docs/cookbook.md for a lifecycle of one's own, with a mission that has an itinerary."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_cli.main import main

COOKBOOK = Path(__file__).parents[2] / "docs" / "cookbook"
CLOSES = "do: {itinerary.close_rest: {status: SKIPPED, code: home_given_up}}"


@pytest.mark.slow
@pytest.mark.parametrize("closes", [True, False])
def test_its_way_out_reports_the_targets_that_are_left(
    closes: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The proof finds the defect that the recipe had: a way home that is given up with targets left."""
    (tmp_path / "parts").mkdir()
    shutil.copy(COOKBOOK / "parts" / "localize.yaml", tmp_path / "parts")
    shutil.copy(COOKBOOK / "wards.yaml", tmp_path)
    lifecycle = (COOKBOOK / "ward" / "lifecycle.yaml").read_text(encoding="utf-8")
    assert CLOSES in lifecycle
    text = lifecycle if closes else lifecycle.replace(CLOSES, "")
    (tmp_path / "lifecycle.yaml").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    code = main(["prove", "wards.yaml", "--targets", "1", "--no-restarts", "--no-scenarios"])
    assert (code, "✗ all_closed" in capsys.readouterr().out) == ((0, False) if closes else (1, True))
