"""How property tests run: the same few examples each time, however long one takes on this machine.

So a failure can be repeated, and comes with the change that causes it. `--hypothesis-profile=search` looks
for others, at random and for long.
"""

from __future__ import annotations

from hypothesis import HealthCheck, settings

_SLOW = {"deadline": None, "suppress_health_check": [*settings().suppress_health_check, HealthCheck.too_slow]}
settings.register_profile("suite", **_SLOW, max_examples=40, derandomize=True)
settings.register_profile("search", **_SLOW, max_examples=2_000, derandomize=False)
settings.load_profile("suite")
