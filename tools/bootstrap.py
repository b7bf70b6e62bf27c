"""Make `.venv`: the engine, its plugins, ROS 2 and the interface packages, on a machine without ROS.

`bootstrap.py run` installs what a run needs, `bootstrap.py dev` also what tests need. Python 3.6 can read it:
an old one gets a sentence. The stamp in `.venv` is written last and taken away first: without one, the
environment is made anew. A ROS 2 that has been sourced is used as it is; otherwise its wheels are installed:
those of Jazzy, or with LUPIN_ROS=kilted those of Kilted, into `.venv-kilted`.
"""

import ast
import fcntl
import hashlib
import json
import os
import re
import runpy
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent import futures
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence

ROOT = Path(__file__).resolve().parent.parent
#: The ROS 2 that has wheels: the environment of each, and its extra of the engine.
WHEELS = {"jazzy": (".venv", "ros"), "kilted": (".venv-kilted", "ros-kilted")}
#: Whose wheels are meant. `lupin interfaces add` sets it to that of its own environment.
DISTRIBUTION = os.environ.get("LUPIN_ROS") or "jazzy"
#: What may have been sourced. Wheels are tested, these are not: docs/testing.md says what was run where.
SOURCED = ("jazzy", "kilted", "lyrical")
VENV = ROOT / WHEELS.get(DISTRIBUTION, WHEELS["jazzy"])[0]
VENV_LOG = Path(tempfile.gettempdir(), "lupin-venv.log")
STAMP, PYTHON = VENV / "bootstrap.json", str(VENV / "bin" / "python")
LOG, INTERFACES_LOG = VENV / "bootstrap.log", VENV / "bootstrap-interfaces.log"
#: What the wheels of ROS 2 exist for, best first: 3.12 is the Python of Jazzy and Kilted themselves.
VERSIONS = ((3, 12), (3, 13), (3, 11), (3, 10))
#: What Jazzy compiles interfaces with and Kilted does not have, and what Kilted has instead.
ONLY_JAZZY = ("ros-jazzy-fastrtps-cmake-module", "ros-jazzy-python-cmake-module")
SINCE_KILTED = ["ros-kilted-ament-cmake-ros-core"]
SUBSETS = ("nav2", "tf2", "control", "mirte")
FOLDERS = ["lupin_msgs", *map("interfaces/{}_msgs".format, ("lupin_engine", *SUBSETS))]
SOURCES = ("lupin_msgs", "interfaces")
INTERFACE_FILES = (".msg", ".srv", ".action", ".xml", ".txt", ".toml", ".cmake")
#: What the verbs of the README need; the extra `ros` has the same and ROS 2.
RUN_EXTRAS = {"wheels": WHEELS.get(DISTRIBUTION, WHEELS["jazzy"])[1], "apt": "diagram,editor,hmi,record,sim"}
GUARD = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"
CHECK = """
import sys; sys.dont_write_bytecode = False  # what is tried leaves bytecode, so that later starts are fast
import rclpy, lupin_cli.main, lupin_msgs.msg as l, mirte_msgs.msg as m, tf2_msgs.msg as t
import control_msgs.action as c, nav2_msgs.action as n, lupin_engine_msgs.action as e
for each in (l.Observation, e.RunMission, m.ServoPosition, t.TFMessage, c.GripperCommand, n.NavigateToPose):
    type(each).__import_type_support__()
lupin_cli.main.main(["check"])
"""
PROBE = """
import importlib.util as u, json, os, platform, struct, sys, sysconfig
print(json.dumps({
    "executable": sys.executable, "version": list(sys.version_info[:3]), "bits": struct.calcsize("P") * 8,
    "implementation": platform.python_implementation(), "system": platform.system(),
    "machine": platform.machine(), "libc": " ".join(platform.libc_ver()),
    "venv": all(map(u.find_spec, ("venv", "ensurepip"))),
    "threaded": bool(sysconfig.get_config_var("Py_GIL_DISABLED")), "include": sysconfig.get_path("include"),
    "tag": "cp%d%d-%s" % (sys.version_info[0], sys.version_info[1], platform.machine())}))
"""
NETWORK = r"NewConnectionError|name resolution|Network is unreach|Timeout|ProxyError|Connection re|SSLError"
UNREACHABLE = "The Python package index cannot be reached. Check the network, then run this again."
#: The programs that run now, to be ended when the user gives up.
running = []  # type: List[Any]
started = time.monotonic()


