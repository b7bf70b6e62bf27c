"""`lupin diagram` as a person uses it; and that the kept pictures are those of the shipped missions."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from lupin_cli.main import main
from lupin_cli.verbs.diagram import FORMATS, diagram
from lupin_cli.verbs.simulate import simulate
from lupin_engine.missions.folders import default_missions_folder

ROOT = Path(__file__).parents[3]
KEPT = ROOT / "docs" / "diagrams"
ALL = "lupin diagram --all missions -o docs/diagrams"
BEGINS = {
    "mermaid": "---\ntitle: InspectionMission",
    "scxml": "<?xml",
    "svg": "<svg",
    "png": "\x89PNG",
}


def invoke(*arguments: str | Path) -> Result:
    """Call the verb."""
    return CliRunner().invoke(diagram, [str(word) for word in arguments], standalone_mode=False)


def said(capfd: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str]:
    """The exit code of the command, and what it says to the person."""
    code = main(["diagram", *map(str, arguments)])
    return code, capfd.readouterr().err


# -- kept pictures ----------------------------------------------------------------------------------------


def test_the_kept_pictures_are_those_of_the_missions(tmp_path: Path) -> None:
    """A picture that is out of date is worse than none."""
    assert invoke("--all", default_missions_folder(), "-o", tmp_path).exception is None
    written = sorted(tmp_path.iterdir())
    assert len(written) >= 3
    stale = [
        file.name
        for file in written
        if not (KEPT / file.name).is_file() or (KEPT / file.name).read_bytes() != file.read_bytes()
    ]
    if stale:
        pytest.fail(f"docs/diagrams is out of date ({', '.join(stale)}); run: {ALL}", pytrace=False)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The record of a simulated run."""
    ran = CliRunner().invoke(simulate, ["inspection", "--tags", "1,5,7", "--json"], standalone_mode=False)
    file = tmp_path_factory.mktemp("run") / "run.json"
    file.write_text(ran.stdout, encoding="utf-8")
    return file


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("inspection.svg", "--depth 2"),
        ("inspection_scanning.svg", "--focus SCANNING"),
        ("inspection_run.svg", "--focus INSPECTING --trace run.json"),
    ],
)
def test_the_pictures_of_the_texts_are_those_of_the_mission(
    name: str, options: str, run: Path, tmp_path: Path
) -> None:
    """Those of README.md and docs/diagrams.md."""
    kept, written = ROOT / "docs" / "img" / name, tmp_path / name
    arguments = [run if word == run.name else word for word in options.split()]
    assert invoke("inspection", *arguments, "-o", written).exception is None
    if not kept.is_file() or kept.read_bytes() != written.read_bytes():
        command = f"lupin diagram inspection {options} -o docs/img/{name}"
        before = "lupin simulate inspection --tags 1,5,7 --json > run.json; " if "trace" in options else ""
        pytest.fail(f"docs/img/{name} is out of date; run: {before}{command}", pytrace=False)


# -- files and formats ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("wanted", FORMATS)
def test_the_ending_of_the_file_decides_the_format(wanted: str, tmp_path: Path) -> None:
    """Or the option, which also prints."""
    file = tmp_path / f"x{FORMATS[wanted]}"
    assert invoke("inspection", "-o", file).exception is None
    assert file.read_bytes().decode("latin-1").startswith(BEGINS[wanted])
    printed = invoke("inspection", "--format", wanted)
    assert printed.exception is None
    assert printed.stdout_bytes == file.read_bytes()


