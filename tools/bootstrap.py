"""Make `.venv`: the engine, its plugins, ROS 2 Jazzy and the interface packages, on a machine without ROS.

`make run` and `make test` come through here first. Once everything is in place this ends within a moment.

Only the standard library, and syntax that Python 3.6 reads: a machine with an old Python must get a sentence
that says so. The stamp in `.venv` is written last and taken away first: an environment without one was left
half-way and is made anew.

Where ROS 2 Jazzy has been sourced (ROS_DISTRO=jazzy), that one is used and no wheels of it are installed.
That side was tested with a stand-in for the apt packages only.
"""

import ast
import contextlib
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
import traceback
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Tuple

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
STAMP = VENV / "bootstrap.json"
LOG = VENV / "bootstrap.log"
BUILD_LOG = VENV / "bootstrap-interfaces.log"
#: Raised when this file starts to arrange `.venv` differently: older ones are then made anew.
LAYOUT = 1

#: What ROS 2 Jazzy's wheels exist for, best first: 3.12 is the Python of Jazzy itself.
VERSIONS = ((3, 12), (3, 13), (3, 11), (3, 10))

PACKAGES = (
    ("lupin_msgs", "lupin_msgs"),
    ("nav2_msgs", "interfaces/nav2_msgs"),
    ("tf2_msgs", "interfaces/tf2_msgs"),
    ("control_msgs", "interfaces/control_msgs"),
    ("mirte_msgs", "interfaces/mirte_msgs"),
)
INTERFACE_FILES = (".msg", ".srv", ".action", ".xml", ".txt", ".toml", ".cmake")
EXTRAS = {"wheels": "ros,dev", "apt": "sim,dev"}
GUARD = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"

CHECK = """
import rclpy, lupin_engine
from lupin_msgs.msg import Observation
from nav2_msgs.action import NavigateToPose
from tf2_msgs.msg import TFMessage
from control_msgs.action import GripperCommand
from mirte_msgs.msg import ServoPosition
for interface in (Observation, NavigateToPose, TFMessage, GripperCommand, ServoPosition):
    type(interface).__import_type_support__()
"""

PROBE = """
import json, os, platform, struct, sys, sysconfig
def has(module):
    try:
        __import__(module)
        return True
    except ImportError:
        return False
try:
    libc = os.confstr("CS_GNU_LIBC_VERSION") or ""
except (ValueError, OSError, AttributeError):
    libc = ""
print(json.dumps({
    "executable": sys.executable, "version": list(sys.version_info[:3]), "bits": struct.calcsize("P") * 8,
    "implementation": platform.python_implementation(), "system": platform.system(),
    "machine": platform.machine(), "libc": libc, "venv": has("venv") and has("ensurepip"),
    "threaded": bool(sysconfig.get_config_var("Py_GIL_DISABLED")), "include": sysconfig.get_path("include"),
    "tag": "cp%d%d-%s" % (sys.version_info[0], sys.version_info[1], platform.machine())}))
"""


class Problem(Exception):
    """Something that the user has to mend: what it is, and what to do about it."""

    def __init__(self, what: str, *advice: str) -> None:
        Exception.__init__(self, what)
        self.advice = advice


class Python(NamedTuple):
    """An interpreter that was asked about itself."""

    executable: str
    facts: Dict[str, Any]

    @property
    def version(self) -> str:
        """As in 3.12.1."""
        return ".".join(str(part) for part in self.facts["version"])


# -- Telling the user ---------------------------------------------------------------------------------------


class Progress:
    """Says what is being done and that it still goes on: one living line on a terminal, else plain lines."""

    def __init__(self, live: bool, plain_every: float = 15.0) -> None:
        self.live = live
        self.plain_every = plain_every
        self.started = time.monotonic()
        self.step_started = self.started
        self.last_plain = self.started

    def step(self, title: str) -> None:
        """Begin a step."""
        self.step_started = self.last_plain = time.monotonic()
        print("[{:5.1f} s] {}".format(self.step_started - self.started, title), flush=True)

    def tick(self, detail: str) -> None:
        """Show that the step is alive."""
        now = time.monotonic()
        text = "          {:4.0f} s  {}".format(now - self.step_started, detail)
        if self.live:
            width = shutil.get_terminal_size().columns - 1
            print("\r\033[K" + text[:width], end="", flush=True)
        elif now - self.last_plain >= self.plain_every:
            self.last_plain = now
            print(text[:110], flush=True)

    def done(self, text: str = "done") -> None:
        """End a step."""
        clear = "\r\033[K" if self.live else ""
        seconds = time.monotonic() - self.step_started
        print("{}          {} in {:.1f} s".format(clear, text, seconds), flush=True)


