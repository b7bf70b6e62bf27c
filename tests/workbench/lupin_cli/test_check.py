"""`lupin check` as people and programs see it: excerpts with carets, SARIF, annotations, watching, rules."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click
import pytest
import yaml
from click.testing import CliRunner, Result

from lupin_cli.main import main
from lupin_cli.terminal.excerpt import excerpt
from lupin_cli.terminal.findings import Checked, as_text
from lupin_cli.terminal.sarif import sarif
from lupin_cli.verbs.check import check, check_paths, watch_paths
from lupin_cli.watch import changes
from lupin_engine.chart.findings import RULES
from lupin_engine.errors import Diagnostic, Place, Severity
from lupin_engine.missions.folders import LIFECYCLE as LIFECYCLE_FILE
from lupin_engine.missions.folders import MAX_BYTES, MAX_FILES, default_missions_folder
from lupin_engine.missions.load import check_chart
from lupin_engine.plugin.registry import load_catalog

ROOT = Path(__file__).parents[3]
HERE = Path(__file__).parent
MINI = ROOT / "tests" / "charts" / "mini" / LIFECYCLE_FILE

LIFECYCLE = """\
lifecycle: L
states:
  A:
    slot: mission
    on_done: A
"""
BROKEN = """\
mission: M
states:
  WAITING:
    after: {1: done}
  done: {type: final}
"""
RIGHT = BROKEN.replace("{1:", "{1 s:")
#: It is loaded, in the mini lifecycle, but a property is broken that no test looks at.
NEVER = RIGHT.replace("states:", "initial: WAITING\nproperties:\n  stays: {never: in_state('NEXT')}\nstates:")
NEVER = NEVER.replace("{1 s: done}", "{1 s: NEXT}\n  NEXT:\n    after: {1 s: done}")
AFTER_A_SECOND = (
    "MISSION.M.WAITING.after.0: property stays (line 4): in_state('NEXT') became true; it must never be;"
    " lupin prove m.yaml tells how it comes to that [broken-property]\n"
)
#: It is loaded, with a warning.
ODD = RIGHT.replace("states:", "codes:\n  lost: {label: lost}\nstates:")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with a lifecycle and a mission with one mistake."""
    (tmp_path / "lifecycle.yaml").write_text(LIFECYCLE)
    (tmp_path / "m.yaml").write_text(BROKEN)
    monkeypatch.chdir(tmp_path)
    for name in ("NO_COLOR", "FORCE_COLOR", "COLUMNS"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path


def typed(*arguments: str) -> Result:
    """Return what the verb prints; its return value is its exit code."""
    result = CliRunner().invoke(check, arguments, standalone_mode=False)
    assert result.exception is None, result.exception
    return result


# -- excerpts ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "column", "shown", "carets"),
    [
        ("    after: {1: done}", 13, "    after: {1: done}", "            ^"),
        ("  on_error: FALT", 13, "  on_error: FALT", "            ^^^^"),
        ("  do: nav.go_too, with: x", 7, "  do: nav.go_too, with: x", "      ^^^^^^^^^^"),
        ("guard: \"a 'b' c\" ", 8, "guard: \"a 'b' c\"", "       ^^^^^^^^^"),
        ("\tkey:\tvalue", 7, "        key:    value", "                ^^^^^"),
        ("名前: 温室 x", 5, "名前: 温室 x", "      ^^^^"),
        ("name: é́x", 9, "name: é́x", "       ^"),
        ("name: \x1b[31mred", 7, "name: \N{REPLACEMENT CHARACTER}[31mred", "      ^"),
        ("key:", 5, "key:", "    ^"),
    ],
    ids=["key", "word", "path", "quoted", "tab", "wide", "combining", "control", "end"],
)
def test_carets_stand_under_the_place(line: str, column: int, shown: str, carets: str) -> None:
    """As many as the word has cells, wherever the terminal puts it."""
    assert excerpt(line, column, 80) == (shown, carets)


@pytest.mark.parametrize(
    ("column", "shown", "carets"),
    [
        (1, "word00 word01 word02 word03 word04...", "^^^^^^"),
        (71, "...d08 word09 word10 word11 word12 wo...", "              ^^^^^^"),
        (134, "...word15 word16 word17 word18 word19", "                               ^^^^^^"),
    ],
    ids=["begin", "middle", "end"],
)
def test_long_lines_are_cut_around_the_place(column: int, shown: str, carets: str) -> None:
    """Never wider than there is room."""
    found, under = excerpt(" ".join(f"word{number:02}" for number in range(20)), column, 40)
    assert (found, under) == (shown, carets)
    assert max(len(found), len(under)) <= 40


