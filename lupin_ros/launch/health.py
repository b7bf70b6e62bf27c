"""The checks of `lupin doctor`: one small function each, none of which needs an installed ROS.

Each yields `Finding`s: the subject, the state (`ok`, `note`, `problem`), and often advice. A check that
raises is a problem itself.
"""

from __future__ import annotations

import os
import platform
import re
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import metadata
from itertools import pairwise, takewhile
from pathlib import Path
from typing import Any, Literal

from lupin_engine import __version__
from lupin_engine.chart import STRICTER, Findings, read
from lupin_engine.errors import LupinError, Severity, UsageError
from lupin_engine.missions import (
    check_chart,
    default_missions_folder,
    folders,
    lifecycle_called,
    lifecycle_in,
    mission_files,
    mission_folders,
    origin_of,
    shipped_lifecycles,
)
from lupin_engine.plugin import (
    DOMAIN,
    entry_points,
    load_catalog,
    load_profiles,
    ros_domain,
    verified_plugin,
)
from lupin_engine.sim import SUFFIX, Missions, load_scenario
from lupin_ros.adapter import environment
from lupin_ros.adapter.dds.ports import exposed
from lupin_ros.adapter.dds.profile import CLOSED, RANGE, users_profile
from lupin_ros.interfaces.type_hashes import local_hash
from lupin_ros.launch.environment import (
    PEERS,
    open_to,
    peers_advice,
    range_advice,
)
from lupin_ros.launch.requirements import INSTALL_ROS, SOURCE_ROS
from lupin_ros.launch.shared_memory import stale_segments
from lupin_ros.service.names import COMMAND_HASH, COMMAND_TYPE

State = Literal["ok", "note", "problem"]

#: The Python versions that there are ROS wheels for; an apt ROS 2 may have the one after them.
OLDEST_PYTHON, FIRST_TOO_NEW = (3, 10), (3, 14)

RIHS = "RIHS01_"

#: Extras of the distribution that a command needs, each with that command.
_EXTRAS = {"hmi": "`--hmi`", "record": "`lupin record`"}


#: What to do about a lifecycle that is carried.
_CARRIED = "it counts before the shipped one, and ages: remove it, unless it shall stay as it is"
#: What to do about a copy of a lifecycle.
_EXTEND = "write `extends: NAME` and only what differs: `lupin new NAME` in an empty folder shows how"


@dataclass(frozen=True)
class Finding:
    """The result of one check, with advice for a problem."""

    topic: str
    found: str
    state: State = "ok"
    advice: str = ""


def examine() -> list[Finding]:
    """Run all checks; a check that fails itself becomes a problem, and the others go on."""
    return [finding for look in LOOKS for finding in _findings(look)]


def _findings(look: Callable[[], Iterator[Finding]]) -> Iterator[Finding]:
    topic = look.__name__.removeprefix("look_at_").replace("_", " ")
    try:
        yield from look()
    except Exception as broken:  # of an installation that is broken anything can be expected
        reason = str(broken) if isinstance(broken, LupinError) else f"{type(broken).__name__}: {broken}"
        yield Finding(topic, "cannot be looked at", "problem", f"{reason}; install the packages anew")


def usable(findings: Sequence[Finding]) -> bool:
    """Return whether missions can be run here."""
    return not any(finding.state == "problem" for finding in findings)


def look_at_python() -> Iterator[Finding]:
    """Check the Python version and the platform; name this package's version."""
    newest = (3, 15) if environment.rclpy_source() == "apt" else FIRST_TOO_NEW
    fits = OLDEST_PYTHON <= sys.version_info[:2] < newest
    advice = "" if fits else "use Python 3.10 to 3.13 (`make PYTHON=/path/to/python3.12 ...`)"
    found = f"{platform.python_version()} in {sys.prefix}"
    yield Finding("Python", found, "ok" if fits else "problem", advice)
    machine = f"{platform.system()} {platform.machine()}"
    has_wheels = machine == "Linux x86_64"
    advice = "" if has_wheels else "there are no ROS wheels for this platform: use an apt ROS 2 Jazzy"
    yield Finding("platform", machine, "ok" if has_wheels else "note", advice)
    yield Finding("lupin-engine", __version__)