class Problem(Exception):
    """Something that the user has to mend: what it is, and lines of what to do about it."""


def say(text: str) -> None:
    """Say what is being done, after how long."""
    print(f"[{time.monotonic() - started:5.1f} s] {text}"[:110], flush=True)


def condense(line: str) -> str:
    """The telling part of a line of output of pip, CMake or ninja."""
    return re.sub(r"\x1b\[[0-9;]*[A-Za-z]|(?:https?|file)://\S+/|\s*\(from .*", "", line).strip()


def run(command: List[str], mode: str, log: Path, purpose: str, path: str = "") -> None:
    """Run to the end with all output in the log; a failure becomes a Problem with the end of it."""
    environment = {**clean_environment(mode), "PATH": path + os.environ.get("PATH", "")}
    with log.open("ab") as output:
        begins = output.seek(0, os.SEEK_END)
        process = subprocess.Popen(command, env=environment, cwd=str(ROOT), stdout=output, stderr=output)
        running.append(process)
        code = process.wait()
        running.remove(process)
    if code:
        lines = log.read_bytes()[begins:].decode("utf-8", "replace").splitlines()
        last = ["    " + line for line in lines[-12:]] + [f"The whole output is in {log}"]
        hint = [UNREACHABLE] * bool(re.search(NETWORK, "\n".join(lines)))
        raise Problem(purpose + " failed; the last lines were:", *last, *hint)


def wait(work: "futures.Future[None]", log: Path) -> None:
    """Wait for work in a thread, whose error is raised here; show the newest line of its log meanwhile."""
    while not futures.wait([work], 10.0).done:
        lines = log.read_bytes()[-2000:].splitlines() if log.is_file() else []
        say("    " + condense(lines[-1].decode("utf-8", "replace") if lines else "begins"))
    work.result()


def clean_environment(mode: str) -> Dict[str, str]:
    """Our environment without what would lead pip or Python anywhere but into the one being made."""
    dropped = ("PYTHONHOME VIRTUAL_ENV PIP_USER PIP_TARGET PIP_PREFIX __PYVENV_LAUNCHER__ " + GUARD).split()
    dropped += ["LD_LIBRARY_PATH"] * (GUARD in os.environ)  # of another environment that started us
    dropped += ["PYTHONPATH", "AMENT_PREFIX_PATH"] * (mode == "wheels")
    kept = {name: value for name, value in os.environ.items() if name not in dropped}
    kept.update({"PYTHONNOUSERSITE": "1"} if mode == "wheels" else {})
    return dict(kept, PIP_DISABLE_PIP_VERSION_CHECK="1", PIP_NO_INPUT="1", PIP_PROGRESS_BAR="off")


def answer(command: List[str], mode: str) -> Optional[str]:
    """What a short command prints, None if it fails."""
    options = {"env": clean_environment(mode), "stderr": subprocess.DEVNULL, "timeout": 30}  # type: Any
    try:
        return str(subprocess.check_output(command, cwd="/", universal_newlines=True, **options))
    except (OSError, subprocess.SubprocessError):
        return None


def probe(command: str, mode: str) -> Dict[str, Any]:
    """What an interpreter says of itself; nothing if there is none, or it does not start."""
    printed = answer([os.path.abspath(shutil.which(command) or os.devnull), "-c", PROBE], mode)
    return dict(json.loads(printed.splitlines()[-1])) if printed else {}


def objection(facts: Dict[str, Any], mode: str) -> Optional[str]:
    """Why an interpreter cannot be used, or None."""
    minor = tuple(facts["version"][:2])
    last = 14 if mode == "apt" else 13  # 3.14 is the Python of Lyrical, and has no wheels
    if not (3, 10) <= minor <= (3, last):
        return f"too {'old' if minor < (3, 10) else 'new'}, 3.10 to 3.{last} will do"
    kind = "a free-threaded build" if facts["threaded"] else facts["implementation"]
    if kind != "CPython":
        return kind + " is not CPython as the wheels of ROS 2 need it"
    if not facts["venv"]:
        return "its venv or ensurepip module is missing: sudo apt install python{}.{}-venv".format(*minor)
    if mode == "apt" and answer([facts["executable"], "-c", "import rclpy"], mode) is None:
        return "cannot import the rclpy of the sourced ROS 2"
    return None


