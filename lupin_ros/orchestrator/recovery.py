"""Replays the journal of the previous process, and decides whether its mission goes on or is closed.

A mission is closed where its file cannot be replayed, the missions' files have changed, `resume_policy` is
`abort`, or the profile cannot resume. Its open targets then get the outcome "left out".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lupin_engine.chart import Chart
from lupin_engine.errors import LupinError, UsageError
from lupin_engine.machine import Machine
from lupin_engine.missions import LoadedMissions, lifecycle_in, load_chart
from lupin_engine.plugin import CLOSED_CODE, TEXT, Parameter, Publish, Rating
from lupin_engine.properties import LiveMonitor
from lupin_engine.runtime import (
    CHARTS,
    Leftover,
    Recovered,
    goes_on,
    leftover,
    make_world,
    open_targets,
    recover,
)
from lupin_ros.adapter.node import RosNode

ASK, CONTINUE, ABORT = POLICIES = ("ask", "continue", "abort")
POLICY = "resume_policy"
#: How long an orchestrator listens before the policy continues, in seconds: a stop's publisher must match it.
HEARD_S = 2.0
#: The node's parameters about a mission that is under way when it starts.
RESUME_PARAMETERS: Mapping[str, Parameter] = {
    POLICY: Parameter(
        TEXT,
        ASK,
        "what a mission does that was under way when the orchestrator ended: ask (it waits for resume), "
        "continue (it goes on as soon as all servers are there, unless a pause or a stop holds it), "
        "abort (it is closed)",
    ),
}


@dataclass(frozen=True)
class Recovery:
    """The decision about a file. `machine` is the replayed one to continue; None: a new one starts.

    `closing` is why the mission under way is closed, `left_out` are the outcomes of its open targets. `watch`
    has judged the replayed steps.
    """

    left: Leftover
    recovered: Recovered | None = None
    machine: Machine | None = None
    closing: str = ""
    left_out: tuple[Publish, ...] = ()
    watch: LiveMonitor | None = None


def find_recovery(
    ros: RosNode, folder: Path, loaded: LoadedMissions, given: Mapping[str, Any]
) -> tuple[Recovery | None, str]:
    """Return the decision about the last file in `folder`; None where there is no usable one.

    The second value names a mission under way whose file cannot be read, and why; '' where there is none.

    Raises:
        UsageError: there is no such policy.
    """
    policy = str(given[POLICY])
    if policy not in POLICIES:
        raise UsageError(f"resume_policy: expected {', '.join(POLICIES)}, got {policy!r}")
    left, problems, lost = leftover(folder)
    for problem in problems:
        ros.log.warning("journal", problem=problem)
    if left is None or lost:
        return None, lost
    return _judged(left, folder, loaded, policy), ""


def _judged(left: Leftover, folder: Path, loaded: LoadedMissions, policy: str) -> Recovery:
    """Decide whether the mission of a file goes on."""
    head = left.file.head
    same = head.chart == loaded.hash
    recovered: Recovered | None = None
    watch: LiveMonitor | None = None
    try:
        chart = loaded.chart if same else _chart_of(left, folder, loaded)
        watch = LiveMonitor(chart)
        recovered = recover(left.file, make_world(chart, head.parameters), watch)
        wrong = recovered.problem
    except LupinError as problem:
        wrong = str(problem)
    if recovered is None or wrong:
        if not head.mission_id or left.file.is_ended:
            return Recovery(left)
        targets = open_targets(left.file, recovered)
        left_out = tuple(_left_out(loaded, head.mission, head.mission_id, targets, wrong))
        return Recovery(left, recovered, closing=wrong, left_out=left_out)
    machine = recovered.machine
    view, stages = machine.view, machine.chart.profile.stages
    found = Recovery(left, recovered, watch=watch)
    if not goes_on(machine):
        return found
    why = _why_closed(same, policy, loaded)
    if not why:
        return replace(found, machine=machine)
    if view.lifecycle in stages.without_mission:
        return found
    targets = [visit.target for visit in machine.memory.outcomes if not visit.closed]
    left_out = tuple(_left_out(loaded, view.mission, view.mission_id, targets, why))
    return replace(found, closing=why, left_out=left_out)


def _why_closed(same: bool, policy: str, loaded: LoadedMissions) -> str:
    if not same:
        return "the files of the missions are others than before"
    if policy == ABORT:
        return "resume_policy is abort"
    return "" if loaded.chart.profile.resume else "its profile has no request to resume"


def _chart_of(left: Leftover, folder: Path, current: LoadedMissions) -> Chart:
    """Return the chart of a file, from the copy of its missions that is beside the journal.

    Raises:
        LupinError: they cannot be loaded.
    """
    head = left.file.head
    kept = folder / CHARTS / head.chart
    return load_chart(lifecycle_in(kept), [kept / file for file in head.files], current.chart.catalog)


def _left_out(
    loaded: LoadedMissions, mission: str, mission_id: str, targets: list[str], why: str
) -> list[Publish]:
    """Return one outcome for each target of a closed mission, rated as left out; none where no outcome is."""
    outcomes = loaded.chart.profile.outcomes
    status = next((outcome.name for outcome in outcomes if outcome.rating is Rating.LEFT_OUT), "")
    unique = dict.fromkeys(targets) if status else ()
    return [Publish(mission, mission_id, target, status, CLOSED_CODE, why) for target in unique]
