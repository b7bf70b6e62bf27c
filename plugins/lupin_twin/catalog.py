"""What the digital twin offers: a node that listens, and nothing to missions."""

from __future__ import annotations

from lupin_engine.plugin.contract import Plugin

PLUGIN = Plugin(
    name="twin",
    doc="The digital twin: the latest of every tag, kept through restarts, and sensor fields between them.",
    nodes={"lupin_twin": "lupin_twin.node:main"},
    companions=("lupin_twin",),
    profile="greenhouse",
)
