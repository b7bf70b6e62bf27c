"""What several plugins know of missions, out of what the orchestrator publishes about them."""

from __future__ import annotations

#: The published lifecycle states in which a mission is under way.
UNDER_WAY = frozenset({"PREPARE", "EXPLORING", "INSPECTING", "MONITORING", "RETURNING"})

#: Seconds after which an orchestrator that says nothing counts as gone; it speaks five times a second.
SILENCE_S = 3.0
