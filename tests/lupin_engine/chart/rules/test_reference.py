"""The reference pages are what the source says now, and their examples are right."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_engine.chart.compose.actions import STRUCTURED, builtin_actions
from lupin_engine.chart.expressions.scope import BUILTIN_CALLS, ROOTS
from lupin_engine.missions.folders import LIFECYCLE, PARTS
from lupin_engine.missions.load import check_chart
from lupin_engine.plugin.registry import Catalog, load_catalog
from lupin_greenhouse.profile import PROFILE
from tests.tools import load_tool

ROOT = Path(__file__).parents[4]
MISSIONS = ROOT / "missions"
EXAMPLES = ROOT / "docs" / "examples"
IDLE = ROOT / "tests" / "charts" / "mini" / "idle.yaml"

#: Around an example that is the content of a state.
AROUND_STATE = "mission: Example\nstates:\n  EXAMPLE:\n{}\n  done: {{type: final}}\n"
#: Around an example that is a part.
AROUND_PART = """\
mission: Example
states:
  USING:
    itinerary: {items: "${ tags.numeric_order() }"}
    use: part
    on_done: done
  done: {type: final}
"""
#: One that reports, and has no itinerary.
AROUND_OUT = """\
mission: Example
context:
  front_locked: {type: bool, default: false}
states:
  USING:
    use: out
    out: {locked: front_locked}
    on_done:
      - {target: done, guard: front_locked}
      - {target: FAULT}
  done: {type: final}
"""


reference = load_tool("reference")


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(reference.PAGES))
def test_a_page_is_what_the_source_says(name: str) -> None:
    """A page that is out of date is worse than none."""
    file = ROOT / "docs" / f"{name}.md"
    if file.read_text(encoding="utf-8") != reference.page(name):
        command = f".venv/bin/python tools/reference.py {name} > docs/{name}.md"
        pytest.fail(f"docs/{name}.md is out of date; write it anew: {command}", pytrace=False)


@pytest.fixture(scope="module")
def shipped() -> Catalog:
    """The plugins that are installed: an author tries the examples with these."""
    return load_catalog()


@pytest.mark.slow
@pytest.mark.parametrize("file", sorted(EXAMPLES.glob("*.yaml")), ids=lambda file: file.stem)
def test_an_example_is_right(file: Path, tmp_path: Path, shipped: Catalog) -> None:
    """In the shipped lifecycle, or as one; neither an error nor a warning."""
    shutil.copytree(MISSIONS, tmp_path, dirs_exist_ok=True)
    text = file.read_text(encoding="utf-8")
    mission = tmp_path / "example.yaml"
    # The shipped lifecycle speaks of states that a mission of the family has.
    beside = [tmp_path / "inspection.yaml"]
    if text.startswith("lifecycle:"):
        (tmp_path / LIFECYCLE).write_text(text, encoding="utf-8")
        text, beside = IDLE.read_text(encoding="utf-8"), []
    elif text.startswith("part:"):
        (tmp_path / PARTS / file.name).write_text(text, encoding="utf-8")
        text = AROUND_OUT if file.stem == "out" else AROUND_PART
    elif not text.startswith("mission:"):
        text = AROUND_STATE.format("\n".join(f"    {line}" for line in text.splitlines()))
    mission.write_text(text, encoding="utf-8")
    chart, found = check_chart(tmp_path / LIFECYCLE, [mission, *beside], shipped)
    assert [str(diagnostic) for diagnostic in found] == []
    assert chart is not None


def test_every_model_has_an_example_and_every_example_a_model() -> None:
    """An example of a word that is gone would never be seen."""
    assert {file.stem for file in EXAMPLES.iterdir()} == set(map(reference.snake, reference.models()))


def test_what_is_told_by_hand_is_complete() -> None:
    """A word that is added without a sentence about it, or removed, is noticed here."""
    assert set(reference.ROOT_TEXTS) == ROOTS
    assert set(reference.CALL_TEXTS) == set(BUILTIN_CALLS)
    assert set(reference.ACTION_TEXTS) == {*builtin_actions(PROFILE), *STRUCTURED}
