"""What the gateway offers: a node, and nothing for missions."""

from __future__ import annotations

from lupin_engine.plugin import Plugin

PLUGIN = Plugin(
    name="gateway",
    doc="The gateway: pages in a browser speak the rosbridge protocol with the robot.",
    nodes={"lupin_gateway": "lupin_gateway.node:main"},
    hmi=True,
    publishes=("/lupin/hmi/estop", "/lupin/gateway/stop"),
    pages="lupin_gateway.virtual:serve_pages",
)
