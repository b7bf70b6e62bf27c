"""Names on the network that the orchestrator and whoever operates it must agree on; loads without ROS."""

from __future__ import annotations

#: The orchestrator's node.
NODE = "mission_orchestrator"

#: MissionState; Observation; every step as JSON.
STATE_TOPIC = "/mission/state"
OBSERVATIONS_TOPIC = "/floranova/observations"
STEPS_TOPIC = f"/{NODE}/steps"

#: StartMission.
START_SERVICE = "/mission/start"


def request_service(request: str) -> str:
    """Return the service (Trigger) of an operator's request, such as `abort`."""
    return f"/mission/{request}"
