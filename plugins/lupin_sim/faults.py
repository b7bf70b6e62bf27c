"""Fault injection: the active fault, and how many goals it still hits."""

from __future__ import annotations

import enum


class InjectedFault(enum.Enum):
    """The ways to fail."""

    NONE = "none"
    REJECT = "reject"  #: goals are rejected
    ABORT = "abort"  #: goals are aborted, the running one too
    STALL = "stall"  #: the robot stands still and keeps its goal
    REFUSE_CANCEL = "refuse_cancel"  #: cancels are refused, the robot drives to its goal
    LOSE_LOCALIZATION = "lose_localization"  #: the pose stands still, its variance grows


class Faults:
    """The active fault.

    With a count of 0 it lasts until it is changed. With a count it hits that many goals, a running one
    included, and its effect ends with the goal.
    """

    def __init__(self) -> None:
        self._kind = InjectedFault.NONE
        self._left = 0
        self._of_goal = InjectedFault.NONE

    @property
    def kind(self) -> InjectedFault:
        """The fault that hits the next goal."""
        return self._kind

    def now(self, fault: InjectedFault) -> bool:
        """Return whether the robot, or its running goal, suffers `fault` now.

        A counted fault acts only through a running goal; lost localization needs none.
        """
        return self._of_goal is fault or (fault is InjectedFault.LOSE_LOCALIZATION and self._kind is fault)

    def set(self, kind: InjectedFault, count: int, goal_running: bool) -> None:
        """Replace the fault; a running goal is hit at once, except by `REJECT`."""
        self._kind, self._left = kind, count
        self._of_goal = InjectedFault.NONE
        if goal_running and kind is not InjectedFault.REJECT:
            self.take()

    def take(self) -> InjectedFault:
        """Return the fault of a new goal, and count the goal."""
        self._of_goal = self._kind
        if self._left > 0:
            self._left -= 1
            if self._left == 0:
                self._kind = InjectedFault.NONE
        return self._of_goal

    def goal_ended(self) -> None:
        """End the effect on the goal."""
        self._of_goal = InjectedFault.NONE
