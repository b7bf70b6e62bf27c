"""A made-up package of interfaces: added in one command, then checked against, published and heard."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from lupin_ros.interfaces.added import add_interfaces
from lupin_ros.interfaces.definitions import installed_types

pytestmark = [pytest.mark.ros, pytest.mark.long, pytest.mark.timeout(600)]

NAME = "lupin_test_lift_msgs"
FILES = {
    "package.xml": f"<package><name>{NAME}</name><version>1.2.0</version></package>",
    "msg/Floor.msg": "string name\nfloat32 height\n",
    "msg/LiftState.msg": "uint8 OPEN=2\nstd_msgs/Header header\nFloor[] floors\nuint8 door_state 0\n",
    "srv/CallLift.srv": "string floor\n---\nbool accepted\n",
}
BINDING = f"""\
binding: lift
summary: A lift.
values:
  door:
    summary: What the door does.
    type: count
    topic: {{name: /lift, type: {NAME}/msg/LiftState}}
    from: ${{ message.door_stat }}
"""
#: A process of its own: this one has looked for packages already.
TALK = f"""
import rclpy
from {NAME}.msg import Floor, LiftState
rclpy.init()
node, heard = rclpy.create_node("lift"), []
node.create_subscription(LiftState, "/lift", heard.append, 1)
publisher = node.create_publisher(LiftState, "/lift", 1)
for _ in range(200):
    publisher.publish(LiftState(floors=[Floor(name="W1", height=3.5)], door_state=LiftState.OPEN))
    rclpy.spin_once(node, timeout_sec=0.1)
    if heard:
        break
print(heard[0].floors[0].name, heard[0].floors[0].height, heard[0].door_state)
"""


@pytest.fixture(scope="module")
def added(tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[str]]:
    """Add the package, and take it away at the end."""
    folder = tmp_path_factory.mktemp("lift")
    for name, text in FILES.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    said: list[str] = []
    assert add_interfaces(str(folder), said.append) == [NAME]
    yield said
    distribution = f"lupin-interfaces-{NAME.replace('_', '-')}"
    subprocess.run([sys.executable, "-m", "pip", "uninstall", "--quiet", "--yes", distribution], check=True)
    assert installed_types(f"{NAME}/msg/Floor") is None


def lupin(*words: str) -> subprocess.CompletedProcess[str]:
    """Run Python in the environment that nodes have."""
    command = [sys.executable, "-m", "lupin_ros.adapter.environment", sys.executable, *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


def test_a_node_publishes_and_hears_it(added: list[str]) -> None:
    """Fields of the package's own messages, and of others."""
    assert added == [f"Compiling {NAME} (3 definitions)"]
    talked = lupin("-c", TALK)
    assert talked.stdout == "W1 3.5 2\n", talked.stderr


@pytest.mark.usefixtures("added")
def test_a_binding_is_checked_against_it(tmp_path: Path) -> None:
    """A field that it has not is an error with the nearest name."""
    (tmp_path / "bindings").mkdir()
    (tmp_path / "lupin.yaml").write_text("allow: {subscribe: [/lift]}\n", encoding="utf-8")
    (tmp_path / "bindings" / "lift.yaml").write_text(BINDING, encoding="utf-8")
    checked = lupin("-m", "lupin_cli.main", "check", str(tmp_path / "bindings" / "lift.yaml"))
    assert checked.returncode == 1
    problem = "'message' has no 'door_stat'; did you mean 'door_state'? [unknown-name]"
    assert f"lift.yaml:8:22: error: values.door.from: {problem}" in checked.stdout
    (tmp_path / "bindings" / "lift.yaml").write_text(BINDING.replace("stat }", "state }"), encoding="utf-8")
    mended = lupin("-m", "lupin_cli.main", "check", str(tmp_path / "bindings" / "lift.yaml"))
    assert (mended.returncode, mended.stdout) == (0, "no missions, no errors, no warnings\n")
