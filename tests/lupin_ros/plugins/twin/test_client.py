"""What missions get to know of the digital twin, over real DDS."""

from __future__ import annotations

from collections.abc import Callable

from lupin_engine.plugin.types import Notation, problems
from lupin_msgs.msg import SensorReading, TwinState, TwinTagState
from lupin_ros.adapter.node import Qos, RosNode
from lupin_twin.catalog import PLUGIN
from lupin_twin.client import TwinClient
from tests.lupin_ros.helpers import spin_until
from tests.plugins.fakes import FakeOutlet, defaults


def test_over_the_wire_the_twin_is_a_live_value(make_node: Callable[..., RosNode]) -> None:
    """Of the type that its catalog declares, as of its stamp, also for who comes later."""
    twin, ours, outlet = make_node("twin"), make_node("ours"), FakeOutlet()
    publisher = twin.publisher(TwinState, "/twin/state", Qos.LATCHED)
    dry = TwinTagState(
        tag_id="7",
        stale_seconds=60.5,
        species="tulip",
        species_confidence=0.75,
        readings=[SensorReading(name="soil_moisture", value=0.1)],
    )
    message = TwinState(tags=[dry, TwinTagState(tag_id="8", stale_seconds=1e9, anomaly=True)])
    message.header.stamp.sec = 100
    publisher.publish(message)
    client = TwinClient(ours, outlet, defaults(PLUGIN))
    spin_until([twin, ours], lambda: bool(outlet.values))
    name, told, stamp = outlet.values[0]
    assert (name, stamp, client.missing()) == ("twin.tags", 100.0, [])
    assert problems(told, PLUGIN.values[name].type, Notation.DATA) == []
    assert told == [
        {
            "id": "7",
            "age": 60.5,
            "species": "tulip",
            "species_confidence": 0.75,
            "anomaly": False,
            "readings": [{"name": "soil_moisture", "value": 0.1}],
        },
        {
            "id": "8",
            "age": 1e9,
            "species": "",
            "species_confidence": 0.0,
            "anomaly": True,
            "readings": [],
        },
    ]
    client.close()
    publisher.publish(message)
    received = len(outlet.values)
    other = FakeOutlet()
    TwinClient(ours, other, defaults(PLUGIN))
    spin_until([twin, ours], lambda: bool(other.values))
    assert len(outlet.values) == received, "a client that is closed tells nothing"