def look_at_ros() -> Iterator[Finding]:
    """Check that rclpy can be imported, from one ROS 2 only; name the middleware."""
    source = environment.rclpy_source()
    if source is None:
        yield Finding("rclpy", "not found", "problem", INSTALL_ROS)
        return
    try:
        environment.refuse_mixture(os.environ)
    except LupinError as problem:
        yield Finding("rclpy", "two installations", "problem", str(problem))
        return
    unusable = environment.rclpy_problem()
    if unusable:
        yield Finding("rclpy", unusable, "problem", SOURCE_ROS)
        return
    if source == "apt":
        yield Finding(
            "rclpy", f"{_version('rclpy')} from apt, ROS_DISTRO={os.environ.get('ROS_DISTRO', '?')}"
        )
        yield Finding("middleware", os.environ.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp, the default"))
        return
    yield Finding("rclpy", f"{_version('ros-rclpy')} from wheels of {environment.distribution().title()}")
    yield from _wheels_middleware()


def _wheels_middleware() -> Iterator[Finding]:
    found = f"Fast DDS {_version('ros-fastrtps')}, rmw_fastrtps_cpp {_version('ros-rmw-fastrtps-cpp')}"
    wanted = os.environ.get("RMW_IMPLEMENTATION", "")
    if wanted and wanted != "rmw_fastrtps_cpp":
        advice = f"RMW_IMPLEMENTATION={wanted} has no effect: the wheels know Fast DDS only; unset it"
        yield Finding("middleware", found, "note", advice)
    else:
        yield Finding("middleware", found)


def look_at_interfaces() -> Iterator[Finding]:
    """Compare the installed message types, by their hashes, with those that the other nodes use."""
    wires = [profile.wire for profile in load_profiles() if profile.wire is not None]
    hashes = {name: found for wire in wires for name, found in wire.hashes.items()}
    for name, expected in {**hashes, COMMAND_TYPE: COMMAND_HASH}.items():
        try:
            found = local_hash(name).removeprefix(RIHS)
        except LupinError as problem:
            advice = (
                "build the interfaces: `make run` does it; or, in a checkout, `pip install ./*_msgs "
                "./interfaces/*_msgs`, or `colcon build` with a sourced ROS 2"
            )
            yield Finding(name, str(problem).partition(":")[0], "problem", advice)
            continue
        if found == expected:
            yield Finding(name, f"{RIHS}{found[:12]}…")
            continue
        advice = f"expected {RIHS}{expected[:12]}…: another version of the package is in the way; rebuild it"
        here = environment.distribution()
        state: State = "problem"
        if here and here not in environment.WHEELS and not name.startswith("lupin_"):
            advice = f"Jazzy and Kilted have {RIHS}{expected[:12]}…: use it with nodes of {here.title()} only"
            state = "note"
        yield Finding(name, f"{RIHS}{found[:12]}…", state, advice)


def look_at_network() -> Iterator[Finding]:
    """Check the ROS domain and the settings of discovery; note what other computers can reach."""
    domain, advice = _domain()
    shown = os.environ.get(DOMAIN, "").strip() or "not set: 0"
    yield Finding(DOMAIN, shown, "problem" if advice else "ok", advice)
    doors, advice = os.environ.get(RANGE, ""), range_advice()
    if advice:
        yield Finding(RANGE, doors, "problem", advice)
    else:
        yield Finding(RANGE, doors or f"not set: {CLOSED} is taken")
    if peers_advice():
        yield Finding(PEERS, os.environ[PEERS], "problem", peers_advice())
    yield _profile()
    doors = open_to()
    closed = Finding("open to", "this machine only")
    yield Finding("open to", "others, too", "note", doors) if doors else closed
    yield from _permissions()
    heard = 0 if domain is None else exposed(domain)
    if heard:
        found = f"{heard} participant{'s' * (heard > 1)} of domain {domain} on this machine"
        yield Finding("listening to others", found, "note", "other computers can find and command these")


def _domain() -> tuple[int | None, str]:
    """Return the ROS domain of this process, or None with advice where there is no such domain."""
    try:
        return ros_domain(), ""
    except UsageError as problem:
        return None, str(problem).rpartition(": ")[2]


def _permissions() -> Iterator[Finding]:
    """Check SROS2: whether nodes need certificates and permissions."""
    if os.environ.get("ROS_SECURITY_ENABLE", "").lower() != "true":
        yield Finding("SROS2", "off: who reaches a node may use all of it")
    elif environment.rclpy_source() == "wheels":
        advice = "the Fast DDS of the wheels has no security: unset ROS_SECURITY_ENABLE, or use an apt ROS 2"
        yield Finding("SROS2", "on, and nodes do not start", "problem", advice)
    elif os.environ.get("ROS_SECURITY_STRATEGY") != "Enforce":
        advice = "nodes without permissions take part all the same: set ROS_SECURITY_STRATEGY=Enforce"
        yield Finding("SROS2", "on, and nobody is kept out", "note", advice)
    else:
        keystore = os.environ.get("ROS_SECURITY_KEYSTORE", "")
        advice = "" if Path(keystore, "enclaves").is_dir() else "no enclaves there; see docs/security.md"
        yield Finding("SROS2", f"on, with {keystore or 'no keystore'}", "problem" if advice else "ok", advice)


def _profile() -> Finding:
    given = users_profile()
    if not given:
        return Finding("DDS profile", "the engine's own: peers within 1 s, deaths within 3 s")
    if Path(given).is_file():
        return Finding("DDS profile", given, "note", "yours is used instead of the engine's")
    return Finding("DDS profile", given, "problem", "there is no such file: unset the variable")


def look_at_left_overs() -> Iterator[Finding]:
    """Note stale shared memory, and the running nodes of this domain."""
    stale = stale_segments()
    size = sum(_size(file) for file in stale) / 1e6
    if stale:
        advice = f"`{_fastdds()} shm clean` removes them while no ROS node is starting"
        yield Finding("shared memory", f"{len(stale)} stale files, {size:.1f} MB", "note", advice)
    else:
        yield Finding("shared memory", "nothing stale")
    domain, _ = _domain()
    nodes = [] if domain is None else list(running_nodes(domain))
    if nodes:
        processes = ", ".join(f"{name} ({pid})" for pid, name in nodes)
        advice = "a run uses them, or they were started by hand; `kill PID` stops one"
        yield Finding("nodes running", processes, "note", advice)
    else:
        yield Finding("nodes running", "none")


def _fastdds() -> str:
    beside = Path(sys.prefix, "bin", "fastdds")
    return str(beside) if beside.is_file() else shutil.which("fastdds") or "fastdds"


def _size(file: Path) -> int:
    try:
        return file.stat().st_size
    except OSError:
        return 0


def running_nodes(domain: int, processes: Path = Path("/proc")) -> Iterator[tuple[int, str]]:
    """Yield process id and name of each `lupin node` in a ROS domain; those of other users are left out."""
    for entry in sorted(processes.glob("[0-9]*"), key=lambda e: int(e.name)):
        try:
            names = _nodes_in(_words(entry / "cmdline"))
            variables = dict(word.partition("=")[::2] for word in _words(entry / "environ")) if names else {}
            is_there = bool(names) and ros_domain(variables) == domain
        except (OSError, UsageError):
            continue  # it has ended, belongs to another user, or has a domain that does not exist
        if is_there:
            yield from ((int(entry.name), name) for name in names)


def _words(file: Path) -> list[str]:
    """Return the texts of a file of the kernel, which zero bytes separate."""
    return file.read_bytes().decode(errors="replace").split("\0")


def _nodes_in(words: Sequence[str]) -> list[str]:
    for place, (before, word) in enumerate(pairwise(words)):
        if word == "node" and (before == "lupin_cli.main" or Path(before).name == "lupin"):
            return list(takewhile(lambda name: name and not name.startswith("-"), words[place + 2 :]))
    return []


def look_at_plugins() -> Iterator[Finding]:
    """Check every installed plugin: a finding has its contents, or why it is refused."""
    for point in entry_points():
        try:
            plugin = verified_plugin(point)
        except LupinError as problem:
            yield Finding(f"plugin {point.name}", "refused", "problem", str(problem))
            continue
        parts = {
            "operation": plugin.operations,
            "action": plugin.actions,
            "function": plugin.functions,
            "value": plugin.values,
            "node": plugin.nodes,
        }
        counts = (f"{len(v)} {word}{'s' * (len(v) > 1)}" for word, v in parts.items() if v)
        yield Finding(f"plugin {plugin.name}", ", ".join(counts))


def look_at_extras() -> Iterator[Finding]:
    """Check the packages that only some commands need; a finding for each extra that lacks one."""
    required = metadata.requires("lupin-engine") or []
    for extra, purpose in _EXTRAS.items():
        named = [text for text in required if f"extra == {extra!r}" in text.replace('"', "'")]
        missing = [name for name in map(_distribution, named) if not _is_installed(name)]
        if missing:
            advice = f"{purpose} needs it: `pip install 'lupin-engine[{extra}]'`"
            yield Finding(f"packages of {extra}", f"{', '.join(missing)} missing", "note", advice)


def _distribution(requirement: str) -> str:
    return re.split(r"[^A-Za-z0-9._-]", requirement, maxsplit=1)[0]


def _is_installed(distribution: str) -> bool:
    return any(True for _ in metadata.distributions(name=distribution))


def look_at_lifecycle() -> Iterator[Finding]:
    """Check whether the lifecycle of the nearest folder is the shipped one, or a copy that has aged."""
    try:
        own, shipped = lifecycle_in(mission_folders()[0]), shipped_lifecycles()
    except LupinError:
        return  # the missions tell
    named = read(own, Findings())
    if named is None or own in shipped.values():
        return
    name, extends, origin = (named.get(key) for key in ("lifecycle", "extends", "origin"))
    base = lifecycle_called(extends, own.parent) if isinstance(extends, str) else None
    origin = origin if isinstance(origin, dict) else {}
    copied = str(origin.get("lifecycle"))
    if base is not None and base not in shipped.values():
        yield Finding("lifecycle", f"{own} extends {base}", "note", _CARRIED)
    elif base is not None:
        yield Finding("lifecycle", f"{own} extends {extends}, which engine {__version__} ships")
    elif copied in shipped:
        yield _copied(own, origin, origin_of(shipped[copied]))
    elif str(name) in shipped and not folders.is_shipped(own):
        found = f"{own} differs from the {name} that engine {__version__} ships"
        yield Finding("lifecycle", found, "note", f"{_EXTEND}, or give it a name of its own")


def _copied(own: Path, origin: Mapping[str, Any], now: Mapping[str, str]) -> Finding:
    """Return the finding of a copy of a lifecycle: whether the shipped one is the same today."""
    found = f"{own} is a copy of {origin['lifecycle']} of engine {origin.get('version')}"
    if origin.get("sha256") == now["sha256"]:
        return Finding("lifecycle", f"{found}, which has not changed since")
    return Finding("lifecycle", f"{found}, which has changed since", "note", _EXTEND)


def look_at_missions() -> Iterator[Finding]:
    """Check the missions of the nearest folder; a finding for each."""
    try:
        catalog = load_catalog()
        folder = mission_folders()[0]
    except LupinError as problem:
        yield Finding("missions", "cannot be checked", "problem", str(problem))
        return
    for file in mission_files(folder):
        _, diagnostics = check_chart(lifecycle_in(folder), [file], catalog)
        errors = [d for d in diagnostics if d.severity is Severity.ERROR]
        if errors:
            advice = f"`lupin check {file}` tells them all; the first: {errors[0]}"
            yield Finding(f"mission {file.stem}", f"{len(errors)} errors", "problem", advice)
        else:
            yield Finding(f"mission {file.stem}", f"no errors, in {folder}")


def look_at_old_words() -> Iterator[Finding]:
    """Count what the project here says that a later engine will refuse."""
    catalog = load_catalog()
    missions = Missions(catalog)
    folder = mission_folders()[0]
    if folder.resolve() == default_missions_folder().resolve():
        return
    dated = [one.stricter for one in check_chart(lifecycle_in(folder), mission_files(folder), catalog)[1]]
    for file in sorted((folder.absolute().parent / "scenarios").rglob(f"*{SUFFIX}")):
        with suppress(LupinError):
            dated += [one.stricter for one in load_scenario(file, catalog, missions).warnings]
    rows = [STRICTER[name] for name in dated if name]
    if not rows:
        yield Finding("old words", "none")
        return
    first = min(row.refused for row in rows)
    advice = "`lupin upgrade` shows what to change, and writes it with `--write`"
    yield Finding("old words", f"{len(rows)}, refused by versions from {first} on", "note", advice)


def _version(distribution: str) -> str:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return "of unknown version"


LOOKS: tuple[Callable[[], Iterator[Finding]], ...] = (
    look_at_python,
    look_at_ros,
    look_at_interfaces,
    look_at_network,
    look_at_left_overs,
    look_at_plugins,
    look_at_extras,
    look_at_lifecycle,
    look_at_missions,
    look_at_old_words,
)
