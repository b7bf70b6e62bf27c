"""Longer lists by default: as far as a number of transitions lasts, and what is reported of it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from lupin_cli.main import main
from lupin_verify import widening
from lupin_verify.situations.explorer import Bounds, SituationExplorer

LIFECYCLE = Path(__file__).parents[2] / "charts" / "mini" / "lifecycle.yaml"
#: A counter may be 1 with two targets, 2 with three, 3 with four.
COUNTS = """\
mission: Counts
request: {tag_sequence: {type: list of text}}
context: {left: {type: count, default: 0, max: 9}}
properties: {few: {never: left >= 3}, one: {never: left >= 9}}
initial: VISIT
states:
  VISIT:
    entry: {set: {left: "${ len(request.tag_sequence) }"}}
    after: {1 s: done}
  done: {type: final}
"""


@pytest.fixture
def mission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A mission that only three targets break."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(LIFECYCLE, tmp_path)
    Path("counts.yaml").write_text(COUNTS, encoding="utf-8")
    return Path("counts.yaml")


def proven(capsys: pytest.CaptureFixture[str], *more: str) -> tuple[int, dict[str, Any], dict[str, str]]:
    """Return the exit code of a proof, its record, and the verdicts on the mission's own properties."""
    code = main(["prove", "counts.yaml", "--no-restarts", "--json", *more])
    (found,) = json.loads(capsys.readouterr().out)
    verdicts = {one["name"]: one["verdict"] for one in found["properties"]}
    return code, found, {name: verdicts[name] for name in ("few", "one")}


def test_what_two_targets_hide_is_found(mission: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By default three and four are explored; the shortest counterexample is kept."""
    code, found, verdicts = proven(capsys, "--targets", "2")
    assert (code, found["targets"], verdicts) == (0, 2, {"few": "holds", "one": "holds"})
    code, found, verdicts = proven(capsys)
    assert (code, found["targets"], found["beyond"]) == (1, 4, "")
    assert verdicts == {"few": "broken", "one": "holds"}
    assert found["cut"] == ["lists of up to 4 elements"]
    scenario = mission.with_name("counts.few.scenario.yaml").read_text(encoding="utf-8")
    assert "tag_sequence: [x1, x2, x3]" in scenario


def test_so_many_transitions_say_how_far(
    mission: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is not begun, or not explored to its end, is reported, and --targets goes further."""
    _, two, _ = proven(capsys, "--targets", "2")
    most = 2 * two["transitions"]
    monkeypatch.setattr(widening, "MOST_TRANSITIONS", most)
    code, found, verdicts = proven(capsys)
    assert (code, found["targets"], verdicts) == (0, 2, {"few": "holds", "one": "holds"})
    beyond = f"that takes more than {most:,} transitions in all"
    assert found["beyond"] == beyond
    assert found["bounds"][-1] == (
        f"Lists of 3 elements were not explored: {beyond}; --targets 3 explores them."
    )
    monkeypatch.setattr(widening, "_FACTOR", 0)
    code, found, verdicts = proven(capsys)
    assert (code, found["targets"], found["beyond"]) == (1, 2, beyond)
    assert verdicts == {"few": "broken", "one": "holds"}, "a breach stands where not everything was explored"
    assert found["complete"] is True


def test_a_chart_without_lists_is_proven_once(
    mission: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor does anything go further that was told how far, or compares a page of outcomes."""
    bounds = []
    begun = SituationExplorer.__init__

    def begin(explorer: SituationExplorer, world: Any, properties: Any, of: Bounds) -> None:
        bounds.append(of.targets)
        begun(explorer, world, properties, of)

    monkeypatch.setattr(SituationExplorer, "__init__", begin)
    proven(capsys, "--outcomes", "new")
    proven(capsys, "--targets", "1")
    mission.write_text(
        COUNTS.replace("request: {tag_sequence: {type: list of text}}\n", "").replace(
            "len(request.tag_sequence)", "1"
        ),
        encoding="utf-8",
    )
    _, found, _ = proven(capsys)
    assert bounds == [2, 1, 2]
    assert (found["targets"], found["beyond"]) == (None, "")


def test_an_interruption_leaves_what_was_proven(
    mission: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With three targets it is interrupted: exit code 3, and what two targets have shown."""
    begun = SituationExplorer.initial

    def interrupted(explorer: SituationExplorer) -> Any:
        if explorer.bounds.targets > 2:
            explorer.step = raises  # type: ignore[method-assign]
        return begun(explorer)

    def raises(*_: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(SituationExplorer, "initial", interrupted)
    code, found, verdicts = proven(capsys)
    assert (code, found["targets"], found["beyond"]) == (3, 2, "interrupted")
    assert verdicts == {"few": "holds", "one": "holds"}
