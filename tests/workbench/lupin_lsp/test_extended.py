"""A lifecycle that extends the shipped one, in the editor: inherited names are offered and found."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.plugin.registry import Catalog
from lupin_lsp.completion import complete
from lupin_lsp.folder import Folder
from lupin_lsp.hover import hover
from lupin_lsp.navigation import mention_under
from lupin_lsp.places import definition
from lupin_lsp.rename import Refused, rename

SHIPPED = default_missions_folder() / "lifecycle.yaml"
OWN = """\
lifecycle: ward-robot
extends: greenhouse-robot
params: {dock_timeout_s: {default: 90 s}}
states:
  RETURNING:
    on: {operator.skip_current: DOCKED}
  DONE:
    after: {5 s: CLEANING}
  CLEANING:
    after: {"${ param.dock_timeout_s }": READY}
    on: {mission.start: {use: READY}}
"""


@pytest.fixture
def folder(missions: Path, catalog: Catalog) -> Folder:
    """A folder with a lifecycle that extends the shipped one."""
    (missions / "lifecycle.yaml").write_text(OWN)
    found = Folder(missions, catalog)
    assert found.survey() == {}
    return found


def leads_to(folder: Folder, name: str, marked: str) -> list[str]:
    """Return the lines that the definitions of what a `|` marks stand in."""
    path = folder.path / name
    mention = mention_under(folder, path, at(folder, path, marked))
    assert mention is not None
    spans = definition(folder, path, mention)
    lines = [(span.file, folder.text(span.file).count("\n", 0, span.start) + 1) for span in spans]
    return [f"{'shipped' if file == SHIPPED else file.name}:{line}" for file, line in lines]


def at(folder: Folder, path: Path, marked: str) -> int:
    """Return the offset of what a `|` marks."""
    return folder.text(path).index(marked.replace("|", "", 1)) + marked.index("|")


def line_of(text: str) -> int:
    """Return the number of the first line of the shipped lifecycle that begins so."""
    return SHIPPED.read_text(encoding="utf-8").splitlines().index(text) + 1


def test_definitions_are_found_in_both_files(folder: Folder) -> None:
    """What the project writes there, what it inherits in the shipped file."""
    assert leads_to(folder, "lifecycle.yaml", "extends: |green") == ["shipped:1"]
    assert leads_to(folder, "lifecycle.yaml", "5 s: |CLEANING") == ["lifecycle.yaml:9"]
    assert leads_to(folder, "lifecycle.yaml", "current: |DOCKED") == [f"shipped:{line_of('      DOCKED:')}"]
    assert leads_to(folder, "lifecycle.yaml", '}": |READY') == [f"shipped:{line_of('  READY:')}"]
    assert leads_to(folder, "lifecycle.yaml", "param.|dock") == ["lifecycle.yaml:3"]
    assert leads_to(folder, "inspection.yaml", "on_error: |FAULT") == [f"shipped:{line_of('  FAULT:')}"]


def test_inherited_names_are_offered(folder: Folder) -> None:
    """Where a name would be overridden, and as targets; the name of the lifecycle, too."""
    path = folder.path / "lifecycle.yaml"

    def offered(old: str, new: str) -> set[str]:
        text = OWN.replace(old, new.replace("|", ""), 1)
        folder.put(path, text)
        folder.check(path)
        offset = text.index(new.replace("|", "", 1)) + new.index("|")
        return {offer.label for offer in complete(folder, path, offset).found}

    assert offered("greenhouse-robot", "g|") == {"greenhouse-robot"}
    assert {"BOOT", "READY", "FAULT"} <= offered("  CLEANING:\n", "  |\n  CLEANING:\n")
    assert "RETURNING" not in offered("  CLEANING:\n", "  |\n  CLEANING:\n")
    assert {"BOOT", "RETURNING", "CLEANING"} <= offered("skip_current: DOCKED", "skip_current: |")
    assert "dock_retry_max" in offered("params: {dock", "params: {|, dock")


def test_an_inherited_state_says_where_it_is_from(folder: Folder) -> None:
    """By the name of its lifecycle."""
    path = folder.path / "lifecycle.yaml"
    found = hover(folder, path, at(folder, path, '}": |READY'))
    assert found is not None
    assert "greenhouse-robot" in found.text


def test_an_inherited_state_is_not_renamed(folder: Folder) -> None:
    """The shipped file is nobody's to edit; a state of one's own is renamed."""
    path = folder.path / "lifecycle.yaml"
    with pytest.raises(Refused, match="'DOCKED' is a state of the lifecycle that this one extends"):
        rename(folder, path, at(folder, path, "current: |DOCKED"), "HOME")
    edits = rename(folder, path, at(folder, path, "5 s: |CLEANING"), "TIDYING")
    assert {file: len(found) for file, found in edits.items()} == {path: 2}


def test_a_refused_override_is_marked_as_it_is_typed(folder: Folder) -> None:
    """As by the checker."""
    path = folder.path / "lifecycle.yaml"
    folder.put(path, OWN + "holds: {pause: {code: battery_low}}\n")
    assert [found.rule for found in folder.check(path)] == ["not-overridable"]
