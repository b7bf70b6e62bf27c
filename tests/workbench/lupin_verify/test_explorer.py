"""The explorer sees everything: by count, without memory of effects, and beside random runs."""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart.model import Chart
from lupin_engine.machine import event as events
from lupin_engine.machine.event import RESUMED, Event
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.memory import Attempt, Memory, Phase
from lupin_engine.machine.operations import EVERYTHING
from lupin_engine.machine.scope import World
from lupin_engine.machine.snapshot import restore
from lupin_engine.machine.step import Step
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.types import TEXT, list_of
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim.simulation import Simulation
from lupin_verify.campaign import Campaign
from lupin_verify.rates import read_rates
from lupin_verify.situations import classes, levels
from lupin_verify.situations.found import ExplorationProgress
from lupin_verify.situations.levels import explore
from lupin_verify.situations.moves import move_text
from lupin_verify.situations.relevance import (
    _codes_named,
    _distinguished_sweeps,
    distinguished_lengths,
    is_abandoned,
)
from lupin_verify.situations.situation import CLAIMS, Situation, TrackedMemory
from lupin_verify.situations.timing import timed_run
from lupin_verify.situations.worlds import in_order
from tests import shipped
from tests.lupin_engine.machine.charts import PAUSE, chart, fails
from tests.workbench.lupin_verify.toys import (
    KeepingExplorer,
    explored,
    random_mission,
    round_trip,
    search,
    two_holds,
    wheels,
)

NO_CLOCK: dict[str, Any] = {
    "A": {"invoke": "nav.go", "on_done": "B", "on_error": "FAULT", "on": {"operator.skip_current": "B"}},
    "B": {"on": {"operator.dock": "A"}},
    "FAULT": {"on": {"operator.reset": "A"}},
}


@pytest.mark.slow
def test_wheels_are_counted() -> None:
    """Regions that know nothing of each other: the product of their sizes, and three moves from each."""
    found = explored(wheels(3, 6), restarts=False)
    assert found.complete
    assert found.progress.situations == 6**3
    assert len(found.sources) == 3 * 6**3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("of", "bounds"),
    [
        (round_trip(), {}),
        (search(), {"targets": 1, "restarts": False}),
        (wheels(2, 5), {}),
        (chart(NO_CLOCK, holds={"pause": PAUSE}), {}),
        (two_holds(), {}),
    ],
)
def test_what_is_remembered_changes_nothing(of: Chart, bounds: dict[str, Any]) -> None:
    """With every transition a step of the machine, the graph is the same."""
    fast, slow = explored(of, **bounds), explored(of, memo=False, **bounds)
    assert fast.progress.steps <= slow.progress.steps
    assert fast.progress.situations == slow.progress.situations
    assert (fast.sources, fast.targets, fast.by) == (slow.sources, slow.targets, slow.by)


def test_which_hold_is_released_makes_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    """A request that releases all of them asks only whether one is engaged; the graph is the same."""
    fast = explored(two_holds())
    for name in ("is_any_engaged", "is_any_beside", "engaged_beside", "release"):
        monkeypatch.setattr(TrackedMemory, name, getattr(Memory, name))
    slow = explored(two_holds())
    assert fast.progress.steps < slow.progress.steps
    assert (fast.sources, fast.targets, fast.by) == (slow.sources, slow.targets, slow.by)


@pytest.mark.slow
def test_in_which_order_elements_answer_changes_nothing() -> None:
    """Of answers that wait for a release, and of which nothing is kept, all orders lead to the same."""
    explorer = KeepingExplorer(search(), targets=2, restarts=False)
    sorted_ = explore(explorer, live=False)
    numbers = {situation: number for number, situation in enumerate(explorer.situations)}
    relevance, slot = explorer.relevance, explorer.table.index["deferred", ""]
    states, relevance.keeps_nothing = relevance.keeps_nothing, frozenset()
    plain = explore(explorer, live=False)
    relevance.keeps_nothing = states
    assert len(explorer.situations) > len(numbers)

    def in_order_of(situation: Situation) -> int:
        memory = TrackedMemory(explorer.table, situation)
        assert len(memory.deferred) < 4  # and so it is looked at
        in_order(memory)
        number = dict(memory.changes()).get(slot, situation[slot])
        return numbers[(*situation[:slot], number, *situation[slot + 1 :])]

    to = [in_order_of(situation) for situation in explorer.situations]
    assert set(to) == set(range(len(numbers)))
    moves = {(to[s], by, to[t]) for s, by, t in zip(plain.sources, plain.by, plain.targets, strict=True)}
    assert moves == set(zip(sorted_.sources, sorted_.by, sorted_.targets, strict=True))