def choose_python(mode: str) -> Dict[str, Any]:
    """The best usable interpreter."""
    versioned = ["python{}.{}".format(*version) for version in VERSIONS]
    # A sourced ROS 2 belongs to the Python of the system, whatever else stands first on the path.
    commands = ["/usr/bin/python3"] * (mode == "apt") + [*versioned, "python3", "python", sys.executable]
    wanted = os.environ.get("PYTHON")
    what = f"PYTHON={wanted} cannot be used" if wanted else "No usable Python was found (3.10 to 3.13)"
    found = []  # type: List[str]
    for command in [wanted] if wanted else commands:
        python = probe(command, mode)
        reason = objection(python, mode) if python else "it does not start, or does not exist"
        if reason is None:
            return python
        if python or wanted:
            found.append(f"    {command} ({'.'.join(map(str, python.get('version', '?')))}): {reason}")
    apt = "On Ubuntu 24.04 and Debian 12: sudo apt install python3 python3-venv python3-dev"
    path = "An interpreter that is not on the path: make PYTHON=/path/to/python3.12"
    raise Problem(what + ".", *found, apt, path)


def check_platform(facts: Dict[str, Any]) -> None:
    """The wheels of ROS 2 exist for one kind of machine."""
    if facts["system"] != "Linux" or facts["machine"] not in ("x86_64", "AMD64") or facts["bits"] != 64:
        what = "ROS 2 has no Python wheels for {system} on {machine}.".format(**facts)
        raise Problem(what, "Install ROS 2 Jazzy with apt on Ubuntu 24.04 and source it: it is then used.")
    libc = re.match(r"glibc (\d+)\.(\d+)", facts["libc"])
    if libc is None or (int(libc.group(1)), int(libc.group(2))) < (2, 28):
        here = facts["libc"].strip() or "another libc"
        raise Problem(f"The wheels of ROS 2 need glibc 2.28 or newer; here it is {here}.")


def check_compiler(facts: Dict[str, Any]) -> None:
    """The interfaces are compiled: try the compilers that CMake would take, and look for Python's headers."""
    advice = "On Debian, Ubuntu: sudo apt install build-essential python{}.{}-dev".format(*facts["version"])
    compilers = {"C": ("CC", "cc", "gcc", "clang"), "C++": ("CXX", "c++", "g++", "clang++")}
    for language, (variable, *names) in compilers.items():
        command = os.environ.get(variable, "").split() or [next(filter(shutil.which, names), "")]
        trial = ["-x", language.lower(), "-I", facts["include"], "-include", "Python.h", "-fsyntax-only"]
        if answer([*command, *trial, os.devnull], "apt") is None:
            what = f"No working {language} compiler with the headers of Python ({facts['include']}) was found"
            raise Problem(what + "; they are needed once, for the ROS 2 interfaces.", advice)


def requested_mode() -> str:
    """`apt` where a ROS 2 was sourced, else `wheels`."""
    sourced, wanted = os.environ.get("ROS_DISTRO") or "", os.environ.get("LUPIN_ROS") or ""
    if DISTRIBUTION not in WHEELS:
        what = f"LUPIN_ROS is {DISTRIBUTION!r}: only {' and '.join(WHEELS)} have Python wheels."
        raise Problem(what, "Use one of them, or unset LUPIN_ROS: for Jazzy, or for a ROS 2 that is sourced.")
    if sourced and wanted:
        what = f"This shell has sourced ROS 2 {sourced}, and LUPIN_ROS={wanted} asks for Python wheels."
        raise Problem(what, "They do not mix: unset LUPIN_ROS, or use a shell in which no ROS 2 is sourced.")
    if sourced and sourced not in SOURCED:
        what = f"This shell has sourced ROS 2 {sourced}; Lupin runs on {', '.join(SOURCED)}."
        raise Problem(what, "Run this in a shell without it: ROS 2 Jazzy then comes from Python wheels.")
    return "apt" if sourced else "wheels"


def interface_files(root: Path) -> List[Path]:
    """All files that decide what the interface packages become, in a fixed order."""
    found = [*(root / "lupin_msgs").rglob("*"), *(root / "interfaces").rglob("*")]
    built = [path for path in found if root / "interfaces" / "complete" not in path.parents]
    return sorted(path for path in built if path.suffix in INTERFACE_FILES and path.is_file())


def digest(root: Path, files: List[Path], *more: str) -> str:
    """A hash over names and contents."""
    found = [(path.relative_to(root).as_posix(), path.read_text(encoding="utf-8")) for path in files]
    return hashlib.sha256(json.dumps([found, more]).encode("utf-8")).hexdigest()


