"""`lupin plugin`: what is installed, what it offers, whether it keeps the contract, and new ones."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_harness.rules import RULES
from tests.workbench.lupin_cli.test_main import HEAVY

VERBS = ("list", "show", "check", "new")


@pytest.fixture(autouse=True)
def wide(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Be in a folder of our own, with a terminal that breaks no line."""
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Call `lupin plugin`; return exit code, output and errors."""
    code = main(["plugin", *arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


@pytest.mark.parametrize("verb", VERBS)
def test_help_imports_nothing_heavy(verb: str) -> None:
    """It must answer at once."""
    program = (
        f"import sys; from lupin_cli.main import main; code = main(['plugin', {verb!r}, '--help']); "
        f"print('HEAVY', code, sorted(set({HEAVY!r}) & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "HEAVY 0 []"
    assert done.stdout.startswith(f"Usage: lupin plugin {verb} ")


# -- list --------------------------------------------------------------------------------------------------


def test_the_list_says_who_brought_what(capsys: pytest.CaptureFixture[str]) -> None:
    """As a table for people."""
    code, out, _ = run(capsys, "list")
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert code == 0
    assert "bridge Sensor readings at the tags of the greenhouse. 1 lupin-engine 0.1.0" in lines


def test_the_list_for_programs(capsys: pytest.CaptureFixture[str]) -> None:
    """With what the table leaves out."""
    code, out, _ = run(capsys, "list", "--json")
    (bridge,) = (row for row in json.loads(out) if row["name"] == "bridge")
    assert code == 0
    assert bridge == {
        "name": "bridge",
        "doc": "Sensor readings at the tags of the greenhouse.",
        "operations": 1,
        "distribution": "lupin-engine",
        "version": "0.1.0",
        "entry_point": "lupin_bridge.catalog:PLUGIN",
        "problem": "",
    }


def test_a_plugin_that_is_refused_is_listed_with_the_reason(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The others are listed all the same; the exit code tells."""
    (tmp_path / "far-1.2.dist-info").mkdir()
    (tmp_path / "far-1.2.dist-info" / "METADATA").write_text("Name: far\nVersion: 1.2\n")
    (tmp_path / "far-1.2.dist-info" / "entry_points.txt").write_text("[lupin.plugins]\nfar = far:PLUGIN\n")
    monkeypatch.syspath_prepend(tmp_path)
    code, out, _ = run(capsys, "list")
    assert code == 1
    reason = (
        "plugin 'far' (far:PLUGIN of far 1.2) cannot be imported: ModuleNotFoundError: No module named 'far'"
    )
    assert reason in " ".join(out.split())
    assert "Sensor readings" in out


