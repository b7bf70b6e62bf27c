"""What is wrong is told before any process is started, without ROS, with the right exit code."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_engine.missions.folders import default_missions_folder

SHIPPED = default_missions_folder()


@pytest.fixture(autouse=True)
def nothing_starts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Fail should a run get as far as ROS, and look for missions in the shipped folder only."""

    def reached() -> None:
        raise AssertionError("this should have been refused before ROS was touched")

    monkeypatch.setattr("lupin_cli.bring_up.prepare_ros", reached)
    monkeypatch.setattr("lupin_cli.verbs.node.prepare_ros", reached)
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("verb", ["run", "up"])
@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["inspecton"], f"no mission 'inspecton' in {SHIPPED}; did you mean 'inspection'?"),
        (["absent.yaml"], "no mission file 'absent.yaml'"),
        (
            ["inspection", "--set", "nav_timeout=5"],
            "--set: unknown parameter 'nav_timeout'; did you mean 'nav_timeout_s'?",
        ),
        (
            ["inspection", "--set", "nav_timeout_s=soon"],
            "--set: parameter 'nav_timeout_s': expected duration, got 'soon'; "
            "its units are 'ms', 's', 'min', 'h'",
        ),
        (
            ["inspection", "--set", "nav_timeout_s"],
            "--set: 'nav_timeout_s' has no '='; write --set NAME=VALUE",
        ),
    ],
    ids=["mission", "file", "parameter name", "parameter type", "no value"],
)
def test_wrong_words_are_usage_errors(
    capsys: pytest.CaptureFixture[str], verb: str, arguments: list[str], text: str
) -> None:
    """Exit code 2 and the nearest spelling."""
    assert main([verb, *arguments]) == 2
    assert capsys.readouterr().err == f"lupin: {text}\n"


def test_all_missions_that_there_are_not_are_told(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """By name and by file, with the nearest; a folder is not one, and has some."""
    shutil.copytree(SHIPPED, tmp_path / "mine")
    names = ["inspecton", "mine/inspecton.yaml", "mine", "mine/parts", "inspection"]
    assert main(["up", *names]) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"lupin: no mission 'inspecton' in {SHIPPED}; did you mean 'inspection'?",
        "no mission file 'mine/inspecton.yaml'; did you mean 'mine/inspection.yaml'?",
        "'mine' is a folder; allowed: 'mine/exploration.yaml', 'mine/inspection.yaml'",
        "'mine/parts' is a folder; it has no missions",
    ]


def test_an_unknown_tag_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """With the tags that there are."""
    assert main(["run", "inspection", "--tags", "1,99"]) == 2
    assert capsys.readouterr().err.startswith("lupin: unknown tag '99'; the layout has 29 tags: 1, 2, 3, 4,")


@pytest.mark.parametrize("verb", ["run", "up"])
def test_a_layout_that_is_not_there_is_named(capsys: pytest.CaptureFixture[str], verb: str) -> None:
    """A parameter that leads nowhere is told here, not by a node that dies."""
    assert main([verb, "inspection", "--set", "tag_locations_file=absent.json"]) == 2
    told = "lupin: tag_locations_file 'absent.json' cannot be used: No such file or directory\n"
    assert capsys.readouterr().err == told


def test_everything_that_is_wrong_is_told_at_once(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Parameters, the request, where logs go, and what the shell has set for ROS."""
    (tmp_path / "file").touch()
    monkeypatch.setenv("ROS_DOMAIN_ID", "lab")
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    given = ["--set", "nav_timeout=5", "--set", "approach_yaw=5 s", "--set", "battery_topic=a b"]
    given += ["--goal", "3", "--log-dir", "file/logs", "--save-svg", "file/run.svg"]
    assert main(["run", "inspection", *given]) == 2
    assert capsys.readouterr().err.splitlines() == [
        "lupin: --set: unknown parameter 'nav_timeout'; did you mean 'nav_timeout_s'?",
        "--set: parameter 'approach_yaw': expected angle, got '5 s'; its units are 'deg', 'rad'",
        "--set: parameter 'battery_topic': expected ROS name, got 'a b', such as /camera/image_raw",
        "InspectionMission has no use for --goal: its request has no discovery_goal; it has tag_sequence",
        "no picture can be written to 'file': File exists",
        "ROS_DOMAIN_ID is 'lab': use a number from 0 to 101 or from 215 to 232",
        "ROS_AUTOMATIC_DISCOVERY_RANGE is 'OFF': nodes do not find each other: unset it",
        "no logs can be written to 'file/logs': Not a directory",
    ]


@pytest.mark.parametrize("verb", ["run", "up", "simulate"])
def test_a_mission_with_errors_is_told_in_full(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, verb: str
) -> None:
    """Every finding; exit code 2, because 1 says that targets were missed."""
    shutil.copytree(SHIPPED, tmp_path / "m")
    file = tmp_path / "m" / "inspection.yaml"
    file.write_text(
        file.read_text().replace("phase: LOC", "phaze: LOC").replace("on_error: FAULT", "on_error: FALT")
    )
    assert main([verb, str(file)]) == 2
    first, second = capsys.readouterr().err.splitlines()
    assert first.startswith(f"{file}:")
    assert first.endswith("unknown key 'phaze'; did you mean 'phase'? [unknown-key]")
    assert "no state is called 'FALT' here; did you mean 'FAULT'?" in second


def test_an_unknown_node_gets_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2."""
    assert main(["node", "greenhous_bridge", "--ros-args", "-p", "debug_seed:=1"]) == 2
    assert (
        capsys.readouterr().err
        == "lupin: unknown node 'greenhous_bridge'; did you mean 'greenhouse_bridge'?\n"
    )


def test_nodes_are_listed_with_what_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    """Without importing them: their modules need ROS."""
    assert main(["node"]) == 0
    names = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert names[0] == "mission_orchestrator"
    assert {"greenhouse_bridge", "lupin_sim"} <= set(names)


def test_without_ros_the_way_to_get_it_is_told(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Everything else works without; a run does not."""
    from lupin_ros.launch.requirements import prepare_ros

    monkeypatch.setattr("lupin_cli.bring_up.prepare_ros", prepare_ros)
    monkeypatch.setattr("lupin_ros.adapter.environment.rclpy_source", lambda: None)
    assert main(["run", "inspection"]) == 2
    told = capsys.readouterr().err
    assert told.startswith("lupin: ROS 2 is not installed for this Python; install it with `pip install ")


@pytest.mark.parametrize("words", [["missions"], ["why", "DONE"], ["replay"]])
def test_a_domain_that_is_a_word_has_no_journal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    """That of the domain 0 is another one."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "lab")
    assert main(words) == 2
    told = "lupin: ROS_DOMAIN_ID is 'lab': use a number from 0 to 101 or from 215 to 232\n"
    assert capsys.readouterr().err == told
