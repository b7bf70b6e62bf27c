"""The test suite by parts, with the time of each at its end.

python tools/suite.py check [pytest arguments]   lint, types, and the quick tests, for which Python is enough
python tools/suite.py test [pytest arguments]    these, `slow` ones, over ROS 2, in a browser; in CI the audit
python tools/suite.py test-all                   these, and those marked `long`
python tools/suite.py test-kilted [pytest arguments]   what needs ROS 2 or a browser, on Kilted, `long` too
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from lupin_ros.adapter.environment import distribution

ROOT = Path(__file__).parents[1]
#: With more workers each spends its time on imports.
CORES = min(os.cpu_count() or 1, 8)
#: What a test needs beside Python, or much time; see `markers` in pyproject.toml.
MORE = "ros or node or browser or broker or proof"
# A file stays with one worker: what a module makes once, nodes above all, is made once.
PYTEST = ["pytest", "--durations=10", "--dist=loadfile", "--no-loadscope-reorder"]
LINT = ["ruff", "check"]
TYPES = ["mypy"]
#: Only where the continuous integration says so: it asks on the network.
AUDIT = ["tools.audit"]
QUICK = [*PYTEST, f"-n{CORES}", "--ignore=tests/lupin_ros"]
# Real processes on a busy machine meet its worst moments: one second try, and who needed it is listed.
AGAIN = ["--reruns=1", "-raR"]
# These tests wait for robots and clocks more than they compute.
ROS = [*PYTEST, *AGAIN, f"-n{2 * CORES}"]
# One browser at a time: several starve everything else.
BROWSER = ["pytest", "--durations=10", *AGAIN]
#: Where its tests are, unless others are named: to look for them among all takes half a minute.
BROWSER_TESTS = ["tests/console", "tests/lupin_ros/system/console"]
_MARKED = re.compile(rf"\bmark\.({MORE.replace(' or ', '|')})\b")

NO_TESTS = 5
#: The commits at which all tests passed, long ones included: a line for each distribution of ROS 2.
RECORD = ROOT / "tests" / "all-passed.txt"
#: So many commits later, `make test` says that it is time for them.
SOON = 50
_CLOSING = re.compile(r"^(\x1b\[\d+m)*=+ .* in [\d.]+s.* =+(\x1b\[\d+m)*$")


@dataclass
class Part:
    """A command under way, or at its end."""

    name: str
    process: subprocess.Popen[str]
    begun: float
    lines: list[str]
    seconds: float = 0.0

    def read(self, to: TextIO | None) -> None:
        """Take what it prints, to its end, and pass it on."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\n"))
            if to is not None:
                print(line, end="", file=to, flush=True)
        self.process.wait()
        self.seconds = time.monotonic() - self.begun

    @property
    def closing(self) -> str:
        """The line that says how it went."""
        said = [line for line in self.lines if line.strip()]
        return next((line for line in reversed(said) if _CLOSING.match(line)), said[-1] if said else "")


def start(name: str, module: list[str]) -> Part:
    """Start a command of this environment."""
    process = subprocess.Popen(
        [sys.executable, "-m", *module], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    return Part(name, process, time.monotonic(), [])


def marked_files() -> list[str]:
    """Return the files outside `tests/lupin_ros` with a test that needs more."""
    files = [file for file in (ROOT / "tests").rglob("test_*.py") if "lupin_ros" not in file.parts]
    return sorted(str(file.relative_to(ROOT)) for file in files if _MARKED.search(file.read_text("utf-8")))


def git(*words: str) -> str:
    """Return what git prints; '' where this is no checkout."""
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True)
    return "" if done.returncode else done.stdout.strip()


def recorded() -> dict[str, str]:
    """Return by distribution the commit at which all tests passed, and its date."""
    lines = RECORD.read_text("utf-8").splitlines() if RECORD.is_file() else []
    return dict(line.split(maxsplit=1) for line in lines)


def record() -> None:
    """Note that all tests passed at this commit."""
    now = recorded() | {distribution(): f"{git('rev-parse', 'HEAD')} {git('log', '-1', '--format=%cs')}"}
    RECORD.write_text("".join(f"{name} {said}\n" for name, said in sorted(now.items())), "utf-8")


def long_ago() -> str:
    """Say that the long tests ran many commits ago; '' where they did not."""
    commit = recorded().get("jazzy", "").partition(" ")[0]
    count = git("rev-list", "--count", f"{commit}..HEAD") if commit else ""
    if count and int(count) <= SOON:
        return ""
    since = f"{count} commits ago" if count else "at a commit that is not known here"
    return f"The long tests passed last {since}: make test-all"


def main() -> int:
    """Run the parts, lint and types beside the quick tests; fail if any of them does."""
    mode = "".join(sys.argv[1:2])
    if mode not in ("check", "test", "test-all", "test-kilted"):
        print(__doc__, file=sys.stderr)
        return 2
    is_check, is_kilted, is_all = mode == "check", mode == "test-kilted", mode.startswith("test-")
    if is_kilted and distribution() != "kilted":
        print("this is not ROS 2 Kilted: make test-kilted makes an environment with it", file=sys.stderr)
        return 2
    given = [*(["--color=yes"] if sys.stdout.isatty() else []), *sys.argv[2:]]
    beside = [] if is_kilted else [start("lint", LINT), start("types", TYPES)]
    if beside and not is_check and os.environ.get("CI"):
        beside.append(start("audit", AUDIT))
    readers = [threading.Thread(target=part.read, args=(None,)) for part in beside]
    for reader in readers:
        reader.start()
    long = "" if is_all else " and not long"
    slow = " and not slow" if is_check else ""
    quick = [*QUICK, "-m", f"not ({MORE}){long}{slow}", *given]
    tests = [] if is_kilted else [start("quick tests", quick)]
    for part in tests:
        part.read(sys.stdout)
    for reader in readers:
        reader.join()
    for part in beside:
        if part.process.returncode:
            print(*part.lines, sep="\n")
    if not is_check:
        named = any((ROOT / argument.partition("::")[0]).exists() for argument in sys.argv[2:])
        browser = [*BROWSER, "-m", f"browser{long}", *given, *([] if named else BROWSER_TESTS)]
        kept = f"({'ros' if is_kilted else MORE}) and not browser{long}"
        ros = [*ROS, "-m", kept, *given, *([] if named else ["tests/lupin_ros", *marked_files()])]
        nodes, console = start("ROS tests", ros), start("browser", browser)
        pages = threading.Thread(target=console.read, args=(None,))
        pages.start()
        nodes.read(sys.stdout)
        pages.join()
        print(*console.lines, sep="\n")
        tests += [nodes, console]
    print("\nTime by part")
    for part in [*beside, *tests]:
        print(f"{part.name:12} {part.seconds:6.1f} s   {part.closing.strip(' =')}")
    print(*(part.closing for part in tests), sep="\n", flush=True)
    codes = [part.process.returncode for part in tests]
    ran = [code for code in codes if code != NO_TESTS] or codes
    failed = max(map(abs, [*ran, *(part.process.returncode for part in beside)]))
    if is_all and not failed and not sys.argv[2:]:
        record()
    elif not is_all and (advice := long_ago()):
        print(advice, flush=True)
    return failed


if __name__ == "__main__":
    sys.exit(main())
