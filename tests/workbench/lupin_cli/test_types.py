"""`lupin types`: what it writes, the same each time, and every wrong use with its text."""

from __future__ import annotations

import json
import stat
import sys
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_ros.interfaces import type_hashes
from lupin_ros.interfaces.files import FieldType, InterfaceSet, WrittenField, WrittenMessage
from lupin_ros.interfaces.typescript import type_names, typescript
from lupin_ros.interfaces.used import used_interfaces

Capture = pytest.CaptureFixture[str]

REAL = FieldType("float32", is_array=True, size=3)
MESSAGES = {
    "a_msgs/msg/Note": WrittenMessage(
        "a_msgs/msg/Note",
        "Ends */ here.",
        (
            WrittenField("at", FieldType("b_msgs/msg/Note"), "when\n[s]"),
            WrittenField("parts", REAL),
            WrittenField("raw", FieldType("uint8", is_array=True)),
            WrittenField("long", FieldType("int64"), "nanoseconds", 7),
        ),
        (WrittenField("LOW", FieldType("string"), "", 'a"b'),),
    ),
    "b_msgs/msg/Note": WrittenMessage("b_msgs/msg/Note"),
    "b_msgs/msg/String": WrittenMessage("b_msgs/msg/String"),
    "b_msgs/srv/Do_Request": WrittenMessage(
        "b_msgs/srv/Do_Request", "", (WrittenField("what", FieldType("string", longest=5)),)
    ),
    "b_msgs/srv/Do_Response": WrittenMessage("b_msgs/srv/Do_Response"),
}
MODULE = """\
/**
 * `a_msgs/msg/Note`
 * Ends *\\/ here.
 */
export interface AMsgsNote {
  /**
   * when
   * [s]
   */
  at: BMsgsNote;
  /** `float32[3]` */
  parts: (number | null)[];
  /** `uint8[]` */
  raw: string;
  /**
   * nanoseconds
   * `int64`
   * Default: 7
   */
  long: number;
}

export const AMsgsNote = {
  LOW: "a\\"b",
} as const;

/** `b_msgs/msg/Note` */
export type BMsgsNote = Record<string, never>;

/** `b_msgs/msg/String` */
export type BMsgsString = Record<string, never>;

/** `b_msgs/srv/Do_Request` */
export interface DoRequest {
  /** `string<=5` */
  what?: string;
}

/** `b_msgs/srv/Do_Response` */
export type DoResponse = Record<string, never>;

export const MSG_TYPES = {
  AMsgsNote: "a_msgs/msg/Note",
  BMsgsNote: "b_msgs/msg/Note",
  BMsgsString: "b_msgs/msg/String",
} as const;

export const SRV_TYPES = {
  Do: "b_msgs/srv/Do",
} as const;

export const ACTION_TYPES = {
} as const;
"""


def test_typescript_word_by_word() -> None:
    """Comments with units, what JSON hides of a type, two of one name, what a caller may leave out."""
    text = typescript(InterfaceSet(("a_msgs/msg/Note", "b_msgs/srv/Do"), MESSAGES))
    assert text.partition("\n\n")[2] == MODULE
    assert type_names(["a_msgs/msg/Note", "std_msgs/msg/String"]) == {
        "a_msgs/msg/Note": "Note",
        "std_msgs/msg/String": "StdMsgsString",
    }


@pytest.mark.slow
def test_every_interface_of_the_page_is_in_use() -> None:
    """What the nodes declare is found in the sources, and all that our own packages have."""
    root = Path(__file__).parents[3]
    page = (root / "docs" / "interfaces.md").read_text(encoding="utf-8")
    topics, _, rest = page.partition("## Topics")[2].partition("## Services")
    services, _, rest = rest.partition("## Actions")
    tables = {"msg": topics, "srv": services, "action": rest.partition("## ")[0]}
    told = set()
    for kind, table in tables.items():
        for row in table.splitlines():
            cell = row.split("|")[2].strip() if row.startswith("| `/") else ""
            name = cell[1:].partition("]")[0] if cell.startswith("[") else cell
            if name and "/" in name:
                told.add(name.replace("/", f"/{kind}/"))
    ours = {
        f"{file.parents[1].name}/{kind}/{file.stem}"
        for kind in ("msg", "srv")
        for folder in (root / "lupin_msgs", root / "interfaces" / "lupin_engine_msgs")
        for file in folder.glob(f"{kind}/*.{kind}")
    }
    assert len(told) > 15
    assert len(ours) > 20
    of_run_mission = {f"lupin_engine_msgs/msg/{name}" for name in ("OutcomeCount", "VisitOutcome")}
    assert (told | ours) - used_interfaces() == of_run_mission


