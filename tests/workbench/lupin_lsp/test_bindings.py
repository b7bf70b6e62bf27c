"""Bindings in an editor: their findings, and what missions see of them while they are written."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.plugin.registry import load_catalog
from lupin_lsp.completion import complete
from lupin_lsp.folder import Folder, folder_of
from lupin_lsp.hover import hover
from lupin_lsp.navigation import mention_under
from lupin_lsp.places import definition

TUTORIAL = Path(__file__).parents[3] / "docs" / "tutorial"


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    """The tutorial's mission with its binding."""
    shutil.copytree(TUTORIAL / "bindings", tmp_path / "bindings")
    shutil.copy(TUTORIAL / "patrol.yaml", tmp_path)
    shutil.copy(default_missions_folder() / "lifecycle.yaml", tmp_path)
    return Folder(tmp_path, load_catalog())


def at(folder: Folder, name: str, mark: str) -> tuple[Path, int]:
    """Return a file and an offset in it: where `|` stands in `mark`."""
    path = folder.path / name
    before, _, after = mark.partition("|")
    assert folder.text(path).count(before + after) == 1
    return path, folder.text(path).index(before + after) + len(before)


def test_a_binding_has_findings_of_its_own(folder: Folder) -> None:
    """While it is written, at its own places."""
    path = folder.path / "bindings" / "photo_arm.yaml"
    assert folder_of(path) == folder.path
    folder.put(path, folder.text(path).replace("${ pose }", "${ poze }"))
    (found,) = folder.check(path)
    assert (found.place.line, found.problem, found.hint) == (
        13,
        "unknown name 'poze'",
        "did you mean 'pose'?",
    )


def test_what_it_may_not_reach_is_told_while_it_is_written(folder: Folder) -> None:
    """And the file that allows it is no mission, wherever it stands."""
    path, robot = folder.path / "bindings" / "photo_arm.yaml", folder.path / "lupin.yaml"
    folder.put(path, folder.text(path).replace("/lupin/arm/preset", "/other/arm"))
    (found,) = folder.check(path)
    assert (found.place.line, found.rule) == (12, "not-allowed")
    robot.write_text("allow: {services: /other/arm}", encoding="utf-8")
    folder.put(robot, folder.text(robot))
    assert (folder.check(path), folder.check(robot)) == ((), ())
    assert robot not in folder.missions()


def test_missions_see_what_is_written_in_it(folder: Folder) -> None:
    """An operation that was added a moment ago, and is not saved, is offered."""
    path = folder.path / "bindings" / "photo_arm.yaml"
    text = folder.text(path)
    folder.put(path, text + text[text.index("  move:") :].replace("  move:", "  stow:"))
    mission, offset = at(folder, "patrol.yaml", "with: {max_variance: 0.25|}")
    folder.put(mission, folder.text(mission).replace("do: nav.localize", "do: "))
    folder.refresh()
    mission, offset = at(folder, "patrol.yaml", "      do: |\n")
    offered = [offer.label for offer in complete(folder, mission, offset).found]
    assert {"photo_arm.move", "photo_arm.stow", "nav.localize"} <= set(offered)


def test_keys_of_a_binding_are_offered(folder: Folder) -> None:
    """With what they mean."""
    path = folder.path / "bindings" / "photo_arm.yaml"
    folder.put(path, folder.text(path) + "    \n")
    offered = {offer.label for offer in complete(folder, path, len(folder.text(path)) - 1).found}
    expected = {"action", "code_when", "cut_short", "progress", "rejected", "result", "unavailable"}
    assert offered == {*expected, "on_restart", "updates", "watch"}


@pytest.mark.parametrize(
    ("mark", "told", "line"),
    [
        ("do: photo_arm.mo|ve\n          with: {pose: home}", "Send the arm to a pose", 8),
        ("with: {po|se: home}", "name of the pose", 11),
    ],
)
def test_a_mission_is_told_what_it_uses(folder: Folder, mark: str, told: str, line: int) -> None:
    """On hovering, and by leading to the file."""
    folder.refresh()
    path, offset = at(folder, "patrol.yaml", mark)
    shown = hover(folder, path, offset)
    assert shown is not None
    assert told in shown.text
    mention = mention_under(folder, path, offset)
    assert mention is not None
    (place,) = definition(folder, path, mention)
    assert place.file.name == "photo_arm.yaml"
    assert place.file.read_text(encoding="utf-8").count("\n", 0, place.start) + 1 == line