@pytest.mark.slow
def test_what_only_a_variable_is_made_of_is_read_where_that_matters() -> None:
    """The same graph, by fewer steps: after an abort nobody asks how many were found."""
    aside, read = (KeepingExplorer(search(), targets=2, restarts=False) for _ in range(2))
    read.table.reported = frozenset()
    fast, slow = explore(aside), explore(read)
    assert fast.progress.steps < slow.progress.steps
    assert (fast.sources, fast.targets, fast.by) == (slow.sources, slow.targets, slow.by)


def test_a_variable_that_cannot_be_set_is_found() -> None:
    """Also where nobody reads it: for each value is seen whether there is a result."""

    def one_is_too_many(env: Any) -> float:
        return 1 / (1 - len(env["input"]["seen"]))

    look = {"exit": [("set", {"found": one_is_too_many})], "on": {"operator.abort": "DONE"}}
    back = {"target": "LOOK", "guard": lambda env: env["input"]["seen"]}
    of = chart(
        {"LOOK": look, "DONE": {"on": {"operator.reset": back}}, "FAULT": {}},
        inputs={"seen": {"type": list_of(TEXT), "initial": []}},
        context={"found": 0},
    )
    assert "no_execution_error" in explored(of, targets=2).breaches


def both() -> Chart:
    """Return a chart that drives and looks about, in whichever order, and drives and looks again."""
    regions = {
        "D": {"states": {"GO": {"invoke": "nav.go", "on_done": "GO", "on_error": "GO"}}},
        "L": {"states": {"LOOK": {"invoke": "arm.look", "on_done": "LOOK", "on_error": "LOOK"}}},
    }
    return chart({"P": {"kind": "parallel", "states": regions}, "FAULT": {}}, holds={"pause": PAUSE})


@pytest.mark.slow
@pytest.mark.parametrize("of", [round_trip(), search(), both()])
def test_claims_follow_from_attempts(of: Chart) -> None:
    """What is kept of them beside the attempts is what the attempts say."""
    explorer = KeepingExplorer(of)
    assert explore(explorer, live=False).complete
    table, seen = explorer.table, set()
    for situation in explorer.situations:
        known = tuple(table.get(situation, CLAIMS) or ())
        names = table.get(situation, ("attempts", "")) or ()
        attempts = {name: table.get(situation, ("attempts", name)) for name in names}
        assert known == tuple(Memory(attempts=attempts).claims)
        seen.add(known)
    assert len(seen) > 3


@pytest.mark.slow
def test_a_restart_after_a_lost_order_is_looked_at_with_late_answers() -> None:
    """The order is cancelled once more, and everything waits for that; otherwise it is forgotten."""

    def phases(owed: int) -> set[tuple[str, ...]]:
        explorer = KeepingExplorer(round_trip(), owed=owed)
        found, table = explore(explorer), explorer.table
        assert found.breaches == {}

        def orders(number: int) -> dict[str, Any]:
            row = explorer.situations[number]
            return {
                name: table.get(row, ("attempts", name)) for name in table.get(row, ("attempts", "")) or ()
            }

        restart = next(
            n for n, move in enumerate(found.moves.all) if move.event and move.event.name == RESUMED
        )
        moves = zip(found.sources, found.targets, found.by, strict=True)
        pairs = [(orders(source), orders(target)) for source, target, by in moves if by == restart]
        lost = [after for before, after in pairs if Phase.LOST in {order.phase for order in before.values()}]
        unwanted = [one for after in lost for name, one in after.items() if is_abandoned(name)]
        return {(order.phase.value, *order.uses) for order in unwanted}

    assert phases(0) == set()
    assert phases(1) == {("cancelling", EVERYTHING)}


def test_a_new_process_is_held_where_a_mission_is_under_way() -> None:
    """Elsewhere it begins from the start, and in a fault it goes on at once."""
    states = {
        "READY": {"on": {"operator.dock": "A"}},
        "A": {"on": {"operator.abort": "FAULT"}},
        "FAULT": {"on": {"operator.reset": "READY"}},
    }
    explorer = KeepingExplorer(chart(states))
    assert explore(explorer, live=False).complete
    known = [(explorer.table.get(one, ("configuration", ""))[-1], one) for one in explorer.situations]
    held = {leaf for leaf, one in known if explorer.table.get(one, ("held", ""))}
    assert {leaf for leaf, _ in known} == {"READY", "A", "FAULT"}
    assert held == {"A"}


