"""`lupin.yaml`: what bindings may reach is said by who owns the robot."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_engine.errors import ChartError
from lupin_engine.missions.folders import default_missions_folder, lifecycle_in, mission_files
from lupin_engine.missions.load import inspect_chart
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.contract import Plugin
from lupin_engine.plugin.registry import Catalog, build_catalog, load_catalog

PHOTO_ROUND = Path(__file__).parents[3] / "examples" / "photo_round"
ALLOWED = "allow: {services: /camera/*, publish: /camera/*, subscribe: /camera/*}"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A robot with the missions of an example, of whom nobody has said anything."""
    shutil.copytree(PHOTO_ROUND / "missions", tmp_path / "missions")
    shutil.copy(default_missions_folder() / "lifecycle.yaml", tmp_path / "missions")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def told(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Check the missions, and return the findings without the lines of the files."""
    main(["check", "missions"])
    return [line for line in capsys.readouterr().out.splitlines() if ": error: " in line or "error" in line]


def said(mission: Path, catalog: Catalog) -> list[str]:
    """Return the findings with another catalog, as texts."""
    inspection = inspect_chart(lifecycle_in(mission.parent), [mission], catalog, reaching=True)
    return [str(found) for found in inspection.found]


def test_nothing_is_allowed_unless_somebody_says_so(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each place is told, with the line that would allow it; other robots' drivers are out of reach."""
    bound = "missions/bindings/camera.yaml"
    assert told(capsys) == [
        f"{bound}:15:21: error: operations.photo.service: it is not allowed to call the service "
        "'/camera/photo'; write /camera/photo under 'allow: services' in lupin.yaml [not-allowed]",
        f"{bound}:30:19: error: actions.lamp.topic: it is not allowed to publish on the topic "
        "'/camera/lamp'; write /camera/lamp under 'allow: publish' in lupin.yaml [not-allowed]",
        f"{bound}:38:19: error: values.camera.light.topic: it is not allowed to listen to the topic "
        "'/camera/light'; write /camera/light under 'allow: subscribe' in lupin.yaml [not-allowed]",
        "1 mission, 3 errors, no warnings",
    ]


def test_who_reaches_nothing_needs_no_leave(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A simulation; what is run is refused before anything is started."""
    (mission,) = mission_files(Path("missions"))
    assert main(["simulate", mission.stem, "--until", "1 s"]) == 0
    with pytest.raises(ChartError, match="not-allowed"):
        load_missions([mission.stem], load_catalog(), reaching=True)
    capsys.readouterr()
    assert main(["up", mission.stem]) == 2
    assert capsys.readouterr().err.count("[not-allowed]") == 3


def test_the_file_above_the_missions_counts(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Who may only put missions there cannot allow himself more; without that file, his counts."""
    Path("missions/lupin.yaml").write_text(ALLOWED)
    assert told(capsys) == ["1 mission, no errors, no warnings"]
    Path("lupin.yaml").write_text("allow: {services: /camera/photo}")
    assert told(capsys)[-1] == "1 mission, 2 errors, no warnings"
    Path("lupin.yaml").write_text("allow: {}")
    assert told(capsys)[-1] == "1 mission, 3 errors, no warnings"
    Path("lupin.yaml").write_text(ALLOWED)
    assert told(capsys) == ["1 mission, no errors, no warnings"]


LAMP = "actions.lamp.topic: it is not allowed to publish on the topic"
OTHERS = {
    "/joint_states": "plugin 'arm'",
    "/perception/discovered_tags": "plugin 'perception'",
    "/lupin/hmi/estop": "plugin 'gateway'",
    "/lupin/gateway/stop": "plugin 'gateway'",
    "/e_stop_state": "plugin 'nav'",
    "/cmd_vel": "profile 'greenhouse'",
    "/mission/state": "the orchestrator",
    "/mission_orchestrator/steps": "the engine",
}


@pytest.mark.slow
@pytest.mark.parametrize("topic", OTHERS)
def test_what_others_publish_is_theirs(folder: Path, capsys: pytest.CaptureFixture[str], topic: str) -> None:
    """Who may subscribe to it may not publish it, and no pattern opens it; the owner can write the name."""
    bound = Path("missions/bindings/camera.yaml")
    bound.write_text(bound.read_text().replace("/camera/lamp", topic))
    Path("lupin.yaml").write_text("allow: {services: /camera/*, publish: /*, subscribe: /camera/*}")
    assert told(capsys) == [
        f"{bound}:30:19: error: {LAMP} '{topic}', which belongs to {OTHERS[topic]}; "
        f"write {topic}, without '*', under 'allow: publish' in lupin.yaml [not-allowed]",
        "1 mission, 1 error, no warnings",
    ]
    Path("lupin.yaml").write_text(f"allow: {{services: /camera/*, publish: {topic}, subscribe: /camera/*}}")
    assert told(capsys) == ["1 mission, no errors, no warnings"]


def test_a_common_name_is_written_in_full(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Else a wildcard for this robot, or its own plugin's topic, would reach all robots."""
    bound = Path("missions/bindings/camera.yaml")
    text = bound.read_text().replace("name: /camera/lamp", "common: true, name: /robot1/e_stop_state")
    bound.write_text(text.replace("name: /camera/light", "common: true, name: /joint_states"))
    Path("lupin.yaml").write_text("allow: {services: /camera/*, publish: /*, subscribe: /*}")
    assert told(capsys) == [
        f"{bound}:30:33: error: {LAMP} '/robot1/e_stop_state' of all robots; write /robot1/e_stop_state, "
        "without '*', under 'allow: publish' in lupin.yaml [not-allowed]",
        f"{bound}:38:33: error: values.camera.light.topic: it is not allowed to listen to the topic "
        "'/joint_states' of all robots; write /joint_states, without '*', under 'allow: subscribe' in "
        "lupin.yaml [not-allowed]",
        "1 mission, 2 errors, no warnings",
    ]
    full = "{services: /camera/*, publish: /robot1/e_stop_state, subscribe: /joint_states}"
    Path("lupin.yaml").write_text(f"allow: {full}")
    assert told(capsys) == ["1 mission, no errors, no warnings"]


@pytest.mark.parametrize(
    ("service", "owner"),
    [
        ("/mission/start", "the orchestrator"),
        ("/mission/resume", "the orchestrator"),
        ("/mission_orchestrator/command", "the engine"),
        ("/lupin/arm/calibrate", "plugin 'arm'"),
    ],
)
def test_what_operators_command_is_theirs(
    folder: Path, capsys: pytest.CaptureFixture[str], service: str, owner: str
) -> None:
    """A binding that resumes is no operator; the owner can write the name."""
    bound = Path("missions/bindings/camera.yaml")
    bound.write_text(bound.read_text().replace("/camera/photo", service))
    Path("lupin.yaml").write_text("allow: {services: /*, publish: /camera/*, subscribe: /camera/*}")
    assert told(capsys) == [
        f"{bound}:15:21: error: operations.photo.service: it is not allowed to call the service '{service}', "
        f"which belongs to {owner}; write {service}, without '*', under 'allow: services' in lupin.yaml "
        "[not-allowed]",
        "1 mission, 1 error, no warnings",
    ]


def test_a_plugin_of_before_has_topics_among_its_services(folder: Path) -> None:
    """They may be subscribed to as before, with a warning; publishing needs the owner's leave."""
    old = Plugin("cam", "A camera.", serves=("/camera/photo", "/camera/light", "/camera/lamp"))
    loaded = load_catalog()
    catalog = build_catalog([*loaded.plugins.values(), old], loaded.profiles.values())
    (mission,) = mission_files(Path("missions"))
    missing, old_way = said(mission, catalog)
    assert missing == (
        f"missions/bindings/camera.yaml:30:19: error: {LAMP} '/camera/lamp'; write /camera/lamp under "
        "'allow: publish' in lupin.yaml; or let plugin 'cam' declare accepts=('/camera/lamp',) [not-allowed]"
    )
    assert old_way == (
        "missions/bindings/camera.yaml:38:19: warning: values.camera.light.topic: plugin 'cam' declares the "
        "topic '/camera/light' under 'serves', among services; write publishes=('/camera/light',) in its "
        "catalog [not-allowed]"
    )
    Path("lupin.yaml").write_text("allow: {publish: /camera/*}")
    assert said(mission, catalog) == [old_way]
    new = replace(old, serves=("/camera/photo",), publishes=("/camera/light",), accepts=("/camera/lamp",))
    Path("lupin.yaml").unlink()
    catalog = build_catalog([*loaded.plugins.values(), new], loaded.profiles.values())
    assert said(mission, catalog) == []


def test_what_is_wrong_in_the_file_is_told_there(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And nothing is allowed meanwhile."""
    Path("lupin.yaml").write_text("allow:\n  topics: /camera/*\n  servces: /camera/*\n")
    found = told(capsys)
    assert found[-1] == "1 mission, 5 errors, no warnings"
    assert [line for line in found if line.startswith("lupin.yaml")] == [
        "lupin.yaml:2:3: error: allow: a topic is listened to or published on; "
        "write 'subscribe: [...]' or 'publish: [...]' [wrong-shape]",
        "lupin.yaml:3:3: error: allow: unknown key 'servces'; did you mean 'services'? [unknown-key]",
    ]
    Path("lupin.yaml").write_text("allow: all\n")
    assert told(capsys) == [
        "lupin.yaml:1:8: error: allow: expected a mapping, got 'all' [wrong-shape]",
        "1 mission, 1 error, no warnings",
    ]
