"""The operator's guide names what there is: every code with its label and severity, every verb and option."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from lupin_cli.main import lupin
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.registry import load_catalog

PAGE = Path(__file__).parents[2] / "docs" / "operating.md"
ROW = re.compile(r"\| `(?P<code>\w+)` \| (?P<label>.+?) \| (?P<severity>\w+) \| (?P<advice>.+?) \|")


def test_every_code_is_explained_with_its_label_and_severity() -> None:
    """All that the shipped missions and plugins can say, in the order of the alphabet, with its advice."""
    told = [row.groups() for row in ROW.finditer(PAGE.read_text(encoding="utf-8"))]
    codes = load_missions((), load_catalog()).chart.codes
    assert told == [
        (name, code.label, code.severity.name.lower(), code.advice) for name, code in sorted(codes.items())
    ]


def commands() -> Iterator[str]:
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        for command in re.findall(r"^ {4}(lupin [^#>]*)|`(lupin [^`]*)`", line):
            yield "".join(command).strip()


@pytest.mark.parametrize("command", sorted(set(commands())))
def test_every_command_is_one(command: str) -> None:
    """The verb is there and has the options."""
    _, verb, *words = command.split()
    found = lupin.get_command(click.Context(lupin), verb)
    assert found is not None
    options = {name for parameter in found.get_params(click.Context(found)) for name in parameter.opts}
    assert {word for word in words if word.startswith("--") and word != "--ros-args"} <= options


def test_a_recording_is_read_as_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The program of the page, over a file of the recorder."""
    pytest.importorskip("mcap_ros2", reason="no reader of recordings is installed here")
    from lupin_ros.recording.file import RecordingFile

    monkeypatch.chdir(tmp_path)
    recorded = RecordingFile(Path("monday.mcap"))
    definition = "string lifecycle_state\nstring current_target"
    topic = recorded.add_topic("/mission/state", "lupin_msgs/msg/MissionState", definition, {})
    texts = b"\x06\0\0\0READY\0\0\0\x02\0\0\x005\0"  # READY and 5, each with its length and a zero
    recorded.add(topic, b"\0\1\0\0" + texts, published=1, heard=2)
    recorded.finish()
    program, _ = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    exec(program, {})
    assert capsys.readouterr().out == "2 READY 5\n"


def test_the_figures_of_starting_again_are_those_of_the_run() -> None:
    """Seconds until a node that died is started again."""
    pytest.importorskip("rclpy", reason="ROS 2 is not installed here")
    from lupin_ros.launch.respawn import RESPAWN_AFTER_S

    *first, last = (f"{seconds:g}" for seconds in RESPAWN_AFTER_S)
    assert f"again, after {', '.join(first)} and {last} seconds" in PAGE.read_text(encoding="utf-8")
