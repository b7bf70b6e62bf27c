"""Prepares the environment variables that a process needs before it can import rclpy.

ROS 2 comes from one of two places. As Python wheels inside the virtual environment, which set up their own
library path at the start of Python; or from apt, through a sourced `setup.bash`. The two do not mix: Python
would take modules from one and libraries from the other, in an order that changes from start to start.

Only `rclpy_problem` imports rclpy. The apt side was tested with a stand-in only: a second environment with
the wheels, handed over through the variables that sourcing sets.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import os
import sys
import sysconfig
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from lupin_engine.errors import UsageError

RclpySource = Literal["wheels", "apt"]

AMENT_PREFIXES = "AMENT_PREFIX_PATH"
LIBRARIES = "LD_LIBRARY_PATH"
#: Set for the process that `prepare` starts anew, so that it can happen once only.
RESTARTED = "_LUPIN_ROS_ENVIRONMENT"

#: The distributions whose wheels the extras `ros` and `ros-kilted` install.
WHEELS = ("jazzy", "kilted")

PACKAGE_MARKERS = Path("share", "ament_index", "resource_index", "packages")


def rclpy_source() -> RclpySource | None:
    """Return where `import rclpy` finds it: in the wheels, or in a sourced ROS 2; None: nowhere."""
    try:
        found = importlib.util.find_spec("rclpy")
    except (ImportError, ValueError):
        return None
    if found is None or found.origin is None:
        return None
    return "wheels" if Path(found.origin).is_relative_to(sys.prefix) else "apt"


def distribution() -> str:
    """Return the distribution of ROS 2 that is used here, such as `kilted`; '' where none is known."""
    if rclpy_source() == "apt":
        return os.environ.get("ROS_DISTRO", "")
    here = (name for name in WHEELS if any(importlib.metadata.distributions(name=f"ros-{name}-rclpy")))
    return next(here, "")


def rclpy_problem() -> str:
    """Return why an existing rclpy cannot be imported by this process; '' when it can."""
    try:
        importlib.import_module("rclpy")
    except ImportError as problem:
        return str(problem).partition("\n")[0]
    return ""


def prepare() -> None:
    """Prepare this process to import rclpy.

    Call it before anything else: in apt mode it may start the program anew, as the dynamic linker reads the
    library path only once.

    Raises:
        UsageError: wheels and a sourced ROS 2 are mixed, or a restart did not complete the library path.
    """
    refuse_mixture(os.environ)
    complete = child_environment()
    os.environ[AMENT_PREFIXES] = complete[AMENT_PREFIXES]
    if complete.get(LIBRARIES) == os.environ.get(LIBRARIES):
        return
    if RESTARTED in os.environ:
        raise UsageError(f"{LIBRARIES} lacks {sys.prefix}/lib although this process was started with it")
    complete[RESTARTED] = "1"
    sys.stdout.flush()
    sys.stderr.flush()
    os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], complete)


def child_environment() -> dict[str, str]:
    """Return the environment for a Python of this installation, completed by its interfaces and libraries."""
    environment = dict(os.environ)
    environment.pop(RESTARTED, None)
    _put(environment, AMENT_PREFIXES, sys.prefix)
    # The wheels put their libraries on the path by themselves; it is the interfaces built beside an apt ROS
    # that need it. Type support is loaded by bare file name, so only the path can lead to it.
    libraries = Path(sys.prefix, "lib")
    if rclpy_source() == "apt" and any(libraries.glob("lib*__rosidl_typesupport_c.so")):
        _put(environment, LIBRARIES, str(libraries))
    return environment


def refuse_mixture(environment: Mapping[str, str]) -> None:
    """Raise UsageError if this installation has the wheels while another ROS 2 is sourced."""
    if not wheels_installed():
        return
    sourced = _sourced_ros(environment)
    if sourced:
        raise UsageError(
            f"two ROS 2 installations are active: the wheels in {sys.prefix} and {sourced}; "
            "open a shell in which no ROS 2 is sourced (ROS_DISTRO must be unset), "
            "or run `make clean` and `make` in the sourced one"
        )


def wheels_installed() -> bool:
    """Whether this Python's own site-packages hold rclpy, even if PYTHONPATH puts another one first."""
    return Path(sysconfig.get_path("platlib"), "rclpy", "__init__.py").is_file()


def _sourced_ros(environment: Mapping[str, str]) -> str | None:
    """Return what names the ROS 2 that was sourced, None without one.

    A workspace of interfaces built against the wheels is not one.
    """
    for prefix in filter(None, environment.get(AMENT_PREFIXES, "").split(os.pathsep)):
        ours = os.path.realpath(prefix) == os.path.realpath(sys.prefix)
        if not ours and (Path(prefix) / PACKAGE_MARKERS / "rclpy").exists():
            return prefix
    distribution = environment.get("ROS_DISTRO")
    return f"ROS_DISTRO={distribution}" if distribution else None


def _put(environment: dict[str, str], variable: str, entry: str) -> None:
    """Put an entry first in a list of paths unless the list has it."""
    entries = [e for e in environment.get(variable, "").split(os.pathsep) if e]
    if entry not in entries:
        environment[variable] = os.pathsep.join([entry, *entries])


def main(arguments: list[str]) -> None:
    """Run PROGRAM in this environment: `python -m lupin_ros.adapter.environment PROGRAM ...`."""
    refuse_mixture(os.environ)
    os.execvpe(arguments[0], arguments, child_environment())


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except UsageError as error:
        sys.exit(str(error))
