"""docs/war-stories.md: every story is shown by something or says why not, and what it links to is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from lupin_engine.sim import SUFFIX

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "war-stories.md"
SCENARIOS = ROOT / "tests" / "scenarios" / "war_stories"

#: The stories as they are numbered: told by the field (62 was never given), and found by reading.
NUMBERS = [str(number) for number in range(1, 79) if number != 62] + [f"A{number}" for number in range(1, 43)]
#: What a story says that is kept by somebody else; it may then have nothing that shows it.
NOT_OURS = "Not ours"

_ROW = re.compile(r"^\| (A?\d+) \| ([^|]+) \| ([^|]+) \| ([^|]+) \|$", re.MULTILINE)
_LINK = re.compile(r"\[([^]]+)\]\(([^)]+)\)")


def rows() -> dict[str, tuple[str, list[tuple[str, str]]]]:
    """Return what keeps each story from happening, and its links as text and target, by its number."""
    found = _ROW.findall(PAGE.read_text(encoding="utf-8"))
    numbers = [number for number, *_ in found]
    assert sorted(set(numbers)) == sorted(numbers), "a number stands twice"
    return {number: (kept, _LINK.findall(shown)) for number, _, kept, shown in found}


def story_of(scenario: Path) -> str:
    """Return the number that a scenario is named by: `A04_accepted_after_pause` is about A4."""
    letter, digits = re.match(r"(A?)0*(\d+)_", scenario.name).groups()  # type: ignore[union-attr]
    return f"{letter}{digits}"


def scenarios() -> list[Path]:
    """Return the scenarios of the war stories."""
    return sorted(SCENARIOS.glob(f"*{SUFFIX}"))


def test_every_story_is_told_once_in_order() -> None:
    """The tables are complete."""
    assert len(NUMBERS) == 119
    assert list(rows()) == NUMBERS


@pytest.mark.parametrize("number", NUMBERS)
def test_what_a_story_links_to_is_there(number: str) -> None:
    """A link is a file; what it says after `::` is a test of that file."""
    kept, links = rows()[number]
    assert links or kept.startswith((f"{NOT_OURS}: ", f"{NOT_OURS}, "))
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
    linked = [(PAGE.parent / target).resolve() for _, target in rows()[story_of(scenario)][1]]
    assert scenario.resolve() in linked
    first = scenario.read_text(encoding="utf-8").partition("\n")[0]
    assert re.match(r"# (The old|Old) flaw: ", first), first
