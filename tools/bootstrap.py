"""Make `.venv`: the engine, its plugins, ROS 2 Jazzy and the interface packages, on a machine without ROS.

`bootstrap.py run` installs what a run needs, `bootstrap.py dev` also what tests and documentation need. Once
everything is in place this ends within a moment. Only the standard library, and syntax that Python 3.6 reads:
a machine with an old Python gets a sentence that says so. The stamp in `.venv` is written last and taken away
first: an environment without one was left half-way and is made anew.

Where ROS 2 Jazzy has been sourced (ROS_DISTRO=jazzy), that one is used and no wheels of it are installed.
"""

import ast
import fcntl
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Optional

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
STAMP = VENV / "bootstrap.json"
LOG = VENV / "bootstrap.log"
INTERFACES_LOG = VENV / "bootstrap-interfaces.log"
PYTHON = str(VENV / "bin" / "python")
#: Raised when this file starts to arrange `.venv` differently: older ones are then made anew.
LAYOUT = 1
#: What ROS 2 Jazzy's wheels exist for, best first: 3.12 is the Python of Jazzy itself.
VERSIONS = ((3, 12), (3, 13), (3, 11), (3, 10))
PACKAGES = {name: "interfaces/" + name for name in ("nav2_msgs", "tf2_msgs", "control_msgs", "mirte_msgs")}
PACKAGES = {"lupin_msgs": "lupin_msgs", **PACKAGES}
INTERFACE_FILES = (".msg", ".srv", ".action", ".xml", ".txt", ".toml", ".cmake")
#: The engine's extras by what the environment is for, and where ROS 2 comes from.
EXTRAS = {"run": {"wheels": "ros", "apt": "sim"}, "dev": {"wheels": "ros,dev", "apt": "sim,dev"}}
GUARD = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"
CHECK = """
import rclpy, lupin_engine
from control_msgs.action import GripperCommand as A
from lupin_msgs.msg import Observation as B
from mirte_msgs.msg import ServoPosition as C
from nav2_msgs.action import NavigateToPose as D
from tf2_msgs.msg import TFMessage as E
[type(interface).__import_type_support__() for interface in (A, B, C, D, E)]
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
#: What stands in the output of a command that failed, and what to do about it.
NETWORK = r"NewConnectionError|name resolution|Network is unreachable|Timeout|ProxyError|Connection re"
HINTS = {
    r"No space left on device": "The disk is full. About 1.5 GB are needed while building.",
    NETWORK: "The Python package index cannot be reached. Check the network, then run this again.",
    r"SSLError|CERTIFICATE_VERIFY": "The certificate of the package index is not trusted here.",
    r"No matching distribution": "The package index that pip is set up with lacks a package.",
}
#: The programs that run now, to be ended when the user gives up.
running = []  # type: List[Any]
started = time.monotonic()


class Problem(Exception):
    """Something that the user has to mend: what it is, and what to do about it."""

    def __init__(self, what: str, *advice: str) -> None:
        Exception.__init__(self, what)
        self.advice = advice


class Python(NamedTuple):
    """An interpreter that was asked about itself."""

    executable: str
    facts: Dict[str, Any]


def say(text: str) -> None:
    """Say what is being done, after how long."""
    print(f"[{time.monotonic() - started:5.1f} s] {text}"[:110], flush=True)


def condense(line: str) -> str:
    """The telling part of a line of output of pip, CMake or ninja."""
    line = re.sub(r"\x1b\[[0-9;]*[A-Za-z]", "", line).strip()
    return re.sub(r"(?:https?|file)://\S+/", "", re.sub(r"\s*\(from .*", "", line))


def run(command: List[str], mode: str, log: Path, purpose: str, path: str = "") -> None:
    """Run to the end with all output in the log; a failure becomes a Problem with the end of it."""
    environment = clean_environment(mode)
    environment["PATH"] = path + environment.get("PATH", "")
    with log.open("ab") as output:
        begins = output.seek(0, os.SEEK_END)
        process = subprocess.Popen(command, env=environment, cwd=str(ROOT), stdout=output, stderr=output)
        running.append(process)
        code = process.wait()
        running.remove(process)
    if code:
        raise failure(purpose, log.read_bytes()[begins:].decode("utf-8", "replace").splitlines(), log)


def failure(purpose: str, output: List[str], log: Path) -> Problem:
    """Turn the output of a failed command into something to act on."""
    advice = ["    " + line for line in output[-12:]] + [f"The whole output is in {log}"]
    advice += [hint for pattern, hint in HINTS.items() if re.search(pattern, "\n".join(output))][:1]
    return Problem(purpose + " failed; the last lines were:", *advice)


class Background(threading.Thread):
    """Work in a thread; who waits for it shows the newest line of its log, so that it is seen to go on."""

    def __init__(self, log: Path, work: Any, *arguments: Any) -> None:
        threading.Thread.__init__(self, daemon=True)
        self.log, self.work, self.arguments = log, work, arguments
        self.error = None  # type: Optional[BaseException]
        self.start()

    def run(self) -> None:
        """What the thread does."""
        try:
            self.work(*self.arguments)
        except BaseException as error:
            self.error = error

    def wait(self) -> None:
        """Wait for the end; what went wrong there is raised here."""
        self.join(10.0)
        while self.is_alive():
            lines = self.log.read_bytes()[-2000:].splitlines() if self.log.is_file() else []
            say("    " + condense(lines[-1].decode("utf-8", "replace") if lines else "begins"))
            self.join(10.0)
        if self.error is not None:
            raise self.error


def clean_environment(mode: str) -> Dict[str, str]:
    """Our environment without what would lead pip or Python anywhere but into the one being made."""
    environment = dict(os.environ)
    for name in ("PYTHONHOME", "VIRTUAL_ENV", "PIP_USER", "PIP_TARGET", "PIP_PREFIX", "__PYVENV_LAUNCHER__"):
        environment.pop(name, None)
    # Set by the wheels of another environment from which we were started, with its libraries.
    if environment.pop(GUARD, None):
        environment.pop("LD_LIBRARY_PATH", None)
    if mode == "wheels":
        environment.pop("PYTHONPATH", None)
        environment.pop("AMENT_PREFIX_PATH", None)
        environment["PYTHONNOUSERSITE"] = "1"
    environment.update(PIP_DISABLE_PIP_VERSION_CHECK="1", PIP_NO_INPUT="1", PIP_PROGRESS_BAR="off")
    return environment


def succeeds(command: List[str], mode: str, cwd: str = "/") -> bool:
    """Whether a short command ends well."""
    silent = subprocess.DEVNULL
    try:
        return not subprocess.call(
            command, env=clean_environment(mode), cwd=cwd, stdout=silent, stderr=silent
        )
    except OSError:
        return False


def probe(command: str, mode: str) -> Optional[Python]:
    """Ask an interpreter about itself; None if there is none, or it does not start."""
    asked = [shutil.which(command) or "", "-c", PROBE]
    silent = subprocess.DEVNULL
    try:
        answer = subprocess.check_output(asked, env=clean_environment(mode), stderr=silent, timeout=30)
        facts = json.loads(answer.decode("utf-8").strip().splitlines()[-1])
    except (OSError, subprocess.SubprocessError, ValueError, IndexError):
        return None
    return Python(facts["executable"] or asked[0], facts)


def objection(python: Python, mode: str) -> Optional[str]:
    """Why an interpreter cannot be used, or None."""
    facts = python.facts
    minor = tuple(facts["version"][:2])
    if minor not in VERSIONS:
        return f"too {'old' if minor < (3, 10) else 'new'}, 3.10 to 3.13 will do"
    if facts["implementation"] != "CPython":
        return f"{facts['implementation']} is not CPython"
    if facts["threaded"]:
        return "a free-threaded build, for which there are no wheels of ROS 2"
    if not facts["venv"]:
        return "its venv or ensurepip module is missing: sudo apt install python{}.{}-venv".format(*minor)
    if mode == "apt" and not succeeds([python.executable, "-c", "import rclpy"], mode):
        return "cannot import the rclpy of the sourced ROS 2"
    return None


def choose_python(mode: str) -> Python:
    """The best usable interpreter."""
    versioned = ["python{}.{}".format(*version) for version in VERSIONS]
    # A sourced ROS 2 belongs to the Python of the system, whatever else stands first on the path.
    commands = ["/usr/bin/python3"] * (mode == "apt") + [*versioned, "python3", "python", sys.executable]
    wanted = os.environ.get("PYTHON")
    found = []  # type: List[str]
    for command in [wanted] if wanted else commands:
        python = probe(command, mode)
        reason = objection(python, mode) if python else "it does not start, or does not exist"
        if python and reason is None:
            return python
        if python or wanted:
            version = ".".join(map(str, python.facts["version"])) if python else "?"
            found.append(f"    {command} ({version}): {reason}")
    raise Problem(
        f"PYTHON={wanted} cannot be used."
        if wanted
        else "No usable Python was found: 3.10 to 3.13 is needed.",
        *found,
        "On Ubuntu 24.04 and Debian 12: sudo apt install python3 python3-venv python3-dev",
        "An interpreter that is not on the path: make PYTHON=/path/to/python3.12",
    )


def check_platform(python: Python) -> None:
    """The wheels of ROS 2 exist for one kind of machine."""
    facts = python.facts
    if facts["system"] != "Linux" or facts["machine"] not in ("x86_64", "AMD64") or facts["bits"] != 64:
        raise Problem(
            "ROS 2 Jazzy has no Python wheels for {system} on {machine}.".format(**facts),
            "Install ROS 2 Jazzy with apt on Ubuntu 24.04, source it, and run this again: it is then used.",
        )
    libc = re.match(r"glibc (\d+)\.(\d+)", facts["libc"])
    if libc is None or (int(libc.group(1)), int(libc.group(2))) < (2, 28):
        here = facts["libc"].strip() or "another libc"
        raise Problem(f"The wheels of ROS 2 Jazzy need glibc 2.28 or newer; here it is {here}.")


def check_compiler(python: Python) -> None:
    """The interfaces are compiled: try the compilers that CMake would take, and look for Python's headers."""
    advice = "On Debian and Ubuntu: sudo apt install build-essential python{}.{}-dev"
    advice = advice.format(*python.facts["version"])
    compilers = {"C": ("CC", "cc", "gcc", "clang"), "C++": ("CXX", "c++", "g++", "clang++")}
    for language, (variable, *names) in compilers.items():
        command = os.environ.get(variable, "").split() or [next(filter(shutil.which, names), "")]
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "trial.c").write_text("#include <stdlib.h>\nint main(void) { return 0; }\n")
            if not succeeds([*command, "trial.c", "-o", "trial"], "apt", folder):
                what = (
                    f"No working {language} compiler was found; it is needed once, for the ROS 2 interfaces."
                )
                raise Problem(what, advice)
    if not Path(python.facts["include"], "Python.h").is_file():
        raise Problem(f"The headers of Python are missing ({python.facts['include']}/Python.h).", advice)


