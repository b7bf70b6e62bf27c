"""The page about plugins is true outside of this checkout as well: a lamp from nothing, over ROS 2.

What the page shows and what its commands print is held against it by test_guide.py; here the package that its
reader has at the end is installed elsewhere, and used by processes that know nothing of this one.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from lupin_harness.domains import claimed_domain
from lupin_harness.live import OPERATION_RULES
from lupin_harness.live import RULES as DRIVER_RULES
from lupin_harness.rules import RULES as CATALOG_RULES
from tests.docs.test_guide import pages

pytest.importorskip("setuptools", reason="the package is built with it")

pytestmark = pytest.mark.timeout(300)

PAGE = Path(__file__).parents[2] / "docs" / "plugins.md"
BUILD = "from setuptools import setup; setup()"


@dataclass(frozen=True)
class Elsewhere:
    """The folder of the page's reader, and where the lamp is installed."""

    folder: Path
    site: Path

    def run(self, *command: str, folder: str = ".") -> subprocess.CompletedProcess[str]:
        """Run a Python program that finds the lamp as it finds any package."""
        environment = {**os.environ, "PYTHONPATH": str(self.site), "COLUMNS": "200", "NO_COLOR": "1"}
        return subprocess.run(
            [sys.executable, *command],
            cwd=self.folder / folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=280,
        )

    def lupin(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run `lupin`."""
        return self.run("-m", "lupin_cli.main", *arguments)


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Elsewhere:
    """Do what the page says, in a folder outside of the checkout; install the lamp into another one."""
    found = Elsewhere(tmp_path_factory.mktemp("reader"), tmp_path_factory.mktemp("site"))
    reader = pages.Reader(found.folder)
    try:
        reader.page(PAGE)
    finally:
        reader.leave()
    build = ["-W", "ignore", "-c", BUILD, "--quiet", "egg_info", "--egg-base", str(found.site)]
    done = found.run(*build, "build_py", "--build-lib", str(found.site), folder="lupin-lamp")
    assert done.returncode == 0, done.stdout
    return found


def test_every_rule_of_the_harness_is_on_the_page() -> None:
    """With what it demands, in the tables."""
    text = PAGE.read_text(encoding="utf-8")
    cells = [line.split("|")[1] for line in text.splitlines() if line.startswith("| `")]
    told = {name.strip(" `") for cell in cells for name in cell.split(",")}
    assert {*CATALOG_RULES, *DRIVER_RULES, *OPERATION_RULES} <= told


@pytest.mark.slow
def test_the_lamp_is_installed(elsewhere: Elsewhere) -> None:
    """The engine finds it by its entry point, and its modules where they were installed."""
    listed = elsewhere.lupin("plugin", "list")
    assert listed.returncode == 0, listed.stdout
    assert "The lamp: switched on and off, and whether it is on." in listed.stdout
    where = elsewhere.run("-c", "import lupin_lamp.catalog as c; print(c.__file__)").stdout.strip()
    assert Path(where).is_relative_to(elsewhere.site)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "last"),
    [
        (("check", "missions"), "1 mission, no errors, no warnings"),
        (("test",), "1 scenario: all hold"),
        (("simulate", "night_light"), "DONE in 13.4 s of virtual time"),
        (("plugin", "check", "lamp"), "1 plugin, 9 rules, all kept"),
        (("lamp", "compare", "candle"), "as bright as 200 of them"),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_a_command_of_the_page_works(elsewhere: Elsewhere, arguments: tuple[str, ...], last: str) -> None:
    """In a process that has never seen the checkout's tests."""
    done = elsewhere.lupin(*arguments)
    assert (done.returncode, done.stdout.splitlines()[-1]) == (0, last)


@pytest.mark.long
@pytest.mark.ros
def test_the_lamp_keeps_the_contract_over_ros(elsewhere: Elsewhere) -> None:
    """All rules, with the node that it brings."""
    done = elsewhere.lupin("plugin", "check", "lamp", "--live")
    assert done.returncode == 0, done.stdout
    assert done.stdout.splitlines()[-1] == "1 plugin, 19 rules, all kept"


@pytest.mark.long
@pytest.mark.ros
def test_the_tests_of_the_package_pass(elsewhere: Elsewhere) -> None:
    """As `lupin plugin new` wrote them, with the harness for third parties."""
    done = elsewhere.run("-m", "pytest", "-q", "-p", "no:cacheprovider", "tests", folder="lupin-lamp")
    assert done.returncode == 0, done.stdout
    assert "21 passed" in done.stdout


@pytest.mark.long
@pytest.mark.ros
def test_a_mission_switches_the_lamp_over_ros(elsewhere: Elsewhere, monkeypatch: pytest.MonkeyPatch) -> None:
    """`lupin run` starts the lamp's node along with the robot's, and the mission uses it."""
    with claimed_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        done = elsewhere.lupin("run", "night_light", "--set", "shine_for=1 s", "--speed", "10")
    assert "LIGHTING" in done.stdout
    assert "DARKENING" in done.stdout
    assert done.returncode == 0, done.stdout
