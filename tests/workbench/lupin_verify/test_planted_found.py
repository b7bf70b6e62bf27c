"""Planted defects are found by what every mission inherits: a handful quickly, the first half in full."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.errors import Severity
from lupin_engine.missions import load_missions
from lupin_engine.missions.folders import lifecycle_of, mission_files
from lupin_engine.missions.load import check_chart
from lupin_engine.plugin import load_catalog
from lupin_engine.runtime import make_world
from lupin_verify.proof import ProofVerdict, prove
from lupin_verify.situations.explorer import Bounds
from tests import shipped
from tests.workbench.lupin_verify.planted.planted import defects, plant

#: A defect -> the property that finds it.
HANDFUL = {
    "abort_is_a_skip": "abort_ends_the_mission",
    "stop_without_release_guard": "stopped_while_pressed",
    "resume_keeps_the_reason": "success_ends",
    "localizes_without_end": "failure_ends",
}
#: A defect that nothing inherited finds -> why.
MISSED = {
    "home_is_not_set": "which pose is home is said by that line alone",
    "arm_presets_swapped": "an action's argument means nothing to the engine",
    "photo_lamp_stays_on": "nothing says that a lamp that is switched on is switched off",
    "blocked_is_forgotten": "the search ends with its budget, and it says so",
    "night_without_rest": "rounds without end are meant; that nothing rests is a warning: never reached",
    "door_sensor_known_is_enough": "what an open door is for is known to this mission alone",
    "crate_not_noted": "what a variable stands for is known to this mission alone; a warning: never reached",
    "crate_still_loaded_untold": "which end is worth a code is known to this mission alone",
    "water_abort_goes_on": "found until the example was mended; why not any more is not known yet",
    "areas_order": "an order of states is meant by the mission alone",
}


def found(defect: str, folder: Path, monkeypatch: pytest.MonkeyPatch, targets: int) -> set[str]:
    """Return what finds a defect: properties, or the rule of an error."""
    missions = dict(plant("first", folder))[defect]
    monkeypatch.chdir(missions.parent)  # its bindings may be said in a file there
    (mission,) = mission_files(missions)
    _, told = check_chart(lifecycle_of(mission), [mission], shipped.catalog())
    errors = {one.rule for one in told if one.severity is Severity.ERROR}
    if errors:
        return errors
    chart = load_missions([str(mission)], load_catalog()).chart
    proof = prove(make_world(chart, {}), Bounds(targets=targets, restarts=False))
    assert proof.complete
    against = (ProofVerdict.BROKEN, ProofVerdict.NOT_SHOWN)  # of the second no times were found: exit code 3
    return {one.name for one in proof.properties if one.verdict in against}


@pytest.mark.parametrize("defect", HANDFUL)
def test_what_is_inherited_finds_it(defect: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With one target, and nothing said in the mission."""
    assert HANDFUL[defect] in found(defect, tmp_path, monkeypatch, targets=1)


@pytest.mark.long
@pytest.mark.proof
@pytest.mark.timeout(900)
@pytest.mark.parametrize("defect", [one.id for one in defects("first")])
def test_of_the_first_half_these_are_found(
    defect: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All but those that only the mission itself could tell."""
    assert bool(found(defect, tmp_path, monkeypatch, targets=2)) is (defect not in MISSED)
