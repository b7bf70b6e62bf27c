"""Import paths from before the shelves: plugins of others go on working, with a warning."""

from __future__ import annotations

import importlib
import subprocess
import sys
import warnings
from collections.abc import Iterator

import pytest

import lupin_engine
from lupin_engine.moved import MOVED

OLD = [
    ("lupin_engine.ros.adapter.service_driver", "ServiceDriver"),
    ("lupin_engine.ros.adapter.node", "RosNode"),
    ("lupin_engine.harness.cases", "CatalogContract"),
]


@pytest.fixture
def forgotten() -> Iterator[None]:
    """Forget what was imported by old paths: a warning comes with the first import only."""
    yield
    for name in [name for name in sys.modules if name.startswith(tuple(MOVED))]:
        del sys.modules[name]


@pytest.mark.usefixtures("forgotten")
@pytest.mark.parametrize(("old", "name"), OLD)
def test_an_old_path_is_the_new_module(old: str, name: str) -> None:
    """It is not loaded a second time: a class is the same by both paths."""
    package = ".".join(old.split(".")[:2])
    new = MOVED[package] + old[len(package) :]
    pytest.importorskip("rclpy" if ".ros." in old else "lupin_harness", reason="ROS 2 is not installed here")
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        found = importlib.import_module(old)
    assert str(warned[-1].message) == f"{old} is now {new}: import that"
    assert (warned[-1].category, found.__spec__.name) == (DeprecationWarning, new)
    assert found is importlib.import_module(new)
    assert hasattr(found, name)


@pytest.mark.usefixtures("forgotten")
def test_a_name_that_is_nowhere_is_an_import_error() -> None:
    """As any other; also one that only begins like an old path."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in ("lupin_engine.ros.gone", "lupin_engine.rosy", "lupin_engine.harness_of_mine"):
            with pytest.raises(ModuleNotFoundError):
                importlib.import_module(name)


def test_a_module_is_started_by_its_old_path() -> None:
    """As unit files and launch files of users do."""
    line = [sys.executable, "-m", "lupin_engine.cli.main", "--version"]
    done = subprocess.run(line, capture_output=True, text=True, check=True)
    assert lupin_engine.__version__ in done.stdout