@pytest.mark.slow
def test_a_stop_after_a_new_beginning_loses_nothing() -> None:
    """What was certain before is what was found, until the next walk has come farther."""
    most = 0

    def look(progress: ExplorationProgress) -> str:
        nonlocal most
        begins = progress.situations < most
        most = max(most, progress.situations)
        return "stopped" if begins and most > 100 else ""

    found = explore(KeepingExplorer(shipped.mission("inspection"), targets=1), look)
    assert (found.complete, found.stopped) == (False, "stopped")
    assert found.progress.situations == len(found.parents) > 10
    assert found.taken


def said(machine: Machine) -> list[Event]:
    """Return what servers can say and people can ask."""
    found = [Event(f"operator.{name}") for name in ("skip_current", "dock", "pause", "resume", "reset")]
    for attempt in machine.memory.attempts.values():
        if attempt.phase is Phase.WAITING:
            continue
        if attempt.phase is not Phase.ACCEPTED:
            found.append(events.accepted(attempt.id))
        found += [events.done(attempt.id, {}), events.failed(attempt.id, "driver_error")]
        found.append(events.cancelled(attempt.id))
    return found


def outline(machine: Machine) -> tuple[Any, ...]:
    """Return what of a memory decides what comes next, where nothing is counted and nothing is late."""
    memory = machine.memory
    attempts = [(a.operation, _phase(a), a.id == _current(machine)) for a in memory.attempts.values()]
    begun = [(i.state, i.begun, i.attempt is not None) for i in memory.invocations.values()]
    answers = [memory.attempts[e.data["attempt"]].answer for e in memory.deferred]
    waiting = [(answer.name, answer.data.get("code")) for answer in answers if answer is not None]
    return memory.configuration, tuple(memory.held), tuple(attempts), tuple(begun), tuple(waiting)


def _current(machine: Machine) -> str | None:
    return next((i.attempt for i in machine.memory.invocations.values()), None)


def test_an_independent_walk_counts_the_same() -> None:
    """Breadth first over snapshots of the machine, with none of the explorer's means."""
    of = chart(NO_CLOCK, holds={"pause": PAUSE})
    world = World(of, {})
    machine = Machine(world)
    machine.start(0.0)
    seen = {outline(machine)}
    waiting = deque([machine.snapshot()])
    while waiting:
        text = waiting.popleft()
        first = Machine(world, restore(of, text))
        moves: list[Event | None] = [*said(first)]
        moves += [None] if first.next_deadline is not None else []
        for move in moves:
            machine = Machine(world, restore(of, text))
            if move is None:
                machine.advance(machine.next_deadline or 0.0)
            else:
                machine.handle(move, 0.0)
            lost = [a for a in machine.memory.attempts.values() if a.phase is Phase.LOST]
            for attempt in lost:  # what is lost is never told apart from what is gone
                del machine.memory.attempts[attempt.id]
            machine.memory.timers[:] = [(3.0, *timer[1:]) for timer in machine.memory.timers]
            if outline(machine) not in seen:
                seen.add(outline(machine))
                waiting.append(machine.snapshot())
    found = explored(of, restarts=False)
    assert found.progress.situations == len(seen)


def outlines(explorer: KeepingExplorer, variables: Sequence[str] = ()) -> set[tuple[Any, ...]]:
    """Return of all situations where they are, what holds them, what is under way, and some variables."""
    known, table = set(), explorer.table
    for situation in explorer.situations:
        names = table.get(situation, ("attempts", "")) or ()
        attempts = [table.get(situation, ("attempts", name)) for name in names]
        held = TrackedMemory(table, situation).held
        kept = tuple(table.get(situation, ("context", name)) for name in variables)
        known.add((table.get(situation, ("configuration", "")), frozenset(held), _phases(attempts), kept))
    return known


def reached(memory: Memory, variables: Sequence[str] = ()) -> tuple[Any, ...]:
    """Return the same of a memory; what is lost, or ends without anybody waiting, is not told apart."""
    waits = [a for a in memory.attempts.values() if a.phase is not Phase.LOST]
    waits = [a for a in waits if a.phase is not Phase.CANCELLING or a.uses]
    kept = tuple(memory.context.get(name) for name in variables)
    return memory.configuration, frozenset(memory.held), _phases(waits), kept


