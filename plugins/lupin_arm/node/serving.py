"""What the services of the arm share: the refusal of a request, and when a request is too old."""

from __future__ import annotations

from typing import Any

#: Seconds after which a request is not carried out: a link is back, and nobody looks at the arm any more.
STALE_AFTER_S = 2.0


class ArmRequestRefused(Exception):
    """A request that is not carried out, and nothing has changed; the text is the answer to the caller."""


def refuse(response: Any, reason: str) -> Any:
    """Answer a request that is not carried out, of a service that answers success and message."""
    response.success = False
    response.message = reason
    return response
