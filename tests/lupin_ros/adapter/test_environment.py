"""Where ROS 2 comes from, without one: the folders and variables of both kinds, made by hand."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from lupin_engine.errors import UsageError
from lupin_ros.adapter import environment


@pytest.fixture
def prefix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An environment of our own, empty, with nothing sourced."""
    ours = tmp_path / "ours"
    (ours / "lib").mkdir(parents=True)
    monkeypatch.setattr(sys, "prefix", str(ours))
    for name in ("ROS_DISTRO", "AMENT_PREFIX_PATH", "LD_LIBRARY_PATH", "PYTHONPATH", environment.RESTARTED):
        monkeypatch.delenv(name, raising=False)
    return ours


@pytest.fixture
def sourced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A ROS 2 elsewhere, as sourcing would announce it."""
    theirs = tmp_path / "jazzy"
    (theirs / environment.PACKAGE_MARKERS).mkdir(parents=True)
    (theirs / environment.PACKAGE_MARKERS / "rclpy").touch()
    (theirs / "site" / "rclpy").mkdir(parents=True)
    (theirs / "site" / "rclpy" / "__init__.py").touch()
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(theirs))
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    monkeypatch.delitem(sys.modules, "rclpy", raising=False)
    monkeypatch.syspath_prepend(str(theirs / "site"))
    return theirs


@pytest.mark.usefixtures("prefix", "sourced")
def test_rclpy_from_elsewhere_is_apt() -> None:
    assert environment.rclpy_source() == "apt"


def test_nothing_found(prefix: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [str(prefix)])
    monkeypatch.delitem(sys.modules, "rclpy", raising=False)
    assert environment.rclpy_source() is None


def test_our_interfaces_are_found_first_and_once(prefix: Path, sourced: Path) -> None:
    (prefix / "lib" / "liblupin_msgs__rosidl_typesupport_c.so").touch()
    child = environment.child_environment()
    assert child["AMENT_PREFIX_PATH"] == f"{prefix}{os.pathsep}{sourced}"
    assert child["LD_LIBRARY_PATH"] == f"{prefix}/lib"


def test_no_libraries_of_ours_no_library_path(prefix: Path, sourced: Path) -> None:
    assert "LD_LIBRARY_PATH" not in environment.child_environment()
    assert prefix != sourced


def test_mixture_is_refused(prefix: Path, sourced: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment, "wheels_installed", lambda: True)
    with pytest.raises(UsageError, match="two ROS 2 installations are active") as caught:
        environment.prepare()
    assert str(prefix) in str(caught.value)
    assert str(sourced) in str(caught.value)


def test_a_workspace_on_top_of_the_wheels_is_no_mixture(
    prefix: Path, sourced: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(environment, "wheels_installed", lambda: True)
    both = f"{tmp_path}/install{os.pathsep}{prefix}"
    environment.refuse_mixture({"AMENT_PREFIX_PATH": both})
    with pytest.raises(UsageError, match="two ROS 2 installations are active"):
        environment.refuse_mixture({"AMENT_PREFIX_PATH": f"{both}{os.pathsep}{sourced}"})


def test_the_program_is_started_anew_once(
    prefix: Path, sourced: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (prefix / "lib" / "liblupin_msgs__rosidl_typesupport_c.so").touch()
    monkeypatch.setattr(environment, "wheels_installed", lambda: False)
    started: list[dict[str, str]] = []
    monkeypatch.setattr(os, "execve", lambda path, arguments, variables: started.append(variables))
    environment.prepare()
    assert started[0]["LD_LIBRARY_PATH"] == f"{prefix}/lib"
    assert str(sourced) in started[0]["AMENT_PREFIX_PATH"]
    monkeypatch.setenv(environment.RESTARTED, "1")
    with pytest.raises(UsageError, match="lacks"):
        environment.prepare()


def test_a_child_can_load_every_interface() -> None:
    pytest.importorskip("rclpy")
    program = "import rclpy; from lupin_msgs.msg import Observation as o; type(o).__import_type_support__()"
    child = environment.child_environment()
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, env=child, check=False, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