@pytest.fixture
def rosidl() -> None:
    """The parser of ROS 2 is needed."""
    pytest.importorskip("rosidl_adapter", reason="ROS 2 is not installed here")


@pytest.mark.slow
@pytest.mark.usefixtures("rosidl")
def test_the_same_text_each_time_and_into_a_file(tmp_path: Path, capsys: Capture) -> None:
    """As a whole, with the permissions that the file had; folders are made."""
    assert main(["types", "ts"]) == 0
    text = capsys.readouterr().out
    assert "export interface MissionState {" in text
    file = tmp_path / "src" / "ros.ts"
    assert main(["types", "ts", "--output", str(file)]) == 0
    assert (file.read_text(encoding="utf-8"), capsys.readouterr().out) == (text, "")
    file.chmod(0o640)
    assert main(["types", "json-schema", "--output", str(file)]) == 0
    assert stat.S_IMODE(file.stat().st_mode) == 0o640
    assert "lupin_msgs/msg/MissionState" in json.loads(file.read_text(encoding="utf-8"))["$defs"]
    assert [entry.name for entry in file.parent.iterdir()] == ["ros.ts"]


@pytest.mark.usefixtures("rosidl")
def test_more_can_be_named(capsys: Capture) -> None:
    """A type, and all of a package."""
    assert main(["types", "ts", "sensor_msgs/msg/LaserScan", "nav_msgs"]) == 0
    text = capsys.readouterr().out
    assert "export interface LaserScan {" in text
    assert 'Odometry: "nav_msgs/msg/Odometry",' in text


@pytest.mark.slow
@pytest.mark.usefixtures("rosidl")
@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (
            ["ts", "sensor_mgs", "x/y"],
            "lupin: no interfaces are called 'sensor_mgs' here; did you mean 'sensor_msgs'?\n"
            "no interfaces are called 'x/y' here; "
            "write PACKAGE, or a type such as sensor_msgs/msg/LaserScan\n",
        ),
        (
            ["ts", "sensor_msgs/msg/LaserScn", "there_msgs/srv/Go"],
            "lupin: the definition of there_msgs/srv/Go is not here; install the package there_msgs\n"
            "the definition of sensor_msgs/msg/LaserScn is not here; "
            "did you mean 'sensor_msgs/msg/LaserScan'?\n",
        ),
        (["ts", "--output", "/dev/null/x.ts"], "lupin: cannot write '/dev/null/x.ts': File exists\n"),
    ],
)
def test_wrong_use_is_told(arguments: list[str], told: str, capsys: Capture) -> None:
    """All at once, with the nearest name; exit code 2."""
    assert main(["types", *arguments]) == 2
    assert capsys.readouterr().err == told


def test_without_ros_it_is_told_what_is_missing(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    """The files of our own packages are in the checkout; what they are made of, and the parser, are not."""
    monkeypatch.setitem(sys.modules, "rosidl_adapter", None)
    monkeypatch.setitem(sys.modules, "rosidl_adapter.parser", None)
    monkeypatch.setattr(type_hashes, "_prefixes", lambda: iter(()))
    assert main(["types", "ts"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert "the definition of std_msgs/msg/String is not here; install the package std_msgs" in lines
    assert [line for line in lines if "lupin_msgs" in line] == []
    assert [line.removeprefix("lupin: ") for line in lines if "rosidl_adapter" in line] == [
        "rosidl_adapter, which reads interface files, is not installed: it comes with ROS 2; "
        "`pip install 'lupin-engine[ros]'`, or source an apt ROS 2 Jazzy"
    ]