@pytest.mark.parametrize("width", range(1, 60, 7))
@pytest.mark.parametrize("column", range(1, 140, 9))
def test_an_excerpt_shows_its_place_in_any_width(width: int, column: int) -> None:
    """What stands at the column stands over the first caret."""
    line = " ".join(f"w{number:03}" for number in range(28))
    shown, carets = excerpt(line, column, width)
    assert shown[carets.index("^")] == line[column - 1]
    assert len(shown) <= max(width, 7)


# -- for people -------------------------------------------------------------------------------------------

TEXT = """\
m.yaml:4:13: error: A.M.WAITING.after.0: expected duration (s), got '1'; write '1 s' [no-unit]
    4 |     after: {1: done}
      |             ^
1 mission, 1 error, no warnings
"""


def test_a_finding_is_shown_with_its_line(folder: Path) -> None:
    """Place and problem in one line, which editors can jump to; below it the source."""
    result = typed("m.yaml")
    assert (result.return_value, result.output) == (1, TEXT)


def test_colours_are_for_terminals(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And for those who insist; never for those who decline."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    coloured = typed("m.yaml").output
    assert click.unstyle(coloured) == TEXT
    assert "\x1b[31m\x1b[1merror\x1b[0m" in coloured
    monkeypatch.setenv("NO_COLOR", "1")
    assert typed("m.yaml").output == TEXT


def test_a_place_without_a_line_has_no_excerpt() -> None:
    """A file that is not there, or is shorter now."""
    found = (Diagnostic(Place("absent.yaml", 1, 1), "no-file", "", "cannot read the file"),)
    text = click.unstyle(as_text(Checked(1, found)))
    assert text == ("absent.yaml:1:1: error: cannot read the file [no-file]\n1 mission, 1 error, no warnings")


@pytest.mark.parametrize(("strict", "code"), [(False, 0), (True, 1)])
def test_warnings_count_for_the_strict(strict: bool, code: int, folder: Path) -> None:
    """Alone they are told and leave the exit code at 0."""
    (folder / "m.yaml").write_text(ODD)
    result = typed("m.yaml", *["--strict"] * strict)
    assert result.return_value == code
    assert result.output.splitlines()[-1] == "1 mission, no errors, 1 warning"


@pytest.mark.parametrize("strict", [False, True])
@pytest.mark.parametrize("form", ["text", "json", "sarif", "github"])
def test_a_warning_is_accepted_in_its_file(form: str, strict: bool, folder: Path) -> None:
    """It is listed with the reason, and counts for nobody."""
    (folder / "m.yaml").write_text(ODD)
    (warning,) = json.loads(typed("m.yaml", "--json").output)
    lines = ODD.splitlines(keepends=True)
    lines.insert(warning["line"] - 1, f"  # accept {warning['rule']}: tried out\n")
    (folder / "m.yaml").write_text("".join(lines))
    result = typed("m.yaml", *["--strict"] * strict, *[f"--{form}"] * (form != "text"))
    assert result.return_value == 0
    assert "accepted: tried out" in result.output
    marks = {
        "text": ": note: ",
        "json": '"severity": "note"',
        "sarif": '"level": "note"',
        "github": "::notice ",
    }
    assert marks[form] in result.output
    if form == "text":
        assert result.output.splitlines()[-1] == "1 mission, no errors, no warnings, 1 accepted"


def test_several_paths_are_checked_at_once(folder: Path) -> None:
    """What is named twice is told once."""
    (folder / "n.yaml").write_text(BROKEN.replace("mission: M", "mission: N"))
    result = typed("m.yaml", "n.yaml", ".", "inspection")
    places = [line.partition(" ")[0] for line in result.output.splitlines() if ": error: " in line]
    assert places == ["m.yaml:4:13:", "n.yaml:4:13:"]
    assert result.output.splitlines()[-1] == "3 missions, 2 errors, no warnings"


def test_a_mission_that_stands_alone_gets_the_shipped_lifecycle(folder: Path) -> None:
    """As when it is simulated or run."""
    (folder / "lifecycle.yaml").unlink()
    assert typed("m.yaml").output.splitlines()[0].startswith("m.yaml:4:13: error: MISSION.M.WAITING.after.0")


def test_the_missions_of_this_folder_come_before_the_shipped_ones(folder: Path) -> None:
    """Without a path, and by name: what an author has in the folder `missions` is what is meant."""
    own = folder / "missions"
    own.mkdir()
    for file in ("lifecycle.yaml", "m.yaml"):
        (folder / file).rename(own / file)
    for arguments in ((), ("m",), ("M",)):
        result = typed(*arguments)
        assert result.output.startswith("missions/m.yaml:4:13: error: ")
        assert result.output.splitlines()[-1] == "1 mission, 1 error, no warnings"
    assert typed("inspection").output == "1 mission, no errors, no warnings\n"


def test_missions_without_a_lifecycle_are_in_the_shipped_one(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One rule for every verb: by name, by file, by folder, and when nothing is named."""
    (folder / "lifecycle.yaml").unlink()
    own = folder / "missions"
    own.mkdir()
    (own / "mine.yaml").write_text(RIGHT.replace("mission: M", "mission: Mine"))
    (folder / "m.yaml").unlink()
    for arguments in ((), ("mine",), ("Mine",), ("missions",), ("missions/mine.yaml",)):
        assert typed(*arguments).output == "1 mission, no errors, no warnings\n", arguments
    (folder / "x.scenario.yaml").write_text("scenario: it ends\nmission: mine\nexpect: {never: [FAULT]}\n")
    for command in (
        ["simulate", "mine", "-q"],
        ["diagram", "mine", "-o", "mine.svg"],
        ["diagram", "--all", "missions", "-o", "pictures"],
        ["test", "x.scenario.yaml"],
        ["new", "other", "--like", "mine"],
    ):
        assert main(command) == 0, capsys.readouterr()


def test_a_folder_without_missions_is_wrong_usage(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As for the other verbs; the folder above the missions is named often."""
    (folder / "empty" / "missions").mkdir(parents=True)
    assert main(["check", "empty/missions"]) == 2
    assert capsys.readouterr().err == "lupin: there are no missions in 'empty/missions'\n"
    assert main(["check", "empty"]) == 2
    assert capsys.readouterr().err.endswith("in 'empty'; did you mean 'empty/missions'?\n")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["none.yaml"], "no mission file 'none.yaml'"),
        (["inspektion"], "did you mean 'inspection'?"),
        (["--explain", "no-unitt"], "no rule 'no-unitt'; did you mean 'no-unit'?"),
        (["a.scenario.yaml"], "'a.scenario.yaml' is a scenario; scenarios are read by lupin test"),
        (
            ["--json", "--sarif", "m.yaml"],
            "lupin: --json and --sarif are different forms of the same findings; use one of them\n",
        ),
        (
            ["--github", "--watch", "--json"],
            "lupin: --json and --github are different forms of the same findings; use one of them\n"
            "--watch is for people and --json and --github for programs; use one of them\n",
        ),
        (["--watch", "--json", "m.yaml"], "--watch is for people and --json for programs; use one of them"),
        (
            ["none.yaml", "m.yaml", "a.scenario.yaml"],
            "lupin: no mission file 'none.yaml'; did you mean 'm.yaml'?\n"
            "'a.scenario.yaml' is a scenario; scenarios are read by lupin test\n",
        ),
        (["--jsn"], "No such option"),
    ],
)
def test_wrong_usage_is_told(
    arguments: list[str], told: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2, one sentence."""
    assert main(["check", *arguments]) == 2
    assert told in capsys.readouterr().err


# -- for programs -----------------------------------------------------------------------------------------


def test_json_has_the_line_too(folder: Path) -> None:
    """All that the text says."""
    assert json.loads(typed("--json", "m.yaml").output) == [
        {
            "file": "m.yaml",
            "line": 4,
            "column": 13,
            "severity": "error",
            "rule": "no-unit",
            "path": "A.M.WAITING.after.0",
            "problem": "expected duration (s), got '1'",
            "hint": "write '1 s'",
            "source": "    after: {1: done}",
        }
    ]


@pytest.fixture(scope="module")
def is_sarif() -> Callable[[Any], None]:
    """What raises when something is no SARIF 2.1.0."""
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads((HERE / "data" / "sarif-2.1.0.json").read_text(encoding="utf-8"))
    validator = jsonschema.Draft4Validator(schema)
    return validator.validate  # type: ignore[no-any-return]


def test_sarif_is_what_the_schema_asks_for(folder: Path, is_sarif: Callable[[Any], None]) -> None:
    """With rule, region, snippet and the place in the chart."""
    log = json.loads(typed("--sarif", "m.yaml").output)
    is_sarif(log)
    (run,) = log["runs"]
    (result,) = run["results"]
    assert run["tool"]["driver"]["rules"][result["ruleIndex"]]["id"] == result["ruleId"] == "no-unit"
    assert result["level"] == "error"
    assert result["message"]["text"] == "expected duration (s), got '1'; write '1 s'"
    (location,) = result["locations"]
    assert location["logicalLocations"] == [{"fullyQualifiedName": "A.M.WAITING.after.0"}]
    assert location["physicalLocation"] == {
        "artifactLocation": {"uri": "m.yaml"},
        "region": {
            "startLine": 4,
            "startColumn": 13,
            "endColumn": 14,
            "snippet": {"text": "    after: {1: done}"},
        },
    }


@pytest.mark.slow
def test_every_broken_mission_can_be_told_as_sarif(is_sarif: Callable[[Any], None]) -> None:
    """Whatever the findings and the letters are; and the files have addresses that work anywhere."""
    charts, catalog = ROOT / "tests" / "charts", load_catalog()
    found: list[Diagnostic] = []
    for file in sorted((charts / "broken").glob("*.yaml")):
        found += check_chart(charts / "mini" / LIFECYCLE_FILE, [file], catalog)[1]
    # One of each rule: holding all of them against the schema takes seconds, and they differ in words only.
    found = list({diagnostic.rule: diagnostic for diagnostic in found}.values())
    log = json.loads(sarif([*found, Diagnostic(Place("a b/ü.yaml", 1, 1), "no-file", "", "x")], ROOT))
    is_sarif(log)
    places = [result["locations"][0]["physicalLocation"] for result in log["runs"][0]["results"]]
    uris = {place["artifactLocation"]["uri"] for place in places}
    files = {Path(diagnostic.place.file).relative_to(ROOT).as_posix() for diagnostic in found}
    assert uris == files | {"a%20b/%C3%BC.yaml"}
    assert (
        sarif([Diagnostic(Place("/x/y.yaml", 1, 1), "no-file", "", "x")], ROOT).count("file:///x/y.yaml") == 1
    )


def test_no_findings_are_sarif_too(is_sarif: Callable[[Any], None]) -> None:
    """CI uploads it all the same, so that old findings are closed."""
    result = typed("--sarif")
    assert result.return_value == 0
    log = json.loads(result.output)
    is_sarif(log)
    assert log["runs"][0]["results"] == []


def test_annotations_of_a_workflow(folder: Path) -> None:
    """One command a line; what would end a part of it is written otherwise."""
    assert typed("--github", "m.yaml").output == (
        "::error file=m.yaml,line=4,col=13,title=no-unit::"
        "A.M.WAITING.after.0: expected duration (s), got '1'; write '1 s' [no-unit]\n"
    )
    (folder / "m.yaml").write_text(RIGHT)
    assert typed("--github", "m.yaml").output == ""
    file = folder / "a,b:100%.yaml"
    file.write_text(BROKEN)
    assert "file=a%2Cb%3A100%25.yaml,line=4" in typed("--github", file.name).output


def test_what_a_proof_finds_is_annotated(folder: Path) -> None:
    """At the transition that breaks a property; how far was looked is told beside the findings."""
    (folder / "m.yaml").write_text(NEVER)
    shutil.copy(MINI, folder)
    result = typed("--github", "--prove", "30 s", "m.yaml")
    assert result.return_value == 1
    assert result.stdout == (
        f"::error file=m.yaml,line=7,col=18,title=broken-property::{AFTER_A_SECOND}".replace("%", "%25")
    )
    assert result.stderr.startswith("M: ")
    found = json.loads(typed("--json", "--prove", "30 s", "m.yaml").stdout)
    assert [(one["line"], one["column"], one["rule"]) for one in found] == [(7, 18, "broken-property")]


# -- rules ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rule", RULES)
def test_every_rule_is_explained(rule: str) -> None:
    """What it protects, and something that breaks it."""
    text = typed("--explain", rule).output
    assert text.startswith(f"{rule}  (")
    assert f"{RULES[rule][1:]}." in text.replace("`", "")
    assert f"[{rule}]" in text


def test_the_installed_package_explains_rules_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the page there is still the sentence."""
    monkeypatch.setattr("lupin_cli.terminal.rule_page._page", lambda: None)
    assert typed("--explain", "no-unit").output == (
        "no-unit  (Types, units and expressions)\n\nA duration, length or angle says its unit.\n"
    )


# -- watching ---------------------------------------------------------------------------------------------


def turns(*acts: Callable[[], Any]) -> Callable[[], None]:
    """Return a wait in which one thing happens each time, and at last Ctrl-C."""
    waiting: Iterator[Callable[[], Any]] = iter(acts)

    def wait() -> None:
        act = next(waiting, None)
        if act is None:
            raise KeyboardInterrupt
        act()

    return wait


def write(file: Path, text: str, moment: int) -> Callable[[], None]:
    """Return what writes a file, which then has a stamp of its own."""

    def act() -> None:
        file.write_text(text)
        os.utime(file, ns=(moment, moment))

    return act


WATCHED = """\
m.yaml:4:13: error: A.M.WAITING.after.0: expected duration (s), got '1'; write '1 s' [no-unit]
    4 |     after: {1: done}
      |             ^
1 mission, 1 error, no warnings
12:00:01  watching 2 files; Ctrl-C ends
1 mission, no errors, no warnings
12:00:02  watching 2 files; Ctrl-C ends
no mission file 'm.yaml'
12:00:03  watching 1 file; Ctrl-C ends
1 mission, no errors, no warnings
12:00:04  watching 2 files; Ctrl-C ends

"""


def test_watching_checks_again_when_something_changed(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Once for each change of what the files say; files may come and go; Ctrl-C ends it."""
    file = folder / "m.yaml"
    wait = turns(
        write(file, RIGHT, 1_000_000_001),
        lambda: None,
        write(file, RIGHT, 1_000_000_002),  # saved again, with nothing new in it
        file.unlink,
        write(file, RIGHT, 1_000_000_003),
    )
    ticks = iter(range(1, 99))
    assert watch_paths(["m.yaml"], wait=wait, clock=lambda: f"12:00:{next(ticks):02}") == 0
    assert capsys.readouterr().out == WATCHED


def test_watching_nothing_is_wrong_usage(folder: Path) -> None:
    """What does not exist at the beginning was mistyped."""
    with pytest.raises(Exception, match="no mission file"):
        watch_paths(["none.yaml"], wait=turns())


def test_a_file_that_goes_away_meanwhile_is_no_failure(tmp_path: Path) -> None:
    """Editors replace files: for a moment there is none."""
    present, absent = tmp_path / "a.yaml", tmp_path / "b.yaml"
    present.write_text("a")
    looks = changes(lambda: [present, absent], turns(write(absent, "b", 5), absent.unlink))
    assert [next(looks), next(looks), next(looks)] == [None, None, None]
    with pytest.raises(KeyboardInterrupt):
        next(looks)


# -- how fast, and where else -----------------------------------------------------------------------------

#: Each of these would cost more than a check may; numpy comes with a plugin's geometry.
NEEDLESS = ("numpy", "rich", "structlog", "transitions", "rclpy", "asyncio", "matplotlib", "readline")
NEEDLESS_ROOMS = ("machine", "runtime", "diagram", "ros", "editor", "verify")


def test_a_check_imports_what_it_needs() -> None:
    """From a cold start it has 0.3 s, and nearly all of that are imports."""
    program = (
        "import sys; from lupin_cli.main import main; main(['check', 'inspection']); "
        "print(*sorted(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.splitlines()[-1].split())
    assert loaded & {*NEEDLESS, *(f"lupin_engine.{room}" for room in NEEDLESS_ROOMS)} == set()
    # Nor does pydantic go through all packages for plugins of its own.
    assert "lupin_cli.terminal.excerpt" in loaded
    assert "lupin_cli.terminal.sarif" not in loaded


def test_pydantic_looks_for_no_plugins(monkeypatch: pytest.MonkeyPatch) -> None:
    """It would read the metadata of every installed package."""
    program = "import lupin_cli.main, os; print(os.environ['PYDANTIC_DISABLE_PLUGINS'])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "__all__"


def test_the_hook_of_pre_commit_checks(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its entry is this verb; it looks at missions, not at scenarios."""
    hooks = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))
    for hook in hooks:
        assert {"id", "name", "entry", "language"} <= set(hook)
        name, *words = shlex.split(hook["entry"])
        assert name == "lupin"
        assert main([*words, "m.yaml", "lifecycle.yaml"]) == 1
        assert capsys.readouterr().out == TEXT
    (folder / "m.yaml").write_text(NEVER)
    shutil.copy(MINI, folder)
    assert [main([*shlex.split(hook["entry"])[1:], "m.yaml", "lifecycle.yaml"]) for hook in hooks] == [0, 1]
    assert f"m.yaml:7:18: error: {AFTER_A_SECOND}" in capsys.readouterr().out


