"""Maps the status of a failed Nav2 goal to an error code and detail."""

from __future__ import annotations

from typing import Any

SUCCEEDED = 4
CANCELED = 5
ABORTED = 6

#: `action_msgs/GoalStatus` by its own names; 5 and 6 were once mistaken for each other in every log.
NAMES = ("UNKNOWN", "ACCEPTED", "EXECUTING", "CANCELING", "SUCCEEDED", "CANCELED", "ABORTED")


def failure(status: int, result: Any) -> tuple[str, str]:
    """Return code and detail of a goal that ended in `status` without success, and that we did not cancel.

    CANCELED and ABORTED have codes of their own; all others are `nav_status_0`, with the status in the
    detail: UNKNOWN from a server that has lost the goal, or a status in which no goal can end.
    """
    name = NAMES[status] if 0 <= status < len(NAMES) else f"status {status}"
    code = f"nav_status_{status}" if status in (CANCELED, ABORTED) else "nav_status_0"
    return code, name + _error(result)


def _error(result: Any) -> str:
    """Return Nav2's own error text; older servers send no such fields."""
    number, text = getattr(result, "error_code", 0), getattr(result, "error_msg", "")
    return (f", error {number}" if number else "") + (f": {text}" if text else "")