def test_random_runs_see_nothing_else() -> None:
    """Whatever a machine comes to by chance, with real times, is among the situations."""
    of = round_trip()
    explorer = KeepingExplorer(of, restarts=False)
    assert explore(explorer).complete
    known = outlines(explorer)
    for seed in range(40):
        dice, machine, now = random.Random(seed), Machine(World(of, {})), 0.0
        machine.start(now)
        for _ in range(60):
            due = machine.next_deadline
            wait = dice.choice((0.0, 0.5, 4.0, 20.0))
            if due is not None and due <= now + wait:
                now = max(now, due)
                machine.advance(now)
            else:
                now += wait
                machine.handle(dice.choice(said(machine)), now)
            assert reached(machine.memory) in known, seed


def told(dice: random.Random, now: float) -> Event:
    """Return what comes by itself: a live value, also one between those that are tried."""
    charges = (0.1, 0.2, 0.22, 0.26, 0.3, 0.5, 0.9)
    values = {
        "robot.estop": (True, False),
        "robot.battery": charges,
        "plugins.missing": ([], ["a"], ["a", "b"]),
    }
    name = dice.choice(sorted(values))
    return events.observed(name, dice.choice(values[name]), now)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2, 8, 16, 22, 26, 36, 39, 56])
def test_random_runs_of_random_missions_see_nothing_else(seed: int, tmp_path: Path) -> None:
    """Nor do the variables that conditions read have other values."""
    of = random_mission(seed, tmp_path)
    explorer = KeepingExplorer(of, targets=2, restarts=False)
    assert explore(explorer, live=False).complete
    variables = sorted(explorer.relevance.variables & {"n", "m", "way", "on"})
    known, came = outlines(explorer, variables), set()
    start = Event("mission.start", {"mission_type": "Chance", "mission_id": "1"})
    for run in range(20):
        dice, machine, now = random.Random(run), Machine(make_world(of, {})), 0.0
        machine.start(now)
        for _ in range(80):
            due, wait = machine.next_deadline, dice.choice((0.0, 0.5, 1.0, 2.5, 4.0, 20.0))
            if due is not None and due <= now + wait:
                now = max(now, due)
                machine.advance(now)
            else:
                now += wait
                machine.handle(dice.choice((*said(machine), start, start, *(told(dice, now),) * 5)), now)
            came.add(reached(machine.memory, variables))
    assert len(came) > 4
    assert came - known == set()


def unknown(env: Any) -> bool:
    """Say whether nobody knows if the robot stands."""
    return not env["known"]("stop")


BACK = {"operator.dock": "A"}
#: In each of these, LATE comes after a deadline that is shorter when it is set.
SHORTER_AT_FIRST: dict[str, dict[str, Any]] = {
    "a value is reported again": {
        "A": {"on": {"operator.dock": "B"}},
        "B": {"after": {5.0: "LATE"}, "always": {"target": "A", "guard": unknown}},
    },
    "a budget is used up in part": {
        "A": {"budget": {5.0: "LATE"}, "after": {4.0: "B"}, "on": {"operator.dock": "B"}},
        "B": {"on": BACK},
    },
    "a tick was late": {
        "A": {
            "every": {4.0: {"do": ("raise", {"event": "tick"})}},
            "states": {
                "ONE": {"on": {"tick": "TWO"}},
                "TWO": {"after": {3.0: "ONE"}, "on": {"tick": "LATE"}},
            },
        },
    },
    "a pause is left to chance": {
        "A": {
            "invoke": {"do": "nav.go", "attempts": 2.0, "backoff": 4.0, "jitter": 0.5},
            "after": {2.1: "B"},
            "on_done": "B",
            "on_error": "LATE",
        },
        "B": {"on": BACK},
    },
}


@pytest.mark.parametrize("states", SHORTER_AT_FIRST.values(), ids=SHORTER_AT_FIRST)
def test_a_deadline_is_in_no_order_if_nobody_knows_how_far_away_it_is(states: dict[str, Any]) -> None:
    """So it may be the next, or another one that was set for longer."""
    of = chart({**states, "LATE": {}, "FAULT": {}}, inputs={"stop": {"initial": False, "freshness": 3.0}})
    assert "LATE" in explored(of, restarts=False).entered


