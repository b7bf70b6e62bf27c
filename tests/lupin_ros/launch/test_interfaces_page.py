"""The page of the interfaces is what the nodes declare when they are started now."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")

from tests.tools import load_tool

PAGE = Path(__file__).parents[3] / "docs" / "interfaces.md"
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_.*' is deprecated:DeprecationWarning")


def test_the_page_is_what_the_nodes_declare() -> None:
    if PAGE.read_text(encoding="utf-8") != load_tool("interfaces").page():
        command = ".venv/bin/python tools/interfaces.py > docs/interfaces.md"
        pytest.fail(f"out of date; write it anew: {command}", pytrace=False)
