"""`lupin doctor`: every problem with what to do about it, with and without ROS."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_engine import __version__
from lupin_engine.plugin.discovery import EntryPoint
from lupin_greenhouse.profile import HASHES
from lupin_ros.adapter import environment
from lupin_ros.adapter.dds.profile import variables
from lupin_ros.launch import health
from lupin_ros.launch.environment import open_to
from lupin_ros.launch.health import RIHS, Finding

TABLE = json.loads((Path(__file__).parents[2] / "msgs" / "wire.json").read_text(encoding="utf-8"))


def findings(capsys: pytest.CaptureFixture[str]) -> dict[str, dict[str, str]]:
    return {finding["topic"]: finding for finding in json.loads(capsys.readouterr().out)["findings"]}


def test_the_expected_hashes_are_those_of_the_wire_table() -> None:
    """Two tables, one truth."""
    assert {name: f"{RIHS}{value}" for name, value in HASHES.items()} == {
        name: TABLE[name]["hash"] for name in HASHES
    }


def test_a_machine_without_ros_is_told_how_to_get_it(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The rest is looked at all the same; exit code 1."""
    monkeypatch.setattr("lupin_ros.adapter.environment.rclpy_source", lambda: None)
    assert main(["doctor", "--json"]) == 1
    found = findings(capsys)
    assert found["rclpy"]["state"] == "problem"
    assert "pip install 'lupin-engine[ros]'" in found["rclpy"]["advice"]
    assert found["mission inspection"]["state"] == "ok"


