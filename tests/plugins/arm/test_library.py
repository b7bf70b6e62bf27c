"""The library of the arm: names, limits, and a file that survives what befalls it."""

from __future__ import annotations

import errno
import json
import math
import os
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_arm.joints import ARM, JAW_CLOSED, JAW_OPEN, check_pose
from lupin_arm.library import (
    BACKUPS,
    MAX_BYTES,
    MAX_ENTRIES,
    MAX_WAYPOINTS,
    Library,
    NotInLibrary,
    Sequence,
    StoredPose,
    StoreFailed,
    Waypoint,
    beyond_limits,
    checked_pose,
    valid_name,
)

HERE = StoredPose(arm=[0.1, 0.2, 0.3, 0.4], created="2026-01-01T00:00:00+00:00")
WALK = Sequence(duration_s=1.0, waypoints=[Waypoint(t=0.0, arm=[0.0] * 4), Waypoint(t=1.0, arm=[0.1] * 4)])
ANY_NUMBER = st.floats(allow_nan=True, allow_infinity=True)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where the library is."""
    return tmp_path / "arm_library.json"


def names(folder: Path) -> list[str]:
    """Return what lies in a folder."""
    return sorted(found.name for found in folder.iterdir())


def written(path: Path, **changed: Any) -> None:
    """Write a library by hand."""
    data = {"version": 1, "poses": {}, "sequences": {}, **changed}
    path.write_text(json.dumps(data))


# --- names


@pytest.mark.parametrize(
    ("given_name", "name"),
    [("home", "home"), ("  Home ", "home"), ("OVER_POT-2", "over_pot-2"), ("7", "7"), ("a" * 32, "a" * 32)],
)
def test_names_are_trimmed_and_lower_case(given_name: str, name: str) -> None:
    """Whoever says Home means home."""
    assert valid_name(given_name) == name


@pytest.mark.parametrize(
    "name", ["", " ", "a" * 33, "_a", "-a", "a.b", "a/b", "..", "ä", "a b", "a\nb", "a\0"]
)
def test_other_names_are_refused(name: str) -> None:
    """The text says what a name is."""
    with pytest.raises(
        NotInLibrary, match="a name has 1 to 32 letters a to z, digits, - and _, beginning with"
    ):
        valid_name(name)


@given(st.from_regex(r"\A\s*[A-Za-z0-9][A-Za-z0-9_-]{0,31}\s*\Z"))
def test_a_name_is_what_it_becomes(text: str) -> None:
    """Whatever is taken for a name is one when it is given again."""
    name = valid_name(text)
    assert name == text.strip().lower()
    assert valid_name(name) == name


@given(st.text(min_size=200))
def test_a_refusal_is_short(text: str) -> None:
    """It is shown on a screen."""
    with pytest.raises(NotInLibrary) as refused:
        valid_name(f"!{text}")
    assert len(str(refused.value)) < 400


# --- limits


@given(st.lists(ANY_NUMBER, max_size=6), st.none() | ANY_NUMBER)
def test_whatever_is_kept_may_be_sent(arm: list[float], jaw: float | None) -> None:
    """A pose is refused, or it is inside the limits of every joint."""
    try:
        pose, told = checked_pose(arm, jaw, "")
    except NotInLibrary:
        finite = all(map(math.isfinite, arm if jaw is None else [*arm, jaw]))
        assert not finite or len(arm) != len(ARM)
    else:
        check_pose(pose.arm)
        assert pose.gripper is None or JAW_OPEN <= pose.gripper <= JAW_CLOSED
        assert beyond_limits(pose) == ""
        assert bool(told) or pose.arm == pytest.approx(arm)


def test_five_values_are_not_four() -> None:
    """Hazard of section 6: they were cut to four before anybody looked."""
    with pytest.raises(NotInLibrary, match=r"expected 4 angles \(.*\), got 5"):
        checked_pose([0.0] * 5, None, "")


def test_what_was_brought_inside_the_limits_is_told() -> None:
    pose, told = checked_pose([2.0, math.radians(-90.0), 0.5, math.radians(88.0)], 1.0, "now")
    assert told == [
        "shoulder_pan 114.6 deg is beyond its limit, kept as 90 deg",
        "shoulder_lift -90.0 deg is beyond its limit, kept as -86 deg",
        "the gripper is beyond its limit, kept as 30 deg",
    ]
    assert pose.arm == pytest.approx(
        [math.radians(angle) for angle in (90.0, -86.0, math.degrees(0.5), 88.0)]
    )
    assert (pose.gripper, pose.created, pose.note) == (JAW_CLOSED, "now", "")
    assert checked_pose([0.0] * 4, JAW_OPEN, "")[1] == []


# --- poses and sequences


def test_a_library_that_is_not_there_is_empty_and_writes_nothing(path: Path) -> None:
    """Reading changes nothing."""
    library = Library(path)
    assert library.listing() == {"poses": [], "sequences": []}
    assert library.notices == []
    assert names(path.parent) == []


def test_what_is_saved_is_there_after_a_restart(path: Path) -> None:
    """In the form that the interface document says."""
    library = Library(path)
    library.save_pose(" Here ", HERE, overwrite=False)
    library.save_sequence("walk", WALK, overwrite=False)
    again = Library(path)
    assert again.pose("here") == HERE
    assert again.sequence("walk") == WALK
    data = json.loads(path.read_text())
    assert data["version"] == 1
    assert set(data["poses"]["here"]) == {"arm", "gripper", "created", "note"}
    keys = {"mode", "include_gripper", "duration_s", "created", "note", "waypoints"}
    assert set(data["sequences"]["walk"]) == keys
    assert data["sequences"]["walk"]["waypoints"][0] == {"t": 0.0, "arm": [0.0] * 4, "gripper": None}


def test_the_listing_is_sorted_and_has_no_waypoints(path: Path) -> None:
    """Names and what is to be known of them."""
    library = Library(path)
    for name in ("b", "a"):
        library.save_pose(name, HERE, overwrite=False)
    library.save_sequence("walk", WALK, overwrite=False)
    assert library.listing() == {
        "poses": [{"name": name, "note": "", "has_gripper": False} for name in ("a", "b")],
        "sequences": [
            {"name": "walk", "mode": "teleop", "duration_s": 1.0, "n_waypoints": 2, "include_gripper": False}
        ],
    }


def test_an_entry_is_overwritten_only_when_asked_for_and_keeps_its_note(path: Path) -> None:
    """A note was written by a person."""
    written(path, poses={"here": {"arm": [0.0] * 4, "gripper": None, "created": "", "note": "over the pot"}})
    library = Library(path)
    with pytest.raises(NotInLibrary, match="pose 'here' exists; choose another name or overwrite it"):
        library.save_pose("here", HERE, overwrite=False)
    library.save_pose("here", HERE, overwrite=True)
    assert library.pose("here").arm == HERE.arm
    assert library.pose("here").note == "over the pot"


def test_entries_are_renamed_and_deleted(path: Path) -> None:
    """What is not there or already there is refused, with what is."""
    library = Library(path)
    library.save_pose("here", HERE, overwrite=False)
    library.save_pose("there", HERE, overwrite=False)
    assert library.edit("pose", "here", " Pot ") == "renamed pose 'here' to 'pot'"
    assert library.edit("pose", "pot", "pot") == "renamed pose 'pot' to 'pot'"
    refusals = {
        ("poses", "pot", ""): "unknown kind 'poses'; did you mean 'pose'?",
        ("pose", "pott", ""): "unknown pose 'pott'; did you mean 'pot'?",
        ("sequence", "pot", ""): "unknown sequence 'pot'; no sequence is saved",
        ("pose", "pot", "there"): "pose 'there' exists; delete it first or choose another name",
        ("pose", "pot", "a/b"): "invalid name 'a/b'",
        ("pose", "pot", " \n"): "invalid name ''",  # no wish to delete it
    }
    for request, why in refusals.items():
        with pytest.raises(NotInLibrary) as refused:
            library.edit(*request)
        assert str(refused.value).startswith(why), request
    assert library.edit("pose", "pot", "") == "deleted pose 'pot'"
    assert [entry["name"] for entry in Library(path).listing()["poses"]] == ["there"]


def test_a_library_is_full_some_day(path: Path) -> None:
    """Whoever asks in a loop does not fill the disk; what is there may still be overwritten."""
    entry = {"arm": [0.0] * 4, "gripper": None, "created": "", "note": ""}
    written(path, poses={f"p{number}": entry for number in range(MAX_ENTRIES)})
    library = Library(path)
    with pytest.raises(NotInLibrary, match=f"the library is full: {MAX_ENTRIES} poses; delete some"):
        library.save_pose("one-more", HERE, overwrite=False)
    library.save_pose("p7", HERE, overwrite=True)


@pytest.mark.slow
def test_waypoints_are_counted_over_all_sequences(path: Path) -> None:
    """The whole file is written with every change, by the process that must hear the emergency stop."""
    half = [Waypoint(t=0.0, arm=[0.0] * 4)] * (MAX_WAYPOINTS // 2)
    library, stale = Library(path), Library(path)
    for name in ("one", "two"):
        library.save_sequence(name, Sequence(duration_s=0.0, waypoints=half), overwrite=False)
    with pytest.raises(
        NotInLibrary, match=f"the library is full: {MAX_WAYPOINTS} waypoints in all; delete some"
    ):
        library.save_sequence("walk", WALK, overwrite=False)
    with pytest.raises(NotInLibrary, match="waypoints in all"):  # what somebody else has saved counts as well
        stale.save_sequence("walk", WALK, overwrite=False)
    library.save_sequence("two", WALK, overwrite=True)
    library.save_sequence("walk", WALK, overwrite=False)
    assert [entry["n_waypoints"] for entry in library.listing()["sequences"]] == [len(half), 2, 2]


def test_limits_are_checked_before_a_replay(path: Path) -> None:
    """A file can be written by hand, with degrees for example."""
    far = WALK.model_dump()
    far["waypoints"][1]["arm"][2] = 57.3
    jaw = WALK.model_dump()
    jaw["waypoints"][0]["gripper"] = -30.0
    written(path, sequences={"far": far, "jaw": jaw})
    library = Library(path)
    why = "waypoint 2: elbow: 3283.0 deg is not within -90 to 90; record it again or delete it"
    with pytest.raises(NotInLibrary, match=f"sequence 'far' is beyond the limits: {why}"):
        library.sequence("far")
    with pytest.raises(NotInLibrary, match=r"waypoint 1: gripper: -30 rad is not within -0\.2 to 0\.25"):
        library.sequence("jaw")


# --- the file


def test_earlier_states_of_the_file_are_kept(path: Path) -> None:
    """As many as are kept, the newest first."""
    library = Library(path)
    for number in range(BACKUPS + 3):
        library.save_pose(f"p{number}", HERE, overwrite=False)
    backups = [f"arm_library.bak{number}" for number in ("", *range(2, BACKUPS + 1))]
    assert names(path.parent) == sorted([path.name, *backups])
    kept = [len(json.loads(path.with_name(name).read_text())["poses"]) for name in backups]
    assert kept == [BACKUPS + 2, BACKUPS + 1, BACKUPS]


def test_there_is_always_a_main_file(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Hazard of section 6: a crash between two renames left none. Stopped at any call, the file is whole."""
    library = Library(path)
    library.save_pose("first", HERE, overwrite=False)
    for name in ("replace", "link", "fsync"):
        real, stopped = getattr(os, name), 0
        for survived in range(4):
            left = [survived]

            def crash(*args: Any, _real: Any = real, _left: list[int] = left, **named: Any) -> Any:
                if not _left[0]:
                    raise KeyboardInterrupt
                _left[0] -= 1
                return _real(*args, **named)

            with monkeypatch.context() as patch:
                patch.setattr(os, name, crash)
                try:
                    library.save_pose(f"{name}{survived}", HERE, overwrite=True)
                except KeyboardInterrupt:
                    stopped += 1
            found = Library(path)
            assert found.notices == [], (name, survived)
            assert "first" in [entry["name"] for entry in found.listing()["poses"]]
            library = found
        assert 0 < stopped < 4, f"a save calls {name}, and ends"