def condense(line: str) -> str:
    """The telling part of a line of output of pip, CMake or ninja."""
    line = re.sub(r"\x1b\[[0-9;]*[A-Za-z]", "", line).strip()
    line = re.sub(r"\s*\(from .*", "", line)
    return re.sub(r"(?:https?|file)://\S+/", "", line)


# -- Running programs ---------------------------------------------------------------------------------------


class Runner:
    """Runs the long commands: all output goes to the log, the newest line of it to the progress display."""

    def __init__(self, progress: Progress, log: Path) -> None:
        self.progress = progress
        self.log = log
        self.newest = ""
        self.stopped = False

    def run(self, command: List[str], environment: Dict[str, str], cwd: Path, purpose: str) -> None:
        """Run to the end; a failure becomes a Problem with the end of the output."""
        tail = []  # type: List[str]
        with self.log.open("a", encoding="utf-8") as log:
            log.write("\n$ {}\n".format(" ".join(command)))
            process = subprocess.Popen(
                command, cwd=str(cwd), env=environment, stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            )  # fmt: skip

            def read() -> None:
                assert process.stdout is not None
                for raw in process.stdout:
                    line = raw.decode("utf-8", "replace")
                    log.write(line)
                    if line.strip():
                        self.newest = condense(line)
                        tail.append(line.rstrip())
                        del tail[:-400]

            reader = threading.Thread(target=read, daemon=True)
            reader.start()
            try:
                while process.poll() is None:
                    if self.stopped:
                        raise Problem("{} was given up.".format(purpose))
                    self.progress.tick(self.newest)
                    reader.join(0.25)
                    if not reader.is_alive():
                        process.wait()
            except BaseException:
                process.terminate()
                process.wait()
                raise
            reader.join()
        if process.returncode:
            raise failure(purpose, tail, self.log)


class Background(threading.Thread):
    """Runs one long piece of work beside another one, silently until it is waited for."""

    def __init__(self, work: Callable[["Runner"], None], log: Path) -> None:
        threading.Thread.__init__(self, daemon=True)
        self.work = work
        self.runner = Runner(Progress(live=False, plain_every=float("inf")), log)
        self.error = None  # type: Optional[BaseException]

    def run(self) -> None:
        """What the thread does."""
        try:
            self.work(self.runner)
        except BaseException as error:
            self.error = error

    def wait(self, progress: Progress) -> None:
        """Wait for the end, showing what is going on; what went wrong there is raised here."""
        while self.is_alive():
            progress.tick(self.runner.newest)
            self.join(0.25)
        if self.error is not None:
            raise self.error

    def stop(self) -> None:
        """Give up: end the program that runs, and wait until its traces are removed."""
        self.runner.stopped = True
        self.join()


def failure(purpose: str, output: List[str], log: Path) -> Problem:
    """Turn the output of a failed command into something to act on."""
    if on_terminal():
        print("\r\033[K", end="")
    advice = ["    " + line for line in output[-12:]]
    advice.append("The whole output is in {}".format(log))
    text = "\n".join(output)
    for pattern, hint in HINTS:
        if re.search(pattern, text):
            advice.append(hint)
            break
    return Problem(purpose + " failed; the last lines were:", *advice)


def on_terminal() -> bool:
    """Whether the progress display has a living line, to be wiped before something else is said."""
    return sys.stdout.isatty()


HINTS = (
    (
        r"No space left on device",
        "The disk is full. About 1.5 GB are needed while building, 500 MB afterwards.",
    ),
    (
        r"NewConnectionError|Temporary failure in name resolution|Network is unreachable|ConnectTimeout"
        r"|ReadTimeout|ProxyError|Connection refused|Connection reset",
        "The Python package index cannot be reached. Check the network (and the proxy), then run this again: "
        "it takes up what has been downloaded.",
    ),
    (r"SSLError|CERTIFICATE_VERIFY_FAILED", "The certificate of the package index is not trusted here."),
    (
        r"No matching distribution|Could not find a version",
        "The package index that pip is set up with lacks a package, or cannot be reached.",
    ),
    (r"Python\.h", "Python's headers are missing: sudo apt install python3-dev"),
)


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