def test_a_ros_that_was_not_sourced_is_told_so(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Python finds it, the linker doesn't: by the doctor, and in one line by who needs it."""
    (tmp_path / "rclpy").mkdir()
    (tmp_path / "rclpy" / "__init__.py").write_text("raise ImportError('librcl.so: cannot open\\nSee URL')")
    monkeypatch.delitem(sys.modules, "rclpy", raising=False)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    monkeypatch.setattr("lupin_ros.adapter.environment.prepare", lambda: None)
    assert main(["doctor", "--json"]) == 1
    found = findings(capsys)["rclpy"]
    advice = "source the setup.bash of its installation in this shell"
    assert (found["found"], found["advice"]) == ("librcl.so: cannot open", advice)
    assert main(["graph"]) == 2
    told = f"lupin: ROS 2 is there, but cannot be used: librcl.so: cannot open; {advice}\n"
    assert capsys.readouterr().err == told


@pytest.mark.parametrize(
    ("variable", "value", "topic", "advice"),
    [
        ("ROS_DOMAIN_ID", "200", "ROS_DOMAIN_ID", "use a number from 0 to 101 or from 215 to 232"),
        ("ROS_DOMAIN_ID", "lab", "ROS_DOMAIN_ID", "use a number from 0 to 101 or from 215 to 232"),
        (
            "ROS_AUTOMATIC_DISCOVERY_RANGE",
            "OFF",
            "ROS_AUTOMATIC_DISCOVERY_RANGE",
            "nodes do not find each other",
        ),
        (
            "ROS_AUTOMATIC_DISCOVERY_RANGE",
            "HOME",
            "ROS_AUTOMATIC_DISCOVERY_RANGE",
            "use one of SUBNET, LOCALHOST",
        ),
        (variables()[0], "/absent.xml", "DDS profile", "there is no such file"),
        (
            "ROS_STATIC_PEERS",
            "robot.local",
            "ROS_STATIC_PEERS",
            "nodes stay on this machine: set ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET to reach them",
        ),
    ],
)
def test_the_network_settings_are_judged(
    monkeypatch: pytest.MonkeyPatch, variable: str, value: str, topic: str, advice: str
) -> None:
    """A wrong one is a problem, because nodes would silently not meet."""
    monkeypatch.setenv(variable, value)
    found = {finding.topic: finding for finding in health.look_at_network()}[topic]
    assert found.state == "problem"
    assert found.advice.startswith(advice)


@pytest.mark.parametrize(
    ("shell", "told"),
    [
        ({}, ("this machine only", "ok", "")),
        (
            {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"},
            (
                "others, too",
                "note",
                "every computer of the network is let in, and may command the robot: "
                "ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET",
            ),
        ),
        (
            {variables()[0]: "/etc/dds.xml"},
            (
                "others, too",
                "note",
                "your DDS profile /etc/dds.xml is used instead of the engine's: it alone says who is let in",
            ),
        ),
    ],
)
def test_it_says_to_whom_the_robot_is_open(
    monkeypatch: pytest.MonkeyPatch, shell: dict[str, str], told: tuple[str, str, str]
) -> None:
    """And whether anything that runs already listens to other computers."""
    for name in ("ROS_AUTOMATIC_DISCOVERY_RANGE", *variables()):
        monkeypatch.delenv(name, raising=False)
    for name, value in shell.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(health, "exposed", lambda domain: 2)
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    found = {finding.topic: finding for finding in health.look_at_network()}
    assert (found["open to"].found, found["open to"].state, found["open to"].advice) == told
    listening = found["listening to others"]
    assert listening.found == "2 participants of domain 7 on this machine"
    assert listening.advice == "other computers can find and command these"


@pytest.mark.parametrize(
    ("shell", "source", "told"),
    [
        ({}, "wheels", ("off: who reaches a node may use all of it", "ok", "")),
        (
            {"ROS_SECURITY_ENABLE": "true"},
            "wheels",
            (
                "on, and nodes do not start",
                "problem",
                "the Fast DDS of the wheels has no security: unset ROS_SECURITY_ENABLE, or use an apt ROS 2",
            ),
        ),
        (
            {"ROS_SECURITY_ENABLE": "true"},
            "apt",
            (
                "on, and nobody is kept out",
                "note",
                "nodes without permissions take part all the same: set ROS_SECURITY_STRATEGY=Enforce",
            ),
        ),
        (
            {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce"},
            "apt",
            ("on, with no keystore", "problem", "no enclaves there; see docs/security.md"),
        ),
    ],
)
def test_it_says_whether_permissions_are_asked_for(
    monkeypatch: pytest.MonkeyPatch, shell: dict[str, str], source: str, told: tuple[str, str, str]
) -> None:
    """By SROS2, and whether that can be."""
    for name in ("ROS_SECURITY_ENABLE", "ROS_SECURITY_STRATEGY", "ROS_SECURITY_KEYSTORE"):
        monkeypatch.delenv(name, raising=False)
    for name, value in shell.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(environment, "rclpy_source", lambda: source)
    (found,) = (finding for finding in health.look_at_network() if finding.topic == "SROS2")
    assert (found.found, found.state, found.advice) == told


def test_in_no_domain_nobody_is_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """The other findings are reported as well."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "lab")
    assert [finding.topic for finding in health.look_at_left_overs()] == ["shared memory", "nodes running"]


def test_another_middleware_is_not_closed_by_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there can be one: with an apt ROS 2."""
    for name in ("ROS_AUTOMATIC_DISCOVERY_RANGE", *variables()):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp")
    assert open_to() == ""
    monkeypatch.setattr(environment, "rclpy_source", lambda: "apt")
    assert open_to() == (
        "the engine closes Fast DDS only, and this is rmw_cyclonedds_cpp: "
        "docs/security.md says how to close it"
    )


def test_another_definition_of_a_message_is_a_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both hashes are shown; the silent alternative is a robot that hears nothing."""
    monkeypatch.setattr(health, "local_hash", lambda name: f"{RIHS}{'0' * 64}")
    found = list(health.look_at_interfaces())
    assert {f.state for f in found} == {"problem"}
    assert found[0].advice.startswith(f"expected {RIHS}{HASHES['lupin_msgs/srv/StartMission'][:12]}…")


def test_a_later_distribution_may_have_another_definition(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of Nav2's action, as Lyrical has; never of ours."""
    monkeypatch.setattr(health, "local_hash", lambda name: f"{RIHS}{'0' * 64}")
    monkeypatch.setattr(environment, "distribution", lambda: "lyrical")
    found = {each.topic: each for each in health.look_at_interfaces()}
    assert found["lupin_msgs/srv/StartMission"].state == "problem"
    drive = found["nav2_msgs/action/NavigateToPose"]
    assert drive.state == "note"
    assert drive.advice == "Jazzy and Kilted have RIHS01_a56dba8a3234…: use it with nodes of Lyrical only"


def test_left_overs_are_told_with_the_way_to_remove_them(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """They cost memory, not the run: a note."""
    segment = tmp_path / "fastrtps_1"
    segment.write_bytes(b"x" * 500_000)
    monkeypatch.setattr(health, "stale_segments", lambda: [segment])
    monkeypatch.setattr(health, "running_nodes", lambda domain: iter([(7, "lupin_sim")]))
    memory, nodes = health.look_at_left_overs()
    assert (memory.state, memory.found) == ("note", "1 stale files, 0.5 MB")
    assert "shm clean" in memory.advice
    assert (nodes.state, nodes.found) == ("note", "lupin_sim (7)")


def test_a_refused_plugin_is_told_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    """The others are still listed."""
    broken = EntryPoint("broken", "lupin_no_such_module:PLUGIN")
    good = EntryPoint("nav", "lupin_nav.catalog:PLUGIN")
    monkeypatch.setattr(health, "entry_points", lambda: [broken, good])
    refused, accepted = health.look_at_plugins()
    assert (refused.topic, refused.found, refused.state) == ("plugin broken", "refused", "problem")
    assert "No module named 'lupin_no_such_module'" in refused.advice
    assert (accepted.topic, accepted.state) == ("plugin nav", "ok")


def test_packages_that_only_some_commands_need_are_told_where_they_are_missing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A note: missions can be run without pages and recordings."""
    required = ["click<9,>=8", 'cbor2<7,>=5.6; extra == "hmi"', 'no-such-thing; extra == "hmi"']
    monkeypatch.setattr(health.metadata, "requires", lambda name: required)
    monkeypatch.setattr(health, "_is_installed", lambda name: name == "cbor2")
    advice = "`--hmi` needs it: `pip install 'lupin-engine[hmi]'`"
    assert list(health.look_at_extras()) == [
        Finding("packages of hmi", "no-such-thing missing", "note", advice)
    ]
    monkeypatch.undo()
    assert list(health.look_at_extras()) == []


def test_a_look_that_fails_is_a_problem_and_the_others_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a broken installation even looking can fail; that is when a doctor is called."""

    def look_at_left_overs() -> Iterator[Finding]:
        yield Finding("nodes running", "none")
        raise AttributeError("module 'x' has no attribute 'y'")

    def look_at_more() -> Iterator[Finding]:
        yield Finding("more", "fine")

    monkeypatch.setattr(health, "LOOKS", (look_at_left_overs, look_at_more))
    advice = "AttributeError: module 'x' has no attribute 'y'; install the packages anew"
    assert health.examine() == [
        Finding("nodes running", "none"),
        Finding("left overs", "cannot be looked at", "problem", advice),
        Finding("more", "fine"),
    ]


def test_the_table_ends_with_a_verdict(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Advice stands under what it is about; notes do not keep anybody from running."""
    fine = [Finding("Python", "3.11"), Finding("memory", "left", "note", "clean it")]
    monkeypatch.setattr(health, "examine", lambda: fine)
    assert main(["doctor"]) == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    assert lines[-1] == "missions can be run here"
    assert "clean it" in lines
    monkeypatch.setattr("lupin_ros.launch.health.examine", lambda: [Finding("a", "b", "problem", "do")])
    assert main(["doctor"]) == 1
    assert capsys.readouterr().out.splitlines()[-1] == "1 problem to mend before missions can be run"


def test_a_lifecycle_that_has_aged_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A copy by what it says of its origin, or by its name; one that extends the shipped one does not age."""
    monkeypatch.chdir(tmp_path)
    lifecycle = tmp_path / "missions" / "lifecycle.yaml"
    assert list(health.look_at_lifecycle()) == []
    assert main(["new", "patrol"]) == 0
    (found,) = health.look_at_lifecycle()
    assert (found.state, found.advice) == ("ok", "")
    shipped = f"greenhouse-robot, which engine {__version__} ships"
    assert found.found == f"missions/lifecycle.yaml extends {shipped}"

    carried = tmp_path / "missions" / "extends" / "greenhouse-robot.yaml"
    carried.parent.mkdir()
    carried.write_text("lifecycle: greenhouse-robot\n", encoding="utf-8")
    (found,) = health.look_at_lifecycle()
    assert (found.state, found.found) == (
        "note",
        f"missions/lifecycle.yaml extends {carried.relative_to(tmp_path)}",
    )
    carried.unlink()

    lifecycle.unlink()
    (tmp_path / "missions" / "patrol.yaml").unlink()
    (tmp_path / "scenarios" / "patrol.scenario.yaml").unlink()
    assert main(["new", "patrol", "--copy"]) == 0
    (found,) = health.look_at_lifecycle()
    copy = f"missions/lifecycle.yaml is a copy of greenhouse-robot of engine {__version__}"
    assert (found.state, found.found) == ("ok", f"{copy}, which has not changed since")

    text = lifecycle.read_text(encoding="utf-8")
    lifecycle.write_text(re.sub(r"sha256: .*}", "sha256: 12ab}", text), encoding="utf-8")
    (found,) = health.look_at_lifecycle()
    assert (found.state, found.found) == ("note", f"{copy}, which has changed since")
    assert found.advice == (
        "write `extends: NAME` and only what differs: `lupin new NAME` in an empty folder shows how"
    )

    lifecycle.write_text(re.sub(r"origin: .*\n", "# old\n", text), encoding="utf-8")
    (found,) = health.look_at_lifecycle()
    differs = f"missions/lifecycle.yaml differs from the greenhouse-robot that engine {__version__} ships"
    assert (found.state, found.found) == ("note", differs)

    for odd in (
        "lifecycle: [",
        "lifecycle: [a]",
        "lifecycle: a\nextends: [b]",
        "lifecycle: a\norigin: {lifecycle: {}}",
    ):
        lifecycle.write_text(f"{odd}\n", encoding="utf-8")
        assert list(health.look_at_lifecycle()) == []
