"""Secrets come from files or the environment, and are told to nobody: no log, no topic, no parameter."""

from __future__ import annotations

import os
import socket
import sys
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import GetParameters, ListParameters

from lupin_ros.adapter.node import Qos
from tests.lupin_ros.world import Operator, World

SECRET = "kas-wortel-93"


@pytest.mark.core
@pytest.mark.parametrize("by_file", [False, True], ids=["environment", "file"])
def test_the_password_of_the_broker_is_told_to_nobody(
    world: World,
    operator: Operator,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    by_file: bool,
) -> None:
    """Not even in a log of everything, while the broker cannot be reached."""
    given = []
    if by_file:
        file = tmp_path / "credentials"
        file.write_text(f"robot\n{SECRET}\n")
        file.chmod(0o600)
        given = ["-p", f"mqtt_credentials_file:={file}"]
    else:
        monkeypatch.setenv("LUPIN_MQTT_USER", "robot")
        monkeypatch.setenv("LUPIN_MQTT_PASSWORD", SECRET)
    heard: list[str] = []
    operator.ros.subscribe(Log, "/rosout", Qos.BACKLOG, lambda m: heard.append(m.msg))
    operator.ros.subscribe(DiagnosticArray, "/diagnostics", Qos.EVENT, lambda m: heard.append(str(m)))
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))  # not listening
        port = nobody.getsockname()[1]
        lupin = str(Path(sys.executable).with_name("lupin"))
        ros = ["--ros-args", "--log-level", "debug", "-p", "backend:=mqtt", "-p", "mqtt_host:=127.0.0.1"]
        world.run(
            "greenhouse_bridge",
            [lupin, "node", "greenhouse_bridge", *ros, "-p", f"mqtt_port:={port}", *given],
        )
        operator.until(
            lambda: any("cannot be reached" in text for text in heard), "the broker is not reached"
        )
        node = "/greenhouse_bridge"
        names = operator.call(ListParameters, f"{node}/list_parameters", ListParameters.Request())
        request = GetParameters.Request(names=names.result.names)
        values = operator.call(GetParameters, f"{node}/get_parameters", request)
    assert len(names.result.names) > 5
    log = world.log("greenhouse_bridge").read_text(encoding="utf-8")
    assert "cannot be reached" in log
    kept = [path.read_text(errors="replace") for path in _files(Path(os.environ["XDG_STATE_HOME"]))]
    for told in (log, str(values), *heard, *kept):
        assert SECRET not in told


def _files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]