# -- Finding an interpreter ---------------------------------------------------------------------------------


def candidates(mode: str) -> List[str]:
    """Commands that may be a usable Python, best first."""
    chosen = os.environ.get("PYTHON")
    if chosen:
        return [chosen]
    versioned = ["python{}.{}".format(*version) for version in VERSIONS]
    plain = ["python3", "python"]
    if mode == "apt":
        # A sourced ROS 2 belongs to the Python of the system, whatever else stands first on the path.
        return ["/usr/bin/python3", *plain, *versioned]
    return versioned + plain + ["/usr/bin/" + name for name in versioned] + [sys.executable]


def probe(command: str, environment: Dict[str, str]) -> Optional[Python]:
    """Ask an interpreter about itself; None if there is none, or it does not start."""
    path = shutil.which(command)
    if path is None:
        return None
    try:
        answer = subprocess.check_output(
            [path, "-c", PROBE],
            env=environment,
            stderr=subprocess.DEVNULL,
            stdin=subprocess.DEVNULL,
            timeout=30,
        )
        facts = json.loads(answer.decode("utf-8").strip().splitlines()[-1])
    except (OSError, subprocess.SubprocessError, ValueError, IndexError):
        return None
    return Python(facts["executable"] or path, facts)


def objection(python: Python, mode: str) -> Optional[str]:
    """Why an interpreter cannot be used, or None."""
    facts = python.facts
    minor = tuple(facts["version"][:2])
    if minor not in VERSIONS:
        return "too old, 3.10 to 3.13 will do" if minor < (3, 10) else "too new, 3.10 to 3.13 will do"
    if facts["implementation"] != "CPython":
        return "{} is not CPython".format(facts["implementation"])
    if facts["threaded"]:
        return "a free-threaded build, for which there are no wheels of ROS 2"
    if not facts["venv"]:
        return "its venv or ensurepip module is missing: sudo apt install python{}.{}-venv".format(*minor)
    if mode == "apt" and not imports_rclpy(python):
        return "cannot import the rclpy of the sourced ROS 2"
    return None


def imports_rclpy(python: Python) -> bool:
    """Whether this Python finds the sourced ROS 2."""
    command = [python.executable, "-c", "import rclpy"]
    return subprocess.call(command, env=clean_environment("apt"), stderr=subprocess.DEVNULL) == 0


def choose_python(mode: str) -> Python:
    """The best usable interpreter."""
    found = {}  # type: Dict[str, str]
    for command in candidates(mode):
        python = probe(command, clean_environment(mode))
        if python is None or python.executable in found:
            continue
        reason = objection(python, mode)
        if reason is None:
            return python
        found[python.executable] = "    {} ({}): {}".format(python.executable, python.version, reason)
    raise no_python(mode, list(found.values()))


def no_python(mode: str, found: List[str]) -> Problem:
    """Say which interpreters there are and why none will do."""
    if mode == "apt":
        return Problem(
            "ROS_DISTRO is jazzy, but no Python here can import its rclpy.",
            *found,
            "Source ROS 2 in this shell (source /opt/ros/jazzy/setup.bash) and run this again,",
            "or unset ROS_DISTRO to use ROS 2 from Python wheels.",
        )
    if os.environ.get("PYTHON"):
        wanted = "PYTHON={}".format(os.environ["PYTHON"])
        return Problem(
            "{} cannot be used.".format(wanted), *(found or ["    it does not start, or does not exist"])
        )
    return Problem(
        "No usable Python was found: 3.10, 3.11, 3.12 or 3.13 is needed.",
        *(found or ["    none on the path"]),
        "On Ubuntu 24.04 and Debian 12: sudo apt install python3 python3-venv python3-dev",
        "An interpreter that is not on the path: make PYTHON=/path/to/python3.12",
    )


# -- What the machine must have -----------------------------------------------------------------------------


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
        raise Problem(
            "The wheels of ROS 2 Jazzy need glibc 2.28 or newer; here it is {}.".format(
                facts["libc"] or "another libc"
            ),
            "Debian 10, Ubuntu 20.04 and everything newer will do.",
        )


