"""`lupin import scxml` and `lupin check` stay small, whatever they are given."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lupin_engine.missions.folders import default_missions_folder

pytestmark = pytest.mark.slow

#: Alone it takes less than 2 s of the processor and 160 MB; others on the computer make it longer.
SECONDS, MEGABYTES = 4.0, 300
SCXML = '<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0" initial="a">{}</scxml>'
STATE = '<state id="a">{}</state>'
MISSION = "mission: M\ninitial: A\n"
A_STATE = "states:\n  A:\n"


def words(letter: str, many: int) -> str:
    """Return so many words."""
    return " ".join(f"{letter}{number}" for number in range(many))


def transitions(events: str, many: int) -> str:
    """Return so many transitions."""
    return "".join(f'<transition event="{events.format(number)}" target="a"/>' for number in range(many))


def raised(event: str, many: int) -> str:
    """Return a block that raises so many events."""
    one = '<raise event="{}"/>'
    return f"<onentry>{''.join(one.format(event.format(number)) for number in range(many))}</onentry>"


#: A parallel state of fifty.
REGIONS = f'<parallel id="a">{"".join(f"<state id={chr(34)}s{n}{chr(34)}/>" for n in range(50))}</parallel>'

DOCUMENTS = {
    "an event of 200,000 words": STATE.format(f'<transition event="{words("e", 99_000)}" target="a"/>'),
    "200,000 dots": STATE.format(f'<transition event="{".".join("e" * 200_000)}" target="a"/>'),
    "100,000 targets": STATE.format(f'<transition event="e" target="{"a " * 100_000}"/>'),
    "one line of 50 MB": STATE.format(f'<log expr="{"1" * 50_000_000}"/>'),
    "a million line breaks": STATE.format("\n" * 999_000),
    "deep": "<state>" * 60_000 + "</state>" * 60_000,
    "45,000 states": "".join(f'<state id="s{number}"/>' for number in range(45_000)),
    "entities": "<!DOCTYPE s [<!ENTITY a 'aa'><!ENTITY b '&a;&a;'>]>",
    "a long expression": STATE.format(f'<transition cond="{"1+" * 400_000}1" target="a"/>'),
    "one event again and again": STATE.format(raised("e", 2_990)),
    "as many as are read": STATE.format(transitions("e{0}", 1_490) + raised("e{0}", 1_490)),
    "each on each": STATE.format(transitions("*", 1_490) + raised("e{0}", 1_490)),
    "all alike": STATE.format(transitions("e", 2_990)),
    "many targets": REGIONS
    + STATE.replace('"a"', '"b"').format(f'<transition event="e" target="{words("s", 50)}"/>' * 2_900),
}
MISSIONS = {
    "one line of 50 MB": MISSION + "summary: " + "x" * 50_000_000,
    "a million line breaks": MISSION + "\n" * 990_000,
    "aliases": MISSION
    + "a0: &a0 [x]\n"
    + "".join(f"a{n}: &a{n} [{f'*a{n - 1},' * 9}]\n" for n in range(1, 12)),
    "deep": MISSION + "states: " + "[" * 400_000,
    "deep in lines": MISSION + "states:\n" + "".join(" " * n + "a:\n" for n in range(1, 1_300)),
    "80,000 states": MISSION + "states:\n" + "".join(f"  S{n}: {{}}\n" for n in range(70_000)),
    "49,000 transitions": MISSION + A_STATE + "    on:\n      e:\n" + "        - A\n" * 49_000,
    "a long expression": MISSION + A_STATE + f'    always: {{target: A, guard: "{"1+" * 400_000}1 > 0"}}\n',
    "brackets": MISSION + A_STATE + f'    always: {{target: A, guard: "{"(" * 400_000}1{")" * 400_000}"}}\n',
    "20,000 inputs": MISSION
    + "inputs:\n"
    + "".join(f"  i{n}: {{value: robot.estop}}\n" for n in range(20_000))
    + A_STATE,
}


#: Runs a command from a small process: Linux counts the memory of who starts a program as the program's.
MEASURED = """
import os, subprocess, sys
process = subprocess.Popen(sys.argv[2:], stdout=open("printed", "w"), stderr=subprocess.STDOUT)
_, status, used = os.wait4(process.pid, 0)
process.returncode = os.waitstatus_to_exitcode(status)
print(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, process.returncode)
"""


def costs(folder: Path, *arguments: str) -> tuple[float, float, int, str]:
    """Run `lupin`, and return seconds of the processor, megabytes, its exit code and what it printed."""
    lupin = str(Path(sys.executable).with_name("lupin"))
    measured = [sys.executable, "-c", MEASURED, "", lupin, *arguments]
    found = subprocess.run(measured, cwd=folder, capture_output=True, text=True, check=True)
    seconds, megabytes, code = found.stdout.split()
    return float(seconds), float(megabytes), int(code), (folder / "printed").read_text(encoding="utf-8")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder of missions with a lifecycle alone."""
    (tmp_path / "missions").mkdir()
    shutil.copy(default_missions_folder() / "lifecycle.yaml", tmp_path / "missions")
    return tmp_path


@pytest.mark.parametrize("name", DOCUMENTS)
def test_an_import_stays_small(folder: Path, name: str) -> None:
    """In time and memory."""
    document = DOCUMENTS[name]
    whole = document + SCXML.format("") if document.startswith("<!") else SCXML.format(document)
    (folder / "m.scxml").write_text(whole)
    seconds, megabytes, code, printed = costs(folder, "import", "scxml", "m.scxml")
    assert (seconds < SECONDS, megabytes < MEGABYTES, code in (0, 1, 2)) == (True, True, True), (
        f"{seconds:.1f} s, {megabytes:.0f} MB, exit code {code}: {printed[:300]}"
    )


@pytest.mark.parametrize("name", MISSIONS)
def test_a_check_stays_small(folder: Path, name: str) -> None:
    """In time and memory."""
    (folder / "missions" / "m.yaml").write_text(MISSIONS[name])
    seconds, megabytes, code, printed = costs(folder, "check", "missions/m.yaml")
    assert (seconds < SECONDS, megabytes < MEGABYTES, code in (0, 1)) == (True, True, True), (
        f"{seconds:.1f} s, {megabytes:.0f} MB, exit code {code}: {printed[:300]}"
    )