def test_a_file_that_only_its_backup_is_left_of_is_taken_from_there(path: Path) -> None:
    """What older programs left behind when they crashed."""
    library = Library(path)
    library.save_pose("first", HERE, overwrite=False)
    library.save_pose("second", HERE, overwrite=False)
    path.unlink()
    found = Library(path)
    assert [entry["name"] for entry in found.listing()["poses"]] == ["first"]
    assert found.notices == ["arm_library.json is missing; taken from arm_library.bak"]


@pytest.mark.parametrize(
    "content", ["", "{", "[]", "null", '"x"', "\x00\xff", "[" * 100_000, '{"poses": {}}', '{"version": "1"}']
)
def test_a_corrupt_file_is_kept_aside(path: Path, content: str) -> None:
    """Wrong JSON and JSON of a wrong shape alike; the next one gets the next number."""
    for number in (1, 2):
        path.write_bytes(content.encode("latin-1"))
        library = Library(path)
        kept = path.with_name(f"arm_library.corrupt-{number}.json")
        assert kept.read_bytes() == content.encode("latin-1")
        (notice,) = library.notices
        assert notice.startswith("arm_library.json cannot be read (")
        assert notice.endswith(f"is kept as {kept.name}; the library is empty")
        assert library.listing() == {"poses": [], "sequences": []}