def test_a_pause_that_is_not_left_to_chance_has_its_place() -> None:
    """What is due before it comes before it."""
    states = SHORTER_AT_FIRST["a pause is left to chance"]
    invoke = {name: value for name, value in states["A"]["invoke"].items() if name != "jitter"}
    of = chart({**states, "A": {**states["A"], "invoke": invoke}, "LATE": {}, "FAULT": {}})
    assert "LATE" not in explored(of, restarts=False).entered


@pytest.mark.long
@pytest.mark.proof
@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("name", "given"),
    [("inspection", {}), ("exploration", {"monitoring_sweeps": 1, "seed_climate_on_discovery": False})],
)
def test_random_missions_see_nothing_else(name: str, given: dict[str, Any]) -> None:
    """Whatever the shipped missions come to in random worlds is, until their orchestrator is started again.

    The registry of an exploration tells each mission the tags of those before as well.
    """
    loaded = load_missions([name], shipped.catalog())
    explorer = KeepingExplorer(loaded.chart, given, targets=1)
    assert explore(explorer, live=False).complete
    known = outlines(explorer)
    file = Path(__file__).parents[2] / "campaigns" / f"{name}.yaml"
    campaign = Campaign(loaded, read_rates(file, loaded.chart), given)
    came: set[tuple[Any, ...]] = set()
    for seed in range(80):
        script = campaign.script(seed)
        if name == "inspection":
            script = replace(script, request={**script.request, "tag_sequence": [str(1 + seed % 29)]})
        simulation = Simulation(loaded.chart, script, given, make_world(loaded.chart, given))

        def look(step: Step, run: Simulation = simulation) -> None:
            if step.event.name == RESUMED:
                run.listener = lambda _: None
            else:
                came.add(reached(run.machine.memory))

        simulation.listener = look
        simulation.run()
    assert len(came) > 40
    assert came - known == set()


def _phases(attempts: list[Any]) -> tuple[Any, ...]:
    """Return what there is of attempts."""
    return tuple(sorted((a.operation, _phase(a), a.answer is not None) for a in attempts))


def _phase(attempt: Attempt) -> str:
    """Return the phase; whether a server has accepted already is not told apart."""
    return "sent" if attempt.phase in (Phase.REQUESTED, Phase.ACCEPTED) else attempt.phase.value


def test_the_round_trip_is_small() -> None:
    """Nothing is broken, and everything is reached that should be."""
    found = explored(round_trip())
    assert found.complete
    assert found.breaches == {}
    assert found.entered >= {"A", "B", "C"}


def test_most_ways_have_times() -> None:
    """Also those on which orders that nobody waits for end, and others take their names over."""
    explorer = KeepingExplorer(round_trip())
    found = explore(explorer)
    out: dict[int, list[tuple[int, int]]] = {}
    for source, move, target in zip(found.sources, found.by, found.targets, strict=True):
        out.setdefault(source, []).append((move, target))
    abandoned = runs = 0
    for seed in range(60):
        dice, at, way = random.Random(seed), 0, []
        for _ in range(14):
            move, at = dice.choice(out[at])
            way.append(move)
        told = [move_text(explorer.chart, found.moves.all[move]) for move in way]
        abandoned += any("from before the restart" in move or "cancelled before" in move for move in told)
        runs += timed_run(explorer, way) is not None
    assert abandoned > 40
    assert runs > 45


def test_what_a_step_only_writes_is_not_read() -> None:
    """It is part of the effect whatever was there; what was read before is part of it where it changes."""
    explorer = KeepingExplorer(round_trip())
    situation, _ = explorer.initial()
    memory = TrackedMemory(explorer.table, situation)
    assert memory.mission == ""
    memory.mission = memory.mission_id = ""
    memory.current_itinerary = "A"
    slots = [explorer.table.index[name, ""] for name in ("mission", "mission_id", "current_itinerary")]
    assert [slot for slot, _ in memory.changes()] == slots[1:]
    assert memory.reads == {slots[0]}


@pytest.mark.parametrize(
    ("source", "most"),
    [
        ("itinerary.open", 0),
        ("itinerary.sweep + itinerary.closed > 1 and input.late", 2),
        ("itinerary.sweep >= 3 or itinerary.sweep == 5", 6),
        ("itinerary.sweep - itinerary.closed > 1", math.inf),
        ("itinerary.sweep > 1 and itinerary.sweep % 2 == 0", math.inf),
        ("itinerary.sweep > context.most", math.inf),
    ],
)
def test_sweeps_are_counted_as_far_as_a_condition_tells_them_apart(source: str, most: float) -> None:
    """Beyond that a mission without end would have situations without end."""
    assert _distinguished_sweeps(source) == most


