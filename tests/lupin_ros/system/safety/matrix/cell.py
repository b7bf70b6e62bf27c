"""Carries a cell of the table out on the bench, and says what came of it."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field
from typing import Any

from builtin_interfaces.msg import Time

from lupin_msgs.msg import MissionState
from tests.lupin_ros.system.safety.matrix.bench import Bench
from tests.lupin_ros.system.safety.matrix.measure import Moved
from tests.lupin_ros.system.safety.matrix.table import AFTER, AGAIN, BEFORE, DURING, HELD, LET_GO, Cell

#: Seconds that a base needs to stand (the simulated one: none), and an arm, by `docs/safety.md`.
BASE_BRAKES_S, ARM_BRAKES_S = 0.0, 0.3
#: What a busy machine adds to a bound, in seconds; the motion within it is noted, and no failure.
BUSY_S = 0.35
#: Seconds for which each part is watched; some of ours look once a second whether they may go on.
WATCHED_S = {HELD: 0.7, LET_GO: 1.3, AGAIN: 0.4}
#: What counts as 0: metres and radians; a motion has begun beyond these.
ZERO_M, ZERO_RAD = 0.02, 0.03
BEGUN_M, BEGUN_RAD = 0.15, 0.10
#: A stop that was let go is not told any more within so many seconds, and a person's request moves something.
RELEASED_S, AGAIN_WITHIN_S = 20.0, 20.0


@dataclass
class Result:
    """What came of a cell."""

    cell: str
    verdict: str = "ok"
    problems: list[str] = field(default_factory=list)
    #: Metres and radians of each part, counted from the bound (and what a busy machine adds).
    moved: dict[str, tuple[float, float]] = field(default_factory=dict)
    #: Metres and radians between the bound itself and that.
    late: tuple[float, float] = (0.0, 0.0)
    #: How long this process was kept waiting meanwhile, in seconds.
    waited: float = 0.0
    #: What state and page said while the stop was engaged, and after it was let go.
    said: dict[str, Any] = field(default_factory=dict)
    answers: list[str] = field(default_factory=list)
    #: Goals that were under way when the stop was let go.
    goals: int = 0
    #: What a person did until it moved again; `nothing` where it moved by itself.
    person: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def fields(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)


def carry_out(bench: Bench, cell: Cell) -> Result:
    """Carry a cell out.

    Raises:
        AssertionError: it could not be; the text says what was waited for.
    """
    began, result = time.monotonic(), Result(cell.name)
    bench.reset(cell.settings)
    _do(bench, cell.stop.prepare)
    if (cell.stop.of_mission and not cell.source.mission) or cell.source.name == "resume_policy":
        bench.mission_drives()
        bench.answers.clear()
    bound = _engaged_in_order(bench, cell)
    _watch(bench, cell, result, HELD, bound)
    result.answers = list(bench.answers)
    result.goals = bench.watch.goals
    if cell.source.hands_off:
        _do(bench, cell.source.hands_off)
    _let_go(bench, cell, result)
    if cell.order == DURING and HELD not in cell.allowed:
        _move_again(bench, cell, result)
    _watch(bench, cell, result, AGAIN, _engage(bench, cell))
    result.problems += [
        f"{part}: {metres:.2f} m, {radians:.2f} rad"
        for part, (metres, radians) in result.moved.items()
        if part not in cell.allowed and Moved(metres, radians).exceeds(ZERO_M, ZERO_RAD)
    ]
    result.problems += _unsaid(cell, result)
    result.verdict = "wrong" if result.problems else "ok"
    result.seconds = round(time.monotonic() - began, 1)
    return result


def _do(bench: Bench, name: str) -> None:
    if name:
        getattr(bench, name)()


def _engage(bench: Bench, cell: Cell) -> float:
    """Engage the stop; return when what moves must stand, in seconds of the wall clock."""
    begun = time.time()
    _do(bench, cell.stop.engage)
    brakes = ARM_BRAKES_S if cell.source.arm else BASE_BRAKES_S
    return begun + cell.stop.bound + brakes


def _engaged_in_order(bench: Bench, cell: Cell) -> float:
    source = cell.source
    if cell.order == BEFORE:
        bound = _engage(bench, cell)
        bench.work(max(time.time() + 0.3, bound + BUSY_S))
        _do(bench, source.begin)
        _do(bench, source.finish)
        return bound
    begun = time.time()
    _do(bench, source.begin)
    if cell.order == DURING and source.follows:
        moves = lambda: bench.watch.moved(begun, time.time()).exceeds(BEGUN_M, BEGUN_RAD)  # noqa: E731
        bench.wait_for(moves, "it moves")
    if cell.order == AFTER:
        _do(bench, source.finish)
        return _engage(bench, cell)
    bound = _engage(bench, cell)
    if source.finish:  # what comes late counts from when it comes
        bench.work(time.time() + 0.2)
        _do(bench, source.finish)
        bound = max(bound, time.time() + cell.stop.bound)
    return bound


def _watch(bench: Bench, cell: Cell, result: Result, part: str, bound: float) -> None:
    counts = bound + BUSY_S
    bench.work(counts)
    counts += bench.watch.waited(bound - 1.0, counts)  # others were kept waiting as well
    bench.states.clear()
    end = max(time.time(), counts) + WATCHED_S[part]
    bench.work(end)
    _note(bench, result, part, counts, end)
    late = bench.watch.moved(bound, counts)
    result.late = max(result.late, (round(late.metres, 3), round(late.radians, 3)))
    result.waited = max(result.waited, round(bench.watch.waited(bound, end), 3))


def _note(bench: Bench, result: Result, part: str, begin: float, end: float) -> None:
    moved = bench.watch.moved(begin, end)
    result.moved[part] = round(moved.metres, 3), round(moved.radians, 3)
    # A browser's click keeps this process waiting: messages of before it may be read only now.
    made = lambda: [each for each in bench.states if _seconds(each.header.stamp) >= begin]  # noqa: E731
    bench.wait_for(lambda: made() or not bench.tells_state, "what the state says")
    state = bench.states[-1] if bench.states else MissionState()
    page = bench._pages.get("a")
    shown = page.told.get("/mission/state", {}) if page is not None else {}
    result.said[part] = {
        "lifecycle": state.lifecycle_state,
        "paused": state.paused,
        "estop_engaged": all(each.estop_engaged for each in made()),
        "last_error": state.last_error,
        "page": None
        if page is None
        else {
            "stopped": page.stops().get("stopped"),
            "paused": shown.get("paused"),
            "estop_engaged": shown.get("estop_engaged"),
        },
    }


def _seconds(stamp: Time) -> float:
    return float(stamp.sec) + stamp.nanosec * 1e-9


def _let_go(bench: Bench, cell: Cell, result: Result) -> None:
    begin = time.time()
    _do(bench, cell.stop.let_go)
    if cell.stop.is_stop:
        bench.states.clear()
        bench.wait_for(lambda: bench.states and not bench.state.estop_engaged, "no stop is told", RELEASED_S)
    end = time.time() + WATCHED_S[LET_GO]
    bench.work(end)
    _note(bench, result, LET_GO, begin, end)


def _move_again(bench: Bench, cell: Cell, result: Result) -> None:
    """Do what a person does until it moves once more, and note that."""
    result.person = [cell.stop.person] if cell.stop.person else []
    begin = time.time()
    if not Moved(*result.moved[LET_GO]).exceeds(BEGUN_M, BEGUN_RAD):
        _do(bench, cell.source.again)
        result.person += [cell.source.again] if cell.source.again else []
        result.person.append("resume" if cell.source.mission else "ask again")
        _do(bench, "resume" if cell.source.mission else cell.source.begin)
    moves = lambda: bench.watch.moved(begin, time.time()).exceeds(BEGUN_M, BEGUN_RAD)  # noqa: E731
    try:
        bench.wait_for(moves, "it moves again", AGAIN_WITHIN_S)
    except AssertionError:
        result.problems.append(f"nothing moves again after: {', '.join(result.person)}")


def _unsaid(cell: Cell, result: Result) -> list[str]:
    """Return what should have been said and was not."""
    found, held = [], result.said[HELD]
    stops = cell.stop.is_stop or cell.stop.name in ("pause", "restarted")
    if stops and cell.source.mission and cell.order != BEFORE and not held["paused"] and not cell.allowed:
        found.append("the state does not say that the mission is held")
    if cell.stop.is_stop and not held["estop_engaged"]:
        found.append("the state does not say that the stop is engaged")
    if cell.stop.is_stop and cell.order == BEFORE and cell.source.answers:
        if not result.answers:
            found.append("what was asked for under the stop has no answer")
        elif "" in result.answers:
            found.append("what was asked for under the stop was accepted")
    return found