def check_compiler(python: Python) -> None:
    """The interfaces are compiled: try the compilers and Python's headers on a line of each."""
    trials = (
        ("CC", ("cc", "gcc", "clang"), "c", "#include <stdlib.h>\nint main(void) { return 0; }\n", []),
        ("CXX", ("c++", "g++", "clang++"), "cpp", "#include <string>\nint main() { return 0; }\n", []),
    )  # type: Tuple[Tuple[str, Tuple[str, ...], str, str, List[str]], ...]
    for variable, names, suffix, source, options in trials:
        compiler = find_compiler(variable, names)
        if compiler is None or not compiles(compiler + options, source, suffix):
            language = {"CC": "C", "CXX": "C++"}[variable]
            raise Problem(
                "No working {} compiler was found; it is needed once, for the ROS 2 interfaces.".format(
                    language
                ),
                "On Debian and Ubuntu: sudo apt install build-essential",
            )
    if not Path(python.facts["include"], "Python.h").is_file():
        raise Problem(
            "The headers of Python {} are missing ({}/Python.h).".format(
                python.version, python.facts["include"]
            ),
            "On Debian and Ubuntu: sudo apt install python{}.{}-dev".format(*python.facts["version"]),
        )


def find_compiler(variable: str, names: Tuple[str, ...]) -> Optional[List[str]]:
    """The compiler that CMake would take: the one that the variable names, else the first on the path."""
    if os.environ.get(variable):
        return os.environ[variable].split()
    path = next((shutil.which(name) for name in names if shutil.which(name)), None)
    return [path] if path else None


