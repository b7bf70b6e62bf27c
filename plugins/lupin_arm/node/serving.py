"""What the arm's services have in common."""

from __future__ import annotations

from typing import Any

#: Seconds after which a request is not carried out: a link is back, and nobody looks at the arm any more.
STALE_AFTER_S = 2.0


def refuse(response: Any, reason: str) -> Any:
    """Answer a request that is not carried out, of a service that answers success and message."""
    response.success = False
    response.message = reason
    return response
