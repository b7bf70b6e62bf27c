"""The page for users of Python: what stands there is what comes."""

from __future__ import annotations

import doctest
from pathlib import Path

import pytest

import lupin_engine

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "python.md"


def test_the_page_shows_what_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Run in the checkout, as a reader would."""
    monkeypatch.chdir(ROOT)
    result = doctest.testfile(str(PAGE), module_relative=False, optionflags=doctest.ELLIPSIS)
    assert result.attempted > 10
    assert result.failed == 0


def test_the_page_has_every_name() -> None:
    """What `lupin_engine` exports is for users, and nothing else is."""
    page = PAGE.read_text(encoding="utf-8")
    assert [name for name in lupin_engine.__all__ if f"`{name}" not in page] == []
    assert len(lupin_engine.__all__) <= 12
