"""Packages of interfaces that cannot be added: all mistakes with their lines, and nothing has changed."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.errors import UsageError
from lupin_ros.interfaces import added, definitions
from lupin_ros.interfaces.added import add_interfaces
from lupin_ros.interfaces.package import COMPLETE, read_package, shipped_names, uses_of

KNOWN = {"std_msgs": ["Header", "String"], "builtin_interfaces": ["Time"]}
MANIFEST = "<package><name>lift_msgs</name><version>1.2.0</version></package>"
FLOOR = "string name\nfloat32 height\n"


def package(folder: Path, **files: str) -> Path:
    """Write a package; in names of files `__` stands for the folder's stroke and `_` for the dot."""
    for name, text in {"package_xml": MANIFEST, "msg__Floor_msg": FLOOR, **files}.items():
        file = folder / name.replace("__", "/").replace("_", ".")
        file.parent.mkdir(parents=True, exist_ok=True)
        if text:
            file.write_text(text, encoding="utf-8")
    return folder


def test_a_package_is_read(tmp_path: Path) -> None:
    """Its name, its files, and what it uses; a broken version is none."""
    files = {
        "msg__Lift_msg": "uint8 OPEN=2\n\n# note\nstd_msgs/Header at\nFloor[<=3] floors\nbool open true\n",
        "action__Go_action": "string floor\n---\nbool done\n---\nbuiltin_interfaces/Time at\n",
        "package_xml": MANIFEST.replace("1.2.0", "one"),
    }
    read = read_package(package(tmp_path, **files), KNOWN)
    assert (read.name, read.version) == ("lift_msgs", "0.0.0")
    assert read.files == ("msg/Floor.msg", "msg/Lift.msg", "action/Go.action")
    assert read.uses == ("action_msgs", "builtin_interfaces", "std_msgs")


