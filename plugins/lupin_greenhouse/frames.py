"""A small tf2: a tree of transforms with their last 10 s, and the pose of one frame in another. Pure.

ROS 2 has no tf2 wheel for Python. As tf2 does for time 0, a lookup uses the latest moment at which every
transform on the way is known; between two transforms it interpolates, and it never extrapolates. Stamps are
of the publishers' clock, arrival times (`heard`) of the caller's. Beyond 2,000 frames new ones are refused.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lupin_greenhouse.poses import Pose, between, pose_of

#: Seconds for which moving frames are remembered.
HISTORY_S = 10.0
#: Frames that are remembered: a robot has some dozens, a greenhouse has hundreds of tags.
MAX_FRAMES = 2000


@dataclass
class _Track:
    """The poses of one frame in its parent, oldest first. A static frame has one, valid for every moment."""

    parent: str
    static: bool
    heard: float = -math.inf
    moments: list[float] = field(default_factory=list)
    poses: list[Pose] = field(default_factory=list)

    def add(self, pose: Pose, moment: float, heard: float) -> None:
        if self.moments and moment <= self.moments[-1]:
            if moment > self.moments[-1] - HISTORY_S:
                return  # overtaken on the way
            self.moments.clear()  # the clock was set back: what is known is of another time
            self.poses.clear()
        self.heard = heard
        self.moments.append(moment)
        self.poses.append(pose)
        too_old = bisect_right(self.moments, moment - HISTORY_S)
        del self.moments[:too_old], self.poses[:too_old]

    def at(self, moment: float) -> Pose:
        """Return the interpolated pose; the moment must be between the oldest and the latest."""
        after = bisect_right(self.moments, moment)
        if self.static or after == len(self.moments):
            return self.poses[-1]
        begin, end = self.moments[after - 1], self.moments[after]
        return between(self.poses[after - 1], self.poses[after], (moment - begin) / (end - begin))


class Frames:
    """The transforms of the last seconds, as a tree of frames."""

    def __init__(self) -> None:
        """Begin empty."""
        self._tracks: dict[str, _Track] = {}
        #: Tracks of frames in another parent than the latest one: a tag that two cameras see.
        self._resting: dict[tuple[str, str], _Track] = {}

    def add(
        self, parent: str, child: str, pose: Pose, moment: float, *, static: bool = False, heard: float = 0.0
    ) -> bool:
        """Add the pose of `child` in `parent`, arrived at `heard`; return False where it is full."""
        child, parent = frame_name(child), frame_name(parent)
        track = self._tracks.get(child)
        if track is None and len(self._tracks) >= MAX_FRAMES:
            return False
        if track is None or track.static or static:
            track = _Track(parent, static)
        elif track.parent != parent:
            track = self._exchanged(child, track, parent)
        self._tracks[child] = track
        track.add(pose, moment, heard)
        return True

    def _exchanged(self, child: str, track: _Track, parent: str) -> _Track:
        """Store a track whose frame has changed its parent; return the one stored for that parent."""
        if len(self._resting) >= MAX_FRAMES:
            self._resting.clear()
        self._resting[child, track.parent] = track
        return self._resting.pop((child, parent), None) or _Track(parent, static=False)

    def take(self, transforms: Iterable[Any], *, static: bool = False, heard: float = 0.0) -> list[str]:
        """Add the transforms of a TFMessage; return the problems of those left out, once for each kind."""
        problems = dict.fromkeys(self._take(stamped, static, heard) for stamped in transforms)
        return [problem for problem in problems if problem]

    def _take(self, stamped: Any, static: bool, heard: float) -> str:
        shift, turn, stamp = stamped.transform.translation, stamped.transform.rotation, stamped.header.stamp
        pose = pose_of((shift.x, shift.y, shift.z), (turn.x, turn.y, turn.z, turn.w))
        if pose is None:
            return "a transform without a finite place and rotation left out"
        moment = stamp.sec + stamp.nanosec * 1e-9
        parent, child = stamped.header.frame_id, stamped.child_frame_id
        if not self.add(parent, child, pose, moment, static=static, heard=heard):
            return f"more than {MAX_FRAMES} frames; further ones left out"
        return ""

    def find(self, target: str, source: str, since: float = -math.inf) -> Pose | None:
        """Return the latest pose of frame `source` in frame `target`; None when it is not known.

        All transforms are taken at one moment, the latest for which every frame on the way is known: a tag
        that was seen a second ago is placed by the camera's pose then, not now. A moving frame whose last
        transform arrived before `since` counts as unknown.
        """
        frames = self._chain(frame_name(target), frame_name(source))
        if frames is None:
            return None
        tracks = [self._tracks[frame] for frame in frames]
        moving = [track for track in tracks if not track.static]
        if any(self._is_silent(frame, since) for frame in frames):
            return None
        moment = min((track.moments[-1] for track in moving), default=math.inf)
        if any(track.moments[0] > moment for track in moving):
            return None
        pose = Pose(np.zeros(3), np.array((0.0, 0.0, 0.0, 1.0)))
        for track in tracks:
            pose = track.at(moment) @ pose
        return pose

    def gap(self, target: str, source: str, since: float = -math.inf) -> str:
        """Return why `find` found nothing: a frame is unconnected or silent, or times do not overlap."""
        target, source = frame_name(target), frame_name(source)
        frames = self._chain(target, source)
        if frames is None:
            return f"no transform leads from {source} to {target}: nothing says where {self._top(source)} is"
        silent = [frame for frame in frames if self._is_silent(frame, since)]
        if silent:
            return f"the transforms of {', '.join(silent)} have ceased"
        moving = {frame: self._tracks[frame].moments for frame in frames if not self._tracks[frame].static}
        ended = min(moving, key=lambda frame: moving[frame][-1])
        begun = max(moving, key=lambda frame: moving[frame][0])
        return (
            f"no moment has all transforms from {source} to {target}: those of {ended} end"
            f" {moving[begun][0] - moving[ended][-1]:.1f} s before those of {begun} begin,"
            " so one has ceased, or two clocks disagree"
        )

    def _is_silent(self, frame: str, since: float) -> bool:
        track = self._tracks[frame]
        return not track.static and track.heard < since

    def _top(self, frame: str) -> str:
        """Return the root above a frame, or a frame of the cycle that it is in."""
        passed = set[str]()
        while frame in self._tracks and frame not in passed:
            passed.add(frame)
            frame = self._tracks[frame].parent
        return frame

    def _chain(self, target: str, source: str) -> Iterable[str] | None:
        """Return the frames from `source` up to below `target`; None where no transforms lead there."""
        chain: dict[str, None] = {}
        frame = source
        while frame != target:
            if frame not in self._tracks or frame in chain:
                return None  # a tree that goes in circles has no top
            chain[frame] = None
            frame = self._tracks[frame].parent
        return chain


def frame_name(frame: str) -> str:
    """Return a frame's name without the leading slash that some publishers still add."""
    return frame.lstrip("/")
