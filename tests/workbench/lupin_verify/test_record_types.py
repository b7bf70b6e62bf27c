"""What a proof tries of records: the fields that conditions read, in requests, variables and parameters."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_engine.missions.selection import load_missions
from lupin_engine.runtime.setup import make_world
from lupin_verify.draws import pool_of
from tests import shipped

LIFECYCLE = Path(__file__).parents[2] / "charts" / "mini" / "lifecycle.yaml"
#: The ward of the request is kept, and read later; DEFECT is where a defect is planted.
MISSION = """\
mission: Kept
types:
  ward: {id: text, floor: {type: integer, min: 0, max: 9}, door: {type: length, min: 50 cm}, open: bool}
params:
  wards:
    type: list of ward
    default: [{id: icu, floor: 2, door: 1 m, open: true}, {id: lab, floor: 3, door: 60 cm, open: true}]
request:
  to: {type: ward, default: "${ param.wards[0] }"}
  all: {type: list of ward, default: "${ param.wards }"}
context:
  here: {type: ward, default: "${ param.wards[0] }"}
properties:
  never_bad: {never: "in_state('BAD')"}
initial: GOING
states:
  GOING:
    entry: {set: {here: "${ request.to }"}}
    after: {1 s: THERE}
  THERE:
    itinerary: {items: "${ request.all }"}
    always:
      - {target: BAD, guard: DEFECT, do: {itinerary.close_rest: {status: SKIPPED}}}
      - {target: done, do: {itinerary.close_rest: {status: SKIPPED}}}
  BAD: {after: {1 s: done}}
  done: {type: final}
"""


@pytest.mark.parametrize(
    ("defect", "verdict"),
    [
        ("here.floor == 7 and not here.open", "broken"),
        ("here.door > '2 m'", "broken"),
        ("here.id == 'kitchen'", "broken"),
        ("here.floor > 9", "proven"),
        ("param.wards[1].door > '1 m'", "proven"),
        ("param.wards[1].door < '1 m'", "broken"),
        ("itinerary.total > 1 and target.floor == 2", "broken"),
        ("itinerary.total > 0 and target.floor == 8", "not all values were tried"),
    ],
)
def test_a_field_that_decides_is_tried(
    defect: str,
    verdict: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A proof finds what a field leads to, or names the field that it did not try enough of."""
    shutil.copy(LIFECYCLE, tmp_path)
    (tmp_path / "kept.yaml").write_text(MISSION.replace("DEFECT", f'"{defect}"'), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    main(["prove", "kept.yaml", "--targets", "2", "--no-restarts", "--no-scenarios"])
    told = capsys.readouterr().out
    found = "broken" if "✗ never_bad" in told else "proven"
    if "target.floor: no other values were tried" in told and found == "proven":
        found = "not all values were tried"
    assert found == verdict


def test_a_campaign_asks_for_records_as_they_are(tmp_path: Path) -> None:
    """Not by their names, which only a plugin could look up."""
    shutil.copy(LIFECYCLE, tmp_path)
    (tmp_path / "kept.yaml").write_text(MISSION.replace("DEFECT", "here.open"), encoding="utf-8")
    world = make_world(load_missions([str(tmp_path / "kept.yaml")], shipped.catalog()).chart, {})
    field, pool = pool_of(world, "Kept")
    assert (field, [one["floor"] for one in pool]) == ("all", [2, 3])
