"""What authors have written goes on working: projects of older engines, and `lupin upgrade`."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pytest

from lupin_cli.edits import PlacedEdit, edited, first_key, key_after, list_edits
from lupin_cli.main import main
from lupin_engine.chart import strictness as rows
from lupin_engine.chart.findings import RULES, Findings
from lupin_engine.chart.source import parse_bytes
from lupin_engine.chart.strictness import STRICTER
from lupin_engine.errors import Place, Severity
from lupin_engine.machine.event import Command
from lupin_engine.machine.step import Step
from lupin_engine.missions.load import check_chart, forget
from lupin_engine.plugin.profile import Publish
from lupin_engine.plugin.registry import Catalog, load_catalog
from lupin_engine.sim.scenario import load_scenario, scenario_files

ROOT = Path(__file__).parents[3]
OLD = ROOT / "tests" / "old_projects"
PROJECTS = sorted(path for path in OLD.iterdir() if path.is_dir())
MINI = ROOT / "tests" / "charts" / "mini" / "lifecycle.yaml"

MISSION = """\
mission: M
states:
  WAITING:
    after: {1 s: done}
  done: {type: final}
"""
SCENARIO = "scenario: it ends\nmission: m\nexpect: {passes: [WAITING, done]}\n"


@pytest.fixture
def catalog() -> Catalog:
    """The installed plugins."""
    return load_catalog()


@pytest.fixture(params=PROJECTS, ids=lambda path: path.name)
def project(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Copy an old project, and go there."""
    old: Path = request.param
    copy = tmp_path / old.name
    shutil.copytree(old, copy)
    monkeypatch.chdir(copy)
    return copy


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make a project of one mission, and go there."""
    (tmp_path / "missions").mkdir()
    (tmp_path / "scenarios").mkdir()
    shutil.copy(MINI, tmp_path / "missions")
    (tmp_path / "missions" / "m.yaml").write_text(MISSION)
    (tmp_path / "scenarios" / "m.scenario.yaml").write_text(SCENARIO)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def later() -> Iterator[None]:
    """Be an engine that was released after every row's 90 days."""
    forget()
    with rows.as_of("2027-12-31"):
        yield
    forget()


def said(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str]:
    """Run a command; return its exit code, and what it says."""
    code = main(list(words))
    told = capsys.readouterr()
    return code, told.out + told.err


def dated(catalog: Catalog, project: Path) -> list[str]:
    """Return the rows that files of a project break."""
    missions = sorted((project / "missions").glob("*.yaml"))
    lifecycle = project / "missions" / "lifecycle.yaml"
    _, found = check_chart(lifecycle, [one for one in missions if one != lifecycle], catalog)
    scenarios = (load_scenario(file, catalog) for file in scenario_files([project / "scenarios"]))
    told = [
        (one, scenario)
        for scenario in scenarios
        for one in (*scenario.warnings, *scenario.dated(scenario.run()))
    ]
    return [one.stricter for one in (*found, *(one for one, _ in told)) if one.stricter]


# -- projects of older engines -------------------------------------------------------------------------------


