"""The recorder: what is in the file, whoever publishes it, whenever and in whatever quality."""

from __future__ import annotations

import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.serialization import deserialize_message
from rosbags.highlevel import AnyReader
from std_msgs.msg import Bool, String
from tf2_msgs.msg import TFMessage

from lupin_engine.errors import Severity, UsageError
from lupin_msgs.msg import Observation
from lupin_ros.adapter.node import Qos, RosNode
from lupin_ros.interfaces.type_hashes import local_hash
from lupin_ros.recording import recorder as module
from lupin_ros.recording.recorder import TopicRecorder
from lupin_ros.recording.schema import message_text
from tests.lupin_ros.helpers import spin_until
from tests.lupin_ros.recording.reading import channels, remains, whole

Make = Callable[..., RosNode]


def until_recorded(nodes: list[RosNode], recorder: TopicRecorder, messages: int) -> None:
    """Let nodes work until so many messages are recorded, beside those of the nodes themselves."""
    spin_until(nodes, lambda: recorder.messages >= messages, what=f"{messages} messages")


def until_found(node: RosNode, topic: str) -> None:
    """Wait until somebody listens to a topic."""
    spin_until([node], lambda: node.node.count_subscribers(topic), what=f"a subscriber of {topic}")


#: The most that a file may have where the disk is full, in bytes.
MOST = 3_000_000
OWN = re.compile(r"^/(rosout|parameter_events)$")


def test_what_was_published_before_is_in_the_file(make_node: Make, tmp_path: Path) -> None:
    """A map, static transforms and fifty observations, in the bytes in which they were sent."""
    node = make_node("robot")
    grid = OccupancyGrid(data=[0, 100, -1, 7])
    grid.info.width = grid.info.height = 2
    node.publisher(OccupancyGrid, "/map", Qos.LATCHED).publish(grid)
    node.publisher(TFMessage, "/tf_static", Qos.STATIC_TRANSFORMS).publish(TFMessage())
    told = [Observation(mission_id=f"m{number}") for number in range(50)]
    observations = node.publisher(Observation, "/observations", Qos.BACKLOG)
    for one in told:
        observations.publish(one)
    joined = time.time_ns()
    with TopicRecorder(tmp_path / "late.mcap", without=OWN) as recorder:
        until_recorded([node], recorder, 52)
    found = whole(recorder.path)
    assert {topic: len(messages) for topic, messages in found.items()} == {
        "/map": 1,
        "/tf_static": 1,
        "/observations": 50,
    }
    # rclpy's own reading of the bytes, and that by the definitions in the file; padding may be anything.
    assert [deserialize_message(one.data, Observation) for one in found["/observations"]] == told
    assert [one.value.mission_id for one in found["/observations"]] == [one.mission_id for one in told]
    assert list(found["/map"][0].value.data) == [0, 100, -1, 7]
    for one in (*found["/map"], *found["/observations"]):
        assert one.published < joined <= one.heard


def test_the_file_says_what_rosbag2_says(make_node: Make, tmp_path: Path) -> None:
    """Types by their full names with all definitions, the publishers' quality of service, type hashes."""
    node = make_node("robot")
    node.publisher(PoseStamped, "/place", Qos.LATCHED).publish(PoseStamped())
    with TopicRecorder(tmp_path / "place.mcap", without=OWN) as recorder:
        until_recorded([node], recorder, 1)
    channel, schema = channels(recorder.path)["/place"]
    assert (schema.name, schema.encoding, channel.message_encoding) == (
        "geometry_msgs/msg/PoseStamped",
        "ros2msg",
        "cdr",
    )
    assert re.findall(r"^={80}\nMSG: (\S+)$", schema.data.decode(), re.MULTILINE) == [
        "std_msgs/Header",
        "builtin_interfaces/Time",
        "geometry_msgs/Pose",
        "geometry_msgs/Point",
        "geometry_msgs/Quaternion",
    ]
    with AnyReader([recorder.path]) as bag:  # as rosbag2 reads it
        (connection,) = bag.connections
        assert (connection.topic, connection.msgtype, connection.msgcount) == ("/place", schema.name, 1)
        assert channel.metadata["topic_type_hash"] == local_hash(schema.name)
        (profile,) = connection.ext.offered_qos_profiles
        assert (profile.reliability.name, profile.durability.name) == ("RELIABLE", "TRANSIENT_LOCAL")
        ((_, at, raw),) = bag.messages()
        assert bag.deserialize(raw, connection.msgtype).pose.orientation.w == 1.0
        assert abs(at - time.time_ns()) < 60e9


