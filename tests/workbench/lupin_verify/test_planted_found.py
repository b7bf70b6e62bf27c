"""Planted defects are found by what every mission inherits: a handful quickly, the first half in full."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.missions import load_missions
from lupin_engine.runtime import make_world
from lupin_verify.proof import prove
from lupin_verify.situations.explorer import Bounds
from tests import shipped
from tests.workbench.lupin_verify.planted.planted import plant

#: A defect -> the property that finds it.
HANDFUL = {
    "abort_is_a_skip": "abort_ends_the_mission",
    "stop_without_release_guard": "stopped_while_pressed",
    "reads_where_it_got_stuck": "good_at_its_target",
    "resume_keeps_the_reason": "success_ends",
    "localizes_without_end": "failure_ends",
}


@pytest.mark.parametrize("defect", HANDFUL)
def test_what_is_inherited_finds_it(defect: str, tmp_path: Path) -> None:
    """With one target, and nothing said in the mission."""
    folders = dict(plant("first", tmp_path))
    (mission,) = (file for file in folders[defect].glob("*.yaml") if file.stem != "lifecycle")
    chart = load_missions([str(mission)], shipped.catalog()).chart
    found = prove(make_world(chart, {}), Bounds(targets=1, restarts=False))
    assert HANDFUL[defect] in {one.name for one in found.broken}
