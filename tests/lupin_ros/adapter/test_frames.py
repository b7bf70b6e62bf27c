"""Frames have a prefix on the network, and none within a node."""

from __future__ import annotations

from geometry_msgs.msg import PoseStamped, TransformStamped
from nav_msgs.msg import Path
from tf2_msgs.msg import TFMessage

from lupin_ros.adapter.frames import FramePrefix


def transforms(*frames: tuple[str, str]) -> TFMessage:
    message = TFMessage()
    for parent, child in frames:
        message.transforms.append(TransformStamped(child_frame_id=child))
        message.transforms[-1].header.frame_id = parent
    return message


def frames(message: TFMessage) -> list[tuple[str, str]]:
    return [(each.header.frame_id, each.child_frame_id) for each in message.transforms]


def test_it_is_added_once_and_taken_off() -> None:
    """Also where the same message is sent again; a message without a frame stays so."""
    prefix, message = FramePrefix("robot2/"), transforms(("map", "odom"), ("/odom", ""))
    sent = [("robot2/map", "robot2/odom"), ("robot2/odom", "")]
    assert frames(prefix.outgoing(prefix.outgoing(message))) == sent
    assert frames(prefix.incoming(message)) == [("map", "odom"), ("odom", "")]


def test_frames_of_others_stay_theirs() -> None:
    """So that a pose of another robot is none on this one's map."""
    heard = FramePrefix("robot2/").incoming(transforms(("robot1/map", "/robot2/odom")))
    assert frames(heard) == [("robot1/map", "odom")]


def test_every_header_of_a_message_has_it() -> None:
    path = Path(poses=[PoseStamped(), PoseStamped()])
    for header in (path.header, *(pose.header for pose in path.poses)):
        header.frame_id = "map"
    FramePrefix("r/").outgoing(path)
    assert {path.header.frame_id, *(pose.header.frame_id for pose in path.poses)} == {"r/map"}


def test_plain_data_is_read_without_it() -> None:
    """As pages get it."""
    sent = {"transforms": [{"header": {"frame_id": "r/map"}, "child_frame_id": "r/odom", "x": [1.0]}]}
    read = FramePrefix("r/").reading(lambda _: sent)
    assert read(b"") == {
        "transforms": [{"header": {"frame_id": "map"}, "child_frame_id": "odom", "x": [1.0]}]
    }


def test_without_a_prefix_nothing_changes() -> None:
    message = transforms(("/map", "odom"))
    assert frames(FramePrefix("").incoming(FramePrefix("").outgoing(message))) == [("/map", "odom")]
