"""Every verb with every kind of mission: no traceback, the right exit code, a sentence that helps.

A new verb is tried as soon as it is there, with the mission as its only argument until `table` says better.
"""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import click
import pytest

from lupin_cli.main import lupin, main
from lupin_engine.errors import UsageError
from tests.warehouse.installed import install
from tests.workbench.lupin_cli.verbs.cases import CASES
from tests.workbench.lupin_cli.verbs.table import OWN_PROFILE, calls_of

pytestmark = pytest.mark.slow

CONTEXT = click.Context(lupin)
VERBS = lupin.list_commands(CONTEXT)
#: What a stand-in for ROS says: everything before was in order.
REACHED = "the network would be used from here on"


def called(words: list[str], site: Path | None, capfd: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    """Return exit code and both outputs of a command, which is a process of its own for a foreign package."""
    if site is None:
        code = main(words)
        return code, *capfd.readouterr()
    command = [str(Path(sys.executable).with_name("lupin")), *words]
    environment = {**os.environ, "PYTHONPATH": str(site)}
    done = subprocess.run(
        command,
        env=environment,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=60,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


@pytest.fixture(scope="module")
def warehouse(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The warehouse's package, installed into a folder."""
    site = tmp_path_factory.mktemp("site")
    install(site)
    return site


@pytest.fixture(autouse=True)
def no_network(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Let every verb that needs ROS end where it would come to it."""

    def reached() -> None:
        raise UsageError(REACHED)

    # Those that have it by name come first: imported afterwards they would keep the stand-in for ever.
    for module in ("lupin_cli.bring_up", "lupin_cli.verbs.node", "lupin_ros.launch"):
        monkeypatch.setattr(f"{module}.prepare_ros", reached)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO()))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.mark.parametrize("case_name", CASES)
@pytest.mark.parametrize("verb", VERBS)
def test_a_verb_with_a_mission(
    verb: str,
    case_name: str,
    tmp_path: Path,
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    folder = tmp_path / "work"
    folder.mkdir()
    case = CASES[case_name](folder)
    monkeypatch.chdir(case.folder)
    site = request.getfixturevalue("warehouse") if case_name == OWN_PROFILE else None
    command = lupin.get_command(CONTEXT, verb)
    assert command is not None
    for call in calls_of(verb, command):
        words = case.words(call.words)
        of_the_mission = words != list(call.words)
        if site is not None and (call.ros or not of_the_mission):
            continue  # a process each, and the same as with any other mission
        code, out, err = called(words, site, capfd)
        told = out + err
        print(words, code, told[-1000:])  # shown where it fails
        assert "Traceback" not in told
        assert "a defect of" not in told
        assert told.strip() or "-o" in words or verb == "lsp"
        if call.keep:
            Path(call.keep).write_text(out, encoding="utf-8")
        if REACHED in err:
            assert not (case.wrong and of_the_mission and not call.asks)
        elif case.wrong and of_the_mission:
            assert code == (2 if case.wrong == "empty" else call.broken)
            assert ("no missions" if case.wrong == "empty" else f"{case.mission}:4:3: error: ") in told
            return
        elif not case.wrong:
            assert code in ((call.but[case_name],) if case_name in call.but else call.codes)
            assert code != 2 or not of_the_mission or case.refused in told


def test_what_a_proof_writes_is_found_where_it_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Also beside a mission whose folder no search would find."""
    case = CASES["blanks"](tmp_path)
    monkeypatch.chdir(tmp_path)
    mission = Path(case.mission)
    broken = "properties: {stays: {never: \"in_state('SEEN')\"}}\n"
    mission.write_text(mission.read_text(encoding="utf-8") + broken, encoding="utf-8")
    assert main(["prove", case.mission, "--targets", "1", "--no-restarts", "-j", "1"]) == 1
    written = mission.with_name("round trip.stays.scenario.yaml")
    assert main(["test", str(written)]) == 1
    assert "stays" in capfd.readouterr().out