def test_a_corrupt_file_is_replaced_by_its_backup(path: Path) -> None:
    """The operator has lost the last change, not all of them."""
    library = Library(path)
    library.save_pose("first", HERE, overwrite=False)
    library.save_pose("second", HERE, overwrite=False)
    path.write_text("{")
    found = Library(path)
    assert [entry["name"] for entry in found.listing()["poses"]] == ["first"]
    assert found.notices[0].endswith("; taken from arm_library.bak")
    found.save_pose("third", HERE, overwrite=False)
    assert [entry["name"] for entry in Library(path).listing()["poses"]] == ["first", "third"]


def test_a_wrong_shape_does_not_raise(path: Path) -> None:
    """Hazard of section 6. Entries that are wrong are left out, the file as it was is kept."""
    good = HERE.model_dump()
    poses = {
        "good": good,
        "short": {**good, "arm": [0.0]},
        "text": {**good, "arm": "0, 0, 0, 0"},
        "texts": {**good, "arm": ["0.0"] * 4},
        "../x": good,
        "list": [],
    }
    back = {**WALK.model_dump(), "waypoints": [{"t": 1.0, "arm": [0.0] * 4}, {"t": 0.5, "arm": [0.0] * 4}]}
    written(path, poses=poses, sequences={"walk": WALK.model_dump(), "back": back, "none": {"waypoints": []}})
    before = path.read_text()
    library = Library(path)
    assert [entry["name"] for entry in library.listing()["poses"]] == ["good"]
    assert [entry["name"] for entry in library.listing()["sequences"]] == ["walk"]
    (notice,) = library.notices
    assert notice.startswith("arm_library.json: poses.short.arm: ")
    assert notice.endswith(" and 4 more; left out, the file is kept as arm_library.corrupt-1.json")
    assert path.with_name("arm_library.corrupt-1.json").read_text() == before
    assert Library(path).notices == []  # once is enough


