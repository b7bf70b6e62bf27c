"""Every broken chart in tests/charts/broken is answered with exactly the text that stands beside it."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from lupin_engine.chart.findings import RULES, SUBJECTS
from lupin_engine.chart.source import head
from lupin_engine.errors import Severity
from lupin_engine.missions.folders import LIFECYCLE, mission_files
from lupin_engine.missions.load import check_chart
from lupin_engine.plugin.registry import Catalog
from lupin_engine.runtime.setup import make_world
from lupin_verify import breach
from lupin_verify.breach import findings
from lupin_verify.proof import prove
from lupin_verify.situations.explorer import Bounds
from lupin_verify.situations.found import ExplorationProgress

CHARTS = Path(__file__).parents[3] / "charts"
BROKEN = CHARTS / "broken"
PROVEN = tuple(rule.replace("-", "_") for rule in breach.RULES)
MINI = CHARTS / "mini"

CASES = sorted(
    list(BROKEN.glob("*.yaml"))
    + [path for path in BROKEN.iterdir() if path.is_dir() and path.name != "parts"]
)


def goes_on(_: ExplorationProgress) -> str:
    """Let a proof go on to its end."""
    return ""


def ends_early(progress: ExplorationProgress) -> str:
    """Let a proof end after the first situations."""
    return "the budget of 1 s ran out" if progress.situations > 3 else ""


def findings_of(case: Path, catalog: Catalog) -> str:
    """Check a case and return its findings, with files named as from the folder of the charts.

    A folder is checked whole; a mission stands in the slot of the mini lifecycle; a lifecycle gets the mini
    mission. One that is named for what a proof finds is proven.
    """
    if case.is_dir():
        _, found = check_chart(case / LIFECYCLE, mission_files(case), catalog)
    elif (head(case) or ("", ""))[0] == "lifecycle":
        _, found = check_chart(case, [MINI / "idle.yaml"], catalog)
    else:
        made, found = check_chart(MINI / LIFECYCLE, [case], catalog)
        if made is not None and case.stem.startswith(PROVEN):
            bounds = Bounds(targets=0, restarts=False, most_values=50)
            proof = prove(make_world(made, {}), bounds, ends_early if case.stem == "not_proven" else goes_on)
            found = (*found, *findings(proof, case.name))
    text = "".join(f"{diagnostic}\n" for diagnostic in found)
    return text.replace(f"{CHARTS}/", "").replace(f"{os.path.relpath(CHARTS)}/", "")


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.stem)
def test_a_broken_chart_is_answered_with_the_text_beside_it(case: Path, catalog: Catalog) -> None:
    """Place, problem, and what to do are part of the product; ACCEPT=1 writes the texts anew."""
    expected = case.with_suffix(".txt")
    found = findings_of(case, catalog)
    if os.environ.get("ACCEPT"):
        expected.write_text(found, encoding="utf-8")
    assert found == expected.read_text(encoding="utf-8")
    assert found


def test_every_rule_has_a_broken_chart() -> None:
    """A rule that no file breaks is a rule that nobody has seen working."""
    texts = "".join(path.read_text(encoding="utf-8") for path in BROKEN.glob("*.txt"))
    assert {rule for rule in RULES if f"[{rule}]" not in texts} == set()


def test_every_text_has_its_broken_chart() -> None:
    """A text whose chart was renamed would never be compared."""
    assert {path.stem for path in BROKEN.glob("*.txt")} == {case.stem for case in CASES}


@pytest.mark.parametrize("mission", [MINI / "idle.yaml"], ids=lambda path: path.stem)
def test_the_charts_that_the_broken_ones_lean_on_are_right(mission: Path, catalog: Catalog) -> None:
    """Otherwise their mistakes would stand in every text."""
    chart, found = check_chart(MINI / LIFECYCLE, [mission], catalog)
    assert found == ()
    assert chart is not None


def test_warnings_do_not_keep_a_chart_from_loading(catalog: Catalog) -> None:
    """What is probably a mistake is told, and the chart is there all the same."""
    chart, found = check_chart(MINI / LIFECYCLE, [BROKEN / "shadowed_state.yaml"], catalog)
    assert [d.severity for d in found] == [Severity.WARN]
    assert chart is not None


#: What is found of each piece by itself, or of what stands side by side.
_OF_PIECES = (
    "Files and their shape",
    "Types, units and expressions",
    "Names of states, events, operations and the rest",
)


@pytest.mark.slow
@pytest.mark.parametrize("case", [case for case in CASES if case.is_file()], ids=lambda case: case.stem)
def test_a_wrong_shape_hides_nothing_elsewhere(case: Path, catalog: Catalog, tmp_path: Path) -> None:
    """Every mistake at once: one place that cannot be read keeps no other from being checked."""
    text = case.read_text(encoding="utf-8")
    if not text.startswith("mission:") or "\nproperties:" in text:
        return
    rules = {rule for subject in _OF_PIECES for rule in SUBJECTS[subject]}
    expected = {
        (f.place[1:], f.rule) for f in check_chart(MINI / LIFECYCLE, [case], catalog)[1] if f.rule in rules
    }
    damaged = shutil.copytree(BROKEN / "parts", tmp_path / "parts").with_name(case.name)
    damaged.write_text(f"{text.rstrip()}\nproperties: {{p: 3}}\n", encoding="utf-8")
    found = {(f.place[1:], f.rule) for f in check_chart(MINI / LIFECYCLE, [damaged], catalog)[1]}
    assert expected <= found