WRONG = {
    "a line that is none": (
        {"msg__Lift_msg": "uint8 OPEN=2\nstring\nint33 x  # wide\nbool open maybe\n"},
        ["{folder}/msg/Lift.msg:2: 'string': ", "{folder}/msg/Lift.msg:3: 'int33 x  # wide': 'int33' is an ",
         "{folder}/msg/Lift.msg:4: 'bool open maybe': "],
    ),
    "a file's name": (
        {"msg__lift_msg": "bool open\n"}, ["{folder}/msg/lift.msg: 'lift' is an invalid message name."],
    ),
    "a field twice": (
        {"srv__Call_srv": "string floor\n---\nbool ok\nbool ok\n"},
        ["{folder}/srv/Call.srv:4: 'bool ok': "],
    ),
    "no separator": (
        {"srv__Call_srv": "string floor\n", "action__Go_action": "---\n"},
        ["{folder}/srv/Call.srv: 0 lines are '---', but a service has one",
         "{folder}/action/Go.action: 1 lines are '---', but an action has two"],
    ),
    "a package that is missing": (
        {"msg__Lift_msg": "Floor floor\n\nbuilding_msgs/Level level\n"},
        ["{folder}/msg/Lift.msg:3: building_msgs/Level: the package 'building_msgs' is not in this "
         "environment; add it before: lupin interfaces add FOLDER"],
    ),
    "messages that are not there": (
        {"msg__Lift_msg": "std_msgs/Headr header\nFlor floor\n"},
        ["{folder}/msg/Lift.msg:1: std_msgs has no message 'Headr'; did you mean 'Header'?",
         "{folder}/msg/Lift.msg:2: lift_msgs has no message 'Flor'; did you mean 'Floor'?"],
    ),
    "no manifest": (
        {"package_xml": ""}, ["{folder}: no package.xml is there, which gives a package its name"],
    ),
    "a manifest that is no XML": (
        {"package_xml": "<package>\n<name>lift_msgs\n</package>"},
        ["{folder}/package.xml:3: this is no XML: mismatched tag: line 3, column 2"],
    ),
    "a name that is none": (
        {"package_xml": "<package><name>Lift-Msgs</name></package>"},
        ["{folder}/package.xml: 'Lift-Msgs' cannot be the name of a package; "
         "use small letters, digits and _"],
    ),
    "no definitions": (
        {"msg__Floor_msg": ""}, ["{folder}: no msg/*.msg, srv/*.srv or action/*.action is there"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_each_mistake_is_told_with_its_line(case: str, tmp_path: Path) -> None:
    """What the parser says of a line is its own."""
    files, lines = WRONG[case]
    with pytest.raises(UsageError) as caught:
        read_package(package(tmp_path, **files), KNOWN)
    told = str(caught.value).splitlines()
    assert len(told) == len(lines)
    for line, begin in zip(told, lines, strict=True):
        assert line.startswith(begin.format(folder=tmp_path))


@pytest.fixture
def no_build(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let nothing be compiled."""
    monkeypatch.setattr(added, "_build", lambda package: pytest.fail(f"{package.name} is built"))


def told(what: str) -> str:
    """Return why a package is not added."""
    with pytest.raises(UsageError) as caught:
        add_interfaces(what, lambda _: None)
    return str(caught.value)


@pytest.mark.usefixtures("no_build")
def test_what_is_no_package_is_told(tmp_path: Path) -> None:
    """A folder that is not there, a near name, and a name that another package has."""
    problem = "there is no folder 'qwxz', and no package of that name comes with Lupin"
    assert told("qwxz") == f"{problem}; Lupin has the definitions of geographic_msgs, nav2_msgs"
    assert told("nav2_msg").endswith("; did you mean 'nav2_msgs'?")
    taken = package(tmp_path, package_xml=MANIFEST.replace("lift_msgs", "std_msgs"))
    problem = f"{tmp_path}: a package 'std_msgs' is in this environment already, and is whole"
    assert told(str(taken)) == f"{problem}; give yours another name, or use that one"


def test_a_missing_compiler_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before anything is downloaded, with what to install."""
    monkeypatch.setenv("CC", "/nowhere/cc")
    text = told(str(package(tmp_path)))
    assert text.startswith("No working C compiler with the headers of Python (")
    assert text.splitlines()[1].startswith("On Debian, Ubuntu: sudo apt install build-essential python3.")


def test_a_sourced_ros_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its packages are built by colcon."""
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    problem = "this shell has sourced ROS 2, whose packages are not changed from here"
    assert told(str(package(tmp_path))) == f"{problem}; build it with colcon, and source its workspace"


def test_what_is_cut_down_says_how_to_add_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of one whose whole definitions are here by its name, of another one by its folder."""
    monkeypatch.setattr(added, "_summary", lambda package: "Minimal wire-compatible subset of it")
    definitions.interface_types.cache_clear()
    hint = "this package is cut down here; add the whole by: lupin interfaces add"
    of_folder = f"{hint} FOLDER (that of the whole tf2_msgs)"
    with pytest.raises(LookupError) as caught:
        definitions.installed_types("tf2_msgs/msg/Nothing")
    assert str(caught.value.args[0]) == f"tf2_msgs has no message 'Nothing'; {of_folder}"
    assert added.cut_down("nav2_msgs") == f"{hint} nav2_msgs"


def test_equal_constants_of_two_parts_are_told_apart() -> None:
    """Only those; a comment changes no hash."""
    text = "uint8 A=0\nuint8 B=1\n---\nuint8 A=0\nuint8 b\n---\n uint8 B=1\nuint8 C=1\n"
    apart = text.replace("---\nuint8 A=0", "---\nuint8 A=0  # of part 2")
    apart = apart.replace(" uint8 B=1", " uint8 B=1  # of part 3")
    assert added.told_apart(text) == apart


def test_the_shipped_definitions_have_no_mistake() -> None:
    """Whole Nav2, and what it needs; what it says of its dependencies is true."""
    assert shipped_names() == ["geographic_msgs", "nav2_msgs"]
    known = dict(added._known())
    for name in shipped_names():
        found = read_package(COMPLETE / name, known)
        assert set(found.uses) == set(uses_of(COMPLETE / name))
        known[name] = [Path(file).stem for file in found.files if file.startswith("msg/")]
    assert len(found.files) == 51