def test_two_names_that_are_the_same_are_told(path: Path) -> None:
    """By hand somebody may write Pot beside pot: the second is left out, and the file is kept."""
    other = {**HERE.model_dump(), "arm": [0.0] * 4}
    written(path, poses={"pot": HERE.model_dump(), "Pot": other})
    library = Library(path)
    assert library.pose("pot") == HERE
    assert library.notices == [
        "arm_library.json: poses: 'Pot' is 'pot', which is there already; left out, "
        "the file is kept as arm_library.corrupt-1.json"
    ]


def test_a_name_that_is_written_twice_is_told(path: Path) -> None:
    """JSON readers take the last one without a word: here the first counts, and the file is kept."""
    other = HERE.model_copy(update={"arm": [0.0] * 4})
    both = f'"pot": {HERE.model_dump_json()}, "pot": {other.model_dump_json()}'
    path.write_text(f'{{"version": 1, "poses": {{{both}}}, "sequences": {{}}}}')
    before = path.read_bytes()
    library = Library(path)
    assert library.pose("pot") == HERE
    assert library.notices == [
        "arm_library.json: 'pot' is there twice; left out, the file is kept as arm_library.corrupt-1.json"
    ]
    assert path.with_name("arm_library.corrupt-1.json").read_bytes() == before