def test_two_packages_with_a_plugin_of_one_name(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Neither is taken by chance, whoever asks; the text says what to do."""
    for package in ("one_lamp", "other_lamp"):
        (tmp_path / f"{package}.py").write_text(
            "from lupin_engine.plugin.contract import Plugin\nPLUGIN = Plugin('lamp', 'A lamp.')\n"
        )
        (tmp_path / f"{package}-1.dist-info").mkdir()
        entry = tmp_path / f"{package}-1.dist-info" / "entry_points.txt"
        entry.write_text(f"[lupin.plugins]\nlamp = {package}:PLUGIN\n")
        entry.with_name("METADATA").write_text(f"Name: {package.replace('_', '-')}\nVersion: 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    offers = "one_lamp:PLUGIN of one-lamp 1 and other_lamp:PLUGIN of other-lamp 1"
    problem = f"plugin 'lamp' is offered more than once: {offers}; uninstall all but one"
    code, out, _ = run(capsys, "list", "--json")
    assert (code, [row["problem"] for row in json.loads(out) if row["name"] == "lamp"]) == (1, [problem] * 2)
    assert run(capsys, "show", "lamp") == (1, "", f"lupin: {problem}\n")
    code, out, _ = run(capsys, "check", "lamp", "--json")
    verdict = {"plugin": "lamp", "rule": "registered", "problems": [problem], "not_tried": ""}
    assert (code, json.loads(out)[0]) == (1, verdict)
    assert main(["simulate", "inspection"]) == 2
    assert capsys.readouterr().err == f"lupin: {problem}\n"


def test_an_old_import_path_is_told_to_its_author(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Python shows such a warning to tests only; the check shows it too."""
    (tmp_path / "old_lamp.py").write_text(
        "import lupin_engine.harness.rules\n"
        "from lupin_engine.plugin.contract import Plugin\nPLUGIN = Plugin('lamp', 'A lamp.')\n"
    )
    (tmp_path / "old-1.dist-info").mkdir()
    entry = tmp_path / "old-1.dist-info" / "entry_points.txt"
    entry.write_text("[lupin.plugins]\nlamp = old_lamp:PLUGIN\n")
    entry.with_name("METADATA").write_text("Name: old\nVersion: 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    with warnings.catch_warnings(record=True) as warned:
        run(capsys, "check", "lamp")
    told = [str(each.message) for each in warned if each.filename.endswith("old_lamp.py")]
    assert told[-1] == "lupin_engine.harness.rules is now lupin_harness.rules: import that"


# -- show --------------------------------------------------------------------------------------------------


def test_a_plugin_is_shown_as_missions_see_it(capsys: pytest.CaptureFixture[str]) -> None:
    """Types with units and ranges, codes with labels, what a hold does."""
    code, out, _ = run(capsys, "show", "nav")
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert code == 0
    assert lines[1] == "lupin_nav.catalog:PLUGIN of lupin-engine 0.1.0"
    for line in (
        "nav.go_to",
        "pose pose: where to drive, in frame `map`",
        "when held cancelled, and begun again on release",
        "uses base",
        "distance(a, b)",
        "returns length in m",
        "type number, at least 0, at most 1",
        "default {x: 0, y: 0, yaw: 0}",
        "type count, at least 0, at most 100",
        "type angle in rad",
    ):
        assert line in lines
    assert any("nav_rejected (navigation goal rejected)" in line for line in lines)


def test_a_plugin_is_shown_to_programs(capsys: pytest.CaptureFixture[str]) -> None:
    """The same, kind by kind."""
    code, out, _ = run(capsys, "show", "bridge", "--json")
    shown = json.loads(out)
    assert (code, shown["name"]) == (0, "bridge")
    assert list(shown["offers"])[:2] == ["Operations", "Types"]
    assert shown["offers"]["Operations"][0]["arguments"] == [["tag_id", "text", "decimal id of the tag"]]


@pytest.mark.parametrize("verb", ["show", "check"])
def test_an_unknown_plugin_gets_the_nearest(capsys: pytest.CaptureFixture[str], verb: str) -> None:
    """One line, exit code 2."""
    assert run(capsys, verb, "bridg") == (
        2,
        "",
        "lupin: no plugin is called 'bridg'; did you mean 'bridge'?\n",
    )


# -- new ---------------------------------------------------------------------------------------------------

FILES = [
    "pyproject.toml",
    "README.md",
    "lupin_night_lamp/__init__.py",
    "lupin_night_lamp/catalog.py",
    "lupin_night_lamp/switch.py",
    "lupin_night_lamp/client.py",
    "lupin_night_lamp/node.py",
    "tests/test_contract.py",
    "tests/test_switch.py",
]


def test_a_new_plugin_is_a_package(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Named throughout; it keeps the rules as it stands."""
    code, out, _ = run(capsys, "new", "night_lamp")
    assert code == 0
    assert out.splitlines() == [
        *(f"wrote lupin-night_lamp/{file}" for file in FILES),
        "next: pip install --editable lupin-night_lamp; lupin plugin check night_lamp",
    ]
    for file in (tmp_path / "lupin-night_lamp").rglob("*.py"):
        ast.parse(file.read_text(encoding="utf-8"))
        assert "%" not in file.read_text(encoding="utf-8")
    assert "class NightLampClient(" in (tmp_path / "lupin-night_lamp/lupin_night_lamp/client.py").read_text()
    code, out, _ = run(capsys, "check", "lupin-night_lamp")
    assert (code, out.splitlines()[-1]) == (0, "1 plugin, 9 rules, all kept")


def test_a_plugin_without_a_node(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Nothing speaks of one then, and the tests bring a stand-in."""
    code, out, _ = run(capsys, "new", "far_lamp", "far", "--no-node")
    assert code == 0
    assert "wrote far/lupin_far_lamp/client.py" in out
    text = "".join(file.read_text() for file in (tmp_path / "far").rglob("*") if file.is_file())
    assert "_sim" not in text
    assert ";;" not in text
    assert "def offer(" in text
    assert run(capsys, "check", "far")[0] == 0


def test_nothing_is_written_over(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Not even when only one file is there: then no file is written."""
    (tmp_path / "lupin-dusk").mkdir()
    (tmp_path / "lupin-dusk" / "README.md").write_text("mine")
    told = "lupin: 'lupin-dusk/README.md' exists; choose another folder, or remove it\n"
    assert run(capsys, "new", "dusk") == (2, "", told)
    assert [file.read_text() for file in (tmp_path / "lupin-dusk").iterdir()] == ["mine"]


def test_a_folder_that_cannot_be_written(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """One line."""
    (tmp_path / "file").write_text("")
    told = "lupin: cannot write 'file/pyproject.toml': File exists\n"
    assert run(capsys, "new", "dusk", "file") == (2, "", told)


WANTED = "write up to 40 lower-case letters, digits and underscores, such as lamp"


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("NightLamp", f"cannot be the name of a plugin: {WANTED}; did you mean 'night_lamp'?"),
        ("night-lamp", f"cannot be the name of a plugin: {WANTED}; did you mean 'night_lamp'?"),
        ("../x", f"cannot be the name of a plugin: {WANTED}; did you mean 'x'?"),
        ("", f"cannot be the name of a plugin: {WANTED}"),
        ("a" * 41, f"cannot be the name of a plugin: {WANTED}"),
        ("mission", "cannot be the name of a plugin: plugin 'mission': its name is a word of the language"),
    ],
)
def test_a_name_that_cannot_be(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, name: str, reason: str
) -> None:
    """With what can be, and the nearest."""
    assert run(capsys, "new", name) == (2, "", f"lupin: {name!r} {reason}\n")
    assert list(tmp_path.iterdir()) == []


def test_a_name_that_is_taken(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a plugin, or by a package that is none."""
    told = "lupin: there is a plugin 'nav' already, from lupin-engine 0.1.0; choose another name\n"
    assert run(capsys, "new", "nav") == (2, "", told)
    (tmp_path / "lupin_dawn.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    told = "lupin: there is a package lupin_dawn already; choose another name\n"
    assert run(capsys, "new", "dawn") == (2, "", told)


# -- bindings ----------------------------------------------------------------------------------------------

DOOR = """\
binding: door
summary: The door.
codes:
  door_locked: {label: the door is locked}
operations:
  open:
    summary: Open it.
    service: {name: /door/open, type: std_srvs/srv/Trigger}
    done_when: response.success
    code: door_locked
"""


@pytest.fixture
def door(tmp_path: Path) -> Path:
    """Return the file of a binding, in the folder of missions that one is in."""
    file = tmp_path / "missions" / "bindings" / "door.yaml"
    file.parent.mkdir(parents=True)
    file.write_text(DOOR)
    return file


@pytest.mark.parametrize("name", ["door", "missions/bindings/door.yaml"])
def test_a_binding_is_shown_as_any_plugin(capsys: pytest.CaptureFixture[str], door: Path, name: str) -> None:
    """It is one: by its name, or its file."""
    code, out, _ = run(capsys, "show", name)
    assert code == 0
    assert [line.strip() for line in out.splitlines()] == [
        "door: The door.",
        "missions/bindings/door.yaml",
        "",
        "Operations",
        "door.open",
        "Open it.",
        "fails with  door_locked (the door is locked)",
        "when held   it may finish; its end waits for the release",
    ]


def test_a_binding_with_errors_is_not_shown(capsys: pytest.CaptureFixture[str], door: Path) -> None:
    """Who asks is told where the errors are told."""
    door.write_text(DOOR.replace("done_when", "done_wen"))
    told = "lupin: the binding missions/bindings/door.yaml has errors; to see them: "
    assert run(capsys, "show", "door") == (2, "", f"{told}lupin check missions/bindings/door.yaml\n")


def test_a_binding_is_checked_with_the_missions(capsys: pytest.CaptureFixture[str], door: Path) -> None:
    """The harness tries packages."""
    told = (
        "lupin: 'door' is a binding; it is checked with the missions: lupin check missions/bindings/door.yaml"
    )
    assert run(capsys, "check", "door") == (2, "", f"{told}\n")


# -- check -------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_all_that_is_installed_is_checked(capsys: pytest.CaptureFixture[str]) -> None:
    """What is kept is only counted."""
    code, out, _ = run(capsys, "check")
    names = {row["name"] for row in json.loads(run(capsys, "list", "--json")[1])}
    assert (code, out) == (0, f"{len(names)} plugins, {len(RULES) * len(names)} rules, all kept\n")


def test_what_breaks_a_rule_is_told(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """In a project that is not installed, below its rule."""
    run(capsys, "new", "dim_lamp")
    catalog = tmp_path / "lupin-dim_lamp" / "lupin_dim_lamp" / "catalog.py"
    catalog.write_text(catalog.read_text().replace("Switch it, and wait until that is done.", "switch it"))
    code, out, _ = run(capsys, "check", "lupin-dim_lamp")
    assert code == 1
    assert out.splitlines()[4:7] == [
        "broken  dim_lamp: documented",
        "        operation 'switch': 'switch it' is no sentence: begin with a capital, end with a full stop",
        "kept    dim_lamp: labelled",
    ]
    assert out.splitlines()[-1] == "1 plugin, 9 rules, 1 broken"
    code, out, _ = run(capsys, "check", "lupin-dim_lamp", "--json")
    assert [verdict["rule"] for verdict in json.loads(out) if verdict["problems"]] == ["documented"]


def test_a_plugin_that_cannot_be_loaded_breaks_the_first_rule(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """And no other is tried."""
    run(capsys, "new", "bad_lamp")
    (tmp_path / "lupin-bad_lamp" / "lupin_bad_lamp" / "catalog.py").write_text("import no_such_thing")
    code, out, _ = run(capsys, "check", "lupin-bad_lamp")
    assert (code, out.splitlines()) == (
        1,
        [
            "broken  bad_lamp: loads",
            "        plugin 'bad_lamp' (lupin_bad_lamp.catalog:PLUGIN of lupin-bad_lamp) cannot be imported: "
            "ModuleNotFoundError: No module named 'no_such_thing'; "
            "at lupin-bad_lamp/lupin_bad_lamp/catalog.py:1",
            "1 plugin, 1 rule, 1 broken",
        ],
    )


def test_a_folder_without_a_plugin(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Says what it would have to declare."""
    (tmp_path / "other").mkdir()
    told = "lupin: 'other' has no pyproject.toml, so it declares no plugin\n"
    assert run(capsys, "check", "other") == (2, "", told)
    (tmp_path / "other" / "pyproject.toml").write_text('[project]\nname = "other"\n')
    wanted = '[project.entry-points."lupin.plugins"] with NAME = "MODULE:PLUGIN"'
    told = f"lupin: other/pyproject.toml declares no plugin; it needs {wanted}\n"
    assert run(capsys, "check", "other") == (2, "", told)


def test_a_driver_without_a_node_cannot_be_tried_here(capsys: pytest.CaptureFixture[str]) -> None:
    """The harness of pytest can: it takes stand-ins."""
    code, _, err = run(capsys, "check", "nav", "--live")
    assert code == 2
    assert err == (
        "lupin: plugin 'nav' brings no node to try its driver with; derive a test from "
        "lupin_harness.DriverContract, with servers of yours\n"
    )
