"""What must hold after a run with faults; pure."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from tests.faults.plan import Plan

OK = 0
#: Seconds until the robot stands when its orchestrator is not heard, by `docs/safety.md`; and what processes
#: that share two cores with others are kept waiting, beside what the witness saw of it.
BOUND_S, BUSY_S = 2.25, 1.0
#: The same when a stop is told.
STOP_S = 0.05
#: A robot that read a tag had been so near to it, in metres.
NEAR_M = 1.6
#: Where a simulated robot is that was started again, after as many seconds without a word at least: no drive.
START, SILENT_S = [0.5, 0.5], 0.3


#: What a tag is read for when it is seen in a search, beside the visit later on.
_SEEN = " when seen"


def name_of(tag: str, source: str) -> str:
    """Name the reading of a tag by what it was made for: in a search there are two."""
    return f"{tag}{_SEEN}" if source == "ExplorationMission" else tag


@dataclass(frozen=True)
class Lost:
    """A time, of the monotonic clock, in which nobody may drive the robot; `end` is infinite meanwhile.

    `bound` is after how many seconds it stands. A goal that a stranger sends meanwhile is carried out, unless
    it is a stop that holds the robot.
    """

    why: str
    begin: float
    end: float = math.inf
    bound: float = BOUND_S
    by_stop: bool = False


@dataclass(frozen=True)
class Outcome:
    """What was told of a target: the status, and the stamp that makes an observation the same one."""

    tag: str
    status: int
    stamp: tuple[int, int]


@dataclass
class Seen:
    """What was seen of a run."""

    #: How it ended: `DONE`, `held: REASON`, `FAULT: REASON`, or anything else, which is wrong.
    end: str = ""
    outcomes: set[Outcome] = field(default_factory=set)
    #: The targets that the twin has rows of, with this mission's id; once for each row.
    rows: list[str] = field(default_factory=list)
    lost: list[Lost] = field(default_factory=list)
    #: (seconds, x, y), and the seconds at which the witness was let work.
    track: list[tuple[float, float, float]] = field(default_factory=list)
    pulses: list[float] = field(default_factory=list)
    #: Processes that ended although nobody ended them.
    ended: list[str] = field(default_factory=list)
    #: When somebody else has sent the robot a goal.
    strange: list[float] = field(default_factory=list)
    resumes: int = 0
    #: How many targets the mission had, as it said when it was DONE.
    total: int | None = None


def problems(plan: Plan, seen: Seen, places: Mapping[str, tuple[float, float]]) -> list[str]:
    """Return everything that must not be, in words; `places` are those of tags in metres."""
    return [
        *_of_end(seen),
        *_of_outcomes(plan, seen),
        *_of_places(seen, places),
        *(text for lost in seen.lost if (text := _of_motion(plan, seen, lost))),
        *(f"{name}: nobody had ended it" for name in seen.ended),
    ]


def _of_end(seen: Seen) -> list[str]:
    kind, _, reason = seen.end.partition(": ")
    if kind == "DONE" or (kind in ("held", "FAULT") and reason):
        return []
    return [f"the mission ended as {seen.end!r}"]


def _of_outcomes(plan: Plan, seen: Seen) -> list[str]:
    found = []
    told = Counter(outcome.tag for outcome in seen.outcomes)
    visited = {tag for tag in told if not tag.endswith(_SEEN)}
    targets = dict.fromkeys(tag.removesuffix(_SEEN) for tag in sorted(told)) if plan.search else plan.tags
    # A search with a damaged journal may not know what it found after the damage: it is closed then.
    is_known = not plan.search or all(fault.kind != "bit flip" for fault in plan.faults)
    if not seen.end.startswith("held") and (is_known or visited):
        found += [f"target {tag} has no outcome" for tag in targets if not told[tag]]
    if seen.total is not None and visited and len(visited) != seen.total:
        found.append(f"{len(visited)} targets have outcomes, and the mission had {seen.total}")
    found += [f"target {tag} has {count} outcomes" for tag, count in told.items() if count > 1]
    found += [f"an outcome of {tag}, which is no target" for tag in sorted(visited - set(targets))]
    kept, read = Counter(seen.rows), {outcome.tag for outcome in seen.outcomes if outcome.status == OK}
    found += [f"the twin has nothing of {tag}, which was read" for tag in sorted(read - kept.keys())]
    found += [f"the twin has {tag}, which was not read" for tag in sorted(kept.keys() - read)]
    found += [f"the twin has {tag} {count} times" for tag, count in kept.items() if count > 1]
    return found


def _of_places(seen: Seen, places: Mapping[str, tuple[float, float]]) -> list[str]:
    """Whoever read a tag was there: else it is booked on another."""
    found = []
    for tag in sorted({o.tag for o in seen.outcomes if o.status == OK and o.tag in places}):
        nearest = min((math.dist(places[tag], (x, y)) for _, x, y in seen.track), default=math.inf)
        if nearest > NEAR_M:
            found.append(f"{tag} was read, and the robot was {nearest:.1f} m away at the nearest")
    return found


def driven(track: Sequence[tuple[float, float, float]], begin: float, end: float) -> tuple[float, float]:
    """Return how far the robot went between two times (m), and how long after the first it last moved (s)."""
    far, last = 0.0, 0.0
    within = [place for place in track if begin <= place[0] <= end]
    for (before, *here), (after, *there) in pairwise(within):
        step = math.dist(here, there)
        if there != START or after - before < SILENT_S:
            far += step
            last = after - begin if step > 0.005 else last
    return far, last


def waited(pulses: Sequence[float], begin: float, end: float) -> float:
    """Return for how long the witness was not let work, in seconds, at the worst."""
    within = [pulse for pulse in pulses if begin - 1.0 <= pulse <= end]
    return max((after - before for before, after in pairwise(within)), default=0.0)


def _of_motion(plan: Plan, seen: Seen, lost: Lost) -> str:
    if not lost.by_stop and any(lost.begin <= sent <= lost.end for sent in seen.strange):
        return ""
    far, last = driven(seen.track, lost.begin, lost.end)
    allowed = lost.bound + BUSY_S + waited(seen.pulses, lost.begin, lost.end)
    if far <= plan.speed * allowed + 0.1 and last <= allowed:
        return ""
    return f"{far:.2f} m in {last:.1f} s after {lost.why}; allowed are {allowed:.1f} s at {plan.speed:g} m/s"