def test_nothing_is_left_out_of_a_file_that_cannot_be_kept(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a full disk the next save would be the end of the entries that are wrong; later all is well."""
    written(path, poses={"good": HERE.model_dump(), "short": {"arm": [0.0]}})
    before = path.read_bytes()

    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", fail)
        library = Library(path)
        why = "and the file cannot be kept as arm_library.corrupt-1.json: No space left on device"
        with pytest.raises(NotInLibrary, match=why):
            library.save_pose("more", HERE, overwrite=False)
        assert (names(path.parent), path.read_bytes()) == ([path.name], before)
    assert library.pose("good") == HERE
    assert path.with_name("arm_library.corrupt-1.json").read_bytes() == before


def test_a_corrupt_file_that_cannot_be_renamed_is_told_as_that(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody is sent to look for a file that is not there; the next save makes a backup of it."""
    path.write_text("{")

    def fail(*_: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    with monkeypatch.context() as patch:
        patch.setattr(os, "rename", fail)
        library = Library(path)
    (notice,) = library.notices
    assert "cannot be renamed to arm_library.corrupt-1.json (Read-only file system)" in notice
    library.save_pose("first", HERE, overwrite=False)
    assert path.with_name("arm_library.bak").read_text() == "{"


def test_what_others_have_added_may_be_no_text(path: Path) -> None:
    """Half a character cannot be written; that is an answer, and nothing is changed."""
    path.write_text(
        '{"version": 1, "poses": {"a": {"arm": [0, 0, 0, 0], "tool": "\\ud800"}}, "sequences": {}}'
    )
    before = path.read_text()
    with pytest.raises(
        StoreFailed, match=r"cannot be written: .*surrogates not allowed; nothing was changed"
    ):
        Library(path).save_pose("b", HERE, overwrite=False)
    assert path.read_text() == before


@pytest.mark.parametrize("key", ["poses", "sequences"])
@pytest.mark.parametrize("value", [None, [], "x", 3])
def test_entries_that_are_no_object_are_none(path: Path, key: str, value: object) -> None:
    """The other kind is kept."""
    good = {"poses": {"good": HERE.model_dump()}, "sequences": {"walk": WALK.model_dump()}}
    written(path, **{**good, key: value})
    listing = Library(path).listing()
    assert [len(listing[kind]) for kind in good] == [int(kind != key) for kind in good]


def test_a_number_that_is_none_is_left_out(path: Path) -> None:
    """Python's JSON knows NaN; the arm does not."""
    written(path, poses={"nan": {**HERE.model_dump(), "arm": [math.nan, 0.0, 0.0, 0.0]}})
    assert Library(path).listing()["poses"] == []


def test_a_later_version_is_left_alone(path: Path) -> None:
    """It is neither read nor written, and says so."""
    written(path, version=2, poses={"here": {"joints": []}})
    before = path.read_text()
    library = Library(path)
    why = "was written by a later version of this program (format 2, known: 1); it is left as it is"
    for ask in (library.listing, lambda: library.save_pose("x", HERE, overwrite=True)):
        with pytest.raises(NotInLibrary) as refused:
            ask()
        assert str(refused.value).endswith(why)
    assert library.notices == [str(refused.value)]
    assert (names(path.parent), path.read_text()) == ([path.name], before)


def test_a_file_that_is_too_large_is_left_alone(path: Path) -> None:
    """It would be read for many seconds, by the process that must hear the emergency stop."""
    written(path, tools=["x" * MAX_BYTES])
    before = path.read_bytes()
    library = Library(path)
    why = f"{path} has {len(before)} bytes, a library at most {MAX_BYTES}; it is left as it is"
    assert library.notices == [why]
    with pytest.raises(NotInLibrary, match=re.escape(why)):
        library.save_pose("pot", HERE, overwrite=False)
    assert path.read_bytes() == before


@pytest.mark.parametrize("changed", [{"version": 2}, {"tools": ["x" * MAX_BYTES]}])
def test_a_file_that_is_left_alone_is_not_replaced_by_its_backup(path: Path, changed: dict[str, Any]) -> None:
    """What is in it is newer than what was kept."""
    library = Library(path)
    for name in ("first", "second"):
        library.save_pose(name, HERE, overwrite=False)
    assert len(names(path.parent)) == 2
    written(path, **changed)
    before = path.read_bytes()
    found = Library(path)
    (notice,) = found.notices
    assert notice.endswith("; it is left as it is")
    with pytest.raises(NotInLibrary, match=re.escape(notice)):
        found.listing()
    assert path.read_bytes() == before


def test_what_would_be_too_large_is_not_written(path: Path) -> None:
    """It could not be read again."""
    written(path, tools=["x" * (MAX_BYTES - 100)])
    before = path.read_bytes()
    library = Library(path)
    why = f"cannot be written: it would have more than {MAX_BYTES} bytes; nothing was changed"
    with pytest.raises(StoreFailed, match=why):
        library.save_pose("pot", HERE, overwrite=False)
    assert (path.read_bytes(), library.listing()["poses"]) == (before, [])


def test_what_others_have_added_is_kept(path: Path) -> None:
    """Keys that this program does not know survive a save."""
    written(path, poses={"here": {**HERE.model_dump(), "tool": "camera"}}, author="somebody")
    Library(path).save_pose("there", HERE, overwrite=False)
    data = json.loads(path.read_text())
    assert (data["author"], data["poses"]["here"]["tool"]) == ("somebody", "camera")


def test_a_file_that_somebody_else_writes_is_read_again(path: Path) -> None:
    """An editor, or a library that was copied from another laptop: nothing of it is overwritten."""
    library = Library(path)
    library.save_pose("mine", HERE, overwrite=False)
    Library(path).save_pose("theirs", HERE, overwrite=False)
    library.save_pose("later", HERE, overwrite=False)
    assert [entry["name"] for entry in library.listing()["poses"]] == ["later", "mine", "theirs"]


@pytest.mark.parametrize("problem", [errno.ENOSPC, errno.EROFS, errno.EDQUOT])
def test_a_save_that_fails_changes_nothing(path: Path, monkeypatch: pytest.MonkeyPatch, problem: int) -> None:
    """A full disk, a read-only one: the library is as it was, in memory and on the disk, backups included."""
    library = Library(path)
    library.save_pose("first", HERE, overwrite=False)
    library.save_pose("second", HERE, overwrite=False)
    before = {name: path.with_name(name).read_bytes() for name in names(path.parent)}

    def fail(*_: object) -> None:
        raise OSError(problem, os.strerror(problem))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", fail)
        with pytest.raises(StoreFailed) as failed:
            library.save_pose("third", HERE, overwrite=False)
    reason = f"{path} cannot be written: {os.strerror(problem)}; nothing was changed"
    assert str(failed.value) == reason
    assert [entry["name"] for entry in library.listing()["poses"]] == ["first", "second"]
    assert {name: path.with_name(name).read_bytes() for name in names(path.parent)} == before
    library.save_pose("third", HERE, overwrite=False)


def test_a_file_that_cannot_be_read_now_is_not_taken_for_an_empty_one(path: Path) -> None:
    """The next save would be its end; when it can be read again, all is there."""
    library = Library(path)
    library.save_pose("first", HERE, overwrite=False)
    kept = path.rename(path.with_name("kept"))
    path.mkdir()
    with pytest.raises(NotInLibrary, match="cannot be read: Is a directory"):
        library.save_pose("second", HERE, overwrite=False)
    assert library.notices == [f"{path} cannot be read: Is a directory"]
    path.rmdir()
    kept.rename(path)
    assert library.pose("first") == HERE
    assert library.notices == []


def test_a_file_system_without_links_has_backups_too(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Such as that of a USB stick."""

    def no_links(*_: object) -> None:
        raise OSError(errno.EPERM, "no links here")

    monkeypatch.setattr(os, "link", no_links)
    library = Library(path)
    library.save_pose("first", HERE, overwrite=False)
    library.save_pose("second", HERE, overwrite=False)
    assert list(json.loads(path.with_name("arm_library.bak").read_text())["poses"]) == ["first"]


def test_a_library_behind_a_link_has_backups_too(path: Path, tmp_path: Path) -> None:
    """Who keeps his settings elsewhere links to them; the backups are earlier states, not the link."""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    path.symlink_to(elsewhere / "library.json")
    library = Library(path)
    for name in ("first", "second", "third"):
        library.save_pose(name, HERE, overwrite=False)
    assert path.is_symlink()
    files = ("arm_library.json", "arm_library.bak", "arm_library.bak2")
    kept = [len(json.loads(path.with_name(name).read_text())["poses"]) for name in files]
    assert kept == [3, 2, 1]