def wanted_state(mode: str, purpose: str, finished: Dict[str, Any]) -> Dict[str, Any]:
    """What the stamp of a finished environment for the present files says."""
    # Interfaces compiled against another version of ROS 2 are other interfaces.
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if mode == "apt" else []
    manifests = [Path(prefix, "share", "rosidl_runtime_c", "package.xml") for prefix in prefixes]
    sourced = [manifest.read_text(encoding="utf-8") for manifest in manifests if manifest.is_file()]
    return {
        "root": str(ROOT),
        "mode": mode,
        "purpose": "dev" if finished.get("purpose") == "dev" else purpose,  # which has what a run needs
        "python": os.environ.get("PYTHON", ""),
        "engine": digest(ROOT, [ROOT / "pyproject.toml"]),
        "interfaces": digest(ROOT, interface_files(ROOT), *sourced),
    }


def finished_state() -> Dict[str, Any]:
    """The stamp of the environment, empty if it is missing, unreadable, or the interpreter is gone."""
    try:
        state = json.loads(STAMP.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return state if isinstance(state, dict) and os.access(PYTHON, os.X_OK) else {}


def must_start_afresh(finished: Dict[str, Any], wanted: Dict[str, Any]) -> bool:
    """Whether the environment cannot be brought up to date; without a wish, the interpreter stays."""
    mode = wanted["mode"]
    if finished.get("mode", mode) != mode:  # never only because a shell has, or has not, sourced ROS 2
        made = f"{VENV.name} was made with ROS 2 from {finished['mode']}"
        what = f"This shell means ROS 2 from {mode}, but {made}."
        raise Problem(what, "Use the other kind of shell, or `make clean` to begin anew.")
    return any(finished.get(k) != wanted[k] for k in ["root", "mode"] + ["python"] * bool(wanted["python"]))


def missing_packages(executable: str, mode: str) -> List[str]:
    """The folders of the interface packages that no sourced ROS 2 provides."""
    # A folder of that name on the path is not the package: only a package has an origin.
    test = "import importlib.util as u, sys; s = u.find_spec(sys.argv[1]); sys.exit(not (s and s.origin))"
    asked = {folder: [executable, "-c", test, os.path.basename(folder)] for folder in FOLDERS}
    return [folder for folder in FOLDERS if mode == "wheels" or answer(asked[folder], mode) is None]


def plain_temporary_folder() -> str:
    """A folder to build in. The generators of ROS do not quote paths, so it must be free of blanks."""
    chosen = tempfile.gettempdir()
    return chosen if re.match(r"^[\w./+-]+$", chosen, re.ASCII) else "/tmp"


def make_venv(executable: str, mode: str, folder: Path) -> None:
    """An empty environment."""
    system = ["--system-site-packages"] * (mode == "apt")
    run([executable, "-m", "venv", *system, str(folder)], mode, VENV_LOG, "Making an environment")


def install(mode: str, *what: str) -> None:
    """Install into `.venv`. Bytecode is made when a module is first used: most are never."""
    run([PYTHON, "-m", "pip", "install", "--no-compile", *what], mode, LOG, "Installing")


def build_requirements(pyproject: Path) -> List[str]:
    """The build requirements of a package; its list of strings reads the same in TOML and in Python."""
    text = pyproject.read_text(encoding="utf-8")
    return list(ast.literal_eval(text.partition("\nrequires = ")[2].partition("\n]")[0] + "]"))


def build_wheels(
    executable: str, mode: str, folders: List[str], target: Path, sources: Sequence[str] = SOURCES
) -> None:
    """Compile interface packages in a temporary copy, with tools that do not stay in `.venv`.

    `folders` lie below the folders `sources`. `lupin interfaces add` uses this, too.
    """
    if target.is_dir() or not folders:
        return
    with tempfile.TemporaryDirectory(prefix="lupin-build-", dir=plain_temporary_folder()) as name:
        for folder in sources:
            shutil.copytree(str(ROOT / folder), os.path.join(name, os.path.basename(folder)))
        # pip's own isolation would hide a sourced ROS 2.
        make_venv(executable, mode, Path(name, "tools"))
        pip = [name + "/tools/bin/python", "-m", "pip"]
        needed = [*build_requirements(ROOT / "lupin_msgs" / "pyproject.toml"), "cmake>=3.24"]
        needed = [one for one in needed if mode == "wheels" or not one.startswith(("ros-", "catkin"))]
        if DISTRIBUTION != "jazzy":
            needed = [one.replace("jazzy", DISTRIBUTION) for one in needed if one not in ONLY_JAZZY]
            needed += SINCE_KILTED
        run([*pip, "install", "--no-compile", *needed], mode, INTERFACES_LOG, "Installing the build tools")
        command = [*pip, "wheel", "-v", "--no-build-isolation", "--no-deps", "--wheel-dir", name + "/wheels"]
        command += [os.path.join(name, folder) for folder in folders]
        run(command, mode, INTERFACES_LOG, "Compiling the ROS 2 interfaces", name + "/tools/bin:")
        # In one rename, so that the cache never holds half of them; another checkout may have done the same.
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix="partial-", dir=str(target.parent)) as partial:
            shutil.copytree(name + "/wheels", partial + "/wheels")
            if not target.is_dir():
                os.rename(partial + "/wheels", str(target))


