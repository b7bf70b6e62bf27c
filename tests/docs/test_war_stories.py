"""docs/war-stories.md: every story has something that shows it, and what it links to is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from lupin_engine.sim import SUFFIX

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "war-stories.md"
SCENARIOS = ROOT / "tests" / "scenarios" / "war_stories"

#: The stories that concern missions: told by the field, and found by reading.
FIELD = [*range(1, 28), 36, 37, 65, 66, 67, 71]
FOUND = [*range(1, 25), 34, 35, 36, 38, 39, 40, 41, 42]
NUMBERS = [*map(str, FIELD), *(f"A{number}" for number in FOUND)]

_ROW = re.compile(r"^\| (A?\d+) \| ([^|]+) \| ([^|]+) \| ([^|]+) \|$", re.MULTILINE)
_LINK = re.compile(r"\[([^]]+)\]\(([^)]+)\)")


def rows() -> dict[str, list[tuple[str, str]]]:
    """Return the links of every row: text and target, by the number of the story."""
    found = _ROW.findall(PAGE.read_text(encoding="utf-8"))
    numbers = [number for number, *_ in found]
    assert sorted(set(numbers)) == sorted(numbers), "a number stands twice"
    return {number: _LINK.findall(shown) for number, _, _, shown in found}


def story_of(scenario: Path) -> str:
    """Return the number that a scenario is named by: `A04_accepted_after_pause` is about A4."""
    letter, digits = re.match(r"(A?)0*(\d+)_", scenario.name).groups()  # type: ignore[union-attr]
    return f"{letter}{digits}"


def scenarios() -> list[Path]:
    """Return the scenarios of the war stories."""
    return sorted(SCENARIOS.glob(f"*{SUFFIX}"))


def test_every_story_is_told_once_in_order() -> None:
    """The table is complete, and has nothing that is not about missions."""
    assert list(rows()) == NUMBERS


@pytest.mark.parametrize("number", NUMBERS)
def test_what_a_story_links_to_is_there(number: str) -> None:
    """A link is a file; what it says after `::` is a test of that file."""
    links = rows()[number]
    assert links
    for text, target in links:
        file = (PAGE.parent / target).resolve()
        assert file.is_file(), target
        _, separator, test = text.partition("::")
        if separator:
            assert re.search(
                rf"^(async )?def {re.escape(test)}\(", file.read_text(encoding="utf-8"), re.MULTILINE
            )
        if file.parent.name == "broken":
            assert file.with_suffix(".txt").is_file(), f"{file.name} is no broken chart"


@pytest.mark.parametrize("scenario", scenarios(), ids=lambda path: path.name.removesuffix(SUFFIX))
def test_a_scenario_stands_in_its_row_and_says_how_it_would_fail(scenario: Path) -> None:
    """Named by its number, linked from it, and its first line tells what the old flaw would do to it."""
    linked = [(PAGE.parent / target).resolve() for _, target in rows().get(story_of(scenario), [])]
    assert scenario.resolve() in linked
    first = scenario.read_text(encoding="utf-8").partition("\n")[0]
    assert re.match(r"# (The old|Old) flaw: ", first), first