def test_severities_are_counted() -> None:
    """An error is wrong for everybody, a warning for the strict."""
    place = Place("a.yaml", 1, 1)
    warning = Diagnostic(place, "unused-code", "", "odd", severity=Severity.WARN)
    error = Diagnostic(place, "no-unit", "", "wrong")
    assert [Checked(1, found).exit_code(False) for found in ((), (warning,), (error,))] == [0, 0, 1]
    assert [Checked(1, found).exit_code(True) for found in ((), (warning,), (error,))] == [0, 1, 1]


def test_the_shipped_missions_are_right_for_the_strict() -> None:
    """They are what authors learn from."""
    assert check_paths([default_missions_folder()], strict=True) == 0


READING = """\
mission: M
codes: {slow: {label: reading took too long}}
states:
  A:
    invoke: {do: bridge.read_tag, with: {tag_id: "1"}, timeout: {after: 5 s, code: slow}}
    on_done:
      - {target: done, guard: "event.reading['temperature'] > 30"}
      - {target: done, guard: "event.reading.readings['temperature'].value > 30"}
      - {target: done, guard: "readings['temperature'] > 30"}
      - {target: done, guard: "known(event.reading['temperature']) and
            event.reading['temperature'] > '30 °C'"}
      - target: done
    on_error: done
  done: {type: final}
"""


