"""What a proof tries of records: the fields that conditions read, in requests, variables and parameters."""

from __future__ import annotations

import re
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
    if "target.floor: only 2, 3 were tried" in told and found == "proven":
        assert "✓ never_bad: never in_state('BAD') (for the values that were tried)\n" in told
        found = "not all values were tried"
    assert found == verdict


#: Four wards, of which only the last one is narrow and shut.
FOUR = """\
    default:
      - {id: icu, floor: 1, door: 1.2 m, open: true}
      - {id: lab, floor: 2, door: 1.1 m, open: true}
      - {id: kitchen, floor: 3, door: 1 m, open: true}
      - {id: archive, floor: 4, door: 60 cm, open: false}
"""
TWO = MISSION[MISSION.index("    default:") : MISSION.index("request:")]
OF_REQUEST, OF_TABLE = '{items: "${ request.all }"}', '{items: "${ param.wards }"}'


def shown(
    defect: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], *more: str, default: str = FOUR
) -> tuple[int, str]:
    """Prove the mission with a longer table and two targets; return the exit code and what is printed."""
    shutil.copy(LIFECYCLE, tmp_path)
    text = MISSION.replace("DEFECT", f'"{defect}"').replace(TWO, default)
    for old, new in zip(more[::2], more[1::2], strict=True):
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "kept.yaml").write_text(text, encoding="utf-8")
    code = main(["prove", str(tmp_path / "kept.yaml"), "--targets", "2", "--no-restarts", "--no-scenarios"])
    return code, capsys.readouterr().out


@pytest.mark.parametrize(
    ("defect", "by"),
    [
        ("target.door < '70 cm'", "door"),
        ("not target.open", "open"),
        ("any(one.door < '70 cm' for one in request.all)", "door"),
        ("itinerary.total > 1 and target.id == 'archive'", "id"),
        ("itinerary.total > 1 and target.floor * target.floor == 16", "floor"),
    ],
)
def test_a_row_that_differs_is_tried(
    defect: str, by: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Alone and beside another one, however far behind it stands in its list."""
    code, told = shown(defect, tmp_path, capsys)
    assert code == 1
    assert "✗ never_bad" in told
    assert f"have 0 to 2 different elements; conditions tell them apart by {by}.\n" in told


def test_rows_of_too_many_kinds_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The ones that are not tried are a bound, and what holds of the others is not said plainly."""
    rows = [f"      - {{id: w{at}, floor: {at}, door: 1 m, open: true}}\n" for at in range(1, 9)]
    defect = "itinerary.total > 0 and target.floor * target.floor == 64"
    code, told = shown(defect, tmp_path, capsys, default="".join(["    default:\n", *rows]))
    assert code == 0
    assert "✓ never_bad: never in_state('BAD') (for the values that were tried)\n" in told
    kinds = "conditions tell 8 kinds of its elements apart, and 6 were tried"
    assert f"Not all values were tried: request.all: {kinds}.\n" in told
    assert "which they are makes no difference" not in told
    assert ": proven for lists of up to 2 elements, the values that were tried; " in told


def test_a_fixed_list_is_walked_whole(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It has no bound, neither in its length nor in what its rows are."""
    no_list = ('  all: {type: list of ward, default: "${ param.wards }"}\n', "")
    code, told = shown("target.door < '70 cm'", tmp_path, capsys, OF_REQUEST, OF_TABLE, *no_list)
    assert code == 0, "the first one is wide, and all of them are closed with it"
    assert "    These lists are fixed, and walked whole: MISSION.Kept.THERE (4 elements).\n" in told
    assert "✓ never_bad: never in_state('BAD')\n" in told
    assert re.search(r"^Kept: proven; ", told, re.MULTILINE)
    code, told = shown("target.door > '1.1 m'", tmp_path, capsys, OF_REQUEST, OF_TABLE, *no_list)
    assert code == 1
    assert "✗ never_bad" in told


def test_a_campaign_asks_for_records_as_they_are(tmp_path: Path) -> None:
    """Not by their names, which only a plugin could look up."""
    shutil.copy(LIFECYCLE, tmp_path)
    (tmp_path / "kept.yaml").write_text(MISSION.replace("DEFECT", "here.open"), encoding="utf-8")
    world = make_world(load_missions([str(tmp_path / "kept.yaml")], shipped.catalog()).chart, {})
    field, pool = pool_of(world, "Kept")
    assert (field, [one["floor"] for one in pool]) == ("all", [2, 3])
