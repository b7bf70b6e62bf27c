"""The operator's library of poses and sequences: its rules, and its JSON file with three backups.

Every change rewrites the file atomically, and the previous ones become backups. An unreadable file is
quarantined under another name and reported in `notices`, and the newest readable backup is used. Nothing
that a person has made is deleted. A file of a later version, or one too large, is refused and left alone.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import re
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from lupin_arm.joints import (
    ARM,
    JAW_CLOSED,
    JAW_OPEN,
    OutsideLimits,
    check_pose,
    clamp_jaw,
    clamp_pose,
    jaw_to_degrees,
)
from lupin_engine.errors import LupinError, nearest, shortened
from lupin_engine.plugin import write_atomically

#: Version of the file; one of a later version is left alone.
VERSION = 1
#: Earlier states of the file that are kept: `.bak` is the newest, then `.bak2`, `.bak3`.
BACKUPS = 3
#: Entries of each kind, and waypoints of all sequences; a library is read and written as a whole, by the
#: process that stops the arm.
MAX_ENTRIES, MAX_WAYPOINTS = 500, 40_000
#: What is larger has more in it than that, and would be read for many seconds.
MAX_BYTES = 10_000_000
#: What rounding may add to a limit, in radians.
ROUNDING = 1e-6

KINDS = ("pose", "sequence")
MODES = ("teleop", "kinesthetic")

_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,31}")
_MODEL = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False, strict=True)


class NotInLibrary(LupinError):
    """A request to the library is refused; the text says why, and what is possible."""


class StoreFailed(LupinError):
    """The library could not be written; its content in memory is unchanged."""


class StoredPose(BaseModel):
    """A pose of the arm in radians, and of the jaw if given."""

    model_config = _MODEL
    arm: list[float] = Field(min_length=len(ARM), max_length=len(ARM))
    gripper: float | None = None
    created: str = ""
    note: str = ""


class Waypoint(BaseModel):
    """The pose at `t` seconds after the beginning of its sequence."""

    model_config = _MODEL
    t: float = Field(ge=0.0)
    arm: list[float] = Field(min_length=len(ARM), max_length=len(ARM))
    gripper: float | None = None


class Sequence(BaseModel):
    """A recorded movement, as waypoints in the order of time."""

    model_config = _MODEL
    mode: Literal["teleop", "kinesthetic"] = "teleop"
    include_gripper: bool = False
    duration_s: float = Field(ge=0.0)
    created: str = ""
    note: str = ""
    waypoints: list[Waypoint] = Field(min_length=1)

    @model_validator(mode="after")
    def _times_go_on(self) -> Sequence:
        times = [waypoint.t for waypoint in self.waypoints]
        if any(later < earlier for earlier, later in itertools.pairwise(times)):
            raise ValueError("the times of the waypoints go back")
        return self


Entry = TypeVar("Entry", StoredPose, Sequence)


def valid_name(text: str) -> str:
    """Return the normalized name: without surrounding blanks, in lower case.

    Raises:
        NotInLibrary: it is no valid name.
    """
    name = text.strip().lower()
    if not _NAME.fullmatch(name):
        rule = "1 to 32 letters a to z, digits, - and _, beginning with a letter or digit"
        raise NotInLibrary(f"invalid name {shortened(name)!r}: a name has {rule}")
    return name


def checked_pose(arm: Iterable[float], gripper: float | None, created: str) -> tuple[StoredPose, list[str]]:
    """Return a pose clamped to the limits, and the changes in words.

    Raises:
        NotInLibrary: not one finite number for each joint.
    """
    given = list(arm)
    if not all(map(math.isfinite, given if gripper is None else [*given, gripper])):
        raise NotInLibrary("a pose has finite numbers in radians only, no NaN and no infinity")
    try:
        inside = clamp_pose(given)
    except OutsideLimits as reason:
        raise NotInLibrary(str(reason)) from None
    jaw = None if gripper is None else clamp_jaw(gripper)
    moves = zip((joint.name for joint in ARM), given, inside, strict=True)
    changes = [
        f"{name} {math.degrees(before):.1f} deg is beyond its limit, kept as {math.degrees(after):g} deg"
        for name, before, after in moves
        if abs(before - after) > ROUNDING
    ]
    if gripper is not None and jaw is not None and abs(gripper - jaw) > ROUNDING:
        changes.append(f"the gripper is beyond its limit, kept as {jaw_to_degrees(jaw):g} deg")
    return StoredPose(arm=list(inside), gripper=jaw, created=created), changes


def beyond_limits(entry: StoredPose | Sequence) -> str:
    """Return why an entry is beyond the limits of the arm; '' where it is not.

    Entries saved here never are, but the file can be edited by hand.
    """
    moments: Iterable[StoredPose | Waypoint] = entry.waypoints if isinstance(entry, Sequence) else [entry]
    for number, moment in enumerate(moments, start=1):
        problem = _beyond_limits(moment.arm, moment.gripper)
        if problem:
            return f"waypoint {number}: {problem}" if isinstance(entry, Sequence) else problem
    return ""


def _beyond_limits(arm: list[float], gripper: float | None) -> str:
    try:
        check_pose(arm)
    except OutsideLimits as reason:
        return str(reason)
    if gripper is not None and abs(clamp_jaw(gripper) - gripper) > ROUNDING:
        return f"gripper: {gripper:g} rad is not within {JAW_OPEN:g} to {JAW_CLOSED:g}"
    return ""


class Library:
    """The library in the file at `path`, which need not exist yet.

    `notices` are its problems for people. A file that another process has changed is read again before use.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._notices: list[str] = []
        self._poses: dict[str, StoredPose] = {}
        self._sequences: dict[str, Sequence] = {}
        self._others: dict[str, Any] = {}  # fields of a later version, kept as they are
        self._unusable = ""
        self._seen: tuple[int, ...] | None = None
        self._load()

    @property
    def notices(self) -> list[str]:
        """Problems for people: quarantined data, and why nothing can be read now."""
        return [*self._notices, *filter(None, [self._unusable])]

    # --- what is asked for --------------------------------------------------------------------------------

    def listing(self) -> dict[str, list[dict[str, Any]]]:
        """Return the entries by name with their metadata, without waypoints.

        Raises:
            NotInLibrary: the file cannot be used.
        """
        self._refresh()
        poses = [
            {"name": name, "note": pose.note, "has_gripper": pose.gripper is not None}
            for name, pose in sorted(self._poses.items())
        ]
        sequences = [
            {
                "name": name,
                "mode": found.mode,
                "duration_s": found.duration_s,
                "n_waypoints": len(found.waypoints),
                "include_gripper": found.include_gripper,
            }
            for name, found in sorted(self._sequences.items())
        ]
        return {"poses": poses, "sequences": sequences}

    def pose(self, name: str) -> StoredPose:
        """Return a pose, checked against the limits.

        Raises:
            NotInLibrary: it is unknown, or beyond the limits.
        """
        self._refresh()
        return self._found("pose", name, self._poses)

    def sequence(self, name: str) -> Sequence:
        """Return a sequence, checked against the limits.

        Raises:
            NotInLibrary: it is unknown, or beyond the limits.
        """
        self._refresh()
        return self._found("sequence", name, self._sequences)

    def check_free(self, kind: str, name: str, overwrite: bool) -> str:
        """Return the normalized name under which an entry can be saved.

        Raises:
            NotInLibrary: the name is invalid or taken, or the library is full.
        """
        self._refresh()
        name = valid_name(name)
        entries = self._of(kind)
        if name in entries:
            if not overwrite:
                raise NotInLibrary(f"{kind} {name!r} exists; choose another name or overwrite it")
        elif len(entries) >= MAX_ENTRIES:
            raise NotInLibrary(f"the library is full: {MAX_ENTRIES} {kind}s; delete some")
        return name

    def save_pose(self, name: str, pose: StoredPose, overwrite: bool) -> str:
        """Save a pose; an overwritten one passes on its note. Return the name.

        Raises:
            NotInLibrary: as for `check_free`.
            StoreFailed: writing failed; the library is unchanged.
        """
        return self._save("pose", name, pose, overwrite)

    def save_sequence(self, name: str, sequence: Sequence, overwrite: bool) -> str:
        """Save a sequence; an overwritten one passes on its note. Return the name.

        Raises:
            NotInLibrary: as for `check_free`, or all sequences together would have too many waypoints.
            StoreFailed: writing failed; the library is unchanged.
        """
        self._refresh()
        others = (found for other, found in self._sequences.items() if other != valid_name(name))
        kept = sum(len(found.waypoints) for found in others)
        if kept + len(sequence.waypoints) > MAX_WAYPOINTS:
            raise NotInLibrary(
                f"the library is full: {MAX_WAYPOINTS} waypoints in all; delete some sequences"
            )
        return self._save("sequence", name, sequence, overwrite)

    def edit(self, kind: str, name: str, new_name: str) -> str:
        """Rename an entry, or delete it when the new name is empty; return a sentence about it.

        Raises:
            NotInLibrary: unknown kind or entry, or the new name is invalid or taken.
            StoreFailed: writing failed; the library is unchanged.
        """
        self._refresh()
        if kind not in KINDS:
            raise NotInLibrary(f"unknown kind {shortened(kind)!r}; {nearest(shortened(kind), KINDS)}")
        name, entries = valid_name(name), self._of(kind)
        if name not in entries:
            raise NotInLibrary(_unknown(kind, name, entries))
        if not new_name:  # blanks are no name, and no wish to delete something
            self._write(kind, {other: entry for other, entry in entries.items() if other != name})
            return f"deleted {kind} {name!r}"
        new_name = valid_name(new_name)
        if new_name in entries and new_name != name:
            raise NotInLibrary(f"{kind} {new_name!r} exists; delete it first or choose another name")
        self._write(kind, {new_name if other == name else other: e for other, e in entries.items()})
        return f"renamed {kind} {name!r} to {new_name!r}"

    # --- entries ------------------------------------------------------------------------------------------

    def _of(self, kind: str) -> Mapping[str, StoredPose | Sequence]:
        return self._poses if kind == "pose" else self._sequences

    def _found(self, kind: str, name: str, entries: Mapping[str, Entry]) -> Entry:
        name = valid_name(name)
        if name not in entries:
            raise NotInLibrary(_unknown(kind, name, entries))
        wrong = beyond_limits(entries[name])
        if wrong:
            raise NotInLibrary(f"{kind} {name!r} is beyond the limits: {wrong}; record it again or delete it")
        return entries[name]

    def _save(self, kind: str, name: str, entry: StoredPose | Sequence, overwrite: bool) -> str:
        name = self.check_free(kind, name, overwrite)
        entries = self._of(kind)
        if name in entries:
            entry = entry.model_copy(update={"note": entries[name].note})
        self._write(kind, {**entries, name: entry})
        return name

    # --- the file -----------------------------------------------------------------------------------------

    def _refresh(self) -> None:
        if self._unusable or self._seen != _identity(self.path):
            self._load()
        if self._unusable:
            raise NotInLibrary(self._unusable)

    def _load(self) -> None:
        """Read the file; recover from a backup where it is missing or corrupt."""
        self._poses, self._sequences, self._others, self._unusable = {}, {}, {}, ""
        try:
            if not self._take_in(self.path):
                self._recover("is missing")
        except _CorruptLibrary as problem:
            self._recover(f"cannot be read ({problem}), {self._quarantine()}")
        except OSError as error:
            # An unreadable file is not taken for an empty library: the next save would overwrite it.
            self._unusable = f"{self.path} cannot be read: {error.strerror}"
        self._seen = _identity(self.path)

    def _take_in(self, file: Path) -> bool:
        """Read a file; return False when there is none. Invalid entries are dropped, and the file is copied.

        Raises:
            _CorruptLibrary: it is no library.
        """
        try:
            size = file.stat().st_size
            raw = file.read_bytes() if size <= MAX_BYTES else b""
        except FileNotFoundError:
            return False
        if size > MAX_BYTES:
            self._unusable = f"{file} has {size} bytes, a library at most {MAX_BYTES}; it is left as it is"
            return True
        wrong: list[str] = []
        data = _object(raw, wrong)
        version = data.get("version")
        if isinstance(version, int) and version > VERSION:
            self._unusable = (
                f"{file} was written by a later version of this program "
                f"(format {version}, known: {VERSION}); it is left as it is"
            )
            return True
        if version != VERSION or isinstance(version, bool):
            raise _CorruptLibrary(f"its version is {version!r}, not {VERSION}")
        self._poses = _entries(data, "poses", StoredPose, wrong)
        self._sequences = _entries(data, "sequences", Sequence, wrong)
        self._others = {key: value for key, value in data.items() if key not in _KEYS}
        if wrong:
            self._drop(file, raw, wrong)
        return True

    def _drop(self, file: Path, raw: bytes, wrong: list[str]) -> None:
        """Continue without the invalid entries, and keep a copy of the file."""
        kept = self._free_name()
        shown = "; ".join(wrong[:3]) + (f" and {len(wrong) - 3} more" if len(wrong) > 3 else "")
        try:
            write_atomically(kept, raw)
        except OSError as error:
            # What is left out would be lost with the next save.
            self._unusable = (
                f"{file.name}: {shown}; and the file cannot be kept as {kept.name}: {error.strerror}"
            )
            return
        self._notices.append(f"{file.name}: {shown}; left out, the file is kept as {kept.name}")
        with contextlib.suppress(StoreFailed):  # told with the next save
            self._persist(self._poses, self._sequences)

    def _recover(self, what: str) -> None:
        """Read the newest usable backup; without one the library is empty, noted unless missing."""
        for backup in self._backups():
            with contextlib.suppress(_CorruptLibrary, OSError):
                if self._take_in(backup):
                    self._notices.append(f"{self.path.name} {what}; taken from {backup.name}")
                    return
        if what != "is missing":
            self._notices.append(f"{self.path.name} {what}; the library is empty")

    def _quarantine(self) -> str:
        """Rename the file; return a phrase about that."""
        kept = self._free_name()
        try:
            os.rename(self.path, kept)
        except OSError as error:  # then the next save that is possible makes a backup of it
            return f"cannot be renamed to {kept.name} ({error.strerror})"
        return f"is kept as {kept.name}"

    def _free_name(self) -> Path:
        names = (self.path.with_name(f"{self.path.stem}.corrupt-{n}.json") for n in range(1, 100_000))
        return next(name for name in names if not os.path.lexists(name))

    def _backups(self) -> list[Path]:
        numbers = ["", *map(str, range(2, BACKUPS + 1))]
        return [self.path.with_suffix(f".bak{number}") for number in numbers]

    def _write(self, kind: str, entries: Mapping[str, Any]) -> None:
        """Write the library with other entries of a kind; memory changes only if that works."""
        poses = dict(entries) if kind == "pose" else self._poses
        sequences = dict(entries) if kind == "sequence" else self._sequences
        self._persist(poses, sequences)
        self._poses, self._sequences = poses, sequences

    def _persist(self, poses: Mapping[str, StoredPose], sequences: Mapping[str, Sequence]) -> None:
        try:
            content = self._text(poses, sequences).encode()
            if len(content) > MAX_BYTES:
                raise ValueError(f"it would have more than {MAX_BYTES} bytes")
            self.path.parent.mkdir(parents=True, exist_ok=True)
            keep_backups(self.path, lambda: write_atomically(self.path, content), self._backups())
        except (OSError, ValueError) as error:  # a ValueError is of what others have put into the file
            reason = getattr(error, "strerror", None) or error
            raise StoreFailed(f"{self.path} cannot be written: {reason}; nothing was changed") from None
        self._seen = _identity(self.path)

    def _text(self, poses: Mapping[str, StoredPose], sequences: Mapping[str, Sequence]) -> str:
        """Return the file's content, one line per entry: that is fast for hours of movements."""
        others = [(key, json.dumps(value)) for key, value in self._others.items()]
        own = [("version", str(VERSION)), ("poses", _lines(poses)), ("sequences", _lines(sequences))]
        return "{" + ",".join(f"\n {json.dumps(key)}: {value}" for key, value in [*others, *own]) + "\n}\n"