DOCS = Path(__file__).parents[3] / "docs"
SPRAYER = DOCS / "sprayer"


@pytest.fixture
def sprayer(tmp_path: Path) -> Folder:
    """A mission whose plugin has everything that a binding can."""
    shutil.copytree(SPRAYER / "bindings", tmp_path / "bindings")
    shutil.copy(SPRAYER / "spray.yaml", tmp_path)
    shutil.copy(default_missions_folder() / "lifecycle.yaml", tmp_path)
    return Folder(tmp_path, load_catalog())


@pytest.mark.parametrize(
    ("mark", "told", "line"),
    [
        ("do: sprayer.sp|ray", "Drive the cart to a place", "  spray:"),
        ("- sprayer.la|mp: {green: 1}", "Light the lamp", "  lamp:"),
        ("sprayer.lamp: {gr|een: 1}", "share of green", "      green: "),
        ("sprayer.le|ak:\n", "The cart loses water", "  leak:"),
        ("value: tank.le|vel", "How full the tank is", "  tank.level:"),
    ],
)
def test_everything_of_a_binding_is_known(sprayer: Folder, mark: str, told: str, line: str) -> None:
    """Actions, events and live values as well."""
    sprayer.refresh()
    path, offset = at(sprayer, "spray.yaml", mark)
    shown = hover(sprayer, path, offset)
    assert shown is not None
    assert told in shown.text
    mention = mention_under(sprayer, path, offset)
    assert mention is not None
    (place,) = definition(sprayer, path, mention)
    text = place.file.read_text(encoding="utf-8")
    assert place.file.name == "sprayer.yaml"
    assert text[text.rindex("\n", 0, place.start) + 1 :].startswith(line)


def test_what_a_live_value_can_say_is_offered(sprayer: Folder) -> None:
    """Its keys, its type, its unit, how the topic is carried."""
    path = sprayer.path / "bindings" / "sprayer.yaml"
    text = sprayer.text(path)
    for written, wanted in (
        ('    unit: "%"\n', "cm"),
        ("    type: number\n", "pose"),
        ("    freshness: 5 s\n", "initial"),
    ):
        key = written.partition(":")[0]
        line = f"{key}: " if wanted != "initial" else "    "
        sprayer.put(path, text.replace(written, f"{line}\n"))
        offset = sprayer.text(path).index(f"{line}\n", text.index(written)) + len(line)
        assert wanted in {offer.label for offer in complete(sprayer, path, offset).found}


@pytest.fixture
def wrist(tmp_path: Path) -> Folder:
    """A mission whose plugin counts in degrees and millimetres."""
    shutil.copytree(DOCS / "wrist" / "bindings", tmp_path / "bindings")
    shutil.copy(DOCS / "wrist" / "feel.yaml", tmp_path)
    shutil.copy(default_missions_folder() / "lifecycle.yaml", tmp_path)
    return Folder(tmp_path, load_catalog())


@pytest.mark.parametrize(
    "mark", ["angle: {type: angle, unit: |deg, min", "bent: {type: length, unit: |mm, from"]
)
def test_units_are_offered_wherever_one_stands(wrist: Folder, mark: str) -> None:
    """Beside an argument, and beside a field."""
    path, offset = at(wrist, "bindings/wrist.yaml", mark)
    text = wrist.text(path)
    wrist.put(path, text[:offset] + text[text.index(",", offset) :])
    assert {"deg", "mm", "ms", "%"} <= {offer.label for offer in complete(wrist, path, offset).found}


def test_an_argument_is_told_with_its_range(wrist: Folder) -> None:
    """As somebody would write it."""
    wrist.refresh()
    path, offset = at(wrist, "feel.yaml", "with: {an|gle: ")
    shown = hover(wrist, path, offset)
    assert shown is not None
    assert "`angle`: angle in rad — how far from the middle (-90 deg to 90 deg)" in shown.text
