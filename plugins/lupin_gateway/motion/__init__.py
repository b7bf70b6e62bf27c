"""Decides whether pages may move the robot: not under a stop, and not while a mission has the base.

Level-triggered: it is asked for each operation, and refused ones are not kept. A page may take the base of a
mission that is held, or whose orchestrator is silent for `SILENCE_S`. Pure: times are of a steady clock.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Literal, TypedDict

from lupin_gateway.motion.names import absolute, any_of

#: The service by which a page takes the base of a mission that is held, and the topic with who has it.
TAKE_BASE, BASE_TOPIC = "/lupin/hmi/take_base", "/lupin/hmi/base"
#: What is said of motion that is refused under a stop: the orchestrator says the same of a resume.
STOPPED = "refused: e-stop engaged"
#: Seconds after which an orchestrator that says nothing counts as gone.
SILENCE_S = 3.0


@dataclass(frozen=True)
class MissionLevel:
    """The orchestrator's published state: lifecycle, and whether a mission is active, held or stopped."""

    lifecycle: str = ""
    under_way: bool = False
    held: bool = False
    stopped: bool = False


class BaseRecord(TypedDict):
    """Who may move the robot: the page that has taken the base, and why no page may.

    `stops` are the sources that hold it: `robot`, `pages`, `hmi`.
    """

    taken_by: str
    hindrance: Annotated[str, Literal["", "stop", "mission", "held"]]
    reason: str
    stops: list[str]


class MotionGate:
    """Who may move the robot now.

    `hindrance` is why no page may: `stop`, `mission` (it has the base), `held` (a mission has the base, and a
    page may take it); '' where any page with the role may.
    """

    def __init__(self, commands: Iterable[str] = ()) -> None:
        """`commands` are the orchestrator's services: calling one gives back a taken base first."""
        self._commands = any_of(commands)
        self._stops: tuple[str, ...] = ()
        self._mission = MissionLevel()
        self._heard = 0.0
        self.hindrance = ""
        #: The page that has taken the base, by the name of its connection.
        self.taken_by = ""
        self._reason = ""

    def hear_stops(self, sources: Iterable[str]) -> None:
        """Take the names of the engaged sources of the stop."""
        self._stops = tuple(sources)

    def hear_mission(self, mission: MissionLevel, now: float) -> None:
        """Take the orchestrator's published state."""
        self._mission, self._heard = mission, now

    def is_silent(self, now: float) -> bool:
        """Return whether the orchestrator is not heard."""
        return now - self._heard > SILENCE_S

    def settle(self, stopped_by_pages: bool, now: float) -> bool:
        """Re-evaluate; return whether motion was allowed before and is not any more."""
        could_move = self._can_move
        self.hindrance, self._reason = self._look(stopped_by_pages, now)
        if self.hindrance != "held":
            self.taken_by = ""
        return could_move and not self._can_move

    @property
    def _can_move(self) -> bool:
        return not self.hindrance or bool(self.taken_by)

    def _look(self, stopped_by_pages: bool, now: float) -> tuple[str, str]:
        mission = self._mission
        is_silent = self.is_silent(now)
        if stopped_by_pages or self._stops or (mission.stopped and not is_silent):
            by = f" ({', '.join(self._stops)})" if self._stops else ""
            return "stop", f"e-stop engaged{by}: release it, then ask again"
        if not mission.under_way:
            return "", ""
        if is_silent:
            return "held", f"a mission's orchestrator is silent ({mission.lifecycle}): take the base first"
        if mission.held:
            return "held", f"a mission is held ({mission.lifecycle}): take the base first"
        return "mission", f"a mission has the base ({mission.lifecycle}): pause it first"

    def refusal(self, page: str) -> str:
        """Return why a page may not move the robot; '' where it may."""
        if self.taken_by:
            return "" if self.taken_by == page else f"{self.taken_by} has the base"
        return self._reason

    def take(self, page: str) -> str:
        """Give a page the base of a mission that is held; return why not, '' where that is done."""
        if not self.hindrance:
            return "no mission is under way: there is nobody to take the base from"
        if self.hindrance != "held":
            return self._reason
        if self.taken_by not in ("", page):
            return f"{self.taken_by} has the base"
        self.taken_by = page
        return ""

    def is_command(self, service: str) -> bool:
        """Return whether a service commands the mission."""
        return bool(self._commands.fullmatch(absolute(service)))

    def state(self) -> BaseRecord:
        """Return the state for pages; `stops` are the engaged sources."""
        return {
            "taken_by": self.taken_by,
            "hindrance": self.hindrance,
            "reason": self._reason,
            "stops": list(self._stops),
        }
