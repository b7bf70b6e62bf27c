"""Finds and removes shared memory that the middleware leaves behind when a process is killed.

Segments of half a megabyte lie in `/dev/shm`. A living process maps those that it uses, so a segment that no
process maps is stale. Only segments of this user are removed: processes of others hide their maps.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

FOLDER = Path("/dev/shm")
PROCESSES = Path("/proc")
#: Of Fast DDS 2 (Jazzy) and 3.
PREFIXES = ("fastrtps_", "fastdds_")
#: The semaphore beside a segment carries its name between these.
SEMAPHORE = ("sem.", "_mutex")


def segments_of(pid: int, processes: Path = PROCESSES) -> frozenset[str]:
    """Return the names of the segments that a process maps; none when it is gone or hidden."""
    return frozenset(_mapped(processes / str(pid) / "maps") or ())


def stale_segments(folder: Path = FOLDER, processes: Path = PROCESSES) -> list[Path]:
    """Return the files of this user that no living process maps, sorted by name."""
    used: set[str] = set()
    for entry in processes.iterdir() if processes.is_dir() else ():
        if entry.name.isdigit():
            used.update(_mapped(entry / "maps") or ())
    return [file for file in _files(folder) if _segment(file.name) not in used and _is_mine(file)]


def remove(names: Iterable[str], folder: Path = FOLDER, processes: Path = PROCESSES) -> list[str]:
    """Remove those of the named segments that are stale, with their semaphores; return the removed files.

    Raises:
        OSError: one cannot be removed.
    """
    wanted = {_segment(name) for name in names}
    gone = []
    for file in stale_segments(folder, processes):
        if _segment(file.name) in wanted:
            file.unlink(missing_ok=True)
            gone.append(file.name)
    return gone


def _files(folder: Path) -> Iterator[Path]:
    if folder.is_dir():
        yield from sorted(f for f in folder.iterdir() if _segment(f.name).startswith(PREFIXES))


def _segment(name: str) -> str:
    """Return the segment that a file belongs to: itself, or that of a lock file or semaphore."""
    return name.removeprefix(SEMAPHORE[0]).removesuffix(SEMAPHORE[1]).removesuffix("_el").removesuffix("_sl")


def _is_mine(file: Path) -> bool:
    try:
        return file.stat().st_uid == os.getuid()
    except OSError:
        return False


def _mapped(maps: Path) -> set[str] | None:
    """Return the segments in a process' memory map; None when it may not be read."""
    try:
        text = maps.read_text(errors="replace")
    except OSError:
        return None
    marker = f"{FOLDER}/"
    files = (line.partition(marker)[2] for line in text.splitlines() if marker in line)
    names = {_segment(file.removesuffix(" (deleted)")) for file in files}
    return {name for name in names if name.startswith(PREFIXES)}
