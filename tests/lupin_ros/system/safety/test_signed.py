"""`require_signed`, in the node: nothing is run but a bundle that was signed by a key that it knows."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_engine.missions.folders import default_missions_folder
from tests.lupin_ros.orchestrator.test_new_missions import Desk
from tests.lupin_ros.world import World

pytestmark = pytest.mark.timeout(180)

HOW = "a mission is signed with: lupin bundle MISSION --sign KEY"


@pytest.fixture
def desk(ros_domain: int) -> Iterator[Desk]:
    """An operator who sees which missions there are."""
    desk = Desk()
    yield desk
    desk.ros.close()


@pytest.fixture
def keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with our public key; beside it ours, another one, and a mission."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    shutil.copytree(default_missions_folder(), tmp_path / "missions")
    known = tmp_path / "keys"
    known.mkdir()
    for name, public in (("our.key", known / "our.pem"), ("other.key", tmp_path / "other.pem")):
        make = ["openssl", "genpkey", "-algorithm", "ed25519", "-out", name]
        subprocess.run(make, check=True, capture_output=True, umask=0o077)
        subprocess.run(["openssl", "pkey", "-in", name, "-pubout", "-out", public], check=True)
    return known


def bundle(folder: Path, *options: str, **changes: str) -> Path:
    """Put the inspection, changed, into the robot's file, at once."""
    text = (default_missions_folder() / "inspection.yaml").read_text(encoding="utf-8")
    for old, new in changes.items():
        text = text.replace(old, new)
    (folder / "missions" / "inspection.yaml").write_text(text, encoding="utf-8")
    assert main(["bundle", "inspection", "-o", "new.lupin", *options]) == 0
    return (folder / "new.lupin").replace(folder / "robot.lupin")


def test_what_is_not_signed_by_us_changes_nothing(
    world: World, desk: Desk, keys: Path, tmp_path: Path
) -> None:
    """The mission that was there can be started all the same; one that we sign takes its place."""
    robot = bundle(tmp_path, "--sign", "our.key")
    world.start_all(missions_path=robot, require_signed=keys)
    desk.offered("InspectionMission")
    bundle(tmp_path, InspectionMission="OtherMission")
    assert desk.problem() == f"{robot}: not signed; {HOW}"
    bundle(tmp_path, "--sign", "other.key", InspectionMission="OtherMission")
    theirs = f"{robot}: signed by a key that is none of those in {keys}; {HOW}"
    desk.until(lambda: desk.offers[-1]["problems"] == [theirs], "whose key it is")
    refused = desk.start("1", mission="OtherMission")
    assert refused.error_message == (
        f"unknown mission 'OtherMission'; allowed: 'InspectionMission'; what is new cannot be used: {theirs}"
    )
    assert desk.start("1").accepted
    desk.in_state("DONE")
    bundle(tmp_path, "--sign", "our.key", InspectionMission="OtherMission")
    desk.offered("OtherMission")
    with zipfile.ZipFile(robot, "a") as archive:
        archive.writestr("bindings/more.yaml", "binding: more")
    altered = f"{robot}: altered since it was made: bindings/more.yaml"
    assert desk.problem() == altered
    assert [m["mission"] for m in desk.offers[-1]["missions"]] == ["OtherMission"]


@pytest.mark.core
def test_a_folder_is_not_signed(world: World, keys: Path, tmp_path: Path) -> None:
    """The node does not start, and says what to do."""
    process = world.start("mission_orchestrator", missions_path="missions", require_signed=keys)
    assert process.wait(60.0) == 1
    log = world.log("mission_orchestrator").read_text(encoding="utf-8")
    assert log.splitlines()[-1] == (
        "lupin: missions: not signed, but require_signed asks for a signed bundle; make one with "
        "'lupin bundle MISSION --sign KEY', and name it as missions_path alone"
    )


def test_no_older_bundle_and_no_other_takes_its_place(
    world: World, desk: Desk, keys: Path, tmp_path: Path
) -> None:
    """Of the same key, while it runs, and after a new start; who means it says so."""
    robot = bundle(tmp_path, "--sign", "our.key", "--version", "2")
    world.start_all(missions_path=robot, require_signed=keys)
    desk.offered("InspectionMission")
    bundle(tmp_path, "--sign", "our.key", "--version", "3", InspectionMission="NewMission")
    desk.offered("NewMission")
    bundle(tmp_path, "--sign", "our.key", "--version", "2")
    older = f"{robot}: it is inspection 2, but 3 was run here already; if that is meant, set allow_bundles:="
    assert desk.problem() == f"{older}['inspection@2']"
    bundle(tmp_path, "--sign", "our.key", "--version", "4", "--name", "other")
    other = f"{robot}: it is 'other', but of its key only inspection was run here; if that is meant, set "
    desk.until(lambda: desk.offers[-1]["problems"] == [f"{other}allow_bundles:=['other']"], "another name")
    bundle(tmp_path, "--sign", "our.key")
    nameless = (
        f"{robot}: without a version, but of its key inspection 3 was run here; make it with "
        "'lupin bundle MISSION --sign KEY --version N', or set allow_bundles:=['unnamed']"
    )
    desk.until(lambda: desk.offers[-1]["problems"] == [nameless], "no name")
    assert [m["mission"] for m in desk.offers[-1]["missions"]] == ["NewMission"]

    bundle(tmp_path, "--sign", "our.key", "--version", "2")
    process = world.processes["mission_orchestrator"]
    process.kill()
    process.wait(10.0)
    process = world.start("mission_orchestrator", missions_path=robot, require_signed=keys)
    assert process.wait(60.0) == 1
    log = world.log("mission_orchestrator").read_text(encoding="utf-8")
    assert log.splitlines()[-1] == f"lupin: {older}['inspection@2']"
    desk.offers.clear()
    world.start(
        "mission_orchestrator", missions_path=robot, require_signed=keys, allow_bundles="['inspection@2']"
    )
    desk.offered("InspectionMission")
