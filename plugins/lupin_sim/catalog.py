"""The catalog of the simulated robot: a node, and nothing for missions, which use plugin `nav`."""

from __future__ import annotations

from lupin_engine.plugin import Plugin

PLUGIN = Plugin(
    name="robot_sim",
    doc="A simulated robot: navigation, localization, cameras, battery, emergency stop, faults on request.",
    nodes={"lupin_sim": "lupin_sim.node:main"},
    composable=("lupin_sim",),
    stands_in={"lupin_sim": ("navigate_to_pose",)},
    # The simulated bridge answers at once: without a stay nobody would have looked at the flowers.
    simulated_defaults={"flower_scan_dwell_s": 0.5},
    profile="greenhouse",
)
