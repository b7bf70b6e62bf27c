"""The presets that are built in, and how they are named."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from lupin_arm.joints import check_pose
from lupin_arm.presets import PRESETS, UnknownPreset, find_preset

PAGE = Path(__file__).parents[3] / "docs" / "arm.md"
NAMES = "detect_left, home, inspect, pick, pick_closed, pick_open, place, travel, tuck, zero"


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_may_be_commanded(name: str) -> None:
    assert check_pose(PRESETS[name]) == PRESETS[name]


def test_the_robot_travels_in_its_rest_pose() -> None:
    assert PRESETS["travel"] == PRESETS["home"] == (0.04, -0.01, 0.01, -1.57)
    assert PRESETS["inspect"] == (0.0, -0.40, 0.90, -0.80)
    assert PRESETS["zero"] == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("said", ["inspect", " Inspect\n", "INSPECT"])
def test_blanks_and_capitals_do_not_matter(said: str) -> None:
    assert find_preset(said) == ("inspect", PRESETS["inspect"])


@pytest.mark.parametrize(
    ("said", "shown"), [("", "''"), ("in spect", "'in spect'"), ("x" * 5000, f"'{'x' * 40}...'")]
)
def test_an_unknown_name_is_answered_with_all_that_there_are(said: str, shown: str) -> None:
    with pytest.raises(UnknownPreset) as refused:
        find_preset(said)
    assert str(refused.value) == f"unknown preset {shown}; allowed: {NAMES}"


def test_the_page_has_the_same_poses() -> None:
    page = PAGE.read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| (.+?) \| (.+?) \| (.+?) \| (.+?) \|", page, re.MULTILINE)
    told = {name: tuple(float(cell) for cell in cells) for name, *cells in rows if name in PRESETS}
    assert told == {
        name: tuple(round(math.degrees(angle), 1) + 0.0 for angle in pose) for name, pose in PRESETS.items()
    }
