"""The table of the matrix is whole, and its planted defects change what there is; `make matrix` walks it."""

from __future__ import annotations

import importlib
import re

import pytest

from tests.ros.safety.matrix.defects import DEFECTS, Defect
from tests.ros.safety.matrix.table import EVERY_SOURCE, EVERY_STOP, SMALL, cell


def test_the_selection_has_each_source_and_each_stop() -> None:
    sources, stops = {names[0] for names in SMALL}, {names[1] for names in SMALL}
    assert (sources, stops) == (set(EVERY_SOURCE), set(EVERY_STOP))
    assert all(cell(*names).applies for names in SMALL)
    assert len(SMALL) < 14  # and one in a real browser: tests/ros/console/test_matrix.py


@pytest.mark.parametrize("defect", DEFECTS, ids=lambda defect: defect.name)
def test_a_defect_takes_away_what_there_is(defect: Defect) -> None:
    """One that sets what nobody calls any more would never be found, or be found for another reason."""
    module = importlib.import_module(defect.module)
    for owner, name, function in re.findall(r"^(?:(\w+)\.)?(\w+) = |^def (\w+)", defect.code, re.MULTILINE):
        if owner or function:
            assert hasattr(getattr(module, owner) if owner else module, name or function)
    assert cell(defect.source, defect.stop, defect.order).applies
    assert len(DEFECTS) >= 20
