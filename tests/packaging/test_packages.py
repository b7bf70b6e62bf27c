"""What the repository promises to pip and to colcon."""

from __future__ import annotations

import ast
import re
import xml.etree.ElementTree as ElementTree
from importlib.metadata import packages_distributions, requires
from pathlib import Path

import pytest

from tests.tools import load_tool

ROOT = Path(__file__).parents[2]
INTERFACES = {
    "lupin_msgs": ROOT / "lupin_msgs",
    "lupin_engine_msgs": ROOT / "interfaces" / "lupin_engine_msgs",
    "nav2_msgs": ROOT / "interfaces" / "nav2_msgs",
    "tf2_msgs": ROOT / "interfaces" / "tf2_msgs",
    "control_msgs": ROOT / "interfaces" / "control_msgs",
    "mirte_msgs": ROOT / "interfaces" / "mirte_msgs",
}
#: Brought by others that are declared, or present where a plugin of pytest is loaded.
BROUGHT = {"lupin-engine", "pydantic-core", "pytest"}
DEVELOPERS = re.compile("""extra == ["'](dev|docs|mutation)["']""")
#: Those that belong to others, of which a part is here.
SUBSETS = [name for name in INTERFACES if not name.startswith("lupin_")]


@pytest.mark.parametrize("name", ["package.xml", "setup.py", "COLCON_IGNORE"])
@pytest.mark.parametrize("folder", [".", "interfaces"])
def test_nothing_hides_our_own_interfaces_from_colcon(name: str, folder: str) -> None:
    assert not (ROOT / folder / name).exists()


@pytest.mark.parametrize(
    "folder", ["lupin_engine", "lupin_ros", "workbench", "plugins", *map("interfaces/{}".format, SUBSETS)]
)
def test_colcon_leaves_all_else_alone(folder: str) -> None:
    # It takes any module that is called setup.py for a package's.
    assert (ROOT / folder / "COLCON_IGNORE").exists()


def build_requirements(folder: Path) -> list[str]:
    text = (folder / "pyproject.toml").read_text(encoding="utf-8")
    listed = text.partition("\nrequires = [\n")[2].partition("\n]")[0]
    return [line.strip() for line in listed.splitlines()]


def test_interface_packages_are_built_with_the_same_tools() -> None:
    first, *others = [build_requirements(folder) for folder in INTERFACES.values()]
    assert len(first) > 10
    assert all(other == first for other in others)


@pytest.mark.parametrize("package", INTERFACES)
def test_what_is_built_upon_is_installed_for_the_build(package: str) -> None:
    # An environment that was made before hides a missing one: only a fresh machine compiles the interfaces.
    cmake = (INTERFACES[package] / "CMakeLists.txt").read_text(encoding="utf-8")
    found = {*re.findall(r"^find_package\((\w+)", cmake, re.MULTILINE)}
    manifest = ElementTree.parse(INTERFACES[package] / "package.xml").getroot()
    depended = {str(one.text) for one in manifest if one.tag in ("depend", "buildtool_depend")}
    installed = build_requirements(INTERFACES[package])
    assert len(found) > 1
    assert found <= depended
    assert [name for name in depended if f'"ros-jazzy-{name.replace("_", "-")}",' not in installed] == []


@pytest.mark.parametrize("package", INTERFACES)
def test_manifest(package: str) -> None:
    manifest = ElementTree.parse(INTERFACES[package] / "package.xml").getroot()
    assert manifest.findtext("name") == package
    maintainer = manifest.find("maintainer")
    assert maintainer is not None
    assert maintainer.get("email") == "o.a.e.devos@student.tudelft.nl"
    if package in SUBSETS:
        assert "subset" in manifest.findtext("description", "")


@pytest.mark.parametrize("package", INTERFACES)
def test_every_definition_is_built(package: str) -> None:
    folder = INTERFACES[package]
    cmake = (folder / "CMakeLists.txt").read_text(encoding="utf-8")
    files = [path for path in folder.glob("*/*") if path.suffix in (".msg", ".srv", ".action")]
    assert files
    assert all(f'"{path.parent.name}/{path.name}"' in cmake for path in files)
    assert "pip" not in cmake


def test_the_bootstrap_reads_the_same_requirements() -> None:
    bootstrap = load_tool("bootstrap")
    for folder in INTERFACES.values():
        read = bootstrap.build_requirements(folder / "pyproject.toml")
        assert [f'"{one}",' for one in read] == build_requirements(folder)


@pytest.mark.slow
def test_what_is_imported_is_declared() -> None:
    """Outside the extras for developers: on their machines everything is there anyway."""
    shipped = (each for each in requires("lupin-engine") or () if not DEVELOPERS.search(each))
    declared = {re.split(r"[^\w-]", each)[0].lower().replace("_", "-") for each in shipped} | BROUGHT
    owners, missing = packages_distributions(), set()
    for shelf in ("lupin_engine", "workbench"):  # the others use what ROS brings
        for file in (ROOT / shelf).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
                for owner in (owner for name in names for owner in owners.get(name.partition(".")[0], ())):
                    if owner.lower().replace("_", "-") not in declared:
                        missing.add(f"{file.relative_to(ROOT)}: {owner}")
    assert sorted({one.rpartition(" ")[2] for one in missing}) == [], sorted(missing)