def test_a_folder_of_missions_becomes_a_folder_of_pictures(tmp_path: Path) -> None:
    """In every format that is asked for, with a page that shows them."""
    folder, out = tmp_path / "missions", tmp_path / "new" / "folder"
    shutil.copytree(default_missions_folder(), folder)
    for other in set(folder.glob("*.yaml")) - {folder / "inspection.yaml", folder / "lifecycle.yaml"}:
        other.unlink()
    formats = [word for wanted in FORMATS for word in ("--format", wanted)]
    assert invoke("--all", folder, *formats, "-o", out).exception is None
    names = [f"inspection{ending}" for ending in FORMATS.values()]
    assert sorted(file.name for file in out.iterdir()) == sorted(["index.md", *names])
    assert (out / "index.md").read_text(encoding="utf-8") == (
        "# Missions\n"
        "\n"
        "Written by `lupin diagram --all`; not to be edited.\n"
        "\n"
        "## InspectionMission\n"
        "\n"
        "Visit every tag in order, read its sensors, publish what was seen, come home.\n"
        "\n"
        "![InspectionMission](inspection.svg)\n"
        "\n"
        "[Mermaid](inspection.mmd) · [SCXML](inspection.scxml)"
        " · [SVG](inspection.svg) · [PNG](inspection.png)\n"
    )


def test_a_run_colours_the_picture(run: Path, tmp_path: Path) -> None:
    """From the simulation to the picture of it."""
    file = tmp_path / "run.svg"
    steps = len(json.loads(run.read_text(encoding="utf-8"))["steps"])
    assert invoke("inspection", "--trace", run, "-o", file).exception is None
    text = file.read_text(encoding="utf-8")
    assert f">coloured by run.json: {steps} steps; pale: never visited</text>" in text
    assert ">done / close OK \u00d73</text>" in text


def test_a_record_has_several_forms(run: Path, tmp_path: Path) -> None:
    """The steps as a list, or one a line as they are logged and as `lupin run --json` tells them."""
    steps, file = json.loads(run.read_text(encoding="utf-8"))["steps"], tmp_path / "steps.json"
    lines = ["\n".join(map(json.dumps, form)) for form in (steps, [{"step": step} for step in steps])]
    for text in (json.dumps(steps), *lines):
        file.write_text(text, encoding="utf-8")
        assert invoke("inspection", "--trace", file, "-o", tmp_path / "x.svg").exception is None
        assert f">coloured by steps.json: {len(steps)} steps;" in (tmp_path / "x.svg").read_text("utf-8")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('{"steps": 3}', "x.json: expected the output of 'lupin simulate --json', or steps, one a line"),
        ('[{"event": "e", "time": 0}]', "the run in 'x.json' entered no state"),
        ('[{"event": "e", "time": 0, "entered": [1]}]', "x.json: step 1 is none: its 'entered' is not as "),
    ],
)
def test_anything_else_is_no_record(text: str, told: str, tmp_path: Path) -> None:
    """Said in one sentence."""
    file = tmp_path / "x.json"
    file.write_text(text, encoding="utf-8")
    assert str(invoke("inspection", "--trace", file, "-o", tmp_path / "x.svg").exception).startswith(told)


def test_a_large_chart_is_drawn_to_a_readable_depth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """And the person is told so; text has it all."""
    monkeypatch.setattr(sys.modules["lupin_engine.diagram.outline"], "READABLE", 16)
    file = tmp_path / "x.svg"
    assert said(capfd, "inspection", "-o", file) == (
        0,
        "lupin: drawn 2 levels deep, to be readable; --depth says how deep\n",
    )
    assert "… 9 states" in file.read_text(encoding="utf-8")
    assert said(capfd, "inspection", "-o", tmp_path / "x.mmd") == (0, "")
    assert "READING" in (tmp_path / "x.mmd").read_text(encoding="utf-8")