def test_a_reading_by_its_name_leads_to_what_works(tmp_path: Path) -> None:
    """However it is tried; the last guard is what is said to write."""
    (tmp_path / "m.yaml").write_text(READING)
    _, found = check_chart(default_missions_folder() / LIFECYCLE_FILE, [tmp_path / "m.yaml"], load_catalog())
    write = "write the number with its unit as a text, such as '5 °C'"
    declare = "Or declare it under context: 'readings: {type: ..., default: ...}'"
    assert [(d.place.line, d.problem, d.hint) for d in found] == [
        (7, "cannot compare number in °C with a plain number", write),
        (8, "\"event.reading.readings['temperature']\" is number in °C, no record", ""),
        (9, "unknown name 'readings'", f"did you mean 'event.reading.readings'? {declare}"),
    ]


@pytest.mark.parametrize(("words", "looks"), [(["missions"], False), (["--explain", "no-unit", "-w"], True)])
def test_a_process_that_ends_at_once_looks_for_no_garbage(
    words: list[str], looks: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would take a twentieth of its time; one that watches goes on looking."""
    asked: list[str] = []
    monkeypatch.setattr("gc.disable", lambda: asked.append("disable"))
    monkeypatch.setattr("sys.argv", ["lupin", "check", *words])
    assert main() == 0
    assert (asked == []) is looks


@pytest.mark.parametrize(("verb", "code"), [("check", 1), ("up", 2)])
def test_a_folder_that_no_orchestrator_would_take_is_refused(
    verb: str, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the words of the orchestrator, before anything is read or started."""
    folder = tmp_path / "missions"
    folder.mkdir()
    monkeypatch.chdir(tmp_path)
    (folder / "large.yaml").write_text("mission: Large\n" + "#" * MAX_BYTES)
    (folder / "m0.yaml").write_text("mission: M0\n")
    assert main([verb]) == code
    large = (folder / "large.yaml").stat().st_size
    assert capsys.readouterr().err == (
        f"lupin: the missions and parts in missions have {large + 12} bytes; at most {MAX_BYTES} are read; "
        f"the largest is large.yaml with {large}\n"
    )
    for number in range(1, MAX_FILES):
        (folder / f"m{number}.yaml").write_text(f"mission: M{number}\n")
    assert main([verb]) == code
    assert capsys.readouterr().err == (
        "lupin: 201 missions in missions; at most 200 are offered: "
        "name some with -p missions:=[NAME, ...], or move others elsewhere\n"
    )
