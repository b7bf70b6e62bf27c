"""Saves the aggregator's state of a mission to a file, so that a restarted aggregator continues.

Plain JSON (a writable file must not be executable code), replaced atomically.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lupin_engine.errors import LupinError
from lupin_engine.plugin import state_key, user_folder, write_atomically
from lupin_greenhouse import pose_of
from lupin_perception.anomalies import Point
from lupin_perception.flowers import ColumnBloom, ScanSummary
from lupin_perception.registry import Known

#: The file name that turns the memory off.
NOWHERE = "none"


@dataclass(frozen=True)
class Past:
    """The saved state: a mission's tags, the places of its pest reports, and the scanned tag."""

    mission_id: str
    tags: Sequence[Known] = ()
    reported: Sequence[Point] = ()
    scanned: str = ""


class MissionFile:
    """The file of the state; without a path nothing is saved."""

    def __init__(self, path: Path | None) -> None:
        """Set the path; opens nothing."""
        self._path = path

    def read(self) -> Past | None:
        """Return the saved state; None without a file.

        Raises:
            LupinError: the file cannot be read, or holds something else.
        """
        if self._path is None:
            return None
        try:
            return _past(json.loads(self._path.read_text(encoding="utf-8")))
        except (FileNotFoundError, NotADirectoryError):
            return None
        except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
            reason = f"{type(error).__name__}: {error}"
            raise LupinError(f"memory_file {str(self._path)!r} cannot be used: {reason}") from error

    def write(self, past: Past) -> None:
        """Replace the content of the file.

        Raises:
            LupinError: the file cannot be written.
        """
        if self._path is None:
            return
        text = json.dumps(_data(past))
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(self._path, text.encode())
        except OSError as error:
            raise LupinError(
                f"memory_file {str(self._path)!r} cannot be written: {error.strerror}"
            ) from error


def memory_path(given: str, environment: Mapping[str, str], robot: str | None = None) -> Path | None:
    """Return the path of the file: the given one, else that of a robot of a domain in the state folder.

    `robot` is its namespace, by default the environment's. None where `NOWHERE` is given: nothing is kept.
    UsageError where the user has no home folder.
    """
    if given == NOWHERE:
        return None
    if given:
        return Path(os.path.expanduser(given))
    folder = user_folder("XDG_STATE_HOME", ".local/state", environment)
    return folder / f"perception-{state_key(None, robot, environment)}.json"


def _data(past: Past) -> dict[str, Any]:
    return {
        "mission_id": past.mission_id,
        "tags": [_tag_data(known) for known in past.tags],
        "reported": list(past.reported),
        "scanned": past.scanned,
    }


def _tag_data(known: Known) -> dict[str, Any]:
    summary = known.summary
    return {
        "id": known.id,
        "position": known.pose.position.tolist(),
        "rotation": known.pose.rotation.tolist(),
        "distance": None if math.isinf(known.distance) else known.distance,
        "sightings": known.sightings,
        "summary": None if summary is None else _summary_data(summary),
    }


def _summary_data(summary: ScanSummary) -> dict[str, Any]:
    blooms = [[bloom.column, bloom.species, bloom.confidence, bloom.anomaly] for bloom in summary.blooms]
    return {
        "species": summary.species,
        "confidence": summary.confidence,
        "anomaly": summary.anomaly,
        "blooms": blooms,
    }


def _past(data: Any) -> Past:
    reported = [(float(x), float(y)) for x, y in data["reported"]]
    tags = [_tag(entry) for entry in data["tags"]]
    scanned = _text(data.get("scanned", ""))  # not there in files from before scans were resumed
    return Past(_text(data["mission_id"]), tags, reported, scanned)


def _tag(entry: Any) -> Known:
    pose = pose_of(map(float, entry["position"]), map(float, entry["rotation"]))
    if pose is None or len(pose.position) != 3 or len(pose.rotation) != 4:
        raise ValueError(f"tag {entry['id']!r} has no pose")
    distance = math.inf if entry["distance"] is None else float(entry["distance"])
    sightings = int(entry["sightings"])
    if math.isnan(distance) or sightings < 1:
        raise ValueError(f"tag {entry['id']!r} was never seen")
    known = Known(_text(entry["id"]), pose, distance, sightings, last_seen=-math.inf)
    known.summary = None if entry["summary"] is None else _summary(entry["summary"])
    return known


def _summary(entry: Any) -> ScanSummary:
    blooms = tuple(ColumnBloom(int(k), _text(name), _share(c), bool(a)) for k, name, c, a in entry["blooms"])
    return ScanSummary(_text(entry["species"]), _share(entry["confidence"]), bool(entry["anomaly"]), blooms)


def _text(written: Any) -> str:
    text = str(written)
    text.encode()  # half a character can be written in JSON, and in no message
    return text


def _share(written: Any) -> float:
    share = float(written)
    if not 0.0 <= share <= 1.0:
        raise ValueError(f"a confidence of {share:g}")
    return share
