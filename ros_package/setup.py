"""Installs the engine and its plugins as the ROS package lupin_engine: colcon calls this, pip does not.

Names, entry points and versions are those of ../pyproject.toml.
"""

import shutil
from pathlib import Path

import tomllib
from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
NODES = (HERE / "nodes.txt").read_text(encoding="utf-8").split()
PACKAGES = {
    package: f"../{source}/{package.replace('.', '/')}".replace("/./", "/")
    for source in (".", "workbench", "plugins")
    for package in find_packages(str(ROOT / source), include=["lupin_*"], exclude=["lupin_msgs*"])
}


class BuildWithMissions(build_py):
    """Copies the shipped missions and the page of rules, too, as the wheel has them."""

    def run(self) -> None:
        super().run()
        engine = Path(self.build_lib) / "lupin_engine"
        shutil.copytree(ROOT / "missions", engine / "missions" / "shipped", dirs_exist_ok=True)
        shutil.copy(ROOT / "docs" / "rules.md", engine / "rules.md")


def commands() -> list[str]:
    """Return the commands of pip's installation, and one for each node: ros2 run lupin_engine NODE."""
    ours = [f"{name} = {entry}" for name, entry in PROJECT["scripts"].items()]
    return ours + [f"{node} = lupin_cli.main:run_node" for node in NODES]


groups = {
    group: [f"{name} = {entry}" for name, entry in entries.items()]
    for group, entries in PROJECT["entry-points"].items()
}
setup(
    name="lupin_engine",
    version=PROJECT["version"],
    packages=sorted(PACKAGES),
    package_dir=PACKAGES,
    package_data={"": ["**/*"]},
    entry_points={"console_scripts": commands(), **groups},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/lupin_engine"]),
        ("share/lupin_engine", ["package.xml"]),
        ("share/lupin_engine/launch", sorted(path.name for path in HERE.glob("*.launch.*"))),
        ("share/lupin_engine/config", ["parameters.yaml"]),
    ],
    cmdclass={"build_py": BuildWithMissions},
)