def compiles(command: List[str], source: str, suffix: str) -> bool:
    """Whether a compiler turns one small program into an executable."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "trial." + suffix).write_text(source)
        try:
            full = [*command, "trial." + suffix, "-o", "trial"]
            return (
                subprocess.call(full, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) == 0
            )
        except OSError:
            return False


# -- What has been done already -----------------------------------------------------------------------------


def requested_mode() -> str:
    """`apt` where a ROS 2 was sourced, else `wheels`."""
    distribution = os.environ.get("ROS_DISTRO")
    if distribution in (None, ""):
        return "wheels"
    if distribution != "jazzy":
        raise Problem(
            "This shell has sourced ROS 2 {}; Lupin needs Jazzy.".format(distribution),
            "Run this in a shell without it: ROS 2 Jazzy then comes from Python wheels.",
        )
    return "apt"


def interface_files(root: Path) -> List[Path]:
    """All files that decide what the interface packages become, in a fixed order."""
    folders = [root / "lupin_msgs", root / "interfaces"]
    files = [path for folder in folders for path in folder.rglob("*") if path.suffix in INTERFACE_FILES]
    return sorted(path for path in files if path.is_file())


def digest(root: Path, files: List[Path], *more: str) -> str:
    """A hash over names and contents."""
    total = hashlib.sha256()
    for path in files:
        total.update(path.relative_to(root).as_posix().encode("utf-8") + b"\0")
        total.update(hashlib.sha256(path.read_bytes()).digest())
    for text in more:
        total.update(text.encode("utf-8") + b"\0")
    return total.hexdigest()


def sourced_ros() -> str:
    """Identify the sourced ROS 2: interfaces compiled against another version are other interfaces."""
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        manifest = Path(prefix, "share", "rosidl_runtime_c", "package.xml")
        if prefix and manifest.is_file():
            return prefix + hashlib.sha256(manifest.read_bytes()).hexdigest()
    return ""


def wanted_state(mode: str) -> Dict[str, Any]:
    """What the stamp of a finished environment for the present files says."""
    return {
        "layout": LAYOUT,
        "root": str(ROOT),
        "mode": mode,
        "python": os.environ.get("PYTHON", ""),
        "engine": digest(ROOT, [ROOT / "pyproject.toml"]),
        "interfaces": digest(ROOT, interface_files(ROOT), sourced_ros() if mode == "apt" else ""),
    }


def finished_state() -> Dict[str, Any]:
    """The stamp of the environment, empty if it is missing, unreadable, or the interpreter is gone."""
    try:
        state = json.loads(STAMP.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    usable = isinstance(state, dict) and os.access(str(VENV / "bin" / "python"), os.X_OK)
    return state if usable else {}


def must_start_afresh(finished: Dict[str, Any], wanted: Dict[str, Any]) -> bool:
    """Whether the environment cannot be brought up to date step by step."""
    decisive = ["layout", "root", "mode"]
    if wanted["python"]:
        # Without a wish, the interpreter that was chosen before stays.
        decisive.append("python")
    return any(finished.get(key) != wanted[key] for key in decisive)


def write_stamp(state: Dict[str, Any]) -> None:
    """Say that the environment is complete; a rename, so that there is no half a stamp."""
    partial = STAMP.with_suffix(".partial")
    partial.write_text(json.dumps(state, indent=2), encoding="utf-8")
    os.replace(str(partial), str(STAMP))


# -- The steps ----------------------------------------------------------------------------------------------


def make_venv(python: Python, mode: str, runner: Runner) -> None:
    """An empty environment, in place of whatever is there."""
    if VENV.is_symlink() or VENV.is_file():
        raise Problem("{} is not a folder; move it away.".format(VENV))
    if VENV.exists():
        shutil.rmtree(str(VENV))
    VENV.mkdir()
    system = ["--system-site-packages"] if mode == "apt" else []
    command = [python.executable, "-m", "venv", *system, str(VENV)]
    runner.run(command, clean_environment(mode), ROOT, "Making the virtual environment")


def install_engine(mode: str, runner: Runner) -> None:
    """The engine and its plugins, editable, with everything they need."""
    target = "{}[{}]".format(ROOT, EXTRAS[mode])
    command = [str(VENV / "bin" / "python"), "-m", "pip", "install", "--editable", target]
    runner.run(command, clean_environment(mode), ROOT, "Installing the engine")


def missing_packages(python: Python, mode: str) -> List[str]:
    """The interface packages, as folders, that no sourced ROS 2 provides."""
    if mode == "wheels":
        return [folder for _, folder in PACKAGES]
    # A folder of that name on the path is not the package: only a package has an origin.
    test = "import importlib.util as u, sys; s = u.find_spec(sys.argv[1]); sys.exit(not (s and s.origin))"
    return [
        folder
        for name, folder in PACKAGES
        if subprocess.call([python.executable, "-c", test, name], env=clean_environment(mode), cwd="/") != 0
    ]


def build_requirements(pyproject: Path) -> List[str]:
    """The build requirements of a package; its list of strings reads the same in TOML and in Python."""
    found = re.search(
        r"^requires = (\[.*?^\])", pyproject.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    if found is None:
        raise Problem("{} has no list of build requirements.".format(pyproject))
    return [str(requirement) for requirement in ast.literal_eval(found.group(1))]


def cache_folder() -> Path:
    """Where built wheels are kept for the next environment: the user's cache, else inside this one."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    if not os.path.isabs(base):  # the specification says that relative ones are ignored
        base = os.path.join(os.path.expanduser("~"), ".cache")
    folder = Path(base, "lupin-engine", "wheels")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=str(folder)):
            return folder
    except OSError:
        return VENV / "wheels"


def plain_temporary_folder() -> str:
    """A folder to build in. The generators of ROS do not quote paths, so it must be free of blanks."""
    chosen = tempfile.gettempdir()
    return chosen if re.match(r"^[\w./+-]+$", chosen, re.ASCII) else "/tmp"


def build_wheels(python: Python, mode: str, folders: List[str], target: Path, runner: Runner) -> None:
    """Compile interface packages in a temporary copy, with tools that do not stay in `.venv`."""
    with tempfile.TemporaryDirectory(prefix="lupin-build-", dir=plain_temporary_folder()) as name:
        work = Path(name)
        for folder in ("lupin_msgs", "interfaces"):
            shutil.copytree(
                str(ROOT / folder), str(work / folder), ignore=shutil.ignore_patterns("__pycache__")
            )
        tools = build_tools(python, mode, work, runner)
        environment = clean_environment(mode)
        environment["PATH"] = os.pathsep.join([str(tools.parent), environment.get("PATH", "")])
        command = [str(tools), "-m", "pip", "wheel", "--verbose", "--no-build-isolation", "--no-deps"]
        command += ["--wheel-dir", str(work / "wheels")] + ["./" + folder for folder in folders]
        runner.run(command, environment, work, "Compiling the ROS 2 interfaces")
        keep_wheels(work / "wheels", target)