_KEYS = ("version", "poses", "sequences")


class _CorruptLibrary(Exception):
    """The file is no library."""


def _unknown(kind: str, name: str, entries: Iterable[str]) -> str:
    known = sorted(entries)
    return f"unknown {kind} {name!r}; " + (nearest(name, known) if known else f"no {kind} is saved")


def _identity(path: Path) -> tuple[int, ...] | None:
    """Return inode, size and mtime, to notice another process's writes; None without a file."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns


def _object(raw: bytes, wrong: list[str]) -> dict[str, Any]:
    """Return the JSON object of a file; duplicate names go to `wrong`, and the first of them counts.

    Raises:
        _CorruptLibrary: it is no JSON, or no object.
    """

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) == len(pairs):
            return found
        counts = Counter(name for name, _ in pairs)
        wrong.extend(f"{shortened(name)!r} is there twice" for name, count in counts.items() if count > 1)
        return dict(reversed(pairs))

    try:
        data = json.loads(raw, object_pairs_hook=once)
    except (ValueError, RecursionError) as error:  # bytes that are no text raise a ValueError, too
        raise _CorruptLibrary(f"no JSON: {error}") from None
    if not isinstance(data, dict):
        raise _CorruptLibrary(f"a {type(data).__name__} instead of an object")
    return data


def _lines(entries: Mapping[str, StoredPose | Sequence]) -> str:
    lines = (f"\n  {json.dumps(name)}: {entry.model_dump_json()}" for name, entry in entries.items())
    return "{" + ",".join(lines) + "}"


def _entries(data: Mapping[str, Any], key: str, model: type[Entry], wrong: list[str]) -> dict[str, Entry]:
    """Return the valid entries under a key; the errors of the others go to `wrong`."""
    found = data.get(key, {})
    if not isinstance(found, dict):
        wrong.append(f"{key}: a {type(found).__name__} instead of an object")
        return {}
    sound: dict[str, Entry] = {}
    for name, entry in found.items():
        try:
            known = valid_name(name)
            if known in sound:
                raise NotInLibrary(f"{name!r} is {known!r}, which is there already")
            sound[known] = model.model_validate(entry)
        except NotInLibrary as reason:
            wrong.append(f"{key}: {reason}")
        except ValidationError as error:
            problem: Any = error.errors()[0]
            where = ".".join(map(str, (key, name, *problem["loc"])))
            wrong.append(f"{where}: {problem['msg']}")
    return sound


def keep_backups(path: Path, write: Callable[[], None], backups: list[Path]) -> None:
    """Rewrite a file, and keep its old content as the first of `backups`.

    Older backups move on by one, the last is deleted; where writing fails all stay as they were.
    """
    old = path.with_name(f"{path.name}.old")
    old.unlink(missing_ok=True)
    if path.exists():
        _link_or_copy(path, old)
    try:
        write()
    except OSError:
        old.unlink(missing_ok=True)
        raise
    if not old.exists():
        return
    for older, newer in zip(backups[::-1], backups[-2::-1], strict=False):
        if newer.exists():
            os.replace(newer, older)
    os.replace(old, backups[0])


def _link_or_copy(path: Path, copy: Path) -> None:
    try:
        os.link(path.resolve(), copy)  # a link to the library itself would follow its changes
    except OSError:  # a file system without links, such as that of a USB stick
        shutil.copy2(path, copy)
