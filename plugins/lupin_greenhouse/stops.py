"""The emergency stop as a fold over its sources: the robot is stopped while any source is engaged.

Each source has a topic of its own, because a message does not name its writer. Several writers of a topic
are one source: a false counts only if no other writer can have published the true that it would release.
Pure: times are arguments, in seconds of one steady clock.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

#: The sources: the robot's own (its button, its bridge), the pages of our gateway, and other HMIs.
ROBOT, PAGES, HMI = "robot", "pages", "hmi"
#: The topic of the gateway's pages, of which the gateway is the only writer, and the one that all HMIs share.
PAGES_TOPIC, HMI_TOPIC = "/lupin/gateway/stop", "/lupin/hmi/estop"
#: Seconds without a true after which a stop that several may have published is over.
QUIET_S = 2.0
#: The same for a source that stays engaged when its writer dies: the middleware remembers a dead writer for
#: up to 20 s, and only of writers that all live silence is a release.
LIVING_S = 25.0
#: Parts of its timeout within which a source speaks again that is steady, and after which it is steady.
GAP, ROW = 0.375, 1.75


@dataclass(frozen=True)
class StopRule:
    """How one source is released, in seconds.

    `forgotten_after`: it is released by so long without a true. `others_after`: after so long without a true
    a false of any writer releases it. `silent_after`: its silence, once it was periodic, engages it; 0:
    never.
    """

    forgotten_after: float = math.inf
    others_after: float = math.inf
    silent_after: float = 0.0


@dataclass(frozen=True)
class StopState:
    """The names of the engaged sources, and which of these are engaged because they are silent."""

    sources: tuple[str, ...] = ()
    silent: tuple[str, ...] = ()

    @property
    def engaged(self) -> bool:
        """Whether the robot is stopped."""
        return bool(self.sources)


@dataclass
class _Source:
    rule: StopRule
    engaged: bool = False
    silent: bool = False
    last_true: float = -math.inf
    #: Who may have published the last true.
    writers: frozenset[str] = field(default_factory=frozenset)
    last_heard: float = -math.inf
    #: Since when it speaks without a gap.
    row_since: float = -math.inf

    @property
    def steady(self) -> bool:
        return self.last_heard - self.row_since >= ROW * self.rule.silent_after

    def hear(self, engaged: bool, writers: frozenset[str], now: float) -> None:
        if now - self.last_heard > GAP * self.rule.silent_after:
            self.row_since = now
        self.last_heard, self.silent = now, False
        if engaged:
            self.engaged, self.last_true, self.writers = True, now, writers
        elif self._releases(writers, now):
            self.engaged = False

    def _releases(self, writers: frozenset[str], now: float) -> bool:
        """Return whether a false counts: it is of the last true's writer, or that was long enough ago."""
        quiet = now - self.last_true
        if quiet >= self.rule.others_after:
            return True
        if writers == self.writers and len(writers) == 1:
            return True
        # A gateway that was started again is one of two for a while, of which the dead one then goes.
        return bool(writers) and writers <= self.writers and quiet >= LIVING_S

    def look(self, now: float) -> None:
        if now - self.last_true >= self.rule.forgotten_after:
            self.engaged = False
        if self.waits_for_silence and now - self.last_heard >= self.rule.silent_after:
            self.silent, self.row_since = self.steady, math.inf

    @property
    def waits_for_silence(self) -> bool:
        return self.rule.silent_after > 0.0 and math.isfinite(self.row_since)


class StopFold:
    """Keeps the state of each source; a message of one never changes another's."""

    def __init__(self, rules: Mapping[str, StopRule]) -> None:
        self._sources = {name: _Source(rule) for name, rule in rules.items()}

    @property
    def state(self) -> StopState:
        """The engaged sources."""
        held = {name: one for name, one in self._sources.items() if one.engaged or one.silent}
        return StopState(tuple(held), tuple(name for name, one in held.items() if one.silent))

    @property
    def waits(self) -> bool:
        """Whether time alone may change the state, so that `look` must be called."""
        return any(one.engaged or one.waits_for_silence for one in self._sources.values())

    def heard(self, source: str, engaged: bool, writers: frozenset[str], now: float) -> None:
        """Take a message of a source; `writers` are the identities of all current publishers of its topic."""
        self._sources[source].hear(engaged, writers, now)

    def look(self, now: float) -> None:
        """Apply the timeouts."""
        for one in self._sources.values():
            one.look(now)


def rules(robot_silent_after: float | None) -> Mapping[str, StopRule]:
    """Return the rule of each source; None: no source for the robot's own, whose publisher must not hear it.

    The robot's own false is believed: its button is sampled, not remembered. The stop of pages outlives its
    gateway, and a gateway that has lost it does not release it. Other HMIs repeat their state every 500 ms,
    so one that is silent is not stopped.
    """
    own = {} if robot_silent_after is None else {ROBOT: StopRule(math.inf, QUIET_S, robot_silent_after)}
    return {**own, PAGES: StopRule(), HMI: StopRule(QUIET_S, QUIET_S)}