@pytest.mark.slow
def test_an_old_project_works_and_says_what_is_dated(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing is refused, every scenario holds; the texts and the diff are those beside the project."""
    told = []
    for words in (["check"], ["test", "-q"], ["upgrade"]):
        code, text = said(capsys, *words)
        assert code == 0, text
        told.append(f"$ lupin {' '.join(words)}\n{text.replace(f'{project}/', '')}")
    beside = OLD / f"{project.name}.txt"
    if os.environ.get("ACCEPT"):
        beside.write_text("\n".join(told), encoding="utf-8")
    assert "\n".join(told) == beside.read_text(encoding="utf-8")


@pytest.mark.slow
def test_an_upgraded_project_is_clean_and_does_the_same(
    project: Path, catalog: Catalog, capsys: pytest.CaptureFixture[str], later: None
) -> None:
    """No row is broken any more, also for an engine that warns no longer; nothing is left to upgrade."""
    assert said(capsys, "upgrade", "--write")[0] == 0
    assert dated(catalog, project) == []
    assert said(capsys, "check")[0] == 0
    assert said(capsys, "test", "-q")[1].splitlines()[-1].endswith("scenarios: all hold")
    before = {path: path.read_bytes() for path in project.rglob("*.yaml")}
    code, text = said(capsys, "upgrade", "--write")
    assert (code, text[:18]) == (0, "nothing to upgrade")
    assert {path: path.read_bytes() for path in project.rglob("*.yaml")} == before


def _orders(step: Step) -> tuple[Command, ...]:
    return tuple(command for command in step.commands if not isinstance(command, Publish))


def steps(project: Path, catalog: Catalog) -> dict[str, list[Any]]:
    """Return what happens in each scenario, without outcomes of targets."""
    found = {}
    for file in scenario_files([project / "scenarios"]):
        run = load_scenario(file, catalog).run()
        found[file.name] = [
            (step.time, step.event.name, step.exited, step.entered, step.configuration, _orders(step))
            for step in run.steps
        ]
    return found


@pytest.mark.slow
def test_an_upgraded_project_takes_the_same_steps(
    project: Path, catalog: Catalog, capsys: pytest.CaptureFixture[str]
) -> None:
    """States, times and commands are those of before; what FAULT publishes now is all that differs."""
    before = steps(project, catalog)
    assert said(capsys, "upgrade", "--write")[0] == 0
    forget()
    assert steps(project, catalog) == before


@pytest.mark.slow
def test_an_old_mission_is_proven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What the checker only warns of breaks no property."""
    shutil.copytree(OLD / "2026-11-21_tags", tmp_path / "p")
    monkeypatch.chdir(tmp_path / "p")
    code, text = said(capsys, "prove", "corners", "--budget", "200 s", "-j", "1")
    assert (code, "CornersMission: proven;" in text) == (0, True)


def test_comments_and_layout_stay(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Every line of before is there after it, but for those that were changed in place."""
    copy = tmp_path / "p"
    shutil.copytree(OLD / "2026-11-22_rounds", copy)
    old = (copy / "missions" / "lifecycle.yaml").read_text().splitlines()
    assert said(capsys, "upgrade", str(copy), "--write")[0] == 0
    new = (copy / "missions" / "lifecycle.yaml").read_text().splitlines()
    assert [line for line in new if line in old] == old
    assert [line.strip() for line in new if line not in old] == [
        "mission_failed: {label: mission failed, severity: error}",
        "entry:",
        "- itinerary.close_rest: {status: SKIPPED, code: mission_failed}",
        "on_error: {}",
    ]


# -- the table -----------------------------------------------------------------------------------------------


def test_a_row_warns_for_90_days() -> None:
    """The dates of a row agree, its rule is one, and what is refused at once says why."""
    for name, row in STRICTER.items():
        days = 0 if row.at_once else 90
        assert date.fromisoformat(row.refused) == date.fromisoformat(row.since) + timedelta(days), name
        assert row.rule in RULES, name
        assert not (row.at_once and row.upgrades), name


def test_the_release_day_of_an_engine_decides() -> None:
    """A warning until then; the same text without the date as an error."""
    words = (
        "wait-in-fault",
        Place("lifecycle.yaml", 1, 1),
        "FAULT",
        "nothing follows",
        "add 'on_error: STATE'",
    )
    with rows.as_of("2027-02-20"):
        before = rows.stricter(*words)
    with rows.as_of("2027-02-21"):
        after = rows.stricter(*words)
    assert (before.severity, before.hint) == (
        Severity.WARN,
        "add 'on_error: STATE' (an error in versions from 2027-02-21 on; 'lupin upgrade' mends it)",
    )
    assert (after.severity, after.hint) == (Severity.ERROR, "add 'on_error: STATE'")


@pytest.mark.slow
def test_an_engine_of_later_refuses_an_old_project(
    later: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """After their days the warnings are errors, of missions and of scenarios; upgrade mends them still."""
    shutil.copytree(OLD / "2026-11-22_rounds", tmp_path / "p")
    monkeypatch.chdir(tmp_path / "p")
    code, text = said(capsys, "check")
    assert code == 1
    assert "error: FAULT.LATE: nothing says what follows when plugins.ready has failed; add" in text
    assert said(capsys, "test", "-q")[0] == 1


def test_every_row_is_on_the_page() -> None:
    """What is dated, and what is refused at once, stands in docs/stability.md."""
    page = (ROOT / "docs" / "stability.md").read_text(encoding="utf-8")
    for row in STRICTER.values():
        assert row.wrote in page
        assert (row.at_once or row.refused) in page


# -- lupin: 1 ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("file", ["missions/m.yaml", "missions/lifecycle.yaml", "scenarios/m.scenario.yaml"])
def test_a_file_may_name_its_version(small: Path, file: str, capsys: pytest.CaptureFixture[str]) -> None:
    """In front or behind; another version says which engine is asked for."""
    written = (small / file).read_text()
    for text in (f"lupin: 1\n{written}", f"{written}lupin: 1\n"):
        (small / file).write_text(text)
        assert said(capsys, "test", "-q") == (0, "1 scenario: all hold\n")
    for version, problem in (
        (
            "2",
            "this engine speaks version 1 of the language, and the file is of version 2; "
            "update the engine: pip install --upgrade lupin-engine",
        ),
        ("0", "this engine speaks version 1 of the language, and the file is of version 0; write 'lupin: 1'"),
        ("one", "expected the version of the language, got 'one'; write 'lupin: 1'"),
        ("true", "expected the version of the language, got true; write 'lupin: 1'"),
    ):
        (small / file).write_text(f"lupin: {version}\n{written}")
        code, text = said(capsys, "test", "-q")
        assert code == 1
        assert f"{small / file}:1:8: error: lupin: {problem} [wrong-shape]".replace(
            f"{small}/", ""
        ) in text.replace(f"{small}/", "")


# -- lupin upgrade -------------------------------------------------------------------------------------------


def test_nothing_to_do_is_said(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With what was looked at; also as JSON."""
    assert said(capsys, "upgrade") == (0, "nothing to upgrade in 1 mission and 1 scenario\n")
    code, text = said(capsys, "upgrade", "--json")
    assert (code, json.loads(text)) == (0, {"written": False, "changes": [], "left": []})


def test_what_only_a_person_can_mend_is_listed(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A restart of old still means what it meant; what to write instead depends on what is to be tested."""
    file = small / "scenarios" / "m.scenario.yaml"
    file.write_text(f"{SCENARIO}when:\n  - {{on: WAITING, after: 0.5 s, restart: true}}\n")
    code, text = said(capsys, "test", "-q")
    warning = (
        "scenarios/m.scenario.yaml:5:42: warning: when.restart: expected a duration such as '5 s', got true; "
        "write 'restart: 1 s' and a resume (an error in versions from 2027-02-21 on) [wrong-shape]\n"
    )
    assert (code, text) == (0, f"{warning}1 scenario: all hold\n")
    assert said(capsys, "upgrade") == (1, f"{warning}1 finding left, which you must mend\n")


def test_a_mission_with_errors_is_left_alone(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its errors are listed with their place, and nothing of it is written."""
    (small / "missions" / "m.yaml").write_text("mission: [\n")
    (small / "scenarios" / "m.scenario.yaml").write_text("scenario: {\n")
    code, text = said(capsys, "upgrade", "--write")
    no_yaml = "2:1: error: did not find expected node content while parsing a flow node [wrong-yaml]"
    files = ("missions/m.yaml", "scenarios/m.scenario.yaml")
    listed = [f"{file}:{no_yaml}" for file in files]
    assert (code, text.splitlines()) == (1, [*listed, "2 findings left, which you must mend"])
    assert (small / files[0]).read_text() == "mission: [\n"


def test_a_scenario_that_is_no_text_is_listed(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And one whose mission is not there."""
    (small / "scenarios" / "m.scenario.yaml").write_bytes(b"scenario: \xff\n")
    (small / "scenarios" / "n.scenario.yaml").write_text(SCENARIO.replace("mission: m", "mission: nn"))
    code, text = said(capsys, "upgrade")
    assert (code, text.splitlines()) == (
        1,
        [
            "scenarios/m.scenario.yaml:1:11: error: this is not UTF-8; save the file as UTF-8 [wrong-yaml]",
            "scenarios/n.scenario.yaml:1:1: error: no mission 'nn' in missions; allowed: 'M', 'm' [no-file]",
            "2 findings left, which you must mend",
        ],
    )


def test_the_doctor_counts_what_is_dated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the first day on which something is refused, and the command."""
    shutil.copytree(OLD / "2026-11-21_tags", tmp_path / "p")
    monkeypatch.chdir(tmp_path / "p")
    said_by = json.loads(said(capsys, "doctor", "--json")[1])["findings"]
    assert [one for one in said_by if one["topic"] == "old words"] == [
        {
            "topic": "old words",
            "found": "14, refused by versions from 2027-02-19 on",
            "state": "note",
            "advice": "`lupin upgrade` shows what to change, and writes it with `--write`",
        }
    ]


def test_rights_are_listed_and_never_written(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A binding of before rights were asked for is refused at once: they are the owner's to give."""
    bindings = small / "missions" / "bindings"
    shutil.copytree(OLD / "2026-11-29_water" / "missions" / "bindings", bindings)
    code, text = said(capsys, "upgrade", "--write")
    assert code == 1
    assert (
        "missions/bindings/valve.yaml:18:21: error: operations.choose.service: it is not allowed to call the "
        "service '/valve/choose'; write /valve/choose under 'allow: services' in lupin.yaml [not-allowed]"
    ) in text
    assert not (small / "lupin.yaml").exists()


def test_wrong_uses_are_told(small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder that is none, and one without anything to upgrade; exit code 2."""
    empty = tmp_path / "empty"
    empty.mkdir()
    assert said(capsys, "upgrade", "nowhere") == (2, "lupin: 'nowhere' is no folder\n")
    assert said(capsys, "upgrade", "missions/m.yaml") == (2, "lupin: 'missions/m.yaml' is no folder\n")
    assert said(capsys, "upgrade", "empty") == (
        2,
        "lupin: there are no missions and no scenarios in 'empty'\n",
    )


def test_of_files_with_one_that_is_read_only_none_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """All or none: a project that is half upgraded is neither."""
    project = tmp_path / "p"
    shutil.copytree(OLD / "2026-11-22_rounds", project)
    monkeypatch.chdir(project)
    (project / "scenarios" / "lost.scenario.yaml").chmod(0o444)
    before = {path: path.read_bytes() for path in project.rglob("*.yaml")}
    text = "lupin: cannot write 'scenarios/lost.scenario.yaml': it is read-only; nothing was written\n"
    assert said(capsys, "upgrade", "--write") == (2, text)
    assert {path: path.read_bytes() for path in project.rglob("*.yaml")} == before


def test_the_changes_are_a_record_for_programs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each file with its rows and its diff."""
    shutil.copytree(OLD / "2026-11-23_photos", tmp_path / "p")
    monkeypatch.chdir(tmp_path / "p")
    code, text = said(capsys, "upgrade", "--json")
    record = json.loads(text)
    assert (code, record["written"], record["left"]) == (0, False, [])
    assert [(one["file"], one["rules"]) for one in record["changes"]] == [
        ("missions/stroll.yaml", ["property-name"])
    ]
    assert record["changes"][0]["diff"].startswith("--- missions/stroll.yaml (now)\n")


# -- edits ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "edit", "expected"),
    [
        ("a: 1\nb: 2\n", PlacedEdit(1, 0, "", "c: 3\n"), "a: 1\nc: 3\nb: 2\n"),
        ("a: 1\r\nb: 2\r\n", PlacedEdit(1, 0, "", "c: 3\n"), "a: 1\r\nc: 3\r\nb: 2\r\n"),
        ("a: 1", PlacedEdit(1, 0, "", "c: 3\n"), "a: 1\nc: 3\n"),
        ("a: 1\n", PlacedEdit(0, 3, "1", "1 m"), "a: 1 m\n"),
        ("a: 1\n", PlacedEdit(0, 3, "2", "1 m"), None),
    ],
)
def test_an_edit_keeps_what_is_around(text: str, edit: PlacedEdit, expected: str | None) -> None:
    """Line ends are the file's own; what does not stand there is not replaced."""
    assert edited(text, [edit]) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("s: {b: 1, c: 2}\n", "s: {a: 0, b: 1, n: 9, c: 2}\n"),
        ("s:\n  b: 1\n  c: 2\n", "s:\n  a: 0\n  b: 1\n  c: 2\n  n: 9\n"),
        (
            "s:\n  # first\n  b: 1\n  c:\n  - 2\n\n# end\n",
            "s:\n  # first\n  a: 0\n  b: 1\n  c:\n  - 2\n  n: 9\n\n# end\n",
        ),
        ("s:\n  b: 1\n  c:\n    d: 2\nt: 3\n", "s:\n  a: 0\n  b: 1\n  c:\n    d: 2\n  n: 9\nt: 3\n"),
    ],
)
def test_keys_are_written_in_the_form_that_is_there(text: str, expected: str) -> None:
    """In braces and in lines; comments and empty lines stay where they are."""
    raw = parse_bytes(text.encode(), "f.yaml", Findings())
    assert raw is not None
    assert edited(text, [first_key(raw["s"], "a: 0"), key_after(raw["s"], "c", "n: 9")]) == expected


@pytest.mark.parametrize(
    ("text", "items", "expected"),
    [
        ("l: [a b, {t: 1, u: 2}]  # as is\n", ["new", 0, 1], "l: [new, a b, {t: 1, u: 2}]  # as is\n"),
        ("l: []\n", ["x", "y"], "l: [x, y]\n"),
        ("l: ['a, b']\n", ["x"], "l: [x]\n"),
        (
            "l:\n  - a\n  - b  # last\nm: 1\n",
            [0, "x", 1, "y"],
            "l:\n  - a\n  - x\n  - b  # last\n  - y\nm: 1\n",
        ),
        ("l:\n  - a\n", ["x"], "l:\n  - a\n"),
        ("l: [a,\n  b]\n", [0, 1, "x"], "l: [a,\n  b]\n"),
    ],
)
def test_a_list_keeps_its_items(text: str, items: list[int | str], expected: str) -> None:
    """What cannot be written in its form is not written at all."""
    raw = parse_bytes(text.encode(), "f.yaml", Findings())
    assert raw is not None
    assert edited(text, list_edits(raw, "l", items)) == expected
