"""The table of the matrix is whole, its planted defects change what there is, and a selection of it runs."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.lupin_ros.system.safety.matrix.defects import DEFECTS, Defect
from tests.lupin_ros.system.safety.matrix.run import ROOT
from tests.lupin_ros.system.safety.matrix.table import EVERY_SOURCE, EVERY_STOP, SMALL, cell


def test_the_selection_has_each_source_and_each_stop() -> None:
    sources, stops = {names[0] for names in SMALL}, {names[1] for names in SMALL}
    assert (sources, stops) == (set(EVERY_SOURCE), set(EVERY_STOP))
    assert all(cell(*names).applies for names in SMALL)
    assert len(SMALL) < 14  # and one in a real browser: tests/lupin_ros/system/console/test_matrix.py


@pytest.mark.parametrize("defect", DEFECTS, ids=lambda defect: defect.name)
def test_a_defect_takes_away_what_there_is(defect: Defect) -> None:
    """One that sets what nobody calls any more would never be found, or be found for another reason."""
    module = importlib.import_module(defect.module)
    for owner, name, function in re.findall(r"^(?:(\w+)\.)?(\w+) = |^def (\w+)", defect.code, re.MULTILINE):
        if owner or function:
            assert hasattr(getattr(module, owner) if owner else module, name or function)
    assert cell(defect.source, defect.stop, defect.order).applies
    assert len(DEFECTS) >= 20


@pytest.mark.timeout(400)
def test_nothing_moves_but_what_may(tmp_path: Path) -> None:
    """What could not be carried out on a busy machine is tried again; what moved is not."""
    line = [
        sys.executable,
        "-m",
        "tests.lupin_ros.system.safety.matrix.run",
        "--small",
        "--folder",
        str(tmp_path),
    ]
    done = subprocess.run(line, cwd=ROOT, capture_output=True, text=True)
    if done.returncode and " wrong " not in done.stdout:
        done = subprocess.run(line, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
