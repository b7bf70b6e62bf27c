"""Decides from the orchestrator's published state whether a mission is active, and after how much silence
the orchestrator counts as gone."""

from __future__ import annotations

from lupin_engine.plugin import Stages

#: The published states of missions/lifecycle.yaml that are not the missions' own.
STAGES = Stages(
    starting=("BOOT",), ready=("READY",), returning=("RETURNING",), ended=("DONE",), faulted=("FAULT",)
)

#: Published states in which no mission is under way; '' before anything was heard. RETURNING is none of them:
#: there the robot still drives for its mission.
_WITHOUT_MISSION = STAGES.without_mission | {""}

#: Seconds after which an orchestrator that says nothing counts as gone; it speaks five times a second.
SILENCE_S = 3.0


def is_under_way(lifecycle_state: str) -> bool:
    """Return whether a mission is active in a published lifecycle state.

    States without a mission are listed, not the others: a state of a mission unknown here must count as
    active.
    """
    return lifecycle_state not in _WITHOUT_MISSION
