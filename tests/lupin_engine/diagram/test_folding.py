"""Drawings with states folded: what is in them is left out, and how much that is stands in their boxes."""

from __future__ import annotations

import re

import pytest

from lupin_engine.diagram.folding import folded_svg
from lupin_engine.errors import UsageError
from tests.shipped import mission

INSPECTION = mission("inspection")
MISSION = "MISSION.InspectionMission"


def boxes(*folded: str) -> set[str]:
    """Return the states that have a group in the drawing."""
    return set(re.findall(r'data-state="([^"]*)"', folded_svg(INSPECTION, frozenset(folded))))


def test_what_is_in_a_folded_state_is_not_drawn_and_all_else_is() -> None:
    everything, folded = boxes(), boxes(MISSION)
    assert everything == {name for name in INSPECTION.states if name}
    assert folded == {name for name in everything if not name.startswith(f"{MISSION}.")}
    assert f"… {len(everything) - len(folded)} states" in folded_svg(INSPECTION, frozenset({MISSION}))


def test_a_state_within_a_folded_one_changes_nothing() -> None:
    inside = next(name for name in INSPECTION.states if name.startswith(f"{MISSION}."))
    assert folded_svg(INSPECTION, frozenset({MISSION, inside})) == folded_svg(
        INSPECTION, frozenset({MISSION})
    )


def test_unknown_states_are_told_all_at_once_up_to_three() -> None:
    with pytest.raises(UsageError) as told:
        folded_svg(INSPECTION, frozenset({"REDY", "MISION"}))
    assert str(told.value) == "no state 'MISION' (did you mean 'MISSION'?), 'REDY' (did you mean 'READY'?)"
    with pytest.raises(UsageError, match=r"^no state 'a', 'b', 'c' and 4 more$"):
        folded_svg(INSPECTION, frozenset("abcdefg"))
