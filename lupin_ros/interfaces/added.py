"""Compiles a package of interfaces and adds it to this environment, as `make run` does with the shipped ones.

The package is read first, then built in a temporary folder with the tools of `tools/bootstrap.py`, and
installed as one wheel at the end: until then, nothing in the environment has changed.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

from lupin_engine.errors import UsageError, meant
from lupin_ros.interfaces.package import (
    InterfacePackage,
    read_package,
    shipped_folder,
    shipped_names,
    uses_of,
)
from lupin_ros.interfaces.type_hashes import installed

_CHECKOUT = Path(__file__).resolve().parents[2]
#: How the packages of interfaces are called that were compiled here, for pip.
_DISTRIBUTION = "lupin-interfaces-{}"
#: How the summaries begin of packages that are cut down, and of those that were added.
_SUBSET, _ADDED = "Minimal wire-compatible subset", "Added by lupin interfaces add"


def add_interfaces(what: str, say: Callable[[str], None]) -> list[str]:
    """Compile and install a package, a folder or the name of a shipped one; return the names that were added.

    A shipped package's own dependencies are added before it, where they are shipped and not here.

    Raises:
        UsageError: it cannot be added; the text has all reasons, and nothing has changed.
    """
    folder = _folder(what)
    names = []
    for one in _needed(folder):
        package = read_package(one, _known())
        _check_free(package)
        say(f"Compiling {package.name} ({len(package.files)} definitions)")
        _build(package)
        names.append(package.name)
    return names


def cut_down(package: str) -> str:
    """Return how to add the whole of a package that is cut down here; '' where it is whole."""
    if not _summary(package).startswith(_SUBSET):
        return ""
    whole = package if shipped_folder(package) else f"FOLDER (that of the whole {package})"
    return f"this package is cut down here; add the whole by: lupin interfaces add {whole}"


def _folder(what: str) -> Path:
    shipped = shipped_folder(what)
    if shipped is not None and not Path(what).is_dir():
        return shipped
    if not Path(what).is_dir():
        known = shipped_names()
        hint = meant(what, known) or f"Lupin has the definitions of {', '.join(known)}"
        raise UsageError(f"there is no folder {what!r}, and no package of that name comes with Lupin; {hint}")
    return Path(what)


def _needed(folder: Path) -> list[Path]:
    """Return the folders to build: shipped ones that a shipped package needs and that are missing, and it."""
    here = _known()
    own = folder == shipped_folder(folder.name)
    needs = [shipped_folder(name) for name in uses_of(folder) if name not in here] if own else []
    return [*(one for one in needs if one is not None), folder]


def _known() -> dict[str, list[str]]:
    """Return the messages that are installed, by package."""
    found: dict[str, list[str]] = {}
    for package, name in installed("msg"):
        found.setdefault(package, []).append(name)
    return found


def _summary(package: str) -> str:
    """Return the summary of a package that was compiled here; '' where it was not."""
    try:
        return str(metadata.metadata(_DISTRIBUTION.format(package.replace("_", "-")))["Summary"] or "")
    except metadata.PackageNotFoundError:
        return ""


def _check_free(package: InterfacePackage) -> None:
    """Refuse a name that another one has; one that is cut down, or was added before, is replaced."""
    here = {name for kind in ("msg", "srv", "action") for name, _ in installed(kind)}
    if package.name in here and not _summary(package.name).startswith((_SUBSET, _ADDED)):
        problem = f"{package.folder}: a package {package.name!r} is in this environment already, and is whole"
        raise UsageError(f"{problem}; give yours another name, or use that one")


def _build(package: InterfacePackage) -> None:
    if os.environ.get("ROS_DISTRO"):
        hint = "build it with colcon, and source its workspace"
        raise UsageError(f"this shell has sourced ROS 2, whose packages are not changed from here; {hint}")
    bootstrap = _bootstrap()
    try:
        bootstrap.check_compiler(bootstrap.probe(sys.executable, "wheels"))
        with tempfile.TemporaryDirectory(prefix="lupin-add-", dir=bootstrap.plain_temporary_folder()) as name:
            sources, wheels = Path(name, "added"), Path(name, "built", "wheels")
            _write(package, sources)
            # The messages that it uses are those of this environment.
            os.environ["CMAKE_PREFIX_PATH"] = sys.prefix
            folder = f"added/{package.name}"
            bootstrap.build_wheels(sys.executable, "wheels", [folder], wheels, [str(sources)])
            pip = [
                sys.executable,
                "-m",
                "pip",
                "install",
                "--quiet",
                "--no-deps",
                "--no-index",
                "--no-compile",
            ]
            subprocess.run([*pip, "--force-reinstall", *map(str, wheels.glob("*.whl"))], check=True)
    except bootstrap.Problem as problem:
        raise UsageError("\n".join(map(str, problem.args))) from None
    except subprocess.CalledProcessError:
        raise UsageError(f"pip could not install {package.name}; what it said stands above") from None


def _bootstrap() -> Any:
    """Return the module that makes environments, from the checkout.

    Raises:
        UsageError: Lupin is installed without its checkout.
    """
    file = _CHECKOUT / "tools" / "bootstrap.py"
    spec = importlib.util.spec_from_file_location("lupin_bootstrap", file) if file.is_file() else None
    if spec is None or spec.loader is None:
        raise UsageError(f"interfaces are compiled with the checkout of Lupin engine; {file} is not there")
    module: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    here = (name for name in module.WHEELS if any(metadata.distributions(name=f"ros-{name}-rclpy")))
    module.DISTRIBUTION = next(here, "jazzy")
    return module


def _write(package: InterfacePackage, sources: Path) -> None:
    """Write a package as a folder that pip can build: its definitions, and build files made of ours."""
    model, target = _CHECKOUT / "interfaces" / "nav2_msgs", sources / package.name
    for file in package.files:
        (target / file).parent.mkdir(parents=True, exist_ok=True)
        text = (package.folder / file).read_text(encoding="utf-8", errors="replace")
        (target / file).write_text(told_apart(text), encoding="utf-8")
    (target / "package.xml").write_text(_manifest(package), encoding="utf-8")
    (sources / "pip_wheels.cmake").write_bytes((model.parent / "pip_wheels.cmake").read_bytes())
    text = (model / "pyproject.toml").read_text(encoding="utf-8")
    head, _, rest = text.partition("[project]\n")
    name = _DISTRIBUTION.format(package.name.replace("_", "-"))
    project = f'[project]\nname = "{name}"\nversion = "{package.version}"\n'
    project += f'description = "{_ADDED}: {package.name}"\n\n'
    tools = "[tool.scikit-build]" + rest.partition("[tool.scikit-build]")[2]
    (target / "pyproject.toml").write_text(head + project + tools, encoding="utf-8")
    (target / "CMakeLists.txt").write_text(_cmake(package), encoding="utf-8")


def told_apart(text: str) -> str:
    """Return a definition in which a constant that an earlier part has as well has a comment.

    rosidl's parser (4.6.6) takes two lines that are equal for one, and gives both to the first part.
    """
    seen, part, lines = dict[str, int](), 0, []
    for line in text.splitlines():
        part += line.strip() == "---"
        if "=" in line and seen.setdefault(line.strip(), part) != part:
            line += f"  # of part {part + 1}"
        lines.append(line)
    return "\n".join(lines) + "\n"


def _manifest(package: InterfacePackage) -> str:
    """Return a manifest with all that the generators ask for, which a written one may lack."""
    uses = "".join(f"<depend>{name}</depend>" for name in package.uses)
    return (
        f'<package format="3"><name>{package.name}</name><version>{package.version}</version>'
        f"<description>{_ADDED}</description><maintainer email='nobody@example.org'>nobody</maintainer>"
        "<license>unknown</license><buildtool_depend>ament_cmake</buildtool_depend>"
        f"<buildtool_depend>rosidl_default_generators</buildtool_depend>{uses}"
        "<exec_depend>rosidl_default_runtime</exec_depend>"
        "<member_of_group>rosidl_interface_packages</member_of_group>"
        "<export><build_type>ament_cmake</build_type></export></package>\n"
    )


def _cmake(package: InterfacePackage) -> str:
    found = "\n".join(f"find_package({name} REQUIRED)" for name in package.uses)
    files = "\n".join(f'  "{file}"' for file in package.files)
    uses = f"\n  DEPENDENCIES {' '.join(package.uses)}" if package.uses else ""
    return f"""cmake_minimum_required(VERSION 3.8)
project({package.name})

find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{found}

rosidl_generate_interfaces(${{PROJECT_NAME}}
{files}{uses}
)

ament_export_dependencies(rosidl_default_runtime)
ament_package()
"""


__all__ = ["add_interfaces", "cut_down"]
