"""The catalog of the gateway's node and its parameters; it offers nothing to missions."""

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