def build_tools(python: Python, mode: str, work: Path, runner: Runner) -> Path:
    """A Python that has what compiling needs. pip's own isolation would hide a sourced ROS 2."""
    system = ["--system-site-packages"] if mode == "apt" else []
    environment = clean_environment(mode)
    runner.run(
        [python.executable, "-m", "venv", *system, str(work / "tools")],
        environment,
        work,
        "Making a folder for build tools",
    )
    requirements = build_requirements(ROOT / "lupin_msgs" / "pyproject.toml")
    if not new_enough_cmake():
        requirements.append("cmake>=3.24")
    if mode == "apt":
        requirements = [one for one in requirements if not one.startswith(("ros-", "catkin"))]
    tools = work / "tools" / "bin" / "python"
    # They run once: compiling all of them to bytecode would take longer than it saves.
    command = [str(tools), "-m", "pip", "install", "--no-compile", *requirements]
    runner.run(command, environment, work, "Installing the build tools")
    return tools


def new_enough_cmake() -> bool:
    """Whether the machine has a CMake that can defer calls, which the hook for wheels needs."""
    try:
        answer = subprocess.check_output(["cmake", "--version"], stderr=subprocess.DEVNULL).decode("utf-8")
    except (OSError, subprocess.SubprocessError):
        return False
    found = re.search(r"version (\d+)\.(\d+)", answer)
    return found is not None and (int(found.group(1)), int(found.group(2))) >= (3, 24)


def keep_wheels(built: Path, target: Path) -> None:
    """Move finished wheels to the cache in one rename, so that the cache never holds half of them."""
    target.parent.mkdir(parents=True, exist_ok=True)
    partial = Path(tempfile.mkdtemp(prefix="partial-", dir=str(target.parent)))
    for wheel in built.glob("*.whl"):
        shutil.copy(str(wheel), str(partial))
    try:
        os.rename(str(partial), str(target))
    except OSError:
        # Another checkout built the same at the same time.
        shutil.rmtree(str(partial), ignore_errors=True)


def wheels_folder(python: Python, mode: str, wanted: Dict[str, Any], folders: List[str]) -> Path:
    """Where the wheels of these very files are kept, built or not."""
    return cache_folder() / digest(ROOT, [], wanted["interfaces"], python.facts["tag"], mode, *folders)[:24]


def start_building(python: Python, mode: str, folders: List[str], target: Path) -> Optional[Background]:
    """Begin to compile what is not in the cache: it needs the processor while pip waits for the network."""
    if not folders or target.is_dir():
        return None
    building = Background(lambda runner: build_wheels(python, mode, folders, target, runner), BUILD_LOG)
    building.start()
    return building


def install_interfaces(mode: str, target: Path, runner: Runner) -> None:
    """Install the interface packages from the cache."""
    wheels = [str(wheel) for wheel in sorted(target.glob("*.whl"))]
    command = [str(VENV / "bin" / "python"), "-m", "pip", "install", *wheels]
    command += ["--no-deps", "--no-index", "--force-reinstall"]
    runner.run(command, clean_environment(mode), ROOT, "Installing the ROS 2 interfaces")


def check(mode: str, runner: Runner) -> None:
    """Load everything once, in a process of its own."""
    environment = clean_environment(mode)
    python = str(VENV / "bin" / "python")
    command = [python, "-m", "lupin_engine.ros.adapter.environment", python, "-c", CHECK]
    runner.run(command, environment, VENV, "Trying the new environment")


def existing_python(mode: str) -> Python:
    """The interpreter of the environment that is brought up to date."""
    python = probe(str(VENV / "bin" / "python"), clean_environment(mode))
    if python is None:
        raise Problem(
            "{} does not start.".format(VENV / "bin" / "python"), "Run: make clean, then this again."
        )
    return python


