"""The missions in `examples/`: without a finding, and their scenarios reach everything."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_cli.main import main

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted(page.parent for page in (ROOT / "examples").glob("*/README.md"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda folder: folder.name)
def test_the_scenarios_reach_everything(example: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`lupin test` holds: every state, transition, outcome and guard."""
    code = main(["test", str(example), "--min-coverage", "100"])
    told = capsys.readouterr().out
    assert code == 0, told
    assert told.rstrip().endswith("scenarios: all hold")


def test_all_of_them_fit_beside_the_shipped_missions(capsys: pytest.CaptureFixture[str]) -> None:
    """In one folder: nothing that one declares is declared otherwise by another."""
    folders = [str(example / "missions") for example in EXAMPLES]
    assert main(["check", "--strict", str(ROOT / "missions"), *folders]) == 0
    assert capsys.readouterr().out == f"{len(EXAMPLES) + 2} missions, no errors, no warnings\n"


def test_their_pages_are_short_and_can_be_found() -> None:
    """From the first page of the documentation, and from that of the repository."""
    assert len(EXAMPLES) == 3
    for page in ("README.md", "docs/index.md"):
        text = (ROOT / page).read_text(encoding="utf-8")
        for example in EXAMPLES:
            assert f"examples/{example.name}/README.md" in text
            assert len((example / "README.md").read_text(encoding="utf-8").splitlines()) <= 60