def requested_mode() -> str:
    """`apt` where a ROS 2 was sourced, else `wheels`."""
    distribution = os.environ.get("ROS_DISTRO") or ""
    if distribution not in ("", "jazzy"):
        what = f"This shell has sourced ROS 2 {distribution}; Lupin needs Jazzy."
        raise Problem(what, "Run this in a shell without it: ROS 2 Jazzy then comes from Python wheels.")
    return "apt" if distribution else "wheels"


def interface_files(root: Path) -> List[Path]:
    """All files that decide what the interface packages become, in a fixed order."""
    found = [*(root / "lupin_msgs").rglob("*"), *(root / "interfaces").rglob("*")]
    return sorted(path for path in found if path.suffix in INTERFACE_FILES and path.is_file())


def digest(root: Path, files: List[Path], *more: str) -> str:
    """A hash over names and contents."""
    contents = [hashlib.sha256(path.read_bytes()).hexdigest() for path in files]
    names = [path.relative_to(root).as_posix() for path in files]
    return hashlib.sha256(json.dumps([names, contents, more]).encode("utf-8")).hexdigest()


def wanted_state(mode: str, purpose: str, finished: Dict[str, Any]) -> Dict[str, Any]:
    """What the stamp of a finished environment for the present files says."""
    # Interfaces compiled against another version of ROS 2 are other interfaces.
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if mode == "apt" else []
    manifests = [Path(prefix, "share", "rosidl_runtime_c", "package.xml") for prefix in prefixes]
    sourced = [manifest.read_text(encoding="utf-8") for manifest in manifests if manifest.is_file()]
    return {
        "layout": LAYOUT,
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
    decisive = ["layout", "root", "mode"] + ["python"] * bool(wanted["python"])
    return any(finished.get(key) != wanted[key] for key in decisive)


def refuse_other_mode(finished: Dict[str, Any], mode: str) -> None:
    """Never rebuild an environment only because a shell has, or has not, sourced ROS 2."""
    if finished.get("mode", mode) != mode:
        has = (
            "has sourced ROS 2, but .venv has its own" if mode == "apt" else "has not sourced ROS 2 as before"
        )
        raise Problem(f"This shell {has}.", "Use the other kind of shell, or `make clean` to begin anew.")


def missing_packages(python: Python, mode: str) -> List[str]:
    """The interface packages, as folders, that no sourced ROS 2 provides."""
    # A folder of that name on the path is not the package: only a package has an origin.
    test = "import importlib.util as u, sys; s = u.find_spec(sys.argv[1]); sys.exit(not (s and s.origin))"
    asked = {folder: [python.executable, "-c", test, name] for name, folder in PACKAGES.items()}
    return [folder for folder, command in asked.items() if mode == "wheels" or not succeeds(command, mode)]


def plain_temporary_folder() -> str:
    """A folder to build in. The generators of ROS do not quote paths, so it must be free of blanks."""
    chosen = tempfile.gettempdir()
    return chosen if re.match(r"^[\w./+-]+$", chosen, re.ASCII) else "/tmp"


def make_venv(python: Python, mode: str, folder: Path) -> None:
    """An empty environment."""
    system = ["--system-site-packages"] * (mode == "apt")
    log = Path(tempfile.gettempdir(), "lupin-venv.log")
    run([python.executable, "-m", "venv", *system, str(folder)], mode, log, "Making an environment")


def install(mode: str, *what: str) -> None:
    """Install into `.venv`. Bytecode is made when a module is first used: most are never."""
    run([PYTHON, "-m", "pip", "install", "--no-compile", *what], mode, LOG, "Installing")


def build_requirements(pyproject: Path) -> List[str]:
    """The build requirements of a package; its list of strings reads the same in TOML and in Python."""
    text = pyproject.read_text(encoding="utf-8")
    return list(ast.literal_eval(text.partition("\nrequires = ")[2].partition("\n]")[0] + "]"))


def build_wheels(python: Python, mode: str, folders: List[str], target: Path) -> None:
    """Compile interface packages in a temporary copy, with tools that do not stay in `.venv`."""
    with tempfile.TemporaryDirectory(prefix="lupin-build-", dir=plain_temporary_folder()) as name:
        for folder in ("lupin_msgs", "interfaces"):
            shutil.copytree(str(ROOT / folder), os.path.join(name, folder))
        # pip's own isolation would hide a sourced ROS 2.
        make_venv(python, mode, Path(name, "tools"))
        pip = [name + "/tools/bin/python", "-m", "pip"]
        needed = [*build_requirements(ROOT / "lupin_msgs" / "pyproject.toml"), "cmake>=3.24"]
        needed = [one for one in needed if mode == "wheels" or not one.startswith(("ros-", "catkin"))]
        run([*pip, "install", "--no-compile", *needed], mode, INTERFACES_LOG, "Installing the build tools")
        command = [*pip, "wheel", "-v", "--no-build-isolation", "--no-deps", "--wheel-dir", name + "/wheels"]
        command += [os.path.join(name, folder) for folder in folders]
        run(command, mode, INTERFACES_LOG, "Compiling the ROS 2 interfaces", name + "/tools/bin:")
        # In one rename, so that the cache never holds half of them; another checkout may have done the same.
        target.parent.mkdir(parents=True, exist_ok=True)
        partial = tempfile.mkdtemp(prefix="partial-", dir=str(target.parent))
        shutil.copytree(name + "/wheels", partial + "/wheels")
        if not target.is_dir():
            os.rename(partial + "/wheels", str(target))
        shutil.rmtree(partial)


def bring_up_to_date(purpose: str) -> None:
    """Do what is missing, and nothing else."""
    mode = requested_mode()
    finished = finished_state()
    refuse_other_mode(finished, mode)
    wanted = wanted_state(mode, purpose, finished)
    afresh = must_start_afresh(finished, wanted)
    parts = ("engine", "purpose", "interfaces")
    outdated = {part for part in parts if afresh or finished.get(part) != wanted[part]}
    if not outdated:
        return
    say("Looking for a Python and what else is needed")
    python = choose_python(mode) if afresh else probe(PYTHON, mode)
    if python is None:
        raise Problem(f"{PYTHON} does not start.", "Run: make clean, then this again.")
    if mode == "wheels":
        check_platform(python)
    folders = missing_packages(python, mode) if "interfaces" in outdated else []
    cache = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "lupin-engine", "wheels")
    wheels = cache / digest(ROOT, [], wanted["interfaces"], python.facts["tag"], mode, *folders)[:24]
    building = bool(folders) and not wheels.is_dir()
    if building:
        check_compiler(python)  # before minutes of downloads, not after them
    if afresh:
        say(f"Making .venv with {python.executable}")
        shutil.rmtree(str(VENV), ignore_errors=True)
        make_venv(python, mode, VENV)
    if STAMP.exists():
        STAMP.unlink()
    # Compiling needs the processor while pip waits for the network.
    work = (build_wheels, python, mode, folders, wheels) if building else (list,)  # type: Any
    compiling = Background(INTERFACES_LOG, *work)
    if outdated & {"engine", "purpose"}:
        beside = ", while the ROS 2 interfaces are compiled" * building
        say(f"Installing the engine and what it needs{beside}")
        extras = EXTRAS[wanted["purpose"]][mode]
        Background(LOG, install, mode, "--editable", f"{ROOT}[{extras}]").wait()
    if folders:
        say("Installing the ROS 2 interfaces")
        compiling.wait()
        install(mode, "--no-deps", "--no-index", "--force-reinstall", *map(str, wheels.glob("*.whl")))
    say("Trying it")
    environment = [PYTHON, "-m", "lupin_engine.ros.adapter.environment"]
    run([*environment, PYTHON, "-c", CHECK], mode, LOG, "Trying the new environment")
    partial = STAMP.with_suffix(".partial")
    partial.write_text(json.dumps(wanted, indent=2), encoding="utf-8")
    os.replace(str(partial), str(STAMP))
    say("Done")


def main(purpose: str = "run") -> int:
    """Prepare `.venv`; the exit code says whether it is ready."""
    try:
        with open(__file__, "rb") as lock:  # two at once would write into the same environment: one waits
            fcntl.flock(lock, fcntl.LOCK_EX)
            bring_up_to_date(purpose)
    except Problem as problem:
        print(f"\n{problem}", *problem.advice, sep="\n", file=sys.stderr)
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
