"""The checker's findings in an editor: their ends, their spellings, and which file shows which."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from lupin_engine.errors import Diagnostic, Place
from lupin_engine.missions.load import check_chart
from lupin_engine.plugin.registry import Catalog
from lupin_lsp.folder import Folder
from lupin_lsp.problems import corrected, problem, spelling
from lupin_lsp.scan import scan

CHARTS = Path(__file__).parents[2] / "charts"

#: What is typed in the inspection mission, and what is marked with which message.
CASES = {
    "a target": ("on_error: FAULT", "on_error: FUALT", "FUALT", "no state is called 'FUALT' here"),
    "a key": ("on_error: FAULT", "on_eror: FAULT", "on_eror", "unknown key 'on_eror'"),
    "an operation": ("nav.localize", "nav.localise", "nav.localise", "unknown operation 'nav.localise'"),
    "a name in an expression": (
        "param.localization_timeout_s",
        "param.localisation_timeout_s",
        "localisation_timeout_s",
        "unknown parameter 'localisation_timeout_s'",
    ),
    "a function": (
        "tags.numeric_order()",
        "tags.numeric_ordr()",
        "tags.numeric_ordr",
        "unknown function 'tags.numeric_ordr'",
    ),
    "a value": ("default: 15 s", "default: 15", "15", "15 has no unit, but a duration needs one"),
    "a part": ("visit_targets", "visit_target", "visit_target", "unknown part or mission 'visit_target'"),
    "broken YAML": ("{type: final}", "{type: final", "{", "did not find expected ',' or '}'"),
}


@pytest.mark.parametrize("case", CASES)
def test_marks_what_it_speaks_of(case: str, folder: Folder) -> None:
    """From the place that the checker tells to the end of the name."""
    old, new, marked, message = CASES[case]
    path = folder.path / "inspection.yaml"
    folder.put(path, folder.text(path).replace(old, new, 1))
    found = [problem(folder.scan(path), finding) for finding in folder.check(path)]
    first = next(each for each in found if each.message.startswith(message))
    if case != "broken YAML":
        assert folder.text(path)[first.start : first.end] == marked


@pytest.mark.slow
@pytest.mark.parametrize("file", sorted((CHARTS / "broken").glob("*.yaml")), ids=lambda file: file.stem)
def test_marks_something_in_every_broken_chart(file: Path, catalog: Catalog) -> None:
    """A piece of one line, which begins where the checker says."""
    text = file.read_text(encoding="utf-8")
    for finding in check_chart(CHARTS / "mini" / "lifecycle.yaml", [file], catalog)[1]:
        if finding.place.file == str(file):
            found = problem(scan(text), finding)
            line, column = scan(text).lines.position(found.start)
            assert (line + 1, column + 1) == (finding.place.line, finding.place.column)
            assert "\n" not in text[found.start : found.end]


def test_mends_the_spelling() -> None:
    """Only where one was found; quotes stay."""
    place = Place("a.yaml", 1, 7)
    finding = Diagnostic(place, "unknown-state", "", "no state is called 'A'", "did you mean 'B'?")
    assert spelling(problem(scan("on: {x: A}"), finding).message) == "B"
    assert spelling("no state is called 'A'; allowed: 'B', 'C'") == ""
    assert corrected("'A'", "B") == "'B'"
    assert corrected("A", "B") == "B"


def test_a_broken_mission_hides_nothing_of_the_others(folder: Folder) -> None:
    """What could be read of it last is what the others are checked with."""
    broken, path = folder.path / "inspection.yaml", folder.path / "lifecycle.yaml"
    folder.put(broken, folder.text(broken))
    folder.check(broken)
    folder.put(broken, folder.text(broken) + "  }")
    folder.put(path, folder.text(path).replace("target: BOOT", "target: BOTT"))
    found = {file.name: [d.rule for d in findings] for file, findings in folder.survey().items()}
    assert found["inspection.yaml"] == ["wrong-yaml"]
    assert "unknown-state" in found["lifecycle.yaml"]
    assert folder.model is not None


def test_findings_of_a_part_are_told_of_the_part(own_folder: Folder) -> None:
    """Also when only the mission is open."""
    part = own_folder.path / "parts" / "visit_targets.yaml"
    part.write_text(re.sub("nav.go_to", "nav.goto", part.read_text()), encoding="utf-8")
    own_folder.put(own_folder.path / "inspection.yaml", own_folder.text(own_folder.path / "inspection.yaml"))
    found = {file.name: [d.rule for d in findings] for file, findings in own_folder.survey().items()}
    assert found["visit_targets.yaml"][0] == "unknown-operation"
    assert own_folder.check(part)[0].rule == "unknown-operation"


def test_other_yaml_is_left_alone(tmp_path: Path, catalog: Catalog) -> None:
    """A server that is started for all YAML must not call a compose file a mission."""
    path = tmp_path / "docker-compose.yaml"
    path.write_text("services: {}\n", encoding="utf-8")
    folder = Folder(tmp_path, catalog)
    folder.put(path, "services: {}\n")
    assert folder.check(path) == ()
    assert folder.survey() == {}


def test_a_scenario_is_no_mission(folder: Folder) -> None:
    """Though it names one with the same key."""
    path = folder.path / "first.scenario.yaml"
    folder.put(path, "scenario: something\nmission: inspection\n")
    assert folder.kind(path) is None
    assert folder.check(path) == ()
