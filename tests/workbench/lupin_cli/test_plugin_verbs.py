"""Verbs that installed packages bring to the command line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from lupin_cli.main import main

LAMP = '''\
"""Verbs of the lamp."""

import sys

import click

print("imported", file=sys.stderr)


@click.group()
def lamp() -> None:
    """Switch lamps, and see
    which are on.

    More than that is not to be told.
    """


@lamp.command()
@click.argument("name")
def on(name: str) -> int:
    """Switch one on."""
    if name == "broken":
        raise ZeroDivisionError("by zero")
    print(f"{name} is on")
    return 3
'''


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder on the path in which packages are installed; none is loaded yet."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    for name in ("far_lamp", "far_lamp.verbs"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return tmp_path


def install(folder: Path, entry_points: str, source: str = LAMP, package: str = "far_lamp") -> None:
    """Do what an installer does with a package of one module."""
    (folder / package).mkdir()
    (folder / package / "__init__.py").write_text("print('the package is imported')")
    (folder / package / "verbs.py").write_text(source)
    (folder / f"{package}-1.2.dist-info").mkdir()
    (folder / f"{package}-1.2.dist-info" / "METADATA").write_text(
        f"Name: {package.replace('_', '-')}\nVersion: 1.2\n"
    )
    (folder / f"{package}-1.2.dist-info" / "entry_points.txt").write_text(f"[lupin.verbs]\n{entry_points}\n")


def test_help_lists_a_verb_without_importing_it(installed: Path) -> None:
    """Its line is the first paragraph of the docstring, read off the source; and all is as fast as before."""
    install(installed, "lamp = far_lamp.verbs:lamp")
    program = (
        "import sys; from lupin_cli.main import main; main(['--help']); "
        "print(sorted({'far_lamp', 'numpy', 'pydantic', 'rich', 'yaml'} & set(sys.modules)))"
    )
    environment = {"PYTHONPATH": str(installed), "PATH": ""}
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, env=environment
    )
    *lines, heavy = done.stdout.splitlines()
    assert heavy == "[]"
    of_plugins = lines[lines.index("Commands of plugins:") + 1 :]
    assert [line.split(maxsplit=1) for line in of_plugins if line.split()[:1] == ["lamp"]] == [
        ["lamp", "Switch lamps, and see which are on."]
    ]
    assert done.stderr == ""


def test_a_verb_is_called(installed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With its own verbs below it; what it returns is the exit code."""
    install(installed, "lamp = far_lamp.verbs:lamp")
    assert main(["lamp", "on", "red"]) == 3
    assert "red is on\n" in capsys.readouterr().out


def test_a_misspelt_verb_gets_the_nearest(installed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Verbs of packages are among them."""
    install(installed, "lamp = far_lamp.verbs:lamp")
    assert main(["lammp"]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == "Error: unknown command 'lammp'; did you mean 'lamp'?"


@pytest.mark.parametrize(
    ("entry_point", "source", "line", "problem"),
    [
        (
            "lamp = far_lamp.verbs:lamp",
            "import no_such_module\n\ndef lamp():\n    'Switch lamps.'\n",
            "Switch lamps.",
            "cannot be imported: ModuleNotFoundError: No module named 'no_such_module'; at FOLDER/verbs.py:1",
        ),
        (
            "lamp = far_lamp.verbs:lamp",
            "this is no Python",
            "(far_lamp.verbs:lamp of far-lamp 1.2)",
            "cannot be imported: SyntaxError: invalid syntax (verbs.py, line 1)",
        ),
        (
            "lamp = far_lamp.verbs:lamp",
            "import sys\nsys.exit(5)",
            "(far_lamp.verbs:lamp of far-lamp 1.2)",
            "cannot be imported: SystemExit: 5; at FOLDER/verbs.py:2",
        ),
        (
            "lamp = far_lamp.gone:lamp",
            "",
            "(far_lamp.gone:lamp of far-lamp 1.2: there is no module far_lamp.gone)",
            "cannot be imported: ModuleNotFoundError: No module named 'far_lamp.gone'",
        ),
        (
            "lamp = far_lamp.verbs:lamp",
            "lamp = 5",
            "(far_lamp.verbs:lamp of far-lamp 1.2)",
            "names something of type int; it must name a click command",
        ),
    ],
    ids=["import", "syntax", "exit", "gone", "no_command"],
)
def test_a_broken_verb_breaks_no_other(
    installed: Path,
    capsys: pytest.CaptureFixture[str],
    entry_point: str,
    source: str,
    line: str,
    problem: str,
) -> None:
    """It is listed, says what is wrong with it when it is called, and the others work."""
    install(installed, entry_point, source)
    assert main(["--help"]) == 0
    assert f" lamp {line}" in " ".join(capsys.readouterr().out.split())
    assert main(["lamp", "on"]) == 1
    value = entry_point.partition(" = ")[2]
    told = capsys.readouterr().err.replace(str(installed / "far_lamp"), "FOLDER")
    assert told == f"lupin: verb 'lamp' ({value} of far-lamp 1.2) {problem}\n"
    assert main(["check", "--help"]) == 0


def test_two_packages_with_one_verb(installed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Neither is taken by chance."""
    install(installed, "lamp = far_lamp.verbs:lamp")
    install(installed, "lamp = near_lamp.verbs:lamp", package="near_lamp")
    offers = "far_lamp.verbs:lamp of far-lamp 1.2 and near_lamp.verbs:lamp of near-lamp 1.2"
    assert main(["lamp"]) == 1
    assert capsys.readouterr().err == (
        f"lupin: verb 'lamp' is offered more than once: {offers}; uninstall all but one\n"
    )
    assert main(["--help"]) == 0
    assert "(offered more than once: far_lamp.verbs:lamp" in capsys.readouterr().out


def test_a_verb_of_the_engine_stays_its_own(installed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Installing something must not change what `lupin check` does."""
    install(installed, "check = far_lamp.verbs:lamp")
    assert main(["check", "--help"]) == 0
    assert capsys.readouterr().out.startswith("Usage: lupin check [OPTIONS] [PATHS]...")
    assert main(["--help"]) == 0
    assert "Switch lamps" not in capsys.readouterr().out


def test_a_defect_of_a_verb_names_who_brought_it(installed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One line and a file, as always; but it is not the engine's."""
    install(installed, "lamp = far_lamp.verbs:lamp")
    assert main(["lamp", "on", "broken"]) == 70
    first, second = capsys.readouterr().err.splitlines()[-2:]
    assert first == "lupin: a defect of the verb 'lamp' of far-lamp 1.2: ZeroDivisionError: by zero"
    log = Path(second.removeprefix("lupin: please report "))
    assert "ZeroDivisionError: by zero" in log.read_text()
