"""Plugins are found as installers describe them, without reading what every other package declares."""

from __future__ import annotations

import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from lupin_engine.plugin.discovery import (
    GROUP,
    VERBS,
    Distribution,
    EntryPoint,
    declared_in,
    entry_points,
    source_file,
)

NAV = EntryPoint("nav", "lupin_nav.catalog:PLUGIN")


def describe(folder: Path, description: str, text: str) -> None:
    (folder / description).mkdir(parents=True)
    (folder / description / "entry_points.txt").write_text(text, encoding="utf-8")


def test_it_finds_what_the_standard_library_finds() -> None:
    """Also those of this checkout, which is installed so that it can be edited."""
    standard = {EntryPoint(point.name, point.value) for point in metadata.entry_points(group=GROUP)}
    assert NAV in standard
    assert set(entry_points()) == standard


@pytest.mark.parametrize(
    "description", ["far_sight-1.2.dist-info", "far_sight-1.2-py3.12.egg-info", "a.egg-info"]
)
def test_a_third_party_plugin_is_found(tmp_path: Path, description: str) -> None:
    """Whoever installed it: pip, colcon, or an old setup.py in place."""
    describe(
        tmp_path,
        description,
        "[console_scripts]\nsight = far_sight:main\n\n"
        "[lupin.plugins]\n# comment\nsight = far_sight.catalog:PLUGIN\nb=far_sight.b : PLUGIN\n\n"
        "[other.lupin.plugins]\nnone = far_sight:none\n",
    )
    found = [EntryPoint("b", "far_sight.b : PLUGIN"), EntryPoint("sight", "far_sight.catalog:PLUGIN")]
    assert entry_points([str(tmp_path)]) == found
    assert [point.module for point in found] == ["far_sight.b", "far_sight.catalog"]


def test_of_packages_with_one_name_the_first_on_the_path_counts(tmp_path: Path) -> None:
    """An overlay hides what it was built over, also where its new version has no plugin any more."""
    describe(tmp_path / "new", "Far.Sight-2.0.dist-info", "[lupin.plugins]\nnew = far:NEW\n")
    describe(tmp_path / "old", "far_sight-1.0.dist-info", "[lupin.plugins]\nold = far:OLD\n")
    (tmp_path / "none" / "far_sight.egg-info").mkdir(parents=True)
    folders = {name: str(tmp_path / name) for name in ("new", "old", "none")}
    assert entry_points([folders["new"], folders["old"]]) == [EntryPoint("new", "far:NEW")]
    assert entry_points([folders["old"], folders["new"]]) == [EntryPoint("old", "far:OLD")]
    assert entry_points([folders["none"], folders["old"]]) == []


def test_what_is_no_folder_is_passed_over(tmp_path: Path) -> None:
    """A path has zip files and folders that are not there; some packages are one file of the old form."""
    (tmp_path / "libraries.zip").write_bytes(b"PK")
    (tmp_path / "old-1.0.egg-info").write_text("Name: old", encoding="utf-8")
    path = [str(tmp_path / "libraries.zip"), str(tmp_path / "gone"), str(tmp_path)]
    assert entry_points(path) == []


@pytest.mark.parametrize(
    ("value", "found"),
    [("os:sep", "/"), ("os.path : sep", "/"), ("os:path.sep [extra]", "/"), ("sys", sys)],
)
def test_an_entry_point_loads_what_it_names(value: str, found: object) -> None:
    """In every form that the packaging rules allow."""
    assert EntryPoint("any", value).load() == found


def test_finding_plugins_does_not_import_the_readers_of_metadata() -> None:
    """They take longer to import than all plugins are found in."""
    program = (
        "import sys; from lupin_engine.plugin.registry import load_catalog; load_catalog(); "
        "print('importlib.metadata' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


@pytest.mark.parametrize(
    ("description", "name", "version", "text"),
    [
        ("Far_Sight-1.2.dist-info", "far-sight", "1.2", "far-sight 1.2"),
        ("far_sight-1.2-py3.12.egg-info", "far-sight", "1.2", "far-sight 1.2"),
        ("far_sight.egg-info", "far-sight", "", "far-sight"),
    ],
)
def test_an_entry_point_knows_who_brought_it(
    tmp_path: Path, description: str, name: str, version: str, text: str
) -> None:
    """As its installer described it; a project that is edited in place may tell no version."""
    describe(tmp_path, description, "[lupin.plugins]\nsight = far:PLUGIN\n")
    (point,) = entry_points([str(tmp_path)])
    assert point.distribution == Distribution(name, version, tmp_path / description)
    assert str(point.distribution) == text


def test_groups_are_kept_apart(tmp_path: Path) -> None:
    """A package may bring plugins and verbs."""
    describe(tmp_path, "far-1.dist-info", "[lupin.plugins]\na = far:A\n[lupin.verbs]\nb = far:B\n")
    assert entry_points([str(tmp_path)]) == [EntryPoint("a", "far:A")]
    assert entry_points([str(tmp_path)], VERBS) == [EntryPoint("b", "far:B")]


def test_a_project_tells_its_plugins_before_it_is_installed(tmp_path: Path) -> None:
    """This checkout's does, as it is installed."""
    project = tmp_path / "pyproject.toml"
    assert declared_in(project) == []
    project.write_text('[project.entry-points."lupin.plugins"]\nfar = "far:PLUGIN"\n\n[tool.x]\ny = "z"\n')
    assert declared_in(project) == [("far", "far:PLUGIN")]
    project.write_text(
        "[project.entry-points.'lupin.plugins']\n'far' = 'far:PLUGIN'  # \"the\" far one\nb = \"b:B\" # 'b'\n"
    )
    assert declared_in(project) == [("far", "far:PLUGIN"), ("b", "b:B")]
    ours = declared_in(Path(__file__).parents[2] / "pyproject.toml")
    assert ("nav", "lupin_nav.catalog:PLUGIN") in ours


def test_the_source_of_a_module_is_found_without_importing_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor the packages that it is in."""
    (tmp_path / "far" / "deep").mkdir(parents=True)
    (tmp_path / "far" / "__init__.py").write_text("raise SystemExit")
    (tmp_path / "far" / "deep" / "module.py").write_text("1 / 0")
    monkeypatch.syspath_prepend(tmp_path)
    assert source_file("far.deep.module") == str(tmp_path / "far" / "deep" / "module.py")
    assert source_file("far") == str(tmp_path / "far" / "__init__.py")
    assert (source_file("far.gone"), source_file("gone.far")) == (None, None)
    assert "far" not in sys.modules
