"""What a part reports is a variable of its user: under that name alone, wherever a run is kept or shown."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.chart.expressions.names import renamed
from lupin_engine.chart.model import Chart
from lupin_engine.diagram.outline import outline
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.missions.load import load_chart
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim.simulation import Script, simulate
from lupin_scxml.exporter import scxml
from lupin_verify.proof import ProofVerdict, prove
from lupin_verify.situations.explorer import Bounds
from tests import shipped

COOKBOOK = Path(__file__).parents[3] / "docs" / "cookbook"
DOORS = (COOKBOOK / "doors.yaml").read_text(encoding="utf-8")
#: A part that hands on what another one reports, under a name of its own.
BOTH = """\
part: both
out: {shut: {type: bool}, asked: {type: count}}
initial: DOOR
states:
  DOOR: {use: lock, with: {door: "door ${ asked }"}, out: {locked: shut, asked: asked}, on_done: over}
  over: {type: final}
"""


def chart(folder: Path, mission: str = DOORS, **parts: str) -> Chart:
    """Return the chart of a mission with the cookbook's part and others, in the shipped lifecycle."""
    (folder / "parts").mkdir(exist_ok=True)
    parts["lock"] = (COOKBOOK / "parts" / "lock.yaml").read_text(encoding="utf-8")
    for name, text in parts.items():
        (folder / "parts" / f"{name}.yaml").write_text(text, encoding="utf-8")
    (folder / "doors.yaml").write_text(mission, encoding="utf-8")
    return load_chart(
        default_missions_folder() / "lifecycle.yaml", [folder / "doors.yaml"], shipped.catalog()
    )


def test_each_use_has_variables_of_its_own(tmp_path: Path) -> None:
    """The chart knows no name of the part, and neither do snapshot and SCXML."""
    made = chart(tmp_path)
    assert list(made.context) == [
        "reason",
        "home",
        "front_locked",
        "back_locked",
        "front_asked",
        "back_asked",
    ]
    run = simulate(made, Script("Doors", {}))
    assert (run.context["back_asked"], run.context["back_locked"]) == (2, False)
    document = scxml(outline(made))
    assert 'location="front_locked"' in document
    assert 'location="locked"' not in document
    assert "min(front_asked + 1, 2)" in document


def test_a_part_in_a_part_hands_it_on(tmp_path: Path) -> None:
    """The innermost name is resolved to the mission's variable."""
    mission = DOORS.replace(
        "use: lock\n    with: {door: front door}\n    out: {locked:", "use: both\n    out: {shut:"
    )
    run = simulate(chart(tmp_path, mission, both=BOTH), Script("Doors", {}))
    assert (run.context["front_asked"], run.context["back_asked"]) == (2, 2)


RENAMED = [
    ("locked and not locked", "front and not front"),
    (" a.locked + locked ", " a.locked + front "),
    ("'locked' == locked", "'locked' == front"),
    ("any([locked for locked in doors])", "any([locked for locked in doors])"),
    ("é == 'é' and\n  locked", "é == 'é' and   front"),
    ("is it locked: ${ locked }, ${ 1 + tries:.1f }", "is it locked: ${ front }, ${ 1 + n:.1f }"),
    ("nothing", "nothing"),
]


@pytest.mark.parametrize(("source", "other"), RENAMED)
def test_names_are_exchanged_where_they_are_read(source: str, other: str) -> None:
    """Not in texts, not after a dot, and not where an element has the name."""
    assert renamed(source, {"locked": "front", "tries": "n"}) == other


@pytest.mark.slow
@pytest.mark.parametrize(("guard", "holds"), [("and", True), ("or", False)])
def test_a_proof_knows_what_a_part_reports(tmp_path: Path, guard: str, holds: bool) -> None:
    """A mission that goes on with one door open is found."""
    mission = DOORS.replace("guard: front_locked and", f"guard: front_locked {guard}")
    proof = prove(make_world(chart(tmp_path, mission), {}), Bounds(targets=0, restarts=False))
    (found,) = [one for one in proof.properties if one.name == "ends_locked"]
    assert (found.verdict is ProofVerdict.HOLDS) == holds