def check_domain() -> None:
    """A run would refuse the shell's ROS domain, but only after minutes of installing."""
    domains = runpy.run_path(str(ROOT / "lupin_engine" / "plugin" / "domain.py"))
    try:
        domains["domain_number"](os.environ.get(domains["DOMAIN"], "").strip() or "0")
    except ValueError as problem:
        raise Problem(str(problem))


def bring_up_to_date(purpose: str) -> None:
    """Do what is missing, and nothing else."""
    if purpose == "run":
        check_domain()
    mode, finished = requested_mode(), finished_state()
    wanted = wanted_state(mode, purpose, finished)
    afresh = must_start_afresh(finished, wanted)
    outdated = {part for part in wanted if afresh or finished.get(part) != wanted[part]} - {"python"}
    if not outdated:
        return
    say("Looking for a Python and what else is needed")
    python = choose_python(mode) if afresh else probe(PYTHON, mode)
    if not python:
        raise Problem(f"{PYTHON} does not start.", "Run: make clean, then this again.")
    if mode == "wheels":
        check_platform(python)
    folders = missing_packages(python["executable"], mode) if "interfaces" in outdated else []
    cache = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "lupin-engine", "wheels")
    wheels = cache / digest(ROOT, [], wanted["interfaces"], python["tag"], mode, DISTRIBUTION, *folders)[:24]
    building = bool(folders) and not wheels.is_dir()
    if building:
        check_compiler(python)  # before minutes of downloads, not after them
    if afresh:
        say(f"Making {VENV.name} with {python['executable']}")
        shutil.rmtree(str(VENV), ignore_errors=True)
        make_venv(python["executable"], mode, VENV)
    if STAMP.exists():
        STAMP.unlink()
    threads = futures.ThreadPoolExecutor(2)  # compiling needs the processor while pip waits for the network
    compiling = threads.submit(build_wheels, python["executable"], mode, folders, wheels)
    if outdated & {"engine", "purpose"}:
        say("Installing the engine and its needs" + ", while the ROS 2 interfaces are compiled" * building)
        extras = RUN_EXTRAS[mode] + ",dev" * (wanted["purpose"] == "dev")
        wait(threads.submit(install, mode, "--editable", f"{ROOT}[{extras}]"), LOG)
    if folders:
        say("Installing the ROS 2 interfaces")
        wait(compiling, INTERFACES_LOG)
        install(mode, "--no-deps", "--no-index", "--force-reinstall", *map(str, wheels.glob("*.whl")))
    say("Trying it")
    run([PYTHON, "-m", "lupin_ros.adapter.environment", PYTHON, "-c", CHECK], mode, LOG, "Trying it")
    STAMP.with_suffix(".partial").write_text(json.dumps(wanted, indent=2), encoding="utf-8")
    os.replace(str(STAMP.with_suffix(".partial")), str(STAMP))
    say("Done")


def main(purpose: str = "run") -> int:
    """Prepare `.venv`; the exit code says whether it is ready."""
    try:
        with open(__file__, "rb") as lock:  # two at once would write into the same environment: one waits
            fcntl.flock(lock, fcntl.LOCK_EX)
            bring_up_to_date(purpose)
    except Problem as problem:
        print("", *problem.args, sep="\n", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nInterrupted. Run it again: what is unfinished is made anew.", file=sys.stderr)
        return 130
    finally:
        for process in tuple(running):
            process.terminate()
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
