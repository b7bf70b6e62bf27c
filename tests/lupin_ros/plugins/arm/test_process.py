"""The arm's nodes as processes: killed, started again, and asked to end."""

from __future__ import annotations

import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from lupin_arm.presets import PRESETS
from lupin_ros.adapter.node import RosNode
from tests.lupin_ros.plugins.arm.scene import Bystander
from tests.lupin_ros.world import PATIENCE, World

pytestmark = pytest.mark.timeout(300)


def test_the_arm_survives_the_death_of_its_node_and_of_its_drivers(
    world: World,
    make_node: Callable[..., RosNode],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    scene = Bystander(make_node)
    world.start("lupin_arm_sim")
    world.start("lupin_arm", preset_duration=0.5)
    scene.until(lambda: scene.told and _sent(scene, "inspect"), "a first preset", PATIENCE)
    scene.arrives(PRESETS["inspect"])

    world.processes["lupin_arm"].send_signal(signal.SIGKILL)
    world.processes["lupin_arm"].wait(PATIENCE)
    again = world.start("lupin_arm", preset_duration=0.5)
    scene.until(lambda: _sent(scene, "place"), "a preset after the node died", PATIENCE)
    scene.arrives(PRESETS["place"])

    world.processes["lupin_arm_sim"].send_signal(signal.SIGKILL)
    world.processes["lupin_arm_sim"].wait(PATIENCE)
    scene.until(lambda: "for more than 2 s" in _refused(scene), "the drivers' death is noticed", PATIENCE)
    world.start("lupin_arm_sim")
    scene.until(lambda: _sent(scene, "tuck"), "a preset after the drivers died", PATIENCE)
    scene.arrives(PRESETS["tuck"])

    again.send_signal(signal.SIGINT)
    assert again.wait(PATIENCE) == 0
    assert "Traceback" not in world.log("lupin_arm").read_text()


def _sent(scene: Bystander, preset: str) -> bool:
    answer = scene.preset(preset)
    return bool(getattr(answer, "success", False))  # a dead server does not answer


def _refused(scene: Bystander) -> str:
    return str(getattr(scene.preset("inspect"), "message", ""))


@pytest.mark.core
def test_a_wrong_parameter_ends_the_node_with_its_name(world: World) -> None:
    process = world.start("lupin_arm", preset_duration=1000.0)
    assert process.wait(PATIENCE) == 1
    said = world.log("lupin_arm").read_text()
    assert "parameter 'preset_duration': expected" in said
    assert "between 0.5 and 60" in said
    assert "Traceback" not in said