def test_a_topic_that_appears_later_is_found(make_node: Make, tmp_path: Path) -> None:
    """Of a node that is started while the recorder runs; hidden topics and unwanted ones are left out."""
    with TopicRecorder(tmp_path / "found.mcap", without=re.compile(f"{OWN.pattern}|^/camera/")) as recorder:
        node = make_node("late")
        for topic in ("/camera/image", "/navigate/_action/status"):
            node.publisher(String, topic, Qos.LATCHED).publish(String(data="x"))
        talker = node.publisher(String, "/late", Qos.EVENT)
        until_found(node, "/late")
        talker.publish(String(data="there"))
        until_recorded([node], recorder, 1)
    assert [one.value.data for one in whole(recorder.path)["/late"]] == ["there"]
    assert list(channels(recorder.path)) == ["/late"]
    assert recorder.news() == []


def test_publishers_of_different_quality_are_all_heard(make_node: Make, tmp_path: Path) -> None:
    """A reliable one that keeps its last message, then one that is neither."""
    node = make_node("robot")
    node.publisher(String, "/mixed", Qos.LATCHED).publish(String(data="kept"))
    with TopicRecorder(tmp_path / "mixed.mcap", without=OWN) as recorder:
        until_recorded([node], recorder, 1)
        other = make_node("other").publisher(String, "/mixed", Qos.SENSOR)

        def arrives() -> bool:
            other.publish(String(data="hasty"))
            return recorder.messages > 1

        spin_until([node], arrives, what="the best effort publisher")
    values = [one.value.data for one in whole(recorder.path)["/mixed"]]
    assert (values[0], set(values[1:])) == ("kept", {"hasty"})


