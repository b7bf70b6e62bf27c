"""Shared by the arm's services: the refusal of a request, and the age limit of requests."""

from __future__ import annotations

from typing import Any

#: Seconds after which a request is not carried out: a link is back, and nobody looks at the arm any more.
STALE_AFTER_S = 2.0


class ArmRequestRefused(Exception):
    """A refused request that has changed nothing; the text is the answer to the caller."""


def refuse(response: Any, reason: str) -> Any:
    """Fill in a refusal, for services that answer success and message."""
    response.success = False
    response.message = reason
    return response
