"""A selection of the matrix: each source of motion once, and each stop once; `make matrix` is the rest."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator

import pytest

from tests.ros.safety.matrix.bench import Bench
from tests.ros.safety.matrix.cell import carry_out
from tests.ros.safety.matrix.defects import DEFECTS, Defect
from tests.ros.safety.matrix.table import EVERY_SOURCE, EVERY_STOP, SMALL, cell

pytestmark = pytest.mark.timeout(240)


@pytest.fixture(scope="module")
def bench(ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """All nodes, for all cells."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("matrix")
        patch.setenv("XDG_STATE_HOME", str(folder / "state"))
        patch.setenv("XDG_CONFIG_HOME", str(folder / "config"))
        bench = Bench(folder)
        yield bench
        assert bench.close() == []


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


@pytest.mark.parametrize("names", SMALL, ids="/".join)
def test_nothing_moves_but_what_may(bench: Bench, names: tuple[str, str, str]) -> None:
    result = carry_out(bench, cell(*names))
    assert result.problems == [], result
