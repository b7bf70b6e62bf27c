"""Plays a sequence: sends the arm's whole trajectory at once, and the jaw's events by timers.

A stop, a lost arm, or the end of the process stops both.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from lupin_arm.library import NotInLibrary, Sequence
from lupin_arm.node.arm import Arm
from lupin_arm.node.serving import ArmRequestRefused
from lupin_arm.node.torque import Done
from lupin_arm.player import JawEvent, Replay, plan
from lupin_ros.adapter import RosNode, RosTimer

#: The name under which sequences move the arm.
OWNER = "library: playing"


@dataclass(eq=False)
class _Playing:
    """A sequence that waits for torque, or is played."""

    name: str
    sequence: Sequence
    speed: float
    answer: Done
    replay: Replay | None = None
    began: float = 0.0
    jaw: deque[JawEvent] = field(default_factory=deque)
    timers: list[RosTimer] = field(default_factory=list)


class Player:
    """Plays at most one sequence at a time, and claims the arm for it."""

    def __init__(self, ros: RosNode, arm: Arm) -> None:
        self._ros = ros
        self._arm = arm
        self._now: _Playing | None = None
        ros.on_stop(self._close)

    @property
    def name(self) -> str:
        """The sequence that is played; '' when none is."""
        return self._now.name if self._now else ""

    @property
    def sequence(self) -> Sequence | None:
        """The sequence that is played; None: none is."""
        return self._now.sequence if self._now else None

    @property
    def elapsed(self) -> float:
        """Seconds since the trajectory was sent."""
        started = self._now is not None and self._now.replay is not None
        return self._ros.elapsed() - self._now.began if self._now is not None and started else 0.0

    @property
    def duration(self) -> float:
        """Its duration in seconds; 0 before that is known."""
        return self._now.replay.duration if self._now is not None and self._now.replay is not None else 0.0

    def play(self, name: str, sequence: Sequence, speed: float, answer: Done) -> None:
        """Play a sequence; `answer` is called when the trajectory was sent, or with the reason why not.

        Raises:
            ArmRequestRefused: it cannot be played now; `answer` is not called.
        """
        self._arm.claim(OWNER, f"playing {name!r}", self._interrupted)
        self._now = playing = _Playing(name, sequence, speed, answer)
        try:
            if_on(self._arm, OWNER, lambda problem: self._begin(playing, problem))
        except ArmRequestRefused:
            self._end()
            raise

    def _begin(self, playing: _Playing, problem: str | None) -> None:
        """Send the trajectory, now that the torque is confirmed."""
        if self._now is not playing:
            return  # stopped meanwhile; it has been answered
        if problem is None:
            problem = self._send(playing)
        if problem is not None:
            self._end()
        playing.answer(problem)

    def _send(self, playing: _Playing) -> str | None:
        """Send a sequence as a trajectory; return why that is refused, None where it is played."""
        try:
            replay = plan(playing.sequence, playing.speed, self._arm.here(OWNER))
            self._arm.send(replay.trajectory, OWNER)
        except (ArmRequestRefused, NotInLibrary) as reason:
            return str(reason)
        playing.replay, playing.began = replay, self._ros.elapsed()
        playing.timers, playing.jaw = [self._ros.call_later(replay.duration, self._end)], deque(replay.jaw)
        self._next_jaw(playing)
        return None

    def _next_jaw(self, playing: _Playing) -> None:
        """Wait for the jaw's next event; one timer at a time, since a recording has hundreds."""
        if playing.jaw:
            event = playing.jaw.popleft()
            delay = playing.began + event.time - self._ros.elapsed()
            timer = self._ros.call_later(delay, lambda: self._move_jaw(playing, event.angle))
            playing.timers = [playing.timers[0], timer]

    def _move_jaw(self, playing: _Playing, angle: float) -> None:
        try:
            self._arm.move_jaw(angle, OWNER)
        except ArmRequestRefused as reason:
            self._ros.log.warning(f"jaw not moved: {reason}", sequence=playing.name)
        self._next_jaw(playing)

    def stop(self, reason: str) -> bool:
        """Stop the arm and end the sequence; return whether one was played."""
        playing = self._now
        if playing is None:
            return False
        self._end()
        if playing.replay is None:
            playing.answer(reason)
        else:
            self._arm.hold()
        self._ros.log.info("replay stopped", sequence=playing.name, reason=reason)
        return True

    def _interrupted(self, reason: str) -> None:
        self.stop(reason)

    def _close(self) -> None:
        """Stop at the end of the process: the controller has the whole trajectory and would execute it."""
        self.stop("the program ends")

    def _end(self) -> None:
        playing, self._now = self._now, None
        self._arm.release(OWNER)
        for timer in playing.timers if playing else ():
            timer.cancel()


def if_on(arm: Arm, owner: str, then: Done) -> None:
    """Call `then(None)` once the servos are on, or `then(reason)` where they cannot be switched on.

    They are switched on only while their state is unknown; servos that a user has switched off stay off.

    Raises:
        ArmRequestRefused: the arm may not be moved; `then` is not called.
    """
    reason = arm.refusal(owner)
    if reason is not None:
        raise ArmRequestRefused(reason)
    if arm.torque:
        then(None)
        return
    stops = arm.stops

    def on(problem: str | None) -> None:
        then(problem or ("the robot was stopped meanwhile" if arm.stops != stops else None))

    arm.set_torque(True, owner, on)
