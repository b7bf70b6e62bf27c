"""What is not told apart makes no difference: slots that are dead, and values that are open."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart.model import Chart
from lupin_engine.plugin.types import BOOL
from lupin_engine.properties.built_in import BUILT_IN
from lupin_engine.runtime.setup import make_world
from lupin_verify.proof import ProofVerdict, Proven, prove
from lupin_verify.situations.explorer import Bounds, SituationExplorer
from lupin_verify.situations.graph import OF_THE_GRAPH, SILENCE, Graph
from lupin_verify.situations.levels import LevelExploration, explore
from lupin_verify.situations.situation import Situation
from lupin_verify.situations.worlds import Mover
from tests import shipped
from tests.lupin_engine.machine.charts import PAUSE, chart
from tests.workbench.lupin_verify.toys import KeepingExplorer, explored, random_mission, round_trip, search

SHORT = {"monitoring_sweeps": 1, "seed_climate_on_discovery": False}


@pytest.mark.long
@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("of", "given", "bounds"),
    [
        (round_trip(), {}, {"targets": 1}),
        (search(), {}, {"targets": 2, "restarts": False}),
        (shipped.mission("inspection"), {}, {"targets": 1}),
        pytest.param(
            shipped.mission("exploration"),
            SHORT,
            {"targets": 1, "restarts": False},
            marks=pytest.mark.proof,
        ),
    ],
)
def test_what_is_not_told_apart_changes_nothing(
    of: Chart, given: dict[str, Any], bounds: dict[str, Any]
) -> None:
    """In charts by hand, and in the shipped missions."""
    check_reduction(of, given, bounds)


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1, 2, 8, 16, 22, 26, 36, 39])
def test_what_is_not_told_apart_changes_nothing_by_chance(seed: int, tmp_path: Path) -> None:
    """Nor in missions that nobody has thought of."""
    check_reduction(random_mission(seed, tmp_path), {}, {"targets": 1, "restarts": False})


def check_reduction(of: Chart, given: dict[str, Any], bounds: dict[str, Any]) -> None:
    """See that the plain walk, with the same left out, has the situations and transitions of the reduced one.

    Where values are told before a transition it is one of the situations that have these.
    """
    explorer = KeepingExplorer(of, given, **bounds)
    plain = explore(explorer, live=False)
    every = list(explorer.situations)
    walk = LevelExploration(explorer, memo=True, live=True)
    reduced = walk.run(lambda _: "")
    assert plain.complete
    assert reduced.complete
    numbers = {situation: number for number, situation in enumerate(explorer.situations)}
    of_plain = []
    for situation in every:
        dead = walk.live.dead(walk.live.location(situation[slot] for slot in walk.live.location_slots))
        kept = tuple(dead.left(slot, value) for slot, value in enumerate(situation))
        of_plain.append(numbers[kept])
    assert set(of_plain) == set(range(reduced.progress.situations))

    inputs = walk.live.input_values.items()
    values = {move: (slot, value) for slot, of in inputs for value, move in of.items()}
    ways: dict[tuple[int, int, int], list[list[tuple[int, int]]]] = {}
    for source, by, target in zip(reduced.sources, reduced.by, reduced.targets, strict=True):
        *told, move = reduced.moves.each(by)
        ways.setdefault((source, move, target), []).append([values[one] for one in told])

    def has(situation: Situation, told: list[tuple[int, int]]) -> bool:
        return all(situation[slot] == value for slot, value in told)

    met = set()
    every_one = zip(plain.sources, plain.by, plain.targets, plain.does, strict=True)
    for source, by, target, does in every_one:
        way = of_plain[source], by, of_plain[target]
        if way[0] != way[2] or does or plain.moves.all[by].side & Mover.TIMER:
            met.add(way)
            assert any(has(every[source], told) for told in ways[way])
    assert met == ways.keys()
    assert plain.breaches.keys() == reduced.breaches.keys()
    assert (plain.taken, plain.entered) == (reduced.taken, reduced.entered)
    broken = [[one.name for one in OF_THE_GRAPH if one.broken(Graph(g)).any()] for g in (plain, reduced)]
    assert broken[0] == broken[1]


def late(env: Any) -> bool:
    """Say whether it is late."""
    return bool(env["input"]["late"])


def early(env: Any) -> bool:
    """Say whether it is not."""
    return not late(env)


def lamps(guard: Any, initial: bool | None = None, **more: Any) -> Chart:
    """Return a chart that looks at a live value now and then, and not in between."""
    states = {
        "A": {"after": {1.0: [{"target": "B", "guard": guard}, {"target": "DONE"}]}},
        "B": {"after": {1.0: [{"target": "DONE", "guard": late}, {"target": "A"}]}},
        "DONE": {},
        "FAULT": {},
    }
    return chart(states, inputs={"late": {"type": BOOL, "initial": initial}}, **more)


def test_one_situation_stands_for_all_values() -> None:
    """Each state is one; where nothing is known yet it is another one."""
    explorer = SituationExplorer(make_world(lamps(late), {}), BUILT_IN, Bounds(restarts=False))
    assert explore(explorer).progress.situations == 2 * 3 - 1  # in B it is known
    assert explore(explorer, open_values=False).progress.situations == 3 * 3 - 1


def test_a_value_that_leads_on_is_open_under_a_hold() -> None:
    """There nothing follows from it before the release."""
    states = {"A": {"always": {"target": "B", "guard": late}}, "B": {}, "FAULT": {}}
    of = chart(states, inputs={"late": {"type": BOOL, "initial": False}}, holds={"pause": PAUSE})
    assert explored(of, restarts=False).progress.situations == 4
    exact = explored(of, open_values=False, restarts=False)
    assert exact.progress.situations == 5  # B does not look at it


def test_what_is_live_after_one_text_alone_is_not_live_where_another_one_is_set() -> None:
    """The number is looked at in B after `left` only: of A, LEFT and B after `left` there are two each."""

    def counts(env: Any) -> bool:
        return bool(env["context"]["way"] == "left" and env["context"]["n"] > 0)

    other = {"do": [("set", {"n": lambda env: 1 - env["context"]["n"]})]}
    to_b = {
        way: {"target": "B", "do": [("set", {"way": lambda _, way=way: way})]} for way in ("left", "right")
    }
    states = {
        "A": {"on": {"operator.resume": other, "operator.dock": "LEFT", "operator.skip_current": "RIGHT"}},
        "LEFT": {"on": {"operator.reset": to_b["left"]}},
        "RIGHT": {"on": {"operator.reset": to_b["right"]}},
        "B": {"on": {"operator.abort": [{"target": "A", "guard": counts}, {"target": "RIGHT"}]}},
        "FAULT": {},
    }
    found = explored(chart(states, context={"way": "left", "n": 0}), restarts=False)
    assert found.progress.situations == 2 + 2 + 2 + 1 + 1


def test_which_way_leads_on_may_depend_on_a_value() -> None:
    """Each of two situations leads on by the other one, with one value each: the exact walk tells that."""
    explorer = SituationExplorer(make_world(lamps(late), {}), BUILT_IN, Bounds(restarts=False))
    silence = next(one for one in OF_THE_GRAPH if one.name == SILENCE)
    assert silence.broken(Graph(explore(explorer))).any()
    assert not silence.broken(Graph(explore(explorer, open_values=False))).any()
    assert _proven(lamps(late), SILENCE).verdict is ProofVerdict.HOLDS


def test_a_doubt_that_remains_is_told() -> None:
    """Where the exact walk is stopped; of steps everything was looked at."""
    proof = prove(
        make_world(lamps(late), {}),
        Bounds(restarts=False),
        lambda progress: "too many" if progress.situations > 5 else "",
    )
    verdicts = {one.name: one.verdict for one in proof.properties}
    assert verdicts["no_execution_error"] is ProofVerdict.HOLDS
    assert verdicts[SILENCE] is ProofVerdict.NOT_PROVEN
    assert (proof.complete, proof.stopped) == (False, "too many")


def _proven(of: Chart, name: str) -> Proven:
    proof = prove(make_world(of, {}), Bounds(restarts=False))
    return next(one for one in proof.properties if one.name == name)


@pytest.mark.parametrize(
    ("guard", "moves"),
    [(late, ("late = true", "time is up in A")), (early, ("time is up in A",))],
)
def test_what_must_be_told_is_part_of_the_story(guard: Any, moves: tuple[str, ...]) -> None:
    """What is so already is not."""
    never = {"never B": lambda env: not env["in_state"](["B"])}
    found = _proven(lamps(guard, initial=False, invariants=never), "invariants")
    assert found.verdict is ProofVerdict.BROKEN
    assert found.moves == moves
    assert found.steps is not None
