"""The crash log of a defect, complete enough to be sent as a report."""

from __future__ import annotations

import platform
import sys
import traceback
from importlib import metadata
from pathlib import Path

from lupin_cli.run_folders import KEPT_CRASHES, make_room, name_of_now, state_folder
from lupin_engine import __version__

_PACKAGES = ("click", "pydantic", "pyyaml", "rich", "structlog", "transitions", "rclpy", "lupin-msgs")


def write_crash_log(defect: BaseException) -> Path:
    """Write versions, command and traceback to a file and return its path; OSError when the disk is full."""
    folder = state_folder("crashes")
    make_room(folder, KEPT_CRASHES)
    path = folder / f"{name_of_now()}.log"
    trace = "".join(traceback.format_exception(type(defect), defect, defect.__traceback__))
    path.write_text("\n".join([*_versions(), "", trace]), encoding="utf-8")
    return path


def _versions() -> list[str]:
    lines = [
        f"lupin-engine {__version__}",
        f"Python {platform.python_version()} on {platform.platform()}",
        f"arguments {sys.argv[1:]!r}",
    ]
    return lines + [f"{name} {_version(name)}" for name in _PACKAGES]


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "is not installed"
