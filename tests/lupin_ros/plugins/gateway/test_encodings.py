"""What both versions of roslib make of our frames: JSON, CBOR, and the serialized message in CBOR."""

from __future__ import annotations

import array
import math
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CompressedImage, JointState, LaserScan
from std_msgs.msg import Header, Int64MultiArray

from lupin_ros.adapter.node import Qos, RosNode
from tests.lupin_ros.plugins.gateway.page import Page

pytestmark = [pytest.mark.node, pytest.mark.timeout(120)]

VERSIONS = pytest.mark.parametrize("version", ["1", "2"])
OpenPage = Callable[..., Page]


def typed(kind: str, *values: float | str | None) -> dict[str, Any]:
    """A typed array, as the page tells it; what is not a number is null there."""
    return {"typed": kind, "values": list(values)}


POSE = PoseWithCovarianceStamped()
POSE.pose.covariance = np.arange(36.0)
MESSAGES = [
    ("/scan", LaserScan(ranges=[1.5, math.nan, math.inf]), "ranges", [1.5, None, None],
     typed("Float32Array", 1.5, None, None)),
    ("/map", OccupancyGrid(data=[-1, 0, 100]), "data", [-1, 0, 100], typed("Int8Array", -1, 0, 100)),
    ("/joints", JointState(name=["ä", "b"], position=[0.1]), "name", ["ä", "b"], ["ä", "b"]),
    ("/picture", CompressedImage(data=b"\x00\xff\x10"), "data", "AP8Q", typed("Uint8Array", 0, 255, 16)),
    ("/long", Int64MultiArray(data=[-5, 2**40]), "data", [-5, 2**40], None),
]  # fmt: skip
#: Which version of roslib makes numbers of it, and which one keeps all digits.
LONG_IN_CBOR = {"1": [-5, 2**40], "2": typed("BigInt64Array", "-5", str(2**40))}


@VERSIONS
def test_lists_in_json_and_cbor(
    version: str, gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """Typed arrays in CBOR, of fixed length too; in JSON null for what is no number, base64 for bytes."""
    ros = make_node("robot")
    for topic, message, *_ in MESSAGES:
        ros.publisher(type(message), topic, Qos.LATCHED).publish(message)
    ros.publisher(PoseWithCovarianceStamped, "/amcl_pose", Qos.LATCHED).publish(POSE)
    url = gateway()
    in_json, in_cbor = page(url, ros, version=version), page(url, ros, version=version)
    for one, options in ((in_json, {}), (in_cbor, {"compression": "cbor"})):
        for topic, message, *_ in MESSAGES:
            kind = type(message)
            one.subscribe(topic, f"{kind.__module__.split('.')[0]}/{kind.__name__}", **options)
        one.subscribe("/amcl_pose", "geometry_msgs/PoseWithCovarianceStamped", **options)
    for topic, _, field, json_value, cbor_value in MESSAGES:
        for one, expected in ((in_json, json_value), (in_cbor, cbor_value)):
            got = one.until(lambda o=one, t=topic: o.messages(t), topic)[0][field]
            assert got == (expected or LONG_IN_CBOR[version])
    covariance = [float(number) for number in range(36)]
    for one, expected in ((in_json, covariance), (in_cbor, typed("Float64Array", *covariance))):
        got = one.until(lambda o=one: o.messages("/amcl_pose"), "the pose")[0]["pose"]["covariance"]
        assert got == expected


@VERSIONS
def test_the_serialized_message_in_cbor(
    version: str, gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """`cbor-raw` has the bytes that DDS sent, and when it did."""
    ros = make_node("robot")
    sent = OccupancyGrid(header=Header(frame_id="map"), data=array.array("b", range(-100, 100)))
    ros.publisher(OccupancyGrid, "/map", Qos.LATCHED).publish(sent)
    one = page(gateway(), ros, version=version)
    one.subscribe("/map", "nav_msgs/OccupancyGrid", compression="cbor-raw")
    got = one.until(lambda: one.messages("/map"), "the map")[0]
    assert deserialize_message(bytes(got["bytes"]["values"]), OccupancyGrid) == sent
    assert abs(got["secs"] - ros.now()) < 30
    assert 0 <= got["nsecs"] < 1_000_000_000


@VERSIONS
def test_bytes_and_nulls_are_taken_as_they_are_given(
    version: str, gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """Base64 or a list for bytes, null for NaN; arrays of fixed length."""
    ros = make_node("robot")
    pictures: list[CompressedImage] = []
    scans: list[LaserScan] = []
    poses: list[PoseWithCovarianceStamped] = []
    ros.subscribe(CompressedImage, "/picture", Qos.EVENT, pictures.append)
    ros.subscribe(LaserScan, "/scan", Qos.EVENT, scans.append)
    ros.subscribe(PoseWithCovarianceStamped, "/pose", Qos.EVENT, poses.append)
    one = page(gateway(), ros, version=version)
    for data in ("AP8Q", [0, 255, 16]):
        one.publish("/picture", "sensor_msgs/CompressedImage", {"data": data})
    one.publish("/scan", "sensor_msgs/LaserScan", {"ranges": [1.5, None], "range_max": None})
    pose = {"pose": {"covariance": list(range(36))}}
    one.publish("/pose", "geometry_msgs/PoseWithCovarianceStamped", pose)
    one.until(lambda: len(pictures) == 2 and scans and poses, "all of them")
    assert [bytes(picture.data) for picture in pictures] == [b"\x00\xff\x10"] * 2
    assert struct.pack("<ff", *scans[0].ranges)[:4] == struct.pack("<f", 1.5)
    assert math.isnan(scans[0].ranges[1])
    assert math.isnan(scans[0].range_max)
    assert list(poses[0].pose.covariance) == list(range(36))
    one.publish("/picture", "sensor_msgs/CompressedImage", {"data": "not base64!", "formt": "x"})
    one.told(
        "/picture: data: a list of bytes is base64, or a list of numbers from 0 to 255; "
        "formt: sensor_msgs/msg/CompressedImage has no such field; did you mean 'format'?"
    )
