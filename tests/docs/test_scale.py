"""The page about the scale is true: what it shows works over ROS 2, and what it breaks is told as it says."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lupin_harness.domains import claimed_domain
from tests.docs.test_guide import pages

pytestmark = pytest.mark.timeout(300)

PAGE = Path(__file__).parents[2] / "docs" / "scale.md"
CATALOG, CLIENT, NODE = (f"lupin_scale/{name}.py" for name in ("catalog", "client", "node"))
CANCELLED = """\
        if self._weighings.pop(attempt, None) is not None:
            self._outlet.cancelled(attempt)
"""
#: In the order of the page's table: what is changed in which file, to what; whether it shows over ROS only.
CHANGES: list[tuple[list[tuple[str, str, str]], bool]] = [
    ([(CATALOG, 'number_in("kg")', 'number_in("stone")')], False),
    ([(CATALOG, "Parameter(MASS, 5.0", "Parameter(MASS, 99.0")], False),
    ([(CATALOG, "Parameter(MASS, 5.0", 'Parameter(MASS, __import__("random").uniform(1, 9)')], False),
    ([(CATALOG, "(UNSTABLE, OVERLOADED)", "(UNSTABLE)")], False),
    ([(CATALOG, "    EventKind,\n", "    Event,\n")], False),
    ([(CATALOG, 'parameters["scale_capacity"]', 'parameters["capacity"]')], False),
    ([(CLIENT, CANCELLED, "        pass\n")], True),
    ([(CLIENT, "Qos.SENSOR", "Qos.LATCHED")], True),
    ([(NODE, "Float32", "Float64")], True),
    (
        [
            (CLIENT, " or not math.isfinite(weight)", ""),
            (NODE, 'self.get_parameter("load").value', 'float("nan")'),
        ],
        True,
    ),
]


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of somebody who has done what the page says."""
    found = pages.Reader(tmp_path_factory.mktemp("reader"))
    try:
        found.page(PAGE)
    finally:
        found.leave()
    return Path(found.folder)


def lupin(*arguments: str, folder: Path, path: str = "") -> subprocess.CompletedProcess[str]:
    """Run `lupin` in a folder; on `path` is what is installed."""
    environment = {**os.environ, "PYTHONPATH": path, "COLUMNS": "200", "NO_COLOR": "1"}
    return subprocess.run(
        [sys.executable, "-m", "lupin_cli.main", *arguments],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=280,
    )


def rows() -> list[str]:
    """Return what the check says, row by row of the page's table."""
    table = PAGE.read_text(encoding="utf-8").partition("| Broken on purpose |")[2].partition("\n\n")[0]
    return [line.rpartition(" | ")[2].strip("`| ") for line in table.splitlines()[2:]]


def test_every_row_of_the_table_is_tried() -> None:
    """And nothing else."""
    assert len(rows()) == len(CHANGES)


@pytest.mark.long
@pytest.mark.parametrize(
    ("number", "live"),
    [
        pytest.param(number, live, marks=[pytest.mark.ros] if live else [])
        for number, (_, live) in enumerate(CHANGES)
    ],
)
def test_what_is_broken_is_told(reader: Path, tmp_path: Path, number: int, live: bool) -> None:
    """In one run, as the row says; `...` stands for what differs from machine to machine."""
    if live:
        pytest.importorskip("rclpy", reason="ROS 2 is not installed here")
    shutil.copytree(reader / "lupin-scale", tmp_path / "broken", ignore=shutil.ignore_patterns("*.egg-info"))
    for name, before, after in CHANGES[number][0]:
        file = tmp_path / "broken" / name
        text = file.read_text(encoding="utf-8")
        assert before in text
        file.write_text(text.replace(before, after), encoding="utf-8")
    done = lupin("plugin", "check", "broken", *(["--live"] if live else []), folder=tmp_path)
    wanted = ".*".join(map(re.escape, rows()[number].split("...")))
    assert re.search(rf"^ +(plugin 'scale'.*)?{wanted}", done.stdout, re.MULTILINE), done.stdout
    assert done.returncode == 1


@pytest.mark.long
@pytest.mark.ros
def test_the_scale_keeps_the_contract_over_ros(reader: Path) -> None:
    """All rules, with its node in plain rclpy."""
    pytest.importorskip("rclpy", reason="ROS 2 is not installed here")
    done = lupin("plugin", "check", "scale", "--live", folder=reader, path=str(reader / "lupin-scale"))
    assert (done.returncode, done.stdout.splitlines()[-1]) == (0, "1 plugin, 18 rules, all kept"), done.stdout


@pytest.mark.long
@pytest.mark.ros
def test_a_mission_weighs_over_ros(reader: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`lupin run` starts the scale's node with what is set for it."""
    pytest.importorskip("rclpy", reason="ROS 2 is not installed here")
    given = ("--set", "scale_sim.load=500 g", "--set", "scale_rest=0.2 s")
    with claimed_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        path = str(reader / "lupin-scale")
        done = lupin("run", "weigh_crop", *given, "--speed", "10", folder=reader, path=path)
    assert "WEIGHING" in done.stdout
    assert done.returncode == 0, done.stdout
