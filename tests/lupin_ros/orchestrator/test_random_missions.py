"""A hundred missions by chance, each of which passes the checker, started by one orchestrator in turn."""

from __future__ import annotations

import json
import random
import time
from pathlib import Path

import pytest

from lupin_engine.errors import ChartError
from tests.lupin_ros.world import PATIENCE, Operator, World
from tests.workbench.lupin_verify.toys import LIFECYCLE, random_mission

MISSIONS = 100
#: A mission is over after a moment, whatever it does with requests.
SHORT = LIFECYCLE.replace("    slot: mission\n", "    slot: mission\n    after: {100 ms: READY}\n")
#: Declarations of parameters that the checker accepts, for a mission to draw from.
PARAMETERS = (
    {"type": "bool", "default": True},
    {"type": "integer", "default": -1, "min": -(2**53 - 1)},
    {"type": "number", "default": 0.5, "max": 1},
    {"type": "text", "default": "2"},
    {"type": "duration", "default": "2 min"},
    {"type": "pose", "default": {"x": "1 m", "y": "0 m", "yaw": "90 deg"}},
    {"type": "tag", "default": {"id": "1"}},
    {"type": "date", "default": "2026-11-22"},
    {"type": "list of text", "default": []},
    {"type": "set of length", "default": ["1 m", "2 m"]},
    {"type": "any", "default": 3},
    {"type": "list of tag", "default": []},
)


def drop_mission(seed: int, folder: Path) -> bool:
    """Write the mission of a seed into the folder, with parameters; tell whether the checker accepts it."""
    dice = random.Random(seed)
    params = {f"p{n}": dice.choice(PARAMETERS) for n in range(dice.randint(0, 2))}
    try:
        random_mission(seed, folder, f"params: {json.dumps(params)}\n")
    except ChartError:
        return False
    return True


def start(operator: Operator, mission: str) -> None:
    """Start a mission, asked again until the one before is over."""
    end = time.monotonic() + PATIENCE
    while not (answer := operator.start(mission=mission)).accepted:
        assert time.monotonic() < end, f"{mission}: {answer.error_message}"


@pytest.mark.timeout(600)
def test_what_the_checker_accepts_is_started(world: World, operator: Operator, tmp_path: Path) -> None:
    """Each is a new file in the folder of an orchestrator that runs; its parameters are those of the file."""
    folder, aside = tmp_path / "missions", tmp_path / "aside"
    folder.mkdir()
    aside.mkdir()
    (folder / "lifecycle.yaml").write_text(SHORT, encoding="utf-8")
    accepted = (seed for seed in range(10 * MISSIONS) if drop_mission(seed, aside))
    for count in range(MISSIONS):
        seed = next(accepted)
        text = (aside / "chance.yaml").read_text(encoding="utf-8")
        # Of a name of its own: where a file cannot be used, an orchestrator keeps the mission that it had.
        (aside / "new").write_text(
            text.replace("mission: Chance", f"mission: Chance{seed}"), encoding="utf-8"
        )
        (aside / "new").replace(folder / "chance.yaml")
        if not count:
            world.start("mission_orchestrator", missions_path=folder)
        start(operator, f"Chance{seed}")
    assert world.processes["mission_orchestrator"].poll() is None
