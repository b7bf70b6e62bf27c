"""The parts of the bootstrap that decide something, without making an environment."""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from lupin_ros.adapter.environment import WHEELS
from tests.tools import load_tool

ROOT = Path(__file__).parents[2]
GOOD: dict[str, Any] = {
    "executable": "/usr/bin/python3.12",
    "version": [3, 12, 1],
    "bits": 64,
    "implementation": "CPython",
    "system": "Linux",
    "machine": "x86_64",
    "libc": "glibc 2.39",
    "venv": True,
    "threaded": False,
    "include": "/nowhere",
    "tag": "cp312-x86_64",
}


@pytest.fixture(scope="module")
def bootstrap() -> ModuleType:
    return load_tool("bootstrap")


@pytest.mark.parametrize(
    ("facts", "reason"),
    [
        ({}, None),
        ({"version": [3, 9, 18]}, "too old"),
        ({"version": [3, 14, 0]}, "too new"),
        ({"implementation": "PyPy"}, "not CPython"),
        ({"threaded": True}, "free-threaded"),
        ({"venv": False}, r"apt install python3\.12-venv"),
    ],
)
def test_objection_to_an_interpreter(
    bootstrap: ModuleType, facts: dict[str, Any], reason: str | None
) -> None:
    found = bootstrap.objection({**GOOD, **facts}, "wheels")
    assert found is None if reason is None else re.search(reason, found)


def test_the_python_of_lyrical_is_for_a_sourced_ros_only(
    bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bootstrap, "answer", lambda *_: "")
    facts = {**GOOD, "version": [3, 14, 0]}
    assert bootstrap.objection(facts, "wheels") == "too new, 3.10 to 3.13 will do"
    assert bootstrap.objection(facts, "apt") is None
    assert bootstrap.objection({**GOOD, "version": [3, 15, 0]}, "apt") == "too new, 3.10 to 3.14 will do"


@pytest.mark.parametrize(
    ("facts", "what"),
    [
        ({"machine": "aarch64"}, "no Python wheels for Linux on aarch64"),
        ({"system": "Darwin"}, "no Python wheels for Darwin"),
        ({"libc": "glibc 2.27"}, "glibc 2.28 or newer; here it is glibc 2.27"),
        ({"libc": ""}, "another libc"),
    ],
)
def test_machine_without_wheels(bootstrap: ModuleType, facts: dict[str, Any], what: str) -> None:
    bootstrap.check_platform(GOOD)  # nothing is wrong with it but for these facts
    with pytest.raises(bootstrap.Problem, match=what):
        bootstrap.check_platform({**GOOD, **facts})


