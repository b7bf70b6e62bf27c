"""`lupin replay FILE --hmi`: what was recorded as lines, files of others, and files that are none."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the extra hmi is not installed here")
pytest.importorskip("mcap_ros2", reason="the extra record is not installed here")

from mcap_ros2.writer import Writer

from lupin_cli.main import main
from lupin_cli.pages import find_server
from lupin_engine.errors import UsageError
from lupin_engine.plugin.contract import Plugin
from lupin_engine.plugin.registry import build_catalog
from tests.console.pages import COMMAND, STATE, STEPS, ServedPages
from tests.plugins.gateway.served import OpenPage

pytestmark = pytest.mark.slow

STRING = "string data"
TRANSFORMS = """Transform[] transforms
================================================================================
MSG: a_msgs/Transform
string child_frame_id
float64[] numbers
uint8[] raw"""
#: UNIX time of the first message, in ns.
BEGIN = 1_790_000_000_000_000_000
MS = 1_000_000

Told = list[tuple[str, int, object]]


@pytest.fixture
def recorded(tmp_path: Path) -> Callable[[Told], Path]:
    """Write messages (topic, ms since the begin, fields) into a file."""

    def write(told: Told) -> Path:
        file = tmp_path / "some.mcap"
        with file.open("wb") as stream:
            writer = Writer(stream)
            string = writer.register_msgdef("std_msgs/msg/String", STRING)
            transforms = writer.register_msgdef("a_msgs/msg/Transforms", TRANSFORMS)
            for topic, at, fields in told:
                schema = transforms if topic == "/tf" else string
                writer.write_message(topic, schema, fields, BEGIN + at * MS, BEGIN + at * MS)
            writer.finish()
        return file

    return write


def step(number: int, at: int) -> tuple[str, int, object]:
    return STEPS, at, {"data": json.dumps({"number": number})}


def test_the_whole_recording_comes_as_lines(recorded: Callable[[Told], Path]) -> None:
    moved = {"transforms": [{"child_frame_id": "base", "numbers": [1.5, float("nan")], "raw": b"\x01"}]}
    other = {"transforms": [{"child_frame_id": "arm", "numbers": [], "raw": b""}]}
    file = recorded(
        [
            step(1, 0),
            step(2, 1),
            ("/tf", 2, moved),
            ("/tf", 3, other),
            ("/tf", 50, moved),
            ("/tf", 120, moved),
        ]
    )
    with ServedPages("replay", str(file)) as served:
        assert served.line == f"recording of some.mcap: pages at {served.url[:-1]}; Ctrl-C ends it"
        begin = BEGIN / MS
        lines = served.history()
        assert [line["msg"] for line in lines if line["topic"] == STEPS] == [step(1, 0)[2], step(2, 1)[2]]
        # Of sensors one message of a frame within 0.1 s.
        assert [(line["at"] - begin) for line in lines if line["topic"] == "/tf"] == [2.0, 3.0, 120.0]
        assert lines[2]["msg"]["transforms"] == [
            {"child_frame_id": "base", "numbers": [1.5, None], "raw": "AQ=="}
        ]
        later = served.history(f"history?since={begin + 3}&topics=/tf,/none")
        assert [(line["topic"], line["at"] - begin) for line in later] == [("/tf", 50.0)]
        status = json.loads(served.fetch("status"))
        assert {name: status[name] for name in ("mode", "title", "from", "to")} == {
            "mode": "recording", "title": "some.mcap", "from": begin, "to": begin + 120,
        }  # fmt: skip
        assert served.interrupt() == (0, "")


def test_nothing_can_be_asked_of_a_recording(recorded: Callable[[Told], Path]) -> None:
    with ServedPages("replay", str(recorded([step(1, 0)]))) as served:
        page = OpenPage(served.port)
        answer = page.call(COMMAND, verb="pause")
        assert (answer["result"], answer["values"]) == (
            False, f"{COMMAND}: this is a recording: it cannot be commanded, and nobody answers",
        )  # fmt: skip
        page.send({"op": "publish", "topic": "/cmd_vel", "type": "geometry_msgs/msg/Twist", "msg": {}})
        page.work_off()
        assert page.statuses() == ["/cmd_vel: this is a recording, which hears nothing that pages publish"]
        page.close()


def test_a_file_that_was_cut_off_is_shown_as_far_as_it_goes(recorded: Callable[[Told], Path]) -> None:
    file = recorded([step(number, number) for number in range(20_000)])
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with ServedPages("replay", str(file)) as served:
        status = json.loads(served.fetch("status"))
        assert status["problems"][0] == "the file is cut off: what came after its last message is not known"
        numbers = [json.loads(line["msg"]["data"])["number"] for line in served.history()]
        assert 0 < len(numbers) < 20_000
        assert numbers == list(range(len(numbers)))
        assert status["to"] == BEGIN / MS + numbers[-1]


def test_of_a_recording_by_others_it_says_what_is_missing(recorded: Callable[[Told], Path]) -> None:
    with ServedPages("replay", str(recorded([("/chatter", 0, {"data": "hello"})]))) as served:
        wanted = [STEPS, "/mission_orchestrator/missions", "/mission_orchestrator/chart"]
        missing = ", ".join([*wanted, "/mission_orchestrator/possible", STATE])
        assert json.loads(served.fetch("status"))["problems"] == [
            f"nobody told {missing} while it was recorded"
        ]
        assert [line["msg"] for line in served.history()] == [{"data": "hello"}]


def test_a_topic_that_cannot_be_read_leaves_the_others(tmp_path: Path) -> None:
    from mcap.writer import Writer as PlainWriter

    file = tmp_path / "mixed.mcap"
    with file.open("wb") as stream:
        writer = PlainWriter(stream)
        writer.start(profile="ros2", library="")
        shape = writer.register_schema("Thing", "jsonschema", b"{}")
        foreign = writer.register_channel("/json", "json", shape)
        wrong = writer.register_schema("a_msgs/msg/Wrong", "ros2msg", b"no message at all !")
        broken = writer.register_channel("/broken", "cdr", wrong)
        for channel in (foreign, broken):
            writer.add_message(channel, BEGIN, b"{}", BEGIN)
        writer.finish()
    with ServedPages("replay", str(file)) as served:
        told = json.loads(served.fetch("status"))["problems"]
        assert "/json cannot be read: json with jsonschema, not cdr with ros2msg" in told
        assert [text for text in told if text.startswith("/broken cannot be read: its definition")]
        assert served.history() == []


def test_what_is_no_recording_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, empty, nothing = tmp_path / "a.txt", tmp_path / "b.mcap", tmp_path / "c.mcap"
    text.write_text("a text", encoding="utf-8")
    empty.write_bytes(b"\x89MCAP0\r\n")
    told = {
        tmp_path: f"{str(tmp_path)!r} is a folder; name the .mcap file in it",
        text: f"{str(text)!r} is no recording: a recording is an MCAP file, as `lupin record` makes it",
        empty: f"{str(empty)!r} has no message that could be shown",
        nothing: f"{str(nothing)!r} cannot be read: No such file or directory",
    }
    for file, problem in told.items():
        assert main(["replay", str(file), "--hmi"]) == 2
        assert capsys.readouterr().err == f"lupin: {problem}\n"
    assert main(["replay", str(text)]) == 2
    assert capsys.readouterr().err == (
        f"lupin: a recording is shown in the console: `lupin replay {text} --hmi`\n"
    )


def test_options_that_do_not_go_with_pages_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "inspection", "--hmi", "--json"]) == 2
    assert capsys.readouterr().err == (
        "lupin: --hmi goes with --tags, --goal, --request, --set, --clock, --seed, --speed and --port only\n"
    )


def test_where_nothing_serves_pages_it_is_told() -> None:
    plugin = Plugin("pages", "Serves pages.", pages="lupin_nowhere:serve")
    nobody, missing = build_catalog([]), build_catalog([plugin])
    with pytest.raises(UsageError, match=r"^--hmi: none of the installed plugins serves pages$"):
        find_server(nobody)
    needed = r"^--hmi: No module named 'lupin_nowhere'; pages need `pip install 'lupin-engine\[hmi\]'`$"
    with pytest.raises(UsageError, match=needed):
        find_server(missing)
