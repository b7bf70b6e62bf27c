"""Every verb that needs a network, with every kind of mission; the others are with tests of the command."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from lupin_cli import main as command_line
from lupin_cli.main import OPERATOR_VERBS, main
from tests.lupin_ros.launch.processes import Lupin
from tests.processes import ended
from tests.warehouse.installed import install
from tests.workbench.lupin_cli.verbs.cases import CASES, Case
from tests.workbench.lupin_cli.verbs.table import OWN_PROFILE

pytestmark = pytest.mark.timeout(240)

Start = Callable[..., Lupin]

GOOD = [name for name in CASES if name not in ("empty", "broken")]
#: Requests of the installed profiles: each is answered, yes or no.
REQUESTS = [verb for verb in command_line._request_verbs() if verb not in OPERATOR_VERBS]


@contextmanager
def served(case: Case, domain: int) -> Iterator[None]:
    """Run what serves the bindings of a case."""
    if case.server is None:
        yield
        return
    network = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    # An rclpy program with several threads sometimes does not end on SIGTERM: it is no part of what is shown.
    with ended(subprocess.Popen([sys.executable, str(case.server)], env={**os.environ, **network})):
        yield


@pytest.fixture
def case(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Case:
    """A mission in a folder of its own, which is the current one."""
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    if request.param == OWN_PROFILE:
        (tmp_path / "site").mkdir()
        install(tmp_path / "site")
        monkeypatch.setenv("PYTHONPATH", str(tmp_path / "site"))
    return CASES[request.param](folder)


@pytest.mark.parametrize("case", GOOD, indirect=True)
def test_an_operator_is_answered(
    case: Case, lupin: Start, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Nodes are up, and everything that can be asked of them gets a sentence and no traceback."""
    up = lupin(
        "up", case.mission, *(() if case.refused else ("--speed", "20"))
    )  # its robot is no simulated one
    with served(case, up.domain):
        _answered(case, up, lupin, monkeypatch, capfd)


def _answered(
    case: Case, up: Lupin, lupin: Start, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    up.until_line("Ctrl-C")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(up.domain))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("XDG_STATE_HOME", str(up.state))

    def asked(*words: str) -> int:
        code = main(words)
        told = "".join(capfd.readouterr())
        assert "Traceback" not in told, words
        assert "a defect of" not in told, f"{words}: {told}"
        assert told.strip(), words
        return code

    record = lupin("record", "--output", "run.mcap")
    record.until_line("into run.mcap; Ctrl-C ends it")
    assert asked("state") == 0
    assert asked("graph") in (0, 1)
    assert asked("start", Path(case.mission).stem) in (0, 1)
    for verb in (*REQUESTS, "answer"):
        assert asked(verb) in (0, 1), verb
    assert asked("state") == 0
    for words in (("missions",), ("why", "state"), ("replay",)):
        assert asked(*words) in (0, 1, 2)
    record.process.send_signal(signal.SIGINT)
    assert record.end() == 0, record.output
    assert "Traceback" not in record.output
    up.process.send_signal(signal.SIGINT)
    assert up.end() == 0, up.output
    assert "Traceback" not in up.output


@pytest.mark.parametrize("case", ["binding"], indirect=True)
def test_nobody_serves_what_is_called(case: Case, lupin: Start) -> None:
    """The orchestrator waits for it, says what it has waited for, and stays for whoever mends it."""
    up = lupin("up", case.mission, "--speed", "20")
    up.until_line("the orchestrator is in FAULT: ")
    up.until_line("mend it, then `lupin reset`")
    assert up.process.poll() is None
    up.process.send_signal(signal.SIGINT)
    assert up.end() == 0, up.output


@pytest.mark.parametrize("case", ["binding", "non-ASCII"], indirect=True)
def test_a_policy_is_written(case: Case) -> None:
    """Of every node of the mission, and of what its binding calls."""
    words = [sys.executable, "-m", "lupin_cli.main", "security", "policy", case.mission]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout.startswith("<?xml")
    assert ("/valve" in done.stdout) is (case.server is not None)


@pytest.mark.parametrize(
    "case", ["part", "missions in missions", "parallel", "non-ASCII", "blanks"], indirect=True
)
def test_a_mission_is_run(case: Case, lupin: Start) -> None:
    """By its file, wherever that is."""
    run = lupin(
        "run", case.mission, "--speed", "20", *(["--tags", "1"] if "inspection" in case.mission else [])
    )
    assert run.end() == 0, run.output
    assert "DONE" in run.output
    assert run.processes() == {}
    assert os.listdir(run.state)