def test_no_compiler(bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(bootstrap.Problem, match="No working C compiler") as caught:
        bootstrap.check_compiler(GOOD)
    assert "build-essential" in caught.value.args[1]


def test_other_ros_is_refused(bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DISTRO", "humble")
    with pytest.raises(bootstrap.Problem, match="humble; Lupin runs on jazzy, kilted, lyrical"):
        bootstrap.requested_mode()


@pytest.mark.parametrize("sourced", ["jazzy", "kilted", "lyrical"])
def test_a_sourced_ros_is_used(bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch, sourced: str) -> None:
    monkeypatch.delenv("LUPIN_ROS", raising=False)
    monkeypatch.setenv("ROS_DISTRO", sourced)
    assert bootstrap.requested_mode() == "apt"


@pytest.mark.parametrize(
    ("variables", "told"),
    [
        (
            {"LUPIN_ROS": "foo"},
            "\nLUPIN_ROS is 'foo': only jazzy and kilted have Python wheels.\n"
            "Use one of them, or unset LUPIN_ROS: for Jazzy, or for a ROS 2 that is sourced.\n",
        ),
        (
            {"LUPIN_ROS": "kilted", "ROS_DISTRO": "jazzy"},
            "\nThis shell has sourced ROS 2 jazzy, and LUPIN_ROS=kilted asks for Python wheels.\n"
            "They do not mix: unset LUPIN_ROS, or use a shell in which no ROS 2 is sourced.\n",
        ),
    ],
)
def test_a_distribution_that_cannot_be_had_is_told_before_anything_is_installed(
    variables: dict[str, str], told: str
) -> None:
    run = subprocess.run(
        ["make", "--no-print-directory", "environment"],
        env={**os.environ, **variables},
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.startswith(told)
    assert not (ROOT / ".venv-foo").exists()


def test_each_distribution_has_an_environment_and_the_same_packages(bootstrap: ModuleType) -> None:
    """Never under the bare names, whose newest versions are of one distribution only."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    packages = {}
    for name, (_, extra) in bootstrap.WHEELS.items():
        listed = text.partition(f"\n{extra} = [\n")[2].partition("\n]")[0]
        packages[name] = re.findall(rf'"ros-{name}-([a-z-]+)', listed)
        assert listed.count('"ros-') == len(packages[name]) > 10
    assert packages["kilted"] == packages["jazzy"]
    assert len({folder for folder, _ in bootstrap.WHEELS.values()}) == len(bootstrap.WHEELS)
    assert tuple(bootstrap.WHEELS) == WHEELS


@pytest.mark.parametrize(("before", "now"), [("wheels", "apt"), ("apt", "wheels")])
def test_an_environment_never_changes_its_ros_silently(bootstrap: ModuleType, before: str, now: str) -> None:
    wanted = {"root": "/a", "mode": now, "python": ""}
    with pytest.raises(bootstrap.Problem, match=f"made with ROS 2 from {before}"):
        bootstrap.must_start_afresh({**wanted, "mode": before}, wanted)
    assert bootstrap.must_start_afresh({}, wanted)


def test_when_to_start_afresh(bootstrap: ModuleType) -> None:
    wanted = {"root": "/a", "mode": "wheels", "python": "", "engine": "e", "interfaces": "i"}
    assert bootstrap.must_start_afresh({}, wanted)
    assert not bootstrap.must_start_afresh({**wanted, "engine": "other"}, wanted)
    assert bootstrap.must_start_afresh({**wanted, "root": "/moved"}, wanted)
    assert not bootstrap.must_start_afresh({**wanted, "python": "python3.11"}, wanted)
    assert bootstrap.must_start_afresh(wanted, {**wanted, "python": "python3.11"})


def test_an_environment_for_tests_is_good_for_a_run(bootstrap: ModuleType) -> None:
    wanted = bootstrap.wanted_state("wheels", "run", {"purpose": "dev"})
    assert wanted["purpose"] == "dev"
    assert bootstrap.wanted_state("wheels", "dev", {"purpose": "run"})["purpose"] == "dev"
    assert bootstrap.wanted_state("wheels", "run", {})["purpose"] == "run"


def test_half_a_stamp_counts_as_none(
    bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(bootstrap, "STAMP", tmp_path / "stamp.json")
    for text in ("", '{"root": 1', "[]"):
        (tmp_path / "stamp.json").write_text(text)
        assert bootstrap.finished_state() == {}


def test_digest_sees_contents_and_names(bootstrap: ModuleType, tmp_path: Path) -> None:
    package = tmp_path / "lupin_msgs" / "msg"
    package.mkdir(parents=True)
    (package / "A.msg").write_text("bool a\n")
    first = bootstrap.digest(tmp_path, bootstrap.interface_files(tmp_path))
    (package / "notes.md").write_text("not built")
    assert bootstrap.digest(tmp_path, bootstrap.interface_files(tmp_path)) == first
    (package / "A.msg").rename(package / "B.msg")
    assert bootstrap.digest(tmp_path, bootstrap.interface_files(tmp_path)) != first


def test_a_line_of_output_is_condensed(bootstrap: ModuleType) -> None:
    line = "\x1b[32m  Downloading https://example.org/a/b/c-1.0-py3-none-any.whl (1 kB)\n"
    assert bootstrap.condense(line) == "Downloading c-1.0-py3-none-any.whl (1 kB)"
    assert bootstrap.condense("Collecting six (from transitions)") == "Collecting six"


def test_failure_names_the_log_and_a_hint(bootstrap: ModuleType, tmp_path: Path) -> None:
    code = "print('NewConnectionError: no route', *(f'line {n}' for n in range(20)), sep='\\n'); exit(1)"
    with pytest.raises(bootstrap.Problem, match="Installing failed") as caught:
        bootstrap.run([sys.executable, "-c", code], "wheels", tmp_path / "x.log", "Installing")
    text = "\n".join(caught.value.args)
    assert "line 19" in text
    assert "line 3" not in [line.strip() for line in text.splitlines()]
    assert str(tmp_path / "x.log") in text
    assert "cannot be reached" in text
    assert bootstrap.running == []


def test_a_blank_in_the_temporary_folder_is_avoided(
    bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bootstrap.tempfile, "gettempdir", lambda: "/home/a b/tmp")
    assert bootstrap.plain_temporary_folder() == "/tmp"
    monkeypatch.setattr(bootstrap.tempfile, "gettempdir", lambda: "/var/tmp")
    assert bootstrap.plain_temporary_folder() == "/var/tmp"


def test_children_are_led_nowhere_else(bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("PYTHONPATH", "PIP_USER", "VIRTUAL_ENV", "LD_LIBRARY_PATH", bootstrap.GUARD):
        monkeypatch.setenv(name, "1")
    wheels = bootstrap.clean_environment("wheels")
    assert not {"PYTHONPATH", "PIP_USER", "VIRTUAL_ENV", "LD_LIBRARY_PATH", bootstrap.GUARD} & set(wheels)
    assert bootstrap.clean_environment("apt")["PYTHONPATH"] == "1"


def test_the_probe_answers_in_json(bootstrap: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    exec(bootstrap.PROBE, {})
    assert set(json.loads(capsys.readouterr().out)) == set(GOOD)


def test_a_real_package_of_the_sourced_ros_is_used(
    bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Only what it lacks is compiled from `interfaces/`; a folder that merely has the name is no package."""
    (tmp_path / "nav2_msgs").mkdir()
    (tmp_path / "nav2_msgs" / "__init__.py").touch()
    (tmp_path / "tf2_msgs").mkdir()
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    # Without the packages of the environment that these tests run in.
    plain = getattr(sys, "_base_executable", sys.executable)
    everything = list(bootstrap.FOLDERS)
    lacking = [folder for folder in everything if folder != "interfaces/nav2_msgs"]
    assert bootstrap.missing_packages(plain, "apt") == lacking
    assert bootstrap.missing_packages(plain, "wheels") == everything


def test_what_is_sourced_later_goes_before_the_subset(tmp_path: Path) -> None:
    """Sourcing puts a package on PYTHONPATH, which Python looks at before its own packages."""
    (tmp_path / "nav2_msgs").mkdir()
    (tmp_path / "nav2_msgs" / "__init__.py").write_text("real = True")
    code = "import nav2_msgs; print(nav2_msgs.real)"
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    shown = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert shown.stdout.strip() == "True", shown.stderr


@pytest.mark.parametrize("file", ["tools/bootstrap.py", "lupin_engine/plugin/domain.py"])
def test_python_3_6_can_read_it(file: str) -> None:
    ast.parse((ROOT / file).read_text(encoding="utf-8"), feature_version=(3, 6))


@pytest.mark.parametrize(
    ("purpose", "code", "told"),
    [("run", 1, "\nROS_DOMAIN_ID is '214': use a number from 0 to 101 or from 215 to 232\n"), ("dev", 0, "")],
)
def test_a_domain_that_a_run_would_refuse_is_told_before_anything_is_installed(
    bootstrap: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    purpose: str,
    code: int,
    told: str,
) -> None:
    """Tests have domains of their own."""
    state = {"root": "r", "mode": "wheels", "purpose": "dev", "python": "", "engine": "e", "interfaces": "i"}
    monkeypatch.setattr(bootstrap, "finished_state", lambda: state)
    monkeypatch.setattr(bootstrap, "wanted_state", lambda *_: state)
    monkeypatch.setenv("ROS_DOMAIN_ID", "214")
    assert bootstrap.main(purpose) == code
    assert capsys.readouterr().err == told


def test_a_run_has_the_same_packages_wherever_its_ros_comes_from(bootstrap: ModuleType) -> None:
    """Those for pictures as PNG and for editors, which the README's list of verbs shows, are among them."""
    wanted = bootstrap.RUN_EXTRAS["apt"]
    assert f'ros = [\n  "lupin-engine[{wanted}]",\n' in (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert {"diagram", "editor"} <= set(wanted.split(","))