@pytest.mark.parametrize(
    ("source", "codes"),
    [
        ("error.code == 'late' or error.code in ['lost', 'gone']", {"late", "lost", "gone"}),
        ("error.code in 'late or lost'", None),
        ("error.code not in 'late'", None),
        ("error.code == 'late' and error.detail in 'lost'", {"late"}),
    ],
)
def test_a_code_within_a_text_is_no_comparison_with_one(source: str, codes: set[str] | None) -> None:
    """`in` a text is true for every code that is a part of it: those must not be merged with the others."""
    assert _codes_named(source) == codes


@pytest.mark.slow
def test_lists_are_as_long_as_a_condition_tells_them_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of servers that are missing it matters whether there is one; with more the same is found."""
    of = shipped.mission("inspection")
    assert distinguished_lengths(of, "missing") == 1
    assert distinguished_lengths(shipped.mission("exploration"), "discovered") == math.inf
    short = explored(of, open_values=False, targets=2, restarts=False)
    monkeypatch.setattr(classes, "distinguished_lengths", lambda *_: math.inf)
    long = explored(of, open_values=False, targets=2, restarts=False)
    assert short.progress.situations < long.progress.situations
    assert (short.taken, short.entered, short.breaches) == (long.taken, long.entered, long.breaches)
    assert set(short.flags) == set(long.flags)


def test_a_breach_is_not_hidden_by_many_others_after_as_many_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of each property some are kept."""
    rule = {"target": "C", "guard": lambda env: env["input"]["x"] != "a"}
    states = {"A": {"always": rule, "after": {1.0: "B"}}, "B": {}, "C": {"entry": [("set", {"n": fails})]}}
    letters = replace(TEXT, values=tuple("abcdefghijklmnopqrstuvwxyz"))
    of = chart({**states, "FAULT": {}}, inputs={"x": {"type": letters, "initial": "a"}}, context={"n": 0})
    monkeypatch.setattr(levels, "_MOST_BREACHES", 1)
    found = explored(of, restarts=False).breaches
    assert {name: breach.depth for name, (breach,) in found.items()} == {
        "no_execution_error": 0,
        "no_deaf_wait": 0,
    }


@pytest.mark.slow
def test_a_value_that_only_an_event_carries_is_told_apart(tmp_path: Path) -> None:
    """What a raised event carries decides where it is read: here the number of a sweep, in the fourth."""
    carries = 'raise: {event: round.over, with: {sweep: "${ itinerary.sweep }"}}'
    (tmp_path / "rounds.yaml").write_text(
        f"""\
mission: Rounds
summary: Goes round two tags, until the fourth round.
initial: ROUND
states:
  ROUND:
    itinerary: {{items: "${{ tags.named(['1', '5']) }}", sweeps: 0}}
    on: {{round.over: {{target: BAD, guard: event.sweep > 3}}}}
    initial: GOES
    states:
      GOES:
        after:
          1 s: {{target: NEXT, do: [{{itinerary.close: {{status: OK}}}}]}}
      NEXT:
        always:
          - {{target: GOES, guard: itinerary.remaining > 0, do: [itinerary.advance, {{{carries}}}]}}
          - target: visited
      visited: {{type: final}}
    on_done: done
  BAD: {{after: {{1 s: done}}}}
  done: {{type: final}}
""",
        encoding="utf-8",
    )
    rounds = load_missions([str(tmp_path / "rounds.yaml")], shipped.catalog()).chart
    assert any(name.endswith(".BAD") for name in explored(rounds, targets=1, restarts=False).entered)


def test_an_interruption_between_two_runs_keeps_what_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run begins again when a reduction was wrong; Ctrl-C may come just then."""
    begin, begun = levels.LevelExploration._begin, 0

    def interrupted(self: levels.LevelExploration) -> None:
        nonlocal begun
        begun += 1
        if begun > 1:
            raise KeyboardInterrupt
        begin(self)

    monkeypatch.setattr(levels.LevelExploration, "_begin", interrupted)
    found = explored(search(), targets=1, restarts=False)
    assert begun == 2
    assert (found.stopped, found.complete) == ("interrupted", False)
    assert found.progress.situations >= 1
