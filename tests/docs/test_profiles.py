"""The page about profiles tells of all that a profile says; what it shows, test_guide.py holds against it."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

from lupin_engine.plugin.profile import Profile

PAGE = Path(__file__).parents[2] / "docs" / "profiles.md"


def test_every_field_of_a_profile_is_told() -> None:
    """In the table, and no other."""
    table = PAGE.read_text(encoding="utf-8").partition("| Field of `Profile` |")[2].partition("\n\n")[0]
    told = {name for line in table.splitlines()[2:] for name in re.findall(r"`(\w+)`", line.split("|")[1])}
    assert told == {field.name for field in dataclasses.fields(Profile)}
