"""Plugins are found as installers describe them, without reading what every other package declares."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from lupin_engine.plugin.discovery import (
    VERBS,
    Distribution,
    EntryPoint,
    declared_in,
    entry_points,
    source_file,
)

NAV = EntryPoint("nav", "lupin_nav.catalog:PLUGIN")


def describe(
    folder: Path, description: str, text: str, about: str = "Name: far_sight\nVersion: 1.2\n"
) -> None:
    """Leave behind what an installer does."""
    (folder / description).mkdir(parents=True)
    (folder / description / "entry_points.txt").write_text(text, encoding="utf-8")
    (folder / description / "METADATA").write_text("Name: far_sight\nVersion: 1.2\n", encoding="utf-8")


def test_the_plugins_of_this_checkout_are_found() -> None:
    """It is installed so that it can be edited."""
    (nav,) = (point for point in entry_points() if point == NAV)
    assert str(nav.distribution).startswith("lupin-engine 0.")


@pytest.mark.parametrize(
    "description", ["far_sight-1.2.dist-info", "far_sight-1.2-py3.12.egg-info", "a.egg-info"]
)
def test_a_third_party_plugin_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, description: str
) -> None:
    """Whoever installed it: pip, colcon, or an old setup.py in place."""
    describe(
        tmp_path,
        description,
        "[console_scripts]\nsight = far_sight:main\n\n"
        "[lupin.plugins]\n# comment\nsight = far_sight.catalog:PLUGIN\nb=far_sight.b : PLUGIN\n\n"
        "[other.lupin.plugins]\nnone = far_sight:none\n",
    )
    found = [EntryPoint("b", "far_sight.b : PLUGIN"), EntryPoint("sight", "far_sight.catalog:PLUGIN")]
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    assert entry_points() == found
    assert [point.module for point in found] == ["far_sight.b", "far_sight.catalog"]


@pytest.mark.parametrize(
    ("value", "found"),
    [("os:sep", "/"), ("os.path : sep", "/"), ("os:path.sep [extra]", "/"), ("sys", sys)],
)
def test_an_entry_point_loads_what_it_names(value: str, found: object) -> None:
    """In every form that the packaging rules allow."""
    assert EntryPoint("any", value).load() == found


def test_an_entry_point_knows_who_brought_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As its installer described it."""
    describe(tmp_path, "far_sight-1.2.dist-info", "[lupin.plugins]\nsight = far:PLUGIN\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    (point,) = entry_points()
    assert point.distribution == Distribution("far_sight", "1.2")
    assert str(point) == "far:PLUGIN of far_sight 1.2"


def test_an_overlay_hides_what_it_was_built_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where its new version has no plugin any more."""
    describe(tmp_path / "old", "far_sight-1.0.dist-info", "[lupin.plugins]\nold = far:OLD\n")
    describe(tmp_path / "new", "Far.Sight-2.0.dist-info", "")
    monkeypatch.setattr(sys, "path", [str(tmp_path / "new"), str(tmp_path / "old")])
    assert entry_points() == []


def test_groups_are_kept_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package may bring plugins and verbs."""
    describe(tmp_path, "far-1.dist-info", "[lupin.plugins]\na = far:A\n[lupin.verbs]\nb = far:B\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    assert entry_points() == [EntryPoint("a", "far:A")]
    assert entry_points(VERBS) == [EntryPoint("b", "far:B")]


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
    ours = declared_in(Path(__file__).parents[3] / "pyproject.toml")
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
