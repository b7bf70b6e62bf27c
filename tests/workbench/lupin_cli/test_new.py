"""`lupin new`: what it writes can be checked, simulated and tested at once, and nothing is written over."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_engine import __version__
from lupin_engine.chart.source import head
from lupin_engine.errors import shortened
from lupin_engine.missions.folders import default_missions_folder

#: What every author's folder begins with.
BEGINNING = ["missions/inspection.yaml", "missions/lifecycle.yaml", "scenarios/inspection.scenario.yaml"]

#: The lifecycle that a folder begins with.
EXTENDING = """\
lifecycle: my-robot
extends: greenhouse-robot
# Write only what differs here; lupin check --expand prints the whole. For example:
# params: {PARAMETER: {default: 90 s}}             # one key of one parameter, and all others stay
# states: {STATE: {on: {EVENT: OTHER_STATE}}}      # one transition, or a state of your own
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Stand in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def files(folder: Path) -> list[str]:
    """Return the files below a folder."""
    return sorted(str(file.relative_to(folder)) for file in folder.rglob("*") if file.is_file())


def test_it_begins_a_mission_in_an_empty_folder(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The lifecycle extends the shipped one; the output says what was written and what to type next."""
    assert main(["new", "inspection"]) == 0
    assert files(folder) == BEGINNING
    assert (folder / "missions" / "lifecycle.yaml").read_text() == EXTENDING
    *written, following = capsys.readouterr().out.splitlines()
    assert sorted(written) == [f"wrote {file}" for file in BEGINNING]
    assert (
        following
        == "next: lupin check missions; lupin simulate inspection; lupin test; lupin prove inspection"
    )


def test_what_its_lifecycle_suggests_is_right(folder: Path) -> None:
    """Each comment can be made a line."""
    assert main(["new", "round_trip"]) == 0
    lifecycle = folder / "missions" / "lifecycle.yaml"
    text = EXTENDING.replace("# params", "params").replace("# states", "states")
    text = text.replace("PARAMETER", "dock_timeout_s").replace("OTHER_STATE", "DONE")
    lifecycle.write_text(text.replace("STATE", "RETURNING").replace("EVENT", "operator.skip_current"))
    assert main(["check", "--strict", "missions"]) == 0
    assert main(["simulate", "round_trip"]) == 0
    assert main(["test"]) == 0


@pytest.mark.slow
def test_a_defect_in_an_override_is_found(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By a property that it inherits: a mission that ends where it is, not at home."""
    assert main(["new", "round_trip"]) == 0
    lifecycle = folder / "missions" / "lifecycle.yaml"
    lifecycle.write_text(f"{EXTENDING}states: {{MISSION: {{on_done: DONE}}}}\n")
    assert main(["check", "--strict", "missions"]) == 0
    assert main(["prove", "round_trip", "--no-restarts"]) == 1
    said = capsys.readouterr().out
    assert "✗ ends_at_home: A mission ends on the way home, or in FAULT." in said
    assert said.count("✗ ") == 2  # once more in the story


def test_a_copy_says_what_it_is_of(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By name, version and digest; it is the shipped one else."""
    assert main(["new", "round_trip", "--copy"]) == 0
    text = (folder / "missions" / "lifecycle.yaml").read_text(encoding="utf-8")
    first, origin, *rest = text.splitlines(keepends=True)
    shipped = (default_missions_folder() / "lifecycle.yaml").read_bytes()
    digest = hashlib.sha256(shipped).hexdigest()[:16]
    said = f"origin: {{lifecycle: greenhouse-robot, version: {__version__}, sha256: {digest}}}\n"
    assert origin.replace('"', "") == said
    assert first + "".join(rest) == shipped.decode()
    assert main(["check", "--strict", "missions"]) == 0


def test_a_lifecycle_of_ones_own_is_copied_as_it_is(folder: Path) -> None:
    """With the mission that stands in it, and what it overrides."""
    other = folder / "other"
    other.mkdir()
    own = "lifecycle: ward\nextends: greenhouse-robot\nparams: {dock_timeout_s: {default: 90 s}}\n"
    (other / "lifecycle.yaml").write_text(own)
    (other / "alone.yaml").write_text("mission: Alone\nstates: {done: {type: final}}\n")
    assert main(["new", "a", "--like", "other/alone.yaml"]) == 0
    assert (folder / "missions" / "lifecycle.yaml").read_text() == own


def test_the_lifecycle_is_printed_and_drawn_as_one(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As it is with what it extends; only one, and none with an error."""
    assert main(["new", "round_trip"]) == 0
    lifecycle = folder / "missions" / "lifecycle.yaml"
    skip = "states: {RETURNING: {on: {operator.skip_current: DONE}}}"
    lifecycle.write_text(f"{EXTENDING}params: {{dock_timeout_s: {{default: 90 s}}}}\n{skip}\n")
    capsys.readouterr()
    assert main(["check", "--expand"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("lifecycle: my-robot\nprofile: greenhouse\n")
    assert "  dock_timeout_s: {type: duration, default: 90 s, min: 1 s, summary: longest drive home" in text
    assert main(["diagram", "round_trip"]) == 0
    drawn = capsys.readouterr().out
    assert "DRIVING_HOME" in drawn
    assert "skip_current" in drawn
    assert main(["check", "--expand", "missions", str(default_missions_folder())]) == 2
    assert capsys.readouterr().err.startswith("lupin: --expand prints one lifecycle, not missions/")
    lifecycle.write_text(f"{EXTENDING}holds: {{pause: {{code: battery_low}}}}\n")
    assert main(["check", "--expand"]) == 1
    assert "missions/lifecycle.yaml:6:9: error: holds.pause: the hold 'pause'" in capsys.readouterr().err


@pytest.mark.slow
def test_its_properties_are_proven(capsys: pytest.CaptureFixture[str]) -> None:
    """Both apply, and nothing is broken; a mission that leaves its work out breaks them."""
    assert main(["new", "round_trip"]) == 0
    assert main(["prove", "round_trip", "--no-restarts"]) == 0
    said = capsys.readouterr().out
    assert "✓ round_trip_prepares: from the start of a mission: never in_state('WORKING'), until" in said
    assert "✓ round_trip_works: before the mission is done: in_state('PREPARE'), in_state('WORKING')" in said
    mission = Path("missions/round_trip.yaml")
    hasty = "after: {2 s: WORKING}\n    on: {operator.skip_current: done}"
    mission.write_text(mission.read_text().replace("after: {2 s: WORKING}", hasty))
    assert main(["prove", "round_trip", "--no-restarts", "--quiet"]) == 1
    assert "the mission is done, but in_state('WORKING') never became true" in capsys.readouterr().out


@pytest.mark.parametrize("like", [[], ["--like", "inspection"]], ids=["plain", "like another"])
def test_what_it_writes_is_right(like: list[str]) -> None:
    """No warning either; the mission ends well and its scenario holds."""
    assert main(["new", "round_trip", *like]) == 0
    assert main(["check", "--strict", "missions"]) == 0
    assert main(["simulate", "round_trip"]) == 0
    assert main(["test"]) == 0


def test_a_copy_has_a_name_of_its_own_and_the_parts(folder: Path) -> None:
    """Two missions of one name could not be loaded together."""
    assert main(["new", "my_tour", "--like", "inspection"]) == 0
    assert head(folder / "missions" / "my_tour.yaml") == ("mission", "MyTour")
    assert "missions/parts/visit_targets.yaml" in files(folder)


def test_the_mission_to_be_like_may_be_ones_own(folder: Path) -> None:
    """The nearest of that name is meant, as by every verb."""
    assert main(["new", "inspection"]) == 0
    mission = folder / "missions" / "inspection.yaml"
    mission.write_text(mission.read_text().replace("5 s", "6 s"))
    assert main(["new", "second", "--like", "inspection"]) == 0
    copy = (folder / "missions" / "second.yaml").read_text()
    own = mission.read_text().replace("mission: Inspection", "mission: Second")
    named = own.replace("inspection_prepares:", "second_prepares:").replace(
        "inspection_works:", "second_works:"
    )
    assert copy == named
    assert main(["check", "--strict", "missions"]) == 0


def test_what_exists_is_kept(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An author's lifecycle is the author's."""
    lifecycle = folder / "missions" / "lifecycle.yaml"
    lifecycle.parent.mkdir()
    lifecycle.write_text("lifecycle: mine\n")
    assert main(["new", "inspection"]) == 0
    assert lifecycle.read_text() == "lifecycle: mine\n"
    assert "kept  missions/lifecycle.yaml" in capsys.readouterr().out.splitlines()


@pytest.mark.parametrize("file", ["missions/inspection.yaml", "scenarios/inspection.scenario.yaml"])
def test_a_mission_that_exists_is_not_written_over(
    folder: Path, file: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing at all is written then."""
    (folder / file).parent.mkdir()
    (folder / file).write_text("precious")
    assert main(["new", "inspection"]) == 2
    assert capsys.readouterr().err == f"lupin: {file!r} exists; choose another name, or remove it\n"
    assert files(folder) == [file]
    assert (folder / file).read_text() == "precious"


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("WaterBeds", "; did you mean 'water_beds'?"),
        ("water-beds", "; did you mean 'water_beds'?"),
        ("missions/a", "; did you mean 'missions_a'?"),
        ("lifecycle", ""),
        ("3", ""),
        ("..", ""),
        ("true", ""),
        ("null", ""),
        ("a" * 61, ""),
    ],
)
def test_a_name_that_cannot_be_one(
    folder: Path, name: str, hint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Answered with what a name looks like, and the nearest one."""
    assert main(["new", name]) == 2
    wanted = f"write at most 60 lower-case letters, digits and underscores, such as water_beds{hint}"
    problem = f"{shortened(name)!r} cannot be the name of a mission's file: {wanted}"
    assert capsys.readouterr().err == f"lupin: {problem}\n"
    assert files(folder) == []


def test_nothing_to_be_like(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The text lists those that there are."""
    assert main(["new", "a", "--like", "inspction"]) == 2
    assert capsys.readouterr().err.endswith("did you mean 'inspection'?\n")
    assert main(["new", "A", "--like", "inspction"]) == 2
    name, like = capsys.readouterr().err.splitlines()
    assert name.startswith("lupin: 'A' cannot be the name of a mission's file")
    assert like.endswith("did you mean 'inspection'?")
    assert files(folder) == []


def test_like_a_mission_that_stands_alone(folder: Path) -> None:
    """It is in the shipped lifecycle, and so is the copy."""
    (folder / "alone.yaml").write_text("mission: Alone\nstates: {done: {type: final}}\n")
    assert main(["new", "a", "--like", "alone.yaml"]) == 0
    assert (folder / "missions" / "lifecycle.yaml").read_text(encoding="utf-8") == EXTENDING
    assert main(["check", "missions"]) == 0


def test_a_folder_that_cannot_be_written(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One line, no traceback."""
    (folder / "missions").write_text("a file")
    assert main(["new", "a"]) == 2
    assert capsys.readouterr().err.startswith("lupin: cannot write 'missions/lifecycle.yaml': ")


def test_a_copy_has_properties_of_its_own(folder: Path) -> None:
    """Missions that are loaded together have no two of one name."""
    assert main(["new", "patrol"]) == 0
    mission = folder / "missions" / "patrol.yaml"
    own = """properties:                                # mine
  calm:
    never: in_state('WORKING') and input.estop and not held(estop)

  # the other one
  patrol_works: {visit_all: in_state('WORKING')}
initial:"""
    head, _, rest = mission.read_text(encoding="utf-8").partition("properties:")
    mission.write_text(f"{head}{own}{rest.partition('initial:')[2]}", encoding="utf-8")
    assert main(["new", "second", "--like", "patrol"]) == 0
    copy = (folder / "missions" / "second.yaml").read_text(encoding="utf-8")
    assert own.replace("calm:", "second_calm:").replace("patrol_", "second_") in copy
    assert main(["check", "--strict", "missions"]) == 0
