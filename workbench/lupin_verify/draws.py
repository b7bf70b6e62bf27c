"""Draws a random world for each seed: targets and the times of events. Servers draw at each call."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from lupin_engine.machine import EvaluationScope, Memory, World, identity_of, read_request
from lupin_engine.sim import Between, Happening, Script
from lupin_verify.rates import Rates


def pool_of(world: World, mission: str) -> tuple[str, tuple[Any, ...]]:
    """Return the field of a request that lists targets, and its default targets; empty if none does.

    They are as a request has them: the names of things that a plugin reads, anything else as it is.
    """
    asked = {"mission_type": mission}
    values, refusal = read_request(world, asked, EvaluationScope(world, Memory()).at("", 0.0))
    for name, value in values.items() if refusal is None else ():
        if isinstance(value, list) and value:
            try:
                names = tuple(identity_of(item) for item in value)
            except ValueError:
                continue
            kind = world.chart.missions[mission].request[name].type.item
            return name, names if kind is None or kind.name in world.readers else tuple(value)
    return "", ()


def draw(rates: Rates, seed: int, pool: tuple[str, Sequence[Any]]) -> Script:
    """Return the world of a seed; it is the same on every machine."""
    dice = random.Random(f"campaign/{seed}")
    script = rates.script
    happenings = [*script.happenings, *_by_chance(rates, dice)]
    request = {**script.request, **_targets(rates, dice, *pool)}
    return replace(script, request=request, happenings=tuple(happenings), seed=script.seed + seed)


def _targets(rates: Rates, dice: random.Random, field: str, known: Sequence[Any]) -> dict[str, Any]:
    if not field or field in rates.script.request:
        return {}
    fewest, most = rates.targets or (1, len(known))
    number = dice.randint(min(fewest, len(known)), min(most, len(known)))
    return {field: dice.sample(list(known), number)}


def _by_chance(rates: Rates, dice: random.Random) -> Iterator[Happening]:
    for chance in rates.chances:
        time = dice.expovariate(1.0 / chance.every)
        while time < rates.script.limit:
            for wait, effect in chance.effects:
                after = wait.draw(dice) if isinstance(wait, Between) else wait
                yield Happening(effect, round(time + after, 3))
            time += dice.expovariate(1.0 / chance.every)