# -- what is refused --------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "answer"),
    [
        ((), "name a mission, or a folder of missions with --all FOLDER"),
        (
            ("inspection", "--focus", "NAVIGATNG"),
            "no state 'NAVIGATNG' in InspectionMission; did you mean 'NAVIGATING'?",
        ),
        (
            ("inspection", "-o", "x.txt"),
            "'x.txt' says no format: end it in .mmd, .scxml, .svg, .png, or add --format",
        ),
        (
            ("inspection", "-o", "x.puml"),
            "'x.puml' says no format: end it in .mmd, .scxml, .svg, .png, or add --format",
        ),
        (
            ("inspection", "-o", "x.png", "--format", "svg"),
            "'x.png' ends like png but --format says svg: leave --format out, or end the file in .svg",
        ),
        (
            ("inspection", "-o", "x.mermaid", "--format", "svg"),
            "'x.mermaid' ends like mermaid but --format says svg: leave --format out, "
            "or end the file in .svg",
        ),
        (
            ("inspection", "--format", "mermaid", "--format", "svg"),
            "one file has one format; several are for --all",
        ),
        (
            ("inspection", "--format", "scxml", "--depth", "2"),
            "SCXML is the whole chart: leave --focus, --depth and --trace out",
        ),
        (
            ("inspection", "-o", "no/such/folder.svg"),
            "cannot write 'no/such/folder.svg': No such file or directory",
        ),
        (
            ("inspekt", "--focus", "X", "-o", "x.txt", "--trace", "README.md"),
            "'x.txt' says no format: end it in .mmd, .scxml, .svg, .png, or add --format\n"
            "README.md:1: this is no JSON; 'lupin simulate MISSION --json' prints a record\n"
            "no mission 'inspekt' in missions; did you mean 'inspection'?",
        ),
        (
            ("--all", "missions"),
            "--all FOLDER needs --output FOLDER, and takes no MISSION, --focus or --trace",
        ),
    ],
)
def test_a_mistake_is_answered(
    arguments: tuple[str, ...],
    answer: str,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In one sentence, with what to do."""
    monkeypatch.chdir(ROOT)
    assert said(capfd, *arguments) == (2, f"lupin: {answer}\n")


def test_a_folder_without_missions_is_answered(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """It is probably the wrong one."""
    code, answer = said(capfd, "--all", tmp_path, "-o", tmp_path / "out")
    assert (code, answer) == (2, f"lupin: there are no missions in {str(tmp_path)!r}\n")


@pytest.mark.parametrize("ending", ["txt", "svg"])
def test_a_format_that_is_named_needs_no_ending_of_its_own(tmp_path: Path, ending: str) -> None:
    """An ending that says nothing, or the same, contradicts nothing."""
    file = tmp_path / f"x.{ending}"
    assert invoke("inspection", "--format", "svg", "-o", file).exception is None
    assert file.read_text(encoding="utf-8").startswith("<svg")


def test_a_scenario_names_the_mission_to_draw(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """It is told what was named, and what can be drawn."""
    file = tmp_path / "a.scenario.yaml"
    file.write_text("scenario: it ends\nmission: inspection\nexpect: {never: [FAULT]}\n", encoding="utf-8")
    mission = default_missions_folder() / "inspection.yaml"
    told = f"{str(file)!r} is a scenario; for a picture name the mission that it tests: {str(mission)!r}"
    assert said(capfd, file) == (2, f"lupin: {told}\n")


def test_a_folder_without_missions_leaves_nothing_behind(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """The folder for the pictures is made when there is one to put into it."""
    (tmp_path / "empty").mkdir()
    answer = said(capfd, "--all", tmp_path / "empty", "-o", tmp_path / "pictures")
    assert answer == (2, f"lupin: there are no missions in {str(tmp_path / 'empty')!r}\n")
    assert not (tmp_path / "pictures").exists()


def test_every_broken_mission_of_a_folder_is_told(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """All at once, those of their lifecycle once, and no picture is written."""
    folder = tmp_path / "missions"
    shutil.copytree(default_missions_folder(), folder)
    wrong = {"lifecycle.yaml": "lifecycl:", "inspection.yaml": "on_eror:", "exploration.yaml": "stats:"}
    for name, word in wrong.items():
        with (folder / name).open("a", encoding="utf-8") as file:
            file.write(f"\n{word} 1\n")
    code, answer = said(capfd, "--all", folder, "-o", tmp_path / "pictures")
    lines = [line for line in answer.splitlines() if "[unknown-key]" in line]
    assert code == 1
    assert [Path(line.split(":")[0]).name for line in lines] == sorted(wrong)
    assert not (tmp_path / "pictures").exists()
