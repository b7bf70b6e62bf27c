"""How all tests run: how long an example of theirs takes says more of the machine than of the code."""

from __future__ import annotations

from hypothesis import HealthCheck, settings

AS_FOUND = settings()
settings.register_profile(
    "any machine",
    AS_FOUND,
    deadline=None,
    suppress_health_check=[*AS_FOUND.suppress_health_check, HealthCheck.too_slow],
)
settings.load_profile("any machine")