def refuse_other_mode(finished: Dict[str, Any], mode: str) -> None:
    """Never rebuild an environment only because a shell has, or has not, sourced ROS 2."""
    before = finished.get("mode", mode)
    if before == mode:
        return
    if mode == "apt":
        raise Problem(
            "This shell has sourced ROS 2, but .venv holds ROS 2 from Python wheels; the two do not mix.",
            "Open a shell that has not sourced it, or run `make clean` to build on the sourced one.",
        )
    raise Problem(
        ".venv was made for a sourced ROS 2 Jazzy, and this shell has not sourced one.",
        "Source it (source /opt/ros/jazzy/setup.bash), or run `make clean` to use Python wheels instead.",
    )


class Work(NamedTuple):
    """What there is to do."""

    mode: str
    wanted: Dict[str, Any]
    afresh: bool
    engine: bool
    interfaces: bool


def find_work() -> Optional[Work]:
    """Compare what is there with what should be; None if all is in place."""
    mode = requested_mode()
    finished, wanted = finished_state(), wanted_state(mode)
    refuse_other_mode(finished, mode)
    afresh = must_start_afresh(finished, wanted)
    engine = afresh or finished.get("engine") != wanted["engine"]
    interfaces = afresh or finished.get("interfaces") != wanted["interfaces"]
    return Work(mode, wanted, afresh, engine, interfaces) if engine or interfaces else None


def bring_up_to_date(progress: Progress) -> None:
    """Do what is missing, and nothing else."""
    work = find_work()
    if work is None:
        return
    progress.step("Looking for a Python and what else is needed")
    python = choose_python(work.mode) if work.afresh else existing_python(work.mode)
    if work.mode == "wheels":
        check_platform(python)
    folders = missing_packages(python, work.mode) if work.interfaces else []
    target = wheels_folder(python, work.mode, work.wanted, folders)
    if folders and not target.is_dir():
        # Before minutes of downloads, not after them.
        check_compiler(python)
    progress.done("{} {}".format(python.executable, python.version))
    carry_out(work, python, folders, target, progress)


def carry_out(work: Work, python: Python, folders: List[str], target: Path, progress: Progress) -> None:
    """Make what is missing, and write the stamp once all of it works; these are the steps that take long."""
    runner = Runner(progress, LOG)
    if work.afresh:
        before = "" if not VENV.exists() else " anew (it was unfinished, or made in another way)"
        progress.step("Making .venv" + before)
        make_venv(python, work.mode, runner)
        progress.done()
    with contextlib.suppress(OSError):
        STAMP.unlink()
    building = start_building(python, work.mode, folders, target)
    try:
        if work.engine:
            source = "ROS 2 Jazzy as Python wheels" if work.mode == "wheels" else "the sourced ROS 2 is used"
            beside = "; the ROS 2 interfaces are compiled meanwhile" if building else ""
            progress.step("Installing the engine and its libraries ({}{})".format(source, beside))
            install_engine(work.mode, runner)
            progress.done()
        if folders:
            where = "compiling" if building else "compiled before"
            progress.step("Installing the ROS 2 interfaces ({})".format(where))
            if building:
                building.wait(progress)
            install_interfaces(work.mode, target, runner)
            progress.done()
    except BaseException:
        if building:
            building.stop()
        raise
    progress.step("Trying it")
    check(work.mode, runner)
    progress.done()
    write_stamp(work.wanted)


@contextlib.contextmanager
def alone(progress: Progress) -> Iterator[None]:
    """Two runs at once would write into the same environment: the second waits."""
    import fcntl  # not on Windows, which is told so before

    with open(__file__, "rb") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            progress.step("Waiting for another run that is preparing .venv")
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def main() -> int:
    """Prepare `.venv`; the exit code says whether it is ready."""
    progress = Progress(live=on_terminal())
    try:
        if os.name != "posix":
            raise Problem("Lupin needs Linux.", "On Windows, use WSL with Ubuntu 24.04.")
        with alone(progress):
            bring_up_to_date(progress)
    except Problem as problem:
        print("\n{}".format(problem), *problem.advice, sep="\n", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nInterrupted. Run it again: what is unfinished is made anew.", file=sys.stderr)
        return 130
    except Exception as error:  # a defect of this program, told in a line like everything else
        place = Path(tempfile.gettempdir(), "lupin-bootstrap-error.log")
        place.write_text(traceback.format_exc(), encoding="utf-8")
        print("\n{}: {}\nDetails are in {}".format(type(error).__name__, error, place), file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
