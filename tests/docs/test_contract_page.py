"""The page of the contract is what the sources say now."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.tools import load_tool

PAGE = Path(__file__).parents[2] / "docs" / "contract.md"
contract = load_tool("contract")


def test_the_page_is_what_the_sources_say() -> None:
    """A page that is out of date is worse than none."""
    if PAGE.read_text(encoding="utf-8") != contract.page():
        pytest.fail(
            "out of date; write it anew: .venv/bin/python tools/contract.py > docs/contract.md", False
        )


@pytest.mark.parametrize(
    "line",
    [
        "| `freshness` | `float \\| None` | `None` |",
        "| `mock` | `Mock` | `Mock()` |",
        "- `SENSOR`: best effort, volatile, depth 5: camera images",
        "- **`start(attempt: str, operation: str, arguments: Mapping[str, Any]) -> None`**",
        "- **`active`**",
        "`list_of(item: Type) -> Type`",
    ],
)
def test_fields_methods_and_constants_are_told(line: str) -> None:
    """As their users write them."""
    assert line in contract.page().splitlines()