def test_what_cannot_be_recorded_is_told(
    make_node: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two types, another definition than here, classes that do not load; the others are recorded."""
    node = make_node("robot")
    node.publisher(String, "/both", Qos.LATCHED)
    make_node("stranger").publisher(Bool, "/both", Qos.LATCHED)
    node.publisher(PoseStamped, "/foreign", Qos.LATCHED).publish(PoseStamped())
    node.publisher(TFMessage, "/broken", Qos.LATCHED).publish(TFMessage())
    node.publisher(String, "/fine", Qos.LATCHED).publish(String(data="x"))
    real = module.local_hash
    monkeypatch.setattr(
        module, "local_hash", lambda name: "RIHS01_00" if name.endswith("PoseStamped") else real(name)
    )
    load = module.interface_class

    def loaded(name: str) -> Any:
        if name.endswith("TFMessage"):
            raise RuntimeError("no type support")
        return load(name)

    monkeypatch.setattr(module, "interface_class", loaded)
    told: list[tuple[str, Severity]] = []
    with TopicRecorder(tmp_path / "some.mcap", without=OWN) as recorder:
        spin_until([node], lambda: told.extend(recorder.news()) or (len(told) > 2 and recorder.messages))
    assert sorted(told) == [
        (
            "/both is not recorded: it is of several types: std_msgs/msg/Bool, std_msgs/msg/String",
            Severity.WARN,
        ),
        ("/broken is not recorded: RuntimeError('no type support')", Severity.WARN),
        (
            "/foreign is not recorded: /robot has another definition of geometry_msgs/msg/PoseStamped",
            Severity.WARN,
        ),
    ]
    assert list(whole(recorder.path)) == ["/fine"]


def test_files_of_others_that_cannot_be_read_do_not_end_a_recording(
    make_node: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A definition that may not be read, and a journal that was deleted to make room."""
    node = make_node("robot")
    node.publisher(TFMessage, "/secret", Qos.LATCHED).publish(TFMessage())
    node.publisher(String, "/fine", Qos.LATCHED).publish(String(data="x"))
    gone, load = tmp_path / "gone.jsonl", module.interface_class

    def loaded(name: str) -> Any:
        if name.endswith("TFMessage"):
            raise PermissionError(13, "Permission denied")
        return load(name)

    monkeypatch.setattr(module, "interface_class", loaded)
    monkeypatch.setattr(module, "journal_files", lambda _: [gone])
    news: list[tuple[str, Severity]] = []
    with TopicRecorder(tmp_path / "some.mcap", without=OWN) as recorder:
        spin_until([node], lambda: news.extend(recorder.news()) or (news and recorder.messages))
    news.extend(recorder.news())
    assert news == [
        ("/secret is not recorded: tf2_msgs/msg/TFMessage cannot be read: Permission denied", Severity.WARN),
        (f"{gone} is not attached: No such file or directory", Severity.WARN),
    ]
    assert not recorder.failed
    assert list(whole(recorder.path)) == ["/fine"]


def test_no_file_is_written_over_and_none_is_left_empty(tmp_path: Path) -> None:
    """What is there stays; a recording of nothing is none."""
    there = tmp_path / "there.mcap"
    there.write_text("mine", encoding="utf-8")
    with pytest.raises(UsageError, match=r"^'.*there\.mcap' is there already; name another file$"):
        TopicRecorder(there)
    assert there.read_text(encoding="utf-8") == "mine"
    with TopicRecorder(tmp_path / "nothing.mcap") as recorder:
        pass
    assert (recorder.messages, recorder.path.exists()) == (0, False)


def lupin_record(file: Path, **how: Any) -> subprocess.Popen[str]:
    """Start `lupin record`."""
    command = [sys.executable, "-m", "lupin_cli.main", "record", "--output", str(file)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **how)


def test_a_recorder_that_is_killed_leaves_what_it_had(make_node: Make, tmp_path: Path) -> None:
    """All but the last two seconds: so old is what was written, at most."""
    file = tmp_path / "killed.mcap"
    node = make_node("robot")
    talker = node.publisher(String, "/talk", Qos.EVENT)
    process = lupin_record(file)
    try:
        until_found(node, "/talk")
        sent = 0

        def written() -> bool:
            nonlocal sent
            sent += 1
            talker.publish(String(data=f"{sent} " + "x" * 1000))
            return file.stat().st_size > 5000

        spin_until([node], written, what="the first chunk")
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=30)
    spoken = [message.data.split(b" ")[0] for message in remains(file) if b"xxx" in message.data]
    assert len(spoken) > 3
    assert [int(re.sub(rb"\D", b"", one[8:])) for one in spoken] == list(range(1, len(spoken) + 1))


def test_a_full_disk_is_told_and_what_was_written_can_be_read(make_node: Make, tmp_path: Path) -> None:
    """A file may have 3 MB here: the recorder says so and ends with exit code 1."""
    file = tmp_path / "full.mcap"
    node = make_node("robot")
    talker = node.publisher(String, "/talk", Qos.EVENT)
    process = lupin_record(file, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (MOST, MOST)))
    try:
        until_found(node, "/talk")

        def over() -> bool:
            talker.publish(String(data=os.urandom(2000).hex()))
            return process.poll() is not None

        spin_until([node], over, what="the end of the recorder")
        out, err = process.communicate(timeout=30)
    finally:
        process.kill()
    assert process.returncode == 1, out + err
    assert err == f"lupin: the recording ends here, {str(file)!r} cannot be written: File too large\n"
    told = re.search(r"^recorded ([\d,]+) messages of \d+ topics, [\d.]+ MB, in .*full\.mcap$", out, re.M)
    assert told is not None, out
    assert len(remains(file)) == int(told[1].replace(",", "")) > 50


def test_a_definition_has_all_that_is_inside_once() -> None:
    """Deep messages too; a message without fields has an empty definition."""
    text = message_text("lupin_msgs/msg/Observation")
    inside = re.findall(r"^MSG: (\S+)$", text, re.MULTILINE)
    assert len(inside) == len(set(inside))
    assert {"lupin_msgs/TagReading", "lupin_msgs/FlowerPoint", "geometry_msgs/Point32"} <= set(inside)
    assert message_text("std_msgs/msg/Empty") == ""
