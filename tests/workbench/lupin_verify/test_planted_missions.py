"""The planted defects are what they say: each applies, and is loaded or refused."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from lupin_engine.errors import Severity
from lupin_engine.missions.folders import lifecycle_of, mission_files
from lupin_engine.missions.load import check_chart
from tests import shipped
from tests.workbench.lupin_verify.planted.planted import HERE, SETS, defects, plant


@pytest.mark.slow
@pytest.mark.parametrize("half", SETS)
def test_every_defect_is_loaded_or_refused(half: str, tmp_path: Path) -> None:
    """As its entry says."""
    refused = {one.id for one in defects(half) if one.refused}
    found = set()
    for name, folder in plant(half, tmp_path):
        (mission,) = mission_files(folder)
        _, told = check_chart(lifecycle_of(mission), [mission], shipped.catalog())
        if any(each.severity is Severity.ERROR for each in told):
            found.add(name)
    assert found == refused


def test_there_are_fifty_in_each_half() -> None:
    """No two have one name, and each kind is in both halves alike."""
    first, second = (defects(half) for half in SETS[:2])
    assert len(first) == len(second) == 50
    assert len({one.id for one in (*first, *second)}) == 100
    of, others = (Counter(one.kind for one in half) for half in (first, second))
    assert all(abs(of[kind] - others[kind]) <= 1 for kind in of | others)


@pytest.mark.parametrize("mission", mission_files(HERE / "missions"), ids=lambda file: file.stem)
def test_the_missions_have_no_finding(mission: Path) -> None:
    """What is wrong in them is what was planted."""
    assert check_chart(lifecycle_of(mission), [mission], shipped.catalog())[1] == ()
