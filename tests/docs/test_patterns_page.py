"""The page of patterns: each has a run that keeps it and one that breaks it, drawn as it is."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.chart.compose.timeless import _KINDS
from tests.tools import load_tool

PAGE = Path(__file__).parents[2] / "docs" / "patterns.md"
patterns = load_tool("patterns")


def test_the_page_is_what_comes_of_the_runs() -> None:
    """Written anew by: .venv/bin/python tools/patterns.py > docs/patterns.md."""
    assert PAGE.read_text(encoding="utf-8") == patterns.page()


def test_every_word_has_a_picture() -> None:
    """A kind of property that is added belongs on the page."""
    lines = " ".join(one.line + one.title.lower() for one in patterns.PATTERNS)
    assert [kind for kind in _KINDS if kind not in lines] == []


@pytest.mark.parametrize("pattern", patterns.PATTERNS, ids=lambda one: one.title)
def test_a_picture_needs_both_runs(pattern: object) -> None:
    """One is kept, the other one broken; exchanged, the tool says so."""
    exchanged = patterns.Pattern(**{**vars(pattern), "kept": pattern.broken, "broken": pattern.kept})  # type: ignore[attr-defined]
    with pytest.raises(AssertionError):
        list(patterns.picture(exchanged))
